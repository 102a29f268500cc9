//! What comes over a serial port, whatever the port: ordinary bytes in a queue of its own, real-time
//! ones as flags that all ports share.
//!
//! Real-time bytes never enter a queue, so that status, hold and abort are seen however full it
//! is. An abort also drops the bytes that every port received before it. Where bytes were lost or
//! damaged, the queue holds a mark: see [`penup::protocol::DAMAGED`].
//!
//! Only loads and stores, so a Cortex-M0+ has it too.

use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Queue};
use penup::protocol::{RealTime, Receiver};
use static_cell::StaticCell;

/// Bytes that wait for the main loop, at most; one more place than that, for the queue. A sender may
/// have 240 bytes unanswered.
const RECEIVED_PLACES: usize = 256;

/// The byte ctrl-X.
pub const ABORT: u8 = 0x18;

/// What was asked in real time since last taken, as bits.
static ASKED: AtomicU16 = AtomicU16::new(0);

/// What the two ends of a port share.
pub struct Shared {
    queue: StaticCell<Queue<u8, RECEIVED_PLACES>>,
    /// How many bytes had been queued when the last abort came.
    count_at_abort: AtomicU32,
}

/// The main loop's end of a port.
pub struct Line {
    bytes: Consumer<'static, u8>,
    count_at_abort: &'static AtomicU32,
    /// Bytes taken since the start, modulo 2^32.
    count: u32,
}

/// The handler's end of a port.
pub struct ReceiveMerge {
    pub receiver: Receiver<'static>,
    count_at_abort: &'static AtomicU32,
}

impl Shared {
    /// Of a port that is not open yet.
    pub const fn new() -> Self {
        Self { queue: StaticCell::new(), count_at_abort: AtomicU32::new(0) }
    }

    /// Both ends.
    ///
    /// # Panics
    /// The second time.
    pub fn ends(&'static self) -> (ReceiveMerge, Line) {
        let (producer, consumer) = self.queue.init(Queue::new()).split();
        let count_at_abort = &self.count_at_abort;
        (
            ReceiveMerge { receiver: Receiver::new(producer), count_at_abort },
            Line { bytes: consumer, count_at_abort, count: 0 },
        )
    }
}

/// Notes what a byte asks for in real time. Called in the handler of a port, with the inlets of all
/// ports; no handler that could interrupt it does the same.
pub fn ask(asked: RealTime, inlets: &mut [ReceiveMerge]) {
    if asked.has(RealTime::ABORT) {
        for receive_merge in inlets {
            receive_merge.count_at_abort.store(receive_merge.receiver.abort(), Ordering::Release);
        }
    }
    // The main loop masks the handler while it takes the bits.
    ASKED.store(ASKED.load(Ordering::Relaxed) | asked.to_bits(), Ordering::Release);
}

/// What was asked in real time since last taken. An abort drops the bytes that the `lines` received
/// before it, which are those of all ports.
pub fn take_real_time(lines: &mut [Line]) -> RealTime {
    if ASKED.load(Ordering::Acquire) == 0 {
        return RealTime::default();
    }
    let asked = critical_section::with(|_| {
        let bits = ASKED.load(Ordering::Acquire);
        ASKED.store(0, Ordering::Relaxed);
        RealTime::from_bits(bits)
    });
    if asked.has(RealTime::ABORT) {
        lines.iter_mut().for_each(Line::drop_void);
    }
    asked
}

impl Line {
    /// The next ordinary byte; none while an abort waits to be taken, for the bytes before it are
    /// void.
    pub fn read_byte(&mut self) -> Option<u8> {
        // An abort and the first byte behind it must not come in between.
        let byte = critical_section::with(|_| {
            let asked = RealTime::from_bits(ASKED.load(Ordering::Acquire));
            if asked.has(RealTime::ABORT) { None } else { self.bytes.dequeue() }
        })?;
        self.count = self.count.wrapping_add(1);
        Some(byte)
    }

    /// Drops what came before the last abort.
    fn drop_void(&mut self) {
        let void = self.count_at_abort.load(Ordering::Acquire).wrapping_sub(self.count);
        for _ in 0..void {
            self.bytes.dequeue();
            self.count = self.count.wrapping_add(1);
        }
    }
}
