//! Exact predicates on unrounded positions: planes, heights above them, and turns as seen from the
//! eye.
//!
//! Positions stay within ±2^30, so the difference of two fits in 32 bits. A component of a normal
//! is twice the area of a triangle inside a square of side 2^31, so it is at most 2^62. A height
//! multiplies the normal by a difference (or by the eye, within ±2^61, or by another normal) and
//! adds three such products. So it is below 2^126 and fits in `i128`.

use super::Eye;
use crate::array::MapEach;
use crate::geometry::{cross, difference, dot};

/// A position in model coordinates, each within ±2^30.
pub(super) type Point = [i32; 3];

/// The plane of three points. Its normal points to the side from which they turn counter-clockwise,
/// the upper side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// A point of the plane, from which heights are measured.
    origin: Point,
    /// The vector at right angles to the plane, on its upper side. Its length is twice the area of
    /// the triangle of the three points; it is zero if they lie on one line.
    normal: [i64; 3],
}

impl Plane {
    /// Returns the plane through three points.
    pub(super) fn through(a: Point, b: Point, c: Point) -> Self {
        Self { origin: a, normal: cross(difference(b, a), difference(c, a)) }
    }

    /// Whether the three points lie on one line, so that they define no plane.
    pub(super) fn is_degenerate(&self) -> bool {
        self.normal == [0; 3]
    }

    /// Returns the height of a point: positive above the plane, zero on it. The unit is the length
    /// of the normal.
    pub(super) fn height(&self, point: Point) -> i128 {
        dot(self.normal, difference(point, self.origin))
    }

    /// Returns a positive number if the upper side of the plane is turned to the eye, and zero if
    /// the plane is edge-on.
    pub(super) fn height_of_eye(&self, eye: Eye) -> i128 {
        match eye {
            Eye::At(position) => dot(
                self.normal,
                // An axis is 0, 1 or 2, so the indexing cannot fail.
                [0, 1, 2].map_each(|axis| position[axis] - i64::from(self.origin[axis])),
            ),
            Eye::Towards(direction) => dot(self.normal, direction),
        }
    }

    /// Returns the eye that looks straight down on the upper side of the plane, from infinitely far
    /// away.
    pub(super) fn eye_above(&self) -> Eye {
        Eye::Towards(self.normal)
    }

    /// Whether the upper sides of both planes face the same half of space.
    pub(super) fn is_turned_like(&self, other: &Plane) -> bool {
        dot(self.normal, other.normal) > 0
    }

    /// Returns the sum of the absolute components of the normal: a measure of the area of the
    /// triangle, at most 3 × 2^62.
    pub(super) fn size(&self) -> u64 {
        self.normal.iter().map(|part| part.unsigned_abs()).sum()
    }
}

/// The eye, moved by an infinitely small step towards a point inside the solid.
///
/// From there every face that is edge-on counts as hidden (Harrison 3.2.1), the outline follows the
/// near side of such a face (3.2.2), and of two vertices on one line of sight the nearer is on the
/// outline. So one rule replaces all of his special cases. The step decides only what the position
/// of the eye itself leaves undecided.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewpoint {
    /// Where the user looks from.
    pub(super) eye: Eye,
    /// Four vertices that span the solid. The step leads towards their centre. With `None` there is
    /// no step.
    pub(super) inside: Option<[Point; 4]>,
}

impl Viewpoint {
    /// Returns a positive number if a, b and c turn counter-clockwise as seen from here, and zero
    /// if they are in line.
    pub(super) fn turn(&self, a: Point, b: Point, c: Point) -> i128 {
        let plane = Plane::through(a, b, c);
        match (plane.height_of_eye(self.eye), self.inside) {
            (0, Some(inside)) => inside.iter().map(|point| plane.height(*point)).sum(),
            (height, _) => height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: i32 = 1 << 30;

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let plane = Plane::through([-FAR, -FAR, -FAR], [FAR, -FAR, FAR], [-FAR, FAR, FAR]);
        let edge = 1i128 << 31;
        assert_eq!(plane.height([FAR, FAR, -FAR]), -2 * edge * edge * edge);
        assert!(plane.height_of_eye(Eye::At([-(1 << 61), -(1 << 61), 1 << 61])) > 0);
        assert!(plane.height_of_eye(plane.eye_above()) > 0);
        assert_eq!(plane.size(), 3 << 62);
    }

    #[test]
    fn an_edge_on_face_of_the_solid_turns_away() {
        let inside = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]];
        let viewpoint = Viewpoint { eye: Eye::At([10, 10, 0]), inside: Some(inside) };
        // The face z = 0, counter-clockwise from outside, which is below.
        assert!(viewpoint.turn([0, 0, 0], [0, 2, 0], [2, 0, 0]) < 0);
        assert_eq!(viewpoint.turn([0, 0, 0], [1, 0, 0], [2, 0, 0]), 0);
    }
}
