//! Exact predicates on integers: on which side of a line, before or behind a plane, where along a line.
//!
//! Everything here is the sign of a determinant of integers, or a ratio of two of them, and so has no
//! rounding and no epsilon. A projected point stays homogeneous, (x, y, w): w is the depth in
//! perspective and 1 in a parallel projection, so one formula serves both.
//!
//! What is refused: nothing. The caller keeps every coordinate within ±[`COORDINATE_LIMIT`] and, in
//! perspective, every depth above zero; then no product overflows. The bound stands at each function.

use bytemuck::{Pod, Zeroable};
use core::cmp::Ordering;

/// View coordinates lie within ± this: products of three stay below 2^60.
pub const COORDINATE_LIMIT: i32 = 1 << 19;

/// A vertex in view coordinates: x right, y up, z the depth away from the eye.
///
/// Each within ±[`COORDINATE_LIMIT`]; in perspective z > 0 and the eye is the origin. The scales of
/// x, y and of z may differ (a linear map keeps every incidence).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// To the right.
    pub x: i32,
    /// Up.
    pub y: i32,
    /// Away from the eye.
    pub z: i32,
}

impl Vertex {
    /// The vertex at (x, y, z).
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }
}

/// How a vertex gets onto the page: (x, y, w) with w = z, or w constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Projection {
    /// Lines of sight meet in the eye (the origin): w = z.
    Perspective,
    /// Lines of sight are parallel to z: w = 1.
    Parallel,
}

/// One of the two directions of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Up.
    Y,
}

impl Axis {
    fn of(self, vertex: Vertex) -> i64 {
        i64::from(match self {
            Axis::X => vertex.x,
            Axis::Y => vertex.y,
        })
    }
}

/// A place along an edge from p to q: p + (numerator / denominator)(q - p) in view *space*.
///
/// 0 <= numerator <= denominator, denominator > 0. Two places are equal if the ratios are.
///
/// ```
/// use penup::geometry::Along;
/// let third = Along { numerator: 1, denominator: 3 };
/// assert_eq!(third, Along { numerator: 2, denominator: 6 });
/// assert!(Along::START < third && third < Along::END);
/// ```
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Along {
    /// Zero at p.
    pub numerator: u64,
    /// Equal to the numerator at q.
    pub denominator: u64,
}

impl Along {
    /// At p.
    pub const START: Self = Self { numerator: 0, denominator: 1 };
    /// At q.
    pub const END: Self = Self { numerator: 1, denominator: 1 };

    /// Where a quantity that varies linearly along the edge in space is zero.
    ///
    /// `at_p` and `at_q` have opposite signs, or one of them is zero; each is within ±2^62.
    ///
    /// ```
    /// use penup::geometry::Along;
    /// assert_eq!(Along::zero_between(-1, 3), Along { numerator: 1, denominator: 4 });
    /// ```
    pub fn zero_between(at_p: i64, at_q: i64) -> Self {
        let numerator = at_p.unsigned_abs();
        Self { numerator, denominator: numerator + at_q.unsigned_abs() }
    }
}

impl Ord for Along {
    fn cmp(&self, other: &Self) -> Ordering {
        let left = u128::from(self.numerator) * u128::from(other.denominator);
        let right = u128::from(other.numerator) * u128::from(self.denominator);
        left.cmp(&right)
    }
}
impl PartialOrd for Along {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Along {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Along {}

/// On which side of the line from a to b the point c lies on the page.
///
/// Positive to the left, negative to the right, zero on the line (or if a and b coincide on the
/// page). Linear in each argument in space, so its values at two points give an
/// [`Along::zero_between`]. In perspective six products of three numbers: within ±2^60.
///
/// ```
/// use penup::geometry::{Projection, Vertex, page_side};
/// let (a, b) = (Vertex::new(0, 0, 5), Vertex::new(2, 0, 9));
/// assert!(page_side(Projection::Parallel, a, b, Vertex::new(1, 1, 7)) > 0);
/// assert!(page_side(Projection::Perspective, a, b, Vertex::new(1, -1, 7)) < 0);
/// ```
pub fn page_side(projection: Projection, a: Vertex, b: Vertex, c: Vertex) -> i64 {
    match projection {
        Projection::Perspective => determinant(a, b, c),
        Projection::Parallel => {
            let along = (i64::from(b.x - a.x), i64::from(b.y - a.y));
            along.0 * i64::from(c.y - a.y) - along.1 * i64::from(c.x - a.x)
        }
    }
}

/// On which side of the plane through a, b and c the point d lies in space.
///
/// If a, b, c run anticlockwise on the page ([`page_side`] positive), positive means that d lies
/// behind the plane as the eye sees it; if clockwise, before it. Zero in the plane. Linear in d.
/// Differences are within ±2^20, so a sum of three products is within ±2^62 and no part of it
/// passes 3 x 2^61.
///
/// ```
/// use penup::geometry::{Vertex, plane_side};
/// let (a, b, c) = (Vertex::new(0, 0, 5), Vertex::new(1, 0, 5), Vertex::new(0, 1, 5));
/// assert!(plane_side(a, b, c, Vertex::new(3, 3, 6)) > 0);
/// assert_eq!(plane_side(a, b, c, Vertex::new(9, 9, 5)), 0);
/// ```
pub fn plane_side(a: Vertex, b: Vertex, c: Vertex, d: Vertex) -> i64 {
    let from_a = |to: Vertex| Vertex::new(to.x - a.x, to.y - a.y, to.z - a.z);
    determinant(from_a(b), from_a(c), from_a(d))
}

/// What [`plane_side`] surely exceeds if d lies off the plane by more than rounding to whole
/// coordinates can hide.
///
/// With M the largest difference: nine minors of two products each, within 18 M^2 together, and less than
/// M^2 + 200 for the rest. Below 2^45.
pub fn plane_side_margin(a: Vertex, b: Vertex, c: Vertex, d: Vertex) -> i64 {
    let differences = [b, c, d].map(|to| {
        (to.x - a.x).unsigned_abs() | (to.y - a.y).unsigned_abs() | (to.z - a.z).unsigned_abs()
    });
    let most = i64::from(differences[0] | differences[1] | differences[2]);
    19 * most * most + 200
}

/// Whether four points of the model lie in one plane, exactly. Coordinates within ±2^30.
///
/// ```
/// use penup::geometry::are_coplanar;
/// let far = 1 << 30;
/// assert!(are_coplanar([[-far, -far, 7], [far, -far, 7], [far, far, 7], [1, 2, 7]]));
/// assert!(!are_coplanar([[-far, -far, 7], [far, -far, 7], [far, far, 7], [1, 2, 8]]));
/// ```
pub fn are_coplanar(points: [[i32; 3]; 4]) -> bool {
    let [a, points @ ..] = points;
    let [u, v, w] = points.map(|to| [0, 1, 2].map(|n| i128::from(to[n]) - i128::from(a[n])));
    let minor = |m: usize, n: usize| u[m] * v[n] - u[n] * v[m];
    minor(1, 2) * w[0] + minor(2, 0) * w[1] + minor(0, 1) * w[2] == 0
}

/// How far [`page_side`] may be off if no coordinate was rounded by more than one half.
///
/// ```
/// use penup::geometry::{Projection, Vertex, page_side_doubt};
/// let [a, b, c] = [0, 100, 200].map(|x| Vertex::new(x, 0, 1));
/// assert_eq!(page_side_doubt(Projection::Parallel, a, b, c), 301);
/// assert_eq!(page_side_doubt(Projection::Parallel, b, c, a), 201);
/// ```
pub fn page_side_doubt(projection: Projection, a: Vertex, b: Vertex, c: Vertex) -> i64 {
    match projection {
        Projection::Perspective => determinant_doubt(a, b, c),
        Projection::Parallel => {
            let extent = |to: Vertex| i64::from((to.x - a.x).abs()) + i64::from((to.y - a.y).abs());
            extent(b) + extent(c) + 1
        }
    }
}

/// How far [`plane_side`] may be off if no coordinate was rounded by more than one half.
pub fn plane_side_doubt(a: Vertex, b: Vertex, c: Vertex, d: Vertex) -> i64 {
    let from_a = |to: Vertex| Vertex::new(to.x - a.x, to.y - a.y, to.z - a.z);
    determinant_doubt(from_a(b), from_a(c), from_a(d))
}

/// How far a determinant may be off if no number in it is off by more than one: less than what the
/// minors, the numbers and one add up to.
fn determinant_doubt(a: Vertex, b: Vertex, c: Vertex) -> i64 {
    let minors = |a: Vertex, b: Vertex| {
        let minor = |p: i32, q: i32, r: i32, s: i32| {
            (i64::from(p) * i64::from(s) - i64::from(q) * i64::from(r)).abs()
        };
        minor(a.x, a.y, b.x, b.y) + minor(a.y, a.z, b.y, b.z) + minor(a.x, a.z, b.x, b.z)
    };
    let numbers = |a: Vertex| i64::from(a.x.abs()) + i64::from(a.y.abs()) + i64::from(a.z.abs());
    minors(a, b) + minors(b, c) + minors(a, c) + 2 * (numbers(a) + numbers(b) + numbers(c)) + 6
}

fn determinant(a: Vertex, b: Vertex, c: Vertex) -> i64 {
    let minor =
        |p: i32, q: i32, r: i32, s: i32| i64::from(p) * i64::from(s) - i64::from(q) * i64::from(r);
    i64::from(a.x) * minor(b.y, b.z, c.y, c.z) - i64::from(a.y) * minor(b.x, b.z, c.x, c.z)
        + i64::from(a.z) * minor(b.x, b.y, c.x, c.y)
}

/// How far the point b lies beyond the point a on the page in the direction of `axis`.
///
/// Only the sign and the ratio of two values with the same b or the same a mean something. Linear
/// in each argument in space; within ±2^39.
///
/// ```
/// use penup::geometry::{Axis, Projection, Vertex, page_offset};
/// let (a, b) = (Vertex::new(1, 0, 1), Vertex::new(2, 0, 4));
/// assert!(page_offset(Projection::Parallel, Axis::X, a, b) > 0);
/// assert!(page_offset(Projection::Perspective, Axis::X, a, b) < 0);
/// ```
pub fn page_offset(projection: Projection, axis: Axis, a: Vertex, b: Vertex) -> i64 {
    match projection {
        Projection::Perspective => axis.of(b) * i64::from(a.z) - axis.of(a) * i64::from(b.z),
        Projection::Parallel => axis.of(b) - axis.of(a),
    }
}

/// Whether the point c lies behind (positive) or before (negative) the line from a to b, where all
/// three lie on one line of the page that is not at right angles to `axis`.
///
/// Zero if the three lie on one line in space. Linear in c; within ±2^42.
///
/// ```
/// use penup::geometry::{Axis, Projection, Vertex, line_side};
/// let (a, b) = (Vertex::new(-2, 0, 5), Vertex::new(2, 0, 5));
/// for projection in [Projection::Parallel, Projection::Perspective] {
///     assert!(line_side(projection, Axis::X, a, b, Vertex::new(0, 0, 6)) > 0);
///     assert!(line_side(projection, Axis::X, b, a, Vertex::new(0, 0, 6)) > 0);
///     assert_eq!(line_side(projection, Axis::X, a, b, Vertex::new(1, 0, 5)), 0);
/// }
/// ```
pub fn line_side(projection: Projection, axis: Axis, a: Vertex, b: Vertex, c: Vertex) -> i64 {
    let depth = |vertex: Vertex| i64::from(vertex.z);
    let turn = (axis.of(b) - axis.of(a)) * (depth(c) - depth(a))
        - (depth(b) - depth(a)) * (axis.of(c) - axis.of(a));
    turn * page_offset(projection, axis, a, b).signum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: i32 = COORDINATE_LIMIT;

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let corners = |n: u32| {
            let sign = |bit: u32| if n >> bit & 1 == 0 { FAR } else { -FAR };
            Vertex::new(sign(0), sign(1), sign(2))
        };
        let mut largest = 0;
        for n in 0..1 << 12 {
            let [a, b, c, d] = [n, n >> 3, n >> 6, n >> 9].map(corners);
            let side = plane_side(a, b, c, d);
            assert_eq!(side, -plane_side(b, a, c, d));
            largest = largest.max(side);
            assert_eq!(
                page_side(Projection::Perspective, a, b, c),
                page_side(Projection::Perspective, b, c, a)
            );
        }
        // The largest tetrahedron in a cube takes a third of it: 6 x (1/3) x (2^20)^3.
        assert_eq!(largest, 2 << 60);
    }

    #[test]
    fn doubts_are_those_of_the_differences() {
        let (a, b, c) = (Vertex::new(5, 7, 1), Vertex::new(105, 27, 1), Vertex::new(-5, 57, 1));
        // 100 + 20 for b, 10 + 50 for c, and one.
        assert_eq!(page_side_doubt(Projection::Parallel, a, b, c), 181);
        let from_a = |x, y, z| Vertex::new(100 + x, 200 + y, 300 + z);
        let (a, b, c) = (from_a(0, 0, 0), from_a(10, 0, 3), from_a(0, 20, 0));
        let d = from_a(0, 0, 30);
        // Minors 200 + 60, 600 and 300; twice 13, 20 and 30; and six.
        assert_eq!(plane_side_doubt(a, b, c, d), 1160 + 126 + 6);
        let (b, c, d) = (from_a(2, 3, 5), from_a(7, 11, 13), from_a(17, 19, 23));
        // Minors |22 - 21| + |39 - 55| + |26 - 35|, and so on.
        let minors = (1 + 16 + 9) + (54 + 6 + 60) + (13 + 26 + 39);
        assert_eq!(plane_side_doubt(a, b, c, d), minors + 2 * (10 + 31 + 59) + 6);
        assert_eq!(plane_side_margin(a, b, c, d), 19 * 31 * 31 + 200);
    }

    #[test]
    fn four_points_of_the_model_lie_in_a_plane_or_not() {
        let points = |x: i32, y: i32, z: i32| [[3, 5, 7], [13, 4, 9], [2, 15, 11], [x, y, z]];
        // (3, 5, 7) + m (10, -1, 2) + n (-1, 10, 4)
        for (m, n) in [(1, 1), (-2, 3), (4, -1), (0, 5)] {
            let at = [3 + 10 * m - n, 5 - m + 10 * n, 7 + 2 * m + 4 * n];
            assert!(are_coplanar(points(at[0], at[1], at[2])));
            for (dx, dy, dz) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)] {
                assert!(!are_coplanar(points(at[0] + dx, at[1] + dy, at[2] + dz)));
            }
        }
    }

    #[test]
    fn the_margin_is_beyond_any_doubt() {
        for n in 1..4000i32 {
            let point = |k: i32| {
                let part = |m: i32| (n * (k + 2) * m * 7919 + k * 104_729) % (1 << (n % 19 + 1));
                Vertex::new(part(1), part(3), part(11))
            };
            let [a, b, c, d] = [0, 1, 2, 3].map(point);
            assert!(plane_side_doubt(a, b, c, d) <= plane_side_margin(a, b, c, d));
        }
    }

    #[test]
    fn places_far_along_a_long_edge_are_told_apart() {
        let near_end = Along { numerator: (1 << 62) - 1, denominator: 1 << 62 };
        let nearer_end = Along { numerator: u64::MAX - 1, denominator: u64::MAX };
        assert!(near_end < nearer_end && nearer_end < Along::END);
        assert_eq!(Along::zero_between(0, 7), Along::START);
        assert_eq!(Along::zero_between(7, 0), Along::END);
    }
}
