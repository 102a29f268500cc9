//! Tells which vertices lay in one plane, or on one line, before the camera rounded them.
//!
//! Rounding each vertex to view coordinates lifts the foot of a block off the floor on which it
//! stands and bends every face of more than three corners. Every test for coplanarity therefore
//! uses the coordinates of the model, within their precision: whether an edge lies in the plane of
//! a face that would hide it, whether two faces pass through each other, whether two blocks are
//! flush, and whether the faces at an edge lie in one plane.
//!
//! A vertex that is made of others, where the near plane cuts an edge or a chord of a curve ends,
//! has no position in the model. It lies in a plane if all that it is made of does. A plane through
//! such vertices is that of what they are made of.

use crate::array::MapEach;
use crate::geometry::{Precision, are_coplanar, are_in_line, doubled_area, extent};
use crate::index::Index;
use crate::model::{Corner, VertexSources};
use core::fmt::{self, Debug, Formatter};

/// The positions of the vertices in the model's own coordinates, as far as they are known.
#[derive(Clone, Copy)]
pub struct Unrounded<'a> {
    /// The positions by vertex number; vertices from its length on have none.
    positions: &'a [[i32; 3]],
    /// Of which vertices those are made that have no position, if that is known.
    sources: Option<&'a dyn VertexSources>,
    /// How far the positions may be off, in the same unit.
    precision: Precision,
    /// Twice the possible error of a view coordinate, at least 1.
    error_bound: u32,
}

impl<'a> Unrounded<'a> {
    /// No positions are known. Then the view coordinates are taken to be those of the model.
    pub const UNKNOWN: Unrounded<'static> =
        Unrounded::new(&[], Precision { written: 0, unit: 0 }, 1);

    /// The positions of the vertices by vertex number, each coordinate within ±2^30, and their
    /// precision in the same unit.
    ///
    /// `error_bound` is twice the possible error of a view coordinate, from both the precision of
    /// the model and the rounding of the view. It is at least 1.
    pub const fn new(positions: &'a [[i32; 3]], precision: Precision, error_bound: u32) -> Self {
        Self { positions, sources: None, precision, error_bound }
    }

    /// The same with what tells of which vertices those are made that have no position.
    #[must_use]
    pub const fn made_of(self, sources: &'a dyn VertexSources) -> Self {
        Self { sources: Some(sources), ..self }
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
        let triangle = triangle.map_each(Index::get);
        let Some([a, b, c]) = self.plane_of(triangle) else { return false };
        let is_known = triangle.iter().all(|corner| *corner < self.positions.len());
        let tested = triangle.into_iter().skip(if is_known { 3 } else { 0 });
        tested.chain([vertex.get()]).all(|number| {
            let mut count = 0;
            while let Some(d) = self.source(number, count) {
                if !are_coplanar([a, b, c, d], self.precision) {
                    return false;
                }
                count += 1;
            }
            count > 0
        })
    }

    /// Whether a vertex lies on the line through a and b in the model. The answer is no if one of
    /// them is no vertex of the model.
    #[cold]
    pub(super) fn are_in_line<I: Index>(&self, a: I, b: I, vertex: I) -> bool {
        let at = |number: I| self.positions.get(number.get()).copied();
        match [a, b, vertex].map_each(at) {
            [Some(a), Some(b), Some(c)] => are_in_line([a, b, c], self.precision),
            _ => false,
        }
    }

    /// Returns three points that span the plane of a triangle: its corners, or three that lie far
    /// apart of those that the corners are made of. Returns `None` if there is no such plane.
    #[inline(never)] // Inlined, its frame would take stack while the vertex is tested.
    fn plane_of(&self, triangle: [usize; 3]) -> Option<[[i32; 3]; 3]> {
        // The corners of a face are made of two vertices of the model at most.
        let mut points = heapless::Vec::<[i32; 3], 6>::new();
        for corner in triangle {
            points.push(self.source(corner, 0)?).ok()?;
            if let Some(other) = self.source(corner, 1) {
                points.push(other).ok()?;
            }
        }
        if let [a, b, c] = *points {
            return Some([a, b, c]);
        }
        let a = *points.first()?;
        let b = *points.iter().max_by_key(|b| extent(a, **b))?;
        let c = *points.iter().max_by_key(|c| doubled_area(a, b, **c))?;
        (doubled_area(a, b, c) > 0).then_some([a, b, c])
    }

    /// Returns the position of the vertex of the model with this index, counted from 0, among those
    /// that a vertex is made of; a vertex of the model is made of itself. Returns `None` beyond the
    /// last one, or if they are unknown.
    fn source(&self, number: usize, index: usize) -> Option<[i32; 3]> {
        let source = match number < self.positions.len() {
            true => Some(number).filter(|_| index == 0),
            false => self.sources?.source(number, index),
        };
        self.positions.get(source?).copied()
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
        let is_off = |corner: &&Corner<I>| {
            let vertex = corner.vertex();
            vertex != from && vertex != to && !self.are_in_line(from, to, vertex)
        };
        one.iter().find(is_off).is_some_and(|third| {
            let triangle = [from, to, third.vertex()];
            let mut corners = other.iter().map(|corner| corner.vertex());
            corners.all(|corner| triangle.contains(&corner) || self.holds(triangle, corner))
        })
    }
}

impl Debug for Unrounded<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Unrounded").field("precision", &self.precision).finish_non_exhaustive()
    }
}
