//! Where a line of the page is cut on a polargraph, so that the belts run nearly straight in between.

use super::Anchors;
use super::kinematics::{in_order, length_of};
use crate::drawing::PagePoint;

/// Beyond every line.
const FAR: i32 = 1 << 24;
/// Nearer to an end is no cut: the belts' step next to it could lie beyond the end.
const NEAR: i32 = 2;

/// The cuts of a line, in steps from its lesser end: the same ones forward and backward.
///
/// Along a line a belt of length a bends by 1/a at most, so a chord of length h is off by h²/8a: 1/64 of a step
/// for the longest. Of the half step that a point may lie off the line, rounding needs less the more the other belt moves: where
/// this one makes s steps for each of that, s/2 is to spare. But t steps from the foot of its anchor's
/// perpendicular s may be t/a only, so there pieces are √(2t) long, which takes s/4; and at the foot √(a/128), which
/// is 1/1024 of a step. The foot itself is a cut, for the belt turns round there.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::machine::{Anchors, Cuts};
/// let anchors = Anchors { left: PagePoint { x: -100, y: 60_000 }, width: 64_000 };
/// let [from, to] = [0, 1000].map(|x| PagePoint { x, y: 0 });
/// let walk = |cuts: Cuts| {
///     core::iter::successors(Some(cuts.start()), move |&cut| Some(cuts.next(cut))).take(9).collect::<Vec<_>>()
/// };
/// assert_eq!(walk(Cuts::new(anchors, from, to)), [0, 20, 40, 60, 80, 100, 121, 142, 165]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cuts {
    /// The feet of both perpendiculars, the lesser first.
    feet: [i32; 2],
    length: i32,
    /// Of the pieces; both are even.
    shortest: i32,
    longest: i32,
    backward: bool,
}

impl Cuts {
    /// Those of a line below the anchors.
    pub fn new(anchors: Anchors, from: PagePoint, to: PagePoint) -> Self {
        let Anchors { left, width } = anchors;
        let [first, last] = in_order([from, to]);
        let (dx, dy) = (last.x - first.x, last.y - first.y);
        let length = length_of(dx, dy);
        let feet = [0, width].map(|x| {
            let product = |a: i32, b: i32| i64::from(a) * i64::from(b);
            let foot = product(left.x + x - first.x, dx) + product(left.y - first.y, dy);
            let foot = foot.checked_div(length.into()).unwrap_or(0);
            foot.clamp((-FAR).into(), FAR.into()) as i32
        });
        // No belt is shorter than the line lies below the anchors.
        let least = (left.y - first.y.max(last.y)).max(1).unsigned_abs();
        let even_root = |square: u32| ((square.isqrt() & !1) as i32).max(2);
        Self {
            feet: [feet[0].min(feet[1]), feet[0].max(feet[1])],
            length,
            shortest: even_root(least / 128),
            longest: even_root(least / 8),
            backward: first != from,
        }
    }

    /// Where the line begins.
    pub fn start(&self) -> i32 {
        if self.backward { self.length } else { 0 }
    }

    /// The cut behind the one at `cut`, or the line's end.
    pub fn next(&self, cut: i32) -> i32 {
        let [low, high] = self.feet;
        let middle = low + (high - low) / 2;
        if self.backward {
            let from = cut.min(self.length - NEAR + 1);
            let (foot, least) = if from > middle { (high, middle) } else { (low, -FAR) };
            let next = (foot - self.beyond(foot - from)).max(least);
            if next < NEAR { 0 } else { next }
        } else {
            let from = cut.max(NEAR - 1);
            let (foot, most) = if from < middle { (low, middle) } else { (high, FAR) };
            let next = (foot + self.beyond(from - foot)).min(most);
            if next > self.length - NEAR { self.length } else { next }
        }
    }

    /// How much of the line is done at a cut if all of it is `whole`.
    pub fn place(&self, cut: i32, whole: u32) -> u32 {
        let product = u64::from(whole) * u64::from(cut.unsigned_abs());
        let place = product.checked_div(self.length.unsigned_abs().into()).unwrap_or(0) as u32;
        if self.backward { whole - place } else { place }
    }

    /// The least cut that lies more than `way` behind the foot; they lie the same before it.
    fn beyond(&self, way: i32) -> i32 {
        let Self { shortest, longest, .. } = *self;
        // Cut k lies k²/2 from the foot where pieces grow.
        let [begin, end] = [shortest, longest].map(|length| length * (length / 2));
        let root = |square: i32| square.unsigned_abs().isqrt() as i32;
        let cut = |k: i32| (k * k + 1) / 2;
        match way {
            ..0 => {
                // The greatest below it.
                let least = -way - 1;
                if least < begin {
                    -(least / shortest * shortest)
                } else if least < end {
                    -cut(root(2 * least))
                } else {
                    -(end + (least - end) / longest * longest)
                }
            }
            _ if way < begin => (way / shortest + 1) * shortest,
            _ if way < end => cut(root(2 * way) + 1),
            _ => end + ((way - end) / longest + 1) * longest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn walk(anchors: Anchors, from: PagePoint, to: PagePoint) -> Vec<i32> {
        let cuts = Cuts::new(anchors, from, to);
        let end = cuts.length - cuts.start();
        let mut all = std::vec![cuts.start()];
        while let Some(&cut) = all.last().filter(|cut| **cut != end) {
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
                let mut back = walk(anchors, to, from);
                back.reverse();
                assert_eq!(there, back);
                assert!(there.is_sorted_by(|a, b| a < b), "{there:?}");
                let cuts = Cuts::new(anchors, from, to);
                assert!(there.windows(2).all(|ends| ends[1] - ends[0] <= cuts.longest + 2));
                for foot in cuts.feet {
                    assert!(!(NEAR..=cuts.length - NEAR).contains(&foot) || there.contains(&foot));
                }
            }
        }
    }
}
