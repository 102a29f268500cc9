//! Reports the state and the progress of the machine, and estimates the duration of a job.

use super::{JobSize, Machine, Setting, Settings, State, Value};
use crate::drawing::PagePoint;

/// The contents of the status line.
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
    /// The number of the pen, from 0, that the machine has stopped for and is waiting for.
    pub fn pen_wanted(&self) -> Option<u8> {
        // The next pen is known as soon as the path was read, and a feed hold may come before the
        // pen change. So the machine must have finished the strokes of the present pen.
        let is_stopped = self.state == State::Hold { standing: true } && self.runner.is_at_rest();
        self.next_pen.filter(|_| is_stopped).map(|(pen, _)| pen)
    }

    /// The position of the machine and the progress of its job.
    pub fn status(&self) -> Status {
        let run = self.runner.run();
        let done = JobSize {
            strokes: run.strokes.wrapping_sub(self.before.strokes),
            drawn: run.drawn - self.before.drawn,
            travelled: run.travelled - self.before.travelled,
            milliseconds: 0,
        };
        Status {
            state: self.state,
            position: self.position(),
            job: self.job,
            done,
            seconds_left: self.seconds_left(done),
            percent: self.percent,
            pen_wanted: self.pen_wanted(),
        }
    }

    /// The remaining time of the job, in seconds. The duration of the job is multiplied by the
    /// fraction that remains, which is measured by lengths and strokes at constant speed.
    fn seconds_left(&self, done: JobSize) -> u32 {
        let bare = |size: JobSize| {
            bare_milliseconds(&self.settings, size.drawn, Setting::DrawSpeed)
                + bare_milliseconds(&self.settings, size.travelled, Setting::TravelSpeed)
                + u64::from(size.strokes) * pen_milliseconds(&self.settings)
        };
        let left = JobSize {
            strokes: self.job.strokes.saturating_sub(done.strokes),
            drawn: self.job.drawn.saturating_sub(done.drawn),
            travelled: self.job.travelled.saturating_sub(done.travelled),
            milliseconds: 0,
        };
        let all = bare(self.job);
        let time = self.job.milliseconds.max(all);
        // The times stay below 2^30 milliseconds, which is several days.
        let left = (time.min(1 << 31) * bare(left).min(1 << 31)).checked_div(all).unwrap_or(0);
        u32::try_from(left / 10 / u64::from(self.percent)).unwrap_or(u32::MAX)
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

    /// The present positions of the motors, in steps.
    pub(super) fn motors_now(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) }
    }

    /// The position on the page where the events planned so far end, in steps.
    pub fn planned_position(&self) -> PagePoint {
        self.settings.kinematics().page(self.runner.position())
    }

    /// The present position of the pins in millimetres, converted by the steps per millimetre in
    /// the settings.
    pub fn position_mm(&self) -> [Value; 2] {
        self.millimetres(self.position())
    }

    /// Converts a position on the page from steps to millimetres.
    pub fn millimetres(&self, point: PagePoint) -> [Value; 2] {
        [
            self.settings.steps_as_millimetres(point.x, Setting::StepsPerMmX),
            self.settings.steps_as_millimetres(point.y, self.settings.steps_per_mm_y()),
        ]
    }
}

/// The time, in milliseconds, that a length (in 2^-18 mm) takes at the speed in a setting.
fn bare_milliseconds(settings: &Settings, length: u64, speed: Setting) -> u64 {
    // The length is in 2^-18 mm and the speed in 2^-16 mm/min.
    let speed = u64::from(settings.get(speed).to_bits().unsigned_abs());
    (length >> 2).saturating_mul(60_000) / speed.max(1)
}

/// The time, in milliseconds, that lowering and raising the pen adds to each stroke: the dwells,
/// and the moves down and up if a motor lifts the pen.
fn pen_milliseconds(settings: &Settings) -> u64 {
    let whole = |setting| settings.get(setting).saturating_to_num::<u64>();
    let dwells = whole(Setting::PenDownDwell) + whole(Setting::PenUpDwell);
    if !settings.is_on(Setting::PenLift) {
        return dwells;
    }
    let heights = whole(Setting::PenDownHeight).abs_diff(whole(Setting::PenUpHeight));
    let way = bits(settings, Setting::TravelZ) * heights / 127;
    let per_second = bits(settings, Setting::MaxRateZ) / 60;
    dwells + 2 * rest_to_rest(way, per_second, bits(settings, Setting::AccelerationZ))
}

/// The value of a setting in units of 2^-16 of its unit; at least 1.
fn bits(settings: &Settings, setting: Setting) -> u64 {
    u64::from(settings.get(setting).to_bits().unsigned_abs()).max(1)
}

/// The time, in milliseconds, of a move from rest to rest over a distance `way` (2^-16 mm). `speed`
/// is the greatest speed (2^-16 mm/s, above 0), and `acceleration` is in 2^-16 mm/s².
fn rest_to_rest(way: u64, speed: u64, acceleration: u64) -> u64 {
    // This is the distance in which the speed is reached and lost again.
    if way >= speed * speed / acceleration {
        way.saturating_mul(1000) / speed + speed * 1000 / acceleration
    } else {
        2 * (way * 1_000_000 / acceleration).isqrt()
    }
}

/// Estimates the duration of a job. Each part between two sharp corners is assumed to be drawn from
/// rest to rest.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    /// The time of the parts that are complete.
    milliseconds: u64,
    /// The length of the present part between two corners, in 2^-18 mm.
    piece: u64,
    /// The last move of the present part, in steps.
    way: (i32, i32),
    /// Whether the present part is drawn with the pen down.
    inked: bool,
}

impl Estimate {
    /// Adds a move by `way` steps that is `length` long (2^-18 mm).
    pub(super) fn add(&mut self, settings: &Settings, way: (i32, i32), inked: bool, length: u64) {
        let [(ax, ay), (bx, by)] = [self.way, way].map(|(x, y)| (i64::from(x), i64::from(y)));
        let (along, across) = (ax * bx + ay * by, ax * by - ay * bx);
        // A turn by more than 20 degrees counts as a corner.
        if self.inked != inked || 8 * across.abs() > 3 * along {
            self.end_piece(settings);
        }
        if inked && !self.inked {
            self.milliseconds += pen_milliseconds(settings);
        }
        (self.way, self.inked) = (way, inked);
        self.piece += length;
    }

    /// The estimated time of all moves, in milliseconds.
    pub(super) fn end(mut self, settings: &Settings) -> u64 {
        self.end_piece(settings);
        self.milliseconds
    }

    /// Adds the time of the current part and begins a new one.
    fn end_piece(&mut self, settings: &Settings) {
        let speed = if self.inked { Setting::DrawSpeed } else { Setting::TravelSpeed };
        let acceleration = [Setting::AccelerationX, Setting::AccelerationY];
        let acceleration = acceleration.map(|setting| bits(settings, setting));
        let acceleration = acceleration[0].min(acceleration[1]);
        let per_second = bits(settings, speed) / 60;
        self.milliseconds += rest_to_rest(self.piece >> 2, per_second, acceleration);
        // Each change of speed takes longer by about the time in which the acceleration builds up.
        let jerk = u64::from(settings.get(Setting::Jerk).to_bits().unsigned_abs());
        if let Some(ramp) = acceleration.checked_div(jerk) {
            self.milliseconds += ramp.min((per_second * 1000 / jerk).isqrt());
        }
        self.piece = 0;
    }
}
