//! The reference for the Pico's USB device: the crates `usb-device` and `usbd-serial`, which the
//! firmware had before it had a device of its own, with the driver of the firmware.

use crate::usb_controller::UsbController;
use crate::usb_firmware::driver::{
    Buffers, Bus, Event, FROM_PORT, NOTICE, PACKET, PacketError, TO_0, TO_PORT, buffer_of,
};
use crate::usb_port::SerialDevice;
use std::sync::atomic::{AtomicBool, Ordering};
use usb_device::bus::{PollResult, UsbBus, UsbBusAllocator};
use usb_device::class::{ControlOut, UsbClass};
use usb_device::control::{Recipient, Request, RequestType};
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

/// The USB number of the maker and of the product.
pub const VENDOR_AND_PRODUCT: [u16; 2] = [0x1209, 0x0001];
/// The maker's name.
pub const MANUFACTURER: &str = "penup";
/// The product's name.
pub const PRODUCT: &str = "penup pen plotter";
/// The number of endpoints in each direction.
const ENDPOINTS: usize = 3;
/// The number of the interface to which the port's endpoints belong. The other one is 0.
const DATA_INTERFACE: u16 = 1;

/// The driver of the firmware, as `usb-device` wants it.
pub struct ReferenceBus {
    driver: Bus<UsbController>,
    /// Whether the next reading of endpoint 0 is to read a request.
    has_setup: AtomicBool,
}

impl ReferenceBus {
    /// The driver of a controller, as `usb-device` borrows it.
    pub fn allocator(controller: UsbController) -> UsbBusAllocator<Self> {
        let driver = Bus::new(controller);
        UsbBusAllocator::new(Self { driver, has_setup: AtomicBool::new(false) })
    }
}

/// The driver's error, as one of `usb-device`.
fn error(error: PacketError) -> UsbError {
    match error {
        PacketError::WouldBlock => UsbError::WouldBlock,
        PacketError::Overflow => UsbError::BufferOverflow,
    }
}

impl UsbBus for ReferenceBus {
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
            (EndpointType::Interrupt, UsbDirection::In) => (1, NOTICE),
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

    /// Does nothing: see [`Reference::new`].
    fn enable(&mut self) {}

    fn reset(&self) {
        self.driver.reset();
    }

    fn set_device_address(&self, address: u8) {
        self.driver.set_address(address);
    }

    fn write(&self, endpoint: EndpointAddress, packet: &[u8]) -> Result<usize> {
        self.driver.write(buffer_of(endpoint.into()), packet).map_err(error)?;
        Ok(packet.len())
    }

    fn read(&self, endpoint: EndpointAddress, into: &mut [u8]) -> Result<usize> {
        let buffer = buffer_of(endpoint.into());
        if buffer != TO_0 || !self.has_setup.swap(false, Ordering::Relaxed) {
            return self.driver.read(buffer, into).map_err(error);
        }
        let request = self.driver.read_setup().ok_or(UsbError::WouldBlock)?;
        let into = into.get_mut(..request.len()).ok_or(UsbError::BufferOverflow)?;
        into.copy_from_slice(&request);
        Ok(request.len())
    }

    fn set_stalled(&self, endpoint: EndpointAddress, is_stalled: bool) {
        self.driver.set_halted(buffer_of(endpoint.into()), is_stalled);
    }

    fn is_stalled(&self, endpoint: EndpointAddress) -> bool {
        self.driver.is_halted(buffer_of(endpoint.into()))
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        let Event::Packets { has_setup, finished } = self.driver.look() else {
            return PollResult::Reset;
        };
        self.has_setup.store(has_setup, Ordering::Relaxed);
        if !has_setup && finished == 0 {
            return PollResult::None;
        }
        let (mut ep_in_complete, mut ep_out) = (0, 0);
        for endpoint in 0..ENDPOINTS {
            let bit = |buffer: usize| ((finished >> buffer & 1) as u16) << endpoint;
            ep_in_complete |= bit(2 * endpoint);
            ep_out |= bit(2 * endpoint + 1);
        }
        PollResult::Data { ep_out, ep_in_complete, ep_setup: u16::from(has_setup) }
    }
}

/// Begins anew with DATA0 where USB 2.0 wants it, which `usb-device` does not.
///
/// It must come before the port's own class, which would accept such a request as a rule.
struct DataToggles(Buffers<UsbController>);

impl UsbClass<ReferenceBus> for DataToggles {
    fn control_out(&mut self, transfer: ControlOut<'_, '_, '_, ReferenceBus>) {
        let request = transfer.request();
        let begins_anew = |buffer: usize| match (request.recipient, request.request, request.value)
        {
            (Recipient::Device, Request::SET_CONFIGURATION, 0 | 1) => true,
            (Recipient::Interface, Request::SET_INTERFACE, 0) => request.index == DATA_INTERFACE,
            (Recipient::Endpoint, Request::CLEAR_FEATURE, Request::FEATURE_ENDPOINT_HALT) => {
                buffer_of(request.index as u8) == buffer
            }
            _ => false,
        };
        if request.request_type == RequestType::Standard {
            for buffer in [FROM_PORT, TO_PORT].into_iter().filter(|buffer| begins_anew(*buffer)) {
                self.0.begin_anew(buffer);
            }
        }
    }
}

/// The device of the crates.
pub struct Reference<'b> {
    device: UsbDevice<'b, ReferenceBus>,
    class: CdcAcmClass<'b, ReferenceBus>,
    toggles: DataToggles,
}

impl<'b> Reference<'b> {
    /// Makes the device with this serial number, and connects it to the host.
    pub fn new(bus: &'b UsbBusAllocator<ReferenceBus>, serial_number: &'b str) -> Self {
        let class = CdcAcmClass::new(bus, PACKET as u16);
        let strings = StringDescriptors::default()
            .manufacturer(MANUFACTURER)
            .product(PRODUCT)
            .serial_number(serial_number);
        let [vendor, product] = VENDOR_AND_PRODUCT;
        let device = UsbDeviceBuilder::new(bus, UsbVidPid(vendor, product))
            .device_class(USB_CLASS_CDC)
            .strings(&[strings])
            .and_then(|builder| builder.max_packet_size_0(64))
            .expect("the strings fit")
            .build();
        let driver = &device.bus().driver;
        driver.connect();
        let toggles = DataToggles(driver.buffers().clone());
        Self { device, class, toggles }
    }

    /// The controller.
    pub fn controller(&self) -> &UsbController {
        self.device.bus().driver.controller()
    }
}

impl SerialDevice for Reference<'_> {
    fn poll(&mut self) {
        let unread = self.toggles.0.unread();
        self.device.poll(&mut [&mut self.toggles, &mut self.class]);
        self.toggles.0.refuse(unread);
    }

    fn is_configured(&self) -> bool {
        self.device.state() == UsbDeviceState::Configured
    }

    fn dtr(&self) -> bool {
        self.class.dtr()
    }

    fn line_coding(&self) -> (u32, [u8; 3]) {
        let coding = self.class.line_coding();
        let codes = [coding.stop_bits() as u8, coding.parity_type() as u8, coding.data_bits()];
        (coding.data_rate(), codes)
    }

    fn read_packet(&mut self, into: &mut [u8]) -> Option<usize> {
        self.class.read_packet(into).ok()
    }

    fn write_packet(&mut self, packet: &[u8]) -> bool {
        self.class.write_packet(packet).is_ok()
    }
}
