//! The ordered drawing, as the machine asks for it, and what it will take.

use crate::drawing::{LineType, PagePoint};
use crate::step::tape::{Decoder, TapeLines};

/// Where the pen goes next, and whether it draws on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// The end of the move.
    pub point: PagePoint,
    /// `None` with the pen up, else how the line is inked.
    pub ink: Option<LineType>,
}

/// The ordered drawing, as the machine asks for it: once to measure it, once to draw it.
pub trait Path {
    /// The next target, `None` at the end.
    fn next_target(&mut self) -> Option<Target>;
    /// Begins again with the first target.
    fn rewind(&mut self);
    /// The pen that the last target given wants, from 0. The machine stands and waits for
    /// [`Machine::resume`](super::Machine::resume) where it changes.
    fn pen(&self) -> u8 {
        0
    }
}

/// A path of targets in memory.
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
    targets: &'a [Target],
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
}

/// A tape as a path from where the machine stands: its moves, and full lines where its pen is down.
#[derive(Debug, Clone)]
pub struct TapePath<I> {
    start: PagePoint,
    rows: I,
    lines: TapeLines<Decoder<I>>,
}

impl<I: Iterator<Item = u8> + Clone> TapePath<I> {
    /// The path of a tape whose first move is made from `start`.
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
}

/// What a path amounts to. Lengths in units of 2^-18 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JobSize {
    /// Strokes: runs of inked targets.
    pub strokes: u32,
    /// Length with the pen down.
    pub drawn: u64,
    /// Length with the pen up.
    pub travelled: u64,
    /// How long it takes, about, with the speeds as set.
    pub milliseconds: u64,
}
