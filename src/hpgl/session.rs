//! What has been received of HP-GL by one serial port and waits to be carried out.

use super::handshake::{Handshake, InterfaceError, Request};
use super::interpreter::{Action, Interpreter};
use super::{Answer, Beginning, DAMAGED, ESCAPE, Point, Rectangle, Token};

/// The number of bytes that wait to be carried out, as on the HP 7475A.
pub const RECEIVED_BYTES: usize = 1024;

/// The most bytes that are interpreted in one call.
const BYTES_AT_ONCE: usize = 64;

/// HP-GL by one serial port: the bytes that wait, the interface, and the interpreter.
///
/// A new one consists of zero bits only, so that a static variable takes no flash.
#[derive(Debug)]
pub struct Session {
    received: [u8; RECEIVED_BYTES],
    /// Where the first byte that waits lies.
    first: u16,
    /// The number of bytes that wait.
    count: u16,
    handshake: Handshake,
    interpreter: Interpreter,
    /// The action that is being carried out.
    action: Action,
    /// Whether the user has been asked for the pen or the sheet that it needs.
    has_asked: bool,
    /// Whether bytes were lost since the last call of [`Session::take_loss`].
    has_lost: bool,
}

impl Session {
    /// Creates a session without any bytes. Before use it must begin.
    pub const fn new() -> Self {
        Self {
            received: [0; RECEIVED_BYTES],
            first: 0,
            count: 0,
            handshake: Handshake::new(),
            interpreter: Interpreter::new(),
            action: Action::Nothing,
            has_asked: false,
            has_lost: false,
        }
    }

    /// Begins HP-GL in this way with this byte. Nothing of an earlier session is left. The pen is
    /// at a position, and its travel has these limits, whose lower left corner is 0.
    pub fn begin(&mut self, beginning: Beginning, byte: u8, at: Point, limits: Rectangle) {
        self.forget();
        self.handshake = Handshake::new();
        self.handshake.reset();
        self.interpreter.initialize(at, limits);
        match beginning {
            Beginning::Initialize => b"IN".iter().chain(&[byte]).for_each(|byte| self.put(*byte)),
            Beginning::Escape => [ESCAPE, byte].into_iter().for_each(|byte| self.control(byte)),
            Beginning::Command => {}
        }
    }

    /// Makes the state after `IN`.
    pub fn initialize(&mut self, at: Point, limits: Rectangle) {
        self.interpreter.initialize(at, limits);
    }

    /// Forgets all that waits. A sender that was asked to wait may go on.
    pub fn forget(&mut self) {
        (self.first, self.count) = (0, 0);
        self.interpreter.abandon();
        (self.action, self.has_asked) = (Action::Nothing, false);
    }

    /// Whether the user has been asked for the pen or the sheet that the action needs.
    pub fn has_asked(&self) -> bool {
        self.has_asked
    }

    /// Notes that the user has been asked for it.
    pub fn note_asked(&mut self) {
        self.has_asked = true;
    }

    /// How many more bytes can be received.
    pub fn room(&self) -> usize {
        RECEIVED_BYTES - usize::from(self.count)
    }

    /// Whether all that was received has been carried out.
    pub fn is_idle(&self) -> bool {
        self.count == 0 && self.action == Action::Nothing && self.interpreter.is_idle()
    }

    /// The speed that `VS` has chosen for lines, in cm/s, in units of 2^-16; `None` if it has not.
    pub fn speed(&self) -> Option<i64> {
        self.interpreter.speed()
    }

    /// Receives a byte, which there must be room for.
    pub fn receive(&mut self, byte: u8, token: Token) {
        if token == Token::Control {
            return self.control(byte);
        }
        if self.handshake.is_open() {
            self.handshake.cut();
        }
        if byte == DAMAGED {
            self.has_lost = true;
            self.handshake.fail(InterfaceError::Lost);
        }
        if !self.handshake.takes_enquiry(byte) {
            self.put(byte);
        }
    }

    /// Takes a byte of an instruction to the interface.
    fn control(&mut self, byte: u8) {
        let (room, is_idle) = (self.room() as u16, self.is_idle());
        if self.handshake.push(byte, room, is_idle) == Request::Forget {
            self.forget();
        }
    }

    /// Keeps a byte for the interpreter.
    fn put(&mut self, byte: u8) {
        let last = (usize::from(self.first) + usize::from(self.count)) % RECEIVED_BYTES;
        if usize::from(self.count) < RECEIVED_BYTES
            && let Some(slot) = self.received.get_mut(last)
        {
            *slot = byte;
            self.count += 1;
        }
    }

    /// Takes the first byte that waits.
    fn take(&mut self) -> Option<u8> {
        self.count = self.count.checked_sub(1)?;
        let byte = self.received.get(usize::from(self.first)).copied();
        self.first = ((usize::from(self.first) + 1) % RECEIVED_BYTES) as u16;
        byte
    }

    /// Returns the action that is to be carried out. It stays the same until
    /// [`Session::end_action`]. Even without an action, some bytes may be left.
    pub fn action(&mut self) -> &Action {
        let mut bytes = 0;
        while self.action == Action::Nothing && bytes < BYTES_AT_ONCE {
            bytes += 1;
            if let Some(action) = self.interpreter.next_action() {
                self.action = action;
            } else if let Some(byte) = self.take() {
                self.interpreter.push(byte);
            } else {
                break;
            }
        }
        &self.action
    }

    /// Ends the action.
    pub fn end_action(&mut self) {
        (self.action, self.has_asked) = (Action::Nothing, false);
    }

    /// Ends the action without carrying it out, because the machine is locked.
    pub fn refuse_action(&mut self) {
        self.interpreter.note_locked();
        self.end_action();
    }

    /// Sends an answer of the interpreter.
    pub fn answer(&mut self, answer: &Answer) {
        self.handshake.answer(format_args!("{answer}"));
    }

    /// Tells the sender to wait or to go on if necessary. Returns the bytes that are to be sent.
    /// Call [`Session::clear_output`] after they were sent.
    pub fn output(&mut self) -> &[u8] {
        let (room, is_idle) = (self.room() as u16, self.is_idle());
        self.handshake.regulate(room, is_idle);
        &self.handshake.output
    }

    /// Tells a sender that was asked to wait to go on, because HP-GL ends.
    pub fn release(&mut self) {
        let output = self.handshake.release();
        self.handshake.reset();
        self.handshake.output = output;
    }

    /// Whether bytes wait to be sent.
    pub fn has_output(&self) -> bool {
        !self.handshake.output.is_empty()
    }

    /// Forgets what was sent.
    pub fn clear_output(&mut self) {
        self.handshake.output.clear();
    }

    /// Whether bytes were lost since the last call.
    pub fn take_loss(&mut self) -> bool {
        core::mem::take(&mut self.has_lost)
    }
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}
