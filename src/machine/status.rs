//! Reports the state and the progress of the machine.

use super::estimate::even_milliseconds;
use super::state::{Activity, Source};
use super::{JobSize, Machine, State, Value};
use crate::drawing::PagePoint;

/// What the status line reports about the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// What the machine is doing.
    pub state: State,
    /// The present position of the pins on the page, in steps.
    pub position: PagePoint,
    /// The size of the job; zero if none was started.
    pub job: JobSize,
    /// The part of the job that has been planned. It is ahead of the pins by at most the contents
    /// of the queue.
    pub done: JobSize,
    /// The estimated time for the rest of the job, in seconds.
    pub seconds_left: u32,
    /// The speed override, in percent of the speeds in the settings.
    pub percent: u8,
    /// The number of the pen that the machine waits for, if it does.
    pub pen_wanted: Option<u8>,
}

impl Machine<'_> {
    /// The number of the pen, from 0, that the machine has stopped for and is waiting for. The pins
    /// may still move: [`Machine::is_stopped`] tells when they stand.
    pub fn pen_wanted(&self) -> Option<u8> {
        // The next pen is known as soon as the path was read, and a feed hold may come before the
        // pen change. So the machine must have planned the strokes of the present pen to their end.
        match self.activity {
            Activity::Hold { stopped: true, source: Source::PenChange { pen, .. } }
                if self.runner.is_at_rest() =>
            {
                Some(pen)
            }
            _ => None,
        }
    }

    /// Returns the position of the machine and the progress of its job, for the status line.
    pub fn status(&self) -> Status {
        let done = self.progress.done(self.runner.run());
        Status {
            state: self.state(),
            position: self.position(),
            job: self.progress.size(),
            done,
            seconds_left: self.seconds_left(done),
            percent: self.percent,
            pen_wanted: self.pen_wanted(),
        }
    }

    /// The remaining time of the job, in seconds. The duration of the job is multiplied by the
    /// fraction that remains, which is measured by lengths and strokes at constant speed.
    fn seconds_left(&self, done: JobSize) -> u32 {
        let even = |size| even_milliseconds(&self.settings, size);
        let (job, left) = (self.progress.size(), self.progress.left(done));
        let all = even(job);
        let time = job.milliseconds.max(all);
        // The times stay below 2^30 milliseconds, which is several days.
        let left = (time.min(1 << 31) * even(left).min(1 << 31)).checked_div(all).unwrap_or(0);
        u32::try_from(left / 10 / u64::from(self.percent.max(1))).unwrap_or(u32::MAX)
    }

    /// The speed that is planned, in mm/min; 0 while the machine is at rest.
    pub fn speed(&self) -> Value {
        if self.is_stopped() { Value::ZERO } else { self.runner.speed() }
    }

    /// How often the queue ran empty while the machine moved because the main loop was late; the
    /// count wraps.
    pub fn underruns(&self) -> u32 {
        self.pins.underruns()
    }

    /// The present position of the pins on the page, in steps.
    pub fn position(&self) -> PagePoint {
        self.settings.kinematics().page(self.motors_now())
    }

    /// Returns the present positions of both motors, in steps.
    pub(super) fn motors_now(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        let motors =
            PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) };
        #[cfg(feature = "spread-backlash")]
        let motors = self.without_spread_backlash(motors);
        motors
    }

    /// Returns the positions of both motors where the events planned so far end, in steps.
    pub(super) fn planned_motors(&self) -> PagePoint {
        let motors = self.runner.position();
        #[cfg(feature = "spread-backlash")]
        let motors = self.planned_without_spread_backlash(motors);
        motors
    }

    /// The position on the page where the events planned so far end, in steps.
    pub fn planned_position(&self) -> PagePoint {
        self.settings.kinematics().page(self.planned_motors())
    }

    /// The present position of the pins in millimetres, converted by the steps per millimetre in
    /// the settings.
    pub fn position_mm(&self) -> [Value; 2] {
        self.millimetres(self.position())
    }

    /// Converts a position on the page from steps to millimetres.
    pub fn millimetres(&self, point: PagePoint) -> [Value; 2] {
        self.settings.millimetres(point)
    }
}
