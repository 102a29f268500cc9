//! A set of faces, by rank, that is cleared often and holds few of them at a time.
//!
//! It has one bit for each face. Which of its words hold bits is recorded, so that clearing a set
//! of many words takes as long as filling it did. Where no more can be recorded, all words are
//! cleared, and all are looked through.

use super::VisibilityError;
use crate::stage::{Scratch, heap_sort_by_key};

/// A set of ranks.
#[derive(Default)]
pub struct FaceSet<'a> {
    /// One bit for each rank.
    words: &'a mut [u32],
    /// The indices of the words that are not zero, as far as they are recorded.
    used: &'a mut [u32],
    /// How many words are not zero; if more than `used` can hold, they are not all recorded.
    count: usize,
}

impl<'a> FaceSet<'a> {
    /// How many words are recorded.
    const MOST_USED: usize = 64;
    /// A set with fewer words than this is cleared as a whole, because recording takes longer.
    const MANY_WORDS: usize = 512;

    /// Returns the most bytes that a set of so many faces takes.
    pub const fn bytes(faces: usize) -> usize {
        let words = faces.div_ceil(32);
        let used = if words < Self::MANY_WORDS { 0 } else { Self::MOST_USED };
        Scratch::bytes_for::<u32>(words) + Scratch::bytes_for::<u32>(used)
    }

    /// Makes an empty set for so many faces.
    ///
    /// # Errors
    /// Returns an error if the memory is too small.
    pub fn new(faces: usize, scratch: &mut Scratch<'a>) -> Result<Self, VisibilityError> {
        let words: &mut [u32] = scratch.take(faces.div_ceil(32))?;
        let used = if words.len() < Self::MANY_WORDS { 0 } else { Self::MOST_USED };
        Ok(Self { words, used: scratch.take(used)?, count: 0 })
    }

    /// Removes all ranks.
    #[inline]
    pub fn clear(&mut self) {
        match self.used.get(..self.count) {
            Some(used) if !self.used.is_empty() => {
                for &word in used {
                    self.words[word as usize] = 0;
                }
            }
            _ => self.words.fill(0),
        }
        self.count = 0;
    }

    /// Adds a rank. Returns whether it was not in the set.
    #[inline]
    pub fn insert(&mut self, rank: usize) -> bool {
        let word = &mut self.words[rank / 32];
        let bit = 1 << (rank % 32);
        if *word & bit != 0 {
            return false;
        }
        if *word == 0 && !self.used.is_empty() {
            if let Some(slot) = self.used.get_mut(self.count) {
                *slot = (rank / 32) as u32;
            }
            self.count += 1;
        }
        *word |= bit;
        true
    }

    /// Calls `each` with every rank, in ascending order, until it returns an error.
    ///
    /// # Errors
    /// What `each` returns.
    pub fn each<E>(&mut self, each: &mut dyn FnMut(usize) -> Result<(), E>) -> Result<(), E> {
        let of_word = |(word, mut bits): (usize, u32),
                       each: &mut dyn FnMut(usize) -> Result<(), E>| {
            while bits != 0 {
                each(32 * word + bits.trailing_zeros() as usize)?;
                bits &= bits - 1;
            }
            Ok(())
        };
        let is_recorded = !self.used.is_empty();
        match self.used.get_mut(..self.count) {
            Some(used) if is_recorded => {
                heap_sort_by_key(used, |word| *word);
                for &word in &*used {
                    of_word((word as usize, self.words[word as usize]), each)?;
                }
            }
            _ => {
                for (word, &bits) in self.words.iter().enumerate() {
                    of_word((word, bits), each)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::vec;
    use std::vec::Vec;

    #[test]
    fn it_holds_what_was_added_since_it_was_cleared() {
        for faces in [40, 1000, 20_000, 100_000] {
            let mut memory = vec![0; FaceSet::bytes(faces) / 8];
            let mut set = FaceSet::new(faces, &mut Scratch::new(&mut memory)).ok().unwrap();
            let mut state = 1u32;
            for round in 0..40 {
                // Few words, then more than can be recorded.
                let mut expected = BTreeSet::new();
                for _ in 0..round * round / 4 {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let rank = (state >> 8) as usize % faces;
                    assert_eq!(set.insert(rank), expected.insert(rank));
                }
                let mut found = Vec::new();
                set.each(&mut |rank| {
                    found.push(rank);
                    Ok::<(), ()>(())
                })
                .unwrap();
                assert!(expected.into_iter().eq(found));
                set.clear();
            }
        }
    }
}
