//! How far a job has come.

use super::{JobSize, Target};
use crate::motion::RunLengths;

/// The size of a job, and the counts of the motion planner when it began.
#[derive(Debug, Default)]
pub(super) struct Progress {
    /// The size of the present job, or of the last one.
    size: JobSize,
    /// The runner's totals of lengths and strokes when the job began.
    begun_at: RunLengths,
    /// Whether the last move that was sent alone was drawn with the pen down.
    is_inked: bool,
}

impl Progress {
    /// Begins a job when the totals of the runner are `run`. The size of a job whose moves are sent
    /// one by one grows with them.
    pub(super) fn begin(size: JobSize, run: RunLengths) -> Self {
        Self { size, begun_at: run, is_inked: false }
    }

    /// Begins the rest of a job, when the totals of the runner are `run`. `whole` is the size of
    /// the whole job, and `rest` that of what is left.
    #[cfg(feature = "resume")]
    pub(super) const fn begin_rest(whole: JobSize, rest: JobSize, run: RunLengths) -> Self {
        let begun_at = RunLengths {
            strokes: run.strokes.wrapping_sub(whole.strokes.wrapping_sub(rest.strokes)),
            drawn: run.drawn.wrapping_sub(whole.drawn.wrapping_sub(rest.drawn)),
            // The move from where the pen is now to the rest was not part of the whole.
            travelled: run.travelled.wrapping_sub(whole.travelled.saturating_sub(rest.travelled)),
        };
        Self { size: whole, begun_at, is_inked: false }
    }

    /// Records that the pen was raised within a stroke and continues it, so that no other stroke is
    /// counted.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    pub(super) const fn go_on_with_stroke(&mut self) {
        self.begun_at.strokes = self.begun_at.strokes.wrapping_add(1);
    }

    /// Adds `more` to the size of the job, of which more has become known.
    #[cfg(feature = "tiles")]
    pub(super) const fn grow(&mut self, more: JobSize) {
        self.size.strokes += more.strokes;
        self.size.drawn += more.drawn;
        self.size.travelled += more.travelled;
        self.size.milliseconds += more.milliseconds;
    }

    /// Adds a move that was sent alone and is `length` long, in 2^-18 mm.
    pub(super) fn add_move(&mut self, target: Target, length: u64) {
        if target.ink.is_some() {
            self.size.drawn += length;
        } else {
            self.size.travelled += length;
        }
        self.add_stroke(target.ink.is_some());
    }

    /// Counts a stroke where the pen goes down for a move.
    pub(super) fn add_stroke(&mut self, inked: bool) {
        self.size.strokes += u32::from(inked && !self.is_inked);
        self.is_inked = inked;
    }

    /// Changes the size of the job.
    #[cfg(feature = "early-ink")]
    pub(super) const fn set_size(&mut self, size: JobSize) {
        self.size = size;
    }

    /// Returns the size of the job: its strokes and lengths.
    pub(super) const fn size(&self) -> JobSize {
        self.size
    }

    /// Records that all of the job is planned, when the totals of the runner are `run`. The runner
    /// counts no stroke that is shorter than a motor step or begins where the one before ends.
    pub(super) const fn complete(&mut self, run: RunLengths) {
        self.begun_at.strokes = run.strokes.wrapping_sub(self.size.strokes);
    }

    /// The part of the job that has been planned when the runner's totals are `run`. A stroke that
    /// a hold has divided counts twice there, but there are never more strokes than the job has.
    pub(super) fn done(&self, run: RunLengths) -> JobSize {
        JobSize {
            strokes: run.strokes.wrapping_sub(self.begun_at.strokes).min(self.size.strokes),
            drawn: run.drawn.wrapping_sub(self.begun_at.drawn),
            travelled: run.travelled.wrapping_sub(self.begun_at.travelled),
            milliseconds: 0,
        }
    }

    /// Returns what is left of the job once `done` is done.
    pub(super) const fn left(&self, done: JobSize) -> JobSize {
        JobSize {
            strokes: self.size.strokes.saturating_sub(done.strokes),
            drawn: self.size.drawn.saturating_sub(done.drawn),
            travelled: self.size.travelled.saturating_sub(done.travelled),
            milliseconds: 0,
        }
    }
}
