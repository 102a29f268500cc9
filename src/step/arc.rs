//! Arcs and circles on the step grid, and the joining of their points into long lines that draw
//! exactly these points.

use crate::array::MapEach;
use crate::drawing::PagePoint;
use crate::fixed::Millimetres;

/// The direction in which an arc turns, with y upward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Turn {
    /// Clockwise (G2).
    Clockwise,
    /// Counterclockwise (G3).
    Counterclockwise,
}

/// The reasons why there is no such arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArcError {
    /// The start or the end is the centre.
    NoRadius,
    /// The centre lies more than 2^22 steps from an end, or so far away that steps of different
    /// lengths in x and y cannot be told apart.
    TooWide,
    /// The distances of the two ends from the centre differ by more than two steps, and by more
    /// than a thousandth of the radius, which Grbl takes, too.
    EndOffCircle,
}

/// The points of an arc, without the first. Each point is the one nearest to the circle along x
/// where the circle is steeper in y, otherwise along y. So it is off the circle by at most half a
/// step.
///
/// The points are the same in both drawing directions. The squared radius of the circle is the mean
/// of those of both ends, because the ends may have been rounded. Equal ends make a full circle.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::step::{Arc, Turn};
/// let at = |x, y| PagePoint { x, y };
/// let arc = Arc::new(at(0, 0), at(3, 0), at(0, 3), Turn::Counterclockwise)?;
/// assert_eq!(arc.collect::<Vec<_>>(), [at(3, 1), at(2, 2), at(1, 3), at(0, 3)]);
/// # Ok::<(), penup::step::ArcError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Arc {
    /// The centre of the circle.
    center: PagePoint,
    /// The end of the arc.
    to: PagePoint,
    /// The lengths of a step of x and of y as relative weights, so that the arc is part of a
    /// circle.
    weights: [u16; 2],
    /// Four times the squared radius. Steps are multiplied by their weights first.
    radius: u64,
    /// Half the length of the right and left sides, and half that of the other two: how far each
    /// extends both ways from its middle, in steps.
    half: [i32; 2],
    /// Whether a side ends at the point where the next side begins.
    corner_is_shared: bool,
    /// The current position on the circle, counted in moves counterclockwise.
    position: i32,
    /// The direction: 1 counterclockwise, -1 clockwise.
    step: i8,
    /// The number of points that are still to come.
    remaining: u32,
}

impl Arc {
    /// The arc around `center` from `from` to `to`. Steps of x and y have the same length.
    ///
    /// # Errors
    /// See [`ArcError`].
    pub fn new(
        center: PagePoint,
        from: PagePoint,
        to: PagePoint,
        turn: Turn,
    ) -> Result<Self, ArcError> {
        Self::weighted([1; 2], center, from, to, turn)
    }

    /// The arc around `center` from `from` to `to` where x and y have different numbers of steps
    /// per millimetre. It is a circle on the page, except that an arc of r steps width is off by up
    /// to r²/2^31 steps.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::fixed::Millimetres;
    /// use penup::step::{Arc, Turn};
    /// let at = |x, y| PagePoint { x, y };
    /// let steps = [Millimetres::lit("100"), Millimetres::lit("50")];
    /// let arc = Arc::scaled(steps, at(0, 0), at(4, 0), at(-4, 0), Turn::Counterclockwise)?;
    /// assert!(arc.map(|point| point.y).eq([1, 2, 2, 2, 2, 2, 1, 0]));
    /// # Ok::<(), penup::step::ArcError>(())
    /// ```
    ///
    /// # Errors
    /// See [`ArcError`].
    pub fn scaled(
        steps_per_mm: [Millimetres; 2],
        center: PagePoint,
        from: PagePoint,
        to: PagePoint,
        turn: Turn,
    ) -> Result<Self, ArcError> {
        let extent = [from, to]
            .map(|end| end.x.abs_diff(center.x).max(end.y.abs_diff(center.y)))
            .into_iter()
            .fold(1, u32::max);
        let most = u16::try_from((1 << 30) / extent).unwrap_or(u16::MAX);
        let weights = weights(steps_per_mm, most).ok_or(ArcError::TooWide)?;
        Self::weighted(weights, center, from, to, turn)
    }

    /// Makes the arc for a step of x and a step of y of these relative lengths, each at least 1.
    fn weighted(
        weights: [u16; 2],
        center: PagePoint,
        from: PagePoint,
        to: PagePoint,
        turn: Turn,
    ) -> Result<Self, ArcError> {
        let squared = |end: PagePoint| {
            let (x, y) = (end.x.abs_diff(center.x), end.y.abs_diff(center.y));
            if x.max(y) > 1 << 22 {
                return Err(ArcError::TooWide);
            }
            let [x, y] = [(x, weights[0]), (y, weights[1])]
                .map(|(steps, weight)| u64::from(steps) * u64::from(weight));
            // The squares are at most 2^60; four of them doubled are below 2^63.
            if x.max(y) > 1 << 30 {
                return Err(ArcError::TooWide);
            }
            Ok(x * x + y * y)
        };
        let (first, last) = (squared(from)?, squared(to)?);
        if first == 0 || last == 0 {
            return Err(ArcError::NoRadius);
        }
        let two_steps = 2 * u64::from(weights[0].max(weights[1]));
        let (from_center, to_center) = (first.isqrt(), last.isqrt());
        if from_center.abs_diff(to_center) > two_steps.max(from_center / 1000) {
            return Err(ArcError::EndOffCircle);
        }
        let mut arc = Self {
            center,
            to,
            weights,
            radius: 2 * (first + last),
            half: [0; 2],
            corner_is_shared: false,
            position: 0,
            step: if turn == Turn::Clockwise { -1 } else { 1 },
            remaining: 0,
        };
        arc.find_corner();
        arc.position = arc.position_of(from);
        let ahead = (arc.position_of(to) - arc.position) * i32::from(arc.step);
        arc.remaining =
            if from == to { arc.whole() } else { arc.around(ahead) }.unsigned_abs().max(1);
        Ok(arc)
    }

    /// Finds the upper end of the right side and the right end of the upper side. There the circle
    /// begins to run more along the other axis.
    fn find_corner(&mut self) {
        let [x, y] = self.weights.map_each(|weight| i64::from(weight) * i64::from(weight));
        // This estimates the point at which the circle is equally steep along both axes; the loops
        // below correct it to the exact step.
        let position = |mine: i64, others: i64| {
            let (mine, others) = (mine.unsigned_abs().max(1), others.unsigned_abs());
            // This is the square of the position, at most `radius` / 4 over the square of the
            // axis's weight.
            let square = self.radius / 4 / (mine + others).max(1) * others / mine;
            square.isqrt() as i32 + 1
        };
        let mut half = [position(y, x), position(x, y)];
        while half[0] > 0 && y * i64::from(half[0]) > x * i64::from(self.across(0, half[0])) {
            half[0] -= 1;
        }
        let corner = self.across(0, half[0]);
        while half[1] > 0
            && (half[1] > corner
                || self.across(1, half[1]) < half[0]
                || x * i64::from(half[1]) > y * i64::from(self.across(1, half[1])))
        {
            half[1] -= 1;
        }
        self.half = half;
        self.corner_is_shared = half[1] == corner && half[0] == self.across(1, half[1]);
    }

    /// The number of moves along a side: 0 for the right and left sides, 1 for the others.
    fn moves_of(&self, side: usize) -> i32 {
        (2 * self.half[side] + i32::from(!self.corner_is_shared)).max(1)
    }

    /// The number of moves along the whole circle; at least 4.
    fn whole(&self) -> i32 {
        2 * (self.moves_of(0) + self.moves_of(1))
    }

    /// A position on the circle or beyond it, counted from 0 up to below [`Arc::whole`].
    fn around(&self, position: i32) -> i32 {
        position.checked_rem_euclid(self.whole()).unwrap_or(0)
    }

    /// The least and the greatest coordinates of the points that are still to come.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::step::{Arc, Turn};
    /// let at = |x, y| PagePoint { x, y };
    /// let arc = Arc::new(at(0, 0), at(3, 4), at(-4, 3), Turn::Counterclockwise)?;
    /// assert_eq!(arc.bounds(), (at(-4, 3), at(2, 5)));
    /// # Ok::<(), penup::step::ArcError>(())
    /// ```
    pub fn bounds(&self) -> (PagePoint, PagePoint) {
        let (mut least, mut most) = (self.to, self.to);
        let mut include = |point: PagePoint| {
            least = PagePoint { x: least.x.min(point.x), y: least.y.min(point.y) };
            most = PagePoint { x: most.x.max(point.x), y: most.y.max(point.y) };
        };
        let step = i32::from(self.step);
        if self.remaining > 1 {
            include(self.point_at(self.position + step));
        }
        // In the middle of each side the circle is farthest out.
        for side in 0..4 {
            let middle = self.begin_of(side) + self.half[side % 2];
            let ahead = self.around((middle - self.position) * step);
            if ahead.unsigned_abs() < self.remaining {
                include(self.point_at(middle));
            }
        }
        (least, most)
    }

    /// The position on the circle where a side begins. The right side begins at 0 and runs upward,
    /// then the top side runs to the left, and so on.
    fn begin_of(&self, side: usize) -> i32 {
        let half_turn = self.moves_of(0) + self.moves_of(1);
        half_turn * (side / 2) as i32 + self.moves_of(0) * (side % 2) as i32
    }

    /// Returns the position on the circle that is nearest to `point`.
    fn position_of(&self, point: PagePoint) -> i32 {
        let (x, y) = (point.x - self.center.x, point.y - self.center.y);
        let [weighted_x, weighted_y] = [(x, self.weights[0]), (y, self.weights[1])]
            .map(|(steps, weight)| i64::from(steps) * i64::from(weight) * i64::from(weight));
        let (side, along) = if weighted_x.abs() >= weighted_y.abs() {
            if x >= 0 { (0, y) } else { (2, -y) }
        } else if y > 0 {
            (1, -x)
        } else {
            (3, x)
        };
        let half = self.half[side % 2];
        self.begin_of(side) + along.min(half).max(-half) + half
    }

    /// Returns the point at a position on the circle.
    fn point_at(&self, position: i32) -> PagePoint {
        let (mut position, half_turn) = (self.around(position), self.whole() / 2);
        let is_second = position >= half_turn;
        position -= if is_second { half_turn } else { 0 };
        let side = usize::from(position >= self.moves_of(0));
        let along = position - self.begin_of(side) - self.half[side];
        let out = self.across(side, along);
        let (x, y) = if side == 0 { (out, along) } else { (-along, out) };
        let (x, y) = if is_second { (-x, -y) } else { (x, y) };
        PagePoint { x: self.center.x + x, y: self.center.y + y }
    }

    /// The distance from the centre, rounded to whole steps, at which the circle crosses the offset
    /// `along` of a side.
    fn across(&self, side: usize, along: i32) -> i32 {
        let out = u32::from(self.weights[side]).max(1);
        let along = u64::from(along.unsigned_abs()) * u64::from(self.weights[1 - side]);
        // The number has at most 63 bits, so its root fits.
        let doubled = self.radius.saturating_sub(4 * along * along).isqrt() as u32;
        ((doubled + out) / (2 * out)) as i32
    }
}

/// Finds the weights of a step of x and of y, neither above `most`, whose ratio is as near as
/// possible to the ratio of the step lengths: to half of 1 / `most`, or better. Returns `None` if
/// one step is more than `most` times as long as the other.
fn weights(steps_per_mm: [Millimetres; 2], most: u16) -> Option<[u16; 2]> {
    let most = u32::from(most);
    let [mut x, mut y] = steps_per_mm.map_each(|steps| steps.to_bits().unsigned_abs());
    // The loop computes the convergents of the continued fraction of y / x, because the length of a
    // step of x is proportional to the steps per millimetre of y.
    let (mut before, mut ratio) = ([0u32, 1], [1u32, 0]);
    while let Some(whole) = y.checked_div(x) {
        let room = |part: usize| (most - before[part]).checked_div(ratio[part]);
        let times = whole.min(room(0).unwrap_or(whole)).min(room(1).unwrap_or(whole));
        // A semiconvergent is nearer to the ratio only if it takes at least half of the partial
        // quotient.
        if times < whole && 2 * u64::from(times) <= u64::from(whole) {
            break;
        }
        (before, ratio) = (ratio, [0, 1].map_each(|part| times * ratio[part] + before[part]));
        if times < whole {
            break;
        }
        (x, y) = (y % x, x);
    }
    ratio.iter().all(|part| *part > 0).then_some(ratio.map_each(|part| part as u16))
}

impl Iterator for Arc {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        self.remaining = self.remaining.checked_sub(1)?;
        if self.remaining == 0 {
            return Some(self.to);
        }
        self.position += i32::from(self.step);
        Some(self.point_at(self.position))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::Chords;
    use std::vec::Vec;

    fn at(x: i32, y: i32) -> PagePoint {
        PagePoint { x, y }
    }

    /// All points of an arc, including the first.
    fn points(center: PagePoint, from: PagePoint, to: PagePoint, turn: Turn) -> Vec<PagePoint> {
        let arc = Arc::new(center, from, to, turn).expect("an arc");
        core::iter::once(from).chain(arc).collect()
    }

    fn are_moves(points: &[PagePoint]) -> bool {
        points
            .windows(2)
            .all(|p| p[0] != p[1] && p[0].x.abs_diff(p[1].x) <= 1 && p[0].y.abs_diff(p[1].y) <= 1)
    }

    #[test]
    fn circles_are_closed_within_half_a_step_and_the_same_both_ways() {
        for radius in 1..120 {
            let start = at(7 + radius, -3);
            let there = points(at(7, -3), start, start, Turn::Counterclockwise);
            let mut back = points(at(7, -3), start, start, Turn::Clockwise);
            assert!(are_moves(&there), "radius {radius}");
            for p in &there {
                let distance = f64::from(p.x - 7).hypot(f64::from(p.y + 3));
                assert!((distance - f64::from(radius)).abs() <= 0.5, "radius {radius} at {p:?}");
            }
            back.reverse();
            assert_eq!(there, back);
        }
    }

    #[test]
    fn circles_of_the_page_are_round_within_half_a_step_and_the_same_both_ways() {
        for (x, y) in [(80.0, 100.0), (100.0, 33.3), (20.0, 400.0), (79.97, 80.013), (3.0, 2.0)] {
            let steps = [x, y].map(Millimetres::from_num);
            for radius in [1, 2, 3, 7, 20, 95, 400, 4001] {
                let (center, start) = (at(7, -3), at(7 + radius, -3));
                let circle = |turn| {
                    let arc = Arc::scaled(steps, center, start, start, turn).expect("a circle");
                    core::iter::once(start).chain(arc).collect::<Vec<_>>()
                };
                let there = circle(Turn::Counterclockwise);
                let mut back = circle(Turn::Clockwise);
                back.reverse();
                assert_eq!(there, back);
                let (wide, high) = (f64::from(radius), f64::from(radius) / x * y);
                for p in &there {
                    let (px, py) = (f64::from(p.x - 7).abs(), f64::from(p.y + 3).abs());
                    // Along the axis on which it is nearer.
                    let across = |a: f64, b: f64, along: f64| {
                        a * (1.0 - (along / b).powi(2)).max(0.0).sqrt()
                    };
                    let off = (across(wide, high, py) - px)
                        .abs()
                        .min((across(high, wide, px) - py).abs());
                    assert!(off <= 0.51, "{x} {y}, radius {radius} at {p:?}: {off}");
                }
                // Where the arc turns within less than a step, consecutive points need not be one
                // move apart.
                if wide * wide > 2.0 * high && high * high > 2.0 * wide {
                    assert!(are_moves(&there), "{x} {y}, radius {radius}");
                }
                let (least, most) = Arc::scaled(steps, center, start, start, Turn::Clockwise)
                    .expect("a circle")
                    .bounds();
                let extreme = |of: fn(&PagePoint) -> i32| {
                    let all = there.iter().map(of);
                    (all.clone().min(), all.max())
                };
                assert_eq!(extreme(|p| p.x), (Some(least.x), Some(most.x)));
                assert_eq!(extreme(|p| p.y), (Some(least.y), Some(most.y)));
            }
        }
    }

    #[test]
    fn weights_are_those_of_the_steps_lengths() {
        let of = |x: f64, y: f64, most| weights([x, y].map(Millimetres::from_num), most);
        assert_eq!(of(80.0, 80.0, 9), Some([1, 1]));
        assert_eq!(of(80.0, 100.0, 9), Some([5, 4]));
        assert_eq!(of(4000.0, 2.0, 900), None);
        for most in [500u16, 3000, 65_535] {
            for (x, y) in [(79.97, 80.013), (123.4567, 7.89), (400.0, 399.9), (80.0, 80.03)] {
                let [a, b] = of(x, y, most).expect("near").map(f64::from);
                assert!(a.max(b) <= f64::from(most));
                let wrong = (a / b * x / y - 1.0).abs();
                assert!(wrong < 0.51 / f64::from(most) + 2e-6, "{x} {y}: {a} {b}");
            }
        }
    }

    #[test]
    fn arcs_between_any_two_points_of_a_circle() {
        for radius in [1, 2, 5, 6, 25, 65] {
            let start = at(radius, 0);
            let circle = points(at(0, 0), start, start, Turn::Counterclockwise);
            for (i, &from) in circle.iter().enumerate().step_by(3) {
                for (j, &to) in circle.iter().enumerate().step_by(2) {
                    if from == to {
                        continue;
                    }
                    let there = points(at(0, 0), from, to, Turn::Counterclockwise);
                    let mut back = points(at(0, 0), to, from, Turn::Clockwise);
                    back.reverse();
                    assert_eq!(there, back);
                    assert!(are_moves(&there), "{from:?} {to:?}");
                    let moves = (j as i32 - i as i32).rem_euclid(circle.len() as i32 - 1);
                    // Both given ends are off the circle, so the circle of the arc is a little
                    // wider or narrower.
                    assert!((there.len() as i32 - moves).abs() <= 9, "{from:?} {to:?}");
                }
            }
        }
    }

    #[test]
    fn ends_off_the_circle_are_reached_and_bad_arcs_refused() {
        let arc = Arc::new(at(0, 0), at(100, 0), at(1, 102), Turn::Counterclockwise).expect("near");
        assert_eq!(Chords::new(at(100, 0), arc).last(), Some(at(1, 102)));
        let refused = |center, from, to| Arc::new(center, from, to, Turn::Clockwise).err();
        assert_eq!(refused(at(0, 0), at(0, 0), at(1, 0)), Some(ArcError::NoRadius));
        assert_eq!(refused(at(0, 0), at(9, 0), at(0, 5)), Some(ArcError::EndOffCircle));
        assert_eq!(refused(at(i32::MAX, 0), at(i32::MIN, 0), at(0, 0)), Some(ArcError::TooWide));
        let far = 1 << 22;
        assert_eq!(refused(at(0, 0), at(far, 0), at(0, -far)), None);
        assert_eq!(refused(at(0, 0), at(far + 1, 0), at(0, -far)), Some(ArcError::TooWide));
        assert_eq!(refused(at(0, 0), at(far, 0), at(0, -far - 1)), Some(ArcError::TooWide));
        // The end may be two steps off the circle, measured in steps of y where these are twice as
        // long as steps of x.
        assert_eq!(refused(at(0, 0), at(9, 0), at(0, 11)), None);
        assert_eq!(refused(at(0, 0), at(9, 0), at(0, 12)), Some(ArcError::EndOffCircle));
        let steps = [100, 50].map(Millimetres::from_num);
        let refused = |to| Arc::scaled(steps, at(0, 0), at(8, 0), to, Turn::Clockwise).err();
        assert_eq!(refused(at(0, 6)), None);
        assert_eq!(refused(at(0, 7)), Some(ArcError::EndOffCircle));
    }
    #[test]
    fn an_arc_is_refused_beyond_its_greatest_extent() {
        const MOST: i32 = 1 << 22;
        for turned in [false, true] {
            let point = |far: i32| if turned { at(0, -far) } else { at(far, 0) };
            let arc = |far: i32| Arc::new(at(0, 0), point(far), point(-far), Turn::Clockwise);
            assert!(arc(MOST).is_ok());
            assert_eq!(arc(MOST + 1).err(), Some(ArcError::TooWide));
            // Steps of x and y count as this many units.
            let weighted = |weight: u16| {
                let turn = Turn::Clockwise;
                Arc::weighted([weight; 2], at(0, 0), point(MOST), point(-MOST), turn)
            };
            assert!(weighted(256).is_ok());
            assert_eq!(weighted(257).err(), Some(ArcError::TooWide));
        }
    }
}
