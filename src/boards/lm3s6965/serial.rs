//! The serial line: UART0 at 115200 baud, 8 bits, no parity, one stop bit.
//!
//! The interrupt puts ordinary bytes into a queue. Real-time bytes never enter it: they set flags,
//! so that status, hold and abort are seen however full the queue is. An abort also drops the bytes
//! received before it. A byte that finds the queue full is lost, and a flag says so.

use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use lm3s6965::{Interrupt, interrupt};
use penup::protocol::{RealTime, Sorter};
use static_cell::StaticCell;

use super::handler::Owned;
use super::registers::{GPIO_A, SYSTEM_CONTROL, UART0};
use super::{HAPPENED, clock, critical};

/// Bytes that wait for the main loop, at most; one more place than that, for the queue.
const RECEIVED_PLACES: usize = 256;

/// The byte ctrl-X.
pub const ABORT: u8 = 0x18;

const BAUD: u32 = 115_200;

mod offset {
    pub const DATA: usize = 0x000;
    pub const FLAGS: usize = 0x018;
    pub const BAUD_INTEGER: usize = 0x024;
    pub const BAUD_FRACTION: usize = 0x028;
    pub const LINE_CONTROL: usize = 0x02C;
    pub const CONTROL: usize = 0x030;
    pub const INTERRUPT_MASK: usize = 0x038;
    pub const INTERRUPT_CLEAR: usize = 0x044;
    /// In system control.
    pub const UART_CLOCKS: usize = 0x104;
    /// In system control.
    pub const GPIO_CLOCKS: usize = 0x108;
    /// In port A.
    pub const ALTERNATE_FUNCTION: usize = 0x420;
    /// In port A.
    pub const DIGITAL_ENABLE: usize = 0x51C;
}
const RECEIVER_EMPTY: u32 = 1 << 4;
const SENDER_FULL: u32 = 1 << 5;
const RECEIVED: u32 = 1 << 4;
const RECEIVE_TIMEOUT: u32 = 1 << 6;
const EIGHT_BITS_WITH_FIFO: u32 = 0b111 << 4;
const ENABLE_BOTH_WAYS: u32 = 1 | 1 << 8 | 1 << 9;
const SERIAL_PINS: u32 = 0b11;

/// What was asked in real time since last taken, as bits.
static ASKED: AtomicU16 = AtomicU16::new(0);
/// When the last `?` came, in cycles modulo 2^24.
static STATUS_ASKED: AtomicU32 = AtomicU32::new(0);
/// How many bytes had been queued when the last abort came.
static COUNT_AT_ABORT: AtomicU32 = AtomicU32::new(0);

static QUEUE: StaticCell<Queue<u8, RECEIVED_PLACES>> = StaticCell::new();
static RECEIVER: Owned<Receiver> = Owned::empty();

/// The handler's end of the line.
struct Receiver {
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

/// Opens the line.
pub fn set_up(nvic: &mut NVIC) -> Line {
    SYSTEM_CONTROL.set_bits(offset::UART_CLOCKS, 1);
    SYSTEM_CONTROL.set_bits(offset::GPIO_CLOCKS, 1);
    // The port answers three cycles after its clock is on; a read takes longer.
    SYSTEM_CONTROL.read(offset::GPIO_CLOCKS);
    GPIO_A.set_bits(offset::ALTERNATE_FUNCTION, SERIAL_PINS);
    GPIO_A.set_bits(offset::DIGITAL_ENABLE, SERIAL_PINS);

    // Sixty-fourths of a divider of 16 samples a bit, rounded.
    const DIVIDER: u32 = (clock::HERTZ * 4 + BAUD / 2) / BAUD;
    UART0.write(offset::CONTROL, 0);
    UART0.write(offset::BAUD_INTEGER, DIVIDER / 64);
    UART0.write(offset::BAUD_FRACTION, DIVIDER % 64);
    UART0.write(offset::LINE_CONTROL, EIGHT_BITS_WITH_FIFO);
    UART0.write(offset::INTERRUPT_MASK, RECEIVED | RECEIVE_TIMEOUT);

    let (producer, consumer) = QUEUE.init(Queue::new()).split();
    let receiver = Receiver { bytes: producer, sorter: Sorter::new(), count: 0 };
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe { RECEIVER.fill(receiver) };
    critical::enable(nvic, Interrupt::UART0, critical::SERIAL_PRIORITY);
    UART0.write(offset::CONTROL, ENABLE_BOTH_WAYS);
    Line { bytes: consumer, count: 0 }
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
        let asked = RealTime::from_bits(ASKED.swap(0, Ordering::AcqRel));
        if asked.has(RealTime::ABORT) {
            let void = COUNT_AT_ABORT.load(Ordering::Acquire).wrapping_sub(self.count);
            for _ in 0..void {
                self.bytes.dequeue();
                self.count = self.count.wrapping_add(1);
            }
        }
        if asked.has(RealTime::STATUS) {
            let waited = clock::cycles_24().wrapping_sub(STATUS_ASKED.load(Ordering::Relaxed));
            let microseconds = (waited & clock::CYCLE_MASK) / (clock::HERTZ / 1_000_000);
            defmt::debug!("status after {=u32} us", microseconds);
        }
        asked
    }
}

/// Sends `bytes`; returns when the last is in the sender's FIFO.
pub fn write(bytes: &[u8]) {
    for &byte in bytes {
        while UART0.read(offset::FLAGS) & SENDER_FULL != 0 {}
        UART0.write(offset::DATA, u32::from(byte));
    }
}

/// A byte straight from the receiver: for the handler, and for a fault, when no handler runs.
pub fn poll() -> Option<u8> {
    let empty = UART0.read(offset::FLAGS) & RECEIVER_EMPTY != 0;
    (!empty).then(|| (UART0.read(offset::DATA) & 0xFF) as u8)
}

impl Receiver {
    fn receive(&mut self, byte: u8) {
        let asked = match self.sorter.sort(byte) {
            Some(asked) => asked,
            None if self.bytes.enqueue(byte).is_ok() => {
                self.count = self.count.wrapping_add(1);
                return;
            }
            None => RealTime::BYTES_LOST,
        };
        if asked.has(RealTime::STATUS) {
            STATUS_ASKED.store(clock::cycles_24(), Ordering::Relaxed);
        }
        if asked.has(RealTime::ABORT) {
            COUNT_AT_ABORT.store(self.count, Ordering::Release);
        }
        ASKED.fetch_or(asked.to_bits(), Ordering::AcqRel);
    }
}

#[interrupt]
fn UART0() {
    UART0.write(offset::INTERRUPT_CLEAR, RECEIVED | RECEIVE_TIMEOUT);
    // SAFETY: this is the handler that owns it.
    if let Some(receiver) = unsafe { RECEIVER.get() } {
        while let Some(byte) = poll() {
            receiver.receive(byte);
        }
    }
    HAPPENED.store(true, Ordering::Relaxed);
}
