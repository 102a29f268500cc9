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

mod append;
mod engine;
mod feed;
mod heights;
mod waits;
mod word_ring;

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::NVIC;
use penup::board_table::PICO;
use penup::byte_queue::{ByteQueue, Producer};
use penup::machine::PulserState;
use penup::motion::{Brake, Runner, StepEvent, StepLength, TICKS_PER_SECOND};
use rp2040_hal::pac::Interrupt;

use super::registers::{DMA, Get, PIO0, Put};
use super::{clock, critical, pen, words};
use crate::boards::fault::once;
pub use engine::release;
use engine::{
    LEVEL, LEVELS, PEN_TICKS, PULSE_TICKS, PULSES, RELEASED, STALLED, TARGETS, WAIT_TICKS, begin,
    order, set_pins, target,
};
use feed::{ABANDONED, BRAKE, FEEDING, HANDED_OVER, WRITTEN, taken};
use heights::{HEIGHT_QUEUE, HEIGHTS_DUE, drain_heights};
use waits::WAIT_WORDS;
use word_ring::{WORDS, row, slot};

pub(super) use target::PULSE;

/// The words that may still be on their way from the ring to the state machine, and the additional
/// words that waits may take.
const RESERVED: u32 = 16 + Runner::ROOM as u32 * WAIT_WORDS;
/// The number of steps that wait on a long path.
const STOPPING_STEPS: u32 = WORDS - RESERVED;
const _: () = assert!(STOPPING_STEPS == PICO.memory.steps);
/// The duration, 2 ms, after which a block ends. A longer block would fix the times of its steps
/// too early, when more steps may still come.
const BRAKED_TICKS: u32 = TICKS_PER_SECOND / 500;
/// The state that the state machine's progress is reported to, for the main loop.
pub static STATE: PulserState = PulserState::new();

/// The main loop's side of the steps: it writes words to the ring and counts those that were taken.
pub struct Steps {
    /// The queue of the heights of the pen and the steps of its motor.
    heights: Producer<'static>,
    /// The lengths of the steps that will be appended, which the brake needs.
    step_length: StepLength,
    /// The number of words put into the ring; it wraps. It is the same as [`WRITTEN`].
    written: u32,
    /// The number of events that still fit: the number when the state machine's progress was last
    /// read, less the events that have come since.
    room: u32,
    /// The value of [`inverted_levels`], which does not change while anything moves.
    inverted_levels: u32,
    /// The value of [`PulserState::pulse_ticks`], which does not change while anything moves.
    pulse_ticks: u32,
    /// For each combination of levels, what a pulse adds to x (in the lower half) and to y (in the
    /// upper half).
    moves: [u32; LEVELS as usize + 1],
    /// The levels of the pins after the last word that was appended.
    levels: u32,
    /// The number of words counted so far; it wraps.
    taken: u32,
    /// The sum of the steps of the words counted so far, for x and y; it wraps.
    steps: (i32, i32),
    /// The sum of the steps counted so far that took up backlash; it wraps.
    backlash: (i32, i32),
    /// The sum of the ticks counted so far; it wraps.
    ticks: u32,
    /// Whether the machine is in motion after the last event.
    moving: bool,
    /// The number of words put into the ring when it was last allowed to run dry; it wraps.
    rest_end: u32,
    /// Whether the state machine has processed all words.
    drained: bool,
    /// Whether the state machine has taken nothing since it was drained, or since an underrun.
    resting: bool,
    /// The number of words taken when progress was last seen.
    taken_seen: u32,
    /// The time at which this number was first seen, in microseconds.
    seen_at: u32,
    /// Whether the pen is driven, which begins when its height is known.
    drives_pen: bool,
}

/// Sets up the state machine and the channel; they start with the first events. Afterwards the pins
/// are outputs and the drivers are off.
pub fn set_up(nvic: &mut NVIC) -> Steps {
    word_ring::clear();
    engine::set_up();

    let (heights, due) = once(HEIGHT_QUEUE.try_init(ByteQueue::new())).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell ensures
    // it).
    unsafe {
        HEIGHTS_DUE.fill(due);
        BRAKE.fill(Brake::default());
    }
    STATE.set_queue(STOPPING_STEPS);
    critical::enable(nvic, Interrupt::DMA_IRQ_0, critical::STEP_PRIORITY);
    critical::enable(nvic, Interrupt::PIO0_IRQ_0, critical::PEN_PRIORITY);
    Steps {
        heights,
        step_length: StepLength::default(),
        written: 0,
        room: 0,
        inverted_levels: 0,
        pulse_ticks: 0,
        moves: [0; LEVELS as usize + 1],
        levels: RELEASED,
        taken: 0,
        steps: (0, 0),
        backlash: (0, 0),
        ticks: 0,
        moving: false,
        rest_end: 0,
        drained: true,
        resting: true,
        taken_seen: 0,
        seen_at: 0,
        drives_pen: false,
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
            self.discard_waiting();
            pen::set_height(STATE.up_height());
        }
        let taken = taken();
        if self.drained && self.written == self.taken {
            self.configure();
        }
        let was_drained = self.drained;
        let was_resting = self.resting;
        let began = taken != self.taken;
        // Words may have come behind a rest in which the ring has run dry.
        let passes_rest = self.rest_end.wrapping_sub(self.taken) <= taken.wrapping_sub(self.taken);
        self.count_to(taken);
        let stalled = PIO0.fdebug().get() & STALLED != 0;
        let waits = PIO0.sm(0).sm_addr().get() == u32::from(engine::START);
        self.drained = stalled && waits && taken == self.written;
        if self.drained && !was_drained {
            drain_heights();
        }
        if stalled && began {
            PIO0.fdebug().put(STALLED);
        }
        self.resting = self.drained || (was_resting && !began);
        // Before the state machine begins, and when its beginning is first seen, the flag may be
        // left from before.
        if stalled && !was_resting && !passes_rest && (self.moving || !self.drained) {
            STATE.note_underrun();
            self.moving = false;
            self.resting = true;
        }
        STATE.report_backlash(self.backlash);
        STATE.report(self.steps, self.ticks, self.drained);
        let waiting = self.written.wrapping_sub(self.taken);
        let words = (WORDS - RESERVED).saturating_sub(waiting);
        self.room = words.min(self.heights.room() as u32);
    }

    /// Adopts the settings, which change only while nothing moves. The first time, the pen begins
    /// to be driven, at the height at which it is raised.
    fn configure(&mut self) {
        if !core::mem::replace(&mut self.drives_pen, true) {
            pen::begin(STATE.up_height());
        }
        let inverted_levels = inverted_levels();
        if inverted_levels != self.inverted_levels {
            self.inverted_levels = inverted_levels;
            for (levels, packed) in (0..).zip(&mut self.moves) {
                let (dx, dy) = StepEvent::from_bits(levels ^ inverted_levels).step();
                *packed = dx.wrapping_add(dy << 16).cast_unsigned();
            }
        }
        let pulse_ticks = STATE.pulse_ticks();
        if pulse_ticks != self.pulse_ticks {
            self.pulse_ticks = pulse_ticks;
            begin(pulse_ticks);
        }
    }

    /// Adds up the steps and ticks of the words up to number `taken`. It takes 14 cycles per pulse.
    #[inline(never)]
    #[unsafe(link_section = ".data.in_ram")] // This leaves the flash's cache to the planner.
    fn count_to(&mut self, taken: u32) {
        let count = taken.wrapping_sub(self.taken);
        // A word in transit may be counted a moment early, so the count may seem to go back.
        if count > WORDS {
            return;
        }
        let (mut counted, mut pulses) = (0, 0);
        let (mut sums, mut backlash) = ([0; 2], 0u32);
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
                    backlash = backlash.wrapping_add(self.moves[(word & LEVELS) as usize]);
                }
            }
        }
        let [steps, pulse_ticks] = sums;
        let beyond =
            waits * WAIT_TICKS + pens * PEN_TICKS + pulses * (PULSE_TICKS + self.pulse_ticks);
        self.ticks = self.ticks.wrapping_add(ticks).wrapping_add(pulse_ticks).wrapping_add(beyond);
        add_packed(&mut self.steps, steps);
        add_packed(&mut self.backlash, backlash);
        self.taken = taken;
    }

    /// Stops at once, and discards the words that wait.
    fn discard_waiting(&mut self) {
        if self.drained && self.written == self.taken {
            return;
        }
        let taken = feed::stop();
        self.count_to(taken);
        set_pins(self.levels_now() & !PULSES);
        while PIO0.flevel().get() & LEVEL != 0 {
            order(order::PULL_WITHOUT_WAITING);
        }
        // SAFETY: the interrupt of the handler that owns it does not come now.
        if let Some(brake) = unsafe { BRAKE.get() } {
            brake.skip_all(STATE.brake());
        }
        self.written = taken;
        WRITTEN.store(taken, Ordering::Relaxed);
        HANDED_OVER.store(taken, Ordering::Relaxed);
        // SAFETY: its register is only read.
        let dma = unsafe { DMA.registers() };
        ABANDONED.store(dma.ch(0).ch_trans_count().get(), Ordering::Relaxed);
        FEEDING.store(false, Ordering::Relaxed);
        begin(self.pulse_ticks);
        // All of this must be written before the handler may run.
        compiler_fence(Ordering::SeqCst);
        feed::let_interrupt_come();
        drain_heights();
        self.levels = self.levels_now() & !PULSES;
        self.moving = false;
        self.drained = true;
        self.resting = true;
    }

    /// The levels of the pins in the last word counted.
    fn levels_now(&self) -> u32 {
        slot(self.taken.wrapping_sub(1)).load(Ordering::Relaxed) & LEVELS
    }
}

/// The bits in which the levels of the pins differ from those of an event. Drivers are on while
/// their pin is low, and a high direction pin counts up unless it is inverted.
fn inverted_levels() -> u32 {
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
