//! What every stage of a job is lent: working memory, and a moment now and then to answer the line.
//!
//! The stages (visibility, drawing, order) never run at once, so one [`Scratch`] serves them all:
//! each takes typed slices from it and gives everything back by ending. A stage that runs for more
//! than a millisecond calls [`Cancel::check`] as it goes, so that status, hold and abort are
//! answered while it computes. What is refused: a slice that does not fit, with the figures.

use bytemuck::Pod;
use core::convert::Infallible;

/// A piece of working memory from which a stage takes its slices.
///
/// Dropping the slices gives nothing back; the owner of the memory makes a new `Scratch` for the
/// next stage. Borrow rules keep two stages from holding the same bytes.
///
/// ```
/// use penup::stage::Scratch;
/// let mut words = [0u64; 4];
/// let mut scratch = Scratch::new(&mut words);
/// let corners: &mut [u16] = scratch.take(5)?;
/// assert_eq!(corners, [0; 5]);
/// assert_eq!(scratch.available_bytes(), 16);
/// # Ok::<(), penup::stage::OutOfScratch>(())
/// ```
#[derive(Debug)]
pub struct Scratch<'a> {
    words: &'a mut [u64],
}

/// A stage needed more working memory than there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OutOfScratch {
    /// Bytes that the slice needed.
    pub needed: usize,
    /// Bytes that were left.
    pub available: usize,
}

impl<'a> Scratch<'a> {
    /// All of `words` as working memory.
    pub fn new(words: &'a mut [u64]) -> Self {
        Self { words }
    }

    /// Bytes not yet taken.
    pub fn available_bytes(&self) -> usize {
        size_of_val(self.words)
    }

    /// The bytes that [`Scratch::take`] uses up for `count` items of `T`.
    pub const fn bytes_for<T>(count: usize) -> usize {
        (count * size_of::<T>()).next_multiple_of(8)
    }

    /// Takes `count` items of `T`, all zero.
    ///
    /// # Errors
    /// [`OutOfScratch`] if they do not fit; nothing is taken then.
    pub fn take<T: Pod>(&mut self, count: usize) -> Result<&'a mut [T], OutOfScratch> {
        let words = self.take_words(count.saturating_mul(size_of::<T>()))?;
        Ok(items_mut(words, count).unwrap_or(&mut [])) // It is as long as asked for.
    }

    #[inline(never)] // Once is enough for every type.
    fn take_words(&mut self, bytes: usize) -> Result<&'a mut [u64], OutOfScratch> {
        let out_of_scratch = OutOfScratch { needed: bytes, available: self.available_bytes() };
        if bytes > out_of_scratch.available {
            return Err(out_of_scratch);
        }
        let words = core::mem::take(&mut self.words);
        let word_count = bytes.div_ceil(size_of::<u64>());
        let (taken, rest) = words.split_at_mut_checked(word_count).ok_or(out_of_scratch)?;
        self.words = rest;
        taken.fill(0);
        Ok(taken)
    }

    /// Takes as many items of `T` as `fill` says that it wrote to the front of all that is left.
    ///
    /// # Errors
    /// What `fill` returns; nothing is taken then.
    pub fn take_filled<T: Pod, E>(
        &mut self,
        fill: impl FnOnce(&mut [T]) -> Result<usize, E>,
    ) -> Result<&'a mut [T], E> {
        let room = self.available_bytes() / size_of::<T>();
        let count = fill(items_mut(self.words, room).unwrap_or(&mut []))?.min(room);
        let words = core::mem::take(&mut self.words);
        // At most what there is, since `count` items fit.
        let (taken, rest) = words.split_at_mut(Self::bytes_for::<T>(count) / size_of::<u64>());
        self.words = rest;
        Ok(items_mut(taken, count).unwrap_or(&mut []))
    }

    /// Lends what is left to a stage within this stage.
    pub fn reborrow(&mut self) -> Scratch<'_> {
        Scratch { words: self.words }
    }

    /// Splits off the first `bytes` (rounded down to words) as one memory, the rest as another.
    pub fn split(self, bytes: usize) -> (Scratch<'a>, Scratch<'a>) {
        let word_count = (bytes / size_of::<u64>()).min(self.words.len());
        let (first, second) = self.words.split_at_mut(word_count);
        (Scratch { words: first }, Scratch { words: second })
    }
}

/// The first `count` items of `T` that lie in `words`; `None` if they do not fit.
pub fn items_mut<T: Pod>(words: &mut [u64], count: usize) -> Option<&mut [T]> {
    const { assert!(align_of::<T>() <= align_of::<u64>()) };
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
    let exact = bytes.get_mut(..count.checked_mul(size_of::<T>())?)?;
    bytemuck::try_cast_slice_mut(exact).ok()
}

/// Like [`items_mut`], to read only.
pub fn items<T: Pod>(words: &[u64], count: usize) -> Option<&[T]> {
    const { assert!(align_of::<T>() <= align_of::<u64>()) };
    let bytes: &[u8] = bytemuck::cast_slice(words);
    let exact = bytes.get(..count.checked_mul(size_of::<T>())?)?;
    bytemuck::try_cast_slice(exact).ok()
}

/// Sorts by a key, in place and without recursion (Williams' heapsort): the library's own sorts take
/// kilobytes of a board's stack, and may order equal keys otherwise in another version.
///
/// ```
/// let mut items = [3, 1, 2];
/// penup::stage::heap_sort_by_key(&mut items, |item| *item);
/// assert_eq!(items, [1, 2, 3]);
/// ```
pub fn heap_sort_by_key<T, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K) {
    let done = heap_sort(items, key, || Ok::<(), Infallible>(()));
    match done {
        Ok(()) => {}
    }
}

/// [`heap_sort_by_key`] for keys that take long to compare: looks up from the work for each item.
///
/// # Errors
/// [`Aborted`] if the user gave up; the items are in some order then.
pub fn heap_sort_cancellable<T, K: Ord>(
    items: &mut [T],
    key: impl Fn(&T) -> K,
    cancel: &mut dyn Cancel,
) -> Result<(), Aborted> {
    heap_sort(items, key, || cancel.check())
}

fn heap_sort<T, K: Ord, E>(
    items: &mut [T],
    key: impl Fn(&T) -> K,
    mut between: impl FnMut() -> Result<(), E>,
) -> Result<(), E> {
    let sift_down = |items: &mut [T], mut parent: usize| {
        loop {
            let mut child = 2 * parent + 1;
            if child >= items.len() {
                return;
            }
            if child + 1 < items.len() && key(&items[child]) < key(&items[child + 1]) {
                child += 1;
            }
            if key(&items[parent]) >= key(&items[child]) {
                return;
            }
            items.swap(parent, child);
            parent = child;
        }
    };
    for parent in (0..items.len() / 2).rev() {
        between()?;
        sift_down(items, parent);
    }
    for end in (1..items.len()).rev() {
        between()?;
        items.swap(0, end);
        sift_down(&mut items[..end], 0);
    }
    Ok(())
}

/// The user asked for the job to be given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Aborted;

/// The caller's sink has no room for what a stage hands to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinkFull;

/// Why a stage ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StageError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The user gave up.
    Aborted,
}

impl From<OutOfScratch> for StageError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}

impl From<Aborted> for StageError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

/// What a job computes before it moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// The camera, and every vertex through it.
    View,
    /// Which stretches are seen.
    Visibility,
    /// The drawing organised (Harrison 5), and in which order its strokes are drawn.
    Order,
}

/// The moment that a long computation gives to the serial line.
pub trait Cancel {
    /// Answers what waits (status, hold, resume).
    ///
    /// # Errors
    /// [`Aborted`] if the user gave the job up; the stage then ends at once.
    fn check(&mut self) -> Result<(), Aborted>;

    /// Told when a stage begins.
    fn enter(&mut self, _stage: Stage) {}
}

/// Nobody to answer: for tests and benchmarks.
#[derive(Debug, Clone, Copy, Default)]
pub struct NeverCancel;

impl Cancel for NeverCancel {
    fn check(&mut self) -> Result<(), Aborted> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_that_does_not_fit_takes_nothing() {
        let mut words = [7u64; 2];
        let mut scratch = Scratch::new(&mut words);
        assert_eq!(scratch.take::<u32>(5), Err(OutOfScratch { needed: 20, available: 16 }));
        assert_eq!(scratch.take::<u32>(4).map(|items| items.len()), Ok(4));
        assert_eq!(scratch.available_bytes(), 0);
        assert_eq!(scratch.take::<u8>(0).map(|items| items.len()), Ok(0));
    }

    #[test]
    fn items_need_not_fill_their_last_word() {
        let mut words = [0u64; 4];
        let mut scratch = Scratch::new(&mut words);
        assert_eq!(scratch.take::<[u32; 3]>(1).map(|items| items.len()), Ok(1));
        assert_eq!(scratch.take::<[u8; 3]>(5).map(|items| items.len()), Ok(5));
        assert_eq!(scratch.available_bytes(), 0);
    }

    #[test]
    fn sorting_is_that_of_the_standard_library() {
        for length in 0..40u32 {
            let mut items: std::vec::Vec<u32> =
                (0..length).map(|i| i.wrapping_mul(0x9E37_79B1) % 17).collect();
            let mut expected = items.clone();
            expected.sort_unstable();
            heap_sort_by_key(&mut items, |item| *item);
            assert_eq!(items, expected);
        }
    }

    #[test]
    fn a_hostile_count_is_refused_and_does_not_wrap() {
        let mut words = [0u64; 2];
        let mut scratch = Scratch::new(&mut words);
        assert!(scratch.take::<u64>(usize::MAX).is_err());
        assert!(scratch.take::<u64>(usize::MAX / 8 + 1).is_err());
    }
}
