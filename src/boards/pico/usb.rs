//! The second serial port: USB, of the class CDC-ACM, for which every system has a driver.
//!
//! Bytes that find no place wait in the controller, and the host waits with the rest; none is lost.
//! What is sent waits in a queue. If the host takes nothing for [`PATIENCE`] although the queue is full, it counts
//! as gone, and what would be sent is dropped until it takes something again: nobody may keep the steps waiting.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};
use rp2040_hal::clocks::UsbClock;
use rp2040_hal::pac::{Interrupt, RESETS, USBCTRL_DPRAM, USBCTRL_REGS, interrupt};
use rp2040_hal::usb::UsbBus;
use static_cell::StaticCell;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

use super::ports::{self, Inlet, Port};
use super::registers::USB;
use super::{clock, critical};
use crate::boards::handler::Owned;
use crate::boards::line::ABORT;

/// For tests and for projects without a number of their own: <https://pid.codes/1209/0001>.
const VENDOR_AND_PRODUCT: UsbVidPid = UsbVidPid(0x1209, 0x0001);
const PACKET: usize = 64;
/// A full packet would need an empty one after it, for the host to see the end.
const SENT_PACKET: usize = PACKET - 1;
/// Bytes that wait to be sent, at most; one more place than that, for the queue.
const SENT_PLACES: usize = 2048;
/// In microseconds. A host takes a packet a millisecond when it is busy.
const PATIENCE: u32 = 20_000;

/// The register of the controller's that tells of filled and emptied packets.
const PACKETS_DONE: usize = 0x58;

static BUS: StaticCell<UsbBusAllocator<UsbBus>> = StaticCell::new();
static QUEUE: StaticCell<Queue<u8, SENT_PLACES>> = StaticCell::new();
static DEVICE: Owned<Device> = Owned::empty();

/// The host takes nothing. The main loop sets it, the handler clears it.
static HOST_IS_GONE: AtomicBool = AtomicBool::new(true);
/// Received bytes wait for a place. The handler writes it.
static BYTES_WAIT: AtomicBool = AtomicBool::new(false);

struct Device {
    device: UsbDevice<'static, UsbBus>,
    class: CdcAcmClass<'static, UsbBus>,
    is_up: bool,
    /// Received bytes that wait for a place.
    waiting: Vec<u8, PACKET>,
    to_send: Consumer<'static, u8>,
    /// Bytes that the controller has not taken yet.
    packet: Vec<u8, SENT_PACKET>,
}

/// The main loop's end of what is sent.
pub struct Sender(Producer<'static, u8>);

/// Shows the device to the host. `ports` is set up.
///
/// # Panics
/// Never: the strings fit.
pub fn set_up(
    nvic: &mut NVIC,
    controller: (USBCTRL_REGS, USBCTRL_DPRAM),
    clock: UsbClock,
    resets: &mut RESETS,
) -> Sender {
    const POWERED: bool = true; // The Pico's power comes from there; the pin that would tell is in use.
    let bus: &UsbBusAllocator<_> = BUS.init(UsbBusAllocator::new(UsbBus::new(
        controller.0,
        controller.1,
        clock,
        POWERED,
        resets,
    )));
    let class = CdcAcmClass::new(bus, PACKET as u16);
    let strings = StringDescriptors::default()
        .manufacturer("penup")
        .product("penup pen plotter")
        .serial_number("pico");
    let builder = UsbDeviceBuilder::new(bus, VENDOR_AND_PRODUCT).device_class(USB_CLASS_CDC);
    let builder = builder.strings(&[strings]).and_then(|builder| builder.max_packet_size_0(64));
    let (sent, to_send) = QUEUE.init(Queue::new()).split();
    if let Ok(builder) = builder {
        let device = Device {
            device: builder.build(),
            class,
            is_up: false,
            waiting: Vec::new(),
            to_send,
            packet: Vec::new(),
        };
        // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell sees to it).
        unsafe { DEVICE.fill(device) };
        critical::enable(nvic, Interrupt::USBCTRL_IRQ, critical::SERIAL_PRIORITY);
    }
    Sender(sent)
}

impl Sender {
    /// Sends `bytes`; waits while the queue is full, but not for a host that is gone.
    pub fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let began = clock::microseconds();
            while !HOST_IS_GONE.load(Ordering::Relaxed) && self.0.enqueue(byte).is_err() {
                critical_section::with(|_| serve());
                if clock::microseconds().wrapping_sub(began) > PATIENCE {
                    HOST_IS_GONE.store(true, Ordering::Relaxed);
                }
            }
        }
        if !HOST_IS_GONE.load(Ordering::Relaxed) {
            critical_section::with(|_| serve());
        }
    }
}

/// Takes bytes in that found no place, if there are any. Called by the main loop.
pub fn go_on() {
    if BYTES_WAIT.load(Ordering::Relaxed) {
        critical_section::with(|_| serve());
    }
}

/// All that there is to do. Called by the handler, or where it and that of the other port are masked.
fn serve() {
    // SAFETY: by the contract above.
    if let (Some(device), Some(inlet)) = unsafe { (DEVICE.get(), ports::inlet()) } {
        // Polling forgets it.
        let took = device.class.write_ep().address().index();
        let took = USB.read(PACKETS_DONE) & 1 << (2 * took) != 0;
        device.device.poll(&mut [&mut device.class]);
        device.follow_state();
        if took {
            device.welcome_back();
        }
        device.take_in(inlet);
        device.send();
    }
}

impl Device {
    /// Begins anew with each host.
    fn follow_state(&mut self) {
        let is_up = self.device.state() == UsbDeviceState::Configured;
        if is_up != self.is_up {
            self.is_up = is_up;
            self.forget_sent();
            self.waiting.clear();
            HOST_IS_GONE.store(!is_up, Ordering::Relaxed);
        }
    }

    fn forget_sent(&mut self) {
        self.packet.clear();
        while self.to_send.dequeue().is_some() {}
    }

    /// The host took a packet. What it missed if it was gone would be half of something.
    fn welcome_back(&mut self) {
        if HOST_IS_GONE.load(Ordering::Relaxed) {
            self.forget_sent();
            HOST_IS_GONE.store(false, Ordering::Relaxed);
        }
    }

    fn take_in(&mut self, inlet: &mut Inlet) {
        loop {
            let taken = self
                .waiting
                .iter()
                .take_while(|&&byte| inlet.append(Port::Usb, byte).is_ok())
                .count();
            self.waiting.drain(..taken);
            if !self.waiting.is_empty() {
                // The next packet waits in the controller; only its interrupt must not come for ever.
                let number = self.class.read_ep().address().index();
                USB.write(PACKETS_DONE, 1 << (2 * number + 1));
                break;
            }
            let mut packet = [0; PACKET];
            let Ok(count) = self.class.read_packet(&mut packet) else { break };
            for &byte in packet.iter().take(count) {
                if let Some(byte) = inlet.sort_out(Port::Usb, byte) {
                    // As many as the packet, so there is a place.
                    let _ = self.waiting.push(byte);
                } else if byte == ABORT {
                    self.waiting.clear();
                }
            }
        }
        BYTES_WAIT.store(!self.waiting.is_empty(), Ordering::Relaxed);
    }

    fn send(&mut self) {
        if !self.is_up {
            return self.forget_sent();
        }
        loop {
            while !self.packet.is_full()
                && let Some(byte) = self.to_send.dequeue()
            {
                let _ = self.packet.push(byte); // There is a place.
            }
            if self.packet.is_empty() || self.class.write_packet(&self.packet).is_err() {
                return;
            }
            self.packet.clear();
        }
    }
}

#[interrupt]
fn USBCTRL_IRQ() {
    serve();
}
