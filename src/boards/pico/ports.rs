//! Two serial ports, UART and USB, and one plotter.
//!
//! Either port can be the sender, and each has lines of its own: what comes by one does not touch a
//! line of the other. Replies go to every port that has spoken since the start, before the first byte
//! to both. Real-time bytes count whatever their port, so one port may watch what the other sends.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::protocol::{RealTime, Receiver};

use super::{serial, usb};
use crate::boards::handler::Owned;
use crate::boards::line::{self, Line, ReceiveMerge, Shared};

/// A serial port, by its number.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// UART0.
    Uart = 0,
    /// USB.
    Usb = 1,
}

const COUNT: usize = 2;

/// A bit for each port from which a sound byte has come. The ports' handlers write it, which have one
/// rank.
static SPOKEN: AtomicU8 = AtomicU8::new(0);

static SHARED: [Shared; COUNT] = [const { Shared::new() }; COUNT];

/// What the handlers of both ports share: they have one rank, so none interrupts the other.
static INLETS: Owned<Inlets> = Owned::empty();

/// Where received bytes go in.
pub struct Inlets {
    inlets: [ReceiveMerge; COUNT],
    /// How often ctrl-X has come, by either port; wraps.
    pub aborts: u32,
}

/// The main loop's end.
pub struct Ports {
    lines: [Line; COUNT],
    /// The port whose byte was read last.
    last: usize,
    /// What is sent goes to USB alone.
    is_aside: bool,
    pub uart: serial::Sender,
    pub usb: usb::Sender,
}

/// Makes the inlets; returns the main loop's ends of them.
pub fn set_up() -> [Line; COUNT] {
    let [uart, usb] = &SHARED;
    let ((uart, uart_line), (usb, usb_line)) = (uart.ends(), usb.ends());
    // SAFETY: the ports' interrupts are masked since reset, and this runs once (the queues' cells see
    // to it).
    unsafe { INLETS.fill(Inlets { inlets: [uart, usb], aborts: 0 }) };
    [uart_line, usb_line]
}

/// The inlets.
///
/// # Safety
/// As [`Owned::get`], for the handlers of both ports.
pub unsafe fn inlets() -> Option<&'static mut Inlets> {
    // SAFETY: the caller's.
    unsafe { INLETS.get() }
}

impl Inlets {
    /// Lets a port's receiver take something, and acts on what that asks for in real time.
    pub fn take(&mut self, port: Port, take: impl FnOnce(&mut Receiver) -> RealTime) {
        let receiver = &mut self.inlets[port as usize].receiver;
        let asked = take(receiver);
        if receiver.has_heard() {
            SPOKEN.store(SPOKEN.load(Ordering::Relaxed) | 1 << port as u8, Ordering::Relaxed);
        }
        if asked != RealTime::default() {
            self.aborts = self.aborts.wrapping_add(u32::from(asked.has(RealTime::ABORT)));
            line::ask(asked, &mut self.inlets);
        }
    }

    /// Bytes that a port received are lost here.
    pub fn lose(&mut self, port: Port) {
        self.inlets[port as usize].receiver.lose();
    }

    /// Puts an ordinary byte into a port's queue; gives it back if there is no place.
    pub fn append(&mut self, port: Port, byte: u8) -> Result<(), u8> {
        self.inlets[port as usize].receiver.append(byte)
    }
}

impl Ports {
    /// Joins what the ports' set-up gave.
    pub fn new(lines: [Line; COUNT], uart: serial::Sender, usb: usb::Sender) -> Self {
        Self { lines, last: 0, is_aside: false, uart, usb }
    }

    /// The next ordinary byte and the number of its port: see [`Line::read_byte`]. A port is read on
    /// until nothing waits there or its line ends, then it is the other's turn.
    pub fn read_byte(&mut self) -> Option<(usize, u8)> {
        for _ in 0..COUNT {
            let port = self.last;
            if let Some(byte) = self.lines[port].read_byte() {
                if byte == b'\n' {
                    self.last = (port + 1) % COUNT;
                }
                return Some((port, byte));
            }
            self.last = (port + 1) % COUNT;
        }
        usb::go_on();
        None
    }

    /// What was asked in real time: see [`line::take_real_time`].
    pub fn take_real_time(&mut self) -> RealTime {
        line::take_real_time(&mut self.lines)
    }

    /// Whether so many bytes find room at once where they would be sent.
    pub fn has_room(&mut self, bytes: usize) -> bool {
        (!hears(Port::Uart) || self.uart.has_room(bytes))
            && (!hears(Port::Usb) || self.usb.has_room(bytes))
    }

    /// What is sent from now on goes to USB alone, or again to who has spoken.
    pub fn speak_aside(&mut self, is_aside: bool) {
        self.is_aside = is_aside;
    }

    /// Sends `bytes` to who has spoken.
    pub fn write(&mut self, bytes: &[u8]) {
        if self.is_aside {
            return self.usb.write(bytes);
        }
        if hears(Port::Uart) {
            self.uart.write(bytes);
        }
        if hears(Port::Usb) {
            self.usb.write(bytes);
        }
    }
}

/// Whether replies go to a port.
fn hears(port: Port) -> bool {
    let spoken = SPOKEN.load(Ordering::Relaxed);
    spoken == 0 || spoken & 1 << port as u8 != 0
}
