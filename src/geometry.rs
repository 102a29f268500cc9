//! Exact geometric predicates on integers: on which side of a line a point lies, whether it is
//! behind or in front of a plane, and where along an edge a crossing is.
//!
//! Every result is the sign of a determinant of integers or the ratio of two of them, so there is
//! no rounding and no epsilon. A projected point stays homogeneous, (x, y, w), where w is the depth
//! in perspective and 1 in a parallel projection. So one formula serves both.
//!
//! Nothing is refused. The caller keeps every coordinate within ±[`COORDINATE_LIMIT`] and, in
//! perspective, every depth above zero. Then no product overflows. Each function documents its
//! bound.

use crate::array::MapEach;
use crate::fixed::product;
use bytemuck::{Pod, Zeroable};
use core::cmp::Ordering;

/// View coordinates lie within ± this limit, so that products of three stay below 2^60.
pub const COORDINATE_LIMIT: i32 = 1 << 19;

/// A vertex in view coordinates: x to the right, y up, and z the depth away from the eye.
///
/// Each coordinate is within ±[`COORDINATE_LIMIT`]. In perspective z is above zero and the eye is
/// the origin. The scale of z may differ from that of x and y (a linear map preserves every
/// incidence).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// The coordinate to the right.
    pub x: i32,
    /// The coordinate upwards.
    pub y: i32,
    /// The depth, away from the eye.
    pub z: i32,
}

impl Vertex {
    /// Creates the vertex at (x, y, z).
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }
}

/// How vertices are projected onto the page. The image of a vertex is (x / w, y / w); the variants
/// say what w is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Projection {
    /// The lines of sight meet in the eye (the origin): w = z.
    Perspective,
    /// The lines of sight are parallel to z: w = 1.
    Parallel,
}

/// One of the two directions of the page, to choose a coordinate by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Upwards.
    Y,
}

impl Axis {
    /// Returns the coordinate of `vertex` along this axis.
    fn of(self, vertex: Vertex) -> i64 {
        i64::from(match self {
            Axis::X => vertex.x,
            Axis::Y => vertex.y,
        })
    }
}

/// A point of an edge from p to q: p + (numerator / denominator)(q - p) in view *space*.
///
/// 0 <= numerator <= denominator, and denominator > 0. Two values are equal if their ratios are.
///
/// ```
/// use penup::geometry::EdgeParameter;
/// let third = EdgeParameter { numerator: 1, denominator: 3 };
/// assert_eq!(third, EdgeParameter { numerator: 2, denominator: 6 });
/// assert!(EdgeParameter::START < third && third < EdgeParameter::END);
/// ```
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct EdgeParameter {
    /// The numerator of the ratio, zero at p.
    pub numerator: u64,
    /// The denominator of the ratio, which equals the numerator at q.
    pub denominator: u64,
}

impl EdgeParameter {
    /// The position p at which the edge begins.
    pub const START: Self = Self { numerator: 0, denominator: 1 };
    /// The position q at which the edge ends.
    pub const END: Self = Self { numerator: 1, denominator: 1 };

    /// Returns where a quantity that varies linearly along the edge in space is zero.
    ///
    /// `at_p` and `at_q` are its values at the two ends. They have opposite signs, or one of them
    /// is zero; each is within ±2^62.
    ///
    /// ```
    /// use penup::geometry::EdgeParameter;
    /// let quarter = EdgeParameter { numerator: 1, denominator: 4 };
    /// assert_eq!(EdgeParameter::zero_between(-1, 3), quarter);
    /// ```
    pub fn zero_between(at_p: i64, at_q: i64) -> Self {
        let numerator = at_p.unsigned_abs();
        Self { numerator, denominator: numerator + at_q.unsigned_abs() }
    }
}

impl Ord for EdgeParameter {
    #[cfg_attr(not(feature = "threads"), inline(never))] // On a board its arithmetic is long.
    fn cmp(&self, other: &Self) -> Ordering {
        let left = u128::from(self.numerator) * u128::from(other.denominator);
        let right = u128::from(other.numerator) * u128::from(self.denominator);
        left.cmp(&right)
    }
}
impl PartialOrd for EdgeParameter {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for EdgeParameter {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for EdgeParameter {}

/// Returns the side of the line from a to b on which the point c lies on the page.
///
/// The result is positive to the left, negative to the right, and zero on the line (or if a and b
/// coincide on the page). It is linear in each argument in space, so its values at two points can
/// be passed to [`EdgeParameter::zero_between`]. In perspective it is a sum of six products of
/// three numbers, within ±2^60.
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

/// Returns on which side of the line from a to b a point of the page lies, which need not be the
/// image of a vertex: 1 to the left, -1 to the right, 0 on the line.
///
/// The point is (x/w, y/w), given as \[x, y, w\], w above zero, and each within ±2^45. The
/// determinant is within ±2^86.
///
/// ```
/// use penup::geometry::{Projection, Vertex, page_side_of};
/// let (a, b) = (Vertex::new(0, 0, 5), Vertex::new(2, 0, 9));
/// assert_eq!(page_side_of(Projection::Parallel, a, b, [1, 1, 8]), 1);
/// assert_eq!(page_side_of(Projection::Perspective, a, b, [1, -1, 8]), -1);
/// assert_eq!(page_side_of(Projection::Perspective, a, b, [7, 0, 8]), 0);
/// ```
pub fn page_side_of(projection: Projection, a: Vertex, b: Vertex, [x, y, w]: [i64; 3]) -> i32 {
    let homogeneous = |vertex: Vertex| {
        let w = match projection {
            Projection::Perspective => vertex.z,
            Projection::Parallel => 1,
        };
        [vertex.x, vertex.y, w].map_each(i64::from)
    };
    let ([ax, ay, aw], [bx, by, bw]) = (homogeneous(a), homogeneous(b));
    let part = |of: i64, minor: i64| i128::from(of) * i128::from(minor);
    let sum = part(x, ay * bw - aw * by) + part(y, aw * bx - ax * bw) + part(w, ax * by - ay * bx);
    sum.signum() as i32
}

/// Returns the side of the plane through a, b and c on which the point d lies in space.
///
/// If a, b and c run anticlockwise on the page ([`page_side`] is positive), a positive result means
/// that d lies behind the plane as the eye sees it. If they run clockwise, it means that d lies in
/// front of the plane. The result is zero in the plane, and linear in d. Differences of coordinates
/// are within ±2^20, so the sum of three products is within ±2^62, and no partial sum exceeds 3 ×
/// 2^61.
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

/// The plane through three points, for asking of many points on which side they lie.
///
/// ```
/// use penup::geometry::{Plane, Vertex, plane_side};
/// let (a, b, c) = (Vertex::new(0, 2, 5), Vertex::new(1, 0, 4), Vertex::new(0, 1, 5));
/// let d = Vertex::new(3, 3, 6);
/// assert_eq!(Plane::through(a, b, c).side(d), plane_side(a, b, c, d));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// A point of the plane.
    a: Vertex,
    /// A vector perpendicular to the plane. Each part is within ±2^41.
    normal: [i64; 3],
}

impl Plane {
    /// Makes the plane through a, b and c. If they lie in one line, all points are on no side.
    pub fn through(a: Vertex, b: Vertex, c: Vertex) -> Self {
        let wide = |to: Vertex| [to.x - a.x, to.y - a.y, to.z - a.z].map_each(i64::from);
        let ([x1, y1, z1], [x2, y2, z2]) = (wide(b), wide(c));
        Self { a, normal: [y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2] }
    }

    /// Returns [`plane_side`] of d. The bounds that it states hold here, too.
    pub fn side(&self, d: Vertex) -> i64 {
        let [x, y, z] = self.normal;
        x * i64::from(d.x - self.a.x)
            + y * i64::from(d.y - self.a.y)
            + z * i64::from(d.z - self.a.z)
    }
}

/// Returns an error bound for [`plane_side`]. If the absolute value of [`plane_side`] is greater, d
/// lies off the plane by more than rounding can explain. `error_bound` is twice the greatest
/// possible error of a coordinate.
///
/// Let M be the largest difference of coordinates and D the value of `error_bound`. Nine minors of
/// two products each contribute at most 18 D M^2 together, the products of two errors at most
/// 18 D^2 M, and those of three errors at most 6 D^3. The result saturates; then no point is
/// certain to lie off the plane.
///
/// ```
/// use penup::geometry::{Vertex, plane_side_margin};
/// let [a, b, c, d] = [0, 7, 15, 8].map(|x| Vertex::new(x, 0, 1));
/// assert_eq!(plane_side_margin(a, b, c, d, 1), 18 * 15 * 16 + 6);
/// ```
pub fn plane_side_margin(a: Vertex, b: Vertex, c: Vertex, d: Vertex, error_bound: u32) -> i64 {
    let differences = [b, c, d].map(|to| {
        (to.x - a.x).unsigned_abs() | (to.y - a.y).unsigned_abs() | (to.z - a.z).unsigned_abs()
    });
    let most = i64::from(differences[0] | differences[1] | differences[2]);
    let error_bound = i64::from(error_bound);
    // With 2^21 and 2^32 the first product is below 2^58.
    let first = (18 * most * (most + error_bound)).saturating_mul(error_bound);
    if error_bound == 1 {
        first + 6
    } else {
        let third = (6 * error_bound).saturating_mul(error_bound).saturating_mul(error_bound);
        first.saturating_add(third)
    }
}

/// The greatest possible error of the coordinates of a model, in the unit in which they are whole
/// numbers.
///
/// The default is exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Precision {
    /// The error from the rounding of the decimals as they were written plus the rounding to whole
    /// numbers. It is at most 2^30.
    pub written: u32,
    /// The error from the rounding to whole numbers alone. It is at most `written`.
    pub unit: u32,
}

/// The least width of a triangle, in multiples of the precision, at which its rounded corners still
/// determine its plane. The plane of a narrower triangle is taken to be exact.
const WIDTHS: i64 = 64;

/// Whether four points of the model may lie in one plane, if each coordinate may be off by what
/// `precision` says. The first three points are the triangle that defines the plane. Coordinates
/// are within ±2^30.
///
/// The determinant of the four points is zero if they lie in one plane. Its twelve derivatives are
/// the minors of its rows. So, with E the precision, the determinant is at most E times the sum of
/// the absolute values of the derivatives, plus a little for the products of two and three errors.
/// If the triangle is narrower than 64 E, this bound would accept nearly any point, so only the
/// precision of the unit is used.
///
/// ```
/// use penup::geometry::{Precision, are_coplanar};
/// let (far, exact) = (1 << 30, Precision::default());
/// assert!(are_coplanar([[-far, -far, 7], [far, -far, 7], [far, far, 7], [1, 2, 7]], exact));
/// let near = [[-far, -far, 7], [far, -far, 7], [far, far, 7], [1, 2, 8]];
/// assert!(!are_coplanar(near, exact));
/// assert!(are_coplanar(near, Precision { written: 1, unit: 1 }));
/// ```
#[inline(never)] // Its 128-bit arithmetic is long.
pub fn are_coplanar(points: [[i32; 3]; 4], precision: Precision) -> bool {
    let [a, b, c, d] = points;
    let (u, v, w) = (difference(b, a), difference(c, a), difference(d, a));
    let (third, fourth) = (difference(c, b), difference(d, b));
    let uv = cross(u, v);
    let height = dot(uv, w);
    if height == 0 || precision.written == 0 {
        return height == 0;
    }
    let side = largest(u).max(largest(v)).max(largest(third));
    let area = i128::from(largest(uv));
    let is_wide = |off: &u32| area >= product(WIDTHS * i64::from(*off), side);
    let off = [precision.written, precision.unit].into_iter().find(is_wide);
    let off = i64::from(off.unwrap_or(0));
    // The derivatives together are below 2^66, the lengths below 2^33.
    let derivatives: i128 = [uv, cross(v, w), cross(w, u), cross(third, fourth)]
        .iter()
        .flatten()
        .map(|part| i128::from(part.abs()))
        .sum();
    let lengths = largest(u) + largest(v) + largest(w);
    // The second term is below 2^35 × 2^33, and the product below 2^30 × 2^70.
    height.abs() <= i128::from(off) * (derivatives + product(24 * off, lengths + 2 * off))
}

/// Whether three points of the model may lie on one line, if each coordinate may be off by what
/// `precision` says. The first two points define the line. See [`are_coplanar`] for the role of
/// `precision`.
///
/// ```
/// use penup::geometry::{Precision, are_in_line};
/// let points = [[0, 0, 0], [1000, 2000, 4000], [500, 1000, 2001]];
/// assert!(!are_in_line(points, Precision::default()));
/// assert!(are_in_line(points, Precision { written: 1, unit: 1 }));
/// ```
#[inline(never)] // Its 128-bit arithmetic is long.
pub fn are_in_line(points: [[i32; 3]; 3], precision: Precision) -> bool {
    let [a, b, c] = points;
    let (u, v) = (difference(b, a), difference(c, a));
    let turn = cross(u, v);
    let is_long = |off: &u32| largest(u) >= WIDTHS * i64::from(*off);
    let off = [precision.written, precision.unit].into_iter().find(is_long);
    let off = i64::from(off.unwrap_or(0));
    // Each minor has four factors, each of which contains two errors.
    let most = 4 * largest(u) + 4 * largest(v) + 8 * off;
    i128::from(largest(turn)) <= product(off, most)
}

/// Returns the vector from a to `to`, for coordinates within ±2^30. Each component is within ±2^31.
pub(crate) fn difference(to: [i32; 3], a: [i32; 3]) -> [i64; 3] {
    // Both points have the components 0, 1 and 2.
    [0, 1, 2].map_each(|n| i64::from(to[n]) - i64::from(a[n]))
}

/// Returns the cross product of two [`difference`]s from one point. A component is twice the area
/// of a triangle in a square of side 2^31, so it is within ±2^62.
#[inline(never)] // Its 64-bit arithmetic is long.
pub(crate) fn cross(u: [i64; 3], v: [i64; 3]) -> [i64; 3] {
    // It is asked only for the components 0, 1 and 2, which both vectors have.
    let minor = |m: usize, n: usize| u[m] * v[n] - u[n] * v[m];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Returns the scalar product of two vectors, whose components must be within ±2^62.
pub(crate) fn dot(a: [i64; 3], b: [i64; 3]) -> i128 {
    // Both vectors have the components 0, 1 and 2.
    (0..3).map(|n| product(a[n], b[n])).sum()
}

/// Returns a measure of the area of a triangle of the model, which is 0 if its corners lie in one
/// line: the largest component of the cross product of two sides.
pub(crate) fn doubled_area(a: [i32; 3], b: [i32; 3], c: [i32; 3]) -> i64 {
    largest(cross(difference(b, a), difference(c, a)))
}

/// Returns a measure of the distance of two points of the model: the largest difference of their
/// coordinates.
pub(crate) fn extent(a: [i32; 3], b: [i32; 3]) -> i64 {
    largest(difference(b, a))
}

/// Returns the largest absolute value of the components, which must be within ±2^62.
fn largest(parts: [i64; 3]) -> i64 {
    parts.iter().fold(0, |most, part| most.max(part.abs()))
}

/// Returns the determinant of the matrix with the rows a, b and c.
fn determinant(a: Vertex, b: Vertex, c: Vertex) -> i64 {
    let minor =
        |p: i32, q: i32, r: i32, s: i32| i64::from(p) * i64::from(s) - i64::from(q) * i64::from(r);
    i64::from(a.x) * minor(b.y, b.z, c.y, c.z) - i64::from(a.y) * minor(b.x, b.z, c.x, c.z)
        + i64::from(a.z) * minor(b.x, b.y, c.x, c.y)
}

/// Returns a measure of how far the point b lies beyond the point a on the page, in the direction
/// of `axis`.
///
/// Only its sign is meaningful, and the ratio of two values with the same a or the same b. It is
/// linear in each argument in space, and within ±2^39.
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

/// Returns a positive number if the point c lies behind the line from a to b, and a negative one if
/// it lies in front of it. All three points must lie on one line of the page that is not at right
/// angles to `axis`.
///
/// The result is zero if the three points lie on one line in space. It is linear in c, and within
/// ±2^42.
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
mod tests;
