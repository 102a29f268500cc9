//! Two serial ports, UART and USB, and one plotter.
//!
//! Either port can be the sender. Replies go to every port that has spoken since the start, before the first byte
//! to both. Real-time bytes count whatever their port, so one port may watch what the other sends. A
//! line that a byte of the other port interrupts is void: it is refused, and the new one is read from its beginning.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::protocol::RealTime;

use super::{serial, usb};
use crate::boards::handler::Owned;
use crate::boards::line::{self, Line, Receiver};

/// A serial port, by its bit.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Port {
    /// UART0.
    Uart = 1,
    /// USB.
    Usb = 2,
}

/// A bit for each port from which a byte has come. The ports' handlers write it, which have one rank.
static SPOKEN: AtomicU8 = AtomicU8::new(0);

/// What the handlers of both ports share: they have one rank, so none interrupts the other.
static INLET: Owned<Inlet> = Owned::empty();

/// Where received bytes go in.
pub struct Inlet {
    receiver: Receiver,
    /// The port of a line that has not ended.
    line_of: Option<Port>,
}

/// The main loop's end.
pub struct Ports {
    line: Line,
    /// What is sent goes to USB alone.
    is_aside: bool,
    pub uart: serial::Sender,
    pub usb: usb::Sender,
}

/// Makes the inlet; returns the main loop's end of it.
pub fn set_up() -> Line {
    let (receiver, line) = line::ends();
    // SAFETY: the ports' interrupts are masked since reset, and this runs once (the line's ends see to it).
    unsafe { INLET.fill(Inlet { receiver, line_of: None }) };
    line
}

/// The inlet.
///
/// # Safety
/// As [`Owned::get`], for the handlers of both ports.
pub unsafe fn inlet() -> Option<&'static mut Inlet> {
    // SAFETY: the caller's.
    unsafe { INLET.get() }
}

impl Inlet {
    /// Takes a byte in; it is lost if there is no place, and a flag says so.
    pub fn receive(&mut self, port: Port, byte: u8) {
        self.note(port);
        self.follow(port, byte);
        self.receiver.receive(byte);
    }

    /// Notes what a real-time byte asks for, and gives an ordinary byte back.
    pub fn sort_out(&mut self, port: Port, byte: u8) -> Option<u8> {
        self.note(port);
        self.receiver.sort_out(byte)
    }

    /// Takes an ordinary byte in; gives it back if there is no place.
    pub fn append(&mut self, port: Port, byte: u8) -> Result<(), u8> {
        self.follow(port, byte);
        self.receiver.append(byte)
    }

    fn note(&mut self, port: Port) {
        SPOKEN.store(SPOKEN.load(Ordering::Relaxed) | port as u8, Ordering::Relaxed);
    }

    /// Makes a line void that another port has begun.
    fn follow(&mut self, port: Port, byte: u8) {
        /// In no text: the line is refused.
        const VOID: u8 = 0xFF;
        if self.line_of.is_some_and(|other| other != port) {
            self.receiver.receive(VOID);
            self.receiver.receive(b'\n');
            self.line_of = None;
        }
        match byte {
            b'\n' | b'\r' => self.line_of = None,
            _ => self.line_of = Some(port),
        }
    }
}

impl Ports {
    /// Joins what the ports' set-up gave.
    pub fn new(line: Line, uart: serial::Sender, usb: usb::Sender) -> Self {
        Self { line, is_aside: false, uart, usb }
    }

    /// The next ordinary byte: see [`Line::read_byte`].
    pub fn read_byte(&mut self) -> Option<u8> {
        let byte = self.line.read_byte();
        if byte.is_none() {
            usb::go_on();
        }
        byte
    }

    /// What was asked in real time: see [`Line::take_real_time`].
    pub fn take_real_time(&mut self) -> RealTime {
        self.line.take_real_time()
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
        let spoken = SPOKEN.load(Ordering::Relaxed);
        let hears = |port: Port| spoken == 0 || spoken & port as u8 != 0;
        if hears(Port::Uart) {
            self.uart.write(bytes);
        }
        if hears(Port::Usb) {
            self.usb.write(bytes);
        }
    }
}
