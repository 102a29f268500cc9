//! The serial line: UART0 at 115200 baud, 8 bits, no parity, one stop bit.

use cortex_m::peripheral::NVIC;
use rp2040_hal::pac::{Interrupt, interrupt};

use super::registers::{self, UART0, reset};
use super::{clock, critical};
use crate::boards::handler::Owned;
use crate::boards::line::{self, Line, Receiver};

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
}
const RECEIVER_EMPTY: u32 = 1 << 4;
const SENDER_FULL: u32 = 1 << 5;
const RECEIVED: u32 = 1 << 4;
const RECEIVE_TIMEOUT: u32 = 1 << 6;
const EIGHT_BITS_WITH_FIFO: u32 = 0b111 << 4;
const ENABLE_BOTH_WAYS: u32 = 1 | 1 << 8 | 1 << 9;

static RECEIVER: Owned<Receiver> = Owned::empty();

/// Opens the line. Its pins are those of `pins`.
pub fn set_up(nvic: &mut NVIC) -> Line {
    registers::restart(reset::UART0);
    // Sixty-fourths of a divider of 16 samples a bit, rounded.
    const DIVIDER: u32 = (clock::HERTZ * 4 + BAUD / 2) / BAUD;
    UART0.write(offset::BAUD_INTEGER, DIVIDER / 64);
    UART0.write(offset::BAUD_FRACTION, DIVIDER % 64);
    UART0.write(offset::LINE_CONTROL, EIGHT_BITS_WITH_FIFO);
    UART0.write(offset::INTERRUPT_MASK, RECEIVED | RECEIVE_TIMEOUT);

    let (receiver, line) = line::ends();
    // SAFETY: the interrupt is masked since reset, and this runs once (the line's ends see to it).
    unsafe { RECEIVER.fill(receiver) };
    critical::enable(nvic, Interrupt::UART0_IRQ, critical::SERIAL_PRIORITY);
    UART0.write(offset::CONTROL, ENABLE_BOTH_WAYS);
    line
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
fn UART0_IRQ() {
    UART0.write(offset::INTERRUPT_CLEAR, RECEIVED | RECEIVE_TIMEOUT);
    // SAFETY: this is the handler that owns it.
    if let Some(receiver) = unsafe { RECEIVER.get() } {
        while let Some(byte) = poll() {
            receiver.receive(byte);
        }
    }
}
