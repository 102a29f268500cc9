//! Turns separate lines into a drawing: merges coincident points (Harrison 5.9) and removes
//! duplicate segments.
//!
//! While visibility is computed, lines are packed at 12 bytes each ([`PackedLine`]). Then
//! [`build_graph`] turns them into points and segments, in the same memory.

use super::overlap::{LineOf, NumberedLine, Rank, ink_once};
use super::{Drawing, LineType, PAGE_LIMIT, PagePoint, Segment};
use crate::array::MapEach;
use crate::index::Index;
use crate::model::PEN_LIMIT;
use crate::stage::{
    Aborted, Cancel, OutOfScratch, Scratch, StageError, heap_sort_cancellable, items, items_mut,
};
use bytemuck::{Pod, Zeroable};
use core::marker::PhantomData;

/// A straight line on the page, packed into 12 bytes.
///
/// | bits | contents |
/// |---|---|
/// | 0 to 83 | x and y of one end, then of the other, each [`PAGE_LIMIT`] plus the coordinate |
/// | 84 to 87 | the code of the line type, so there may be 16 types |
/// | 88 | whether the line yields to any other at the same position |
/// | 89 to 93 | the pen, from 0 |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PackedLine([u32; 3]);

/// The position, in the last word of a packed line, of what it keeps besides its ends.
const MARKS: u32 = 84 - 64;

/// What a packed line keeps besides its ends: how and with which pen it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Marks {
    /// How the line is inked: solid, dotted and so on.
    line_type: LineType,
    /// Whether the line yields to any other at the same position.
    yields: bool,
    /// The pen that draws the line, from 0.
    pen: u8,
}

impl Marks {
    /// The bit that marks a line that yields to any other at the same position.
    const YIELDS: u32 = 1 << LineType::CODE_BITS;

    /// Packs the marks into ten bits, as [`Marks::from_bits`] reads them.
    fn bits(self) -> u32 {
        let yields = if self.yields { Self::YIELDS } else { 0 };
        let pen = u32::from(self.pen % PEN_LIMIT) << (LineType::CODE_BITS + 1);
        u32::from(self.line_type.code()) | yields | pen
    }

    /// Unpacks what [`Marks::bits`] packed. Higher bits are ignored.
    fn from_bits(bits: u32) -> Self {
        Self {
            line_type: LineType::from_code((bits & (Self::YIELDS - 1)) as u8),
            yields: bits & Self::YIELDS != 0,
            pen: (bits >> (LineType::CODE_BITS + 1)) as u8 % PEN_LIMIT,
        }
    }
}

impl PackedLine {
    /// Packs the line from `from` to `to`. Both must be within ±[`PAGE_LIMIT`], and `pen` below
    /// [`PEN_LIMIT`].
    pub fn new(from: PagePoint, to: PagePoint, line_type: LineType, pen: u8) -> Self {
        let pack = |c: i32| (c.clamp(1 - PAGE_LIMIT, PAGE_LIMIT - 1) + PAGE_LIMIT) as u64;
        let low = pack(from.x) | pack(from.y) << 21 | pack(to.x) << 42 | pack(to.y) << 63;
        let high = (pack(to.y) >> 1) as u32;
        let marks = Marks { line_type, yields: false, pen }.bits();
        Self([low as u32, (low >> 32) as u32, high | marks << MARKS])
    }

    /// Returns the same line. A full line is marked to yield to any other line at the same
    /// position, so that a hidden line never replaces a visible one.
    #[must_use]
    pub fn under(self) -> Self {
        let Self([low, middle, high]) = self;
        let yields = if self.marks().line_type == LineType::Full { Marks::YIELDS } else { 0 };
        Self([low, middle, high | yields << MARKS])
    }

    /// Whether its ends are different points, so that there is a line to draw.
    pub fn has_length(self) -> bool {
        let [from, to] = self.ends();
        from != to
    }

    /// Returns the two ends of the line.
    pub fn ends(self) -> [PagePoint; 2] {
        let [low, middle, high] = self.0.map(u64::from);
        let low = low | middle << 32;
        [low, low >> 42 | high << 22].map_each(|packed| {
            let coordinate = |shift: u32| ((packed >> shift) as i32 & 0x1F_FFFF) - PAGE_LIMIT;
            PagePoint { x: coordinate(0), y: coordinate(21) }
        })
    }

    /// Unpacks the line type, the pen and whether the line yields.
    fn marks(self) -> Marks {
        Marks::from_bits(self.0[2] >> MARKS)
    }
}

/// The points and the segments of a drawing, and the memory behind them.
#[cfg(feature = "early-ink")]
pub type SplitMut<'a, I> = (&'a [PagePoint], &'a mut [Segment<I>], Scratch<'a>);

/// The layout of a drawing in the working memory: first the segments, then the points.
#[derive(Debug, Clone, Copy)]
pub struct Stored<I = u16> {
    /// The number of segments, which come first.
    segments: usize,
    /// The number of points, which follow the segments.
    points: usize,
    /// The width of the numbers in the segments.
    width: PhantomData<I>,
}

impl<I: Index> Default for Stored<I> {
    fn default() -> Self {
        Self::of_counts([0; 2])
    }
}

impl<I: Index> Stored<I> {
    /// Returns the number of segments and the number of points.
    pub fn counts(&self) -> [usize; 2] {
        [self.segments, self.points]
    }

    /// Makes the layout that has these [`Stored::counts`].
    pub fn of_counts([segments, points]: [usize; 2]) -> Self {
        Self { segments, points, width: PhantomData }
    }

    /// Returns the number of bytes from the beginning of the memory to the end of the drawing.
    pub fn bytes(&self) -> usize {
        self.segment_bytes() + Scratch::bytes_for::<PagePoint>(self.points)
    }

    /// Returns the number of bytes that the segments take, which is where the points begin.
    fn segment_bytes(&self) -> usize {
        Scratch::bytes_for::<Segment<I>>(self.segments)
    }

    /// Returns the drawing stored in `words`, or `None` if `words` is too short for it.
    pub fn drawing<'a>(&self, words: &'a [u64]) -> Option<Drawing<'a, I>> {
        let points = words.get(self.segment_bytes() / 8..)?;
        Some(Drawing {
            segments: items(words, self.segments)?,
            points: items(points, self.points)?,
        })
    }

    /// Returns the points and the segments of the drawing stored in `words`, which may change
    /// places, and the memory after it.
    ///
    /// # Errors
    /// As [`Stored::split`].
    #[cfg(feature = "early-ink")]
    pub fn split_mut<'a>(&self, words: &'a mut [u64]) -> Result<SplitMut<'a, I>, OutOfScratch> {
        let missing = OutOfScratch { needed: self.bytes(), available: size_of_val(words) };
        let (segments, rest) =
            words.split_at_mut_checked(self.segment_bytes() / 8).ok_or(missing)?;
        let point_words = Scratch::bytes_for::<PagePoint>(self.points) / 8;
        let (points, rest) = rest.split_at_mut_checked(point_words).ok_or(missing)?;
        let points = items(points, self.points).ok_or(missing)?;
        let segments = items_mut(segments, self.segments).ok_or(missing)?;
        Ok((points, segments, Scratch::new(rest)))
    }

    /// Returns the drawing stored in `words`, and the memory after it.
    ///
    /// # Errors
    /// [`OutOfScratch`] if `words` is too short for the drawing.
    pub fn split<'a>(
        &self,
        words: &'a mut [u64],
    ) -> Result<(Drawing<'a, I>, Scratch<'a>), OutOfScratch> {
        let missing = OutOfScratch { needed: self.bytes(), available: size_of_val(words) };
        let (segments, rest) =
            words.split_at_mut_checked(self.segment_bytes() / 8).ok_or(missing)?;
        let point_words = Scratch::bytes_for::<PagePoint>(self.points) / 8;
        let (points, rest) = rest.split_at_mut_checked(point_words).ok_or(missing)?;
        let drawing = Drawing {
            segments: items(segments, self.segments).ok_or(missing)?,
            points: items(points, self.points).ok_or(missing)?,
        };
        Ok((drawing, Scratch::new(rest)))
    }
}

/// The reasons why lines did not become a drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GraphError {
    /// The points do not fit in the memory beside the lines.
    Scratch(OutOfScratch),
    /// The user aborted the job.
    Aborted,
}

impl From<OutOfScratch> for GraphError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}

impl From<StageError> for GraphError {
    fn from(error: StageError) -> Self {
        match error {
            StageError::Scratch(missing) => Self::Scratch(missing),
            StageError::Aborted => Self::Aborted,
        }
    }
}

impl From<Aborted> for GraphError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

/// The number of lines between two calls of [`Cancel::check`]. Each line searches for its points at
/// up to 18 positions, so this many lines take about 50,000 instructions.
const LINES_BETWEEN_CHECKS: usize = 32;

/// Turns the `count` lines at the beginning of `words` into a drawing at the beginning of `words`.
///
/// Points less than two steps apart along both axes become one, the first of them. Lines that
/// shrink to a point are dropped. Where segments overlap, one is kept: a full line before a dotted
/// one, then the lower pen before the higher.
///
/// # Errors
/// See [`GraphError`]; on an error the lines are lost.
// Not inlined, so that its variables take no stack while the rest of a job is computed.
#[inline(never)]
pub fn build_graph<I: Index>(
    words: &mut [u64],
    count: usize,
    cancel: &mut dyn Cancel,
) -> Result<Stored<I>, GraphError> {
    // A line inside another one that yields to it splits that one into two pieces, so there may be
    // up to twice as many segments as lines. There is room for so many if memory is left beside the
    // points of the lines and their table.
    let all: &[PackedLine] = items(words, count).unwrap_or(&[]);
    let marks = |line: &PackedLine| line.0[2] >> MARKS;
    let differ = all.iter().any(|line| Some(marks(line)) != all.first().map(marks));
    let available = size_of_val(words);
    let point_bytes = 2 * count * (size_of::<PagePoint>() + 2 * size_of::<I>());
    let spare = available.saturating_sub(point_bytes) / size_of::<LineOf<I>>();
    // In both cases it is at least `count`. So no index of a line below can fail: `kept` is at most
    // `at`, which is below `count`, and `spread` packed lines take as much room as a numbered one.
    let room = if differ { (2 * count).min(spare).max(count + count / 4 + 8) } else { count };
    let line_words = Scratch::bytes_for::<LineOf<I>>(room) / 8;
    let missing = OutOfScratch { needed: line_words * 8, available };
    let (line_memory, rest) = words.split_at_mut_checked(line_words).ok_or(missing)?;
    let lines: &mut [LineOf<I>] = items_mut(line_memory, room).ok_or(missing)?;
    // Each packed line becomes a numbered one in its place, so it must have as much room.
    let spread = size_of::<LineOf<I>>() / size_of::<PackedLine>();
    if spread > 1 {
        let packed: &mut [PackedLine] = bytemuck::cast_slice_mut(&mut *lines);
        for at in (0..count).rev() {
            packed[spread * at] = packed[at];
        }
    }

    let (segments, points) = {
        let mut finder = PointFinder::<I>::new(Scratch::new(rest), 2 * count)?;
        let mut kept = 0;
        for at in 0..count {
            if at % LINES_BETWEEN_CHECKS == 0 {
                cancel.check()?;
            }
            let line = bytemuck::cast_slice::<_, PackedLine>(lines)[spread * at];
            let [from, to] = line.ends();
            let ends = [finder.number(from)?, finder.number(to)?];
            if ends[0] != ends[1] {
                let Marks { line_type, yields, pen } = line.marks();
                let rank = Rank::new(line_type, yields, pen);
                lines[kept] = NumberedLine::new(ends, rank);
                kept += 1;
            }
        }
        let points = finder.points.get(..finder.count).unwrap_or(&[]);
        let segments = ink_once::<I>(lines, kept, points, cancel)?;
        let found = lines.get_mut(..segments).unwrap_or(&mut []);
        for line in found.iter_mut() {
            *line = NumberedLine::new(line.ends::<I>(), line.rank());
        }
        // No two have the same ends.
        heap_sort_cancellable(found, |line| line.key(), cancel)?;
        (segments, points.len())
    };

    // Shrink each line, of six numbers, to its segment, of three, in place, from front to back.
    // `ink_once` returns no more segments than `lines` has room for, so all of these numbers exist.
    let numbers: &mut [I] = bytemuck::cast_slice_mut(&mut *line_memory);
    for at in 0..segments {
        let line: [I; 6] = core::array::from_fn(|number| numbers[6 * at + number]);
        let line: LineOf<I> = bytemuck::cast(line);
        let ([from, to], (line_type, pen)) = (line.ends::<I>(), line.rank().line_type_and_pen());
        let packed: [I; 3] = bytemuck::cast(Segment::new(from, to).inked(line_type, pen));
        numbers[3 * at..3 * at + 3].copy_from_slice(&packed);
    }

    let stored = Stored::of_counts([segments, points]);
    let point_words = Scratch::bytes_for::<PagePoint>(points) / 8;
    // The points lie at the front of what is behind the lines, and segments are shorter than these.
    words.copy_within(line_words..line_words + point_words, stored.segment_bytes() / 8);
    Ok(stored)
}

/// Numbers points with a hash table of their positions, and gives coincident points the same
/// number.
struct PointFinder<'a, I> {
    /// The points found so far, followed by room for more.
    points: &'a mut [PagePoint],
    /// The number of different points found so far.
    count: usize,
    /// For each slot the point number + 1, or 0 if it is free. The length is a power of two.
    table: &'a mut [I],
}

impl<'a, I: Index> PointFinder<'a, I> {
    /// Makes a finder for at most `most` points. Its table has twice as many slots, or fewer if
    /// memory is short.
    fn new(scratch: Scratch<'a>, most: usize) -> Result<Self, OutOfScratch> {
        let available = scratch.available_bytes();
        // The table takes at most a third of the memory: a point takes 8 bytes, and the table 2 to
        // 4 bytes for each point.
        let longest = (available / 3 / size_of::<I>()).max(1);
        let longest = 1 << (usize::BITS - 1 - longest.leading_zeros());
        let most_slots = I::NONE.get().saturating_add(1).saturating_mul(2);
        let length = (2 * most).next_power_of_two().clamp(8, most_slots).min(longest);
        let (mut points, mut table) =
            scratch.split(available.saturating_sub(Scratch::bytes_for::<I>(length)));
        let point_limit = (points.available_bytes() / size_of::<PagePoint>()).min(most);
        Ok(Self { points: points.take(point_limit)?, count: 0, table: table.take(length)? })
    }

    /// Returns the number of a point. It is that of a known point at the same position or one step
    /// away from it, or else a new number.
    fn number(&mut self, point: PagePoint) -> Result<I, OutOfScratch> {
        /// Where to look for a known point, in steps from the new one: first at the same position,
        /// then beside, above and below it, and then at the four diagonal neighbours.
        const SAME_THEN_AROUND: [(i32, i32); 9] =
            [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
        for (dx, dy) in SAME_THEN_AROUND {
            if let Some(number) = self.find(PagePoint { x: point.x + dx, y: point.y + dy }) {
                return Ok(number);
            }
        }
        self.add(point)
    }

    /// Returns the slot of the table at which the search for a point begins.
    fn slot(&self, point: PagePoint) -> usize {
        let mixed =
            (point.x as u32).wrapping_mul(0x9E37_79B1) ^ (point.y as u32).wrapping_mul(0x85EB_CA77);
        (mixed ^ mixed >> 15) as usize & (self.table.len() - 1)
    }

    /// Returns the number of the known point at exactly this position.
    fn find(&self, point: PagePoint) -> Option<I> {
        let mut slot = self.slot(point);
        // The table always has a free slot, so this loop ends.
        loop {
            let next = *self.table.get(slot)?;
            let at = next.get().checked_sub(1)?;
            if *self.points.get(at)? == point {
                return Some(next - I::ONE);
            }
            slot = (slot + 1) & (self.table.len() - 1);
        }
    }

    /// Adds a new point, which is not yet known, and returns its number.
    fn add(&mut self, point: PagePoint) -> Result<I, OutOfScratch> {
        let full = OutOfScratch {
            needed: (self.count + 1) * size_of::<PagePoint>(),
            available: size_of_val(self.points),
        };
        // One slot at least stays free.
        let fullest = self.table.len() - self.table.len().div_ceil(8);
        if self.count >= fullest.min(I::NONE.get()) {
            return Err(full);
        }
        *self.points.get_mut(self.count).ok_or(full)? = point;
        let mut slot = self.slot(point);
        while *self.table.get(slot).ok_or(full)? != I::ZERO {
            slot = (slot + 1) & (self.table.len() - 1);
        }
        let number = I::new(self.count);
        self.count += 1;
        *self.table.get_mut(slot).ok_or(full)? = number + I::ONE;
        Ok(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::NeverCancel;
    use std::vec;
    use std::vec::Vec;

    fn point(x: i32, y: i32) -> PagePoint {
        PagePoint { x, y }
    }

    fn drawn(lines: &[PackedLine], words: usize) -> Result<Vec<[(i32, i32); 2]>, GraphError> {
        let mut memory = vec![0u64; words];
        items_mut(&mut memory, lines.len()).unwrap().copy_from_slice(lines);
        let stored = build_graph::<u16>(&mut memory, lines.len(), &mut NeverCancel)?;
        let (drawing, _) = stored.split(&mut memory)?;
        let at = |number: u16| drawing.points[usize::from(number)];
        Ok(drawing
            .segments
            .iter()
            .map(|s| [at(s.from()), at(s.to())].map(|p| (p.x, p.y)))
            .collect())
    }

    fn line(from: (i32, i32), to: (i32, i32)) -> PackedLine {
        PackedLine::new(point(from.0, from.1), point(to.0, to.1), LineType::Full, 0)
    }

    #[test]
    fn a_line_keeps_what_it_is_given() {
        for (x, y, line_type, pen) in [
            (0, 0, LineType::Full, 0),
            (PAGE_LIMIT - 1, 1 - PAGE_LIMIT, LineType::Dashed, 31),
            (-1, 77, LineType::Dotted, 5),
        ] {
            let packed = PackedLine::new(point(x, y), point(y, x), line_type, pen);
            let marks = Marks { line_type, yields: false, pen };
            assert_eq!((packed.ends(), packed.marks()), ([point(x, y), point(y, x)], marks));
            assert_eq!(packed.has_length(), x != y);
            // Only a full line yields, and nothing but its mark changes.
            let (under, yields) = (packed.under(), line_type == LineType::Full);
            assert_eq!((under.ends(), under.marks()), (packed.ends(), Marks { yields, ..marks }));
            let segment = Segment::new(0u16, 1).inked(line_type, pen);
            assert_eq!((segment.line_type(), segment.pen()), (line_type, pen));
        }
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(drawn(&[], 8), Ok(vec![]));
    }

    #[test]
    fn coincident_points_are_one_and_nothing_is_twice() {
        let lines = [
            line((0, 0), (100, 0)),
            line((101, 1), (50, 80)),
            line((50, 80), (99, -1)), // the same as the one before
            line((50, 80), (51, 79)), // shrinks to a point
            line((1, 0), (50, 81)),
        ];
        let found = drawn(&lines, 64).unwrap();
        assert_eq!(found, [[(0, 0), (100, 0)], [(0, 0), (50, 80)], [(100, 0), (50, 80)]]);
    }

    #[test]
    fn too_little_memory_is_an_error_and_never_a_panic() {
        let lines: Vec<PackedLine> = (0..40).map(|i| line((i * 10, 0), (i * 10, 5))).collect();
        // The lines alone take 60 words. A few more leave a table of 1 to 8 slots.
        for words in 60..=120 {
            assert!(drawn(&lines, words).is_err(), "{words} words");
        }
        let enough = (121..400).find(|words| drawn(&lines, *words).is_ok());
        assert!(enough.is_some());
        for words in enough.unwrap()..400 {
            assert_eq!(drawn(&lines, words).map(|found| found.len()), Ok(40), "{words} words");
        }
    }
}
