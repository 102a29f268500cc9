//! Removes overlaps, so that no stretch of paper is drawn twice: collinear segments that overlap
//! are drawn once.
//!
//! Segments are sorted by the straight line on which they lie, then by rank, then by where they
//! begin. Each segment is then cut to what the segments before it in that order leave free. All
//! computations are exact, and every cut is at the end of another segment, so no new points are
//! needed.

use super::{LineType, PagePoint};
use crate::array::MapEach;
use crate::fixed::product;
use crate::index::Index;
use crate::stage::{Cancel, OutOfScratch, StageError, heap_sort_cancellable};
use bytemuck::{Pod, Zeroable};
use core::cmp::Ordering;

/// A line between two numbered points, before it becomes a segment of the drawing.
///
/// It is a pair of the numbers of its ends, its [`Rank`] and its slope ([`Key::slope`]), of which
/// the latter two take no more bits than a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct NumberedLine<P>([P; 3]);

/// The [`NumberedLine`] with numbers of this width.
pub(super) type LineOf<I> = NumberedLine<<I as Index>::Pair>;

impl<P: Copy + Ord + From<u32> + Into<u64>> NumberedLine<P> {
    /// Makes the line between two different points, the one with the lower number first.
    pub(super) fn new<I: Index<Pair = P>>([a, b]: [I; 2], rank: Rank) -> Self {
        Self([I::pair(a.min(b), a.max(b)), rank.0.into(), 0.into()])
    }

    /// Returns the numbers of the points at its ends, in order as a sort key.
    pub(super) fn key(&self) -> P {
        self.0[0]
    }

    /// Returns the numbers of the points at both ends.
    pub(super) fn ends<I: Index<Pair = P>>(&self) -> [I; 2] {
        I::halves(self.0[0])
    }

    /// Returns the same line between other points.
    fn between<I: Index<Pair = P>>(self, from: I, to: I) -> Self {
        Self([I::pair(from, to), self.0[1], self.0[2]])
    }

    pub(super) fn rank(&self) -> Rank {
        Rank(self.0[1].into() as u32)
    }

    fn slope(&self) -> u32 {
        self.0[2].into() as u32
    }
}

/// The rank of a line: where lines overlap, that of the lowest rank is drawn. A line that yields
/// ranks behind those that do not, then counts the precedence of the line type, then the pen.
///
/// Bit 24 is set if the line yields. Below it are eight bits each for the precedence, the code of
/// the line type and the pen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Rank(u32);

impl Rank {
    /// Makes the rank of a line that `pen` draws. `yields` says that any other line at the same
    /// position is drawn instead.
    pub(super) fn new(line_type: LineType, yields: bool, pen: u8) -> Self {
        let [precedence, code, pen] =
            [line_type.precedence(), line_type.code(), pen].map_each(u32::from);
        Self(u32::from(yields) << 24 | precedence << 16 | code << 8 | pen)
    }

    /// Returns the code of the line type and the pen, which the rank holds.
    pub(super) fn line_type_and_pen(self) -> (LineType, u8) {
        (LineType::from_code((self.0 >> 8) as u8), self.0 as u8)
    }
}

/// A sort key for points along a line: x, then y. The first point is the left one, or the lower one
/// of a vertical line.
type PointKey = (i32, i32);

/// The key by which segments are sorted, so that those on one straight line follow each other.
struct Key {
    /// The direction of the segment as one number, see [`Key::slope`].
    slope: u32,
    /// The end of the segment that comes first along the line.
    from: PointKey,
    /// The end of the segment that comes last along the line.
    to: PointKey,
    /// The rank among segments of one line, of which the lowest is drawn.
    rank: Rank,
}

impl Key {
    /// Makes the key of a segment. `points` gives the positions of its ends.
    fn of<I: Index>(segment: &LineOf<I>, points: &[PagePoint]) -> Self {
        Self {
            slope: segment.slope(),
            from: End::<I>::first(segment, points).position,
            to: End::<I>::second(segment, points).position,
            rank: segment.rank(),
        }
    }

    /// Returns the vector from the first end to the second; each component is within ±2^21.
    fn direction(&self) -> (i64, i64) {
        (
            i64::from(self.to.0) - i64::from(self.from.0),
            i64::from(self.to.1) - i64::from(self.from.1),
        )
    }

    /// Returns a number for the direction, which is equal for parallel segments and in most cases
    /// different for others.
    fn slope(&self) -> u32 {
        let (dx, dy) = self.direction();
        if dx >= dy.abs() {
            ((dy << 28).checked_div(dx).unwrap_or(0) + (1 << 28)) as u32
        } else {
            1 << 31 | (dx << 28).checked_div(dy).unwrap_or(0) as u32 & 0x7FFF_FFFF
        }
    }

    /// Compares the lines on which two segments lie: by direction, then by distance from the
    /// origin.
    fn compare_line(&self, other: &Self) -> Ordering {
        let ((ax, ay), (bx, by)) = (self.direction(), other.direction());
        let fast = self.slope.cmp(&other.slope);
        fast.then_with(|| (ay * bx).cmp(&(by * ax))).then_with(|| {
            // Twice the area of the triangle with the origin is below 2^43. Dividing it by the
            // length along the longer axis gives the distance; the division is replaced by cross
            // multiplication.
            let area = |key: &Self, (dx, dy): (i64, i64)| {
                dx * i64::from(key.from.1) - dy * i64::from(key.from.0)
            };
            let (long_a, long_b) = if ax >= ay.abs() { (ax, bx) } else { (ay.abs(), by.abs()) };
            let a = product(area(self, (ax, ay)), long_b);
            a.cmp(&(product(area(other, (bx, by)), long_a)))
        })
    }
}

impl Ord for Key {
    fn cmp(&self, other: &Self) -> Ordering {
        self.compare_line(other)
            .then_with(|| self.rank.cmp(&other.rank))
            .then_with(|| self.from.cmp(&other.from))
            .then_with(|| self.to.cmp(&other.to))
    }
}
impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Key {}

/// The number of segments between two calls of [`Cancel::check`]; they take some 100,000
/// instructions.
const SEGMENTS_BETWEEN_CHECKS: usize = 64;

/// Cuts the first `count` of `segments` until none overlap. Returns the number of segments then. It
/// is greater than `count` only if a line lies inside another that yields to it.
///
/// # Errors
/// [`StageError::Scratch`] if the result does not fit into `segments`;
/// [`StageError::Aborted`] if the user aborted the job.
pub(super) fn ink_once<I: Index>(
    segments: &mut [LineOf<I>],
    count: usize,
    points: &[PagePoint],
    cancel: &mut dyn Cancel,
) -> Result<usize, StageError> {
    let full = OutOfScratch {
        needed: size_of_val(segments) + size_of::<LineOf<I>>(),
        available: size_of_val(segments),
    };
    let (sorted, _) = segments.split_at_mut_checked(count).ok_or(full)?;
    for segments in sorted.chunks_mut(SEGMENTS_BETWEEN_CHECKS) {
        for segment in segments {
            segment.0[2] = Key::of::<I>(segment, points).slope().into();
        }
        cancel.check()?;
    }
    heap_sort_cancellable(sorted, |segment| Key::of::<I>(segment, points), cancel)?;

    // The finished pieces are stored at the front of `segments`, and those for which there is no
    // room there, from `count` on. In both areas the pieces of the current line begin at `starts`.
    // They form runs of one rank each, which are sorted and disjoint.
    let mut ends = [0, count];
    let mut starts = ends;
    let mut last: Option<Key> = None;
    for read in 0..count {
        if read % SEGMENTS_BETWEEN_CHECKS == 0 {
            cancel.check()?;
        }
        let segment = segments[read];
        let key = Key::of::<I>(&segment, points);
        if last.as_ref().is_none_or(|last| last.compare_line(&key) != Ordering::Equal) {
            starts = ends;
        }
        let (mut from, to) =
            (End::<I>::first(&segment, points), End::<I>::second(&segment, points));
        while from.position < to.position {
            // `reach` is how far the line is already drawn at this point. If it is not, `next` is
            // where the next piece begins.
            let (mut reach, mut next) = (from, to);
            for side in 0..2 {
                let mut pieces = segments.get(starts[side]..ends[side]).unwrap_or(&[]);
                while let Some(rank) = pieces.first().map(|piece| piece.rank()) {
                    let of_rank = pieces.partition_point(|piece| piece.rank() <= rank);
                    let (run, rest) = pieces.split_at(of_rank);
                    pieces = rest;
                    let begun = |piece: &LineOf<I>| {
                        End::<I>::first(piece, points).position <= from.position
                    };
                    let after = run.partition_point(begun);
                    if let Some(piece) = after.checked_sub(1).and_then(|at| run.get(at)) {
                        reach = reach.max(End::second(piece, points));
                    }
                    if let Some(piece) = run.get(after) {
                        next = next.min(End::first(piece, points));
                    }
                }
            }
            if reach.position > from.position {
                from = reach;
                continue;
            }
            let piece = segment.between(from.number, next.number);
            let at = &mut ends[usize::from(ends[0] > read)];
            *segments.get_mut(*at).ok_or(full)? = piece;
            *at += 1;
            from = next;
        }
        last = Some(key);
    }
    // `ends[0]` is at most `count`: a piece was stored there only while it was at most `read`. And
    // `ends[1]` is at most the length, where `get_mut` has refused to store. So both ranges exist.
    segments.copy_within(count..ends[1], ends[0]);
    Ok(ends[0] + ends[1] - count)
}

/// An end of a segment: its position, and the number of its point.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct End<I> {
    /// Where the end lies, as a sort key along the line.
    position: PointKey,
    /// The number by which segments name the point.
    number: I,
}

impl<I: Index> End<I> {
    /// Returns both ends of a segment, the one with the lower point number first.
    fn both(segment: &LineOf<I>, points: &[PagePoint]) -> [Self; 2] {
        segment.ends::<I>().map_each(|number| {
            let position = points.get(number.get()).map_or((0, 0), |point| (point.x, point.y));
            Self { position, number }
        })
    }

    /// Returns the end that comes first along the line.
    fn first(segment: &LineOf<I>, points: &[PagePoint]) -> Self {
        let [a, b] = Self::both(segment, points);
        a.min(b)
    }

    /// Returns the end that comes last along the line.
    fn second(segment: &LineOf<I>, points: &[PagePoint]) -> Self {
        let [a, b] = Self::both(segment, points);
        a.max(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::{PackedLine, build_graph};
    use crate::stage::{NeverCancel, items_mut};
    use std::string::String;
    use std::vec;
    use std::vec::Vec;

    /// The line types as they are drawn in a strip. A digit is a full line of that pen, and a
    /// letter is one that yields: `a` has pen 0, `b` pen 1 and so on.
    const TYPES: [(char, LineType); 3] =
        [('-', LineType::Full), ('.', LineType::Dotted), ('=', LineType::Dashed)];

    /// The line that a strip such as `"  +--+"` shows. The strip lies along `direction`, whose x
    /// or else y is positive; a character is ten steps long, so that no two points become one.
    fn line(strip: &str, direction: [i32; 2], reversed: bool) -> PackedLine {
        let mut ends = [strip.find('+'), strip.rfind('+')];
        if reversed {
            ends.reverse();
        }
        let [from, to] = ends.map(|end| {
            let [x, y] = direction.map(|step| step * 10 * end.unwrap() as i32);
            PagePoint { x, y }
        });
        let ink = strip.trim_start().chars().nth(1).unwrap();
        let pen = |first: char| ink as u8 - first as u8;
        match ink {
            '0'..='9' => PackedLine::new(from, to, LineType::Full, pen('0')),
            'a'..='z' => PackedLine::new(from, to, LineType::Full, pen('a')).under(),
            ',' => PackedLine::new(from, to, LineType::Dotted, 0).under(),
            _ => {
                let (_, line_type) = TYPES.into_iter().find(|(shown, _)| *shown == ink).unwrap();
                PackedLine::new(from, to, line_type, 0)
            }
        }
    }

    /// Layers of a plan: a line, and many shorter ones within it that have a lower pen.
    #[test]
    fn a_line_may_be_cut_into_as_many_pieces_as_there_are_lines_within_it() {
        let steps = |x: i32| PagePoint { x: 10 * x, y: 0 };
        let short =
            |at: i32| PackedLine::new(steps(2 * at + 1), steps(2 * at + 2), LineType::Full, 0);
        for count in [1, 12, 200] {
            let long = PackedLine::new(steps(0), steps(2 * count + 1), LineType::Full, 1);
            let lines: Vec<_> = [long].into_iter().chain((0..count).map(short)).collect();
            let mut words = vec![0; 40 * lines.len() + 100];
            items_mut(&mut words, lines.len()).unwrap().copy_from_slice(&lines);
            let stored = build_graph::<u16>(&mut words, lines.len(), &mut NeverCancel).unwrap();
            let segments = stored.drawing(&words).unwrap().segments;
            let of_pen = |pen| segments.iter().filter(|segment| segment.pen() == pen).count();
            assert_eq!([of_pen(0), of_pen(1)], [count as usize, count as usize + 1]);
        }
    }

    /// What is drawn of these lines, as one strip: `+` at the ends of each segment, and between
    /// them the line type, or the pen if that is not the first.
    fn drawn(lines: &[PackedLine], direction: [i32; 2]) -> String {
        let mut words = vec![0; 400];
        items_mut(&mut words, lines.len()).unwrap().copy_from_slice(lines);
        let stored = build_graph::<u16>(&mut words, lines.len(), &mut NeverCancel).unwrap();
        let drawing = stored.drawing(&words).unwrap();
        let mut strip = Vec::new();
        for segment in drawing.segments {
            let [from, to] = [segment.from(), segment.to()].map(|number| {
                let PagePoint { x, y } = drawing.points[usize::from(number)];
                let at = if direction[0] != 0 { x / direction[0] } else { y / direction[1] } / 10;
                assert_eq!([x, y], direction.map(|step| step * 10 * at));
                at as usize
            });
            let (from, to) = (from.min(to), from.max(to));
            strip.resize(strip.len().max(to + 1), ' ');
            let (ink, line_type) = TYPES[usize::from(segment.line_type().code())];
            assert_eq!(segment.line_type(), line_type);
            for letter in &mut strip[from + 1..to] {
                assert_eq!(*letter, ' ', "drawn twice");
                *letter = if segment.pen() == 0 { ink } else { (b'0' + segment.pen()) as char };
            }
            (strip[from], strip[to]) = ('+', '+');
        }
        strip.into_iter().collect()
    }

    /// Asserts that `strips`, which lie one over the other, are drawn as `expected`, whatever their
    /// slope, their order and the ends at which they begin.
    #[track_caller]
    fn assert_drawn(strips: &[&str], expected: &str) {
        for direction in [[1, 0], [0, 1], [2, 1], [3, -2], [5, 7]] {
            for first in 0..strips.len() {
                for reversed in 0..1 << strips.len() {
                    let lines = (0..strips.len()).map(|at| {
                        let at = (first + at) % strips.len();
                        line(strips[at], direction, reversed >> at & 1 != 0)
                    });
                    let found = drawn(&lines.collect::<Vec<_>>(), direction);
                    assert_eq!(found, expected, "{strips:?} {direction:?}");
                }
            }
        }
    }

    #[test]
    fn a_full_line_replaces_others_where_they_overlap() {
        assert_drawn(&["+......+", "+------+"], "+------+");
        assert_drawn(
            &[
                "+.............+", //
                "     +---+     ",
            ],
            "+....+---+....+",
        );
        assert_drawn(
            &[
                "+========+     ", //
                "     +---------+",
            ],
            "+====+---------+",
        );
    }

    #[test]
    fn a_dotted_line_replaces_a_dashed_one() {
        assert_drawn(
            &[
                "   +======+    ", //
                "+....+         ",
                "        +.....+",
            ],
            "+....+==+.....+",
        );
    }

    #[test]
    fn lines_of_one_type_are_drawn_once() {
        assert_drawn(&["+----+", "+----+", "+----+"], "+----+");
        assert_drawn(
            &[
                "+-------+      ", //
                "    +--------+ ",
                "      +--------+",
            ],
            "+-------+----+-+",
        );
        assert_drawn(
            &[
                "+--------------+", //
                "   +--+         ",
                "         +--+   ",
            ],
            "+--------------+",
        );
    }

    #[test]
    fn the_lower_pen_replaces_the_higher() {
        assert_drawn(
            &[
                "+3333333333333+", //
                "   +1111111+   ",
                "      +22222222222+",
            ],
            "+33+1111111+222222+",
        );
    }

    #[test]
    fn a_hidden_line_yields_to_whatever_is_seen() {
        assert_drawn(&["+aaaa+", "+5555+", "+6666+"], "+5555+");
        assert_drawn(&["+7777+", "+bbbb+", "+jjjj+"], "+7777+");
        assert_drawn(&["+dddd+", "+cccc+", "+eeee+"], "+2222+");
        assert_drawn(&["+....+", "+8888+", "+jjjj+"], "+8888+");
        assert_drawn(&["+,,,,+", "+....+", "+aaaa+"], "+....+");
        assert_drawn(
            &[
                "+aaaaaaaaaaaaa+", //
                "   +===+       ",
                "         +4444444+",
            ],
            "+--+===+-+4444444+",
        );
    }
}
