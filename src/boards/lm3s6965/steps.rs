//! The step interrupt: pops an event, writes pins, sets the next compare.
//!
//! Timer 1 runs one shot at a time, from one event to the next. Each shot is shortened by how late its start is
//! against the planned instant, read from SysTick, so that delays never add up: the planned time between
//! two events holds over any number of them. Timer 2 ends the pulses, and its handler counts the steps that
//! wait. Where they are few it sets a third one off that lengthens the event in work, if the machine would else be
//! too fast. All have one priority, so none comes in between another.
//!
//! Events wait until the queue is half full or the planner has nothing to add and sleeps, so that
//! a motion does not begin with one event and starve.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::machine::{EventRing, Pulser, PulserState, Solenoid, StepQueue, Tick};
use penup::motion::{EventQueue, StepEvent, TICKS_PER_SECOND};
use static_cell::ConstStaticCell;

use super::pins::{AxisPins, MotorPins, PenPin};
use super::registers::{SYSTEM_CONTROL, TIMER1, TIMER2};
use super::{HAPPENED, clock, critical};
use crate::boards::handler::Owned;

/// Events that wait for the interrupt, at most; one more place than that, for the queue. 4 bytes
/// each. At the default speed of travel, 100 mm/s, the machine stops within 500 steps.
const EVENT_PLACES: usize = 624;

const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));

/// The main loop turns after this many cycles (2.5 ms) or events, so that it does not for every step
/// and yet keeps the queue full.
const TURN_CYCLES: u32 = clock::HERTZ / 400;
const TURN_EVENTS: usize = 30;

mod offset {
    pub const CONFIGURATION: usize = 0x000;
    pub const MODE_A: usize = 0x004;
    pub const CONTROL: usize = 0x00C;
    pub const INTERRUPT_MASK: usize = 0x018;
    pub const INTERRUPT_CLEAR: usize = 0x024;
    pub const INTERVAL_LOAD_A: usize = 0x028;
    /// In system control.
    pub const TIMER_CLOCKS: usize = 0x104;
}
const TIMER_CLOCKS: u32 = 0b11 << 17;
const ALL_32_BITS: u32 = 0;
const ONE_SHOT: u32 = 1;
const ENABLE: u32 = 1;
const TIMED_OUT: u32 = 1;

/// Those of the handlers. That of no timer has the least number: it comes before the others.
const STEP: Interrupt = Interrupt::TIMER_1A;
const PULSE: Interrupt = Interrupt::TIMER_2A;
const BRAKE: Interrupt = Interrupt::TIMER_0B;
const _: () = assert!((BRAKE as u16) < (STEP as u16) && (BRAKE as u16) < (PULSE as u16));

/// An event is never lengthened by more, 0.15 s, so that early can be told from late.
const MOST_MORE_TICKS: u32 = TICKS_PER_SECOND * 3 / 20;

static RING: ConstStaticCell<EventRing<EVENT_PLACES>> = ConstStaticCell::new(EventRing::new());
static STEPPER: Owned<Stepper> = Owned::empty();

/// What the interrupt has done, for the main loop.
pub static STATE: PulserState = PulserState::new();

/// The handlers' end.
struct Stepper {
    pulser: Pulser<'static, AxisPins, Solenoid<PenPin>, EVENT_PLACES>,
    /// What SysTick, counting down, is to show when the event in work ends; modulo 2^24.
    due: u32,
}

/// The main loop's end.
pub struct Steps {
    events: StepQueue<'static, EVENT_PLACES>,
    /// When the main loop's last turn was over, in cycles modulo 2^24.
    turned: u32,
}

/// Readies the timers; they start with the first events.
pub fn set_up(pins: MotorPins, nvic: &mut NVIC) -> Steps {
    SYSTEM_CONTROL.set_bits(offset::TIMER_CLOCKS, TIMER_CLOCKS);
    // The timers answer three cycles after their clock is on; a read takes longer.
    SYSTEM_CONTROL.read(offset::TIMER_CLOCKS);
    for timer in [TIMER1, TIMER2] {
        timer.write(offset::CONTROL, 0);
        timer.write(offset::CONFIGURATION, ALL_32_BITS);
        timer.write(offset::MODE_A, ONE_SHOT);
        timer.write(offset::INTERRUPT_MASK, TIMED_OUT);
    }

    let (pulser, events) = Pulser::new(pins.axes, Solenoid(pins.pen), RING.take(), &STATE);
    let stepper = Stepper { pulser, due: 0 };
    // SAFETY: the interrupts are masked since reset, and this runs once (the ring's cell sees to it).
    unsafe { STEPPER.fill(stepper) };
    for interrupt in [STEP, PULSE, BRAKE] {
        critical::enable(nvic, interrupt, critical::STEP_PRIORITY);
    }
    Steps { events, turned: 0 }
}

impl Steps {
    /// Lets waiting events begin.
    pub fn start(&mut self) {
        if !self.events.is_empty() && self.events.is_stopped() {
            // SAFETY: no handler is active, and none is wanted: there is nothing to do for them.
            cortex_m::interrupt::free(|_| unsafe { STEPPER.get_filled() }.begin());
        }
    }

    /// Lets the interrupt run before the event in work is over: the pins were halted.
    pub fn start_now(&mut self) {
        NVIC::pend(STEP);
    }

    /// Tells the main loop what has been done.
    pub fn sync_consumed(&mut self) {
        self.events.sync_consumed();
    }

    /// The main loop has had its turn.
    pub fn end_turn(&mut self) {
        self.turned = clock::cycles_24();
    }

    /// Whether enough has passed since for another.
    pub fn wants_turn(&self) -> bool {
        let passed = clock::cycles_24().wrapping_sub(self.turned) & clock::CYCLE_MASK;
        self.events.taken() > TURN_EVENTS || passed > TURN_CYCLES
    }

    /// No event waits, and the last is over.
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
    /// The first event is due.
    fn begin(&mut self) {
        if self.pulser.begin() {
            TIMER2.write(offset::INTERVAL_LOAD_A, STATE.pulse_ticks() * CYCLES_PER_TICK);
            self.due = clock::count_down();
            NVIC::pend(STEP);
        }
    }

    /// One event. No loop, no division, no lock.
    ///
    /// The worst of each handler, counted in QEMU from its first instruction to its last, built for size: 58 for an event of a
    /// move (59 of the pen, 76 where a motor lifts it), 51 for the end of its pulses (28 while the queue holds the stopping
    /// distance), 59 for a piece of the brake (47 at each step where the queue does not hold it). So a move takes 86, and at
    /// most some 160 where few steps wait; that its steps get another length is an event more, and three pieces.
    /// `host-tests/tests/qemu_interrupt.rs` holds these figures.
    #[inline(always)]
    fn step(&mut self) {
        let now = clock::count_down();
        // Late by less than 0.16 s, so the top bit of 24 tells early from late.
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

    /// It is early: the event in work was lengthened, or an alarm calls.
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

    /// A piece of what keeps a queue that runs dry from stopping the machine with a jerk.
    #[inline(always)]
    fn brake(&mut self) {
        let (is_due, more) = self.pulser.brake();
        // The timer goes on as it was set, and is set again when it is over.
        self.due = self.due.wrapping_sub(more.min(MOST_MORE_TICKS) * CYCLES_PER_TICK);
        if is_due {
            NVIC::pend(BRAKE);
        }
    }
}

#[cold]
#[inline(never)]
fn rest() {
    TIMER1.write(offset::CONTROL, 0);
    HAPPENED.store(true, Ordering::Relaxed);
}

/// Calls for the next event after so many cycles, at least 1.
#[inline(always)]
fn run_for(cycles: u32) {
    TIMER1.write(offset::INTERVAL_LOAD_A, cycles);
    TIMER1.write(offset::CONTROL, ENABLE);
}

/// Stops the timers for good, in a fault.
pub fn halt() {
    for timer in [TIMER1, TIMER2] {
        timer.write(offset::CONTROL, 0);
    }
    NVIC::mask(STEP);
}

/// The next event.
#[interrupt]
fn TIMER_1A() {
    TIMER1.write(offset::INTERRUPT_CLEAR, TIMED_OUT);
    // SAFETY: one of the handlers that own it, and of the same priority; it was filled before they
    // were unmasked.
    unsafe { STEPPER.get_filled() }.step();
}

/// The pulses end.
#[interrupt]
fn TIMER_2A() {
    TIMER2.write(offset::INTERRUPT_CLEAR, TIMED_OUT);
    // An emulator's trace tells the time of the pins by what was read here last.
    clock::count_down();
    // SAFETY: as above.
    if unsafe { STEPPER.get_filled() }.pulser.end_pulses() {
        NVIC::pend(BRAKE);
    }
}

/// Few steps wait, or they get another length.
#[interrupt]
fn TIMER_0B() {
    // SAFETY: as above.
    unsafe { STEPPER.get_filled() }.brake();
}
