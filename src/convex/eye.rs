//! The point or direction from which the user looks at a convex solid.

use super::SolidError;
use super::exact::Point;
use crate::array::MapEach;
use crate::fixed::{divide, product};

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
        let step = 4 * i64::from(tolerance.min(extent >> 10));
        if step == 0 {
            return self;
        }
        let square = i64::from(extent) * i64::from(extent); // at most 2^62
        let centre = centre.map_each(i64::from);
        // An axis is 0, 1 or 2, so no indexing below can fail.
        let (ray, nearest) = match self {
            Self::At(position) => {
                ([0, 1, 2].map_each(|axis| position[axis] - centre[axis]), square)
            }
            Self::Towards(direction) => (direction, 0),
        };
        let greatest = ray.iter().map(|part| part.abs()).max().unwrap_or(0);
        let divisor = (i128::from(nearest) + product(step, greatest)).unsigned_abs();
        // The ray is below 2^62, and the part of it that remains is below 2^61 in either case.
        let shortened =
            |part: i64| part.signum() * divide(product(part.abs(), square) as u128, divisor) as i64;
        Self::At([0, 1, 2].map_each(|axis| centre[axis] + shortened(ray[axis])))
    }
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
