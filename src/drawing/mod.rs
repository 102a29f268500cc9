//! The line drawing on the page: points, segments, pen, line type; fit to the page; merge coincident
//! points.
//!
//! Lines come in as they are found, mapped to steps by a [`PageMap`] that fits the image to the
//! [`Page`] and packed as [`PackedLine`]s; [`build_graph`] then makes one [`Drawing`] of them: a graph whose
//! points are all different (Harrison 5.1.1 and 5.9). Refused: what does not fit the page or the
//! memory.

mod collect;
mod overlap;
mod page;
mod title;
mod window;

pub use collect::{GraphError, PackedLine, Stored, build_graph};
pub use page::{Bounds, Page, PageError, PageMap, StepsPerMillimetre};
pub use title::{Title, TitleText, is_in_font};

use bytemuck::{Pod, Zeroable};

/// A point of the page in steps of the plotter, x right, y up; each within ±2^20.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Pod, Zeroable)]
#[repr(C)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PagePoint {
    /// Steps to the right of the page's origin.
    pub x: i32,
    /// Steps above the page's origin.
    pub y: i32,
}

/// Page coordinates stay within ± this: squared distances fit 43 bits.
pub const PAGE_LIMIT: i32 = 1 << 20;

/// How a segment is inked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LineType {
    /// Without a gap.
    #[default]
    Full,
    /// Harrison's dotted line.
    Dotted,
    /// Longer dashes than dots.
    Dashed,
}

/// A straight piece of the drawing between two different points, by point number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// One end.
    pub from: u16,
    /// The other.
    pub to: u16,
    /// 0 full, 1 dotted, 2 dashed: see [`Segment::line_type`].
    pub line_type_code: u8,
    /// The pen that draws it, from 0.
    pub pen: u8,
}

impl LineType {
    /// The code by which a [`Segment`] stores it: a full line sorts before the others.
    pub const fn code(self) -> u8 {
        match self {
            Self::Full => 0,
            Self::Dotted => 1,
            Self::Dashed => 2,
        }
    }
}

impl Segment {
    /// How it is inked.
    pub fn line_type(&self) -> LineType {
        match self.line_type_code {
            1 => LineType::Dotted,
            2 => LineType::Dashed,
            _ => LineType::Full,
        }
    }
}

/// A drawing: no two points equal, no segment twice, every segment between two different points.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// The points.
    pub points: &'a [PagePoint],
    /// The segments between them.
    pub segments: &'a [Segment],
}
