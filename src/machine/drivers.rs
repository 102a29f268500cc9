//! The drivers at rest: they are switched off when the machine has been at rest for a while (`$1`),
//! and on again by the first event of the next move.

use super::state::Activity;
use super::{Alarm, Machine, Setting};
use crate::motion::EventQueue;

/// The value of `$1` with which the drivers stay on.
const ALWAYS: u32 = 255;

impl Machine<'_> {
    /// How long the machine is to stand until the drivers are switched off, in milliseconds; `None`
    /// if they stay on, are off already, or the machine is not at rest.
    pub fn driver_rest(&self) -> Option<u32> {
        let milliseconds = self.settings.whole(Setting::StepIdleDelay);
        let has_moved = self.runner.ticks() != self.released_at;
        let is_at_rest = matches!(self.activity, Activity::Idle) && self.is_stopped();
        (milliseconds < ALWAYS && has_moved && is_at_rest).then_some(milliseconds)
    }

    /// Switches the drivers off. The position is kept, and with it the side of its backlash on
    /// which each motor is; a pen that a motor lifts may sink.
    pub fn release_drivers(&mut self, queue: &mut dyn EventQueue) {
        if self.runner.release_drivers(queue).is_err() {
            return self.alarm(Alarm::Queue);
        }
        self.released_at = self.runner.ticks();
        if self.settings.is_on(Setting::Tool) {
            self.runner.forget_lift();
        }
    }
}
