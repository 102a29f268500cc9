//! The elements around several tiles, found once for all of them.
//!
//! The faces of many models are in no order on the page, so nearly all of them must be looked at to
//! find those that meet a tile. A region is a larger part of the page whose elements are listed, in
//! a byte each, so that only these are looked at for each tile in it.

use super::page::Rectangle;
use crate::stage::{OutOfScratch, Scratch};
use core::slice;

/// The list takes at most the working memory divided by this number.
const SHARE: usize = 16;

/// A region is small if it has fewer elements than there is room for, divided by this number. Then
/// the next one may be twice as large.
const SMALL: usize = 4;

/// A step over this many corners leads to no element. A smaller step leads from the first corner of
/// an element to that of the next.
const FAR: u8 = u8::MAX;

/// The properties of a region that are stored beside its list.
#[derive(Debug, Clone, Copy)]
pub(super) struct PausedRegion {
    /// The rectangle whose elements are listed, [`Rectangle::NONE`] if none are.
    near: Rectangle,
    /// The greatest extent of an element of the list on the grid.
    extent: [u16; 2],
    /// The number of steps of the list.
    length: usize,
    /// The number of times that the page is divided to get the next region.
    pub depth: u32,
    /// The number of words of memory.
    words: usize,
}

impl PausedRegion {
    /// The number of words of memory that the list takes.
    pub fn words(&self) -> usize {
        self.words
    }
}

/// The list of all elements that may meet a part of the page, in the order of the model.
#[derive(Debug)]
pub(super) struct Region<'t> {
    /// The number of corners from each element to the next, and from corner 0 to the first.
    steps: &'t mut [u8],
    /// The other properties of the region.
    pub known: PausedRegion,
    /// The first corner of the element that was listed last.
    last: usize,
}

/// The position in an iteration over the list.
pub(super) struct RegionCursor<'a> {
    /// The steps that are left.
    steps: slice::Iter<'a, u8>,
    /// The first corner of the element before them.
    first: usize,
}

impl RegionCursor<'_> {
    /// Returns the first corner of the next element.
    pub fn next(&mut self) -> Option<usize> {
        loop {
            let step = *self.steps.next()?;
            self.first += usize::from(step);
            if step != FAR {
                return Some(self.first);
            }
        }
    }
}

impl<'t> Region<'t> {
    /// Takes memory for a list, which is empty so far.
    ///
    /// # Errors
    /// [`OutOfScratch`].
    pub fn new(scratch: &mut Scratch<'t>) -> Result<Self, OutOfScratch> {
        let words = scratch.available_bytes() / SHARE / size_of::<u64>();
        let near = Rectangle::NONE;
        let known = PausedRegion { near, extent: [0; 2], length: 0, depth: 0, words };
        Ok(Self { steps: scratch.take(words * size_of::<u64>())?, known, last: 0 })
    }

    /// Finds the list again, which lies at the front of `memory`.
    pub fn go_on(known: PausedRegion, memory: &'t mut [u64]) -> Option<Self> {
        let steps = bytemuck::cast_slice_mut(memory.get_mut(..known.words)?);
        Some(Self { steps, known, last: 0 })
    }

    /// Returns the number of elements for which there is room.
    pub fn room(&self) -> usize {
        self.steps.len()
    }

    /// Whether all elements are listed that may meet a rectangle.
    pub fn includes(&self, near: Rectangle) -> bool {
        self.known.near != Rectangle::NONE && self.known.near.includes(near)
    }

    /// Returns how far an element of the list extends on the grid at most.
    pub fn extent(&self) -> [u16; 2] {
        self.known.extent
    }

    /// Begins to go through the elements.
    pub fn cursor(&self) -> RegionCursor<'_> {
        let steps = self.steps.get(..self.known.length).unwrap_or(&[]);
        RegionCursor { steps: steps.iter(), first: 0 }
    }

    /// Returns as much of `wanted` as is listed, if `least` is.
    pub fn clip(&self, least: Rectangle, wanted: Rectangle) -> Rectangle {
        let listed = self.includes(least).then_some(self.known.near);
        listed.and_then(|near| near.intersection(wanted)).unwrap_or(wanted)
    }

    /// Adds an element, given by its first corner, behind those that are listed. Returns whether
    /// there was room for it.
    pub fn push(&mut self, first: usize) -> bool {
        let mut distance = first.saturating_sub(self.last);
        self.last = first;
        loop {
            let Some(step) = self.steps.get_mut(self.known.length) else { return false };
            self.known.length += 1;
            *step = distance.min(FAR.into()) as u8;
            distance -= usize::from(*step);
            if *step != FAR {
                return true;
            }
        }
    }

    /// Says which elements have been listed: all that may meet `near`, none of which extends
    /// farther on the grid than `extent`.
    pub fn finish(&mut self, near: Rectangle, extent: [u16; 2]) {
        (self.known.near, self.known.extent) = (near, extent);
        if self.known.length < self.steps.len() / SMALL {
            self.known.depth = self.known.depth.saturating_sub(1);
        }
    }

    /// Takes the region and leaves one without elements and memory.
    pub fn take(&mut self) -> Self {
        self.clear();
        Self { steps: core::mem::take(&mut self.steps), known: self.known, last: 0 }
    }

    /// Forgets the elements.
    pub fn clear(&mut self) {
        self.last = 0;
        self.known.near = Rectangle::NONE;
        self.known.length = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::page::GridPoint;
    use super::*;
    use std::vec::Vec;

    /// A rectangle from (0, 0) to (`side`, `side`).
    fn square(side: u16) -> Rectangle {
        Rectangle { low: GridPoint { x: 0, y: 0 }, high: GridPoint { x: side, y: side } }
    }

    /// The elements of a region.
    fn listed(region: &Region<'_>) -> Vec<usize> {
        let mut cursor = region.cursor();
        core::iter::from_fn(|| cursor.next()).collect()
    }

    #[test]
    fn elements_far_apart_take_more_steps() {
        let mut words = [0; 16 * 8];
        let mut region = Region::new(&mut Scratch::new(&mut words)).unwrap();
        assert_eq!(region.room(), 64);
        // Distances around 255 and its double, and the first element of the model.
        let firsts = [0, 3, 257, 511, 766, 1022, 1531, 2041, 2552, 100_000];
        let mut fit = 0;
        for first in firsts {
            fit += usize::from(region.push(first));
        }
        // The last one is 382 times 255 corners away.
        assert_eq!(fit, firsts.len() - 1);
        region.clear();
        assert_eq!(listed(&region), [0; 0]);
        assert!(firsts[..9].iter().all(|&first| region.push(first)));
        region.finish(square(9), [1, 2]);
        assert_eq!(listed(&region), firsts[..9]);
        assert_eq!(region.extent(), [1, 2]);
    }

    #[test]
    fn it_includes_what_lies_within_it_only() {
        let mut words = [0; 16];
        let mut region = Region::new(&mut Scratch::new(&mut words)).unwrap();
        assert!(!region.includes(square(1)) && !region.includes(Rectangle::NONE));
        assert_eq!(region.clip(square(5), square(20)), square(20));
        region.finish(square(9), [0; 2]);
        assert!(region.includes(square(9)) && !region.includes(square(10)));
        assert_eq!(region.clip(square(5), square(20)), square(9));
        assert_eq!(region.clip(square(10), square(20)), square(20));
        let (known, memory) = (region.known, &mut [0; 1]);
        assert!(Region::go_on(known, memory).is_some_and(|region| region.includes(square(9))));
        assert!(Region::go_on(known, &mut []).is_none());
    }

    #[test]
    fn the_next_region_is_larger_after_a_small_one_only() {
        let mut words = [0; 16 * 8];
        let mut region = Region::new(&mut Scratch::new(&mut words)).unwrap();
        for (count, depth) in [(16, 5), (15, 4)] {
            region.known.depth = 5;
            region.clear();
            assert!((0..count).all(|number| region.push(3 * number)));
            region.finish(square(9), [0; 2]);
            assert_eq!(region.known.depth, depth, "{count} elements of 64");
        }
    }
}
