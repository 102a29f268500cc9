//! Tests jobs of the emulated Raspberry Pi Pico whose power is cut at random, and whose flash then
//! returns garbage once. `cargo xtask power-soak` does it for as long as one wishes.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_host_tests::pico_cuts::{CutPico, Job};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::time::{Duration, Instant};

type TestResult = Result<(), Box<dyn Error>>;

/// A pen that takes little time. Pulses for the servo come every 20 ms, so with less the pins show
/// the pen late.
const QUICK_PEN: [&str; 2] = ["$212=30", "$213=30"];

/// A job of few strokes.
fn small() -> Job {
    job("cube.obj", &["$page=20x20", "$margin=4"])
}

fn job(scene: &str, options: &[&str]) -> Job {
    Job::new(job_lines(scene, &[&QUICK_PEN[..], options].concat()))
}

/// A job of a solid that lies in flash and is drawn part by part: vertices without faces fill the
/// memory.
fn in_parts() -> Job {
    let options = ["$page=45x45", "$margin=3", "$hidden=erased"];
    let mut lines = job_lines("lattice3.obj", &[&QUICK_PEN[..], &options].concat());
    let plot = lines.pop();
    lines.extend(vec!["v 1 1 1".to_owned(); PICO.memory.vertices]);
    lines.extend(plot);
    Job::new(lines)
}

#[test]
fn a_drawing_in_parts_is_whole_after_cuts() -> TestResult {
    let job = in_parts();
    let mut board = CutPico::start()?;
    board.draw(&job, 3, &mut Random::new(5))?;
    eprintln!("{} strokes, {:?}: {:?}", job.whole.len(), job.time, board.counts());
    assert!(board.counts().cuts() >= 2, "{:?}", board.counts());
    Ok(())
}

#[test]
fn a_drawing_is_whole_after_cuts_and_garbage() -> TestResult {
    let job = small();
    let mut board = CutPico::start()?;
    let mut random = Random::new(2103);
    while board.counts().garbled < 3 {
        board.draw(&job, 3, &mut random)?;
    }
    eprintln!("{:?}", board.counts());
    Ok(())
}

/// Draws jobs of every kind, each with some cuts, one after the other, and says how many it were.
#[test]
#[ignore = "`cargo xtask power-soak` runs it for many minutes"]
fn soak() -> TestResult {
    let minutes = wish("PENUP_MINUTES", 10);
    let seed = wish("PENUP_SEED", 1);
    let lattice = ["$page=45x45", "$margin=3", "$hidden=erased"];
    let jobs = [
        ("small", small(), 3),
        ("lattice", job("lattice2.obj", &lattice), 8),
        ("dotted", job("lattice2.obj", &["$page=45x45", "$margin=3", "$hidden=dotted"]), 8),
        ("early ink", job("lattice4.obj", &["$page=40x40", "$margin=3"]), 10),
        ("one stroke with rests", Job::new(one_stroke()), 8),
        ("in parts", in_parts(), 6),
    ];
    let mut random = Random::new(seed);
    let begun = Instant::now();
    let mut board = CutPico::start()?;
    while begun.elapsed() < Duration::from_secs(60 * minutes) {
        let (name, job, cuts) = &jobs[random.below(jobs.len() as u64) as usize];
        board
            .draw(job, *cuts, &mut random)
            .map_err(|error| format!("seed {seed}: {name}: {error}"))?;
        println!("{} s: {:?}", begun.elapsed().as_secs(), board.counts());
    }
    Ok(())
}

/// A spiral of one stroke, with rests after each 40 mm of it.
fn one_stroke() -> Vec<String> {
    let vertices = (0..200).map(|index| {
        let (turn, radius) = (f64::from(index) * 0.2, 2.0 + f64::from(index) / 20.0);
        format!("v {:.3} {:.3} 0", radius * turn.cos(), radius * turn.sin())
    });
    let chords = (1..200).map(|from| format!("l {from} {}", from + 1));
    let settings = QUICK_PEN.into_iter().chain(["$219=0.04", "$page=30x30", "$margin=3", "$plot"]);
    vertices.chain(chords).chain(settings.map(str::to_owned)).collect()
}

/// A job of half an hour that is cut ten times.
#[test]
#[ignore = "`cargo xtask power-soak --long` runs it for some 20 minutes"]
fn a_job_of_half_an_hour_is_whole_after_ten_cuts() -> TestResult {
    let seed = wish("PENUP_SEED", 1);
    let job = job("lattice4.obj", &["$page=200x200", "$margin=3", "$201=150", "$202=400"]);
    println!("{} strokes, {:?}", job.whole.len(), job.time);
    assert!(job.time >= Duration::from_secs(30 * 60), "{:?}", job.time);
    let begun = Instant::now();
    let mut board = CutPico::start()?;
    board
        .draw(&job, 10, &mut Random::new(seed))
        .map_err(|error| format!("seed {seed}: {error}"))?;
    println!("{:?} in {:?}", board.counts(), begun.elapsed());
    assert_eq!(board.counts().cuts(), 10);
    Ok(())
}
