//! The byte stream to and from a plotter.
//!
//! [`Sender`](crate::sender::Sender) knows a plotter only through the trait [`Link`]. A serial
//! port, an emulated board, the library in memory and the fake plotter of the tests are therefore
//! all driven by the same code.

use crate::cli::RejoinArgs;
use crate::keyboard::{Key, Keyboard};
use crate::ports;
use crate::rejoin::Rejoining;
use crate::stderr;
use crate::typed::TypedLines;
use penup_job::protocol::ABORT;
use serialport::SerialPort;
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

/// The user's answer to a question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Yes.
    Yes,
    /// The user has not answered yet.
    NotYet,
    /// There is nobody to ask, for instance because the standard input is closed.
    Nobody,
}

/// What a user beside the plotter asks for by a key while it draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UserRequest {
    /// Pause, or go on after a pause.
    Pause,
    /// All speeds up by a tenth.
    Faster,
    /// All speeds down by a tenth.
    Slower,
    /// Lower the pen a little less far, while the machine holds.
    PenHigher,
    /// Lower the pen a little farther, while the machine holds.
    PenLower,
    /// Give the job up.
    GiveUp,
}

/// A connection to a plotter that carries bytes in both directions.
pub trait Link {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// The error that the port reports, for instance that the plotter was unplugged.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `timeout` for bytes and writes them to the start of `buffer`. Returns how many
    /// there are: 0 if none arrived in time.
    ///
    /// # Errors
    /// The error that the port reports. A timeout is not an error.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Called repeatedly while the stopped machine waits for pen number `pen`, counted from 1.
    /// Starts or awaits the change of the pen and returns whether the pen is in the holder now, as
    /// far as somebody can say so.
    ///
    /// # Errors
    /// The error that the port reports.
    fn change_pen(&mut self, pen: u8) -> io::Result<Answer>;

    /// Called repeatedly while the machine is in feed hold in the middle of a drawing. Informs the
    /// user if this is the `first` call of this hold, and returns whether the user wants the
    /// machine to resume.
    ///
    /// # Errors
    /// The error that the port reports.
    fn ask_to_resume(&mut self, first: bool) -> io::Result<Answer> {
        let _ = first;
        Ok(Answer::Nobody)
    }

    /// What the user has asked for since the last call, one request at a time.
    fn request(&mut self) -> Option<UserRequest> {
        None
    }

    /// The current time, which the sender uses for all its timeouts. A simulated plotter may return
    /// simulated time.
    fn now(&self) -> Instant {
        Instant::now()
    }
}

/// A plotter at a serial port, 115200 baud, 8 data bits, no parity, 1 stop bit.
pub struct SerialLink {
    port: Rejoining<Box<dyn SerialPort>>,
    requested_pen: Option<u8>,
    /// Who answers where the keys of the terminal are not taken.
    typed: TypedLines,
    /// The keys of the terminal, once they were taken.
    keyboard: Option<Keyboard>,
    /// The requests that were typed and not yet asked for.
    requests: VecDeque<UserRequest>,
    /// Whether Enter was pressed since the last question.
    is_answered: bool,
}

/// The speed of the serial line in bits per second.
pub const BAUD: u32 = 115_200;

impl SerialLink {
    /// Opens `device`, for instance `/dev/ttyUSB0` or `COM3`.
    ///
    /// # Errors
    /// There is no such port, another program uses it, or the user has no permission to open it.
    pub fn open(device: &str) -> Result<Self, serialport::Error> {
        let port = serialport::new(device, BAUD).open()?;
        let device = device.to_owned();
        let again = move || serialport::new(device.as_str(), BAUD).open().ok();
        let port = Rejoining::new(port, Box::new(again));
        let requests = VecDeque::new();
        Ok(Self {
            port,
            requested_pen: None,
            typed: TypedLines::default(),
            keyboard: None,
            requests,
            is_answered: false,
        })
    }

    /// Returns the same link, but if the plotter is lost, it is also searched for at other ports.
    #[must_use]
    pub fn found_again_by_search(mut self) -> Self {
        self.port.also_open(Box::new(|| ports::find().ok()?.port.into_wire()));
        self
    }

    /// From now on, waits for a plotter that has answered and is gone; see [`crate::rejoin`].
    pub fn rejoin(&mut self, args: &RejoinArgs, is_quiet: bool) {
        self.port.wait(Duration::from_secs(args.rejoin), is_quiet);
    }

    /// Obeys the keys of the terminal from now on ([`crate::keyboard`]). Returns whether there is a
    /// terminal.
    pub fn obey_keys(&mut self) -> bool {
        self.keyboard = Keyboard::take();
        self.keyboard.is_some()
    }

    /// Collects the keys that were pressed.
    fn read_keys(&mut self) {
        while let Some(key) = self.keyboard.as_mut().and_then(Keyboard::key) {
            match key {
                Key::Enter => self.is_answered = true,
                Key::Request(request) => self.requests.push_back(request),
            }
        }
    }
}

impl Link for SerialLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // An abort must not be lost: who sends it thinks that the machine stops.
        self.port.send(bytes, bytes.contains(&ABORT))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.port.receive(buffer, timeout)
    }

    fn now(&self) -> Instant {
        self.port.now()
    }

    /// Asks the user to change the pen, and assumes that it is in when the user has pressed Enter.
    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        let first = self.requested_pen.replace(pen) != Some(pen);
        let answer = self.ask(first, &format!("Put in pen {pen}, then press Enter"));
        if answer == Answer::Yes {
            self.requested_pen = None;
        }
        Ok(answer)
    }

    fn ask_to_resume(&mut self, first: bool) -> io::Result<Answer> {
        Ok(self.ask(
            first,
            "The machine holds: somebody pressed hold at another port, or a byte was damaged on \
             the line.\nPress Enter to let it go on, or Ctrl-C to give the plot up",
        ))
    }

    fn request(&mut self) -> Option<UserRequest> {
        self.read_keys();
        self.requests.pop_front()
    }
}

impl SerialLink {
    /// Returns whether the user has pressed Enter since the `first` call for this question, which
    /// prints it.
    fn ask(&mut self, first: bool, question: &str) -> Answer {
        if self.keyboard.is_some() {
            self.read_keys();
            if first {
                stderr::say(question);
                self.is_answered = false;
            }
            let is_answered = std::mem::take(&mut self.is_answered);
            return if is_answered { Answer::Yes } else { Answer::NotYet };
        }
        if first && self.typed.begin_question() {
            stderr::say(question);
        }
        self.typed.answer()
    }
}
