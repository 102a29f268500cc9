//! Tests that a job's steps and pen moves at the LM3S6965's pins are identical, one by one, to
//! those of the library on the host.
#![cfg(feature = "emulator")]

use clap::Parser as _;
use penup::board_table::LM3S6965;
use penup_client::cli::Cli;
use penup_client::run::run;
use penup_client::workspace;
use penup_host_tests::emulated_jobs::{PEN_ON_A_MOTOR, compare, give_up, stop_at_once};
use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[test]
fn a_concave_solid_in_perspective() -> Result<(), Box<dyn Error>> {
    let camera = ["$eye=5.5,9,5", "$at=2,1.5,1", "$page=80x80", "$margin=5"];
    compare(&LM3S6965, "notched.obj", &camera)
}

#[test]
fn solids_through_each_other_with_dotted_hidden_lines() -> Result<(), Box<dyn Error>> {
    let camera = ["$projection=isometric", "$hidden=dotted", "$page=80x80", "$margin=5"];
    compare(&LM3S6965, "interpen.obj", &camera)
}

#[test]
fn many_parts_with_many_odd_points() -> Result<(), Box<dyn Error>> {
    compare(&LM3S6965, "lattice2.obj", &["$page=60x80", "$margin=5"])
}

#[test]
fn a_lattice_of_125_cubes_in_64_kilobytes() -> Result<(), Box<dyn Error>> {
    let camera = ["$eye=-15.37,-20.71,25.13", "$at=4.5,4.5,4.5", "$up=0,0,1"];
    compare(&LM3S6965, "lattice5.obj", &[&camera[..], &["$page=40x40", "$margin=2"]].concat())
}

#[test]
fn a_structure_mirrored_twice_in_an_editing_session() -> Result<(), Box<dyn Error>> {
    // Figure 4 of Cárdenas & Seeley, from a quarter.
    compare(&LM3S6965, "structure.txt", &["$page=80x80", "$margin=5"])
}

#[test]
fn curves_in_space_and_on_a_plan() -> Result<(), Box<dyn Error>> {
    compare(&LM3S6965, "isobars.obj", &["$fit=on", "$page=60x60", "$margin=5"])?;
    compare(&LM3S6965, "isobars.obj", &["$projection=isometric", "$page=60x60", "$margin=5"])
}

#[test]
fn a_title_below_a_solid() -> Result<(), Box<dyn Error>> {
    let title = ["$title=Caf\\xE9 \\u{2013} 3 %", "$title-size=4", "$page=80x80", "$margin=5"];
    compare(&LM3S6965, "octahedron.obj", &title)
}

#[test]
fn a_motor_lifts_the_pen() -> Result<(), Box<dyn Error>> {
    let settings = [&PEN_ON_A_MOTOR[..], &["$page=80x80", "$margin=5"]].concat();
    compare(&LM3S6965, "notched.obj", &settings)
}

#[test]
fn a_motor_raises_the_pen_after_an_emergency_stop() -> Result<(), Box<dyn Error>> {
    stop_at_once(&LM3S6965)
}

#[test]
fn ctrl_x_stops_the_steps_raises_the_pen_and_knows_the_position() -> Result<(), Box<dyn Error>> {
    give_up(&LM3S6965)
}

/// Oblique lines, whose single steps are together longer than the lines themselves.
#[test]
fn preview_and_plot_tell_the_same_lengths() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let scene = workspace::root().join("scenes/interpen.obj").display().to_string();
    let json = folder.join("lengths.json").display().to_string();
    let svg = folder.join("lengths.svg").display().to_string();
    let summary = |command: &str, options: &[&str]| -> Result<String, Box<dyn Error>> {
        let view = ["--svg", &svg, "--page=80x80", "--margin=5", "--projection=isometric"];
        let line = ["penup", command, &scene].into_iter().chain(view).chain(options.to_vec());
        let sentence = run(&Cli::try_parse_from(line)?, &AtomicBool::new(false))?.text;
        let summary = sentence.split_once(": ").ok_or("no files are named")?.1;
        // Only a preview tells the time.
        let lengths = summary.rsplit_once(" %").ok_or("no efficiency is named")?.0;
        Ok(lengths.to_owned())
    };
    let preview = summary("preview", &["--json", &json])?;
    assert_eq!(summary("plot", &["--board=lm3s6965"])?, preview);
    // And they are the lengths of the drawing's lines.
    let drawn = preview.split_once(" strokes, ").and_then(|(_, rest)| rest.split_once(" mm drawn"));
    let drawn: f64 = drawn.ok_or("no length is named")?.0.parse()?;
    let json = fs::read_to_string(json)?;
    let exact = json.split_once("\"pen_down_mm\":").and_then(|(_, rest)| rest.split_once(','));
    let exact: f64 = exact.ok_or("no length in the file")?.0.parse()?;
    assert!((drawn - exact).abs() < 0.1 && drawn > 100.0, "{drawn} and {exact}");
    Ok(())
}
