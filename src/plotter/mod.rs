//! Owns the memory and joins the rest: bytes in, step events and replies out.
//!
//! A [`Plotter`] is polled by the board's main loop ([`run`] is that loop). Each poll answers what was
//! asked in real time, carries out the lines that came, and keeps the step queue full. A `$plot`
//! computes the whole [`Job`] first ([`Cancel`] answers the line meanwhile), then the strokes go
//! to the machine. This is the only module that knows all the others.

mod board;
pub mod budget;
mod editor;
mod job;
mod kept;
mod memory;
mod options;
mod plan;
mod program;
mod reply;
mod report;
mod solid;
mod stream;
mod title;

pub use board::{Board, NotStored, REPLY_BYTES, Record, Stored};
pub use job::{Cursor, Job, Observer, Strokes, Unobserved};
pub use memory::{
    EMPTY_LOOKAHEAD, EMPTY_LOOKAHEAD_OF_PICO, Lm3s6965Memory, Memory, MemorySlices, PicoMemory,
};
pub use options::PlotOptions;

use crate::machine::{
    Alarm, Machine, MachineError, Path, PulserState, Setting, SettingError, Settings, State,
    Target, Value,
};
use crate::model::Model;
use crate::protocol::{Command, CommandError, Label, LineReader, Numbering, RealTime, Received};
use crate::stage::{Aborted, Cancel, Stage};
use program::Program;
use reply::Reply;
use stream::{Listing, Progress, Task};

/// How far step events are planned ahead of the pins at least, and so how late a hold takes effect:
/// 50 ms. More if the machine could not stop within them.
const AHEAD_TICKS: u32 = crate::motion::TICKS_PER_SECOND / 20;

/// Serial ports of a board, at most.
const PORT_LIMIT: usize = 2;

/// Polls the plotter for ever; sleeps when there is nothing to do.
pub fn run<B: Board>(board: &mut B, memory: MemorySlices<'_>, pins: &PulserState) -> ! {
    let mut plotter = Plotter::with_settings(memory, pins, kept::settings(board));
    if board.fault().is_some() {
        plotter.inner.machine.alarm(Alarm::Restarted);
    }
    // Who has opened a port while the board started hears what all hear, not a second greeting.
    let _ = board.take_opened();
    plotter.greet(board);
    report::fault(board);
    loop {
        if !plotter.poll(board) {
            board.wait();
        }
    }
}

/// The whole plotter but for its pins.
#[derive(Debug)]
pub struct Plotter<'m> {
    /// The line that each port is sending.
    readers: &'m mut [LineReader],
    /// What each port has numbered.
    numberings: [Numbering; PORT_LIMIT],
    /// The port of the line in work, and what the reply to it names.
    port: usize,
    label: Label,
    inner: Inner<'m>,
    /// The status is to be told as soon as there is room.
    status_due: bool,
}

/// What is left to do when a line is carried out: a job, whose stages need the stack.
enum Next {
    Nothing,
    Plot,
    Again,
    ShowDrive,
}

/// All but the line being read, which is borrowed while it is carried out.
#[derive(Debug)]
struct Inner<'m> {
    model: Model<'m>,
    options: PlotOptions,
    words: &'m mut [u64],
    machine: Machine<'m>,
    job: Job,
    cursor: Cursor,
    /// How many of the `words`, from the first on, hold the model as it was before the last change; 0 for none.
    kept_words: usize,
    program: Program,
    /// The line that is answered when it is done.
    task: Option<Task>,
    alarm_told: Option<Alarm>,
    /// The pen that the user was asked for.
    pen_told: Option<u8>,
}

impl<'m> Plotter<'m> {
    /// An idle plotter at the page's origin with an empty model. `pins` is what the board's step
    /// interrupt counts in.
    pub fn new(memory: MemorySlices<'m>, pins: &'m PulserState) -> Self {
        Self::with_settings(memory, pins, Settings::default())
    }

    /// The same with other settings than the defaults.
    #[inline(never)] // What it builds the parts in must not lie under the stages' frames.
    pub fn with_settings(
        memory: MemorySlices<'m>,
        pins: &'m PulserState,
        settings: Settings,
    ) -> Self {
        let MemorySlices { vertices, corners, blocks, words, readers } = memory;
        Self {
            readers,
            numberings: [Numbering::default(), Numbering::default()],
            port: 0,
            label: Label::default(),
            status_due: false,
            inner: Inner {
                model: Model::new(vertices, corners),
                options: PlotOptions::default(),
                words,
                machine: Machine::new(settings, blocks, pins, AHEAD_TICKS),
                job: Job::default(),
                cursor: Cursor::default(),
                kept_words: 0,
                program: Program::default(),
                task: None,
                alarm_told: None,
                pen_told: None,
            },
        }
    }

    /// The first line that a sender sees, and what it sees after ctrl-X.
    pub fn greet<B: Board>(&self, board: &mut B) {
        report::greet(board);
    }

    /// Answers the line, and keeps the step queue full. Whether anything was done.
    pub fn poll<B: Board>(&mut self, board: &mut B) -> bool {
        let asked = board.take_real_time();
        self.act(asked, board);
        self.inner.watch(board);
        let planned = self.inner.plan(board);
        if self.inner.task.is_some() {
            match self.inner.proceed(board) {
                Progress::Done(outcome) => self.answer(outcome, board),
                Progress::More => {}
                Progress::Waits => return planned || asked != RealTime::default(),
            }
            return true;
        }
        // A line is read once its reply finds room, so that no reply keeps the steps waiting.
        let waits = self.inner.must_wait() || !board.has_room(REPLY_BYTES);
        let byte = if waits { None } else { board.read_byte() };
        let Some((port, byte)) = byte else { return planned || asked != RealTime::default() };
        let reader = self.readers.get_mut(port).zip(self.numberings.get_mut(port));
        let Some((reader, numbering)) = reader else { return true };
        let Some(line) = reader.push(byte) else { return true };
        let mut shows_drive = false;
        let (outcome, label) = match numbering.receive(line) {
            Received::Line(line, label) => {
                let outcome = match self.inner.carry_out(line, board) {
                    Ok(Next::Plot) => self.inner.plot(board, false),
                    Ok(Next::Again) => self.inner.plot(board, true),
                    Ok(Next::Nothing) => Ok(()),
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
        if outcome == Err(CommandError::Aborted) {
            self.reset(board);
        }
        (self.port, self.label) = (port, label);
        if self.inner.task.is_none() {
            self.answer(outcome, board);
        }
        if shows_drive {
            board.show_drive();
        }
        true
    }

    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn answer<B: Board>(&mut self, outcome: Result<(), CommandError>, board: &mut B) {
        if let Some(numbering) = self.numberings.get_mut(self.port) {
            numbering.note(self.label, outcome);
        }
        Reply(board).outcome(outcome, self.label);
    }

    /// What the model holds.
    pub fn model(&self) -> &Model<'m> {
        &self.inner.model
    }

    /// What is drawn and how.
    pub fn options(&self) -> &PlotOptions {
        &self.inner.options
    }

    /// The machine's side.
    pub fn machine(&self) -> &Machine<'m> {
        &self.inner.machine
    }

    /// The job drawn last, or being drawn.
    pub fn job(&self) -> &Job {
        &self.inner.job
    }

    /// Computes the job of `$plot` without drawing it.
    ///
    /// # Errors
    /// The [`CommandError`] that `$plot` would reply with.
    pub fn compute(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer,
    ) -> Result<&Job, CommandError> {
        self.inner.compute(cancel, observer)?;
        Ok(&self.inner.job)
    }

    /// The strokes of the job computed last, from the beginning.
    pub fn strokes(&mut self) -> Strokes<'_> {
        self.inner.cursor = Cursor::default();
        self.inner.job.strokes(self.inner.words, &mut self.inner.cursor)
    }

    fn act<B: Board>(&mut self, asked: RealTime, board: &mut B) {
        report::greet_opened(self.inner.machine.state(), board);
        if B::HAS_DRIVE && board.wants_drive() && self.inner.is_without_job() {
            board.show_drive();
        }
        if asked.has(RealTime::ABORT) {
            self.inner.machine.abort();
            self.reset(board);
        }
        self.inner.act(asked);
        self.status_due |= asked.has(RealTime::STATUS);
        if self.status_due && board.has_room(REPLY_BYTES) {
            self.status_due = false;
            // To write it takes 10 ms; so may what was done since the queue was filled last.
            self.inner.plan(board);
            self.inner.report_status(board);
        }
    }

    fn reset<B: Board>(&mut self, board: &mut B) {
        self.readers.iter_mut().for_each(LineReader::clear);
        self.numberings = [Numbering::default(), Numbering::default()];
        self.inner.task = None;
        self.inner.program = Program::default();
        self.greet(board);
    }
}

impl Inner<'_> {
    /// Keeps the step queue full. Whether the machine still has something to plan.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn plan<B: Board>(&mut self, board: &mut B) -> bool {
        let before = self.machine.planned_position();
        let mut strokes = self.job.strokes(self.words, &mut self.cursor);
        self.machine.fill(&mut strokes, board.queue());
        self.machine.planned_position() != before
    }

    /// Nothing moves, and no job is held that could go on.
    fn is_without_job(&self) -> bool {
        let is_over = matches!(
            self.machine.state(),
            State::Idle | State::Alarm(_) | State::Sleep | State::Check
        );
        is_over && self.machine.is_stopped()
    }

    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn carry_out<B: Board>(&mut self, line: &str, board: &mut B) -> Result<Next, CommandError> {
        let command = Command::parse(line)?;
        let one_pen = self.options.one_pen;
        let (model, mut keeper, _) = self.split();
        let keep = &mut |model: &Model<'_>| keeper.save(model);
        match command {
            Command::Nothing => {}
            Command::Vertex(coordinates) => {
                model.add_vertex(coordinates, keep).map_err(CommandError::Model)?
            }
            Command::Face(numbers) => {
                model.add_face(numbers.iter(), keep).map_err(CommandError::Model)?
            }
            Command::Polyline(numbers) => {
                model.add_polyline(numbers.iter(), keep).map_err(CommandError::Model)?
            }
            Command::Degree(degree) => model.set_degree(degree).map_err(CommandError::Model)?,
            Command::Curve { ends, control } => {
                model.begin_curve(ends, control.iter()).map_err(CommandError::Model)?
            }
            Command::Knots(knots) => model.add_knots(knots.iter()).map_err(CommandError::Model)?,
            // So that no file has too many.
            Command::Pen { .. } if one_pen => {}
            Command::Pen { by_material, name } => {
                model.choose_pen(by_material, name, keep).map_err(CommandError::Model)?
            }
            Command::EndCurve => model.end_curve(keep).map_err(CommandError::Model)?,
            Command::Help => self.task = Some(Task::List(Listing::Help, 0)),
            Command::BuildInfo => self.report_build(board),
            Command::Settings => self.task = Some(Task::List(Listing::Settings, 0)),
            Command::Setting { name, value } => {
                self.change_setting(name, value)?;
                kept::keep_settings(self.machine.settings(), board)?;
            }
            Command::Option(option) => self.options.set(option),
            Command::Title(text) => self.options.set_title(text)?,
            Command::Options => self.task = Some(Task::List(Listing::Options, 0)),
            Command::Model => self.report_model(board),
            Command::Clear => {
                keep(model);
                model.clear();
            }
            Command::Edit(edit) => self.edit(edit, board)?,
            Command::List(part, numbers) => self.begin_list(part, numbers)?,
            Command::Undo => self.undo()?,
            Command::Plot => return Ok(Next::Plot),
            Command::Again => return Ok(Next::Again),
            Command::ShowDrive if !B::HAS_DRIVE => return Err(CommandError::UnknownSystemCommand),
            Command::ShowDrive if !self.is_without_job() => return Err(CommandError::Busy),
            Command::ShowDrive => return Ok(Next::ShowDrive),
            Command::Unlock => self.machine.unlock()?,
            Command::Home => self.home()?,
            Command::Check => self.machine.check(self.machine.state() != State::Check)?,
            Command::Sleep => self.machine.sleep()?,
            Command::Jog(line) => self.jog(line)?,
            Command::GCode(line) => self.run_gcode(line)?,
        }
        Ok(Next::Nothing)
    }

    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn plot<B: Board>(&mut self, board: &mut B, again: bool) -> Result<(), CommandError> {
        if !matches!(self.machine.state(), State::Idle | State::Check) {
            return Err(match self.machine.state() {
                State::Alarm(_) | State::Sleep => CommandError::Locked,
                _ => CommandError::Busy,
            });
        }
        let position = self.machine.position_mm();
        let asked = RealTime::default();
        let mut listener = Listener { board, position, stage: Stage::View, asked };
        let computed = if again {
            self.load(listener.board)
        } else {
            self.compute(&mut listener, &mut Unobserved).map(|()| self.save(listener.board))
        };
        let begun = computed.and_then(|()| self.begin(&mut listener));
        let asked = listener.asked;
        if asked.has(RealTime::EMERGENCY) {
            self.act(asked);
        }
        begun?;
        self.report_degenerate(board);
        self.act(asked);
        Ok(())
    }

    /// Keeps the job, before anything moves: flash cannot be read meanwhile.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn save<B: Board>(&self, board: &mut B) {
        if kept::keep_job(&self.job, self.machine.settings(), self.words, board).is_err() {
            Reply(board)
                .line(format_args!("[MSG:$again will not draw this: the flash is worn out]"));
        }
    }

    /// Takes the kept job in place of the last one.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn load<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        self.kept_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        self.job = kept::job(self.machine.settings(), self.words, board)?;
        Ok(())
    }

    /// Hands the job to the machine, which measures it first.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn begin(&mut self, cancel: &mut dyn Cancel) -> Result<(), CommandError> {
        let strokes = self.job.strokes(self.words, &mut self.cursor);
        let mut strokes = MeasuredStrokes { strokes, cancel, targets: 0, given_up: false };
        self.machine.start(&mut strokes)?;
        if strokes.given_up {
            self.machine.abort();
            return Err(CommandError::Aborted);
        }
        self.cursor = Cursor::default();
        Ok(())
    }

    #[inline(never)] // Its frame must not lie under that of `plot`.
    fn compute(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer,
    ) -> Result<(), CommandError> {
        // The memory of the last job is used again, so it ends here even if this one fails.
        self.kept_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        let settings = self.machine.settings();
        let steps =
            [Setting::StepsPerMmX, Setting::StepsPerMmY].map(|setting| settings.get(setting));
        self.job = Job::compute(&self.model, &self.options, steps, self.words, cancel, observer)?;
        Ok(())
    }

    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn change_setting(&mut self, name: &str, value: &str) -> Result<(), CommandError> {
        let setting = name
            .parse()
            .ok()
            .and_then(Setting::numbered)
            .ok_or(CommandError::UnknownSystemCommand)?;
        let value = crate::fixed::Decimal::parse(value).map_err(|_| CommandError::NotANumber)?;
        let value: Value = value.to_millimetres().map_err(|_| CommandError::NumberOutOfRange)?;
        self.machine.set(setting, value).map_err(CommandError::Setting)
    }
}

/// Strokes that are measured while the line is answered.
struct MeasuredStrokes<'s, 'a> {
    strokes: Strokes<'s>,
    cancel: &'a mut dyn Cancel,
    targets: usize,
    given_up: bool,
}

impl Path for MeasuredStrokes<'_, '_> {
    fn next_target(&mut self) -> Option<Target> {
        self.targets += 1;
        // These take some 100,000 instructions.
        if self.targets.is_multiple_of(64) && self.cancel.check().is_err() {
            self.given_up = true;
        }
        self.strokes.next_target().filter(|_| !self.given_up)
    }

    fn rewind(&mut self) {
        self.strokes.rewind();
    }

    fn pen(&self) -> u8 {
        self.strokes.pen()
    }
}

/// Answers the line while a job is computed.
struct Listener<'b, B: Board> {
    board: &'b mut B,
    position: [Value; 2],
    stage: Stage,
    /// What is to be done when it ends.
    asked: RealTime,
}

impl<B: Board> Cancel for Listener<'_, B> {
    fn check(&mut self) -> Result<(), Aborted> {
        report::greet_opened(State::Run, self.board);
        let asked = self.board.take_real_time();
        if asked.has(RealTime::RESUME) {
            self.asked = RealTime::default();
        }
        self.asked = self.asked.and(asked).only(RealTime::HOLD.and(RealTime::EMERGENCY));
        if asked.has(RealTime::STATUS) {
            let stage = match self.stage {
                Stage::View => "view",
                Stage::Visibility => "visibility",
                Stage::Order => "order",
            };
            let mut reply = Reply(self.board);
            reply.part(format_args!("<Run"));
            reply.position(self.position);
            reply.line(format_args!("|Stage:{stage}>"));
        }
        let ends = asked.has(RealTime::ABORT) || asked.has(RealTime::EMERGENCY);
        if ends { Err(Aborted) } else { Ok(()) }
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
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
