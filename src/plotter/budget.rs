//! What each stage of a job takes of a board's working memory, checked when the library is compiled.

use super::memory::{Lm3s6965Memory, Memory, PicoMemory};
use crate::drawing::{PackedLine, PagePoint, Segment};
use crate::geometry::Vertex;
use crate::order::{self, Leg};
use crate::stage::Scratch;
use crate::visibility;
use core::marker::PhantomData;

/// The largest scene that a board must hold, and what comes of it.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Its vertices.
    pub vertices: usize,
    /// Corners of its faces.
    pub corners: usize,
    /// Its faces, each cut by a fan.
    pub faces: usize,
    /// Lines of its drawing, hidden ones erased.
    pub lines: usize,
    /// Odd points for which the pen-up moves are the best there are.
    pub odd_points: usize,
}

/// What a board has, and what its largest scene takes, in bytes.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    /// The board's name.
    pub board: &'static str,
    /// Vertices that the model can have.
    pub vertex_limit: usize,
    /// Corners of faces and ends of bars that the model can have.
    pub corner_limit: usize,
    /// All of the model.
    pub model: usize,
    /// All of the working memory, which the stages use one after the other.
    pub working: usize,
    /// Vertices in view coordinates: stay while hidden lines are found.
    pub view: usize,
    /// The least with which hidden lines are found; what is left makes it faster.
    pub visibility: usize,
    /// Lines as they are found.
    pub lines: usize,
    /// The drawing on the page: stays until it is drawn.
    pub drawing: usize,
    /// The order of its strokes: stays, too.
    pub tour: usize,
    /// The exact matching of the odd points.
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
            // A line has at most two points of its own.
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

/// Every board's.
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
