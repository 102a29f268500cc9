//! Turns lines, dotted lines and arcs into single moves of the plotter in eight directions.
//!
//! Harrison 1.6: of the two moves that may follow, a line takes the one that ends nearer to the
//! true line. If both are equally near (the Knight's move condition, 1.6.1), the choice depends on
//! the direction of the line. So the moves from A to B are the moves from B to A reversed, and a
//! line that is drawn twice is no thicker. [`Line`] yields the moves, and [`Pattern`] says which of
//! them are drawn with the pen down. [`Arc`] yields the points of an arc, and [`Chords`] joins
//! these points into lines that draw exactly the same points.
//!
//! This module does not handle speed, pen or limits. A line of more than 2^21 moves leaves the
//! page; it is refused where the page is checked.

mod arc;
mod chords;
mod line;
mod pattern;
pub mod tape;

pub use arc::{Arc, ArcError, Turn};
pub use chords::Chords;
pub use line::Line;
pub use pattern::Pattern;

use crate::drawing::PagePoint;

/// One move of the plotter, numbered as Harrison's diagram 1.4 does: clockwise from straight up.
///
/// ```
/// use penup::step::Direction;
/// assert_eq!(Direction::UpRight.delta(), (1, 1));
/// assert_eq!(Direction::UpRight.reversed(), Direction::DownLeft);
/// assert_eq!(Direction::from_delta(0, -1), Some(Direction::Down));
/// assert_eq!(Direction::from_delta(0, 0), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Direction {
    /// Upwards: y + 1.
    Up = 1,
    /// To the right and upwards: x + 1, y + 1.
    UpRight = 2,
    /// To the right: x + 1.
    Right = 3,
    /// To the right and downwards: x + 1, y - 1.
    DownRight = 4,
    /// Downwards: y - 1.
    Down = 5,
    /// To the left and downwards: x - 1, y - 1.
    DownLeft = 6,
    /// To the left: x - 1.
    Left = 7,
    /// To the left and upwards: x - 1, y + 1.
    UpLeft = 8,
}

impl Direction {
    /// All eight directions, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Up,
        Self::UpRight,
        Self::Right,
        Self::DownRight,
        Self::Down,
        Self::DownLeft,
        Self::Left,
        Self::UpLeft,
    ];

    /// The direction given by the signs of `dx` and `dy`; `None` if both are 0.
    pub const fn from_delta(dx: i32, dy: i32) -> Option<Self> {
        Some(match (dx.signum(), dy.signum()) {
            (0, 1) => Self::Up,
            (1, 1) => Self::UpRight,
            (1, 0) => Self::Right,
            (1, -1) => Self::DownRight,
            (0, -1) => Self::Down,
            (-1, -1) => Self::DownLeft,
            (-1, 0) => Self::Left,
            (-1, 1) => Self::UpLeft,
            _ => return None,
        })
    }

    /// The changes of x and y by the move, each -1, 0 or 1.
    pub const fn delta(self) -> (i32, i32) {
        /// The changes of x and y by a move in each direction, indexed by the number of the
        /// direction.
        const DELTAS: [(i8, i8); 9] =
            [(0, 0), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)];
        let (dx, dy) = DELTAS[self as usize];
        (dx as i32, dy as i32)
    }

    /// Returns the opposite direction.
    pub const fn reversed(self) -> Self {
        match self {
            Self::Up => Self::Down,
            Self::UpRight => Self::DownLeft,
            Self::Right => Self::Left,
            Self::DownRight => Self::UpLeft,
            Self::Down => Self::Up,
            Self::DownLeft => Self::UpRight,
            Self::Left => Self::Right,
            Self::UpLeft => Self::DownRight,
        }
    }

    /// Returns the point to which the move leads from `point`.
    pub const fn from_point(self, point: PagePoint) -> PagePoint {
        let (dx, dy) = self.delta();
        PagePoint { x: point.x + dx, y: point.y + dy }
    }
}
