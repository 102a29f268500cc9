//! The camera that the user chose, and the image axes that follow from it.
//!
//! This is the only module of the view with angles, square roots and binary floating-point numbers.
//! They are computed once per view, in `libm`.

use super::ViewError;
use crate::fixed::{sin_cos_degrees, square_root};
use crate::geometry::Projection;
use crate::model::{Position, Positions};

/// A point or direction in model space. It is used only to set up the camera.
// It has three components, as a position has, and both are indexed only by the axes 0, 1 and 2,
// which stand beside the index.
pub type Direction = [f64; 3];

/// The view that the user chose: from where the model is seen, and by which projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// From where and in which direction the eye looks.
    pub pose: Pose,
    /// The kind of projection, as the lens of a real camera determines it.
    pub lens: Lens,
}

/// From where and in which direction the eye looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pose {
    /// The eye looks from one point towards another (Brown IV).
    Towards {
        /// The eye, in model units.
        eye: Direction,
        /// The point looked at, in model units. Its image is the origin of the page.
        at: Direction,
        /// The up direction. With `None` it is z, or y if the line of sight runs along z.
        up: Option<Direction>,
    },
    /// Harrison's viewpoint and rotation (2.3, equations 1 to 6). The model is turned by γ about z,
    /// β about y and α about x; after that the line of sight is z, and y is up.
    Turned {
        /// The eye, in model units. The angles alone say in which direction it looks.
        eye: Direction,
        /// The angles α, β and γ by which the model is turned about x, y and z, in degrees.
        angles: [f64; 3],
    },
}

/// The kind of projection: how the lines of sight run (Harrison 2.2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// The lines of sight meet in the eye.
    Perspective,
    /// The lines of sight are parallel, at right angles to the page.
    Orthographic,
    /// The lines of sight are parallel and slanted: a depth is drawn in the direction `angle`,
    /// `ratio` times as long.
    Oblique {
        /// The direction in which depth is drawn, in degrees from the x axis of the page.
        angle: f64,
        /// The factor by which depth is scaled, from 0 to 2: 1 for a cavalier, 0.5 for a cabinet
        /// projection.
        ratio: f64,
    },
}

impl Lens {
    /// Returns whether the projection is perspective or parallel.
    pub fn projection(self) -> Projection {
        match self {
            Self::Perspective => Projection::Perspective,
            Self::Orthographic | Self::Oblique { .. } => Projection::Parallel,
        }
    }
}

impl Camera {
    /// Returns the three-quarter view that a model gets if the user chooses none. It looks from the
    /// right, from in front and from above; an oblique view looks from in front. The eye is so far
    /// away that the whole model is well inside the field of view. The camera looks at `at`, or at
    /// the middle of the model if that is `None`. Returns `None` for a model without vertices.
    pub fn automatic(
        model: &impl Positions,
        lens: Lens,
        at: Option<Direction>,
        up: Option<Direction>,
    ) -> Option<Self> {
        let from = match lens {
            Lens::Oblique { .. } => [0.0, -1.0, 0.0],
            _ => [0.45, -0.75, 0.5],
        };
        Self::from_direction(model, from, lens, at, up)
    }

    /// Returns an axonometric view from an azimuth of `azimuth` degrees (0 is along the x axis, -90
    /// is in front) and an elevation of `elevation` degrees above the xy plane. An isometric view
    /// is (-45, 35.264…). Returns `None` for a model without vertices.
    pub fn axonometric(
        model: &impl Positions,
        azimuth: f64,
        elevation: f64,
        at: Option<Direction>,
        up: Option<Direction>,
    ) -> Option<Self> {
        let (sin_azimuth, cos_azimuth) = sin_cos_degrees(azimuth);
        let (sin_elevation, cos_elevation) = sin_cos_degrees(elevation);
        let from = [cos_azimuth * cos_elevation, sin_azimuth * cos_elevation, sin_elevation];
        Self::from_direction(model, from, Lens::Orthographic, at, up)
    }

    /// Returns Harrison's view, along the z axis of the turned model (see [`Pose::Turned`]). It
    /// looks from `eye`, or, if that is `None`, from so far away that the whole model is well
    /// inside the field of view. Returns `None` for a model without vertices.
    pub fn turned(
        model: &impl Positions,
        lens: Lens,
        angles: [f64; 3],
        eye: Option<Direction>,
    ) -> Option<Self> {
        let (middle, radius) = middle_and_radius(model)?;
        let [_, _, forward] = turned(angles);
        let eye = eye
            .unwrap_or([0, 1, 2].map(|axis| middle[axis] - EYE_DISTANCE * radius * forward[axis]));
        Some(Self { pose: Pose::Turned { eye, angles }, lens })
    }

    /// Returns the camera that looks from the direction `from` at `at` or at the middle of the
    /// model.
    fn from_direction(
        model: &impl Positions,
        from: Direction,
        lens: Lens,
        at: Option<Direction>,
        up: Option<Direction>,
    ) -> Option<Self> {
        let (middle, radius) = middle_and_radius(model)?;
        let at = at.unwrap_or(middle);
        let eye = [0, 1, 2].map(|axis| at[axis] + EYE_DISTANCE * radius * from[axis]);
        Some(Self { pose: Pose::Towards { eye, at, up }, lens })
    }
}

/// The distance of the automatic eye, in radii of the model. At this distance a sphere around the
/// model fills at most 33 degrees.
const EYE_DISTANCE: f64 = 3.5;

/// Returns the middle of the model and an estimate of its radius, both in model units. Returns
/// `None` without vertices.
///
/// The radius is used only to place the automatic eye, so a square root of 24 bits that is some 5 %
/// off is accurate enough.
pub(super) fn middle_and_radius(model: &impl Positions) -> Option<(Direction, f64)> {
    Some(middle_and_radius_of(model.bounds()?, model.fraction_bits()))
}

/// Returns the middle and the radius of a model with this bounding box.
#[cfg_attr(feature = "tiles", inline(never))] // Both kinds of models share one copy.
#[cfg_attr(not(feature = "tiles"), inline(always))]
fn middle_and_radius_of((low, high): (Position, Position), fraction_bits: u32) -> (Direction, f64) {
    let unit = libm::ldexp(1.0, -(fraction_bits as i32));
    let (low, high) = (low.coordinates().map(f64::from), high.coordinates().map(f64::from));
    let middle = [0, 1, 2].map(|axis| (low[axis] + high[axis]) / 2.0 * unit);
    let largest = [0, 1, 2].map(|axis| (high[axis] - low[axis]) / 2.0 * unit);
    let size = largest_component(largest);
    if size == 0.0 {
        return (middle, 1.0);
    }
    let squares =
        largest.iter().map(|half| to_single(half / size)).map(|half| to_single(half * half));
    let sum = squares.fold(0.0, |sum, square| to_single(sum + square));
    (middle, size * estimated_root(sum))
}

/// Rounds to the nearest number with the 24 bits of a single-precision float, for 0 and numbers
/// above 2^-126.
fn to_single(value: f64) -> f64 {
    let bits = value.to_bits();
    let half_to_even = 0x0FFF_FFFF + (bits >> 29 & 1);
    f64::from_bits((bits + half_to_even) & !0x1FFF_FFFF)
}

/// Estimates the square root of a single-precision number above 0 by halving its exponent. The
/// result is some 5 % off.
fn estimated_root(square: f64) -> f64 {
    f64::from_bits(((square.to_bits() + 1f64.to_bits()) >> 1) & !0x1FFF_FFFF)
}

/// The lines of sight of a camera, in units of 2^-fraction_bits of the model. Each coordinate is
/// within ±2^60.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SightLines {
    /// The lines of sight meet at this point, the eye.
    Through([i64; 3]),
    /// The lines of sight are parallel. This direction points to the user and is not zero.
    Along([i64; 3]),
}

impl Camera {
    /// Returns the lines of sight of this camera, in units of 2^-`fraction_bits` of the model. An
    /// eye too far away for these units gives parallel lines of sight.
    ///
    /// # Errors
    /// See [`ViewError`].
    pub fn sight_lines(&self, fraction_bits: u32) -> Result<SightLines, ViewError> {
        let Axes { directions: [right, up, forward], origin, .. } = Axes::new(self)?;
        let position = origin.map(|coordinate| libm::ldexp(coordinate, fraction_bits as i32));
        let limit = libm::ldexp(1.0, 60);
        if self.lens.projection() == Projection::Perspective && largest_component(position) <= limit
        {
            return Ok(SightLines::Through(
                position.map(|coordinate| libm::round(coordinate) as i64),
            ));
        }
        // The direction that shows as a point on the page. An eye too far away for the range of
        // numbers is treated as looking straight on.
        let sight = cross(right, up);
        let away = if dot(sight, forward) < 0.0 { 1.0 } else { -1.0 };
        let scale = away * limit / largest_component(sight);
        Ok(SightLines::Along(sight.map(|part| libm::round(part * scale) as i64)))
    }
}

/// The axes of the image and the point from which they are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axes {
    /// The directions right, up and away from the eye. They have length 1, except for the slants.
    pub directions: [Direction; 3],
    /// How much of the direction away from the eye is added to those right and up, within ±2.
    pub slants: [f64; 2],
    /// The eye in perspective; otherwise the point looked at.
    pub origin: Direction,
}

impl Axes {
    /// Computes the axes from the point and the direction that the user chose, and the lens.
    pub fn new(camera: &Camera) -> Result<Self, ViewError> {
        let (eye, at, straight) = match camera.pose {
            Pose::Towards { eye, at, up } => (eye, at, towards(eye, at, up)?),
            Pose::Turned { eye, angles } => (eye, eye, turned(angles)),
        };
        let slants = match camera.lens {
            Lens::Oblique { angle, ratio } => {
                let (sin, cos) = sin_cos_degrees(angle);
                [ratio * cos, ratio * sin]
            }
            Lens::Perspective | Lens::Orthographic => [0.0; 2],
        };
        let origin = match camera.lens.projection() {
            Projection::Perspective => eye,
            Projection::Parallel => at,
        };
        Ok(Self::slanted(straight, slants, origin))
    }

    /// Slants these directions right, up and away from the eye, which have length 1.
    fn slanted([right, up, forward]: [Direction; 3], slants: [f64; 2], origin: Direction) -> Self {
        let [along, upward] = slants;
        let directions = [sum(right, along, forward), sum(up, upward, forward), forward];
        Self { directions, slants, origin }
    }

    /// The axes of the parallel view that shows the same as the perspective one, if the eye is
    /// further away than [`FAR`] times the size of what lies between these extents along the axes:
    /// the coordinates of depth would have too few units there. The images of the two differ by at
    /// most a 2·[`FAR`]th of their size.
    pub(super) fn parallel_if_far(&self, extents: &[(f64, f64); 3]) -> Option<Self> {
        let size = extents.iter().fold(0.0, |most, (low, high)| f64::max(most, high - low));
        let [right, up, forward] = self.directions;
        let [x, y, z] = extents.map(|(low, high)| (low + high) / 2.0);
        let from_eye = |middle: f64, axis: Direction| middle - dot(axis, self.origin);
        let [across, above, depth] = [from_eye(x, right), from_eye(y, up), from_eye(z, forward)];
        // Far beside the line of sight, the axes would be too long for the arithmetic.
        let is_ahead = |beside: f64| libm::fabs(beside) <= 2.0 * depth;
        if depth <= FAR * size || !is_ahead(across) || !is_ahead(above) {
            return None;
        }
        // x/w and y/w around the centre, to the first order.
        // Measured from the model, because the eye may be as far as 10^15.
        let origin = sum(sum(sum([0.0; 3], x, right), y, up), z, forward);
        Some(Self::slanted(self.directions, [-across / depth, -above / depth], origin))
    }
}

/// Returns a + factor b.
fn sum([ax, ay, az]: Direction, factor: f64, [bx, by, bz]: Direction) -> Direction {
    [ax + factor * bx, ay + factor * by, az + factor * bz]
}

/// From so many times the size of a model on, the eye counts as infinitely far.
const FAR: f64 = 2048.0;

/// Returns the directions right, up and forward of an eye that looks from `eye` at `at`.
fn towards(
    eye: Direction,
    at: Direction,
    up: Option<Direction>,
) -> Result<[Direction; 3], ViewError> {
    let sight = [0, 1, 2].map(|axis| at[axis] - eye[axis]);
    let forward = normalized(sight).ok_or(ViewError::EyeAtTarget)?;
    let right = match up {
        Some(up) => normalized(up).and_then(|up| sideways(forward, up)),
        None => sideways(forward, [0.0, 0.0, 1.0]).or_else(|| sideways(forward, [0.0, 1.0, 0.0])),
    };
    let right = right.ok_or(ViewError::UpAlongSight)?;
    Ok([right, cross(right, forward), forward])
}

/// Returns the rows of Harrison's R = Rx Ry Rz (equation 5), with his x axis reversed. With y up
/// and z away from the eye his axes are right-handed, and the picture would be a mirror image.
fn turned([alpha, beta, gamma]: [f64; 3]) -> [Direction; 3] {
    let [(sa, ca), (sb, cb), (sg, cg)] = [alpha, beta, gamma].map(sin_cos_degrees);
    let up = [sa * sb * cg + ca * sg, ca * cg - sa * sb * sg, -sa * cb];
    let forward = [sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb];
    [cross(forward, up), up, forward]
}

/// Returns forward × up, scaled to length 1. Returns `None` if both are parallel within rounding.
fn sideways(forward: Direction, up: Direction) -> Option<Direction> {
    let right = cross(forward, up);
    if dot(right, right) < 1e-20 { None } else { normalized(right) }
}

/// Returns the scalar product of two vectors.
pub(super) fn dot(a: Direction, b: Direction) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the vector product a × b, which is at right angles to both vectors.
fn cross(a: Direction, b: Direction) -> Direction {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the greatest absolute value of the components.
pub(super) fn largest_component(a: Direction) -> f64 {
    a.iter().fold(0.0, |most, d| f64::max(most, libm::fabs(*d)))
}

/// Returns the vector of length 1 with this direction; `None` if it has no length.
fn normalized(a: Direction) -> Option<Direction> {
    // The vector is scaled first so that its squares neither overflow nor underflow.
    let largest = largest_component(a);
    if largest == 0.0 || !largest.is_finite() {
        return None;
    }
    let scaled = a.map(|d| d / largest);
    let length = square_root(dot(scaled, scaled));
    Some(scaled.map(|d| d / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::geometry::Precision;

    /// The box with these opposite corners.
    struct Cuboid([Position; 2]);

    impl Positions for Cuboid {
        fn fraction_bits(&self) -> u32 {
            0
        }

        fn bounds(&self) -> Option<(Position, Position)> {
            Some((self.0[0], self.0[1]))
        }

        fn positions(&self) -> impl Iterator<Item = Position> {
            self.0.into_iter()
        }

        fn precision(&self) -> Precision {
            Precision::default()
        }
    }

    fn near(a: Direction, b: Direction) -> bool {
        [0, 1, 2].iter().all(|&axis: &usize| libm::fabs(a[axis] - b[axis]) < 1e-12)
    }

    #[test]
    fn single_precision_is_rounded_as_the_language_does() {
        // The bits of the golden ratio, over and over, as mantissas.
        let mut bits = 0u64;
        for exponent in (1023 - 60..1023 + 3).cycle().take(2000) {
            bits = bits.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let value = f64::from_bits(exponent << 52 | bits >> 12);
            let ties = f64::from_bits(value.to_bits() & !0x0FFF_FFFF);
            for value in [value, ties, 0.0] {
                let single = to_single(value);
                assert_eq!(single, f64::from(value as f32), "{value}");
                if single > 0.0 {
                    let root = f32::from_bits(((single as f32).to_bits() + 1f32.to_bits()) >> 1);
                    assert_eq!(estimated_root(single), f64::from(root), "{value}");
                }
            }
        }
    }

    #[test]
    fn the_automatic_eye_sees_a_model_that_is_far_from_the_origin() {
        let corners = [[100, 200, 300], [104, 206, 301]];
        let cuboid = Cuboid(corners.map(|[x, y, z]| Position { x, y, z }));
        let (middle, radius) = middle_and_radius(&cuboid).unwrap();
        assert_eq!(middle, [102.0, 203.0, 300.5]);
        // Half of the diagonal, some 5 % off.
        let half = libm::sqrt(4.0 + 9.0 + 0.25);
        assert!((radius / half - 1.0).abs() < 0.07, "{radius} {half}");
        // Without a turn one looks along z, from below.
        let camera = Camera::turned(&cuboid, Lens::Perspective, [0.0; 3], None).unwrap();
        let eye = [102.0, 203.0, 300.5 - EYE_DISTANCE * radius];
        assert_eq!(camera.pose, Pose::Turned { eye, angles: [0.0; 3] });
        let given = Camera::turned(&cuboid, Lens::Orthographic, [0.0; 3], Some([1.0; 3])).unwrap();
        assert_eq!(given.pose, Pose::Turned { eye: [1.0; 3], angles: [0.0; 3] });
    }

    #[test]
    fn quarter_turns_are_exact() {
        for (degrees, sin_cos) in [
            (0.0, (0.0, 1.0)),
            (90.0, (1.0, 0.0)),
            (180.0, (0.0, -1.0)),
            (270.0, (-1.0, 0.0)),
            (-90.0, (-1.0, 0.0)),
            (450.0, (1.0, 0.0)),
        ] {
            let (sin, cos) = sin_cos_degrees(degrees);
            assert_eq!((sin + 0.0, cos + 0.0), sin_cos, "{degrees}");
        }
        let (sin, cos) = sin_cos_degrees(30.0);
        assert!(libm::fabs(sin - 0.5) < 1e-15 && libm::fabs(cos * cos - 0.75) < 1e-15);
    }

    #[test]
    fn an_unturned_viewpoint_looks_along_z_with_y_up_and_nothing_mirrored() {
        let [right, up, forward] = turned([0.0; 3]);
        assert!(
            near(forward, [0.0, 0.0, 1.0])
                && near(up, [0.0, 1.0, 0.0])
                && near(right, [-1.0, 0.0, 0.0])
        );
    }

    #[test]
    fn a_turned_view_is_the_view_towards_the_same_point() {
        for angles in [[20.0, 30.0, 40.0], [-100.0, 15.0, 200.0], [0.0, 89.0, 1.0]] {
            let [right, up, forward] = turned(angles);
            let eye = [1.0, 2.0, 3.0];
            let at = [0, 1, 2].map(|axis| eye[axis] + 5.0 * forward[axis]);
            let same = towards(eye, at, Some(up)).unwrap();
            assert!(
                near(same[0], right) && near(same[1], up) && near(same[2], forward),
                "{angles:?}"
            );
        }
    }

    #[test]
    fn the_automatic_eye_looks_at_the_point_from_its_side() {
        let cube = Cuboid([Position::ORIGIN, Position { x: 2, y: 2, z: 2 }]);
        let at = Some([10.0, 20.0, 30.0]);
        let camera = Camera::axonometric(&cube, 90.0, 0.0, at, None).unwrap();
        let Pose::Towards { eye, at, .. } = camera.pose else { panic!("{camera:?}") };
        assert!(near(at, [10.0, 20.0, 30.0]));
        // 3.5 radii away, which are estimated within 6 %, along the y axis.
        let far = (eye[1] - 20.0) / (3.5 * libm::sqrt(3.0));
        assert!((far - 1.0).abs() < 0.06, "{far}");
        assert!(near(eye, [10.0, eye[1], 30.0]), "{eye:?}");
        let camera =
            Camera::automatic(&cube, Lens::Oblique { angle: 45.0, ratio: 0.5 }, None, None);
        let Pose::Towards { eye, at, .. } = camera.unwrap().pose else { panic!() };
        assert!(near(at, [1.0; 3]) && near(eye, [1.0, eye[1], 1.0]) && eye[1] < -4.0, "{eye:?}");
    }

    #[test]
    fn parallel_lines_of_sight_point_to_the_user() {
        let eye = [3.0, -4.0, 12.0];
        let pose = Pose::Towards { eye, at: [0.0; 3], up: None };
        let lines = |lens| Camera { pose, lens }.sight_lines(4).unwrap();
        assert_eq!(lines(Lens::Perspective), SightLines::Through([48, -64, 192]));
        let SightLines::Along(direction) = lines(Lens::Orthographic) else { panic!("parallel") };
        let direction = direction.map(|part| part as f64 / libm::ldexp(1.0, 60));
        assert!(near(direction, [0.25, -1.0 / 3.0, 1.0]), "{direction:?}");
        // An eye beyond the range of numbers.
        let pose = Pose::Towards { eye: eye.map(|part| part * 1e18), at: [0.0; 3], up: None };
        let far = Camera { pose, lens: Lens::Perspective }.sight_lines(4).unwrap();
        let SightLines::Along(far) = far else { panic!("{far:?}") };
        assert!(near(far.map(|part| part as f64 / libm::ldexp(1.0, 60)), direction), "{far:?}");
    }
}
