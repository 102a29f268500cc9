//! The Pico's serial port by USB, as its firmware uses the crates `usb-device` and `usbd-serial`,
//! on a controller made of plain memory.
//!
//! [`Port::serve`] does what the function of that name in `src/boards/pico/usb.rs` does, with the
//! very driver that the firmware has ([`usb_driver`](crate::usb_driver)). What is left out belongs
//! to the chip or to the protocol: the errata E5 and E15, the main loop's queues and messages, and
//! real-time bytes.

use crate::usb_controller::UsbController;
use crate::usb_driver::{Buffers, Bus, DataToggles, PACKET};
use std::collections::VecDeque;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

/// The USB number of the maker and of the product.
pub const VENDOR_AND_PRODUCT: [u16; 2] = [0x1209, 0x0001];
/// The maker's name.
pub const MANUFACTURER: &str = "penup";
/// The product's name.
pub const PRODUCT: &str = "penup pen plotter";
/// The size of a sent packet, so that no empty one is needed behind it.
const SENT_PACKET: usize = PACKET - 1;
/// The greatest number of bytes that wait to be sent.
const MOST_TO_SEND: usize = 2047;
/// The greatest number of received bytes that wait for room in the line's queue.
const MOST_WAITING: usize = 512;

/// The device and its serial port.
pub struct Port<'b> {
    device: UsbDevice<'b, Bus<UsbController>>,
    class: CdcAcmClass<'b, Bus<UsbController>>,
    toggles: DataToggles<UsbController>,
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

impl<'b> Port<'b> {
    /// Connects the device to the host, with this serial number.
    pub fn new(bus: &'b UsbBusAllocator<Bus<UsbController>>, number: &'b str) -> Self {
        let class = CdcAcmClass::new(bus, PACKET as u16);
        let strings = StringDescriptors::default()
            .manufacturer(MANUFACTURER)
            .product(PRODUCT)
            .serial_number(number);
        let [vendor, product] = VENDOR_AND_PRODUCT;
        let device = UsbDeviceBuilder::new(bus, UsbVidPid(vendor, product))
            .device_class(USB_CLASS_CDC)
            .strings(&[strings])
            .and_then(|builder| builder.max_packet_size_0(64))
            .expect("the strings fit")
            .build();
        device.bus().connect();
        let buffers = Buffers(device.bus().controller().clone());
        Self {
            device,
            class,
            toggles: DataToggles(buffers.clone()),
            buffers,
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

    /// Whether the host has configured the device.
    pub fn is_up(&self) -> bool {
        self.is_up
    }

    /// Whether a program has the port open, according to DTR.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// The received bytes that the line's queue has not taken.
    pub fn waiting(&self) -> Vec<u8> {
        self.waiting.iter().copied().collect()
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
        let unread = self.buffers.unread();
        self.device.bus().look();
        self.device.poll(&mut [&mut self.toggles, &mut self.class]);
        self.buffers.refuse(unread);
        self.follow_state();
        self.follow_port();
        self.receive();
        self.send();
    }

    /// Resets the port for each new host.
    fn follow_state(&mut self) {
        let state = self.device.state();
        let is_up = state == UsbDeviceState::Configured;
        if is_up != self.is_up && state != UsbDeviceState::Suspend {
            self.is_up = is_up;
            self.forget_sent();
        }
    }

    /// Follows whether a program at the host has the port open.
    fn follow_port(&mut self) {
        let is_open = self.class.dtr();
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
            let Ok(count) = self.class.read_packet(&mut packet) else { return };
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
            if self.packet.is_empty() || self.class.write_packet(&self.packet).is_err() {
                return;
            }
            self.sent.push(std::mem::take(&mut self.packet));
        }
    }
}
