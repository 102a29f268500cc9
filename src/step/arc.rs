//! Arcs and circles on the grid, and the fewest lines that draw exactly their points.

use super::{Direction, Line};
use crate::drawing::PagePoint;
use crate::fixed::Millimetres;

/// Which way an arc turns, y up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Turn {
    /// As the hands of a clock (G2).
    Clockwise,
    /// The other way (G3).
    Counterclockwise,
}

/// Why there is no such arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArcError {
    /// An end is the centre.
    NoRadius,
    /// The centre lies more than 2^22 steps from an end, or so far that steps of different length in x and y
    /// cannot be told apart.
    TooWide,
    /// The ends are not equally far from the centre: more than two steps apart.
    EndOffCircle,
}

/// The points of an arc after its first, each nearest to the circle along the axis on which the arc
/// is steeper: off the circle by half a step at most.
///
/// The same points whichever way it is drawn. The circle's squared radius is the mean of those of
/// both ends, as rounding may have moved them; equal ends make a full circle.
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
    center: PagePoint,
    to: PagePoint,
    /// How much a step of x and of y counts, so that the arc is part of a circle.
    weights: [u16; 2],
    /// Four times the squared radius, weighted.
    radius: u64,
    /// Of the right and left side, and of the others: how far they go both ways from their middle.
    half: [i32; 2],
    /// Whether a side ends where the next one begins.
    corner_is_shared: bool,
    /// Place on the circle, in moves counterclockwise.
    place: i32,
    step: i8,
    remaining: u32,
}

impl Arc {
    /// The arc around `center` from `from` to `to`, steps of x as long as those of y.
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

    /// The same if there are so many steps of x and of y in a millimetre: a circle on the page, but for r²/2^31
    /// steps of one r steps wide.
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
            // Squares of 2^30, four of them doubled: below 2^63.
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
        if first.isqrt().abs_diff(last.isqrt()) > two_steps {
            return Err(ArcError::EndOffCircle);
        }
        let mut arc = Self {
            center,
            to,
            weights,
            radius: 2 * (first + last),
            half: [0; 2],
            corner_is_shared: false,
            place: 0,
            step: if turn == Turn::Clockwise { -1 } else { 1 },
            remaining: 0,
        };
        arc.find_corner();
        arc.place = arc.place_of(from);
        let ahead = (arc.place_of(to) - arc.place) * i32::from(arc.step);
        let whole = 2 * (arc.moves_of(0) + arc.moves_of(1));
        let moves = ahead.rem_euclid(whole);
        arc.remaining = if from == to { whole } else { moves }.unsigned_abs().max(1);
        Ok(arc)
    }

    /// Where the right side ends above, and the upper one on the right: where the circle runs more along the other
    /// axis.
    fn find_corner(&mut self) {
        let [x, y] = self.weights.map(|weight| i64::from(weight) * i64::from(weight));
        // Where it is as steep along both, found to the step.
        let place = |mine: i64, others: i64| {
            let (mine, others) = (mine.unsigned_abs(), others.unsigned_abs());
            // Four times the square; at most a quarter of the radius over the weight.
            let square = self.radius / 4 / (mine + others) * others / mine;
            square.isqrt() as i32 + 1
        };
        let mut half = [place(y, x), place(x, y)];
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

    /// Moves along a side: 0 the right or left one, 1 the others.
    fn moves_of(&self, side: usize) -> i32 {
        (2 * self.half[side] + i32::from(!self.corner_is_shared)).max(1)
    }

    /// The least and the greatest coordinates of its points; those already passed do not count.
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
            include(self.point_at(self.place + step));
        }
        // Where a side is crossed in its middle, the circle is furthest out.
        let half_turn = self.moves_of(0) + self.moves_of(1);
        for side in 0..4 {
            let middle = self.begin_of(side) + self.half[side % 2];
            let ahead = ((middle - self.place) * step).rem_euclid(2 * half_turn);
            if ahead.unsigned_abs() < self.remaining {
                include(self.point_at(middle));
            }
        }
        (least, most)
    }

    /// The place where a side begins: the right side runs up from 0, the top left, and so on.
    fn begin_of(&self, side: usize) -> i32 {
        let half_turn = self.moves_of(0) + self.moves_of(1);
        half_turn * (side / 2) as i32 + self.moves_of(0) * (side % 2) as i32
    }

    /// The place on the circle nearest to `point`.
    fn place_of(&self, point: PagePoint) -> i32 {
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
        self.begin_of(side) + along.clamp(-half, half) + half
    }

    fn point_at(&self, place: i32) -> PagePoint {
        let [mut place, half_turn] = [place, self.moves_of(0) + self.moves_of(1)];
        place = place.rem_euclid(2 * half_turn);
        let is_second = place >= half_turn;
        place -= if is_second { half_turn } else { 0 };
        let side = usize::from(place >= self.moves_of(0));
        let along = place - self.begin_of(side) - self.half[side];
        let out = self.across(side, along);
        let (x, y) = if side == 0 { (out, along) } else { (-along, out) };
        let (x, y) = if is_second { (-x, -y) } else { (x, y) };
        PagePoint { x: self.center.x + x, y: self.center.y + y }
    }

    /// How far out the circle is nearest to at `along` of such a side.
    fn across(&self, side: usize, along: i32) -> i32 {
        let out = u32::from(self.weights[side]);
        let along = u64::from(along.unsigned_abs()) * u64::from(self.weights[1 - side]);
        // The root of 63 bits.
        let doubled = self.radius.saturating_sub(4 * along * along).isqrt() as u32;
        ((doubled + out) / (2 * out)) as i32
    }
}

/// Weights of a step of x and of y, none above `most`, in the ratio of their lengths as nearly as can be: to
/// half of 1 / `most`, or better. `None` if one is longer than so many of the other.
fn weights(steps_per_mm: [Millimetres; 2], most: u16) -> Option<[u16; 2]> {
    let most = u32::from(most);
    let [mut x, mut y] = steps_per_mm.map(|steps| steps.to_bits().unsigned_abs());
    // Convergents of the continued fraction of y / x: a step of x is as long as there are steps of y.
    let (mut before, mut ratio) = ([0u32, 1], [1u32, 0]);
    while let Some(whole) = y.checked_div(x) {
        let room = |part: usize| (most - before[part]).checked_div(ratio[part]);
        let times = whole.min(room(0).unwrap_or(whole)).min(room(1).unwrap_or(whole));
        // Fewer times than whole is nearer from half of it on.
        if times < whole && 2 * u64::from(times) <= u64::from(whole) {
            break;
        }
        (before, ratio) = (ratio, [0, 1].map(|part| times * ratio[part] + before[part]));
        if times < whole {
            break;
        }
        (x, y) = (y % x, x);
    }
    ratio.iter().all(|part| *part > 0).then_some(ratio.map(|part| part as u16))
}

impl Iterator for Arc {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        self.remaining = self.remaining.checked_sub(1)?;
        if self.remaining == 0 {
            return Some(self.to);
        }
        self.place += i32::from(self.step);
        Some(self.point_at(self.place))
    }
}

/// The most moves of one chord.
const CHORD_MOVES: usize = 64;

/// Joins points into lines: yields the ends of long lines, one after another, whose moves lead
/// through every point.
///
/// A point that is not one move from the one before it becomes the end of a line of its own.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::step::{Arc, Chords, Turn};
/// let at = |x, y| PagePoint { x, y };
/// let arc = Arc::new(at(0, 0), at(100, 0), at(0, 100), Turn::Counterclockwise)?;
/// assert!(Chords::new(at(100, 0), arc).count() < 30);
/// # Ok::<(), penup::step::ArcError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Chords<I> {
    pub(super) points: I,
    /// Where the next line begins.
    from: PagePoint,
    /// The moves read ahead, and where they lead.
    moves: heapless::Deque<Direction, CHORD_MOVES>,
    ahead: PagePoint,
    /// A point that no single move reaches.
    beyond: Option<PagePoint>,
}

impl<I: Iterator<Item = PagePoint>> Chords<I> {
    /// The lines from `from` through `points`.
    pub fn new(from: PagePoint, points: I) -> Self {
        Self { points, from, moves: heapless::Deque::new(), ahead: from, beyond: None }
    }

    fn read_ahead(&mut self) {
        while self.beyond.is_none() && !self.moves.is_full() {
            let Some(point) = self.points.next() else {
                return;
            };
            let delta = (point.x - self.ahead.x, point.y - self.ahead.y);
            match Direction::from_delta(delta.0, delta.1) {
                Some(direction) if direction.delta() == delta => {
                    self.ahead = point;
                    // Not full, so it fits.
                    self.moves.push_back(direction).ok();
                }
                Some(_) => self.beyond = Some(point),
                None => {}
            }
        }
    }

    /// The end of the longest line whose moves are those read ahead, and how many.
    fn longest_line(&self) -> (PagePoint, usize) {
        let mut longest = (self.from, 0);
        let mut point = self.from;
        for (index, direction) in self.moves.iter().enumerate() {
            point = direction.from_point(point);
            let count = index + 1;
            let line = Line::new(self.from, point);
            if line.len() == count && line.zip(&self.moves).all(|(a, &b)| a == b) {
                longest = (point, count);
            }
        }
        longest
    }
}

impl<I: Iterator<Item = PagePoint>> Iterator for Chords<I> {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        self.read_ahead();
        let (end, count) = self.longest_line();
        if count == 0 {
            let beyond = self.beyond.take()?;
            self.from = beyond;
            self.ahead = beyond;
            return Some(beyond);
        }
        for _ in 0..count {
            self.moves.pop_front();
        }
        self.from = end;
        Some(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn at(x: i32, y: i32) -> PagePoint {
        PagePoint { x, y }
    }

    /// All points of an arc, its first included.
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
                    // EdgeParameter the axis on which it is nearer.
                    let across = |a: f64, b: f64, along: f64| {
                        a * (1.0 - (along / b).powi(2)).max(0.0).sqrt()
                    };
                    let off = (across(wide, high, py) - px)
                        .abs()
                        .min((across(high, wide, px) - py).abs());
                    assert!(off <= 0.51, "{x} {y}, radius {radius} at {p:?}: {off}");
                }
                // Bends of less than a step are no moves from point to point.
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
                    // Both ends lie off the circle, so theirs is a little wider or narrower.
                    assert!((there.len() as i32 - moves).abs() <= 9, "{from:?} {to:?}");
                }
            }
        }
    }

    #[test]
    fn chords_lead_through_every_point() {
        for radius in [1, 4, 30, 300, 3000] {
            let from = at(radius, 0);
            for turn in [Turn::Clockwise, Turn::Counterclockwise] {
                let expected = points(at(0, 0), from, from, turn);
                let arc = Arc::new(at(0, 0), from, from, turn).expect("a circle");
                let mut drawn = std::vec![from];
                let mut corner = from;
                let mut chords = 0;
                for to in Chords::new(from, arc) {
                    for direction in Line::new(corner, to) {
                        drawn.push(direction.from_point(*drawn.last().expect("one")));
                    }
                    corner = to;
                    chords += 1;
                }
                assert_eq!(drawn, expected);
                assert!(radius < 300 || chords < expected.len() / 5, "{radius}: {chords} chords");
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
        // Two steps off the circle are allowed: of y, where those are twice as long as steps of x.
        assert_eq!(refused(at(0, 0), at(9, 0), at(0, 11)), None);
        assert_eq!(refused(at(0, 0), at(9, 0), at(0, 12)), Some(ArcError::EndOffCircle));
        let steps = [100, 50].map(Millimetres::from_num);
        let refused = |to| Arc::scaled(steps, at(0, 0), at(8, 0), to, Turn::Clockwise).err();
        assert_eq!(refused(at(0, 6)), None);
        assert_eq!(refused(at(0, 7)), Some(ArcError::EndOffCircle));
    }
}
