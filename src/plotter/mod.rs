//! The plotter: it joins all other modules and borrows the large memory. Bytes go in; step events
//! and replies come out.
//!
//! A [`Plotter`] is polled by the board's main loop ([`run`] is that loop). Each poll answers
//! real-time requests, carries out received lines, and keeps the step queue full. `$plot` first
//! computes the whole [`Job`], during which [`Cancel`] still answers the serial line. The strokes
//! then go to the machine. This is the only module that knows all the others.

mod board;
pub mod budget;
#[cfg(feature = "early-ink")]
mod early;
mod editor;
mod grbl;
mod help;
#[cfg(feature = "hpgl")]
mod hpgl;
mod job;
mod flash_records;
mod listener;
mod memory;
mod options;
mod overrides;
mod plan;
mod plot;
mod program;
mod records;
mod reply;
mod report;
mod resume;
#[cfg(feature = "convex")]
mod solid;
#[cfg(feature = "tiles")]
mod stored;
mod stream;
#[cfg(feature = "stream")]
mod streamed;
mod title;

pub use board::{Board, NotStored, REPLY_BYTES, Record, Replies, Stored};
pub use flash_records::{FlashRecords, Layout};
pub use help::help;
pub use job::{Cursor, Job, Observer, Strokes, Unobserved};
pub use memory::{EMPTY_LOOKAHEAD, HpGlMemory, Memory, MemorySlices};
pub use options::{
    Flag, HiddenLines, OPTIONS, PlotOption, PlotOptions, ProjectionChoice, VisibilityMode,
};

#[cfg(any(test, feature = "host"))]
use crate::drawing::Drawing;
use crate::index::Index;
use crate::machine::{
    Alarm, Machine, MachineError, PulserState, Setting, SettingError, Settings, State, Value,
};
use crate::model::Model;
use crate::protocol::{
    Command, CommandError, Label, LineReader, Numbering, RealTime, Received, Significant,
    next_number,
};
use crate::stage::Cancel;
#[cfg(any(test, feature = "host"))]
pub use program::to_steps;

use plot::Drawing as DrawnJob;
use program::{Parameters, Program};
use reply::Reply;
use report::ReportCounts;
use resume::Resumption;
use stream::{Listing, Progress, Task};

/// The least time by which step events are planned ahead of the pins, and so the delay until a hold
/// takes effect: 50 ms. The machine plans further ahead if it could not stop within that time.
const AHEAD_TICKS: u32 = crate::motion::TICKS_PER_SECOND / 20;

/// The largest number of serial ports of a board.
const PORT_LIMIT: usize = 2;

/// Polls the plotter forever, and sleeps while there is nothing to do.
pub fn run<B: Board, I: Index>(
    board: &mut B,
    memory: MemorySlices<'_, I>,
    pins: &PulserState,
) -> ! {
    // The plotter is made here and not in a function that returns it, because then it would be on
    // the stack twice.
    let mut plotter = Plotter::with_settings(memory, pins, records::load_settings(board));
    plotter.begin(board);
    loop {
        if !plotter.poll(board) {
            if plotter.inner.is_timing() { board.wait_briefly() } else { board.wait() }
        }
    }
}

/// Makes a plotter of what the board has kept, and greets the user, as after every reset.
#[cfg(any(test, feature = "host"))]
pub fn start<'m, B: Board, I: Index>(
    board: &mut B,
    memory: MemorySlices<'m, I>,
    pins: &'m PulserState,
) -> Plotter<'m, I> {
    let mut plotter = Plotter::with_settings(memory, pins, records::load_settings(board));
    plotter.begin(board);
    plotter
}

/// What is known of a job whose order is being computed, if one is.
#[cfg(feature = "early-ink")]
type BegunJob<'b, I> = Option<job::Begun<'b, I>>;
/// Without the feature `early-ink`, the order is computed before anything moves.
#[cfg(not(feature = "early-ink"))]
type BegunJob<'b, I> = [&'b I; 0];

/// The whole plotter except its pins, which the board pulses.
#[derive(Debug)]
pub struct Plotter<'m, I = u16> {
    /// For each serial port, the line that is being received by it.
    readers: &'m mut [LineReader],
    /// For each serial port, which numbered lines have come by it.
    numberings: [Numbering; PORT_LIMIT],
    /// The number of the port by which the line came that is being carried out.
    port: usize,
    /// Whether and how the reply to that line is numbered and checked.
    label: Label,
    /// Everything that carries out a line. It is separate from the lines, which stay borrowed
    /// meanwhile.
    inner: Inner<'m, I>,
    /// Whether a status report was asked for and waits for room in the output.
    status_due: bool,
    /// The state of HP-GL, which may take the place of lines.
    #[cfg(feature = "hpgl")]
    hpgl: hpgl::HpGl<'m>,
}

/// The task that is left after a line has been carried out. Jobs are left to the caller, because
/// their computation needs much stack.
enum Next {
    /// The line has been carried out completely.
    Nothing,
    /// The plotter is reset, as by ctrl-X.
    Reset,
    /// Compute the model's job and draw it (`$plot`).
    Plot,
    /// Draw the last job again (`$again`).
    Again,
    /// Draw the rest of the job that has stopped (`$resume`).
    #[cfg(feature = "resume")]
    Resume {
        /// Whether the user has put the pen at the origin.
        at_origin: bool,
    },
    /// Become the USB drive onto which a new firmware image is copied (`$UF2`).
    ShowDrive,
}

/// The plotter without the line being read: that line stays borrowed while it is carried out.
#[derive(Debug)]
struct Inner<'m, I> {
    /// The model that the user has sent.
    model: Model<'m, I>,
    /// What is drawn and how, as the user has set it.
    options: PlotOptions,
    /// The working memory. It holds the job, or the copy of the model for `$undo`.
    words: &'m mut [u64],
    /// The machine, which plans the moves of the job.
    machine: Machine<'m>,
    /// The job that is being drawn or was drawn last.
    job: Job<I>,
    /// How far the strokes of the job have been handed to the machine.
    cursor: Cursor<I>,
    /// How many of the first `words` hold the copy of the model before its last change; 0 if there
    /// is no copy.
    copy_words: usize,
    /// Whether the model is copied before each change.
    can_undo: bool,
    /// Whether a computer computes for a plotter, so that more work on the order pays.
    #[cfg(any(test, feature = "host"))]
    is_thorough: bool,
    /// Whether the pen begins before the order of the strokes is known.
    #[cfg(all(feature = "early-ink", any(test, feature = "host")))]
    has_early_ink: bool,
    /// The job whose order is known, but not released yet.
    #[cfg(feature = "early-ink")]
    pending: Option<early::Pending<I>>,
    /// The progress of a job whose strokes are sent while they are drawn.
    #[cfg(feature = "stream")]
    streamed: streamed::Streamed,
    /// The state of the model in flash.
    #[cfg(feature = "tiles")]
    large: stored::FlashModel,
    /// The progress of drawing a model in flash.
    #[cfg(feature = "tiles")]
    parts: stored::Parts<I>,
    /// The modes that lines of G-code have set.
    program: Program,
    /// What is kept when a program ends.
    parameters: Parameters,
    /// What is known of a job that can be resumed.
    resumption: Resumption,
    /// When the plotter last had something to do, in microseconds of the board's clock.
    busy_at: u32,
    /// The time of the last movement, as [`Board::microseconds`] tells it.
    #[cfg(feature = "driver-pins")]
    moved_at: u32,
    /// The counters that decide when status reports contain the parts that are only sent now and
    /// then.
    report_counts: ReportCounts,
    /// The task of a line that takes longer. The line is answered when the task is done.
    task: Option<Task>,
    /// The alarm that was last reported, while it lasts.
    alarm_reported: Option<Alarm>,
    /// The pen, from 0, for which the user was last asked, so that the question is not repeated.
    pen_reported: Option<u8>,
    /// The pen, from 0, that HP-GL waits for.
    #[cfg(feature = "hpgl")]
    hpgl_pen: Option<u8>,
}

impl<'m, I: Index> Plotter<'m, I> {
    /// An idle plotter at the page's origin with an empty model and default settings. `pins` is the
    /// state that the plotter shares with the board's step interrupt.
    pub fn new(memory: MemorySlices<'m, I>, pins: &'m PulserState) -> Self {
        Self::with_settings(memory, pins, Settings::default())
    }

    /// Makes a plotter like [`Plotter::new`], with these settings of the machine.
    #[inline(never)] // Inlined, its temporaries would take stack while a job is computed.
    pub fn with_settings(
        memory: MemorySlices<'m, I>,
        pins: &'m PulserState,
        settings: Settings,
    ) -> Self {
        #[cfg(feature = "hpgl")]
        let hpgl = hpgl::HpGl::new(memory.hpgl);
        let MemorySlices { vertices, corners, blocks, words, readers, .. } = memory;
        Self {
            readers,
            numberings: [Numbering::default(), Numbering::default()],
            port: 0,
            label: Label::default(),
            status_due: false,
            #[cfg(feature = "hpgl")]
            hpgl,
            inner: Inner {
                model: Model::new(vertices, corners),
                options: PlotOptions::default(),
                words,
                machine: Machine::new(settings, blocks, pins, AHEAD_TICKS),
                job: Job::default(),
                cursor: Cursor::default(),
                copy_words: 0,
                #[cfg(feature = "stream")]
                streamed: streamed::Streamed::default(),
                can_undo: true,
                #[cfg(any(test, feature = "host"))]
                is_thorough: false,
                #[cfg(all(feature = "early-ink", any(test, feature = "host")))]
                has_early_ink: false,
                #[cfg(feature = "early-ink")]
                pending: None,
                #[cfg(feature = "tiles")]
                large: stored::FlashModel::default(),
                #[cfg(feature = "tiles")]
                parts: stored::Parts::default(),
                program: Program::default(),
                parameters: Parameters::default(),
                resumption: Resumption::default(),
                busy_at: 0,
                #[cfg(feature = "driver-pins")]
                moved_at: 0,
                report_counts: ReportCounts::default(),
                task: None,
                alarm_reported: None,
                pen_reported: None,
                #[cfg(feature = "hpgl")]
                hpgl_pen: None,
            },
        }
    }

    /// Loads the rest of what the board has kept, and greets the user, as after every reset.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn begin<B: Board>(&mut self, board: &mut B) {
        if board.fault().is_some() {
            self.inner.machine.alarm(Alarm::Restarted);
        }
        // A program that opened a port while the board started gets the greeting that goes to all
        // ports. It needs no second one.
        let _ = board.take_opened();
        #[cfg(feature = "driver-pins")]
        self.inner.set_driver_pins(board);
        self.inner.parameters = records::load_parameters(board);
        self.inner.find_stopped(board);
        self.greet(board);
        report::fault(board);
        #[cfg(feature = "resume")]
        self.inner.report_held(None, board);
        self.inner.resumption.report(State::Idle, board);
        records::report_refused(self.inner.machine.settings(), board);
        #[cfg(feature = "tiles")]
        self.inner.find_stored(board);
        self.inner.run_startup_lines(board);
    }

    /// Takes what the board has kept, and greets the user, as after every reset.
    #[cfg(any(test, feature = "host"))]
    pub fn power_up<B: Board>(&mut self, board: &mut B) {
        self.begin(board);
    }

    /// Returns the same plotter without `$undo`. With it, the time in which a model is received
    /// grows with the square of its size, because the whole model is copied before each change.
    #[must_use]
    pub fn without_undo(mut self) -> Self {
        self.inner.can_undo = false;
        self
    }

    /// Sets whether this plotter computes for another one, on a computer. Then, unless `$effort` is
    /// a number, more work is spent on the order
    /// ([`TimeModel::COMPUTER`](crate::order::TimeModel)), and the order is no longer that which a
    /// board finds.
    #[cfg(any(test, feature = "host"))]
    pub fn set_thorough(&mut self, is_thorough: bool) {
        self.inner.is_thorough = is_thorough;
    }

    /// Sets whether the pen begins before the order of the strokes is known, as on the boards of
    /// which [`BoardRow::early_ink`](crate::board_table::BoardRow) says so. The order may then
    /// differ from what it is otherwise.
    #[cfg(all(feature = "early-ink", any(test, feature = "host")))]
    #[must_use]
    pub fn with_early_ink(mut self, has_early_ink: bool) -> Self {
        self.inner.has_early_ink = has_early_ink;
        self
    }

    /// Writes the greeting: the first line that a sender sees. It is also the reply to ctrl-X.
    pub fn greet<B: Board>(&self, board: &mut B) {
        report::greet(board);
    }

    /// Answers the serial line, and keeps the queue of step events full. Returns whether there was
    /// anything to do.
    pub fn poll<B: Board>(&mut self, board: &mut B) -> bool {
        let requests = board.take_real_time();
        self.act(requests, board);
        self.inner.watch(board);
        self.inner.watch_idleness(board);
        #[cfg(feature = "driver-pins")]
        self.inner.watch_drivers(board);
        self.inner.note_progress(board);
        let planned = self.inner.plan(BegunJob::default(), board);
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
        let waits = self.hpgl.must_wait(waits);
        let waits = waits || !board.has_room(REPLY_BYTES);
        let byte = if waits { None } else { board.read_byte() };
        let Some((port, byte)) = byte else {
            #[cfg(feature = "tiles")]
            if self.tend_parts(board) {
                return true;
            }
            return planned || requests != RealTime::default();
        };
        self.inner.busy_at = board.microseconds();
        #[cfg(feature = "hpgl")]
        if self.take_hpgl(port, byte, board) {
            return true;
        }
        // Nothing comes between the instructions of HP-GL that are being carried out.
        #[cfg(feature = "hpgl")]
        let is_busy =
            self.hpgl.is_drawing() || (self.hpgl.port().is_some() && self.inner.must_wait());
        #[cfg(not(feature = "hpgl"))]
        let is_busy = false;
        let reader = self.readers.get_mut(port).zip(self.numberings.get_mut(port));
        let Some((reader, numbering)) = reader else { return true };
        let Some(line) = reader.push(byte) else { return true };
        let (mut shows_drive, mut resets) = (false, false);
        let (outcome, label) = match numbering.receive(line) {
            Received::Line(_, label) if is_busy => (Err(CommandError::Busy), label),
            Received::Line(line, label) => {
                let outcome = match self.inner.carry_out(line, board) {
                    Ok(Next::Plot) => self.inner.plot(board, DrawnJob::Model),
                    Ok(Next::Again) => self.inner.plot(board, DrawnJob::LastJob),
                    #[cfg(feature = "resume")]
                    Ok(Next::Resume { at_origin }) => {
                        self.inner.plot(board, DrawnJob::Stopped { at_origin })
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
        if tended == stored::PartsProgress::Aborted {
            self.inner.machine.abort();
            self.reset(board);
        }
        tended != stored::PartsProgress::Idle
    }

    /// Replies to the line that has been carried out, and notes its outcome for repeated lines.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn answer<B: Board>(&mut self, outcome: Result<(), CommandError>, board: &mut B) {
        if let Some(numbering) = self.numberings.get_mut(self.port) {
            numbering.note(self.label, outcome);
        }
        Reply(board).outcome(outcome, self.label);
    }

    /// Returns the model that the user has sent.
    pub fn model(&self) -> &Model<'m, I> {
        &self.inner.model
    }

    /// The options: what is drawn and how.
    pub fn options(&self) -> &PlotOptions {
        &self.inner.options
    }

    /// The machine, which draws the strokes.
    pub fn machine(&self) -> &Machine<'m> {
        &self.inner.machine
    }

    /// The job that is being drawn or was drawn last.
    pub fn job(&self) -> &Job<I> {
        &self.inner.job
    }

    /// Computes the job of `$plot` without drawing it.
    ///
    /// # Errors
    /// The [`CommandError`] that `$plot` would reply with.
    pub fn compute(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer<I>,
    ) -> Result<&Job<I>, CommandError> {
        self.inner.compute(cancel, observer)?;
        Ok(&self.inner.job)
    }

    /// Computes the drawing of `$plot` without the order of its strokes, which takes the longest:
    /// enough to look at while the camera turns. The job computed last ends.
    ///
    /// # Errors
    /// The [`CommandError`] that `$plot` would reply with.
    #[cfg(any(test, feature = "host"))]
    pub fn draw(&mut self, cancel: &mut dyn Cancel) -> Result<Drawing<'_, I>, CommandError> {
        self.inner.draw(cancel)
    }

    /// The strokes of the job computed last, from the beginning.
    pub fn strokes(&mut self) -> Strokes<'_, I> {
        self.inner.cursor = Cursor::default();
        let ends = self.inner.machine.stroke_ends();
        self.inner.job.strokes(self.inner.words, &mut self.inner.cursor, ends)
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
        self.status_due |= requests.has(RealTime::STATUS);
        if self.status_due && board.has_room(REPLY_BYTES) {
            self.status_due = false;
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
    fn plan<B: Board>(&mut self, begun: BegunJob<'_, I>, board: &mut B) -> bool {
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

    /// Forgets the modes of G-code and the overrides, and leaves check mode and sleep.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn reset(&mut self) {
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
    fn is_without_job(&self) -> bool {
        let is_over = matches!(
            self.machine.state(),
            State::Idle | State::Alarm(_) | State::Sleep | State::Check
        );
        is_over && self.machine.is_stopped()
    }

    /// Carries out a line. Returns what is left to the caller to do.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn carry_out<B: Board>(&mut self, line: &str, board: &mut B) -> Result<Next, CommandError> {
        let command = Command::parse(line)?;
        #[cfg(feature = "tiles")]
        let Some(command) = self.carry_out_in_flash(command, board)? else {
            return Ok(Next::Nothing);
        };
        let one_pen = self.options.one_pen;
        let (model, mut undo_copy, _) = self.split();
        let save_copy = &mut |model: &Model<'_, I>| undo_copy.save(model);
        let added = match command {
            Command::Nothing => Ok(()),
            Command::Vertex(coordinates) => model.add_vertex(coordinates, save_copy),
            Command::Face(numbers) => model.add_face(numbers.iter(), save_copy),
            Command::Polyline(numbers) => model.add_polyline(numbers.iter(), save_copy),
            Command::Degree(degree) => model.set_degree(degree),
            Command::Curve { ends, control } => model.begin_curve(ends, control.iter()),
            Command::Knots(knots) => model.add_knots(knots.iter()),
            // With a single pen, choices of a pen are ignored: no file can then use too many pens.
            Command::Pen { .. } if one_pen => Ok(()),
            Command::Pen { by_material, name } => model.choose_pen(by_material, name, save_copy),
            Command::EndCurve => model.end_curve(save_copy),
            Command::Clear => {
                save_copy(model);
                model.clear();
                Ok(())
            }
            command => return self.carry_out_other(command, board),
        };
        added.map_err(CommandError::Model)?;
        Ok(Next::Nothing)
    }

    /// Carries out a command that is no line of a model. Returns what is left to the caller to do.
    #[inline(never)] // Inlined, its frame would take stack while a model is sent.
    fn carry_out_other<B: Board>(
        &mut self,
        command: Command<'_>,
        board: &mut B,
    ) -> Result<Next, CommandError> {
        match command {
            // The caller has carried these out.
            Command::Nothing
            | Command::Vertex(_)
            | Command::Face(_)
            | Command::Polyline(_)
            | Command::Degree(_)
            | Command::Curve { .. }
            | Command::Knots(_)
            | Command::Pen { .. }
            | Command::EndCurve
            | Command::Clear => {}
            Command::Help => self.task = Some(Task::List(Listing::Help, 0)),
            Command::BuildInfo => {
                self.check_idle()?;
                self.report_build(board);
            }
            Command::Settings => {
                #[cfg(feature = "stream")]
                let may_run = self.is_streamed();
                #[cfg(not(feature = "stream"))]
                let may_run = false;
                let state = self.machine.state();
                let has_stopped = matches!(state, State::Hold { stopped: true });
                if !may_run && !has_stopped && !matches!(state, State::Check | State::Jog) {
                    self.check_idle()?;
                }
                self.task = Some(Task::List(Listing::Settings, 0));
            }
            Command::Modes => self.report_modes(board),
            Command::Parameters => {
                self.check_idle()?;
                self.report_parameters(board);
            }
            Command::StartupLines => {
                self.check_idle()?;
                self.report_startup_lines(board);
            }
            Command::SetStartupLine { index, line } => self.set_startup_line(index, line, board)?,
            Command::SetInfo(text) => {
                self.check_idle()?;
                self.set_info(text, board)?;
            }
            Command::Restore { settings, parameters, texts } => {
                let is_over = self.restore([settings, parameters, texts], board)?;
                return Ok(if is_over { Next::Reset } else { Next::Nothing });
            }
            Command::Assign { name, value } => {
                if !self.options.set(name, value)? {
                    let before = self.machine.held_to();
                    self.change_setting(name, value)?;
                    #[cfg(feature = "driver-pins")]
                    self.set_driver_pins(board);
                    self.report_held(before, board);
                    records::save_settings(self.machine.settings(), board)?;
                }
            }
            Command::Options => self.task = Some(Task::List(Listing::Options, 0)),
            Command::Model => self.report_model(board),
            Command::Edit(edit) => self.edit(edit, board)?,
            Command::List(part, numbers) => self.begin_list(part, numbers)?,
            Command::Undo => self.undo()?,
            Command::Plot => return Ok(Next::Plot),
            Command::Again => return Ok(Next::Again),
            #[cfg(feature = "resume")]
            Command::Resume { at_origin } if board.keeps_progress() => {
                return Ok(Next::Resume { at_origin });
            }
            Command::Resume { .. } => return Err(CommandError::NoJobKept),
            Command::ShowDrive if !B::HAS_DRIVE => return Err(CommandError::UnknownSystemCommand),
            Command::ShowDrive if !self.is_without_job() => return Err(CommandError::Busy),
            Command::ShowDrive => return Ok(Next::ShowDrive),
            // The receive interrupt does not know it in this form.
            #[cfg(feature = "hpgl")]
            Command::HpGl => return Err(CommandError::UnknownSystemCommand),
            #[cfg(feature = "stream")]
            Command::BeginStream(header) => self.begin_streamed(header, board)?,
            #[cfg(feature = "stream")]
            Command::Strokes(strokes) => self.take_strokes(strokes)?,
            #[cfg(feature = "stream")]
            Command::Stream => self.report_streamed(board)?,
            Command::Unlock => self.unlock(board)?,
            Command::Home => self.home()?,
            Command::Check => {
                let is_over = self.machine.state() == State::Check;
                self.machine.check(!is_over).map_err(|_| CommandError::Busy)?;
                let text = if is_over { "Disabled" } else { "Enabled" };
                Reply(board).line(format_args!("[MSG:{text}]"));
                if is_over {
                    return Ok(Next::Reset);
                }
            }
            Command::Sleep => {
                self.machine.sleep()?;
                self.resumption.lose_position();
                Reply(board).line(format_args!("[MSG:Sleeping]"));
            }
            Command::Jog(line) => self.jog(line)?,
            Command::GCode(line) => self.run_gcode(line, board)?,
        }
        Ok(Next::Nothing)
    }

    /// Computes the drawing alone, in place of the last job.
    #[cfg(any(test, feature = "host"))]
    fn draw(&mut self, cancel: &mut dyn Cancel) -> Result<Drawing<'_, I>, CommandError> {
        self.copy_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        let steps = self.machine.settings().page_steps();
        let (model, options, words) = (&self.model, &self.options, &mut *self.words);
        let observer = &mut Unobserved;
        let time_model = crate::order::TimeModel::default();
        let pipeline = job::Pipeline {
            model,
            options,
            steps,
            time_model,
            #[cfg(feature = "early-ink")]
            early: None,
            words,
            cancel,
            observer,
        };
        let stored = pipeline.draw()?;
        Ok(stored.drawing(self.words).unwrap_or(Drawing { points: &[], segments: &[] }))
    }

    /// Sets the setting with the number `name`.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn change_setting(&mut self, name: &str, value: &str) -> Result<(), CommandError> {
        let mut name = Significant(name.bytes());
        let number = next_number(&mut name).filter(|_| name.next().is_none());
        let setting = number
            .and_then(|number| u16::try_from(number.to_whole().ok()?).ok())
            .and_then(Setting::numbered)
            .ok_or(CommandError::UnknownSystemCommand)?;
        let mut value = Significant(value.bytes());
        let number = next_number(&mut value).ok_or(CommandError::NotANumber)?;
        if value.next().is_some() {
            return Err(CommandError::UnknownSystemCommand);
        }
        let value: Value = number.to_millimetres().map_err(|_| CommandError::NumberOutOfRange)?;
        self.machine.set(setting, value).map_err(CommandError::Setting)
    }
}

impl From<MachineError> for CommandError {
    fn from(error: MachineError) -> Self {
        match error {
            MachineError::State(State::Alarm(_) | State::Sleep) => Self::Locked,
            MachineError::State(_) => Self::Busy,
            error => Self::Machine(error),
        }
    }
}

impl From<SettingError> for CommandError {
    fn from(error: SettingError) -> Self {
        Self::Setting(error)
    }
}
