//! Edits a model, after Cárdenas & Seeley: sequential arrays of joints and bars, and here of faces
//! and curves too.
//!
//! [`Model::edit`] makes one [`Edit`]. A deletion either closes the gap by compaction, so that all
//! higher numbers decrease, or plugs it with the last element, so that only the number of that one
//! changes. Elements that use a deleted vertex are deleted too. An edit is refused, and the model
//! is unchanged, if numbers do not exist, if a plane is defined by collinear vertices, or if
//! coordinates or a copy do not fit.

mod delete;
mod map;
mod mirror;

use super::pens::RUN;
use super::{BeforeChange, Model, ModelError, resolve};
use crate::array::MapEach;
use crate::fixed::{Decimal, rest_of_periods};
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use core::ops::Range;
use map::{Map, SCALE_LIMIT, UNIT_BITS};

/// The kinds of elements of a model, each with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ElementKind {
    /// The vertices, which Cárdenas & Seeley call joints.
    Vertices,
    /// The bars, straight lines that belong to no face.
    Bars,
    /// The faces, flat polygons that hide what is behind them.
    Faces,
    /// The curves, which are B-splines.
    Curves,
}

/// The first and the last number of a range, from 1, or from -1 backwards; `None` for all elements.
pub type Numbers = Option<[i32; 2]>;

/// A change of a model. Numbers are as in OBJ: from 1, or from -1 backwards for the last ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edit {
    /// Deletes a range of elements; the higher numbers decrease.
    Delete(ElementKind, [i32; 2]),
    /// Deletes one element; the last one gets its number.
    Plug(ElementKind, i32),
    /// Moves one vertex, given by its number, to a position.
    Move(i32, [Decimal; 3]),
    /// Moves vertices by a vector.
    Translate([Decimal; 3], Numbers),
    /// Multiplies the x, the y and the z of vertices by a factor each.
    Scale([Decimal; 3], Numbers),
    /// Rotates about an axis (0 to 2) through the origin by an angle in degrees, counter-clockwise
    /// as seen from the positive end of the axis.
    Rotate(u8, f64, Numbers),
    /// Adds the mirror image about the plane of three vertices. Vertices on the plane belong to
    /// both halves.
    Mirror([i32; 3], Numbers),
    /// Replaces vertices by their mirror image about the plane of three vertices.
    Reflect([i32; 3], Numbers),
}

/// How many elements of each kind an edit added, or removed if negative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Change {
    /// The change of the number of vertices (joints).
    pub vertices: i32,
    /// By how much the number of bars of the model changes; negative if it falls.
    pub bars: i32,
    /// By how much the number of faces of the model changes; negative if it falls.
    pub faces: i32,
    /// By how much the number of curves of the model changes; negative if it falls.
    pub curves: i32,
}

impl<I: Index> Model<'_, I> {
    /// Makes one change. `scratch` must have 2 bytes for each vertex that is mirrored. `before` is
    /// called with the model just before it changes.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn edit(
        &mut self,
        edit: Edit,
        scratch: Scratch<'_>,
        before: BeforeChange<'_, I>,
    ) -> Result<Change, ModelError> {
        if self.curves.is_unfinished() {
            return Err(ModelError::CurveUnfinished);
        }
        let counts = self.counts();
        match edit {
            Edit::Delete(part, numbers) => {
                let range = self.range(part, Some(numbers))?;
                before(self);
                self.delete(part, range, false);
            }
            Edit::Plug(part, number) => {
                let range = self.range(part, Some([number; 2]))?;
                if self.pens().changes() > 0
                    && matches!(part, ElementKind::Bars | ElementKind::Faces)
                {
                    // The pen may change before and after the element that is moved.
                    self.store.check_room(2 * RUN)?;
                }
                before(self);
                self.delete(part, range, true);
            }
            Edit::Move(number, coordinates) => {
                let range = self.range(ElementKind::Vertices, Some([number; 2]))?;
                let position = self.position(coordinates, before)?;
                for vertex in self.vertices.get_mut(range).unwrap_or(&mut []) {
                    *vertex = position;
                }
            }
            Edit::Translate(by, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                let mut shift = Map::NO_SHIFT;
                for (shift, by) in shift.iter_mut().zip(by) {
                    *shift = by
                        .to_binary_truncated(self.fraction_bits)
                        .map_err(|_| ModelError::CoordinateTooLarge)?;
                }
                let map = Map::Affine(Map::diagonal([1 << UNIT_BITS; 3]), shift);
                self.transform(&map, range.clone(), before)?;
                let is_whole = by.iter().all(|by| by.decimals() == 0);
                self.scale_errors(1 << UNIT_BITS, is_whole, &range);
            }
            Edit::Scale(by, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                let mut factors = [0; 3];
                for (factor, by) in factors.iter_mut().zip(by) {
                    let value = by.to_binary(UNIT_BITS).ok();
                    *factor = value
                        .filter(|factor| factor.abs() <= SCALE_LIMIT)
                        .ok_or(ModelError::CoordinateTooLarge)?;
                }
                let map = Map::Affine(Map::diagonal(factors), Map::NO_SHIFT);
                self.transform(&map, range.clone(), before)?;
                let most = factors.iter().map(|factor| factor.unsigned_abs()).max().unwrap_or(0);
                let is_whole = factors.iter().all(|factor| factor % (1 << UNIT_BITS) == 0);
                self.scale_errors(most, is_whole, &range);
            }
            Edit::Rotate(axis, degrees, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.transform(&Map::rotation(axis, degrees), range.clone(), before)?;
                if rest_of_periods(degrees, 90.0) != 0.0 {
                    self.rotate_errors(&range);
                }
            }
            Edit::Reflect(plane, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.transform(&self.reflection(plane)?, range.clone(), before)?;
                self.reverse_faces(&range);
                self.rotate_errors(&range);
            }
            Edit::Mirror(plane, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.mirror(&self.reflection(plane)?, range, scratch, before)?;
                self.rotate_errors(&(0..0));
            }
        }
        let after = self.counts();
        let [vertices, bars, faces, curves] =
            [0, 1, 2, 3].map_each(|part: usize| after[part] as i32 - counts[part] as i32);
        Ok(Change { vertices, bars, faces, curves })
    }

    /// Updates the error bound after the vertices in `range` were multiplied by a factor in units
    /// of 2^-30.
    fn scale_errors(&mut self, by: u64, is_whole: bool, range: &Range<usize>) {
        let all = range.len() == self.vertices.len();
        self.rounding.scale(self.fraction_bits, by, is_whole, all);
    }

    /// Updates the error bound after the vertices in `range` were rotated or reflected.
    fn rotate_errors(&mut self, range: &Range<usize>) {
        let all = range.len() == self.vertices.len();
        self.rounding.rotate(self.fraction_bits, all);
    }

    /// Returns the numbers of vertices, bars, faces and curves.
    fn counts(&self) -> [usize; 4] {
        [ElementKind::Vertices, ElementKind::Bars, ElementKind::Faces, ElementKind::Curves]
            .map(|part| self.count(part))
    }

    /// Returns the number of elements of a kind.
    pub fn count(&self, part: ElementKind) -> usize {
        match part {
            ElementKind::Vertices => self.vertices.len(),
            ElementKind::Bars => self.bars,
            ElementKind::Faces => self.faces,
            ElementKind::Curves => self.curves.count,
        }
    }

    /// Returns the indices of the elements with these numbers. The range is empty only if `numbers`
    /// is `None` and there are no elements.
    ///
    /// # Errors
    /// [`ModelError::UnknownVertex`], [`ModelError::UnknownElement`].
    pub fn range(&self, part: ElementKind, numbers: Numbers) -> Result<Range<usize>, ModelError> {
        let count = self.count(part);
        let Some(numbers) = numbers else { return Ok(0..count) };
        let mut ends = [0; 2];
        for (end, number) in ends.iter_mut().zip(numbers) {
            *end = resolve::<I>(number, count).map(I::get).ok_or(match part {
                ElementKind::Vertices => ModelError::UnknownVertex { number, vertices: count },
                _ => ModelError::UnknownElement { part, number, count },
            })?;
        }
        let [first, last] = ends;
        Ok(first.min(last)..first.max(last) + 1)
    }
}

impl From<OutOfScratch> for ModelError {
    fn from(missing: OutOfScratch) -> Self {
        Self::Scratch(missing)
    }
}
