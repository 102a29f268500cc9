//! The step interrupt: takes an event from the queue, writes the pins, and sets the timer for the
//! next event.
//!
//! Timer 1 runs in one-shot mode from one event to the next. Each shot is shortened by the delay of
//! its start after the planned instant, which is read from SysTick. So delays never add up: the
//! planned time between two events holds over any number of events. Timer 2 ends the pulses, and
//! its handler counts the steps that wait. Where there are few, it triggers a third interrupt,
//! which lengthens the current event if the machine would otherwise be too fast. All three
//! interrupts have the same priority, so none interrupts another.
//!
//! Events wait until the queue is half full, or until the planner has nothing to add and sleeps, so
//! that a motion does not begin with one event and then lack the next.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::machine::{EventRing, Pulser, PulserState, Solenoid, StepQueue, Tick};
use penup::motion::{EventQueue, StepEvent, TICKS_PER_SECOND};
use static_cell::ConstStaticCell;

use super::pins::{AxisPins, MotorPins, PenPin};
use super::registers::{SYSTEM_CONTROL, TIMER1, TIMER2};
use super::{HAPPENED, clock, critical};
use crate::boards::fault::once;
use crate::boards::handler::Owned;
use penup::board_table::LM3S6965;

/// The number of slots in the queue, one of which stays empty; each takes 4 bytes. At the default
/// travel speed, 100 mm/s, the machine stops within 500 steps.
const EVENT_PLACES: usize = LM3S6965.memory.steps as usize + 5;

/// The cycles of the core's clock in one tick, the unit of time of step events.
const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));

/// The main loop runs one turn after this many cycles (2.5 ms), or after [`TURN_EVENTS`] events. So
/// it does not run for every step, and yet it keeps the queue full.
const TURN_CYCLES: u32 = clock::HERTZ / 400;
/// The main loop runs one turn after this many events, if they come before [`TURN_CYCLES`] are
/// over.
const TURN_EVENTS: usize = 30;

/// The registers of a timer that are used here, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register that says whether the timer is one of 32 bits or two of 16 bits.
    pub const CONFIGURATION: Offset = Offset::new(0x000);
    /// The register that says what the timer does when its time is over.
    pub const MODE_A: Offset = Offset::new(0x004);
    /// The register that starts and stops the timer.
    pub const CONTROL: Offset = Offset::new(0x00C);
    /// The register that says, by one bit for each event of the timer, which events cause an
    /// interrupt.
    pub const INTERRUPT_MASK: Offset = Offset::new(0x018);
    /// The register that clears the interrupt of an event when the event's bit is written to it.
    pub const INTERRUPT_CLEAR: Offset = Offset::new(0x024);
    /// The register of the time from a start of the timer to its interrupt, in cycles.
    pub const INTERVAL_LOAD_A: Offset = Offset::new(0x028);
    /// The register of system control that switches the clocks of the timers on.
    pub const TIMER_CLOCKS: Offset = Offset::new(0x104);
}
/// The bits that switch the clocks of timers 1 and 2 on.
const TIMER_CLOCKS: u32 = 0b11 << 17;
/// What is written to [`offset::CONFIGURATION`] for a timer of 32 bits.
const ALL_32_BITS: u32 = 0;
/// What is written to [`offset::MODE_A`] for a timer that stops when its time is over.
const ONE_SHOT: u32 = 1;
/// The bit that starts a timer.
const ENABLE: u32 = 1;
/// The bit of the event that the time of a timer is over.
const TIMED_OUT: u32 = 1;

/// The interrupt of timer 1, at which the next step event begins.
const STEP: Interrupt = Interrupt::TIMER_1A;
/// The interrupt of timer 2, at which the step pulses end.
const PULSE: Interrupt = Interrupt::TIMER_2A;
/// The interrupt in which the brake does its work. It belongs to no timer that runs, and the
/// program triggers it. Its number is the lowest of the three, so it is served before the others.
const BRAKE: Interrupt = Interrupt::TIMER_0B;
const _: () = assert!((BRAKE as u16) < (STEP as u16) && (BRAKE as u16) < (PULSE as u16));

/// The greatest number of ticks by which an event is lengthened, 0.15 s. With this bound an early
/// call can be told from a late one.
const MOST_MORE_TICKS: u32 = TICKS_PER_SECOND * 3 / 20;

/// The memory of the queue in which step events wait for their interrupt.
static RING: ConstStaticCell<EventRing<EVENT_PLACES>> = ConstStaticCell::new(EventRing::new());
/// The handlers' end of the queue, which all three handlers use.
static STEPPER: Owned<Stepper> = Owned::empty();

/// What the step interrupts and the main loop share: orders to the first, and counts from them.
pub static STATE: PulserState = PulserState::new();

/// What the step interrupts own: the library's interrupt code, and when its next event is due.
struct Stepper {
    /// The library's part of the work: it takes the events and sets the pins.
    pulser: Pulser<'static, AxisPins, Solenoid<PenPin>, EVENT_PLACES>,
    /// The value that SysTick, which counts down, shows when the current event ends; modulo 2^24.
    due: u32,
}

/// The main loop's side of the steps: it puts events into the queue and starts the interrupts.
pub struct Steps {
    /// The main loop's end of the library's queue.
    events: StepQueue<'static, EVENT_PLACES>,
    /// The time at which the last turn of the main loop ended, in cycles modulo 2^24.
    turned: u32,
}

/// Sets up the timers. They start with the first events.
pub fn set_up(pins: MotorPins, nvic: &mut NVIC) -> Steps {
    SYSTEM_CONTROL.set_bits(offset::TIMER_CLOCKS, TIMER_CLOCKS);
    // The timers respond three cycles after their clock is on; this read takes longer.
    SYSTEM_CONTROL.read(offset::TIMER_CLOCKS);
    for timer in [TIMER1, TIMER2] {
        timer.write(offset::CONTROL, 0);
        timer.write(offset::CONFIGURATION, ALL_32_BITS);
        timer.write(offset::MODE_A, ONE_SHOT);
        timer.write(offset::INTERRUPT_MASK, TIMED_OUT);
    }

    let (pulser, events) =
        Pulser::new(pins.axes, Solenoid(pins.pen), once(RING.try_take()), &STATE);
    let stepper = Stepper { pulser, due: 0 };
    // SAFETY: the interrupts are masked since reset, and this runs once (the ring's cell ensures
    // it).
    unsafe { STEPPER.fill(stepper) };
    for interrupt in [STEP, PULSE, BRAKE] {
        critical::enable(nvic, interrupt, critical::STEP_PRIORITY);
    }
    Steps { events, turned: 0 }
}

impl Steps {
    /// Starts the interrupt if it does not run and has something to do: events wait, or the pins
    /// were halted.
    pub fn start(&mut self) {
        let has_work = !self.events.is_empty() || STATE.halt_is_due();
        if has_work && self.events.is_stopped() {
            // SAFETY: no handler is active, and none is wanted: there is nothing to do for them.
            cortex_m::interrupt::free(|_| unsafe { STEPPER.get_filled() }.begin());
        }
    }

    /// Makes the interrupt run before the current event ends, because the pins were halted.
    pub fn start_now(&mut self) {
        NVIC::pend(STEP);
    }

    /// Lets the main loop count the events that the interrupt has taken since the last call.
    pub fn sync_consumed(&mut self) {
        self.events.sync_consumed();
    }

    /// Records that the main loop has ended a turn, so that it can sleep until enough has happened.
    pub fn end_turn(&mut self) {
        self.turned = clock::cycles_24();
    }

    /// Whether enough time or enough events have passed since the last turn for another one.
    pub fn wants_turn(&self) -> bool {
        let passed = clock::cycles_24().wrapping_sub(self.turned) & clock::CYCLE_MASK;
        self.events.taken() > TURN_EVENTS || passed > TURN_CYCLES
    }

    /// Whether no event waits and the last one is over.
    pub fn idle(&self) -> bool {
        self.events.is_empty() && self.events.is_stopped()
    }
}

impl EventQueue for Steps {
    fn room(&self) -> usize {
        self.events.room()
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.events.push(event)?;
        if self.events.is_half_full() {
            self.start();
        }
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        self.events.set_step_length(units, after_next)
    }
}

impl Stepper {
    /// Starts the timers, because the first event is due.
    fn begin(&mut self) {
        if self.pulser.begin() {
            TIMER2.write(offset::INTERVAL_LOAD_A, STATE.pulse_ticks() * CYCLES_PER_TICK);
            self.due = clock::count_down();
            NVIC::pend(STEP);
        }
    }

    /// Processes one event, without a loop, a division or a lock.
    ///
    /// The worst case of each handler, in instructions counted in QEMU from its first instruction
    /// to its last in a build for size, is: 58 for an event of a move (59 for the pen, 76 where a
    /// motor lifts it); 51 for the end of its pulses (28 while the queue holds the stopping
    /// distance); 71 for one part of the brake's work (47 at each step where the queue does not
    /// hold the stopping distance). So a step takes 86, and at most some 160 where few steps wait.
    /// A change of the length of the steps takes one more event and four parts of the brake's work.
    /// `host-tests/tests/qemu_interrupt.rs` checks these figures.
    #[inline(always)]
    fn step(&mut self) {
        let now = clock::count_down();
        // The delay is less than 0.16 s, so the top bit of 24 tells early from late.
        let late = self.due.wrapping_sub(now) << 8;
        if late.cast_signed() < 0 {
            return self.wait_on(now);
        }
        match self.pulser.tick() {
            Tick::Begun { ticks, pulses } => {
                if pulses {
                    TIMER2.write(offset::CONTROL, ENABLE);
                }
                let (cycles, late) = (ticks * CYCLES_PER_TICK, late >> 8);
                run_for(if cycles > late { cycles - late } else { 1 });
                self.due = self.due.wrapping_sub(cycles);
            }
            Tick::Told => {
                NVIC::pend(BRAKE);
                NVIC::pend(STEP);
            }
            Tick::Over => rest(),
        }
    }

    /// Goes on waiting when the interrupt comes before the current event ends, because the event
    /// was lengthened, or stops, because an alarm has halted the pulses.
    #[cold]
    #[inline(never)]
    fn wait_on(&mut self, now: u32) {
        if self.pulser.is_halted() {
            self.pulser.stop();
            return rest();
        }
        let left = now.wrapping_sub(self.due) & clock::CYCLE_MASK;
        let behind = left.min(self.pulser.wait_behind() * CYCLES_PER_TICK);
        self.due = self.due.wrapping_add(behind);
        run_for((left - behind).max(1));
    }

    /// Does one part of the brake's work, which prevents an abrupt stop when the queue runs empty.
    #[inline(always)]
    fn brake(&mut self) {
        let (is_due, more) = self.pulser.brake();
        // The timer keeps its setting; when it expires, it is set again.
        self.due = self.due.wrapping_sub(more.min(MOST_MORE_TICKS) * CYCLES_PER_TICK);
        if is_due {
            NVIC::pend(BRAKE);
        }
    }
}

/// Stops the step timer, because the queue is empty or the machine is halted, and wakes the main
/// loop.
#[cold]
#[inline(never)]
fn rest() {
    TIMER1.write(offset::CONTROL, 0);
    HAPPENED.store(true, Ordering::Relaxed);
}

/// Sets the timer so that the next event comes after `cycles`, at least 1.
#[inline(always)]
fn run_for(cycles: u32) {
    TIMER1.write(offset::INTERVAL_LOAD_A, cycles);
    TIMER1.write(offset::CONTROL, ENABLE);
}

/// Stops the timers for good, after a fault.
pub fn halt() {
    for timer in [TIMER1, TIMER2] {
        timer.write(offset::CONTROL, 0);
    }
    NVIC::mask(STEP);
}

/// The interrupt of timer 1, at which the next step event is due.
#[interrupt]
fn TIMER_1A() {
    TIMER1.write(offset::INTERRUPT_CLEAR, TIMED_OUT);
    // SAFETY: one of the handlers that own it, and of the same priority; it was filled before they
    // were unmasked.
    unsafe { STEPPER.get_filled() }.step();
}

/// The interrupt for the end of the pulses.
#[interrupt]
fn TIMER_2A() {
    TIMER2.write(offset::INTERRUPT_CLEAR, TIMED_OUT);
    // This read has no effect on the machine. An emulator's trace takes the time of the pin changes
    // from it.
    clock::count_down();
    // SAFETY: as in `TIMER_1A`.
    if unsafe { STEPPER.get_filled() }.pulser.end_pulses() {
        NVIC::pend(BRAKE);
    }
}

/// The interrupt for the brake's work: few steps wait, or the length of the steps changes.
#[interrupt]
fn TIMER_0B() {
    // SAFETY: as in `TIMER_1A`.
    unsafe { STEPPER.get_filled() }.brake();
}
