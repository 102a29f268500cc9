//! The Pico's serial port by USB, and beside it the same port with the reference device. Whatever
//! the host does, it does to both, and both must be the same in everything that it can see.
//!
//! Behind each step of the host and of the program are compared: the answer; all registers and the
//! whole memory of the two controllers, which hold the packets, the control words with the data
//! toggles and the stalls, and the address; the state of the port, its line coding, the bytes that
//! it has received and the packets that it has sent.

use crate::usb_controller::{Answer, Handshake, UsbController};
use crate::usb_firmware::device::Device;
use crate::usb_port::{Port, SerialDevice};
use crate::usb_reference::{Reference, ReferenceBus};
use std::fmt::Debug;
use usb_device::bus::UsbBusAllocator;

/// The device of the firmware and that of the crates, each with its port and its controller.
pub struct Twins<'b> {
    own: Port<Device<'b, UsbController>>,
    reference: Port<Reference<'b>>,
}

/// Compares what the two have answered, and returns it.
fn same<T: PartialEq + Debug>(own: T, reference: T, what: &str) -> T {
    assert_eq!(own, reference, "the device and the reference differ in {what}");
    own
}

impl<'b> Twins<'b> {
    /// The driver of the reference, which [`Twins::new`] borrows.
    pub fn allocator() -> UsbBusAllocator<ReferenceBus> {
        ReferenceBus::allocator(UsbController::default())
    }

    /// Connects both devices to the host, with this serial number.
    pub fn new(bus: &'b UsbBusAllocator<ReferenceBus>, serial_number: &'b str) -> Self {
        let controller = UsbController::default();
        let own = Port::new(Device::new(controller.clone(), serial_number), controller);
        let reference = Reference::new(bus, serial_number);
        let controller = reference.controller().clone();
        let twins = Self { own, reference: Port::new(reference, controller) };
        twins.compare();
        twins
    }

    /// Compares all that the host can see.
    fn compare(&self) {
        let (own, reference) = (&self.own, &self.reference);
        if let Some(difference) = own.bus().difference(reference.bus()) {
            panic!("the device and the reference differ in {difference}");
        }
        same(own.is_up(), reference.is_up(), "whether they are configured");
        same(own.is_open(), reference.is_open(), "whether the port is open");
        let coding = SerialDevice::line_coding(own.device());
        same(coding, reference.device().line_coding(), "the line coding");
        same(&own.received, &reference.received, "the bytes for the line");
        same(own.waiting(), reference.waiting(), "the bytes that wait");
        same(&own.sent, &reference.sent, "the packets that were sent");
        same(own.has_to_send(), reference.has_to_send(), "whether bytes are to be sent");
    }

    /// Lets the host do something to both.
    fn both<T: PartialEq + Debug>(&self, what: &str, act: impl Fn(&UsbController) -> T) -> T {
        let answer = same(act(self.own.bus()), act(self.reference.bus()), what);
        self.compare();
        answer
    }

    /// Sends a SETUP packet.
    pub fn set_up(&self, request: [u8; 8]) {
        self.both("nothing", |bus| bus.set_up(request));
    }

    /// Asks an endpoint for a packet.
    pub fn ask(&self, endpoint: usize) -> Answer {
        self.both("the answer", |bus| bus.ask(endpoint))
    }

    /// Sends an endpoint a packet.
    pub fn give(&self, endpoint: usize, is_data_1: bool, packet: &[u8]) -> Handshake {
        self.both("the handshake", |bus| bus.give(endpoint, is_data_1, packet))
    }

    /// Begins and ends a reset of the bus.
    pub fn reset_bus(&self) {
        self.both("nothing", UsbController::reset_bus);
    }

    /// Suspends the bus.
    pub fn suspend_bus(&self) {
        self.both("nothing", UsbController::suspend_bus);
    }

    /// Resumes the bus.
    pub fn resume_bus(&self) {
        self.both("nothing", UsbController::resume_bus);
    }

    /// Does all the work of the ports.
    pub fn serve(&mut self) {
        self.own.serve();
        self.reference.serve();
        self.compare();
    }

    /// Sends bytes, as far as there is room for them.
    pub fn write(&mut self, bytes: &[u8]) {
        self.own.write(bytes);
        self.reference.write(bytes);
    }

    /// Lets the queue of the line be full, or not.
    pub fn set_line_full(&mut self, is_full: bool) {
        self.own.is_line_full = is_full;
        self.reference.is_line_full = is_full;
    }

    /// Whether the queue of the line is full.
    pub fn is_line_full(&self) -> bool {
        self.own.is_line_full
    }

    /// Forgets the bytes that the queue of the line has taken.
    pub fn forget_received(&mut self) {
        self.own.received.clear();
        self.reference.received.clear();
    }

    /// Forgets the packets that the controllers have taken.
    pub fn forget_sent(&mut self) {
        self.own.sent.clear();
        self.reference.sent.clear();
    }

    /// Forgets the last packet that the controllers have taken.
    pub fn forget_last_sent(&mut self) {
        self.own.sent.pop();
        self.reference.sent.pop();
    }

    /// The port of the firmware, which is like the other one.
    pub fn port(&self) -> &Port<Device<'b, UsbController>> {
        &self.own
    }
}
