//! What the plotter does in each turn of the main loop: real-time requests, lines, and the queue of
//! step events.

#[cfg(feature = "hpgl")]
use super::Replies;
use super::commands::Next;
#[cfg(feature = "hpgl")]
use super::hpgl::Taken;
use super::plot::Drawing;
#[cfg(feature = "tiles")]
use super::stored::PartsProgress;
use super::stream::Progress;
use super::{BegunJob, Board, Inner, Plotter, REPLY_BYTES, Reply, ReportCounts, report};
use crate::index::Index;
use crate::machine::State;
use crate::protocol::{CommandError, LineReader, Numbering, RealTime, Received};

/// The most bytes of a line that are read in one turn of the main loop. They take a small part of
/// the time of a turn, which plans steps first.
const BYTES_IN_TURN: u32 = 32;

/// The same for a port at which HP-GL is in force. Its sender counts on the room for the bytes that
/// wait to be interpreted, so they must leave the port's queue as fast as they come. As many
/// come in 11 ms.
#[cfg(feature = "hpgl")]
const HPGL_BYTES_IN_TURN: u32 = 128;

impl<I: Index> Plotter<'_, I> {
    /// Answers the serial line, and keeps the queue of step events full. Returns whether there was
    /// anything to do.
    pub fn poll<B: Board>(&mut self, board: &mut B) -> bool {
        let requests = board.take_real_time();
        #[cfg(feature = "hold-in-silence")]
        self.inner.watch_silence(requests, board);
        self.act(requests, board);
        self.inner.watch(board);
        self.inner.watch_idleness(board);
        self.inner.note_progress(board);
        #[cfg(feature = "driver-pins")]
        self.inner.watch_drivers(board);
        let planned = self.inner.plan(BegunJob::default(), board);
        if self.inner.startup_due {
            self.inner.run_startup_lines(board);
        }
        #[cfg(feature = "early-ink")]
        let planned = self.inner.follow_order(board) || planned;
        #[cfg(feature = "hpgl")]
        let planned = self.carry_out_hpgl(board) || planned;
        if self.inner.task.is_some() {
            match self.inner.proceed(board) {
                Progress::Done(outcome) => self.answer(outcome, board),
                Progress::More => {}
                #[cfg(feature = "early-ink")]
                Progress::Reset => {
                    self.answer(Ok(()), board);
                    self.begin_anew(board);
                }
                Progress::Waits => return planned || requests != RealTime::default(),
            }
            return true;
        }
        // A byte is read only when the output has room for a reply, so that no reply blocks and
        // delays the steps.
        let waits = self.inner.must_wait();
        #[cfg(feature = "hpgl")]
        let waits = self.hpgl.must_wait(waits) || self.inner.machine.notes_last_stroke();
        let waits = waits || !board.has_room(REPLY_BYTES);
        let byte = if waits { None } else { board.read_byte() };
        let Some((mut port, mut byte)) = byte else {
            #[cfg(feature = "tiles")]
            if self.tend_parts(board) {
                return true;
            }
            #[cfg(feature = "early-ink")]
            if self.improve_order(board) {
                return true;
            }
            return planned || requests != RealTime::default();
        };
        self.inner.busy_at = board.microseconds();
        #[cfg(feature = "hold-in-silence")]
        self.inner.silence.note_byte();
        let mut left = BYTES_IN_TURN;
        #[cfg(feature = "hpgl")]
        if self.hpgl.port().is_some() {
            left = HPGL_BYTES_IN_TURN;
        }
        // Bytes within a line change nothing and have no reply, so several are read in a turn.
        let (numbering, line, is_busy) = loop {
            #[cfg(feature = "hpgl")]
            match self.take_hpgl(port, byte, board) {
                Taken::Line => {}
                Taken::More if left > 1 => {
                    left -= 1;
                    let Some(next) = board.read_byte() else { return true };
                    (port, byte) = next;
                    continue;
                }
                Taken::More | Taken::Last => return true,
            }
            // Nothing comes between the instructions of HP-GL that are being carried out.
            #[cfg(feature = "hpgl")]
            let is_busy =
                self.hpgl.is_drawing() || (self.hpgl.port().is_some() && self.inner.must_wait());
            #[cfg(not(feature = "hpgl"))]
            let is_busy = false;
            let reader = self.readers.get_mut(port).zip(self.numberings.get_mut(port));
            let Some((reader, numbering)) = reader else { return true };
            if let Some(line) = reader.push(byte) {
                break (numbering, line, is_busy);
            }
            // A byte that ends HP-GL decides who is answered, which the next turn carries out.
            #[cfg(feature = "hpgl")]
            if self.hpgl.port().is_some() {
                return true;
            }
            left -= 1;
            let next = if left == 0 { None } else { board.read_byte() };
            let Some(next) = next else { return true };
            (port, byte) = next;
        };
        let (mut shows_drive, mut resets) = (false, false);
        let (outcome, label) = match numbering.receive(line) {
            Received::Line(_, label) if is_busy => (Err(CommandError::Busy), label),
            Received::Line(line, label) => {
                let outcome = match self.inner.carry_out(line, board) {
                    Ok(Next::Plot) => self.inner.plot(board, Drawing::Model),
                    Ok(Next::Again) => self.inner.plot(board, Drawing::LastJob),
                    #[cfg(feature = "resume")]
                    Ok(Next::Resume { at_origin }) => {
                        self.inner.plot(board, Drawing::Stopped { at_origin })
                    }
                    Ok(Next::Nothing) => Ok(()),
                    Ok(Next::Reset) => {
                        resets = true;
                        Ok(())
                    }
                    Ok(Next::ShowDrive) => {
                        shows_drive = true;
                        Ok(())
                    }
                    Err(command_error) => Err(command_error),
                };
                (outcome, label)
            }
            Received::Answer(outcome, label) => (outcome, label),
        };
        if matches!(outcome, Err(CommandError::Aborted)) {
            self.reset(board);
        }
        (self.port, self.label) = (port, label);
        if self.inner.task.is_none() {
            self.answer(outcome, board);
        }
        if resets {
            self.begin_anew(board);
        }
        if shows_drive {
            board.show_drive();
        }
        true
    }

    /// Computes the next part of a drawing that is drawn part by part. Returns whether there was
    /// one to compute.
    #[cfg(feature = "tiles")]
    #[inline(always)] // It is called in every turn of the main loop.
    fn tend_parts<B: Board>(&mut self, board: &mut B) -> bool {
        if !self.inner.parts.is_active() {
            return false;
        }
        let tended = self.inner.tend_parts(board);
        if tended == PartsProgress::Aborted {
            // What comes in the same turn must not find the drawing that is given up.
            self.inner.end_parts();
            self.inner.machine.abort();
            self.reset(board);
        }
        tended != PartsProgress::Idle
    }

    /// Improves the order of the strokes that the pen has not reached. Returns whether there was
    /// one to improve.
    #[cfg(feature = "early-ink")]
    #[inline(always)] // It is called in every turn of the main loop.
    fn improve_order<B: Board>(&mut self, board: &mut B) -> bool {
        if !self.inner.is_improving() {
            return false;
        }
        let improved = self.inner.improve_order(board);
        // In an alarm, the machine has reported why.
        if improved.is_err() && !matches!(self.inner.machine.state(), State::Alarm(_)) {
            self.reset(board);
        }
        true
    }

    /// Replies to the line that has been carried out, and notes its outcome for repeated lines.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn answer<B: Board>(&mut self, outcome: Result<(), CommandError>, board: &mut B) {
        if let Some(numbering) = self.numberings.get_mut(self.port) {
            numbering.note(self.label, outcome);
        }
        Reply(board).outcome(outcome, self.label);
    }

    /// Carries out the real-time `requests`, and everything else that does not come by a line.
    fn act<B: Board>(&mut self, requests: RealTime, board: &mut B) {
        let state = self.inner.machine.state();
        let settings = Some(self.inner.machine.settings());
        report::greet_opened(state, self.inner.resumption, settings, board);
        if B::HAS_DRIVE && board.wants_drive() && self.inner.is_without_job() {
            board.show_drive();
        }
        if requests.has(RealTime::ABORT) {
            self.inner.machine.abort();
            self.reset(board);
        }
        self.inner.act(requests);
        // Between two instructions of HP-GL the machine is idle and can hold at once. In other
        // states this is refused.
        #[cfg(feature = "hpgl")]
        if (requests.has(RealTime::HOLD) || requests.has(RealTime::PAUSE))
            && self.hpgl.port().is_some()
        {
            let _ = self.inner.machine.pause();
        }
        if self.inner.takes_status(requests, board) {
            // Writing the report takes 10 ms, and so may what was done since the queue was last
            // filled.
            self.inner.plan(BegunJob::default(), board);
            #[cfg(feature = "hpgl")]
            if let Some(port) = self.hpgl.port() {
                board.reply_to(Replies::OthersIfAny(port));
            }
            self.inner.report_status("", board);
            #[cfg(feature = "hpgl")]
            self.mute(board);
        }
    }

    /// Forgets unfinished lines, line numbers, overrides, and the modes of G-code, leaves check
    /// mode and sleep, and greets the user.
    fn reset<B: Board>(&mut self, board: &mut B) {
        // What is in force is kept, too.
        #[cfg(feature = "early-ink")]
        if let Some(outcome) = self.inner.keep_rest(true, board) {
            self.answer(outcome, board);
        }
        self.readers.iter_mut().for_each(LineReader::clear);
        self.numberings = [Numbering::default(), Numbering::default()];
        self.inner.task = None;
        #[cfg(feature = "hpgl")]
        self.end_hpgl(board);
        self.begin_anew(board);
    }

    /// Begins with the modes of a start, and greets the user.
    #[inline(never)] // Its callers share one copy of the code.
    fn begin_anew<B: Board>(&mut self, board: &mut B) {
        self.inner.reset();
        self.greet(board);
        self.inner.run_startup_lines(board);
    }
}

impl<I: Index> Inner<'_, I> {
    /// Keeps the step queue full. While the order of the job is computed, `begun` is what of it is
    /// known. Returns whether the planned position has changed.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn plan<B: Board>(&mut self, begun: BegunJob<'_, I>, board: &mut B) -> bool {
        let before = self.machine.planned_position();
        let ends = self.machine.stroke_ends();
        #[cfg(feature = "early-ink")]
        let mut strokes = self.job.strokes_of(begun, self.words, &mut self.cursor, ends);
        #[cfg(not(feature = "early-ink"))]
        let mut strokes = {
            let _ = begun;
            self.job.strokes(self.words, &mut self.cursor, ends)
        };
        #[cfg(feature = "stream")]
        {
            strokes.streamed = Some(&self.streamed);
        }
        #[cfg(feature = "tiles")]
        if self.parts.is_active() {
            strokes.ring = self.model.spare_words();
        }
        self.machine.fill(&mut strokes, board.queue());
        self.machine.planned_position() != before
    }

    /// Restores Z of the program as it was before the check mode, if that is on or an alarm has
    /// ended it: it moves nothing.
    pub(super) fn restore_z(&mut self) {
        if let Some(z) = self.z_before_check.take() {
            self.program = self.program.with_z(z);
        }
    }

    /// Forgets the modes of G-code and the overrides, and leaves check mode and sleep.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn reset(&mut self) {
        self.restore_z();
        self.program = self.program.reset();
        self.report_counts = ReportCounts::default();
        self.machine.set_override(100);
        self.machine.set_rapid_override(100);
        if self.machine.state() == State::Check {
            // It is not refused in this state.
            let _ = self.machine.check(false);
        }
        self.machine.wake();
    }

    /// Whether nothing moves and there is no interrupted job that could continue.
    pub(super) fn is_without_job(&self) -> bool {
        let is_over = matches!(
            self.machine.state(),
            State::Idle | State::Alarm(_) | State::Sleep | State::Check
        );
        is_over && self.machine.is_stopped()
    }
}
