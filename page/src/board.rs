//! An emulated plotter: the firmware's session on a board of plain memory, with a pipe of bytes to
//! it, and a record of what its pins do.

use crate::options::text_of;
use penup::board_table::{BOARDS, BoardRow, Capacities};
use penup::boards::host::{HostBoard, PORTS, Stamped, lend_memory};
use penup::machine::{EventRing, PulserState};
use penup::model::{Corner, Position};
use penup::motion::{Block, TICKS_PER_SECOND};
use penup::plotter::{Board as _, MemorySlices, Plotter};
use penup::protocol::LineReader;
use penup_job::picture::Picture;
use penup_job::pins::Machine;
use penup_job::strokes::{Stroke, strokes_of};
use penup_job::watch::PenWatch;
use penup_readers::page::Page;
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::fmt;
use wasm_bindgen::prelude::wasm_bindgen;

/// The most time between two samples of the pen's path while it moves, in ticks: 20 ms.
const SAMPLE_TICKS: u64 = TICKS_PER_SECOND as u64 / 50;

/// The emulated plotter.
#[wasm_bindgen]
pub struct Board {
    board: HostBoard<'static>,
    plotter: Plotter<'static>,
    pen: PenWatch,
    path: SampledPath,
}

impl fmt::Debug for Board {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Board").field("board", &self.board).finish_non_exhaustive()
    }
}

#[wasm_bindgen]
impl Board {
    /// Starts the plotter, at the page's origin with the pen up. It has the memory of the board of
    /// the name `limits`, or as much as a computer lends if there is none.
    #[wasm_bindgen(constructor)]
    pub fn new(limits: &str) -> Self {
        crate::note_faults();
        // The memory is leaked because the plotter and the board borrow from it; a worker makes
        // one board and keeps it.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins = Box::leak(Box::new(PulserState::new()));
        let mut board = HostBoard::new(ring, pins);
        let plotter = Plotter::new(memory_of(limits), pins);
        plotter.greet(&mut board);
        let steps = plotter.machine().settings().page_steps().map(|steps| steps.to_num::<f64>());
        let pen = PenWatch::new(1.0 / steps[0]);
        Self { board, plotter, pen, path: SampledPath::new(steps) }
    }

    /// Receives bytes by the serial line.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.board.receive(bytes);
    }

    /// Lets `milliseconds` of the plotter's time pass.
    pub fn advance(&mut self, milliseconds: u32) {
        // Whatever was received is read first, which takes no time.
        while !self.board.has_read_all() && self.plotter.poll(&mut self.board) {}
        for _ in 0..milliseconds {
            self.plotter.poll(&mut self.board);
            self.board.wait();
        }
        let changes = self.board.trace().take_changes();
        for change in &changes {
            self.pen.change(change.into());
            self.path.change(change);
        }
    }

    /// The bytes that the plotter has sent since the last call.
    pub fn take_sent(&mut self) -> Vec<u8> {
        self.board.take_sent()
    }

    /// Says that the pen with this number, from 1, is in from now on.
    pub fn change_pen(&mut self, pen: u8) {
        self.pen.change_pen(pen);
        self.path.pen = pen;
    }

    /// Forgets the path so far, because another drawing begins.
    pub fn begin_again(&mut self) {
        self.pen.begin_again();
        self.path.begin_again();
    }

    /// The path of the pen since the last call: four numbers for each sample, which are the time in
    /// seconds since the drawing began, x and y in mm from the lower left corner of the page, and
    /// the pen that is down, from 1, or 0. From one sample to the next, the pen moves straight,
    /// within two steps of its path, and is down if the sample at the end says so.
    pub fn take_path(&mut self) -> Vec<f32> {
        self.path.end();
        std::mem::take(&mut self.path.samples)
    }

    /// The picture of the path on a page of this size in mm, as SVG: the file that `penup preview`
    /// writes.
    pub fn svg(&mut self, width: f64, height: f64) -> String {
        let runs = self.pen.runs();
        Picture { page: Page { width, height }, runs: runs.runs, step: runs.step }.svg()
    }

    /// The strokes of the last drawing in their order, in mm on the page: for each the pen, the
    /// number of points, and x and y of each.
    pub fn strokes(&mut self) -> Vec<f64> {
        let strokes = strokes_of(&mut self.plotter.strokes(), self.path.steps);
        let mut numbers = Vec::new();
        for Stroke { pen, points } in strokes {
            numbers.extend([f64::from(pen), points.len() as f64]);
            numbers.extend(points.into_iter().flatten());
        }
        numbers
    }
}

/// The boards as JSON: an array of objects with name, description, and capacities.
#[wasm_bindgen]
pub fn boards() -> String {
    let boards = BOARDS.map(|board| BoardLimits {
        name: board.name,
        about: board.about,
        vertices: board.memory.vertices,
        corners: board.memory.corners,
    });
    text_of(&boards)
}

/// What a board holds.
#[derive(Serialize)]
struct BoardLimits {
    name: &'static str,
    about: &'static str,
    vertices: usize,
    corners: usize,
}

/// Memory with the capacities of a board. It is leaked, so it lasts as long as the worker.
fn memory_of(board: &str) -> MemorySlices<'static> {
    let Some(row) = BoardRow::named(board) else { return lend_memory() };
    let Capacities { vertices, corners, words, blocks, .. } = row.memory;
    MemorySlices {
        vertices: vec![Position::ORIGIN; vertices].leak(),
        corners: vec![<Corner>::ZERO; corners].leak(),
        blocks: vec![Block::EMPTY; blocks].leak(),
        words: vec![0; words].leak(),
        readers: Box::leak(Box::new([const { LineReader::new() }; PORTS])),
        hpgl: Box::leak(Box::new(penup::hpgl::Session::new())),
    }
}

/// Follows the pins, and keeps of the path what is needed to show it.
struct SampledPath {
    machine: Machine,
    /// Steps per mm, of x and of y.
    steps: [f64; 2],
    /// The number of the pen that is in, from 1.
    pen: u8,
    samples: Vec<f32>,
    /// The time of the first change since the drawing began, in ticks.
    began: Option<u64>,
    /// The time of the last change, and of the last sample.
    last: u64,
    sampled: u64,
    /// Whether the last change is not sampled yet.
    is_due: bool,
    course: Course,
}

impl SampledPath {
    fn new(steps: [f64; 2]) -> Self {
        Self {
            machine: Machine::default(),
            steps,
            pen: 1,
            samples: Vec::new(),
            began: None,
            last: 0,
            sampled: 0,
            is_due: false,
            course: Course::from((0, 0)),
        }
    }

    fn begin_again(&mut self) {
        self.samples.clear();
        self.began = None;
    }

    fn change(&mut self, change: &Stamped) {
        let (before, was_down) = (self.machine.position(), self.machine.pen_is_down());
        self.machine.change(change.into());
        let (now, is_down) = (self.machine.position(), self.machine.pen_is_down());
        let lifts = was_down != is_down;
        if now == before && !lifts {
            return;
        }
        if self.began.is_none() {
            self.began = Some(change.time);
            self.last = change.time;
            self.sample(before, was_down);
        }
        if change.time != self.last {
            // All changes before this one are complete. The step that begins now is the first that
            // may leave the straight line.
            let turns = !self.course.passes(before);
            if self.is_due && (lifts || turns || self.last - self.sampled >= SAMPLE_TICKS) {
                self.sample(before, was_down);
            }
        }
        self.last = change.time;
        self.is_due = true;
        if lifts {
            self.sample(now, was_down);
            self.sample(now, is_down);
        }
    }

    /// Samples what is not sampled yet.
    fn end(&mut self) {
        if self.is_due {
            self.sample(self.machine.position(), self.machine.pen_is_down());
        }
    }

    /// Samples the position at the time of the last change.
    fn sample(&mut self, position: (i32, i32), is_down: bool) {
        let ticks = self.last - self.began.unwrap_or(self.last);
        self.samples.extend([
            (ticks as f64 / f64::from(TICKS_PER_SECOND)) as f32,
            (f64::from(position.0) / self.steps[0]) as f32,
            (f64::from(position.1) / self.steps[1]) as f32,
            if is_down { f32::from(self.pen) } else { 0.0 },
        ]);
        (self.sampled, self.is_due) = (self.last, false);
        self.course = Course::from(position);
    }
}

/// The straight lines from a position that pass every later one within a step.
struct Course {
    from: (i32, i32),
    /// The direction to the first later position.
    first: Option<f64>,
    /// The range of directions, relative to the first.
    lowest: f64,
    highest: f64,
    /// The distance to the farthest position so far.
    farthest: f64,
}

impl Course {
    fn from(from: (i32, i32)) -> Self {
        Self { from, first: None, lowest: -PI, highest: PI, farthest: 0.0 }
    }

    /// Adds a position. Returns whether the straight line to it passes all before it.
    fn passes(&mut self, (x, y): (i32, i32)) -> bool {
        let (dx, dy) = (f64::from(x - self.from.0), f64::from(y - self.from.1));
        let (distance, angle) = (dx.hypot(dy), dy.atan2(dx));
        let turned = (angle - self.first.unwrap_or(angle) + 3.0 * PI).rem_euclid(TAU) - PI;
        let passes =
            distance + 1.0 >= self.farthest && (self.lowest..=self.highest).contains(&turned);
        self.farthest = self.farthest.max(distance);
        if distance > 1.0 {
            self.first.get_or_insert(angle);
            let spread = (1.0 / distance).asin();
            self.lowest = self.lowest.max(turned - spread);
            self.highest = self.highest.min(turned + spread);
        }
        passes
    }
}
