//! The ring buffer in which events wait for the step interrupt.
//!
//! The main loop puts words in, and the interrupt takes them out and does nothing else with them. A
//! word that was taken stays in its slot until the main loop has counted it. All accesses are loads
//! and stores, so a Cortex-M0+ supports them. Interrupt and main loop run on the same core, so
//! compiler fences are enough to order the accesses.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};

/// The queue of step events: a ring buffer of `N` slots, of which all but one can be filled.
#[derive(Debug)]
#[repr(C)] // The words come last, so that the other fields have short offsets.
pub struct EventRing<const N: usize> {
    /// The slot after the word that was taken last, which is the slot of the next word: 0 to `N`,
    /// where `N` means slot 0. Only the interrupt writes it.
    taken: AtomicU32,
    /// The slot after the word that was put in last. Only the main loop writes it.
    filled: AtomicU32,
    /// Whether the interrupt is taking one word after the other. Only the interrupt writes it.
    running: AtomicBool,
    /// The slots. A slot holds one step event, or information about later ones.
    words: [AtomicU32; N],
}

impl<const N: usize> Default for EventRing<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> EventRing<N> {
    /// Creates an empty ring.
    pub const fn new() -> Self {
        assert!(N > 1, "a ring of one slot holds nothing");
        Self {
            taken: AtomicU32::new(0),
            filled: AtomicU32::new(0),
            running: AtomicBool::new(false),
            words: [const { AtomicU32::new(0) }; N],
        }
    }

    /// Returns the word in the slot `slot`, and the number of the slot after it.
    #[inline(always)]
    fn at(&self, slot: u32) -> (&AtomicU32, u32) {
        let slot = if slot < N as u32 { slot } else { 0 };
        (&self.words[slot as usize], slot + 1)
    }

    /// The number of words from slot `from` up to, but not including, slot `to`.
    fn between(from: u32, to: u32) -> u32 {
        if to >= from { to - from } else { to + N as u32 - from }
    }

    /// Takes the next word. For the interrupt only.
    #[inline(always)]
    pub(super) fn take(&self) -> Option<u32> {
        let taken = self.taken.load(Ordering::Relaxed);
        if taken == self.filled.load(Ordering::Relaxed) {
            return None;
        }
        compiler_fence(Ordering::Acquire);
        let (word, next) = self.at(taken);
        let word = word.load(Ordering::Relaxed);
        self.taken.store(next, Ordering::Relaxed);
        Some(word)
    }

    /// Returns the next word without taking it. For the interrupt only.
    pub(super) fn peek(&self) -> Option<u32> {
        let taken = self.taken.load(Ordering::Relaxed);
        let is_empty = taken == self.filled.load(Ordering::Relaxed);
        compiler_fence(Ordering::Acquire);
        (!is_empty).then(|| self.at(taken).0.load(Ordering::Relaxed))
    }

    /// Records that the interrupt begins to take words, or stops taking them. For the interrupt
    /// only.
    pub(super) fn set_running(&self, running: bool) {
        compiler_fence(Ordering::Release);
        self.running.store(running, Ordering::Relaxed);
    }

    /// Whether the interrupt takes words. For the main loop: if not, the main loop sees everything
    /// that was taken.
    pub(super) fn is_running(&self) -> bool {
        let running = self.running.load(Ordering::Relaxed);
        compiler_fence(Ordering::Acquire);
        running
    }

    /// Whether the interrupt has taken all words.
    pub(super) fn is_empty(&self) -> bool {
        self.taken.load(Ordering::Relaxed) == self.filled.load(Ordering::Relaxed)
    }

    /// Returns the number of words that wait to be taken.
    pub(super) fn waiting(&self) -> u32 {
        Self::between(self.taken.load(Ordering::Relaxed), self.filled.load(Ordering::Relaxed))
    }

    /// The slot after the word that was taken last, from which counting can begin.
    pub(super) fn taken_slot(&self) -> u32 {
        self.taken.load(Ordering::Relaxed)
    }

    /// The number of words that were taken from slot `from` on. For the main loop only.
    pub(super) fn taken_behind(&self, from: u32) -> u32 {
        Self::between(from, self.taken.load(Ordering::Relaxed))
    }

    /// The number of free slots if the words from slot `counted` on still need theirs. For the main
    /// loop only.
    pub(super) fn room(&self, counted: u32) -> usize {
        N - 1 - Self::between(counted, self.filled.load(Ordering::Relaxed)) as usize
    }

    /// Puts a word in. The caller makes sure that there is room. For the main loop only.
    pub(super) fn put(&self, word: u32) {
        let (slot, next) = self.at(self.filled.load(Ordering::Relaxed));
        slot.store(word, Ordering::Relaxed);
        compiler_fence(Ordering::Release);
        self.filled.store(next, Ordering::Relaxed);
    }

    /// Passes the words that were taken since `counted` to `each`, and advances `counted` past
    /// them. For the main loop only.
    pub(super) fn count(&self, counted: &mut u32, mut each: impl FnMut(u32)) {
        let taken = self.taken.load(Ordering::Relaxed);
        while *counted != taken {
            let (word, next) = self.at(*counted);
            each(word.load(Ordering::Relaxed));
            *counted = next;
        }
    }

    /// Discards the waiting words. For the main loop only, while the interrupt does not run.
    pub(super) fn clear(&self) {
        self.filled.store(self.taken.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_out_in_order_and_stay_until_they_are_counted() {
        let ring = EventRing::<4>::new();
        let (mut counted, mut next, mut sum) = (0, 1, 0);
        for round in 1..=20 {
            assert_eq!(ring.room(counted), 3);
            for word in next..next + 3 {
                ring.put(word);
            }
            assert_eq!((ring.room(counted), ring.waiting()), (0, 3));
            for word in next..next + 3 {
                assert_eq!((ring.peek(), ring.take()), (Some(word), Some(word)));
            }
            assert_eq!(ring.take(), None);
            assert_eq!((ring.room(counted), ring.taken_behind(counted)), (0, 3));
            ring.count(&mut counted, |word| sum += word);
            next += 3;
            assert_eq!(sum, (1..=3 * round).sum::<u32>());
        }
        ring.put(1);
        ring.clear();
        assert!(ring.is_empty() && ring.peek().is_none() && ring.room(counted) == 3);
    }
}
