//! The speed along one piece of the path: how it rises, stays and falls, divided into slices of
//! constant speed.

use super::{Limits, PathLength, SLICE_TICKS, SliceSpeed};

/// Times are counted in sixteenths of ticks, which is this number of fractional bits. In whole
/// ticks each short block would lose up to one tick.
pub(super) const FRACTION_BITS: u32 = 4;

/// A speed along the path, together with the distance within which the machine can shed it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PathSpeed {
    /// The distance within which the speed can be shed.
    pub(super) stopping_distance: PathLength,
    /// The speed itself.
    pub(super) speed: SliceSpeed,
}

impl PathSpeed {
    /// No movement.
    pub const REST: Self = Self { stopping_distance: PathLength::ZERO, speed: SliceSpeed::ZERO };

    /// Returns a speed with its stopping distance.
    pub(super) fn of_speed(limits: &Limits, speed: SliceSpeed) -> Self {
        Self { stopping_distance: limits.stopping_distance(speed), speed }
    }

    /// Returns the speed that has this stopping distance.
    pub(super) fn of_stopping_distance(limits: &Limits, stopping_distance: PathLength) -> Self {
        Self { stopping_distance, speed: limits.speed(stopping_distance) }
    }
}

/// A part of a profile in which the acceleration is constant.
#[derive(Debug, Clone, Copy, Default)]
struct Phase {
    /// The distance that is left, in units of 2^-32 mm.
    distance: u64,
    /// The time that is left, in sixteenths of ticks.
    time: u64,
    /// The speed now.
    speed: SliceSpeed,
    /// The speed that each slice adds.
    gain: i32,
}

impl Phase {
    /// A phase of `distance` whose speed changes from `from` to `to`.
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

/// A short time within which the speed is constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Slice {
    /// The distance covered, in units of 2^-32 mm.
    pub(super) distance: u32,
    /// The duration in sixteenths of ticks, at most [`Slice::MOST`] times [`Slice::TIME`].
    pub(super) time: u32,
}

impl Slice {
    /// The duration of an ordinary slice, which is [`SLICE_TICKS`], in sixteenths of ticks.
    pub(super) const TIME: u32 = SLICE_TICKS << FRACTION_BITS;
    /// The most ordinary slices that are merged into one where the speed stays the same, which is
    /// 2.6 ms. Then a chord of a few moves is one slice.
    pub(super) const MOST: u32 = 16;
    /// The same while the pen travels: 1.3 ms, because the pen may be told at the end of a slice
    /// only.
    pub(super) const MOST_OF_TRAVEL: u32 = 8;

    /// The most ordinary slices that are merged at this speed, which hardly changes within them.
    /// They are fewer above 350 mm/s, because a slice must be shorter than 1 mm.
    pub(super) const fn most(speed: u32) -> u32 {
        if speed < 15 << 24 { Self::MOST } else { 8 }
    }
}

/// The speed along one piece of the path: at most three phases of constant acceleration.
#[derive(Debug, Clone, Copy, Default)]
pub struct Profile {
    /// The current phase.
    phase: Phase,
    /// After the current phase, the distance at constant speed.
    flat: PathLength,
    /// After that, the distance on which the speed falls.
    down: PathLength,
    /// The greatest speed of the profile.
    peak: PathSpeed,
    /// The speed at the end of the profile.
    exit: PathSpeed,
}

impl Profile {
    /// Plans a piece of `length` that begins at the speed `entry`. The speed never exceeds `top`,
    /// and at the end it is as close to the stopping distance `exit_allowed` as the acceleration
    /// permits, but not above it.
    ///
    /// If `entry` is faster than `top`, the speed is first reduced to `top`. `exit_allowed` must be
    /// reachable, which is guaranteed if it comes from the same look-ahead as `entry`; otherwise
    /// the profile reduces the speed as far as it can.
    #[inline(always)] // A copy of what it returns costs as much as the plan.
    pub(super) fn new(
        limits: &Limits,
        entry: PathSpeed,
        length: PathLength,
        top: PathSpeed,
        exit_allowed: PathLength,
    ) -> Self {
        let start = entry.stopping_distance;
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
        Self::in_phases(limits, entry, length, top, exit_allowed)
    }

    /// Does the work of [`Profile::new`] where the speed changes.
    #[inline(never)] // Most chords never come here: it would only fill the cache.
    fn in_phases(
        limits: &Limits,
        entry: PathSpeed,
        length: PathLength,
        top: PathSpeed,
        exit_allowed: PathLength,
    ) -> Self {
        let (start, reach) = (entry.stopping_distance, length);
        let slowest = start.saturating_sub(reach);
        let fastest = start.saturating_add(reach);
        let exit = exit_allowed.min(fastest).max(slowest);
        let peak = if start > top.stopping_distance {
            top.stopping_distance.max(slowest)
        } else {
            let sum = u64::from(fastest.to_bits()) + u64::from(exit.to_bits());
            // Half the sum of two 32-bit numbers fits 32 bits.
            PathLength::from_bits((sum / 2) as u32).min(top.stopping_distance)
        };
        let exit = exit.min(peak);
        let speed_of = |distance: PathLength| {
            if distance == top.stopping_distance {
                top
            } else if distance == start {
                entry
            } else if distance == 0 {
                PathSpeed::REST
            } else {
                PathSpeed::of_stopping_distance(limits, distance)
            }
        };
        let peak_speed = speed_of(peak);
        // An exit at rest is exact even if the top speed is so low that its stopping distance
        // rounds to zero.
        let exit_speed = if exit == 0 { PathSpeed::REST } else { speed_of(exit) };
        let up = start.abs_diff(peak).min(length);
        let down = (peak - exit).min(length - up);
        let (mut flat, mut down) = (length - up - down, down);
        let (from, to, distance) = if up > 0 {
            (entry, peak_speed, up)
        } else if flat > 0 {
            (peak_speed, peak_speed, core::mem::take(&mut flat))
        } else {
            (peak_speed, exit_speed, core::mem::take(&mut down))
        };
        let phase = Phase::new(limits, from.speed, to.speed, distance);
        Self { phase, flat, down, peak: peak_speed, exit: exit_speed }
    }

    /// Begins the next phase. Returns whether there is one.
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

    /// The speed at the end of the profile.
    pub(super) fn exit(&self) -> PathSpeed {
        self.exit
    }

    /// The time until the end of the profile, in sixteenths of ticks.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn time_left(&self, limits: &Limits) -> u64 {
        let flat = Phase::new(limits, self.peak.speed, self.peak.speed, self.flat);
        let down = Phase::new(limits, self.peak.speed, self.exit.speed, self.down);
        self.phase.time.saturating_add(flat.time).saturating_add(down.time)
    }

    /// The speed at which the next slice begins, with its exact stopping distance, which follows
    /// from what is left of the phase.
    pub(super) fn state(&self) -> PathSpeed {
        let Phase { distance, gain, .. } = self.phase;
        let is_last = self.flat == 0 && self.down == 0;
        let end = if is_last { self.exit } else { self.peak };
        if distance == 0 {
            return end;
        }
        let left = PathLength::from_bits((distance >> 14) as u32);
        let stopping_distance = match gain.cmp(&0) {
            core::cmp::Ordering::Less => end.stopping_distance.saturating_add(left),
            core::cmp::Ordering::Equal => end.stopping_distance,
            core::cmp::Ordering::Greater => end.stopping_distance.saturating_sub(left),
        };
        PathSpeed { stopping_distance, speed: self.phase.speed }
    }

    /// The speed at which the next slice begins.
    pub(super) fn speed(&self) -> SliceSpeed {
        if self.phase.distance > 0 {
            self.phase.speed
        } else if self.flat > 0 || self.down > 0 {
            self.peak.speed
        } else {
            self.exit.speed
        }
    }

    /// Returns the next slice, or `None` at the end of the profile. It merges at most `most`
    /// ordinary slices.
    pub(super) fn next_slice(&mut self, limits: &Limits, most: u32) -> Option<Slice> {
        loop {
            let phase = &mut self.phase;
            let slices =
                if phase.gain == 0 { Slice::most(phase.speed.to_bits()).min(most) } else { 1 };
            let time = u64::from(slices * Slice::TIME);
            if phase.time > time {
                let speed = i64::from(phase.speed.to_bits());
                let after = (speed + i64::from(phase.gain)).max(0);
                let distance = (speed + after).unsigned_abs() * u64::from(slices) / 2;
                let distance = distance.min(phase.distance);
                phase.speed = SliceSpeed::from_bits(after as u32);
                phase.distance -= distance;
                phase.time -= time;
                // The distance fits 32 bits: an ordinary slice at the greatest speed is 0.09 mm.
                return Some(Slice { distance: distance as u32, time: time as u32 });
            }
            // The rest is no longer than a slice, so it fits 32 bits, too.
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
        while let Some(slice) = profile.next_slice(limits, Slice::MOST) {
            distance += u64::from(slice.distance);
            time += u64::from(slice.time);
        }
        (distance as f64 / 2f64.powi(32), time as f64 / 16.0 / 25e6)
    }

    /// From `entry` on to rest, or as far as `length` allows.
    fn stopping(limits: &Limits, entry: PathSpeed, length: PathLength) -> Profile {
        let length = length.min(entry.stopping_distance);
        Profile::new(limits, entry, length, entry, PathLength::ZERO)
    }

    #[test]
    fn triangle_trapezoid_and_stop_take_the_time_of_the_formula() {
        let limits = Limits::new(&settings()).expect("valid");
        let top = PathSpeed::of_speed(&limits, limits.draw_speed);
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
            let entry =
                PathSpeed::of_stopping_distance(&limits, mm(entry).min(top.stopping_distance));
            let profile = Profile::new(&limits, entry, mm(length), top, mm(exit));
            let (distance, time) = run(&limits, profile);
            assert!((distance - length).abs() < 1e-5, "{length}: {distance}");
            assert!((time - seconds).abs() < 2e-4 * seconds, "{length}: {time}, not {seconds}");
        }
        let (distance, time) = run(&limits, stopping(&limits, top, mm(100.0)));
        assert!((distance - 6.25).abs() < 1e-3 && (time - 0.25).abs() < 1e-4);
        let short = stopping(&limits, top, mm(1.0));
        assert_eq!(short.exit().stopping_distance, top.stopping_distance - mm(1.0));
        assert_eq!(run(&limits, stopping(&limits, PathSpeed::REST, mm(1.0))), (0.0, 0.0));
    }

    #[test]
    fn wherever_a_profile_is_broken_off_its_end_stays_within_reach() {
        let limits = Limits::new(&settings()).expect("valid");
        let top = PathSpeed::of_speed(&limits, limits.draw_speed);
        let cases = [(20.0, 0.0, 0.0), (9.3, 1.7, 3.1), (1.0, 4.0, 3.5), (3.0, 6.25, 3.25)];
        for (length, entry, exit) in cases {
            let entry = PathSpeed::of_stopping_distance(&limits, mm(entry));
            let mut profile = Profile::new(&limits, entry, mm(length), top, mm(exit));
            let mut left = u64::from(mm(length).to_bits()) << 14;
            while let Some(slice) = profile.next_slice(&limits, Slice::MOST) {
                left -= u64::from(slice.distance);
                let PathSpeed { stopping_distance, speed } = profile.state();
                let end = profile.exit().stopping_distance;
                let reach = PathLength::from_bits((left >> 14) as u32);
                assert!(stopping_distance <= end + reach, "{length}: {stopping_distance}");
                assert!(end <= stopping_distance + reach + PathLength::DELTA, "{length}");
                let of_speed = limits.stopping_distance(speed);
                assert!(stopping_distance.abs_diff(of_speed) < mm(0.001), "{length}: {of_speed}");
            }
            assert_eq!(profile.state(), profile.exit());
        }
    }
}
