//! The USB device: one serial port of the class CDC-ACM (USB 2.0, chapters 8 and 9; Class
//! Definitions for Communication Devices 1.2, and its subclass for PSTN devices).
//!
//! `control` makes the control transfers at endpoint 0, `requests` carries out what they request,
//! and `descriptors` says what the device is. The packets go through the
//! [driver](super::driver). Nothing here panics: the interrupt handler calls it.
//!
//! On the wire, the device is exactly that of the crates `usb-device` and `usbd-serial`, also where
//! USB 2.0 would allow another answer. The tests of the host compare both, packet by packet.

mod control;
mod descriptors;
mod requests;

use self::control::ControlPipe;
pub use self::requests::LineCoding;
use super::driver::{
    Buffers, Bus, Controller, Event, FROM_0, FROM_PORT, PacketError, TO_0, TO_PORT,
};

/// The state of the device (USB 2.0, section 9.1). That the bus is suspended is not followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// The bus was reset.
    Default,
    /// The host has given the device an address.
    Address,
    /// The host has configured the device, so that bytes can be exchanged.
    Configured,
}

/// The device and its serial port.
pub struct Device<'n, C> {
    bus: Bus<C>,
    /// The number of this device, which is one of its string descriptors.
    serial_number: &'n str,
    control: ControlPipe,
    state: State,
    /// The address that the device gets when a request is confirmed; 0 if there is none.
    pending_address: u8,
    /// Whether the host has said that the device may wake it, which the device never does.
    may_wake_host: bool,
    line_coding: LineCoding,
    /// Whether a program has the port open (Data Terminal Ready).
    dtr: bool,
}

impl<'n, C: Controller> Device<'n, C> {
    /// Makes the device with this serial number, of 63 letters at most, and connects it to the
    /// host. The controller was just reset.
    pub fn new(controller: C, serial_number: &'n str) -> Self {
        let bus = Bus::new(controller);
        bus.connect();
        Self {
            bus,
            serial_number,
            control: ControlPipe::new(),
            state: State::Default,
            pending_address: 0,
            may_wake_host: false,
            line_coding: LineCoding::DEFAULT,
            dtr: false,
        }
    }

    /// The buffers of the controller.
    pub fn buffers(&self) -> &Buffers<C> {
        self.bus.buffers()
    }

    /// Whether the host has configured the device, so that bytes can be exchanged.
    pub fn is_configured(&self) -> bool {
        self.state == State::Configured
    }

    /// Whether a program at the host has the port open (Data Terminal Ready).
    pub fn dtr(&self) -> bool {
        self.dtr
    }

    /// How the host wants the bytes of the port to be sent, if the port were on a serial line.
    pub fn line_coding(&self) -> &LineCoding {
        &self.line_coding
    }

    /// Reads a packet for the port, and returns the number of its bytes.
    ///
    /// # Errors
    /// There is no packet, or less room than it needs.
    pub fn read_packet(&mut self, into: &mut [u8]) -> Result<usize, PacketError> {
        self.bus.read(TO_PORT, into)
    }

    /// Writes a packet of the port.
    ///
    /// # Errors
    /// The host has not taken the last one, or this one is too long.
    pub fn write_packet(&mut self, packet: &[u8]) -> Result<(), PacketError> {
        self.bus.write(FROM_PORT, packet)
    }

    /// Follows what has happened on the bus, and answers the host at endpoint 0.
    pub fn poll(&mut self) {
        let unread = self.buffers().unread();
        match self.bus.look() {
            Event::Reset => self.reset(),
            Event::Packets { has_setup, finished } => {
                self.follow_control(has_setup, finished);
            }
        }
        self.buffers().refuse(unread);
    }

    /// Goes on with the control transfer.
    fn follow_control(&mut self, has_setup: bool, finished: u32) {
        let request = if has_setup {
            self.control.set_up(&self.bus)
        } else if finished & 1 << TO_0 != 0 {
            self.control.take_packet(&self.bus)
        } else {
            None
        };
        if let Some(request) = request {
            // That a packet was taken belongs to an earlier transfer, or to the one before.
            self.carry_out(&request);
        } else if finished & 1 << FROM_0 != 0
            && self.control.go_on(&self.bus)
            && self.pending_address != 0
        {
            self.bus.set_address(self.pending_address);
            self.pending_address = 0;
            self.state = State::Address;
        }
    }

    /// Begins anew behind a reset of the bus.
    fn reset(&mut self) {
        self.bus.reset();
        self.control.reset();
        self.state = State::Default;
        self.pending_address = 0;
        self.may_wake_host = false;
        self.line_coding = LineCoding::DEFAULT;
        self.dtr = false;
    }
}
