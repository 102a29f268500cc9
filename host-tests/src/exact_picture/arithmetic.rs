//! The exact arithmetic of the reference: fractions, quantities that are linear along an edge,
//! vectors and planes of whole numbers.

use penup::geometry::{Projection, Vertex};
use std::cmp::Ordering;

/// A point along an edge as a fraction: a numerator and a positive denominator.
pub type Ratio = (u128, u128);

/// Compares two fractions.
pub fn compare(a: Ratio, b: Ratio) -> Ordering {
    (a.0 * b.1).cmp(&(b.0 * a.1))
}

/// A quantity that is linear along an edge, given by its values at the two ends; below 2^62.
pub(super) type Linear = (i128, i128);

pub(super) fn zero_of(linear: Linear) -> Option<Ratio> {
    let (p, q) = (linear.0.unsigned_abs(), linear.1.unsigned_abs());
    (linear.0.signum() * linear.1.signum() < 0).then_some((p, p + q))
}

pub(super) fn sign_at(linear: Linear, at: Ratio) -> i128 {
    (linear.0 * (at.1 - at.0) as i128 + linear.1 * at.0 as i128).signum()
}

pub(super) type Vector = [i128; 3];

pub(super) fn vector(vertex: Vertex) -> Vector {
    [vertex.x, vertex.y, vertex.z].map(i128::from)
}

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|n: usize| a[n] - b[n])
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn dot(a: Vector, b: Vector) -> i128 {
    (0..3).map(|n| a[n] * b[n]).sum()
}

/// A plane through three points: its normal, and a point in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) normal: Vector,
    at: Vector,
}

impl Plane {
    pub(super) fn through([a, b, c]: [Vector; 3]) -> Self {
        Self { normal: cross(minus(b, a), minus(c, a)), at: a }
    }

    pub(super) fn height(&self, point: Vector) -> i128 {
        dot(self.normal, minus(point, self.at))
    }

    /// The height of the eye over the plane.
    pub(super) fn height_of_eye(&self, projection: Projection) -> i128 {
        match projection {
            Projection::Perspective => -dot(self.normal, self.at),
            Projection::Parallel => -self.normal[2],
        }
    }
}

/// Compares two points along an axis, each given as a sum and its divisor.
pub(super) fn compare_along(a: &(Vector, i128), b: &(Vector, i128), axis: usize) -> Ordering {
    // The products would be as large as 2^144, which does not fit, so the whole parts are compared
    // first.
    let whole = |(sum, by): &(Vector, i128)| (sum[axis].div_euclid(*by), sum[axis].rem_euclid(*by));
    let ((whole_a, rest_a), (whole_b, rest_b)) = (whole(a), whole(b));
    whole_a.cmp(&whole_b).then((rest_a * b.1).cmp(&(rest_b * a.1)))
}
