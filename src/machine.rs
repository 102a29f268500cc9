//! Axes, kinematics, pen, limits, homing, hold, abort: a state machine.
//!
//! (skeleton: the motion work fills this in)

use crate::drawing::{LineType, PagePoint};

/// Where the pen goes next, and whether it draws on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// The end of the move.
    pub point: PagePoint,
    /// `None` with the pen up, else how the line is inked.
    pub ink: Option<LineType>,
}

/// The ordered drawing, as the machine asks for it.
pub trait Path {
    /// The next target, `None` at the end.
    fn next_target(&mut self) -> Option<Target>;
}
