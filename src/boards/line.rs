//! What comes over the serial line, whatever the port: ordinary bytes in a queue, real-time ones as
//! flags.
//!
//! Real-time bytes never enter the queue, so that status, hold and abort are seen however full it
//! is. An abort also drops the bytes received before it. A byte that finds the queue full is lost,
//! and a flag says so.
//!
//! Only loads and stores, so a Cortex-M0+ has it too.

use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};
use penup::protocol::{RealTime, Sorter};
use static_cell::StaticCell;

/// Bytes that wait for the main loop, at most; one more place than that, for the queue.
const RECEIVED_PLACES: usize = 256;

/// The byte ctrl-X.
pub const ABORT: u8 = 0x18;

/// What was asked in real time since last taken, as bits.
static ASKED: AtomicU16 = AtomicU16::new(0);
/// How many bytes had been queued when the last abort came.
static COUNT_AT_ABORT: AtomicU32 = AtomicU32::new(0);

static QUEUE: StaticCell<Queue<u8, RECEIVED_PLACES>> = StaticCell::new();

/// The handler's end of the line.
pub struct Receiver {
    bytes: Producer<'static, u8>,
    sorter: Sorter,
    /// Bytes queued since the start, modulo 2^32.
    count: u32,
}

/// The main loop's end of the line.
pub struct Line {
    bytes: Consumer<'static, u8>,
    /// Bytes taken since the start, modulo 2^32.
    count: u32,
}

/// Both ends.
///
/// # Panics
/// The second time.
pub fn ends() -> (Receiver, Line) {
    let (producer, consumer) = QUEUE.init(Queue::new()).split();
    (
        Receiver { bytes: producer, sorter: Sorter::new(), count: 0 },
        Line { bytes: consumer, count: 0 },
    )
}

impl Receiver {
    /// Takes a byte in; an ordinary one is lost if the queue is full. Called in the handler, and no
    /// handler that could interrupt it does the same.
    pub fn receive(&mut self, byte: u8) {
        if let Some(byte) = self.sort_out(byte)
            && self.append(byte).is_err()
        {
            self.ask(RealTime::BYTES_LOST);
        }
    }

    /// Notes what a real-time byte asks for, and gives an ordinary byte back.
    pub fn sort_out(&mut self, byte: u8) -> Option<u8> {
        match self.sorter.sort(byte) {
            Some(asked) => {
                self.ask(asked);
                None
            }
            None => Some(byte),
        }
    }

    /// Puts an ordinary byte into the queue; gives it back if there is no place.
    pub fn append(&mut self, byte: u8) -> Result<(), u8> {
        self.bytes.enqueue(byte)?;
        self.count = self.count.wrapping_add(1);
        Ok(())
    }

    fn ask(&mut self, asked: RealTime) {
        if asked.has(RealTime::ABORT) {
            COUNT_AT_ABORT.store(self.count, Ordering::Release);
        }
        // The main loop masks the handler while it takes the bits.
        ASKED.store(ASKED.load(Ordering::Relaxed) | asked.to_bits(), Ordering::Release);
    }
}

impl Line {
    /// The next ordinary byte; none while an abort waits to be taken, for the bytes before it are
    /// void.
    pub fn read_byte(&mut self) -> Option<u8> {
        if RealTime::from_bits(ASKED.load(Ordering::Acquire)).has(RealTime::ABORT) {
            return None;
        }
        let byte = self.bytes.dequeue()?;
        self.count = self.count.wrapping_add(1);
        Some(byte)
    }

    /// What was asked in real time since last taken. An abort drops the bytes received before it.
    pub fn take_real_time(&mut self) -> RealTime {
        if ASKED.load(Ordering::Acquire) == 0 {
            return RealTime::default();
        }
        let asked = critical_section::with(|_| {
            let bits = ASKED.load(Ordering::Acquire);
            ASKED.store(0, Ordering::Relaxed);
            RealTime::from_bits(bits)
        });
        if asked.has(RealTime::ABORT) {
            let void = COUNT_AT_ABORT.load(Ordering::Acquire).wrapping_sub(self.count);
            for _ in 0..void {
                self.bytes.dequeue();
                self.count = self.count.wrapping_add(1);
            }
        }
        asked
    }
}
