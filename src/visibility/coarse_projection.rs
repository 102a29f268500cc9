//! The projection of the vertices onto a coarse grid of the page, which makes most geometric tests
//! cheap.
//!
//! Each vertex gets a cell on a grid of 2^14 by 2^14. The question on which side of a line a vertex
//! lies is answered from the coarse grid where its resolution suffices, and exactly where it does
//! not.

use super::Scene;
use super::yield_counter::YieldCounter;
use super::{Unrounded, VisibilityError};
use crate::array::MapEach;
use crate::geometry::{
    Axis, COORDINATE_LIMIT, EdgeParameter, Projection, Vertex, page_offset, page_side,
    page_side_of, plane_side, plane_side_margin,
};
use crate::index::Index;
use crate::stage::{Aborted, Scratch};
use bytemuck::{Pod, Zeroable};

/// The coordinates on the coarse grid are below 2^`COARSE_BITS`, so that the product of two
/// differences fits in 29 bits.
pub const COARSE_BITS: u32 = 14;

/// A vertex on the coarse grid, rounded down. The vertex itself lies less than one unit to the
/// right of this point and less than one unit above it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CoarsePoint {
    /// The coordinate to the right.
    pub x: u16,
    /// The coordinate upwards.
    pub y: u16,
}

impl CoarsePoint {
    /// The point with the least coordinates, to begin a search for the greatest.
    pub const LOWEST: Self = Self { x: 0, y: 0 };
    /// The point with the greatest coordinates, to begin a search for the least.
    pub const HIGHEST: Self = Self { x: u16::MAX, y: u16::MAX };

    /// Returns the lower left corner of the rectangle around both points.
    #[inline]
    pub fn low(self, other: Self) -> Self {
        Self { x: self.x.min(other.x), y: self.y.min(other.y) }
    }

    /// Returns the upper right corner of the rectangle around both points.
    #[inline]
    pub fn high(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y) }
    }

    /// Whether a rectangle whose upper right corner is `self` lies certainly to the left of, or
    /// below, a rectangle whose lower left corner is `other`.
    #[inline]
    pub fn is_before(self, other: Self) -> bool {
        self.x < other.x || self.y < other.y
    }
}

/// The line through two points of the coarse grid, which tells left from right with 32-bit numbers.
#[derive(Debug, Clone, Copy)]
pub struct CoarseLine {
    /// The x of the first point, in units of the coarse grid.
    x: i32,
    /// The y of the first point, in units of the coarse grid.
    y: i32,
    /// How far the second point lies to the right of the first; negative if it lies to the left.
    along_x: i32,
    /// How far the second point lies above the first; negative if it lies below.
    along_y: i32,
    /// How large the determinant in [`Self::side`] must at least be, whatever its sign, so that the
    /// sign is certain, as far as this depends on the line alone.
    error_bound: i32,
}

impl CoarseLine {
    /// Makes the line from `a` to `b`, for which "left" and "right" are meant in this direction.
    #[inline]
    pub fn new(a: CoarsePoint, b: CoarsePoint) -> Self {
        let (x, y) = (i32::from(a.x), i32::from(a.y));
        let (along_x, along_y) = (i32::from(b.x) - x, i32::from(b.y) - y);
        Self { x, y, along_x, along_y, error_bound: along_x.abs() + along_y.abs() + 2 }
    }

    /// Returns the sign of [`page_side`] for a vertex at the coarse point `position`, or zero if
    /// the coarse grid cannot decide it.
    ///
    /// Each true difference of coordinates is within one unit of the difference on the coarse grid.
    /// So the determinant changes by less than the sum of the absolute differences plus two.
    #[inline]
    pub fn side(&self, position: CoarsePoint) -> i32 {
        let (to_x, to_y) = (i32::from(position.x) - self.x, i32::from(position.y) - self.y);
        let side = self.along_x * to_y - self.along_y * to_x;
        let error_bound = self.error_bound + to_x.abs() + to_y.abs();
        i32::from(side >= error_bound) - i32::from(side <= -error_bound)
    }
}

impl CoarseLine {
    /// Whether the line may have a point in the rectangle with these corners.
    pub fn may_cross(&self, low: CoarsePoint, high: CoarsePoint) -> bool {
        // The corners that lie the farthest to the left of the line, and to the right.
        let (mut left, mut right) = (low, high);
        if self.along_x > 0 {
            (left.y, right.y) = (high.y, low.y);
        }
        if self.along_y < 0 {
            (left.x, right.x) = (high.x, low.x);
        }
        self.side(left) >= 0 && self.side(right) <= 0
    }
}

/// Returns [`CoarseLine::side`] of `c` for the line from `a` to `b`.
#[inline]
pub fn coarse_side(a: CoarsePoint, b: CoarsePoint, c: CoarsePoint) -> i32 {
    CoarseLine::new(a, b).side(c)
}

/// The line through two vertices. It is asked on the coarse grid first, and exactly if that does
/// not decide.
#[derive(Debug, Clone, Copy)]
pub struct VertexLine<'o, I> {
    /// The vertices, which are needed where the coarse grid cannot decide.
    coarse_projection: &'o CoarseProjection<'o>,
    /// The number of the vertex at which the line begins.
    a: I,
    /// The number of the vertex to which the line leads.
    b: I,
    /// The line on the coarse grid, where it is asked first.
    coarse: CoarseLine,
}

impl<I: Index> VertexLine<'_, I> {
    /// Returns on which side of the line an end of an edge lies on the page: 1 left, -1 right, 0 on
    /// the line.
    #[inline]
    pub fn side(&self, end: End<I>) -> i32 {
        let coarse = self.coarse.side(end.position);
        if coarse != 0 { coarse } else { self.exact_side(end) }
    }

    /// Answers [`Self::side`] exactly, without the coarse grid.
    #[cold]
    fn exact_side(&self, end: End<I>) -> i32 {
        if end.number == self.a || end.number == self.b {
            return 0;
        }
        self.coarse_projection.side_value(self.a, self.b, end).signum() as i32
    }
}

/// The number of instructions that two 64-bit divisions take on a core without a divider. They are
/// counted as work while the vertices are projected.
const TWO_DIVISIONS: usize = 1500;

/// How positions on the page become points of the coarse grid.
#[derive(Debug, Clone, Copy)]
struct Mapping {
    /// Whether the view is perspective or parallel.
    projection: Projection,
    /// The least x and y of all vertices on the page, in units of 2^-20.
    low: (i64, i64),
    /// The number of bits by which x and y are shifted right to give coarse coordinates.
    shift: (u32, u32),
    /// How far a point may lie beside its true place on the page, in units of 2^-20, if its view
    /// coordinates are off by one unit.
    unit: i64,
}

impl Mapping {
    /// Chooses the map so that all vertices fit the coarse grid and use as much of it as possible.
    fn new(
        projection: Projection,
        vertices: &[Vertex],
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, Aborted> {
        let (mut low, mut high) = ((i64::MAX, i64::MAX), (i64::MIN, i64::MIN));
        let mut nearest = COORDINATE_LIMIT;
        for &vertex in vertices {
            let (x, y) = fine(projection, vertex);
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
            nearest = nearest.min(vertex.z);
            yield_counter.spend(TWO_DIVISIONS)?;
        }
        let unit = match projection {
            // Both x and z are off.
            Projection::Perspective => {
                let farthest = high.0.max(-low.0).max(high.1.max(-low.1));
                ((1 << 20) + farthest) / i64::from(nearest.max(1)) + 1
            }
            Projection::Parallel => 1 << 20,
        };
        // The rounded ends of a seam may lie beside all vertices. On a whole page that does not
        // matter; on a small part of it, it may be many points of the coarse grid.
        #[cfg(feature = "tiles")]
        let (low, high) = with_margin(projection, vertices, low, high);
        let shift_for = |low: i64, high: i64| {
            let extent = high.saturating_sub(low).max(0);
            (64 - extent.leading_zeros()).saturating_sub(COARSE_BITS)
        };
        let shift = (shift_for(low.0, high.0), shift_for(low.1, high.1));
        Ok(Self { projection, low, shift, unit })
    }

    /// Returns how far a point may lie beside its true place on the coarse grid if its view
    /// coordinates are off by this many units.
    fn error_bound(&self, units: u32) -> i32 {
        // The unit is below 2^41.
        let fine = self.unit * i64::from(units.min(1 << 20));
        (fine >> self.shift.0.min(self.shift.1)).min(1 << COARSE_BITS) as i32 + 1
    }

    /// Returns the point of the coarse grid for a vertex. A vertex outside the grid gets the
    /// nearest point on its border.
    fn position(&self, vertex: Vertex) -> CoarsePoint {
        let (x, y) = fine(self.projection, vertex);
        let coarse = |fine: i64, low: i64, shift: u32| {
            ((fine - low) >> shift).clamp(0, (1 << COARSE_BITS) - 1) as u16
        };
        CoarsePoint {
            x: coarse(x, self.low.0, self.shift.0),
            y: coarse(y, self.low.1, self.shift.1),
        }
    }
}

/// Returns the rectangle around all vertices on the page, and around all points whose view
/// coordinates are rounded from between theirs.
#[cfg(feature = "tiles")]
fn with_margin(
    projection: Projection,
    vertices: &[Vertex],
    low: (i64, i64),
    high: (i64, i64),
) -> ((i64, i64), (i64, i64)) {
    let nearest = vertices.iter().map(|vertex| vertex.z).min();
    let (Projection::Perspective, Some(nearest @ 1..)) = (projection, nearest) else {
        return (low, high);
    };
    // In a parallel view, rounding stays between. Here x and z change by up to half a unit.
    let parts = [low.0, low.1, high.0, high.1].map(i64::unsigned_abs);
    let farthest = parts.into_iter().max().unwrap_or(0);
    let margin = (((1 << 20) + farthest) >> 1) as i64 / i64::from(nearest) + 1;
    ((low.0 - margin, low.1 - margin), (high.0 + margin, high.1 + margin))
}

/// Projects a vertex onto the page: x and y in units of 2^-20, rounded down.
#[cfg(feature = "tiles")]
pub(crate) fn page_position(projection: Projection, vertex: Vertex) -> [i64; 2] {
    fine(projection, vertex).into()
}

/// Projects a vertex onto the page, in units of 2^-20, rounded down.
fn fine(projection: Projection, vertex: Vertex) -> (i64, i64) {
    let fine = |coordinate: i32| i64::from(coordinate) << 20;
    match projection {
        Projection::Perspective => {
            // The depth is not zero. `check` refuses a vertex level with the eye, the end of a seam
            // is rounded from between two vertices, and the tiles ask only for what is not nearer
            // than the near plane, whose depth is at least 1 (`View::near`).
            let depth = i64::from(vertex.z);
            (fine(vertex.x).div_euclid(depth), fine(vertex.y).div_euclid(depth))
        }
        Projection::Parallel => (fine(vertex.x), fine(vertex.y)),
    }
}

/// A point of the page that is no vertex.
#[derive(Debug, Clone, Copy)]
pub struct PagePoint {
    /// The homogeneous coordinates (x, y, w): the point lies at (x/w, y/w).
    exact: [i64; 3],
    /// The position on the coarse grid.
    position: CoarsePoint,
}

/// One of the two ends of an edge that is tested against faces.
#[derive(Debug, Clone, Copy)]
pub struct End<I> {
    /// The number of the vertex at this end, or [`End::FREE`], which is the number of no vertex.
    pub number: I,
    /// The position in view coordinates.
    pub vertex: Vertex,
    /// The position on the coarse grid.
    pub position: CoarsePoint,
}

impl<I: Index> End<I> {
    /// The number of an end that is not a vertex of the model.
    pub const FREE: I = I::NONE;
}

/// The vertices of a scene as the eye sees them, in view coordinates and on the coarse grid.
#[derive(Debug, Clone, Copy)]
pub struct CoarseProjection<'a> {
    /// Whether the view is perspective or parallel.
    pub projection: Projection,
    /// The view coordinates of each vertex.
    // Indexing this and `positions` by the number of a vertex cannot fail: each number comes from a
    // corner of the scene, whose vertex exists (see `check`), and there is a position for each
    // vertex. An end with the number `End::FREE` is not looked up; it has its vertex and its
    // position in itself.
    pub vertices: &'a [Vertex],
    /// The position of each vertex on the coarse grid.
    pub positions: &'a [CoarsePoint],
    /// The positions in the model, as far as they are known.
    pub unrounded: Unrounded<'a>,
    /// The map from the page to the coarse grid, for points that are not vertices.
    mapping: Mapping,
}

impl<'a> CoarseProjection<'a> {
    /// Projects every vertex onto the coarse grid.
    pub fn new<'s: 'a, I: Index>(
        scene: &Scene<'a, I>,
        scratch: &mut Scratch<'s>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let Scene { projection, vertices, .. } = *scene;
        let positions: &mut [CoarsePoint] = scratch.take(vertices.len())?;
        let mapping = Mapping::new(projection, vertices, yield_counter)?;
        for (slot, &vertex) in positions.iter_mut().zip(vertices) {
            *slot = mapping.position(vertex);
            yield_counter.spend(TWO_DIVISIONS)?;
        }
        Ok(Self { projection, vertices, positions, unrounded: scene.unrounded, mapping })
    }

    /// Returns a vertex as the end of an edge, with its position in both forms.
    pub fn end<I: Index>(&self, number: I) -> End<I> {
        End { number, vertex: self.vertex(number), position: self.position(number) }
    }

    /// Returns any point within the extent of the vertices as the end of an edge.
    pub fn free_end<I: Index>(&self, vertex: Vertex) -> End<I> {
        End { number: End::FREE, vertex, position: self.mapping.position(vertex) }
    }

    /// Returns the view coordinates of a vertex.
    #[inline]
    pub fn vertex<I: Index>(&self, number: I) -> Vertex {
        self.vertices[number.get()]
    }

    /// Returns the position of a vertex on the coarse grid. Every corner of a scene that is
    /// searched is a vertex that exists ([`super::check`]).
    #[inline]
    pub fn position<I: Index>(&self, number: I) -> CoarsePoint {
        // On the Pico no panic is left by this; elsewhere a check of bounds takes less code.
        if cfg!(feature = "tiles") {
            self.positions.get(number.get()).copied().unwrap_or_default()
        } else {
            self.positions[number.get()]
        }
    }

    /// Returns the line from vertex `a` to vertex `b`.
    #[inline]
    pub fn line<I: Index>(&self, a: I, b: I) -> VertexLine<'_, I> {
        VertexLine {
            coarse_projection: self,
            a,
            b,
            coarse: CoarseLine::new(self.position(a), self.position(b)),
        }
    }

    /// Returns on which side of the line from vertex a to vertex b the vertex c lies on the page: 1
    /// left, -1 right, 0 on the line.
    #[inline]
    pub fn side<I: Index>(&self, a: I, b: I, c: I) -> i32 {
        self.line(a, b).side(self.end(c))
    }

    /// Returns the middle of a rectangle of the coarse grid.
    pub fn middle(&self, low: CoarsePoint, high: CoarsePoint) -> PagePoint {
        let Mapping { low: origin, shift, .. } = self.mapping;
        // Twice the coordinates in units of 2^-20, so that the middle is a whole number.
        let twice = |low: u16, high: u16, origin: i64, shift: u32| {
            2 * origin + ((i64::from(low) + i64::from(high)) << shift)
        };
        let x = twice(low.x, high.x, origin.0, shift.0);
        let y = twice(low.y, high.y, origin.1, shift.1);
        let between = |low: u16, high: u16| low + (high - low) / 2;
        PagePoint {
            exact: [x, y, 2 << 20],
            position: CoarsePoint { x: between(low.x, high.x), y: between(low.y, high.y) },
        }
    }

    /// Returns on which side of the line from vertex a to vertex b a point of the page lies: 1
    /// left, -1 right, 0 on the line.
    pub fn side_of_point<I: Index>(&self, a: I, b: I, point: &PagePoint) -> i32 {
        match coarse_side(self.position(a), self.position(b), point.position) {
            0 => page_side_of(self.projection, self.vertex(a), self.vertex(b), point.exact),
            side => side,
        }
    }

    /// Returns the exact [`page_side`] of an end, for the line through two vertices.
    pub fn side_value<I: Index>(&self, a: I, b: I, end: End<I>) -> i64 {
        page_side(self.projection, self.vertex(a), self.vertex(b), end.vertex)
    }

    /// Returns where on the edge from p to q the line through a and b crosses it. The caller
    /// guarantees that it crosses between p and q.
    pub fn crossing<I: Index>(&self, a: I, b: I, p: End<I>, q: End<I>) -> EdgeParameter {
        EdgeParameter::zero_between(self.side_value(a, b, p), self.side_value(a, b, q))
    }

    /// Returns a signed measure, proportional to the distance, of how far an end lies behind the
    /// plane of a triangle. For a triangle that turns anticlockwise on the page, positive means
    /// behind the plane; for one that turns clockwise, positive means in front of it.
    ///
    /// The result is zero if the end lies in the plane in the model, as far as that is known;
    /// rounding alone would move it out of the plane.
    pub fn height<I: Index>(&self, triangle: [I; 3], end: End<I>) -> i64 {
        if triangle.contains(&end.number) {
            return 0;
        }
        let [a, b, c] = triangle.map_each(|number| self.vertex(number));
        let height = plane_side(a, b, c, end.vertex);
        let margin = plane_side_margin(a, b, c, end.vertex, self.unrounded.error_bound());
        if height.abs() <= margin && self.unrounded.holds(triangle, end.number) {
            0
        } else {
            height
        }
    }

    /// Returns [`Self::height`] over `triangle` for each corner of the triangle `of`.
    pub fn heights<I: Index>(&self, triangle: [I; 3], of: [I; 3]) -> [i64; 3] {
        of.map_each(|corner| self.height(triangle, self.end(corner)))
    }

    /// Returns how far on the coarse grid a face may lie beside an edge that it touches in the
    /// model: by the errors of both.
    pub fn error_bound(&self) -> i32 {
        self.mapping.error_bound(self.unrounded.error_bound())
    }

    /// Returns how far on the coarse grid a point moves at most when its view coordinates are
    /// rounded.
    #[cfg(feature = "threads")]
    pub fn rounding_error(&self) -> u16 {
        self.mapping.error_bound(1) as u16 // It is at most 2^14 + 1.
    }

    /// Returns an axis of the page along which p and q differ, and the sign of their difference.
    ///
    /// Returns `None` if the eye sees both points at the same position.
    pub fn direction(&self, p: Vertex, q: Vertex) -> Option<(Axis, i64)> {
        [Axis::X, Axis::Y].into_iter().find_map(|axis| {
            let sign = page_offset(self.projection, axis, p, q).signum();
            (sign != 0).then_some((axis, sign))
        })
    }
}

#[cfg(test)]
mod tests;
