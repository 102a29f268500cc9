//! Maps of positions: translation, scale, rotation and reflection.

use crate::array::MapEach;
use crate::fixed::{divide_rounding, product, sin_cos_degrees};
use crate::index::Index;
use crate::model::{BeforeChange, Model, ModelError, POSITION_LIMIT, Position, resolve};
use core::ops::Range;

/// The number of fraction bits of a matrix entry.
pub(super) const UNIT_BITS: u32 = 30;

/// The limit of the absolute value of a scale factor, in units of 2^-[`UNIT_BITS`].
pub(super) const SCALE_LIMIT: i64 = 1 << (20 + UNIT_BITS);

/// The number of bits of a normal's component. With it, a product with a difference of positions
/// fits 64 bits.
const NORMAL_BITS: u32 = 28;

// No index in this file can fail: a row, a column and an axis have a number from 0 to 2, and are
// indices of arrays of three.

/// How an edit moves vertices: a matrix and a shift, or a reflection.
pub(super) enum Map {
    /// The rows of a matrix in units of 2^-[`UNIT_BITS`], and the vector that is added.
    Affine([[i64; 3]; 3], [i64; 3]),
    /// The reflection about the plane through a position with this normal, each component within
    /// ±2^[`NORMAL_BITS`].
    Reflection(Position, [i64; 3]),
}

impl Map {
    /// The shift of an affine map by which nothing is shifted.
    pub(super) const NO_SHIFT: [i64; 3] = [0; 3];

    /// Returns the matrix with these entries on its diagonal and zeros elsewhere.
    pub(super) fn diagonal(entries: [i64; 3]) -> [[i64; 3]; 3] {
        [0, 1, 2].map_each(|row| {
            [0, 1, 2].map_each(|column| if row == column { entries[row] } else { 0 })
        })
    }

    /// Makes the rotation about an axis, counter-clockwise as seen from its positive end.
    pub(super) fn rotation(axis: u8, degrees: f64) -> Self {
        let entry = |value: f64| libm::round(libm::ldexp(value, UNIT_BITS as i32)) as i64;
        let (sine, cosine) = sin_cos_degrees(degrees);
        let (sine, cosine) = (entry(sine), entry(cosine));
        let axis = usize::from(axis % 3);
        let (from, to) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut rows = Self::diagonal([1 << UNIT_BITS; 3]);
        (rows[from][from], rows[from][to]) = (cosine, -sine);
        (rows[to][from], rows[to][to]) = (sine, cosine);
        Self::Affine(rows, Self::NO_SHIFT)
    }

    /// How far a position is from the one on the plane of a reflection, along the axis on which
    /// that is most; 0 for other maps.
    pub(super) fn distance(&self, position: Position) -> u64 {
        let Self::Reflection(on_plane, _) = self else { return 0 };
        let pairs = position.coordinates().into_iter().zip(on_plane.coordinates());
        pairs.map(|(p, q)| p.abs_diff(q).into()).max().unwrap_or(0)
    }

    /// Returns the image of a position, rounded and limited to ±2^62.
    // Not inlined, so that its 128-bit arithmetic is in the program only once.
    #[inline(never)]
    pub(super) fn apply(&self, position: Position) -> [i64; 3] {
        let p = position.coordinates().map_each(i64::from);
        match self {
            Self::Affine(rows, shift) => [0, 1, 2].map_each(|row: usize| {
                let products = rows[row].iter().zip(p).map(|(m, p)| product(*m, p));
                let half = 1 << (UNIT_BITS - 1);
                within((products.sum::<i128>() + half) >> UNIT_BITS).saturating_add(shift[row])
            }),
            Self::Reflection(on_plane, n) => {
                let q = on_plane.coordinates().map_each(i64::from);
                // The sum is below 3 2^31 2^28.
                let height: i64 = (0..3).map(|k| (p[k] - q[k]) * n[k]).sum();
                let square: i64 = n.iter().map(|c| c * c).sum();
                [0, 1, 2].map_each(|k: usize| {
                    let product = 2 * product(height, n[k]);
                    p[k] - within(divide_rounding(product, square.into()))
                })
            }
        }
    }
}

/// Limits a coordinate to ±2^62, far beyond what a model can hold. Later checks refuse it.
#[inline(never)] // Its 128-bit arithmetic is long.
fn within(value: i128) -> i64 {
    const LIMIT: i128 = 1 << 62;
    value.clamp(-LIMIT, LIMIT) as i64
}

impl<I: Index> Model<'_, I> {
    /// Returns the reflection about the plane through three vertices, given by their numbers.
    pub(super) fn reflection(&self, numbers: [i32; 3]) -> Result<Map, ModelError> {
        let vertices = self.vertices.len();
        let mut corners = [Position::default(); 3];
        for (corner, number) in corners.iter_mut().zip(numbers) {
            *corner = resolve::<I>(number, vertices)
                .and_then(|at| self.vertices.get(at.get()))
                .copied()
                .ok_or(ModelError::UnknownVertex { number, vertices })?;
        }
        let [a, b, c] = corners.map_each(Position::coordinates);
        let [u, v] = [b, c]
            .map_each(|end| [0, 1, 2].map_each(|k: usize| i64::from(end[k]) - i64::from(a[k])));
        let cross = [0, 1, 2].map_each(|k: usize| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            // Each component is at most 2^63.
            (u[i] * v[j]).saturating_sub(u[j] * v[i])
        });
        let divisor = cross.iter().fold(0, |divisor, part| gcd(divisor, part.unsigned_abs()));
        if divisor == 0 {
            return Err(ModelError::NoPlane);
        }
        let divisor = i64::try_from(divisor).unwrap_or(i64::MAX);
        let normal = cross.map(|part| part / divisor);
        let largest = normal.iter().map(|part| part.unsigned_abs()).max().unwrap_or(1);
        let excess = (u64::BITS - largest.leading_zeros()).saturating_sub(NORMAL_BITS);
        let half = 1i64.checked_shl(excess.wrapping_sub(1)).unwrap_or(0);
        Ok(Map::Reflection(corners[0], normal.map(|part| part.saturating_add(half) >> excess)))
    }

    /// Maps the vertices in `range`, and makes the unit coarser if necessary.
    pub(super) fn transform(
        &mut self,
        map: &Map,
        range: Range<usize>,
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let coarser = self.coarser_for(map, range.clone())?;
        before(self);
        for position in self.vertices.get_mut(range.clone()).unwrap_or(&mut []) {
            *position = in_unit(map.apply(*position), coarser);
        }
        self.coarsen_others(coarser, range);
        Ok(())
    }

    /// Returns by how many bits the unit must become coarser so that the images of the vertices in
    /// `range` fit.
    pub(super) fn coarser_for(&self, map: &Map, range: Range<usize>) -> Result<u32, ModelError> {
        let positions = self.vertices.get(range).unwrap_or(&[]);
        let mut largest = 0;
        for position in positions {
            for part in map.apply(*position) {
                largest = part.unsigned_abs().max(largest);
            }
        }
        (0..=self.fraction_bits)
            .find(|bits| largest >> bits <= POSITION_LIMIT as u64)
            .ok_or(ModelError::CoordinateTooLarge)
    }

    /// Converts all vertices except those in `range` to a unit that is coarser by `bits`.
    pub(super) fn coarsen_others(&mut self, bits: u32, range: Range<usize>) {
        if bits > 0 {
            for (at, position) in self.vertices.iter_mut().enumerate() {
                if !range.contains(&at) {
                    *position = in_unit(position.coordinates().map_each(i64::from), bits);
                }
            }
            self.rounding.coarsen(bits);
            self.fraction_bits -= bits;
        }
    }
}

/// Converts a position to a coarser unit. It is rounded towards zero, as when the unit of the model
/// changes.
pub(super) fn in_unit(position: [i64; 3], coarser: u32) -> Position {
    // Each coordinate fits 32 bits: see `coarser_for`.
    let [x, y, z] = position.map_each(|c| ((c.abs() >> coarser) * c.signum()) as i32);
    Position { x, y, z }
}

/// Returns the greatest common divisor.
fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
