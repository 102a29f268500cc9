//! Tells which vertices lay in one plane, or on one line, before the camera rounded them.
//!
//! Rounding each vertex to view coordinates lifts the foot of a block off the floor on which it
//! stands and bends every face of more than three corners. Every test for coplanarity therefore
//! uses the coordinates of the model, within their precision: whether an edge lies in the plane of
//! a face that would hide it, whether two faces pass through each other, whether two blocks are
//! flush, and whether the faces at an edge lie in one plane.
//!
//! A vertex that does not belong to the model, such as one where the near plane cuts an edge, lies
//! in no plane.

use crate::array::MapEach;
use crate::geometry::{Precision, are_coplanar, are_in_line};
use crate::index::Index;
use crate::model::Corner;

/// The positions of the vertices in the model's own coordinates, as far as they are known.
#[derive(Debug, Clone, Copy)]
pub struct Unrounded<'a> {
    /// The positions by vertex number; vertices from its length on have no known position.
    positions: &'a [[i32; 3]],
    /// How far the positions may be off, in the same unit.
    precision: Precision,
    /// Twice the possible error of a view coordinate, at least 1.
    error_bound: u32,
}

impl<'a> Unrounded<'a> {
    /// No positions are known. Then the view coordinates are taken to be those of the model.
    pub const UNKNOWN: Unrounded<'static> =
        Unrounded { positions: &[], precision: Precision { written: 0, unit: 0 }, error_bound: 1 };

    /// The positions of the vertices by vertex number, each coordinate within ±2^30, and their
    /// precision in the same unit.
    ///
    /// `error_bound` is twice the possible error of a view coordinate, from both the precision of
    /// the model and the rounding of the view. It is at least 1.
    pub const fn new(positions: &'a [[i32; 3]], precision: Precision, error_bound: u32) -> Self {
        Self { positions, precision, error_bound }
    }

    /// Returns twice the possible error of a view coordinate.
    #[inline]
    pub(super) fn error_bound(&self) -> u32 {
        self.error_bound
    }

    /// Whether a vertex lies in the plane of a triangle in the model. The answer is no if one of
    /// the positions is unknown.
    #[cold]
    pub(super) fn holds<I: Index>(&self, triangle: [I; 3], vertex: I) -> bool {
        let [a, b, c] = triangle;
        match [a, b, c, vertex].map_each(|number| self.at(number)) {
            [Some(a), Some(b), Some(c), Some(d)] => are_coplanar([a, b, c, d], self.precision),
            _ => false,
        }
    }

    /// Whether a vertex lies on the line through a and b in the model. The answer is no if one of
    /// the positions is unknown.
    #[cold]
    pub(super) fn are_in_line<I: Index>(&self, a: I, b: I, vertex: I) -> bool {
        match [a, b, vertex].map_each(|number| self.at(number)) {
            [Some(a), Some(b), Some(c)] => are_in_line([a, b, c], self.precision),
            _ => false,
        }
    }

    /// Whether the two faces that share an edge lie in one plane in the model.
    #[inline(never)] // Only the choice of creases calls it.
    pub(super) fn are_one_plane<I: Index>(
        &self,
        edge: [I; 2],
        one: &[Corner<I>],
        other: &[Corner<I>],
    ) -> bool {
        let [from, to] = edge;
        let is_off = |corner: &&Corner<I>| !self.are_in_line(from, to, corner.vertex());
        one.iter().find(is_off).is_some_and(|third| {
            let triangle = [from, to, third.vertex()];
            let mut corners = other.iter().map(|corner| corner.vertex());
            corners.all(|corner| triangle.contains(&corner) || self.holds(triangle, corner))
        })
    }

    /// Returns the position of a vertex in the model, or `None` if it is unknown.
    fn at<I: Index>(&self, number: I) -> Option<[i32; 3]> {
        self.positions.get(number.get()).copied()
    }
}
