//! Draws building blocks that touch as one shape: no line appears between two faces that lie in one
//! plane.
//!
//! What counts is what is visible on both sides of an edge. If the nearest face that begins at the
//! edge on its left and the nearest one on its right lie in one plane, the edge is not drawn there.
//! So the line where a wall stands on a floor is kept, although the underside of the wall and the
//! floor lie in one plane. The ranks of these two faces (their positions in the order of depth,
//! nearest first) are recorded on the profile of the edge.
//!
//! The blocks touch in the model, but in the view each corner was rounded separately. Therefore the
//! tests "in one plane" and "on one line" use the positions of the model. They leave room for the
//! precision of the model, so which of several faces is the nearest may depend on the order in
//! which they are asked. They are asked in the order of their ranks, and those that do not meet the
//! edge within the error of both do not count, so the result does not depend on the grid of the
//! search.

use super::coarse_projection::CoarseProjection;
use super::edge_query::{CrossedPolygon, EdgeQuery};
use super::faces::Face;
use super::profile::{EdgeInterval, Profile};
use super::scene_index::SceneIndex;
use crate::array::MapEach;
use crate::geometry::{COORDINATE_LIMIT, Vertex};
use crate::index::Index;

/// One of the two sides of an edge, and the bits of the profile's marks that hold the rank of the
/// nearest face that begins there. They hold the rank plus one; zero means none.
#[derive(Clone, Copy)]
struct EdgeSide {
    /// The position of the lowest of the 16 bits that hold the rank.
    shift: u32,
    /// Whether this is the side to the left of the edge, as seen on the page from its start.
    is_left: bool,
}

/// How many bits a rank has among the marks.
const RANK_BITS: u32 = 30;
/// The bits of a rank.
const RANKS: usize = (1 << RANK_BITS) - 1;
const LEFT: EdgeSide = EdgeSide { shift: 4, is_left: true };
const RIGHT: EdgeSide = EdgeSide { shift: LEFT.shift + RANK_BITS, is_left: false };

impl EdgeSide {
    /// Returns the rank (the number of the face in the order of depth) that `marks` hold for this
    /// side; `None` if they hold none.
    fn get(self, marks: u64) -> Option<usize> {
        ((marks >> self.shift) as usize & RANKS).checked_sub(1)
    }

    /// Returns `marks` with `rank` stored for this side, in place of what they held.
    fn put(self, marks: u64, rank: usize) -> u64 {
        marks & !((RANKS as u64) << self.shift) | (rank as u64 + 1) << self.shift
    }
}

/// A triangle that touches an edge: its plane contains the edge.
struct Touching<I> {
    /// The numbers of the vertices at its corners.
    corners: [I; 3],
    /// The side of the edge's line on which each corner lies: 1 is left, -1 is right, 0 is on the
    /// line.
    sides: [i32; 3],
    /// The sense in which the triangle turns on the page: positive is anticlockwise.
    facing: i32,
}

impl<I: Index> Touching<I> {
    /// Returns a corner that lies on the given side of the edge.
    fn corner(&self, edge_side: EdgeSide) -> Option<I> {
        let wanted = if edge_side.is_left { 1 } else { -1 };
        let found = self.sides.iter().position(|&side| side == wanted)?;
        // There are as many corners as sides.
        Some(self.corners[found])
    }

    /// Returns a positive number if a vertex lies behind the plane of this triangle, a negative one
    /// if it lies in front, and zero if it lies in the plane.
    fn height(&self, coarse_projection: &CoarseProjection<'_>, vertex: I) -> i64 {
        coarse_projection.height(self.corners, coarse_projection.end(vertex))
            * i64::from(self.facing)
    }
}

impl<I: Index> EdgeQuery<I> {
    /// Records where `face` begins at this edge, for the parts of the edge where it is the nearest
    /// face to do so.
    pub fn touch(
        &self,
        around: &SceneIndex<'_, I>,
        face: Face,
        rank: usize,
        profile: &mut Profile<'_>,
    ) {
        for triangle in around.triangles(face) {
            let Some(touching) = self.touching(&around.coarse_projection, triangle) else {
                continue;
            };
            if self.is_apart_from(&around.coarse_projection, triangle) {
                continue;
            }
            let piece = CrossedPolygon::new(&touching.corners, &touching.sides);
            for edge_side in [LEFT, RIGHT] {
                let crossings =
                    piece.crossings(if edge_side.is_left { piece.left } else { piece.left_or_on });
                let passage =
                    self.passage(&around.coarse_projection, piece, crossings, touching.facing);
                if let Some(passage) = passage {
                    let part: EdgeInterval = self.part(&around.coarse_projection, passage);
                    profile.update(part, &|marks| {
                        let known = edge_side.get(marks);
                        if known
                            .is_none_or(|known| self.is_nearer(around, &touching, known, edge_side))
                        {
                            edge_side.put(marks, rank)
                        } else {
                            marks
                        }
                    });
                }
            }
        }
    }

    /// Whether a triangle whose plane contains this edge certainly has no point in common with it,
    /// within the errors of both. A side of such a triangle may be in line with the edge, far from
    /// it; where rounding bends that line, the triangle would seem to lie beside the edge.
    fn is_apart_from(&self, coarse_projection: &CoarseProjection<'_>, triangle: [I; 3]) -> bool {
        let parts: [fn(Vertex) -> i32; 3] = [|at| at.x, |at| at.y, |at| at.z];
        // With an error of the whole range nothing is apart.
        let error = coarse_projection.unrounded.error_bound().min(2 * COORDINATE_LIMIT as u32);
        parts.into_iter().any(|part| {
            let (p, q) = (part(self.p.vertex), part(self.q.vertex));
            let [a, b, c] = triangle.map_each(|number| part(coarse_projection.vertex(number)));
            a.max(b).max(c) + (error as i32) < p.min(q) || a.min(b).min(c) - error as i32 > p.max(q)
        })
    }

    /// Whether the faces recorded on both sides of a piece of this edge lie in one plane.
    pub fn is_within_plane(&self, around: &SceneIndex<'_, I>, marks: u64) -> bool {
        let beside =
            |edge_side: EdgeSide| self.find_touching(around, edge_side.get(marks)?, edge_side);
        let (Some(left), Some(right)) = (beside(LEFT), beside(RIGHT)) else {
            return false;
        };
        let coarse_projection = &around.coarse_projection;
        left.corner(LEFT).is_some_and(|corner| right.height(coarse_projection, corner) == 0)
    }

    /// Whether a triangle is nearer to the eye than the face with rank `than`, on the given side of
    /// this edge.
    fn is_nearer(
        &self,
        around: &SceneIndex<'_, I>,
        touching: &Touching<I>,
        than: usize,
        edge_side: EdgeSide,
    ) -> bool {
        let coarse_projection = &around.coarse_projection;
        match (self.find_touching(around, than, edge_side), touching.corner(edge_side)) {
            (Some(other), Some(corner)) => other.height(coarse_projection, corner) < 0,
            _ => false,
        }
    }

    /// Returns the triangle of a face whose plane contains this edge and that has a corner on the
    /// given side of it.
    fn find_touching(
        &self,
        around: &SceneIndex<'_, I>,
        rank: usize,
        edge_side: EdgeSide,
    ) -> Option<Touching<I>> {
        around
            .triangles(around.faces.get(rank))
            .filter_map(|triangle| self.touching(&around.coarse_projection, triangle))
            .find(|touching| touching.corner(edge_side).is_some())
    }

    /// Returns how a triangle lies beside this edge, or `None` if its plane does not contain the
    /// edge or the eye sees it edge-on.
    fn touching(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        triangle: [I; 3],
    ) -> Option<Touching<I>> {
        let [a, b, c] = triangle;
        let facing = coarse_projection.side(a, b, c);
        (facing != 0 && self.lies_in_plane_of(coarse_projection, triangle)).then(|| Touching {
            corners: triangle,
            sides: triangle.map_each(|corner| {
                if self.is_in_line_with(coarse_projection, corner) {
                    0
                } else {
                    self.side_of(coarse_projection, corner)
                }
            }),
            facing,
        })
    }

    /// Whether the plane of a triangle contains this edge. A seam is contained in each plane in
    /// which either of its two faces lies.
    pub fn lies_in_plane_of(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        triangle: [I; 3],
    ) -> bool {
        match self.seam {
            Some(seam) => seam.iter().any(|of| coarse_projection.heights(triangle, *of) == [0; 3]),
            None => {
                [self.p, self.q].iter().all(|end| coarse_projection.height(triangle, *end) == 0)
            }
        }
    }

    /// Whether a vertex lies, in the model, on the line of this edge or seam.
    fn is_in_line_with(&self, coarse_projection: &CoarseProjection<'_>, vertex: I) -> bool {
        let [p, q] = [self.p.number, self.q.number];
        match self.seam {
            Some(seam) => seam
                .iter()
                .all(|of| coarse_projection.height(*of, coarse_projection.end(vertex)) == 0),
            None => {
                vertex == p || vertex == q || coarse_projection.unrounded.are_in_line(p, q, vertex)
            }
        }
    }
}
