//! Straight lines for a curve: as few as the tolerance on the page allows.

use super::{FRACTION_BITS, Parameter, Point, Span, Spline, rounded};

/// A place on the page in fine units, usually 1/256 step: x, y, each within ±2^29 (clamped to that).
pub type Fine = [i64; 2];

const FINE_LIMIT: i64 = 1 << 29;

/// A polynomial is halved at most this often to see whether it stays by a chord: its Bézier points then
/// leave it by less than 1/4^`HALVINGS` of what they did.
const HALVINGS: usize = 4;

/// Chord lengths are sought to one part in 2^`SEARCH_BITS`.
const SEARCH_BITS: u32 = 6;

/// The ends of chords along a spline, in order: where on the curve, and the place in whole units of the
/// control points. The first is the curve's beginning, the last its end; no two in a row are equal.
///
/// Guarantees that the curve between two ends stays within the tolerance of the straight line between
/// them as seen on the page (so the line lies as near to the curve): proved, not sampled, since a curve
/// lies in the convex hull of its Bézier points. The ends are rounded to whole units only then, as
/// every vertex is. Two exceptions: a piece that is all within a unit of its beginning is not divided; and
/// where a curve crosses the near plane, one chord crosses it too.
///
/// Each chord is the longest that can be proved, to a sixty-fourth of its length, and may pass any number
/// of knots. So there are at most about 3 in 100 more, and one, than the fewest there could be.
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
        // `good` is proved, `bad` is not; the search begins with the length of the chord before.
        let (mut good, mut bad) = (0, None);
        let mut guess = self.length.clamp(1, most);
        loop {
            if self.fits(from, Parameter(from.at.0 + guess)) {
                good = guess;
            } else {
                bad = Some(guess);
            }
            guess = match bad {
                None if good == most => break,
                None => good.saturating_mul(2).min(most),
                // A corner is at a knot: knots are tried first, then halves.
                Some(bad) => match knot_between(from.at.0 + good, from.at.0 + bad) {
                    Some(knot) => knot - from.at.0,
                    None if bad - good <= (good >> SEARCH_BITS).max(1) => break,
                    None => good + (bad - good) / 2,
                },
            };
        }
        good.max(1)
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
            let area = away[0] * self.along[1] - away[1] * self.along[0];
            area.abs() <= self.tolerance * self.length
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
