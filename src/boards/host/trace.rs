//! Pins and a pen that record their changes, and the library's interrupt code that runs on them.

use super::QUEUE_LENGTH;
use crate::machine::{EventRing, Pen, Pins, Pulser, PulserState, StepQueue, Tick};
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, OutputPin};
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::vec::Vec;

/// What changed at the pins or at the pen, and the new level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The step pin of x has this level now.
    StepX(bool),
    /// The step pin of y has this level now.
    StepY(bool),
    /// The direction pin of x has this level now; high counts up.
    UpX(bool),
    /// The direction pin of y has this level now; high counts up.
    UpY(bool),
    /// The enable pin of the motor drivers has this level now.
    Enable(bool),
    /// The height of the pen, from 0 (raised) to 127 (lowered).
    Pen(u8),
    /// The step pin of the motor that lifts the pen has this level now.
    StepZ(bool),
    /// The direction pin of the motor that lifts the pen has this level now; high lowers the pen.
    DownZ(bool),
}

/// A change and the time at which it happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamped {
    /// When it happened, in ticks (1/25,000,000 s) from the start.
    pub time: u64,
    /// Which pin or setting of the pen changed, and to what.
    pub change: Change,
}

/// The changes of all pins, in order. Writes that change nothing are not recorded.
#[derive(Debug, Default)]
pub struct Trace {
    /// The present time in ticks from the start.
    now: Cell<u64>,
    /// The changes so far, in the order in which they happened.
    changes: RefCell<Vec<Stamped>>,
}

impl Trace {
    /// Records that a pin or the pen changes at the present time.
    fn note(&self, change: Change) {
        self.changes.borrow_mut().push(Stamped { time: self.now.get(), change });
    }

    /// The present time in ticks from the start.
    pub fn now(&self) -> u64 {
        self.now.get()
    }

    /// Sets the present time, in ticks from the start.
    pub fn set_now(&self, now: u64) {
        self.now.set(now);
    }

    /// Returns a copy of all changes so far.
    pub fn changes(&self) -> Vec<Stamped> {
        self.changes.borrow().clone()
    }

    /// Returns the changes so far and removes them from the trace.
    pub fn take_changes(&self) -> Vec<Stamped> {
        self.changes.take()
    }
}

/// A simulated output pin that records its changes.
#[derive(Debug)]
pub struct TracedPin {
    /// The trace that records the changes.
    trace: Rc<Trace>,
    /// The present level; `None` before the first write.
    level: Option<bool>,
    /// Makes the change that is recorded for a level.
    change: fn(bool) -> Change,
}

impl ErrorType for TracedPin {
    type Error = Infallible;
}

impl TracedPin {
    /// Records the change to `level`, if this is not the level already.
    fn set(&mut self, level: bool) {
        if self.level.replace(level) != Some(level) {
            self.trace.note((self.change)(level));
        }
    }
}

impl OutputPin for TracedPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

/// A simulated pen that records to which heights it is moved.
#[derive(Debug)]
pub struct TracedPen {
    /// The trace that records the heights.
    trace: Rc<Trace>,
    /// The present height; `None` before the first one.
    height: Option<u8>,
}

impl Pen for TracedPen {
    fn set_height(&mut self, height: u8) {
        if self.height.replace(height) != Some(height) {
            self.trace.note(Change::Pen(height));
        }
    }
}

/// The library's interrupt code, running on traced pins.
type TracedPulser<'q> = Pulser<
    'q,
    Pins<TracedPin, TracedPin, TracedPin, TracedPin, TracedPin, TracedPin, TracedPin>,
    TracedPen,
    QUEUE_LENGTH,
>;

/// Calls the interrupt code at the times at which it is due.
#[derive(Debug)]
pub struct TracedSteps<'q> {
    /// The library's interrupt code, which runs here as on a board.
    pulser: TracedPulser<'q>,
    /// The numbers and requests that the interrupt code shares with the main loop.
    state: &'q PulserState,
    /// The trace of the pins, with the clock.
    trace: Rc<Trace>,
    /// The time at which the next event is due, in ticks from the start.
    due: Option<u64>,
    /// The time at which the present pulses end, in ticks from the start.
    pulses_end: Option<u64>,
}

/// Creates pins that record their changes in a trace, the interrupt code that writes them, and the
/// main loop's end of its queue.
pub fn traced_steps<'q>(
    ring: &'q mut EventRing<QUEUE_LENGTH>,
    state: &'q PulserState,
) -> (StepQueue<'q, QUEUE_LENGTH>, TracedSteps<'q>) {
    let trace = Rc::new(Trace::default());
    let pin = |change| TracedPin { trace: Rc::clone(&trace), level: None, change };
    let pins = Pins {
        step_x: pin(Change::StepX),
        direction_x: pin(Change::UpX),
        step_y: pin(Change::StepY),
        direction_y: pin(Change::UpY),
        enable: pin(Change::Enable),
        step_z: pin(Change::StepZ),
        direction_z: pin(Change::DownZ),
    };
    let pen = TracedPen { trace: Rc::clone(&trace), height: None };
    let (pulser, queue) = Pulser::new(pins, pen, ring, state);
    (queue, TracedSteps { pulser, state, trace, due: None, pulses_end: None })
}

impl TracedSteps<'_> {
    /// The recorded changes of the pins.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Makes the next event due now, if there is one, or if the pins were halted.
    pub fn step_now(&mut self) {
        if self.pulser.begin() {
            self.due = Some(self.trace.now());
        }
    }

    /// Advances the time to `end`, in ticks from the start. Everything that is due before it
    /// happens.
    pub fn pass_until(&mut self, end: u64) {
        if self.due.is_none() && self.trace.now() < end {
            self.step_now();
        }
        loop {
            let ends =
                self.pulses_end.filter(|&at| at < end && self.due.is_none_or(|due| at <= due));
            if let Some(at) = ends {
                self.trace.set_now(at);
                self.pulses_end = None;
                if self.pulser.end_pulses() {
                    self.brake();
                }
            } else if let Some(at) = self.due.filter(|&due| due < end) {
                self.trace.set_now(at);
                match self.pulser.tick() {
                    Tick::Begun { ticks, pulses } => {
                        self.due = Some(at + u64::from(ticks));
                        if pulses {
                            self.pulses_end = Some(at + u64::from(self.state.pulse_ticks()));
                        }
                    }
                    Tick::Told => self.brake(),
                    Tick::Over => self.due = None,
                }
            } else {
                break;
            }
        }
        self.trace.set_now(end);
    }

    /// Does what the brake has to do at once, and lets the current event last longer where it says
    /// so.
    fn brake(&mut self) {
        loop {
            let (is_due, more) = self.pulser.brake();
            let more = u64::from(more.saturating_sub(self.pulser.wait_behind()));
            self.due = self.due.map(|due| due + more);
            if !is_due {
                break;
            }
        }
    }
}
