//! The driver of the USB controller: packets and requests in both directions.
//!
//! The endpoints are those of a serial port, and are constants.

use super::buffers::{Buffers, FROM_0, FROM_PORT, NOTICES, SETUP_REQ, TO_0, TO_PORT, control_word};
use super::endpoints::MOST_DATA;
use super::{Controller, Register};

/// The greatest packet of every endpoint but that of notices, in bytes.
pub const PACKET: usize = 64;
/// The greatest notice of the port to the host, in bytes. None is ever sent.
pub const NOTICE: usize = 8;
/// The number of endpoints in each direction that have buffers.
const ENDPOINTS: usize = 3;

/// Bits of the control word of an endpoint (section 4.1.2.5.2). Endpoint 0 has none.
mod endpoint_word {
    /// The endpoint answers the host.
    pub const ENABLED: u32 = 1 << 31;
    /// Each buffer that the host has taken or filled is reported.
    pub const INTERRUPT_PER_BUFFER: u32 = 1 << 29;
    /// The endpoint's packets are a stream of bytes.
    pub const BULK: u32 = 2 << 26;
    /// The host asks for the endpoint's packets at intervals.
    pub const INTERRUPT: u32 = 3 << 26;
}

/// Bits of the registers.
mod bits {
    /// In MAIN_CTRL: the controller is on, as a device.
    pub const CONTROLLER_EN: u32 = 1;
    /// In SIE_CTRL: D+ is pulled up, which shows the host a device.
    pub const PULLUP_EN: u32 = 1 << 16;
    /// In SIE_CTRL: each buffer of endpoint 0 that the host has taken or filled is reported.
    pub const EP0_INT_1BUF: u32 = 1 << 29;
    /// In SIE_STATUS: a request of the host's was received.
    pub const SETUP_REC: u32 = 1 << 17;
    /// In SIE_STATUS: the host resets the bus.
    pub const BUS_RESET: u32 = 1 << 19;
    /// In USB_MUXING: the controller is connected to the wires, and the program says when it shows
    /// itself to the host.
    pub const TO_PHY_SOFTCON: u32 = 1 | 1 << 3;
    /// In USB_PWR: the bus has power, whatever a pin says.
    pub const VBUS_DETECT_OVERRIDE: u32 = 1 << 2 | 1 << 3;
    /// In the interrupts: a buffer was taken or filled.
    pub const BUFF_STATUS: u32 = 1 << 4;
    /// In the interrupts: the host resets the bus.
    pub const BUS_RESET_INT: u32 = 1 << 12;
}

/// The bits of all buffers.
const ALL_BUFFERS: u32 = (1 << (2 * ENDPOINTS)) - 1;
/// The bits of those that the host takes.
const ALL_TAKEN: u32 = 0x5555_5555;
/// The words of the memory before the buffers.
const BUFFERS: usize = 0x100 / 4;
/// The first word of the memory behind the buffers.
const END: usize = BUFFERS + 2 * ENDPOINTS * PACKET / 4;

/// What has happened on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The host resets the bus.
    Reset,
    /// Packets were exchanged, or none.
    Packets {
        /// Whether the host has made a request, which [`Bus::read_setup`] is to read.
        has_setup: bool,
        /// The buffers that the host has taken or filled, one bit for each.
        finished: u32,
    },
}

/// Why a packet was not read or written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PacketError {
    /// There is no packet to read, or the controller still has the last one that was written.
    WouldBlock,
    /// There is not so much room.
    Overflow,
}

/// The greatest packet of a buffer; 0 if there is no such buffer.
const fn greatest(buffer: usize) -> usize {
    match buffer {
        FROM_0 | TO_0 | TO_PORT | FROM_PORT => PACKET,
        NOTICES => NOTICE,
        _ => 0,
    }
}

/// The word of the memory at which a buffer begins. Those of endpoint 0 are one.
const fn place(buffer: usize) -> usize {
    let index = if buffer == TO_0 { FROM_0 } else { buffer };
    BUFFERS + index * PACKET / 4
}

/// The bus, as this driver sees it. All its state is in the controller.
pub struct Bus<C> {
    buffers: Buffers<C>,
}

impl<C: Controller> Bus<C> {
    /// Makes the driver of a controller that was just reset. [`Bus::connect`] switches it on.
    pub const fn new(controller: C) -> Self {
        Self { buffers: Buffers(controller) }
    }

    /// The buffers of the endpoints.
    pub fn buffers(&self) -> &Buffers<C> {
        &self.buffers
    }

    /// The controller.
    pub fn controller(&self) -> &C {
        &self.buffers.0
    }

    /// Switches the controller on and shows the device to the host, which then resets the bus.
    pub fn connect(&self) {
        use Register::{Inte, MainCtrl, SieCtrl, UsbMuxing, UsbPwr};
        let controller = self.controller();
        // Memory holds anything when the power comes.
        for index in 0..END {
            controller.put_word(index, 0);
        }
        self.begin_endpoints();
        controller.put(UsbMuxing, bits::TO_PHY_SOFTCON);
        controller.put(UsbPwr, bits::VBUS_DETECT_OVERRIDE);
        controller.put(MainCtrl, bits::CONTROLLER_EN);
        controller.put(Inte, bits::BUFF_STATUS | bits::BUS_RESET_INT | SETUP_REQ);
        controller.put(SieCtrl, bits::EP0_INT_1BUF | bits::PULLUP_EN);
    }

    /// Looks what has happened on the bus since the last call. That the host suspends or resumes
    /// the bus is not seen: nothing depends on it.
    pub fn look(&self) -> Event {
        let due = self.controller().get(Register::Intr);
        if due & bits::BUS_RESET_INT != 0 {
            return Event::Reset;
        }
        let finished = self.buffers.finished() & ALL_BUFFERS;
        // That a packet was taken is reported once; that one was received, until it is read.
        self.buffers.clear_finished(finished & ALL_TAKEN);
        let has_setup = due & SETUP_REQ != 0;
        if has_setup {
            // What endpoint 0 holds answers a request that the host has broken off.
            self.buffers.keep(FROM_0, self.buffers.control(FROM_0));
        }
        Event::Packets { has_setup, finished }
    }

    /// Empties all buffers, and makes the endpoints ready for a host.
    fn begin_endpoints(&self) {
        use control_word::IS_DATA_1;
        use endpoint_word::{BULK, INTERRUPT};
        for buffer in [FROM_0, TO_0] {
            self.buffers.keep(buffer, 0);
        }
        for (buffer, kind) in [(NOTICES, INTERRUPT), (TO_PORT, BULK), (FROM_PORT, BULK)] {
            let word = endpoint_word::ENABLED | endpoint_word::INTERRUPT_PER_BUFFER | kind;
            // The two control words of an endpoint lie where its buffers are counted.
            self.controller().put_word(buffer, word | (4 * place(buffer)) as u32);
            self.buffers.keep(buffer, IS_DATA_1); // The first packet flips it.
        }
        self.buffers.clear_finished(u32::MAX);
        self.buffers.give(TO_PORT, PACKET as u32);
    }

    /// Begins anew behind a reset of the bus: without an address, and with empty buffers.
    pub fn reset(&self) {
        self.controller().put(Register::SieStatus, bits::BUS_RESET);
        // A request to an address was made before the reset. One to address 0 may have come after
        // it: the host waits only ten milliseconds, and work on the flash lasts longer.
        if self.controller().get(Register::AddrEndp) != 0 {
            self.controller().put(Register::SieStatus, bits::SETUP_REC);
            self.controller().put(Register::AddrEndp, 0);
        }
        self.begin_endpoints();
    }

    /// Lets the device answer to this address.
    pub fn set_address(&self, address: u8) {
        self.controller().put(Register::AddrEndp, u32::from(address & 0x7F));
    }

    /// Reads the host's request, and makes endpoint 0 ready for what follows it: packets that begin
    /// with DATA1. A halt of endpoint 0 ends. Returns `None` if another request came while this one
    /// was read. It will be reported.
    pub fn read_setup(&self) -> Option<[u8; 8]> {
        self.controller().put(Register::SieStatus, bits::SETUP_REC);
        let [low, high] = self.buffers.setup();
        if self.buffers.setup() != [low, high] {
            return None;
        }
        // The first packet to the host flips the data toggle.
        self.buffers.keep(FROM_0, 0);
        self.buffers.clear_finished(1 << TO_0);
        let (is_from_device, length) = (low & 0x80 != 0, high >> 16);
        if is_from_device {
            // The host confirms what it gets, by an empty packet. There is no room for others,
            // because the answer lies in the same memory.
            self.buffers.give(TO_0, control_word::IS_DATA_1);
        } else if (1..=MOST_DATA as u32).contains(&length) {
            self.buffers.give(TO_0, control_word::IS_DATA_1 | PACKET as u32);
        } else {
            // There are no data, or they will be refused.
            self.buffers.keep(TO_0, control_word::IS_DATA_1);
        }
        Some((u64::from(high) << 32 | u64::from(low)).to_le_bytes())
    }

    /// Reads a packet, gives the controller the buffer again, and returns the number of bytes.
    ///
    /// # Errors
    /// There is no packet, or less room than it needs. Then it is still there.
    pub fn read(&self, buffer: usize, into: &mut [u8]) -> Result<usize, PacketError> {
        use control_word::{AVAILABLE, FULL, IS_DATA_1, LENGTH, STALL};
        let word = self.buffers.control(buffer);
        if word & FULL == 0 || word & AVAILABLE != 0 {
            return Err(PacketError::WouldBlock);
        }
        let length = (word & LENGTH) as usize;
        let into = into.get_mut(..length.min(PACKET)).ok_or(PacketError::Overflow)?;
        for (index, bytes) in (place(buffer)..).zip(into.chunks_mut(4)) {
            let word = self.controller().word(index).to_le_bytes();
            bytes.iter_mut().zip(word).for_each(|(into, byte)| *into = byte);
        }
        // This must come before the controller gets the buffer and may fill it again.
        self.buffers.clear_finished(1 << buffer);
        let next = word & STALL | !word & IS_DATA_1 | PACKET as u32;
        if buffer == TO_0 && length < PACKET {
            // These were the last data.
            self.buffers.keep(buffer, next);
        } else {
            self.buffers.give(buffer, next);
        }
        Ok(into.len())
    }

    /// Writes a packet, which the controller then has until the host takes it.
    ///
    /// # Errors
    /// The controller still has the last packet, or this one is too long for the endpoint.
    pub fn write(&self, buffer: usize, packet: &[u8]) -> Result<(), PacketError> {
        use control_word::{AVAILABLE, FULL, IS_DATA_1, STALL};
        let word = self.buffers.control(buffer);
        if word & AVAILABLE != 0 {
            return Err(PacketError::WouldBlock);
        }
        if packet.len() > greatest(buffer) {
            return Err(PacketError::Overflow);
        }
        for (index, bytes) in (place(buffer)..).zip(packet.chunks(4)) {
            let word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
            self.controller().put_word(index, word);
        }
        let next = word & STALL | !word & IS_DATA_1 | FULL | packet.len() as u32;
        self.buffers.give(buffer, next);
        Ok(())
    }

    /// Halts the endpoint of a buffer, or lifts its halt. At endpoint 0 a halt ends with the host's
    /// next request.
    pub fn set_halted(&self, buffer: usize, is_halted: bool) {
        if greatest(buffer) == 0 {
            return;
        }
        self.buffers.set_bit(buffer, control_word::STALL, is_halted);
        if is_halted && buffer <= TO_0 {
            self.buffers.arm_stall();
        }
    }

    /// Whether the endpoint of a buffer is halted.
    pub fn is_halted(&self, buffer: usize) -> bool {
        self.buffers.control(buffer) & control_word::STALL != 0
    }
}
