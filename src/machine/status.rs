//! What the machine says of itself.

use super::{JobSize, Machine, Setting, State, Value};
use crate::drawing::PagePoint;

/// A report for the status line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// What the machine does.
    pub state: State,
    /// Where the pins are, in steps.
    pub position: PagePoint,
    /// The job's size; zero if none was started.
    pub job: JobSize,
    /// What of it is planned already: at most the queue ahead of the pins.
    pub done: JobSize,
    /// How long the rest takes at least, without what corners and bends cost.
    pub seconds_left: u32,
    /// The pen that the machine waits for, if it does.
    pub pen_wanted: Option<u8>,
}

impl Machine<'_> {
    /// Where it is, and how far the job is.
    pub fn status(&self) -> Status {
        let run = self.runner.run();
        let done = JobSize {
            strokes: run.strokes.wrapping_sub(self.before.strokes),
            drawn: run.drawn - self.before.drawn,
            travelled: run.travelled - self.before.travelled,
        };
        Status {
            state: self.state,
            position: self.position(),
            job: self.job,
            done,
            seconds_left: self.seconds_left(done),
            pen_wanted: self.next_pen.map(|(pen, _)| pen),
        }
    }

    fn seconds_left(&self, done: JobSize) -> u32 {
        let at_speed = |length: u64, speed: Setting| {
            // 2^-18 mm over 2^-16 mm/min, in milliseconds.
            let speed = u64::from(self.settings.get(speed).to_bits().unsigned_abs());
            (length >> 2).saturating_mul(60_000) / speed.max(1)
        };
        let strokes = u64::from(self.job.strokes.saturating_sub(done.strokes));
        let dwell = self.settings.get(Setting::PenUpDwell).saturating_to_num::<u64>()
            + self.settings.get(Setting::PenDownDwell).saturating_to_num::<u64>();
        let milliseconds = at_speed(self.job.drawn.saturating_sub(done.drawn), Setting::DrawSpeed)
            + at_speed(self.job.travelled.saturating_sub(done.travelled), Setting::TravelSpeed)
            + strokes * dwell;
        u32::try_from(milliseconds / 1000).unwrap_or(u32::MAX)
    }

    /// Where the pins are, in steps of the page.
    pub fn position(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        let motors =
            PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) };
        self.settings.kinematics().page(motors)
    }

    /// Where the events planned so far lead, in steps of the page.
    pub fn planned_position(&self) -> PagePoint {
        self.settings.kinematics().page(self.runner.position())
    }

    /// The length of a step of x and of y is its setting; this is the position in millimetres.
    pub fn position_mm(&self) -> [Value; 2] {
        let point = self.position();
        let mm = |steps: i32, setting: Setting| {
            let steps_per_mm = i64::from(self.settings.get(setting).to_bits());
            let bits = (i64::from(steps) << (2 * Value::FRAC_NBITS)) / steps_per_mm.max(1);
            Value::from_bits(bits.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
        };
        [mm(point.x, Setting::StepsPerMmX), mm(point.y, self.settings.steps_per_mm_y())]
    }
}
