//! A plotter in memory: the plotter's library on this computer, behind the same interface as a
//! serial line.
//!
//! Every line passes through the library's own protocol, and the job through its own planner, whose
//! steps a [`PlannedBoard`] carries out. A preview therefore shows what a plotter would do,
//! including its refusals.
//!
//! The file is longer than 500 lines, because one type has a method for each result of a drawing.

use crate::error::Error;
use crate::link::{Answer, Link};
use crate::motion_plot::{self, Motion};
use crate::planned::PlannedBoard;
use penup::boards::host::CutFlash;
use penup::geometry::{Projection, Vertex};
use penup::index::Index;
use penup::machine::{Path, Setting, Settings};
use penup::motion::TICKS_PER_SECOND;
use penup::order::{Shape, TimeModel};
use penup::plotter::{Observer, Plotter, Unobserved};
use penup::protocol::CommandError;
use penup::stage::{Aborted, Cancel, Stage};
use penup::view::View;
use penup::visibility::{EdgeParameter, Stretch};
use penup_job::machine_settings::is_grid;
use penup_job::path::Run;
use penup_job::protocol::{MODEL, PLOT};
use penup_job::relooped::Relooped;
use penup_job::results::{JobReport, JobResult, Lengths, Timings};
use penup_job::room::Room;
use penup_job::streamed::{Form, StreamError, StreamedJob};
use penup_job::strokes::{dashes_of, has_several_pens, runs_of, strokes_of};
use penup_readers::lines::Lines;
use std::io;
use std::time::{Duration, Instant};

/// The number of ticks in a millisecond.
const MILLISECOND: u64 = TICKS_PER_SECOND as u64 / 1000;

/// The beginning of the line that begins a drawing whose strokes are sent.
const BEGIN_STREAM: &str = "$stream=";

/// The size of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModelSize {
    /// The number of vertices.
    pub vertices: usize,
    /// The number of corners of faces, ends of bars and the like, as a board counts them.
    pub corners: usize,
    /// The number of faces.
    pub faces: usize,
    /// The number of bars.
    pub bars: usize,
    /// The number of curves.
    pub curves: usize,
}

/// A plotter in this process, with numbers of 32 bits, or of 16 as on a board.
pub struct InMemory<I: Index = u32> {
    board: PlannedBoard,
    plotter: Plotter<'static, I>,
    /// When the plotter's clock began, if that is the clock of the conversation.
    began: Option<Instant>,
    /// Whether closed strokes begin at random points.
    reloops: bool,
}

/// What the plotter drew after a plot command.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawn {
    /// The path of the pen.
    pub runs: Vec<Run>,
    /// The number of motor steps. A simultaneous step of both axes counts once.
    pub steps: u64,
    /// The time from the first to the last change of a pin, in seconds, without changes of pens by
    /// hand.
    pub duration_s: f64,
}

impl<I: Index> InMemory<I> {
    /// Starts a plotter with this memory and these settings. Its own clock is that of the
    /// conversation, and goes on while a sender listens.
    pub fn new(room: Room, settings: Settings) -> Self {
        let mut board = PlannedBoard::new(50 * MILLISECOND, room.steps);
        let plotter = Plotter::with_settings(room.lend(), board.pins, settings)
            .without_undo()
            .with_early_ink(room.early_ink);
        plotter.greet(&mut board);
        Self { board, plotter, began: Some(Instant::now()), reloops: false }
    }

    /// Starts a plotter with this memory, and with flash in which it keeps its settings and jobs,
    /// as when its power comes on. In each call of [`Link::receive`] a tenth of a second passes for
    /// it.
    pub fn with_flash(room: Room, flash: CutFlash) -> Self {
        let mut board = PlannedBoard::new(MILLISECOND, room.steps);
        board.set_flash(flash);
        let pins = board.pins;
        let plotter = penup::plotter::start(&mut board, room.lend(), pins);
        let plotter = plotter.with_early_ink(room.early_ink);
        Self { board, plotter, began: None, reloops: false }
    }

    /// Cuts the power. Returns the flash, if the plotter has any.
    pub fn cut_power(mut self) -> Option<CutFlash> {
        self.board.take_flash()
    }

    /// The settings of the machine.
    pub fn settings(&self) -> &Settings {
        self.plotter.machine().settings()
    }

    /// Records the path of the pen from now on, as from each plot command on.
    pub fn record(&mut self) {
        self.board.steps.begin(self.plotter.machine().settings());
    }

    /// How often the plotter has lowered its pen.
    pub fn pen_falls(&self) -> usize {
        self.board.steps.falls
    }

    fn steps_per_mm(&self) -> [f64; 2] {
        self.settings().page_steps().map(|steps| steps.to_num::<f64>())
    }

    /// Polls the plotter until it has read every byte and has no more work. A plot that began
    /// continues in [`Link::receive`].
    fn answer(&mut self) {
        // Work that waits for the machine continues in `receive`.
        while !self.board.has_read_all() && self.plotter.poll(&mut self.board) {}
    }

    /// Sends all `lines` to the plotter. Returns whether it has accepted them.
    pub fn take(&mut self, lines: &dyn Lines) -> bool {
        self.board.take_sent();
        lines.in_order().all(|line| {
            self.board.receive(line.sent.as_bytes());
            self.board.receive(b"\n");
            self.answer();
            self.board.take_sent().ends_with(b"ok\r\n")
        })
    }

    /// The size of the model that was sent.
    pub fn model_size(&self) -> ModelSize {
        let model = self.plotter.model();
        ModelSize {
            vertices: model.vertices().len(),
            corners: model.corner_count_of::<u16>(),
            faces: model.face_count(),
            bars: model.bar_count(),
            curves: model.curve_count(),
        }
    }

    /// Whether the model is a plan: it has only bars and curves, at one height.
    pub fn is_plan(&self) -> bool {
        self.plotter.model().is_plan()
    }

    /// What the drawing that was computed last leaves out of the model: sentences without a full
    /// stop. A plotter says the same when it draws by `$plot`.
    pub fn left_out(&mut self) -> Vec<String> {
        let path = self.open_path();
        let job = self.plotter.job();
        let faces = match job.degenerate_faces() {
            0 => None,
            1 => Some("1 face has no area and is left out".to_owned()),
            count => Some(format!("{count} faces have no area and are left out")),
        };
        let edges = match job.joined_edges() {
            0 => None,
            count => Some(format!(
                "edges are left out ({count}): within the precision, the faces beside them are one"
            )),
        };
        faces.into_iter().chain(edges).chain(path).collect()
    }

    /// Says that no pen returns to where it began, if `--cycle` asks for that and the drawing that
    /// was computed last has several pens.
    pub fn open_path(&mut self) -> Option<String> {
        let steps = self.plotter.machine().settings().page_steps();
        let order = self.plotter.options().order(steps, TimeModel::default());
        (order.shape == Shape::ClosedCycle && has_several_pens(&mut self.plotter.strokes()))
            .then(|| "several pens draw it, so nothing is changed by --cycle".to_owned())
    }

    /// Computes the drawing of the model that was sent.
    fn compute(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer<I>,
    ) -> Result<(), Error> {
        let computed = self.plotter.compute(cancel, observer);
        computed.map(drop).map_err(|refusal| Error::NotDrawn { refusal })
    }

    /// Passes the strokes that were computed to `visit`.
    fn with_strokes<R>(&mut self, visit: impl FnOnce(&mut dyn Path) -> R) -> R {
        let reloops = self.reloops;
        with_begins(self.plotter.strokes(), reloops, visit)
    }

    /// Sets whether closed strokes begin at random points, in [`InMemory::streamed`] and in all
    /// results of this computer. The plotter's own `$plot` does not know that.
    pub fn set_reloops(&mut self, reloops: bool) {
        self.reloops = reloops;
    }

    /// Computes the drawing of the model that was sent, as lines that a plotter draws while they
    /// come, without its first `from` strokes, and the report on all of it. More work is spent on
    /// the order than by a plotter, because a computer is faster.
    ///
    /// # Errors
    /// The drawing is refused, does not fit the machine, or has no such form.
    pub fn streamed(
        &mut self,
        form: Form,
        from: u32,
    ) -> Result<(StreamedJob, Option<JobReport>), Error> {
        let (job, report, _) = self.streamed_from(form, from, 0)?;
        Ok((job, report))
    }

    /// Computes the rest of the drawing of the model that was sent, as the lines that a plotter
    /// draws which has drawn so many strokes behind the first `from`, and has passed so many points
    /// within strokes. It begins at the last of these points if that lies in the next stroke, and
    /// otherwise with that stroke.
    ///
    /// # Errors
    /// As [`InMemory::streamed`].
    pub fn rest(&mut self, from: u32, drawn: u32, points: u32) -> Result<StreamedJob, Error> {
        let (whole, _, before) = self.streamed_from(Form::Strokes, from, 0)?;
        // A stroke that begins elsewhere has its points elsewhere.
        let points = if self.reloops { before } else { before.saturating_add(points) };
        let begin = from.saturating_add(drawn);
        let (mut rest, _, mut passed) = self.streamed_from(Form::Strokes, begin, points)?;
        // The last point lies in a later stroke, where several strokes are noted at once.
        if rest.size().strokes != whole.size().strokes.saturating_sub(drawn) {
            (rest, _, passed) = self.streamed_from(Form::Strokes, begin, 0)?;
        }
        rest.set_rest_of(&whole, passed.saturating_sub(before));
        Ok(rest)
    }

    /// Computes the lines of [`InMemory::streamed`] without the first `from` strokes, beginning at
    /// the last one of so many points within strokes, if it lies behind these strokes. Returns the
    /// number of points before that, too.
    fn streamed_from(
        &mut self,
        form: Form,
        from: u32,
        points: u32,
    ) -> Result<(StreamedJob, Option<JobReport>, u32), Error> {
        self.plotter.set_thorough(true);
        self.compute(&mut StopWatch::default(), &mut Unobserved)?;
        let settings = *self.plotter.machine().settings();
        let (steps, reloops) = (self.steps_per_mm(), self.reloops);
        let lengths = reloops.then(|| {
            let strokes = self.with_strokes(|strokes| strokes_of(strokes, steps));
            Lengths::of(&strokes.into_iter().map(|stroke| stroke.points).collect::<Vec<_>>())
        });
        let (strokes, before) = match from {
            0 if points == 0 => (self.plotter.strokes(), 0),
            _ => self.plotter.strokes_left(from, points).ok_or_else(|| Error::NotStreamed {
                reason: format!("it has no more than {from} strokes: nothing is left to draw"),
            })?,
        };
        let job = with_begins(strokes, reloops, |path| StreamedJob::new(&settings, path, form));
        let job = job.map_err(|error| match error {
            StreamError::Machine(error) => {
                Error::NotDrawn { refusal: CommandError::Machine(error) }
            }
            StreamError::LineType => Error::NotStreamed {
                reason: "this plotter takes G-code, which has no dotted or dashed lines: choose \
                         others by --hidden"
                    .to_owned(),
            },
            StreamError::TooLong => {
                Error::NotStreamed { reason: "it has more lines than can be numbered".to_owned() }
            }
        })?;
        self.board.take_sent();
        self.board.receive(format!("{MODEL}\n").as_bytes());
        self.answer();
        let sent = String::from_utf8_lossy(&self.board.take_sent()).into_owned();
        let strokes = job.size().strokes.into();
        let report = sent.lines().find_map(|line| JobReport::parse(strokes, line.trim()));
        let report = match lengths {
            Some(lengths) => report.map(|report| report.with_moves_of(lengths)),
            None => report,
        };
        Ok((job, report, before))
    }

    /// The speed with the pen down, in mm/min.
    pub fn draw_speed(&self) -> f64 {
        self.plotter.machine().settings().get(Setting::DrawSpeed).to_num()
    }

    /// Computes the drawing and measures its moves, as the plotter does before the first move.
    ///
    /// # Errors
    /// The plotter refuses the drawing.
    pub fn rehearse(&mut self) -> Result<(), Error> {
        self.compute(&mut StopWatch::default(), &mut Segments::default())?;
        let settings = *self.plotter.machine().settings();
        motion_plot::measure(settings, &mut self.plotter.strokes())
            .map_err(|error| Error::NotDrawn { refusal: CommandError::Machine(error) })
    }

    /// Records the drawing of the model that was sent as a tape ([`crate::tape`]).
    ///
    /// # Errors
    /// The plotter refuses the drawing.
    pub fn tape(&mut self) -> Result<Vec<u8>, Error> {
        self.compute(&mut StopWatch::default(), &mut Segments::default())?;
        let settings = *self.plotter.machine().settings();
        let tape = crate::tape::record(settings, &mut self.plotter.strokes());
        tape.map_err(|error| Error::NotDrawn { refusal: CommandError::Machine(error) })
    }

    /// Whether several pens draw what was computed last.
    pub fn has_several_pens(&mut self) -> bool {
        has_several_pens(&mut self.plotter.strokes())
    }

    /// Records the motion of the drawing by this plotter ([`crate::motion_plot`]).
    ///
    /// # Errors
    /// The drawing is refused.
    pub fn motion(&mut self) -> Result<Motion, Error> {
        self.compute(&mut StopWatch::default(), &mut Segments::default())?;
        let settings = *self.plotter.machine().settings();
        self.with_strokes(|strokes| Motion::record(settings, strokes))
            .map_err(|error| Error::NotDrawn { refusal: CommandError::Machine(error) })
    }

    /// What was drawn after the last plot command.
    pub fn drawn(&mut self) -> Drawn {
        let (steps, duration_s) = self.board.steps.totals();
        let settings = self.plotter.machine().settings();
        let runs = if is_grid(settings) {
            self.board.steps.runs()
        } else {
            let dot = f64::from(settings.get(Setting::DotLength).to_bits()) / f64::from(1 << 16);
            let steps = self.steps_per_mm();
            let lines = self.with_strokes(|strokes| dashes_of(strokes, steps, dot));
            runs_of(lines, 1.0 / steps[0])
        };
        Drawn { runs, steps, duration_s }
    }

    /// The results of the last plot command. The drawing is computed once more, which is timed.
    ///
    /// # Errors
    /// The plotter refuses the drawing.
    pub fn result(&mut self) -> Result<JobResult, Error> {
        let Drawn { runs, steps, duration_s } = self.drawn();
        let mut watch = StopWatch::default();
        let mut segments = Segments::default();
        self.compute(&mut watch, &mut segments)?;
        let timings_ms = watch.stop();
        let steps_per_mm = self.steps_per_mm();
        let (mut stroke_pens, mut strokes): (Vec<u8>, Vec<_>) = self
            .with_strokes(|strokes| strokes_of(strokes, steps_per_mm))
            .into_iter()
            .map(|stroke| (stroke.pen, stroke.points))
            .unzip();
        let lengths = Lengths::of(&strokes);
        // A return of the pen counts among the moves, and is no stroke.
        if strokes.last().is_some_and(|points| points.len() == 1) {
            strokes.pop();
            stroke_pens.pop();
        }
        Ok(JobResult {
            segments: segments.ends,
            segment_pens: segments.pens,
            strokes,
            stroke_pens,
            pen_down_mm: lengths.pen_down_mm,
            pen_up_mm: lengths.pen_up_mm,
            efficiency: lengths.efficiency(),
            steps,
            duration_s,
            timings_ms,
            runs,
        })
    }
}

impl<I: Index> Link for InMemory<I> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // The command is between the line's number and its checksum.
        let begins = |part: &[u8]| {
            [PLOT, BEGIN_STREAM].into_iter().any(|command| part.starts_with(command.as_bytes()))
        };
        if bytes.split(|byte| *byte == b' ').any(begins) {
            self.record();
        }
        self.board.receive(bytes);
        self.answer();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let timeout = match self.began {
            Some(_) => timeout,
            None => Duration::from_millis(100),
        };
        let end = self.board.now() + timeout.as_millis() as u64 * MILLISECOND;
        let mut sent = Vec::new();
        while sent.is_empty() && self.board.now() < end {
            self.plotter.poll(&mut self.board);
            penup::plotter::Board::wait(&mut self.board);
            if self.began.is_some() {
                sent = self.board.take_sent();
            }
        }
        sent.extend(self.board.take_sent());
        let (now, later) = sent.split_at(sent.len().min(buffer.len()));
        buffer[..now.len()].copy_from_slice(now);
        penup::plotter::Board::write(&mut self.board, later);
        Ok(now.len())
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.board.steps.change_pen(pen);
        Ok(Answer::Yes)
    }

    /// Goes on at once: the pen of a preview is full again after a pause for ink (`$215`).
    fn ask_to_resume(&mut self, _first: bool) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn now(&self) -> Instant {
        let ticks = self.board.now() / MILLISECOND;
        self.began.map_or_else(Instant::now, |began| began + Duration::from_millis(ticks))
    }
}

/// Passes `strokes` to `visit`. Closed ones begin at random points if this `reloops`.
fn with_begins<R>(
    mut strokes: impl Path,
    reloops: bool,
    visit: impl FnOnce(&mut dyn Path) -> R,
) -> R {
    match reloops {
        true => visit(&mut Relooped::of(&mut strokes)),
        false => visit(&mut strokes),
    }
}

/// Measures the computing time of each stage.
struct StopWatch {
    began: Instant,
    stage: Stage,
    timings: Timings,
}

impl Default for StopWatch {
    fn default() -> Self {
        Self { began: Instant::now(), stage: Stage::View, timings: Timings::default() }
    }
}

impl StopWatch {
    fn stop(mut self) -> Timings {
        self.enter(Stage::View);
        self.timings
    }
}

impl Cancel for StopWatch {
    fn check(&mut self) -> Result<(), Aborted> {
        Ok(())
    }

    fn enter(&mut self, stage: Stage) {
        let passed = self.began.elapsed().as_secs_f64() * 1000.0;
        *match self.stage {
            Stage::View => &mut self.timings.view,
            Stage::Visibility => &mut self.timings.visibility,
            Stage::Order => &mut self.timings.order,
        } += passed;
        self.stage = stage;
        self.began = Instant::now();
    }
}

/// Collects the visible segments on the image plane and the pen of each.
#[derive(Default)]
struct Segments {
    ends: Vec<[f64; 4]>,
    pens: Vec<u8>,
}

impl Segments {
    fn push(&mut self, ends: [f64; 4], pen: u8) {
        self.ends.push(ends);
        self.pens.push(pen + 1);
    }
}

impl<I: Index> Observer<I> for Segments {
    fn stretch(&mut self, view: &View, stretch: &Stretch<I>) {
        if stretch.visible {
            let (p, q) = stretch.ends;
            let [[x1, y1], [x2, y2]] = [stretch.from, stretch.to].map(|end| image(view, p, q, end));
            self.push([x1, y1, x2, y2], stretch.pen);
        }
    }

    fn start_again(&mut self) {
        *self = Self::default();
    }

    fn plan_bar(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], pen: u8) {
        self.push([x1, y1, x2, y2], pen);
    }
}

/// The image of the point with parameter `along` on the edge from `p` to `q`.
fn image(view: &View, p: Vertex, q: Vertex, along: EdgeParameter) -> [f64; 2] {
    let part = along.numerator as f64 / along.denominator as f64;
    let between = |p: i32, q: i32| f64::from(p) * (1.0 - part) + f64::from(q) * part;
    let w = match view.projection() {
        Projection::Perspective => between(p.z, q.z),
        Projection::Parallel => 1.0,
    };
    [(p.x, q.x), (p.y, q.y)].map(|(p, q)| between(p, q) / w * view.image_unit())
}
