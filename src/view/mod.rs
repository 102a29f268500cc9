//! The camera: transforms the vertices of a model to integer view coordinates (x, y, z), where z is
//! the depth, and clips what lies behind the eye.
//!
//! A [`Camera`] is what the user chose: two points or three angles, and a lens. A [`View`] is that
//! camera applied to one model: a linear map in fixed point that takes every position to view
//! coordinates within ±2^19. This rounding, once per vertex and view, is the only one before the
//! page. Square roots and angles are computed once per view, in `libm`, so every machine gets the
//! same map. [`project_scene`] cuts off what lies behind the eye or level with it, and welds
//! vertices at the same position.
//!
//! Refused are an eye at the point looked at, an up direction along the line of sight, and a model
//! that lies entirely behind the eye.
//!
//! Sources: Harrison 2.2 and 2.3 (equations 1 to 10) and Brown IV (the view from two points).

mod camera;
mod clip;
mod curves;
mod sources;
mod weld;

pub use camera::{Camera, Direction, Lens, Pose, SightLines};
pub use clip::{Seen, distinct_edges, project_scene};
pub use curves::Flattening;
pub use sources::Sources;
#[cfg(feature = "tiles")]
pub(crate) use {
    clip::{cut, on_plane},
    weld::{spans_area, weld},
};

use crate::array::MapEach;
use crate::fixed::square_root;
use crate::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use crate::index::Index;
use crate::model::{Model, Position, Positions};
use crate::stage::{Aborted, Cancel};
use camera::{Axes, dot, largest_component};

/// The reasons why a camera has no view of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ViewError {
    /// The model has no vertex.
    NothingToSee,
    /// The eye is at the point looked at.
    EyeAtTarget,
    /// The up direction is along the line of sight, or zero.
    UpAlongSight,
    /// The whole model lies level with the eye or behind it.
    NothingInFront,
    /// A vertex lies level with the eye or behind it, and the user does not want clipping.
    BehindEye {
        /// The number of the vertex, counted from 1.
        vertex: usize,
    },
}

/// A camera applied to one model: the map from positions to view coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The three rows of the map, which give x, y and z in view coordinates.
    rows: [Row; 3],
    /// Whether the view is perspective or parallel.
    projection: Projection,
    /// What [`Self::image_unit`] returns: it converts image coordinates to lengths, for reports.
    image_unit: f64,
    /// What [`Self::depth_stretch`] returns: how much deeper the view is than the model.
    depth_stretch: (u32, u32),
    /// What [`Self::slants`] returns: how much of the depth is added to width and height.
    slants: [i32; 2],
    /// What [`Self::near`] returns: the least depth that is drawn.
    near: Option<i32>,
}

/// One row of the map. Its result is (m · position + offset) >> shift, rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Row {
    /// The factors by which x, y and z of the position are multiplied, each within ±2^30.
    m: [i32; 3],
    /// The number that is added to the sum of the three products, in the unit of the sum.
    offset: i64,
    /// The number of bits by which the sum is shifted right, at least 1.
    shift: u32,
}

impl Row {
    /// Applies the row to a position of the model. Returns the x, the y or the z of the view,
    /// whichever the row is for.
    fn apply(&self, position: Position) -> i32 {
        // Both |m| and |position| are at most 2^30, so each product is at most 2^60; `Row::new`
        // keeps the sum below 2^62.
        let sum = self
            .m
            .iter()
            .zip(position.coordinates())
            .map(|(m, coordinate)| i64::from(*m) * i64::from(coordinate))
            .sum::<i64>()
            + self.offset;
        ((sum + (1 << (self.shift - 1))) >> self.shift) as i32
    }

    /// Creates the row that computes scale (direction · p) + offset, where p = position ×
    /// 2^-fraction_bits. The absolute value of the result is below 2^20. `reach` is an upper bound
    /// of |p|.
    fn new(direction: Direction, scale: f64, offset: f64, fraction_bits: u32, reach: f64) -> Self {
        // Since `reach` times the length bounds |direction · p|, these two limits on the shift keep
        // the sum and each factor in range.
        let length = square_root(dot(direction, direction));
        let largest = scale * reach * length + libm::fabs(offset) + 1.0;
        let steepest = scale * largest_component(direction);
        let mut shift = 61 - exponent(largest);
        if steepest > 0.0 {
            shift = shift.min(29 + fraction_bits as i32 - exponent(steepest));
        }
        let shift = shift.clamp(1, 62);
        let unit = libm::ldexp(1.0, shift);
        let m = direction
            .map(|d| libm::round(libm::ldexp(d * scale, shift - fraction_bits as i32)) as i32);
        Self { m, offset: libm::round(offset * unit) as i64, shift: shift as u32 }
    }
}

/// Returns the least e with |value| < 2^e, for a positive finite value.
fn exponent(value: f64) -> i32 {
    libm::frexp(value).1
}

/// The number of vertices that are transformed between two checks for cancelling. They take some
/// 100,000 instructions.
const VERTICES_BETWEEN_CHECKS: usize = 256;

/// How far the rounding of a row's factors brings a coordinate off, as a part of the distance from
/// the model's origin: 2^-26.
const ROW_ERROR: f64 = 1.0 / 67_108_864.0;

/// The near plane is at 2^-`NEAR_SHIFT` of the greatest depth.
const NEAR_SHIFT: u32 = 10;

impl View {
    /// Computes the view of `model` through `camera`.
    ///
    /// # Errors
    /// See [`ViewError`].
    // Not inlined, so that its variables take no stack while the rest of a job is computed.
    #[inline(never)]
    pub fn new(camera: &Camera, model: &impl Positions) -> Result<Self, ViewError> {
        let mut axes = Axes::new(camera)?;
        let mut projection = camera.lens.projection();
        let extents_along = |axes: &Axes| extents(&axes.directions, model);
        let mut extents = extents_along(&axes).ok_or(ViewError::NothingToSee)?;
        if projection == Projection::Perspective
            && let Some(parallel) = axes.parallel_if_far(&extents)
        {
            (axes, projection) = (parallel, Projection::Parallel);
            extents = extents_along(&axes).unwrap_or(extents);
        }
        Self::of_extents(projection, axes, extents, reach(model), model.fraction_bits())
    }

    /// Computes the view of a model with these extents along the axes of the camera. `reach` is the
    /// result of the function of this name.
    #[cfg_attr(feature = "tiles", inline(never))] // Both kinds of models share one copy.
    #[cfg_attr(not(feature = "tiles"), inline(always))]
    fn of_extents(
        projection: Projection,
        Axes { directions, slants, origin }: Axes,
        extents: [(f64, f64); 3],
        reach: f64,
        fraction_bits: u32,
    ) -> Result<Self, ViewError> {
        let limit = f64::from(COORDINATE_LIMIT - 1);
        let shift = directions.map_each(|axis| -dot(axis, origin));
        // Here and below, the rows are 0, 1 and 2, and each array has an item for each row.
        let width = [0, 1]
            .iter()
            .flat_map(|&row: &usize| [extents[row].0 + shift[row], extents[row].1 + shift[row]])
            .fold(0.0, |most, value| f64::max(most, libm::fabs(value)));
        let (nearest, farthest) = (extents[2].0 + shift[2], extents[2].1 + shift[2]);
        // An extent of only a few units of 2^-30 is rounding noise of the directions.
        let noise = if reach > 0.0 { reach * 6e-8 } else { 1.0 };
        // The factors of a row are rounded, too: far from the origin of a small model they bring a
        // coordinate off by up to `scale` times `reach` times 2^-26, which must stay within the
        // limit. Nearer than 64 times its size this is less than half a unit.
        let whole = |extent: f64| {
            let extent = f64::max(extent, noise);
            if reach > 64.0 * extent { extent + reach * ROW_ERROR } else { extent }
        };
        let scale = limit / whole(width);
        let (depth_scale, depth_offset) = match projection {
            Projection::Perspective => {
                if farthest <= 0.0 {
                    return Err(ViewError::NothingInFront);
                }
                (limit / whole(f64::max(farthest, -nearest)), 0.0)
            }
            // Only differences of depth matter, so the depths are centred on zero.
            Projection::Parallel => {
                let half = (farthest - nearest) / 2.0;
                (limit / whole(half), -(nearest + farthest) / 2.0)
            }
        };
        let offsets = [scale * shift[0], scale * shift[1], depth_scale * (shift[2] + depth_offset)];
        let scales = [scale, scale, depth_scale];
        let rows = [0, 1, 2].map_each(|row: usize| {
            Row::new(directions[row], scales[row], offsets[row], fraction_bits, reach)
        });
        let (image_unit, near) = match projection {
            Projection::Perspective => {
                let deepest = libm::ceil(depth_scale * farthest) as i32;
                (depth_scale / scale, Some((deepest >> NEAR_SHIFT).max(1)))
            }
            Projection::Parallel => (1.0 / scale, None),
        };
        let stretch = depth_scale / scale;
        let depth_stretch = as_ratio(stretch);
        // The depth of a normal was divided by the exact stretch, not by the rounded one.
        let unit = 256.0 * f64::from(depth_stretch.0) / stretch;
        let slants = slants.map(|slant| libm::round(slant * unit) as i32);
        Ok(Self { rows, projection, image_unit, depth_stretch, slants, near })
    }

    /// Returns the view coordinates of a position of the model.
    pub fn vertex(&self, position: Position) -> Vertex {
        let [x, y, z] = self.rows.each_ref().map_each(|row| row.apply(position));
        Vertex { x, y, z }
    }

    /// Returns the value of x/w and y/w at 45 degrees from the line of sight, in units of
    /// 2^-`fraction_bits`. Returns `None` in a parallel view.
    pub fn field(&self, fraction_bits: u32) -> Option<i64> {
        self.near.map(|_| libm::ldexp(1.0 / self.image_unit, fraction_bits as i32) as i64)
    }

    /// Returns the part of an edge that lies in front of the near plane. Returns `None` if no part
    /// does.
    pub fn clip_edge(&self, ends: [Vertex; 2]) -> Option<[Vertex; 2]> {
        clip::clip_edge(ends, self.near.unwrap_or(i32::MIN))
    }

    /// Returns an error bound of the view coordinates: twice the possible error of a coordinate if
    /// positions may be off by `units` of their units, including the rounding of the view itself.
    /// The result is at least 1.
    pub fn error_bound(&self, units: u32) -> u32 {
        let most = |row: &Row| {
            let steepness: u64 = row.m.iter().map(|m| u64::from(m.unsigned_abs())).sum();
            // The steepness is at most 3 × 2^30, and `units` is at most 2^30.
            ((steepness * u64::from(units)) >> (row.shift - 1)).saturating_add(1)
        };
        let error_bound = self.rows.iter().map(most).max().unwrap_or(1) + u64::from(units > 0);
        u32::try_from(error_bound).unwrap_or(u32::MAX)
    }

    /// Transforms every vertex of `model` to view coordinates.
    fn fill<I: Index>(
        &self,
        model: &Model<'_, I>,
        vertices: &mut [Vertex],
        cancel: &mut dyn Cancel,
    ) -> Result<(), Aborted> {
        let chunks = vertices.chunks_mut(VERTICES_BETWEEN_CHECKS);
        for (vertices, positions) in chunks.zip(model.vertices().chunks(VERTICES_BETWEEN_CHECKS)) {
            for (vertex, position) in vertices.iter_mut().zip(positions) {
                *vertex = self.vertex(*position);
            }
            cancel.check()?;
        }
        Ok(())
    }

    /// Checks that every vertex is in front of the near plane.
    ///
    /// # Errors
    /// Returns [`ViewError::BehindEye`] with the first vertex that is not.
    pub fn refuse_behind(&self, model: &impl Positions) -> Result<(), ViewError> {
        let near = self.near.unwrap_or(i32::MIN);
        let is_behind = |position: Position| self.vertex(position).z < near;
        match model.positions().position(is_behind) {
            Some(vertex) => Err(ViewError::BehindEye { vertex: vertex + 1 }),
            None => Ok(()),
        }
    }

    /// Returns whether the view is perspective or parallel.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Returns the least depth that is drawn, in view units. Returns `None` in a parallel view,
    /// which has no eye.
    pub fn near(&self) -> Option<i32> {
        self.near
    }

    /// Returns the factor by which depth is stretched relative to width and height, as a ratio of
    /// two numbers from 1 to 2^20. It is needed to compute the angles between faces.
    pub fn depth_stretch(&self) -> (u32, u32) {
        self.depth_stretch
    }

    /// Returns the slants of an oblique view, which are needed to compute the angles between faces.
    /// See [`Crease::slants`](crate::visibility::Crease::slants).
    pub fn slants(&self) -> [i32; 2] {
        self.slants
    }

    /// Returns the factor by which x/w and y/w are multiplied to give coordinates on the image
    /// plane at distance 1 (perspective) or in model units (parallel, where w = 1). It is for
    /// reports; no decision depends on it.
    pub fn image_unit(&self) -> f64 {
        self.image_unit
    }
}

/// Returns a positive number as a ratio of two whole numbers, each from 1 to 2^20.
fn as_ratio(value: f64) -> (u32, u32) {
    const LARGEST: f64 = 1_048_576.0;
    let part = |value: f64| libm::round(value * LARGEST).max(1.0) as u32;
    if value < 1.0 { (part(value), LARGEST as u32) } else { (LARGEST as u32, part(1.0 / value)) }
}

/// Returns an upper bound of |direction · position| for directions of length 1, in model units.
fn reach(model: &impl Positions) -> f64 {
    let largest = model.bounds().map_or(0, |(low, high)| {
        let corners = [low.coordinates(), high.coordinates()];
        corners.iter().flatten().map(|c| c.unsigned_abs()).max().unwrap_or(0)
    });
    // The factor is slightly more than the square root of 3.
    1.75 * libm::ldexp(f64::from(largest), -(model.fraction_bits() as i32))
}

/// Returns, for each axis, the least and the greatest value of axis · position over all vertices.
fn extents(axes: &[Direction; 3], model: &impl Positions) -> Option<[(f64, f64); 3]> {
    // The sums use integers, with 30 bits of each direction, so that no vertex needs floating
    // point.
    let fixed_axes = axes.map(|axis| axis.map(|d| libm::round(libm::ldexp(d, 30)) as i64));
    let along = |axis: &[i64; 3], vertex: Position| -> i64 {
        axis.iter().zip(vertex.coordinates()).map(|(d, coordinate)| d * i64::from(coordinate)).sum()
    };
    let unit = libm::ldexp(1.0, -(30 + model.fraction_bits() as i32));
    model.positions().next()?;
    Some(fixed_axes.map(|axis| {
        let (low, high) = model.positions().fold((i64::MAX, i64::MIN), |(low, high), vertex| {
            let value = along(&axis, vertex);
            (low.min(value), high.max(value))
        });
        (low as f64 * unit, high as f64 * unit)
    }))
}

#[cfg(test)]
mod tests;
