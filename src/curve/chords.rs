//! Straight lines for a curve: as few as the tolerance on the page allows.

use super::{FRACTION_BITS, Parameter, Point, Span, Spline, rounded};

/// A place on the page in fine units, usually 1/256 step: x, y, each within ±2^29 (clamped to that).
pub type Fine = [i64; 2];

const FINE_LIMIT: i64 = 1 << 29;

/// A polynomial is halved at most this often to see whether it stays by a chord: its Bézier points then
/// leave it by less than 1/4^`HALVINGS` of what they did.
const HALVINGS: u32 = 4;

/// Lengths are tried that differ by one part in 2^`SAMPLE_BITS`; between the best and the next, chords are
/// then sought to one part in 2^`SEARCH_BITS`.
const SAMPLE_BITS: u32 = 4;
const SEARCH_BITS: u32 = 8;

/// So many lengths are tried before shorter ones are looked for: the last spans a seventh of the first.
const TRIED: usize = 32;

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
    span: Span,
    used: Option<usize>,
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

    /// The longest chord from `from` that can be proved, at most `most` long, at least 1.
    fn longest(&mut self, from: End, most: u32) -> u32 {
        let mut first = (self.length / 2).clamp(1, most);
        let mut most = most;
        // `good` is proved, `bad` is not.
        let (mut good, mut bad) = loop {
            match self.farthest(from, first, most) {
                (0, bad) if bad > 1 => {
                    most = bad - 1;
                    first = (first >> SAMPLE_BITS).clamp(1, most);
                }
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

    /// The longest of a series of lengths, from `first` to `most`, that can be proved (0 if none of those
    /// tried can), and the next of the series; the least tried if none can.
    ///
    /// A chord may stay by the curve where shorter ones do not: round a bend, say, and then on. So those
    /// lengths are tried, the longest first, for which the line of the chord passes near enough to the
    /// places before.
    fn farthest(&mut self, from: End, first: u32, most: u32) -> (u32, u32) {
        let next = |length: u32| length.saturating_add((length >> SAMPLE_BITS).max(1)).min(most);
        let mut candidates = heapless::Deque::<u32, TRIED>::new();
        let origin = (self.project)(from.place);
        let mut cone = Cone::ALL;
        let mut length = first;
        while !cone.is_empty() {
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
            if !self.load(number) {
                continue;
            }
            let part = self.span.part(begin, end);
            if !is_within_a_unit(&part, from.place) && !self.stays(&part, strip.as_ref()) {
                return false;
            }
        }
        true
    }

    /// Makes `self.span` polynomial `number`; `false` if that has no length.
    fn load(&mut self, number: usize) -> bool {
        if self.used != Some(number) {
            self.used = self.spline.load(number, &mut self.span).then_some(number);
        }
        self.used.is_some()
    }

    fn place(&self, t: Parameter) -> [i64; 3] {
        if self.used == Some(t.span()) {
            self.span.at(t.local())
        } else {
            self.spline.exactly_at(t)
        }
    }

    /// Whether all of `span` is in the strip; without a strip, whether none of it is seen.
    fn stays(&self, span: &Span, strip: Option<&Strip>) -> bool {
        let inside = |point: &[i64; 3]| match ((self.project)(*point), strip) {
            (Some(place), Some(strip)) => strip.contains(place),
            (None, None) => true,
            _ => false,
        };
        // Part number `part` of 2^`halvings`. Cutting it out again costs less than a stack of halves to keep.
        let (mut part, mut halvings) = (0, 0);
        loop {
            let length = Parameter::ONE >> halvings;
            let piece = span.part(part * length, (part + 1) * length);
            // The first point is the last of the part before, which is inside.
            if piece.points().iter().skip(1).all(inside) {
                part += 1;
                while part % 2 == 0 && halvings > 0 {
                    (part, halvings) = (part / 2, halvings - 1);
                }
                if halvings == 0 {
                    return true;
                }
            } else if halvings == HALVINGS || !piece.points().last().is_some_and(inside) {
                // The last point is on the curve.
                return false;
            } else {
                (part, halvings) = (2 * part, halvings + 1);
            }
        }
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
