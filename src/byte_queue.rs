//! A queue of bytes between two contexts, such as an interrupt and the main loop: one puts bytes
//! in, the other takes them out, and neither waits for the other.
//!
//! It is made of atomic loads and stores alone, so a Cortex-M0+ supports it, and it calls nothing
//! that panics. A place in the queue is found by a mask, without a division: the divider of a
//! handler would have to be shared with the main loop.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// The memory of a queue; its ends are made by [`ByteQueue::split`].
///
/// ```
/// use penup::byte_queue::ByteQueue;
/// let mut queue = ByteQueue::<4>::new();
/// let (mut sink, mut source) = queue.split();
/// for byte in *b"abc" {
///     assert_eq!(sink.enqueue(byte), Ok(()));
/// }
/// assert_eq!(sink.enqueue(b'd'), Err(b'd'));
/// assert_eq!((source.dequeue(), sink.len()), (Some(b'a'), 2));
/// assert_eq!(sink.enqueue(b'd'), Ok(()));
/// assert_eq!([(); 4].map(|()| source.dequeue()), [Some(b'b'), Some(b'c'), Some(b'd'), None]);
/// ```
#[derive(Debug)]
pub struct ByteQueue<const SLOTS: usize>(Ring<[AtomicU8; SLOTS]>);

/// What both ends share.
#[derive(Debug)]
struct Ring<S: ?Sized> {
    /// The slot that is filled next. The producer writes it.
    filled: AtomicUsize,
    /// The slot that is emptied next. The consumer writes it.
    emptied: AtomicUsize,
    /// The slots, a power of two of them, one of which stays empty.
    slots: S,
}

/// The end of a queue that puts bytes in.
#[derive(Debug)]
pub struct Producer<'q>(&'q Ring<[AtomicU8]>);

/// The end of a queue that takes bytes out.
#[derive(Debug)]
pub struct Consumer<'q>(&'q Ring<[AtomicU8]>);

impl<const SLOTS: usize> ByteQueue<SLOTS> {
    /// An empty queue for one byte less than it has slots. `SLOTS` is a power of two.
    pub const fn new() -> Self {
        const { assert!(SLOTS.is_power_of_two()) };
        let (filled, emptied) = (AtomicUsize::new(0), AtomicUsize::new(0));
        Self(Ring { filled, emptied, slots: [const { AtomicU8::new(0) }; SLOTS] })
    }

    /// Both ends of the queue. There is one of each, because the queue stays borrowed.
    pub fn split(&mut self) -> (Producer<'_>, Consumer<'_>) {
        (Producer(&self.0), Consumer(&self.0))
    }
}

impl<const SLOTS: usize> Default for ByteQueue<SLOTS> {
    fn default() -> Self {
        Self::new()
    }
}

impl Ring<[AtomicU8]> {
    /// A number of slots, or of a slot, within the ring.
    #[inline]
    fn around(&self, number: usize) -> usize {
        number & self.slots.len().wrapping_sub(1)
    }

    /// The number of bytes that wait.
    #[inline]
    fn len(&self) -> usize {
        let (filled, emptied) =
            (self.filled.load(Ordering::Acquire), self.emptied.load(Ordering::Acquire));
        self.around(filled.wrapping_sub(emptied))
    }
}

impl Producer<'_> {
    /// Puts a byte in.
    ///
    /// # Errors
    /// The byte, if the queue is full.
    #[inline]
    pub fn enqueue(&mut self, byte: u8) -> Result<(), u8> {
        let ring = self.0;
        let at = ring.filled.load(Ordering::Relaxed);
        let next = ring.around(at.wrapping_add(1));
        if next == ring.emptied.load(Ordering::Acquire) {
            return Err(byte);
        }
        ring.slots.get(at).ok_or(byte)?.store(byte, Ordering::Relaxed);
        ring.filled.store(next, Ordering::Release);
        Ok(())
    }

    /// The number of bytes that wait.
    #[inline]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether no byte waits.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of bytes for which there is room now.
    #[inline]
    pub fn room(&self) -> usize {
        self.0.around(usize::MAX).saturating_sub(self.len())
    }
}

impl Consumer<'_> {
    /// Takes the byte out that was put in first; `None` if none waits.
    #[inline]
    pub fn dequeue(&mut self) -> Option<u8> {
        let ring = self.0;
        let at = ring.emptied.load(Ordering::Relaxed);
        if at == ring.filled.load(Ordering::Acquire) {
            return None;
        }
        let byte = ring.slots.get(at)?.load(Ordering::Relaxed);
        ring.emptied.store(ring.around(at.wrapping_add(1)), Ordering::Release);
        Some(byte)
    }

    /// The number of bytes that wait.
    #[inline]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether no byte waits.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_in_their_order_however_the_ends_take_turns() {
        let mut queue = ByteQueue::<8>::new();
        let (mut sink, mut source) = queue.split();
        let (mut put, mut taken) = (0u8, 0u8);
        // The turns differ in length, so that every slot is once the first and once the last.
        for turn in 0..300 {
            for _ in 0..turn % 11 {
                let has_room = sink.room() > 0;
                assert_eq!(sink.enqueue(put).is_ok(), has_room);
                put = put.wrapping_add(u8::from(has_room));
            }
            assert_eq!(sink.len(), usize::from(put.wrapping_sub(taken)));
            for _ in 0..turn % 7 {
                let waits = !source.is_empty();
                assert_eq!(source.dequeue(), waits.then_some(taken));
                taken = taken.wrapping_add(u8::from(waits));
            }
            assert_eq!(source.len() + sink.room(), 7);
        }
    }

    #[test]
    fn another_thread_takes_out_what_was_put_in() {
        let mut queue = ByteQueue::<16>::new();
        let (mut sink, mut source) = queue.split();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for byte in (0..10_000).map(|number| (number % 251) as u8) {
                    while sink.enqueue(byte).is_err() {
                        std::thread::yield_now();
                    }
                }
            });
            for byte in (0..10_000).map(|number| (number % 251) as u8) {
                let mut taken = source.dequeue();
                while taken.is_none() {
                    std::thread::yield_now();
                    taken = source.dequeue();
                }
                assert_eq!(taken, Some(byte));
            }
        });
    }
}
