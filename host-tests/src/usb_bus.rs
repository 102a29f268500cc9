//! The RP2040's USB controller as a device, with the driver of `rp2040-hal` 0.12, in plain memory.
//!
//! The trait's methods do what that driver does, register by register; the other methods are the
//! host's end of the cable (data sheet of the RP2040, section 4.1.2.6). A packet of the device
//! stays until the host takes it. A SETUP packet is always accepted, and lifts the stall of
//! endpoint 0; what that endpoint held goes only when the driver sees the SETUP packet, as on the
//! chip. A received packet whose data toggle is not the expected one is acknowledged and dropped,
//! as USB 2.0 wants it (section 8.6.3); the data sheet does not say.
//!
//! What is left out: time, and the errata E5 and E15, which the emulated Pico has.

use crate::usb_endpoints::{Buffers, control_word};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use usb_device::bus::{PollResult, UsbBus};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};

/// The greatest packet of any endpoint but an isochronous one, in bytes.
pub const GREATEST_PACKET: usize = 64;
/// The number of endpoints in each direction.
const ENDPOINTS: usize = 16;
/// In the bits of finished buffers, those of packets that the host has taken.
const ALL_TAKEN: u32 = 0x5555_5555;
/// In the bits of finished buffers, the packet that the host has sent to endpoint 0.
const SENT_TO_0: u32 = 1 << 1;

/// The controller, with the driver before it and the cable behind it.
#[derive(Clone, Default)]
pub struct Bus(Arc<Mutex<Controller>>);

/// What a device answers a host that asks for a packet.
#[derive(Debug, PartialEq, Eq)]
pub enum Answer {
    /// A packet, which the host acknowledges.
    Packet {
        /// Its data.
        bytes: Vec<u8>,
        /// Whether its data toggle is DATA1.
        is_data_1: bool,
        /// Whether it was written after the driver had seen the last SETUP packet.
        is_current: bool,
    },
    /// Nothing yet.
    Nak,
    /// The endpoint is halted.
    Stall,
    /// There is no such endpoint.
    Nothing,
}

/// What a device answers a host that has sent a packet.
#[derive(Debug, PartialEq, Eq)]
pub enum Handshake {
    /// The packet is accepted.
    Ack,
    /// The packet is acknowledged, but the device takes it for a repeated one and drops it.
    Dropped,
    /// There is no room yet.
    Nak,
    /// The endpoint is halted.
    Stall,
    /// There is no such endpoint.
    Nothing,
}

/// A buffer of an endpoint in one direction, with its control word.
#[derive(Clone, Copy)]
struct Buffer {
    is_available: bool,
    is_full: bool,
    is_data_1: bool,
    is_stalled: bool,
    length: usize,
    bytes: [u8; GREATEST_PACKET],
    /// The number of SETUP packets that had come when the driver wrote the packet.
    setups: u32,
}

impl Buffer {
    /// A control word of zeros.
    const EMPTY: Self = Self {
        is_available: false,
        is_full: false,
        is_data_1: false,
        is_stalled: false,
        length: 0,
        bytes: [0; GREATEST_PACKET],
        setups: 0,
    };

    /// The control word, without the length.
    fn control(&self) -> u32 {
        let bits = [
            (self.is_available, control_word::AVAILABLE),
            (self.is_stalled, control_word::STALL),
            (self.is_data_1, control_word::IS_DATA_1),
            (self.is_full, control_word::FULL),
        ];
        bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |word, (_, bit)| word | bit)
    }

    /// Changes the control word, but for the length.
    fn put_control(&mut self, word: u32) {
        self.is_available = word & control_word::AVAILABLE != 0;
        self.is_stalled = word & control_word::STALL != 0;
        self.is_data_1 = word & control_word::IS_DATA_1 != 0;
        self.is_full = word & control_word::FULL != 0;
    }
}

/// The registers, and what the driver remembers.
struct Controller {
    /// For each endpoint the buffer that the host takes, then the one that it fills.
    buffers: [Buffer; 2 * ENDPOINTS],
    /// The greatest packet of each buffer; `None` if there is no such endpoint.
    greatest: [Option<usize>; 2 * ENDPOINTS],
    /// Whether the endpoints besides the first are switched on.
    is_enabled: bool,
    /// A bit for each buffer that the host has taken or filled.
    finished: u32,
    setup: [u8; 8],
    has_setup: bool,
    /// Whether the driver's next reading of endpoint 0 is that of the SETUP packet.
    reads_setup: bool,
    is_reset: bool,
    is_suspended: bool,
    is_resumed: bool,
    /// Whether the first two buffers, those of endpoint 0, may stall.
    is_stall_armed: [bool; 2],
    address: u8,
    setups: u32,
}

impl Default for Controller {
    fn default() -> Self {
        Self {
            buffers: [Buffer::EMPTY; 2 * ENDPOINTS],
            greatest: [None; 2 * ENDPOINTS],
            is_enabled: false,
            finished: 0,
            setup: [0; 8],
            has_setup: false,
            reads_setup: false,
            is_reset: false,
            is_suspended: false,
            is_resumed: false,
            is_stall_armed: [false; 2],
            address: 0,
            setups: 0,
        }
    }
}

impl Controller {
    /// Whether the endpoint of this buffer answers the host.
    fn answers(&self, buffer: usize) -> bool {
        self.greatest[buffer].is_some() && (buffer < 2 || self.is_enabled)
    }

    /// Whether this buffer answers STALL.
    fn stalls(&self, buffer: usize) -> bool {
        let is_armed = self.is_stall_armed.get(buffer).is_none_or(|is_armed| *is_armed);
        self.buffers[buffer].is_stalled && is_armed
    }
}

/// The number of the buffer of an endpoint, as the driver counts them.
fn buffer_of(endpoint: EndpointAddress) -> usize {
    2 * endpoint.index() + usize::from(endpoint.is_out())
}

/// The host's end of the cable.
impl Bus {
    fn controller(&self) -> MutexGuard<'_, Controller> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a SETUP packet, which every device acknowledges.
    pub fn set_up(&self, request: [u8; 8]) {
        let mut controller = self.controller();
        controller.setup = request;
        controller.has_setup = true;
        controller.is_stall_armed = [false; 2];
        controller.setups += 1;
    }

    /// Asks an endpoint for a packet.
    pub fn ask(&self, endpoint: usize) -> Answer {
        let (mut controller, number) = (self.controller(), 2 * endpoint);
        if !controller.answers(number) {
            return Answer::Nothing;
        }
        if controller.stalls(number) {
            return Answer::Stall;
        }
        let setups = controller.setups;
        let buffer = &mut controller.buffers[number];
        if !(buffer.is_available && buffer.is_full) {
            return Answer::Nak;
        }
        (buffer.is_available, buffer.is_full) = (false, false);
        let bytes = buffer.bytes[..buffer.length].to_vec();
        let is_data_1 = buffer.is_data_1;
        let is_current = buffer.setups == setups;
        controller.finished |= 1 << number;
        Answer::Packet { bytes, is_data_1, is_current }
    }

    /// Sends an endpoint a packet.
    pub fn give(&self, endpoint: usize, is_data_1: bool, packet: &[u8]) -> Handshake {
        let (mut controller, number) = (self.controller(), 2 * endpoint + 1);
        if !controller.answers(number) {
            return Handshake::Nothing;
        }
        if controller.stalls(number) {
            return Handshake::Stall;
        }
        let buffer = &mut controller.buffers[number];
        if !buffer.is_available || buffer.is_full {
            return Handshake::Nak;
        }
        if buffer.is_data_1 != is_data_1 {
            return Handshake::Dropped;
        }
        (buffer.is_available, buffer.is_full) = (false, true);
        buffer.length = packet.len();
        buffer.bytes[..packet.len()].copy_from_slice(packet);
        controller.finished |= 1 << number;
        Handshake::Ack
    }

    /// Begins and ends a reset of the bus.
    pub fn reset_bus(&self) {
        self.controller().is_reset = true;
    }

    /// Suspends the bus.
    pub fn suspend_bus(&self) {
        self.controller().is_suspended = true;
    }

    /// Resumes the bus.
    pub fn resume_bus(&self) {
        self.controller().is_resumed = true;
    }

    /// The address to which the device answers.
    pub fn address(&self) -> u8 {
        self.controller().address
    }

    /// Whether the controller interrupts the processor.
    pub fn has_interrupt(&self) -> bool {
        let controller = self.controller();
        let has_event = controller.is_reset || controller.is_suspended || controller.is_resumed;
        has_event || controller.has_setup || controller.finished != 0
    }
}

impl Buffers for Bus {
    fn finished(&self) -> u32 {
        self.controller().finished
    }

    fn clear_finished(&self, bits: u32) {
        self.controller().finished &= !bits;
    }

    fn control(&self, buffer: usize) -> u32 {
        self.controller().buffers[buffer].control()
    }

    fn put_control(&self, buffer: usize, word: u32) {
        self.controller().buffers[buffer].put_control(word);
    }

    fn setup(&self) -> [u32; 2] {
        let [a, b, c, d, e, f, g, h] = self.controller().setup;
        [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]
    }

    fn has_setup(&self) -> bool {
        self.controller().has_setup
    }

    fn arm_stall(&self) {
        self.controller().is_stall_armed = [true; 2];
    }

    fn wait_for_packet(&self) {}
}

impl UsbBus for Bus {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        greatest: u16,
        _: u8,
    ) -> Result<EndpointAddress> {
        let mut controller = self.controller();
        let is_control = kind == EndpointType::Control;
        let free = |index: &usize| {
            controller.greatest[buffer_of(EndpointAddress::from_parts(*index, direction))].is_none()
        };
        let address = match address {
            Some(address) => address,
            None => (usize::from(!is_control)..ENDPOINTS)
                .find(free)
                .map(|index| EndpointAddress::from_parts(index, direction))
                .ok_or(UsbError::EndpointOverflow)?,
        };
        let greatest = usize::from(greatest);
        if (address.index() == 0) != is_control || greatest > GREATEST_PACKET {
            return Err(UsbError::Unsupported);
        }
        match controller.greatest.get_mut(buffer_of(address)) {
            None => Err(UsbError::EndpointOverflow),
            Some(Some(_)) => Err(UsbError::InvalidEndpoint),
            Some(place) => {
                *place = Some(greatest);
                Ok(address)
            }
        }
    }

    fn enable(&mut self) {}

    fn reset(&self) {
        let mut controller = self.controller();
        controller.is_reset = false;
        controller.finished = 0;
        controller.is_enabled = true;
        controller.address = 0;
        for number in 0..controller.buffers.len() {
            if controller.greatest[number].is_some() {
                let is_in = number % 2 == 0;
                let empty = Buffer { is_available: !is_in, is_data_1: is_in, ..Buffer::EMPTY };
                controller.buffers[number] = empty;
            }
        }
    }

    fn set_device_address(&self, address: u8) {
        let mut controller = self.controller();
        controller.address = address & 0x7F;
        controller.buffers[0].is_data_1 = true;
        controller.buffers[1].is_data_1 = true;
    }

    fn write(&self, endpoint: EndpointAddress, packet: &[u8]) -> Result<usize> {
        let (mut controller, number) = (self.controller(), buffer_of(endpoint));
        let setups = controller.setups;
        let greatest = controller.greatest.get(number).copied().flatten();
        let greatest = greatest.ok_or(UsbError::InvalidEndpoint)?;
        let buffer = &mut controller.buffers[number];
        if buffer.is_available {
            return Err(UsbError::WouldBlock);
        }
        // The driver would refuse it, so that it would never be sent.
        assert!(packet.len() <= greatest, "a packet of {} bytes", packet.len());
        buffer.bytes[..packet.len()].copy_from_slice(packet);
        buffer.length = packet.len();
        buffer.is_data_1 = !buffer.is_data_1;
        buffer.setups = setups;
        (buffer.is_full, buffer.is_available) = (true, true);
        Ok(packet.len())
    }

    fn read(&self, endpoint: EndpointAddress, into: &mut [u8]) -> Result<usize> {
        let (mut controller, number) = (self.controller(), buffer_of(endpoint));
        let greatest = controller.greatest.get(number).copied().flatten();
        let greatest = greatest.ok_or(UsbError::InvalidEndpoint)?;
        if endpoint.index() == 0 && controller.reads_setup {
            let request = controller.setup;
            into.get_mut(..request.len())
                .ok_or(UsbError::BufferOverflow)?
                .copy_from_slice(&request);
            controller.buffers[0].is_data_1 = false;
            controller.has_setup = false;
            controller.finished &= !SENT_TO_0;
            // Data or their confirmation follows.
            let has_out_packet = request[0] & 0x80 != 0 || request[6] != 0 || request[7] != 0;
            let buffer = &mut controller.buffers[1];
            buffer.length = greatest;
            buffer.is_full = false;
            buffer.is_data_1 = true;
            buffer.is_available = has_out_packet;
            controller.reads_setup = false;
            return Ok(request.len());
        }
        let buffer = &mut controller.buffers[number];
        if !buffer.is_full {
            return Err(UsbError::WouldBlock);
        }
        let length = buffer.length;
        into.get_mut(..length)
            .ok_or(UsbError::BufferOverflow)?
            .copy_from_slice(&buffer.bytes[..length]);
        buffer.length = greatest;
        buffer.is_full = false;
        buffer.is_data_1 = !buffer.is_data_1;
        buffer.is_available |= endpoint.index() != 0 || length == greatest;
        controller.finished &= !(1 << number);
        Ok(length)
    }

    fn set_stalled(&self, endpoint: EndpointAddress, is_stalled: bool) {
        let (mut controller, number) = (self.controller(), buffer_of(endpoint));
        if let Some(is_armed) = controller.is_stall_armed.get_mut(number) {
            *is_armed = is_stalled;
        }
        controller.buffers[number].is_stalled = is_stalled;
    }

    fn is_stalled(&self, endpoint: EndpointAddress) -> bool {
        self.controller().buffers[buffer_of(endpoint)].is_stalled
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        let mut controller = self.controller();
        if controller.is_reset {
            return PollResult::Reset;
        }
        if controller.finished == 0 && !controller.has_setup {
            if controller.is_suspended {
                controller.is_suspended = false;
                return PollResult::Suspend;
            }
            if controller.is_resumed {
                controller.is_resumed = false;
                return PollResult::Resume;
            }
            return PollResult::None;
        }
        let finished = controller.finished;
        controller.finished &= !ALL_TAKEN;
        let bits_of = |direction: usize| {
            let is_finished = |index: &usize| finished & 1 << (2 * index + direction) != 0;
            (0..ENDPOINTS).filter(is_finished).fold(0, |bits, index| bits | 1 << index)
        };
        if controller.has_setup {
            controller.buffers[0].is_available = false;
            controller.reads_setup = true;
        }
        PollResult::Data {
            ep_out: bits_of(1),
            ep_in_complete: bits_of(0),
            ep_setup: u16::from(controller.has_setup),
        }
    }
}
