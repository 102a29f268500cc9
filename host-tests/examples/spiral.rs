//! Prints the spiral that a logic analyser is to see on a real Pico (docs/bring-up.md), as a file
//! to plot. Comments at its beginning say what to set before, and what the step pins are to do.
//!
//!     cargo run -p penup-host-tests --example spiral > spiral.obj

use penup::board_table::PICO;
use penup_client::emulator::Pin;
use penup_host_tests::spiral;
use penup_host_tests::step_edges::{Edge, planned};
use std::time::Duration;

/// The longest time without a pulse at either pin in the stroke, but for its first and last 10 ms,
/// in which the speed changes.
fn longest_gap(edges: &[Edge]) -> Duration {
    let rises: Vec<_> = edges.iter().filter(|edge| edge.1).map(|edge| edge.2).collect();
    // Behind the pause in which the pen goes down.
    let is_pause = |pair: &[Duration]| pair[1] - pair[0] > Duration::from_millis(20);
    let begin = rises.windows(2).rposition(is_pause).map_or(0, |last| last + 1);
    let ramp = Duration::from_millis(10);
    let (Some(&first), Some(&last)) = (rises.get(begin), rises.last()) else { return ramp };
    let (from, to) = (first + ramp, last.saturating_sub(ramp));
    let steady: Vec<_> = rises.into_iter().filter(|rise| (from..to).contains(rise)).collect();
    steady.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or_default()
}

fn main() {
    let lines = spiral::at_half_a_million();
    let edges = planned(&PICO, &lines);
    for (name, pin) in [("GP2 (STEP x)", Pin::StepX), ("GP3 (STEP y)", Pin::StepY)] {
        let rises: Vec<_> =
            edges.iter().filter(|edge| edge.0 == pin && edge.1).map(|edge| edge.2).collect();
        let shortest = rises.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or_default();
        println!(
            "# {name}: {} pulses of 0.5 us, the closest {:.2} us apart",
            rises.len(),
            shortest.as_secs_f64() * 1e6
        );
    }
    if let (Some(first), Some(last)) = (edges.first(), edges.last()) {
        let seconds = (last.2 - first.2).as_secs_f64();
        println!("# from the first edge to the last: {:.3} ms", seconds * 1e3);
    }
    println!(
        "# the longest time without a pulse: {:.2} us",
        longest_gap(&edges).as_secs_f64() * 1e6
    );
    let (settings, drawing): (Vec<_>, Vec<_>) =
        lines.iter().filter(|line| *line != "$plot").partition(|line| line.starts_with('$'));
    for setting in settings {
        println!("# set {setting}");
    }
    for line in drawing {
        println!("{line}");
    }
}
