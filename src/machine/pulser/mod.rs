//! The step interrupt: takes events from the queue, sets the pins, and reports the counts to the
//! main loop.
//!
//! [`Pulser`] is the interrupt's side, [`StepQueue`] that of the main loop. Between them lie the
//! events ([`EventRing`]) and the orders and counts ([`PulserState`]).

mod pins;
mod queue;
mod ring;
mod state;

pub use pins::{Axes, PinOrder, Pins};
pub use queue::StepQueue;
pub use ring::EventRing;
use state::Halt;
pub use state::PulserState;

use super::Pen;
use crate::motion::{EventKind, StepBrake, StepEvent};
use core::sync::atomic::Ordering;

/// The work of the step interrupt: it takes step events from the queue, sets the pins as they say,
/// and brakes where few wait.
///
/// A step takes two calls: [`Pulser::tick`] raises the step pins, and [`Pulser::end_pulses`] lowers
/// them. Some more calls of [`Pulser::brake`] follow where the queue may run empty at speed. There
/// is no division, no loop and no lock. The time that the interrupt takes is documented and
/// measured in the boards' modules.
#[derive(Debug)]
pub struct Pulser<'q, A, P, const N: usize> {
    /// The pins of the motors.
    axes: A,
    /// The servo or solenoid that moves the pen.
    pen: P,
    /// The queue from which events are taken.
    ring: &'q EventRing<N>,
    /// The state that is shared with the main loop: its orders, and the counts for it.
    state: &'q PulserState,
    /// The ticks from the current event to the next.
    ticks: u32,
    /// Prevents an abrupt stop at speed when the queue runs empty.
    brake: StepBrake,
}

/// What [`Pulser::tick`] found in the queue, and so what the interrupt must do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tick {
    /// A step event has begun, and its pins are set.
    Begun {
        /// The time at which the next event is due, in ticks after this event was due.
        ticks: u32,
        /// Whether [`Pulser::end_pulses`] must be called [`PulserState::pulse_ticks`] from now.
        pulses: bool,
    },
    /// The word was no step event, but information about later ones. [`Pulser::brake`] is due at
    /// once, then the next tick.
    Told,
    /// The queue is empty or the machine is halted. The current event was the last.
    Over,
}

impl<'q, A: Axes, P: Pen, const N: usize> Pulser<'q, A, P, N> {
    /// Creates a pulser at rest, and the main loop's end of its queue. The pins do not change until
    /// the first event.
    pub fn new(
        axes: A,
        pen: P,
        ring: &'q mut EventRing<N>,
        state: &'q PulserState,
    ) -> (Self, StepQueue<'q, N>) {
        let ring = &*ring;
        state.set_queue(StepQueue::<N>::EVENTS as u32);
        let pulser = Self { axes, pen, ring, state, ticks: 0, brake: StepBrake::new() };
        (pulser, StepQueue::new(ring, state, A::ORDER))
    }

    /// Prepares for the first event after a rest. Call it before the first event, and again after
    /// [`Tick::Over`]. Returns whether there is anything to do.
    pub fn begin(&mut self) -> bool {
        let has_work = !self.ring.is_empty() || self.is_halted();
        if has_work {
            self.ring.set_running(true);
        }
        has_work
    }

    /// Takes the next event from the queue and sets the pins as it says.
    #[inline(always)]
    pub fn tick(&mut self) -> Tick {
        const RARE: u32 = (StepEvent::LENGTH | StepEvent::PEN) as u32;
        if self.is_halted() {
            self.stop();
            return Tick::Over;
        }
        let Some(word) = self.ring.take() else {
            self.run_dry();
            return Tick::Over;
        };
        let ticks = word >> 8;
        if word & RARE == 0 {
            self.axes.set(word);
            self.ticks = ticks;
            return Tick::Begun { ticks, pulses: word & u32::from(A::ORDER.pulses) != 0 };
        }
        let event = StepEvent::from_bits(word);
        if event.is_told() {
            self.brake.tell(event);
            return Tick::Told;
        }
        match event.kind() {
            EventKind::Pen { height } => self.pen.set_height(height),
            EventKind::Lift { step, down } => {
                self.axes.set_z_axis(step, down != self.state.z_is_inverted());
                return Tick::Begun { ticks, pulses: step };
            }
            // These events were handled above.
            EventKind::Levels(_) => {}
        }
        Tick::Begun { ticks, pulses: false }
    }

    /// Whether the pulses are halted. No other data is read because of this flag, so it needs no
    /// memory ordering.
    #[inline(always)]
    pub fn is_halted(&self) -> bool {
        self.state.halt.load(Ordering::Relaxed) != Halt::None as u8
    }

    /// Ends the pulses of an event. Returns whether [`Pulser::brake`] is due at once.
    #[inline(always)]
    pub fn end_pulses(&mut self) -> bool {
        self.axes.end_pulses();
        self.brake.step(&self.state.brake)
    }

    /// Does a part of the brake's work. Returns whether another call is due, and by how many ticks
    /// the current event must last longer than planned. With fewer steps waiting, the machine would
    /// otherwise be too fast to stop within them.
    #[inline(always)]
    pub fn brake(&mut self) -> (bool, u32) {
        let (is_due, least) = self.brake.work(&self.state.brake);
        (is_due, least.saturating_sub(self.ticks))
    }

    /// Returns the ticks of the event between the current one and the next step, or 0. It is
    /// a change of direction, or an order to the pen while the machine moves. They count as well
    /// where the current event is lengthened.
    pub fn wait_behind(&self) -> u32 {
        let others = A::ORDER.pulses | StepEvent::AT_REST | StepEvent::LENGTH | StepEvent::PEN;
        match self.ring.peek() {
            Some(word) if word as u8 & others == 0 => word >> 8,
            #[cfg(feature = "pen-overlap")]
            Some(word) if word as u8 & StepEvent::PEN != 0 => word >> 8,
            _ => 0,
        }
    }

    /// Raises the pen at once, because the main loop has halted the pulses. No event follows the
    /// current one.
    #[cold]
    #[inline(never)]
    pub fn stop(&mut self) {
        self.pen.set_height(self.state.up_height());
        self.state.halt.store(Halt::Done as u8, Ordering::Relaxed);
        self.brake.stop();
        self.ring.set_running(false);
    }

    /// Records that the interrupt stops because the queue is empty. [`Pulser::begin`] starts it
    /// again.
    #[cold]
    #[inline(never)]
    fn run_dry(&mut self) {
        self.brake.rest();
        self.ring.set_running(false);
    }
}
