//! The first serial port: UART0 at 115200 baud, 8 bits, no parity, one stop bit.
//!
//! What is sent waits in a queue, so that an answer does not keep the main loop from the steps.

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use rp2040_hal::pac::{Interrupt, interrupt};
use static_cell::StaticCell;

use super::ports::{self, Port};
use super::registers::{self, UART0, reset};
use super::{clock, critical};
use crate::boards::handler::Owned;

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
const SENT: u32 = 1 << 5;
const RECEIVE_TIMEOUT: u32 = 1 << 6;
const EIGHT_BITS_WITH_FIFO: u32 = 0b111 << 4;
const ENABLE_BOTH_WAYS: u32 = 1 | 1 << 8 | 1 << 9;

/// Bytes that wait to be sent, at most; one more place than that, for the queue.
const SENT_PLACES: usize = 512;

static QUEUE: StaticCell<Queue<u8, SENT_PLACES>> = StaticCell::new();
static SENDER: Owned<Consumer<'static, u8>> = Owned::empty();

/// The main loop's end of what is sent.
pub struct Sender(Producer<'static, u8>);

/// Opens the port. Its pins are those of `pins`, and `ports` is set up.
pub fn set_up(nvic: &mut NVIC) -> Sender {
    registers::restart(reset::UART0);
    // Sixty-fourths of a divider of 16 samples a bit, rounded.
    const DIVIDER: u32 = (clock::HERTZ * 4 + BAUD / 2) / BAUD;
    UART0.write(offset::BAUD_INTEGER, DIVIDER / 64);
    UART0.write(offset::BAUD_FRACTION, DIVIDER % 64);
    UART0.write(offset::LINE_CONTROL, EIGHT_BITS_WITH_FIFO);
    UART0.write(offset::INTERRUPT_MASK, RECEIVED | RECEIVE_TIMEOUT);

    let (sent, to_send) = QUEUE.init(Queue::new()).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe { SENDER.fill(to_send) };
    critical::enable(nvic, Interrupt::UART0_IRQ, critical::SERIAL_PRIORITY);
    UART0.write(offset::CONTROL, ENABLE_BOTH_WAYS);
    Sender(sent)
}

impl Sender {
    /// Sends `bytes`; waits only while the queue is full.
    pub fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let mut rest = self.0.enqueue(byte);
            while let Err(byte) = rest {
                pump();
                rest = self.0.enqueue(byte);
            }
        }
        pump();
    }
}

/// Lets the line's handler send: its interrupt comes only when the FIFO gets emptier.
fn pump() {
    NVIC::mask(Interrupt::UART0_IRQ);
    send();
    // SAFETY: it was unmasked at set-up, before there was a sender.
    unsafe { NVIC::unmask(Interrupt::UART0_IRQ) };
}

/// Fills the FIFO, and asks for an interrupt if more waits. Called by the line's handler, or where it
/// is masked.
fn send() {
    // SAFETY: this is the handler that owns it, or the handler is masked.
    let Some(bytes) = (unsafe { SENDER.get() }) else { return };
    while UART0.read(offset::FLAGS) & SENDER_FULL == 0
        && let Some(byte) = bytes.dequeue()
    {
        UART0.write(offset::DATA, u32::from(byte));
    }
    let more = if bytes.is_empty() { 0 } else { SENT };
    UART0.write(offset::INTERRUPT_MASK, RECEIVED | RECEIVE_TIMEOUT | more);
}

/// Sends `bytes` past the queue: for a fault, when no handler runs.
pub fn write_now(bytes: &[u8]) {
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
    UART0.write(offset::INTERRUPT_CLEAR, RECEIVED | RECEIVE_TIMEOUT | SENT);
    send();
    // SAFETY: this is a handler that owns it.
    if let Some(inlet) = unsafe { ports::inlet() } {
        while let Some(byte) = poll() {
            inlet.receive(Port::Uart, byte);
        }
    }
}
