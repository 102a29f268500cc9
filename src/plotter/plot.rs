//! `$plot`, `$again` and `$resume`: computes a job, or loads the kept one, and hands it to the
//! machine.

#[cfg(not(feature = "early-ink"))]
use super::Unobserved;
use super::job::Pipeline;
use super::listener::{Listener, MeasuredStrokes};
#[cfg(feature = "resume")]
use super::resume::StoppedJob;
use super::{Board, Cursor, Inner, Job, Observer, records};
use crate::index::Index;
use crate::machine::State;
#[cfg(feature = "early-ink")]
use crate::machine::TargetList;
use crate::order::TimeModel;
use crate::protocol::{CommandError, RealTime};
use crate::stage::{Aborted, Cancel};
#[cfg(all(feature = "early-ink", feature = "stream", feature = "resume"))]
use crate::storage::PAGE_BYTES;

/// Which job is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawing {
    /// The job that is computed from the model (`$plot`).
    Model,
    /// The job that was kept last, from its beginning (`$again`).
    LastJob,
    /// The rest of the job that has stopped (`$resume`).
    #[cfg(feature = "resume")]
    Stopped {
        /// Whether the user has put the pen at the origin.
        at_origin: bool,
    },
}

/// The time in microseconds for which the plotter listens to the user between two erasures of the
/// flash, so that its answers have been sent before the next erasure begins.
#[cfg(feature = "early-ink")]
pub(super) const ANSWER_MICROSECONDS: u32 = 10_000;

impl<I: Index> Inner<'_, I> {
    /// Begins a job.
    ///
    /// # Errors
    /// [`CommandError::Locked`] or [`CommandError::Busy`] if the state does not allow it, or the
    /// reason why there is no job.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn plot<B: Board>(
        &mut self,
        board: &mut B,
        drawing: Drawing,
    ) -> Result<(), CommandError> {
        if !matches!(self.machine.state(), State::Idle | State::Check) {
            return Err(match self.machine.state() {
                State::Alarm(_) | State::Sleep => CommandError::Locked,
                _ => CommandError::Busy,
            });
        }
        #[cfg(feature = "stream")]
        {
            self.streamed = Default::default();
        }
        let mut listener = self.listener(board);
        let begun = match drawing {
            _ if self.settle(&mut listener).is_err() => Err(CommandError::Aborted),
            #[cfg(feature = "tiles")]
            Drawing::Model if self.is_in_flash() => self.plot_stored(None, &mut listener),
            #[cfg(feature = "early-ink")]
            Drawing::Model => self.plot_model(&mut listener),
            #[cfg(not(feature = "early-ink"))]
            Drawing::Model => self.compute(&mut listener, &mut Unobserved).and_then(|()| {
                self.begin(&mut listener)?;
                self.keep_begun(listener.board);
                Ok(())
            }),
            Drawing::LastJob => self.plot_again(&mut listener),
            #[cfg(feature = "resume")]
            Drawing::Stopped { at_origin } => {
                self.load_stopped(at_origin, listener.board).and_then(|stopped| match stopped {
                    StoppedJob::Loaded(drawn) => {
                        #[cfg(feature = "early-ink")]
                        if let Some(strokes) = self.complete_order(&mut listener)? {
                            self.resumption.count_strokes(strokes);
                            self.keep_order(strokes, listener.board);
                        }
                        self.begin_rest(drawn, &mut listener)
                    }
                    StoppedJob::Sent => Ok(()),
                    #[cfg(feature = "tiles")]
                    StoppedJob::InParts(parts) => self.plot_kept(parts, &mut listener),
                })
            }
        };
        let Listener { requests, overrides, .. } = listener;
        self.change_overrides(overrides);
        if requests.has(RealTime::EMERGENCY) {
            self.act(requests);
        }
        begun?;
        self.report_degenerate(board);
        self.act(requests);
        Ok(())
    }

    /// Begins to draw the job that was kept last once more.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(always)] // Adds no frame to the stack.
    fn plot_again<B: Board>(&mut self, listener: &mut Listener<'_, B>) -> Result<(), CommandError> {
        #[cfg(feature = "tiles")]
        if let Some(parts) = self.kept_parts(listener.board)? {
            return self.plot_kept(parts, listener);
        }
        self.load(listener.board)?;
        #[cfg(feature = "early-ink")]
        let order = self.complete_order(listener)?;
        self.begin(listener)?;
        self.keep_progress(None, listener.board);
        // Not before the log of this copy has begun: the log before it may tell how much is drawn
        // in another order, which other sources have computed.
        #[cfg(feature = "early-ink")]
        if let Some(strokes) = order.filter(|_| self.machine.state() == State::Run) {
            self.keep_order(strokes, listener.board);
        }
        Ok(())
    }

    /// Waits until the last moves are made, and makes room in the flash for a job that is sent
    /// while it is drawn. Meanwhile the user is listened to. Returns what is to be done when the
    /// job has begun.
    ///
    /// # Errors
    /// [`Aborted`] if the user does not want what comes next.
    #[cfg(all(feature = "stream", feature = "resume"))]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn wait_until_idle<B: Board>(&mut self, board: &mut B) -> Result<RealTime, Aborted> {
        let mut listener = self.listener(board);
        let mut waited = self.settle(&mut listener);
        // The rest of a job that has stopped continues in the log of that job.
        #[cfg(feature = "early-ink")]
        if waited.is_ok() && self.resumption.stopped(State::Idle).is_none() {
            waited = Self::make_room(&mut listener, 2 * PAGE_BYTES as u32);
        }
        let Listener { requests, overrides, .. } = listener;
        self.change_overrides(overrides);
        if waited.is_err() {
            self.act(requests);
        }
        waited.map(|()| requests)
    }

    /// Begins to listen while a job is computed.
    pub(super) fn listener<'b, B: Board>(&self, board: &'b mut B) -> Listener<'b, B> {
        let [x, y] = self.machine.position_mm();
        let position = [x, y, self.program.z()];
        Listener::new(board, position, self.in_inches(), self.machine.inverted_contacts())
    }

    /// Waits until the last moves are made: their plan may be complete before, and a sector of
    /// flash must not be erased while something moves.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn settle<B: Board>(&mut self, listener: &mut Listener<'_, B>) -> Result<(), Aborted> {
        while !self.machine.is_stopped() {
            listener.check()?;
            // The moves may have come just before, so that nothing has begun them yet, and nobody
            // else counts what the pins have done.
            #[cfg(feature = "early-ink")]
            {
                self.machine.fill(&mut TargetList::new(&[]), listener.board.queue());
                listener.board.begin_steps();
            }
            listener.board.wait_briefly();
        }
        Ok(())
    }

    /// Erases what a record of a job and its log will take, one sector after the other, while the
    /// user is listened to: a sector may take 400 ms.
    ///
    /// # Errors
    /// [`Aborted`] if the user does not want the job any more. Nothing that is kept is lost.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn make_room<B: Board>(
        listener: &mut Listener<'_, B>,
        bytes: u32,
    ) -> Result<(), Aborted> {
        while listener.board.erase_ahead(bytes) {
            listener.has_answered = false;
            listener.check()?;
            let begun = listener.board.microseconds();
            while listener.has_answered
                && listener.board.microseconds().wrapping_sub(begun) < ANSWER_MICROSECONDS
            {
                listener.check()?;
                listener.board.wait_briefly();
            }
        }
        listener.check()
    }

    /// Keeps the job of `$plot` that has begun, and how far it comes, before anything moves. A job
    /// that is refused or only checked (`$C`) does not replace the one that is kept.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    pub(super) fn keep_begun<B: Board>(&mut self, board: &mut B) {
        if self.machine.state() == State::Run && self.save(board) {
            self.keep_model(board);
        }
    }

    /// Begins to keep how far the job comes, which was computed from the model.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    pub(super) fn keep_model<B: Board>(&mut self, board: &mut B) {
        let contents = [self.model.checksum(), self.options.checksum()];
        self.keep_progress(Some(contents), board);
    }

    /// Writes the job to flash before anything moves, because flash cannot be read during the
    /// write. Returns whether the flash keeps it.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn save<B: Board>(&self, board: &mut B) -> bool {
        let saved = records::save_job(&self.job, self.machine.settings(), self.words, board);
        if saved.is_err() {
            records::say_not_kept(board);
        }
        saved.is_ok()
    }

    /// Loads the kept job in place of the last one.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn load<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        self.copy_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        self.job = records::load_job(self.machine.settings(), self.words, board)?;
        Ok(())
    }

    /// Hands the job to the machine, which first measures its strokes.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn begin(&mut self, cancel: &mut dyn Cancel) -> Result<(), CommandError> {
        let ends = self.machine.stroke_ends();
        let strokes = self.job.strokes(self.words, &mut self.cursor, ends);
        let mut strokes = MeasuredStrokes::new(strokes, cancel);
        self.machine.start(&mut strokes)?;
        if strokes.aborted {
            self.machine.abort();
            return Err(CommandError::Aborted);
        }
        self.cursor = Cursor::default();
        Ok(())
    }

    /// Computes the job of `$plot`, in place of the last one.
    #[inline(never)] // Keeps its frame out of that of `plot`.
    pub(super) fn compute(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer<I>,
    ) -> Result<(), CommandError> {
        #[cfg(not(feature = "early-ink"))]
        {
            self.forget_job();
            self.job = self.pipeline(cancel, observer).run()?;
        }
        #[cfg(feature = "early-ink")]
        {
            self.job = self.begin_job(cancel, observer)?.ordered(self.words, cancel)?;
        }
        Ok(())
    }

    /// Discards the last job, because its memory is overwritten even if the next one fails.
    #[inline(always)] // Adds no frame to the stack.
    pub(super) fn forget_job(&mut self) {
        self.copy_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
    }

    /// Creates the pipeline that computes the job of `$plot`.
    #[inline(always)] // Adds no frame to the stack.
    pub(super) fn pipeline<'p>(
        &'p mut self,
        cancel: &'p mut dyn Cancel,
        observer: &'p mut dyn Observer<I>,
    ) -> Pipeline<'p, I> {
        let steps = self.machine.settings().page_steps();
        let time_model = self.machine.settings().time_model(self.units_per_second());
        #[cfg(feature = "early-ink")]
        let early = self.early();
        let (model, options, words) = (&self.model, &self.options, &mut *self.words);
        Pipeline {
            model,
            options,
            steps,
            time_model,
            #[cfg(feature = "early-ink")]
            early,
            words,
            cancel,
            observer,
        }
    }

    /// The units of work that count as one second when the order is improved.
    #[cfg(any(test, feature = "host"))]
    pub(super) fn units_per_second(&self) -> u32 {
        if self.is_thorough { TimeModel::COMPUTER } else { TimeModel::BOARD }
    }

    /// The units of work that count as one second when the order is improved.
    #[cfg(not(any(test, feature = "host")))]
    pub(super) fn units_per_second(&self) -> u32 {
        TimeModel::BOARD
    }
}
