//! A plotter in memory: the plotter's library on this computer, behind the same interface as a
//! serial line.
//!
//! Every line passes through the library's own protocol, and the job through its own interrupt code
//! on a [`HostBoard`]. A preview therefore shows what a plotter would do, including its refusals.

use crate::error::Error;
use crate::link::Link;
use crate::motion_plot::{self, GivenSetting, Motion};
use crate::protocol::PLOT;
use crate::results::{JobResult, Lengths, Timings};
use crate::watch::PenWatch;
use penup::boards::host::{Change, HostBoard, lend_memory};
use penup::geometry::{Projection, Vertex};
use penup::machine::{EventRing, Path, PulserState, Target};
use penup::plotter::{Observer, Plotter};
use penup::protocol::CommandError;
use penup::stage::{Aborted, Cancel, Stage};
use penup::view::View;
use penup::visibility::{EdgeParameter, Stretch};
use std::io;
use std::time::{Duration, Instant};

/// A plotter in this process.
pub struct InMemory {
    board: HostBoard<'static>,
    plotter: Plotter<'static>,
    steps: u64,
    pen: Option<PenWatch>,
}

impl InMemory {
    /// Starts the plotter.
    pub fn new() -> Self {
        // The memory is leaked because the plotter and the board borrow from it as long as the
        // process lives; there is only one per run.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins = Box::leak(Box::new(PulserState::new()));
        let mut board = HostBoard::new(ring, pins);
        let plotter = Plotter::new(lend_memory(), pins);
        plotter.greet(&mut board);
        Self { board, plotter, steps: 0, pen: None }
    }

    fn steps_per_mm(&self) -> [f64; 2] {
        self.plotter.machine().settings().page_steps().map(|steps| steps.to_num::<f64>())
    }

    fn follow_pins(&mut self) {
        let changes = self.board.trace().take_changes();
        self.steps += count_steps(&changes);
        if let Some(pen) = &mut self.pen {
            changes.iter().for_each(|change| pen.change(change.into()));
        }
    }

    /// Polls the plotter until it has read every byte and has no more work. A plot that began
    /// continues in [`Link::receive`].
    fn answer(&mut self) {
        // Work that waits for the machine continues in `receive`.
        while !self.board.has_read_all() && self.plotter.poll(&mut self.board) {}
    }

    /// Records the drawing of the model that was sent as a tape ([`crate::tape`]).
    ///
    /// # Errors
    /// The plotter refuses the drawing.
    pub fn tape(&mut self) -> Result<Vec<u8>, Error> {
        let computed = self.plotter.compute(&mut StopWatch::default(), &mut Segments::default());
        computed.map_err(|refusal| Error::NotDrawn { refusal })?;
        let settings = *self.plotter.machine().settings();
        let tape = crate::tape::record(settings, &mut self.plotter.strokes());
        tape.map_err(|error| Error::NotDrawn { refusal: CommandError::Machine(error) })
    }

    /// Records the motion of the drawing, by a machine with the default settings except for those
    /// given ([`crate::motion_plot`]).
    ///
    /// # Errors
    /// A setting, or the drawing, is refused.
    pub fn motion(&mut self, given: &[GivenSetting]) -> Result<Motion, Error> {
        let refused = |refusal| Error::NotDrawn { refusal };
        let computed = self.plotter.compute(&mut StopWatch::default(), &mut Segments::default());
        computed.map_err(refused)?;
        let mut settings = *self.plotter.machine().settings();
        motion_plot::apply(&mut settings, given)
            .map_err(|error| refused(CommandError::Setting(error)))?;
        Motion::record(settings, &mut self.plotter.strokes())
            .map_err(|error| refused(CommandError::Machine(error)))
    }

    /// The results of the last plot command.
    ///
    /// # Errors
    /// The plotter refuses the drawing.
    pub fn result(&mut self) -> Result<JobResult, Error> {
        let mut watch = StopWatch::default();
        let mut segments = Segments::default();
        let computed = self.plotter.compute(&mut watch, &mut segments);
        computed.map_err(|refusal| Error::NotDrawn { refusal })?;
        let timings_ms = watch.stop();
        let steps = self.steps_per_mm();
        let mut strokes: Vec<Vec<[f64; 2]>> = Vec::new();
        let mut stroke_pens: Vec<u8> = Vec::new();
        let mut path = self.plotter.strokes();
        while let Some(Target { point, ink }) = path.next_target() {
            let point = [f64::from(point.x) / steps[0], f64::from(point.y) / steps[1]];
            let pen = path.pen() + 1;
            match (ink, strokes.last_mut(), stroke_pens.last()) {
                (Some(_), Some(stroke), Some(last)) if *last == pen => stroke.push(point),
                // Another pen continues where the last one ended.
                (Some(_), Some(stroke), _) => {
                    let from = stroke.last().copied().unwrap_or(point);
                    strokes.push(vec![from, point]);
                    stroke_pens.push(pen);
                }
                _ => {
                    strokes.push(vec![point]);
                    stroke_pens.push(pen);
                }
            }
        }
        let lengths = Lengths::of(&strokes);
        Ok(JobResult {
            segments: segments.ends,
            segment_pens: segments.pens,
            strokes,
            stroke_pens,
            pen_down_mm: lengths.pen_down_mm,
            pen_up_mm: lengths.pen_up_mm,
            efficiency: lengths.efficiency(),
            steps: core::mem::take(&mut self.steps),
            timings_ms,
            pen: self.pen.as_mut().map(PenWatch::runs).unwrap_or_default(),
        })
    }
}

impl Default for InMemory {
    fn default() -> Self {
        Self::new()
    }
}

impl Link for InMemory {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // The command is between the line's number and its checksum.
        let plots = |part: &[u8]| part.starts_with(PLOT.as_bytes());
        if bytes.split(|byte| *byte == b' ').any(plots) {
            self.steps = 0;
            let step = 1.0 / self.steps_per_mm()[0];
            self.pen.get_or_insert_with(|| PenWatch::new(step)).begin_again();
        }
        self.board.receive(bytes);
        self.answer();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _patience: Duration) -> io::Result<usize> {
        // Each iteration lets a tenth of a second of the plotter's time pass.
        for _ in 0..100 {
            self.plotter.poll(&mut self.board);
            penup::plotter::Board::wait(&mut self.board);
        }
        self.follow_pins();
        let sent = self.board.take_sent();
        let (now, later) = sent.split_at(sent.len().min(buffer.len()));
        buffer[..now.len()].copy_from_slice(now);
        penup::plotter::Board::write(&mut self.board, later);
        Ok(now.len())
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<bool> {
        self.follow_pins();
        if let Some(watch) = &mut self.pen {
            watch.change_pen(pen);
        }
        Ok(true)
    }
}

/// Counts the steps at the pins. Simultaneous rising edges of both axes count as one step.
fn count_steps(changes: &[penup::boards::host::Stamped]) -> u64 {
    let rises = |change: Change| matches!(change, Change::StepX(true) | Change::StepY(true));
    let mut times: Vec<u64> = changes.iter().filter(|c| rises(c.change)).map(|c| c.time).collect();
    times.dedup();
    times.len() as u64
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

impl Observer for Segments {
    fn stretch(&mut self, view: &View, stretch: &Stretch) {
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
