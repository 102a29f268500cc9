//! How the speed runs through one piece of the path: up, along, down, cut into slices.

use super::{Limits, PathLength, SLICE_TICKS, SliceSpeed};

/// Sixteenths of a tick: the fraction keeps short blocks from losing a tick each.
pub(super) const FRACTION_BITS: u32 = 4;

/// A speed both ways: as such, and as the distance in which it can be shed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pace {
    pub(super) stopping_distance: PathLength,
    pub(super) speed: SliceSpeed,
}

impl Pace {
    /// Standing.
    pub const REST: Self = Self { stopping_distance: PathLength::ZERO, speed: SliceSpeed::ZERO };

    pub(super) fn of_speed(limits: &Limits, speed: SliceSpeed) -> Self {
        Self { stopping_distance: limits.stopping_distance(speed), speed }
    }

    pub(super) fn of_stopping_distance(limits: &Limits, stopping_distance: PathLength) -> Self {
        Self { stopping_distance, speed: limits.speed(stopping_distance) }
    }
}

/// A stretch of constant acceleration.
#[derive(Debug, Clone, Copy, Default)]
struct Phase {
    /// Still to go, 2^-32 mm.
    distance: u64,
    /// Still to pass, 1/16 ticks.
    time: u64,
    /// Now.
    speed: SliceSpeed,
    /// Gained by each slice.
    gain: i32,
}

impl Phase {
    /// From one speed to another.
    #[inline(always)] // A copy of what it returns costs more.
    fn new(limits: &Limits, from: SliceSpeed, to: SliceSpeed, distance: PathLength) -> Self {
        let speeds = u64::from(from.to_bits()) + u64::from(to.to_bits());
        let bits = u64::from(distance.to_bits());
        // Time = 2 s / (v0 + v1) slices of 2^12 ticks, s and v in the same unit: below 2^63.
        let time = (bits << (14 + 1 + SLICE_TICKS.trailing_zeros() + FRACTION_BITS))
            .checked_div(speeds)
            .unwrap_or(0);
        let acceleration = limits.acceleration.to_bits().cast_signed();
        Self {
            distance: bits << 14,
            time,
            speed: from,
            gain: match to.cmp(&from) {
                core::cmp::Ordering::Less => -acceleration,
                core::cmp::Ordering::Equal => 0,
                core::cmp::Ordering::Greater => acceleration,
            },
        }
    }
}

/// A short time of constant speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Slice {
    /// Gone in it, 2^-32 mm.
    pub(super) distance: u32,
    /// It lasts, 1/16 ticks, at most [`Slice::MOST`] times [`Slice::TIME`].
    pub(super) time: u32,
}

impl Slice {
    /// [`SLICE_TICKS`].
    pub(super) const TIME: u32 = SLICE_TICKS << FRACTION_BITS;
    /// Where the speed does not change, so many are one: 1.3 ms.
    pub(super) const MOST: u32 = 8;
}

/// The speed along one piece of the path: at most three phases of constant acceleration.
#[derive(Debug, Clone, Copy, Default)]
pub struct Profile {
    /// The phase in work.
    phase: Phase,
    /// How long the speed then stays, and how long it sinks at the end.
    flat: PathLength,
    down: PathLength,
    peak: Pace,
    exit: Pace,
}

impl Profile {
    /// Begins at `entry`, goes `length`, at most `top` fast, and ends as fast as `exit_allowed` and
    /// the acceleration let it.
    ///
    /// If `entry` is faster than `top`, the speed is shed first. `exit_allowed` must be within
    /// reach, which it is if it comes from the same look-ahead as `entry`; else the profile sheds
    /// all it can.
    pub(super) fn new(
        limits: &Limits,
        entry: Pace,
        length: PathLength,
        top: Pace,
        exit_allowed: PathLength,
    ) -> Self {
        let (start, reach) = (entry.stopping_distance, length);
        // Most chords are run at the greatest speed from end to end.
        if start == top.stopping_distance && start > 0 && exit_allowed >= start {
            let phase = Phase::new(limits, top.speed, top.speed, length);
            return Self {
                phase,
                flat: PathLength::ZERO,
                down: PathLength::ZERO,
                peak: top,
                exit: top,
            };
        }
        let slowest = start.saturating_sub(reach);
        let fastest = start.saturating_add(reach);
        let exit = exit_allowed.min(fastest).max(slowest);
        let peak = if start > top.stopping_distance {
            top.stopping_distance.max(slowest)
        } else {
            let sum = u64::from(fastest.to_bits()) + u64::from(exit.to_bits());
            // Half of two numbers of 32 bits has 32.
            PathLength::from_bits((sum / 2) as u32).min(top.stopping_distance)
        };
        let exit = exit.min(peak);
        let pace = |distance: PathLength| {
            if distance == top.stopping_distance {
                top
            } else if distance == start {
                entry
            } else if distance == 0 {
                Pace::REST
            } else {
                Pace::of_stopping_distance(limits, distance)
            }
        };
        let peak_pace = pace(peak);
        // Even if the top speed is so slow that it needs no length to be shed.
        let exit_pace = if exit == 0 { Pace::REST } else { pace(exit) };
        let up = start.abs_diff(peak).min(length);
        let down = (peak - exit).min(length - up);
        let (mut flat, mut down) = (length - up - down, down);
        let (from, to, distance) = if up > 0 {
            (entry, peak_pace, up)
        } else if flat > 0 {
            (peak_pace, peak_pace, core::mem::take(&mut flat))
        } else {
            (peak_pace, exit_pace, core::mem::take(&mut down))
        };
        let phase = Phase::new(limits, from.speed, to.speed, distance);
        Self { phase, flat, down, peak: peak_pace, exit: exit_pace }
    }

    /// Takes the next phase into work, if there is one.
    fn begin_phase(&mut self, limits: &Limits) -> bool {
        let (to, length) = if self.flat > 0 {
            (self.peak, core::mem::take(&mut self.flat))
        } else {
            (self.exit, core::mem::take(&mut self.down))
        };
        if length == 0 {
            (self.phase.distance, self.phase.time) = (0, 0);
            return false;
        }
        self.phase = Phase::new(limits, self.peak.speed, to.speed, length);
        true
    }

    /// The speed at its end.
    pub(super) fn exit(&self) -> Pace {
        self.exit
    }

    /// How long it still takes to its end, in sixteenths of ticks.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn time_left(&self, limits: &Limits) -> u64 {
        let flat = Phase::new(limits, self.peak.speed, self.peak.speed, self.flat);
        let down = Phase::new(limits, self.peak.speed, self.exit.speed, self.down);
        self.phase.time.saturating_add(flat.time).saturating_add(down.time)
    }

    /// The speed where the next slice begins.
    pub(super) fn speed(&self) -> SliceSpeed {
        if self.phase.distance > 0 {
            self.phase.speed
        } else if self.flat > 0 || self.down > 0 {
            self.peak.speed
        } else {
            self.exit.speed
        }
    }

    /// The next slice, `None` at the end.
    pub(super) fn next_slice(&mut self, limits: &Limits) -> Option<Slice> {
        loop {
            let phase = &mut self.phase;
            let slices = if phase.gain == 0 { Slice::MOST } else { 1 };
            let time = u64::from(slices * Slice::TIME);
            if phase.time > time {
                let speed = i64::from(phase.speed.to_bits());
                let after = (speed + i64::from(phase.gain)).max(0);
                let distance = (speed + after).unsigned_abs() * u64::from(slices) / 2;
                let distance = distance.min(phase.distance);
                phase.speed = SliceSpeed::from_bits(after as u32);
                phase.distance -= distance;
                phase.time -= time;
                // Speeds are at most 0.09, and a slice is no longer than eight.
                return Some(Slice { distance: distance as u32, time: time as u32 });
            }
            // No more than that.
            let rest = Slice { distance: phase.distance as u32, time: phase.time as u32 };
            let goes_on = self.begin_phase(limits);
            if rest.distance > 0 {
                return Some(rest);
            }
            if !goes_on {
                return None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::settings;
    use super::*;

    fn mm(length: f64) -> PathLength {
        PathLength::from_num(length)
    }

    /// Distance (mm) and time (s) of all slices.
    fn run(limits: &Limits, mut profile: Profile) -> (f64, f64) {
        let (mut distance, mut time) = (0u64, 0u64);
        while let Some(slice) = profile.next_slice(limits) {
            distance += u64::from(slice.distance);
            time += u64::from(slice.time);
        }
        (distance as f64 / 2f64.powi(32), time as f64 / 16.0 / 25e6)
    }

    /// From `entry` on to rest, or as far as `length` allows.
    fn stopping(limits: &Limits, entry: Pace, length: PathLength) -> Profile {
        let length = length.min(entry.stopping_distance);
        Profile::new(limits, entry, length, entry, PathLength::ZERO)
    }

    #[test]
    fn triangle_trapezoid_and_stop_take_the_time_of_the_formula() {
        let limits = Limits::new(&settings()).expect("valid");
        let top = Pace::of_speed(&limits, limits.draw_speed);
        let cases = [
            // length, entry, exit, seconds
            (20.0, 0.0, 0.0, 0.25 + 0.25 + 7.5 / 50.0),
            (2.0, 0.0, 0.0, 2.0 * (2.0f64 / 200.0).sqrt()),
            (6.25, 0.0, 6.25, 0.25),
            (6.25, 6.25, 0.0, 0.25),
            (0.05, 6.25, 6.25, 0.001),
            (1.0, 0.0, 10.0, (2.0f64 / 200.0).sqrt()),
        ];
        for (length, entry, exit, seconds) in cases {
            let entry = Pace::of_stopping_distance(&limits, mm(entry).min(top.stopping_distance));
            let profile = Profile::new(&limits, entry, mm(length), top, mm(exit));
            let (distance, time) = run(&limits, profile);
            assert!((distance - length).abs() < 1e-5, "{length}: {distance}");
            assert!((time - seconds).abs() < 2e-4 * seconds, "{length}: {time}, not {seconds}");
        }
        let (distance, time) = run(&limits, stopping(&limits, top, mm(100.0)));
        assert!((distance - 6.25).abs() < 1e-3 && (time - 0.25).abs() < 1e-4);
        let short = stopping(&limits, top, mm(1.0));
        assert_eq!(short.exit().stopping_distance, top.stopping_distance - mm(1.0));
        assert_eq!(run(&limits, stopping(&limits, Pace::REST, mm(1.0))), (0.0, 0.0));
    }
}
