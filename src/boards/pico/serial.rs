//! The first serial port: UART0.
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

/// Bytes that wait to be sent, at most; one more place than that, for the queue.
const SENT_PLACES: usize = 512;

static QUEUE: StaticCell<Queue<u8, SENT_PLACES>> = StaticCell::new();
static SENDER: Owned<Consumer<'static, u8>> = Owned::empty();

/// The main loop's end of what is sent.
pub struct Sender(Producer<'static, u8>);

/// Opens the port. Its pins are those of `pins`, and `ports` is set up.
pub fn set_up(nvic: &mut NVIC) -> Sender {
    registers::restart(reset::UART0);
    UART0.set_up(clock::HERTZ);

    let (sent, to_send) = QUEUE.init(Queue::new()).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe { SENDER.fill(to_send) };
    critical::enable(nvic, Interrupt::UART0_IRQ, critical::SERIAL_PRIORITY);
    UART0.enable();
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
    while UART0.has_place()
        && let Some(byte) = bytes.dequeue()
    {
        UART0.put(byte);
    }
    UART0.interrupt_when_sent(!bytes.is_empty());
}

#[interrupt]
fn UART0_IRQ() {
    UART0.clear_interrupt();
    send();
    // SAFETY: this is a handler that owns it.
    if let Some(inlet) = unsafe { ports::inlet() } {
        while let Some(byte) = UART0.poll() {
            inlet.receive(Port::Uart, byte);
        }
    }
}
