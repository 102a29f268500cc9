//! The camera: from two points and an up direction to integers (x, y, z), z the depth.
//!
//! A [`Camera`] is what the user chose; a [`View`] is that camera looking at one model: a linear map
//! in fixed point that takes every position to view coordinates within ±2^19. This rounding, once
//! per vertex and view, is the only one before the page. Square roots happen once per view, in
//! `libm`, so every machine gets the same map. Refused: an eye at the point looked at, an up
//! direction along the line of sight, a vertex that is not in front of the eye.
//!
//! Sources: Harrison 2.3 (equations 1 to 10) and Brown IV (the view from two points).

use crate::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use crate::model::{Model, Position};

/// A point or direction of the model's space, for angles only.
pub type Direction = [f64; 3];

/// Where the user looks from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The eye, in model units.
    pub eye: Direction,
    /// The point looked at; its image is the origin.
    pub at: Direction,
    /// What is up; `None`: z, or y where the line of sight is along z.
    pub up: Option<Direction>,
    /// Perspective or orthographic.
    pub projection: Projection,
}

/// Why there is no view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ViewError {
    /// The model has no vertex.
    NothingToSee,
    /// The eye is at the point looked at.
    EyeAtTarget,
    /// The up direction is along the line of sight, or zero.
    UpAlongSight,
    /// A vertex is level with the eye or behind it.
    BehindEye {
        /// The vertex, from 1.
        vertex: usize,
    },
}

/// A camera that looks at one model: the map from its positions to view coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    rows: [Row; 3],
    projection: Projection,
    image_unit: f64,
}

/// One row of the map: (m · position + offset) >> shift, rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Row {
    m: [i32; 3],
    offset: i64,
    shift: u32,
}

impl Row {
    fn apply(&self, position: Position) -> i32 {
        // |m| <= 2^30 and |position| <= 2^30: each product below 2^60; `Row::new` keeps the sum below 2^62.
        let sum = self
            .m
            .iter()
            .zip(position.coordinates())
            .map(|(m, coordinate)| i64::from(*m) * i64::from(coordinate))
            .sum::<i64>()
            + self.offset;
        ((sum + (1 << (self.shift - 1))) >> self.shift) as i32
    }

    /// scale (direction · p) + offset for p = position × 2^-fraction_bits, |result| < 2^20.
    fn new(direction: Direction, scale: f64, offset: f64, fraction_bits: u32, reach: f64) -> Self {
        // `reach` bounds |direction · p|. Both limits keep the sum and each factor in range.
        let largest = scale * reach + libm::fabs(offset) + 1.0;
        let steepest = scale
            * direction
                .iter()
                .fold(0.0, |most, d| f64::max(most, libm::fabs(*d)));
        let mut shift = 61 - exponent(largest);
        if steepest > 0.0 {
            shift = shift.min(29 + fraction_bits as i32 - exponent(steepest));
        }
        let shift = shift.clamp(1, 62);
        let unit = libm::ldexp(1.0, shift);
        let m = direction
            .map(|d| libm::round(libm::ldexp(d * scale, shift - fraction_bits as i32)) as i32);
        Self {
            m,
            offset: libm::round(offset * unit) as i64,
            shift: shift as u32,
        }
    }
}

/// The least e with |value| < 2^e, for a positive finite value.
fn exponent(value: f64) -> i32 {
    libm::frexp(value).1
}

impl View {
    /// Looks at `model` through `camera`.
    ///
    /// # Errors
    /// See [`ViewError`].
    pub fn new(camera: &Camera, model: &Model<'_>) -> Result<Self, ViewError> {
        let axes = axes(camera)?;
        let fraction_bits = model.fraction_bits();
        let extents = extents(&axes, model).ok_or(ViewError::NothingToSee)?;
        let unit = libm::ldexp(1.0, -(fraction_bits as i32));
        let largest = model
            .bounds()
            .map(|(low, high)| {
                let corners = [low.coordinates(), high.coordinates()];
                corners
                    .iter()
                    .flatten()
                    .map(|c| c.unsigned_abs())
                    .max()
                    .unwrap_or(0)
            })
            .unwrap_or(0);
        let reach = 1.75 * f64::from(largest) * unit; // sqrt(3) and a little
        let limit = f64::from(COORDINATE_LIMIT - 1);
        let origin = match camera.projection {
            Projection::Perspective => camera.eye,
            Projection::Parallel => camera.at,
        };
        let shift = axes.map(|axis| -dot(axis, origin));
        let width = [0, 1]
            .iter()
            .flat_map(|&row| [extents[row].0 + shift[row], extents[row].1 + shift[row]])
            .fold(0.0, |most, value| f64::max(most, libm::fabs(value)));
        let (near, far) = (extents[2].0 + shift[2], extents[2].1 + shift[2]);
        // What is narrower than some units of 2^-30 is rounding noise of the directions.
        let noise = if reach > 0.0 { reach * 6e-8 } else { 1.0 };
        let scale = limit / f64::max(width, noise);
        let (depth_scale, depth_offset) = match camera.projection {
            Projection::Perspective => (if far > 0.0 { limit / far } else { 1.0 }, 0.0),
            // Only differences of depth matter: centre them.
            Projection::Parallel => {
                let half = (far - near) / 2.0;
                (limit / f64::max(half, noise), -(near + far) / 2.0)
            }
        };
        let rows = [
            Row::new(axes[0], scale, scale * shift[0], fraction_bits, reach),
            Row::new(axes[1], scale, scale * shift[1], fraction_bits, reach),
            Row::new(
                axes[2],
                depth_scale,
                depth_scale * (shift[2] + depth_offset),
                fraction_bits,
                reach,
            ),
        ];
        let image_unit = match camera.projection {
            Projection::Perspective => depth_scale / scale,
            Projection::Parallel => 1.0 / scale,
        };
        let view = Self {
            rows,
            projection: camera.projection,
            image_unit,
        };
        if camera.projection == Projection::Perspective {
            let behind = model
                .vertices()
                .iter()
                .position(|vertex| view.vertex(*vertex).z <= 0);
            if let Some(vertex) = behind {
                return Err(ViewError::BehindEye { vertex: vertex + 1 });
            }
        }
        Ok(view)
    }

    /// A position in view coordinates.
    pub fn vertex(&self, position: Position) -> Vertex {
        let [x, y, z] = self.rows.each_ref().map(|row| row.apply(position));
        Vertex { x, y, z }
    }

    /// Perspective or parallel.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// What x/w and y/w are multiplied by to give the image plane at distance 1 (perspective) or
    /// model units (parallel, w = 1). For reports; no decision depends on it.
    pub fn image_unit(&self) -> f64 {
        self.image_unit
    }
}

/// Right, up and forward, each of length 1.
fn axes(camera: &Camera) -> Result<[Direction; 3], ViewError> {
    let sight = [0, 1, 2].map(|axis| camera.at[axis] - camera.eye[axis]);
    let forward = normalized(sight).ok_or(ViewError::EyeAtTarget)?;
    let right = match camera.up {
        Some(up) => {
            let up = normalized(up).ok_or(ViewError::UpAlongSight)?;
            sideways(forward, up).ok_or(ViewError::UpAlongSight)?
        }
        None => sideways(forward, [0.0, 0.0, 1.0])
            .or_else(|| sideways(forward, [0.0, 1.0, 0.0]))
            .ok_or(ViewError::UpAlongSight)?,
    };
    Ok([right, cross(right, forward), forward])
}

/// forward × up, of length 1, unless they are parallel but for rounding.
fn sideways(forward: Direction, up: Direction) -> Option<Direction> {
    let right = cross(forward, up);
    if dot(right, right) < 1e-20 {
        None
    } else {
        normalized(right)
    }
}

/// Least and greatest of axis · position over all vertices, for each axis.
fn extents(axes: &[Direction; 3], model: &Model<'_>) -> Option<[(f64, f64); 3]> {
    // In integers, with 30 bits of each direction, so that no vertex costs a float.
    let fixed_axes = axes.map(|axis| axis.map(|d| libm::round(libm::ldexp(d, 30)) as i64));
    let along = |axis: &[i64; 3], vertex: &Position| -> i64 {
        axis.iter()
            .zip(vertex.coordinates())
            .map(|(d, coordinate)| d * i64::from(coordinate))
            .sum()
    };
    let unit = libm::ldexp(1.0, -(30 + model.fraction_bits() as i32));
    model.vertices().first()?;
    Some(fixed_axes.map(|axis| {
        let (low, high) =
            model
                .vertices()
                .iter()
                .fold((i64::MAX, i64::MIN), |(low, high), vertex| {
                    let value = along(&axis, vertex);
                    (low.min(value), high.max(value))
                });
        (low as f64 * unit, high as f64 * unit)
    }))
}

fn dot(a: Direction, b: Direction) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Direction, b: Direction) -> Direction {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn normalized(a: Direction) -> Option<Direction> {
    // Scaled first, so that neither huge nor tiny vectors leave the range of the squares.
    let largest = a.iter().fold(0.0, |most, d| f64::max(most, libm::fabs(*d)));
    if largest == 0.0 || !largest.is_finite() {
        return None;
    }
    let scaled = a.map(|d| d / largest);
    let length = libm::sqrt(dot(scaled, scaled));
    Some(scaled.map(|d| d / length))
}

/// The three-quarter view that a model gets if the user chooses none: from the right, in front and
/// above, far enough away that the whole model is well inside the field. `None` without vertices.
///
/// An estimate that decides nothing else, so single precision (`micromath`) is enough.
pub fn three_quarter_view(model: &Model<'_>, projection: Projection) -> Option<Camera> {
    use micromath::F32Ext;
    let (low, high) = model.bounds()?;
    let unit = libm::ldexp(1.0, -(model.fraction_bits() as i32));
    let (low, high) = (low.coordinates(), high.coordinates());
    let centre = [0, 1, 2].map(|axis| (f64::from(low[axis]) + f64::from(high[axis])) / 2.0 * unit);
    let halves =
        [0, 1, 2].map(|axis| ((f64::from(high[axis]) - f64::from(low[axis])) / 2.0 * unit) as f32);
    // Named in full: with std at hand, `f32::sqrt` would quietly take its place.
    let radius = F32Ext::sqrt(halves.iter().map(|half| half * half).sum::<f32>());
    let flat = halves.iter().all(|half| *half == 0.0);
    let radius = if flat { 1.0 } else { f64::from(radius) };
    const FROM: Direction = [1.5, -2.6, 1.7];
    let eye = [0, 1, 2].map(|axis| centre[axis] + FROM[axis] * radius);
    Some(Camera {
        eye,
        at: centre,
        up: None,
        projection,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Decimal;
    use crate::model::Corner;

    fn with_model(vertices: &[[&str; 3]], test: impl FnOnce(&Model<'_>)) {
        let mut memory = (
            heapless::Vec::<Position, 16>::new(),
            heapless::Vec::<Corner, 16>::new(),
        );
        let mut model = Model::new(&mut memory.0, &mut memory.1);
        for vertex in vertices {
            model
                .add_vertex(vertex.map(|text| Decimal::parse(text).unwrap()))
                .unwrap();
        }
        test(&model);
    }

    const CUBE: [[&str; 3]; 8] = [
        ["0", "0", "0"],
        ["1", "0", "0"],
        ["1", "1", "0"],
        ["0", "1", "0"],
        ["0", "0", "1"],
        ["1", "0", "1"],
        ["1", "1", "1"],
        ["0", "1", "1"],
    ];

    fn camera(eye: Direction, at: Direction) -> Camera {
        Camera {
            eye,
            at,
            up: None,
            projection: Projection::Perspective,
        }
    }

    #[test]
    fn images_are_those_of_the_formula() {
        with_model(&CUBE, |model| {
            for projection in [Projection::Perspective, Projection::Parallel] {
                for (eye, at) in [
                    ([-3.0, -4.0, 2.5], [0.5, 0.5, 0.5]),
                    ([1000.0, 2000.0, -500.0], [0.25, 0.5, 0.125]),
                    ([0.5, -1.2, 0.5], [0.5, 0.5, 0.5]),
                    ([0.5, 0.5, 5.0], [0.5, 0.5, 0.5]),
                ] {
                    let camera = Camera {
                        projection,
                        ..camera(eye, at)
                    };
                    let view = View::new(&camera, model).unwrap();
                    let [right, up, forward] = axes(&camera).unwrap();
                    let unit = libm::ldexp(1.0, -(model.fraction_bits() as i32));
                    for position in model.vertices() {
                        let p = position.coordinates().map(|c| f64::from(c) * unit);
                        let origin = if projection == Projection::Perspective {
                            eye
                        } else {
                            at
                        };
                        let d = [0, 1, 2].map(|axis| p[axis] - origin[axis]);
                        let vertex = view.vertex(*position);
                        let w = if projection == Projection::Perspective {
                            f64::from(vertex.z)
                        } else {
                            1.0
                        };
                        let depth = if projection == Projection::Perspective {
                            dot(d, forward)
                        } else {
                            1.0
                        };
                        for (axis, seen) in [(right, vertex.x), (up, vertex.y)] {
                            let image = f64::from(seen) / w * view.image_unit();
                            let error = image - dot(d, axis) / depth;
                            assert!(error.abs() < 2e-6, "{eye:?} {projection:?}: off by {error}");
                        }
                        assert!(
                            [vertex.x, vertex.y, vertex.z]
                                .iter()
                                .all(|c| c.abs() <= COORDINATE_LIMIT)
                        );
                    }
                }
            }
        });
    }

    #[test]
    fn a_model_of_any_size_fills_the_range() {
        for size in ["1e-6", "0.001", "1", "12345.678", "1e9"] {
            with_model(
                &[["0", "0", "0"], [size, "0", "0"], ["0", size, size]],
                |model| {
                    let camera = three_quarter_view(model, Projection::Perspective).unwrap();
                    let view = View::new(&camera, model).unwrap();
                    let widest = model
                        .vertices()
                        .iter()
                        .map(|p| view.vertex(*p))
                        .map(|v| v.x.abs().max(v.y.abs()))
                        .max();
                    assert!(widest > Some(COORDINATE_LIMIT - 10), "{size}: {widest:?}");
                },
            );
        }
    }

    #[test]
    fn impossible_cameras_are_refused() {
        with_model(&CUBE, |model| {
            let at = [0.5, 0.5, 0.5];
            assert_eq!(
                View::new(&camera(at, at), model),
                Err(ViewError::EyeAtTarget)
            );
            let mut upright = camera([0.5, 0.5, 5.0], at);
            upright.up = Some([0.0, 0.0, -2.0]);
            assert_eq!(View::new(&upright, model), Err(ViewError::UpAlongSight));
            upright.up = Some([0.0; 3]);
            assert_eq!(View::new(&upright, model), Err(ViewError::UpAlongSight));
            assert_eq!(
                View::new(&camera([0.5, 0.5, 0.6], at), model),
                Err(ViewError::BehindEye { vertex: 5 })
            );
            // An orthographic eye only gives the direction.
            let inside = Camera {
                projection: Projection::Parallel,
                ..camera([0.5, 0.5, 0.6], at)
            };
            assert!(View::new(&inside, model).is_ok());
        });
        with_model(&[], |model| {
            assert_eq!(
                View::new(&camera([1.0; 3], [0.0; 3]), model),
                Err(ViewError::NothingToSee)
            );
        });
    }

    #[test]
    fn one_vertex_alone_can_be_seen() {
        with_model(&[["5", "5", "5"]], |model| {
            let camera = three_quarter_view(model, Projection::Parallel).unwrap();
            let vertex = View::new(&camera, model)
                .unwrap()
                .vertex(model.vertices()[0]);
            assert!(
                [vertex.x, vertex.y, vertex.z]
                    .iter()
                    .all(|c| c.abs() <= COORDINATE_LIMIT)
            );
        });
    }
}
