//! The line drawing on the page: it is fitted to the page, and coincident points and overlapping
//! segments are merged.
//!
//! Lines arrive one at a time. A [`PageMap`] that fits the image to the [`Page`] maps each to
//! steps, and it is packed as a [`PackedLine`]. [`build_graph`] then makes one [`Drawing`] of all
//! lines: a graph whose points are all different (Harrison 5.1.1 and 5.9). A drawing that does not
//! fit the page or the memory is refused.

mod collect;
mod font;
mod line_type;
mod overlap;
mod page;
mod page_map;
mod title;
mod window;

#[cfg(feature = "early-ink")]
pub use collect::SplitMut;
pub use collect::{GraphError, PackedLine, Stored, build_graph};
pub use line_type::{Dashes, LineType};
pub use page::{Page, PageError, StepsPerMillimetre};
pub use page_map::{Bounds, PageMap};
pub use title::{LetterStrokes, Title, TitleText, is_in_font};

use crate::index::Index;
use bytemuck::{Pod, Zeroable};

/// A point of the page in plotter steps, with x to the right and y up. Each coordinate is within
/// ±2^20.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Pod, Zeroable)]
#[repr(C)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PagePoint {
    /// Steps to the right of the page's origin.
    pub x: i32,
    /// Steps above the page's origin.
    pub y: i32,
}

/// The limit of the absolute value of page coordinates, in steps. With it, squared distances fit 43
/// bits.
pub const PAGE_LIMIT: i32 = 1 << 20;

/// A straight line of the drawing between two different points, given by their numbers, which are
/// below [`Index::NONE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct Segment<I = u16>([I; 3]);

impl<I: Index> Segment<I> {
    /// Makes the segment between the points `from` and `to`, a full line of the first pen.
    pub fn new(from: I, to: I) -> Self {
        Self([from, to, I::ZERO])
    }

    /// Returns the same segment with another line type, and with `pen`, counted from 0.
    #[must_use]
    pub fn inked(self, line_type: LineType, pen: u8) -> Self {
        let Self([from, to, _]) = self;
        Self([from, to, I::new(usize::from(line_type.code()) | usize::from(pen) << 8)])
    }

    /// Returns the number of the point at one end.
    #[inline]
    pub fn from(&self) -> I {
        self.0[0]
    }

    /// Returns the number of the point at the other end.
    #[inline]
    pub fn to(&self) -> I {
        self.0[1]
    }

    /// Returns the line type.
    #[inline]
    pub fn line_type(&self) -> LineType {
        LineType::from_code(self.0[2].get() as u8)
    }

    /// Returns the pen that draws it, from 0.
    #[inline]
    pub fn pen(&self) -> u8 {
        (self.0[2] >> 8).get() as u8
    }
}

/// A line drawing on the page, as a graph. No two points are equal, no segment occurs twice, and
/// every segment joins two different points.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a, I = u16> {
    /// The points, all of them different.
    pub points: &'a [PagePoint],
    /// The segments between the points.
    pub segments: &'a [Segment<I>],
}
