//! The UART of both chips, Arm's PrimeCell PL011: 115200 baud, 8 bits, no parity, one stop bit,
//! with FIFOs in both directions.

use super::peripheral::Peripheral;

/// The speed of the serial line, in bits per second.
const BAUD: u32 = 115_200;

/// The registers that are used here, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register to which a byte to send is written, and from which a received byte is read with
    /// its error bits.
    pub const DATA: Offset = Offset::new(0x000);
    /// The register whose bits say whether the FIFOs (the queues of received bytes and of those to
    /// send) are empty or full.
    pub const FLAGS: Offset = Offset::new(0x018);
    /// The register of the whole part of the divider that gives the baud rate.
    pub const BAUD_INTEGER: Offset = Offset::new(0x024);
    /// The register of the fraction of the divider that gives the baud rate, in 64ths.
    pub const BAUD_FRACTION: Offset = Offset::new(0x028);
    /// The register that says how many bits a byte has, and whether the FIFOs are in use.
    pub const LINE_CONTROL: Offset = Offset::new(0x02C);
    /// The register that switches the UART, its sender and its receiver on.
    pub const CONTROL: Offset = Offset::new(0x030);
    /// The register that says, by one bit for each event, which events cause an interrupt.
    pub const INTERRUPT_MASK: Offset = Offset::new(0x038);
    /// The register that clears the interrupt of an event when the event's bit is written to it.
    pub const INTERRUPT_CLEAR: Offset = Offset::new(0x044);
    /// The register that says whether DMA is asked to fetch received bytes.
    pub const DMA: Offset = Offset::new(0x048);
}
/// The bit of [`offset::FLAGS`] that says that bytes wait to be sent, or that the last bit of one,
/// its stop bit, is not out yet.
const BUSY: u32 = 1 << 3;
/// The bit of [`offset::FLAGS`] that says that no received byte waits.
const RECEIVER_EMPTY: u32 = 1 << 4;
/// The bit of [`offset::FLAGS`] that says that the sender's FIFO has no room.
const SENDER_FULL: u32 = 1 << 5;
/// The bit of the event that enough received bytes wait.
const RECEIVED: u32 = 1 << 4;
/// The bit of the event that the sender's FIFO gets emptier.
const SENT: u32 = 1 << 5;
/// The bit of the event that received bytes wait and no more have come for a while.
const RECEIVE_TIMEOUT: u32 = 1 << 6;
/// The bits of [`offset::LINE_CONTROL`] for bytes of 8 bits without parity, and with FIFOs.
const EIGHT_BITS_WITH_FIFO: u32 = 0b111 << 4;
/// The bits of [`offset::CONTROL`] that switch the UART, its sender and its receiver on.
const ENABLE_BOTH_WAYS: u32 = 1 | 1 << 8 | 1 << 9;

/// A UART of the chip, given by its registers.
#[derive(Clone, Copy)]
pub struct Uart(pub Peripheral);

impl Uart {
    /// Configures the UART for a clock of `hertz`. No interrupt is enabled yet.
    #[inline(always)]
    pub fn set_up(self, hertz: u32) {
        // The divider counts sixty-fourths of 16 samples per bit, rounded.
        let divider = (hertz * 4 + BAUD / 2) / BAUD;
        self.0.write(offset::CONTROL, 0);
        self.0.write(offset::BAUD_INTEGER, divider / 64);
        self.0.write(offset::BAUD_FRACTION, divider % 64);
        self.0.write(offset::LINE_CONTROL, EIGHT_BITS_WITH_FIFO);
        self.0.write(offset::INTERRUPT_MASK, 0);
    }

    /// Enables sending and receiving.
    pub fn enable(self) {
        self.0.write(offset::CONTROL, ENABLE_BOTH_WAYS);
    }

    /// Whether the FIFO of the sender has room for a byte.
    pub fn has_place(self) -> bool {
        self.0.read(offset::FLAGS) & SENDER_FULL == 0
    }

    /// Sends a byte. The FIFO must have room for it.
    pub fn put(self, byte: u8) {
        self.0.write(offset::DATA, u32::from(byte));
    }

    /// Sends `bytes`. It returns when the last byte is in the FIFO.
    pub fn write(self, bytes: &[u8]) {
        for &byte in bytes {
            while !self.has_place() {}
            self.put(byte);
        }
    }

    /// Waits until all bytes have left the chip, the stop bit of the last one included.
    pub fn flush(self) {
        while self.0.read(offset::FLAGS) & BUSY != 0 {}
    }

    /// Reads a byte with its error bits directly from the receiver, as
    /// [`penup::protocol::Receiver::receive_from_uart`] takes them.
    pub fn poll(self) -> Option<u32> {
        let empty = self.0.read(offset::FLAGS) & RECEIVER_EMPTY != 0;
        (!empty).then(|| self.0.read(offset::DATA))
    }

    /// Enables the interrupt for received bytes.
    pub fn interrupt_when_received(self) {
        self.0.write(offset::INTERRUPT_MASK, RECEIVED | RECEIVE_TIMEOUT);
    }

    /// Enables or disables the interrupt that comes when the FIFO of the sender gets emptier.
    /// Received bytes cause no interrupt.
    pub fn interrupt_when_sent(self, interrupts: bool) {
        self.0.write(offset::INTERRUPT_MASK, if interrupts { SENT } else { 0 });
    }

    /// Sets whether DMA fetches the received bytes, whatever errors they have. Otherwise
    /// [`Uart::poll`] returns them.
    pub fn receive_by_dma(self, by_dma: bool) {
        self.0.write(offset::DMA, u32::from(by_dma));
    }

    /// The address at which a DMA channel reads the next received byte with its error bits, as a
    /// half-word.
    pub const fn data_address(self) -> u32 {
        self.0.address(offset::DATA)
    }

    /// Clears the interrupt in its handler.
    pub fn clear_interrupt(self) {
        self.0.write(offset::INTERRUPT_CLEAR, RECEIVED | RECEIVE_TIMEOUT | SENT);
    }
}
