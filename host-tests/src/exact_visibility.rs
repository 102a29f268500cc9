//! A reference for visibility by definition: exact fractions, and every edge against everything
//! without shortcuts.
//!
//! An edge is cut at every point of the page where anything can change: where a side of a face or
//! another edge crosses or touches it, and where it passes through the plane of a face. Between two
//! such points, the midpoint decides for the whole piece. A face counts as the plane polygon that
//! it is (inside by the parity of crossings), so faces must be plane and must not intersect
//! themselves.

use crate::fraction::Fraction;
use num_bigint::BigInt;
use num_traits::Zero;
use penup::geometry::{Projection, Vertex};
use penup::model::Corner;

/// A piece of an edge: the indices of the edge's ends, the start and end of the piece as fractions
/// of the edge's length in space, and whether the piece is visible.
pub type Piece = ((u16, u16), Fraction, Fraction, bool);

type Number = Fraction;
type Point = [Number; 2];

fn whole(value: i32) -> Number {
    Number::whole(value)
}

fn half(value: Number) -> Number {
    value / whole(2)
}

fn turn(a: &Point, b: &Point, c: &Point) -> Number {
    (&b[0] - &a[0]) * (&c[1] - &a[1]) - (&b[1] - &a[1]) * (&c[0] - &a[0])
}

/// A plane polygon in space and on the page.
struct Polygon {
    page: Vec<Point>,
    low: Point,
    high: Point,
    /// The plane as (a, b, c, d) with a x + b y + c z = d in space; `None` if the polygon has no
    /// area.
    plane: Option<[Number; 4]>,
}

/// An edge or a bar.
#[derive(Clone)]
struct Edge {
    ends: (u16, u16),
    page: [Point; 2],
    /// The depth at both ends in a form that is linear on the page: 1 / z in a perspective
    /// projection, z in a parallel one.
    linear_depth: [Number; 2],
}

struct World {
    projection: Projection,
    polygons: Vec<Polygon>,
    edges: Vec<Edge>,
}

fn at_fraction(edge: &[Point; 2], t: &Number) -> Point {
    [0, 1].map(|n| &edge[0][n] + t * (&edge[1][n] - &edge[0][n]))
}

impl World {
    fn new(projection: Projection, vertices: &[Vertex], corners: &[Corner]) -> Self {
        let page_of = |vertex: &Vertex| match projection {
            Projection::Perspective => {
                [whole(vertex.x) / whole(vertex.z), whole(vertex.y) / whole(vertex.z)]
            }
            Projection::Parallel => [whole(vertex.x), whole(vertex.y)],
        };
        let linear_depth = |vertex: &Vertex| match projection {
            Projection::Perspective => whole(vertex.z).recip(),
            Projection::Parallel => whole(vertex.z),
        };
        let mut polygons = Vec::new();
        let mut edges: Vec<Edge> = Vec::new();
        for element in corners.split_inclusive(|corner| corner.is_last()) {
            let numbers: Vec<u16> = element.iter().map(|corner| corner.vertex()).collect();
            let at = |n: usize| &vertices[usize::from(numbers[n % numbers.len()])];
            let sides = if numbers.len() == 2 { 1 } else { numbers.len() };
            for n in 0..sides {
                let ends = (numbers[n], numbers[(n + 1) % numbers.len()]);
                let known = |edge: &Edge| edge.ends == ends || edge.ends == (ends.1, ends.0);
                if ends.0 != ends.1 && !edges.iter().any(known) {
                    edges.push(Edge {
                        ends,
                        page: [page_of(at(n)), page_of(at(n + 1))],
                        linear_depth: [linear_depth(at(n)), linear_depth(at(n + 1))],
                    });
                }
            }
            if numbers.len() > 2 {
                let page: Vec<Point> = (0..numbers.len()).map(|n| page_of(at(n))).collect();
                let bound = |n: usize, high: bool| {
                    let all = page.iter().map(|point| point[n].clone());
                    if high { all.max() } else { all.min() }.unwrap_or_default()
                };
                polygons.push(Polygon {
                    low: [bound(0, false), bound(1, false)],
                    high: [bound(0, true), bound(1, true)],
                    page,
                    plane: plane_of(&(0..numbers.len()).map(at).collect::<Vec<_>>()),
                });
            }
        }
        Self { projection, polygons, edges }
    }

    /// The polygons that can affect the edge: those whose bounding rectangle on the page meets that
    /// of the edge.
    fn about<'w>(&'w self, edge: &Edge) -> Vec<&'w Polygon> {
        let [p, q] = &edge.page;
        let apart = |polygon: &&Polygon| {
            (0..2).any(|n| {
                polygon.low[n] > *(&p[n]).max(&q[n]) || polygon.high[n] < *(&p[n]).min(&q[n])
            })
        };
        self.polygons.iter().filter(|polygon| !apart(polygon)).collect()
    }

    /// The depth of a plane at a point of the page; `None` if the plane is seen edge-on.
    fn depth_at(&self, plane: &[Number; 4], page: &Point) -> Option<Number> {
        let [a, b, c, d] = plane;
        let across = a * &page[0] + b * &page[1];
        match self.projection {
            // The point (x z, y z, z) lies in the plane.
            Projection::Perspective => {
                let rate = across + c;
                (!rate.is_zero()).then(|| d / rate)
            }
            Projection::Parallel => (!c.is_zero()).then(|| (d - across) / c),
        }
    }

    fn edge_depth(&self, edge: &Edge, t: &Number) -> Number {
        let linear = &edge.linear_depth[0] + t * (&edge.linear_depth[1] - &edge.linear_depth[0]);
        match self.projection {
            Projection::Perspective => linear.recip(),
            Projection::Parallel => linear,
        }
    }

    /// All points along the edge on the page where something can change, in order.
    fn cuts(&self, edge: &Edge, about: &[&Polygon]) -> Vec<Number> {
        let [p, q] = &edge.page;
        let mut cuts = vec![Number::zero(), Number::one()];
        let mut cut_at_line = |a: &Point, b: &Point| {
            let (side_a, side_b) = (turn(p, q, a), turn(p, q, b));
            if side_a.is_zero() && side_b.is_zero() {
                for end in [a, b] {
                    let axis = usize::from(p[0] == q[0]);
                    cuts.push((&end[axis] - &p[axis]) / (&q[axis] - &p[axis]));
                }
            } else if !(&side_a * &side_b).is_positive() {
                let (side_p, side_q) = (turn(a, b, p), turn(a, b, q));
                cuts.push(&side_p / (&side_p - &side_q));
            }
        };
        for polygon in about {
            for n in 0..polygon.page.len() {
                let next = (n + 1) % polygon.page.len();
                cut_at_line(&polygon.page[n], &polygon.page[next]);
            }
        }
        // The points where the edge passes through a plane. The distance is a linear function of
        // the point in space.
        for plane in about.iter().filter_map(|polygon| polygon.plane.as_ref()) {
            let height = |t: &Number| {
                let page = at_fraction(&edge.page, t);
                let depth = self.edge_depth(edge, t);
                let [a, b, c, d] = plane;
                let (x, y) = match self.projection {
                    Projection::Perspective => (&page[0] * &depth, &page[1] * &depth),
                    Projection::Parallel => (page[0].clone(), page[1].clone()),
                };
                a * x + b * y + c * depth - d
            };
            let (at_p, at_q) = (height(&Number::zero()), height(&Number::one()));
            if (&at_p * &at_q).is_negative() {
                cuts.push(self.page_fraction(edge, &(&at_p / (&at_p - &at_q))));
            }
        }
        // The ends of the overlap with another edge that lies on the same line of the page.
        for other in &self.edges {
            if let Some((from, to)) = self.shadow(edge, other) {
                cuts.extend([from.clone(), to.clone()]);
                let gap = |t: &Number| {
                    let there = self.fraction_of(other, &at_fraction(&edge.page, t));
                    let depths = &other.linear_depth;
                    let there = &depths[0] + there * (&depths[1] - &depths[0]);
                    let here =
                        &edge.linear_depth[0] + t * (&edge.linear_depth[1] - &edge.linear_depth[0]);
                    here - there
                };
                let (at_from, at_to) = (gap(&from), gap(&to));
                if (&at_from * &at_to).is_negative() {
                    cuts.push(&from + (&to - &from) * &at_from / (&at_from - &at_to));
                }
            }
        }
        cuts.retain(|t| !t.is_negative() && *t <= Number::one());
        cuts.sort();
        cuts.dedup();
        cuts
    }

    /// The fraction of `edge` on the page at which a point of its line lies.
    fn fraction_of(&self, edge: &Edge, point: &Point) -> Number {
        let [p, q] = &edge.page;
        let axis = usize::from(p[0] == q[0]);
        (&point[axis] - &p[axis]) / (&q[axis] - &p[axis])
    }

    /// The part of `edge` that coincides with `other` on the page, if both lie on one line there.
    fn shadow(&self, edge: &Edge, other: &Edge) -> Option<(Number, Number)> {
        let [p, q] = &edge.page;
        let [a, b] = &other.page;
        if a == b || !turn(p, q, a).is_zero() || !turn(p, q, b).is_zero() {
            return None;
        }
        let (at_a, at_b) = (self.fraction_of(edge, a), self.fraction_of(edge, b));
        let from = at_a.clone().min(at_b.clone()).max(Number::zero());
        let to = at_a.max(at_b).min(Number::one());
        (from < to).then_some((from, to))
    }

    /// Converts a fraction of the edge in space to one on the page.
    fn page_fraction(&self, edge: &Edge, s: &Number) -> Number {
        match self.projection {
            Projection::Parallel => s.clone(),
            Projection::Perspective => {
                let (z_p, z_q) = (edge.linear_depth[0].recip(), edge.linear_depth[1].recip());
                s * &z_q / (&z_p + s * (&z_q - &z_p))
            }
        }
    }

    /// Converts a fraction of the edge on the page to one in space.
    fn space_fraction(&self, edge: &Edge, t: &Number) -> Number {
        match self.projection {
            Projection::Parallel => t.clone(),
            Projection::Perspective => {
                let (z_p, z_q) = (edge.linear_depth[0].recip(), edge.linear_depth[1].recip());
                t * &z_p / (&z_q + t * (&z_p - &z_q))
            }
        }
    }

    /// Whether the part of the page immediately next to `point`, in the direction `beside`, lies
    /// within the polygon.
    fn covers(&self, polygon: &Polygon, point: &Point, beside: &Point) -> bool {
        if (0..2).any(|n| point[n] < polygon.low[n] || point[n] > polygon.high[n]) {
            return false;
        }
        // The step is so small that it reaches no line that does not pass through the point.
        let count = polygon.page.len();
        let sides = || (0..count).map(|n| (&polygon.page[n], &polygon.page[(n + 1) % count]));
        let mut step = Number::one();
        for (a, b) in sides() {
            let distance = turn(a, b, point);
            let there: Point = [&point[0] + &beside[0], &point[1] + &beside[1]];
            let rate = turn(a, b, &there) - &distance;
            if !distance.is_zero() && !rate.is_zero() {
                step = step.min(half((distance / rate).abs()));
            } else if distance.is_zero() && rate.is_zero() {
                // The side is straight ahead: the step must end before the ends of the side.
                let axis = usize::from(beside[0].is_zero());
                for end in [a, b] {
                    step = step.min(half(((&end[axis] - &point[axis]) / &beside[axis]).abs()));
                }
            }
        }
        // A ray to the right, infinitesimally above the height of any corner on its way.
        let from: Point = [0, 1].map(|n| &point[n] + &step * &beside[n]);
        let mut inside = false;
        for (a, b) in sides() {
            let above = |corner: &Point| corner[1] > from[1];
            if above(a) != above(b) {
                let side = turn(a, b, &from);
                assert!(!side.is_zero(), "the step leaves every line");
                if side.is_positive() == above(b) {
                    inside = !inside;
                }
            }
        }
        inside
    }

    fn is_hidden(&self, edge: &Edge, about: &[&Polygon], t: &Number) -> bool {
        let [p, q] = &edge.page;
        let point = at_fraction(&edge.page, t);
        let depth = self.edge_depth(edge, t);
        let left: Point = [&p[1] - &q[1], &q[0] - &p[0]];
        let right: Point = [-&left[0], -&left[1]];
        let nearer: Vec<&&Polygon> = about
            .iter()
            .filter(|polygon| {
                let plane = polygon.plane.as_ref();
                plane
                    .and_then(|plane| self.depth_at(plane, &point))
                    .is_some_and(|face| face < depth)
            })
            .collect();
        [left, right]
            .iter()
            .all(|beside| nearer.iter().any(|polygon| self.covers(polygon, &point, beside)))
    }

    fn is_enclosed(&self, number: usize, t: &Number) -> bool {
        let edge = &self.edges[number];
        let point = at_fraction(&edge.page, t);
        let depth = self.edge_depth(edge, t);
        self.edges.iter().enumerate().any(|(other_number, other)| {
            let Some((from, to)) = self.shadow(edge, other) else {
                return false;
            };
            if other_number == number || *t < from || *t > to {
                return false;
            }
            let there = self.edge_depth(other, &self.fraction_of(other, &point));
            there < depth || there == depth && other_number < number
        })
    }

    /// Whether the nearest faces that begin at the edge on both sides are coplanar.
    fn is_within_plane(&self, edge: &Edge, about: &[&Polygon], t: &Number) -> bool {
        let [p, q] = &edge.page;
        let point = at_fraction(&edge.page, t);
        let left: Point = [&p[1] - &q[1], &q[0] - &p[0]];
        let right: Point = [-&left[0], -&left[1]];
        let holds = |plane: &[Number; 4], t: &Number| {
            let depth = self.depth_at(plane, &at_fraction(&edge.page, t));
            depth.is_some_and(|depth| depth == self.edge_depth(edge, t))
        };
        let nearest = |beside: &Point| {
            let there = |n: usize| &point[n] + &beside[n] / whole(1 << 20);
            about
                .iter()
                .filter_map(|polygon| Some((polygon, polygon.plane.as_ref()?)))
                .filter(|(_, plane)| holds(plane, &Number::zero()) && holds(plane, &Number::one()))
                .filter(|(polygon, _)| self.covers(polygon, &point, beside))
                .min_by_key(|(_, plane)| self.depth_at(plane, &[there(0), there(1)]))
        };
        match (nearest(&left), nearest(&right)) {
            (Some((_, one)), Some((_, other))) => (0..4)
                .flat_map(|a| (0..4).map(move |b| (a, b)))
                .all(|(a, b)| &one[a] * &other[b] == &one[b] * &other[a]),
            _ => false,
        }
    }

    fn pieces(&self, merged_blocks: bool) -> Vec<Piece> {
        let mut pieces: Vec<Piece> = Vec::new();
        for (number, edge) in self.edges.iter().enumerate() {
            if edge.page[0] == edge.page[1] {
                continue;
            }
            let about = self.about(edge);
            let cuts = self.cuts(edge, &about);
            for pair in cuts.windows(2) {
                let middle = half(&pair[0] + &pair[1]);
                let hidden = self.is_hidden(edge, &about, &middle);
                if !hidden
                    && (self.is_enclosed(number, &middle)
                        || merged_blocks && self.is_within_plane(edge, &about, &middle))
                {
                    continue;
                }
                let [from, to] = [0, 1].map(|n| self.space_fraction(edge, &pair[n]));
                match pieces.last_mut() {
                    Some(last) if last.0 == edge.ends && last.2 == from && last.3 != hidden => {
                        last.2 = to;
                    }
                    _ => pieces.push((edge.ends, from, to, !hidden)),
                }
            }
        }
        pieces
    }
}

/// The plane through three corners that are not on one line.
fn plane_of(corners: &[&Vertex]) -> Option<[Number; 4]> {
    let big = |value: i32| BigInt::from(value);
    let a = corners[0];
    for b in corners {
        for c in corners {
            let u = [big(b.x) - big(a.x), big(b.y) - big(a.y), big(b.z) - big(a.z)];
            let v = [big(c.x) - big(a.x), big(c.y) - big(a.y), big(c.z) - big(a.z)];
            let normal = [
                &u[1] * &v[2] - &u[2] * &v[1],
                &u[2] * &v[0] - &u[0] * &v[2],
                &u[0] * &v[1] - &u[1] * &v[0],
            ];
            if normal.iter().any(|part| !part.is_zero()) {
                let height = |w: &Vertex| {
                    &normal[0] * big(w.x) + &normal[1] * big(w.y) + &normal[2] * big(w.z)
                };
                let d = height(a);
                assert!(
                    corners.iter().all(|corner| height(corner) == d),
                    "the model takes plane faces only"
                );
                let [x, y, z] = normal;
                return Some([x, y, z, d].map(|part| Number::new(part, 1)));
            }
        }
    }
    None
}

/// Computes the visible and the hidden pieces of every edge, in the order of the elements.
///
/// With `merged_blocks`, the visible pieces between two coplanar faces are omitted.
///
/// # Panics
/// Panics if a face is not plane.
pub fn pieces(
    projection: Projection,
    vertices: &[Vertex],
    corners: &[Corner],
    merged_blocks: bool,
) -> Vec<Piece> {
    World::new(projection, vertices, corners).pieces(merged_blocks)
}
