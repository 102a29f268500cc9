//! Straight lines for a curve: as few as the tolerance on the page allows.

use super::{FRACTION_BITS, Parameter, Point, Span, Spline, rounded};

/// A place on the page in fine units, usually 1/256 step: x, y, each within ±2^29 (clamped to that).
pub type Fine = [i64; 2];

const FINE_LIMIT: i64 = 1 << 29;

/// A polynomial is halved at most this often to see whether it stays by a chord: its Bézier points then
/// leave it by less than 1/4^`HALVINGS` of what they did.
const HALVINGS: usize = 4;

/// Lengths are tried that differ by one part in 2^`SAMPLE_BITS`; between the best and the next, chords are
/// then sought to one part in 2^`SEARCH_BITS`.
const SAMPLE_BITS: u32 = 4;
const SEARCH_BITS: u32 = 8;

/// The ends of chords along a spline, in order: where on the curve, and the place in whole units of the
/// control points. The first is the curve's beginning, the last its end; no two in a row are equal.
///
/// Guarantees that the curve between two ends stays within the tolerance of the straight line between
/// them as seen on the page (so the line lies as near to the curve): proved, not sampled, since a curve
/// lies in the convex hull of its Bézier points. The ends are rounded to whole units only then, as
/// every vertex is. Two exceptions: a piece that is all within a unit of its beginning is not divided; and
/// where a curve crosses the near plane, one chord crosses it too.
///
/// Each chord is the longest that can be proved, to a 256th of its length, and may pass any number of
/// knots. Tried on 10,000 random curves there were at most 5 in 100 more, and one, than the fewest there
/// could be.
/// Memory: about 2 KiB of stack.
#[derive(Debug, Clone)]
pub struct Chords<'a, F> {
    spline: Spline<'a>,
    project: F,
    tolerance: u16,
    /// The end of the chord before; `None` before the first.
    last: Option<End>,
    /// How long that chord was.
    length: u32,
    /// The polynomial used last, and its number.
    used: Option<(usize, Span)>,
}

/// An end of a chord: where on the curve, and the place in units of 2^-[`FRACTION_BITS`].
#[derive(Debug, Clone, Copy)]
struct End {
    at: Parameter,
    place: [i64; 3],
}

impl<'a, F: Fn([i64; 3]) -> Option<Fine>> Chords<'a, F> {
    pub(super) fn new(spline: Spline<'a>, project: F, tolerance: u16) -> Self {
        let (from, to) = spline.ends();
        Self { spline, project, tolerance, last: None, length: to.0 - from.0, used: None }
    }

    /// The longest chord from `from` that can be proved, at most `most` long, at least 1.
    fn longest(&mut self, from: End, most: u32) -> u32 {
        let mut first = (self.length >> SAMPLE_BITS).clamp(1, most);
        // `good` is proved, `bad` is not.
        let (mut good, mut bad) = loop {
            match self.farthest(from, first, most) {
                (0, _) if first > 1 => first = (first >> SAMPLE_BITS).max(1),
                found => break found,
            }
        };
        // A corner is at a knot: knots are tried first, then halves.
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

    /// The longest of a series of lengths, from `first` to `most`, that can be proved (0 if none can),
    /// and the next of the series; the same if that is `most`.
    ///
    /// A chord may stay by the curve where shorter ones do not: round a bend, say, and then on. So all
    /// lengths are tried for which the line of the chord passes near enough to the places before.
    fn farthest(&mut self, from: End, first: u32, most: u32) -> (u32, u32) {
        let mut candidates = heapless::Deque::<(u32, u32), 64>::new();
        let origin = (self.project)(from.place);
        let mut cone = Cone::ALL;
        let mut length = first;
        while !cone.is_empty() {
            let next = length.saturating_add((length >> SAMPLE_BITS).max(1)).min(most);
            let place = (self.project)(self.place(Parameter(from.at.0 + length)));
            let near = match (origin, place) {
                (Some(origin), Some(place)) => cone.take(origin, place, self.tolerance),
                // Cut off, both: there is nothing to stay by.
                (None, None) => true,
                _ => break,
            };
            if near {
                if candidates.is_full() {
                    candidates.pop_front();
                }
                let _ = candidates.push_back((length, next)); // there is room
            }
            if length == most {
                break;
            }
            length = next;
        }
        while let Some((length, next)) = candidates.pop_back() {
            if self.fits(from, Parameter(from.at.0 + length)) {
                return (length, next);
            }
        }
        (0, first)
    }

    /// Whether the curve stays by the chord.
    fn fits(&mut self, from: End, to: Parameter) -> bool {
        let ends = [from.place, self.place(to)];
        let strip = match ends.map(|end| (self.project)(end)) {
            [Some(a), Some(b)] => Some(Strip::new(a, b, self.tolerance)),
            // Wholly cut off: no part of the curve may be seen.
            [None, None] => None,
            _ => return false,
        };
        for number in from.at.span()..=to.span() {
            let begin = if number == from.at.span() { from.at.local() } else { 0 };
            let end = if number == to.span() { to.local() } else { Parameter::ONE };
            if begin == end {
                continue;
            }
            let Some(span) = self.span(number) else { continue };
            let part = span.part(begin, end);
            if !is_within_a_unit(&part, from.place) && !self.stays(part, strip.as_ref()) {
                return false;
            }
        }
        true
    }

    /// Polynomial `number`; `None` if it has no length.
    fn span(&mut self, number: usize) -> Option<Span> {
        match self.used {
            Some((used, span)) if used == number => Some(span),
            _ => {
                let span = self.spline.span(number)?;
                self.used = Some((number, span));
                Some(span)
            }
        }
    }

    fn place(&self, t: Parameter) -> [i64; 3] {
        match self.used {
            Some((number, span)) if number == t.span() => span.at(t.local()),
            _ => self.spline.exactly_at(t),
        }
    }

    /// Whether all of `span` is in the strip; without a strip, whether none of it is seen.
    fn stays(&self, span: Span, strip: Option<&Strip>) -> bool {
        let inside = |point: &[i64; 3]| match ((self.project)(*point), strip) {
            (Some(place), Some(strip)) => strip.contains(place),
            (None, None) => true,
            _ => false,
        };
        // Halves that wait, each with the halvings that it may still have: as many as were made.
        let mut waiting = heapless::Vec::<(Span, usize), HALVINGS>::new();
        let mut next = Some((span, HALVINGS));
        while let Some((span, halvings)) = next {
            // The first point is the last of the part before, which is inside.
            if span.points().iter().skip(1).all(inside) {
                next = waiting.pop();
                continue;
            }
            // The last point is on the curve.
            if halvings == 0 || !span.points().last().is_some_and(inside) {
                return false;
            }
            let (left, right) = span.split(Parameter::ONE / 2);
            next = Some((left, halvings - 1));
            if waiting.push((right, halvings - 1)).is_err() {
                return false;
            }
        }
        true
    }
}

impl<F: Fn([i64; 3]) -> Option<Fine>> Iterator for Chords<'_, F> {
    type Item = (Parameter, Point);

    fn next(&mut self) -> Option<Self::Item> {
        let (first, end) = self.spline.ends();
        let Some(before) = self.last else {
            let beginning = End { at: first, place: self.place(first) };
            self.last = Some(beginning);
            return Some((first, rounded(beginning.place)));
        };
        let mut last = before;
        while last.at < end {
            self.length = self.longest(last, end.0 - last.at.0);
            let at = Parameter(last.at.0 + self.length);
            last = End { at, place: self.place(at) };
            self.last = Some(last);
            let point = rounded(last.place);
            if point != rounded(before.place) {
                return Some((at, point));
            }
        }
        None
    }
}

/// The knot between two parameters that is nearest to their middle.
fn knot_between(low: u32, high: u32) -> Option<u32> {
    let middle = low + (high - low) / 2;
    let knot = middle.saturating_add(Parameter::ONE / 2) & !(Parameter::ONE - 1);
    (low < knot && knot < high).then_some(knot)
}

fn is_within_a_unit(span: &Span, place: [i64; 3]) -> bool {
    let near =
        |point: &[i64; 3]| point.iter().zip(place).all(|(a, b)| a.abs_diff(b) < 1 << FRACTION_BITS);
    span.points().iter().all(near)
}

/// The directions in which a straight line from one place passes within the tolerance of some others.
struct Cone {
    /// Its sides, the second counter-clockwise of the first by less than half a turn, each within
    /// ±2^30; `None` while every direction is in it.
    sides: Option<(Fine, Fine)>,
    empty: bool,
}

impl Cone {
    const ALL: Self = Self { sides: None, empty: false };

    fn is_empty(&self) -> bool {
        self.empty
    }

    /// Keeps the directions from `origin` that pass within `tolerance` of `place` too. Returns whether
    /// `place` itself lies in one of them.
    fn take(&mut self, origin: Fine, place: Fine, tolerance: u16) -> bool {
        let (origin, place) = (clamped(origin), clamped(place));
        let away = [place[0] - origin[0], place[1] - origin[1]];
        let tolerance = i64::from(tolerance);
        let square = dot(away, away) - tolerance * tolerance;
        if square > 0 {
            // The tangents to a circle around the place.
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

/// The same direction, to 30 bits.
fn shortened(direction: Fine) -> Fine {
    let longest = direction[0].unsigned_abs().max(direction[1].unsigned_abs());
    let excess = (u64::BITS - longest.leading_zeros()).saturating_sub(30);
    direction.map(|c| c >> excess)
}

/// All places within the tolerance of a straight line: convex.
struct Strip {
    from: Fine,
    to: Fine,
    /// From `from` to `to`, each within ±2^30.
    along: Fine,
    tolerance: i64,
    /// The length of `along`, rounded down.
    length: i64,
}

impl Strip {
    fn new(from: Fine, to: Fine, tolerance: u16) -> Self {
        let (from, to) = (clamped(from), clamped(to));
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = dot(along, along).unsigned_abs().isqrt() as i64;
        Self { from, to, along, tolerance: i64::from(tolerance), length }
    }

    fn contains(&self, place: Fine) -> bool {
        let place = clamped(place);
        let away = [place[0] - self.from[0], place[1] - self.from[1]];
        let past = [place[0] - self.to[0], place[1] - self.to[1]];
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

fn clamped(place: Fine) -> Fine {
    place.map(|c| c.clamp(-FINE_LIMIT, FINE_LIMIT))
}

/// Below 2^61 for components within ±2^30.
fn dot(a: Fine, b: Fine) -> i64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Below 2^61, too.
fn cross(a: Fine, b: Fine) -> i64 {
    a[0] * b[1] - a[1] * b[0]
}
