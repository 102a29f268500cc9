//! The buffers of the endpoints, which program and controller share.
//!
//! Each endpoint has one buffer in the controller's memory, with a control word: see
//! [`control_word`]. While its bit AVAILABLE is set the buffer belongs to the controller. The
//! controller runs on another clock, so this bit must be set some cycles after the others (data
//! sheet, section 4.1.2.5.1): see [`Buffers::give`].

use super::{Controller, Register};

/// The buffer of endpoint 0 whose packets the host takes.
pub const FROM_0: usize = 0;
/// The buffer of endpoint 0 that the host fills.
pub const TO_0: usize = 1;
/// The buffer of notices of the port to the host.
pub const NOTICES: usize = 2;
/// The buffer that the host fills with bytes for the port.
pub const TO_PORT: usize = 3;
/// The buffer of bytes from the port, which the host takes.
pub const FROM_PORT: usize = 4;

/// Bits of the control word of an endpoint's buffer (section 4.1.2.5.3).
pub mod control_word {
    /// The number of bytes in the packet, or those for which there is room.
    pub const LENGTH: u32 = 0x3FF;
    /// The controller has the buffer: the host may take its packet, or fill it with one.
    pub const AVAILABLE: u32 = 1 << 10;
    /// The endpoint refuses packets.
    pub const STALL: u32 = 1 << 11;
    /// The packet is one of the odd ones (DATA1). Even and odd packets alternate, so that a
    /// repeated one is noticed.
    pub const IS_DATA_1: u32 = 1 << 13;
    /// The buffer holds a packet.
    pub const FULL: u32 = 1 << 15;
}

/// In the interrupts: a request of the host's was received.
pub const SETUP_REQ: u32 = 1 << 16;
/// In EP_STALL_ARM: both directions of endpoint 0.
const BOTH_DIRECTIONS: u32 = 0b11;

/// The word of the memory at which the control words of the buffers begin.
const CONTROL_WORDS: usize = 0x80 / 4;
/// The cycles of the core in which the controller sees what was written: one cycle of its clock of
/// 48 MHz is 2.6 of the core's. The Pico SDK waits as long.
const SETTLING: u32 = 12;

/// The number of the buffer of an endpoint, below 32. `address` is a `bEndpointAddress` (USB 2.0,
/// section 9.6.6): the number of the endpoint, and bit 7 if the host takes its packets.
pub fn buffer_of(address: u8) -> usize {
    2 * usize::from(address & 0xF) + usize::from(address & 0x80 == 0)
}

/// The buffers of a controller.
#[derive(Clone)]
pub struct Buffers<C>(pub C);

impl<C: Controller> Buffers<C> {
    /// The buffers that the host has taken or filled, one bit for each, since it was cleared.
    pub fn finished(&self) -> u32 {
        self.0.get(Register::BuffStatus)
    }

    /// Clears these bits.
    pub fn clear_finished(&self, bits: u32) {
        self.0.put(Register::BuffStatus, bits);
    }

    /// Whether the host has made a request that was not read.
    pub fn has_setup(&self) -> bool {
        self.0.get(Register::Intr) & SETUP_REQ != 0
    }

    /// The two words of the host's last request.
    pub fn setup(&self) -> [u32; 2] {
        [self.0.word(0), self.0.word(1)]
    }

    /// The control word of a buffer.
    pub fn control(&self, buffer: usize) -> u32 {
        self.0.word(CONTROL_WORDS + buffer)
    }

    /// Writes the control word of a buffer, which the controller does not have afterwards.
    pub fn keep(&self, buffer: usize, word: u32) {
        let kept = word & !control_word::AVAILABLE;
        self.0.put_word(CONTROL_WORDS + buffer, kept);
    }

    /// Writes the control word of a buffer, and gives the controller the buffer.
    pub fn give(&self, buffer: usize, word: u32) {
        self.keep(buffer, word);
        self.0.delay(SETTLING);
        self.0.put_word(CONTROL_WORDS + buffer, word | control_word::AVAILABLE);
    }

    /// Sets or clears the bit STALL or DATA1 of a buffer's control word, whoever has the buffer.
    /// The host must not exchange a packet with the endpoint meanwhile. A buffer that the
    /// controller has is not taken back for it, because by erratum E15 it could not be given again
    /// at once.
    pub fn set_bit(&self, buffer: usize, bit: u32, is_set: bool) {
        let word = self.control(buffer) & !bit;
        self.0.put_word(CONTROL_WORDS + buffer, if is_set { word | bit } else { word });
    }

    /// Lets endpoint 0 refuse what the host sends or asks for, where its control words say so,
    /// until the next request. The controller ends that by itself.
    pub fn arm_stall(&self) {
        self.0.put(Register::EpStallArm, BOTH_DIRECTIONS);
    }
}
