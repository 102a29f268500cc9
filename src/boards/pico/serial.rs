//! The first serial port: UART0.
//!
//! Received bytes are written by DMA into a ring buffer in RAM, each with its error bits. So
//! nothing is lost while flash is erased or written and every interrupt is masked. The ring is read
//! every millisecond, so real-time bytes act within about a millisecond. Flash operations mask
//! interrupts for at most 400 ms, the time of one sector. In that time a sender may send its window
//! of 240 bytes, and the other 784 slots are for real-time bytes: two per millisecond. If bytes are
//! overwritten nevertheless, this is detected by the counts of the channels and marked like lost
//! bytes.
//!
//! Two DMA channels take turns forever. When the count of one has run down, it starts the other,
//! which continues at the same position of the ring, because a count is a whole number of rings.
//!
//! Sent bytes wait in a queue, so that a reply does not delay the main loop's work for the steps.

use core::sync::atomic::{AtomicU16, Ordering};

use cortex_m::peripheral::NVIC;
use penup::byte_queue::{ByteQueue, Consumer, Producer};
use rp2040_hal::pac::dma::CH;
use rp2040_hal::pac::{Interrupt, interrupt};
use static_cell::StaticCell;

use super::ports::{self, Port, ReceiveSide};
use super::registers::{self, DMA, Get, Put, UART0, reset};
use super::{clock, critical, divider};
use crate::boards::fault::once;
use crate::boards::handler::Owned;

/// The number of slots in the queue of bytes to send, one of which stays empty.
const SENT_SLOTS: usize = 1024;

/// The number of bytes in the ring, each with its error bits.
const RING_SLOTS: u32 = 1024;
/// The number of slots that the channel may fill while the ring is read.
const MARGIN: u32 = 64;
/// The number of bytes that a channel receives in its turn; a multiple of the ring.
const TURN: u32 = 1 << 14;
const _: () = assert!(TURN.is_multiple_of(RING_SLOTS));

/// The memory into which DMA writes received bytes, in turn from its beginning to its end.
#[repr(align(2048))] // The channels wrap around only if the ring is aligned to its size.
struct Ring([AtomicU16; RING_SLOTS as usize]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

/// The ring of received bytes.
static RING: Ring = Ring([const { AtomicU16::new(0) }; RING_SLOTS as usize]);

/// The queue of bytes to send.
static QUEUE: StaticCell<ByteQueue<SENT_SLOTS>> = StaticCell::new();
/// The handler's end of the queue of bytes to send.
static SENDER: Owned<Consumer<'static>> = Owned::empty();
/// The number of bytes of the ring that have been read, modulo two turns.
static READ_COUNT: Owned<u32> = Owned::empty();

/// The channels that receive. The channel of the steps has number 0 and takes precedence.
const CHANNELS: [usize; 2] = [1, 2];

/// Bits of the control register of a DMA channel.
mod control {
    /// The channel is transferring, or has still to.
    pub const BUSY: u32 = 1 << 24;
    /// The channel waits for the UART's receiver before each byte.
    const REQUEST_OF_UART0_RECEIVER: u32 = 21 << 15;
    /// The channel causes no interrupt when its count has run down.
    const QUIET: u32 = 1 << 21;
    /// Enabled, half-words, writing around the ring; then the channel `next` goes on.
    pub const fn receive_before(next: usize) -> u32 {
        let ring = size_of::<super::Ring>().trailing_zeros() << 6 | 1 << 10;
        1 | 1 << 2 | 1 << 5 | ring | (next as u32) << 11 | REQUEST_OF_UART0_RECEIVER | QUIET
    }
}

/// Sends bytes by UART0: the main loop's side of the queue of bytes to send.
pub struct Sender(Producer<'static>);

/// Sets up the port; [`open`] opens it. Both `ports` and `steps` must be set up before, because
/// `steps` resets the DMA.
pub fn set_up(nvic: &mut NVIC) -> Sender {
    registers::restart(reset::UART0);
    UART0.set_up(clock::HERTZ);
    UART0.receive_by_dma(true);

    let (sent, to_send) = once(QUEUE.try_init(ByteQueue::new())).split();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell ensures
    // it).
    unsafe {
        SENDER.fill(to_send);
        READ_COUNT.fill(0);
    }
    critical::enable(nvic, Interrupt::UART0_IRQ, critical::SERIAL_PRIORITY);
    Sender(sent)
}

/// Opens the port. Its pins must be connected to it before: an unconnected input would be low,
/// which is a break.
pub fn open() {
    let [first, second] = CHANNELS;
    // SAFETY: the channels read the data register of the UART, and write to the ring of atomics.
    let dma = unsafe { DMA.registers() };
    let set_up = |channel: &CH| {
        channel.ch_read_addr().put(UART0.data_address());
        channel.ch_write_addr().put(RING.0.as_ptr() as u32);
        channel.ch_trans_count().put(TURN);
    };
    set_up(dma.ch(second));
    dma.ch(second).ch_al1_ctrl().put(control::receive_before(first));
    // Writing this register starts the channel.
    set_up(dma.ch(first));
    dma.ch(first).ch_ctrl_trig().put(control::receive_before(second));
    UART0.enable();
}

/// Has the serial port's interrupt handler read the bytes that were received, and send what waits.
/// It is called every millisecond.
pub fn request_read() {
    NVIC::pend(Interrupt::UART0_IRQ);
}

/// The number of bytes that have been written to the ring since the start, modulo two turns; `None`
/// while one channel hands over to the other.
fn received() -> Option<u32> {
    // SAFETY: its registers are only read.
    let dma = unsafe { DMA.registers() };
    let is_busy = |number: usize| dma.ch(number).ch_al1_ctrl().get() & control::BUSY != 0;
    let (before, number) =
        if is_busy(CHANNELS[0]) { (0, CHANNELS[0]) } else { (TURN, CHANNELS[1]) };
    let left = dma.ch(number).ch_trans_count().get();
    (is_busy(number) && left != 0).then(|| before + TURN - left)
}

/// Reads what has been written to the ring. It is called by the port's handler.
fn read_ring(receive_side: &mut ReceiveSide) {
    // SAFETY: this is the handler that owns it.
    let Some(read_count) = (unsafe { READ_COUNT.get() }) else { return };
    let Some(received) = received() else { return };
    let waiting = received.wrapping_sub(*read_count) % (2 * TURN);
    if waiting > RING_SLOTS - MARGIN {
        *read_count = received.wrapping_sub(RING_SLOTS - MARGIN) % (2 * TURN);
        receive_side.lose(Port::Uart);
    }
    while *read_count != received {
        let data = RING.0[(*read_count % RING_SLOTS) as usize].load(Ordering::Relaxed);
        receive_side.take(Port::Uart, |receiver| receiver.receive_from_uart(data.into()));
        *read_count = (*read_count + 1) % (2 * TURN);
    }
}

impl Sender {
    /// Whether there is room at once for this many bytes.
    pub fn has_room(&self, bytes: usize) -> bool {
        self.0.room() >= bytes
    }

    /// Sends `bytes`. It waits only while the queue is full.
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

/// Sends from the main loop, because the interrupt comes only when the FIFO gets emptier.
fn pump() {
    NVIC::mask(Interrupt::UART0_IRQ);
    send();
    // SAFETY: it was unmasked at set-up, before there was a sender.
    unsafe { NVIC::unmask(Interrupt::UART0_IRQ) };
}

/// Fills the FIFO, and requests an interrupt if more bytes wait. It is called by the port's
/// handler, or where the handler is masked.
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

/// The interrupt for room in the sender's FIFO, and for [`request_read`].
#[interrupt]
fn UART0_IRQ() {
    divider::keep_during(|| {
        UART0.clear_interrupt();
        send();
        // SAFETY: this is a handler that owns it.
        if let Some(receive_side) = unsafe { ports::receive_side() } {
            read_ring(receive_side);
        }
    });
}
