//! Cuts a move into segments that are straight for the motors too, and appends them to the plan.

use super::{Machine, SegmentEnd, Target};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, PathLength, PushError};
use crate::step::Pattern;

/// The remaining part of a move that is being cut into segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segmenter {
    /// The start of the move on the page.
    from: PagePoint,
    /// The end of the move on the page.
    to: PagePoint,
    /// The length of the move.
    length: PathLength,
    /// The length that has been appended already.
    place: PathLength,
    /// The last cut that has been passed, in steps; 0 at the beginning.
    cut: i32,
    /// The index of the current dot or gap of the line type.
    dot: u32,
    /// The line type of the move; `None` with the pen up.
    ink: Option<LineType>,
    /// The limit of the speed, given as a stopping distance.
    limit: PathLength,
}

impl Segmenter {
    /// Where the last segment ends, on the page.
    pub(super) fn end(&self) -> PagePoint {
        self.to
    }
}

impl Machine<'_> {
    /// Appends a move in segments and returns its length. `limit` bounds its speed, given as a
    /// stopping distance.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
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
        let length = self.runner.limits().length(dx, dy).ok_or(PushError::TooLong)?;
        let place = PathLength::ZERO;
        self.split = Some(Segmenter { from, to, length, place, cut: 0, dot: 0, ink, limit });
        self.push_pieces();
        Ok(length)
    }

    /// Appends as many of the remaining segments as there is room for.
    pub(super) fn push_pieces(&mut self) {
        while let Some(split) = self.split
            && !self.runner.is_full()
        {
            let Segmenter { from, to, length, place, mut cut, dot, mut ink, limit } = split;
            let mut next_dot = dot;
            let way = (to.x - from.x, to.y - from.y);
            let build = self.settings.kinematics();
            let (mut end, mut is_gap) = (length.to_bits(), false);
            if let Some(cuts) = build.cuts(from, to) {
                let next = cuts.next(cut);
                // Dots and gaps are cut here, because each segment is shorter than the pattern of a
                // whole line.
                let pattern = match ink.replace(LineType::Full) {
                    Some(line_type) if line_type != LineType::Full => {
                        let dot_length = self.settings.pen_positions().dot_length;
                        Pattern::of(line_type, length.to_bits(), dot_length.to_bits())
                    }
                    before => {
                        ink = before;
                        Pattern::full(length.to_bits())
                    }
                };
                let dot_end = pattern.end_of(dot);
                is_gap = !Pattern::inked(dot);
                let next_place = cuts.place(next, length.to_bits());
                end = dot_end.min(next_place);
                next_dot += u32::from(end == dot_end);
                if end == next_place {
                    cut = next;
                }
            }
            let end = PathLength::from_bits(end);
            let places = [place.to_bits(), end.to_bits()];
            let begin = self.runner.end();
            let SegmentEnd { motors, page, offsets } =
                build.piece([from, to], places, length.to_bits(), begin);
            let piece =
                Move { motors, offsets, page, way, whole: length, length: end - place, is_gap };
            // There is room, and the segment is no longer than the move, whose length was accepted.
            let pushed = self.push_motors(&piece, ink, limit);
            debug_assert!(pushed.is_ok());
            if pushed != Ok(false) {
                let rest = Segmenter { place: end, cut, dot: next_dot, ..split };
                self.split = (end < length).then_some(rest);
            }
        }
    }
}
