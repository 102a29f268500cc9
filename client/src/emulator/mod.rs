//! An emulated board: its serial line, its pins as they really moved, its log.
//!
//! [`Emulator::start`] boots an image of the LM3S6965 in QEMU, [`Pico::start`] one of the Raspberry Pi
//! Pico in rp2040js. [`EmulatedBoard::send`] and [`EmulatedBoard::receive`] are the serial line.
//! [`EmulatedBoard::pin_changes`] gives every change of every pin, in order, with the time on the
//! board's own clock; [`Machine`] folds them into steps and moves of the pen. Dropping the emulator
//! ends its process, and on Linux so does the death of this process, whatever its cause.
//!
//! Emulated time counts instructions in QEMU, each taking [`Options::nanoseconds_per_instruction`],
//! and core cycles in rp2040js; while the core sleeps it leaps to the next timer. It has no relation
//! to the time on the wall, so the instant at which a sent byte arrives is not under control.
//!
//! What is refused: an image that does not exist, an emulator that does not start or ends by itself, a
//! trace that makes no sense. Each error carries what the emulator said.

mod debugger;
mod log;
mod pico;
mod pins;
mod process;
mod running;
mod stack;
mod trace;

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::Duration;

pub use pico::{Pico, PicoByUsb, UartError};
pub use pins::{Machine, MachineEvent, MachineEventKind, Pin, PinChange};
pub use stack::Stack;

use process::Process;
use trace::{Trace, TraceError};

/// Why an emulated board does not run.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The firmware is not built.
    #[error("there is no firmware image {path}: run `cargo xtask build --board BOARD`")]
    NoImage {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The image's log table cannot be read.
    #[error("the image's log table: {reason}")]
    BadImage {
        /// What the decoder says.
        reason: String,
    },
    /// The emulator is not there.
    #[error("cannot run {program} ({source}): run `cargo xtask set-up`")]
    NotInstalled {
        /// Its program.
        program: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// The emulator is another version than the harness is written for.
    #[error("there is {program} {found}, and {needed} is needed: run `cargo xtask set-up`")]
    WrongVersion {
        /// Its name.
        program: &'static str,
        /// The version that is there.
        found: String,
        /// The version that is needed.
        needed: String,
    },
    /// The emulator ended, or does not answer.
    #[error("the emulator ended: {said}")]
    Ended {
        /// The last lines that it printed.
        said: String,
    },
    /// A line of QEMU's trace that is unlike what its version 7.2 prints.
    #[error("the emulator's trace has an unknown line: {line}")]
    BadTrace {
        /// The line.
        line: String,
    },
    /// The operating system's reason why a socket or a thread cannot be had.
    #[error("cannot connect to the emulator: {0}")]
    Connection(#[from] io::Error),
}

/// How a board is emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// The time of each instruction is 2 to this power, in nanoseconds. 4 is 16 ns: the LM3S6965 at
    /// 50 MHz with four instructions in five cycles.
    pub instruction_shift: u8,
    /// Whether [`Emulator::stack`] is to be known.
    pub paints_stack: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { instruction_shift: 4, paints_stack: false }
    }
}

impl Options {
    /// Emulated nanoseconds that an instruction takes.
    pub const fn nanoseconds_per_instruction(self) -> u64 {
        1 << self.instruction_shift
    }
}

/// The image that `cargo xtask build --board BOARD` leaves.
pub fn image_path(board: &str) -> PathBuf {
    crate::workspace::root().join("target/firmware").join(format!("{board}.elf"))
}

/// A running board.
pub trait EmulatedBoard: std::fmt::Debug {
    /// Sends all of `bytes` to the board's serial line.
    ///
    /// # Errors
    /// The emulator has ended.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `patience` for bytes of the board and says how many it put into `buffer`: 0 if
    /// none came.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] if the emulator has ended.
    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// The changes of pins since last asked: all that came before the last byte that
    /// [`EmulatedBoard::receive`] gave, and perhaps some after it.
    ///
    /// # Errors
    /// The emulator has ended, or its trace makes no sense.
    fn pin_changes(&mut self) -> Result<Vec<PinChange>, EmulatorError>;

    /// The latest instant on the board's clock that is known.
    ///
    /// # Errors
    /// As [`EmulatedBoard::pin_changes`].
    fn clock(&mut self) -> Result<Duration, EmulatorError>;

    /// What the board has logged since last asked, a line each: time, level, message.
    fn log_lines(&mut self) -> Vec<String>;

    /// The lines that the emulator itself printed, the last of them.
    fn said(&self) -> String;

    /// How the emulator ended, if it has ended by itself or was killed.
    fn how_it_ended(&mut self) -> Option<ExitStatus>;
}

/// A running LM3S6965. Its clock stands still while the board sleeps without a task.
#[derive(Debug)]
pub struct Emulator {
    process: Process,
    line: TcpStream,
    /// Bytes that [`Emulator::receive`] has given.
    received: u64,
}

/// How long a started QEMU may take to connect, and the trace to catch up with the serial line.
const PATIENCE: Duration = Duration::from_secs(20);

impl Emulator {
    /// Boots `image`, an ELF file.
    ///
    /// # Errors
    /// See [`EmulatorError`]; no process is left then.
    pub fn start(image: &Path, options: Options) -> Result<Self, EmulatorError> {
        let (process, line) = Process::start(image, options, PATIENCE)?;
        line.set_nodelay(true)?;
        Ok(Self { process, line, received: 0 })
    }

    /// The deepest stack since the boot; none unless [`Options::paints_stack`].
    ///
    /// # Errors
    /// QEMU has ended.
    pub fn stack(&mut self) -> Result<Option<Stack>, EmulatorError> {
        self.process.stack()
    }

    /// The process number of QEMU.
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

impl EmulatedBoard for Emulator {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.line.set_read_timeout(Some(patience.max(Duration::from_millis(1))))?;
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
        self.process.with_trace(PATIENCE, |trace| trace.sent() >= received, Trace::take_pins)
    }

    fn clock(&mut self) -> Result<Duration, EmulatorError> {
        self.process.with_trace(PATIENCE, |_| true, |trace| trace.clock())
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
