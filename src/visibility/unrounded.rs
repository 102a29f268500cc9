//! What lies in one plane, or in one line, before the camera rounded it.
//!
//! Rounding each vertex to view coordinates takes a block's foot off the floor on which it stands and
//! bends every face of more than three corners. So whoever asks whether things are coplanar asks
//! here, on the coordinates of the model and within their precision: whether an edge lies in the
//! plane of a face that would hide it, whether two faces pass through each other, whether two
//! blocks are flush, whether the faces at an edge are one plane.
//!
//! A vertex that is not of the model, such as one where an edge is cut at the eye, lies in no plane.

use crate::geometry::{Precision, are_coplanar, are_in_line};
use crate::model::Corner;

/// The vertices in the model's own space, as far as known.
#[derive(Debug, Clone, Copy)]
pub struct Unrounded<'a> {
    positions: &'a [[i32; 3]],
    precision: Precision,
    error_bound: u32,
}

impl<'a> Unrounded<'a> {
    /// Nothing is known: view coordinates are taken to be the model's.
    pub const UNKNOWN: Unrounded<'static> =
        Unrounded { positions: &[], precision: Precision { written: 0, unit: 0 }, error_bound: 1 };

    /// Each vertex by its number, within ±2^30, with a precision in the same unit.
    ///
    /// `doubt`: twice what a view coordinate may be off, by the precision and by its own rounding;
    /// at least 1.
    pub const fn new(positions: &'a [[i32; 3]], precision: Precision, error_bound: u32) -> Self {
        Self { positions, precision, error_bound }
    }

    /// Twice what a view coordinate may be off.
    #[inline]
    pub(super) fn error_bound(&self) -> u32 {
        self.error_bound
    }

    /// Whether the plane of a triangle holds a vertex.
    #[cold]
    pub(super) fn holds(&self, triangle: [u16; 3], vertex: u16) -> bool {
        let [a, b, c] = triangle;
        match [a, b, c, vertex].map(|number| self.at(number)) {
            [Some(a), Some(b), Some(c), Some(d)] => are_coplanar([a, b, c, d], self.precision),
            _ => false,
        }
    }

    /// Whether the line through a and b holds a vertex.
    #[cold]
    pub(super) fn are_in_line(&self, a: u16, b: u16, vertex: u16) -> bool {
        match [a, b, vertex].map(|number| self.at(number)) {
            [Some(a), Some(b), Some(c)] => are_in_line([a, b, c], self.precision),
            _ => false,
        }
    }

    /// Whether the two faces at an edge lie in one plane.
    #[inline(never)] // Only creases ask.
    pub(super) fn are_one_plane(&self, edge: [u16; 2], one: &[Corner], other: &[Corner]) -> bool {
        let [from, to] = edge;
        let is_off = |corner: &&Corner| !self.are_in_line(from, to, corner.vertex());
        one.iter().find(is_off).is_some_and(|third| {
            let triangle = [from, to, third.vertex()];
            let mut corners = other.iter().map(|corner| corner.vertex());
            corners.all(|corner| triangle.contains(&corner) || self.holds(triangle, corner))
        })
    }

    fn at(&self, number: u16) -> Option<[i32; 3]> {
        self.positions.get(usize::from(number)).copied()
    }
}
