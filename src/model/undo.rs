//! Copies the whole model to unused memory, so that an edit can be undone.

use super::pens::PenBook;
use super::precision::Rounding;
use super::{Corner, Model, PEN_LIMIT, Position};
use crate::stage::{Scratch, items};

/// The number of 32-bit values stored before the vertices.
const HEAD: usize = 13 + PEN_LIMIT as usize;

impl Model<'_> {
    /// Copies the model to `words`, without an unfinished curve. Returns `false` if it does not
    /// fit.
    pub fn save(&self, words: &mut [u64]) -> bool {
        self.copy_to(Scratch::new(words)).is_some()
    }

    /// Returns how many of the words given to it [`Model::save`] uses.
    pub fn saved_words(&self) -> usize {
        let vertices = Scratch::bytes_for::<Position>(self.vertices.len());
        let corners = Scratch::bytes_for::<Corner>(self.whole_corners().len());
        (Scratch::bytes_for::<u32>(HEAD) + vertices + corners) / size_of::<u64>()
    }

    /// Returns the half-words of the elements, of the pens and of the completed curves.
    fn whole_corners(&self) -> &[Corner] {
        let end = self.curves.start + self.curves.whole();
        self.corners.get(..end).unwrap_or(self.corners)
    }

    fn copy_to(&self, mut scratch: Scratch<'_>) -> Option<()> {
        let corners = self.whole_corners();
        let (curves, lengths) = (&self.curves, [self.vertices.len(), corners.len()]);
        let PenBook { names, current, by_material } = self.pens;
        let [decimals, edited] = self.rounding.numbers();
        let (numbers, rest) = scratch.take::<u32>(HEAD).ok()?.split_first_chunk_mut()?;
        *numbers = [
            self.fraction_bits as usize,
            lengths[0],
            lengths[1],
            self.faces,
            self.bars,
            curves.start,
            curves.whole(),
            curves.count,
            self.runs,
            current.into(),
            by_material.into(),
            decimals,
            edited,
        ]
        .map(|number| number as u32);
        *rest.first_chunk_mut()? = names;
        scratch.take::<Position>(lengths[0]).ok()?.copy_from_slice(self.vertices);
        scratch.take::<Corner>(lengths[1]).ok()?.copy_from_slice(corners);
        Some(())
    }

    /// Restores the model that [`Model::save`] copied to `words`. The contents of `words` must be
    /// unchanged since then.
    pub fn restore(&mut self, words: &[u64]) {
        // It always fits, because it was there before.
        let _ = self.copy_from(words);
    }

    fn copy_from(&mut self, words: &[u64]) -> Option<()> {
        let head: &[u32] = items(words, HEAD)?;
        let (numbers, names) = head.split_first_chunk()?;
        let [
            fraction_bits,
            vertices,
            corners,
            faces,
            bars,
            start,
            whole,
            count,
            runs,
            pen,
            by,
            decimals,
            edited,
        ] = *numbers;
        let positions_at = Scratch::bytes_for::<u32>(HEAD) / 8;
        let corners_at = positions_at + Scratch::bytes_for::<Position>(vertices as usize) / 8;
        self.vertices.clear();
        let saved = items(words.get(positions_at..)?, vertices as usize)?;
        self.vertices.extend_from_slice(saved).ok()?;
        self.corners.clear();
        self.corners.extend_from_slice(items(words.get(corners_at..)?, corners as usize)?).ok()?;
        self.fraction_bits = fraction_bits;
        self.rounding = Rounding::from_numbers([decimals, edited]);
        (self.faces, self.bars) = (faces as usize, bars as usize);
        self.runs = runs as usize;
        let names = names.try_into().ok()?;
        self.pens = PenBook { names, current: pen as u8, by_material: by != 0 };
        self.curves.restore(start as usize, whole as usize, count as usize);
        Some(())
    }
}
