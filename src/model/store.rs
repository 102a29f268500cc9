//! The model's memory of half-words (16 bits): the corners of the elements, the changes of the pen
//! and the curves.
//!
//! The three [`Region`]s lie one after the other from the beginning of the memory, and the free
//! half-words behind them. So each may grow as long as any half-word is free. Only this file knows
//! where a region begins.

use super::pens::{PenRun, RUN};
use super::{Corner, ModelError};
use crate::index::Index;
use core::ops::Range;

/// A part of the memory, in the order in which they lie there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Region {
    /// The corners of faces and bars, of one half-word (16 bits) each.
    Corners,
    /// The changes of the pen, of two half-words each.
    PenRuns,
    /// The encoded curves, of any number of half-words: see [`super::Curves`].
    Curves,
}

/// The number of regions into which the memory is divided.
const REGIONS: usize = 3;

/// The model's memory of half-words (16 bits each), which it divides among corners, changes of the
/// pen and curves.
///
/// Each region ends where the next begins, and the last ends within the memory. A change that does
/// not fit is refused and changes nothing.
#[derive(Debug)]
pub(super) struct Store<'m, I> {
    /// All half-words. Those in use come first, region after region.
    memory: &'m mut [I],
    /// Where the first region begins, which is at 0, and where each ends.
    bounds: [usize; REGIONS + 1],
}

impl<'m, I: Index> Store<'m, I> {
    /// Makes an empty store. What the memory contains is discarded.
    pub(super) fn new(memory: &'m mut [Corner<I>]) -> Self {
        Self { memory: bytemuck::cast_slice_mut(memory), bounds: [0; REGIONS + 1] }
    }

    /// Empties all regions, so that all half-words are free.
    pub(super) fn clear(&mut self) {
        self.bounds = [0; REGIONS + 1];
    }

    /// Returns the number of half-words in the memory, free or not.
    pub(super) fn capacity(&self) -> usize {
        self.memory.len()
    }

    /// Returns how many half-words (16 bits each) are in use.
    pub(super) fn used(&self) -> usize {
        self.bounds[REGIONS]
    }

    /// Refuses to go on unless this many half-words are free.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`].
    pub(super) fn check_room(&self, count: usize) -> Result<(), ModelError> {
        let (limit, needed) = (self.capacity(), self.used().saturating_add(count));
        if needed > limit { Err(ModelError::TooManyCorners { limit, needed }) } else { Ok(()) }
    }

    /// Returns which half-words of the memory a region takes.
    fn range(&self, region: Region) -> Range<usize> {
        self.bounds[region as usize]..self.bounds[region as usize + 1]
    }

    /// Returns the half-words of a region.
    fn region(&self, region: Region) -> &[I] {
        self.memory.get(self.range(region)).unwrap_or(&[])
    }

    /// Returns the half-words of a region, to be changed.
    fn region_mut(&mut self, region: Region) -> &mut [I] {
        let range = self.range(region);
        self.memory.get_mut(range).unwrap_or(&mut [])
    }

    /// Returns the corners of the faces and bars.
    pub(super) fn corners(&self) -> &[Corner<I>] {
        bytemuck::cast_slice(self.region(Region::Corners))
    }

    /// Returns the corners of the faces and bars, to be changed.
    pub(super) fn corners_mut(&mut self) -> &mut [Corner<I>] {
        bytemuck::cast_slice_mut(self.region_mut(Region::Corners))
    }

    /// Returns the changes of the pen, in the order of the elements.
    // The casts here and below cannot fail: the region grows and shrinks by whole changes of the
    // pen, and `replace` gets the ends that the regions once had.
    pub(super) fn pen_runs(&self) -> &[PenRun<I>] {
        bytemuck::cast_slice(self.region(Region::PenRuns))
    }

    /// Returns the changes of the pen, to be changed themselves.
    pub(super) fn pen_runs_mut(&mut self) -> &mut [PenRun<I>] {
        bytemuck::cast_slice_mut(self.region_mut(Region::PenRuns))
    }

    /// Returns the encoded curves, the unfinished one included.
    pub(super) fn curves(&self) -> &[I] {
        self.region(Region::Curves)
    }

    /// Returns the encoded curves, to be changed.
    pub(super) fn curves_mut(&mut self) -> &mut [I] {
        self.region_mut(Region::Curves)
    }

    /// Adds corners behind those of the elements and returns them, to be filled.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`]; nothing is changed.
    pub(super) fn add_corners(&mut self, count: usize) -> Result<&mut [Corner<I>], ModelError> {
        self.grow(Region::Corners, count).map(bytemuck::cast_slice_mut)
    }

    /// Adds changes of the pen behind the others and returns them, to be filled.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`]; nothing is changed.
    pub(super) fn add_pen_runs(&mut self, count: usize) -> Result<&mut [PenRun<I>], ModelError> {
        self.grow(Region::PenRuns, RUN * count).map(bytemuck::cast_slice_mut)
    }

    /// Adds half-words behind those of the curves and returns them, to be filled.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`]; nothing is changed.
    pub(super) fn add_to_curves(&mut self, count: usize) -> Result<&mut [I], ModelError> {
        self.grow(Region::Curves, count)
    }

    /// Removes all corners but the first `count`.
    pub(super) fn truncate_corners(&mut self, count: usize) {
        self.truncate(Region::Corners, count);
    }

    /// Removes all changes of the pen but the first `count`.
    pub(super) fn truncate_pen_runs(&mut self, count: usize) {
        self.truncate(Region::PenRuns, RUN * count);
    }

    /// Removes all half-words of the curves but the first `count`.
    pub(super) fn truncate_curves(&mut self, count: usize) {
        self.truncate(Region::Curves, count);
    }

    /// Lengthens a region by `count` half-words and returns them; their contents are left over from
    /// before. The regions behind it are moved.
    // Not inlined: its three callers share one copy of the code.
    #[inline(never)]
    fn grow(&mut self, region: Region, count: usize) -> Result<&mut [I], ModelError> {
        self.check_room(count)?;
        let (end, used) = (self.range(region).end, self.used());
        self.memory.copy_within(end..used, end + count);
        for bound in &mut self.bounds[region as usize + 1..] {
            *bound += count;
        }
        Ok(self.memory.get_mut(end..end + count).unwrap_or(&mut []))
    }

    /// Shortens a region to its first `length` half-words, if it is longer. The regions behind it
    /// are moved.
    #[inline(never)]
    fn truncate(&mut self, region: Region, length: usize) {
        let (Range { start, end }, used) = (self.range(region), self.used());
        let gone = (end - start).saturating_sub(length);
        self.memory.copy_within(end..used, end - gone);
        for bound in &mut self.bounds[region as usize + 1..] {
            *bound -= gone;
        }
    }

    /// Returns the half-words of all regions in turn, without the last `without` of them.
    pub(super) fn all_but(&self, without: usize) -> &[I] {
        self.memory.get(..self.used().saturating_sub(without)).unwrap_or(&[])
    }

    /// Returns how many half-words the corners take, and how many the corners and the changes of
    /// the pen take together. A copy of the memory is divided into its regions by these two
    /// numbers.
    pub(super) fn ends(&self) -> [usize; 2] {
        [self.bounds[1], self.bounds[2]]
    }

    /// Replaces all regions: `halves` are those of all in turn, and `ends` is as [`Store::ends`]
    /// returned it. Returns `None`, and changes nothing, if they do not fit.
    pub(super) fn replace(&mut self, ends: [usize; 2], halves: &[I]) -> Option<()> {
        if ends[0] > ends[1] || ends[1] > halves.len() {
            return None;
        }
        self.memory.get_mut(..halves.len())?.copy_from_slice(halves);
        self.bounds = [0, ends[0], ends[1], halves.len()];
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const ALL: [Region; REGIONS] = [Region::Corners, Region::PenRuns, Region::Curves];

    #[test]
    fn regions_grow_and_shrink_as_three_separate_lists() {
        let mut memory = [<Corner>::ZERO; 40];
        let mut store = Store::new(&mut memory);
        let mut lists: [Vec<u16>; REGIONS] = Default::default();
        let mut state = 1u32;
        let mut random = |below: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as usize % below
        };
        for step in 0..20_000u16 {
            let (region, used) = (ALL[random(REGIONS)], lists.iter().map(Vec::len).sum::<usize>());
            let list = &mut lists[region as usize];
            if random(2) == 0 {
                let count = 2 * random(5);
                match store.grow(region, count) {
                    Ok(new) => {
                        new.fill(step);
                        list.extend((0..count).map(|_| step));
                    }
                    Err(error) => {
                        let needed = used + count;
                        assert_eq!(error, ModelError::TooManyCorners { limit: 40, needed });
                        assert!(needed > 40);
                    }
                }
            } else {
                let length = 2 * random(10);
                store.truncate(region, length);
                list.truncate(length);
            }
            for region in ALL {
                assert_eq!(store.region(region), lists[region as usize]);
                assert_eq!(store.region_mut(region), lists[region as usize]);
            }
            let all = lists.concat();
            assert_eq!((store.used(), store.all_but(0)), (all.len(), &all[..]));
        }
    }

    #[test]
    fn what_was_copied_comes_back() {
        let (mut memory, mut other) = ([<Corner>::ZERO; 8], [<Corner>::ZERO; 8]);
        let (mut store, mut copy) = (Store::new(&mut memory), Store::new(&mut other));
        for (region, half) in ALL.into_iter().zip([1, 2, 3]) {
            store.grow(region, 2).unwrap().fill(half);
        }
        copy.replace(store.ends(), store.all_but(1)).unwrap();
        assert_eq!([copy.region(ALL[0]), copy.region(ALL[1])], [[1, 1], [2, 2]]);
        assert_eq!(copy.curves(), [3]);
        for (ends, count) in [([1, 2], 9), ([2, 1], 4), ([1, 5], 4)] {
            assert_eq!(copy.replace(ends, &[7; 9][..count]), None);
        }
        assert_eq!(copy.used(), 5);
    }
}
