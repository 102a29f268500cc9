//! How fast the corner between two blocks may be passed.

use super::{Limits, PathLength};

/// The way in which a block runs: a vector of length 2^30.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Heading {
    x: i32,
    y: i32,
}

impl Heading {
    /// The way of a move by (`dx`, `dy`) steps whose length is `length`, not 0.
    pub(super) fn new(limits: &Limits, dx: i32, dy: i32, length: PathLength) -> Self {
        let [step_x, step_y] = limits.step_length;
        // One division for both parts: 2^63 over a length from 2^31 on.
        let length = length.to_bits().max(1);
        let zeros = length.leading_zeros();
        let scale = u64::from(1u32 << zeros);
        let inverse = (1u64 << 63).checked_div((length << zeros).into()).unwrap_or(0);
        let part = |steps: i32, step: u32| {
            // Units of 2^-32 mm; the length's are 2^-18 mm. A part is no longer than the whole but
            // for rounding, below 2^46, so that 32 bits hold it in units of the length as it is
            // shifted.
            let part = u64::from(steps.unsigned_abs()) * u64::from(step);
            // A product is a shift, and one instruction where a shift of 64 bits is a call.
            let part = ((part * scale) >> 14).min(u32::MAX.into());
            let heading = (part * inverse) >> 33;
            // 2^30 but for rounding.
            let heading = heading.min(1 << 30) as i32;
            if steps < 0 { -heading } else { heading }
        };
        Self { x: part(dx, step_x.to_bits()), y: part(dy, step_y.to_bits()) }
    }
}

/// What a corner allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Corner {
    /// Stopping distance with which it may be passed.
    pub(super) limit: PathLength,
    /// Whether the path turns by more than 40° and so is no curve.
    pub(super) is_sharp: bool,
}

impl Corner {
    /// Where the machine must stand anyway.
    pub(super) const STOP: Self = Self { limit: PathLength::ZERO, is_sharp: true };
}

/// The corner between two blocks, the length of the shorter one given.
///
/// Junction deviation δ rounds a corner of turning angle θ by an arc of radius
/// δ cos(θ/2) / (1 - cos(θ/2)); half of it is the stopping distance. Where the blocks are too short
/// for that arc, the arc that touches both in the middle of the shorter counts, ½ l / tan(θ/2): on
/// a dense polyline that is the circle through its points.
///
/// Points lie on the grid of steps, so a corner may be nothing but rounding: it counts as less
/// sharp by as much as rounding can explain.
#[inline(always)] // Where each chord is pushed: elsewhere it would drive that out of the cache.
pub(super) fn corner(
    limits: &Limits,
    before: Heading,
    after: Heading,
    shorter: PathLength,
) -> Corner {
    const NONE: Corner = Corner { limit: PathLength::MAX, is_sharp: false };
    // With unit vectors u, v: |u + v| = 2 cos(θ/2), |v - u| = 2 sin(θ/2).
    let (dx, dy) = (after.x.wrapping_sub(before.x), after.y.wrapping_sub(before.y));
    let rounding = u64::from(limits.rounding.to_bits()) << 30;
    let shorter = shorter.to_bits().max(1);
    // On dense curves rounding explains all, which takes no root to see.
    let most = dx.unsigned_abs() / 2 + dy.unsigned_abs() / 2 + 1;
    if u64::from(most) * u64::from(shorter) <= rounding {
        return NONE;
    }
    let sine = half_length(dx, dy).saturating_sub(rounding / u64::from(shorter));
    if sine == 0 {
        return NONE;
    }
    let cosine = half_length(before.x.wrapping_add(after.x), before.y.wrapping_add(after.y));
    // Lengths are rounded to whole units, and headings with them: what turns back stands.
    let cosine = if cosine * u64::from(shorter) <= 1 << 30 { 0 } else { cosine };
    let by_deviation = {
        // δ c (1 + c) / s², as 1 - c itself would lose all its digits in a slight bend.
        let scaled = (u64::from(limits.junction_deviation.to_bits()) * cosine) >> 30;
        let doubled = scaled * ((1 << 30) + cosine);
        doubled / ((sine * sine) >> 30).max(1)
    };
    let radius = if limits.centripetal {
        // l below 2^32, c at most 2^30.
        by_deviation.min(u64::from(shorter) * cosine / (2 * sine))
    } else {
        by_deviation
    };
    Corner {
        limit: PathLength::from_bits(u32::try_from(radius / 2).unwrap_or(u32::MAX)),
        // sin 20°
        is_sharp: sine > (1 << 30) / 1000 * 342,
    }
}

/// Whether one of two lines is no chord of the curve that the other is part of: it is four times
/// as long, and more than 32 times what rounding explains. A single step beside it says nothing,
/// so that a curve in steps, in which lines of steps are joined, remains one.
#[inline(always)] // As above.
pub(super) fn bends_apart(limits: &Limits, one: PathLength, other: PathLength) -> bool {
    let (shorter, longer) = (one.min(other).to_bits(), one.max(other).to_bits());
    let rounding = limits.rounding.to_bits();
    longer >> 5 > rounding && shorter > rounding && shorter < longer >> 2
}

/// Half the length of a vector of two parts within ±2^31, at most 2^30.
#[inline(always)] // As above.
fn half_length(x: i32, y: i32) -> u64 {
    let square = |part: i32| u64::from(part.unsigned_abs()) * u64::from(part.unsigned_abs());
    // Opposite headings can add up to 2^31 by one unit of rounding: within 32 unsigned bits.
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
            let corner = corner(&limits, heading(-2), heading(1), length(1));
            // A single step may be nothing but rounding.
            assert!(corner.limit == 0 || x.max(y) == 1, "{x} {y}: {corner:?}");
        }
    }
}
