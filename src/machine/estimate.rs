//! Estimates the duration of a job.

use super::{JobSize, Setting, Settings, Tool};
use crate::array::MapEach;
use core::num::NonZeroU64;

/// The speed along the path that a setting asks for, as far as both axes allow it, in 2^-16 mm/min;
/// at least 1.
fn per_minute(settings: &Settings, speed: Setting) -> NonZeroU64 {
    let bits = settings.path_speed(speed).to_bits().unsigned_abs();
    NonZeroU64::new(bits.into()).unwrap_or(NonZeroU64::MIN)
}

/// The time, in milliseconds, that a job of this size would take if all speeds were reached at
/// once.
pub(super) fn even_milliseconds(settings: &Settings, size: JobSize) -> u64 {
    let line = |length: u64, speed| {
        // The length is in 2^-18 mm and the speed in 2^-16 mm/min.
        (length >> 2).saturating_mul(60_000) / per_minute(settings, speed)
    };
    line(size.drawn, Setting::DrawSpeed)
        + line(size.travelled, Setting::TravelSpeed)
        + u64::from(size.strokes) * Tool::stroke_milliseconds(settings)
}

/// The time, in milliseconds, of a move from rest to rest over a `distance` (2^-16 mm). `speed`
/// is the greatest speed (2^-16 mm/s, above 0), and `acceleration` is in 2^-16 mm/s².
pub(super) fn rest_to_rest(distance: u64, speed: u64, acceleration: u64) -> u64 {
    let (speed, acceleration) = (speed.max(1), acceleration.max(1));
    // This is the distance in which the speed is reached and lost again.
    if distance >= speed * speed / acceleration {
        distance.saturating_mul(1000) / speed + speed * 1000 / acceleration
    } else {
        2 * (distance * 1_000_000 / acceleration).isqrt()
    }
}

/// Estimates the duration of a job. Each part between two sharp corners is assumed to be drawn from
/// rest to rest.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    /// The time of the parts between corners that are complete, in milliseconds.
    milliseconds: u64,
    /// The length of the part between two corners that is being added up, in 2^-18 mm.
    length: u64,
    /// The last move of that part, in steps.
    delta: (i32, i32),
    /// Whether that part is drawn with the pen down.
    inked: bool,
}

impl Estimate {
    /// Adds a move to the estimate: by `delta` steps, and `length` long in units of 2^-18 mm.
    pub(super) fn add(&mut self, settings: &Settings, delta: (i32, i32), inked: bool, length: u64) {
        let [(ax, ay), (bx, by)] =
            [self.delta, delta].map_each(|(x, y)| (i64::from(x), i64::from(y)));
        let (along, across) = (ax * bx + ay * by, ax * by - ay * bx);
        // A turn by more than 20 degrees counts as a corner.
        if self.inked != inked || 8 * across.abs() > 3 * along {
            self.end_part(settings);
        }
        if inked && !self.inked {
            self.milliseconds += Tool::stroke_milliseconds(settings);
        }
        (self.delta, self.inked) = (delta, inked);
        self.length += length;
    }

    /// Ends the estimate and returns the time of all moves, in milliseconds.
    pub(super) fn end(mut self, settings: &Settings) -> u64 {
        self.end_part(settings);
        self.milliseconds
    }

    /// Adds the time of the current part and begins a new one.
    fn end_part(&mut self, settings: &Settings) {
        let speed = if self.inked { Setting::DrawSpeed } else { Setting::TravelSpeed };
        let (acceleration, _) = settings.acceleration_and_corners();
        let acceleration = u64::from(acceleration.to_bits().unsigned_abs()).max(1);
        let per_second = per_minute(settings, speed).get() / 60;
        self.milliseconds += rest_to_rest(self.length >> 2, per_second, acceleration);
        // Each change of speed takes longer by about the time in which the acceleration builds up.
        let jerk = u64::from(settings.get(Setting::Jerk).to_bits().unsigned_abs());
        if let Some(ramp) = acceleration.checked_div(jerk) {
            self.milliseconds += ramp.min((per_second * 1000 / jerk).isqrt());
        }
        self.length = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Value;

    #[test]
    fn lines_take_as_long_as_the_axes_allow() {
        let mut settings = Settings::default();
        for setting in [Setting::MaxRateX, Setting::MaxRateY] {
            settings.set(setting, Value::from_num(600)).expect("a valid setting");
        }
        // A square of 100 mm takes 40 s at 10 mm/s.
        let side = 100 << 18;
        let size = JobSize { drawn: 4 * side, ..JobSize::default() };
        assert_eq!(even_milliseconds(&settings, size), 40_000);
        let mut estimate = Estimate::default();
        for delta in [(8000, 0), (0, 8000), (-8000, 0), (0, -8000)] {
            estimate.add(&settings, delta, true, side);
        }
        let milliseconds = estimate.end(&settings);
        assert!((40_000..42_000).contains(&milliseconds), "{milliseconds}");
    }
}
