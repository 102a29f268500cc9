//! The page as a grid of 2^16 by 2^16 points, and its division into tiles.
//!
//! The map to the grid rounds down and keeps the order, so rectangles that meet on the page meet
//! here, too. The converse need not hold: more faces are loaded than is necessary, never fewer.

use super::outline::Outline;
use super::{ModelSource, ViewParameters};
use crate::geometry::{Projection, Vertex};
use crate::stage::{Aborted, Cancel};
use crate::visibility::page_position;
use bytemuck::{Pod, Zeroable};

/// The number of bits of a coordinate of the grid.
const GRID_BITS: u32 = 16;

/// A point of the grid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GridPoint {
    /// The coordinate to the right.
    pub x: u16,
    /// The coordinate upwards.
    pub y: u16,
}

/// A rectangle of the grid, with its border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rectangle {
    /// The lower left corner.
    pub low: GridPoint,
    /// The upper right corner.
    pub high: GridPoint,
}

impl Rectangle {
    /// The whole grid.
    pub const ALL: Self =
        Self { low: GridPoint { x: 0, y: 0 }, high: GridPoint { x: u16::MAX, y: u16::MAX } };

    /// A rectangle that meets none and is the start of a union.
    pub const NONE: Self = Self { low: Self::ALL.high, high: Self::ALL.low };

    /// Returns the rectangle around two points.
    pub fn around(a: GridPoint, b: GridPoint) -> Self {
        Self::NONE.with(a).with(b)
    }

    /// Returns the smallest rectangle that contains this one and a point.
    pub fn with(self, point: GridPoint) -> Self {
        self.union(Self { low: point, high: point })
    }

    /// Returns the smallest rectangle that contains both.
    pub fn union(self, other: Self) -> Self {
        let Self { low, high } = self;
        Self {
            low: GridPoint { x: low.x.min(other.low.x), y: low.y.min(other.low.y) },
            high: GridPoint { x: high.x.max(other.high.x), y: high.y.max(other.high.y) },
        }
    }

    /// Returns what two rectangles have in common, if they meet.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let (low, high) = (self.low, self.high);
        let low = GridPoint { x: low.x.max(other.low.x), y: low.y.max(other.low.y) };
        let high = GridPoint { x: high.x.min(other.high.x), y: high.y.min(other.high.y) };
        (low.x <= high.x && low.y <= high.y).then_some(Self { low, high })
    }

    /// Whether both rectangles have a point in common.
    pub fn meets(self, other: Self) -> bool {
        self.intersection(other).is_some()
    }

    /// Whether another rectangle lies within this one.
    pub fn includes(self, other: Self) -> bool {
        self.union(other) == self
    }

    /// Whether a point lies in the rectangle.
    pub fn holds(self, point: GridPoint) -> bool {
        self.meets(Self { low: point, high: point })
    }

    /// Returns the rectangle whose sides lie `by` farther out, as far as the grid goes.
    pub fn grown(self, by: u16) -> Self {
        let Self { low, high } = self;
        Self {
            low: GridPoint { x: low.x.saturating_sub(by), y: low.y.saturating_sub(by) },
            high: GridPoint { x: high.x.saturating_add(by), y: high.y.saturating_add(by) },
        }
    }

    /// Returns how far the rectangle extends to the right and upwards.
    pub fn extent(self) -> [u16; 2] {
        [self.high.x.saturating_sub(self.low.x), self.high.y.saturating_sub(self.low.y)]
    }

    /// Whether the rectangle extends no farther than `limit` in either direction.
    pub fn is_within(self, limit: [u16; 2]) -> bool {
        let extent = self.extent();
        extent[0] <= limit[0] && extent[1] <= limit[1]
    }

    /// Whether the rectangle may meet the segment from `a` to `b`.
    ///
    /// The true coordinates of all points are up to one unit greater than those on the grid, so a
    /// determinant of two differences is off by less than the sum of the differences plus two.
    pub fn may_meet_segment(self, a: GridPoint, b: GridPoint) -> bool {
        if !self.meets(Self::around(a, b)) {
            return false;
        }
        let wide = |point: GridPoint| [i64::from(point.x), i64::from(point.y)];
        let ([ax, ay], [bx, by]) = (wide(a), wide(b));
        let along = [bx - ax, by - ay];
        let side_of = |x: u16, y: u16| {
            let to = [i64::from(x) - ax, i64::from(y) - ay];
            let side = along[0] * to[1] - along[1] * to[0];
            let parts = [along[0], along[1], to[0], to[1]];
            let error = parts.iter().map(|part| part.abs()).sum::<i64>() + 2;
            if side.abs() <= error { 0 } else { side.signum() }
        };
        let Self { low, high } = self;
        let corners = [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)];
        let sides = corners.map(|(x, y)| side_of(x, y));
        sides != [1; 4] && sides != [-1; 4]
    }
}

/// The results of one pass over the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Survey {
    /// The least x and y on the page of what is seen, in units of 2^-20.
    low: [i64; 2],
    /// The number of bits by which x and y are shifted right to give coordinates of the grid.
    shift: [u32; 2],
    /// The greatest error of a point on the grid for each half unit of error of its view
    /// coordinates.
    error_bound: u64,
    /// The number of faces that are left out because they have no area.
    pub degenerate_faces: u32,
}

impl Survey {
    /// Goes through all elements. Returns `None` if nothing is in front of the near plane.
    pub(super) fn new<S: ModelSource>(
        source: &S,
        parameters: &ViewParameters,
        cancel: &mut dyn Cancel,
    ) -> Result<Option<Self>, Aborted> {
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        let mut nearest = i32::MAX;
        let mut degenerate_faces = 0;
        let mut first = 0;
        while first < source.corner_count() {
            cancel.check()?;
            let outline = Outline::at(source, first);
            if outline.has_extent() {
                outline.each_point(parameters.near, &mut |vertex: Vertex| {
                    let at = page_position(parameters.projection, vertex);
                    for axis in [0, 1] {
                        low[axis] = low[axis].min(at[axis]);
                        high[axis] = high[axis].max(at[axis]);
                    }
                    nearest = nearest.min(vertex.z);
                });
            } else {
                degenerate_faces += 1;
            }
            first = outline.end();
        }
        if low[0] > high[0] {
            return Ok(None);
        }
        let shift = [0, 1].map(|axis: usize| {
            let extent = high[axis] - low[axis];
            (64 - extent.leading_zeros()).saturating_sub(GRID_BITS)
        });
        // Half a unit, in units of 2^-20. In perspective both x / z and its z change.
        let half = 1u64 << 19;
        let error_bound = match parameters.projection {
            Projection::Parallel => half,
            Projection::Perspective => {
                let parts = low.iter().chain(&high);
                let farthest = parts.map(|part| part.unsigned_abs()).max().unwrap_or(0);
                (half + (farthest >> 1)) / nearest.max(1) as u64 + 1
            }
        };
        let error_bound = (error_bound >> shift[0].min(shift[1])) + 1;
        Ok(Some(Self { low, shift, error_bound, degenerate_faces }))
    }

    /// Returns the place of a vertex. One beyond the grid gets the nearest point on its border.
    pub(super) fn point(&self, projection: Projection, vertex: Vertex) -> GridPoint {
        let at = page_position(projection, vertex);
        let [x, y] = [0, 1].map(|axis: usize| {
            let place = (at[axis] - self.low[axis]) >> self.shift[axis];
            place.clamp(0, (1 << GRID_BITS) - 1) as u16
        });
        GridPoint { x, y }
    }

    /// Returns a rectangle as bounds on the page.
    pub(super) fn window(&self, rectangle: Rectangle) -> Window {
        self.window_around(rectangle, [0; 2])
    }

    /// Returns a rectangle as bounds on the page, each of them moved outwards by this much.
    pub(super) fn window_around(&self, rectangle: Rectangle, by: [u16; 2]) -> Window {
        let Rectangle { low, high } = rectangle;
        let bound = |axis: usize, place: i64| self.low[axis] + (place << self.shift[axis]);
        let (low, high) = ([low.x, low.y], [high.x, high.y]);
        Window {
            low: [0, 1].map(|axis: usize| bound(axis, i64::from(low[axis]) - i64::from(by[axis]))),
            end: [0, 1]
                .map(|axis: usize| bound(axis, i64::from(high[axis]) + 1 + i64::from(by[axis]))),
        }
    }

    /// Returns the greatest error on the grid of a point whose view coordinates may be off by this
    /// many halves of a unit.
    pub(super) fn error_bound(&self, halves: u32) -> u16 {
        self.error_bound.saturating_mul(halves.into()).min(u16::MAX.into()) as u16
    }
}

/// Bounds on the page, in units of 2^-20: from the least x and y to the first beyond.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    low: [i64; 2],
    end: [i64; 2],
}

impl Window {
    /// Returns one bit for each of the four sides of the window beyond which a vertex lies (as
    /// Sutherland's outcode). Its place on the page is not computed, which would take divisions:
    /// x / w, rounded down, is below a whole number n if x is below n w.
    ///
    /// `vertex` must be in front of the eye. The bounds lie within ±2^42 / w, so products are below
    /// 2^62.
    pub fn outcode(&self, projection: Projection, vertex: Vertex) -> u32 {
        let w = match projection {
            Projection::Perspective => i64::from(vertex.z),
            Projection::Parallel => 1,
        };
        let mut code = 0;
        for (axis, part) in [vertex.x, vertex.y].into_iter().enumerate() {
            let part = i64::from(part) << 20;
            let bits =
                u32::from(part < self.low[axis] * w) | u32::from(part >= self.end[axis] * w) << 1;
            code = code << 2 | bits;
        }
        code
    }
}

/// A tile: one of the parts into which the page is divided by halving it, again and again, in
/// turn across and along.
///
/// Tiles follow each other as the numbers of a Gray code do, so that the next one mostly lies
/// beside the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    /// For each division which half, 1 for the one that comes later; the last one is the lowest
    /// bit.
    path: u32,
    /// The number of divisions.
    depth: u32,
}

impl Tile {
    /// The whole page.
    pub const FIRST: Self = Self { path: 0, depth: 0 };

    /// The first half of this tile. `None` if it is a single point.
    pub fn divided(self) -> Option<Self> {
        let Self { path, depth } = self;
        (depth < 2 * GRID_BITS).then_some(Self { path: path << 1, depth: depth + 1 })
    }

    /// Returns the tile after this one, as large as it can be. `None` after the last.
    pub fn next(self) -> Option<Self> {
        let last_halves = self.path.trailing_ones();
        let depth = self.depth.checked_sub(last_halves).filter(|&depth| depth > 0)?;
        Some(Self { path: (self.path >> last_halves) + 1, depth })
    }

    /// Returns the number of divisions.
    pub fn depth(self) -> u32 {
        self.depth
    }

    /// Returns the part of the page that is divided this many times and has this tile in it. `None`
    /// if the tile is larger than that.
    pub fn part_of(self, depth: u32) -> Option<Self> {
        let more = self.depth.checked_sub(depth)?;
        Some(Self { path: self.path.checked_shr(more).unwrap_or(0), depth })
    }

    /// Returns the points of the grid that belong to the tile.
    pub fn rectangle(self) -> Rectangle {
        let (mut low, mut bits) = ([0u32; 2], [GRID_BITS; 2]);
        // In a half that comes later, the halves follow each other in the opposite order.
        let halves = self.path ^ self.path >> 1;
        for level in 0..self.depth {
            let axis = level as usize % 2;
            bits[axis] -= 1;
            low[axis] |= (halves >> (self.depth - 1 - level) & 1) << bits[axis];
        }
        let high = [0, 1].map(|axis: usize| low[axis] + ((1u32 << bits[axis]) - 1));
        // All are below 2^16.
        let [low, high] = [low, high].map(|[x, y]| GridPoint { x: x as u16, y: y as u16 });
        Rectangle { low, high }
    }
}
