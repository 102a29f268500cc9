//! The profile of one edge: its pieces from p to q and, for each piece, what covers it, as far as
//! the search has got.

use crate::geometry::EdgeParameter;
use bytemuck::{Pod, Zeroable};

/// What may cover a piece of an edge, as bits that can be combined.
pub mod mark {
    /// A nearer face covers the points of the page just to the left.
    pub const LEFT: u64 = 1;
    /// A nearer face covers the points of the page just to the right.
    pub const RIGHT: u64 = 2;
    /// Nearer faces cover the points on both sides, so the piece is hidden.
    pub const HIDDEN: u64 = LEFT | RIGHT;
    /// Another edge on the same line of the page is drawn instead of this one.
    pub const ENCLOSED: u64 = 4;
}

/// A part of an edge, between two positions along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EdgeInterval {
    /// The start of the part; `None` if it begins at p.
    pub from: Option<EdgeParameter>,
    /// The end of the part; `None` if it ends at q.
    pub to: Option<EdgeParameter>,
}

impl EdgeInterval {
    /// The whole edge.
    pub const WHOLE: Self = Self { from: None, to: None };

    /// Returns the part of the edge that belongs to both parts.
    pub fn and(self, other: Self) -> Self {
        let both =
            |a: Option<EdgeParameter>,
             b: Option<EdgeParameter>,
             choose: fn(EdgeParameter, EdgeParameter) -> EdgeParameter| match (a, b) {
                (Some(a), Some(b)) => Some(choose(a, b)),
                (a, b) => a.or(b),
            };
        Self {
            from: both(self.from, other.from, EdgeParameter::max),
            to: both(self.to, other.to, EdgeParameter::min),
        }
    }

    /// Whether the part has no length.
    fn is_empty(self) -> bool {
        matches!((self.from, self.to), (Some(from), Some(to)) if from >= to)
    }
}

/// A piece of an edge. It extends from `from` to where the next piece begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ProfilePiece {
    /// Where on the edge the piece begins.
    pub from: EdgeParameter,
    /// The marks of the piece, see [`mark`]. The higher bits hold the ranks that `blocks` records.
    pub marks: u64,
}

/// What is known so far about the visibility of an edge: the pieces of a part of it, called the
/// window, and what covers each.
///
/// Adjacent pieces have different marks. The memory for the pieces is limited: when it is full, the
/// window is shortened to where the last piece began, and the rest of the edge is processed in
/// another window.
#[derive(Debug)]
pub struct Profile<'a> {
    /// The memory for the pieces, the first `count` of which are in use.
    // There are at least `FEWEST_PIECES` (see `Marks::new`), and `count` is from 1 to as many as
    // there are: `split` makes room before it adds a piece to a full memory, and `join` keeps one.
    // The pieces begin at ascending places.
    memory: &'a mut [ProfilePiece],
    /// The number of pieces in use.
    count: usize,
    /// Where on the edge the window ends, which is the part that is being processed.
    end: EdgeParameter,
}

/// The fewest pieces for which a profile must have room in order to make progress: the piece that
/// is being marked, what is before it and what is behind it.
pub const FEWEST_PIECES: usize = 4;

impl<'a> Profile<'a> {
    /// Creates a profile that stores its pieces in `memory`, which must have room for at least
    /// [`FEWEST_PIECES`].
    pub fn new(memory: &'a mut [ProfilePiece]) -> Self {
        let mut profile = Self { memory, count: 0, end: EdgeParameter::END };
        profile.open(EdgeParameter::START);
        profile
    }

    /// Restarts the window so that it extends from `start` to the end of the edge and nothing in it
    /// is covered.
    pub fn open(&mut self, start: EdgeParameter) {
        self.memory[0] = ProfilePiece { from: start, marks: 0 };
        self.count = 1;
        self.end = EdgeParameter::END;
    }

    /// Returns where on the edge the window (the part that is being processed) ends.
    pub fn end(&self) -> EdgeParameter {
        self.end
    }

    /// Whether the whole window (the part that is being processed) is hidden, so that no further
    /// mark can change it.
    pub fn is_hidden(&self) -> bool {
        self.count == 1 && self.memory[0].marks == mark::HIDDEN
    }

    /// Returns the pieces of the window (the part of the edge that is being processed), in order
    /// from p to q.
    pub fn pieces(&self) -> &[ProfilePiece] {
        &self.memory[..self.count]
    }

    /// Adds `marks` to the pieces of a part of the edge, for example that a face hides it.
    pub fn mark(&mut self, part: EdgeInterval, marks: u64) {
        self.update(part, &|known| known | marks);
    }

    /// Changes the marks of the pieces of a part of the edge by `change`.
    #[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
    pub fn update(&mut self, part: EdgeInterval, change: &dyn Fn(u64) -> u64) {
        if part.is_empty() || part.to.is_some_and(|to| to <= self.memory[0].from) {
            return;
        }
        let first = part.from.map_or(0, |from| self.split(from));
        let last = part.to.map_or(self.count, |to| self.split(to));
        // `first` pieces begin before the part does, and so before its end. The second `split`
        // returns how many begin before the end, of those that it has left. So the limits are in
        // order.
        for piece in &mut self.memory[first.min(self.count)..last.min(self.count)] {
            piece.marks = change(piece.marks);
            if piece.marks & mark::HIDDEN == mark::HIDDEN {
                piece.marks = mark::HIDDEN;
            }
        }
        self.join(first);
    }

    /// Splits the piece that contains `position` in two, so that a piece begins there, if
    /// `position` lies within the window. Returns the index of the first piece that begins at
    /// `position` or later; the number of pieces if there is none.
    fn split(&mut self, position: EdgeParameter) -> usize {
        if position >= self.end {
            return self.count;
        }
        // `after` is at most `count`. Behind the returns below it is not zero and still at most
        // `count`, and a full memory has lost a piece, so there is room for one at `after`.
        let after = self.memory[..self.count].partition_point(|piece| piece.from < position);
        if after == 0 || after < self.count && self.memory[after].from == position {
            return after;
        }
        if self.count == self.memory.len() {
            self.count -= 1;
            self.end = self.memory[self.count].from;
            if after > self.count {
                return self.count;
            }
        }
        let marks = self.memory[after - 1].marks;
        self.memory.copy_within(after..self.count, after + 1);
        self.memory[after] = ProfilePiece { from: position, marks };
        self.count += 1;
        after
    }

    /// Joins adjacent pieces with the same marks, starting with the piece before `first`.
    fn join(&mut self, first: usize) {
        let mut kept = first.saturating_sub(1);
        for next in kept + 1..self.count {
            if self.memory[next].marks != self.memory[kept].marks {
                kept += 1;
                self.memory[kept] = self.memory[next];
            }
        }
        self.count = self.count.min(kept + 1);
    }
}
