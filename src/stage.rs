//! What every stage of a job borrows: working memory, and a way to answer the serial line while it
//! computes. A stage is one part of the computation that turns a model into a drawing, such as the
//! hidden-line removal ([`Stage`] lists them).
//!
//! The stages never run at the same time, so one [`Scratch`] serves them all. Each takes typed
//! slices from it and gives all of them back when it ends. A stage that runs for more than a
//! millisecond calls [`Cancel::check`] regularly, so that status, hold and abort are answered
//! during the computation. A slice that does not fit is refused, with the sizes.

use bytemuck::Pod;

/// Working memory from which a part of the computation (a [`Stage`]) takes its slices.
///
/// Dropping the slices returns nothing: the owner of the memory makes a new `Scratch` for the next
/// stage. The borrow rules keep two stages from holding the same bytes.
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
    /// The part of the memory that has not been taken yet.
    words: &'a mut [u64],
}

/// The error that a stage of the computation needs more working memory than there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OutOfScratch {
    /// Number of bytes that the slice needs.
    pub needed: usize,
    /// Number of bytes that are left.
    pub available: usize,
}

impl<'a> Scratch<'a> {
    /// Makes all of `words` available as working memory.
    pub fn new(words: &'a mut [u64]) -> Self {
        Self { words }
    }

    /// Number of bytes that have not been taken yet.
    pub fn available_bytes(&self) -> usize {
        size_of_val(self.words)
    }

    /// Number of bytes that [`Scratch::take`] uses for `count` items of `T`.
    pub const fn bytes_for<T>(count: usize) -> usize {
        (count * size_of::<T>()).next_multiple_of(8)
    }

    /// Takes `count` items of `T`, all zero.
    ///
    /// # Errors
    /// [`OutOfScratch`] if they do not fit; nothing is taken then.
    pub fn take<T: Pod>(&mut self, count: usize) -> Result<&'a mut [T], OutOfScratch> {
        let words = self.take_words(count.saturating_mul(size_of::<T>()))?;
        Ok(items_mut(words, count).unwrap_or(&mut [])) // It has the length asked for.
    }

    /// Takes this many bytes, rounded up to whole words, off the front of the memory.
    #[inline(never)] // All types share one copy of the code.
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

    /// Lets `fill` write items of `T` to the front of all the memory that is left, and takes as
    /// many as it says it has written.
    ///
    /// # Errors
    /// The error that `fill` returns; nothing is taken then.
    pub fn take_filled<T: Pod, E>(
        &mut self,
        fill: impl FnOnce(&mut [T]) -> Result<usize, E>,
    ) -> Result<&'a mut [T], E> {
        let room = self.available_bytes() / size_of::<T>();
        let count = fill(items_mut(self.words, room).unwrap_or(&mut []))?.min(room);
        let words = core::mem::take(&mut self.words);
        // `count` items fit, so this is at most what is left.
        let word_count = Self::bytes_for::<T>(count) / size_of::<u64>();
        let (taken, rest) = words.split_at_mut_checked(word_count).unwrap_or_default();
        self.words = rest;
        Ok(items_mut(taken, count).unwrap_or(&mut []))
    }

    /// Takes all the memory that is left as items of `T`, with whatever it holds. So a list that is
    /// mostly shorter than its room costs no time to clear.
    pub fn take_rest<T: Pod>(&mut self) -> &'a mut [T] {
        let words = core::mem::take(&mut self.words);
        let count = size_of_val(words) / size_of::<T>();
        items_mut(words, count).unwrap_or(&mut []) // It has as many.
    }

    /// Lends the memory that is left, for a part of this stage's work. All of it is free again
    /// afterwards.
    pub fn reborrow(&mut self) -> Scratch<'_> {
        Scratch { words: self.words }
    }

    /// Splits the memory into its first `bytes` (rounded down to words) and the rest.
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

/// Returns the first `count` items of `T` that lie in `words`, for reading only; `None` if they do
/// not fit.
pub fn items<T: Pod>(words: &[u64], count: usize) -> Option<&[T]> {
    const { assert!(align_of::<T>() <= align_of::<u64>()) };
    let bytes: &[u8] = bytemuck::cast_slice(words);
    let exact = bytes.get(..count.checked_mul(size_of::<T>())?)?;
    bytemuck::try_cast_slice(exact).ok()
}

/// Sorts by a key, in place and without recursion, by Williams' heapsort. The standard library's
/// sorts take kilobytes of a board's stack, and another version of it may order equal keys
/// differently.
///
/// ```
/// let mut items = [3, 1, 2];
/// penup::stage::heap_sort_by_key(&mut items, |item| *item);
/// assert_eq!(items, [1, 2, 3]);
/// ```
pub fn heap_sort_by_key<T, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K) {
    // `NeverCancel` never aborts.
    let _ = heap_sort(items.len(), &mut Keyed { items, key }, &mut NeverCancel);
}

/// Sorts by a key as [`heap_sort_by_key`] does, and checks for cancelling before each item. It is
/// for keys that take long to compare.
///
/// # Errors
/// [`Aborted`] if the user cancelled the job; the order of the items is then undefined.
pub fn heap_sort_cancellable<T, K: Ord>(
    items: &mut [T],
    key: impl Fn(&T) -> K,
    cancel: &mut dyn Cancel,
) -> Result<(), Aborted> {
    heap_sort(items.len(), &mut Keyed { items, key }, cancel)
}

/// Items that a heapsort compares and exchanges. So all types of items share one copy of its code.
trait Heap {
    /// Whether the item at `a` comes before the item at `b`.
    fn is_less(&self, a: usize, b: usize) -> bool;
    /// Exchanges two items.
    fn swap(&mut self, a: usize, b: usize);
}

/// A slice of items, and the key by which they are sorted.
struct Keyed<'i, T, F> {
    /// The items, which change places.
    items: &'i mut [T],
    /// Returns the key by which an item is compared.
    key: F,
}

impl<T, K: Ord, F: Fn(&T) -> K> Heap for Keyed<'_, T, F> {
    fn is_less(&self, a: usize, b: usize) -> bool {
        let key = |index: usize| self.items.get(index).map(&self.key);
        key(a) < key(b)
    }

    fn swap(&mut self, a: usize, b: usize) {
        // A heap changes items of its own.
        if a.max(b) < self.items.len() {
            self.items.swap(a, b);
        }
    }
}

/// Sorts the `count` elements of `heap` without further memory.
fn heap_sort(count: usize, heap: &mut dyn Heap, cancel: &mut dyn Cancel) -> Result<(), Aborted> {
    for parent in (0..count / 2).rev() {
        cancel.check()?;
        sift_down(heap, count, parent);
    }
    for end in (1..count).rev() {
        cancel.check()?;
        heap.swap(0, end);
        sift_down(heap, end, 0);
    }
    Ok(())
}

/// Moves an item down among the first `count` until neither of its children is greater.
fn sift_down(heap: &mut dyn Heap, count: usize, mut parent: usize) {
    loop {
        let mut child = 2 * parent + 1;
        if child >= count {
            return;
        }
        if child + 1 < count && heap.is_less(child, child + 1) {
            child += 1;
        }
        if !heap.is_less(parent, child) {
            return;
        }
        heap.swap(parent, child);
        parent = child;
    }
}

/// Cancels what other threads compute when a flag is set.
#[cfg(feature = "threads")]
pub(crate) struct CancelFlag<'f>(&'f core::sync::atomic::AtomicBool);

#[cfg(feature = "threads")]
impl<'f> CancelFlag<'f> {
    /// Cancels when `is_cancelled` becomes true.
    pub(crate) fn new(is_cancelled: &'f core::sync::atomic::AtomicBool) -> Self {
        Self(is_cancelled)
    }
}

#[cfg(feature = "threads")]
impl Cancel for CancelFlag<'_> {
    fn check(&mut self) -> Result<(), Aborted> {
        let is_cancelled = self.0.load(core::sync::atomic::Ordering::Relaxed);
        if is_cancelled { Err(Aborted) } else { Ok(()) }
    }
}

/// The error that the user has cancelled the job while it was being computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Aborted;

/// The error that the caller has no room for what a stage of the computation hands to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinkFull;

/// The reasons why a stage of the computation ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StageError {
    /// There is not enough working memory.
    Scratch(OutOfScratch),
    /// The user has cancelled the job.
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

/// The stages of computing a job, which run one after the other before anything moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// Choosing the camera and projecting every vertex.
    View,
    /// Finding the visible stretches of the edges.
    Visibility,
    /// Organising the drawing as a graph (Harrison 5) and ordering its strokes.
    Order,
}

/// Lets a long computation answer the serial line, and ends it when the user cancels the job. A
/// stage calls it about once a millisecond.
pub trait Cancel {
    /// Answers pending requests (status, hold, resume).
    ///
    /// # Errors
    /// [`Aborted`] if the user has cancelled the job; the stage then ends at once.
    fn check(&mut self) -> Result<(), Aborted>;

    /// Called when a stage begins, so that the user can be told what is being computed.
    fn enter(&mut self, _stage: Stage) {}

    /// Called as soon as it is known about where on the page the pen will begin, while most is
    /// still to be computed. The pen may travel there meanwhile.
    #[cfg(feature = "early-ink")]
    fn expect_beginning(&mut self, _at: crate::drawing::PagePoint) {}
}

/// Never cancels and answers nobody, for tests and benchmarks.
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
