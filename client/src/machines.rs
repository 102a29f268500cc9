//! The plotters that are no hardware: an emulated board, and the library in this process.

use crate::emulator::{
    EmulatedBoard, Emulator, EmulatorError, Machine, MachineEvent, MachineEventKind, Options, Pico,
    image_path,
};
use crate::error::Error;
use crate::job::JobResult;
use crate::link::Link;
use crate::picture::Run;
use crate::preview::InMemory;
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
    machine: Machine,
    runs: Vec<Run>,
}

/// The firmware's default, in mm: see setting `$100`.
const STEP: f64 = 1.0 / 80.0;

impl Emulated {
    fn start(board: Board) -> Result<Self, Error> {
        let fault = |error: EmulatorError| board.error(&error);
        let emulator = board.boot().map_err(fault)?;
        let start = Run { pen_down: false, points: vec![[0.0; 2]] };
        Ok(Self { board, emulator, machine: Machine::default(), runs: vec![start] })
    }

    /// Takes in what the pins did since last asked.
    fn follow_pins(&mut self) -> Result<(), Error> {
        let changes = self.emulator.pin_changes().map_err(|error| self.board.error(&error))?;
        for change in changes {
            let event = self.machine.change(change);
            self.follow(event);
        }
        Ok(())
    }

    fn follow(&mut self, event: Option<MachineEvent>) {
        let Some(run) = self.runs.last_mut() else { return };
        let Some(&[x, y]) = run.points.last() else { return };
        match event.map(|event| event.kind) {
            Some(MachineEventKind::Step { x: dx, y: dy }) => {
                // Whole steps, so that no error adds up.
                let moved = |from: f64, by: i8| ((from / STEP).round() + f64::from(by)) * STEP;
                run.points.push([moved(x, dx), moved(y, dy)]);
            }
            Some(MachineEventKind::Pen { down }) if down != run.pen_down => {
                self.runs.push(Run { pen_down: down, points: vec![[x, y]] });
            }
            _ => {}
        }
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
        Error::Board { board: self.name().to_owned(), reason: error.to_string() }
    }
}

impl Link for Emulated {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.emulator.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.emulator.receive(buffer, patience)
    }
}

impl WatchedPlotter for Emulated {
    fn pen_runs(&mut self) -> Result<PenRuns, Error> {
        self.follow_pins()?;
        let last = self.machine.last();
        self.follow(last);
        let drawn = self.runs.iter().filter(|run| run.points.len() > 1).cloned();
        Ok(PenRuns { runs: drawn.collect(), step: STEP })
    }
}
