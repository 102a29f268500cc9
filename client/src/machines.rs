//! The plotters that are no hardware: an emulated board, and the library in this process.

use crate::error::Error;
use crate::job::JobResult;
use crate::link::Link;
use crate::picture::Run;

/// The boards that can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Board {
    /// Cortex-M3, 64 KiB of RAM, in QEMU.
    Lm3s6965,
}

/// A plotter whose pins are watched.
pub trait WatchedPlotter: Link {
    /// What the pins did to the pen since the start.
    ///
    /// # Errors
    /// The emulator ended, or its trace makes no sense.
    fn pen_runs(&mut self) -> Result<PenRuns, Error>;
}

/// What the pins did.
#[derive(Debug, Clone, PartialEq)]
pub struct PenRuns {
    /// Every way of the pen, in mm.
    pub runs: Vec<Run>,
    /// The length of a step, in mm.
    pub step: f64,
}

/// The plotter's library on this computer.
pub trait PreviewPlotter: Link {
    /// What came of the last plot command, with the best time of each stage in all of them
    /// ([`Timings::best`](crate::job::Timings::best)).
    ///
    /// # Errors
    /// There was none.
    fn result(&mut self) -> Result<JobResult, Error>;
}

/// Starts the emulated `board`.
///
/// # Errors
/// The emulator or the firmware's image is missing.
pub fn emulate(board: Board) -> Result<Box<dyn WatchedPlotter>, Error> {
    Err(Error::Board {
        board: format!("{board:?}").to_lowercase(),
        reason: "this build has no emulator".to_owned(),
    })
}

/// Starts the plotter in memory.
///
/// # Errors
/// It cannot start.
pub fn in_memory() -> Result<Box<dyn PreviewPlotter>, Error> {
    Err(Error::Board { board: "host".to_owned(), reason: "this build has none".to_owned() })
}
