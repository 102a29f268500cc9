//! Joins faces that differ only by rounding, and hands over the finished solid.
//!
//! A face takes in its neighbours, and their neighbours, as long as each of their corners may lie
//! in its plane ([`are_coplanar`], within the precision) and they face the same way. The largest
//! face begins, because its plane is the most accurate. Errors do not accumulate along a chain of
//! faces: every corner is compared with the plane of the face that began. Faces whose union is not
//! one simple polygon stay separate.

use super::exact::{Plane, Point};
use super::faces::{HullEdge, Solid};
use super::{EdgeVisibility, Eye, SolidEdge, SolidError, SolidSink, SolidSummary};
use crate::array::MapEach;
use crate::geometry::{Precision, are_coplanar};
use crate::index::Index;
use crate::model::Corner;
use crate::stage::{Cancel, OutOfScratch, Scratch};

// Why no index in this file can fail:
// * `from`, `to`, the corners of faces and the vertices `inside` are numbers of `solid.points`,
//   because `FaceFinder` takes them all from the list of vertices. `next` and `corners` are as long
//   as `solid.points`.
// * Both faces of each edge are numbers of `solid.faces`: an edge leaves the perimeter only when it
//   gets a face that it lacks, and the outline does so twice; each search ends only when the
//   perimeter is empty. `joined` is as long as `solid.faces`.
// * `joined` holds numbers of faces, or `NONE`, which is only compared: `join_faces` goes on until
//   no face is undecided, so `hand_over` meets no `NONE`.

/// Joins faces of one solid that are meant to be one face and differ only by rounding.
#[derive(Debug)]
pub(super) struct Joining<'s, I> {
    /// The solid with triangles as faces, before those in one plane are joined.
    solid: Solid<'s, I>,
    /// Where the user looks from. It decides which faces are seen edge-on.
    eye: Eye,
    /// The eye, moved a little towards the solid, so that a face that is meant to be edge-on counts
    /// as hidden.
    drawn_in: Eye,
    /// For each face, the face that took it in, which may be the face itself.
    joined: &'s mut [I],
    /// For each vertex, the vertex that follows it around the face that is being handed over.
    next: &'s mut [I],
    /// The corners of the face that is being handed over.
    corners: &'s mut [Corner<I>],
}

impl<'s, I: Index> Joining<'s, I> {
    /// The working memory in bytes for a solid with this many vertices and faces.
    pub(super) const fn scratch_bytes(vertices: usize, faces: usize) -> usize {
        Scratch::bytes_for::<I>(faces)
            + Scratch::bytes_for::<I>(vertices)
            + Scratch::bytes_for::<Corner<I>>(vertices)
    }

    /// Prepares the joining of the faces of `solid`, each of which is still a face of its own.
    pub(super) fn new(
        solid: Solid<'s, I>,
        eye: Eye,
        drawn_in: Eye,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let joined = scratch.take::<I>(solid.faces.len())?;
        for (slot, face) in joined.iter_mut().zip(I::all()) {
            *slot = face;
        }
        Ok(Self {
            eye,
            drawn_in,
            joined,
            next: scratch.take(solid.points.len())?,
            corners: scratch.take(solid.points.len())?,
            solid,
        })
    }

    /// Returns the plane of a face as it was found, before it took in others. Its upper side is
    /// outside the solid.
    fn plane(&self, face: I) -> Plane {
        let [a, b, c] =
            self.solid.faces[face.get()].map_each(|number| self.solid.points[number.get()]);
        Plane::through(a, b, c)
    }

    /// Refuses vertices that lie deeper inside the solid than the precision. The others count as
    /// lying on a face.
    pub(super) fn check_convex(
        &mut self,
        precision: Precision,
        cancel: &mut dyn Cancel,
    ) -> Result<(), SolidError> {
        let mut deep = 0;
        let mut first = I::NONE;
        for number in self.solid.inside {
            cancel.check()?;
            let point = self.solid.points[number.get()];
            let faces = I::below(I::new(self.solid.faces.len()));
            let near =
                precision.written > 0 && { faces }.any(|face| self.is_near(face, point, precision));
            if !near {
                deep += 1;
                first = first.min(*number);
            }
        }
        if deep > 0 {
            return Err(SolidError::VertexInside { vertex: first.into(), count: deep });
        }
        self.solid.flat += self.solid.inside.len();
        Ok(())
    }

    /// Joins faces that differ by no more than the precision.
    pub(super) fn join_faces(
        &mut self,
        precision: Precision,
        cancel: &mut dyn Cancel,
    ) -> Result<(), SolidError> {
        if precision.written == 0 {
            return Ok(());
        }
        for edge in self.solid.edges {
            cancel.check()?;
            if self.is_almost_flat(edge, precision) {
                self.joined[edge.left().get()] = I::NONE;
                self.joined[edge.right().get()] = I::NONE;
            }
        }
        while let Some(first) = self.largest_undecided_face() {
            self.joined[first.get()] = first;
            let plane = self.plane(first);
            while self.take_in_neighbours(first, &plane, precision, cancel)? {}
            if self.go_around(first).is_none() {
                for (joined, face) in self.joined.iter_mut().zip(I::all()) {
                    if *joined == first && face != first {
                        *joined = I::NONE;
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether the two faces at an edge bend so little that one might take in the other.
    fn is_almost_flat(&self, edge: &HullEdge<I>, precision: Precision) -> bool {
        let (left, right) = (self.plane(edge.left()), self.plane(edge.right()));
        let near = |plane: I, face: I| {
            let corners = self.solid.faces[face.get()].iter();
            corners
                .map(|number| self.solid.points[number.get()])
                .all(|point| self.is_near(plane, point, precision))
        };
        left.is_turned_like(&right)
            && (near(edge.left(), edge.right()) || near(edge.right(), edge.left()))
    }

    /// Whether a point may lie in the plane of a face, within the precision.
    fn is_near(&self, face: I, point: Point, precision: Precision) -> bool {
        let [a, b, c] =
            self.solid.faces[face.get()].map_each(|number| self.solid.points[number.get()]);
        are_coplanar([a, b, c, point], precision)
    }

    /// Returns the largest of the faces that still have to be joined or kept.
    fn largest_undecided_face(&self) -> Option<I> {
        self.joined
            .iter()
            .zip(I::all())
            .filter(|(joined, _)| **joined == I::NONE)
            .map(|(_, face)| face)
            .max_by_key(|face| self.plane(*face).size())
    }

    /// Makes one pass over the edges and returns whether any face was taken in.
    fn take_in_neighbours(
        &mut self,
        first: I,
        plane: &Plane,
        precision: Precision,
        cancel: &mut dyn Cancel,
    ) -> Result<bool, SolidError> {
        let mut any = false;
        for edge in self.solid.edges {
            let sides = [edge.left(), edge.right()];
            let neighbour = match sides.map_each(|face| self.joined[face.get()]) {
                [inner, other] if inner == first && other == I::NONE => edge.right(),
                [other, inner] if inner == first && other == I::NONE => edge.left(),
                _ => continue,
            };
            cancel.check()?;
            if plane.is_turned_like(&self.plane(neighbour))
                && self.is_all_near(neighbour, first, precision)
            {
                self.joined[neighbour.get()] = first;
                any = true;
            }
        }
        Ok(any)
    }

    /// Whether all corners of a face may lie in the plane of the face `plane`.
    fn is_all_near(&self, face: I, plane: I, precision: Precision) -> bool {
        let near = |number: I| self.is_near(plane, self.solid.points[number.get()], precision);
        self.solid
            .edges
            .iter()
            .filter(|edge| edge.left() == face || edge.right() == face)
            .all(|edge| near(edge.from()) && near(edge.to()))
    }

    /// Writes the corners of a face to `corners` and returns their number. Returns `None` if the
    /// boundary of the face is not one simple polygon.
    fn go_around(&mut self, face: I) -> Option<usize> {
        self.next.fill(I::NONE);
        let mut count = 0;
        let mut start = None;
        for edge in self.solid.edges {
            let sides = [edge.left(), edge.right()];
            let (from, to) = match sides.map_each(|side| self.joined[side.get()] == face) {
                [true, false] => (edge.from(), edge.to()),
                [false, true] => (edge.to(), edge.from()),
                _ => continue,
            };
            let next = &mut self.next[from.get()];
            if *next != I::NONE {
                return None;
            }
            *next = to;
            start.get_or_insert(from);
            count += 1;
        }
        let start = start?;
        // `count` is the number of different vertices from which a side leads on, so `corners` has
        // as many, and it is at least 1 here.
        let mut at = start;
        for corner in &mut self.corners[..count] {
            if at == I::NONE {
                return None;
            }
            let next = self.next[at.get()];
            *corner = Corner::new(at, false, next == start);
            at = next;
        }
        let closed_at = self.corners[..count].iter().position(|corner| corner.is_last());
        (closed_at == Some(count - 1)).then_some(count)
    }

    /// Hands the faces and edges to the sink.
    pub(super) fn hand_over(
        &mut self,
        mut summary: SolidSummary,
        cancel: &mut dyn Cancel,
        sink: &mut dyn SolidSink<I>,
    ) -> Result<SolidSummary, SolidError> {
        for face in 0..self.solid.faces.len() {
            cancel.check()?;
            let number = I::new(face); // below 2^15
            if self.joined[face] != number {
                continue;
            }
            // There is always a boundary: exact faces are simple polygons, and the joined ones have
            // been checked.
            if let Some(count) = self.go_around(number) {
                sink.face(&self.corners[..count], self.is_visible(number))?;
                summary.faces += 1;
            }
        }
        // From here on `next` records which vertices are still corners.
        self.next.fill(I::NONE);
        for edge in self.solid.edges {
            let [left, right] =
                [edge.left(), edge.right()].map_each(|face| self.joined[face.get()]);
            if left == right {
                summary.joined += 1;
                continue;
            }
            self.next[edge.from().get()] = edge.to();
            self.next[edge.to().get()] = edge.from();
            sink.edge(SolidEdge {
                ends: (edge.from(), edge.to()),
                visibility: self.visibility(left, right),
            })?;
            summary.edges += 1;
        }
        let exact_corners = self.solid.edges.len() + 2 - self.solid.faces.len(); // Euler
        let corners = self.next.iter().filter(|next| **next != I::NONE).count();
        summary.flat = self.solid.flat + exact_corners - corners;
        Ok(summary)
    }

    /// Whether the eye, moved as the precision requires, sees the face from outside.
    fn is_visible(&self, face: I) -> bool {
        self.plane(face).height_of_eye(self.drawn_in) > 0
    }

    /// Returns the visibility of the edge between two faces.
    fn visibility(&self, left: I, right: I) -> EdgeVisibility {
        // A face that is neither visible nor turned away from the eye is edge-on.
        let edge_on = |face: I| self.plane(face).height_of_eye(self.eye) >= 0;
        match (self.is_visible(left), self.is_visible(right)) {
            (true, true) => EdgeVisibility::Visible,
            (false, false) if edge_on(left) || edge_on(right) => EdgeVisibility::BehindOutline,
            (false, false) => EdgeVisibility::Hidden,
            _ => EdgeVisibility::Outline,
        }
    }
}
