//! The interface through which the machine reads an ordered drawing, and the measured size of a
//! job.

use crate::drawing::{LineType, PagePoint};
use crate::step::tape::{Decoder, TapeLines};

/// The end of the next move of the pen, and whether the pen draws during it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// The end of the move, in steps of the page.
    pub point: PagePoint,
    /// The line type of the stroke; `None` if the pen is raised during the move.
    pub ink: Option<LineType>,
}

/// A target of a path that has not come yet.
#[cfg(any(feature = "stream", feature = "early-ink"))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PendingTarget {
    /// Whether the pen was down before.
    pub within_stroke: bool,
}

/// An ordered drawing. The machine reads it twice: once to measure it and once to draw it.
pub trait Path {
    /// Returns the next target, or `None` at the end.
    fn next_target(&mut self) -> Option<Target>;
    /// Restarts the path at the first target.
    fn rewind(&mut self);
    /// Passes the next targets of the same pen to `visit` as long as it returns true, without
    /// moving on. A path that is not known ahead passes none.
    fn look_ahead(&mut self, visit: &mut dyn FnMut(Target) -> bool) {
        let _ = visit;
    }
    /// Returns the pending target if the next target has not come yet, so that the machine waits
    /// for it with the pen raised. It is asked when there is no next target.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    fn late(&self) -> Option<PendingTarget> {
        None
    }
    /// The number of the pen, from 0, for the target that was returned last. Where the number
    /// changes, the machine stops and waits for [`Machine::resume`](super::Machine::resume).
    fn pen(&self) -> u8 {
        0
    }
}

/// A path given by a slice of targets.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::machine::{Path, Target, TargetList};
/// let dot = Target { point: PagePoint { x: 3, y: 4 }, ink: None };
/// let targets = [dot];
/// let mut path = TargetList::new(&targets);
/// assert_eq!(path.next_target(), Some(dot));
/// assert_eq!(path.next_target(), None);
/// path.rewind();
/// assert_eq!(path.next_target(), Some(dot));
/// ```
#[derive(Debug, Clone)]
pub struct TargetList<'a> {
    /// All targets of the path, in the order in which the pen goes to them.
    targets: &'a [Target],
    /// The index of the target to which the pen goes next.
    next: usize,
}

impl<'a> TargetList<'a> {
    /// A path along `targets`.
    pub const fn new(targets: &'a [Target]) -> Self {
        Self { targets, next: 0 }
    }
}

impl Path for TargetList<'_> {
    fn next_target(&mut self) -> Option<Target> {
        let target = *self.targets.get(self.next)?;
        self.next += 1;
        Some(target)
    }
    fn rewind(&mut self) {
        self.next = 0;
    }
    fn look_ahead(&mut self, visit: &mut dyn FnMut(Target) -> bool) {
        let rest = self.targets.get(self.next..).unwrap_or(&[]);
        let _ = rest.iter().all(|&target| visit(target));
    }
}

/// A tape as a path: its moves, drawn as full lines where its pen is down.
#[derive(Debug, Clone)]
pub struct TapePath<I> {
    /// The point of the page where the first move of the tape starts.
    start: PagePoint,
    /// The rows of the tape, kept so that it can be read again.
    rows: I,
    /// The lines of the tape that are still to come.
    lines: TapeLines<Decoder<I>>,
}

impl<I: Iterator<Item = u8> + Clone> TapePath<I> {
    /// The path of the tape `rows`, whose first move starts at `start`.
    pub fn new(start: PagePoint, rows: I) -> Self {
        let lines = TapeLines::new(start, Decoder::new(rows.clone()));
        Self { start, rows, lines }
    }
}

impl<I: Iterator<Item = u8> + Clone> Path for TapePath<I> {
    fn next_target(&mut self) -> Option<Target> {
        let (point, inked) = self.lines.next()?;
        Some(Target { point, ink: inked.then_some(LineType::Full) })
    }
    fn rewind(&mut self) {
        *self = Self::new(self.start, self.rows.clone());
    }
    fn look_ahead(&mut self, visit: &mut dyn FnMut(Target) -> bool) {
        let mut rest = self.clone();
        while let Some(target) = rest.next_target()
            && visit(target)
        {}
    }
}

/// The size of a job: its strokes, lengths and duration. Lengths are in units of 2^-18 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JobSize {
    /// The number of strokes. A stroke is a sequence of consecutive targets drawn with the pen
    /// down.
    pub strokes: u32,
    /// The total length that is drawn with the pen down.
    pub drawn: u64,
    /// The total length of the moves with the pen up.
    pub travelled: u64,
    /// The estimated duration at the speeds in the settings, in milliseconds.
    pub milliseconds: u64,
}
