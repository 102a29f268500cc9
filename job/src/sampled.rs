//! The path of the pen in few samples, to be shown while it draws.

use crate::pins::{Machine, PinChange};
use std::f64::consts::{PI, TAU};
use std::time::Duration;

/// The most time between two samples of the pen's path while it moves.
const SAMPLE: Duration = Duration::from_millis(20);

/// Follows the pins, and keeps of the path what is needed to show it.
///
/// Four numbers are kept for each sample: the time in seconds since the drawing began, x and y in
/// mm from the lower left corner of the page, and the pen that is down, from 1, or 0. From one
/// sample to the next, the pen moves straight, within two steps of its path, and is down if the
/// sample at the end says so.
#[derive(Debug)]
pub struct SampledPath {
    machine: Machine,
    /// Steps per mm, of x and of y.
    steps: [f64; 2],
    /// The number of the pen that is in, from 1.
    pen: u8,
    samples: Vec<f32>,
    /// The time of the first change since the drawing began.
    began: Option<Duration>,
    /// The time of the last change, and of the last sample.
    last: Duration,
    sampled: Duration,
    /// Whether the last change is not sampled yet.
    is_due: bool,
    course: Course,
}

impl SampledPath {
    /// Starts at the origin with pen 1 up. There are `steps` in a mm of x and of y.
    pub fn new(steps: [f64; 2]) -> Self {
        Self {
            machine: Machine::default(),
            steps,
            pen: 1,
            samples: Vec::new(),
            began: None,
            last: Duration::ZERO,
            sampled: Duration::ZERO,
            is_due: false,
            course: Course::from((0, 0)),
        }
    }

    /// Forgets the samples, because another drawing begins.
    pub fn begin_again(&mut self) {
        self.samples.clear();
        self.began = None;
    }

    /// Says that the pen with this number, from 1, is in from now on.
    pub fn change_pen(&mut self, pen: u8) {
        self.pen = pen;
    }

    /// Takes the samples since the last call.
    pub fn take(&mut self) -> Vec<f32> {
        if self.is_due {
            self.sample(self.machine.position(), self.machine.pen_is_down());
        }
        std::mem::take(&mut self.samples)
    }

    /// Processes the next change of a pin.
    pub fn change(&mut self, change: PinChange) {
        let (before, was_down) = (self.machine.position(), self.machine.pen_is_down());
        self.machine.change(change);
        let (now, is_down) = (self.machine.position(), self.machine.pen_is_down());
        let lifts = was_down != is_down;
        if now == before && !lifts {
            return;
        }
        if self.began.is_none() {
            self.began = Some(change.at);
            self.last = change.at;
            self.sample(before, was_down);
        }
        if change.at != self.last {
            // All changes before this one are complete. The step that begins now is the first that
            // may leave the straight line.
            let turns = !self.course.passes(before);
            if self.is_due && (lifts || turns || self.last.saturating_sub(self.sampled) >= SAMPLE) {
                self.sample(before, was_down);
            }
        }
        self.last = change.at;
        self.is_due = true;
        if lifts {
            self.sample(now, was_down);
            self.sample(now, is_down);
        }
    }

    /// Samples the position at the time of the last change.
    fn sample(&mut self, position: (i32, i32), is_down: bool) {
        let time = self.last.saturating_sub(self.began.unwrap_or(self.last));
        self.samples.extend([
            time.as_secs_f32(),
            (f64::from(position.0) / self.steps[0]) as f32,
            (f64::from(position.1) / self.steps[1]) as f32,
            if is_down { f32::from(self.pen) } else { 0.0 },
        ]);
        (self.sampled, self.is_due) = (self.last, false);
        self.course = Course::from(position);
    }
}

/// The directions of the straight lines from a position that pass within a step of every later
/// position.
#[derive(Debug)]
struct Course {
    from: (i32, i32),
    /// The direction to the first later position.
    first: Option<f64>,
    /// The range of directions, relative to the first.
    lowest: f64,
    highest: f64,
    /// The distance to the farthest position so far.
    farthest: f64,
}

impl Course {
    fn from(from: (i32, i32)) -> Self {
        Self { from, first: None, lowest: -PI, highest: PI, farthest: 0.0 }
    }

    /// Adds a position. Returns whether the straight line to it passes all before it.
    fn passes(&mut self, (x, y): (i32, i32)) -> bool {
        let (dx, dy) = (f64::from(x - self.from.0), f64::from(y - self.from.1));
        let (distance, angle) = (dx.hypot(dy), dy.atan2(dx));
        let turned = (angle - self.first.unwrap_or(angle) + 3.0 * PI).rem_euclid(TAU) - PI;
        let passes =
            distance + 1.0 >= self.farthest && (self.lowest..=self.highest).contains(&turned);
        self.farthest = self.farthest.max(distance);
        if distance > 1.0 {
            self.first.get_or_insert(angle);
            let spread = (1.0 / distance).asin();
            self.lowest = self.lowest.max(turned - spread);
            self.highest = self.highest.min(turned + spread);
        }
        passes
    }
}
