//! Stores which pen draws each element.
//!
//! Neighbouring elements mostly have the same pen. Therefore only the changes are stored, one
//! [`PenRun`] for each, in a region of the [store](super::store). A model with one pen stores none.
//! Pens are chosen by `usemtl` and `g`: a name with a number is the pen of that number, and any
//! other name gets the first pen without a name. Of such a name a hash is stored.

use super::ModelError;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use core::ops::Range;

/// The number of pens that a drawing may use.
pub const PEN_LIMIT: u8 = 32;

/// A change of the pen: the index of an element's first corner, and the pen, from 0, of the
/// elements from there on, which is another than before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PenRun<I = u16>([I; RUN]);

impl<I: Index> PenRun<I> {
    /// Makes the change to `pen` at an element whose first corner has the index `first`, which
    /// fits.
    pub(super) fn new(first: usize, pen: u8) -> Self {
        Self([I::new(first), I::new(pen.into())])
    }

    /// Returns the index of the element's first corner.
    fn first(self) -> usize {
        self.0[0].get()
    }

    /// Returns the pen, from 0.
    fn pen(self) -> u8 {
        self.0[1].get() as u8
    }

    /// Whether the run begins at this corner.
    pub(super) fn begins_at(self, corner: usize) -> bool {
        self.first() == corner
    }
}

/// The number of half-words that a [`PenRun`] takes in the store.
pub(super) const RUN: usize = 2;

/// The pens of elements. Elements before the first run have the first pen.
///
/// If they come from a model or a [`PenWriter`], the runs are in order, none is empty, and each has
/// another pen than the one before.
#[derive(Debug, Clone, Copy)]
pub struct Pens<'a, I = u16> {
    /// The changes of the pen, in the order of the elements.
    runs: &'a [PenRun<I>],
}

impl<I> Default for Pens<'_, I> {
    fn default() -> Self {
        Self { runs: &[] }
    }
}

impl<'a, I: Index> Pens<'a, I> {
    pub(super) fn new(runs: &'a [PenRun<I>]) -> Self {
        Self { runs }
    }

    /// Returns the pen, from 0, of the element to which a corner belongs.
    #[inline]
    pub fn at(&self, corner: usize) -> u8 {
        let after = self.runs.partition_point(|run| run.first() <= corner);
        after.checked_sub(1).and_then(|last| self.runs.get(last)).map_or(0, |run| run.pen())
    }

    /// Returns how many times the pen changes from one element to the next.
    pub fn changes(&self) -> usize {
        self.runs.len()
    }

    /// Returns the pen of the last element.
    pub(super) fn last(&self) -> u8 {
        self.runs.last().map_or(0, |run| run.pen())
    }
}

/// Records the pens of elements while these are written one after the other.
#[derive(Debug)]
pub struct PenWriter<'a, I = u16> {
    /// The changes recorded so far, followed by room for more.
    runs: &'a mut [PenRun<I>],
    /// The number of changes of the pen recorded so far.
    count: usize,
}

impl<'a, I: Index> PenWriter<'a, I> {
    /// Makes a writer for at most this many changes of the pen.
    ///
    /// # Errors
    /// [`OutOfScratch`] if there is no room for them.
    pub fn new(scratch: &mut Scratch<'a>, changes: usize) -> Result<Self, OutOfScratch> {
        Ok(Self { runs: scratch.take(changes)?, count: 0 })
    }

    /// Records the pen of the next element, which begins at corner `first`. The first corners must
    /// be in ascending order.
    pub fn element(&mut self, first: usize, pen: u8) {
        let last = Pens { runs: self.runs.get(..self.count).unwrap_or(&[]) }.last();
        if let Some(run) = self.runs.get_mut(self.count).filter(|_| pen != last) {
            *run = PenRun::new(first, pen); // corners are fewer than 2^16
            self.count += 1;
        }
    }

    /// Ends the record and returns the pens of all elements in it.
    pub fn finish(self) -> Pens<'a, I> {
        let runs: &'a [PenRun<I>] = self.runs;
        Pens { runs: runs.get(..self.count).unwrap_or(runs) }
    }
}

/// Removes the corners in `gone` from the first `count` of `runs`, and returns how many runs are
/// left. The last of them may then be empty.
pub(super) fn close_gap<I: Index>(
    runs: &mut [PenRun<I>],
    count: usize,
    gone: Range<usize>,
) -> usize {
    let (mut kept, mut last) = (0usize, 0);
    for at in 0..count.min(runs.len()) {
        // `kept` grows by 1 at most in each round, so it is at most `at`. No index here can fail.
        let (before, pen) = (runs[at].first(), runs[at].pen());
        // It only becomes less, so it fits.
        let first = if before >= gone.end { before - gone.len() } else { before.min(gone.start) };
        // If the run before has lost all its corners, this run replaces it.
        if kept > 0 && runs[kept - 1].first() == first {
            kept -= 1;
            last = if kept > 0 { runs[kept - 1].pen() } else { 0 };
        }
        if pen != last {
            runs[kept] = PenRun::new(first, pen);
            (kept, last) = (kept + 1, pen);
        }
    }
    kept
}

/// Inserts `length` corners with `pen` at `at` into the first `count` of `runs`, which must have
/// room for two more. Returns how many runs there are then.
pub(super) fn open_gap<I: Index>(
    runs: &mut [PenRun<I>],
    mut count: usize,
    at: usize,
    length: usize,
    pen: u8,
) -> usize {
    let end = at + length;
    // No index below can fail: `next` is at most `count`, and so is `index`; and `count`, which
    // grows by 2 at most, stays within `runs`, which have room for two more.
    let next = runs.iter().take(count).take_while(|run| run.first() < at).count();
    let before = next.checked_sub(1).map_or(0, |last| runs[last].pen());
    let mut after = before;
    if let Some(run) = runs.get(next).filter(|run| next < count && run.first() == at) {
        after = run.pen();
        runs.copy_within(next + 1..count, next);
        count -= 1;
    }
    for run in &mut runs[next..count] {
        run.0[0] += I::new(length);
    }
    let new = [PenRun::new(at, pen), PenRun::new(end, after)];
    let is_new = [pen != before, after != pen];
    let mut index = next;
    for run in new.into_iter().zip(is_new).filter_map(|(run, is_new)| is_new.then_some(run)) {
        runs.copy_within(index..count, index + 1);
        runs[index] = run;
        (index, count) = (index + 1, count + 1);
    }
    count
}

/// What a `usemtl` or `g` statement says about the pen: its number, or a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PenName {
    /// The number of a pen, from 0, below [`PEN_LIMIT`].
    Number(u8),
    /// The hash of a name that is not the number of a pen.
    Other(u32),
}

/// Which pen draws what follows, and which names the pens have been given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PenBook {
    /// For each pen the hash of its name, or [`FREE`] or [`BY_NUMBER`].
    pub(super) names: [u32; PEN_LIMIT as usize],
    /// The pen that draws the elements that follow, from 0.
    pub(super) current: u8,
    /// Whether a `usemtl` statement has come. Then `g` statements are ignored.
    pub(super) by_material: bool,
}

/// Stands instead of the hash of a name for a pen that no name was given to.
const FREE: u32 = 0;
/// Stands instead of the hash of a name for a pen that was chosen by its number.
const BY_NUMBER: u32 = 1;

impl PenBook {
    /// Returns the pen, from 0, that draws the elements that follow.
    pub const fn pen(&self) -> u8 {
        self.current
    }

    /// Whether a `usemtl` statement has come. Then `g` statements are ignored, and elements before
    /// it have the first pen.
    pub const fn is_by_material(&self) -> bool {
        self.by_material
    }

    /// Returns the book after a statement `usemtl` (`by_material`) or `g` with this name.
    ///
    /// # Errors
    /// [`ModelError::TooManyPens`].
    ///
    /// ```
    /// use penup::model::{PenBook, PenName};
    /// let book = PenBook::default().after(false, PenName::Number(4))?;
    /// assert_eq!(book.pen(), 4);
    /// let book = book.after(true, PenName::Other(99))?;
    /// assert_eq!(book.after(false, PenName::Number(4))?.pen(), 0);
    /// # Ok::<(), penup::model::ModelError>(())
    /// ```
    pub fn after(self, by_material: bool, name: PenName) -> Result<Self, ModelError> {
        if self.by_material && !by_material {
            return Ok(self);
        }
        let mut book = self;
        if by_material != book.by_material {
            book = Self { by_material, ..Self::default() };
        }
        book.choose(name)?;
        Ok(book)
    }

    /// Chooses the pen that a name stands for.
    ///
    /// # Errors
    /// [`ModelError::TooManyPens`]; nothing is changed.
    fn choose(&mut self, name: PenName) -> Result<(), ModelError> {
        let pen = match name {
            PenName::Number(pen) => {
                let name = self.names.get_mut(usize::from(pen)).ok_or(ModelError::TooManyPens)?;
                if *name == FREE {
                    *name = BY_NUMBER;
                }
                pen
            }
            PenName::Other(hash) => {
                let hash = hash.max(BY_NUMBER + 1);
                let pen = self.names.iter().position(|name| *name == hash);
                let pen = pen.or_else(|| self.names.iter().position(|name| *name == FREE));
                let pen = pen.ok_or(ModelError::TooManyPens)?;
                self.names[pen] = hash; // `position` found it there
                pen as u8
            }
        };
        self.current = pen;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Returns the pen of each corner.
    fn of(runs: &[PenRun], corners: usize) -> Vec<u8> {
        (0..corners).map(|corner| Pens { runs }.at(corner)).collect()
    }

    #[test]
    fn gaps_are_closed_and_opened_as_in_a_list() {
        let mut state = 1u32;
        let mut random = |below: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as usize % below
        };
        let (mut list, mut runs, mut count) = (Vec::new(), [PenRun::<u16>::zeroed(); 400], 0);
        for _ in 0..20_000 {
            let (at, length, pen) = (random(list.len() + 1), random(4) + 1, random(4) as u8);
            if list.len() < 100 && random(2) == 0 {
                list.splice(at..at, std::iter::repeat_n(pen, length));
                count = open_gap(&mut runs, count, at, length, pen);
            } else {
                let gone = at..(at + length).min(list.len());
                list.drain(gone.clone());
                count = close_gap(&mut runs, count, gone);
            }
            let (used, end) = (&runs[..count], list.len());
            assert!(used.first().is_none_or(|run| run.pen() != 0), "{used:?}");
            let in_order =
                |two: &[PenRun]| two[0].first() < two[1].first() && two[0].pen() != two[1].pen();
            assert!(used.windows(2).all(in_order), "{used:?}");
            assert_eq!(of(used, end), list);
            // The model removes a run that begins at the end.
            if used.last().is_some_and(|run| run.first() >= end) {
                count -= 1;
            }
        }
    }

    #[test]
    fn names_take_free_pens_and_numbers_are_pens() {
        let mut book = PenBook::default();
        let mut chosen = |name| book.choose(name).map(|()| book.current);
        assert_eq!(chosen(PenName::Number(1)), Ok(1));
        for (name, pen) in [(70, 0), (71, 2), (70, 0), (72, 3), (0, 4), (1, 4), (71, 2)] {
            assert_eq!(chosen(PenName::Other(name)), Ok(pen), "{name}");
        }
        assert_eq!(chosen(PenName::Number(31)), Ok(31));
        assert_eq!(chosen(PenName::Number(32)), Err(ModelError::TooManyPens));
        for name in 100..126 {
            assert_eq!(chosen(PenName::Other(name)), Ok(name as u8 - 100 + 5));
        }
        assert_eq!(chosen(PenName::Other(999)), Err(ModelError::TooManyPens));
        assert_eq!(chosen(PenName::Other(70)), Ok(0));
    }

    #[test]
    fn a_writer_notes_changes_only() {
        let mut words = [0; 8];
        let mut writer = PenWriter::new(&mut Scratch::new(&mut words), 3).unwrap();
        for (first, pen) in [(0, 0), (3, 2), (6, 2), (8, 0), (10, 5)] {
            writer.element(first, pen);
        }
        let pens = writer.finish();
        assert_eq!(of(pens.runs, 12), [0, 0, 0, 2, 2, 2, 2, 2, 0, 0, 5, 5]);
        assert_eq!(pens.changes(), 3);
    }
}
