//! What a board does that keeps how far jobs come.

mod notes;
#[cfg(feature = "tiles")]
mod parts;
#[cfg(feature = "stream")]
mod streamed;

#[cfg(feature = "tiles")]
pub(in crate::plotter) use parts::{KeptParts, are_noted_at_once};

use super::{Origin, Resumption};
use crate::index::Index;
use crate::machine::{Path, Settings, State};
#[cfg(feature = "early-ink")]
use crate::plotter::NotStored;
use crate::plotter::listener::MeasuredStrokes;
use crate::plotter::{Board, Inner, Reply, records};
use crate::protocol::CommandError;
use crate::stage::Cancel;
use crate::storage::LogProgress;
#[cfg(feature = "tiles")]
use notes::is_in_parts;
use notes::{LAYOUT, all_strokes, begin_notes, done, is_streamed, origin_settings, read};
#[cfg(feature = "early-ink")]
use notes::{is_without_order, word};
#[cfg(feature = "tiles")]
use parts::noted_in_parts;

/// The three words of notes that tell what a job was computed from: the checksums of the model
/// and of the options, if they are known.
fn words_of(contents: Option<[u32; 2]>) -> [u32; 3] {
    let [model, options] = contents.unwrap_or_default();
    [u32::from(contents.is_some()), model, options]
}

/// What `$resume` has found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) enum StoppedJob {
    /// The job lies in the working memory, and this much of it is drawn.
    Loaded(LogProgress),
    /// Its sender has the strokes. The plotter knows no more than that the pen is at the origin.
    Sent,
    /// The job is computed again part by part, and this much of it is drawn.
    #[cfg(feature = "tiles")]
    InParts(KeptParts),
}

impl Origin {
    /// Whether the machine has been homed.
    const fn is_homed(self) -> bool {
        matches!(self, Self::Homed(_))
    }
}

impl Resumption {
    /// How many strokes of a job that has stopped are drawn, and how many there are.
    pub(in crate::plotter) fn stopped(&self, state: State) -> Option<[u32; 2]> {
        let is_over = !matches!(state, State::Run | State::Hold { .. } | State::Abort);
        self.progress.filter(|[done, all]| is_over && done < all)
    }

    /// Another job has taken the place of the one that has stopped.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) fn forget(&mut self) {
        self.progress = None;
    }

    /// The job has this many strokes, which was an estimate before.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) const fn count_strokes(&mut self, strokes: u32) {
        if let Some([_, all]) = &mut self.progress {
            *all = strokes;
        }
    }

    /// Whether the board keeps how far the job comes.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) fn keeps(&self) -> bool {
        self.progress.is_some()
    }

    /// How the plotter knows where the pen is. Where the settings have changed with which it was
    /// homed, homing would find another origin, so that it does not.
    fn origin(&self, settings: &Settings) -> Origin {
        match self.origin {
            Origin::Homed(with) if with != origin_settings(settings) => Origin::Lost,
            origin => origin,
        }
    }

    /// What is known when a job begins: nothing but the origin. A user who draws where nobody has
    /// told the plotter where the pen is takes that place for known.
    fn anew(&self, settings: &Settings) -> Self {
        let origin = match self.origin(settings) {
            Origin::Lost => Origin::ByHand,
            known => known,
        };
        Self { origin, ..Self::default() }
    }

    /// The position of the pen is not known any more.
    pub(in crate::plotter) fn lose_position(&mut self) {
        self.origin = Origin::Lost;
    }

    /// The machine has been homed with these settings.
    pub(in crate::plotter) fn find_position(&mut self, settings: &Settings) {
        self.origin = Origin::Homed(origin_settings(settings));
    }

    /// Reports a job that has stopped, if there is one.
    pub(in crate::plotter) fn report<B: Board>(&self, state: State, board: &mut B) {
        let Some([done, all]) = self.stopped(state) else { return };
        let mut reply = Reply(board);
        reply.part(format_args!("[MSG:a job stopped at stroke {}", done.saturating_add(1)));
        if all != u32::MAX {
            reply.part(format_args!(" of {all}"));
        }
        let how = if self.is_sent { "its sender sends the rest" } else { "$resume goes on" };
        reply.line(format_args!(": {how}]"));
    }
}

impl<I: Index> Inner<'_, I> {
    /// Records that the order of the job has become known, and with it the number of strokes.
    /// `kept` says whether the flash has stored it.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn order_kept<B: Board>(
        &mut self,
        strokes: u32,
        kept: Result<(), NotStored>,
        board: &mut B,
    ) {
        if kept.is_err() {
            return self.end_notes(board);
        }
        if let Some([_, all]) = &mut self.resumption.progress {
            *all = strokes;
        }
    }

    /// Looks for a job that the last run of the firmware did not finish.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn find_stopped<B: Board>(&mut self, board: &mut B) {
        let found = read(board);
        self.resumption.is_sent = found.is_some_and(|(notes, _)| is_streamed(&notes));
        self.resumption.progress =
            found.map(|(notes, noted)| [done(&notes, noted), all_strokes(&notes, noted, board)]);
        self.resumption.lose_position();
    }

    /// Begins to keep how far the job comes that has just begun. `contents` as for
    /// [`begin_notes`].
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_progress<B: Board>(
        &mut self,
        contents: Option<[u32; 2]>,
        board: &mut B,
    ) {
        // A job that is only checked (`$C`) replaces no job that has stopped.
        if self.machine.state() != State::Run {
            return;
        }
        self.resumption = self.resumption.anew(self.machine.settings());
        if !board.keeps_progress() {
            return;
        }
        let strokes = self.machine.status().job.strokes;
        let (more, origin) = (words_of(contents), self.resumption.origin);
        let notes = begin_notes(self.machine.settings(), LAYOUT, strokes, more, origin);
        if board.begin_progress(notes.as_flattened(), strokes).is_err() {
            return refuse(board);
        }
        self.machine.log_strokes(0);
        self.resumption.progress = Some([0, strokes]);
    }

    /// Keeps that a stroke has been drawn, or that a point within one has been passed, if the
    /// pins have just done so and stand.
    #[inline(always)] // It is called in every turn of the main loop.
    pub(in crate::plotter) fn note_progress<B: Board>(&mut self, board: &mut B) {
        if let Some(points) = self.machine.point_to_note() {
            self.note_point(points, board);
        }
        if self.machine.may_note_stroke()
            && let Some(strokes) = self.machine.stroke_to_note()
        {
            self.note_stroke(strokes, board);
        }
    }

    /// Records in flash that this many strokes have been drawn.
    #[inline(never)] // Inlined, it would take room in the main loop.
    fn note_stroke<B: Board>(&mut self, strokes: u32, board: &mut B) {
        let at_once = self.resumption.more_at_once.saturating_add(1);
        let strokes = strokes.saturating_add(self.resumption.drawn_before);
        let is_end = self.resumption.progress.is_some_and(|[_, all]| strokes == all);
        // The last few strokes count as soon as all of them are drawn.
        let parts = if is_end { strokes.div_ceil(at_once) } else { strokes / at_once };
        #[cfg(feature = "tiles")]
        let parts = match self.resumption.in_parts {
            false => parts,
            true if is_end => u32::MAX,
            true => noted_in_parts(strokes),
        };
        if board.note_progress(parts).is_err() {
            return self.end_notes(board);
        }
        self.machine.stroke_noted();
        #[cfg(feature = "early-ink")]
        let is_estimate = self.pending.is_some();
        #[cfg(not(feature = "early-ink"))]
        let is_estimate = false;
        if let Some([done, all]) = &mut self.resumption.progress {
            *done = strokes;
            if is_estimate {
                *all = (*all).max(strokes.saturating_add(1));
            }
        }
    }

    /// Records in flash that this many points within strokes have been passed.
    #[inline(never)] // Inlined, it would take room in the main loop.
    fn note_point<B: Board>(&mut self, points: u32, board: &mut B) {
        let kept = board.note_point(points);
        self.machine.point_noted();
        if kept.is_err() {
            self.end_notes(board);
        }
    }

    /// The flash takes no more of how far the job comes: says what `$resume` will do after a loss
    /// of power, because what has been noted before stays there.
    #[inline(never)] // It is called in several places.
    fn end_notes<B: Board>(&mut self, board: &mut B) {
        self.machine.end_log();
        let Some([done, _]) = self.resumption.progress.take() else { return };
        Reply(board).line(format_args!(
            "[MSG:the flash takes no more notes of this job: after a loss of power $resume draws \
             it again from stroke {} on]",
            done.saturating_add(1)
        ));
    }

    /// Loads the job that has stopped, and returns how much of it is drawn. With `at_origin`
    /// the user has put the pen at the origin, because nobody knows where it is.
    ///
    /// # Errors
    /// [`CommandError::NothingToResume`] if no job has stopped, or the reason why it cannot go
    /// on. The job stays kept.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn load_stopped<B: Board>(
        &mut self,
        at_origin: bool,
        board: &mut B,
    ) -> Result<StoppedJob, CommandError> {
        let (notes, noted) = read(board).ok_or(CommandError::NothingToResume)?;
        let all = all_strokes(&notes, noted, board);
        if done(&notes, noted) >= all {
            return Err(CommandError::NothingToResume);
        }
        self.check_notes(&notes)?;
        if is_streamed(&notes) {
            if !at_origin {
                return Err(CommandError::RestIsSent);
            }
            if self.resumption.origin(self.machine.settings()) != Origin::Lost {
                return Err(CommandError::PositionKnown);
            }
            self.machine.declare_origin()?;
            self.resumption.origin = Origin::ByHand;
            Reply(board).line(format_args!(
                "[MSG:the pen is taken to be at the origin: the sender of the job sends the rest]"
            ));
            return Ok(StoppedJob::Sent);
        }
        let is_lost = self.resumption.origin(self.machine.settings()) == Origin::Lost;
        match (is_lost, at_origin) {
            (true, false) => return Err(CommandError::PositionUnknown),
            (false, true) => return Err(CommandError::PositionKnown),
            _ => {}
        }
        #[cfg(feature = "tiles")]
        if is_in_parts(&notes) {
            let kept = self.kept_parts(board)?.ok_or(CommandError::NoJobKept)?;
            // Another build may compute other strokes, or divide them otherwise.
            if kept.sources != records::SOURCES {
                return Err(CommandError::OtherVersion);
            }
            if at_origin {
                self.machine.declare_origin()?;
                self.resumption.origin = Origin::ByHand;
            }
            let drawn = Some(done(&notes, noted));
            let points = noted.points;
            return Ok(StoppedJob::InParts(KeptParts { drawn, points, ..kept }));
        }
        // Other sources may compute another order, in which others of the strokes come first.
        #[cfg(feature = "early-ink")]
        if is_without_order(&notes, board) && word(&notes, 6) != records::SOURCES {
            return Err(CommandError::OtherVersion);
        }
        self.copy_words = 0;
        self.job = Default::default();
        self.cursor = Default::default();
        self.job = records::load_job(self.machine.settings(), self.words, board)?;
        if at_origin {
            self.machine.declare_origin()?;
        }
        let progress = Some([noted.parts, all]);
        self.resumption = Resumption { progress, ..self.resumption.anew(self.machine.settings()) };
        Ok(StoppedJob::Loaded(noted))
    }

    /// Hands the rest of the job to the machine. `drawn` is the part that has been drawn
    /// already.
    ///
    /// # Errors
    /// The machine's refusal, or [`CommandError::Aborted`].
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn begin_rest(
        &mut self,
        drawn: LogProgress,
        cancel: &mut dyn Cancel,
    ) -> Result<(), CommandError> {
        let ends = self.machine.stroke_ends();
        let strokes = self.job.strokes(self.words, &mut self.cursor, ends);
        let mut strokes = MeasuredStrokes::new(strokes, cancel);
        let whole = self.machine.measure_whole(&mut strokes)?;
        if strokes.aborted {
            return Err(CommandError::Aborted);
        }
        let has_pens = strokes.has_pens;
        let begun = strokes.strokes.begin_rest(drawn.parts, [0, drawn.points], &self.machine);
        let points = begun.ok_or(CommandError::NoJobKept)?;
        self.machine.start_rest(&mut strokes, whole)?;
        if strokes.aborted {
            self.machine.abort();
            return Err(CommandError::Aborted);
        }
        strokes.strokes.rewind();
        if self.machine.state() == State::Run {
            if has_pens {
                self.machine.forget_pen(false);
            }
            self.machine.log_strokes(points);
        }
        Ok(())
    }
}

/// Tells the user that a job that begins cannot go on after a loss of power.
fn refuse<B: Board>(board: &mut B) {
    Reply(board).line(format_args!(
        "[MSG:$resume will not go on with this: the flash does not take how far it comes]"
    ));
}
