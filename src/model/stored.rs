//! A model that lies in flash, where it is read and never changed. An [`Upload`](super::Upload)
//! writes it.
//!
//! A position takes three words. It stays in the unit that was in force when it came: where a
//! larger coordinate has made the unit coarser, the record says so, and a position that came before
//! is made coarser whenever it is read. A corner takes three bytes: the number of its vertex, the
//! pen of its element, and the two marks of a [`Corner`].

use super::precision::Rounding;
use super::{Corner, FINEST_FRACTION_BITS, PEN_LIMIT, Position, Positions};
use crate::checksum::Crc32;
use crate::geometry::Precision;
use crate::storage::area::{Area, AreaRecord, RECORD_WORDS};

/// The size of a corner in flash, in bytes.
pub(super) const CORNER_BYTES: usize = 3;

/// The number of bits of a corner that are the number of its vertex.
const VERTEX_BITS: u32 = 17;
/// The number of bits of a corner that are its pen.
const PEN_BITS: u32 = 5;
const _: () = assert!(1 << PEN_BITS == PEN_LIMIT as u32);
/// The mark of a corner of a bar.
const OF_BAR: u32 = 1 << (VERTEX_BITS + PEN_BITS);
/// The mark of the last corner of an element.
const IS_LAST: u32 = OF_BAR << 1;
const _: () = assert!(IS_LAST < 1 << (8 * CORNER_BYTES));

/// The greatest number of vertices that corners can name.
pub(super) const VERTEX_LIMIT: usize = 1 << VERTEX_BITS;

/// A corner as it lies in flash.
pub(super) fn packed(corner: Corner<u32>, pen: u8) -> [u8; CORNER_BYTES] {
    let bar = if corner.of_bar() { OF_BAR } else { 0 };
    let last = if corner.is_last() { IS_LAST } else { 0 };
    let bits = corner.vertex() | u32::from(pen) << VERTEX_BITS | bar | last;
    let [a, b, c, _] = bits.to_le_bytes();
    [a, b, c]
}

/// The units that were in force while the vertices came, each coarser than the one before: the
/// first vertex of each, and its number of fraction bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Units {
    /// How many there are.
    count: usize,
    /// The vertex shifted left, and the fraction bits below it.
    changes: [u32; Self::LIMIT],
}

impl Units {
    /// The greatest number of units: 0 to 30 fraction bits.
    const LIMIT: usize = FINEST_FRACTION_BITS as usize + 1;
    /// The number of bits of a number of fraction bits.
    const BITS: u32 = 5;

    /// The unit of the first vertices.
    pub fn new(fraction_bits: u32) -> Self {
        let mut changes = [0; Self::LIMIT];
        changes[0] = fraction_bits;
        Self { count: 1, changes }
    }

    /// Notes that the unit is coarser from this vertex on.
    pub fn coarsen(&mut self, vertex: usize, fraction_bits: u32) {
        if let Some(change) = self.changes.get_mut(self.count) {
            *change = (vertex as u32) << Self::BITS | fraction_bits;
            self.count += 1;
        }
    }

    /// The first vertex of the last unit, and its number of fraction bits.
    pub fn last(&self) -> (usize, u32) {
        Self::parts(self.changes.get(self.count - 1).copied().unwrap_or(0))
    }

    /// The number of fraction bits in which a vertex came.
    fn of(&self, vertex: usize) -> u32 {
        let changes = self.changes.get(..self.count).unwrap_or(&[]);
        let after = changes.partition_point(|&change| Self::parts(change).0 <= vertex);
        let last = after.checked_sub(1).and_then(|last| changes.get(last));
        last.map_or(0, |&change| Self::parts(change).1)
    }

    /// The vertex and the fraction bits of a change.
    fn parts(change: u32) -> (usize, u32) {
        ((change >> Self::BITS) as usize, change & ((1 << Self::BITS) - 1))
    }
}

/// What is known of a model in flash beside its vertices and corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ModelSummary {
    pub faces: usize,
    pub bars: usize,
    pub rounding: Rounding,
    /// One bit for each pen that an element has.
    pub pens: u32,
    /// Elements before this corner have the first pen, whatever their corners say.
    pub void_before: usize,
    /// The box around all vertices, in the unit of the last.
    pub bounds: (Position, Position),
    pub units: Units,
}

impl ModelSummary {
    /// The summary as the words of a record.
    pub fn words(&self) -> [u32; RECORD_WORDS] {
        let Self { faces, bars, rounding, pens, void_before, bounds: (low, high), units } = self;
        let [decimals, edited] = rounding.numbers();
        let head = [*faces, *bars, decimals, edited, *pens as usize, *void_before, units.count];
        let head = head.map(|number| number as u32);
        let box_words = low.coordinates().into_iter().chain(high.coordinates());
        let all = head.into_iter().chain(box_words.map(i32::cast_unsigned)).chain(units.changes);
        let mut words = [u32::MAX; RECORD_WORDS];
        words.iter_mut().zip(all).for_each(|(slot, word)| *slot = word);
        words
    }

    /// The summary of which these are the words. `None` if they are none.
    fn of_words(words: &[u32; RECORD_WORDS]) -> Option<Self> {
        let (head, rest) = words.split_first_chunk::<7>()?;
        let (corners, rest) = rest.split_first_chunk::<6>()?;
        let [faces, bars, decimals, edited, pens, void_before, count] = *head;
        let [low_x, low_y, low_z, x, y, z] = corners.map(u32::cast_signed);
        let count = count as usize;
        let units = Units { count, changes: *rest.first_chunk()? };
        (1..=Units::LIMIT).contains(&count).then_some(Self {
            faces: faces as usize,
            bars: bars as usize,
            rounding: Rounding::from_numbers([decimals, edited]),
            pens,
            void_before: void_before as usize,
            bounds: (Position { x: low_x, y: low_y, z: low_z }, Position { x, y, z }),
            units,
        })
    }
}

/// Makes a coordinate coarser by this many bits, rounded towards zero. As it may be done in several
/// steps, it is the same as when a model in memory does it.
fn coarser(coordinate: i32, bits: u32) -> i32 {
    coordinate / (1 << bits)
}

/// Makes a position coarser by this many bits.
pub(super) fn coarser_position(Position { x, y, z }: Position, bits: u32) -> Position {
    Position { x: coarser(x, bits), y: coarser(y, bits), z: coarser(z, bits) }
}

/// A complete model in flash.
#[derive(Debug, Clone, Copy)]
pub struct StoredModel<'f> {
    /// Where it lies: the positions are the low contents, the corners the high ones.
    area: Area<'f>,
    /// Its record.
    record: AreaRecord,
    /// What the record says.
    summary: ModelSummary,
}

impl<'f> StoredModel<'f> {
    /// The model that lies in an area, if there is one and all of it has been written.
    #[inline(never)] // Keeps its frame off the stack while the model is drawn.
    pub fn new(area: Area<'f>) -> Option<Self> {
        let record = area.record()?;
        let summary = ModelSummary::of_words(&record.words)?;
        Some(Self { area, record, summary })
    }

    /// Whether the flash still holds what was written. `check` is called after each KiB or so.
    ///
    /// # Errors
    /// That of `check`.
    pub fn is_sound<E>(&self, check: &mut dyn FnMut() -> Result<(), E>) -> Result<bool, E> {
        self.area.is_sound(&self.record, check)
    }

    /// The number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.record.lengths[0] / size_of::<Position>()
    }

    /// The number of corners of faces and ends of bars.
    pub fn corner_count(&self) -> usize {
        self.record.lengths[1] / CORNER_BYTES
    }

    /// The number of faces.
    pub fn face_count(&self) -> usize {
        self.summary.faces
    }

    /// The number of bars.
    pub fn bar_count(&self) -> usize {
        self.summary.bars
    }

    /// One bit for each pen, from the lowest, that an element has.
    pub fn pens(&self) -> u32 {
        self.summary.pens
    }

    /// Whether it is a plan: it has only bars, and all vertices are at one height.
    pub fn is_plan(&self) -> bool {
        let (low, high) = self.summary.bounds;
        self.summary.faces == 0 && self.summary.bars > 0 && low.z == high.z
    }

    /// The position of a vertex, in units of 2^-[`Positions::fraction_bits`]. A vertex that does
    /// not exist has any.
    #[inline]
    pub fn position(&self, vertex: usize) -> Position {
        let at = Area::LOW + 3 * vertex;
        let word = |number: usize| self.area.word(at + number).cast_signed();
        let position = Position { x: word(0), y: word(1), z: word(2) };
        let (since, fraction_bits) = self.summary.units.last();
        if vertex >= since {
            return position;
        }
        coarser_position(position, self.summary.units.of(vertex).saturating_sub(fraction_bits))
    }

    /// The bits of a corner.
    #[inline]
    fn bits(&self, corner: usize) -> u32 {
        let [a, b, c] = self.area.high_3(CORNER_BYTES * corner);
        u32::from_le_bytes([a, b, c, 0])
    }

    /// The corner with this index, from 0. The last one ends its element, and so does any that does
    /// not exist.
    #[inline]
    pub fn corner(&self, corner: usize) -> Corner<u32> {
        let bits = self.bits(corner);
        Corner::new(bits & ((1 << VERTEX_BITS) - 1), bits & OF_BAR != 0, bits & IS_LAST != 0)
    }

    /// The pen, from 0, of the element to which a corner belongs.
    #[inline]
    pub fn pen(&self, corner: usize) -> u8 {
        if corner < self.summary.void_before {
            return 0;
        }
        (self.bits(corner) >> VERTEX_BITS) as u8 & ((1 << PEN_BITS) - 1)
    }

    /// The checksum of the model, as [`Model::checksum`](super::Model::checksum) computes it.
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn checksum(&self) -> u32 {
        let mut digest = Crc32::new();
        let number = |digest: &mut Crc32, number: u32| digest.update(&number.to_le_bytes());
        number(&mut digest, self.vertex_count() as u32);
        let shift = FINEST_FRACTION_BITS - self.fraction_bits().min(FINEST_FRACTION_BITS);
        for position in self.positions() {
            for coordinate in position.coordinates() {
                digest.update(&(i64::from(coordinate) << shift).to_le_bytes());
            }
        }
        number(&mut digest, (self.summary.faces + self.summary.bars) as u32);
        let mut first = 0;
        while first < self.corner_count() {
            let last = (first..self.corner_count()).find(|&corner| self.corner(corner).is_last());
            let end = last.map_or(self.corner_count(), |last| last + 1);
            number(&mut digest, self.pen(first).into());
            number(&mut digest, (end - first) as u32);
            (first..end).for_each(|corner| number(&mut digest, self.corner(corner).vertex()));
            first = end;
        }
        // There are no curves.
        number(&mut digest, 0);
        let [decimals, _] = self.summary.rounding.numbers();
        number(&mut digest, decimals as u32);
        digest.finalize()
    }
}

impl Positions for StoredModel<'_> {
    fn fraction_bits(&self) -> u32 {
        self.summary.units.last().1
    }

    fn bounds(&self) -> Option<(Position, Position)> {
        (self.vertex_count() > 0).then_some(self.summary.bounds)
    }

    fn positions(&self) -> impl Iterator<Item = Position> {
        (0..self.vertex_count()).map(|vertex| self.position(vertex))
    }

    fn precision(&self) -> Precision {
        self.summary.rounding.precision(self.fraction_bits())
    }
}
