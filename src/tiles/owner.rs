//! Which edges and seams of a loaded part are followed.

use super::load::Loaded;
use super::page::Rectangle;
use crate::geometry::Vertex;
use crate::visibility::Ownership;

/// The edges and seams of a tile.
///
/// An edge belongs to the tile that holds the lower left corner of the rectangle around it, a seam
/// to the one that holds that of the intersection of the rectangles around its two faces.
pub(super) struct OfTile<'o> {
    /// The points of the tile.
    pub tile: Rectangle,
    /// The greatest extent of an edge, and of one of the two faces of a seam. Longer edges, and the
    /// seams of two larger faces, are left to be followed one by one.
    pub limit: Option<[u16; 2]>,
    /// Whether all faces count as large, because a seam may lie too far beside them.
    pub no_small_faces: bool,
    /// The elements that have been loaded.
    pub loaded: &'o Loaded<'o>,
    /// The depth at which the model is cut.
    pub near: Option<i32>,
}

impl Ownership<u16> for OfTile<'_> {
    fn owns_edge(&mut self, ends: [u16; 2]) -> bool {
        let Some([a, b]) = self.loaded.places(ends) else { return false };
        let bounds = Rectangle::around(a, b);
        self.tile.holds(bounds.low)
            && self.limit.is_none_or(|limit| bounds.is_within(limit))
            && !self.loaded.is_cut(ends, self.near)
    }

    fn owns_pair(&mut self, firsts: [usize; 2]) -> bool {
        let [one, other] = firsts.map(|first| self.loaded.bounds(first));
        let is_small =
            |limit| !self.no_small_faces && (one.is_within(limit) || other.is_within(limit));
        one.intersection(other).is_some_and(|both| self.tile.holds(both.low))
            && self.limit.is_none_or(is_small)
    }

    fn owns_seam(&mut self, _: [Vertex; 2]) -> bool {
        true
    }
}

/// A single edge, given by its two ends in either order.
pub(super) struct OneEdge(pub [u16; 2]);

impl Ownership<u16> for OneEdge {
    fn owns_edge(&mut self, ends: [u16; 2]) -> bool {
        let [a, b] = self.0;
        ends == [a, b] || ends == [b, a]
    }

    fn owns_pair(&mut self, _: [usize; 2]) -> bool {
        false
    }

    fn owns_seam(&mut self, _: [Vertex; 2]) -> bool {
        false
    }
}

/// A single one of the seams of two faces.
pub(super) struct OneSeam {
    /// Where the two faces begin.
    pub firsts: [usize; 2],
    /// Which of their seams it is, in the order in which they are found.
    pub number: usize,
    /// The number of seams of the two faces that have been found.
    pub found: usize,
    /// Whether to follow it, not only to find it.
    pub is_followed: bool,
    /// The ends of the seam, once it has been found.
    pub ends: Option<[Vertex; 2]>,
}

impl OneSeam {
    /// Makes the seam with this number of two faces.
    pub fn new(firsts: [usize; 2], number: usize, is_followed: bool) -> Self {
        Self { firsts, number, found: 0, is_followed, ends: None }
    }
}

impl Ownership<u16> for OneSeam {
    fn owns_edge(&mut self, _: [u16; 2]) -> bool {
        false
    }

    fn owns_pair(&mut self, [a, b]: [usize; 2]) -> bool {
        self.firsts == [a, b] || self.firsts == [b, a]
    }

    fn owns_seam(&mut self, ends: [Vertex; 2]) -> bool {
        let is_it = self.found == self.number;
        self.found += 1;
        if is_it {
            self.ends = Some(ends);
        }
        is_it && self.is_followed
    }
}
