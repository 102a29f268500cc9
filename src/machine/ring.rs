//! The ring in which events wait for the step interrupt.
//!
//! The main loop puts words in, the interrupt takes them out, and does nothing else with them: what was
//! taken stays in its place until the main loop has counted it. Loads and stores only, so a Cortex-M0+
//! has it too; interrupt and main loop are of one core, so their order needs no barrier but the
//! compiler's.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};

/// A ring of `N` places, all but one of which can be filled.
#[derive(Debug)]
#[repr(C)] // The words last: the interrupt reaches the others by a short offset.
pub struct EventRing<const N: usize> {
    /// The place behind the word taken last, which is the place of the next: 0 to `N`, and `N` stands for
    /// the first. Of the interrupt.
    taken: AtomicU32,
    /// The place behind the word put in last. Of the main loop.
    filled: AtomicU32,
    /// The interrupt takes one word after the other. Of the interrupt.
    running: AtomicBool,
    words: [AtomicU32; N],
}

impl<const N: usize> Default for EventRing<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> EventRing<N> {
    /// Nothing in it.
    pub const fn new() -> Self {
        assert!(N > 1, "a ring of one place holds nothing");
        Self {
            taken: AtomicU32::new(0),
            filled: AtomicU32::new(0),
            running: AtomicBool::new(false),
            words: [const { AtomicU32::new(0) }; N],
        }
    }

    /// The word at `place`, and what comes behind it.
    #[inline(always)]
    fn at(&self, place: u32) -> (&AtomicU32, u32) {
        let place = if place < N as u32 { place } else { 0 };
        (&self.words[place as usize], place + 1)
    }

    /// How many words lie between two places.
    fn between(from: u32, to: u32) -> u32 {
        if to >= from { to - from } else { to + N as u32 - from }
    }

    /// The next word. For the interrupt.
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

    /// The next word, which stays. For the interrupt.
    pub(super) fn peek(&self) -> Option<u32> {
        let taken = self.taken.load(Ordering::Relaxed);
        let is_empty = taken == self.filled.load(Ordering::Relaxed);
        compiler_fence(Ordering::Acquire);
        (!is_empty).then(|| self.at(taken).0.load(Ordering::Relaxed))
    }

    /// The interrupt begins to take words, or takes no more. For the interrupt.
    pub(super) fn set_running(&self, running: bool) {
        compiler_fence(Ordering::Release);
        self.running.store(running, Ordering::Relaxed);
    }

    /// Whether it does. For the main loop: if not, it sees all that was taken.
    pub(super) fn is_running(&self) -> bool {
        let running = self.running.load(Ordering::Relaxed);
        compiler_fence(Ordering::Acquire);
        running
    }

    /// Whether all words were taken.
    pub(super) fn is_empty(&self) -> bool {
        self.taken.load(Ordering::Relaxed) == self.filled.load(Ordering::Relaxed)
    }

    /// How many words wait to be taken.
    pub(super) fn waiting(&self) -> u32 {
        Self::between(self.taken.load(Ordering::Relaxed), self.filled.load(Ordering::Relaxed))
    }

    /// The place behind the word taken last, to count from.
    pub(super) fn taken_place(&self) -> u32 {
        self.taken.load(Ordering::Relaxed)
    }

    /// How many words were taken behind `place`. For the main loop.
    pub(super) fn taken_behind(&self, place: u32) -> u32 {
        Self::between(place, self.taken.load(Ordering::Relaxed))
    }

    /// How many words have room, if those behind `counted` still need theirs. For the main loop.
    pub(super) fn room(&self, counted: u32) -> usize {
        N - 1 - Self::between(counted, self.filled.load(Ordering::Relaxed)) as usize
    }

    /// Puts a word in; there is room. For the main loop.
    pub(super) fn put(&self, word: u32) {
        let (place, next) = self.at(self.filled.load(Ordering::Relaxed));
        place.store(word, Ordering::Relaxed);
        compiler_fence(Ordering::Release);
        self.filled.store(next, Ordering::Relaxed);
    }

    /// The words taken since `counted`, which moves on. For the main loop.
    pub(super) fn count(&self, counted: &mut u32, mut each: impl FnMut(u32)) {
        let taken = self.taken.load(Ordering::Relaxed);
        while *counted != taken {
            let (word, next) = self.at(*counted);
            each(word.load(Ordering::Relaxed));
            *counted = next;
        }
    }

    /// Throws away what waits. For the main loop, while the interrupt does not run.
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
