//! Computes the error bound of the coordinates: the rounding of the numbers that were sent, and
//! what each edit adds to it.

use super::{FINEST_FRACTION_BITS, Model};
use crate::fixed::Decimal;
use crate::geometry::Precision;
use crate::index::Index;

/// Numbers with fewer decimals than this are taken to be exact, such as `0.25`, or a grid in steps
/// of 0.1.
const FEWEST_ROUNDED: u32 = 3;

/// The facts about the rounding of a model's coordinates.
///
/// What counts is the greatest number of decimals in the model without zeros at the end, so it
/// makes no difference whether a program writes those zeros. From three decimals on, the last one
/// is taken to be rounded. Numbers with fewer decimals are taken to be exact, and so are whole
/// numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Rounding {
    /// The greatest number of decimals of the coordinates that were sent.
    decimals: u8,
    /// Whether an edit may have made errors along all three axes of an error along one.
    rotated: bool,
    /// The error bound after edits, in the model's unit.
    edited: u32,
}

impl Rounding {
    /// Takes into account with how many decimals coordinates were sent.
    pub(super) fn write(&mut self, coordinates: &[Decimal]) {
        for coordinate in coordinates {
            let decimals = coordinate.decimals().min(u8::MAX.into()) as u8;
            self.decimals = self.decimals.max(decimals);
        }
    }

    /// Returns the error bound of each coordinate, in units of 2^-`fraction_bits`.
    pub(super) fn precision(&self, fraction_bits: u32) -> Precision {
        let unit = u32::from(self.decimals > 0);
        let decimals = u32::from(self.decimals);
        let half = match 10u64.checked_pow(decimals) {
            _ if decimals < FEWEST_ROUNDED => 0,
            // At most 2^30. Twice 10^19 is no number of 64 bits. The compiler does not know that no
            // power is 0.
            Some(power) => ((1 << fraction_bits) / power.max(1) / 2) as u32 + 1,
            None => 1,
        };
        let written = (half + unit).max(self.edited);
        Precision { written, unit: written.min(1) }
    }

    /// Updates the error bound when the unit becomes coarser by `bits`.
    pub(super) fn coarsen(&mut self, bits: u32) {
        if self.edited > 0 && bits > 0 {
            self.edited = (self.edited >> bits) + 2;
        }
    }

    /// Updates the error bound when coordinates are multiplied by a number in units of 2^-30, and
    /// rounded if it is not whole. `all` tells whether all vertices are.
    pub(super) fn scale(&mut self, fraction_bits: u32, by: u64, is_whole: bool, all: bool) {
        const BITS: u32 = FINEST_FRACTION_BITS;
        let written = u64::from(self.precision(fraction_bits).written);
        // The product is below 2^31 2^51. An error larger than the model needs no exact value.
        let scaled = (u128::from(written) * u128::from(by)) >> BITS;
        let scaled = u32::try_from(scaled).unwrap_or(u32::MAX).min(1 << BITS);
        let more = u32::from(written > 0) + u32::from(!is_whole);
        if all {
            (self.decimals, self.edited) = (0, 0);
        }
        self.edited = self.edited.max(scaled.saturating_add(more));
    }

    /// Updates the error bound when coordinates are rotated or reflected. An error within a cube
    /// lies within the sphere around the cube, and stays there however often it is rotated: 7/4 is
    /// more than the square root of 3.
    pub(super) fn rotate(&mut self, fraction_bits: u32, all: bool) {
        const WHOLE: u64 = 1 << FINEST_FRACTION_BITS;
        let by = if self.rotated { WHOLE } else { WHOLE / 4 * 7 };
        self.scale(fraction_bits, by, false, all);
        self.rotated = true;
    }

    /// Returns these facts as two numbers, so that they can be saved for `$undo`.
    pub(super) fn numbers(&self) -> [usize; 2] {
        [usize::from(self.decimals) << 1 | usize::from(self.rotated), self.edited as usize]
    }

    /// Makes the record again from the two numbers that [`Rounding::numbers`] returned.
    pub(super) fn from_numbers([decimals, edited]: [u32; 2]) -> Self {
        Self { decimals: (decimals >> 1) as u8, rotated: decimals & 1 != 0, edited }
    }
}

impl<I: Index> Model<'_, I> {
    /// Returns the error bound of each coordinate, in the model's unit. It is half a unit of the
    /// last decimal that was written if there are three or more, and what the rounding to the
    /// model's unit and edits have added.
    ///
    /// ```
    /// use penup::fixed::Decimal;
    /// use penup::model::{Model, Position, no_undo};
    /// let (mut vertices, mut corners) = ([Position::ORIGIN; 2], []);
    /// let mut model: Model = Model::new(&mut vertices, &mut corners);
    /// let decimals = |texts: [&str; 3]| texts.map(|text| Decimal::parse(text).unwrap());
    /// model.add_vertex(decimals(["8", "2.5", "0"]), &mut no_undo)?;
    /// assert_eq!(model.precision().written, 1); // Exact but for the unit.
    /// model.add_vertex(decimals(["1", "2.540", "0.125"]), &mut no_undo)?;
    /// let half = model.precision().written as f64 / (1 << model.fraction_bits()) as f64;
    /// assert!((half - 0.0005).abs() < 1e-7);
    /// # Ok::<(), penup::model::ModelError>(())
    /// ```
    pub fn precision(&self) -> Precision {
        self.rounding.precision(self.fraction_bits)
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use super::*;
    use crate::stage::Scratch;
    use std::format;

    fn decimals(texts: [&str; 3]) -> [Decimal; 3] {
        texts.map(|text| Decimal::parse(text).unwrap())
    }

    fn with_vertices(positions: &[[&str; 3]], test: impl FnOnce(&mut Model<'_>)) {
        let mut vertices = [Position::ORIGIN; 8];
        let mut corners = [<Corner>::ZERO; 4];
        let mut model = Model::new(&mut vertices, &mut corners);
        for position in positions {
            model.add_vertex(decimals(*position), &mut no_undo).unwrap();
        }
        test(&mut model);
    }

    /// The precision in units of the model.
    fn written(model: &Model<'_>) -> f64 {
        f64::from(model.precision().written) / (model.fraction_bits() as f64).exp2()
    }

    fn is_about(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-7
    }

    /// Single precision near zero has so many, as what CAD programs leave of a zero.
    #[test]
    fn numbers_may_have_any_number_of_decimals() {
        for decimals in 1..60 {
            let zeros = "0".repeat(decimals - 1);
            let small = format!("0.{zeros}5");
            with_vertices(&[["1", "2", &small]], |model| {
                let unit = (model.fraction_bits() as f64).exp2().recip();
                let half = if decimals < 3 { 0.0 } else { 0.5 / 10f64.powi(decimals as i32) };
                let found = written(model);
                assert!(found >= half && found <= half + 2.0 * unit, "{decimals}: {found}");
            });
        }
    }

    #[test]
    fn whole_numbers_are_exact_and_stay_so() {
        with_vertices(&[["1000", "0", "1"], ["0", "2", "3"]], |model| {
            assert_eq!(model.precision(), Precision::default());
            let edits = [
                Edit::Rotate(2, 90.0, None),
                Edit::Scale(decimals(["3", "-2", "1"]), None),
                Edit::Translate(decimals(["5", "0", "-7"]), None),
            ];
            for edit in edits {
                model.edit(edit, Scratch::new(&mut []), &mut no_undo).unwrap();
                assert_eq!(model.precision(), Precision::default(), "{edit:?}");
            }
        });
    }

    #[test]
    fn few_decimals_are_meant_as_they_stand() {
        for position in [["0.1", "0.2", "0"], ["0.25", "1.75", "2.50"], ["0.100", "0.2000", "1e-2"]]
        {
            with_vertices(&[position, ["100", "1", "1"]], |model| {
                assert_eq!(model.precision(), Precision { written: 1, unit: 1 });
            });
        }
    }

    #[test]
    fn the_most_decimals_count_wherever_zeros_end() {
        for last in ["0.125000", "0.125", "1.25e-1"] {
            with_vertices(&[["0.000001", "5", last], ["9", "-2.5", "0.75"]], |model| {
                assert!(is_about(written(model), 5e-7));
            });
        }
    }

    #[test]
    fn the_precision_survives_a_coarser_unit_and_undoing() {
        with_vertices(&[["0.1234", "0", "0"]], |model| {
            assert!(is_about(written(model), 5e-5));
            let mut words = [0; 64];
            assert!(model.save(&mut words));
            model.add_vertex(decimals(["1000", "0", "0"]), &mut no_undo).unwrap();
            assert!((written(model) - 5e-5).abs() < 3e-6);
            model.edit(Edit::Rotate(0, 10.0, None), Scratch::new(&mut []), &mut no_undo).unwrap();
            assert!(written(model) > 8e-5);
            model.restore(&words);
            assert!(is_about(written(model), 5e-5));
            model.clear();
            assert_eq!(model.precision(), Precision::default());
        });
    }

    #[test]
    fn edits_carry_the_error_along() {
        let position = ["0.123", "0.5", "0"];
        with_vertices(&[position, ["7", "7", "7"]], |model| {
            let edit = |model: &mut Model<'_>, edit| {
                model.edit(edit, Scratch::new(&mut [0; 4]), &mut no_undo).unwrap();
                written(model)
            };
            assert!(is_about(
                edit(model, Edit::Scale(decimals(["0.1", "0.1", "0.2"]), None)),
                1e-4
            ));
            // However often it is rotated, the error lies in the same sphere.
            for _ in 0..40 {
                let rotated = edit(model, Edit::Rotate(1, 33.0, None));
                assert!((1.7e-4..1.8e-4).contains(&rotated), "{rotated}");
            }
            assert!(edit(model, Edit::Scale(decimals(["9", "1", "1"]), Some([1, 1]))) > 15e-4);
            // What is sent afterwards has its own error bound.
            model.clear();
            model.add_vertex(decimals(position), &mut no_undo).unwrap();
            assert!(is_about(written(model), 5e-4));
            assert_eq!(model.chosen_precision(Decimal::parse("0").unwrap()).written, 1);
            let chosen = model.chosen_precision(Decimal::parse("0.25").unwrap()).written;
            assert_eq!(chosen, 1 << (model.fraction_bits() - 2));
        });
    }
}
