//! The first serial port: UART0.
//!
//! What is received goes by DMA into a ring in RAM, each byte with its error bits, so that nothing is
//! lost while flash is erased or written and every interrupt is masked. The ring is looked at every
//! millisecond, and so real-time bytes act within about a millisecond. Flash masks interrupts for 400 ms
//! at most, the time of one sector. In that time a sender may send its window, 240 bytes, and the
//! other 784 places are for real-time bytes: two in a millisecond. What is overwritten all the same
//! is noticed by the channels' counts, and marked as lost bytes are.
//!
//! Two DMA channels take turns for ever: each, when its count has run down, starts the other, which goes
//! on at the same place of the ring, because a count is a whole number of rings.
//!
//! What is sent waits in a queue, so that an answer does not keep the main loop from the steps.

use core::sync::atomic::{AtomicU16, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use rp2040_hal::pac::{Interrupt, interrupt};
use static_cell::StaticCell;

use super::ports::{self, Inlets, Port};
use super::registers::{self, DMA, UART0, reset};
use super::{clock, critical, divider};
use crate::boards::handler::Owned;

/// Bytes that wait to be sent, at most; one more place than that, for the queue.
const SENT_PLACES: usize = 1024;

/// Bytes in the ring, each with its error bits.
const RING_PLACES: u32 = 1024;
/// Places that the channel may fill while the ring is looked at.
const MARGIN: u32 = 64;
/// Bytes that a channel takes in before it is the other's turn: whole rings.
const TURN: u32 = 1 << 14;
const _: () = assert!(TURN.is_multiple_of(RING_PLACES));

#[repr(align(2048))] // Its size, or the channels would not find around.
struct Ring([AtomicU16; RING_PLACES as usize]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

static RING: Ring = Ring([const { AtomicU16::new(0) }; RING_PLACES as usize]);

static QUEUE: StaticCell<Queue<u8, SENT_PLACES>> = StaticCell::new();
static SENDER: Owned<Consumer<'static, u8>> = Owned::empty();
/// How many bytes of the ring have been looked at, modulo two turns.
static LOOKED_AT: Owned<u32> = Owned::empty();

/// The channels that receive; that of the steps has the number 0 and goes first.
const CHANNELS: [usize; 2] = [1, 2];

/// Registers of a channel of the direct memory access.
mod channel {
    pub const BYTES: usize = 0x40;
    pub const READ_ADDRESS: usize = 0x00;
    pub const WRITE_ADDRESS: usize = 0x04;
    pub const COUNT: usize = 0x08;
    pub const CONTROL_AND_START: usize = 0x0C;
    pub const CONTROL: usize = 0x10;
    pub const BUSY: u32 = 1 << 24;
    pub const REQUEST_OF_UART0_RECEIVER: u32 = 21 << 15;
    pub const QUIET: u32 = 1 << 21;
    /// Enabled, half-words, writing on around the ring.
    pub const RECEIVE: u32 = 1
        | 1 << 2
        | 1 << 5
        | size_of::<super::Ring>().trailing_zeros() << 6
        | 1 << 10
        | REQUEST_OF_UART0_RECEIVER
        | QUIET;
}

/// The main loop's end of what is sent.
pub struct Sender(Producer<'static, u8>);

/// Readies the port; [`open`] opens it. `ports` is set up, and the steps, who restart the DMA.
pub fn set_up(nvic: &mut NVIC) -> Sender {
    registers::restart(reset::UART0);
    UART0.set_up(clock::HERTZ);
    UART0.receive_by_dma(true);

    let (sent, to_send) = QUEUE.init(Queue::new()).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
    unsafe {
        SENDER.fill(to_send);
        LOOKED_AT.fill(0);
    }
    critical::enable(nvic, Interrupt::UART0_IRQ, critical::SERIAL_PRIORITY);
    Sender(sent)
}

/// Opens the port. Its pins are routed to it: an input that is not would be low, which is a break.
pub fn open() {
    let [first, second] = CHANNELS;
    for (this, next, control) in
        [(second, first, channel::CONTROL), (first, second, channel::CONTROL_AND_START)]
    {
        let registers = channel::BYTES * this;
        DMA.write(registers + channel::READ_ADDRESS, UART0.data_address());
        DMA.write(registers + channel::WRITE_ADDRESS, RING.0.as_ptr() as u32);
        DMA.write(registers + channel::COUNT, TURN);
        DMA.write(registers + control, channel::RECEIVE | (next as u32) << 11);
    }
    UART0.enable();
}

/// Lets the port's handler look at what has been received. Called every millisecond.
pub fn look_soon() {
    NVIC::pend(Interrupt::UART0_IRQ);
}

/// How many bytes have come into the ring since the start, modulo two turns; `None` just while one
/// channel hands over to the other.
fn received() -> Option<u32> {
    let is_busy =
        |number: usize| DMA.read(channel::BYTES * number + channel::CONTROL) & channel::BUSY != 0;
    let (before, number) =
        if is_busy(CHANNELS[0]) { (0, CHANNELS[0]) } else { (TURN, CHANNELS[1]) };
    let left = DMA.read(channel::BYTES * number + channel::COUNT);
    (is_busy(number) && left != 0).then(|| before + TURN - left)
}

/// Takes in what has come into the ring. Called by the port's handler.
fn look(inlets: &mut Inlets) {
    // SAFETY: this is the handler that owns it.
    let Some(looked_at) = (unsafe { LOOKED_AT.get() }) else { return };
    let Some(received) = received() else { return };
    let waiting = received.wrapping_sub(*looked_at) % (2 * TURN);
    if waiting > RING_PLACES - MARGIN {
        *looked_at = received.wrapping_sub(RING_PLACES - MARGIN) % (2 * TURN);
        inlets.lose(Port::Uart);
    }
    while *looked_at != received {
        let data = RING.0[(*looked_at % RING_PLACES) as usize].load(Ordering::Relaxed);
        inlets.take(Port::Uart, |receiver| receiver.receive_from_uart(data.into()));
        *looked_at = (*looked_at + 1) % (2 * TURN);
    }
}

impl Sender {
    /// Whether so many bytes find room at once.
    pub fn has_room(&self, bytes: usize) -> bool {
        self.0.capacity() - self.0.len() >= bytes
    }

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

/// A place in the FIFO of what is sent, or [`look_soon`].
#[interrupt]
fn UART0_IRQ() {
    divider::keep_during(|| {
        UART0.clear_interrupt();
        send();
        // SAFETY: this is a handler that owns it.
        if let Some(inlets) = unsafe { ports::inlets() } {
            look(inlets);
        }
    });
}
