//! What comes over the serial line, whatever the port: ordinary bytes in a queue, real-time ones as
//! flags.
//!
//! Real-time bytes never enter the queue, so that status, hold and abort are seen however full it
//! is. An abort also drops the bytes received before it. A byte that finds the queue full is lost,
//! and a flag says so.
//!
//! Only loads and stores, so a Cortex-M0+ has it too.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};
use penup::protocol::RealTime;
use static_cell::StaticCell;

/// Bytes that wait for the main loop, at most; one more place than that, for the queue.
const RECEIVED_PLACES: usize = 256;

/// The byte ctrl-X.
pub const ABORT: u8 = 0x18;

mod flag {
    pub const STATUS: u8 = 1;
    pub const HOLD: u8 = 2;
    pub const RESUME: u8 = 4;
    pub const ABORT: u8 = 8;
    pub const OVERRUN: u8 = 16;
}
/// The flags seen since last taken.
static FLAGS: AtomicU8 = AtomicU8::new(0);
/// How many bytes had been queued when the last abort came.
static COUNT_AT_ABORT: AtomicU32 = AtomicU32::new(0);

static QUEUE: StaticCell<Queue<u8, RECEIVED_PLACES>> = StaticCell::new();

/// The handler's end of the line.
pub struct Receiver {
    bytes: Producer<'static, u8>,
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
    (Receiver { bytes: producer, count: 0 }, Line { bytes: consumer, count: 0 })
}

impl Receiver {
    /// Takes a byte in. Called in the handler, and no handler that could interrupt it does the same.
    pub fn receive(&mut self, byte: u8) {
        let flag = match byte {
            b'?' => flag::STATUS,
            b'!' => flag::HOLD,
            b'~' => flag::RESUME,
            ABORT => {
                COUNT_AT_ABORT.store(self.count, Ordering::Release);
                flag::ABORT
            }
            _ => {
                if self.bytes.enqueue(byte).is_ok() {
                    self.count = self.count.wrapping_add(1);
                    return;
                }
                flag::OVERRUN
            }
        };
        // The main loop masks the handler while it takes the flags.
        FLAGS.store(FLAGS.load(Ordering::Relaxed) | flag, Ordering::Release);
    }
}

impl Line {
    /// The next ordinary byte; none while an abort waits to be taken, for the bytes before it are
    /// void.
    pub fn read_byte(&mut self) -> Option<u8> {
        if FLAGS.load(Ordering::Acquire) & flag::ABORT != 0 {
            return None;
        }
        let byte = self.bytes.dequeue()?;
        self.count = self.count.wrapping_add(1);
        Some(byte)
    }

    /// What was asked in real time since last taken. An abort drops the bytes received before it.
    pub fn take_real_time(&mut self) -> RealTime {
        if FLAGS.load(Ordering::Acquire) == 0 {
            return RealTime::default();
        }
        let flags = critical_section::with(|_| {
            let flags = FLAGS.load(Ordering::Acquire);
            FLAGS.store(0, Ordering::Relaxed);
            flags
        });
        let abort = flags & flag::ABORT != 0;
        if abort {
            let void = COUNT_AT_ABORT.load(Ordering::Acquire).wrapping_sub(self.count);
            for _ in 0..void {
                self.bytes.dequeue();
                self.count = self.count.wrapping_add(1);
            }
        }
        RealTime {
            status: flags & flag::STATUS != 0,
            hold: flags & flag::HOLD != 0,
            resume: flags & flag::RESUME != 0,
            abort,
            bytes_lost: flags & flag::OVERRUN != 0,
        }
    }
}
