//! Building blocks that touch, drawn as one shape: no line between two faces of one plane.
//!
//! What counts is what is seen on both sides of an edge: if the nearest face that begins at the edge
//! on its left and the nearest on its right lie in one plane, the edge is not drawn there. So the line where
//! a wall stands on a floor stays, though the wall's underside and the floor lie in one plane. Which
//! faces those are is noted on the edge's profile, by rank.
//!
//! Blocks touch in the model; in the view each corner was rounded on its own. So "in one plane" and "on
//! one line" are asked of the model.

use super::coarse_projection::CoarseProjection;
use super::edge_query::{CrossedPolygon, EdgeQuery, SceneIndex};
use super::faces::Face;
use super::profile::{EdgeInterval, Profile};

/// A side of an edge, and where its profile keeps the nearest face that begins there: the rank and one.
#[derive(Clone, Copy)]
struct Bank {
    shift: u32,
    is_left: bool,
}

const LEFT: Bank = Bank { shift: 16, is_left: true };
const RIGHT: Bank = Bank { shift: 32, is_left: false };

impl Bank {
    fn get(self, marks: u64) -> Option<usize> {
        usize::from((marks >> self.shift) as u16).checked_sub(1)
    }

    fn put(self, marks: u64, rank: usize) -> u64 {
        marks & !(0xFFFF << self.shift) | (rank as u64 + 1) << self.shift
    }
}

/// A triangle whose plane holds an edge.
struct Touching {
    corners: [u16; 3],
    /// On which side of the edge's line each corner lies.
    sides: [i32; 3],
    facing: i32,
}

impl Touching {
    /// A corner on one side of the edge.
    fn corner(&self, bank: Bank) -> Option<u16> {
        let wanted = if bank.is_left { 1 } else { -1 };
        let found = self.sides.iter().position(|&side| side == wanted)?;
        Some(self.corners[found])
    }

    /// Whether a vertex lies behind this triangle (positive), before it, or in its plane.
    fn height(&self, coarse_projection: &CoarseProjection<'_>, vertex: u16) -> i64 {
        coarse_projection.height(self.corners, coarse_projection.end(vertex))
            * i64::from(self.facing)
    }
}

impl EdgeQuery {
    /// Notes where `face` begins at this edge, where it is the nearest to do so.
    pub fn touch(
        &self,
        around: &SceneIndex<'_>,
        face: Face,
        rank: usize,
        profile: &mut Profile<'_>,
    ) {
        for triangle in around.triangles(face) {
            let Some(touching) = self.touching(&around.coarse_projection, triangle) else {
                continue;
            };
            let piece = CrossedPolygon::new(&touching.corners, &touching.sides);
            for bank in [LEFT, RIGHT] {
                let crossings =
                    piece.crossings(if bank.is_left { piece.left } else { piece.left_or_on });
                let passage =
                    self.passage(&around.coarse_projection, piece, crossings, touching.facing);
                if let Some(passage) = passage {
                    let part: EdgeInterval = self.part(&around.coarse_projection, passage);
                    profile.update(part, |marks| {
                        let known = bank.get(marks);
                        if known.is_none_or(|known| self.is_nearer(around, &touching, known, bank))
                        {
                            bank.put(marks, rank)
                        } else {
                            marks
                        }
                    });
                }
            }
        }
    }

    /// Whether what is noted for a piece of this edge is one plane on both sides.
    pub fn is_within_plane(&self, around: &SceneIndex<'_>, marks: u64) -> bool {
        let beside = |bank: Bank| self.find_touching(around, bank.get(marks)?, bank);
        let (Some(left), Some(right)) = (beside(LEFT), beside(RIGHT)) else {
            return false;
        };
        let coarse_projection = &around.coarse_projection;
        left.corner(LEFT).is_some_and(|corner| right.height(coarse_projection, corner) == 0)
    }

    /// Whether a triangle is nearer on one side of this edge than the face of a rank.
    fn is_nearer(
        &self,
        around: &SceneIndex<'_>,
        touching: &Touching,
        than: usize,
        bank: Bank,
    ) -> bool {
        let coarse_projection = &around.coarse_projection;
        match (self.find_touching(around, than, bank), touching.corner(bank)) {
            (Some(other), Some(corner)) => other.height(coarse_projection, corner) < 0,
            _ => false,
        }
    }

    /// The triangle of a face that holds this edge and has a corner on one side of it.
    fn find_touching(&self, around: &SceneIndex<'_>, rank: usize, bank: Bank) -> Option<Touching> {
        around
            .triangles(around.faces.get(rank))
            .filter_map(|triangle| self.touching(&around.coarse_projection, triangle))
            .find(|touching| touching.corner(bank).is_some())
    }

    fn touching(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        triangle: [u16; 3],
    ) -> Option<Touching> {
        let [a, b, c] = triangle;
        let facing = coarse_projection.side(a, b, c);
        (facing != 0 && self.lies_in_plane_of(coarse_projection, triangle)).then(|| Touching {
            corners: triangle,
            sides: triangle.map(|corner| {
                if self.is_in_line_with(coarse_projection, corner) {
                    0
                } else {
                    self.side_of(coarse_projection, corner)
                }
            }),
            facing,
        })
    }

    /// Whether the plane of a triangle holds this edge. That of a seam is held by every plane of
    /// either of its faces.
    pub fn lies_in_plane_of(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        triangle: [u16; 3],
    ) -> bool {
        match self.seam {
            Some(seam) => seam.iter().any(|of| coarse_projection.heights(triangle, *of) == [0; 3]),
            None => {
                [self.p, self.q].iter().all(|end| coarse_projection.height(triangle, *end) == 0)
            }
        }
    }

    /// Whether a vertex lies on the line of this edge, or of this seam, in the model.
    fn is_in_line_with(&self, coarse_projection: &CoarseProjection<'_>, vertex: u16) -> bool {
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
