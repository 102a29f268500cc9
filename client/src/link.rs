//! Bytes to and from a plotter.
//!
//! A [`Link`] is all that [`Sender`](crate::sender::Sender) knows of a plotter, so a serial port, an
//! emulated board, the library in memory and the tests' fake all take the same road.

use std::io;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// What the user says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Yes.
    Yes,
    /// Nothing yet.
    NotYet,
    /// Nobody is there who could be asked.
    Nobody,
}

/// A line to a plotter: bytes in, bytes out.
pub trait Link {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// What the port says, for instance that the plotter was unplugged.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `patience` for bytes and says how many it put into `buffer`: 0 if none came.
    ///
    /// # Errors
    /// What the port says; an expired patience is no error.
    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// The machine stands and waits for this pen, from 1: changes it if it can, and says whether it is in.
    ///
    /// # Errors
    /// What the port says.
    fn change_pen(&mut self, pen: u8) -> io::Result<bool>;

    /// The machine holds in the middle of a drawing: tells the user, the `first` time, and asks
    /// whether it shall go on.
    ///
    /// # Errors
    /// What the port says.
    fn ask_to_resume(&mut self, first: bool) -> io::Result<Answer> {
        let _ = first;
        Ok(Answer::Nobody)
    }

    /// The time, by which the sender waits.
    fn now(&self) -> Instant {
        Instant::now()
    }
}

/// A plotter at a serial port, 115200 baud, 8 data bits, no parity, 1 stop bit.
pub struct SerialLink {
    port: Box<dyn serialport::SerialPort>,
    pen_asked: Option<u8>,
    /// A line that the user typed, once it was asked for.
    typed: Option<Receiver<()>>,
}

/// Tells of each line that the user types: a thread waits for them, as long as the process lives.
fn typed_lines() -> Receiver<()> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let is_heard = |line: io::Result<String>| line.is_ok() && sender.send(()).is_ok();
        io::stdin().lines().all(is_heard)
    });
    receiver
}

/// The speed of the line, in bits a second.
pub const BAUD: u32 = 115_200;

impl SerialLink {
    /// Opens `device`, for instance `/dev/ttyUSB0` or `COM3`.
    ///
    /// # Errors
    /// There is no such port, it is in use, or the user may not open it.
    pub fn open(device: &str) -> Result<Self, serialport::Error> {
        let port = serialport::new(device, BAUD).open()?;
        Ok(Self { port, pen_asked: None, typed: None })
    }
}

impl Link for SerialLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // Generous: a window of lines takes 25 ms at this speed.
        self.port.set_timeout(Duration::from_secs(2))?;
        self.port.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.port.set_timeout(patience)?;
        match self.port.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(0),
            // A port that is ready and has nothing has lost its other end.
            Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
            result => result,
        }
    }

    /// Asks the user; the pen is in when a line is typed.
    fn change_pen(&mut self, pen: u8) -> io::Result<bool> {
        let first = self.pen_asked.replace(pen) != Some(pen);
        let answer = self.ask(first, &format!("Put in pen {pen}, then press Enter"));
        if answer == Answer::Yes {
            self.pen_asked = None;
        }
        Ok(answer == Answer::Yes)
    }

    fn ask_to_resume(&mut self, first: bool) -> io::Result<Answer> {
        Ok(self.ask(
            first,
            "The machine holds: somebody pressed hold at another port, or a byte was damaged on \
             the line.\nPress Enter to let it go on, or Ctrl-C to give the plot up",
        ))
    }
}

impl SerialLink {
    /// Whether the user has typed a line since the question was asked `first`.
    fn ask(&mut self, first: bool, question: &str) -> Answer {
        let typed = self.typed.get_or_insert_with(typed_lines);
        if first {
            // What was typed before is no answer.
            while typed.try_recv().is_ok() {}
            eprintln!("{question}");
        }
        match typed.try_recv() {
            Ok(()) => Answer::Yes,
            Err(TryRecvError::Empty) => Answer::NotYet,
            Err(TryRecvError::Disconnected) => Answer::Nobody,
        }
    }
}
