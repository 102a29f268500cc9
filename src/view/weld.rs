//! Repairs two common defects of models: welds vertices at the same position, and leaves out faces
//! without an area.

use crate::array::MapEach;
use crate::index::Index;
use crate::model::{Corner, Element, Elements, PenWriter, Position};
use crate::stage::{Cancel, OutOfScratch, Scratch, StageError};

/// Returns the elements of a model with each vertex replaced by the first one at the same
/// position and without the faces that have no area, and the number of these faces. Returns the
/// model's own elements if there is nothing to do. A remaining face may then have the same corner
/// twice in a row; visibility can process that.
///
/// If there is something to do, it takes 2 bytes of memory for each corner and 4 for each change of
/// the pen. While it runs it takes 4 to 8 more bytes for each vertex.
pub(crate) fn weld<'a, I: Index>(
    positions: &'a [Position],
    elements: Elements<'a, I>,
    scratch: &mut Scratch<'a>,
    cancel: &mut dyn Cancel,
) -> Result<(Elements<'a, I>, u32), StageError> {
    let degenerate = elements.iter().filter(|element| !has_extent(element, positions)).count();
    cancel.check()?;
    if degenerate == 0 && PositionTable::<I>::new(positions, &mut scratch.reborrow())?.1 == 0 {
        return Ok((elements, 0));
    }
    let corners: &mut [Corner<I>] = scratch.take(elements.corners().len())?;
    let mut pens = PenWriter::new(scratch, elements.pens().changes())?;
    cancel.check()?;
    let (table, _) = PositionTable::new(positions, &mut scratch.reborrow())?;
    cancel.check()?;
    let mut kept = 0;
    let with_extent =
        elements.iter_with_pens().filter(|(element, _)| has_extent(element, positions));
    for (element, pen) in with_extent {
        pens.element(kept, pen);
        let bar;
        let old = match element {
            Element::Face(corners) => corners,
            Element::Bar(from, to) => {
                bar = [Corner::new(from, true, false), Corner::new(to, true, true)];
                &bar
            }
        };
        for (new, old) in corners.iter_mut().skip(kept).zip(old) {
            let first = table.first_at(old.vertex()).unwrap_or(old.vertex());
            *new = Corner::new(first, old.of_bar(), old.is_last());
        }
        kept += old.len();
    }
    let corners: &'a [Corner<I>] = corners;
    let corners = corners.get(..kept).unwrap_or(corners);
    Ok((Elements::with_pens(corners, pens.finish()), degenerate as u32))
}

/// Whether an element is a bar or a face with an area.
fn has_extent<I: Index>(element: &Element<'_, I>, positions: &[Position]) -> bool {
    let Element::Face(corners) = element else { return true };
    let mut corners = corners.iter().filter_map(|c| positions.get(c.vertex().get()).copied());
    corners.next().is_some_and(|start| spans_area(start, corners))
}

/// Whether a face that begins at `start` and goes on through `others` has an area.
pub(crate) fn spans_area(start: Position, others: impl Iterator<Item = Position>) -> bool {
    let from = start.coordinates();
    let mut sides = others.filter_map(|position| {
        let to = position.coordinates();
        // A position has three coordinates.
        let side = [0, 1, 2].map_each(|axis: usize| i64::from(to[axis]) - i64::from(from[axis]));
        (side != [0; 3]).then_some(side)
    });
    let Some(a) = sides.next() else { return false };
    // Each difference is below 2^31, so a product is below 2^62. Products are compared without
    // being subtracted.
    sides.any(|b| {
        a[0] * b[1] != a[1] * b[0] || a[1] * b[2] != a[2] * b[1] || a[2] * b[0] != a[0] * b[2]
    })
}

/// A hash table of the positions that have a vertex, with open addressing.
struct PositionTable<'a, I> {
    /// The position of each vertex of the model.
    positions: &'a [Position],
    /// Vertex numbers counted from 1; 0 marks a free slot. The length is a power of two and at
    /// least twice the number of vertices.
    slots: &'a mut [I],
}

impl<'a, I: Index> PositionTable<'a, I> {
    /// Builds the table, and counts the vertices that are at the position of an earlier one.
    fn new(
        positions: &'a [Position],
        scratch: &mut Scratch<'a>,
    ) -> Result<(Self, usize), OutOfScratch> {
        let slots = scratch.take((2 * positions.len()).next_power_of_two())?;
        let table = Self { positions, slots };
        let mut repeated = 0;
        for (number, position) in I::ONE.to(I::NONE).zip(positions) {
            let slot = table.slot(position);
            match table.slots.get_mut(slot).filter(|slot| **slot == I::ZERO) {
                Some(free) => *free = number,
                None => repeated += 1,
            }
        }
        Ok((table, repeated))
    }

    /// Returns the least number of a vertex at the position of vertex `number`.
    fn first_at(&self, number: I) -> Option<I> {
        let slot = self.slot(self.positions.get(number.get())?);
        self.slots.get(slot)?.get().checked_sub(1).map(I::new)
    }

    /// Returns the slot that holds this position, or the free one where it belongs.
    fn slot(&self, position: &Position) -> usize {
        let mask = self.slots.len() - 1; // there is always one
        let mut slot = hash(position) as usize & mask;
        while let Some(number) = self.slots.get(slot).and_then(|number| number.get().checked_sub(1))
        {
            if self.positions.get(number) == Some(position) {
                break;
            }
            slot = (slot + 1) & mask;
        }
        slot
    }
}

/// Hashes a position: multiplies by odd constants (Knuth, 6.4) and mixes the better upper half into
/// the lower.
fn hash(position: &Position) -> u32 {
    let [x, y, z] = position.coordinates().map_each(|coordinate| coordinate as u32);
    let mixed = [(y, 0x85EB_CA6B), (z, 0xC2B2_AE35)]
        .into_iter()
        .fold(x.wrapping_mul(0x9E37_79B1), |hash, (part, factor): (u32, u32)| {
            (hash ^ hash >> 15 ^ part).wrapping_mul(factor)
        });
    mixed ^ mixed >> 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Decimal;
    use crate::model::{Model, no_undo};
    use crate::stage::NeverCancel;
    use std::vec::Vec;

    fn decimals(position: [&str; 3]) -> [Decimal; 3] {
        position.map(|text| Decimal::parse(text).unwrap())
    }

    fn welded(positions: &[[&str; 3]], faces: &[&[i32]]) -> Vec<(u16, bool, bool)> {
        let mut vertices = [Position::ORIGIN; 16];
        let mut corners = [<Corner>::ZERO; 64];
        let mut model = Model::new(&mut vertices, &mut corners);
        for position in positions {
            model.add_vertex(decimals(*position), &mut no_undo).unwrap();
        }
        for face in faces {
            match face.len() {
                2 => model.add_polyline(face.iter().copied(), &mut no_undo).unwrap(),
                _ => model.add_face(face.iter().copied(), &mut no_undo).unwrap(),
            }
        }
        let mut words = [0; 64];
        let (elements, _) = weld(
            model.vertices(),
            model.elements(),
            &mut Scratch::new(&mut words),
            &mut NeverCancel,
        )
        .unwrap();
        elements.corners().iter().map(|c| (c.vertex(), c.of_bar(), c.is_last())).collect()
    }

    #[test]
    fn a_square_of_two_loose_triangles_shares_its_diagonal() {
        let positions = [
            ["0", "0", "0"],
            ["1", "0", "0"],
            ["1", "1", "0"],
            ["0", "0", "-0"],
            ["1.0", "1e0", "0"],
            ["0", "1", "0"],
        ];
        let corners = welded(&positions, &[&[1, 2, 3], &[4, 5, 6], &[5, 6]]);
        let expected = [
            (0, false, false),
            (1, false, false),
            (2, false, true),
            (0, false, false),
            (2, false, false),
            (5, false, true),
            (2, true, false),
            (5, true, true),
        ];
        assert_eq!(corners, expected);
    }

    #[test]
    fn what_has_no_repeats_is_untouched_and_takes_no_memory() {
        let mut vertices = [Position::ORIGIN; 4];
        let mut corners = [<Corner>::ZERO; 4];
        let mut model = Model::new(&mut vertices, &mut corners);
        for [x, y] in [["0", "0"], ["1", "0"], ["0.5", "1"]] {
            model.add_vertex(decimals([x, y, "0"]), &mut no_undo).unwrap();
        }
        model.add_face([1, 2, 3].into_iter(), &mut no_undo).unwrap();
        let mut words = [0; 2];
        let mut scratch = Scratch::new(&mut words);
        let (elements, degenerate) =
            weld(model.vertices(), model.elements(), &mut scratch, &mut NeverCancel).unwrap();
        assert_eq!(degenerate, 0);
        assert!(core::ptr::eq(elements.corners(), model.elements().corners()));
        assert_eq!(scratch.available_bytes(), 16);
        assert!(
            weld(model.vertices(), model.elements(), &mut Scratch::new(&mut [0]), &mut NeverCancel)
                .is_err()
        );
    }

    #[test]
    fn nothing_has_nothing_to_weld() {
        assert!(welded(&[], &[]).is_empty());
    }

    #[test]
    fn a_full_model_all_at_one_place_has_no_face_left() {
        let positions = [["7", "7", "7"]; 16];
        assert!(welded(&positions, &[&[1, 2, 16]]).is_empty());
        assert_eq!(welded(&positions, &[&[1, 16]]), [(0, true, false), (0, true, true)]);
    }

    #[test]
    fn a_face_in_line_is_left_out_and_its_neighbours_stay() {
        let positions = [
            ["0", "0", "0"],
            ["1", "2", "3"],
            ["2", "4", "6"],
            ["0", "1", "0"],
            ["-9", "-18", "-27"],
        ];
        let faces: [&[i32]; 4] = [&[1, 2, 3], &[1, 3, 4], &[5, 1, 2, 3], &[2, 4]];
        let corners = welded(&positions, &faces);
        let numbers: Vec<u16> = corners.iter().map(|corner| corner.0).collect();
        assert_eq!(numbers, [0, 2, 3, 1, 3]);
    }
}
