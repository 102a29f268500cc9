//! Positions in the model's own space, how coordinates become such, and what a camera must know of
//! them, wherever they lie.

use super::{FINEST_FRACTION_BITS, Model, ModelError};
use crate::array::MapEach;
use crate::fixed::Decimal;
use crate::geometry::Precision;
use crate::index::Index;
use bytemuck::{Pod, Zeroable};

/// A position in the model's own space. Each coordinate is in units of 2^-[`Model::fraction_bits`],
/// and its absolute value is at most 2^30.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Position {
    /// The x coordinate.
    pub x: i32,
    /// The y coordinate.
    pub y: i32,
    /// The z coordinate.
    pub z: i32,
}

impl Position {
    /// The position whose coordinates are 0.
    pub const ORIGIN: Self = Self { x: 0, y: 0, z: 0 };

    /// Returns x, y and z in this order.
    pub fn coordinates(self) -> [i32; 3] {
        [self.x, self.y, self.z]
    }
}

/// The limit of the absolute value of stored coordinates, so that their differences fit 32 bits.
pub const POSITION_LIMIT: i32 = 1 << 30;

/// Converts coordinates to the finest unit, not finer than 2^-`fraction_bits`, in which they are
/// within the limit. Returns the number of fraction bits of that unit, too.
///
/// # Errors
/// [`ModelError::CoordinateTooLarge`].
#[inline(always)] // On a board with little flash it has one caller.
pub(super) fn truncated(
    coordinates: [Decimal; 3],
    fraction_bits: u32,
) -> Result<(Position, u32), ModelError> {
    let fraction_bits = (0..=fraction_bits)
        .rev()
        .find(|bits| {
            coordinates.iter().all(|coordinate| {
                coordinate
                    .to_binary_truncated(*bits)
                    .is_ok_and(|value| value.unsigned_abs() <= POSITION_LIMIT as u64)
            })
        })
        .ok_or(ModelError::CoordinateTooLarge)?;
    let [x, y, z] = coordinates.map_each(|coordinate| {
        // It is in range, because the search above tried it.
        coordinate
            .to_binary_truncated(fraction_bits)
            .ok()
            .and_then(|value| i32::try_from(value).ok())
            .unwrap_or(0)
    });
    Ok((Position { x, y, z }, fraction_bits))
}

/// What a camera must know of a model.
pub trait Positions {
    /// The number of fraction bits, 0 to 30: the unit of every coordinate is 2^-this.
    fn fraction_bits(&self) -> u32;

    /// The smallest box around all vertices, or `None` if there are none.
    fn bounds(&self) -> Option<(Position, Position)>;

    /// The positions of all vertices, in the order in which they were sent.
    fn positions(&self) -> impl Iterator<Item = Position>;

    /// The error bound of each coordinate, in the model's unit.
    fn precision(&self) -> Precision;

    /// The precision when the user states the error bound, as `chosen` in the model's own
    /// coordinates. Zero means that the coordinates are exact.
    fn chosen_precision(&self, chosen: Decimal) -> Precision {
        let known = self.precision();
        let units = chosen.to_binary(self.fraction_bits()).unwrap_or(i64::MAX);
        let written = u32::try_from(units).unwrap_or(u32::MAX).min(1 << FINEST_FRACTION_BITS);
        Precision { written: written.max(known.unit), unit: known.unit }
    }
}

impl<I: Index> Positions for Model<'_, I> {
    fn fraction_bits(&self) -> u32 {
        self.fraction_bits
    }

    fn bounds(&self) -> Option<(Position, Position)> {
        Model::bounds(self)
    }

    fn positions(&self) -> impl Iterator<Item = Position> {
        self.vertices.iter().copied()
    }

    fn precision(&self) -> Precision {
        Model::precision(self)
    }
}
