//! Steps by a PIO state machine that DMA feeds: no interrupt for a step, and no jitter.
//!
//! A word for the state machine is laid out as a step event: the levels of five neighbouring pins
//! in bits 0 to 4, where its program goes on in bits 5 to 7, the ticks from bit 8 on. The state
//! machine sets the pins, ends the pulse if there is one, and counts the ticks; every event takes its
//! ticks to the cycle.
//!
//! The words wait in a ring that the DMA channel reads in blocks: all that is there when the last
//! block ends is the next. Between two blocks the state machine lives on the words in its own queue.
//!
//! Should the main loop be late, the ring runs dry at speed. So the interrupt that hands the blocks
//! over looks at them: where [`Brake`] asks for more ticks, it hands over a copy with those, and the ring
//! keeps the planned ones. As long as enough waits behind a group of words, one look at the group will do.
//!
//! What the state machine has taken is read off the channel and told to the main loop's
//! [`PulserState`] whenever that loop turns. The pen's heights, and the steps of a motor that lifts it, wait in a
//! queue of their own, for a word has no place for them; an interrupt sets servo and pins.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use penup::machine::PulserState;
use penup::motion::{
    Brake, EventKind, EventQueue, QueueSize, Runner, StepEvent, StepLength, StepTrain, StepWay,
    TICKS_PER_SECOND,
};
use rp2040_hal::pac::{Interrupt, interrupt};
use static_cell::StaticCell;

use super::pins::FIRST_MOTOR_PIN;
use super::registers::{self, DMA, PIO0, reset};
use super::{clock, critical, lift, pen, words};
use crate::boards::handler::Owned;

/// Words of the ring, a power of two.
const WORDS: u32 = 2048;
/// Words that may still be on their way from the ring to the state machine, and those that waits may
/// take beyond one each.
const RESERVED: u32 = 16 + Runner::ROOM as u32 * WAIT_WORDS;
/// The machine is to stop within as many steps as are held by a ring half full: on long paths it is
/// always fuller.
const STOPPING_STEPS: u32 = WORDS / 2;
/// Words in a block that goes as planned, at most: the state machine's queue lasts while they are
/// looked at, some 45 cycles each.
const CALM_WORDS: u32 = 16;
/// Words in a block that is braked, at most: some 100 cycles each. The state machine's queue is as long, and
/// lasts 2000 cycles at 500,000 steps a second.
const BRAKED_WORDS: u32 = 8;
/// Of so many words, from a multiple of it on, there is a sum.
const GROUP: u32 = 16;
/// Groups in a block behind which enough waits, at most.
const FAR_GROUPS: u32 = 8;
/// It ends before its steps are known too early, when more may come: 2 ms.
const BRAKED_TICKS: u32 = TICKS_PER_SECOND / 500;
/// Steps with fewer ticks are braked some at a time: above 200,000 a second.
const FAST_TICKS: u32 = TICKS_PER_SECOND / 200_000;
/// A wait is so many words at most, of 2 ms if that is enough, for the same reason.
const WAIT_WORDS: u32 = 64;
/// Heights of the pen that wait, or two for each step of its motor, at most; one more place than that, for the queue.
const HEIGHTS: usize = 1024;
/// In the place of a height: the pins of the pen's motor take levels.
mod lift_levels {
    pub const MARK: u8 = 1 << 7;
    pub const STEP: u8 = 1;
    pub const DOWN: u8 = 1 << 1;
}

/// A pass of the counting loop is a tick.
const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(CYCLES_PER_TICK == 5 && clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));
/// Where the program goes on, in a word's place for it.
mod target {
    pub const MOVE_PEN: u32 = 0;
    pub const WAIT: u32 = 1 << 5;
    pub const PULSE: u32 = 6 << 5;
}
pub(super) use target::PULSE;
const TARGETS: u32 = 7 << 5;
/// Ticks that a word takes beyond its count, by its target; a pulse takes its width, too.
const WAIT_TICKS: u32 = 2;
const PEN_TICKS: u32 = 3;
const PULSE_TICKS: u32 = 2;
/// Ticks of a pulse beyond its count.
const WIDTH_TICKS: u32 = 2;

/// Registers of the PIO block and its state machine 0.
mod machine {
    pub const CONTROL: usize = 0x000;
    pub const FIFO_DEBUG: usize = 0x008;
    pub const FIFO_LEVEL: usize = 0x00C;
    pub const SEND: usize = 0x010;
    pub const FLAGS: usize = 0x030;
    pub const INSTRUCTIONS: usize = 0x048;
    pub const EXECUTION: usize = 0x0CC;
    pub const SHIFT: usize = 0x0D0;
    pub const ADDRESS: usize = 0x0D4;
    pub const INSTRUCTION: usize = 0x0D8;
    pub const PINS: usize = 0x0DC;
    pub const INTERRUPT_ENABLE: usize = 0x12C;
}
const ENABLE: u32 = 1;
const RESTART: u32 = 1 << 4;
const STALLED: u32 = 1 << 24;
const LEVEL: u32 = 0xF;
/// Flag 0, in the flags and among the interrupts.
const FLAG: u32 = 1;
const FLAG_INTERRUPT: u32 = 1 << 8;
const SHIFT_RIGHT_BOTH: u32 = 0b11 << 18;
/// The receiver's places are the sender's: 8 words.
const JOIN_SENDER: u32 = 1 << 30;

/// Instructions that the core hands to the state machine.
mod order {
    pub const JUMP_TO_START: u32 = super::START;
    /// The width of the pulses, from the queue to where the program looks for it.
    pub const PULL: u32 = 0x80A0;
    pub const KEEP_WIDTH: u32 = 0xA0C7;
    pub const PULL_WITHOUT_WAITING: u32 = 0x8080;
    pub const SET_PINS: u32 = 0xE000;
    pub const SET_DIRECTIONS: u32 = 0xE080;
}

/// Registers of channel 0 of the direct memory access, and of all.
mod channel {
    pub const READ_ADDRESS: usize = 0x00;
    pub const WRITE_ADDRESS: usize = 0x04;
    pub const COUNT: usize = 0x08;
    /// Without a start.
    pub const CONTROL: usize = 0x10;
    /// Count, and starts.
    pub const START: usize = 0x1C;
    pub const INTERRUPT_ENABLE: usize = 0x404;
    pub const INTERRUPT: usize = 0x40C;
    pub const ABORT: usize = 0x444;
}
const CHANNEL: u32 = 1;
const BUSY: u32 = 1 << 24;
/// Enabled, before other channels, words, reading on around the ring, no chain, paced by `SEND`.
const FEED: u32 = 1 | 1 << 1 | 2 << 2 | 1 << 4 | size_of::<Ring>().trailing_zeros() << 6;

#[repr(align(8192))] // Its size, or the channel would not find around.
struct Ring([AtomicU32; WORDS as usize]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

static RING: Ring = Ring([const { AtomicU32::new(0) }; WORDS as usize]);
/// Of each word of the ring that is a step: `around` of [`StepWay`] in the lower half, `behind` in the
/// upper one; 0 for other words.
static WAYS: [AtomicU32; WORDS as usize] = [const { AtomicU32::new(0) }; WORDS as usize];

/// For each group of words how many units were queued up to its end; wraps.
static SUMS: [AtomicU32; (WORDS / GROUP) as usize] =
    [const { AtomicU32::new(0) }; (WORDS / GROUP) as usize];

#[repr(align(64))] // Its size, so that the channel finds no end of a ring in it.
struct Block([AtomicU32; BRAKED_WORDS as usize]);
const _: () = assert!(align_of::<Block>() == size_of::<Block>());

/// The block that is braked.
static BRAKED: Block = Block([const { AtomicU32::new(0) }; BRAKED_WORDS as usize]);
static BRAKE: Owned<Brake> = Owned::empty();
/// The last block was braked. Written where the channel's interrupt is masked.
static BRAKING: AtomicBool = AtomicBool::new(false);
/// Words put into the ring; wraps. The main loop alone writes it.
static WRITTEN: AtomicU32 = AtomicU32::new(0);
/// Words that the channel was told to take; wraps. Written where the channel's interrupt is masked.
static TOLD: AtomicU32 = AtomicU32::new(0);
/// Words of a block that was given up, which the channel's count still shows. Written where the channel's interrupt
/// is masked.
static GIVEN_UP: AtomicU32 = AtomicU32::new(0);
/// A block is under way. Written where the channel's interrupt is masked.
static FEEDING: AtomicBool = AtomicBool::new(false);

static HEIGHT_QUEUE: StaticCell<Queue<u8, HEIGHTS>> = StaticCell::new();
static HEIGHTS_DUE: Owned<Consumer<'static, u8>> = Owned::empty();

/// What the state machine has done, for the main loop.
pub static STATE: PulserState = PulserState::new();

/// Where the program waits for the next word.
const START: u32 = 3;
const LEVELS: u32 = 0x1F;
const PULSES: u32 = (StepEvent::STEP_X | StepEvent::STEP_Y) as u32;
/// Nothing pulsed, drivers off: their pin is active low.
const RELEASED: u32 = StepEvent::DRIVERS_ON as u32;

/// The main loop's end.
pub struct Steps {
    heights: Producer<'static, u8>,
    step_length: StepLength,
    /// As [`WRITTEN`].
    written: u32,
    /// How many more events fit: so many did when the state machine was last followed, less those
    /// that have come.
    room: u32,
    /// As [`flips`] and [`PulserState::pulse_ticks`], which hold while anything moves.
    flips: u32,
    pulse_ticks: u32,
    /// What a pulse at each of the levels adds to x (in the lower half) and to y.
    moves: [u32; LEVELS as usize + 1],
    /// The pins' levels after the last word.
    levels: u32,
    /// The sum of the words counted so far; all wrap.
    taken: u32,
    steps: (i32, i32),
    slack: (i32, i32),
    ticks: u32,
    /// Something follows the last event.
    moving: bool,
    drained: bool,
    /// It has taken nothing since it was drained, or since an underrun.
    resting: bool,
    /// How many words were taken, and when that was first seen, in microseconds.
    taken_seen: u32,
    seen_at: u32,
}

/// Readies state machine and channel; they start with the first events. The pins are outputs
/// afterwards, drivers off.
pub fn set_up(nvic: &mut NVIC) -> Steps {
    registers::restart(reset::PIO0 | reset::DMA);
    let program = pio::pio_asm!(
        ".origin 0",
        "move_pen:",
        "    irq set 0 [4]",
        "rest:",
        "    out x, 24",
        "count:",
        "    jmp x-- count [4]",
        "start:",
        "    pull block",
        "    out pins, 5",
        "    out pc, 3 [1]",
        "pulse:",
        "    mov x, isr [1]",
        "high:",
        "    jmp x-- high [4]",
        "    set pins, 0 [1]",
        "    jmp rest",
    );
    for (index, &instruction) in program.program.code.iter().enumerate() {
        PIO0.write(machine::INSTRUCTIONS + 4 * index, u32::from(instruction));
    }
    const WRAP_AT_END: u32 = 31 << 12;
    PIO0.write(machine::EXECUTION, WRAP_AT_END);
    PIO0.write(machine::SHIFT, SHIFT_RIGHT_BOTH | JOIN_SENDER);
    set_pins(RELEASED);
    PIO0.write(machine::INTERRUPT_ENABLE, FLAG_INTERRUPT);
    order(order::JUMP_TO_START);

    DMA.write(channel::READ_ADDRESS, ring_address(0));
    DMA.write(channel::WRITE_ADDRESS, PIO0.address(machine::SEND));
    DMA.write(channel::CONTROL, FEED);
    DMA.write(channel::INTERRUPT_ENABLE, CHANNEL);

    let (heights, due) = HEIGHT_QUEUE.init(Queue::new()).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe {
        HEIGHTS_DUE.fill(due);
        BRAKE.fill(Brake::default());
    }
    STATE.set_queue(QueueSize { steps: STOPPING_STEPS, full: WORDS - RESERVED });
    critical::enable(nvic, Interrupt::DMA_IRQ_0, critical::STEP_PRIORITY);
    critical::enable(nvic, Interrupt::PIO0_IRQ_0, critical::PEN_PRIORITY);
    Steps {
        heights,
        step_length: StepLength::default(),
        written: 0,
        room: 0,
        flips: 0,
        pulse_ticks: 0,
        moves: [0; LEVELS as usize + 1],
        levels: RELEASED,
        taken: 0,
        steps: (0, 0),
        slack: (0, 0),
        ticks: 0,
        moving: false,
        drained: true,
        resting: true,
        taken_seen: 0,
        seen_at: 0,
    }
}

fn order(instruction: u32) {
    PIO0.write(machine::INSTRUCTION, instruction);
}

/// Makes the pins outputs of these levels, at once. The program sets pulses only.
fn set_pins(levels: u32) {
    let first = FIRST_MOTOR_PIN;
    let pins = |set: u32| set.count_ones() << 26 | LEVELS.count_ones() << 20 | first << 5 | first;
    PIO0.write(machine::PINS, pins(LEVELS));
    order(order::SET_PINS | levels);
    order(order::SET_DIRECTIONS | LEVELS);
    PIO0.write(machine::PINS, pins(PULSES));
}

/// Lets the state machine begin, with pulses of that width. Its queue is empty.
fn begin(pulse_ticks: u32) {
    PIO0.write(machine::CONTROL, RESTART);
    PIO0.write(machine::SEND, pulse_ticks.saturating_sub(WIDTH_TICKS));
    order(order::PULL);
    order(order::KEEP_WIDTH);
    order(order::JUMP_TO_START);
    PIO0.write(machine::CONTROL, ENABLE);
}

fn place(word: u32) -> &'static AtomicU32 {
    &RING.0[(word % WORDS) as usize]
}

/// Up to `count` words from `word` on, as far as they lie in a row.
fn row(word: u32, count: u32) -> &'static [AtomicU32] {
    let start = word % WORDS;
    &RING.0[start as usize..(start + count).min(WORDS) as usize]
}

fn ring_address(word: u32) -> u32 {
    place(word).as_ptr() as u32
}

fn way(word: u32) -> &'static AtomicU32 {
    &WAYS[(word % WORDS) as usize]
}

/// The sum of the group that ends before `word`.
fn sum(word: u32) -> &'static AtomicU32 {
    &SUMS[(word / GROUP) as usize % SUMS.len()]
}

fn pack(way: StepWay) -> u32 {
    way.around | way.behind << 16
}

fn unpack(way: u32) -> StepWay {
    StepWay { around: way & 0xFFFF, behind: way >> 16 }
}

impl Steps {
    /// Lets waiting words begin.
    pub fn start(&mut self) {
        critical::with_steps_masked(|| {
            if !FEEDING.load(Ordering::Relaxed) {
                feed();
            }
        });
    }

    /// Whether the state machine gets on: it has nothing to do, or takes its next word before the
    /// longest event could be over twice.
    pub fn gets_on(&mut self) -> bool {
        const LONGEST: u32 = 2 * (StepEvent::MAX_TICKS / (TICKS_PER_SECOND / 1_000_000));
        let now = clock::microseconds();
        let taken = taken();
        if self.drained || taken != self.taken_seen {
            self.taken_seen = taken;
            self.seen_at = now;
        }
        now.wrapping_sub(self.seen_at) <= LONGEST
    }

    /// Counts what the state machine has taken since, and tells the main loop's state.
    #[inline(never)]
    pub fn follow(&mut self) {
        if STATE.is_halted() {
            self.throw_away();
            pen::set_height(0);
        }
        let taken = taken();
        if self.drained && self.written == self.taken {
            self.configure();
        }
        let was_drained = self.drained;
        let was_resting = self.resting;
        let began = taken != self.taken;
        self.count_to(taken);
        let stalled = PIO0.read(machine::FIFO_DEBUG) & STALLED != 0;
        let waits = PIO0.read(machine::ADDRESS) == order::JUMP_TO_START;
        self.drained = stalled && waits && taken == self.written;
        if self.drained && !was_drained {
            heal_pen();
        }
        if stalled && began {
            PIO0.write(machine::FIFO_DEBUG, STALLED);
        }
        self.resting = self.drained || (was_resting && !began);
        // Until it begins, and when that is first seen, the flag may be from before.
        if stalled && !was_resting && (self.moving || !self.drained) {
            STATE.note_underrun();
            self.moving = false;
            self.resting = true;
        }
        STATE.report_slack(self.slack);
        STATE.report(self.steps, self.ticks, self.drained);
        let waiting = self.written.wrapping_sub(self.taken);
        let words = (WORDS - RESERVED).saturating_sub(waiting);
        self.room = words.min((HEIGHTS - 1 - self.heights.len()) as u32);
    }

    /// Takes the settings over; they change only while nothing moves.
    fn configure(&mut self) {
        let flips = flips();
        if flips != self.flips {
            self.flips = flips;
            for (levels, packed) in (0..).zip(&mut self.moves) {
                let (dx, dy) = StepEvent::from_bits(levels ^ flips).step();
                *packed = dx.wrapping_add(dy << 16).cast_unsigned();
            }
        }
        let pulse_ticks = STATE.pulse_ticks();
        if pulse_ticks != self.pulse_ticks {
            self.pulse_ticks = pulse_ticks;
            begin(pulse_ticks);
        }
    }

    /// 14 cycles a pulse.
    fn count_to(&mut self, taken: u32) {
        let count = taken.wrapping_sub(self.taken);
        // A word on its way may be counted a moment early, so the count may seem to go back.
        if count > WORDS {
            return;
        }
        let (mut counted, mut pulses) = (0, 0);
        let (mut sums, mut slack) = ([0; 2], 0u32);
        let (mut ticks, mut waits, mut pens) = (0u32, 0, 0);
        while counted < count {
            let row = row(self.taken.wrapping_add(counted), count - counted);
            let in_row = words::count_pulses(row, &self.moves, &mut sums);
            pulses += in_row as u32;
            counted += in_row as u32;
            let Some(word) = row.get(in_row).map(|word| word.load(Ordering::Relaxed)) else {
                continue;
            };
            counted += 1;
            ticks = ticks.wrapping_add(word >> 8);
            if word & TARGETS == target::MOVE_PEN {
                pens += 1;
            } else {
                waits += 1;
                if word & PULSES != 0 {
                    slack = slack.wrapping_add(self.moves[(word & LEVELS) as usize]);
                }
            }
        }
        let [steps, pulse_ticks] = sums;
        let beyond =
            waits * WAIT_TICKS + pens * PEN_TICKS + pulses * (PULSE_TICKS + self.pulse_ticks);
        self.ticks = self.ticks.wrapping_add(ticks).wrapping_add(pulse_ticks).wrapping_add(beyond);
        add_packed(&mut self.steps, steps);
        add_packed(&mut self.slack, slack);
        self.taken = taken;
    }

    /// Stops at once, and forgets what waits.
    fn throw_away(&mut self) {
        if self.drained && self.written == self.taken {
            return;
        }
        critical::with_steps_masked(|| {
            PIO0.write(machine::CONTROL, 0);
            DMA.write(channel::INTERRUPT_ENABLE, 0);
            DMA.write(channel::ABORT, CHANNEL);
            while DMA.read(channel::CONTROL) & BUSY != 0 {}
            DMA.write(channel::INTERRUPT, CHANNEL);
            DMA.write(channel::INTERRUPT_ENABLE, CHANNEL);
            let taken = taken();
            self.count_to(taken);
            set_pins(self.levels_now() & !PULSES);
            while PIO0.read(machine::FIFO_LEVEL) & LEVEL != 0 {
                order(order::PULL_WITHOUT_WAITING);
            }
            // SAFETY: the handler that owns it is masked.
            if let Some(brake) = unsafe { BRAKE.get() } {
                brake.skip_all(STATE.brake());
            }
            self.written = taken;
            WRITTEN.store(taken, Ordering::Relaxed);
            TOLD.store(taken, Ordering::Relaxed);
            GIVEN_UP.store(DMA.read(channel::COUNT), Ordering::Relaxed);
            FEEDING.store(false, Ordering::Relaxed);
            begin(self.pulse_ticks);
        });
        heal_pen();
        self.levels = self.levels_now() & !PULSES;
        self.moving = false;
        self.drained = true;
        self.resting = true;
    }

    /// The levels of the last word counted.
    fn levels_now(&self) -> u32 {
        place(self.taken.wrapping_sub(1)).load(Ordering::Relaxed) & LEVELS
    }
}

impl EventQueue for Steps {
    fn room(&self) -> usize {
        self.room as usize
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.room = self.room.checked_sub(1).ok_or(event)?;
        let (word, beyond) = match event.kind() {
            EventKind::Pen { height } => {
                self.heights.enqueue(height).map_err(|_| event)?;
                self.moving = false;
                (self.levels | target::MOVE_PEN, PEN_TICKS)
            }
            EventKind::Lift { step, down } => {
                self.moving = true;
                return self.push_lift(step, down, event);
            }
            EventKind::Levels(levels) => {
                self.moving = levels & StepEvent::AT_REST == 0;
                let pins = (u32::from(levels) & LEVELS) ^ self.flips;
                self.levels = pins & !PULSES;
                if event.is_slack() {
                    return self.push_slack(pins, event.ticks());
                }
                if pins & PULSES == 0 {
                    (pins | target::WAIT, WAIT_TICKS)
                } else {
                    (pins | target::PULSE, PULSE_TICKS + self.pulse_ticks)
                }
            }
        };
        // Without a rule nothing is told, and nothing counted.
        let is_told = event.is_step() && STATE.brake().is_on();
        let step = if is_told { self.step_length.step() } else { StepWay::default() };
        if word & TARGETS == target::PULSE {
            self.put(word, event.ticks().saturating_sub(beyond), step);
        } else {
            self.put_wait(word, beyond, event.ticks());
        }
        self.publish();
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        if units != self.step_length.last() {
            self.step_length.set(units, after_next);
        }
        Ok(())
    }

    /// 17 cycles a step; more if it may be braked.
    fn push_train(&mut self, train: &mut StepTrain, count: u32) -> Result<(), StepEvent> {
        let Some(room) = self.room.checked_sub(count) else {
            return train.push_each(count, |event| self.push(event));
        };
        let beyond = (PULSE_TICKS + self.pulse_ticks) << 8;
        let flips = self.flips | target::PULSE;
        train.convert(|event| (event ^ flips).wrapping_sub(beyond));
        let mut done = 0;
        while done < count {
            let row = row(self.written.wrapping_add(done), count - done);
            words::write_train(train, row);
            done += row.len() as u32;
        }
        let word = place(self.written.wrapping_add(count - 1)).load(Ordering::Relaxed);
        train.convert(|word| word.wrapping_add(beyond) ^ flips);
        if STATE.brake().is_on() {
            self.tell_ways(count);
        }
        self.room = room;
        self.written = self.written.wrapping_add(count);
        self.levels = word & LEVELS & !PULSES;
        self.moving = true;
        self.publish();
        Ok(())
    }
}

impl Steps {
    /// A word that takes `beyond` ticks beside its count, and waits behind it: `ticks` in all.
    fn put_wait(&mut self, word: u32, beyond: u32, mut ticks: u32) {
        let step = StepWay::default();
        if ticks <= BRAKED_TICKS {
            self.put(word, ticks.saturating_sub(beyond), step);
            return;
        }
        let part = (ticks / WAIT_WORDS).max(BRAKED_TICKS);
        self.put(word, part - beyond, step);
        ticks -= part;
        while ticks > 0 {
            let part = if ticks < 2 * part { ticks } else { part };
            self.put(self.levels | target::WAIT, part - WAIT_TICKS, step);
            ticks -= part;
        }
    }

    /// The pen's motor: its pulse lasts half of the event, so that the handler is never two levels behind.
    fn push_lift(&mut self, step: bool, down: bool, event: StepEvent) -> Result<(), StepEvent> {
        use lift_levels::{DOWN, MARK, STEP};
        let pins = MARK | if down { DOWN } else { 0 };
        let word = self.levels | target::MOVE_PEN;
        let mut ticks = event.ticks();
        if step {
            self.room = self.room.saturating_sub(1);
            self.heights.enqueue(pins | STEP).map_err(|_| event)?;
            let high = (ticks / 2).min(BRAKED_TICKS);
            self.put_wait(word, PEN_TICKS, high);
            ticks -= high;
        }
        self.heights.enqueue(pins).map_err(|_| event)?;
        self.put_wait(word, PEN_TICKS, ticks);
        self.publish();
        Ok(())
    }

    /// A pulse that is none for the state machine, so that it is counted apart: a wait while the pins
    /// are high, and one while they are low.
    fn push_slack(&mut self, pins: u32, ticks: u32) -> Result<(), StepEvent> {
        self.room = self.room.saturating_sub(1);
        let low = ticks.saturating_sub(self.pulse_ticks);
        for (levels, ticks) in [(pins, self.pulse_ticks), (self.levels, low)] {
            let count = ticks.saturating_sub(WAIT_TICKS);
            self.put(levels | target::WAIT, count, StepWay::default());
        }
        self.publish();
        Ok(())
    }

    /// The next words are so many steps, fewer than there are places.
    #[inline(never)] // On its own it stays in the core's registers.
    fn tell_ways(&mut self, count: u32) {
        if let Some(step) = self.step_length.steady() {
            return self.tell_same_ways(step, count);
        }
        let mut queued = STATE.brake().queued();
        for number in 0..count {
            let word = self.written.wrapping_add(number);
            let step = self.step_length.step();
            way(word).store(pack(step), Ordering::Relaxed);
            queued = queued.wrapping_add(step.around);
            let next = word.wrapping_add(1);
            if next.is_multiple_of(GROUP) {
                sum(next).store(queued, Ordering::Relaxed);
            }
        }
        STATE.brake().set_queued(queued);
    }

    /// The same where all have the same way: a few cycles a step.
    fn tell_same_ways(&self, step: StepWay, count: u32) {
        let packed = pack(step);
        let first = (self.written % WORDS) as usize;
        let (around, behind) = WAYS.split_at(first);
        let before_end = behind.len().min(count as usize);
        let ways = [&behind[..before_end], &around[..count as usize - before_end]];
        for part in ways {
            for way in part {
                way.store(packed, Ordering::Relaxed);
            }
        }
        let queued = STATE.brake().queued();
        let mut number = GROUP - self.written % GROUP;
        while number <= count {
            let units = queued.wrapping_add(step.around * number);
            sum(self.written.wrapping_add(number)).store(units, Ordering::Relaxed);
            number += GROUP;
        }
        STATE.brake().set_queued(queued.wrapping_add(step.around * count));
    }

    fn put(&mut self, word: u32, count: u32, step: StepWay) {
        place(self.written).store(word | count << 8, Ordering::Relaxed);
        way(self.written).store(pack(step), Ordering::Relaxed);
        self.written = self.written.wrapping_add(1);
        STATE.brake().add(step.around);
        if self.written.is_multiple_of(GROUP) {
            sum(self.written).store(STATE.brake().queued(), Ordering::Relaxed);
        }
    }

    /// Shows the words to the channel; lets them begin if they are many.
    fn publish(&mut self) {
        WRITTEN.store(self.written, Ordering::Release);
        if FEEDING.load(Ordering::Relaxed) {
            return;
        }
        // What has begun goes on at once.
        if !self.drained || self.written.wrapping_sub(self.taken) >= WORDS / 2 {
            self.start();
        }
    }
}

/// The bits in which the pins' levels differ from an event's: drivers are on while their pin is low,
/// and high direction counts up, unless inverted.
fn flips() -> u32 {
    const DOWN: u8 = StepEvent::DOWN_X | StepEvent::DOWN_Y;
    RELEASED | u32::from(DOWN ^ STATE.inverted() << 2)
}

/// Adds the halves, each within ±2^11, so that they part again.
fn add_packed((x, y): &mut (i32, i32), packed: u32) {
    let dx = i32::from(packed as u16 as i16);
    *x = x.wrapping_add(dx);
    *y = y.wrapping_add(packed.wrapping_sub(dx.cast_unsigned()).cast_signed() >> 16);
}

/// How many words have left the channel and the state machine's queue.
fn taken() -> u32 {
    critical::with_steps_masked(|| {
        loop {
            let left = DMA.read(channel::COUNT);
            let waiting = PIO0.read(machine::FIFO_LEVEL) & LEVEL;
            if left == DMA.read(channel::COUNT) {
                let to_come = left - GIVEN_UP.load(Ordering::Relaxed) + waiting;
                return TOLD.load(Ordering::Relaxed).wrapping_sub(to_come);
            }
        }
    })
}

/// Tells the channel what to take next. Called where its interrupt is masked.
fn feed() {
    let told = TOLD.load(Ordering::Relaxed);
    let count = WRITTEN.load(Ordering::Acquire).wrapping_sub(told);
    FEEDING.store(count != 0, Ordering::Relaxed);
    // SAFETY: this is the handler that owns it, or the handler is masked.
    let Some(brake) = (unsafe { BRAKE.get() }) else { return };
    if count == 0 {
        return;
    }
    let (mut address, mut words) = (ring_address(told), count);
    if STATE.brake().is_on() {
        words = far_words(brake, told, count);
        // What had to be braked goes on so, and is not looked at twice.
        if words == 0 && !BRAKING.load(Ordering::Relaxed) {
            words = calm_words(brake, told, count);
        }
        if words == 0 {
            words = brake_evenly(brake, told, count);
            if words == 0 {
                words = brake_words(brake, told, count);
            }
            address = BRAKED.0.as_ptr() as u32;
        }
    }
    TOLD.store(told.wrapping_add(words), Ordering::Relaxed);
    GIVEN_UP.store(0, Ordering::Relaxed);
    DMA.write(channel::READ_ADDRESS, address);
    DMA.write(channel::START, words);
}

/// How many of the `count` words from `told` on go as planned, since enough waits behind them, whatever they are.
fn far_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let group = told / GROUP;
    for groups in [FAR_GROUPS, 1] {
        let end = group.wrapping_add(groups).wrapping_mul(GROUP);
        let words = end.wrapping_sub(told);
        if words <= count && brake.pass_far(sum(end).load(Ordering::Relaxed), STATE.brake()) {
            return words;
        }
    }
    0
}

/// How many of the `count` words from `told` on go as planned, with one look at all of them; 0 if they
/// have to be looked at one by one.
#[inline(never)] // On its own it stays in the core's registers.
fn calm_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let (mut words, mut ticks) = (0, 0);
    let (mut around, mut longest, mut shortest) = (0, 0, u32::MAX);
    while words < count.min(CALM_WORDS) && ticks <= BRAKED_TICKS {
        let at = told.wrapping_add(words);
        let step = way(at).load(Ordering::Relaxed);
        let planned = place(at).load(Ordering::Relaxed) >> 8;
        if step != 0 {
            around += step & 0xFFFF;
            longest = longest.max(step >> 16);
            shortest = shortest.min(planned);
        }
        ticks += planned;
        words += 1;
    }
    if brake.pass(around, longest, shortest, STATE.brake()) { words } else { 0 }
}

/// Copies a block of the `count` words from `told` on, with the same least ticks for all: far from rest, where there is little
/// time. Says how many they are; 0 if that will not do.
#[inline(never)]
fn brake_evenly(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let is_fast = place(told).load(Ordering::Relaxed) >> 8 < FAST_TICKS;
    if count < BRAKED_WORDS || !is_fast {
        return 0;
    }
    let (mut around, mut longest) = (0, 0);
    for number in 0..BRAKED_WORDS {
        let step = way(told.wrapping_add(number)).load(Ordering::Relaxed);
        if step == 0 {
            return 0;
        }
        around += step & 0xFFFF;
        longest = longest.max(step >> 16);
    }
    let Some(least) = brake.pass_evenly(around, longest, STATE.brake()) else { return 0 };
    let least = least.saturating_sub(PULSE_TICKS + STATE.pulse_ticks()).min(StepEvent::MAX_TICKS);
    let mut is_braked = false;
    for (number, braked) in (0..).zip(&BRAKED.0) {
        let mut word = place(told.wrapping_add(number)).load(Ordering::Relaxed);
        if word >> 8 < least {
            word = least << 8 | word & 0xFF;
            is_braked = true;
        }
        braked.store(word, Ordering::Relaxed);
    }
    BRAKING.store(is_braked, Ordering::Relaxed);
    BRAKED_WORDS
}

/// Copies the first of the `count` words from `told` on, each step with as many ticks as it takes at
/// least. Says how many.
#[inline(never)]
fn brake_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let beyond = PULSE_TICKS + STATE.pulse_ticks();
    let (mut words, mut ticks, mut more) = (0, 0, 0);
    for (number, braked) in (0..count).zip(&BRAKED.0) {
        let at = told.wrapping_add(number);
        let mut word = place(at).load(Ordering::Relaxed);
        let step = way(at).load(Ordering::Relaxed);
        if step != 0 {
            let mut least = brake.step(unpack(step), STATE.brake());
            let planned = (word >> 8) + beyond;
            if least > planned && number + 1 < count {
                // What follows may be a wait between two steps.
                let next = place(at.wrapping_add(1)).load(Ordering::Relaxed);
                if next & TARGETS == target::WAIT {
                    least = least.saturating_sub((next >> 8) + WAIT_TICKS);
                }
            }
            more |= least.saturating_sub(planned);
            word += least.saturating_sub(planned).min(StepEvent::MAX_TICKS - (word >> 8)) << 8;
        }
        braked.store(word, Ordering::Relaxed);
        words += 1;
        ticks += word >> 8;
        if ticks > BRAKED_TICKS {
            break;
        }
    }
    BRAKING.store(more != 0, Ordering::Relaxed);
    words
}

/// Two heights that come faster than the interrupt would leave one behind: the last counts. Steps of the pen's
/// motor are left over only where all was thrown away.
fn heal_pen() {
    critical::with_steps_masked(|| {
        // SAFETY: the handler that owns it is masked.
        if let Some(due) = unsafe { HEIGHTS_DUE.get() } {
            while let Some(height) = due.dequeue() {
                if height & lift_levels::MARK == 0 {
                    pen::set_height(height);
                }
            }
            lift::end_pulse();
        }
    });
}

/// The pen's motor takes a direction, and a step if asked.
fn set_lift(step: bool, down: bool) {
    lift::set(step, down != STATE.lift_is_inverted());
    if step {
        STATE.count_lift(down);
    }
}

/// Stops for good with the drivers off, in a fault.
pub fn release() {
    PIO0.write(machine::CONTROL, 0);
    set_pins(RELEASED);
}

#[interrupt]
fn DMA_IRQ_0() {
    DMA.write(channel::INTERRUPT, CHANNEL);
    feed();
}

#[interrupt]
fn PIO0_IRQ_0() {
    PIO0.write(machine::FLAGS, FLAG);
    // SAFETY: this is the handler that owns it.
    if let Some(height) = unsafe { HEIGHTS_DUE.get() }.and_then(Consumer::dequeue) {
        if height & lift_levels::MARK == 0 {
            pen::set_height(height);
        } else {
            set_lift(height & lift_levels::STEP != 0, height & lift_levels::DOWN != 0);
        }
    }
}
