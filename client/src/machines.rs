//! The plotters that are no hardware: an emulated board, and the library in this process.

use crate::emulator::{EmulatedBoard, Emulator, EmulatorError, Options, Pico, image_path};
use crate::error::Error;
use crate::job::JobResult;
use crate::link::Link;
use crate::preview::InMemory;
use crate::watch::{PenRuns, PenWatch};
use std::fs;
use std::io;
use std::time::Duration;

/// The boards that can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Board {
    /// Cortex-M3, 64 KiB of RAM, in QEMU.
    Lm3s6965,
    /// Raspberry Pi Pico: Cortex-M0+, 264 KiB of RAM, in rp2040js.
    Pico,
}

/// A plotter whose pins are watched.
pub trait WatchedPlotter: Link {
    /// What the pins did to the pen since the start.
    ///
    /// # Errors
    /// The emulator ended, or its trace makes no sense.
    fn pen_runs(&mut self) -> Result<PenRuns, Error>;

    /// Turns a broken line into what broke, if it was the emulator.
    fn explain(&mut self, error: Error) -> Error;
}

/// The plotter's library on this computer.
pub trait PreviewPlotter: Link {
    /// What came of the last plot command, with the best time of each stage in all of them
    /// ([`Timings::best`](crate::job::Timings::best)).
    ///
    /// # Errors
    /// There was none.
    fn result(&mut self) -> Result<JobResult, Error>;

    /// The job of the model that was sent, as a tape ([`crate::tape`]).
    ///
    /// # Errors
    /// What the plotter refuses.
    fn tape(&mut self) -> Result<Vec<u8>, Error>;
}

/// Starts the emulated `board`.
///
/// # Errors
/// The emulator or the firmware's image is missing.
pub fn emulate(board: Board) -> Result<Box<dyn WatchedPlotter>, Error> {
    Ok(Box::new(Emulated::start(board)?))
}

/// Starts the plotter in memory.
pub fn in_memory() -> Box<dyn PreviewPlotter> {
    Box::new(InMemory::new())
}

/// A board in the emulator, with what its pins have done so far.
struct Emulated {
    board: Board,
    emulator: Box<dyn EmulatedBoard>,
    pen: PenWatch,
}

/// The firmware's default, in mm: see setting `$100`.
const STEP: f64 = 1.0 / 80.0;

impl Emulated {
    fn start(board: Board) -> Result<Self, Error> {
        let fault = |error: EmulatorError| board.error(&error);
        let emulator = board.boot().map_err(fault)?;
        Ok(Self { board, emulator, pen: PenWatch::new(STEP) })
    }

    fn follow_pins(&mut self) -> Result<(), EmulatorError> {
        for change in self.emulator.pin_changes()? {
            self.pen.change(change);
        }
        Ok(())
    }
}

impl Board {
    /// Its name, as `--board` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "lm3s6965",
            Self::Pico => "pico",
        }
    }

    /// Boots its firmware in its emulator.
    ///
    /// # Errors
    /// See [`EmulatorError`].
    pub fn boot(self) -> Result<Box<dyn EmulatedBoard>, EmulatorError> {
        let image = image_path(self.name());
        Ok(match self {
            Self::Lm3s6965 => Box::new(Emulator::start(&image, Options::default())?),
            Self::Pico => Box::new(Pico::start(&image)?),
        })
    }

    fn error(self, error: &EmulatorError) -> Error {
        match error {
            EmulatorError::Ended { said } => self.broken("ended while it started", said),
            EmulatorError::NoImage { path } => Error::Board {
                board: self.name().to_owned(),
                reason: format!(
                    "there is no firmware {}: run `cargo xtask build --board {}`",
                    path.display(),
                    self.name()
                ),
            },
            error => Error::Board { board: self.name().to_owned(), reason: error.to_string() },
        }
    }

    /// The emulator ended; what it `said` last goes into a file, for it is not for the user's eyes.
    fn broken(self, how: &str, said: &str) -> Error {
        let file = format!("penup-emulator-{}.log", std::process::id());
        let file = std::env::temp_dir().join(file);
        let is_kept = !said.trim().is_empty() && fs::write(&file, said).is_ok();
        Error::EmulatorBroke {
            board: self.name().to_owned(),
            how: how.to_owned(),
            details: is_kept.then_some(file),
        }
    }
}

impl Link for Emulated {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.emulator.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.emulator.receive(buffer, patience)
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<bool> {
        self.follow_pins().map_err(io::Error::other)?;
        self.pen.change_pen(pen);
        Ok(true)
    }
}

impl WatchedPlotter for Emulated {
    fn pen_runs(&mut self) -> Result<PenRuns, Error> {
        self.follow_pins().map_err(|error| self.board.error(&error))?;
        Ok(self.pen.runs())
    }

    fn explain(&mut self, error: Error) -> Error {
        let how = match (&error, self.emulator.how_it_ended()) {
            (Error::Link(_), Some(status)) => format!("ended by itself ({status})"),
            (Error::Link(_), None) => "closed its line".to_owned(),
            _ => return error,
        };
        self.board.broken(&how, &self.emulator.said())
    }
}
