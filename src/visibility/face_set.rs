//! A set of faces, by rank, that is cleared often and holds few of them at a time.
//!
//! It has one bit for each face. Which of its words hold bits is recorded, so that clearing a set
//! of many words takes as long as filling it did. Where no more can be recorded, all words are
//! cleared, and all are looked through. With the numbers of a board there are never this many faces
//! that recording would be faster.

use super::VisibilityError;
use crate::index::Index;
use crate::stage::{Scratch, heap_sort_by_key};
use core::marker::PhantomData;

/// A set of ranks of faces, which are numbered by `I`.
pub struct FaceSet<'a, I> {
    /// One bit for each rank.
    // Only the ranks of faces are added, and there is a bit for each face of the scene. While the
    // faces in `Marks::met` are looked through, an empty set stands in its place; nothing is added
    // to that. `used` holds indices of words to which a rank was added.
    words: &'a mut [u32],
    /// The indices of the words that are not zero, as far as they are recorded.
    used: &'a mut [u32],
    /// How many words are not zero; if more than `used` can hold, they are not all recorded.
    count: usize,
    /// The numbers of the faces.
    numbers: PhantomData<I>,
}

impl<I> Default for FaceSet<'_, I> {
    fn default() -> Self {
        Self { words: &mut [], used: &mut [], count: 0, numbers: PhantomData }
    }
}

impl<'a, I: Index> FaceSet<'a, I> {
    /// Whether words are recorded at all.
    const IS_RECORDED: bool = I::BITS > 16;
    /// A set with fewer words than this is cleared as a whole, because recording takes longer.
    const MANY_WORDS: usize = 256;
    /// One in so many words is recorded. To clear more of them one by one takes about as long as to
    /// clear all.
    const WORDS_OF_ONE_USED: usize = 8;

    /// Returns how many words of a set of this many are recorded.
    const fn used(words: usize) -> usize {
        if Self::IS_RECORDED && words >= Self::MANY_WORDS {
            words / Self::WORDS_OF_ONE_USED
        } else {
            0
        }
    }

    /// Returns the recorded words, if those are all `count` words that are not zero.
    #[inline]
    fn recorded(used: &mut [u32], count: usize) -> Option<&mut [u32]> {
        if Self::IS_RECORDED && !used.is_empty() { used.get_mut(..count) } else { None }
    }

    /// Returns the most bytes that a set of this many faces takes.
    pub const fn bytes(faces: usize) -> usize {
        let words = faces.div_ceil(32);
        Scratch::bytes_for::<u32>(words) + Scratch::bytes_for::<u32>(Self::used(words))
    }

    /// Makes an empty set for this many faces.
    ///
    /// # Errors
    /// Returns an error if the memory is too small.
    pub fn new(faces: usize, scratch: &mut Scratch<'a>) -> Result<Self, VisibilityError> {
        let words: &mut [u32] = scratch.take(faces.div_ceil(32))?;
        let used = scratch.take(Self::used(words.len()))?;
        Ok(Self { words, used, count: 0, numbers: PhantomData })
    }

    /// Removes all ranks.
    #[inline]
    pub fn clear(&mut self) {
        let Self { words, used, count, .. } = self;
        match Self::recorded(used, *count) {
            Some(used) => {
                for &word in &*used {
                    words[word as usize] = 0;
                }
            }
            None => words.fill(0),
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
        if Self::IS_RECORDED && *word == 0 && !self.used.is_empty() {
            if let Some(slot) = self.used.get_mut(self.count) {
                *slot = (rank / 32) as u32;
            }
            self.count += 1;
        }
        *word |= bit;
        true
    }

    /// Calls `each` with every rank, in ascending order, until it returns an error. The
    /// set must hold no rank below `least`.
    ///
    /// # Errors
    /// What `each` returns.
    #[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
    pub fn each<E>(
        &mut self,
        least: usize,
        each: &mut dyn FnMut(usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let of_word = |(word, mut bits): (usize, u32),
                       each: &mut dyn FnMut(usize) -> Result<(), E>| {
            while bits != 0 {
                each(32 * word + bits.trailing_zeros() as usize)?;
                bits &= bits - 1;
            }
            Ok(())
        };
        let Self { words, used, count, .. } = self;
        match Self::recorded(used, *count) {
            // Sorting many words takes longer than looking through all.
            Some(used) if 64 * used.len() < words.len() => {
                heap_sort_by_key(used, |word| *word);
                for &word in &*used {
                    of_word((word as usize, words[word as usize]), each)?;
                }
            }
            _ => {
                // On a board there are few words.
                let first = if Self::IS_RECORDED { least / 32 } else { 0 };
                for (word, &bits) in words.iter().enumerate().skip(first) {
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
            let mut memory = vec![0; FaceSet::<u32>::bytes(faces) / 8];
            let mut set = FaceSet::<u32>::new(faces, &mut Scratch::new(&mut memory)).ok().unwrap();
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
                set.each(0, &mut |rank| {
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
