//! Reconstructs the path of the pen from the changes of the output pins, or from single steps.

use crate::path::Run;
use crate::pins::{Machine, MachineEvent, MachineEventKind, PinChange};
use crate::straight::{Straightener, TOLERANCE};

/// Follows the pins of a plotter that starts at the origin with the pen up.
#[derive(Debug)]
pub struct PenWatch {
    machine: Machine,
    path: PenPath,
}

impl PenWatch {
    /// Starts at the origin with pen 1 up. `step` is the length of a motor step in mm.
    pub fn new(step: f64) -> Self {
        Self { machine: Machine::default(), path: PenPath::new(step) }
    }

    /// Processes the next change of a pin.
    pub fn change(&mut self, change: PinChange) {
        let event = self.machine.change(change);
        self.follow(event);
    }

    /// Sets the number of the pen, counted from 1, that draws the following runs.
    pub fn change_pen(&mut self, pen: u8) {
        self.path.change_pen(pen);
    }

    /// Discards the recorded runs but keeps the position, because another job begins.
    pub fn begin_again(&mut self) {
        self.path.begin_again();
    }

    /// All runs that contain at least one step.
    pub fn runs(&mut self) -> Vec<Run> {
        let last = self.machine.last();
        self.follow(last);
        self.path.runs()
    }

    fn follow(&mut self, event: Option<MachineEvent>) {
        match event.map(|event| event.kind) {
            Some(MachineEventKind::Step { x, y }) => self.path.step(x.into(), y.into()),
            Some(MachineEventKind::Pen { down }) => self.path.set_pen(down),
            _ => {}
        }
    }
}

/// Follows the single steps of a pen that starts at the origin, raised. Where they stay within half
/// a step of a straight line, only the line is kept, so a long path takes little memory.
#[derive(Debug)]
pub struct PenPath {
    /// The runs before the present one, in mm.
    runs: Vec<Run>,
    /// The present run, in steps.
    line: Straightener,
    /// The position in steps.
    at: [f64; 2],
    pen_down: bool,
    /// The pen that draws the present run.
    run_pen: u8,
    /// The number of the current pen, counted from 1.
    pen: u8,
    /// The length of a step in mm.
    step: f64,
}

impl PenPath {
    /// Starts at the origin with pen 1 up. `step` is the length of a step in mm.
    pub fn new(step: f64) -> Self {
        let (runs, at) = (Vec::new(), [0.0; 2]);
        let line = Straightener::new(at, TOLERANCE);
        Self { runs, line, at, pen_down: false, run_pen: 1, pen: 1, step }
    }

    /// Goes a step to the right by `x` and up by `y`, each -1, 0 or 1.
    #[inline]
    pub fn step(&mut self, x: i32, y: i32) {
        self.at = [self.at[0] + f64::from(x), self.at[1] + f64::from(y)];
        self.line.push(self.at);
    }

    /// Lowers or raises the pen, if it is not there already.
    pub fn set_pen(&mut self, down: bool) {
        if down != self.pen_down {
            let run = self.present_run();
            self.runs.extend(run);
            (self.pen_down, self.run_pen) = (down, self.pen);
            self.line = Straightener::new(self.at, TOLERANCE);
        }
    }

    /// Sets the number of the pen, counted from 1, that draws the following runs.
    pub fn change_pen(&mut self, pen: u8) {
        self.pen = pen;
    }

    /// Discards the runs but keeps the position, because another job begins.
    pub fn begin_again(&mut self) {
        self.runs.clear();
        (self.pen_down, self.run_pen) = (false, 1);
        self.line = Straightener::new(self.at, TOLERANCE);
    }

    /// All runs that contain at least one step.
    pub fn runs(&self) -> Vec<Run> {
        self.runs.iter().cloned().chain(self.present_run()).collect()
    }

    /// The run since the pen was lifted or lowered, if there was a step.
    fn present_run(&self) -> Option<Run> {
        if self.line.is_empty() {
            return None;
        }
        let mm = |point: [f64; 2]| point.map(|steps| steps * self.step);
        let points = self.line.clone().end().into_iter().map(mm).collect();
        Some(Run { pen_down: self.pen_down, pen: self.run_pen, points })
    }
}
