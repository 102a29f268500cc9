//! A reference model of a convex solid by brute force: it tests every plane through three vertices
//! and every side of every face.
//!
//! It shares nothing with the library: no search, no outline, no joining. All numbers have 128
//! bits, which suffices for every determinant of coordinates within ±2^30 and an eye within ±2^61.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use std::collections::{BTreeMap, BTreeSet};

use penup::convex::{EdgeVisibility, Eye, SinkFull, SolidEdge, SolidSink};
use penup::model::Corner;

/// A point in space.
pub type Point = [i32; 3];

/// The shape that the vertices span.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Model {
    /// There are fewer than four different points.
    TooFew,
    /// All points are on one line.
    InLine,
    /// All points are in one plane; these are the corners of the polygon.
    Flat(BTreeSet<u16>),
    /// The eye is inside the solid or on its surface.
    EyeInside,
    /// These vertices are inside the solid.
    NotConvex(BTreeSet<u16>),
    /// A valid solid.
    Solid(Solid),
}

/// The faces and edges of a solid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Solid {
    /// The corners of each face, counter-clockwise as seen from outside and beginning with the
    /// smallest index, and whether the face is visible.
    pub faces: BTreeSet<(Vec<u16>, bool)>,
    /// The edges, with the smaller index first.
    pub edges: BTreeMap<(u16, u16), EdgeVisibility>,
    /// The number of vertices that coincide with an earlier one.
    pub welded: usize,
    /// The number of vertices on the surface that are no corners.
    pub flat: usize,
}

/// Collects the results of the library in the same form.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// As in [`Solid::faces`].
    pub faces: BTreeSet<(Vec<u16>, bool)>,
    /// As in [`Solid::edges`].
    pub edges: BTreeMap<(u16, u16), EdgeVisibility>,
}

impl SolidSink for Found {
    fn face(&mut self, corners: &[Corner], visible: bool) -> Result<(), SinkFull> {
        let last: Vec<bool> = corners.iter().map(|corner| corner.is_last()).collect();
        assert_eq!(last.iter().position(|last| *last), Some(corners.len() - 1));
        let mut numbers: Vec<u16> = corners.iter().map(|corner| corner.vertex()).collect();
        let least = (0..numbers.len()).min_by_key(|at| numbers[*at]).expect("corners");
        numbers.rotate_left(least);
        assert!(self.faces.insert((numbers, visible)), "a face came twice");
        Ok(())
    }

    fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull> {
        let (a, b) = edge.ends;
        let known = self.edges.insert((a.min(b), a.max(b)), edge.visibility);
        assert_eq!(known, None, "an edge came twice");
        Ok(())
    }
}

fn minus(a: Point, b: Point) -> [i128; 3] {
    [0, 1, 2].map(|k| i128::from(a[k]) - i128::from(b[k]))
}

fn det(a: [i128; 3], b: [i128; 3], c: [i128; 3]) -> i128 {
    a[0] * b[1] * c[2] + a[1] * b[2] * c[0] + a[2] * b[0] * c[1]
        - a[2] * b[1] * c[0]
        - a[1] * b[0] * c[2]
        - a[0] * b[2] * c[1]
}

/// Six times the volume of a tetrahedron. It is positive if `d` is above the triangle a, b, c,
/// which is counter-clockwise.
fn volume(a: Point, b: Point, c: Point, d: Point) -> i128 {
    det(minus(b, a), minus(c, a), minus(d, a))
}

fn height_of_eye(a: Point, b: Point, c: Point, eye: Eye) -> i128 {
    let to_eye = match eye {
        Eye::At(position) => [0, 1, 2].map(|k| i128::from(position[k]) - i128::from(a[k])),
        Eye::Towards(direction) => direction.map(i128::from),
    };
    det(minus(b, a), minus(c, a), to_eye)
}

fn in_line(a: Point, b: Point, c: Point) -> bool {
    let (u, v) = (minus(b, a), minus(c, a));
    u[1] * v[2] == u[2] * v[1] && u[2] * v[0] == u[0] * v[2] && u[0] * v[1] == u[1] * v[0]
}

/// Whether `c`, which is on one line with a and b, is between them.
fn between(a: Point, b: Point, c: Point) -> bool {
    (0..3).all(|k| a[k].min(b[k]) <= c[k] && c[k] <= a[k].max(b[k]))
}

/// The sides of the convex polygon of coplanar points, counter-clockwise as seen from a point for
/// which `outward(p, q, r)` is positive if p, q, r turn counter-clockwise.
fn sides(
    points: &[Point],
    on_plane: &[u16],
    outward: impl Fn(Point, Point, Point) -> i128,
) -> Vec<(u16, u16)> {
    let at = |v: u16| points[usize::from(v)];
    let mut sides = vec![];
    for &p in on_plane {
        for &q in on_plane {
            let is_side = p != q
                && on_plane.iter().all(|&r| {
                    r == p
                        || r == q
                        || if in_line(at(p), at(q), at(r)) {
                            between(at(p), at(q), at(r))
                        } else {
                            outward(at(p), at(q), at(r)) > 0
                        }
                });
            if is_side {
                sides.push((p, q));
            }
        }
    }
    sides
}

/// The corners of the polygon in the order of its sides, starting with the smallest index.
fn chain(sides: &[(u16, u16)]) -> Vec<u16> {
    let next: BTreeMap<u16, u16> = sides.iter().copied().collect();
    assert_eq!(next.len(), sides.len(), "each corner begins one side");
    let start = *next.keys().next().expect("a face has sides");
    let mut corners = vec![start];
    loop {
        let to = next[corners.last().expect("not empty")];
        if to == start {
            assert_eq!(corners.len(), sides.len(), "one boundary");
            return corners;
        }
        corners.push(to);
    }
}

/// Computes the solid that `points` span, as seen from `eye`.
pub fn model(points: &[Point], eye: Eye) -> Model {
    let mut first_at = BTreeMap::new();
    for (number, point) in points.iter().enumerate() {
        first_at.entry(*point).or_insert(number as u16);
    }
    let mut distinct: Vec<u16> = first_at.values().copied().collect();
    distinct.sort_unstable();
    let welded = points.len() - distinct.len();
    if distinct.len() < 4 {
        return Model::TooFew;
    }
    let at = |v: u16| points[usize::from(v)];
    let (a, b) = (at(distinct[0]), at(distinct[1]));
    let Some(c) = distinct.iter().map(|v| at(*v)).find(|c| !in_line(a, b, *c)) else {
        return Model::InLine;
    };
    let Some(d) = distinct.iter().map(|v| at(*v)).find(|d| volume(a, b, c, *d) != 0) else {
        // All points are in a plane. Any direction out of the plane distinguishes left from right.
        let u = minus(b, a);
        let v = minus(c, a);
        let normal =
            [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let polygon = sides(points, &distinct, |p, q, r| det(minus(q, p), minus(r, p), normal));
        return Model::Flat(polygon.iter().map(|side| side.0).collect());
    };
    let mut planes = BTreeSet::new();
    for (i, &p) in distinct.iter().enumerate() {
        for (j, &q) in distinct.iter().enumerate().skip(i + 1) {
            for &r in &distinct[j + 1..] {
                if in_line(at(p), at(q), at(r)) {
                    continue;
                }
                let heights: Vec<_> =
                    distinct.iter().map(|v| volume(at(p), at(q), at(r), at(*v))).collect();
                let all_below = heights.iter().all(|h| *h <= 0);
                let all_above = heights.iter().all(|h| *h >= 0);
                if all_below || all_above {
                    let on_plane: Vec<u16> = distinct
                        .iter()
                        .zip(&heights)
                        .filter(|(_, h)| **h == 0)
                        .map(|(v, _)| *v)
                        .collect();
                    planes.insert(on_plane);
                }
            }
        }
    }
    let centre = [a, b, c, d];
    let mut faces = BTreeSet::new();
    let mut facing: BTreeMap<(u16, u16), Vec<i128>> = BTreeMap::new();
    let mut corners = BTreeSet::new();
    let mut on_surface = BTreeSet::new();
    for on_plane in &planes {
        on_surface.extend(on_plane.iter().copied());
        // The four points of the frame are not all on this plane, so outward is the direction away
        // from them.
        let polygon = chain(&sides(points, on_plane, |p, q, r| {
            -centre.iter().map(|inner| volume(p, q, r, *inner)).sum::<i128>()
        }));
        let towards_eye =
            height_of_eye(at(polygon[0]), at(polygon[1]), at(polygon[2]), eye).signum();
        for (k, &p) in polygon.iter().enumerate() {
            let q = polygon[(k + 1) % polygon.len()];
            facing.entry((p.min(q), p.max(q))).or_default().push(towards_eye);
        }
        corners.extend(polygon.iter().copied());
        faces.insert((polygon, towards_eye > 0));
    }
    if faces.iter().all(|(_, visible)| !visible) {
        return Model::EyeInside;
    }
    if on_surface.len() < distinct.len() {
        return Model::NotConvex(
            distinct.iter().copied().filter(|v| !on_surface.contains(v)).collect(),
        );
    }
    let edges = facing
        .into_iter()
        .map(|(ends, mut facing)| {
            facing.sort_unstable();
            assert_eq!(facing.len(), 2, "an edge has two faces");
            let visibility = match (facing[0], facing[1]) {
                (1, 1) => EdgeVisibility::Visible,
                (_, 1) => EdgeVisibility::Outline,
                (_, 0) => EdgeVisibility::BehindOutline,
                _ => EdgeVisibility::Hidden,
            };
            (ends, visibility)
        })
        .collect();
    Model::Solid(Solid { faces, edges, welded, flat: distinct.len() - corners.len() })
}
