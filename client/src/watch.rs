//! The ways of the pen, from what the pins did.

use crate::emulator::{Machine, MachineEvent, MachineEventKind, PinChange};
use crate::picture::Run;

/// What the pins did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PenRuns {
    /// Every way of the pen, in mm.
    pub runs: Vec<Run>,
    /// The length of a step, in mm.
    pub step: f64,
}

/// Follows the pins of a plotter that begins at the origin with the pen up.
#[derive(Debug)]
pub struct PenWatch {
    machine: Machine,
    runs: Vec<Run>,
    step: f64,
    /// From 1.
    pen: u8,
}

impl PenWatch {
    /// `step` is the length of a step in mm.
    pub fn new(step: f64) -> Self {
        Self { machine: Machine::default(), runs: vec![start([0.0; 2])], step, pen: 1 }
    }

    /// Takes in one change of a pin.
    pub fn change(&mut self, change: PinChange) {
        let event = self.machine.change(change);
        self.follow(event);
    }

    /// Another pen, from 1, draws what comes.
    pub fn change_pen(&mut self, pen: u8) {
        self.pen = pen;
    }

    /// Forgets the ways, not the place: another job begins.
    pub fn begin_again(&mut self) {
        let last = self.runs.last().and_then(|run| run.points.last());
        self.runs = vec![start(last.copied().unwrap_or_default())];
    }

    /// Every way that led anywhere.
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
                // Whole steps, so that no error adds up.
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

fn start(at: [f64; 2]) -> Run {
    Run { pen_down: false, pen: 1, points: vec![at] }
}
