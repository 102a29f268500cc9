//! The memory budget of each board, checked at compile time.
//!
//! For the largest scene that a board must be able to draw, a [`Budget`] adds up what the stages of
//! a job need. The library does not compile if that exceeds the board's working memory.

use super::memory::{Lm3s6965Memory, Memory, PicoMemory};
use crate::drawing::{PackedLine, PagePoint, Segment};
use crate::geometry::Vertex;
use crate::order::{self, Leg};
use crate::stage::Scratch;
use crate::visibility;
use core::marker::PhantomData;

/// The largest scene that a board must be able to draw, and the size of the drawing that results
/// from it.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Number of vertices of the model.
    pub vertices: usize,
    /// Number of corners of all faces together.
    pub corners: usize,
    /// Number of faces; each is triangulated as a fan.
    pub faces: usize,
    /// Number of lines of the drawing, with hidden lines erased.
    pub lines: usize,
    /// Number of odd points (of odd degree) of a drawing for which the exact matching must still
    /// fit.
    pub odd_points: usize,
}

/// The capacities of a board, and the memory in bytes that its largest scene needs.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    /// The board's name.
    pub board: &'static str,
    /// Number of vertices that the model can hold.
    pub vertex_limit: usize,
    /// Number of face corners and bar ends that the model can hold.
    pub corner_limit: usize,
    /// Size of the model's memory, in bytes.
    pub model: usize,
    /// Size of the working memory, in bytes. The stages use it one after the other.
    pub working: usize,
    /// Bytes for the vertices in view coordinates. They are held while hidden lines are found.
    pub view: usize,
    /// The fewest bytes with which hidden lines can be found. More memory makes the search faster.
    pub visibility: usize,
    /// Bytes for the lines that the search finds.
    pub lines: usize,
    /// Bytes for the drawing on the page. It is held until it has been drawn.
    pub drawing: usize,
    /// Bytes for the order of the strokes. It is held until the drawing has been drawn, too.
    pub tour: usize,
    /// Bytes for the exact matching of the odd points.
    pub matching: usize,
}

impl Budget {
    const fn new<
        const VERTICES: usize,
        const CORNERS: usize,
        const WORDS: usize,
        const PORTS: usize,
    >(
        board: &'static str,
        _: PhantomData<Memory<VERTICES, CORNERS, WORDS, PORTS>>,
        scene: Scene,
    ) -> Self {
        let budget = Self {
            board,
            vertex_limit: VERTICES,
            corner_limit: CORNERS,
            model: size_of::<Memory<VERTICES, CORNERS, 0, 0>>(),
            working: 8 * WORDS,
            view: Scratch::bytes_for::<Vertex>(scene.vertices),
            visibility: visibility::least_bytes(scene.vertices, scene.corners, scene.faces),
            lines: Scratch::bytes_for::<PackedLine>(scene.lines),
            // A line adds at most two new points.
            drawing: Scratch::bytes_for::<Segment>(scene.lines)
                + Scratch::bytes_for::<PagePoint>(2 * scene.lines),
            tour: Scratch::bytes_for::<Leg>(scene.lines),
            matching: order::matching_bytes(scene.odd_points),
        };
        assert!(scene.vertices <= VERTICES && scene.corners <= CORNERS, "the model is too small");
        let seeing = budget.view + budget.visibility + budget.lines;
        assert!(seeing <= budget.working, "no memory to find hidden lines in");
        let ordering = budget.drawing + budget.tour + budget.matching;
        assert!(ordering <= budget.working, "no memory to order strokes in");
        budget
    }
}

/// The budgets of all boards.
pub const BUDGETS: [Budget; 2] = [
    Budget::new(
        "lm3s6965",
        PhantomData::<Lm3s6965Memory>,
        Scene { vertices: 1000, corners: 3000, faces: 750, lines: 820, odd_points: 400 },
    ),
    Budget::new(
        "pico",
        PhantomData::<PicoMemory>,
        Scene { vertices: 2744, corners: 8232, faces: 2058, lines: 1871, odd_points: 1000 },
    ),
];
