//! Emulated boards, with access to their serial line, the timed changes of their pins, and their
//! log.
//!
//! [`Emulator::start`] boots an image of the LM3S6965 in QEMU, and [`Pico::start`] boots one of the
//! Raspberry Pi Pico in rp2040js. [`EmulatedBoard::send`] and [`EmulatedBoard::receive`] access the
//! serial line. [`EmulatedBoard::pin_changes`] returns every change of every pin in order, with the
//! time on the board's own clock. [`Machine`] combines these changes into steps and pen moves.
//! Dropping the emulator ends its process; on Linux so does the death of this process, whatever its
//! cause.
//!
//! Emulated time is derived from the number of instructions in QEMU, each of which takes
//! [`Options::nanoseconds_per_instruction`], and from the number of core cycles in rp2040js. While
//! the core sleeps, the time jumps to the next timer event. It is unrelated to real time, so the
//! emulated instant at which a sent byte arrives cannot be controlled.
//!
//! Errors are an image that does not exist, an emulator that does not start or ends by itself, and
//! a trace that cannot be parsed. Where the emulator ran, the error contains its last output.

mod debugger;
mod heights;
mod log;
mod pico;
mod process;
mod running;
mod stack;
mod trace;

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::Duration;

pub use pico::{CallGaps, FlashOperation, InterruptTimes, Pico, PicoByUsb, UartError};
pub use stack::Stack;

use crate::table::{self, BoardRow};
use heights::ToldHeights;
pub use penup_job::pins::{Machine, MachineEvent, MachineEventKind, Pin, PinChange};
use process::Process;
use trace::{Trace, TraceError};

/// The reason why an emulated board does not run.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The firmware image does not exist.
    #[error("there is no firmware image {path}: run `cargo xtask build --board BOARD`")]
    NoImage {
        /// The expected path of the image.
        path: PathBuf,
    },
    /// The image cannot be parsed: its log table or a symbol is missing or invalid.
    #[error("the image's log table: {reason}")]
    BadImage {
        /// The reason.
        reason: String,
    },
    /// The emulator is not installed.
    #[error("cannot run {program} ({source}): run `cargo xtask set-up`")]
    NotInstalled {
        /// The name of the program.
        program: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
    /// The emulator has a different version than this program needs.
    #[error("there is {program} {found}, and {needed} is needed: run `cargo xtask set-up`")]
    WrongVersion {
        /// The name of the program.
        program: &'static str,
        /// The installed version.
        found: String,
        /// The required version.
        needed: String,
    },
    /// The emulator ended or does not answer.
    #[error("the emulator ended: {said}")]
    Ended {
        /// The last lines that it printed.
        said: String,
    },
    /// A line of QEMU's trace does not have the format of version 7.2.
    #[error("the emulator's trace has an unknown line: {line}")]
    BadTrace {
        /// The line.
        line: String,
    },
    /// The operating system could not provide a socket or a thread.
    #[error("cannot connect to the emulator: {0}")]
    Connection(#[from] io::Error),
}

/// The options of an emulated LM3S6965.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Each instruction takes 2 to this power nanoseconds. 4 is 16 ns, which corresponds to the
    /// LM3S6965 at 50 MHz with four instructions in five cycles.
    pub instruction_shift: u8,
    /// Whether [`Emulator::stack`] is available, for which the stack is painted before the boot.
    pub paints_stack: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { instruction_shift: 4, paints_stack: false }
    }
}

impl Options {
    /// The emulated time of an instruction in nanoseconds.
    pub const fn nanoseconds_per_instruction(self) -> u64 {
        1 << self.instruction_shift
    }
}

/// Boots the firmware of `board` in the emulator that its row names.
///
/// # Errors
/// See [`EmulatorError`].
pub fn boot(board: &BoardRow) -> Result<Box<dyn EmulatedBoard>, EmulatorError> {
    let image = image_path(board.name);
    Ok(match board.emulator {
        table::Emulator::Qemu { .. } => Box::new(Emulator::start(&image, Options::default())?),
        table::Emulator::Rp2040js => Box::new(Pico::start(&image)?),
    })
}

/// The path of the image that `cargo xtask build --board BOARD` produces.
pub fn image_path(board: &str) -> PathBuf {
    crate::workspace::root().join("target/firmware").join(format!("{board}.elf"))
}

/// A running emulated board.
pub trait EmulatedBoard: std::fmt::Debug {
    /// Sends all of `bytes` to the board's serial line.
    ///
    /// # Errors
    /// The emulator has ended.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `timeout` for bytes from the board and writes them to the start of `buffer`.
    /// Returns how many there are: 0 if none arrived in time.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] if the emulator has ended.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Returns the changes of pins since the last call: all that preceded the last byte that
    /// [`EmulatedBoard::receive`] returned, and perhaps some later ones.
    ///
    /// # Errors
    /// The emulator has ended, or its trace cannot be parsed.
    fn pin_changes(&mut self) -> Result<Vec<PinChange>, EmulatorError>;

    /// The latest known time of the board's clock.
    ///
    /// # Errors
    /// As [`EmulatedBoard::pin_changes`].
    fn clock(&mut self) -> Result<Duration, EmulatorError>;

    /// The lines that the board has logged since the last call, each with time, level and message.
    fn log_lines(&mut self) -> Vec<String>;

    /// The last lines that the emulator itself printed.
    fn said(&self) -> String;

    /// The exit status of the emulator, if it has ended by itself or was killed.
    fn how_it_ended(&mut self) -> Option<ExitStatus>;
}

/// A running LM3S6965. Its clock stops while the board sleeps without a task.
#[derive(Debug)]
pub struct Emulator {
    process: Process,
    line: TcpStream,
    /// The number of bytes that `receive` has returned.
    received: u64,
    told: ToldHeights,
}

/// The board that QEMU emulates here.
const BOARD: &BoardRow = &table::LM3S6965;

/// How long QEMU may take to connect after its start, and the trace to catch up with the serial
/// line.
const TIMEOUT: Duration = Duration::from_secs(20);

impl Emulator {
    /// Boots `image`, an ELF file.
    ///
    /// # Errors
    /// See [`EmulatorError`]. No process is left running after an error.
    pub fn start(image: &Path, options: Options) -> Result<Self, EmulatorError> {
        let (process, line) = Process::start(image, options, TIMEOUT)?;
        line.set_nodelay(true)?;
        Ok(Self { process, line, received: 0, told: ToldHeights::default() })
    }

    /// The deepest use of the stack since the boot; `None` unless [`Options::paints_stack`] is set.
    ///
    /// # Errors
    /// QEMU has ended.
    pub fn stack(&mut self) -> Result<Option<Stack>, EmulatorError> {
        self.process.stack()
    }

    /// The process id of QEMU.
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

impl EmulatedBoard for Emulator {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.told.hear(bytes);
        self.line.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.line.set_read_timeout(Some(timeout.max(Duration::from_millis(1))))?;
        match self.line.read(buffer) {
            Ok(0) if !buffer.is_empty() => Err(io::ErrorKind::BrokenPipe.into()),
            Ok(count) => {
                self.received += count as u64;
                Ok(count)
            }
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(0),
                _ => Err(error),
            },
        }
    }

    fn pin_changes(&mut self) -> Result<Vec<PinChange>, EmulatorError> {
        let received = self.received;
        let is_whole = |trace: &Trace| trace.sent() >= received;
        let mut changes = self.process.with_trace(TIMEOUT, is_whole, Trace::take_pins)?;
        let heights = self.told.heights();
        for change in changes.iter_mut().filter(|change| change.pin == Pin::Pen) {
            // Solenoids know these two heights.
            change.high = heights.is_down(if change.high { 127 } else { 0 });
        }
        Ok(changes)
    }

    fn clock(&mut self) -> Result<Duration, EmulatorError> {
        self.process.with_trace(TIMEOUT, |_| true, |trace| trace.clock())
    }

    fn log_lines(&mut self) -> Vec<String> {
        self.process.take_log()
    }

    fn said(&self) -> String {
        self.process.said()
    }

    fn how_it_ended(&mut self) -> Option<ExitStatus> {
        self.process.how_it_ended()
    }
}

impl From<TraceError> for EmulatorError {
    fn from(TraceError { line }: TraceError) -> Self {
        Self::BadTrace { line }
    }
}
