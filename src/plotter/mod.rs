//! The plotter: it joins all other modules and borrows the large memory. Bytes go in; step events
//! and replies come out.
//!
//! A [`Plotter`] is polled by the board's main loop ([`run`] is that loop). Each poll (`poll`)
//! answers real-time requests, carries out received lines (`commands`), and keeps the step queue
//! full. `$plot` first computes the whole [`Job`], during which [`Cancel`] still answers the serial
//! line. The strokes then go to the machine. This is the only module that knows all the others.

mod board;
pub mod budget;
mod commands;
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
mod poll;
mod program;
mod records;
mod reply;
mod report;
mod resume;
#[cfg(feature = "hold-in-silence")]
mod silence;
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
use crate::fixed::Millimetres;
use crate::index::Index;
use crate::machine::{Alarm, Machine, PulserState, Settings, State};
use crate::model::Model;
use crate::protocol::{CommandError, Label, LineReader, Numbering};
use crate::stage::Cancel;
#[cfg(any(test, feature = "host"))]
pub use program::to_steps;

use program::{Parameters, Program};
use reply::Reply;
use report::ReportCounts;
use resume::Resumption;
use stream::Task;

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
    /// The state of HP-GL, which may take the place of lines.
    #[cfg(feature = "hpgl")]
    hpgl: hpgl::HpGl<'m>,
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
    /// Whether the startup lines are carried out once the machine has stopped behind ctrl-X.
    startup_due: bool,
    /// Z of the program when the check mode (`$C`) began, which moves nothing; `None` outside it.
    z_before_check: Option<Millimetres>,
    /// What is kept when a program ends.
    parameters: Parameters,
    /// What is known of a job that can be resumed.
    resumption: Resumption,
    /// For how long the computer has been silent.
    #[cfg(feature = "hold-in-silence")]
    silence: silence::Silence,
    /// When the plotter last had something to do, in microseconds of the board's clock.
    busy_at: u32,
    /// The time of the last movement, as [`Board::microseconds`] tells it.
    #[cfg(feature = "driver-pins")]
    moved_at: u32,
    /// Whether a status report was asked for and waits for room in the output.
    status_due: bool,
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
                startup_due: false,
                z_before_check: None,
                parameters: Parameters::default(),
                resumption: Resumption::default(),
                #[cfg(feature = "hold-in-silence")]
                silence: silence::Silence::default(),
                busy_at: 0,
                #[cfg(feature = "driver-pins")]
                moved_at: 0,
                status_due: false,
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

    /// The strokes of the job computed last, from where it goes on if so many of them are `drawn`
    /// and so many points within strokes are passed, and the number of points before that. `None`
    /// if nothing is left to draw. See [`Strokes::begin_rest`].
    #[cfg(feature = "host")]
    pub fn strokes_left(&mut self, drawn: u32, points: u32) -> Option<(Strokes<'_, I>, u32)> {
        let Inner { machine, job, words, cursor, .. } = &mut self.inner;
        let mut strokes = job.strokes(words, cursor, machine.stroke_ends());
        let before = strokes.begin_rest(drawn, [0, points], machine)?;
        Some((strokes, before))
    }
}

impl<I: Index> Inner<'_, I> {
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
}
