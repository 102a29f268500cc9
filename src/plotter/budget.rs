//! The memory budget of each board, checked at compile time.
//!
//! For the largest scene that a board must be able to draw, a [`Budget`] adds up what the stages of
//! a job need. The library does not compile if that exceeds the board's working memory.

use crate::board_table::{BOARDS, BoardRow};
use crate::drawing::{PackedLine, PagePoint, Segment};
use crate::geometry::Vertex;
use crate::model::{Corner, Position};
use crate::order::{self, Leg};
use crate::stage::Scratch;
use crate::visibility;

/// The capacities of a board, and the memory in bytes that its largest scene needs.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    /// The board's name, as in [`crate::board_table`].
    pub board: &'static str,
    /// Number of vertices that the model can hold.
    pub vertex_limit: usize,
    /// Number of face corners and bar ends that the model can hold.
    pub corner_limit: usize,
    /// Size of the model's memory, in bytes.
    pub model: usize,
    /// Size of the working memory, in bytes. The stages of a job (the parts of its computation) use
    /// it one after the other.
    pub working: usize,
    /// Bytes for the vertices in view coordinates. They are held while hidden lines are found.
    pub view: usize,
    /// The fewest bytes with which hidden lines can be found. More memory makes the search faster.
    pub visibility: usize,
    /// Bytes for the visible lines that the search finds.
    pub lines: usize,
    /// Bytes for the drawing on the page. It is held until it has been drawn.
    pub drawing: usize,
    /// Bytes for the order of the strokes. It is held until the drawing has been drawn, too.
    pub tour: usize,
    /// Bytes for pairing the odd points exactly, so that the pen travels least.
    pub matching: usize,
}

impl Budget {
    /// Adds up the memory that the largest scene of a board needs.
    const fn of(board: &BoardRow) -> Self {
        let BoardRow { name, memory, scene, .. } = board;
        let budget = Self {
            board: *name,
            vertex_limit: memory.vertices,
            corner_limit: memory.corners,
            model: size_of::<Position>() * memory.vertices + size_of::<Corner>() * memory.corners,
            working: 8 * memory.words,
            view: Scratch::bytes_for::<Vertex>(scene.vertices),
            visibility: visibility::least_bytes::<u16>(scene.vertices, scene.corners, scene.faces),
            lines: Scratch::bytes_for::<PackedLine>(scene.lines),
            // A line adds at most two new points.
            drawing: Scratch::bytes_for::<Segment>(scene.lines)
                + Scratch::bytes_for::<PagePoint>(2 * scene.lines),
            tour: Scratch::bytes_for::<Leg>(scene.lines),
            matching: order::matching_bytes::<u16>(scene.odd_points),
        };
        assert!(memory.ports == 1 || memory.ports == 2, "there are one or two ports");
        assert!(
            scene.vertices <= memory.vertices && scene.corners <= memory.corners,
            "the model is too small"
        );
        let seeing = budget.view + budget.visibility + budget.lines;
        assert!(seeing <= budget.working, "no memory to find hidden lines in");
        let ordering = budget.drawing + budget.tour + budget.matching;
        assert!(ordering <= budget.working, "no memory to order strokes in");
        budget
    }
}

/// The memory budgets of all boards, in the order of their table.
pub const BUDGETS: [Budget; BOARDS.len()] = {
    let mut budgets = [Budget::of(BOARDS[0]); BOARDS.len()];
    let mut number = 1;
    while number < BOARDS.len() {
        budgets[number] = Budget::of(BOARDS[number]);
        number += 1;
    }
    budgets
};
