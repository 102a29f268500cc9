//! The instructions that the step interrupts of the LM3S6965 take for each step event, counted in
//! QEMU: `cargo xtask bench --motion` builds the image and runs this.
//!
//! The handlers do not depend on the speed, while the queue holds the stopping distance. So all
//! jobs are slow, and are arcs: what waits for their lines does not let the queue run dry.

use penup_host_tests::counted_board::{Counted, END_OF_PULSES, EVENT, PIECE_OF_BRAKE};
use std::error::Error;

/// So slow that few steps hold the stopping distance, and where the jobs begin.
const SETTINGS: [&str; 9] =
    ["$100=100", "$101=100", "$110=600", "$111=600", "$120=800", "$121=800", "M5", "G0X1Y1", "M3"];

fn main() -> Result<(), Box<dyn Error>> {
    // Chords deviate by 0.002 mm ($12), so these radii make them so long.
    let circle = "G2X1Y1I0.2J0F600";
    for (name, line, times) in [
        ("a line", "G1X31Y12F600", 1),
        ("chords of 5 moves", circle, 20),
        ("chords of 50 moves", "G2X20Y20I19J0F600", 1),
    ] {
        let mut board = Counted::boot()?;
        for line in SETTINGS.iter().chain(std::iter::repeat_n(&line, times)).chain(&["M5"]) {
            board.ask(line)?;
        }
        board.wait_for("<Idle")?;
        let counts = board.end()?;
        let sums = |handler| {
            let calls = counts.get(&handler).into_iter().flatten();
            calls.fold((0, 0), |sum, (count, calls)| (sum.0 + calls, sum.1 + count * calls))
        };
        let all: usize =
            [EVENT, END_OF_PULSES, PIECE_OF_BRAKE].map(|handler| sums(handler).1).iter().sum();
        let moves = sums(END_OF_PULSES).0;
        println!("| {name} | {} |", (all + moves / 2).checked_div(moves).ok_or("no move")?);
    }
    Ok(())
}
