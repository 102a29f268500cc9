//! Finds the faces and edges of a convex solid from its vertices alone (Harrison, chapter 3).
//!
//! The outline is found first. Its segments are the first *perimeter*: the list of directed
//! segments that each have one face still to be found, on their left as seen from outside. One
//! segment is taken and its face found. The sides of the face cancel the equal segments of the
//! perimeter; the other sides join the perimeter, reversed (3.2.5). The perimeter may fall into
//! several loops (3.6). When it is empty, all visible faces are found; the reversed outline then
//! leads to the hidden ones (3.2.6).
//!
//! This differs from the programs in Harrison's appendix 3 in two points:
//! * *Valid third vertices* (3.3): he requires vertices to the left of the segment on the page. No
//!   vertex of an edge-on face is, so his program misses such a face. Here the search uses that all
//!   vertices lie in a wedge about the edge whose two sides are its two faces. Turning a plane
//!   counter-clockwise about the directed edge ends on the face that is sought, whatever the page
//!   shows.
//! * *Vertices that drop out* (3.4): he drops a vertex when two of its segments cancel. A vertex
//!   where two loops of the perimeter touch would then be missing from the second loop. Here a
//!   vertex drops out with its last segment.

use crate::array::MapEach;
use crate::index::Index;
use bytemuck::{Pod, Zeroable};

use super::exact::{Plane, Point, Viewpoint};
use super::joined::Joining;
use super::points::{self, Span};
use super::polygon::Polygon;
use super::{EdgeVisibility, Eye, SolidEdge, SolidError, SolidSink, SolidSummary};
use crate::geometry::Precision;
use crate::model::Corner;
use crate::stage::{Cancel, Scratch};

/// The number of vertices that are tested between two checks for cancelling.
const VERTICES_PER_CHECK: usize = 64;

/// An edge with its two faces: the vertices at which it begins and ends, and the faces on its left
/// and right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct HullEdge<I>([I; 4]);

impl<I: Index> HullEdge<I> {
    /// Makes the edge between two vertices, with the faces on its left and right. A face that has
    /// not been found yet is [`Index::NONE`].
    fn new([from, to]: [I; 2], [left, right]: [I; 2]) -> Self {
        Self([from, to, left, right])
    }

    /// Returns the vertex at which the edge begins.
    pub(super) fn from(&self) -> I {
        self.0[0]
    }

    /// Returns the vertex at which the edge ends.
    pub(super) fn to(&self) -> I {
        self.0[1]
    }

    /// Returns the face on the left, as seen from outside, or [`Index::NONE`].
    pub(super) fn left(&self) -> I {
        self.0[2]
    }

    /// Returns the face on the right, as seen from outside, or [`Index::NONE`].
    pub(super) fn right(&self) -> I {
        self.0[3]
    }
}

/// A face, as three of its corners, which are counter-clockwise from outside and well spread around
/// it.
pub(super) type FaceCorners<I> = [I; 3];

/// Finds the faces and edges of the convex solid whose corners are `positions`, and hands them to
/// `sink`.
///
/// `precision` says how far the positions may be off (see the module documentation).
///
/// # Errors
/// See [`SolidError`].
///
/// ```
/// use penup::convex::*;
/// use penup::geometry::Precision;
/// use penup::model::Corner;
/// use penup::stage::{Scratch, NeverCancel};
///
/// #[derive(Default)]
/// struct Count { visible_faces: usize, hidden_edges: usize }
/// impl SolidSink for Count {
///     fn face(&mut self, corners: &[Corner], visible: bool) -> Result<(), SinkFull> {
///         assert_eq!(corners.len(), 4);
///         self.visible_faces += usize::from(visible);
///         Ok(())
///     }
///     fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull> {
///         self.hidden_edges += usize::from(edge.visibility == EdgeVisibility::Hidden);
///         Ok(())
///     }
/// }
/// let cube = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| [i & 1, i >> 1 & 1, i >> 2]);
/// let mut words = vec![0; scratch_bytes_from_vertices::<u16>(8) / 8];
/// let mut count = Count::default();
/// let eye = Eye::At([5, 4, 3]);
/// let (exact, scratch) = (Precision::default(), Scratch::new(&mut words));
/// let summary = from_vertices(&cube, eye, exact, scratch, &mut NeverCancel, &mut count)?;
/// assert_eq!((summary.faces, summary.edges), (6, 12));
/// assert_eq!((count.visible_faces, count.hidden_edges), (3, 3));
/// # Ok::<(), SolidError>(())
/// ```
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub fn from_vertices<I: Index>(
    positions: &[[i32; 3]],
    eye: Eye,
    precision: Precision,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn SolidSink<I>,
) -> Result<SolidSummary, SolidError> {
    eye.check()?;
    points::check::<I>(positions)?;
    let numbers = scratch.take::<I>(positions.len())?;
    for (slot, number) in numbers.iter_mut().zip(I::all()) {
        *slot = number;
    }
    let distinct = points::weld(positions, numbers);
    let numbers = numbers.get_mut(..distinct).unwrap_or_default();
    let summary = SolidSummary { welded: positions.len() - distinct, ..SolidSummary::default() };
    if distinct < 4 {
        return Err(SolidError::TooFewVertices { distinct });
    }
    match points::span(positions, numbers) {
        Span::Line => Err(SolidError::AllInLine),
        Span::Plane(triangle) => {
            flat_solid(positions, numbers, triangle, eye, scratch, sink, summary)
        }
        Span::Space(inside) => {
            let mut scratch = scratch.reborrow();
            let drawn_in = points::drawn_in_eye(eye, positions, numbers, precision);
            let mut search =
                FaceFinder::new(positions, eye, inside, numbers, &mut scratch, cancel)?;
            search.find_all_faces(cancel)?;
            let mut joining = Joining::new(search.into_solid(), eye, drawn_in, &mut scratch)?;
            joining.check_convex(precision, cancel)?;
            joining.join_faces(precision, cancel)?;
            joining.hand_over(summary, cancel, sink)
        }
    }
}

/// Returns the bytes of working memory that [`from_vertices`] takes for this number of vertices.
pub const fn scratch_bytes_from_vertices<I: Index>(vertices: usize) -> usize {
    let edges = most_edges(vertices);
    let faces = most_faces(vertices);
    4 * Scratch::bytes_for::<I>(vertices)
        + Scratch::bytes_for::<I>(edges)
        + Scratch::bytes_for::<HullEdge<I>>(edges)
        + Scratch::bytes_for::<I>(3 * faces)
        + Joining::<I>::scratch_bytes(vertices, faces)
}

/// Returns the greatest possible number of edges. By Euler v - e + f = 2, and every face has at
/// least three edges.
const fn most_edges(vertices: usize) -> usize {
    (3 * vertices).saturating_sub(6)
}

/// Returns the greatest possible number of faces, by the same formula.
const fn most_faces(vertices: usize) -> usize {
    (2 * vertices).saturating_sub(4)
}

/// Hands over the one polygon that vertices in one plane form. It hides nothing, and it is seen
/// from either side.
fn flat_solid<I: Index>(
    points: &[Point],
    numbers: &[I],
    triangle: [I; 3],
    eye: Eye,
    mut scratch: Scratch<'_>,
    sink: &mut dyn SolidSink<I>,
    summary: SolidSummary,
) -> Result<SolidSummary, SolidError> {
    let [a, mut b, mut c] = triangle;
    let plane =
        |[a, b, c]: [I; 3]| Plane::through(points[a.get()], points[b.get()], points[c.get()]);
    if plane([a, b, c]).height_of_eye(eye) < 0 {
        (b, c) = (c, b);
    }
    let room = scratch.take::<I>(numbers.len())?;
    let viewpoint = Viewpoint { eye: plane([a, b, c]).eye_above(), inside: None };
    let mut polygon = Polygon::triangle(room, points, &viewpoint, [a, b, c]);
    for number in numbers {
        polygon.enclose(points, &viewpoint, *number).map_err(|_| SolidError::EyeInside)?;
    }
    let corners = polygon.corners();
    let marked = scratch.take::<Corner<I>>(corners.len())?; // one for each `at`
    for (at, corner) in corners.iter().enumerate() {
        marked[at] = Corner::new(*corner, false, at + 1 == corners.len());
    }
    sink.face(marked, true)?;
    for (from, to) in sides(corners) {
        sink.edge(SolidEdge { ends: (from, to), visibility: EdgeVisibility::Outline })?;
    }
    Ok(SolidSummary {
        faces: 1,
        edges: corners.len(),
        flat: numbers.len() - corners.len(),
        ..summary
    })
}

/// Iterates over the sides: from each corner to the next, and from the last to the first.
fn sides<I: Index>(corners: &[I]) -> impl Iterator<Item = (I, I)> + Clone {
    let next = corners.iter().skip(1).chain(corners.first());
    corners.iter().copied().zip(next.copied())
}

/// The solid as it was found exactly, before faces are joined.
#[derive(Debug)]
pub(super) struct Solid<'s, I> {
    /// The position of each vertex.
    pub(super) points: &'s [Point],
    /// The edges. Each has both its faces.
    pub(super) edges: &'s [HullEdge<I>],
    /// The faces, by three corners each.
    pub(super) faces: &'s [FaceCorners<I>],
    /// The vertices that are corners of no face. They lie inside the solid, or a solid with them is
    /// not convex.
    pub(super) inside: &'s [I],
    /// The number of vertices in the middle of a face or an edge.
    pub(super) flat: usize,
}

// No index can fail. Vertices are numbers of `points`; edges and faces are numbered as they are
// found. All tests are exact, so each face and each edge of the solid is found once. By Euler they
// are at most as many as `faces` and `edges` hold, and the perimeter holds different edges. The
// candidates are different vertices, because a corner of the outline has left them with its last
// segment before it is added again; so they fit, as do those `on_plane`. A segment of the perimeter
// lacks a face, whose corners are candidates still: at least three vertices are `on_plane`.

/// Finds the faces of a solid, one after the other, as Harrison does. It holds what is found so
/// far.
struct FaceFinder<'s, I> {
    /// The position of each vertex.
    points: &'s [Point],
    /// The vertices that may be corners of faces still to be found. This is Harrison's vertices
    /// list.
    candidates: &'s mut [I],
    /// How many entries of `candidates` are in use, from the first on.
    candidate_count: usize,
    /// The numbers of the edges with one face still to be found in this pass. This is Harrison's
    /// current perimeter list.
    perimeter: &'s mut [I],
    /// How many entries of `perimeter` are in use, from the first on.
    perimeter_count: usize,
    /// For each vertex, the number of segments of the perimeter that begin there. As many end
    /// there.
    segments_from: &'s mut [I],
    /// The edges found so far, those of the outline first.
    edges: &'s mut [HullEdge<I>],
    /// How many entries of `edges` are in use, from the first on.
    edge_count: usize,
    /// How many of the edges belong to the outline. They come first.
    outline_count: usize,
    /// The faces found so far.
    faces: &'s mut [FaceCorners<I>],
    /// How many entries of `faces` are in use, from the first on.
    face_count: usize,
    /// The vertices that lie in the plane of the face that is being found.
    on_plane: &'s mut [I],
    /// Memory in which the corners of that face are put in order.
    room: &'s mut [I],
    /// How many vertices were found in the middle of a face or an edge, and so are no corners.
    flat: usize,
}

impl<'s, I: Index> FaceFinder<'s, I> {
    /// Finds the outline (the edge of the solid as the eye sees it), from which the search starts.
    fn new(
        points: &'s [Point],
        eye: Eye,
        inside: [I; 4],
        candidates: &'s mut [I],
        scratch: &mut Scratch<'s>,
        cancel: &mut dyn Cancel,
    ) -> Result<Self, SolidError> {
        let viewpoint =
            Viewpoint { eye, inside: Some(inside.map_each(|number| points[number.get()])) };
        let count = candidates.len();
        let room = scratch.take::<I>(count)?;
        let perimeter = scratch.take::<I>(most_edges(count))?;
        let segments_from = scratch.take::<I>(points.len())?;
        let edges = scratch.take::<HullEdge<I>>(most_edges(count))?;
        // Three numbers for each face, so the cast cannot fail.
        let faces = bytemuck::cast_slice_mut(scratch.take::<I>(3 * most_faces(count))?);
        let on_plane = scratch.take::<I>(count)?;
        let [a, b, c, _] = inside;
        let mut outline = Polygon::triangle(room, points, &viewpoint, [a, b, c]);
        for number in candidates.iter() {
            cancel.check()?;
            outline.enclose(points, &viewpoint, *number).map_err(|_| SolidError::EyeInside)?;
        }
        let outline_count = outline.corners().len();
        for (number, (from, to)) in sides(outline.corners()).enumerate() {
            edges[number] = HullEdge::new([from, to], [I::NONE; 2]);
        }
        let mut search = Self {
            points,
            candidates,
            candidate_count: count,
            perimeter,
            perimeter_count: 0,
            segments_from,
            edges,
            edge_count: outline_count,
            outline_count,
            faces,
            face_count: 0,
            on_plane,
            room: outline.into_room(),
            flat: 0,
        };
        search.begin_with_outline();
        Ok(search)
    }

    /// Makes the outline the perimeter, so that the faces on one side of it are found from there.
    fn begin_with_outline(&mut self) {
        for number in 0..self.outline_count {
            self.perimeter[number] = I::new(number); // fewer than there are vertices
            self.segments_from[self.edges[number].from().get()] = I::ONE;
        }
        self.perimeter_count = self.outline_count;
    }

    /// Finds the visible faces and then the hidden ones.
    fn find_all_faces(&mut self, cancel: &mut dyn Cancel) -> Result<(), SolidError> {
        while self.perimeter_count > 0 {
            self.find_face(0, cancel)?;
        }
        self.turn_to_hidden_faces();
        while self.perimeter_count > 0 {
            self.find_face(0, cancel)?;
        }
        Ok(())
    }

    /// Makes the outline the perimeter again, to find the hidden faces. All visible faces are
    /// found, so of their corners only those on the outline belong to more faces.
    fn turn_to_hidden_faces(&mut self) {
        for edge in &self.edges[..self.outline_count] {
            self.candidates[self.candidate_count] = edge.from();
            self.candidate_count += 1;
        }
        self.begin_with_outline();
    }

    /// Ends the search and returns what it found. The vertices that are still candidates lie on no
    /// face.
    fn into_solid(self) -> Solid<'s, I> {
        Solid {
            points: self.points,
            edges: &self.edges[..self.edge_count],
            faces: &self.faces[..self.face_count],
            inside: &self.candidates[..self.candidate_count],
            flat: self.flat,
        }
    }

    /// Returns a segment of the perimeter, directed so that the face still to be found is on its
    /// left.
    fn segment(&self, at: usize) -> (I, I) {
        let edge = self.edges[self.perimeter[at].get()];
        if edge.left() == I::NONE { (edge.from(), edge.to()) } else { (edge.to(), edge.from()) }
    }

    /// Returns the position of a vertex.
    fn point(&self, number: I) -> Point {
        self.points[number.get()]
    }

    /// Finds the face to the left of one segment of the perimeter and updates the perimeter.
    fn find_face(&mut self, at: usize, cancel: &mut dyn Cancel) -> Result<(), SolidError> {
        let (from, to) = self.segment(at);
        let on_plane_count = self.find_plane(from, to, cancel)?;
        let third = self.on_plane[2];
        let viewpoint = Viewpoint {
            eye: Plane::through(self.point(from), self.point(to), self.point(third)).eye_above(),
            inside: None,
        };
        // The memory is moved out of `self` while the perimeter changes.
        let room = core::mem::take(&mut self.room);
        let mut polygon = Polygon::triangle(room, self.points, &viewpoint, [from, to, third]);
        for number in &self.on_plane[3..on_plane_count] {
            polygon.enclose(self.points, &viewpoint, *number).map_err(|_| SolidError::EyeInside)?;
        }
        polygon.begin_with(from);
        let corners = polygon.corners();
        let face = I::new(self.face_count); // below 2^15
        let spread = corners.len() / 3; // a polygon has 3 corners at least
        self.faces[self.face_count] = [corners[0], corners[spread], corners[2 * spread]];
        self.face_count += 1;
        self.flat += on_plane_count - corners.len();
        for (from, to) in sides(corners) {
            self.cancel_or_add(from, to, face);
        }
        self.room = polygon.into_room();
        // Neither a corner that has no segment left nor a vertex in the middle of the face belongs
        // to another face.
        for at in 0..on_plane_count {
            let number = self.on_plane[at];
            if self.segments_from[number.get()] == I::ZERO {
                self.drop_candidate(number);
            }
        }
        Ok(())
    }

    /// Turns the plane about the directed edge until no vertex is above it. Writes the vertices on
    /// it to `on_plane`, the two ends of the edge and a third corner first, and returns how many
    /// they are.
    fn find_plane(&mut self, from: I, to: I, cancel: &mut dyn Cancel) -> Result<usize, SolidError> {
        let (start, end) = (self.point(from), self.point(to));
        self.on_plane[0] = from;
        self.on_plane[1] = to;
        let mut count = 2;
        // The plane is degenerate until a third vertex is found. Until then every height is zero.
        let mut plane = Plane::through(start, end, end);
        let mut at = 0;
        while at < self.candidate_count {
            if at % VERTICES_PER_CHECK == 0 {
                cancel.check()?;
            }
            let number = self.candidates[at];
            at += 1;
            if number == from || number == to {
                continue;
            }
            let point = self.point(number);
            let height = plane.height(point);
            if height < 0 {
                continue;
            }
            let turned = Plane::through(start, end, point);
            if turned.is_degenerate() {
                // The vertex lies in the middle of this edge, so it is not a corner of any face.
                at -= 1;
                self.candidate_count -= 1;
                self.candidates.swap(at, self.candidate_count);
                self.flat += 1;
            } else if height > 0 || plane.is_degenerate() {
                plane = turned;
                self.on_plane[2] = number;
                count = 3;
            } else {
                self.on_plane[count] = number;
                count += 1;
            }
        }
        Ok(count)
    }

    /// Processes a side of a new face: it cancels the equal segment of the perimeter, or joins the
    /// perimeter reversed.
    fn cancel_or_add(&mut self, from: I, to: I, face: I) {
        let met = (0..self.perimeter_count).find(|at| self.segment(*at) == (from, to));
        if let Some(at) = met {
            let edge = &mut self.edges[self.perimeter[at].get()];
            if edge.left() == I::NONE {
                edge.0[2] = face;
            } else {
                edge.0[3] = face;
            }
            self.perimeter.copy_within(at + 1..self.perimeter_count, at);
            self.perimeter_count -= 1;
            self.segments_from[from.get()] -= I::ONE;
        } else {
            self.edges[self.edge_count] = HullEdge::new([from, to], [face, I::NONE]);
            self.perimeter[self.perimeter_count] = I::new(self.edge_count); // below 3 × 2^14
            self.edge_count += 1;
            self.perimeter_count += 1;
            self.segments_from[to.get()] += I::ONE;
        }
    }

    /// Removes a vertex from the candidates, because no face that is still to be found has it as a
    /// corner.
    fn drop_candidate(&mut self, number: I) {
        let candidates = &self.candidates[..self.candidate_count];
        if let Some(at) = candidates.iter().position(|other| *other == number) {
            self.candidate_count -= 1;
            self.candidates.swap(at, self.candidate_count);
        }
    }
}

#[cfg(test)]
mod tests;
