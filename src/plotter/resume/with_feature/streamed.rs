//! Jobs that a computer sends while they are drawn: how far they come.

use super::super::{Origin, Resumption};
use super::notes::{STREAMED, began_homed, begin_notes, is_streamed, read, word};
use super::refuse;
use crate::index::Index;
use crate::machine::State;
use crate::plotter::{Board, Inner, Reply, records};
use crate::protocol::{CommandError, StreamHeader};

/// The most strokes that are noted at once.
const MOST_AT_ONCE: u32 = 1 << 12;

impl<I: Index> Inner<'_, I> {
    /// Begins to keep how far a job comes that is sent while it is drawn, behind this `header`. If
    /// it is the rest of the job that has stopped, goes on with what is kept of that. Nothing may
    /// move yet.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_streamed<B: Board>(
        &mut self,
        header: StreamHeader,
        board: &mut B,
    ) {
        let StreamHeader { id, pens, points, .. } = header;
        let stopped = self.resumption.progress;
        self.resumption = self.resumption.anew(self.machine.settings());
        if self.machine.state() != State::Run || !board.keeps_progress() {
            return;
        }
        let strokes = self.machine.status().job.strokes;
        // The sender names the rest of a job by the number of the whole job.
        let is_rest = |[done, all]: &[u32; 2]| done < all && strokes == all - done;
        if let Some([drawn, all]) = stopped.filter(is_rest)
            && let Some((notes, _)) = read(board)
            && is_streamed(&notes)
            && word(&notes, 4) == id
            && self.check_notes(&notes).is_ok()
            // All of it may be drawn anew, from another origin.
            && (drawn > 0 || self.resumption.origin.is_homed() == began_homed(&notes))
        {
            self.machine.log_strokes(points);
            let more_at_once = word(&notes, 3).saturating_sub(1);
            if pens != 1 {
                // If several strokes are noted at once, the rest may begin with strokes before the
                // last change of the pen.
                self.machine.forget_pen(more_at_once > 0);
            }
            self.resumption = Resumption {
                progress: Some([drawn, all]),
                more_at_once,
                is_sent: true,
                drawn_before: drawn,
                ..self.resumption
            };
            return;
        }
        // This job replaces the one that `$again` would draw, which is no longer the last one.
        if records::save_streamed(id, board).is_err() {
            return refuse(board);
        }
        for power in 0..=MOST_AT_ONCE.ilog2() {
            let at_once = 1 << power;
            let more = [at_once, id, 0];
            let origin = self.resumption.origin;
            let notes = begin_notes(self.machine.settings(), STREAMED, strokes, more, origin);
            let parts = strokes.div_ceil(at_once);
            if board.begin_progress(notes.as_flattened(), parts).is_ok() {
                self.machine.log_strokes(0);
                self.resumption.more_at_once = at_once - 1;
                self.resumption.is_sent = true;
                self.resumption.progress = Some([0, strokes]);
                return;
            }
        }
        refuse(board);
    }

    /// Says how far a job has come that was sent while it was drawn and has stopped, so that
    /// its sender can go on: the number by which it knows the job, how many strokes are drawn
    /// and how many there are, whether the position of the pen is unknown since then, and how many
    /// points within strokes are passed. Returns whether there is such a job.
    ///
    /// # Errors
    /// What the job depends on has changed.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn report_stopped_stream<B: Board>(
        &self,
        board: &mut B,
    ) -> Result<bool, CommandError> {
        let Some([drawn, all]) = self.resumption.stopped(self.machine.state()) else {
            return Ok(false);
        };
        let Some((notes, noted)) = read(board).filter(|(notes, _)| is_streamed(notes)) else {
            return Ok(false);
        };
        self.check_notes(&notes)?;
        let id = word(&notes, 4);
        let origin = self.resumption.origin(self.machine.settings());
        let is_lost = u8::from(origin == Origin::Lost);
        let points = noted.points;
        Reply(board).line(format_args!("[STOPPED:{id},{drawn},{all},{is_lost},{points}]"));
        Ok(true)
    }
}
