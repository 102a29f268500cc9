//! The point or direction from which the user looks at a convex solid.

use super::SolidError;
use super::exact::Point;

/// The eye, in units of the positions of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eye {
    /// Perspective projection: the lines of sight meet at this point.
    At([i64; 3]),
    /// Parallel projection: the direction from the solid to the user, not zero, of any length.
    Towards([i64; 3]),
}

/// The coordinates of an [`Eye`] lie within ± this limit.
pub const EYE_LIMIT: i64 = 1 << 61;

impl Eye {
    /// Checks that the coordinates are within [`EYE_LIMIT`], and that a direction is not zero.
    pub(super) fn check(self) -> Result<(), SolidError> {
        let (Self::At(coordinates) | Self::Towards(coordinates)) = self;
        let in_range =
            coordinates.iter().all(|part| part.unsigned_abs() <= EYE_LIMIT.unsigned_abs());
        if in_range && self != Self::Towards([0; 3]) { Ok(()) } else { Err(SolidError::BadEye) }
    }

    /// Returns the eye moved straight towards `centre`, so that the reciprocal of its distance
    /// grows by 4 `tolerance` / `extent`². The distance is measured along the axis on which it is
    /// greatest.
    pub(super) fn drawn_in(self, centre: Point, extent: u32, tolerance: u32) -> Self {
        // With a tolerance of more than 1/1024 of the solid the eye would come too near to see it
        // from the same side.
        let step = 4 * i128::from(tolerance.min(extent >> 10));
        if step == 0 {
            return self;
        }
        let square = i128::from(extent) * i128::from(extent); // below 2^62
        let centre = centre.map(i64::from);
        let (ray, divisor) = match self {
            Self::At(position) => {
                let ray = [0, 1, 2].map(|axis| position[axis] - centre[axis]);
                (ray, square + step * greatest(ray))
            }
            Self::Towards(direction) => (direction, step * greatest(direction)),
        };
        // The ray is below 2^62, and the part of it that remains is below 2^61 in either case.
        Self::At(
            [0, 1, 2].map(|axis| centre[axis] + (i128::from(ray[axis]) * square / divisor) as i64),
        )
    }
}

/// Returns the greatest absolute value of the components.
fn greatest(ray: [i64; 3]) -> i128 {
    ray.iter().map(|part| i128::from(part.unsigned_abs())).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eye_comes_nearer_on_the_same_ray() {
        let centre = [100, 0, 0];
        let unmoved = Eye::At([1 << 40, 0, 5]);
        assert_eq!(unmoved.drawn_in(centre, 1 << 20, 0), unmoved);
        assert_eq!(unmoved.drawn_in(centre, 1000, 1), unmoved);
        // 1 / 2^20 + 4 × 2^6 / 2^40 = 1 / 2^20 + 1 / 2^32
        let moved = Eye::At([100, -(1 << 20), 1 << 19]).drawn_in(centre, 1 << 20, 64);
        let distance = (1i64 << 32) / 4097;
        assert_eq!(moved, Eye::At([100, -distance, distance / 2]));
        // 4096 times the size.
        let parallel = Eye::Towards([0, -3, 6]).drawn_in(centre, 1 << 20, 64);
        assert_eq!(parallel, Eye::At([100, -(1 << 31), 1 << 32]));
        assert_eq!(Eye::At([100, 0, 0]).drawn_in(centre, 1 << 20, 64), Eye::At([100, 0, 0]));
    }

    #[test]
    fn the_largest_numbers_stay_in_range() {
        let far = EYE_LIMIT;
        for tolerance in [1, 1 << 17, u32::MAX] {
            for eye in
                [Eye::At([far, -far, far]), Eye::Towards([far, -far, far]), Eye::Towards([1, 0, 0])]
            {
                let moved = eye.drawn_in([1 << 30, -(1 << 30), 0], 1 << 31, tolerance);
                assert_eq!(moved.check(), Ok(()), "{eye:?} {tolerance}");
            }
        }
    }
}
