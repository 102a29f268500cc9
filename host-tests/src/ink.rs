//! What the pins ink, and how far that is from what they should ink.

use crate::whole_jobs::Bench;
use penup_client::emulator::{Machine, MachineEventKind, PinChange};
use std::collections::HashMap;

/// A straight line in steps.
pub type Segment = [[f64; 2]; 2];

/// Follows the pins, and collects where ink comes onto the page.
#[derive(Debug, Clone, Default)]
pub struct Ink {
    machine: Machine,
    is_down: bool,
    at: [i32; 2],
    points: Vec<[i32; 2]>,
}

impl Ink {
    /// Processes the next change of a pin.
    pub fn change(&mut self, change: PinChange) {
        if let Some(event) = self.machine.change(change) {
            self.take(event.kind);
        }
    }

    fn take(&mut self, kind: MachineEventKind) {
        match kind {
            MachineEventKind::Step { x, y } => {
                let [at_x, at_y] = self.at;
                self.at = [at_x + i32::from(x), at_y + i32::from(y)];
            }
            MachineEventKind::Pen { down } => self.is_down = down,
            _ => return,
        }
        if self.is_down {
            self.points.push(self.at);
        }
    }

    /// The positions, in steps from where the machine stood at first, at which there is ink since
    /// the last call of [`Ink::forget`], in their order.
    pub fn points(&mut self) -> &[[i32; 2]] {
        if let Some(event) = self.machine.last() {
            self.take(event.kind);
        }
        &self.points
    }

    /// Forgets the ink so far.
    pub fn forget(&mut self) {
        self.points();
        self.points.clear();
    }

    /// The sum of all steps.
    pub fn position(&self) -> [i32; 2] {
        self.at
    }
}

/// The positions, in steps from where the machine stood at first, at which ink came onto the page,
/// in their order, and the sum of all steps.
pub fn inked(bench: &Bench) -> (Vec<[i32; 2]>, [i32; 2]) {
    let mut ink = Ink::default();
    for stamped in &bench.board.trace().changes() {
        ink.change(stamped.into());
    }
    (ink.points().to_vec(), ink.position())
}

/// The same positions as numbers in whatever order, each once.
pub fn places(bench: &Bench) -> Vec<[f64; 2]> {
    let (mut points, _) = inked(bench);
    points.sort_unstable();
    points.dedup();
    points.iter().map(|point| point.map(f64::from)).collect()
}

/// How far a point is from a line, in steps.
fn distance([x, y]: [f64; 2], [[ax, ay], [bx, by]]: Segment) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let square = dx * dx + dy * dy;
    let along =
        if square > 0.0 { (((x - ax) * dx + (y - ay) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    (x - ax - along * dx).hypot(y - ay - along * dy)
}

/// The size of the cells in which lines and points are looked for, in steps. What is farther than
/// that counts as being that far.
const CELL: f64 = 32.0;

/// The cell of a point.
fn cell([x, y]: [f64; 2]) -> [i64; 2] {
    [x, y].map(|coordinate| (coordinate / CELL).floor() as i64)
}

/// The cells around a point, with its own.
fn around(point: [f64; 2]) -> impl Iterator<Item = [i64; 2]> {
    let [x, y] = cell(point);
    (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| [x + dx, y + dy]))
}

/// Points along a line, at most ten steps apart.
fn along([a, b]: Segment) -> impl Iterator<Item = [f64; 2]> {
    let count = (((b[0] - a[0]).hypot(b[1] - a[1]) / 10.0) as usize).max(1);
    (0..=count).map(move |part| {
        let part = part as f64 / count as f64;
        [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]
    })
}

/// The longest distance of a point of ink from the figure, in steps.
pub fn farthest(ink: &[[f64; 2]], figure: &[Segment]) -> f64 {
    let mut cells: HashMap<[i64; 2], Vec<Segment>> = HashMap::new();
    for segment in figure {
        for point in along(*segment) {
            let segments = cells.entry(cell(point)).or_default();
            if segments.last() != Some(segment) {
                segments.push(*segment);
            }
        }
    }
    let from_figure = |point: &[f64; 2]| {
        let near = around(*point).filter_map(|cell| cells.get(&cell)).flatten();
        near.map(|line| distance(*point, *line)).fold(CELL, f64::min)
    };
    ink.iter().map(from_figure).fold(0.0, f64::max)
}

/// The longest distance of a point of the figure from the ink, in steps.
pub fn missing(ink: &[[f64; 2]], figure: &[Segment]) -> f64 {
    let mut cells: HashMap<[i64; 2], Vec<[f64; 2]>> = HashMap::new();
    for point in ink {
        cells.entry(cell(*point)).or_default().push(*point);
    }
    let from_ink = |[x, y]: [f64; 2]| {
        let near = around([x, y]).filter_map(|cell| cells.get(&cell)).flatten();
        near.map(|[ax, ay]| (ax - x).hypot(ay - y)).fold(CELL, f64::min)
    };
    figure.iter().flat_map(|segment| along(*segment)).map(from_ink).fold(0.0, f64::max)
}

/// What differs between the ink and the figure; `None` if each lies within a step of the other, or
/// `tolerance` steps more.
pub fn difference(ink: &[[f64; 2]], figure: &[Segment], tolerance: f64) -> Option<String> {
    if ink.is_empty() || figure.is_empty() {
        let text = format!("{} points of ink, {} lines", ink.len(), figure.len());
        return (ink.len() + figure.len() > 0).then_some(text);
    }
    let (beside, missing) = (farthest(ink, figure), missing(ink, figure));
    // A point of the figure lies at most half a diagonal from the nearest step.
    (beside > 1.0 + tolerance || missing > 1.5 + tolerance)
        .then(|| format!("ink {beside:.2} steps beside, {missing:.2} missing"))
}

/// Checks that the ink and the figure lie within a step of each other, or `tolerance` steps more.
///
/// # Panics
/// Panics if they do not.
pub fn assert_same_ink(name: &str, ink: &[[f64; 2]], figure: &[Segment], tolerance: f64) {
    if let Some(difference) = difference(ink, figure, tolerance) {
        panic!("{name}: {difference}");
    }
}
