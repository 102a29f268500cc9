//! The two serial ports, UART and USB, of one plotter.
//!
//! Either port can be the sender, and each has lines of its own: what comes by one port does not
//! affect a line of the other. Replies go to every port that has sent something since the start,
//! and to both before the first byte. Real-time bytes act whatever their port, so one port can
//! monitor what the other sends.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::plotter::Replies;
use penup::protocol::{RealTime, Receiver};

use super::{serial, usb};
use crate::boards::handler::Owned;
use crate::boards::line::{self, ReceiveMerge, SerialInput, Shared};

/// A serial port, by its number.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// UART0, at two pins.
    Uart = 0,
    /// The serial port over USB.
    Usb = 1,
}

/// The number of serial ports, of which both are read.
const COUNT: usize = 2;

/// One bit for each port that has received an undamaged byte. The handlers of the ports write it;
/// they have the same priority.
static HAS_RECEIVED: AtomicU8 = AtomicU8::new(0);

/// For each port, the data that its handler and the main loop share.
static SHARED: [Shared; COUNT] = [const { Shared::new() }; COUNT];

/// The data that the handlers of both ports share. They have the same priority, so neither
/// interrupts the other.
static RECEIVE_SIDE: Owned<ReceiveSide> = Owned::empty();

/// The receive interrupts' side of both ports.
pub struct ReceiveSide {
    /// The receiving end of each port, by its number.
    merges: [ReceiveMerge; COUNT],
    /// The number of times that ctrl-X has come by either port; it wraps.
    pub aborts: u32,
}

/// The main loop's side of both ports: it reads bytes from both as one plotter, and replies to
/// both.
pub struct Ports {
    /// The main loop's ends of the receiving queues.
    lines: [SerialInput; COUNT],
    /// The number of the port where the next byte is looked for first.
    next: usize,
    /// Whether replies go to USB alone, because a program has just opened that port.
    only_to_opened: bool,
    /// The ports to which replies go otherwise.
    replies: Replies,
    /// The end by which the main loop sends bytes to UART0.
    pub uart: serial::Sender,
    /// The end by which the main loop sends bytes to USB.
    pub usb: usb::Sender,
}

/// Creates the receiving ends for the handlers; returns the main loop's ends.
pub fn set_up() -> [SerialInput; COUNT] {
    let [uart, usb] = &SHARED;
    let ((uart, uart_line), (usb, usb_line)) = (uart.ends(), usb.ends());
    // SAFETY: the ports' interrupts are masked since reset, and this runs once (the queues' cells
    // ensure it).
    unsafe { RECEIVE_SIDE.fill(ReceiveSide { merges: [uart, usb], aborts: 0 }) };
    [uart_line, usb_line]
}

/// Returns the receiving ends.
///
/// # Safety
/// As [`Owned::get`], for the handlers of both ports.
pub unsafe fn receive_side() -> Option<&'static mut ReceiveSide> {
    // SAFETY: the caller meets the contract.
    unsafe { RECEIVE_SIDE.get() }
}

impl ReceiveSide {
    /// Passes a port's receiver to `take`, and acts on the real-time requests that it returns.
    pub fn take(&mut self, port: Port, take: impl FnOnce(&mut Receiver) -> RealTime) {
        let receiver = &mut self.merges[port as usize].receiver;
        let requests = take(receiver);
        if receiver.has_heard() {
            HAS_RECEIVED
                .store(HAS_RECEIVED.load(Ordering::Relaxed) | 1 << port as u8, Ordering::Relaxed);
        }
        if requests != RealTime::default() {
            self.aborts = self.aborts.wrapping_add(u32::from(requests.has(RealTime::ABORT)));
            line::ask(requests, &mut self.merges);
        }
    }

    /// Records that bytes received by a port were lost.
    pub fn lose(&mut self, port: Port) {
        self.merges[port as usize].receiver.lose();
    }

    /// Records that a line that a port has not ended was ended in its place.
    pub fn end_line(&mut self, port: Port) {
        self.merges[port as usize].receiver.end_line();
    }

    /// Appends an ordinary byte to the queue of a port; returns it if there is no room.
    pub fn append(&mut self, port: Port, byte: u8) -> Result<(), u8> {
        self.merges[port as usize].receiver.append(byte)
    }
}

impl Ports {
    /// How many more bytes fit into the fuller of the queues.
    pub fn receive_room(&self) -> usize {
        self.lines.iter().map(SerialInput::room).min().unwrap_or(0)
    }

    /// Combines the parts that the set-up of the ports has returned.
    pub fn new(lines: [SerialInput; COUNT], uart: serial::Sender, usb: usb::Sender) -> Self {
        Self { lines, next: 0, only_to_opened: false, replies: Replies::All, uart, usb }
    }

    /// Returns the next ordinary byte and the number of its port: see [`SerialInput::read_byte`].
    /// The ports take turns, so that neither waits for a line of the other, which need not end.
    pub fn read_byte(&mut self) -> Option<(usize, u8)> {
        for _ in 0..COUNT {
            let port = self.next % COUNT;
            self.next = (port + 1) % COUNT;
            if let Some(byte) = self.lines[port].read_byte() {
                return Some((port, byte));
            }
        }
        usb::go_on();
        None
    }

    /// Takes the real-time requests: see [`line::take_real_time`].
    pub fn take_real_time(&mut self) -> RealTime {
        line::take_real_time(&mut self.lines)
    }

    /// Whether there is room at once for this many bytes at every port to which they would be sent.
    pub fn has_room(&mut self, bytes: usize) -> bool {
        (!gets_replies(Port::Uart) || self.uart.has_room(bytes))
            && (!gets_replies(Port::Usb) || self.usb.has_room(bytes))
    }

    /// Sends replies to USB alone from now on, or again to all ports that have sent something.
    pub fn reply_only_to_opened(&mut self, only_to_opened: bool) {
        self.only_to_opened = only_to_opened;
    }

    /// Chooses the ports to which replies go from now on.
    pub fn reply_to(&mut self, replies: Replies) {
        self.replies = replies;
    }

    /// Sends `bytes` to the ports that were chosen, among those that have sent something.
    pub fn write(&mut self, bytes: &[u8]) {
        if self.only_to_opened {
            return self.usb.write(bytes);
        }
        if self.is_chosen(Port::Uart) {
            self.uart.write(bytes);
        }
        if self.is_chosen(Port::Usb) {
            self.usb.write(bytes);
        }
    }

    /// Whether replies go to this port now.
    fn is_chosen(&self, port: Port) -> bool {
        let number = port as usize;
        gets_replies(port)
            && match self.replies {
                Replies::All => true,
                Replies::Only(only) => only == number,
                Replies::Others(not) => not != number,
                Replies::OthersIfAny(not) => {
                    let other = if number == 0 { Port::Usb } else { Port::Uart };
                    not != number || !gets_replies(other)
                }
            }
    }
}

/// Whether the replies to commands are sent to a port.
fn gets_replies(port: Port) -> bool {
    let received = HAS_RECEIVED.load(Ordering::Relaxed);
    received == 0 || received & 1 << port as u8 != 0
}
