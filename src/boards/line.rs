//! The receiving side of every serial port. Ordinary bytes go into a queue of the port; real-time
//! bytes become flags that all ports share.
//!
//! Real-time bytes never enter a queue, so status, hold and abort are seen however full it is. An
//! abort also discards the bytes that every port received before it. Where bytes were lost or
//! damaged, the queue holds a mark: see [`penup::protocol::DAMAGED`].
//!
//! The module needs only atomic loads and stores, so a Cortex-M0+ supports it.

use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use penup::byte_queue::{ByteQueue, Consumer};
use penup::protocol::{RealTime, Receiver};
use static_cell::StaticCell;

use super::fault::once;

/// The number of slots in the queue of received bytes, one of which stays empty. A sender may have
/// up to 240 unanswered bytes.
const RECEIVED_PLACES: usize = 256;

/// The byte for ctrl-X, which cancels the job.
pub const ABORT: u8 = 0x18;

/// The real-time requests since they were last taken, as bits.
static REQUESTED: AtomicU16 = AtomicU16::new(0);

/// What the receive interrupt and the main loop share of one serial port.
pub struct Shared {
    /// The queue in which received bytes wait for the main loop.
    queue: StaticCell<ByteQueue<RECEIVED_PLACES>>,
    /// The number of bytes that had been queued when the last abort came.
    count_at_abort: AtomicU32,
}

/// The main loop's end of one serial port, from which it reads bytes.
pub struct SerialInput {
    /// Where the received bytes wait.
    bytes: Consumer<'static>,
    /// The number of bytes that had been queued when the last abort came.
    count_at_abort: &'static AtomicU32,
    /// The number of bytes taken since the start, modulo 2^32.
    count: u32,
}

/// The receive interrupt's side of one serial port, which sorts bytes and queues the ordinary ones.
pub struct ReceiveMerge {
    /// Sorts the received bytes and queues the ordinary ones.
    pub receiver: Receiver<'static>,
    /// The number of bytes that had been queued when the last abort came.
    count_at_abort: &'static AtomicU32,
}

impl Shared {
    /// Creates the data of a port that is not open yet.
    pub const fn new() -> Self {
        Self { queue: StaticCell::new(), count_at_abort: AtomicU32::new(0) }
    }

    /// Creates both ends of the port.
    ///
    /// A second call is a fault: see [`once`].
    pub fn ends(&'static self) -> (ReceiveMerge, SerialInput) {
        let (producer, consumer) = once(self.queue.try_init(ByteQueue::new())).split();
        let count_at_abort = &self.count_at_abort;
        (
            ReceiveMerge { receiver: Receiver::new(producer), count_at_abort },
            SerialInput { bytes: consumer, count_at_abort, count: 0 },
        )
    }
}

/// Records what a real-time byte requests. It is called in the handler of a port, with the
/// receiving ends of all ports in `merges`. No handler that could interrupt it does the same.
pub fn ask(requests: RealTime, merges: &mut [ReceiveMerge]) {
    if requests.has(RealTime::ABORT) {
        for receive_merge in merges {
            receive_merge.count_at_abort.store(receive_merge.receiver.abort(), Ordering::Release);
        }
    }
    // No update is lost here, because the main loop masks the handler while it takes the bits.
    REQUESTED.store(REQUESTED.load(Ordering::Relaxed) | requests.to_bits(), Ordering::Release);
}

/// Takes the real-time requests that came since the last call. An abort discards the bytes that the
/// `lines` received before it; `lines` must be those of all ports.
pub fn take_real_time(lines: &mut [SerialInput]) -> RealTime {
    if REQUESTED.load(Ordering::Acquire) == 0 {
        return RealTime::default();
    }
    let requests = critical_section::with(|_| {
        let bits = REQUESTED.load(Ordering::Acquire);
        REQUESTED.store(0, Ordering::Relaxed);
        RealTime::from_bits(bits)
    });
    if requests.has(RealTime::ABORT) {
        lines.iter_mut().for_each(SerialInput::drop_void);
    }
    requests
}

impl SerialInput {
    /// Returns the next ordinary byte. While an abort waits to be taken, it returns none, because
    /// the bytes before the abort are void.
    pub fn read_byte(&mut self) -> Option<u8> {
        // An abort and the first byte after it must not arrive between the check and the read.
        let byte = critical_section::with(|_| {
            let requests = RealTime::from_bits(REQUESTED.load(Ordering::Acquire));
            if requests.has(RealTime::ABORT) { None } else { self.bytes.dequeue() }
        })?;
        self.count = self.count.wrapping_add(1);
        Some(byte)
    }

    /// How many more bytes fit into the queue.
    pub fn room(&self) -> usize {
        RECEIVED_PLACES - 1 - self.bytes.len()
    }

    /// Discards the bytes that came before the last abort.
    fn drop_void(&mut self) {
        let void = self.count_at_abort.load(Ordering::Acquire).wrapping_sub(self.count);
        for _ in 0..void {
            self.bytes.dequeue();
            self.count = self.count.wrapping_add(1);
        }
    }
}
