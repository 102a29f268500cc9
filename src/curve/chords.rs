//! Approximates a curve by straight lines, as few as the tolerance on the page allows.

use super::{FRACTION_BITS, Parameter, Point, Span, Spline, rounded};
use crate::index::Index;

/// A point on the page in fine units, usually 1/256 step: x and y, each clamped to ±2^29.
pub type Fine = [i64; 2];

/// The greatest absolute value to which a coordinate of a [`Fine`] point is clamped, so that
/// squares and their sums fit in 64 bits.
const FINE_LIMIT: i64 = 1 << 29;

/// The greatest number of times that a polynomial is halved to test whether it stays near a chord.
/// The Bézier points of the parts deviate from the curve by less than 1/4^`HALVINGS` of the
/// original deviation.
const HALVINGS: u32 = 4;

/// The resolution of the search for the longest chord. The lengths tried first differ by one part
/// in 2^`SAMPLE_BITS`.
const SAMPLE_BITS: u32 = 4;
/// Between the best of the lengths tried first and the next one, the search continues to one part
/// in 2^`SEARCH_BITS`.
const SEARCH_BITS: u32 = 8;

/// The number of lengths that are tested before shorter ones are searched for. The shortest of them
/// is a seventh of the longest.
const TRIED: usize = 32;

/// The ends of the chords along a spline, in order: the position on the curve, and the point in
/// whole units of the control points. The first is the beginning of the curve and the last is its
/// end. No two consecutive points are equal.
///
/// As seen on the page, the curve between two ends stays within the tolerance of the straight line
/// between them, and so the line is as near to the curve. This is proved and not sampled, because a
/// curve lies in the convex hull of its Bézier points. Only after that are the ends rounded to
/// whole units, as every vertex is. There are two exceptions: a part that is entirely within one
/// unit of its beginning is not divided, and where a curve crosses the near plane, one chord
/// crosses it too.
///
/// Each chord is the longest that can be proved, to a 256th of its length, and may pass any number
/// of knots. In a test with 10,000 random curves the number of chords exceeded the least possible
/// number by at most 5 percent plus one.
///
/// It uses about 2 KiB of stack.
#[derive(Debug, Clone)]
pub struct Chords<'a, F, I = u16> {
    /// The curve that chords approximate.
    spline: Spline<'a, I>,
    /// Maps points of the curve to the page: see [`Spline::chords`].
    project: F,
    /// The tolerance in fine units.
    tolerance: u16,
    /// The end of the previous chord; `None` before the first.
    last: Option<End>,
    /// The length of the previous chord, with which the search for the next one begins, in units of
    /// [`Parameter`].
    length: u32,
    /// The polynomial that was used last.
    span: Span,
    /// The number of the polynomial in `span`, or `None` before the first one is loaded.
    used: Option<usize>,
}

/// An end of a chord: the position on the curve, and the point in units of 2^-[`FRACTION_BITS`].
#[derive(Debug, Clone, Copy)]
struct End {
    /// Where the chord ends along the curve.
    at: Parameter,
    /// Where the chord ends in the model.
    position: [i64; 3],
}

impl<'a, F: Fn([i64; 3]) -> Option<Fine>, I: Index> Chords<'a, F, I> {
    /// Starts at the beginning of the spline: see [`Spline::chords`].
    pub(super) fn new(spline: Spline<'a, I>, project: F, tolerance: u16) -> Self {
        let (from, to) = spline.ends();
        Self {
            spline,
            project,
            tolerance,
            last: None,
            length: to.0 - from.0,
            span: Span::default(),
            used: None,
        }
    }

    /// The length of the longest chord from `from` that can be proved; at most `most` and at least
    /// 1.
    fn longest(&mut self, from: End, most: u32) -> u32 {
        let mut first = (self.length / 2).clamp(1, most);
        let mut most = most;
        // The length `good` is proved; the length `bad` is not.
        let (mut good, mut bad) = loop {
            match self.farthest(from, first, most) {
                (0, bad) if bad > 1 => {
                    most = bad - 1;
                    first = (first >> SAMPLE_BITS).clamp(1, most);
                }
                found => break found,
            }
        };
        // Corners occur only at knots, so the search tries knots first and then halves the
        // interval.
        while good < bad {
            let guess = match knot_between(from.at.0 + good, from.at.0 + bad) {
                Some(knot) => knot - from.at.0,
                None if bad - good <= (good >> SEARCH_BITS).max(1) => break,
                None => good + (bad - good) / 2,
            };
            if self.fits(from, Parameter(from.at.0 + guess)) {
                good = guess;
            } else {
                bad = guess;
            }
        }
        good.max(1)
    }

    /// Tests a series of lengths from `first` to `most`. Returns the longest that can be proved and
    /// the next one of the series. If none can be proved, returns 0 and the shortest length that
    /// was tested.
    ///
    /// A long chord may stay near the curve where shorter ones do not, for example around a bend
    /// and onward. So the lengths tested, the longest first, are those for which the line of the
    /// chord passes near enough to the preceding points.
    fn farthest(&mut self, from: End, first: u32, most: u32) -> (u32, u32) {
        let next = |length: u32| length.saturating_add((length >> SAMPLE_BITS).max(1)).min(most);
        let mut candidates = heapless::Deque::<u32, TRIED>::new();
        let origin = (self.project)(from.position);
        let mut cone = Cone::ALL;
        let mut length = first;
        while !cone.is_empty() {
            let position = (self.project)(self.position_at(Parameter(from.at.0 + length)));
            let near = match (origin, position) {
                (Some(origin), Some(position)) => cone.take(origin, position, self.tolerance),
                // Both points are clipped, so there is no line to test.
                (None, None) => true,
                _ => break,
            };
            if near {
                if candidates.is_full() {
                    candidates.pop_front();
                }
                let _ = candidates.push_back(length); // there is room
            }
            if length == most {
                break;
            }
            length = next(length);
        }
        let mut least = first;
        while let Some(length) = candidates.pop_back() {
            if self.fits(from, Parameter(from.at.0 + length)) {
                return (length, next(length));
            }
            least = length;
        }
        (0, least)
    }

    /// Whether the curve stays within the tolerance of the chord from `from` to `to`.
    fn fits(&mut self, from: End, to: Parameter) -> bool {
        let ends = [from.position, self.position_at(to)];
        let strip = match ends.map(|end| (self.project)(end)) {
            [Some(a), Some(b)] => Some(Strip::new(a, b, self.tolerance)),
            // Both ends are clipped, so no part of the curve may be visible.
            [None, None] => None,
            _ => return false,
        };
        for number in from.at.span()..=to.span() {
            let begin = if number == from.at.span() { from.at.local() } else { 0 };
            let end = if number == to.span() { to.local() } else { Parameter::ONE };
            if begin == end {
                continue;
            }
            if !self.load(number) {
                continue;
            }
            let part = self.span.part(begin, end);
            if !is_within_a_unit(&part, from.position) && !self.stays(&part, strip.as_ref()) {
                return false;
            }
        }
        true
    }

    /// Makes `self.span` the polynomial with this number, from 0. Returns `false` if that
    /// polynomial has zero length.
    fn load(&mut self, number: usize) -> bool {
        if self.used != Some(number) {
            self.used = self.spline.load(number, &mut self.span).then_some(number);
        }
        self.used.is_some()
    }

    /// Returns the point of the curve at `t`, in units of 2^-[`FRACTION_BITS`].
    fn position_at(&self, t: Parameter) -> [i64; 3] {
        if self.used == Some(t.span()) {
            self.span.at(t.local())
        } else {
            self.spline.exactly_at(t)
        }
    }

    /// Whether all of `span` is in the strip. Without a strip, whether no part of it is visible.
    fn stays(&self, span: &Span, strip: Option<&Strip>) -> bool {
        let inside = |point: &[i64; 3]| match ((self.project)(*point), strip) {
            (Some(position), Some(strip)) => strip.contains(position),
            (None, None) => true,
            _ => false,
        };
        // The loop examines part number `part` of 2^`halvings`. Cutting it out again costs less
        // than keeping a stack of halves.
        let (mut part, mut halvings) = (0, 0);
        loop {
            let length = Parameter::ONE >> halvings;
            let piece = span.part(part * length, (part + 1) * length);
            // The first point is the last one of the previous part, which is inside.
            if piece.points().iter().skip(1).all(inside) {
                part += 1;
                while part % 2 == 0 && halvings > 0 {
                    (part, halvings) = (part / 2, halvings - 1);
                }
                if halvings == 0 {
                    return true;
                }
            } else if halvings == HALVINGS || !piece.points().last().is_some_and(inside) {
                // The last point is on the curve, so halving cannot help.
                return false;
            } else {
                (part, halvings) = (2 * part, halvings + 1);
            }
        }
    }
}

impl<F: Fn([i64; 3]) -> Option<Fine>, I: Index> Iterator for Chords<'_, F, I> {
    type Item = (Parameter, Point);

    fn next(&mut self) -> Option<Self::Item> {
        let (first, end) = self.spline.ends();
        let Some(before) = self.last else {
            let beginning = End { at: first, position: self.position_at(first) };
            self.last = Some(beginning);
            return Some((first, rounded(beginning.position)));
        };
        let mut last = before;
        while last.at < end {
            self.length = self.longest(last, end.0 - last.at.0);
            let at = Parameter(last.at.0 + self.length);
            last = End { at, position: self.position_at(at) };
            self.last = Some(last);
            let point = rounded(last.position);
            if point != rounded(before.position) {
                return Some((at, point));
            }
        }
        None
    }
}

/// The knot between two positions that is nearest to the middle between them.
fn knot_between(low: u32, high: u32) -> Option<u32> {
    let middle = low + (high - low) / 2;
    let knot = middle.saturating_add(Parameter::ONE / 2) & !(Parameter::ONE - 1);
    (low < knot && knot < high).then_some(knot)
}

/// Whether all of the polynomial is within one unit of `position` in each coordinate.
fn is_within_a_unit(span: &Span, position: [i64; 3]) -> bool {
    let near = |point: &[i64; 3]| {
        point.iter().zip(position).all(|(a, b)| a.abs_diff(b) < 1 << FRACTION_BITS)
    };
    span.points().iter().all(near)
}

/// The set of directions in which a straight line from one point passes within the tolerance of
/// several others.
struct Cone {
    /// The two sides of the cone. The second is counter-clockwise of the first by less than half a
    /// turn, and each component is within ±2^30. `None` while the cone contains every direction.
    sides: Option<(Fine, Fine)>,
    /// Whether the cone contains no direction.
    empty: bool,
}

impl Cone {
    /// The cone that contains every direction, because no point restricts it yet.
    const ALL: Self = Self { sides: None, empty: false };

    /// Whether no direction is left, so that no single line passes near enough to all points.
    fn is_empty(&self) -> bool {
        self.empty
    }

    /// Restricts the cone to the directions from `origin` that also pass within `tolerance` of
    /// `position`. Returns whether the direction to `position` itself is in the cone.
    fn take(&mut self, origin: Fine, position: Fine, tolerance: u16) -> bool {
        let (origin, position) = (clamped(origin), clamped(position));
        let away = [position[0] - origin[0], position[1] - origin[1]];
        let tolerance = i64::from(tolerance);
        let square = dot(away, away) - tolerance * tolerance;
        if square > 0 {
            // The sides are the tangents to a circle around the point.
            let root = square.unsigned_abs().isqrt() as i64;
            let ahead = [away[0] * root, away[1] * root]; // below 2^61
            let aside = [-away[1] * tolerance, away[0] * tolerance];
            let right = shortened([ahead[0] - aside[0], ahead[1] - aside[1]]);
            let left = shortened([ahead[0] + aside[0], ahead[1] + aside[1]]);
            let (least, most) = self.sides.unwrap_or((right, left));
            let within = |side, (least, most)| cross(least, side) >= 0 && cross(side, most) >= 0;
            let either = |new, old| {
                if within(new, (least, most)) {
                    Some(new)
                } else {
                    within(old, (right, left)).then_some(old)
                }
            };
            self.sides = either(right, least).zip(either(left, most));
            self.empty = self.sides.is_none();
        }
        let inside = |(least, most)| cross(least, away) >= 0 && cross(away, most) >= 0;
        !self.empty && self.sides.is_none_or(inside)
    }
}

/// Returns the same direction with components of at most 30 bits, so that products do not overflow.
fn shortened(direction: Fine) -> Fine {
    let longest = direction[0].unsigned_abs().max(direction[1].unsigned_abs());
    let excess = (u64::BITS - longest.leading_zeros()).saturating_sub(30);
    direction.map(|c| c >> excess)
}

/// The set of all points within the tolerance of a straight line, which is convex.
struct Strip {
    /// The start of the line.
    from: Fine,
    /// The end of the line.
    to: Fine,
    /// The vector from `from` to `to`; each component is within ±2^30.
    along: Fine,
    /// The greatest distance from the line.
    tolerance: i64,
    /// The length of `along`, rounded down.
    length: i64,
}

impl Strip {
    /// Makes the strip around the line from `from` to `to`. `tolerance` is in the same unit as the
    /// points.
    fn new(from: Fine, to: Fine, tolerance: u16) -> Self {
        let (from, to) = (clamped(from), clamped(to));
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = dot(along, along).unsigned_abs().isqrt() as i64;
        Self { from, to, along, tolerance: i64::from(tolerance), length }
    }

    /// Whether a point is within the tolerance of the line, its ends included.
    fn contains(&self, position: Fine) -> bool {
        let position = clamped(position);
        let away = [position[0] - self.from[0], position[1] - self.from[1]];
        let past = [position[0] - self.to[0], position[1] - self.to[1]];
        let square = self.tolerance * self.tolerance;
        if dot(away, self.along) <= 0 {
            dot(away, away) <= square
        } else if dot(past, self.along) >= 0 {
            dot(past, past) <= square
        } else {
            cross(away, self.along).abs() <= self.tolerance * self.length
        }
    }
}

/// Returns the point with each coordinate limited to ±[`FINE_LIMIT`].
fn clamped(position: Fine) -> Fine {
    position.map(|c| c.clamp(-FINE_LIMIT, FINE_LIMIT))
}

/// The dot product; below 2^61 for components within ±2^30.
fn dot(a: Fine, b: Fine) -> i64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The cross product; below 2^61, too.
fn cross(a: Fine, b: Fine) -> i64 {
    a[0] * b[1] - a[1] * b[0]
}
