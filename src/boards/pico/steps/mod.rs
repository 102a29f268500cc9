//! Generates steps by a PIO state machine that DMA feeds. There is no interrupt for each step, and
//! no jitter.
//!
//! A word for the state machine is laid out like a step event: the levels of five adjacent pins in
//! bits 0 to 4, the address at which its program continues in bits 5 to 7, and the ticks from bit 8
//! on. The state machine sets the pins, ends the pulse if there is one, and counts the ticks. Every
//! event takes exactly its ticks.
//!
//! The words wait in a ring that the DMA channel reads in blocks. When a block ends, all words that
//! wait then form the next one. Between two blocks the state machine runs on the words in its own
//! queue.
//!
//! If the main loop is late, the ring runs empty at speed. So the interrupt that hands over the
//! blocks examines them. Where [`Brake`] asks for more ticks, it hands over a copy with more ticks,
//! and the ring keeps the planned ones. As long as enough steps wait after a group of words, one
//! check for the group is enough.
//!
//! The progress of the state machine is read from the channel and reported to the main loop's
//! [`PulserState`] in every turn of that loop. The heights of the pen, and the steps of a motor
//! that lifts it, wait in a queue of their own, because a word has no room for them. An interrupt
//! sets the servo and the pins.

mod engine;
mod feed;
mod heights;
mod word_ring;

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Producer, Queue};
use penup::machine::PulserState;
use penup::motion::{
    Brake, EventKind, EventQueue, QueueSize, Runner, StepEvent, StepLength, StepTrain, StepWay,
    TICKS_PER_SECOND,
};
use rp2040_hal::pac::Interrupt;

use super::registers::{DMA, PIO0};
use super::{clock, critical, pen, words};
pub use engine::release;
use engine::{
    LEVEL, LEVELS, PEN_TICKS, PULSE_TICKS, PULSES, RELEASED, STALLED, TARGETS, WAIT_TICKS, begin,
    channel, machine, order, set_pins, target,
};
use feed::{BRAKE, FEEDING, GIVEN_UP, TOLD, WRITTEN, taken};
use heights::{HEIGHT_QUEUE, HEIGHTS, HEIGHTS_DUE, heal_pen, lift_levels};
use word_ring::{GROUP, WAYS, WORDS, pack, place, row, sum, way};

pub(super) use target::PULSE;

/// The words that may still be on their way from the ring to the state machine, and the additional
/// words that waits may take.
const RESERVED: u32 = 16 + Runner::ROOM as u32 * WAIT_WORDS;
/// The number of steps within which the machine must be able to stop: a half full ring. On long
/// paths the ring is always fuller.
const STOPPING_STEPS: u32 = WORDS / 2;
/// The duration, 2 ms, after which a block ends. A longer block would fix the times of its steps
/// too early, when more steps may still come.
const BRAKED_TICKS: u32 = TICKS_PER_SECOND / 500;
/// The greatest number of words of a wait. Each word lasts 2 ms if that is enough, for the same
/// reason.
const WAIT_WORDS: u32 = 64;

/// The state that the state machine's progress is reported to, for the main loop.
pub static STATE: PulserState = PulserState::new();

/// The main loop's end of the queue.
pub struct Steps {
    /// The queue of the heights of the pen and the steps of its motor.
    heights: Producer<'static, u8>,
    /// The lengths of the steps to come.
    step_length: StepLength,
    /// The same number as [`WRITTEN`].
    written: u32,
    /// The number of events that still fit: the number when the state machine's progress was last
    /// read, less the events that have come since.
    room: u32,
    /// The value of [`flips`], which does not change while anything moves.
    flips: u32,
    /// The value of [`PulserState::pulse_ticks`], which does not change while anything moves.
    pulse_ticks: u32,
    /// For each combination of levels, what a pulse adds to x (in the lower half) and to y (in the
    /// upper half).
    moves: [u32; LEVELS as usize + 1],
    /// The levels of the pins after the last word.
    levels: u32,
    /// The number of words counted so far; it wraps.
    taken: u32,
    /// The sum of the steps counted so far; it wraps.
    steps: (i32, i32),
    /// The sum of the steps counted so far that took up slack; it wraps.
    slack: (i32, i32),
    /// The sum of the ticks counted so far; it wraps.
    ticks: u32,
    /// Whether the machine is in motion after the last event.
    moving: bool,
    /// Whether the state machine has processed all words.
    drained: bool,
    /// Whether the state machine has taken nothing since it was drained, or since an underrun.
    resting: bool,
    /// The number of words taken when progress was last seen.
    taken_seen: u32,
    /// The time at which this number was first seen, in microseconds.
    seen_at: u32,
}

/// Sets up the state machine and the channel; they start with the first events. Afterwards the pins
/// are outputs and the drivers are off.
pub fn set_up(nvic: &mut NVIC) -> Steps {
    engine::set_up();

    let (heights, due) = HEIGHT_QUEUE.init(Queue::new()).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell ensures
    // it).
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

impl Steps {
    /// Starts the transfer of waiting words.
    pub fn start(&mut self) {
        feed::start();
    }

    /// Whether the state machine makes progress: it has nothing to do, or it takes its next word
    /// within twice the duration of the longest event.
    pub fn is_progressing(&mut self) -> bool {
        const LONGEST: u32 = 2 * (StepEvent::MAX_TICKS / (TICKS_PER_SECOND / 1_000_000));
        let now = clock::microseconds();
        let taken = taken();
        if self.drained || taken != self.taken_seen {
            self.taken_seen = taken;
            self.seen_at = now;
        }
        now.wrapping_sub(self.seen_at) <= LONGEST
    }

    /// Counts what the state machine has taken since the last call, and updates the state for the
    /// main loop.
    #[inline(never)]
    pub fn sync_consumed(&mut self) {
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
        // Before the state machine begins, and when its beginning is first seen, the flag may be
        // left from before.
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

    /// Adopts the settings, which change only while nothing moves.
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

    /// Counts the words up to number `taken`. It takes 14 cycles per pulse.
    #[inline(never)]
    #[unsafe(link_section = ".data.in_ram")] // This leaves the flash's cache to the planner.
    fn count_to(&mut self, taken: u32) {
        let count = taken.wrapping_sub(self.taken);
        // A word in transit may be counted a moment early, so the count may seem to go back.
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

    /// Stops at once, and discards the words that wait.
    fn throw_away(&mut self) {
        if self.drained && self.written == self.taken {
            return;
        }
        feed::stop();
        let taken = taken();
        self.count_to(taken);
        set_pins(self.levels_now() & !PULSES);
        while PIO0.read(machine::FIFO_LEVEL) & LEVEL != 0 {
            order(order::PULL_WITHOUT_WAITING);
        }
        // SAFETY: the interrupt of the handler that owns it does not come now.
        if let Some(brake) = unsafe { BRAKE.get() } {
            brake.skip_all(STATE.brake());
        }
        self.written = taken;
        WRITTEN.store(taken, Ordering::Relaxed);
        TOLD.store(taken, Ordering::Relaxed);
        GIVEN_UP.store(DMA.read(channel::COUNT), Ordering::Relaxed);
        FEEDING.store(false, Ordering::Relaxed);
        begin(self.pulse_ticks);
        // All of this must be written before the handler may run.
        compiler_fence(Ordering::SeqCst);
        feed::let_interrupt_come();
        heal_pen();
        self.levels = self.levels_now() & !PULSES;
        self.moving = false;
        self.drained = true;
        self.resting = true;
    }

    /// The levels of the pins in the last word counted.
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
        // Without a braking rule, no lengths are passed on or counted.
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

    /// Appends steps of a train. It takes 17 cycles per step, or more if the step may be braked.
    #[unsafe(link_section = ".data.in_ram")] // As above.
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
    /// Appends a word that takes `beyond` ticks besides its count, followed by waits, so that it
    /// takes `ticks` in all.
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

    /// Appends an event of the pen's motor. The pulse lasts half of the event, so that the handler
    /// is never two levels behind.
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

    /// Appends a pulse that takes up slack. For the state machine it is not a pulse, so that it is
    /// counted separately: it is a wait while the pins are high and another while they are low.
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

    /// Records the lengths of the next `count` words, which are steps. `count` is less than the
    /// size of the ring.
    #[inline(never)] // As a function of its own it needs only the core's registers.
    #[unsafe(link_section = ".data.in_ram")] // This leaves the flash's cache to the planner.
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

    /// Does the same where all steps have the same length, in a few cycles per step.
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

    /// Makes the words visible to the channel, and starts the transfer if there are many.
    fn publish(&mut self) {
        WRITTEN.store(self.written, Ordering::Release);
        // A handler that finds nothing more to transfer must either have seen these words, or its
        // result must be seen here.
        compiler_fence(Ordering::SeqCst);
        if FEEDING.load(Ordering::Relaxed) {
            return;
        }
        // If the state machine is already running, it continues at once.
        if !self.drained || self.written.wrapping_sub(self.taken) >= WORDS / 2 {
            self.start();
        }
    }
}

/// The bits in which the levels of the pins differ from those of an event. Drivers are on while
/// their pin is low, and a high direction pin counts up unless it is inverted.
fn flips() -> u32 {
    const DOWN: u8 = StepEvent::DOWN_X | StepEvent::DOWN_Y;
    RELEASED | u32::from(DOWN ^ STATE.inverted() << 2)
}

/// Adds the two halves of `packed` to the sums. Each half is within ±2^11, so that they can be
/// separated again.
fn add_packed((x, y): &mut (i32, i32), packed: u32) {
    let dx = i32::from(packed as u16 as i16);
    *x = x.wrapping_add(dx);
    *y = y.wrapping_add(packed.wrapping_sub(dx.cast_unsigned()).cast_signed() >> 16);
}
