//! The path of the pen on the page.

/// A point on the page in mm: x to the right and y up from the lower left corner.
pub type PagePoint = [f64; 2];

/// A section of the pen's path during which the pen is neither lifted nor lowered.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Whether the pen is down.
    pub pen_down: bool,
    /// The number of the pen, counted from 1.
    pub pen: u8,
    /// The vertices of the path, in mm.
    pub points: Vec<PagePoint>,
}
