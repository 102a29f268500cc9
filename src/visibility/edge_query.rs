//! Tests one edge against one face and finds exactly which part of the edge the face hides.
//!
//! A triangle hides an edge where the edge lies behind the plane of the triangle and, on the page,
//! inside the triangle. "Inside" is decided twice: for the points of the page just to the left of
//! the edge and for those just to the right. A corner that lies on the line of the edge counts as
//! lying to the right in the first decision and to the left in the second. So every degenerate case
//! falls on one side or the other.

use super::coarse_projection::{CoarseLine, CoarseProjection, End};
use super::edges::sides;
use super::faces::Face;
use super::profile::{EdgeInterval, Profile, mark};
use super::raster::Bounds;
use super::scene_index::SceneIndex;
use crate::array::MapEach;
use crate::geometry::{EdgeParameter, line_side, page_offset, page_side};
use crate::index::Index;
use crate::model::Corner;

/// An edge, or a seam, that is being tested against faces.
#[derive(Debug, Clone, Copy)]
pub struct EdgeQuery<I> {
    /// The side of a face that represents this edge; [`Self::NO_SIDE`] for a seam.
    pub side: usize,
    /// The end at which the edge begins.
    pub p: End<I>,
    /// The end at which the edge stops.
    pub q: End<I>,
    /// The depth of the end that is nearer to the eye.
    pub near: i32,
    /// The depth of the end that is farther from the eye.
    pub far: i32,
    /// The two triangles that pass through each other along it, if this is a seam.
    pub seam: Option<[[I; 3]; 2]>,
    /// The rectangle around the edge on the coarse grid.
    pub bounds: Bounds,
    /// The line of the edge on the coarse grid.
    line: CoarseLine,
}

/// A side of a face: the numbers of the vertices at its two ends.
type Side<I> = (I, I);

/// A face, or one of its triangles, with the sides of the edge's line on which its corners lie.
///
/// The points just to the left of the edge see a corner on its line as lying to the right; the
/// points just to the right see it as lying to the left. So there are two masks of the corners that
/// count as lying to the left.
#[derive(Clone, Copy)]
pub struct CrossedPolygon<'c, I> {
    /// The numbers of the vertices of the polygon.
    // There is at least one corner: a polygon is a triangle or has all corners of an element.
    corners: &'c [I],
    /// One bit for each corner: whether it lies to the left of the line.
    pub left: u32,
    /// One bit for each corner: whether it lies to the left of the line or on it.
    pub left_or_on: u32,
}

impl<'c, I: Index> CrossedPolygon<'c, I> {
    /// Builds it from the corners, of which there are at most [`FEW_CORNERS`], and the side of the
    /// line on which each lies: positive is left, negative is right, zero is on the line.
    pub fn new(corners: &'c [I], sides: &[i32]) -> Self {
        let (mut left, mut left_or_on) = (0, 0);
        for (n, &side) in sides.iter().enumerate().take(corners.len()) {
            left |= u32::from(side > 0) << n;
            left_or_on |= u32::from(side >= 0) << n;
        }
        Self { corners, left, left_or_on }
    }

    /// Moves the bit of each corner to the position of the next corner around the polygon.
    fn shifted(&self, mask: u32) -> u32 {
        let count = self.corners.len();
        (mask << 1 | mask >> (count - 1)) & ((1 << count) - 1)
    }

    /// Returns one bit for each side of the polygon that crosses the line. The bit is at the corner
    /// where the side ends. `left` is one of the two masks.
    pub fn crossings(&self, left: u32) -> u32 {
        left ^ self.shifted(left)
    }

    /// Returns one bit for each side of the polygon that lies on the line, at the corner where the
    /// side ends.
    fn sides_on_line(&self) -> u32 {
        let on = self.left ^ self.left_or_on;
        on & self.shifted(on)
    }

    /// Returns the side that ends at a corner.
    fn side(&self, end: usize) -> Side<I> {
        // `passage` counts `end` up to the number of corners, so there is one.
        let begin = end.checked_sub(1).unwrap_or(self.corners.len() - 1);
        (self.corners[begin], self.corners[end])
    }
}

/// Whether more than two bits are set.
fn is_many(mask: u32) -> bool {
    let without_one = mask & mask.wrapping_sub(1);
    without_one & without_one.wrapping_sub(1) != 0
}

/// The most corners with which a face is tested as a whole. A face with more is tested triangle by
/// triangle.
const FEW_CORNERS: usize = 8;

/// The sides through which the edge enters and leaves a polygon on the page. Each is `None` if the
/// edge begins or ends inside the polygon.
#[derive(Clone, Copy, Default)]
pub struct Passage<I> {
    /// The side of the polygon through which the edge comes in.
    entry: Option<Side<I>>,
    /// The side of the polygon through which the edge goes out.
    exit: Option<Side<I>>,
}

/// Which part of an edge lies deeper than a face, wherever the face is on the page.
enum Depth {
    /// No part of the edge lies behind the face.
    Before,
    /// This part of the edge lies behind the face.
    Behind(EdgeInterval),
    /// The answer differs between the triangles of the face.
    Mixed,
}

impl<I: Index> EdgeQuery<I> {
    /// The value of `side` for a seam. It sorts after the sides of all edges.
    pub const NO_SIDE: usize = usize::MAX;

    /// Creates the query for the seam of two triangles, which runs from p to q.
    pub fn of_seam(triangles: [[I; 3]; 2], p: End<I>, q: End<I>) -> Self {
        Self { seam: Some(triangles), ..Self::new(Self::NO_SIDE, p, q) }
    }

    /// Creates the query for the edge between two ends that `side` represents.
    pub fn new(side: usize, p: End<I>, q: End<I>) -> Self {
        Self {
            side,
            p,
            q,
            near: p.vertex.z.min(q.vertex.z),
            far: p.vertex.z.max(q.vertex.z),
            seam: None,
            bounds: Bounds { low: p.position.low(q.position), high: p.position.high(q.position) },
            line: CoarseLine::new(p.position, q.position),
        }
    }

    /// Returns the side of this edge's line on which a vertex lies on the page: positive for left,
    /// negative for right, zero on the line.
    pub fn side_of(&self, coarse_projection: &CoarseProjection<'_>, number: I) -> i32 {
        let coarse = self.line.side(coarse_projection.position(number));
        if coarse != 0 { coarse } else { self.exact_side_of(coarse_projection, number) }
    }

    /// Answers [`Self::side_of`] exactly, without the coarse grid.
    #[cold]
    fn exact_side_of(&self, coarse_projection: &CoarseProjection<'_>, number: I) -> i32 {
        if number == self.p.number || number == self.q.number {
            return 0;
        }
        let vertex = coarse_projection.vertex(number);
        page_side(coarse_projection.projection, self.p.vertex, self.q.vertex, vertex).signum()
            as i32
    }

    /// Marks on `profile` the parts of this edge that `face` hides or that one of its sides
    /// replaces. `rank` is the rank of the face. The caller has asked [`SceneIndex::may_meet`].
    /// Where `hides` is `false`, all that the face hides is hidden by others.
    #[cfg_attr(feature = "threads", inline(never))] // Most faces are passed over before.
    pub fn mark_face(
        &self,
        around: &SceneIndex<'_, I>,
        rank: usize,
        face: Face,
        hides: bool,
        profile: &mut Profile<'_>,
    ) {
        let coarse_projection = &around.coarse_projection;
        let corners = around.outlines.element(face.first);
        let mut numbers = [I::ZERO; FEW_CORNERS];
        let mut sides = [0; FEW_CORNERS];
        let (mut left, mut right) = (true, true);
        let mut bounds = Bounds::NOWHERE;
        for (n, corner) in corners.iter().enumerate() {
            let number = corner.vertex();
            let position = coarse_projection.position(number);
            if !SceneIndex::<I>::HAS_SHORTCUTS {
                bounds.add(position);
            }
            let mut side = 0;
            if number != self.p.number && number != self.q.number {
                side = self.line.side(position);
                left &= side > 0;
                right &= side < 0;
            }
            if n < FEW_CORNERS {
                numbers[n] = number;
                sides[n] = side;
            }
        }
        // If all other corners lie on one side of the line, a face that contains p or q meets the
        // edge nowhere else; a face that contains both is not nearer than the edge.
        if left || right || !SceneIndex::<I>::HAS_SHORTCUTS && !bounds.may_meet(&self.bounds) {
            return;
        }
        let count = corners.len();
        if count <= FEW_CORNERS {
            for (side, &number) in sides.iter_mut().zip(&numbers).take(count) {
                if *side == 0 {
                    *side = self.exact_side_of(coarse_projection, number);
                }
            }
            let piece = CrossedPolygon::new(&numbers[..count], &sides);
            if hides && !(face.is_fan && self.pass(around, rank, piece, profile)) {
                self.pass_triangles(around, face, profile);
            }
            if piece.sides_on_line() == 0 {
                return;
            }
        } else if hides {
            self.pass_triangles(around, face, profile);
        }
        self.pass_sides(around, face.first, corners, profile);
    }

    /// Marks the parts of this edge that a face hides, triangle by triangle.
    fn pass_triangles(&self, around: &SceneIndex<'_, I>, face: Face, profile: &mut Profile<'_>) {
        for triangle in around.triangles(face) {
            self.pass_triangle(around, &triangle, profile);
        }
    }

    /// Marks the part of this edge that one triangle hides.
    fn pass_triangle(
        &self,
        around: &SceneIndex<'_, I>,
        triangle: &[I; 3],
        profile: &mut Profile<'_>,
    ) {
        let sides = triangle.map_each(|corner| self.side_of(&around.coarse_projection, corner));
        self.pass(around, usize::MAX, CrossedPolygon::new(triangle, &sides), profile);
    }

    /// Marks the parts of this edge that a polygon hides. Returns `false`, and marks nothing, if
    /// the triangles of the face must be tested one by one. For a single triangle it always returns
    /// `true`. `rank` is the rank of the face if the polygon is all of it, and no rank otherwise.
    fn pass(
        &self,
        around: &SceneIndex<'_, I>,
        rank: usize,
        piece: CrossedPolygon<'_, I>,
        profile: &mut Profile<'_>,
    ) -> bool {
        let coarse_projection = &around.coarse_projection;
        let corners = piece.corners;
        let left = piece.crossings(piece.left);
        let right = piece.crossings(piece.left_or_on);
        if left | right == 0 {
            return true;
        }
        if is_many(left) || is_many(right) {
            return false;
        }
        let depth = |number: &I| coarse_projection.vertex(*number).z;
        let (near, far, facing) = around.outlook(rank).unwrap_or_else(|| {
            let (mut near, mut far) = (i32::MAX, i32::MIN);
            for z in corners.iter().map(depth) {
                (near, far) = (near.min(z), far.max(z));
            }
            (near, far, 0)
        });
        if near >= self.far {
            return true;
        }
        let mut facing = facing;
        if facing == 0 {
            for pair in corners[1..].windows(2) {
                let turn = coarse_projection.side(corners[0], pair[0], pair[1]);
                if facing * turn < 0 {
                    return false;
                }
                facing |= turn;
            }
            if facing == 0 {
                return true;
            }
        }
        let on_left = self.passage(coarse_projection, piece, left, facing);
        let on_right = if left == right {
            on_left
        } else {
            self.passage(coarse_projection, piece, right, facing)
        };
        if on_left.is_none() && on_right.is_none() {
            return true;
        }
        let behind = if far + 1 < self.near {
            EdgeInterval::WHOLE
        } else {
            match self.depth_behind(coarse_projection, corners, facing) {
                Depth::Before => return true,
                Depth::Behind(part) => part,
                Depth::Mixed => return false,
            }
        };
        let mut cover = |passage: Option<Passage<I>>, marks: u64| {
            if let Some(passage) = passage {
                profile.mark(self.part(coarse_projection, passage).and(behind), marks);
            }
        };
        if left == right {
            cover(on_left, mark::HIDDEN);
        } else {
            cover(on_left, mark::LEFT);
            cover(on_right, mark::RIGHT);
        }
        true
    }

    /// Finds which part of the edge lies behind the planes of a fan of triangles. All the triangles
    /// turn on the page in the sense that the sign of `facing` gives.
    fn depth_behind(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        corners: &[I],
        facing: i32,
    ) -> Depth {
        let mut depth = None;
        for pair in corners[1..].windows(2) {
            let triangle = [corners[0], pair[0], pair[1]];
            let here = if self.seam.is_some() && self.lies_in_plane_of(coarse_projection, triangle)
            {
                None
            } else {
                let height =
                    |end: End<I>| coarse_projection.height(triangle, end) * i64::from(facing);
                behind_between(height(self.p), height(self.q))
            };
            if corners.len() > 3 {
                let is_all = here == Some(EdgeInterval::WHOLE);
                if here.is_some() && !is_all || depth.is_some_and(|depth| depth != here) {
                    return Depth::Mixed;
                }
            }
            depth = Some(here);
        }
        match depth.flatten() {
            Some(part) => Depth::Behind(part),
            None => Depth::Before,
        }
    }

    /// Finds the sides through which the edge enters and leaves a polygon on the page. Returns
    /// `None` if the edge does not meet the polygon. `crossings` are the sides that cross its line.
    /// The sign of `facing` says in which sense the polygon turns: positive is anticlockwise.
    #[cfg_attr(feature = "threads", inline(always))]
    pub fn passage(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        piece: CrossedPolygon<'_, I>,
        crossings: u32,
        facing: i32,
    ) -> Option<Passage<I>> {
        if crossings == 0 {
            return None;
        }
        let mut passage = Passage::default();
        for end in 0..piece.corners.len() {
            if crossings >> end & 1 == 0 {
                continue;
            }
            let side = piece.side(end);
            let line = coarse_projection.line(side.0, side.1);
            let p_inside = line.side(self.p) * facing;
            let q_inside = line.side(self.q) * facing;
            if p_inside <= 0 && q_inside <= 0 {
                return None;
            }
            if p_inside < 0 {
                passage.entry = Some(side);
            } else if q_inside < 0 {
                passage.exit = Some(side);
            }
        }
        Some(passage)
    }

    /// Returns the part of the edge that lies within a polygon on the page.
    pub fn part(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        passage: Passage<I>,
    ) -> EdgeInterval {
        let position = |(a, b): Side<I>| coarse_projection.crossing(a, b, self.p, self.q);
        EdgeInterval { from: passage.entry.map(position), to: passage.exit.map(position) }
    }

    /// Marks the parts of this edge that are replaced by sides of an element that lie on the same
    /// line of the page.
    #[cold]
    fn pass_sides(
        &self,
        around: &SceneIndex<'_, I>,
        first: usize,
        corners: &[Corner<I>],
        profile: &mut Profile<'_>,
    ) {
        let is_on_line = |corner: I| self.side_of(&around.coarse_projection, corner) == 0;
        for (number, a, b) in sides(corners) {
            let side = first + number;
            if side != self.side && around.chosen.contains(side) && is_on_line(a) && is_on_line(b) {
                self.pass_side(around, side, (a, b), profile);
            }
        }
    }

    /// Marks the part of this edge where the side (a, b) of a face, which lies on the same line of
    /// the page, is drawn in its stead. That is where the side is nearer than this edge, or equally
    /// near with a lower pen, or equally near with the same pen and earlier in the model.
    fn pass_side(
        &self,
        around: &SceneIndex<'_, I>,
        side: usize,
        (a, b): Side<I>,
        profile: &mut Profile<'_>,
    ) {
        let coarse_projection = &around.coarse_projection;
        let projection = coarse_projection.projection;
        let (va, vb) = (coarse_projection.vertex(a), coarse_projection.vertex(b));
        let (vp, vq) = (self.p.vertex, self.q.vertex);
        let Some((axis, ahead)) = coarse_projection.direction(vp, vq) else {
            return;
        };
        if page_offset(projection, axis, va, vb) == 0 {
            return;
        }
        let position = |vertex| {
            let beyond_p = page_offset(projection, axis, vp, vertex) * ahead;
            let before_q = page_offset(projection, axis, vertex, vq) * ahead;
            if beyond_p <= 0 {
                EdgeParameter::START
            } else if before_q <= 0 {
                EdgeParameter::END
            } else {
                EdgeParameter::zero_between(beyond_p, before_q)
            }
        };
        let height = |vertex| line_side(projection, axis, va, vb, vertex);
        let heights = (height(vp), height(vq));
        let behind = if heights == (0, 0) {
            let pens = around.outlines.pens;
            let is_first = self.side == Self::NO_SIDE
                || (pens.at(side), side) < (pens.at(self.side), self.side);
            is_first.then_some(EdgeInterval::WHOLE)
        } else {
            behind_between(heights.0, heights.1)
        };
        if let Some(behind) = behind {
            let (at_a, at_b) = (position(va), position(vb));
            let beside = EdgeInterval { from: Some(at_a.min(at_b)), to: Some(at_a.max(at_b)) };
            profile.mark(beside.and(behind), mark::ENCLOSED);
        }
    }
}

/// Returns the part of an edge that lies behind a plane or a line, from the heights of its ends p
/// and q: positive is behind. Returns `None` if no part lies behind.
fn behind_between(at_p: i64, at_q: i64) -> Option<EdgeInterval> {
    if at_p <= 0 && at_q <= 0 {
        return None;
    }
    let mut part = EdgeInterval::WHOLE;
    if at_p < 0 {
        part.from = Some(EdgeParameter::zero_between(at_p, at_q));
    } else if at_q < 0 {
        part.to = Some(EdgeParameter::zero_between(at_p, at_q));
    }
    Some(part)
}
