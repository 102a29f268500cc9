//! An emulated plotter: the firmware's session on a board of plain memory, with a pipe of bytes to
//! it, and a record of what its pins do.

use crate::number::Number;
use crate::options::{NamedValues, text_of};
use penup::board_table::{BOARDS, BoardRow};
use penup::boards::host::HostBoard;
use penup::machine::{EventRing, PulserState, Setting};
use penup::plotter::{Board as _, Plotter};
use penup_job::export;
use penup_job::picture::Picture;
use penup_job::pins::{PenHeights, PinChange};
use penup_job::room::Room;
use penup_job::sampled::SampledPath;
use penup_job::strokes::{Stroke, strokes_of};
use penup_job::watch::PenWatch;
use penup_readers::page::Page;
use serde::Serialize;
use std::fmt;
use wasm_bindgen::prelude::wasm_bindgen;

/// The emulated plotter.
#[wasm_bindgen]
pub struct Board {
    board: HostBoard<'static>,
    plotter: Plotter<'static, Number>,
    pen: PenWatch,
    /// Steps per mm, of x and of y.
    steps: [f64; 2],
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
    /// the name `limits`, or if there is none, enough for a model that needs the `room`, which
    /// [`Sheet`](crate::Sheet) tells of a file (without it, for one that is not very large). The
    /// machine has the settings that the `options` say: a JSON array of pairs of name and value.
    ///
    /// # Errors
    /// A sentence for the user: there is no such machine.
    #[wasm_bindgen(constructor)]
    pub fn new(limits: &str, room: &str, options: &str) -> Result<Self, String> {
        crate::note_faults();
        let room = serde_json::from_str(room).unwrap_or_else(|_| Room::usual());
        // The numbers here are twice as wide as those of a board.
        let of_board = |board| Room::of_board(board).with_words(2);
        let room = BoardRow::named(limits).map_or(room, of_board);
        // The memory is leaked because the plotter and the board borrow from it; a worker makes
        // one board and keeps it.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins = Box::leak(Box::new(PulserState::new()));
        let mut board = HostBoard::new(ring, pins);
        pins.set_queue(room.steps);
        let machine = NamedValues::parse(options)?.machine()?;
        let plotter = Plotter::with_settings(room.lend(), pins, machine)
            .without_undo()
            .with_early_ink(room.early_ink);
        plotter.greet(&mut board);
        let steps = plotter.machine().settings().page_steps().map(|steps| steps.to_num::<f64>());
        let pen = PenWatch::new(1.0 / steps[0]);
        Ok(Self { board, plotter, pen, steps, path: SampledPath::new(steps) })
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
        let heights = PenHeights::of(self.plotter.machine().settings());
        for change in &changes {
            let change = PinChange::of(change, heights);
            self.pen.change(change);
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
        self.path.change_pen(pen);
    }

    /// Forgets the path so far, because another drawing begins.
    pub fn begin_again(&mut self) {
        self.pen.begin_again();
        self.path.begin_again();
    }

    /// The path of the pen since the last call, as [`SampledPath`] describes it.
    pub fn take_path(&mut self) -> Vec<f32> {
        self.path.take()
    }

    /// The picture of the path on a page of this size in mm, as SVG: the file that `penup preview`
    /// writes.
    pub fn svg(&mut self, width: f64, height: f64) -> String {
        Picture { page: Page { width, height }, runs: self.pen.runs() }.svg()
    }

    /// What the pins have drawn as G-code for Grbl, as the client writes it with these options: a
    /// JSON array of pairs of name and value.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn gcode(&mut self, options: &str) -> Result<String, String> {
        let speed = self.plotter.machine().settings().get(Setting::DrawSpeed).to_num();
        Ok(export::gcode(&self.lines(options)?, speed))
    }

    /// What the pins have drawn as HP-GL, as the client writes it with these options: a JSON array
    /// of pairs of name and value.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn hpgl(&mut self, options: &str) -> Result<String, String> {
        Ok(export::hpgl(&self.lines(options)?))
    }

    /// The strokes of the last drawing in their order, in mm on the page: for each the pen, the
    /// number of points, and x and y of each.
    pub fn strokes(&mut self) -> Vec<f64> {
        let strokes = strokes_of(&mut self.plotter.strokes(), self.steps);
        let mut numbers = Vec::new();
        // A single point is where the pen returns to.
        for Stroke { pen, points } in strokes.into_iter().filter(|it| it.points.len() > 1) {
            numbers.extend([f64::from(pen), points.len() as f64]);
            numbers.extend(points.into_iter().flatten());
        }
        numbers
    }
}

impl Board {
    /// The lines that the pins have drawn, as they are saved with these options.
    fn lines(&mut self, options: &str) -> Result<Vec<export::Line>, String> {
        let retracing = NamedValues::parse(options)?.retracing()?;
        Ok(export::lines(&self.pen.runs(), retracing))
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
