//! In which order, and which way, the segments are drawn: odd points, pen-up matching, Eulerian
//! tour, joining of the separate parts.
//!
//! (skeleton: the order work fills this in)

use crate::drawing::Drawing;
use crate::stage::{Attention, OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// One segment of the tour and the way it is drawn. At most 32768 segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Leg(u16);

impl Leg {
    /// Segment `segment`, drawn from its `to` end if `reversed`.
    pub fn new(segment: u16, reversed: bool) -> Self {
        Self(segment << 1 | u16::from(reversed))
    }
    /// The number of the segment in the drawing.
    pub fn segment(self) -> usize {
        usize::from(self.0 >> 1)
    }
    /// Whether it is drawn from its `to` end to its `from` end.
    pub fn reversed(self) -> bool {
        self.0 & 1 != 0
    }
}

/// How the pen-up moves are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Exact where it fits in memory, else greedy.
    #[default]
    Auto,
    /// Greedy with regret (Harrison 5.10.1), then pair exchange.
    Greedy,
    /// Minimum-weight perfect matching.
    Exact,
}

/// Whether the pen returns to where it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// From the first stroke's start to the last stroke's end.
    #[default]
    OpenPath,
    /// And back to the first stroke's start.
    ClosedCycle,
}

/// What the user may choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// How the pen-up moves are chosen.
    pub method: Method,
    /// Open or closed.
    pub shape: Shape,
    /// How many rounds of improvement may be tried after the first tour (a budget in work, not in
    /// time, so that every machine gives the same tour).
    pub effort: u32,
}

/// What came of it. Lengths in 1/256 steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Report {
    /// Points where an odd number of segments meet.
    pub odd_points: u32,
    /// Separate parts.
    pub components: u32,
    /// Length drawn.
    pub pen_down: u64,
    /// Length of the moves between strokes.
    pub pen_up: u64,
    /// Moves between strokes.
    pub lifts: u32,
    /// Lower bound of the pen-up length.
    pub bound: u64,
    /// Whether `pen_up` is proved the least.
    pub optimal: bool,
}

/// Why there is no order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The user gave up.
    Aborted,
    /// More segments than a tour can number.
    TooManySegments,
}

/// Orders `drawing` into `tour` (as long as `drawing.segments`).
///
/// Each segment stands in the tour once; the pen goes up where a leg does not begin where the one
/// before it ended.
///
/// # Errors
/// See [`OrderError`].
pub fn order(
    _drawing: Drawing<'_>,
    _options: Options,
    _scratch: Scratch<'_>,
    _attention: &mut dyn Attention,
    _tour: &mut [Leg],
) -> Result<Report, OrderError> {
    Ok(Report::default())
}
