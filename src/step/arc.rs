//! Arcs and circles on the grid, and the fewest lines that draw exactly their points.

use super::{Direction, Line};
use crate::drawing::PagePoint;

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
    /// The centre lies more than 2^22 steps from an end.
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
    /// Four times the squared radius.
    radius: u64,
    /// The greatest u with a point (u, v), u <= v, of the circle around 0.
    half: i32,
    /// Moves of a quarter turn.
    quarter: i32,
    /// Place on the circle, in moves counterclockwise.
    place: i32,
    step: i32,
    remaining: u32,
}

impl Arc {
    /// The arc around `center` from `from` to `to`.
    ///
    /// # Errors
    /// See [`ArcError`].
    pub fn new(
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
            Ok(u64::from(x) * u64::from(x) + u64::from(y) * u64::from(y))
        };
        let (first, last) = (squared(from)?, squared(to)?);
        if first == 0 || last == 0 {
            return Err(ArcError::NoRadius);
        }
        if first.isqrt().abs_diff(last.isqrt()) > 2 {
            return Err(ArcError::EndOffCircle);
        }
        let radius = 2 * (first + last);
        // Near r / √2, found to the step.
        let mut half = (radius / 8).isqrt() as i32 + 1;
        while half > 0 && half > across(radius, half) {
            half -= 1;
        }
        let corner_is_shared = half == across(radius, half);
        let quarter = 2 * half + i32::from(!corner_is_shared);
        let mut arc = Self {
            center,
            to,
            radius,
            half,
            quarter: quarter.max(1),
            place: 0,
            step: if turn == Turn::Clockwise { -1 } else { 1 },
            remaining: 0,
        };
        arc.place = arc.place_of(from);
        let ahead = (arc.place_of(to) - arc.place) * arc.step;
        let whole = 4 * arc.quarter;
        let moves = ahead.rem_euclid(whole);
        arc.remaining = if from == to { whole } else { moves }.unsigned_abs().max(1);
        Ok(arc)
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
        if self.remaining > 1 {
            include(self.point_at(self.place + self.step));
        }
        // Where a side is crossed in its middle, the circle is furthest out.
        for side in 0..4 {
            let middle = side * self.quarter + self.half;
            let ahead = ((middle - self.place) * self.step).rem_euclid(4 * self.quarter);
            if ahead.unsigned_abs() < self.remaining {
                include(self.point_at(middle));
            }
        }
        (least, most)
    }

    /// The place on the circle nearest to `point`: the right side runs up from 0, the top left, and
    /// so on, a quarter each.
    fn place_of(&self, point: PagePoint) -> i32 {
        let (x, y) = (point.x - self.center.x, point.y - self.center.y);
        let (side, along) = if x.abs() >= y.abs() {
            if x >= 0 { (0, y) } else { (2, -y) }
        } else if y > 0 {
            (1, -x)
        } else {
            (3, x)
        };
        side * self.quarter + along.clamp(-self.half, self.half) + self.half
    }

    fn point_at(&self, place: i32) -> PagePoint {
        let place = place.rem_euclid(4 * self.quarter);
        let along = place % self.quarter - self.half;
        let out = across(self.radius, along);
        let (x, y) = match place / self.quarter {
            0 => (out, along),
            1 => (-along, out),
            2 => (-out, -along),
            _ => (along, -out),
        };
        PagePoint { x: self.center.x + x, y: self.center.y + y }
    }
}

/// The v nearest to the circle at u = `along`; never halfway, as four times the squared radius is
/// even.
fn across(radius: u64, along: i32) -> i32 {
    let along = u64::from(along.unsigned_abs());
    let doubled = radius.saturating_sub(4 * along * along).isqrt();
    doubled.div_ceil(2) as i32
}

impl Iterator for Arc {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        self.remaining = self.remaining.checked_sub(1)?;
        if self.remaining == 0 {
            return Some(self.to);
        }
        self.place += self.step;
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
    }
}
