//! Copies the whole model to unused memory, so that an edit can be undone.

use super::pens::PenBook;
use super::precision::Rounding;
use super::{Model, PEN_LIMIT, Position};
use crate::index::Index;
use crate::stage::{Scratch, items};

/// The number of 32-bit values stored before the vertices.
const HEAD: usize = NUMBERS + PEN_LIMIT as usize;

/// How many of these values come before the names of the pens.
const NUMBERS: usize = 12;

impl<I: Index> Model<'_, I> {
    /// Copies the model to `words`, without an unfinished curve. Returns `false` if it does not
    /// fit.
    pub fn save(&self, words: &mut [u64]) -> bool {
        self.copy_to(Scratch::new(words)).is_some()
    }

    /// Returns how many of the words given to it [`Model::save`] uses.
    pub fn saved_words(&self) -> usize {
        let vertices = Scratch::bytes_for::<Position>(self.vertices.len());
        let corners = Scratch::bytes_for::<I>(self.stored_halves().len());
        (Scratch::bytes_for::<u32>(HEAD) + vertices + corners) / size_of::<u64>()
    }

    /// Returns the half-words of the elements, of the pens and of the completed curves.
    fn stored_halves(&self) -> &[I] {
        self.store.all_but(self.curves.unfinished_length(&self.store))
    }

    /// Copies the model into `scratch`. Returns `None` if it does not fit.
    fn copy_to(&self, mut scratch: Scratch<'_>) -> Option<()> {
        let halves = self.stored_halves();
        let [corners_end, pens_end] = self.store.ends();
        let PenBook { names, current, by_material } = self.pens;
        let [decimals, edited] = self.rounding.numbers();
        let (numbers, rest) = scratch.take::<u32>(HEAD).ok()?.split_first_chunk_mut()?;
        *numbers = [
            self.fraction_bits as usize,
            self.vertices.len(),
            self.faces,
            self.bars,
            corners_end,
            pens_end,
            halves.len(),
            self.curves.count,
            current.into(),
            by_material.into(),
            decimals,
            edited,
        ]
        .map(|number| number as u32);
        *rest.first_chunk_mut()? = names;
        // What is taken is as long as what is copied to it.
        scratch.take::<Position>(self.vertices.len()).ok()?.copy_from_slice(&self.vertices);
        scratch.take::<I>(halves.len()).ok()?.copy_from_slice(halves);
        Some(())
    }

    /// Restores the model that [`Model::save`] copied to `words`. The contents of `words` must be
    /// unchanged since then.
    pub fn restore(&mut self, words: &[u64]) {
        // The copy always fits, because the model was there before.
        let _ = self.copy_from(words);
    }

    /// Restores the model from what `copy_to` wrote. Returns `None` if that does not fit this
    /// model, which may then be changed in part.
    fn copy_from(&mut self, words: &[u64]) -> Option<()> {
        let head: &[u32] = items(words, HEAD)?;
        let (numbers, names) = head.split_first_chunk::<NUMBERS>()?;
        let [fraction_bits, rest @ .., decimals, edited] = *numbers;
        let [vertices, faces, bars, corners_end, pens_end, halves, curves, pen, by] =
            rest.map(|number| number as usize);
        let positions_at = Scratch::bytes_for::<u32>(HEAD) / 8;
        let halves_at = positions_at + Scratch::bytes_for::<Position>(vertices) / 8;
        self.vertices.replace(items(words.get(positions_at..)?, vertices)?)?;
        let halves = items(words.get(halves_at..)?, halves)?;
        self.store.replace([corners_end, pens_end], halves)?;
        self.fraction_bits = fraction_bits;
        self.rounding = Rounding::from_numbers([decimals, edited]);
        (self.faces, self.bars) = (faces, bars);
        let names = names.try_into().ok()?;
        self.pens = PenBook { names, current: pen as u8, by_material: by != 0 };
        self.curves.restore(&self.store, curves);
        Some(())
    }
}
