//! The line drawing on the page: it is fitted to the page, and coincident points and overlapping
//! segments are merged.
//!
//! Lines arrive one at a time. A [`PageMap`] that fits the image to the [`Page`] maps each to
//! steps, and it is packed as a [`PackedLine`]. [`build_graph`] then makes one [`Drawing`] of all
//! lines: a graph whose points are all different (Harrison 5.1.1 and 5.9). A drawing that does not
//! fit the page or the memory is refused.

mod collect;
mod line_type;
mod overlap;
mod page;
mod page_map;
mod title;
mod window;

pub use collect::{GraphError, PackedLine, Stored, build_graph};
pub use line_type::{Dashes, LineType};
pub use page::{Page, PageError, StepsPerMillimetre};
pub use page_map::{Bounds, PageMap};
pub use title::{Title, TitleText, is_in_font};

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

/// A straight line of the drawing between two different points, given by their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// The number of the point at one end.
    pub from: u16,
    /// The number of the point at the other end.
    pub to: u16,
    /// The [code](LineType::code) of its line type.
    pub line_type_code: u8,
    /// The pen that draws it, from 0.
    pub pen: u8,
}

impl Segment {
    /// Returns the line type.
    pub fn line_type(&self) -> LineType {
        LineType::from_code(self.line_type_code)
    }
}

/// A drawing. No two points are equal, no segment occurs twice, and every segment joins two
/// different points.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// The points, all of them different.
    pub points: &'a [PagePoint],
    /// The segments between the points.
    pub segments: &'a [Segment],
}
