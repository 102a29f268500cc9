//! The step interrupt: pops an event, writes pins, sets the next compare.
//!
//! Timer 0 runs one shot at a time. Each shot is shortened by how late its start is against the
//! planned instant, read from SysTick, so that delays never add up: the planned time between two
//! events holds over any number of them.
//!
//! Events wait until the queue is half full or the planner has nothing to add and sleeps, so that
//! a motion does not begin with one event and starve.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::Queue;
use lm3s6965::{Interrupt, interrupt};
use penup::machine::{Pulser, PulserState, Solenoid, StepQueue};
use penup::motion::{EventQueue, StepEvent, TICKS_PER_SECOND};
use static_cell::StaticCell;

use super::pins::{AxisPins, MotorPins, PenPin};
use super::registers::{SYSTEM_CONTROL, TIMER0};
use super::{HAPPENED, clock, critical};
use crate::boards::handler::Owned;

/// Events that wait for the interrupt, at most; one more place than that, for the queue. 4 bytes
/// each. At the default speed of travel, 100 mm/s, the machine stops within 500 steps.
const EVENT_PLACES: usize = 624;

const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));

/// The main loop turns after this many ticks (2.5 ms) or events, so that it does not for every step
/// and yet keeps the queue full.
const TURN_TICKS: u32 = 62_500;
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
const TIMER_0_CLOCK: u32 = 1 << 16;
const ALL_32_BITS: u32 = 0;
const ONE_SHOT: u32 = 1;
const ENABLE: u32 = 1;
const TIMED_OUT: u32 = 1;

static QUEUE: StaticCell<Queue<StepEvent, EVENT_PLACES>> = StaticCell::new();
static STEPPER: Owned<Stepper> = Owned::empty();
/// From the first event until the last one is over.
static RUNNING: AtomicBool = AtomicBool::new(false);

/// What the interrupt has done, for the main loop.
pub static STATE: PulserState = PulserState::new();

/// The handler's end.
struct Stepper {
    pulser: Pulser<'static, AxisPins, Solenoid<PenPin>>,
    /// When the present event was planned to begin, in cycles modulo 2^24.
    began: u32,
    running: bool,
}

/// The main loop's end.
pub struct Steps {
    events: StepQueue<'static>,
    /// As the main loop's last turn left it: places that were free, and ticks that had passed.
    room: usize,
    ticks: u32,
}

/// Readies the timer; it starts with the first events.
pub fn set_up(pins: MotorPins, nvic: &mut NVIC) -> Steps {
    SYSTEM_CONTROL.set_bits(offset::TIMER_CLOCKS, TIMER_0_CLOCK);
    // The timer answers three cycles after its clock is on; a read takes longer.
    SYSTEM_CONTROL.read(offset::TIMER_CLOCKS);
    TIMER0.write(offset::CONTROL, 0);
    TIMER0.write(offset::CONFIGURATION, ALL_32_BITS);
    TIMER0.write(offset::MODE_A, ONE_SHOT);
    TIMER0.write(offset::INTERRUPT_MASK, TIMED_OUT);

    let queue = QUEUE.init(Queue::new());
    let (pulser, events) = Pulser::new(pins.axes, Solenoid(pins.pen), queue, &STATE);
    let stepper = Stepper { pulser, began: 0, running: false };
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe { STEPPER.fill(stepper) };
    critical::enable(nvic, Interrupt::TIMER_0A, critical::STEP_PRIORITY);
    Steps { events, room: 0, ticks: 0 }
}

impl Steps {
    /// Lets waiting events begin.
    pub fn start(&mut self) {
        if !self.events.is_empty() && !RUNNING.load(Ordering::Acquire) {
            NVIC::pend(Interrupt::TIMER_0A);
        }
    }

    /// Lets the interrupt run before the event in work is over: the pins were halted.
    pub fn start_now(&mut self) {
        NVIC::pend(Interrupt::TIMER_0A);
    }

    /// The main loop has had its turn.
    pub fn end_turn(&mut self) {
        self.room = self.events.room();
        self.ticks = STATE.ticks();
    }

    /// Whether enough has passed since for another.
    pub fn wants_turn(&self) -> bool {
        self.events.room() > self.room + TURN_EVENTS
            || STATE.ticks().wrapping_sub(self.ticks) > TURN_TICKS
    }

    /// No event waits, and the last is over.
    pub fn idle(&self) -> bool {
        self.events.is_empty() && !RUNNING.load(Ordering::Acquire)
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
    /// One event. No loop, no division, no lock.
    ///
    /// Counted in QEMU, built for size, from the handler's first instruction to its last: 93 for the
    /// call that raises a move's pulses, 116 for the one that lowers them, of which the brake is 45;
    /// 15 more where it binds, and 60 where the steps get another length.
    #[inline(always)]
    fn pulse(&mut self) {
        let now = clock::cycles_24();
        // Late by less than 0.16 s, so the top bit of 24 tells early from late.
        let mut late = now.wrapping_sub(self.began) & clock::CYCLE_MASK;
        if !self.running || late > clock::CYCLE_MASK / 2 {
            if self.running && self.keeps_pulse(clock::CYCLE_MASK + 1 - late) {
                return;
            }
            (self.began, late, self.running) = (now, 0, true);
            RUNNING.store(true, Ordering::Release);
        }
        let Some(ticks) = self.pulser.tick() else {
            self.running = false;
            RUNNING.store(false, Ordering::Release);
            HAPPENED.store(true, Ordering::Relaxed);
            return;
        };
        let cycles = ticks * CYCLES_PER_TICK;
        let left = if cycles > late { cycles - late } else { 1 };
        TIMER0.write(offset::INTERVAL_LOAD_A, left);
        TIMER0.write(offset::CONTROL, ENABLE);
        self.began = self.began.wrapping_add(cycles);
    }

    /// Only an alarm calls before the time. A pulse keeps its width all the same: it has `cycles` to
    /// go.
    #[cold]
    #[inline(never)]
    fn keeps_pulse(&self, cycles: u32) -> bool {
        let high = self.pulser.pulse_is_high();
        if high {
            TIMER0.write(offset::INTERVAL_LOAD_A, cycles);
            TIMER0.write(offset::CONTROL, ENABLE);
        }
        high
    }
}

/// Stops the timer for good, in a fault.
pub fn halt() {
    TIMER0.write(offset::CONTROL, 0);
    NVIC::mask(Interrupt::TIMER_0A);
}

#[interrupt]
fn TIMER_0A() {
    TIMER0.write(offset::INTERRUPT_CLEAR, TIMED_OUT);
    // SAFETY: this is the handler that owns it.
    if let Some(stepper) = unsafe { STEPPER.get() } {
        stepper.pulse();
    }
}
