//! Cuts a move into segments that are straight for the motors too, and appends them to the plan.

use super::{Machine, SegmentEnd, Target};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, PathLength, PushError};
use crate::step::Pattern;

/// The remaining part of a move that is being cut into segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segmenter {
    /// The point of the page at which the move starts.
    pub(super) from: PagePoint,
    /// The point of the page at which the move ends.
    pub(super) to: PagePoint,
    /// The length of the whole move, of which segments are parts.
    pub(super) length: PathLength,
    /// The length of what has been appended already.
    pub(super) position: PathLength,
    /// The last cut that has been passed, in steps; 0 at the beginning.
    pub(super) cut: i32,
    /// The index of the current dot or gap of the line type.
    pub(super) dot: u32,
    /// The line type of the move; `None` with the pen up.
    pub(super) ink: Option<LineType>,
    /// The limit of the speed, given as a stopping distance.
    pub(super) limit: PathLength,
}

impl Segmenter {
    /// Where the last segment ends, on the page.
    pub(super) fn end(&self) -> PagePoint {
        self.to
    }
}

impl Machine<'_> {
    /// Plans a move, cut into segments that are straight for the motors too, and returns its
    /// length. `limit` bounds its speed: it is the distance within which the machine could stop
    /// from it.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
    #[inline(never)] // The Pico places it beside what the main loop does for each chord.
    pub(super) fn push(
        &mut self,
        target: Target,
        limit: PathLength,
    ) -> Result<PathLength, PushError> {
        let Target { point: to, ink } = target;
        if !self.has_room() {
            return Err(PushError::Full);
        }
        let from = self.runner.page_end();
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let length = self.runner.move_length(dx, dy).ok_or(PushError::TooLong)?;
        let position = PathLength::ZERO;
        self.segmenter = Some(Segmenter { from, to, length, position, cut: 0, dot: 0, ink, limit });
        self.push_segments();
        Ok(length)
    }

    /// Plans as many of the remaining segments of the move as there is room for.
    pub(super) fn push_segments(&mut self) {
        while let Some(segmenter) = self.segmenter
            && !self.runner.is_full()
        {
            #[cfg(feature = "spread-backlash")]
            if self.push_spread_backlash(&segmenter) {
                continue;
            }
            let Segmenter { from, to, length, position, mut cut, dot, mut ink, limit } = segmenter;
            let mut next_dot = dot;
            let displacement = (to.x - from.x, to.y - from.y);
            let kinematics = self.settings.kinematics();
            let (mut end, mut is_gap) = (length.to_bits(), false);
            if let Some(cuts) = kinematics.cuts(from, to) {
                let next = cuts.next(cut);
                // Dots and gaps are cut here, because each segment is shorter than the pattern of a
                // whole line.
                let pattern = match ink.replace(LineType::Full) {
                    Some(line_type) if line_type != LineType::Full => {
                        let dot_length = self.settings.dot_length();
                        Pattern::of(line_type, length.to_bits(), dot_length.to_bits())
                    }
                    unchanged => {
                        ink = unchanged;
                        Pattern::full(length.to_bits())
                    }
                };
                let dot_end = pattern.end_of(dot);
                is_gap = !Pattern::inked(dot);
                let cut_end = cuts.position(next, length.to_bits());
                end = dot_end.min(cut_end);
                next_dot += u32::from(end == dot_end);
                if end == cut_end {
                    cut = next;
                }
            }
            let end = PathLength::from_bits(end);
            let positions = [position.to_bits(), end.to_bits()];
            let begin = self.motors_end();
            let SegmentEnd { motors, page, offsets } =
                kinematics.segment_end([from, to], positions, length.to_bits(), begin);
            let segment = Move {
                motors,
                offsets,
                page,
                displacement,
                whole_length: length,
                length: end - position,
                is_gap,
            };
            // There is room, and the segment is no longer than the move, whose length was accepted.
            let pushed = self.push_motors(&segment, ink, limit);
            debug_assert!(pushed.is_ok());
            if pushed != Ok(false) {
                match &mut self.segmenter {
                    Some(rest) if end < length => {
                        (rest.position, rest.cut, rest.dot) = (end, cut, next_dot);
                    }
                    rest => *rest = None,
                }
            }
        }
    }
}
