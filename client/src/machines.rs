//! The emulated boards as plotters whose pins are watched.

use crate::emulator::{self, EmulatedBoard, EmulatorError};
use crate::error::Error;
use crate::link::{Answer, Link};
use crate::table::BoardRow;
use penup_job::path::Run;
use penup_job::sampled::SampledPath;
use penup_job::watch::PenWatch;
use std::fs;
use std::io;
use std::time::Duration;

/// A plotter whose pins are watched.
pub trait WatchedPlotter: Link {
    /// The path of the pen since the start, reconstructed from the pins.
    ///
    /// # Errors
    /// The emulator ended, or its trace cannot be parsed.
    fn pen_runs(&mut self) -> Result<Vec<Run>, Error>;

    /// The samples of the path of the pen since the last call ([`SampledPath`]).
    ///
    /// # Errors
    /// As [`WatchedPlotter::pen_runs`].
    fn take_path(&mut self) -> Result<Vec<f32>, Error>;

    /// Forgets the path, because another drawing begins.
    ///
    /// # Errors
    /// As [`WatchedPlotter::pen_runs`].
    fn begin_again(&mut self) -> Result<(), Error>;

    /// Replaces an error of the link by one that says how the emulator ended. Returns other errors
    /// unchanged.
    fn explain(&mut self, error: Error) -> Error;
}

/// Starts the emulated `board`.
///
/// # Errors
/// The emulator or the firmware image is missing, or the emulator does not start.
pub fn emulate(board: &'static BoardRow) -> Result<Box<dyn WatchedPlotter>, Error> {
    Ok(Box::new(Emulated::start(board)?))
}

/// An emulated board and the path of its pen.
struct Emulated {
    board: &'static BoardRow,
    emulator: Box<dyn EmulatedBoard>,
    pen: PenWatch,
    path: SampledPath,
}

/// The firmware's default step length in mm; see setting `$100`.
const STEP: f64 = 1.0 / 80.0;

impl Emulated {
    fn start(board: &'static BoardRow) -> Result<Self, Error> {
        let emulator = emulator::boot(board).map_err(|error| not_started(board, &error))?;
        let path = SampledPath::new([1.0 / STEP; 2]);
        Ok(Self { board, emulator, pen: PenWatch::new(STEP), path })
    }

    fn follow_pins(&mut self) -> Result<(), EmulatorError> {
        for change in self.emulator.pin_changes()? {
            self.pen.change(change);
            self.path.change(change);
        }
        Ok(())
    }
}

/// The error of an emulator that did not start or whose pins cannot be followed.
fn not_started(board: &BoardRow, error: &EmulatorError) -> Error {
    let name = board.name;
    let reason = match error {
        EmulatorError::Ended { said } => return broken(board, "ended while it started", said),
        EmulatorError::NoImage { path } => format!(
            "there is no firmware {}: run `cargo xtask build --board {name}`",
            path.display(),
        ),
        error => error.to_string(),
    };
    Error::Board { board: name.to_owned(), reason }
}

/// The error of an emulator that ended. Its last output, `said`, is written to a file, because it
/// is too technical for the message.
fn broken(board: &BoardRow, how: &str, said: &str) -> Error {
    let file = format!("penup-emulator-{}.log", std::process::id());
    let file = std::env::temp_dir().join(file);
    let is_kept = !said.trim().is_empty() && fs::write(&file, said).is_ok();
    Error::EmulatorBroke {
        board: board.name.to_owned(),
        how: how.to_owned(),
        details: is_kept.then_some(file),
    }
}

impl Link for Emulated {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.emulator.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.emulator.receive(buffer, timeout)
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.follow_pins().map_err(io::Error::other)?;
        self.pen.change_pen(pen);
        self.path.change_pen(pen);
        Ok(Answer::Yes)
    }
}

impl WatchedPlotter for Emulated {
    fn pen_runs(&mut self) -> Result<Vec<Run>, Error> {
        self.follow_pins().map_err(|error| not_started(self.board, &error))?;
        Ok(self.pen.runs())
    }

    fn take_path(&mut self) -> Result<Vec<f32>, Error> {
        self.follow_pins().map_err(|error| not_started(self.board, &error))?;
        Ok(self.path.take())
    }

    fn begin_again(&mut self) -> Result<(), Error> {
        self.follow_pins().map_err(|error| not_started(self.board, &error))?;
        self.pen.begin_again();
        self.path.begin_again();
        Ok(())
    }

    fn explain(&mut self, error: Error) -> Error {
        let how = match (&error, self.emulator.how_it_ended()) {
            (Error::Link(_), Some(status)) => format!("ended by itself ({status})"),
            (Error::Link(_), None) => "closed its line".to_owned(),
            _ => return error,
        };
        broken(self.board, &how, &self.emulator.said())
    }
}
