//! The driver of the USB controller, as the crate `usb-device` wants it.
//!
//! The endpoints are those of `usbd-serial`, and are constants. So the driver has no table of
//! them, and allocating one cannot fail.

use usb_device::bus::{PollResult, UsbBus};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};

use super::buffers::{
    Buffers, FROM_0, FROM_PORT, NOTICES, SETUP_REQ, TO_0, TO_PORT, buffer_of, control_word,
};
use super::{Controller, Register};

/// The greatest packet of every endpoint but that of notices, in bytes.
pub const PACKET: usize = 64;
/// The greatest notice of the port to the host, in bytes. None is ever sent.
const NOTICE: usize = 8;
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

/// The word of the memory, behind the buffers, in which [`Bus::look`] puts what it has seen: the
/// buffers that the host has taken or filled, and the two bits below.
const SEEN: usize = BUFFERS + 2 * ENDPOINTS * PACKET / 4;
/// In [`SEEN`]: the host resets the bus.
const SEEN_RESET: u32 = 1 << 30;
/// In [`SEEN`]: the host has made a request, which the next reading of endpoint 0 is to read.
const SEEN_SETUP: u32 = 1 << 31;

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

    /// The controller.
    pub fn controller(&self) -> &C {
        &self.buffers.0
    }

    /// Switches the controller on and shows the device to the host, which then resets the bus.
    pub fn connect(&self) {
        use Register::{Inte, MainCtrl, SieCtrl, UsbMuxing, UsbPwr};
        let controller = self.controller();
        // Memory holds anything when the power comes.
        for index in 0..=SEEN {
            controller.put_word(index, 0);
        }
        self.begin_endpoints();
        controller.put(UsbMuxing, bits::TO_PHY_SOFTCON);
        controller.put(UsbPwr, bits::VBUS_DETECT_OVERRIDE);
        controller.put(MainCtrl, bits::CONTROLLER_EN);
        controller.put(Inte, bits::BUFF_STATUS | bits::BUS_RESET_INT | SETUP_REQ);
        controller.put(SieCtrl, bits::EP0_INT_1BUF | bits::PULLUP_EN);
    }

    /// Looks what has happened on the bus, for the polling of the device that must follow. That the
    /// host suspends or resumes the bus is not seen: nothing depends on it.
    pub fn look(&self) {
        let due = self.controller().get(Register::Intr);
        if due & bits::BUS_RESET_INT != 0 {
            return self.controller().put_word(SEEN, SEEN_RESET);
        }
        let mut seen = self.buffers.finished() & ALL_BUFFERS;
        // That a packet was taken is reported once; that one was received, until it is read.
        self.buffers.clear_finished(seen & ALL_TAKEN);
        if due & SETUP_REQ != 0 {
            // What endpoint 0 holds answers a request that the host has broken off.
            self.buffers.keep(FROM_0, self.buffers.control(FROM_0));
            seen |= SEEN_SETUP;
        }
        self.controller().put_word(SEEN, seen);
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

    /// Reads the host's request, and makes endpoint 0 ready for what follows it: packets that begin
    /// with DATA1.
    ///
    /// # Errors
    /// Another request came while this one was read. It will be reported.
    fn read_setup(&self, into: &mut [u8]) -> Result<usize> {
        self.controller().put(Register::SieStatus, bits::SETUP_REC);
        let [low, high] = self.buffers.setup();
        if self.buffers.setup() != [low, high] {
            return Err(UsbError::WouldBlock);
        }
        let request = u64::from(high) << 32 | u64::from(low);
        let request = request.to_le_bytes();
        into.get_mut(..request.len()).ok_or(UsbError::BufferOverflow)?.copy_from_slice(&request);
        // The first packet to the host flips the data toggle.
        self.buffers.keep(FROM_0, 0);
        self.buffers.clear_finished(1 << TO_0);
        let (is_from_device, length) = (low & 0x80 != 0, high >> 16);
        if is_from_device {
            // The host confirms what it gets, by an empty packet. There is no room for others,
            // because the answer lies in the same memory.
            self.buffers.give(TO_0, control_word::IS_DATA_1);
        } else if length > 0 {
            self.buffers.give(TO_0, control_word::IS_DATA_1 | PACKET as u32);
        } else {
            self.buffers.keep(TO_0, control_word::IS_DATA_1);
        }
        Ok(request.len())
    }

    /// Reads a packet, and gives the controller the buffer again.
    fn read_packet(&self, buffer: usize, into: &mut [u8]) -> Result<usize> {
        use control_word::{AVAILABLE, FULL, IS_DATA_1, LENGTH, STALL};
        let word = self.buffers.control(buffer);
        if word & FULL == 0 || word & AVAILABLE != 0 {
            return Err(UsbError::WouldBlock);
        }
        let length = (word & LENGTH) as usize;
        let into = into.get_mut(..length.min(PACKET)).ok_or(UsbError::BufferOverflow)?;
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
}

impl<C: Controller + Sync> UsbBus for Bus<C> {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        size: u16,
        _interval: u8,
    ) -> Result<EndpointAddress> {
        let (index, packet) = match (kind, direction) {
            (EndpointType::Control, _) => (0, PACKET),
            (EndpointType::Interrupt, UsbDirection::In) => (NOTICES / 2, NOTICE),
            (EndpointType::Bulk, UsbDirection::In) => (FROM_PORT / 2, PACKET),
            (EndpointType::Bulk, UsbDirection::Out) => (TO_PORT / 2, PACKET),
            _ => return Err(UsbError::EndpointOverflow),
        };
        let endpoint = EndpointAddress::from_parts(index, direction);
        if usize::from(size) != packet || address.is_some_and(|address| address != endpoint) {
            return Err(UsbError::Unsupported);
        }
        Ok(endpoint)
    }

    /// Does nothing: see [`Bus::connect`].
    fn enable(&mut self) {}

    fn reset(&self) {
        self.controller().put(Register::SieStatus, bits::BUS_RESET);
        // A request to an address was made before the reset. One to address 0 may have come after
        // it: the host waits only ten milliseconds, and work on the flash lasts longer.
        if self.controller().get(Register::AddrEndp) != 0 {
            self.controller().put(Register::SieStatus, bits::SETUP_REC);
            self.controller().put(Register::AddrEndp, 0);
        }
        self.begin_endpoints();
    }

    fn set_device_address(&self, address: u8) {
        self.controller().put(Register::AddrEndp, u32::from(address & 0x7F));
    }

    fn write(&self, endpoint: EndpointAddress, packet: &[u8]) -> Result<usize> {
        use control_word::{AVAILABLE, FULL, IS_DATA_1, STALL};
        let buffer = buffer_of(endpoint);
        let word = self.buffers.control(buffer);
        if word & AVAILABLE != 0 {
            return Err(UsbError::WouldBlock);
        }
        if packet.len() > greatest(buffer) {
            return Err(UsbError::BufferOverflow);
        }
        for (index, bytes) in (place(buffer)..).zip(packet.chunks(4)) {
            let word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
            self.controller().put_word(index, word);
        }
        let next = word & STALL | !word & IS_DATA_1 | FULL | packet.len() as u32;
        self.buffers.give(buffer, next);
        Ok(packet.len())
    }

    #[inline(always)]
    fn read(&self, endpoint: EndpointAddress, into: &mut [u8]) -> Result<usize> {
        let buffer = buffer_of(endpoint);
        let seen = self.controller().word(SEEN);
        let count = if buffer == TO_0 && seen & SEEN_SETUP != 0 {
            self.controller().put_word(SEEN, seen & !SEEN_SETUP);
            self.read_setup(into)?
        } else {
            self.read_packet(buffer, into)?
        };
        // It is never more. Where the compiler sees that, `usb-device` needs no check of bounds.
        Ok(count.min(into.len()))
    }

    fn set_stalled(&self, endpoint: EndpointAddress, is_stalled: bool) {
        let buffer = buffer_of(endpoint);
        if greatest(buffer) == 0 {
            return;
        }
        self.buffers.set_bit(buffer, control_word::STALL, is_stalled);
        if is_stalled && buffer <= TO_0 {
            self.buffers.arm_stall();
        }
    }

    fn is_stalled(&self, endpoint: EndpointAddress) -> bool {
        self.buffers.control(buffer_of(endpoint)) & control_word::STALL != 0
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    /// Reports what [`Bus::look`] has seen last.
    fn poll(&self) -> PollResult {
        let seen = self.controller().word(SEEN);
        if seen & SEEN_RESET != 0 {
            return PollResult::Reset;
        }
        if seen == 0 {
            return PollResult::None;
        }
        let (mut ep_in_complete, mut ep_out) = (0, 0);
        for endpoint in 0..ENDPOINTS {
            let bit = |buffer: usize| ((seen >> buffer & 1) as u16) << endpoint;
            ep_in_complete |= bit(2 * endpoint);
            ep_out |= bit(2 * endpoint + 1);
        }
        PollResult::Data { ep_out, ep_in_complete, ep_setup: u16::from(seen & SEEN_SETUP != 0) }
    }
}
