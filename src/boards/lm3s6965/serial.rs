//! The serial line: UART0 at 115200 baud, 8 bits, no parity, one stop bit.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::protocol::RealTime;

use super::registers::{GPIO_A, SYSTEM_CONTROL, UART0};
use super::{HAPPENED, clock, critical};
use crate::boards::handler::Owned;
use crate::boards::line::{self, Receiver};

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

/// When the last `?` came, in cycles modulo 2^24.
static STATUS_ASKED: AtomicU32 = AtomicU32::new(0);

static RECEIVER: Owned<Receiver> = Owned::empty();

/// The main loop's end of the line.
pub struct Line(line::Line);

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

    let (receiver, line) = line::ends();
    // SAFETY: the interrupt is masked since reset, and this runs once (the line's ends see to it).
    unsafe { RECEIVER.fill(receiver) };
    critical::enable(nvic, Interrupt::UART0, critical::SERIAL_PRIORITY);
    UART0.write(offset::CONTROL, ENABLE_BOTH_WAYS);
    Line(line)
}

impl Line {
    /// As [`line::Line::read_byte`].
    pub fn read_byte(&mut self) -> Option<u8> {
        self.0.read_byte()
    }

    /// As [`line::Line::take_real_time`]; logs how long a request for the status has waited.
    pub fn take_real_time(&mut self) -> RealTime {
        let asked = self.0.take_real_time();
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

#[interrupt]
fn UART0() {
    UART0.write(offset::INTERRUPT_CLEAR, RECEIVED | RECEIVE_TIMEOUT);
    // SAFETY: this is the handler that owns it.
    if let Some(receiver) = unsafe { RECEIVER.get() } {
        while let Some(byte) = poll() {
            if byte == b'?' {
                STATUS_ASKED.store(clock::cycles_24(), Ordering::Relaxed);
            }
            receiver.receive(byte);
        }
    }
    HAPPENED.store(true, Ordering::Relaxed);
}
