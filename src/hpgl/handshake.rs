//! The instructions to the interface, `ESC .`: what the plotter answers to them at once, and when
//! it asks the sender to wait.

use super::dialect::has_parameters;
use super::{ESCAPE, RECEIVED_BYTES};
use core::fmt::Write;
use heapless::Vec;

/// The most bytes that wait to be sent.
const OUTPUT: usize = 96;

/// The most parameters of an instruction: a limit, a byte, and ten bytes of a string.
const PARAMETERS: usize = 12;

/// The most bytes of a string that a sender chooses.
const STRING: usize = 10;

/// What an instruction to the interface asks the plotter to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Request {
    /// Nothing more.
    Nothing,
    /// The bytes that wait are to be forgotten (`ESC.K`).
    Forget,
}

/// The errors that `ESC.E` tells by their number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InterfaceError {
    /// The instruction is not known.
    Unknown = 11,
    /// A byte came at a place where it is not allowed.
    BadByte = 12,
    /// A parameter is out of its range.
    BadParameter = 13,
    /// There are too many parameters.
    TooMany = 14,
    /// Bytes were lost or damaged.
    Lost = 15,
}

/// The state of the interface. All its bits may be zero before [`Handshake::reset`].
#[derive(Debug)]
pub(super) struct Handshake {
    /// The progress of an instruction to the interface.
    progress: Progress,
    /// The letter of the instruction.
    letter: u8,
    parameters: [u16; PARAMETERS],
    /// The index of the parameter that is being read.
    index: usize,
    /// The bytes that wait to be sent.
    pub(super) output: Vec<u8, OUTPUT, u8>,
    /// The bytes that end an answer, and the one that begins it; 0 for none.
    terminators: [u8; 2],
    initiator: u8,
    /// The room for bytes at which the sender is asked to wait.
    limit: u16,
    /// The byte by which the sender asks for room, 0 for none.
    enquiry: u8,
    /// Whether an enquiry is also answered immediately.
    responds: bool,
    /// What the sender is told when there is room, and when it is to wait.
    go_on: [u8; STRING],
    wait: [u8; STRING],
    /// Whether the sender has been asked to wait.
    has_stopped: bool,
    /// Whether the sender has asked for room and waits for the answer.
    is_asked: bool,
    /// Whether the sender waits until all bytes have been carried out (`ESC.L`).
    awaits_end: bool,
    /// The number of the last error, 0 for none.
    error: u8,
}

/// The progress of an instruction to the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    None,
    Escape,
    Dot,
    Parameters,
    /// An escape sequence of another language is coming, up to a capital letter.
    Other,
}

impl Handshake {
    /// Consists of zero bits.
    pub(super) const fn new() -> Self {
        Self {
            progress: Progress::None,
            letter: 0,
            parameters: [0; PARAMETERS],
            index: 0,
            output: Vec::new(),
            terminators: [0; 2],
            initiator: 0,
            limit: 0,
            enquiry: 0,
            responds: false,
            go_on: [0; STRING],
            wait: [0; STRING],
            has_stopped: false,
            is_asked: false,
            awaits_end: false,
            error: 0,
        }
    }

    /// Makes the state of `ESC.R`: answers end with CR, and the sender is never asked to wait.
    pub(super) fn reset(&mut self) {
        // A sender that was stopped must not wait for ever.
        let output = self.release();
        *self = Self { error: self.error, output, terminators: [b'\r', 0], ..Self::new() };
    }

    /// Tells the sender to go on if it was asked to wait. Returns the bytes that wait to be sent.
    pub(super) fn release(&mut self) -> Vec<u8, OUTPUT, u8> {
        if core::mem::take(&mut self.has_stopped) || core::mem::take(&mut self.is_asked) {
            self.send(self.go_on);
        }
        core::mem::take(&mut self.output)
    }

    /// Notes an error.
    pub(super) fn fail(&mut self, error: InterfaceError) {
        self.error = error as u8;
    }

    /// Whether an instruction has begun and not ended.
    pub(super) fn is_open(&self) -> bool {
        self.progress != Progress::None
    }

    /// Ends an instruction without its colon.
    pub(super) fn cut(&mut self) {
        self.progress = Progress::None;
        self.fail(InterfaceError::BadByte);
    }

    /// Takes a byte of an instruction. `room` is how many bytes can be received, and `is_idle` says
    /// whether all have been carried out.
    pub(super) fn push(&mut self, byte: u8, room: u16, is_idle: bool) -> Request {
        match self.progress {
            _ if byte == ESCAPE => {
                if self.is_open() {
                    self.cut();
                }
                self.progress = Progress::Escape;
            }
            Progress::Escape if byte == b'.' => self.progress = Progress::Dot,
            Progress::Escape | Progress::Other => {
                self.progress =
                    if byte.is_ascii_uppercase() { Progress::None } else { Progress::Other };
            }
            Progress::Dot if has_parameters(byte) => {
                (self.progress, self.letter) = (Progress::Parameters, byte);
                (self.parameters, self.index) = ([0; PARAMETERS], 0);
            }
            Progress::Dot => {
                self.progress = Progress::None;
                return self.carry_out(byte, room, is_idle);
            }
            Progress::Parameters => match byte {
                b'0'..=b'9' => {
                    if let Some(parameter) = self.parameters.get_mut(self.index) {
                        let digit = u16::from(byte - b'0');
                        *parameter = parameter.saturating_mul(10).saturating_add(digit);
                    }
                }
                b';' => self.index += 1,
                _ => {
                    self.progress = Progress::None;
                    if self.index >= PARAMETERS {
                        self.fail(InterfaceError::TooMany);
                    } else {
                        self.configure();
                    }
                }
            },
            Progress::None => {}
        }
        Request::Nothing
    }

    /// Carries out an instruction without parameters.
    fn carry_out(&mut self, letter: u8, room: u16, is_idle: bool) -> Request {
        match letter {
            // These switch the plotter on and off, which has no effect: it is always on.
            b'(' | b')' | b'Y' | b'Z' => {}
            b'B' => self.answer(format_args!("{room}")),
            b'E' => {
                let error = core::mem::take(&mut self.error);
                self.answer(format_args!("{error}"));
            }
            b'J' => {
                self.output.clear();
                (self.is_asked, self.awaits_end) = (false, false);
            }
            b'K' => return Request::Forget,
            b'L' => self.awaits_end = true,
            b'O' => self.answer(format_args!("{}", if is_idle { 8 } else { 0 })),
            b'R' => self.reset(),
            _ => self.fail(InterfaceError::Unknown),
        }
        Request::Nothing
    }

    /// Carries out an instruction with parameters.
    fn configure(&mut self) {
        let mut bytes = [0; PARAMETERS];
        for (byte, parameter) in bytes.iter_mut().zip(self.parameters).skip(1) {
            match u8::try_from(parameter) {
                Ok(number) if number < 128 => *byte = number,
                _ => return self.fail(InterfaceError::BadParameter),
            }
        }
        let [limit, ..] = self.parameters;
        let [_, first, second, third, fourth, fifth, ..] = bytes;
        match self.letter {
            b'H' | b'I' => {
                if usize::from(limit) > RECEIVED_BYTES {
                    return self.fail(InterfaceError::BadParameter);
                }
                self.output = self.release();
                (self.limit, self.enquiry) = (if limit == 0 { 80 } else { limit }, first);
                self.responds = self.letter == b'I';
                self.go_on = string(&bytes, 2);
            }
            b'N' => self.wait = string(&bytes, 1),
            b'M' => {
                // The delay, the trigger and the end of the echo are for half-duplex lines.
                let _ = (first, second);
                let ends = [third, fourth];
                self.terminators = if ends == [0; 2] { [b'\r', 0] } else { ends };
                self.initiator = fifth;
            }
            // The size of the buffer and the hardware handshake are what they are.
            b'@' => {}
            _ => self.fail(InterfaceError::Unknown),
        }
    }

    /// Answers, with what begins and ends an answer.
    pub(super) fn answer(&mut self, text: core::fmt::Arguments<'_>) {
        self.send([self.initiator]);
        let _ = self.output.write_fmt(text);
        self.send(self.terminators);
    }

    /// Sends bytes up to the first 0. Bytes for which there is no room are lost: a sender that asks
    /// without reading the answers does not need them.
    fn send<const LENGTH: usize>(&mut self, bytes: [u8; LENGTH]) {
        for byte in bytes.into_iter().take_while(|byte| *byte != 0) {
            let _ = self.output.push(byte);
        }
    }

    /// Whether the byte is the one by which the sender asks for room. If so, the enquiry is noted.
    pub(super) fn takes_enquiry(&mut self, byte: u8) -> bool {
        let is_enquiry = self.enquiry != 0 && byte == self.enquiry;
        if is_enquiry {
            if self.responds {
                self.send(self.wait);
            }
            self.is_asked = true;
        }
        is_enquiry
    }

    /// Tells the sender to wait or to go on, depending on the room that is left.
    pub(super) fn regulate(&mut self, room: u16, is_idle: bool) {
        if self.is_asked && room >= self.limit {
            self.is_asked = false;
            self.send(self.go_on);
        }
        if self.enquiry == 0 {
            let [first, ..] = self.wait;
            if !self.has_stopped && first != 0 && room <= self.limit {
                self.has_stopped = true;
                self.send(self.wait);
            } else if self.has_stopped && usize::from(room) >= RECEIVED_BYTES / 2 {
                self.has_stopped = false;
                self.send(self.go_on);
            }
        }
        if self.awaits_end && is_idle {
            self.awaits_end = false;
            self.answer(format_args!("{RECEIVED_BYTES}"));
        }
    }
}

/// The string that begins at this parameter.
fn string(bytes: &[u8; PARAMETERS], begin: usize) -> [u8; STRING] {
    let mut string = [0; STRING];
    for (byte, value) in string.iter_mut().zip(bytes.iter().skip(begin)) {
        *byte = *value;
    }
    string
}
