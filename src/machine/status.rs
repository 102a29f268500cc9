//! What the machine says of itself.

use super::{JobSize, Machine, Setting, Settings, State, Value};
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
    /// How long the rest takes, about.
    pub seconds_left: u32,
    /// Speeds in percent of the settings.
    pub percent: u8,
    /// The pen that the machine waits for, if it does.
    pub pen_wanted: Option<u8>,
}

impl Machine<'_> {
    /// The pen, from 0, that the machine stands and waits for.
    pub fn pen_wanted(&self) -> Option<u8> {
        // It is known earlier, when the path was read; a hold may come in between.
        let is_stopped = self.state == State::Hold { standing: true } && self.runner.is_at_rest();
        self.next_pen.filter(|_| is_stopped).map(|(pen, _)| pen)
    }

    /// Where it is, and how far the job is.
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

    /// The job's time, shared out by the time of the lengths and strokes that are left.
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
        // Days of milliseconds stay below 2^30.
        let left = (time.min(1 << 31) * bare(left).min(1 << 31)).checked_div(all).unwrap_or(0);
        u32::try_from(left / 10 / u64::from(self.percent)).unwrap_or(u32::MAX)
    }

    /// How often the queue ran dry while the machine moved: the main loop was late; wraps.
    pub fn underruns(&self) -> u32 {
        self.pins.underruns()
    }

    /// Where the pins are, in steps of the page.
    pub fn position(&self) -> PagePoint {
        self.settings.kinematics().page(self.motors_now())
    }

    pub(super) fn motors_now(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) }
    }

    /// Where the events planned so far lead, in steps of the page.
    pub fn planned_position(&self) -> PagePoint {
        self.settings.kinematics().page(self.runner.position())
    }

    /// The length of a step of x and of y is its setting; this is the position in millimetres.
    pub fn position_mm(&self) -> [Value; 2] {
        self.millimetres(self.position())
    }

    /// A place on the page in millimetres.
    pub fn millimetres(&self, point: PagePoint) -> [Value; 2] {
        [
            self.settings.steps_as_millimetres(point.x, Setting::StepsPerMmX),
            self.settings.steps_as_millimetres(point.y, self.settings.steps_per_mm_y()),
        ]
    }
}

/// How long a length (2^-18 mm) takes at the speed of a setting.
fn bare_milliseconds(settings: &Settings, length: u64, speed: Setting) -> u64 {
    // 2^-18 mm over 2^-16 mm/min.
    let speed = u64::from(settings.get(speed).to_bits().unsigned_abs());
    (length >> 2).saturating_mul(60_000) / speed.max(1)
}

/// What the pen costs a stroke, in milliseconds: its dwells, and the ways down and up of a motor.
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

/// A setting above 0, in 2^-16 of its unit.
fn bits(settings: &Settings, setting: Setting) -> u64 {
    u64::from(settings.get(setting).to_bits().unsigned_abs()).max(1)
}

/// The milliseconds of a way (2^-16 mm) from rest to rest, at most at a speed (2^-16 mm/s, above 0) and by an
/// acceleration (2^-16 mm/s²).
fn rest_to_rest(way: u64, speed: u64, acceleration: u64) -> u64 {
    // The way until the speed is reached and shed.
    if way >= speed * speed / acceleration {
        way.saturating_mul(1000) / speed + speed * 1000 / acceleration
    } else {
        2 * (way * 1_000_000 / acceleration).isqrt()
    }
}

/// The time of a job, about: each piece between two sharp corners from rest to rest.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    milliseconds: u64,
    /// Of the piece in work: its length, the way it runs, whether it is inked.
    piece: u64,
    way: (i32, i32),
    inked: bool,
}

impl Estimate {
    /// A move by so many steps.
    pub(super) fn add(&mut self, settings: &Settings, way: (i32, i32), inked: bool, length: u64) {
        let [(ax, ay), (bx, by)] = [self.way, way].map(|(x, y)| (i64::from(x), i64::from(y)));
        let (along, across) = (ax * bx + ay * by, ax * by - ay * bx);
        // A turn of more than 20 degrees is a corner.
        if self.inked != inked || 8 * across.abs() > 3 * along {
            self.end_piece(settings);
        }
        if inked && !self.inked {
            self.milliseconds += pen_milliseconds(settings);
        }
        (self.way, self.inked) = (way, inked);
        self.piece += length;
    }

    /// The time of all moves.
    pub(super) fn end(mut self, settings: &Settings) -> u64 {
        self.end_piece(settings);
        self.milliseconds
    }

    fn end_piece(&mut self, settings: &Settings) {
        let speed = if self.inked { Setting::DrawSpeed } else { Setting::TravelSpeed };
        let acceleration = [Setting::AccelerationX, Setting::AccelerationY];
        let acceleration = acceleration.map(|setting| bits(settings, setting));
        let acceleration = acceleration[0].min(acceleration[1]);
        let per_second = bits(settings, speed) / 60;
        self.milliseconds += rest_to_rest(self.piece >> 2, per_second, acceleration);
        // Each change of speed takes as long as acceleration takes to be built up, about.
        let jerk = u64::from(settings.get(Setting::Jerk).to_bits().unsigned_abs());
        if let Some(ramp) = acceleration.checked_div(jerk) {
            self.milliseconds += ramp.min((per_second * 1000 / jerk).isqrt());
        }
        self.piece = 0;
    }
}
