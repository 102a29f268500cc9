//! How fast the corner between two blocks may be passed.

use super::{Limits, PathLength};

/// The direction of a block, as a vector of length 2^30.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Heading {
    x: i32,
    y: i32,
}

impl Heading {
    /// The direction of a move by (`dx`, `dy`) steps of the given `length`, which is not 0.
    pub(super) fn new(limits: &Limits, dx: i32, dy: i32, length: PathLength) -> Self {
        let [step_x, step_y] = limits.step_length;
        // One division for both parts: 2^63 over a length from 2^31 on.
        let length = length.to_bits().max(1);
        let zeros = length.leading_zeros();
        let scale = u64::from(1u32 << zeros);
        let inverse = (1u64 << 63).checked_div((length << zeros).into()).unwrap_or(0);
        let part = |steps: i32, step: u32| {
            // In units of 2^-32 mm, where the length is in 2^-18 mm. Except for rounding, a
            // component is no longer than the whole, which is below 2^46. So 32 bits hold it in
            // units of the shifted length.
            let part = u64::from(steps.unsigned_abs()) * u64::from(step);
            // A multiplication is used as a shift, because it is one instruction where a shift of
            // 64 bits is a call.
            let part = ((part * scale) >> 14).min(u32::MAX.into());
            let heading = (part * inverse) >> 33;
            // At most 2^30, except for rounding.
            let heading = heading.min(1 << 30) as i32;
            if steps < 0 { -heading } else { heading }
        };
        Self { x: part(dx, step_x.to_bits()), y: part(dy, step_y.to_bits()) }
    }
}

/// How a corner may be passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Corner {
    /// The stopping distance of the greatest speed at the corner.
    pub(super) limit: PathLength,
    /// Whether the path turns by more than 40°, so that it is no curve.
    pub(super) is_sharp: bool,
}

impl Corner {
    /// A corner at which the machine must come to rest anyway.
    pub(super) const STOP: Self = Self { limit: PathLength::ZERO, is_sharp: true };
    /// No corner: the path goes straight on.
    pub(super) const NONE: Self = Self { limit: PathLength::MAX, is_sharp: false };
}

/// Computes how the corner between two blocks may be passed, given the length of the shorter one.
///
/// Junction deviation δ rounds a corner of turning angle θ by an arc of radius δ cos(θ/2) / (1 -
/// cos(θ/2)), half of which is the stopping distance. If the blocks are too short for that arc, the
/// arc that touches both in the middle of the shorter one counts instead, whose radius is ½ l /
/// tan(θ/2). On a dense polyline that is the circle through its points.
///
/// Points lie on the grid of steps, so a corner may be mere rounding. It therefore counts as less
/// sharp by as much as rounding can explain.
///
/// Between the two there may be short moves, of which two directions tell nothing: a `gap` of some
/// steps. The arc may then be as much longer, and where they cut the corner, they deviate from it
/// themselves: by some ¼ l tan(θ/2) where they are an arc of the length l.
// Where each chord is pushed: elsewhere it would drive that out of the cache.
#[cfg_attr(not(feature = "lm3s6965"), inline(always))]
pub(super) fn corner(
    limits: &Limits,
    before: Heading,
    after: Heading,
    shorter: PathLength,
    gap: PathLength,
) -> Corner {
    // With unit vectors u, v: |u + v| = 2 cos(θ/2), |v - u| = 2 sin(θ/2).
    let (dx, dy) = (after.x.wrapping_sub(before.x), after.y.wrapping_sub(before.y));
    let rounding = u64::from(limits.rounding.to_bits()) << 30;
    let shorter = shorter.to_bits().max(1);
    // Fast path: on dense curves rounding explains the whole corner, which is known without a
    // square root.
    let most = dx.unsigned_abs() / 2 + dy.unsigned_abs() / 2 + 1;
    if u64::from(most) * u64::from(shorter) <= rounding {
        return Corner::NONE;
    }
    let sine = half_length(dx, dy).saturating_sub(rounding / u64::from(shorter));
    if sine == 0 {
        return Corner::NONE;
    }
    let cosine = half_length(before.x.wrapping_add(after.x), before.y.wrapping_add(after.y));
    // Lengths are rounded to whole units, and so are the directions. A path that turns back must
    // come to rest.
    let cosine = if cosine * u64::from(shorter) <= 1 << 30 { 0 } else { cosine };
    let gap = u64::from(gap.to_bits());
    let by_deviation = {
        // δ c (1 + c) / s² is used in place of δ c / (1 - c), because 1 - c would lose all its
        // digits in a slight bend. The gap adds ¼ l s / c to δ; it is below 2^20.
        let cut = (gap * sine) >> 2;
        let scaled = (u64::from(limits.junction_deviation.to_bits()) * cosine + cut) >> 30;
        let doubled = scaled * ((1 << 30) + cosine);
        doubled / ((sine * sine) >> 30).max(1)
    };
    let radius = if limits.centripetal {
        // The length is below 2^32, and the cosine at most 2^30.
        by_deviation.min((u64::from(shorter) + gap) * cosine / (2 * sine))
    } else {
        by_deviation
    };
    Corner {
        limit: PathLength::from_bits(u32::try_from(radius / 2).unwrap_or(u32::MAX)),
        // sin 20°
        is_sharp: sine > (1 << 30) / 1000 * 342,
    }
}

/// Whether one of two lines cannot be a chord of the curve that the other is part of, because it is
/// four times as long and more than 32 times what rounding explains. A single step beside a long
/// line proves nothing. So a curve of single steps in which collinear ones are joined remains one
/// curve.
// Like `corner`.
#[cfg_attr(not(feature = "lm3s6965"), inline(always))]
pub(super) fn bends_apart(limits: &Limits, one: PathLength, other: PathLength) -> bool {
    let (shorter, longer) = (one.min(other).to_bits(), one.max(other).to_bits());
    let rounding = limits.rounding.to_bits();
    longer >> 5 > rounding && shorter > rounding && shorter < longer >> 2
}

/// Returns half the length of a vector whose components are within ±2^31; at most 2^30.
// Like `corner`.
#[cfg_attr(not(feature = "lm3s6965"), inline(always))]
fn half_length(x: i32, y: i32) -> u64 {
    let square = |part: i32| u64::from(part.unsigned_abs()) * u64::from(part.unsigned_abs());
    // With a unit of rounding, two directions can add up to 2^31, which fits 32 unsigned bits.
    (square(x) / 4 + square(y) / 4).isqrt().min(1 << 30)
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::settings;
    use super::*;
    use crate::fixed::Millimetres;

    #[test]
    fn a_path_that_turns_back_stands() {
        let junction_deviation_mm = Millimetres::ONE;
        let settings = crate::motion::MotionSettings { junction_deviation_mm, ..settings() };
        let limits = Limits::new(&settings).expect("valid");
        for (x, y) in (1..40).flat_map(|x| (0..40).map(move |y| (x, y))) {
            let length = |times| limits.length(times * x, times * y).expect("short");
            let heading = |times| Heading::new(&limits, times * x, times * y, length(times));
            let corner = corner(&limits, heading(-2), heading(1), length(1), PathLength::ZERO);
            // A single step may be nothing but rounding.
            assert!(corner.limit == 0 || x.max(y) == 1, "{x} {y}: {corner:?}");
        }
    }
}
