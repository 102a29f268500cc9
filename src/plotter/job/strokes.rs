//! Hands the strokes of a job to the machine.

use crate::drawing::Drawing;
use crate::index::Index;
use crate::machine::{Path, Target};
use crate::order::Leg;

/// Position in the strokes of a job: how far they have been handed to the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cursor<I = u16> {
    /// Index in the tour of the segment that is being handed over.
    leg: usize,
    /// Number of the point at which the pen is, or `None` before the first move.
    at: Option<I>,
    /// The pen of the segment that is being handed over, from 0.
    pen: u8,
    /// Index in the tour of the segment with which the path begins.
    #[cfg(feature = "resume")]
    first: usize,
}

/// The strokes of a job, as the [`Path`] that the machine follows. A pen-up move is inserted
/// wherever a leg does not begin where the previous one ended.
#[derive(Debug)]
pub struct Strokes<'a, I = u16> {
    /// The points and segments of the job.
    pub(super) drawing: Drawing<'a, I>,
    /// The segments in the order in which they are drawn, each with its direction.
    pub(super) tour: &'a [Leg<I>],
    /// How far the strokes have been handed over.
    pub(super) cursor: &'a mut Cursor<I>,
}

impl<I: Index> Path for Strokes<'_, I> {
    fn next_target(&mut self) -> Option<Target> {
        let leg = self.tour.get(self.cursor.leg)?;
        let segment = self.drawing.segments.get(leg.segment())?;
        let (from, to) = if leg.reversed() {
            (segment.to(), segment.from())
        } else {
            (segment.from(), segment.to())
        };
        let begins_here = self.cursor.at == Some(from);
        let number = if begins_here { to } else { from };
        let point = *self.drawing.points.get(number.get())?;
        self.cursor.at = Some(number);
        self.cursor.pen = segment.pen();
        self.cursor.leg += usize::from(begins_here);
        Some(Target { point, ink: begins_here.then(|| segment.line_type()) })
    }

    fn pen(&self) -> u8 {
        self.cursor.pen
    }

    fn rewind(&mut self) {
        *self.cursor = Cursor {
            #[cfg(feature = "resume")]
            leg: self.cursor.first,
            #[cfg(feature = "resume")]
            first: self.cursor.first,
            ..Cursor::default()
        };
    }
}

#[cfg(feature = "resume")]
impl<I: Index> Strokes<'_, I> {
    /// Lets the path begin with this stroke, counted from 0 as the machine counts them. Returns
    /// whether there is such a stroke; if not, the path is at its end.
    pub fn begin_at(&mut self, stroke: u32) -> bool {
        *self.cursor = Cursor::default();
        let (mut inked, mut pen, mut strokes) = (false, 0, 0u32);
        loop {
            let first = self.cursor.leg;
            let Some(Target { ink, .. }) = self.next_target() else { return false };
            // A change of the pen begins a new stroke.
            if ink.is_some() && (!inked || self.pen() != pen) {
                if strokes == stroke {
                    *self.cursor = Cursor { leg: first, first, ..Cursor::default() };
                    return true;
                }
                strokes += 1;
            }
            (inked, pen) = (ink.is_some(), self.pen());
        }
    }
}
