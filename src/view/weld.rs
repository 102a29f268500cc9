//! Vertices at the same place made one: meshes from a modeller often have one for each face.

use crate::model::{Corner, Elements, Model, Position};
use crate::stage::{OutOfScratch, Scratch};

/// The elements of the model with each vertex replaced by the first one at the same place; the model's own
/// if no two share a place. Corners of a face may come to be the same; visibility lives with that.
///
/// Memory: 2 bytes for each corner if there is something to weld; 4 to 8 for each vertex meanwhile.
pub(super) fn weld<'a>(
    model: &'a Model<'_>,
    scratch: &mut Scratch<'a>,
) -> Result<Elements<'a>, OutOfScratch> {
    let positions = model.vertices();
    let elements = model.elements();
    if Places::new(positions, &mut scratch.reborrow())?.1 == 0 {
        return Ok(elements);
    }
    let corners: &mut [Corner] = scratch.take(elements.corners().len())?;
    corners.copy_from_slice(elements.corners());
    let (places, _) = Places::new(positions, &mut scratch.reborrow())?;
    for corner in corners.iter_mut() {
        if let Some(first) = places.first_at(corner.vertex()) {
            *corner = Corner::new(first, corner.of_bar(), corner.is_last());
        }
    }
    Ok(Elements::new(corners))
}

/// A hash table of the places that have a vertex, with open addressing.
struct Places<'a> {
    positions: &'a [Position],
    /// Numbers of vertices from 1; 0 is free. A power of two, at least twice the vertices.
    slots: &'a mut [u16],
}

impl<'a> Places<'a> {
    /// All places, and how many vertices are at the place of an earlier one.
    fn new(
        positions: &'a [Position],
        scratch: &mut Scratch<'a>,
    ) -> Result<(Self, usize), OutOfScratch> {
        let slots = scratch.take((2 * positions.len()).next_power_of_two())?;
        let places = Self { positions, slots };
        let mut repeated = 0;
        for (number, position) in (1..).zip(positions) {
            let slot = places.slot(position);
            match places.slots.get_mut(slot) {
                Some(free @ 0) => *free = number,
                _ => repeated += 1,
            }
        }
        Ok((places, repeated))
    }

    /// The least number of a vertex at the place of vertex `number`.
    fn first_at(&self, number: u16) -> Option<u16> {
        let slot = self.slot(self.positions.get(usize::from(number))?);
        self.slots.get(slot)?.checked_sub(1)
    }

    /// The slot of this place, or the free one where it belongs.
    fn slot(&self, position: &Position) -> usize {
        let mask = self.slots.len() - 1; // there is always one
        let mut slot = hash(position) as usize & mask;
        while let Some(number) = self.slots.get(slot).and_then(|number| number.checked_sub(1)) {
            if self.positions.get(usize::from(number)) == Some(position) {
                break;
            }
            slot = (slot + 1) & mask;
        }
        slot
    }
}

/// Multiplies by odd constants (Knuth, 6.4) and folds the better upper half down.
fn hash(position: &Position) -> u32 {
    let [x, y, z] = position.coordinates().map(|coordinate| coordinate as u32);
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
    use std::vec::Vec;

    fn decimals(place: [&str; 3]) -> [Decimal; 3] {
        place.map(|text| Decimal::parse(text).unwrap())
    }

    fn welded(places: &[[&str; 3]], faces: &[&[i32]]) -> Vec<(u16, bool, bool)> {
        let mut vertices = heapless::Vec::<Position, 16>::new();
        let mut corners = heapless::Vec::<Corner, 64>::new();
        let mut model = Model::new(&mut vertices, &mut corners);
        for place in places {
            model.add_vertex(decimals(*place)).unwrap();
        }
        for face in faces {
            match face.len() {
                2 => model.add_polyline(face.iter().copied()).unwrap(),
                _ => model.add_face(face.iter().copied()).unwrap(),
            }
        }
        let mut words = [0; 64];
        let elements = weld(&model, &mut Scratch::new(&mut words)).unwrap();
        elements.corners().iter().map(|c| (c.vertex(), c.of_bar(), c.is_last())).collect()
    }

    #[test]
    fn a_square_of_two_loose_triangles_shares_its_diagonal() {
        let places = [
            ["0", "0", "0"],
            ["1", "0", "0"],
            ["1", "1", "0"],
            ["0", "0", "-0"],
            ["1.0", "1e0", "0"],
            ["0", "1", "0"],
        ];
        let corners = welded(&places, &[&[1, 2, 3], &[4, 5, 6], &[5, 6]]);
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
        let mut vertices = heapless::Vec::<Position, 4>::new();
        let mut corners = heapless::Vec::<Corner, 4>::new();
        let mut model = Model::new(&mut vertices, &mut corners);
        for x in ["0", "1", "0.5"] {
            model.add_vertex(decimals([x, x, "0"])).unwrap();
        }
        model.add_face([1, 2, 3].into_iter()).unwrap();
        let mut words = [0; 2];
        let mut scratch = Scratch::new(&mut words);
        let elements = weld(&model, &mut scratch).unwrap();
        assert!(core::ptr::eq(elements.corners(), model.elements().corners()));
        assert_eq!(scratch.available_bytes(), 16);
        assert!(weld(&model, &mut Scratch::new(&mut [0])).is_err());
    }

    #[test]
    fn nothing_has_nothing_to_weld() {
        assert!(welded(&[], &[]).is_empty());
    }

    #[test]
    fn a_full_model_all_at_one_place_becomes_one_vertex() {
        let places = [["7", "7", "7"]; 16];
        let corners = welded(&places, &[&[1, 2, 16]]);
        assert!(corners.iter().all(|corner| corner.0 == 0));
    }
}
