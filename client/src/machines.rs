//! The emulated boards as plotters whose pins are watched.

use crate::emulator::{EmulatedBoard, Emulator, EmulatorError, Options, Pico, image_path};
use crate::error::Error;
use crate::link::Link;
use crate::page::PenRuns;
use crate::watch::PenWatch;
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
    /// The path of the pen since the start, reconstructed from the pins.
    ///
    /// # Errors
    /// The emulator ended, or its trace cannot be parsed.
    fn pen_runs(&mut self) -> Result<PenRuns, Error>;

    /// Replaces an error of the link by one that says how the emulator ended. Returns other errors
    /// unchanged.
    fn explain(&mut self, error: Error) -> Error;
}

/// Starts the emulated `board`.
///
/// # Errors
/// The emulator or the firmware image is missing, or the emulator does not start.
pub fn emulate(board: Board) -> Result<Box<dyn WatchedPlotter>, Error> {
    Ok(Box::new(Emulated::start(board)?))
}

/// An emulated board and the path of its pen.
struct Emulated {
    board: Board,
    emulator: Box<dyn EmulatedBoard>,
    pen: PenWatch,
}

/// The firmware's default step length in mm; see setting `$100`.
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
    /// The name of the board, as the option `--board` accepts it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "lm3s6965",
            Self::Pico => "pico",
        }
    }

    /// Boots the board's firmware in its emulator.
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

    /// Creates the error of an emulator that ended. Its last output, `said`, is written to a file,
    /// because it is too technical for the message.
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
