//! Chooses the points at which a line on the page is cut into segments on a polargraph, so that the
//! belt lengths change almost linearly within each segment.

use super::{Anchors, in_order, length_of};
use crate::drawing::PagePoint;

/// Stands for "no limit": a position beyond the end of every line, in steps.
const FAR: i32 = 1 << 24;
/// The least distance of a cut from the ends of the line, in steps. A belt step next to a closer
/// cut could lie beyond the end.
const NEAR: i32 = 2;

/// The cuts of a line, in steps from its beginning. The cuts are the same points when the line is
/// drawn backward.
///
/// Along a line, the length of a belt of length a has a curvature of at most 1/a, so a chord of
/// length h is off by at most h²/8a. The longest segment is chosen so that this is 1/64 of a step.
/// A point may lie at most half a step off the line, and rounding uses less of this half step the
/// more the other belt moves: where this belt makes s steps for each step of the other, s/2 steps
/// remain. But at a distance of t steps from the foot of the perpendicular from its anchor, s may
/// be as small as t/a. Segments there are √(2t) long, which uses s/4. The foot itself is a cut,
/// because the belt reverses there.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::machine::{Anchors, CutPositions};
/// let anchors = Anchors { left: PagePoint { x: -100, y: 60_000 }, width: 64_000 };
/// let [from, to] = [0, 1000].map(|x| PagePoint { x, y: 0 });
/// let walk = |cuts: CutPositions| {
///     let numbers = core::iter::successors(Some(0), move |&cut| Some(cuts.next(cut)));
///     numbers.take(9).collect::<Vec<_>>()
/// };
/// assert_eq!(walk(CutPositions::new(anchors, from, to)), [0, 13, 28, 45, 62, 81, 100, 121, 142]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CutPositions {
    /// The feet of the perpendiculars from both anchors, the first along the line first.
    feet: [i32; 2],
    /// The point halfway between the feet. Up to it the first foot counts, behind it the second.
    middle: i32,
    /// The length of the line, in steps.
    length: i32,
    /// The length of the longest segment, in steps; an even number.
    longest: i32,
    /// Whether the line runs from its greater end to its lesser one.
    backward: bool,
}

impl CutPositions {
    /// The cuts of the line from `from` to `to`, which lies below the anchors.
    pub fn new(anchors: Anchors, from: PagePoint, to: PagePoint) -> Self {
        let Anchors { left, width } = anchors;
        let ([first, last], backward) = in_order([from, to]);
        let (dx, dy) = (last.x - first.x, last.y - first.y);
        let length = length_of(dx, dy);
        let product = |a: i32, b: i32| i64::from(a) * i64::from(b);
        let foot = |x: i32| {
            let foot = product(x - first.x, dx) + product(left.y - first.y, dy);
            // The foot is no farther away than the anchor.
            foot.checked_div(length.into()).unwrap_or(0) as i32
        };
        // The lesser end is the left one, so the foot of the left anchor comes first.
        let (low, high) = (foot(left.x), foot(left.x + width));
        let middle = low + (high - low) / 2;
        // No belt is shorter than the vertical distance of the line from the anchors.
        let least = (left.y - first.y.max(last.y)).max(1).unsigned_abs();
        let longest = ((least / 8).isqrt() as i32 & !1).max(2);
        let (feet, middle) = if backward {
            ([length - high, length - low], length - middle)
        } else {
            ([low, high], middle)
        };
        Self { feet, middle, length, longest, backward }
    }

    /// The next cut after `cut` (0 is the beginning of the line), or the end of the line.
    pub fn next(&self, cut: i32) -> i32 {
        let from = cut.max(NEAR - 1);
        let [first, second] = self.feet;
        let (foot, most) = if from < self.middle { (first, self.middle) } else { (second, FAR) };
        let next = (foot + self.beyond(from - foot)).min(most);
        if next > self.length - NEAR { self.length } else { next }
    }

    /// The length of the line up to a cut, in units in which the whole line is `whole` long.
    pub fn position(&self, cut: i32, whole: u32) -> u32 {
        let from_lesser = if self.backward { self.length - cut } else { cut };
        let product = u64::from(whole) * u64::from(from_lesser.unsigned_abs());
        let position = product.checked_div(self.length.unsigned_abs().into()).unwrap_or(0) as u32;
        if self.backward { whole - position } else { position }
    }

    /// The least cut that lies more than `distance` steps beyond the foot. The cuts before the foot
    /// mirror those after it.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn beyond(&self, distance: i32) -> i32 {
        let longest = self.longest;
        // From this distance on, all segments have the same length.
        let even = longest * (longest / 2);
        let last_within = |distance: i32| {
            if distance < even {
                (2 * distance).unsigned_abs().isqrt() as i32
            } else {
                longest + (distance - even).checked_div(longest).unwrap_or(0)
            }
        };
        let cut = |k: i32| {
            if k < longest { (k * k + 1) / 2 } else { even + (k - longest) * longest }
        };
        if distance < 0 { -cut(last_within(-distance - 1)) } else { cut(last_within(distance) + 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn walk(anchors: Anchors, from: PagePoint, to: PagePoint) -> Vec<i32> {
        let cuts = CutPositions::new(anchors, from, to);
        let mut all = std::vec![0];
        while let Some(&cut) = all.last().filter(|cut| **cut != cuts.length) {
            all.push(cuts.next(cut));
        }
        all
    }

    #[test]
    fn a_line_has_the_same_cuts_forward_and_backward_and_each_foot_is_one() {
        for (width, height) in [(64_000, 60_000), (3_000, 900), (500, 40)] {
            let anchors = Anchors { left: PagePoint { x: -width / 5, y: height }, width };
            for (x, y) in [(width, 0), (width, -300), (width / 2, -7000), (0, -9), (1, 0), (0, 0)] {
                let (from, to) = (PagePoint { x: -width / 2, y: 0 }, PagePoint { x, y });
                let there = walk(anchors, from, to);
                let back = walk(anchors, to, from);
                let end = back.last().copied().unwrap_or_default();
                assert!(
                    there.iter().eq(back
                        .iter()
                        .rev()
                        .map(|cut| end - cut)
                        .collect::<Vec<_>>()
                        .iter())
                );
                assert!(there.is_sorted_by(|a, b| a < b), "{there:?}");
                let cuts = CutPositions::new(anchors, from, to);
                assert!(there.windows(2).all(|ends| ends[1] - ends[0] <= cuts.longest + 2));
                for foot in cuts.feet {
                    assert!(!(NEAR..=cuts.length - NEAR).contains(&foot) || there.contains(&foot));
                }
            }
        }
    }
}
