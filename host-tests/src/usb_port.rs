//! The Pico's serial port by USB, on a controller made of plain memory.
//!
//! [`Port::serve`] does what the function of that name in `src/boards/pico/usb.rs` does, with the
//! very device and driver that the firmware has ([`usb_firmware`](crate::usb_firmware)), or with
//! another device ([`usb_reference`](crate::usb_reference)). What is left out belongs to the chip
//! or to the protocol: the errata E5 and E15, the main loop's queues and messages, and real-time
//! bytes.

use crate::usb_controller::UsbController;
use crate::usb_firmware::device::Device;
use crate::usb_firmware::driver::{Buffers, PACKET};
use std::collections::VecDeque;

/// The size of a sent packet, so that no empty one is needed behind it.
const SENT_PACKET: usize = PACKET - 1;
/// The greatest number of bytes that wait to be sent.
const MOST_TO_SEND: usize = 2047;
/// The greatest number of received bytes that wait for room in the line's queue.
const MOST_WAITING: usize = 512;

/// A USB device with a serial port.
pub trait SerialDevice {
    /// Follows what has happened on the bus, and answers the host at endpoint 0.
    fn poll(&mut self);
    /// Whether the host has configured the device.
    fn is_configured(&self) -> bool;
    /// Whether a program at the host has the port open (Data Terminal Ready).
    fn dtr(&self) -> bool;
    /// The line coding: the bits a second, and the codes of stop bits, parity and data bits.
    fn line_coding(&self) -> (u32, [u8; 3]);
    /// Reads a packet for the port, if there is one, and returns the number of its bytes.
    fn read_packet(&mut self, into: &mut [u8]) -> Option<usize>;
    /// Writes a packet of the port. Returns whether there was room.
    fn write_packet(&mut self, packet: &[u8]) -> bool;
}

/// The device of the firmware.
impl SerialDevice for Device<'_, UsbController> {
    fn poll(&mut self) {
        Device::poll(self);
    }

    fn is_configured(&self) -> bool {
        Device::is_configured(self)
    }

    fn dtr(&self) -> bool {
        Device::dtr(self)
    }

    fn line_coding(&self) -> (u32, [u8; 3]) {
        let coding = Device::line_coding(self);
        let [.., stop_bits, parity, bits] = coding.bytes();
        (coding.data_rate(), [stop_bits, parity, bits])
    }

    fn read_packet(&mut self, into: &mut [u8]) -> Option<usize> {
        Device::read_packet(self, into).ok()
    }

    fn write_packet(&mut self, packet: &[u8]) -> bool {
        Device::write_packet(self, packet).is_ok()
    }
}

/// The device and its serial port.
pub struct Port<D> {
    device: D,
    buffers: Buffers<UsbController>,
    is_up: bool,
    is_open: bool,
    /// Received bytes for which the line's queue has had no room yet.
    waiting: VecDeque<u8>,
    to_send: VecDeque<u8>,
    /// The bytes of the next packet, which the controller has not taken yet.
    packet: Vec<u8>,
    /// Whether the line's queue is full.
    pub is_line_full: bool,
    /// The bytes that the line's queue has taken.
    pub received: Vec<u8>,
    /// The packets that the controller has taken, without those that were taken back.
    pub sent: Vec<Vec<u8>>,
}

impl<D: SerialDevice> Port<D> {
    /// Makes the port of a device that `controller` connects to the host.
    pub fn new(device: D, controller: UsbController) -> Self {
        Self {
            device,
            buffers: Buffers(controller),
            is_up: false,
            is_open: false,
            waiting: VecDeque::new(),
            to_send: VecDeque::new(),
            packet: Vec::new(),
            is_line_full: false,
            received: Vec::new(),
            sent: Vec::new(),
        }
    }

    /// The controller, at whose other end is the host.
    pub fn bus(&self) -> &UsbController {
        &self.buffers.0
    }

    /// The device.
    pub fn device(&self) -> &D {
        &self.device
    }

    /// Whether the host has configured the device.
    pub fn is_up(&self) -> bool {
        self.is_up
    }

    /// Whether a program has the port open, according to DTR.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// The received bytes that the line's queue has not taken.
    pub fn waiting(&self) -> &VecDeque<u8> {
        &self.waiting
    }

    /// Whether bytes wait that the controller has not taken.
    pub fn has_to_send(&self) -> bool {
        !self.to_send.is_empty() || !self.packet.is_empty()
    }

    /// Sends bytes, as far as there is room for them.
    pub fn write(&mut self, bytes: &[u8]) {
        let room = MOST_TO_SEND - self.to_send.len();
        self.to_send.extend(&bytes[..bytes.len().min(room)]);
    }

    /// Does all the work of the port.
    pub fn serve(&mut self) {
        self.device.poll();
        self.follow_state();
        self.follow_port();
        self.receive();
        self.send();
    }

    /// Resets the port for each new host.
    fn follow_state(&mut self) {
        let is_up = self.device.is_configured();
        if is_up != self.is_up {
            self.is_up = is_up;
            self.forget_sent();
        }
    }

    /// Follows whether a program at the host has the port open.
    fn follow_port(&mut self) {
        let is_open = self.device.dtr();
        if is_open == self.is_open {
            return;
        }
        self.is_open = is_open;
        if !is_open {
            self.forget_sent();
            if self.buffers.take_back() {
                self.sent.pop();
            }
        }
    }

    /// Discards the bytes that were to be sent.
    fn forget_sent(&mut self) {
        self.packet.clear();
        self.to_send.clear();
    }

    /// Passes received bytes on to the line's queue, and reads further packets while there is room.
    fn receive(&mut self) {
        loop {
            if !self.is_line_full {
                self.received.extend(self.waiting.drain(..));
            }
            if MOST_WAITING - self.waiting.len() < PACKET + 2 {
                return self.buffers.leave();
            }
            let mut packet = [0; PACKET];
            let Some(count) = self.device.read_packet(&mut packet) else { return };
            self.waiting.extend(&packet[..count]);
        }
    }

    /// Sends the bytes that wait, as far as the controller takes them.
    fn send(&mut self) {
        if !self.is_up {
            return self.forget_sent();
        }
        loop {
            while self.packet.len() < SENT_PACKET
                && let Some(byte) = self.to_send.pop_front()
            {
                self.packet.push(byte);
            }
            if self.packet.is_empty() || !self.device.write_packet(&self.packet) {
                return;
            }
            self.sent.push(std::mem::take(&mut self.packet));
        }
    }
}
