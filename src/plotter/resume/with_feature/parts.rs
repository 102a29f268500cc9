//! Drawings that are computed and drawn part by part: how far they come, and how they go on.

use super::super::Resumption;
use super::notes::{PARTS, begin_notes};
use super::refuse;
use crate::index::Index;
use crate::machine::State;
use crate::order::TimeModel;
use crate::plotter::listener::Listener;
use crate::plotter::{Board, Inner, Layout, Reply, records};
use crate::protocol::CommandError;

/// So many first strokes of a drawing in parts are noted one by one.
const ONE_BY_ONE: u32 = 1 << 14;
/// So many of the others are noted at once.
const LATER_AT_ONCE: u32 = 32;
/// The most bits of the log by which strokes of a drawing in parts are noted. The last one says
/// that the drawing is complete.
const MOST_NOTED: u32 = {
    let [log, _] = Layout::from(0, 0).logs;
    log.limit() - 1
};

/// A drawing in parts that goes on or is drawn again. The options are those with which it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) struct KeptParts {
    /// By what the order of each part is chosen.
    pub time_model: TimeModel,
    /// The checksum of the model.
    pub model: u32,
    /// The checksum of the sources of the firmware that began it.
    pub sources: u32,
    /// The number of strokes that are drawn; `None` to begin anew.
    pub drawn: Option<u32>,
    /// The number of points within strokes that are passed.
    pub points: u32,
}

impl Resumption {
    /// The number of all strokes of a drawing in parts has become known.
    pub(in crate::plotter) fn end_parts(&mut self, strokes: u32) {
        if let Some([_, all]) = &mut self.progress {
            *all = strokes.saturating_add(self.drawn_before);
        }
    }
}

impl<I: Index> Inner<'_, I> {
    /// Returns what the last job is computed from if it is a drawing in parts, to draw it anew;
    /// otherwise `None`. A model that is still coming is completed.
    ///
    /// # Errors
    /// [`CommandError::OtherModel`] if the flash holds another model or none, or the reason why
    /// the model in flash cannot be used.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn kept_parts<B: Board>(
        &mut self,
        board: &mut B,
    ) -> Result<Option<KeptParts>, CommandError> {
        let Some(kept) = records::load_parts(None, board) else { return Ok(None) };
        if !self.is_in_flash() || self.whole_model(board)?.checksum() != kept.model {
            return Err(CommandError::OtherModel);
        }
        Ok(Some(kept))
    }

    /// Draws a drawing in parts once more, or its rest, with its own options. They stay in force
    /// if the machine begins to draw.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(never)] // Keeps its frame off the stack while other jobs are computed.
    pub(in crate::plotter) fn plot_kept<B: Board>(
        &mut self,
        kept: KeptParts,
        listener: &mut Listener<'_, B>,
    ) -> Result<(), CommandError> {
        let before = self.options;
        let _ = records::load_parts(Some(&mut self.options), listener.board);
        let begun = self.plot_stored(Some(kept), listener);
        if begun.is_err() || self.machine.state() == State::Check {
            self.options = before;
        }
        begun
    }

    /// Nothing is left to draw of a drawing in parts. If it was `kept`, the power went just behind
    /// its end, which is noted now.
    ///
    /// # Errors
    /// [`CommandError::NothingToPlot`] if nothing was drawn before, either.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(in crate::plotter) fn nothing_left<B: Board>(
        &mut self,
        kept: Option<KeptParts>,
        board: &mut B,
    ) -> Result<(), CommandError> {
        self.parts.end();
        kept.and_then(|kept| kept.drawn).ok_or(CommandError::NothingToPlot)?;
        if board.note_progress(u32::MAX).is_err() {
            refuse(board);
        }
        self.resumption = self.resumption.anew(self.machine.settings());
        Reply(board).line(format_args!("[MSG:nothing is left to draw: the drawing is complete]"));
        Ok(())
    }

    /// Begins to keep how far a drawing in parts comes that has just begun, of the model with this
    /// checksum, or goes on with what is kept of it, behind so many points within strokes. Nothing
    /// may move yet.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_parts<B: Board>(
        &mut self,
        model: u32,
        time_model: TimeModel,
        kept: Option<KeptParts>,
        points: u32,
        board: &mut B,
    ) {
        self.resumption = self.resumption.anew(self.machine.settings());
        if !board.keeps_progress() {
            return;
        }
        let drawn = kept.and_then(|kept| kept.drawn);
        if drawn.is_none() {
            let origin = self.resumption.origin;
            let notes = begin_notes(self.machine.settings(), PARTS, u32::MAX, [0; 3], origin);
            // The rest of what another build has kept would be refused.
            let is_saved = kept.is_some_and(|kept| kept.sources == records::SOURCES);
            if !is_saved && !records::save_parts(&self.options, time_model, model, board) {
                return;
            }
            if board.begin_progress(notes.as_flattened(), 0).is_err() {
                return refuse(board);
            }
        }
        self.machine.log_strokes(points);
        let drawn = drawn.unwrap_or(0);
        self.resumption.progress = Some([drawn, u32::MAX]);
        (self.resumption.drawn_before, self.resumption.in_parts) = (drawn, true);
    }
}

/// Whether several strokes of a drawing in parts are noted at once where so many are drawn.
pub(in crate::plotter) fn are_noted_at_once(drawn: u32) -> bool {
    drawn >= ONE_BY_ONE
}

/// The number of bits of the log that say that so many strokes of a drawing in parts are drawn.
pub(super) fn noted_in_parts(strokes: u32) -> u32 {
    let noted = strokes.min(ONE_BY_ONE) + strokes.saturating_sub(ONE_BY_ONE) / LATER_AT_ONCE;
    noted.min(MOST_NOTED)
}

/// The number of strokes of a drawing in parts of which so many bits of the log say that they are
/// drawn.
pub(super) fn drawn_in_parts(noted: u32) -> u32 {
    noted.min(ONE_BY_ONE) + noted.saturating_sub(ONE_BY_ONE) * LATER_AT_ONCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_strokes_of_a_drawing_in_parts_are_noted_than_are_drawn() {
        for (drawn, noted) in [
            (0, 0),
            (1, 1),
            (16_384, 16_384),
            (16_415, 16_384),
            (16_416, 16_416),
            (16_500, 16_480),
            (229_343, 229_312),
            (229_344, 229_344),
            (u32::MAX - 1, 229_344),
        ] {
            assert_eq!(drawn_in_parts(noted_in_parts(drawn)), noted, "{drawn}");
            // The log's last bit says that the drawing is complete.
            assert!(noted_in_parts(drawn) < 23_040, "{drawn}");
        }
    }
}
