//! The second serial port: USB of the class CDC-ACM, for which every operating system has a driver.
//!
//! Received bytes that find no room in the line's queue wait in a queue of this module. When that
//! is full too, the controller refuses further packets, so that the host waits with the rest. No
//! byte is lost, even when the host suspends the bus or closes the port. Real-time bytes act as
//! soon as their packet is received.
//!
//! Sent bytes wait in a queue. If the host takes nothing for [`HOST_TIMEOUT`] although the queue is
//! full, it counts as gone. Then bytes to be sent are discarded until it takes something again,
//! because nothing may delay the steps; lines are discarded as a whole, and when the host takes
//! bytes again, it is told with the next packet: see [`MISSED`]. The same holds after a program has
//! closed the port (DTR has fallen): replies that it has not taken are discarded, and so is the
//! rest of a line that it has not ended, but nobody is told. A program that opens the port (DTR
//! rises) gets a greeting, which goes only to it: see [`take_opened`].
//!
//! The controller is driven by [`driver`], and [`device`] answers the host's requests. Two of the
//! chip's errata are worked around: see
//! [`connection`] for E5, which takes GPIO 15 for a millisecond when a host resets the bus, and
//! [`frame`] for E15. E2 does not matter, because no endpoint is aborted, nor do E3 and E4, which
//! are those of a host.

mod connection;
mod device;
mod driver;
mod frame;

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::{Deque, Vec};
use penup::byte_queue::{ByteQueue, Consumer, Producer};
use penup::protocol::{DAMAGED, RealTime};
use rp2040_hal::pac::{Interrupt, interrupt};
use static_cell::StaticCell;

use self::connection::Connection;
use self::driver::{Controller, PACKET, Register};
use self::frame::Frame;
pub use self::frame::forget as forget_frame;
use super::ports::{self, Port, ReceiveSide};
use super::registers::{self, Get, Put, USB, USB_MEMORY, reset};
use super::{clock, critical, divider};
use crate::boards::fault::once;
use crate::boards::handler::Owned;
use crate::boards::peripheral::Offset;

/// The size of a sent packet. After a full packet, an empty one would be needed for the host to see
/// the end.
const SENT_PACKET: usize = PACKET - 1;
/// The number of slots in the queue of bytes to send, one of which stays empty.
const SENT_SLOTS: usize = 2048;
/// The time, in microseconds, after which a host that takes nothing counts as gone. A busy host
/// takes a packet every millisecond.
const HOST_TIMEOUT: u32 = 20_000;

/// The greatest number of received bytes that wait for room in the line's queue.
const WAITING_SLOTS: usize = 512;
/// What a program is told that was not there to take its replies. It fits into a packet.
const MISSED: &[u8] = b"\r\n[MSG:replies were lost: they were not read]\r\n";
const _: () = assert!(MISSED.len() <= SENT_PACKET);
/// The baud rate of the touch: whoever opens the port at this rate and closes it asks for the drive
/// for a new image, as with an Arduino.
const TOUCH_RATE: u32 = 1200;

/// The bit of the controller's interrupts for a reset of the bus.
const BUS_RESET: u32 = 1 << 12;

/// The queue of bytes to send.
static QUEUE: StaticCell<ByteQueue<SENT_SLOTS>> = StaticCell::new();
/// The serial line, which belongs to the USB handler.
static LINE: Owned<UsbLine> = Owned::empty();

/// Whether the host takes nothing. The main loop sets it, and the handler clears it.
static HOST_IS_GONE: AtomicBool = AtomicBool::new(true);
/// Whether bytes to be sent were discarded since a program opened the port. The main loop sets it,
/// and the handler clears it.
static HAS_MISSED: AtomicBool = AtomicBool::new(false);
/// Whether received bytes wait for room, or a bus reset has not ended yet. The handler writes it.
static IS_WAITED: AtomicBool = AtomicBool::new(false);
/// Whether a program has opened the port. The handler sets it, and the main loop clears it.
static WAS_OPENED: AtomicBool = AtomicBool::new(false);
/// Whether a program has opened the port at [`TOUCH_RATE`] and closed it. The handler sets it, and
/// the main loop clears it.
static WAS_TOUCHED: AtomicBool = AtomicBool::new(false);

/// The serial line: the USB device and what it needs of the chip.
struct UsbLine {
    /// The USB device, whose only function is a serial port.
    device: device::Device<'static, Chip>,
    /// Whether the host has configured the device, so that bytes can be exchanged.
    is_up: bool,
    /// Whether a program has the port open, according to DTR.
    is_open: bool,
    /// Connects the board to the bus in spite of the chip's erratum E5.
    connection: Connection,
    /// Whether the host resets the bus and the interrupt that reports it is masked.
    awaits_bus: bool,
    /// Says when a packet may be sent in spite of the chip's erratum E15.
    frame: Frame,
    /// The received bytes that wait for room in the queue of the main loop.
    waiting: Deque<u8, WAITING_SLOTS>,
    /// The last received byte, or the end of a line before the first one.
    last: u8,
    /// The value of [`ReceiveSide::aborts`] when it was last read.
    aborts: u32,
    /// The bytes to send, as the handler takes them from the queue.
    to_send: Consumer<'static>,
    /// The bytes of the next packet, which the controller has not taken yet.
    packet: Vec<u8, SENT_PACKET>,
}

/// Sends bytes by USB: the main loop's side of the queue of bytes to send.
pub struct Sender {
    /// Where the main loop puts the bytes to send.
    bytes: Producer<'static>,
    /// The time since which there has been no room, in microseconds, and the number of bytes that
    /// waited then.
    full: Option<(u32, usize)>,
    /// Whether a byte of the present line was discarded, so that the rest of it is, too.
    is_cut: bool,
}

/// Connects the device to the host, with this serial number. `ports` must be set up, the clock of
/// the controller must run at 48 MHz, and the pins must be out of reset.
pub fn set_up(nvic: &mut NVIC, number: &'static str) -> Sender {
    registers::restart(reset::USBCTRL | reset::SYSINFO);
    let (sent, to_send) = once(QUEUE.try_init(ByteQueue::new())).split();
    let line = UsbLine {
        device: device::Device::new(Chip, number),
        is_up: false,
        is_open: false,
        connection: Connection::new(),
        awaits_bus: false,
        frame: Frame::new(),
        waiting: Deque::new(),
        last: b'\n',
        aborts: 0,
        to_send,
        packet: Vec::new(),
    };
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell ensures
    // it).
    unsafe { LINE.fill(line) };
    critical::enable(nvic, Interrupt::USBCTRL_IRQ, critical::SERIAL_PRIORITY);
    Sender { bytes: sent, full: None, is_cut: false }
}

impl Sender {
    /// Whether there is room at once for this many bytes. If there is not, and the host takes
    /// nothing for [`HOST_TIMEOUT`], the host counts as gone.
    pub fn has_room(&mut self, bytes: usize) -> bool {
        let waiting = self.bytes.len();
        if HOST_IS_GONE.load(Ordering::Relaxed) || self.bytes.room() >= bytes {
            self.full = None;
            return true;
        }
        let now = clock::microseconds();
        match self.full {
            Some((since, before)) if before == waiting => {
                if now.wrapping_sub(since) > HOST_TIMEOUT {
                    HOST_IS_GONE.store(true, Ordering::Relaxed);
                }
            }
            _ => self.full = Some((now, waiting)),
        }
        false
    }

    /// Sends `bytes`. It waits while the queue is full, but not for a host that is gone. A program
    /// that has opened the port gets nothing before its greeting: what is answered until then was
    /// requested by the one before.
    pub fn write(&mut self, bytes: &[u8]) {
        let is_for_another = WAS_OPENED.load(Ordering::Relaxed);
        for &byte in bytes {
            if !self.is_cut && !is_for_another && self.enqueue(byte) {
                continue;
            }
            self.is_cut = byte != b'\n';
            if !is_for_another {
                HAS_MISSED.store(true, Ordering::Relaxed);
            }
        }
        if !HOST_IS_GONE.load(Ordering::Relaxed) {
            critical_section::with(|_| serve());
        }
    }

    /// Puts a byte into the queue, when there is room. Returns whether it was, because the host is
    /// there.
    fn enqueue(&mut self, byte: u8) -> bool {
        let began = clock::microseconds();
        while !HOST_IS_GONE.load(Ordering::Relaxed) {
            if self.bytes.enqueue(byte).is_ok() {
                return true;
            }
            critical_section::with(|_| serve());
            if clock::microseconds().wrapping_sub(began) > HOST_TIMEOUT {
                HOST_IS_GONE.store(true, Ordering::Relaxed);
            }
        }
        false
    }
}

/// Moves waiting bytes on, if there are any, and checks whether the bus is ready. The main loop
/// calls it.
pub fn go_on() {
    if IS_WAITED.load(Ordering::Relaxed) {
        critical_section::with(|_| serve());
    }
}

/// Whether a program has opened the port since the last call.
pub fn take_opened() -> bool {
    take(&WAS_OPENED)
}

/// Whether the drive for a new image has been requested since the last call.
pub fn take_touched() -> bool {
    take(&WAS_TOUCHED)
}

/// Reads a flag and clears it. The handler only sets it, so nothing is lost if the handler runs in
/// between.
fn take(flag: &AtomicBool) -> bool {
    let is_set = flag.load(Ordering::Relaxed);
    if is_set {
        flag.store(false, Ordering::Relaxed);
    }
    is_set
}

/// Does all the work of the port. It is called by the handler, or where it and the handler of the
/// other port are masked.
fn serve() {
    // SAFETY: by the contract above.
    if let (Some(line), Some(receive_side)) = unsafe { (LINE.get(), ports::receive_side()) } {
        line.frame.follow();
        // This must be read before polling, which clears it.
        let took = line.device.buffers().is_taken();
        if line.connection.is_ready() {
            line.device.poll();
        }
        line.await_bus(USB.intr().get() & BUS_RESET != 0);
        line.follow_state();
        line.follow_port(receive_side);
        if took {
            line.resume_host();
        }
        line.receive(receive_side);
        line.send();
        IS_WAITED.store(line.awaits_bus || !line.waiting.is_empty(), Ordering::Relaxed);
    }
}

impl UsbLine {
    /// Masks or unmasks the interrupt of a bus reset. While the host resets the bus, for some 10 to
    /// 50 ms or for as long as the host has no power, the interrupt would come again at once. So it
    /// is masked, and the main loop checks instead.
    fn await_bus(&mut self, awaits: bool) {
        if awaits != self.awaits_bus {
            self.awaits_bus = awaits;
            if awaits { USB.inte().clear(BUS_RESET) } else { USB.inte().set(BUS_RESET) }
        }
    }

    /// Resets the port for each new host. A host that suspends the bus is still the same
    /// afterwards.
    fn follow_state(&mut self) {
        let is_up = self.device.is_configured();
        if is_up != self.is_up {
            self.is_up = is_up;
            self.forget_sent();
            // The host counts as gone until a program opens the port.
            HOST_IS_GONE.store(true, Ordering::Relaxed);
        }
    }

    /// Follows whether a program at the host has the port open.
    fn follow_port(&mut self, receive_side: &mut ReceiveSide) {
        let is_open = self.device.dtr();
        if is_open == self.is_open {
            return;
        }
        self.is_open = is_open;
        if is_open {
            HOST_IS_GONE.store(false, Ordering::Relaxed);
            // The replies before were for nobody.
            HAS_MISSED.store(false, Ordering::Relaxed);
            WAS_OPENED.store(true, Ordering::Relaxed);
            return;
        }
        HOST_IS_GONE.store(true, Ordering::Relaxed);
        self.forget_sent();
        self.device.buffers().take_back();
        if !matches!(self.last, b'\n' | b'\r') {
            // The unfinished line is refused, and the next one is a separate line. There is room,
            // because packets are read only while there are two slots more than they need.
            receive_side.end_line(Port::Usb);
            // Behind `;` nothing is missing: it ends an instruction of HP-GL, and begins a comment
            // in G-code.
            if self.last != b';' {
                let _ = self.waiting.push_back(DAMAGED);
            }
            let _ = self.waiting.push_back(b'\n');
            self.last = b'\n';
        }
        if self.device.line_coding().data_rate() == TOUCH_RATE {
            WAS_TOUCHED.store(true, Ordering::Relaxed);
        }
    }

    /// Discards the bytes that were to be sent.
    fn forget_sent(&mut self) {
        self.packet.clear();
        while self.to_send.dequeue().is_some() {}
    }

    /// Notes that the host has taken a packet, so that it is there. If bytes were discarded, those
    /// before them that still wait are, too, because they would be incomplete, and it is told.
    fn resume_host(&mut self) {
        if self.is_open && HAS_MISSED.load(Ordering::Relaxed) {
            self.forget_sent();
            let _ = self.packet.extend_from_slice(MISSED); // There is room.
            HAS_MISSED.store(false, Ordering::Relaxed);
        }
        if self.is_open {
            HOST_IS_GONE.store(false, Ordering::Relaxed);
        }
    }

    /// Discards the waiting bytes if ctrl-X has come by either port since the last call.
    fn drop_void(&mut self, receive_side: &ReceiveSide) {
        if self.aborts != receive_side.aborts {
            self.aborts = receive_side.aborts;
            self.last = b'\n';
            self.waiting.clear();
        }
    }

    /// Passes received bytes on to the line's queue, as far as there is room for them, and reads
    /// further packets while there is room for those.
    fn receive(&mut self, receive_side: &mut ReceiveSide) {
        self.drop_void(receive_side);
        loop {
            while let Some(&byte) = self.waiting.front()
                && receive_side.append(Port::Usb, byte).is_ok()
            {
                self.waiting.pop_front();
            }
            if self.waiting.capacity() - self.waiting.len() < PACKET + 2 {
                return self.device.buffers().leave();
            }
            let mut packet = [0; PACKET];
            let Ok(count) = self.device.read_packet(&mut packet) else { return };
            // A host that sends is present, even without DTR.
            if self.is_up && count > 0 {
                HOST_IS_GONE.store(false, Ordering::Relaxed);
            }
            for &byte in packet.iter().take(count) {
                let (waiting, last) = (&mut self.waiting, &mut self.last);
                receive_side.take(Port::Usb, |receiver| match receiver.sort_out(byte) {
                    Ok(byte) => {
                        *last = byte;
                        let _ = waiting.push_back(byte); // There is room.
                        RealTime::default()
                    }
                    Err(requests) => requests,
                });
                self.drop_void(receive_side);
            }
        }
    }

    /// Sends the bytes that wait, as far as the controller takes them.
    fn send(&mut self) {
        if !self.is_up {
            self.frame.stop();
            return self.forget_sent();
        }
        loop {
            while !self.packet.is_full()
                && let Some(byte) = self.to_send.dequeue()
            {
                let _ = self.packet.push(byte); // There is room.
            }
            if self.packet.is_empty() {
                return self.frame.stop();
            }
            if !self.frame.may_send() || self.device.write_packet(&self.packet).is_err() {
                return;
            }
            self.packet.clear();
        }
    }
}

/// The controller of the chip.
#[derive(Clone, Copy)]
struct Chip;

impl Controller for Chip {
    fn get(&self, register: Register) -> u32 {
        match register {
            Register::AddrEndp => USB.addr_endp().get(),
            Register::MainCtrl => USB.main_ctrl().get(),
            Register::SieCtrl => USB.sie_ctrl().get(),
            Register::SieStatus => USB.sie_status().get(),
            Register::BuffStatus => USB.buff_status().get(),
            Register::EpStallArm => USB.ep_stall_arm().get(),
            Register::UsbMuxing => USB.usb_muxing().get(),
            Register::UsbPwr => USB.usb_pwr().get(),
            Register::Intr => USB.intr().get(),
            Register::Inte => USB.inte().get(),
        }
    }

    fn put(&self, register: Register, bits: u32) {
        match register {
            Register::AddrEndp => USB.addr_endp().put(bits),
            Register::MainCtrl => USB.main_ctrl().put(bits),
            Register::SieCtrl => USB.sie_ctrl().put(bits),
            Register::SieStatus => USB.sie_status().put(bits),
            Register::BuffStatus => USB.buff_status().put(bits),
            Register::EpStallArm => USB.ep_stall_arm().put(bits),
            Register::UsbMuxing => USB.usb_muxing().put(bits),
            Register::UsbPwr => USB.usb_pwr().put(bits),
            Register::Intr => {} // It can only be read.
            Register::Inte => USB.inte().put(bits),
        }
    }

    fn word(&self, index: usize) -> u32 {
        USB_MEMORY.read(Offset::of_word(index))
    }

    fn put_word(&self, index: usize, word: u32) {
        USB_MEMORY.write(Offset::of_word(index), word);
    }

    fn delay(&self, cycles: u32) {
        cortex_m::asm::delay(cycles);
    }
}

/// The interrupt of the USB controller: does all the work of the port.
#[interrupt]
fn USBCTRL_IRQ() {
    divider::keep_during(serve);
}
