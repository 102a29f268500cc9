//! What becomes of a drawing whose pen begins before the order of its strokes is known: for each
//! scene whose order takes a Raspberry Pi Pico a second or longer, the moves with the pen up and
//! the time of the drawing, with the pen that waits and with the pen that begins early.
//!
//! `first_strokes [SCENE]...`

use penup::board_table::PICO;
use penup_host_tests::emulated_jobs::bench_like;
use penup_host_tests::whole_jobs::{Bench, job_lines};

/// The scenes with their options.
const SCENES: [(&str, &[&str]); 24] = [
    (
        "gears",
        &["$eye=-22.3,-118.7,88.9", "$at=0,-3,4", "$crease=40", "$page=240x158", "$margin=6"],
    ),
    ("gears", &["$view=auto"]),
    ("gears", &["$view=auto", "$crease=20"]),
    ("gears", &["$eye=-80.3,-60.7,88.9", "$at=0,-3,4"]),
    ("lattice3", &["$eye=-9.37,-12.71,15.13", "$see=wire"]),
    ("lattice4", &["$eye=-12.37,-16.71,20.13"]),
    ("lattice4", &["$view=auto"]),
    ("lattice5", &["$eye=-15.37,-20.71,25.13"]),
    ("lattice5", &["$view=auto"]),
    ("lattice5", &["$eye=15.37,-20.71,25.13"]),
    ("lattice6", &["$eye=-18.37,-24.71,30.13"]),
    ("lattice6", &["$view=auto"]),
    ("lattice7", &["$eye=-21.37,-28.71,35.13"]),
    ("lattice7", &["$view=auto"]),
    ("text300", &["$view=auto"]),
    ("text300", &["$page=100x100"]),
    ("eighteen", &["$view=auto"]),
    ("grid20", &["$view=auto"]),
    ("interpen", &["$view=auto"]),
    ("isobars", &["$view=auto"]),
    ("rotating", &["$view=auto"]),
    ("notched", &["$view=auto"]),
    ("lattice5", &["$eye=-15.37,-20.71,25.13", "$hidden=dotted"]),
    ("gears", &["$view=auto", "$hidden=dashed"]),
];

fn main() {
    println!("| scene | options | waits: up, mm | s | early: up, mm | s | up | time |");
    println!("|---|---|---|---|---|---|---|---|");
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    for (scene, options) in SCENES {
        if !wanted.is_empty() && !wanted.iter().any(|name| name == scene) {
            continue;
        }
        let [late, early] = [false, true].map(|early_ink| measure(scene, options, early_ink));
        let (Some((late_up, late_time)), Some((up, time))) = (late, early) else {
            println!("| {scene} | {} | refused |", options.join(" "));
            continue;
        };
        if late == early {
            continue;
        }
        println!(
            "| {scene} | {} | {late_up:.1} | {late_time:.1} | {up:.1} | {time:.1} | {:+.2} % | \
             {:+.1} s |",
            options.join(" "),
            100.0 * (up - late_up) / late_up,
            time - late_time,
        );
    }
}

/// The length of the moves with the pen up in mm, and the time of the drawing in seconds. `None` if
/// the plotter refuses the scene.
fn measure(scene: &str, options: &[&str], early_ink: bool) -> Option<(f64, f64)> {
    let bench = bench_like(&PICO);
    let mut bench = Bench { plotter: bench.plotter.with_early_ink(early_ink), ..bench };
    for line in job_lines(&format!("{scene}.obj"), options) {
        if !bench.say(&format!("{line}\n")).ends_with("ok\n") {
            return None;
        }
    }
    bench.finish();
    let up = bench.plotter.job().report().pen_up as f64 / 256.0 / 80.0;
    let end = bench.board.trace().changes().last().map_or(0, |change| change.time);
    Some((up, end as f64 / 25e6))
}
