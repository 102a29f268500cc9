//! Computes a checksum of a model, so that a sender can compare it with what it sent.

use super::{Element, FINEST_FRACTION_BITS, Model};
use crate::array::MapEach;
use crate::checksum::Crc32;
use crate::index::Index;

impl<I: Index> Model<'_, I> {
    /// Returns the CRC-32 of the model: of the vertices; of the bars, faces and completed curves,
    /// each with its pen; and of the number of decimals with which the vertices were written, since
    /// it says how exact they are.
    ///
    /// It is the same on every machine, however many bits a number takes in memory. Coordinates (in
    /// units of 2^-30), the ends of curves and knots enter as little-endian numbers of 64 bits,
    /// everything else as little-endian numbers of 32 bits. Each part begins with the number of its
    /// items.
    ///
    /// ```
    /// use penup::model::{Model, Position};
    /// let mut memory = ([Position::ORIGIN; 8], []);
    /// let empty: Model = Model::new(&mut memory.0, &mut memory.1);
    /// // The CRC-32 of four numbers that are 0.
    /// assert_eq!(empty.checksum(), 0xECBB_4B55);
    /// ```
    // Not inlined, so that its variables take no stack while a job is computed.
    #[inline(never)]
    pub fn checksum(&self) -> u32 {
        let mut digest = Crc32::new();
        let mut number = |number: u32| digest.update(&number.to_le_bytes());
        number(self.vertices.len() as u32);
        let shift = FINEST_FRACTION_BITS - self.fraction_bits;
        for vertex in self.vertices.iter() {
            for coordinate in vertex.coordinates() {
                // The shifted coordinate is below 2^60.
                digest.update(&(i64::from(coordinate) << shift).to_le_bytes());
            }
        }
        let mut number = |number: u32| digest.update(&number.to_le_bytes());
        number((self.faces + self.bars) as u32);
        for (element, pen) in self.elements().iter_with_pens() {
            number(pen.into());
            match element {
                Element::Bar(from, to) => [2, from.into(), to.into()].map_each(&mut number),
                Element::Face(corners) => {
                    // A face has three corners or more.
                    number(corners.len() as u32);
                    corners.iter().for_each(|corner| number(corner.vertex().into()));
                    [(); 3]
                }
            };
        }
        number(self.curves.count as u32);
        for curve in self.curves().iter() {
            let knots = curve.knots.count().unwrap_or(0);
            let counts = [curve.control.len(), knots].map_each(|count| count as u32);
            for head in [curve.pen.into(), curve.order.into(), counts[0], counts[1]] {
                digest.update(&u32::to_le_bytes(head));
            }
            for control in curve.control {
                digest.update(&(*control).into().to_le_bytes());
            }
            let ends = [curve.from, curve.to].map_each(|end| i64::from(end.to_bits()));
            for value in ends.into_iter().chain((0..knots).map(|knot| curve.knots.get(knot))) {
                digest.update(&value.to_le_bytes());
            }
        }
        let [decimals, _] = self.rounding.numbers();
        digest.update(&(decimals as u32).to_le_bytes());
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Corner, PenName, Position, no_undo};
    use super::*;
    use crate::fixed::Decimal;
    use std::vec::Vec;

    /// The checksum of a model with these vertices and elements: a face, or a bar if there are two
    /// numbers.
    fn sum(vertices: &[[&str; 3]], elements: &[(&[i32], u8)]) -> u32 {
        let mut memory = ([Position::ORIGIN; 9], [<Corner>::ZERO; 64]);
        let mut model = Model::new(&mut memory.0, &mut memory.1);
        for vertex in vertices {
            let position = vertex.map(|text| Decimal::parse(text).unwrap());
            model.add_vertex(position, &mut no_undo).unwrap();
        }
        for (numbers, pen) in elements {
            model.choose_pen(true, PenName::Number(*pen), &mut no_undo).unwrap();
            match numbers {
                [_, _] => model.add_polyline(numbers.iter().copied(), &mut no_undo).unwrap(),
                _ => model.add_face(numbers.iter().copied(), &mut no_undo).unwrap(),
            }
        }
        model.checksum()
    }

    #[test]
    fn every_part_of_a_model_counts() {
        const POSITIONS: [[&str; 3]; 4] =
            [["0", "0", "0"], ["1", "0", "0"], ["1", "1", "0"], ["0", "1", "0.5"]];
        let mut other = POSITIONS;
        other[3][2] = "0.25";
        // In the model's unit this is the same position, but its last decimal is taken to be
        // rounded.
        let mut rounded = POSITIONS;
        rounded[1][0] = "1.0000000000001";
        let face: &[i32] = &[1, 2, 3];
        let sums = [
            sum(&POSITIONS, &[]),
            sum(&POSITIONS[..3], &[]),
            sum(&other, &[]),
            sum(&POSITIONS, &[(face, 0)]),
            sum(&POSITIONS, &[(&[1, 3, 2], 0)]),
            sum(&POSITIONS, &[(&[1, 2, 3, 4], 0)]),
            sum(&POSITIONS, &[(face, 1)]),
            sum(&POSITIONS, &[(&[1, 2], 0), (&[2, 3], 0), (&[3, 1], 0)]),
            sum(&POSITIONS, &[(face, 0), (&[1, 2], 0)]),
            sum(&POSITIONS, &[(&[1, 2], 0), (face, 0)]),
            sum(&rounded, &[]),
        ];
        let different: std::collections::BTreeSet<u32> = sums.into_iter().collect();
        assert_eq!(different.len(), sums.len(), "{sums:?}");
    }

    #[test]
    fn the_unit_of_the_model_does_not_count() {
        let near: Vec<[&str; 3]> = std::vec![["1", "0.5", "0"], ["0.25", "0", "1"]];
        // A vertex far away makes the unit coarser, and is removed again.
        let mut memory = ([Position::ORIGIN; 9], [<Corner>::ZERO; 64]);
        let mut model = Model::new(&mut memory.0, &mut memory.1);
        for vertex in near.iter().chain([&["1000", "0", "0"]]) {
            let position = vertex.map(|text| Decimal::parse(text).unwrap());
            model.add_vertex(position, &mut no_undo).unwrap();
        }
        model.vertices.truncate(near.len());
        assert!(model.fraction_bits() < FINEST_FRACTION_BITS);
        assert_eq!(model.checksum(), sum(&near, &[]));
    }
}
