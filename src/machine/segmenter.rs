//! Cuts a move into segments that are straight for the motors too, and appends them to the plan.

use super::{CutPositions, Machine, SegmentEnd, Target};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Chord, Move, PathLength, PushError, SpeedLimit};
use crate::step::Pattern;

/// The remaining part of a move that is being cut into segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segmenter {
    /// The point of the page at which the move ends.
    pub(super) to: PagePoint,
    /// The whole move, of which segments are parts.
    pub(super) chord: Chord,
    /// The length of what has been appended already.
    pub(super) position: PathLength,
    /// The last cut that has been passed, in steps; 0 at the beginning.
    pub(super) cut: i32,
    /// The index of the current dot or gap of the line type.
    pub(super) dot: u32,
    /// The line type of the move; `None` with the pen up.
    pub(super) ink: Option<LineType>,
    /// The limit of the speed.
    pub(super) limit: SpeedLimit,
}

impl Segmenter {
    /// The point of the page at which the move starts.
    pub(super) fn from(&self) -> PagePoint {
        let (dx, dy) = self.chord.displacement();
        PagePoint { x: self.to.x - dx, y: self.to.y - dy }
    }

    /// Where the last segment ends, on the page.
    pub(super) fn end(&self) -> PagePoint {
        self.to
    }
}

impl Machine<'_> {
    /// Plans a move, cut into segments that are straight for the motors too, and returns its
    /// length. `limit` bounds its speed.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
    #[inline(never)] // The Pico places it beside what the main loop does for each chord.
    pub(super) fn push(
        &mut self,
        target: Target,
        limit: SpeedLimit,
    ) -> Result<PathLength, PushError> {
        let Target { point: to, ink } = target;
        if !self.has_room() {
            return Err(PushError::Full);
        }
        let from = self.runner.page_end();
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        // Not by `?`, for which the chord would be copied once more.
        let Some(chord) = self.runner.chord(dx, dy) else { return Err(PushError::TooLong) };
        let position = PathLength::ZERO;
        let mut segmenter = Segmenter { to, chord, position, cut: 0, dot: 0, ink, limit };
        // Most moves are one segment, which is not kept.
        if !self.push_segment(&mut segmenter) {
            self.segmenter = Some(segmenter);
            self.push_segments();
        }
        Ok(segmenter.chord.length())
    }

    /// Plans as many of the remaining segments of the move as there is room for.
    pub(super) fn push_segments(&mut self) {
        while let Some(mut segmenter) = self.segmenter
            && !self.runner.is_full()
        {
            let is_complete = self.push_segment(&mut segmenter);
            self.segmenter = (!is_complete).then_some(segmenter);
        }
    }

    /// Plans the next segment of a move, for which there must be room. Returns whether the move is
    /// complete.
    #[inline(never)] // As `push`.
    fn push_segment(&mut self, segmenter: &mut Segmenter) -> bool {
        #[cfg(feature = "spread-backlash")]
        if let Some(is_complete) = self.push_spread_backlash(segmenter) {
            return is_complete;
        }
        let Segmenter { to, ref chord, position, mut cut, mut dot, mut ink, limit } = *segmenter;
        // There is room, and no segment is longer than the move, whose length was accepted. So
        // below, nothing that is pushed is refused.
        let kinematics = self.settings.kinematics();
        let Some(anchors) = kinematics.belts() else {
            let whole = Move::whole(kinematics.motors(to), to, chord);
            let rest = Move { length: chord.length().saturating_sub(position), ..whole };
            let pushed = self.push_motors(&rest, ink, limit);
            debug_assert!(pushed.is_ok());
            return pushed != Ok(false);
        };
        let (from, length) = (segmenter.from(), chord.length());
        let cuts = CutPositions::new(anchors, from, to);
        let next = cuts.next(cut);
        // Dots and gaps are cut here, because each segment is shorter than the pattern of a whole
        // line.
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
        let is_gap = !Pattern::inked(dot);
        let cut_end = cuts.position(next, length.to_bits());
        let end = dot_end.min(cut_end);
        dot += u32::from(end == dot_end);
        if end == cut_end {
            cut = next;
        }
        let end = PathLength::from_bits(end);
        let positions = [position.to_bits(), end.to_bits()];
        let begin = self.motors_end();
        let SegmentEnd { motors, page, offsets } =
            anchors.segment_end([from, to], positions, length.to_bits(), begin);
        let segment = Move { motors, offsets, page, chord, length: end - position, is_gap };
        let pushed = self.push_motors(&segment, ink, limit);
        debug_assert!(pushed.is_ok());
        if pushed == Ok(false) {
            return false;
        }
        (segmenter.position, segmenter.cut, segmenter.dot) = (end, cut, dot);
        end >= length
    }
}
