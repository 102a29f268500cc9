//! The line drawing on the page: it is fitted to the page, and coincident points and overlapping
//! segments are merged.
//!
//! Lines arrive one at a time. A [`PageMap`] that fits the image to the [`Page`] maps each to
//! steps, and it is packed as a [`PackedLine`]. [`build_graph`] then makes one [`Drawing`] of all
//! lines: a graph whose points are all different (Harrison 5.1.1 and 5.9). A drawing that does not
//! fit the page or the memory is refused.

mod collect;
mod overlap;
mod page;
mod title;
mod window;

pub use collect::{GraphError, PackedLine, Stored, build_graph};
pub use page::{Bounds, Page, PageError, PageMap, StepsPerMillimetre};
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

/// The line style of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LineType {
    /// A solid line.
    #[default]
    Full,
    /// Harrison's dotted line.
    Dotted,
    /// A line of dashes, which are longer than the dots.
    Dashed,
}

/// A straight line of the drawing between two different points, given by their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// The number of the point at one end.
    pub from: u16,
    /// The number of the point at the other end.
    pub to: u16,
    /// The line style: 0 full, 1 dotted, 2 dashed; see [`Segment::line_type`].
    pub line_type_code: u8,
    /// The pen that draws it, from 0.
    pub pen: u8,
}

impl LineType {
    /// Returns the code by which a [`Segment`] stores the style. A full line sorts before the
    /// others.
    pub const fn code(self) -> u8 {
        match self {
            Self::Full => 0,
            Self::Dotted => 1,
            Self::Dashed => 2,
        }
    }
}

impl Segment {
    /// Returns the line style.
    pub fn line_type(&self) -> LineType {
        match self.line_type_code {
            1 => LineType::Dotted,
            2 => LineType::Dashed,
            _ => LineType::Full,
        }
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
