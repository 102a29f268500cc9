//! A reference for the picture of a scene whose view coordinates are rounded. Coplanarity is taken
//! from the grid on which the scene was made, everything else from the rounded vertices.
//!
//! Along an edge, every relevant quantity is linear in space, such as the signed distance from a
//! line of the page or the distance behind a plane. Each such quantity is therefore represented by
//! two whole numbers, its values at the ends. The edge is cut wherever one of them changes its
//! sign, and between two cuts their mediant decides for the whole piece. Every triangle is tested
//! against every edge, without shortcuts.
//!
//! A face counts as the fan of triangles from its first corner, so faces must be convex.

mod arithmetic;

pub use arithmetic::{Ratio, compare};

use arithmetic::{
    Linear, Plane, Vector, compare_along, cross, dot, minus, sign_at, vector, zero_of,
};

use crate::camera_scenes::{CameraScene, GridPoint};
use penup::geometry::{Projection, Vertex};
use std::cmp::Ordering;

/// A piece of an edge: the indices of the edge's ends, the start and end of the piece as fractions
/// of the edge's length in space, and whether the piece is visible.
pub type Piece = ((u16, u16), Ratio, Ratio, bool);

/// A seam, which is the intersection line of two faces, and its visible pieces.
#[derive(Debug, Clone)]
pub struct Seam {
    /// The ends, rounded to whole coordinates.
    pub ends: [Vertex; 2],
    /// The visible pieces, as fractions of the seam.
    pub visible: Vec<(Ratio, Ratio)>,
}

#[derive(Debug, Clone, Copy)]
struct Triangle {
    corners: [u16; 3],
    face: usize,
    plane: Plane,
    /// The sign of the eye's height over the plane; zero if the plane is seen edge-on.
    eye: i128,
    /// The orientation of the corners on the page.
    turn: i128,
}

/// A line whose visibility is computed: an edge, or the seam of two faces.
#[derive(Debug, Clone, Copy)]
struct TestedLine {
    ends: [Vector; 2],
    origin: Origin,
}

#[derive(Debug, Clone, Copy)]
enum Origin {
    Edge { number: usize, vertices: [u16; 2] },
    Seam([usize; 2]),
}

/// The relation of one triangle to one line.
struct Relation {
    triangle: Triangle,
    /// The signed distance of the line's points from each side of the triangle on the page,
    /// positive inside.
    sides: [Linear; 3],
    /// The side of the line on which each corner lies on the page.
    corners: [i128; 3],
    /// The distance of the line's points behind the triangle's plane.
    behind: Linear,
    /// If the triangle's plane contains the line: the side of the line on which each corner lies,
    /// zero if on it.
    coplanar: Option<[i128; 3]>,
}

/// A scene with its triangles and its distinct edges.
pub struct Picture<'s> {
    scene: &'s CameraScene,
    faces: Vec<Vec<u16>>,
    triangles: Vec<Triangle>,
    edges: Vec<[u16; 2]>,
}

fn on_grid(point: GridPoint) -> Vector {
    point.map(i128::from)
}

impl<'s> Picture<'s> {
    /// Collects the triangles and edges of the scene.
    pub fn new(scene: &'s CameraScene) -> Self {
        let faces: Vec<Vec<u16>> = scene
            .corners
            .split_inclusive(|corner| corner.is_last())
            .map(|face| face.iter().map(|corner| corner.vertex()).collect())
            .collect();
        let mut picture = Self { scene, faces, triangles: Vec::new(), edges: Vec::new() };
        for (face, corners) in picture.faces.iter().enumerate() {
            for pair in corners[1..].windows(2) {
                let corners = [corners[0], pair[0], pair[1]];
                let plane = Plane::through(corners.map(|number| picture.vertex(number)));
                let [a, b, c] = corners.map(|number| picture.vertex(number));
                picture.triangles.push(Triangle {
                    corners,
                    face,
                    plane,
                    eye: plane.height_of_eye(scene.projection).signum(),
                    turn: picture.side(a, b, c).signum(),
                });
            }
            for (n, &from) in corners.iter().enumerate() {
                let to = corners[(n + 1) % corners.len()];
                let known = |edge: &[u16; 2]| *edge == [from, to] || *edge == [to, from];
                if !picture.edges.iter().any(known) {
                    picture.edges.push([from, to]);
                }
            }
        }
        picture
    }

    fn vertex(&self, number: u16) -> Vector {
        vector(self.scene.vertices[usize::from(number)])
    }

    fn grid(&self, number: u16) -> Vector {
        on_grid(self.scene.grid[usize::from(number)])
    }

    /// Whether the plane of a triangle contains a vertex, exactly, before any rounding.
    fn is_in_plane(&self, triangle: [u16; 3], vertex: u16) -> bool {
        Plane::through(triangle.map(|number| self.grid(number))).height(self.grid(vertex)) == 0
    }

    fn is_in_line(&self, a: u16, b: u16, c: u16) -> bool {
        let [a, b, c] = [a, b, c].map(|number| self.grid(number));
        cross(minus(b, a), minus(c, a)) == [0; 3]
    }

    fn are_in_one_plane(&self, triangle: [u16; 3], face: usize) -> bool {
        self.faces[face].iter().all(|corner| self.is_in_plane(triangle, *corner))
    }

    /// The side of the line from a to b on which the point c lies on the page: positive to the
    /// left.
    fn side(&self, a: Vector, b: Vector, c: Vector) -> i128 {
        match self.scene.projection {
            Projection::Perspective => dot(a, cross(b, c)),
            Projection::Parallel => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]),
        }
    }

    /// The distance of a vertex behind a triangle as seen from the eye; zero if they are coplanar.
    fn behind(&self, triangle: &Triangle, vertex: u16) -> i128 {
        if self.is_in_plane(triangle.corners, vertex) {
            return 0;
        }
        -triangle.eye * triangle.plane.height(self.vertex(vertex))
    }

    fn relation(&self, triangle: Triangle, line: &TestedLine) -> Relation {
        let [p, q] = line.ends;
        let corners = triangle.corners.map(|number| self.side(p, q, self.vertex(number)).signum());
        let sides = [0, 1, 2].map(|n: usize| {
            let [a, b] = [n, (n + 1) % 3].map(|n| self.vertex(triangle.corners[n]));
            (triangle.turn * self.side(a, b, p), triangle.turn * self.side(a, b, q))
        });
        let (behind, coplanar) = match line.origin {
            Origin::Edge { vertices, .. } => {
                let [p, q] = vertices.map(|vertex| self.behind(&triangle, vertex));
                let coplanar =
                    vertices.iter().all(|vertex| self.is_in_plane(triangle.corners, *vertex));
                let [from, to] = vertices;
                let corner = |n: usize| {
                    let is_on = self.is_in_line(from, to, triangle.corners[n]);
                    if is_on { 0 } else { corners[n] }
                };
                ((p, q), coplanar.then(|| [0, 1, 2].map(corner)))
            }
            Origin::Seam(faces) => {
                let is_of = |face: &usize| {
                    *face == triangle.face || self.are_in_one_plane(triangle.corners, *face)
                };
                let behind = |point| -triangle.eye * triangle.plane.height(point);
                let corner = |n: usize| {
                    let is_on = |face: &usize| {
                        let [a, b, c] = [0, 1, 2].map(|n: usize| self.faces[*face][n]);
                        self.is_in_plane([a, b, c], triangle.corners[n])
                    };
                    if faces.iter().all(is_on) { 0 } else { corners[n] }
                };
                match faces.iter().any(is_of) {
                    true => ((0, 0), Some([0, 1, 2].map(corner))),
                    false => ((behind(p), behind(q)), None),
                }
            }
        };
        Relation { triangle, sides, corners, behind, coplanar }
    }

    /// The other edges that lie on the same line of the page, with three linear quantities: before,
    /// after, and behind them.
    fn shadows(&self, line: &TestedLine) -> Vec<(usize, [Linear; 3])> {
        let [p, q] = line.ends;
        let projection = self.scene.projection;
        let offset = |axis: usize, a: Vector, b: Vector| match projection {
            Projection::Perspective => b[axis] * a[2] - a[axis] * b[2],
            Projection::Parallel => b[axis] - a[axis],
        };
        let axis = usize::from(offset(0, p, q) == 0);
        let mut shadows = Vec::new();
        for (number, edge) in self.edges.iter().enumerate() {
            let [a, b] = edge.map(|number| self.vertex(number));
            let is_self = matches!(line.origin, Origin::Edge { number: own, .. } if own == number);
            if is_self
                || self.side(p, q, a) != 0
                || self.side(p, q, b) != 0
                || offset(axis, a, b) == 0
            {
                continue;
            }
            let along = |from: Vector| (offset(axis, from, p), offset(axis, from, q));
            let depth = |x: Vector| {
                (b[axis] - a[axis]) * (x[2] - a[2]) - (b[2] - a[2]) * (x[axis] - a[axis])
            };
            let eye = match projection {
                Projection::Perspective => depth([0; 3]),
                Projection::Parallel => -(b[axis] - a[axis]),
            };
            let behind = (-eye.signum() * depth(p), -eye.signum() * depth(q));
            shadows.push((number, [along(a), along(b), behind]));
        }
        shadows
    }

    /// The pieces of a line: start, end, whether the piece is hidden, and whether it is drawn.
    fn visibility_along(&self, line: &TestedLine, merged: bool) -> Vec<(Ratio, Ratio, bool, bool)> {
        let relations: Vec<Relation> = self
            .triangles
            .iter()
            .filter(|triangle| triangle.turn != 0)
            .map(|triangle| self.relation(*triangle, line))
            .collect();
        let shadows = self.shadows(line);
        let mut cuts: Vec<Ratio> = vec![(0, 1), (1, 1)];
        for relation in &relations {
            cuts.extend(relation.sides.into_iter().filter_map(zero_of));
            cuts.extend(zero_of(relation.behind));
        }
        for (_, linears) in &shadows {
            cuts.extend(linears.iter().filter_map(|linear| zero_of(*linear)));
        }
        cuts.sort_by(|a, b| compare(*a, *b));
        cuts.dedup_by(|a, b| compare(*a, *b) == Ordering::Equal);
        cuts.windows(2)
            .map(|pair| {
                let at = (pair[0].0 + pair[1].0, pair[0].1 + pair[1].1);
                let is_hidden = [1, -1].into_iter().all(|beside| {
                    relations.iter().any(|relation| {
                        sign_at(relation.behind, at) > 0 && covers(relation, at, beside)
                    })
                });
                let is_left_out = self.is_drawn_by_another(line, &shadows, at)
                    || merged && self.is_flat(&relations, at);
                (pair[0], pair[1], is_hidden, !is_left_out)
            })
            .collect()
    }

    fn is_drawn_by_another(
        &self,
        line: &TestedLine,
        shadows: &[(usize, [Linear; 3])],
        at: Ratio,
    ) -> bool {
        shadows.iter().any(|(number, [from_a, from_b, behind])| {
            if sign_at(*from_a, at) * sign_at(*from_b, at) >= 0 {
                return false;
            }
            match (sign_at(*behind, at), line.origin) {
                (0, Origin::Edge { number: own, .. }) => *number < own,
                (0, Origin::Seam(_)) => true,
                (sign, _) => sign > 0,
            }
        })
    }

    /// Whether the nearest triangles beside the line whose planes contain it are coplanar.
    fn is_flat(&self, relations: &[Relation], at: Ratio) -> bool {
        let nearest = |beside: i128| {
            let mut best: Option<(&Triangle, u16)> = None;
            for relation in relations {
                let Some(corners) = relation.coplanar else { continue };
                let is_there = |n: usize| corners[n] * beside > 0;
                let crosses = |n: &usize| is_there(*n) != is_there((n + 1) % 3);
                let Some(corner) = (0..3).find(|n| is_there(*n)) else { continue };
                let mut crossing = (0..3).filter(crosses).peekable();
                if crossing.peek().is_none()
                    || crossing.any(|n| sign_at(relation.sides[n], at) <= 0)
                {
                    continue;
                }
                let corner = relation.triangle.corners[corner];
                if best.is_none_or(|(known, _)| self.behind(known, corner) < 0) {
                    best = Some((&relation.triangle, corner));
                }
            }
            best
        };
        match (nearest(1), nearest(-1)) {
            (Some((_, corner)), Some((right, _))) => self.behind(right, corner) == 0,
            _ => false,
        }
    }

    /// Computes the visible and the hidden pieces of every edge, in the order of the elements.
    pub fn pieces(&self, merged: bool) -> Vec<Piece> {
        let mut pieces: Vec<Piece> = Vec::new();
        for (number, &vertices) in self.edges.iter().enumerate() {
            let ends = vertices.map(|vertex| self.vertex(vertex));
            if self.is_point(ends) {
                continue;
            }
            let line = TestedLine { ends, origin: Origin::Edge { number, vertices } };
            let [from, to] = vertices;
            for (begin, end, is_hidden, is_drawn) in self.visibility_along(&line, merged) {
                if !is_hidden && !is_drawn {
                    continue;
                }
                match pieces.last_mut() {
                    Some(last)
                        if last.0 == (from, to)
                            && compare(last.2, begin) == Ordering::Equal
                            && last.3 != is_hidden =>
                    {
                        last.2 = end;
                    }
                    _ => pieces.push(((from, to), begin, end, !is_hidden)),
                }
            }
        }
        pieces
    }

    fn is_point(&self, [p, q]: [Vector; 2]) -> bool {
        match self.scene.projection {
            Projection::Perspective => cross(p, q) == [0; 3],
            Projection::Parallel => p[0] == q[0] && p[1] == q[1],
        }
    }

    /// Computes every seam and its visible pieces.
    pub fn seams(&self, merged: bool) -> Vec<Seam> {
        let mut seams = Vec::new();
        for other in 0..self.faces.len() {
            for one in 0..other {
                if self.has_edge_of(one, other)
                    || self.has_edge_of(other, one)
                    || !self.is_through(one, other)
                    || !self.is_through(other, one)
                {
                    continue;
                }
                let of = |face: usize| self.triangles.iter().filter(move |t| t.face == face);
                for first in of(one) {
                    for second in of(other) {
                        let Some(ends) = self.crossing(first, second) else { continue };
                        let ends = ends.map(vector);
                        if self.is_point(ends) {
                            continue;
                        }
                        let line = TestedLine { ends, origin: Origin::Seam([one, other]) };
                        let mut visible: Vec<(Ratio, Ratio)> = Vec::new();
                        for (from, to, is_hidden, is_drawn) in self.visibility_along(&line, merged)
                        {
                            match visible.last_mut() {
                                _ if is_hidden || !is_drawn => {}
                                Some(last) if compare(last.1, from) == Ordering::Equal => {
                                    last.1 = to
                                }
                                _ => visible.push((from, to)),
                            }
                        }
                        let round =
                            |at: Vector| Vertex::new(at[0] as i32, at[1] as i32, at[2] as i32);
                        seams.push(Seam { ends: ends.map(round), visible });
                    }
                }
            }
        }
        seams
    }

    /// Whether both ends of an edge of one face are corners of the other.
    fn has_edge_of(&self, one: usize, other: usize) -> bool {
        let corners = &self.faces[one];
        let is_there = |corner: &u16| self.faces[other].contains(corner);
        (0..corners.len())
            .any(|n| [n, (n + 1) % corners.len()].iter().all(|n| is_there(&corners[*n])))
    }

    /// Whether a face has corners on both sides of the plane of another face.
    fn is_through(&self, face: usize, plane: usize) -> bool {
        let [a, b, c] = [0, 1, 2].map(|n: usize| self.grid(self.faces[plane][n]));
        let plane = Plane::through([a, b, c]);
        let signs = self.faces[face].iter().map(|corner| plane.height(self.grid(*corner)).signum());
        let (low, high) = signs.fold((0, 0), |(low, high), sign| (low.min(sign), high.max(sign)));
        (low, high) == (-1, 1)
    }

    /// The rounded intersection of two triangles. A corner in the plane of the other triangle
    /// counts as lying on its positive side.
    fn crossing(&self, one: &Triangle, other: &Triangle) -> Option<[Vertex; 2]> {
        let along = cross(one.plane.normal, other.plane.normal);
        let axis = (0..3).max_by_key(|axis| along[*axis].abs())?;
        // The points where the border of a triangle passes through a plane, as fractions with a
        // common denominator.
        let passes = |triangle: &Triangle, plane: &Triangle| -> Option<[(Vector, i128); 2]> {
            let height = |corner: u16| match self.is_in_plane(plane.corners, corner) {
                true => 0,
                false => plane.plane.height(self.vertex(corner)),
            };
            let mut points = (0..3).filter_map(|n| {
                let [a, b] = [n, (n + 1) % 3].map(|n| triangle.corners[n]);
                let (at_a, at_b) = (height(a), height(b));
                ((at_a >= 0) != (at_b >= 0)).then(|| {
                    let (from, to) = (at_a.abs(), at_b.abs());
                    let (a, b) = (self.vertex(a), self.vertex(b));
                    ([0, 1, 2].map(|n: usize| a[n] * to + b[n] * from), from + to)
                })
            });
            let pair = [points.next()?, points.next()?];
            let is_before = compare_along(&pair[0], &pair[1], axis) == Ordering::Less;
            Some(if is_before { pair } else { [pair[1], pair[0]] })
        };
        let ([a, b], [c, d]) = (passes(one, other)?, passes(other, one)?);
        let low = if compare_along(&a, &c, axis) == Ordering::Less { c } else { a };
        let high = if compare_along(&b, &d, axis) == Ordering::Less { b } else { d };
        if compare_along(&low, &high, axis) != Ordering::Less {
            return None;
        }
        let ends = [low, high].map(|(sum, by)| {
            let [x, y, z] = sum.map(|part| (2 * part + by).div_euclid(2 * by) as i32);
            Vertex::new(x, y, z)
        });
        (ends[0] != ends[1]).then_some(ends)
    }
}

/// Whether the part of the page immediately next to a line, to the left (1) or right (-1), lies
/// within a triangle.
fn covers(relation: &Relation, at: Ratio, beside: i128) -> bool {
    (0..3).all(|n| match relation.sides[n] {
        // This side lies on the line itself, so the third corner decides.
        (0, 0) => relation.corners[(n + 2) % 3] * beside > 0,
        side => sign_at(side, at) > 0,
    })
}
