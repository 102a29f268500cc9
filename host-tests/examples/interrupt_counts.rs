//! The instructions that the step interrupts of the LM3S6965 take for each step event, counted in
//! QEMU: `cargo xtask bench --motion` builds the image and runs this.
//!
//! The paths are those whose planning the image `bench-motion` counts, an eighth of each circle,
//! which has its chords of every direction. The handlers do not depend on the speed, while the
//! queue holds the stopping distance. So all jobs are slow: what waits for their lines does not let
//! the queue run dry.

use penup::drawing::PagePoint;
use penup::step::{Arc, Turn};
use penup_host_tests::counted_board::{Counted, END_OF_PULSES, EVENT, PIECE_OF_BRAKE};
use std::error::Error;
use std::iter;

/// So slow that few steps hold the stopping distance, and free to go to either side of where the
/// board begins.
const SETTINGS: [&str; 5] = ["$20=0", "$110=600", "$111=600", "$120=800", "$121=800"];

/// A job: its name, the steps of both axes in a millimetre, and its targets.
struct Job {
    name: &'static str,
    steps: i32,
    targets: Vec<PagePoint>,
}

impl Job {
    fn line() -> Self {
        Self { name: "a line", steps: 100, targets: vec![PagePoint { x: 4000, y: 1700 }] }
    }

    /// Chords of so many moves of an eighth of a circle of 90 mm.
    fn chords(name: &'static str, steps: i32, moves: usize) -> Result<Self, Box<dyn Error>> {
        let center = PagePoint { x: -90 * steps, y: 0 };
        let circle = Arc::new(center, PagePoint::default(), PagePoint::default(), Turn::Clockwise);
        let mut circle = circle.map_err(|error| format!("no circle: {error:?}"))?;
        let chords = iter::from_fn(|| circle.nth(moves - 1));
        let eighth = chords.take_while(|at| (at.x - center.x).abs() >= at.y.abs());
        Ok(Self { name, steps, targets: eighth.collect() })
    }

    /// The lines of G-code that draw it. Coordinates are whole steps, within the micrometre of
    /// which there are at most 1/4 in a step.
    fn lines(&self) -> impl Iterator<Item = String> {
        let mm = |steps: i32| f64::from(steps) / f64::from(self.steps);
        let lines = self.targets.iter().map(move |at| format!("X{:.3}Y{:.3}", mm(at.x), mm(at.y)));
        let steps = [100, 101].map(|setting| format!("${setting}={}", self.steps));
        let [begin, end] = ["M3G1F600", "M5"].map(|line| iter::once(line.to_owned()));
        steps.into_iter().chain(SETTINGS.map(String::from)).chain(begin).chain(lines).chain(end)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    for job in [
        Job::line(),
        Job::chords("chords of 5 moves", 100, 5)?,
        Job::chords("chords of 50 moves", 250, 50)?,
    ] {
        let mut board = Counted::boot()?;
        board.stream(job.lines())?;
        board.wait_for("<Idle")?;
        let counts = board.end()?;
        let sums = |handler| {
            let calls = counts.handlers.get(&handler).into_iter().flatten();
            calls.fold((0, 0), |sum, (count, calls)| (sum.0 + calls, sum.1 + count * calls))
        };
        let all: usize =
            [EVENT, END_OF_PULSES, PIECE_OF_BRAKE].map(|handler| sums(handler).1).iter().sum();
        let moves = sums(END_OF_PULSES).0;
        let mean = (all + moves / 2).checked_div(moves).ok_or("no move")?;
        println!("| {} | {mean} |", job.name);
    }
    Ok(())
}
