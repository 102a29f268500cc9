//! Reconstructs the path of the pen from the changes of the output pins.

use crate::path::{PenRuns, Run};
use crate::pins::{Machine, MachineEvent, MachineEventKind, PinChange};

/// Follows the pins of a plotter that starts at the origin with the pen up.
#[derive(Debug)]
pub struct PenWatch {
    machine: Machine,
    runs: Vec<Run>,
    step: f64,
    /// The number of the current pen, counted from 1.
    pen: u8,
}

impl PenWatch {
    /// Starts at the origin with pen 1 up. `step` is the length of a motor step in mm.
    pub fn new(step: f64) -> Self {
        Self { machine: Machine::default(), runs: vec![start([0.0; 2])], step, pen: 1 }
    }

    /// Processes the next change of a pin.
    pub fn change(&mut self, change: PinChange) {
        let event = self.machine.change(change);
        self.follow(event);
    }

    /// Sets the number of the pen, counted from 1, that draws the following runs.
    pub fn change_pen(&mut self, pen: u8) {
        self.pen = pen;
    }

    /// Discards the recorded runs but keeps the position, because another job begins.
    pub fn begin_again(&mut self) {
        let last = self.runs.last().and_then(|run| run.points.last());
        self.runs = vec![start(last.copied().unwrap_or_default())];
    }

    /// All runs that contain at least one step.
    pub fn runs(&mut self) -> PenRuns {
        let last = self.machine.last();
        self.follow(last);
        let drawn = self.runs.iter().filter(|run| run.points.len() > 1).cloned();
        PenRuns { runs: drawn.collect(), step: self.step }
    }

    fn follow(&mut self, event: Option<MachineEvent>) {
        let Some(run) = self.runs.last_mut() else { return };
        let Some(&[x, y]) = run.points.last() else { return };
        match event.map(|event| event.kind) {
            Some(MachineEventKind::Step { x: dx, y: dy }) => {
                // The position is rounded to whole steps, so that rounding errors do not
                // accumulate.
                let step = self.step;
                let moved = |from: f64, by: i8| ((from / step).round() + f64::from(by)) * step;
                run.points.push([moved(x, dx), moved(y, dy)]);
            }
            Some(MachineEventKind::Pen { down }) if down != run.pen_down => {
                self.runs.push(Run { pen_down: down, pen: self.pen, points: vec![[x, y]] });
            }
            _ => {}
        }
    }
}

/// Returns a run with the pen up that begins at this point.
fn start(at: [f64; 2]) -> Run {
    Run { pen_down: false, pen: 1, points: vec![at] }
}
