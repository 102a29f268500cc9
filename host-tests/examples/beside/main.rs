//! Hidden lines and the order of strokes beside other programs, on the same scenes in one run:
//! `cargo xtask bench --beside` installs Open CASCADE and vpype and runs this.
//!
//! The arguments are `open-cascade=PYTHON` and `vpype=PYTHON`, interpreters that have these
//! programs; one that is not named is left out. Both sides do the work by turns, so that a busy
//! moment meets both, and the best time of each counts: of the others that of the processor,
//! because a busy machine interrupts a long job more often than a short one.

#![allow(clippy::expect_used, reason = "a scene that cannot be drawn ends the program")]

mod hidden_lines;
mod program;
mod strokes;

use program::{Answer, Program, Silence};
use std::error::Error;
use std::path::PathBuf;

/// How often the work is done at most.
const MOST_ROUNDS: usize = 10;
/// After so many seconds no further round begins.
const ENOUGH: f64 = 10.0;

/// The best times of both sides.
struct Both {
    /// Of penup, in milliseconds.
    penup: f64,
    /// Of the other program, with the length that it found, or why there is none.
    other: Result<Answer, &'static str>,
}

impl Both {
    /// The milliseconds of the other program, and how many times as long they are.
    fn columns(&self) -> String {
        match &self.other {
            Ok(other) => {
                let ratio = other.milliseconds / self.penup;
                format!("{} | {ratio:.1}", milliseconds(other.milliseconds))
            }
            Err(reason) => format!("{reason} | "),
        }
    }
}

/// A time with three digits.
fn milliseconds(time: f64) -> String {
    let decimals = if time < 10.0 { 2 } else { usize::from(time < 100.0) };
    format!("{time:.decimals$}")
}

/// Does the work by turns, so that a busy moment meets both sides, and returns the best times.
/// `penup` returns its milliseconds.
fn by_turns(started: Option<Result<Program, Silence>>, mut penup: impl FnMut() -> f64) -> Both {
    let (mut program, mut other) = match started {
        Some(Ok(program)) => (Some(program), Err::<Answer, _>("failed")),
        Some(Err(silence)) => (None, Err(silence.word())),
        None => (None, Err("skipped")),
    };
    let (mut best, mut seconds) = (f64::INFINITY, 0.0);
    for _ in 0..MOST_ROUNDS {
        let here = penup();
        best = best.min(here);
        seconds += here / 1e3;
        match program.as_mut().map(Program::run) {
            Some(Ok(answer)) => {
                seconds += answer.milliseconds / 1e3;
                let before = other.as_ref().map_or(f64::INFINITY, |best| best.milliseconds);
                if answer.milliseconds < before {
                    other = Ok(answer);
                }
            }
            Some(Err(silence)) => {
                // What was measured before counts.
                other = other.or(Err(silence.word()));
                program = None;
            }
            None => {}
        }
        if seconds > ENOUGH {
            break;
        }
    }
    Both { penup: best, other }
}

fn main() -> Result<(), Box<dyn Error>> {
    let python = |name: &str| -> Option<PathBuf> {
        let mut arguments = std::env::args();
        arguments.find_map(|a| Some(a.strip_prefix(name)?.strip_prefix('=')?.into()))
    };
    hidden_lines::compare(python("open-cascade").as_deref())?;
    println!();
    strokes::compare(python("vpype").as_deref())
}
