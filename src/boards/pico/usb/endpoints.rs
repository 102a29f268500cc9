//! Does with the buffers of the endpoints what the controller's driver and the crate `usb-device`
//! leave undone.
//!
//! * A packet that the host has not taken is taken back: see [`take_back`].
//! * A packet for which the port has no room waits in the controller: see [`leave`].
//! * Data at endpoint 0 that nobody reads are refused: see [`refuse`].
//! * Packets begin anew with DATA0 where USB 2.0 wants it: see [`DataToggles`].
//!
//! This works on any controller with the control words of the RP2040 (data sheet, section 4.1.2.5),
//! so the tests of the host run this very file.

use usb_device::bus::UsbBus;
use usb_device::class::{ControlOut, UsbClass};
use usb_device::control::{Recipient, Request, RequestType};
use usb_device::endpoint::EndpointAddress;

/// Bits of the control word of an endpoint's buffer.
pub mod control_word {
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

/// The buffer of endpoint 0 whose packets the host takes.
const FROM_0: usize = 0;
/// The buffer of endpoint 0 that the host fills.
const TO_0: usize = 1;
/// The most bytes of data from the host for which `usb-device` has room in one request.
const MOST_DATA: u32 = 128;
/// The number of the interface to which the port's endpoints belong. The other one is 0.
const DATA_INTERFACE: u16 = 1;

/// The registers of a USB controller that belong to the buffers. Buffer 2 n is that of endpoint n
/// whose packets the host takes, and buffer 2 n + 1 the one that the host fills.
pub trait Buffers {
    /// Returns one bit for each buffer that the host has taken or filled since the bit was cleared.
    fn finished(&self) -> u32;
    /// Clears these bits.
    fn clear_finished(&self, bits: u32);
    /// Returns the control word of a buffer.
    fn control(&self, buffer: usize) -> u32;
    /// Writes the control word of a buffer.
    fn put_control(&self, buffer: usize, word: u32);
    /// Returns the two words of the host's last request.
    fn setup(&self) -> [u32; 2];
    /// Whether the driver has not seen that request yet.
    fn has_setup(&self) -> bool;
    /// Lets endpoint 0 refuse packets, where its control words say so, until the next request.
    fn arm_stall(&self);
    /// Waits until a packet that has already begun is over.
    fn wait_for_packet(&self);
}

/// The number of the buffer of an endpoint, below 32.
fn buffer_of(endpoint: EndpointAddress) -> usize {
    2 * (endpoint.index() & 0xF) + usize::from(endpoint.is_out())
}

/// Whether the host has taken or filled the buffer of this endpoint, and the driver has not seen
/// it yet.
pub fn is_finished(buffers: &impl Buffers, endpoint: EndpointAddress) -> bool {
    buffers.finished() & 1 << buffer_of(endpoint) != 0
}

/// Leaves a packet from the host in the controller, until there is room for it. Its interrupt is
/// cleared so that it does not come again and again.
pub fn leave(buffers: &impl Buffers, endpoint: EndpointAddress) {
    buffers.clear_finished(1 << buffer_of(endpoint));
}

/// Takes back a packet that the controller holds for the host, unless the host is taking it just
/// now. Returns whether there was one to take back.
pub fn take_back(buffers: &impl Buffers, endpoint: EndpointAddress) -> bool {
    use control_word::{AVAILABLE, FULL, IS_DATA_1};
    let buffer = buffer_of(endpoint);
    let word = buffers.control(buffer);
    if word & AVAILABLE == 0 {
        return false;
    }
    buffers.put_control(buffer, word & !AVAILABLE);
    buffers.wait_for_packet();
    if is_finished(buffers, endpoint) {
        return false;
    }
    // The next packet must have the data toggle of this one, which was never sent; the driver will
    // flip it.
    buffers.put_control(buffer, word & !(AVAILABLE | FULL) ^ IS_DATA_1);
    true
}

/// Returns the control word of a packet at endpoint 0 that the driver has not read, if there is
/// one and no request has come after it. Packets that follow each other differ in their data
/// toggle.
pub fn unread(buffers: &impl Buffers) -> Option<u32> {
    let is_left = buffers.finished() & 1 << TO_0 != 0 && !buffers.has_setup();
    is_left.then(|| buffers.control(TO_0))
}

/// Whether the driver has seen a request with more data from the host than `usb-device` has room
/// for.
fn is_too_long(buffers: &impl Buffers) -> bool {
    let [low, high] = buffers.setup();
    let is_from_device = low & 0x80 != 0;
    let length = high >> 16;
    !is_from_device && length > MOST_DATA && !buffers.has_setup()
}

/// Refuses data at endpoint 0 that `usb-device` neither reads nor refuses, until the next request.
/// Otherwise their interrupt would come without an end, or they would be taken for those of an
/// earlier request. Call it after the device was polled; `before` is what [`unread`] returned
/// before.
///
/// Such data are those of a request that is too long, and data that no request has announced.
pub fn refuse(buffers: &impl Buffers, before: Option<u32>) {
    let is_unread = before.is_some() && before == unread(buffers);
    if !is_unread && !is_too_long(buffers) {
        return;
    }
    for buffer in [FROM_0, TO_0] {
        buffers.put_control(buffer, buffers.control(buffer) | control_word::STALL);
    }
    buffers.arm_stall();
    buffers.clear_finished(1 << TO_0);
}

/// Begins anew with DATA0 when the host configures the device, chooses the setting of the port's
/// interface or lifts the halt of an endpoint (USB 2.0, sections 9.1.1.5 and 9.4.5). Neither
/// `usb-device` nor the driver does, and then a packet would be lost where the host's data toggle
/// differs.
///
/// It must come before the port's own class, which would accept such a request as a rule.
pub struct DataToggles<R> {
    buffers: R,
    endpoints: [EndpointAddress; 2],
}

impl<R: Buffers> DataToggles<R> {
    /// Takes care of these endpoints.
    pub fn new(buffers: R, endpoints: [EndpointAddress; 2]) -> Self {
        Self { buffers, endpoints }
    }

    /// Makes the next packet of an endpoint DATA0, even if it is waiting for the host already. The
    /// host exchanges no packet with the endpoint until its request is confirmed.
    fn begin_anew(&self, endpoint: EndpointAddress) {
        use control_word::{AVAILABLE, IS_DATA_1};
        let buffer = buffer_of(endpoint);
        let word = self.buffers.control(buffer);
        // The driver flips the toggle when it writes a packet, and when it has read one.
        let toggle = if word & AVAILABLE != 0 { 0 } else { IS_DATA_1 };
        self.buffers.put_control(buffer, word & !IS_DATA_1 | toggle);
    }
}

impl<B: UsbBus, R: Buffers> UsbClass<B> for DataToggles<R> {
    fn control_out(&mut self, transfer: ControlOut<'_, '_, '_, B>) {
        let request = *transfer.request();
        let begins_anew = |endpoint: &EndpointAddress| match (
            request.recipient,
            request.request,
            request.value,
        ) {
            (Recipient::Device, Request::SET_CONFIGURATION, 0 | 1) => true,
            (Recipient::Interface, Request::SET_INTERFACE, 0) => request.index == DATA_INTERFACE,
            (Recipient::Endpoint, Request::CLEAR_FEATURE, Request::FEATURE_ENDPOINT_HALT) => {
                request.index & 0x8F == u16::from(u8::from(*endpoint))
            }
            _ => false,
        };
        if request.request_type == RequestType::Standard {
            for endpoint in self.endpoints.into_iter().filter(begins_anew) {
                self.begin_anew(endpoint);
            }
        }
    }
}
