//! Computes the distance between two points of the page, exactly and with integers only, and the
//! lengths of a tour.
//!
//! Whatever orders strokes compares lengths of pen moves, so this is its most frequent computation.
//! The square root avoids divisions, which small cores do not have.

use super::network::start_point;
use super::{Leg, Options, Report, Shape};
use crate::array::MapEach as _;
use crate::drawing::{Drawing, PagePoint, StepsPerMillimetre};
use crate::index::Index;

/// Returns the distance between two points of the page in 1/256 steps, rounded down.
///
/// The points must be within ±[`PAGE_LIMIT`](crate::drawing::PAGE_LIMIT): then the square fits 43
/// bits and the distance 30.
///
/// ```
/// use penup::{drawing::PagePoint, order::length};
/// let origin = PagePoint { x: 0, y: 0 };
/// assert_eq!(length(origin, PagePoint { x: 3, y: -4 }), 5 << 8);
/// assert_eq!(length(origin, PagePoint { x: 1, y: 1 }), 362);
/// ```
pub fn length(a: PagePoint, b: PagePoint) -> u32 {
    root(square(a, b) << 16)
}

/// [`y_in_x`] where the steps of x and y are equal.
const EQUAL: u32 = 1 << 20;

/// How many steps of x are as long as a step of y, in units of 2^-20. It is [`EQUAL`] if the steps
/// are not known.
pub(crate) fn y_in_x([x, y]: StepsPerMillimetre) -> u32 {
    let [x, y] = [x, y].map_each(|steps| u64::from(steps.to_bits().unsigned_abs()));
    (x << 20).checked_div(y).unwrap_or(EQUAL.into()).min(u32::MAX.into()) as u32
}

/// Returns the distance between two points of the page in 1/256 steps of x, rounded down, where a
/// step of y may have another length ([`y_in_x`]). For equal steps it is [`length`].
#[inline(never)] // Inlined, it would take room in each of its callers.
pub(crate) fn true_length(a: PagePoint, b: PagePoint, y_in_x: u32) -> u64 {
    let multiply = |a: u32, b: u32| u64::from(a) * u64::from(b);
    let mut x = multiply(a.x.abs_diff(b.x), 1 << 8);
    let mut y = multiply(a.y.abs_diff(b.y), y_in_x) >> 12;
    // The square of what the root takes is below 2^59.
    let mut shift = 0;
    while (x | y) >> 29 != 0 {
        (x, y, shift) = (x >> 1, y >> 1, shift + 1);
    }
    let (x, y) = (x as u32, y as u32);
    u64::from(root(multiply(x, x) + multiply(y, y))) << shift
}

/// Adds the lengths and lifts of `tour` to `report`.
pub(super) fn measure<I: Index>(
    drawing: Drawing<'_, I>,
    tour: &[Leg<I>],
    options: Options,
    report: &mut Report,
) {
    let y_in_x = y_in_x(options.steps);
    let length = |a, b| true_length(a, b, y_in_x);
    // The legs of a tour are segments of its drawing, and `check` has seen that their points exist.
    let position = |leg: Leg<I>| drawing.points[start_point(drawing.segments, leg).get()];
    let closing = match options.shape {
        Shape::OpenPath => None,
        Shape::ClosedCycle => tour.first(),
    };
    let mut pen = tour.first().map(|&leg| position(leg)).unwrap_or_default();
    for &leg in tour {
        report.lifts += u32::from(position(leg) != pen);
        report.pen_up += length(pen, position(leg));
        report.pen_down += length(position(leg), position(leg.flipped()));
        pen = position(leg.flipped());
    }
    if let Some(&leg) = closing {
        report.returns = position(leg) != pen;
        report.lifts += u32::from(report.returns);
        report.pen_up += length(pen, position(leg));
    }
    if y_in_x != EQUAL {
        report.bound = 0;
    }
    report.optimal = report.pen_up == report.bound;
}

/// Returns a lower bound of the distance in 1/256 steps, without a square root: the greater of the
/// differences in x and in y.
#[cfg_attr(feature = "threads", inline)]
pub(super) fn least_length(a: PagePoint, b: PagePoint) -> u32 {
    a.x.abs_diff(b.x).max(a.y.abs_diff(b.y)) << 8
}

/// Returns the square of the distance between two points of the page, in square steps.
pub(super) fn square(a: PagePoint, b: PagePoint) -> u64 {
    let (dx, dy) = (a.x.abs_diff(b.x), a.y.abs_diff(b.y));
    if (dx | dy) >> 16 == 0 {
        // Most pages need only 32-bit products here, which are faster on a core without long ones.
        return u64::from(dx * dx) + u64::from(dy * dy);
    }
    u64::from(dx) * u64::from(dx) + u64::from(dy) * u64::from(dy)
}

/// Where the root's computation starts: 2^15 / √x for x from 1 to 4, in steps of 1/32.
const RECIPROCAL_ROOTS: [u16; 96] = {
    let mut table = [0; 96];
    let mut index = 0;
    while index < table.len() {
        // The guess is for the middle of the interval: x = (2 (index + 32) + 1) / 64.
        let middle = 2 * (index as u64 + 32) + 1;
        table[index] = ((1 << 36) / middle).isqrt() as u16;
        index += 1;
    }
    table
};

/// Returns the square root of `square`, which must be below 2^60, rounded down.
///
/// Two Newton steps approximate the reciprocal root, which needs no division. On a core that has no
/// division this takes a third of the instructions of the general `isqrt`.
pub(super) fn root(square: u64) -> u32 {
    if square == 0 {
        return 0;
    }
    let shift = square.leading_zeros() & !1;
    let multiply = |a: u32, b: u32| u64::from(a) * u64::from(b);
    // A value from 1 to 4, with 30 bits after the binary point.
    let x = ((square << shift) >> 32) as u32;
    // `x` has one of its two highest bits, so there is an entry for it.
    let guess = RECIPROCAL_ROOTS.get(((x >> 25) as usize).wrapping_sub(32));
    let guess = u32::from(guess.copied().unwrap_or_default());
    // Newton's step is g' = g (3 - x g²) / 2; the first gives 15 bits, the second 31.
    let squared = (multiply(x, guess * guess) >> 32) as u32;
    let guess = (multiply(guess, (3 << 28) - squared) >> 13) as u32;
    let squared = (multiply(x, (multiply(guess, guess) >> 32) as u32) >> 32) as u32;
    let guess = (multiply(guess, (3 << 28) - squared) >> 29) as u32;
    let mut root = (multiply(x, guess) >> (30 + shift / 2)) as u32;
    while multiply(root, root) > square {
        root -= 1;
    }
    while multiply(root + 1, root + 1) <= square {
        root += 1;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_true_whatever_the_steps_are() {
        use crate::fixed::Millimetres;
        let steps = |x: i32, y: i32| y_in_x([x, y].map(Millimetres::from_num));
        let origin = PagePoint::default();
        let to = |x, y| PagePoint { x, y };
        for point in [to(1, 1), to(-300, 4), to(77, -1_048_576), to(1_048_576, 1_048_575)] {
            for equal in [steps(80, 80), y_in_x(StepsPerMillimetre::default())] {
                assert_eq!(true_length(origin, point, equal), u64::from(length(origin, point)));
            }
        }
        // 30 mm and 40 mm.
        for (x, y) in [(80, 160), (160, 80), (4000, 2), (2, 4000), (100, 300)] {
            let all = true_length(origin, to(30 * x, 40 * y), steps(x, y));
            let expected = 256 * 50 * x as u64;
            assert!(all.abs_diff(expected) <= 1 + expected / 2000, "{x} {y} {all} {expected}");
        }
    }

    #[test]
    fn the_root_is_exact() {
        let mut square = 1u64;
        for step in 0..2_000_000u64 {
            square = square.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(step | 1);
            let square = square >> (4 + step % 60);
            assert_eq!(u64::from(root(square)), square.isqrt(), "{square}");
            let exact = square.isqrt() * square.isqrt();
            assert_eq!(u64::from(root(exact)), exact.isqrt(), "{exact}");
            let before = exact.saturating_sub(1);
            assert_eq!(u64::from(root(before)), before.isqrt(), "{before}");
        }
        assert_eq!(root((1 << 60) - 1), (1 << 30) - 1);
    }
}
