//! The compact encoding in which the model stores faces and bars.

use super::Pens;
use crate::index::Index;
use bytemuck::{Pod, Zeroable};

/// A vertex number as an element stores it, with two flags.
///
/// The lowest bits are the vertex number, from 0: 14 bits of the 16 on a board. The next bit is set
/// in the corners of a bar, and the highest in the last corner of an element. So a face of n
/// corners takes n numbers and needs no header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Corner<I = u16>(pub(super) I);

impl<I: Index> Corner<I> {
    /// How many bits a vertex number has.
    const VERTEX_BITS: u32 = I::BITS - 2;
    /// One more than the greatest vertex number that a corner can hold.
    pub const VERTEX_NUMBER_LIMIT: usize = 1 << Self::VERTEX_BITS;
    /// A corner at the first vertex, with no flag.
    pub const ZERO: Self = Self(I::ZERO);

    /// The flag of a corner of a bar.
    fn bar() -> I {
        I::ONE << Self::VERTEX_BITS
    }

    /// The flag of the last corner of an element.
    fn last() -> I {
        I::ONE << (Self::VERTEX_BITS + 1)
    }

    /// Makes the corner at `vertex`, which must be below [`Corner::VERTEX_NUMBER_LIMIT`] (higher
    /// bits are discarded).
    pub fn new(vertex: I, of_bar: bool, last: bool) -> Self {
        let bar = if of_bar { Self::bar() } else { I::ZERO };
        let last = if last { Self::last() } else { I::ZERO };
        Self(vertex & (Self::bar() - I::ONE) | bar | last)
    }

    /// Returns the vertex number, from 0.
    #[inline]
    pub fn vertex(self) -> I {
        self.0 & (Self::bar() - I::ONE)
    }

    /// Whether this corner belongs to a bar.
    #[inline]
    pub fn of_bar(self) -> bool {
        self.0 & Self::bar() != I::ZERO
    }

    /// Whether this is the last corner of its element.
    #[inline]
    pub fn is_last(self) -> bool {
        self.0 & Self::last() != I::ZERO
    }
}

/// One face or bar, decoded from its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element<'a, I = u16> {
    /// A polygon of at least three different corners, in order around it.
    Face(&'a [Corner<I>]),
    /// A straight bar between two different vertices.
    Bar(I, I),
}

impl<I: Index> Element<'_, I> {
    /// Returns the number of corners of the element.
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
pub struct Elements<'a, I = u16> {
    /// The encoded corners of all elements, in the order in which these were sent.
    pub(super) corners: &'a [Corner<I>],
    /// Which pen draws each element.
    pub(super) pens: Pens<'a, I>,
}

impl<'a, I: Index> Elements<'a, I> {
    /// Makes the elements that `corners` encode, all with the first pen. Corners after the last
    /// mark are ignored.
    pub fn new(corners: &'a [Corner<I>]) -> Self {
        Self::with_pens(corners, Pens::default())
    }

    /// Makes the elements that `corners` encode, drawn with these pens. Corners after the last mark
    /// are ignored.
    pub fn with_pens(corners: &'a [Corner<I>], pens: Pens<'a, I>) -> Self {
        let whole = corners.iter().rposition(|corner| corner.is_last()).map_or(0, |last| last + 1);
        // `whole` is 0, or one more than an index of `corners`, so there are as many.
        Self { corners: &corners[..whole], pens }
    }

    /// Returns the corners of all elements, one element after the other.
    pub fn corners(&self) -> &'a [Corner<I>] {
        self.corners
    }

    /// Returns the pens of the elements, which are found by the index of a corner.
    pub fn pens(&self) -> Pens<'a, I> {
        self.pens
    }

    /// Returns the elements one by one, in the order in which they were sent.
    pub fn iter(&self) -> impl Iterator<Item = Element<'a, I>> + Clone + use<'a, I> {
        self.corners.split_inclusive(|corner| corner.is_last()).map(|corners| match corners {
            [a, b] if a.of_bar() => Element::Bar(a.vertex(), b.vertex()),
            _ => Element::Face(corners),
        })
    }

    /// Returns the elements one by one, each with the pen that draws it.
    pub fn iter_with_pens(&self) -> impl Iterator<Item = (Element<'a, I>, u8)> + use<'a, I> {
        let (pens, mut first) = (self.pens, 0);
        self.iter().map(move |element| {
            let pen = pens.at(first);
            first += element.corner_count();
            (element, pen)
        })
    }
}
