//! The memory for the points of a polygon, which has room for as many as a file may have.
//!
//! A plotter looks for each crossing of a line of a fill among all edges. Here the edges that a
//! line crosses are listed, and they are found by going upward through all edges in the order of
//! their lower ends. The crossings are the same, so the fill is, too.

use penup::hpgl::{PolygonBuffer, Vertex};

/// The most points of a polygon, with those that close its parts. They take 8 MB, and their edges
/// up to 64 MB while they are filled.
pub(super) const MOST_VERTICES: usize = 1_000_000;

/// An edge that the lines of a fill reach or have reached.
#[derive(Debug, Clone, Copy)]
struct Span {
    low: i64,
    high: i64,
    /// The index of the edge's end.
    index: usize,
}

/// The points of a polygon, and what of its edges is sorted for a fill.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    vertices: Vec<Vertex>,
    /// The edges that begin above the present line, the lowest last.
    waiting: Vec<Span>,
    /// The edges that begin at the present line or below it, and end above it.
    active: Vec<Span>,
    /// Where the present line lies, and its crossings.
    line: Option<i64>,
    crossings: Vec<(i64, usize)>,
}

impl PolygonBuffer for Vertices {
    fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    fn put(&mut self, index: usize, vertex: Vertex) -> bool {
        if index >= MOST_VERTICES {
            return false;
        }
        self.vertices.truncate(index);
        self.vertices.push(vertex);
        true
    }

    fn begin_fill(&mut self, span: impl Fn(&[Vertex], usize) -> Option<[i64; 2]>) {
        self.active.clear();
        self.line = None;
        self.waiting.clear();
        let spans = (0..self.vertices.len()).filter_map(|index| {
            let [low, high] = span(&self.vertices, index)?;
            Some(Span { low, high, index })
        });
        self.waiting.extend(spans);
        self.waiting.sort_unstable_by_key(|span| std::cmp::Reverse((span.low, span.index)));
    }

    fn crossings_at(
        &mut self,
        y: i64,
        crossing: impl Fn(&[Vertex], usize) -> Option<i64>,
    ) -> Option<&[(i64, usize)]> {
        if self.line != Some(y) {
            self.line = Some(y);
            while let Some(span) = self.waiting.pop_if(|span| span.low <= y) {
                self.active.push(span);
            }
            self.active.retain(|span| span.high > y);
            let found = self
                .active
                .iter()
                .filter_map(|&Span { index, .. }| Some((crossing(&self.vertices, index)?, index)));
            self.crossings.clear();
            self.crossings.extend(found);
            self.crossings.sort_unstable();
        }
        Some(&self.crossings)
    }
}
