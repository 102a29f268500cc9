//! How much memory a plotter in this process needs for a job, so that nothing but the computer's
//! memory limits the size of a drawing.

use penup::board_table::{BoardRow, PICO};
use penup::boards::host::lend_memory_of;
use penup::index::Index;
use penup::plotter::EMPTY_LOOKAHEAD;
use penup::plotter::MemorySlices;
use penup_readers::lines::Lines;
use serde::{Deserialize, Serialize};

/// The capacities of a plotter's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Room {
    /// The number of vertices.
    pub vertices: usize,
    /// The number of corners, or of numbers that take the place of one.
    pub corners: usize,
    /// The number of words to work in.
    words: usize,
    /// The number of moves planned ahead.
    blocks: usize,
    /// The number of steps that wait. The machine is never faster than it could stop within 13/16
    /// of them.
    pub steps: u32,
    /// Whether the pen begins to draw while the order is computed. Without a named board it does
    /// not.
    #[serde(default)]
    pub early_ink: bool,
}

impl Room {
    /// The bytes to work in that a job needs however small it is. They are enough for the title.
    const LEAST_BYTES: usize = 4 << 20;
    /// The bytes to work in for each vertex: its view coordinates and its place on the grid.
    const BYTES_A_VERTEX: usize = 32;
    /// The bytes to work in for each corner: the grid of the page, the lines of up to two stretches
    /// of an edge, and the order of their strokes.
    const BYTES_A_CORNER: usize = 256;
    /// The number of steps that wait, where no board is named: those of the fastest one.
    const STEPS: u32 = PICO.memory.steps;
    /// The number of chords into which the piece of a curve at one control point may be divided.
    const CHORDS: usize = 64;

    /// Returns what is enough for any model that a board holds in its working memory.
    pub fn usual() -> Self {
        let blocks = EMPTY_LOOKAHEAD.len();
        Self {
            vertices: 1 << 15,
            corners: 1 << 16,
            words: 1 << 19,
            blocks,
            steps: Self::STEPS,
            early_ink: false,
        }
    }

    /// Returns what is enough for the model that `lines` send.
    pub fn for_job(lines: &dyn Lines) -> Self {
        let (mut vertices, mut corners, mut chords) = (0, 0, 0);
        for line in lines.in_order() {
            let mut words = line.sent.split_ascii_whitespace();
            let keyword = words.next();
            let numbers = words.count();
            match keyword {
                Some("v") => vertices += 1,
                // Two corners for each bar of a polyline, and at most two for a change of the pen.
                Some("f" | "l") => corners += 2 * numbers + 2,
                Some("curv" | "parm") => {
                    corners += 2 * numbers + 8;
                    chords += Self::CHORDS * numbers;
                }
                _ => {}
            }
        }
        let bytes = Self::LEAST_BYTES
            + Self::BYTES_A_VERTEX * (vertices + chords)
            + Self::BYTES_A_CORNER * (corners + 2 * chords);
        let blocks = EMPTY_LOOKAHEAD.len();
        Self { vertices, corners, words: bytes / 8, blocks, steps: Self::STEPS, early_ink: false }
    }

    /// Returns the same capacities with this many times the working memory, for numbers that are
    /// wider by this factor.
    #[must_use]
    pub fn with_words(self, times: usize) -> Self {
        Self { words: times * self.words, ..self }
    }

    /// Whether this fits in `other`.
    pub fn fits(self, other: Self) -> bool {
        self.vertices <= other.vertices
            && self.corners <= other.corners
            && self.words <= other.words
            && self.blocks <= other.blocks
    }

    /// Returns what a board has.
    pub fn of_board(board: &BoardRow) -> Self {
        let memory = board.memory;
        Self {
            vertices: memory.vertices,
            corners: memory.corners,
            words: memory.words,
            blocks: memory.blocks,
            steps: memory.steps,
            early_ink: board.early_ink,
        }
    }

    /// Allocates the memory. It lasts as long as the process.
    pub fn lend<I: Index>(self) -> MemorySlices<'static, I> {
        lend_memory_of(self.vertices, self.corners, self.words, self.blocks)
    }
}
