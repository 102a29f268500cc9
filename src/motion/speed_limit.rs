//! Limits of the speed that belong to a block, beside its corner and its bends, in 16 bits.

use super::limits::slice_speed;
use super::profile::PathSpeed;
use super::{Limits, PathLength, SliceSpeed};
use crate::fixed::Millimetres;

/// A number of 32 bits that is stored in 15: five bits of exponent and eleven significant bits, of
/// which the first one is implied. Numbers below 2^11 are exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Float(u16);

impl Float {
    const MANTISSA_BITS: u32 = 10;
    const IMPLIED: u32 = 1 << Self::MANTISSA_BITS;
    /// A number above all others that are stored, which stands for infinity.
    const MAX: Self = Self(0x7FFF);

    /// The greatest number of this kind that does not exceed `number`.
    const fn rounded_down(number: u32) -> Self {
        let bits = u32::BITS - number.leading_zeros();
        let Some(shift) = bits.checked_sub(Self::MANTISSA_BITS + 1) else {
            return Self(number as u16);
        };
        // The leading bit is implied, so it adds 1 to the exponent.
        Self(((shift << Self::MANTISSA_BITS) + (number >> shift)) as u16)
    }

    /// The nearest number of this kind.
    const fn nearest(number: u32) -> Self {
        let bits = u32::BITS - number.leading_zeros();
        let half = (1 << bits.saturating_sub(Self::MANTISSA_BITS + 1)) / 2;
        Self::rounded_down(number.saturating_add(half))
    }

    /// The significant bits, below 2^11, and the number of bits by which they are shifted.
    const fn parts(self) -> (u32, u32) {
        let mantissa = self.0 as u32 & (Self::IMPLIED - 1);
        match (self.0 as u32 >> Self::MANTISSA_BITS).checked_sub(1) {
            Some(shift) => (mantissa | Self::IMPLIED, shift),
            None => (mantissa, 0),
        }
    }

    const fn value(self) -> u32 {
        let (mantissa, shift) = self.parts();
        if self.0 >= Self::MAX.0 { u32::MAX } else { mantissa << shift }
    }
}

/// The speed of a corner, as a stopping distance that is rounded down. [`Lookahead`] finds with it
/// how fast blocks may be entered when the override has changed.
///
/// [`Lookahead`]: super::Lookahead
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CornerLimit(Float);

impl CornerLimit {
    /// The machine stops at the corner.
    pub(super) const STOP: Self = Self(Float(0));

    /// Stores a limit, rounded down.
    pub(super) const fn new(limit: PathLength) -> Self {
        Self(Float::rounded_down(limit.to_bits()))
    }

    /// The limit as a stopping distance.
    pub(super) const fn limit(self) -> PathLength {
        PathLength::from_bits(self.0.value())
    }
}

/// What limits the speed of a move beside its corners and bends.
///
/// It is stored in 16 bits, of which the first one tells the kinds apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SpeedLimit(u16);

impl Default for SpeedLimit {
    fn default() -> Self {
        Self::NONE
    }
}

impl SpeedLimit {
    const CONSTANT: u16 = 1 << 15;

    /// Nothing limits the speed.
    pub const NONE: Self = Self(Self::CONSTANT | Float::MAX.0);

    /// The least feed, in mm/min. The override may scale it to a tenth.
    pub const LEAST_FEED: Millimetres = Millimetres::lit("0.1");

    /// A feed in mm/min, at least [`SpeedLimit::LEAST_FEED`], which the override scales. It is held
    /// within 0.1 %, and within 0.2 % below 1 mm/min.
    pub fn of_feed(mm_per_min: Millimetres) -> Self {
        let speed = slice_speed(mm_per_min.max(Self::LEAST_FEED));
        speed.map_or(Self::NONE, |speed| Self(Float::nearest(speed.to_bits()).0))
    }

    /// A stopping distance that the override does not change, rounded down by at most 0.1 %.
    pub(super) fn constant(stopping_distance: PathLength) -> Self {
        if stopping_distance == PathLength::MAX {
            return Self::NONE;
        }
        Self(Self::CONSTANT | Float::rounded_down(stopping_distance.to_bits()).0)
    }

    /// The stored number, and whether it is a stopping distance.
    const fn parts(self) -> (Float, bool) {
        (Float(self.0 & !Self::CONSTANT), self.0 & Self::CONSTANT != 0)
    }
}

/// The override, with which the stopping distances of feeds are computed without a division.
#[derive(Debug, Clone, Copy)]
pub(super) struct FeedOverride {
    /// The override in percent.
    percent: u8,
    /// The square of the override, by twice the acceleration, in units of 2^-50.
    factor: u64,
}

impl FeedOverride {
    /// Nothing is scaled. It is in force until the limits are known, and where no block has a feed.
    pub(super) const NONE: Self = Self { percent: 100, factor: u64::MAX };

    /// An override of `percent`.
    pub(super) fn new(limits: &Limits, percent: u8) -> Self {
        // At least 2 * 1000, because the acceleration is at least 10 mm/s²; so the factor is below
        // 2^42.
        let twice = 2 * u64::from(limits.acceleration.to_bits());
        let square = u64::from(percent) * u64::from(percent);
        let factor = (square << 47).checked_div(twice * const { 10_000 / 8 }).unwrap_or(u64::MAX);
        Self { percent, factor }
    }

    /// The greatest stopping distance that the limit allows. That of a feed is rounded up, so that
    /// the machine need not rest between two moves whose feed is low.
    pub(super) fn stopping_distance(&self, limit: SpeedLimit) -> PathLength {
        let (number, is_constant) = limit.parts();
        let bits = if is_constant {
            number.value()
        } else {
            let (mantissa, shift) = number.parts();
            // The speed, in units of 2^-32 mm per slice, is the mantissa shifted; a stopping
            // distance is in units of 2^-18 mm. The product is below 2^22 * 2^42.
            let product = u64::from(mantissa * mantissa).saturating_mul(self.factor);
            let units = product.checked_shr((50 + 14) - 2 * shift).unwrap_or(0);
            u32::try_from(units).unwrap_or(u32::MAX).saturating_add(1)
        };
        PathLength::from_bits(bits)
    }

    /// The greatest speed that the limit allows, which must not be [`SpeedLimit::NONE`].
    pub(super) fn speed(&self, limits: &Limits, limit: SpeedLimit) -> PathSpeed {
        let stopping_distance = self.stopping_distance(limit);
        let (number, is_constant) = limit.parts();
        if is_constant {
            return PathSpeed::of_stopping_distance(limits, stopping_distance);
        }
        let bits = u64::from(number.value()) * u64::from(self.percent) / 100;
        let bits = u32::try_from(bits.max(1)).unwrap_or(u32::MAX);
        PathSpeed { stopping_distance, speed: SliceSpeed::from_bits(bits) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::settings;
    use super::*;
    use crate::motion::MotionSettings;

    #[test]
    fn numbers_are_stored_to_11_significant_bits() {
        for number in (0..5000).chain((0..32).flat_map(|bits| {
            let power = 1u32 << bits;
            [power - 1, power, power + power / 3, power + (power - 1)]
        })) {
            let down = Float::rounded_down(number);
            let nearest = Float::nearest(number);
            assert!(down.value() <= number, "{number}");
            assert!(number - down.value() <= number / 1024, "{number}");
            assert!(nearest.value().abs_diff(number) <= number / 2048 + 1, "{number}");
            assert!(nearest.0 >= down.0 && nearest.0 - down.0 <= 1, "{number}");
            if number < 2048 {
                assert_eq!([down.value(), nearest.value()], [number; 2]);
            }
        }
        assert!(Float::rounded_down(u32::MAX).value() > u32::MAX / 2048 * 2047);
        assert_eq!(CornerLimit::STOP.limit(), 0);
    }

    #[test]
    fn feeds_are_scaled_and_others_are_not() {
        for acceleration in [10, 47, 800, 32_767] {
            let acceleration_mm_per_s2 = Millimetres::from_num(acceleration);
            let settings = MotionSettings { acceleration_mm_per_s2, ..settings() };
            let limits = Limits::new(&settings).expect("valid");
            for percent in [10, 50, 99, 100, 200] {
                let feed_override = FeedOverride::new(&limits, percent);
                for feed in [0.1, 1.0, 7.7, 24.0, 600.0, 3000.0, 16_000.0, 32_767.0] {
                    let limit = SpeedLimit::of_feed(Millimetres::from_num(feed));
                    let PathSpeed { stopping_distance, speed } =
                        feed_override.speed(&limits, limit);
                    // mm/s, and 2^-18 mm.
                    let asked = feed / 60.0 * f64::from(percent) / 100.0;
                    let speed = speed.to_num::<f64>() * 25e6 / 4096.0;
                    let exact = speed * speed / 2.0 / f64::from(acceleration) * 262_144.0;
                    let distance = f64::from(stopping_distance.to_bits());
                    let least = (0.999_9 * exact).min(f64::from(u32::MAX) - 1.0);
                    assert!((speed / asked - 1.0).abs() < 0.01, "F{feed} at {percent} %: {speed}");
                    assert!(
                        distance >= least && distance <= 1.01 * exact + 1.0,
                        "F{feed}: {exact}"
                    );
                }
                for length in [1u32, 1000, 1 << 20, u32::MAX - 1] {
                    let limit = SpeedLimit::constant(PathLength::from_bits(length));
                    let kept = feed_override.stopping_distance(limit).to_bits();
                    assert!(kept <= length && length - kept <= length / 1024, "{length}: {kept}");
                }
                assert_eq!(feed_override.stopping_distance(SpeedLimit::NONE), PathLength::MAX);
            }
        }
        assert_eq!(SpeedLimit::constant(PathLength::MAX), SpeedLimit::NONE);
        assert_eq!(SpeedLimit::default(), SpeedLimit::NONE);
    }
}
