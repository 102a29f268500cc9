//! What the requests at endpoint 0 do: those of USB 2.0 (section 9.4), and those of the class
//! (Communication Devices, subclass for PSTN Devices 1.2, section 6.3).

use super::super::driver::{Controller, FROM_PORT, TO_PORT, buffer_of};
use super::control::Request;
use super::descriptors::{
    CONFIGURATION, CONTROL_INTERFACE, DATA_INTERFACE, Descriptor, find, string_bytes,
};
use super::{Device, State};

/// The first byte of a request, `bmRequestType`: the type of the request, its recipient, and bit 7
/// if the host asks for data.
mod to {
    /// A standard request to the device.
    pub const DEVICE: u8 = 0x00;
    /// A standard request to an interface.
    pub const INTERFACE: u8 = 0x01;
    /// A standard request to an endpoint.
    pub const ENDPOINT: u8 = 0x02;
    /// A request of the class to an interface.
    pub const CLASS: u8 = 0x21;
    /// The host asks for data.
    pub const ASK: u8 = 0x80;
    /// A standard request to the device, for data.
    pub const ASK_DEVICE: u8 = ASK | DEVICE;
    /// A standard request to an interface, for data.
    pub const ASK_INTERFACE: u8 = ASK | INTERFACE;
    /// A standard request to an endpoint, for data.
    pub const ASK_ENDPOINT: u8 = ASK | ENDPOINT;
    /// A request of the class to an interface, for data.
    pub const ASK_CLASS: u8 = ASK | CLASS;
}

/// The standard requests that are answered: `bRequest`.
mod standard {
    /// Whether an endpoint is halted, and whether the device may wake the host.
    pub const GET_STATUS: u8 = 0;
    /// Lifts a halt, or forbids the device to wake the host.
    pub const CLEAR_FEATURE: u8 = 1;
    /// Halts an endpoint, or allows the device to wake the host.
    pub const SET_FEATURE: u8 = 3;
    /// Gives the device an address.
    pub const SET_ADDRESS: u8 = 5;
    /// Asks for a descriptor.
    pub const GET_DESCRIPTOR: u8 = 6;
    /// Asks for the number of the configuration.
    pub const GET_CONFIGURATION: u8 = 8;
    /// Chooses a configuration.
    pub const SET_CONFIGURATION: u8 = 9;
    /// Asks for the setting of an interface.
    pub const GET_INTERFACE: u8 = 10;
    /// Chooses a setting of an interface.
    pub const SET_INTERFACE: u8 = 11;
}

/// The requests of the class that are answered: `bRequest`.
mod class {
    /// A command to a modem, which is accepted and ignored.
    pub const SEND_ENCAPSULATED_COMMAND: u8 = 0x00;
    /// Sets the line coding.
    pub const SET_LINE_CODING: u8 = 0x20;
    /// Asks for the line coding.
    pub const GET_LINE_CODING: u8 = 0x21;
    /// Opens the port, or closes it.
    pub const SET_CONTROL_LINE_STATE: u8 = 0x22;
    /// In the value of [`SET_CONTROL_LINE_STATE`]: Data Terminal Ready.
    pub const DTR: u16 = 1;
}

/// The feature of an endpoint that it is halted: `wValue`.
const ENDPOINT_HALT: u16 = 0;
/// The feature of the device that it may wake the host: `wValue`.
const DEVICE_REMOTE_WAKEUP: u16 = 1;
/// The greatest number of an interface, and of its settings.
const MOST_INTERFACE: u16 = 255;

/// How bytes are sent on a serial line: the data of the requests `SET_LINE_CODING` and
/// `GET_LINE_CODING`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineCoding([u8; 7]);

impl LineCoding {
    /// 9600 bits a second, 1 stop bit, no parity, 8 bits a byte.
    pub const DEFAULT: Self = {
        let [a, b, c, d] = 9600_u32.to_le_bytes();
        Self([a, b, c, d, 0, 0, 8])
    };
    /// The greatest code of the number of stop bits: 2.
    const MOST_STOP_BITS: u8 = 2;
    /// The greatest code of a parity.
    const MOST_PARITY: u8 = 4;

    /// The line coding of a request. An unknown number of stop bits is taken for 1, and an unknown
    /// parity for none.
    fn of(data: [u8; 7]) -> Self {
        let [a, b, c, d, stop_bits, parity, bits] = data;
        let stop_bits = if stop_bits <= Self::MOST_STOP_BITS { stop_bits } else { 0 };
        let parity = if parity <= Self::MOST_PARITY { parity } else { 0 };
        Self([a, b, c, d, stop_bits, parity, bits])
    }

    /// The bits a second.
    pub fn data_rate(&self) -> u32 {
        let [a, b, c, d, ..] = self.0;
        u32::from_le_bytes([a, b, c, d])
    }

    /// The data of the requests.
    pub fn bytes(&self) -> [u8; 7] {
        self.0
    }
}

impl<C: Controller> Device<'_, C> {
    /// Carries out a request, whose data have come, and answers, confirms or refuses it.
    pub fn carry_out(&mut self, request: &Request) {
        if request.is_from_device() {
            self.answer(request);
        } else if self.obey(request) {
            self.control.confirm(&self.bus);
        } else {
            self.control.reject(&self.bus);
        }
    }

    /// Answers a request for data, or refuses it.
    fn answer(&mut self, request: &Request) {
        let (control, bus) = (&mut self.control, &self.bus);
        match (request.request_type, request.request) {
            (to::ASK_CLASS, class::GET_LINE_CODING)
                if request.index == CONTROL_INTERFACE && request.length == 7 =>
            {
                control.answer(bus, request, self.line_coding.bytes());
            }
            (to::ASK_DEVICE, standard::GET_STATUS) => {
                control.answer(bus, request, [u8::from(self.may_wake_host) << 1, 0]);
            }
            (to::ASK_INTERFACE, standard::GET_STATUS) => control.answer(bus, request, [0, 0]),
            (to::ASK_ENDPOINT, standard::GET_STATUS) => {
                let is_halted = bus.is_halted(endpoint_of(request.index));
                control.answer(bus, request, [u8::from(is_halted), 0]);
            }
            (to::ASK_DEVICE, standard::GET_DESCRIPTOR) => {
                match find(request.value, request.index, self.serial_number) {
                    Some(Descriptor::Bytes(bytes)) => {
                        control.answer(bus, request, bytes.iter().copied());
                    }
                    Some(Descriptor::Text(text)) => {
                        control.answer(bus, request, string_bytes(text));
                    }
                    None => control.reject(bus),
                }
            }
            (to::ASK_DEVICE, standard::GET_CONFIGURATION) => {
                let is_configured = self.state == State::Configured;
                let number = if is_configured { CONFIGURATION as u8 } else { 0 };
                control.answer(bus, request, [number]);
            }
            (to::ASK_INTERFACE, standard::GET_INTERFACE) if request.index <= MOST_INTERFACE => {
                control.answer(bus, request, [0]);
            }
            _ => control.reject(bus),
        }
    }

    /// Does what a request wants that asks for no data. Returns false if it is refused.
    fn obey(&mut self, request: &Request) -> bool {
        let Request { request_type, request, value, index, .. } = *request;
        match (request_type, request) {
            (to::DEVICE, standard::CLEAR_FEATURE) if value == DEVICE_REMOTE_WAKEUP => {
                self.may_wake_host = false;
            }
            (to::DEVICE, standard::SET_FEATURE) if value == DEVICE_REMOTE_WAKEUP => {
                self.may_wake_host = true;
            }
            (to::DEVICE, standard::SET_ADDRESS) if (1..=127).contains(&value) => {
                self.pending_address = value as u8;
            }
            (to::DEVICE, standard::SET_CONFIGURATION) if value == CONFIGURATION => {
                self.begin_port_anew();
                self.state = State::Configured;
            }
            (to::DEVICE, standard::SET_CONFIGURATION) if value == 0 => {
                self.begin_port_anew();
                if self.state != State::Default {
                    self.state = State::Address;
                }
            }
            (to::INTERFACE, standard::SET_INTERFACE) if value == 0 && index <= MOST_INTERFACE => {
                if index == DATA_INTERFACE {
                    self.begin_port_anew();
                }
            }
            (to::ENDPOINT, standard::CLEAR_FEATURE) if value == ENDPOINT_HALT => {
                let buffer = endpoint_of(index);
                if [FROM_PORT, TO_PORT].contains(&buffer) {
                    self.buffers().begin_anew(buffer);
                }
                self.bus.set_halted(buffer, false);
            }
            (to::ENDPOINT, standard::SET_FEATURE) if value == ENDPOINT_HALT => {
                self.bus.set_halted(endpoint_of(index), true);
            }
            _ => {
                return index == CONTROL_INTERFACE && self.obey_class(request_type, request, value);
            }
        }
        true
    }

    /// The same for a request of the class.
    fn obey_class(&mut self, request_type: u8, request: u8, value: u16) -> bool {
        match (request_type, request) {
            (to::CLASS, class::SEND_ENCAPSULATED_COMMAND) => {}
            (to::CLASS, class::SET_LINE_CODING) => {
                let Some(data) = self.control.data().first_chunk() else { return false };
                self.line_coding = LineCoding::of(*data);
            }
            (to::CLASS, class::SET_CONTROL_LINE_STATE) => self.dtr = value & class::DTR != 0,
            _ => return false,
        }
        true
    }

    /// Lets the packets of the port begin anew with DATA0 (USB 2.0, sections 9.1.1.5 and 9.4.5).
    fn begin_port_anew(&self) {
        for buffer in [FROM_PORT, TO_PORT] {
            self.buffers().begin_anew(buffer);
        }
    }
}

/// The buffer of the endpoint whose address is the lower byte of `wIndex`.
fn endpoint_of(index: u16) -> usize {
    let [address, _] = index.to_le_bytes();
    buffer_of(address)
}
