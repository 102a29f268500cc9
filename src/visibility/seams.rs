//! Computes the seam of two faces that pass through each other: the segment that two of their
//! triangles have in common.

use crate::array::MapEach;
use crate::fixed::{divide_down, product};
use crate::geometry::{Vertex, plane_side};
use bytemuck::{Pod, Zeroable};

/// The bounding box of a face in view coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Extent {
    /// The least x, y and z of the box.
    low: Vertex,
    /// The greatest x, y and z of the box.
    high: Vertex,
}

impl Extent {
    /// Returns the bounding box of `corners`.
    pub fn around(corners: impl Iterator<Item = Vertex>) -> Self {
        let none = Self {
            low: Vertex::new(i32::MAX, i32::MAX, i32::MAX),
            high: Vertex::new(i32::MIN, i32::MIN, i32::MIN),
        };
        corners.fold(none, |Self { low, high }, at| Self {
            low: Vertex::new(low.x.min(at.x), low.y.min(at.y), low.z.min(at.z)),
            high: Vertex::new(high.x.max(at.x), high.y.max(at.y), high.z.max(at.z)),
        })
    }

    /// Returns the depth of its nearest point.
    #[cfg(feature = "threads")]
    pub fn near(&self) -> i32 {
        self.low.z
    }

    /// Returns the depth of its farthest point.
    pub fn far(&self) -> i32 {
        self.high.z
    }

    /// Whether both boxes have a point in common. If they have none, their faces do not cross.
    pub fn meets(&self, other: &Self) -> bool {
        let (low, high) = (other.low, other.high);
        self.low.x <= high.x
            && low.x <= self.high.x
            && self.low.y <= high.y
            && low.y <= self.high.y
            && self.low.z <= high.z
            && low.z <= self.high.z
    }
}

/// Returns the segment where two triangles cross, with its ends rounded to whole coordinates.
/// `of_one` says how far the corners of the first triangle lie behind the plane of the second, zero
/// for a corner in the plane. `of_other` says the same for the corners of the second triangle and
/// the plane of the first.
///
/// Returns `None` if the triangles do not cross, or cross only in a segment that rounding shrinks
/// to a point. A corner in the plane of the other triangle counts as lying on one fixed side of it,
/// so that a seam along a diagonal, where two triangles of one face meet, is found exactly once.
#[inline(never)] // Inlined, its frame would take stack while the seam is followed.
pub fn seam(
    one: [Vertex; 3],
    other: [Vertex; 3],
    of_one: [i64; 3],
    of_other: [i64; 3],
) -> Option<(Vertex, Vertex)> {
    let crosses = |heights: [i64; 3]| {
        let above = heights.map_each(|height| height >= 0);
        above != [above[0]; 3]
    };
    if !crosses(of_one) || !crosses(of_other) {
        return None;
    }
    let mut ends: Option<(Vertex, Vertex)> = None;
    for (triangle, through, heights) in [(other, one, of_other), (one, other, of_one)] {
        for n in 0..3 {
            let next = (n + 1) % 3;
            // Both are below 3, the number of corners and of heights.
            let (a, b) = (triangle[n], triangle[next]);
            if (heights[n] >= 0) != (heights[next] >= 0) && pierces(a, b, through) {
                let point = between(a, b, heights[n], heights[next]);
                ends = Some(match ends {
                    None => (point, point),
                    Some((p, q)) => farthest([(p, q), (p, point), (q, point)]),
                });
            }
        }
    }
    ends.filter(|(p, q)| p != q)
}

/// Whether the segment from a to b, which crosses the plane of a triangle, passes through the
/// triangle itself.
fn pierces(a: Vertex, b: Vertex, triangle: [Vertex; 3]) -> bool {
    let [c, d, e] = triangle;
    let turns = [(c, d), (d, e), (e, c)].map_each(|(from, to)| plane_side(a, b, from, to));
    turns.iter().all(|&turn| turn >= 0) || turns.iter().all(|&turn| turn <= 0)
}

/// Returns the point between a and b where the height is zero, rounded to the nearest whole
/// coordinates.
fn between(a: Vertex, b: Vertex, height_a: i64, height_b: i64) -> Vertex {
    // The heights are within ±2^62.
    let (from, to) = (height_a.abs(), height_b.abs());
    let whole = i128::from(from) + i128::from(to);
    let mixed = |a: i32, b: i32| {
        let sum = product(a.into(), to) + product(b.into(), from);
        divide_down(2 * sum + whole, 2 * whole) as i32
    };
    Vertex::new(mixed(a.x, b.x), mixed(a.y, b.y), mixed(a.z, b.z))
}

/// Returns the pair whose two points are farthest apart.
fn farthest(pairs: [(Vertex, Vertex); 3]) -> (Vertex, Vertex) {
    let distance = |(p, q): &(Vertex, Vertex)| {
        let square = |a: i32, b: i32| {
            let difference = i64::from(a) - i64::from(b);
            difference * difference
        };
        square(p.x, q.x) + square(p.y, q.y) + square(p.z, q.z)
    };
    let [first, rest @ ..] = pairs;
    rest.into_iter().fold(
        first,
        |best, pair| {
            if distance(&pair) > distance(&best) { pair } else { best }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: [Vertex; 3] =
        [Vertex::new(-10, -10, 0), Vertex::new(10, -10, 0), Vertex::new(0, 20, 0)];

    /// Returns a wall that stands across the floor from `bottom` to `top`.
    fn wall(left: i32, right: i32, bottom: i32, top: i32) -> [Vertex; 3] {
        [Vertex::new(left, 0, bottom), Vertex::new(right, 0, bottom), Vertex::new(right, 0, top)]
    }

    /// Returns the seam of two triangles that were never rounded.
    fn seam(one: [Vertex; 3], other: [Vertex; 3]) -> Option<(Vertex, Vertex)> {
        let heights =
            |[a, b, c]: [Vertex; 3], of: [Vertex; 3]| of.map(|corner| plane_side(a, b, c, corner));
        super::seam(one, other, heights(other, one), heights(one, other))
    }

    fn sorted(seam: Option<(Vertex, Vertex)>) -> Option<[(i32, i32, i32); 2]> {
        let (p, q) = seam?;
        let mut ends = [(p.x, p.y, p.z), (q.x, q.y, q.z)];
        ends.sort_unstable();
        Some(ends)
    }

    #[test]
    fn triangles_that_cross_have_a_seam() {
        let seam = |wall| {
            let found = sorted(self::seam(FLOOR, wall));
            assert_eq!(sorted(self::seam(wall, FLOOR)), found);
            found
        };
        // Inside the floor; through one border of it; through both.
        assert_eq!(seam(wall(-2, 2, -1, 1)), Some([(0, 0, 0), (2, 0, 0)]));
        assert_eq!(seam(wall(0, 20, -1, 7)), Some([(3, 0, 0), (7, 0, 0)]));
        assert_eq!(seam(wall(-20, 20, -1, 7)), Some([(-7, 0, 0), (7, 0, 0)]));
    }

    #[test]
    fn triangles_that_only_touch_or_are_apart_have_none() {
        for wall in [wall(-2, 2, 1, 3), wall(12, 18, -1, 1), wall(-2, 2, 0, 3), wall(0, 0, -1, 1)] {
            assert_eq!(seam(FLOOR, wall), None);
            assert_eq!(seam(wall, FLOOR), None);
        }
        assert_eq!(seam(FLOOR, FLOOR), None);
    }

    #[test]
    fn boxes_that_touch_meet() {
        let extent = |triangle: [Vertex; 3]| Extent::around(triangle.into_iter());
        for (wall, meets) in [
            (wall(-2, 2, -1, 1), true),
            (wall(10, 20, 0, 1), true),
            (wall(11, 20, 0, 1), false),
            (wall(-2, 2, 1, 3), false),
        ] {
            assert_eq!(extent(FLOOR).meets(&extent(wall)), meets);
            assert_eq!(extent(wall).meets(&extent(FLOOR)), meets);
        }
    }

    #[test]
    fn a_seam_along_a_diagonal_is_found_once() {
        // Two triangles of one wall that meet in the plane of the floor.
        let (left, right) = (Vertex::new(-2, 0, 0), Vertex::new(2, 0, 0));
        let upper = [left, right, Vertex::new(0, 0, 5)];
        let lower = [right, left, Vertex::new(0, 0, -5)];
        let found = [seam(FLOOR, upper), seam(FLOOR, lower)];
        assert_eq!(found.iter().flatten().count(), 1);
    }
}
