//! The compact encoding in which the model stores faces and bars.

use super::Pens;
use bytemuck::{Pod, Zeroable};

/// One more than the greatest vertex number that an element can hold.
pub const VERTEX_NUMBER_LIMIT: usize = 1 << 14;

/// A vertex number as an element stores it, with two flags.
///
/// Bits 0 to 13 are the vertex number, from 0. Bit 14 is set in the corners of a bar. Bit 15 is set
/// in the last corner of an element. So a face of n corners takes n half-words and needs no header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Corner(pub(super) u16);

impl Corner {
    /// The bits of the vertex number.
    const VERTEX: u16 = 0x3FFF;
    /// The flag of a corner of a bar.
    const BAR: u16 = 0x4000;
    /// The flag of the last corner of an element.
    const LAST: u16 = 0x8000;

    /// Makes the corner at `vertex`, which must be below [`VERTEX_NUMBER_LIMIT`] (higher bits are
    /// discarded).
    pub const fn new(vertex: u16, of_bar: bool, last: bool) -> Self {
        let bar = if of_bar { Self::BAR } else { 0 };
        let last = if last { Self::LAST } else { 0 };
        Self(vertex & Self::VERTEX | bar | last)
    }

    /// Returns the vertex number, from 0.
    pub const fn vertex(self) -> u16 {
        self.0 & Self::VERTEX
    }

    /// Whether this corner belongs to a bar.
    pub const fn of_bar(self) -> bool {
        self.0 & Self::BAR != 0
    }

    /// Whether this is the last corner of its element.
    pub const fn is_last(self) -> bool {
        self.0 & Self::LAST != 0
    }
}

/// One face or bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element<'a> {
    /// A polygon of at least three different corners, in order around it.
    Face(&'a [Corner]),
    /// A straight bar between two different vertices.
    Bar(u16, u16),
}

impl Element<'_> {
    /// Returns the number of its corners.
    pub fn corner_count(&self) -> usize {
        match self {
            Self::Face(corners) => corners.len(),
            Self::Bar(..) => 2,
        }
    }
}

/// Faces and bars in the order in which they were sent.
///
/// If they come from a model, every vertex number exists, every face has at least three corners and
/// every bar two, and the last corner of each is marked.
#[derive(Debug, Clone, Copy)]
pub struct Elements<'a> {
    pub(super) corners: &'a [Corner],
    pub(super) pens: Pens<'a>,
}

impl<'a> Elements<'a> {
    /// Makes the elements that `corners` encode, all with the first pen. Corners after the last
    /// mark are ignored.
    pub fn new(corners: &'a [Corner]) -> Self {
        Self::with_pens(corners, Pens::default())
    }

    /// As [`Elements::new`], with the pens of the elements.
    pub fn with_pens(corners: &'a [Corner], pens: Pens<'a>) -> Self {
        let whole = corners.iter().rposition(|corner| corner.is_last()).map_or(0, |last| last + 1);
        Self { corners: &corners[..whole], pens }
    }

    /// Returns every corner of every element.
    pub fn corners(&self) -> &'a [Corner] {
        self.corners
    }

    /// Returns the pens of the elements, which are found by the index of a corner.
    pub fn pens(&self) -> Pens<'a> {
        self.pens
    }

    /// Returns each element in turn.
    pub fn iter(&self) -> impl Iterator<Item = Element<'a>> + Clone + use<'a> {
        self.corners.split_inclusive(|corner| corner.is_last()).map(|corners| match corners {
            [a, b] if a.of_bar() => Element::Bar(a.vertex(), b.vertex()),
            _ => Element::Face(corners),
        })
    }

    /// Returns each element in turn, with its pen.
    pub fn iter_with_pens(&self) -> impl Iterator<Item = (Element<'a>, u8)> + use<'a> {
        let (pens, mut first) = (self.pens, 0);
        self.iter().map(move |element| {
            let pen = pens.at(first);
            first += element.corner_count();
            (element, pen)
        })
    }
}
