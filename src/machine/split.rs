//! A move to pieces that are straight for the motors, too.

use super::{Machine, Target};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{PathLength, PushError};

/// What is left of a move: pieces from `done` on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Split {
    from: PagePoint,
    to: PagePoint,
    done: u32,
    pieces: u32,
    ink: Option<LineType>,
    limit: PathLength,
}

impl Split {
    /// Where the last piece ends.
    pub(super) fn end(&self) -> PagePoint {
        self.to
    }
}

impl Machine<'_> {
    /// Appends a move, not faster than a stopping distance, in pieces.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub(super) fn push(&mut self, target: Target, limit: PathLength) -> Result<(), PushError> {
        let Target { point: to, ink } = target;
        if !self.has_room() {
            return Err(PushError::Full);
        }
        let from = self.runner.page_end();
        let pieces = self.settings.kinematics().pieces(from, to);
        // A piece is no longer than the whole.
        self.runner.limits().length(to.x - from.x, to.y - from.y).ok_or(PushError::TooLong)?;
        self.split = Some(Split { from, to, done: 0, pieces, ink, limit });
        self.push_pieces();
        Ok(())
    }

    /// Appends the pieces for which there is room.
    pub(super) fn push_pieces(&mut self) {
        while let Some(split) = self.split
            && !self.runner.is_full()
        {
            let Split { from, to, ink, limit, done, pieces } = split;
            let done = done + 1;
            let [motors, page] = self.settings.kinematics().part([from, to], done, pieces);
            // There is room, and it is no longer than the move that was checked.
            let pushed = self.push_motors(motors, page, ink, limit);
            debug_assert!(pushed.is_ok());
            if pushed != Ok(false) {
                self.split = (done < pieces).then_some(Split { done, ..split });
            }
        }
    }
}
