//! Input shapers: how motion is divided into delayed copies, so that the machine does not go on
//! shaking after it.
//!
//! A resonance of frequency f and damping ratio ζ answers each change of the motion by a decaying
//! oscillation. A shaper makes the change in two or three parts, at such times that their
//! oscillations cancel. [`Shaping`] has the shapers of both axes of the page; the delay line of the
//! `shaper` module carries them out. The shapers are those of Singer and Seering (1990), which
//! Klipper has, too.
//!
//! With K = exp(-ζπ/√(1-ζ²)) and half a period of the damped oscillation h = 1/(2f√(1-ζ²)):
//!
//! | shaper | weights | delays |
//! |---|---|---|
//! | ZV | 1, K | 0, h |
//! | ZVD | 1, 2K, K² | 0, h, 2h |
//! | EI | 21/80, 38/80 K, 21/80 K² | 0, h, 2h |
//!
//! divided by the sum of the weights. The delays of both axes are shifted so that both have the
//! same mean delay. So an axis lags behind the plan as the other does, and a line that is drawn at
//! constant speed stays straight.
//!
//! # How far the shaped path leaves the planned one
//!
//! Let p be the planned position, and s the time less the mean delay m. If p has no acceleration
//! beyond a, the copy delayed by T is at p(s) - (T - m) p'(s), but for at most a(T - m)²/2. The
//! middle terms cancel in the weighted sum, so the shaped position is off p(s) by at most aσ²/2,
//! where σ² is the variance of the delays. A corner that is passed at a change of velocity of Δv
//! adds at most κΔv, where κ is half the mean of |T - m|. The delay line is straight between points
//! [`RUN_TIME`] apart, which adds at most a quarter of that time to κ. Along the path and across it
//! the acceleration may reach a at once, which makes √2 a. [`Shaping::bounds`] chooses the
//! acceleration and the junction deviation by that.

use super::TICKS_PER_SECOND;
use super::profile::FRACTION_BITS;
use crate::array::MapEach;
use crate::fixed::Millimetres;

/// The number of copies that a shaper makes at most.
const MOST_PULSES: usize = 3;

/// The least time that an entry of the delay line lasts, in sixteenths of ticks: 2.6 ms.
pub(super) const RUN_TIME: u32 = 1 << 20;

/// The number of entries of the delay line, each of 12 bytes. They are on the stack of a board, and
/// while it starts, several times.
pub(super) const RUNS: usize = 60;

/// The longest delay for which the delay line has room, in sixteenths of ticks: 136 ms. Entries
/// besides are for a run that is cut short at a rest and for those that bring the copies to it.
const LONGEST_DELAY: u32 = (RUNS as u32 - 8) * RUN_TIME;

/// Sixteenths of ticks in a second, and in a microsecond.
const PER_SECOND: u64 = (TICKS_PER_SECOND as u64) << FRACTION_BITS;
const PER_MICROSECOND: u32 = (PER_SECOND / 1_000_000) as u32;

/// The greatest number of steps a second that are shaped. Above, a Pico would not be in time.
pub(super) const MOST_SHAPED_STEPS: u32 = 40_000;

/// The kinds of shapers, from the shortest to the one that suffers the greatest error of the
/// frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShaperKind {
    /// Zero vibration.
    Zv,
    /// Zero vibration and derivative.
    Zvd,
    /// Extra insensitive: 5 % of the vibration is left at the frequency itself.
    Ei,
}

impl ShaperKind {
    /// The weights of the copies, not yet divided by their sum, if a half period leaves the part
    /// `decay` of an oscillation. All are multiples of 2^-30.
    const fn weights(self, decay: u64) -> [u64; MOST_PULSES] {
        let squared = (decay * decay) >> 30;
        match self {
            Self::Zv => [1 << 30, decay, 0],
            Self::Zvd => [1 << 30, 2 * decay, squared],
            Self::Ei => [1 << 30, decay * 38 / 21, squared],
        }
    }

    /// The half periods from the first copy to the last one.
    const fn half_periods(self) -> u32 {
        match self {
            Self::Zv => 1,
            Self::Zvd | Self::Ei => 2,
        }
    }
}

/// The resonance of each axis of the page, as the settings say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resonance {
    /// The shaper of both axes.
    pub kind: ShaperKind,
    /// The frequencies of x and y in hertz; 0 if an axis is not to be shaped.
    pub hertz: [Millimetres; 2],
    /// The damping ratio, 0 to 0.5.
    pub damping: Millimetres,
}

/// A copy of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Pulse {
    /// The part of the motion that this copy makes. All of them add up to 2^16, or to 2^15 if the
    /// motors of both axes move together. 0 if there is no such copy.
    pub(super) weight: u32,
    /// By how much it is later than the plan, in sixteenths of ticks.
    pub(super) delay: u32,
}

/// The shapers of both axes. A value of this type guarantees that the delay line has room for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shaping {
    pulses: [[Pulse; MOST_PULSES]; 2],
    /// The greatest delay.
    longest: u32,
    /// Whether both motors move both axes: the first turns by x + y, the second by x - y.
    couples_axes: bool,
}

impl Shaping {
    /// Computes the shapers.
    ///
    /// # Errors
    /// The least frequency whose copies fit into the delay line, in hundredths of hertz, if one is
    /// lower.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub fn new(resonance: &Resonance, couples_axes: bool) -> Result<Self, u32> {
        let Resonance { kind, hertz, damping } = *resonance;
        // Multiples of 2^-30; the damping ratio is below 1.
        let ratio = u64::from(damping.to_bits().unsigned_abs()).min(1 << 15) << 14;
        let damped = ((1 << 60) - ratio * ratio).isqrt();
        let decay = exponential(ratio * PI / damped.max(1));
        // Half a period in sixteenths of ticks, for a frequency in 2^-16 hertz.
        let half_period = |hertz: u64| {
            let whole = (PER_SECOND << 29) / damped.max(1);
            (whole << 16).checked_div(hertz).unwrap_or(0)
        };
        let longest = u64::from(LONGEST_DELAY / kind.half_periods());
        let weights = kind.weights(decay);
        let sum: u64 = weights.iter().sum();
        let whole = if couples_axes { 1 << 15 } else { 1 << 16 };
        let mut pulses = [[Pulse { weight: 0, delay: 0 }; MOST_PULSES]; 2];
        for (pulses, hertz) in pulses.iter_mut().zip(hertz) {
            let hertz = u64::from(hertz.to_bits().unsigned_abs());
            let half = half_period(hertz);
            if half > longest {
                // Rounded up, by less than two hundredths.
                return Err((half_period(1 << 16) * 100).div_ceil(longest) as u32 + 1);
            }
            if hertz == 0 {
                pulses[0].weight = whole;
                continue;
            }
            let (mut left, mut delay) = (whole, 0);
            for (pulse, weight) in pulses.iter_mut().zip(weights) {
                if weight > 0 {
                    let share = ((weight * u64::from(whole) + sum / 2) / sum.max(1)) as u32;
                    *pulse = Pulse { weight: share.min(left), delay };
                    left -= pulse.weight;
                    delay += half as u32;
                }
            }
            pulses[0].weight += left;
        }
        let means = pulses.map_each(|pulses| mean(&pulses));
        let latest = means[0].max(means[1]);
        for (pulses, mean) in pulses.iter_mut().zip(means) {
            for pulse in pulses.iter_mut().filter(|pulse| pulse.weight > 0) {
                pulse.delay += latest - mean;
            }
        }
        let shaping = Self { pulses, longest: 0, couples_axes };
        let delays = [0, 1].map_each(|axis| shaping.copies(axis).map(|pulse| pulse.delay).max());
        let longest = delays[0].max(delays[1]).unwrap_or(0);
        Ok(Self { longest, ..shaping })
    }

    /// The copies of each axis, without those that do not exist.
    pub(super) fn copies(&self, axis: usize) -> impl Iterator<Item = Pulse> {
        self.pulses[axis].into_iter().filter(|pulse| pulse.weight > 0)
    }

    /// The time from the end of the planned motion to the end of the shaped one, in sixteenths of
    /// ticks.
    pub(super) const fn longest(&self) -> u32 {
        self.longest
    }

    /// The same time in milliseconds.
    pub const fn milliseconds(&self) -> u32 {
        self.longest / (1000 * PER_MICROSECOND)
    }

    /// Whether both motors move both axes.
    pub(super) const fn couples_axes(&self) -> bool {
        self.couples_axes
    }

    /// The weights and delays of the copies of each axis, for tests that compute the shaped path in
    /// another way: parts of 1, and seconds.
    #[cfg(any(test, feature = "host"))]
    pub fn weights_and_delays(&self) -> [std::vec::Vec<(f64, f64)>; 2] {
        self.pulses.map(|pulses| {
            let part = |pulse: &Pulse| {
                let weight = f64::from(pulse.weight) / f64::from(weight(&pulses));
                (weight, f64::from(pulse.delay) / PER_SECOND as f64)
            };
            pulses.iter().filter(|pulse| pulse.weight > 0).map(part).collect()
        })
    }

    /// The greatest acceleration and junction deviation, in mm/s² and mm, with which the shaped
    /// path leaves the planned one by no more than `deviation` mm, which is above 0 and at most 10.
    /// `acceleration` and `junction_deviation` are those that are set.
    ///
    /// Four fifths of the deviation are for the acceleration: √2 aσ²/2. A fifth is for corners:
    /// κΔv, where Δv² is below 8aδ for the junction deviation δ.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub fn bounds(
        &self,
        deviation: Millimetres,
        acceleration: Millimetres,
        junction_deviation: Millimetres,
    ) -> (Millimetres, Millimetres) {
        let deviation = u64::from(deviation.to_bits().unsigned_abs());
        // In µs² and µs. The delays are below 2^18 µs.
        let (mut variance, mut kink) = (1, 1);
        for pulses in &self.pulses {
            let (whole, mean) = (u64::from(weight(pulses)).max(1), mean(pulses));
            let (mut squares, mut sizes) = (0, 0);
            for pulse in pulses {
                let size = u64::from(pulse.delay.abs_diff(mean) / PER_MICROSECOND);
                squares += u64::from(pulse.weight) * size * size;
                sizes += u64::from(pulse.weight) * size;
            }
            variance = variance.max(squares / whole);
            kink = kink.max(sizes / whole / 2);
        }
        kink += u64::from(RUN_TIME / PER_MICROSECOND / 4);
        // Each is no more than what is set, which has 31 bits.
        let lesser = |bound: u64, set: Millimetres| {
            Millimetres::from_bits(bound.min(set.to_bits().max(0).unsigned_abs().into()) as i32)
        };
        // 0.8 √2, times the square of the microseconds in a second.
        let acceleration = lesser(deviation * 1_131_370_849_898 / variance, acceleration);
        let change = (deviation * 200_000 / kink).min(1 << 31);
        let eightfold = 8 * u64::from(acceleration.to_bits().unsigned_abs().max(1));
        (acceleration, lesser(change * change / eightfold, junction_deviation))
    }
}

/// π in units of 2^-30.
const PI: u64 = 3_373_259_426;

/// The exponential function of -`x`, for `x` up to 2. Both are in units of 2^-30.
fn exponential(x: u64) -> u64 {
    let (mut positive, mut negative) = (0, 0);
    let mut term = 1 << 30;
    for number in 1..24 {
        positive += term;
        term = ((term * x) >> 30) / number;
        core::mem::swap(&mut positive, &mut negative);
    }
    // After an odd number of exchanges, the terms with even exponents are in the second sum.
    negative - positive
}

/// The sum of the weights.
fn weight(pulses: &[Pulse; MOST_PULSES]) -> u32 {
    pulses.iter().map(|pulse| pulse.weight).sum()
}

/// The mean delay.
fn mean(pulses: &[Pulse; MOST_PULSES]) -> u32 {
    let sum: u64 =
        pulses.iter().map(|pulse| u64::from(pulse.weight) * u64::from(pulse.delay)).sum();
    // The mean is no greater than the greatest delay, which has 32 bits.
    sum.checked_div(weight(pulses).into()).unwrap_or(0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [ShaperKind; 3] = [ShaperKind::Zv, ShaperKind::Zvd, ShaperKind::Ei];

    fn shaping(kind: ShaperKind, hertz: [f64; 2], damping: f64) -> Result<Shaping, u32> {
        let hertz = hertz.map(Millimetres::from_num);
        let resonance = Resonance { kind, hertz, damping: Millimetres::from_num(damping) };
        Shaping::new(&resonance, false)
    }

    /// The part of a unit impulse's oscillation that is left after a shaper, at this frequency.
    fn residue(copies: &[(f64, f64)], hertz: f64, damping: f64) -> f64 {
        let (speed, decay) = (std::f64::consts::TAU * hertz, damping);
        let damped = speed * (1.0 - decay * decay).sqrt();
        let last = copies.iter().map(|copy| copy.1).fold(0.0, f64::max);
        let (mut sine, mut cosine) = (0.0, 0.0);
        for &(weight, delay) in copies {
            let size = weight * (-decay * speed * (last - delay)).exp();
            sine += size * (damped * delay).sin();
            cosine += size * (damped * delay).cos();
        }
        sine.hypot(cosine)
    }

    #[test]
    fn the_exponential_function() {
        for x in 0..=2000 {
            let x = f64::from(x) / 1000.0;
            let unit = f64::from(1 << 30);
            let computed = exponential((x * unit) as u64) as f64 / unit;
            assert!((computed - (-x).exp()).abs() < 1e-7, "{x}: {computed}");
        }
    }

    #[test]
    fn nothing_is_left_at_the_frequency_and_little_beside_it() {
        for kind in KINDS {
            for hertz in [10.0, 23.7, 80.0] {
                for damping in [0.0, 0.05, 0.2] {
                    let shaping = shaping(kind, [hertz, 0.0], damping).expect("fits");
                    let [copies, single] = shaping.weights_and_delays();
                    assert_eq!(single.len(), 1);
                    let at = residue(&copies, hertz, damping);
                    let most = if kind == ShaperKind::Ei { 0.051 } else { 0.001 };
                    assert!(at < most, "{kind:?} {hertz} {damping}: {at}");
                    let off = residue(&copies, 1.1 * hertz, damping);
                    let most = [0.17, 0.04, 0.051][kind as usize];
                    assert!(off < most, "{kind:?} {hertz} {damping}: {off} at 1.1 times");
                }
            }
        }
    }

    #[test]
    fn both_axes_lag_by_the_same_mean_and_all_of_the_motion_is_made() {
        for kind in KINDS {
            for (x, y) in [(10.0, 20.0), (33.3, 33.3), (0.0, 15.0), (100.0, 0.0), (0.0, 0.0)] {
                for couples_axes in [false, true] {
                    let hertz = [x, y].map(Millimetres::from_num);
                    let damping = Millimetres::from_num(0.1);
                    let resonance = Resonance { kind, hertz, damping };
                    let shaping = Shaping::new(&resonance, couples_axes).expect("fits");
                    let means = shaping.pulses.map(|pulses| mean(&pulses));
                    assert!(means[0].abs_diff(means[1]) <= 1, "{means:?}");
                    let whole = if couples_axes { 1 << 15 } else { 1 << 16 };
                    assert_eq!(shaping.pulses.map(|pulses| weight(&pulses)), [whole; 2]);
                    assert!(shaping.longest() <= LONGEST_DELAY);
                }
            }
        }
    }

    #[test]
    fn a_frequency_that_is_too_low_is_refused_by_the_least_one_that_works() {
        for kind in KINDS {
            for damping in [0.0, 0.1, 0.5] {
                let least = shaping(kind, [1.0, 0.0], damping).expect_err("too low");
                let fits = |hundredths: u32| {
                    let hertz = f64::from(hundredths) / 100.0;
                    shaping(kind, [40.0, hertz], damping).map(|shaping| shaping.longest)
                };
                assert_eq!(fits(least - 2), Err(least));
                assert!(fits(least).expect("fits") <= LONGEST_DELAY);
                assert!(least < 1000, "{kind:?}: {least}");
            }
        }
    }

    #[test]
    fn the_deviation_limits_the_acceleration_and_the_corners() {
        let shaping = shaping(ShaperKind::Zv, [10.0, 40.0], 0.0).expect("fits");
        let bounds = |deviation: f64| {
            let [deviation, acceleration, junction] =
                [deviation, 800.0, 0.05].map(Millimetres::from_num);
            let (acceleration, junction) = shaping.bounds(deviation, acceleration, junction);
            (acceleration.to_num::<f64>(), junction.to_num::<f64>())
        };
        assert_eq!(bounds(5.0), (800.0, Millimetres::from_num(0.05).to_num()));
        // Delays of 0 and 50 ms: a variance of 25² ms², and 12.5 ms as half the mean distance.
        let (acceleration, junction) = bounds(0.25);
        assert!((acceleration - 0.8 * 2f64.sqrt() * 0.25 / 0.025f64.powi(2)).abs() < 0.1);
        let change = (8.0 * acceleration * junction).sqrt();
        let cut = f64::from(RUN_TIME) / PER_SECOND as f64 / 4.0;
        assert!((change * (0.0125 + cut) - 0.05).abs() < 0.001, "{change}");
    }
}
