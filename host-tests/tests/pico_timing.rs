//! The Raspberry Pi Pico's steps in time: each pulse rises and falls when it was planned to, to the
//! cycle, at any speed.
#![cfg(feature = "emulator")]

use penup_client::machines::Board::Pico;
use penup_host_tests::emulated_jobs::begin;
use penup_host_tests::step_edges::{Edge, assert_in_time, of_changes, planned};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

fn at_the_pins(lines: &[String]) -> Result<Vec<Edge>, Box<dyn Error>> {
    let mut line = begin(Pico, lines)?;
    while !line.status()?.starts_with("<Idle") {
        std::thread::sleep(Duration::from_millis(200));
    }
    Ok(of_changes(&line.emulator.pin_changes()?))
}

/// From the first edge on, every edge has its planned time.
fn keeps_time(scene: &str, settings: &[&str], least: usize) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    assert_in_time(&planned(Pico, &lines), &at_the_pins(&lines)?, least, Duration::ZERO);
    Ok(())
}

#[test]
fn a_job_of_several_strokes_keeps_time_to_the_cycle() -> Result<(), Box<dyn Error>> {
    keeps_time("notched.obj", &["$page=60x60", "$margin=5"], 50_000)
}

/// 502,000 steps a second.
#[test]
fn a_long_diagonal_at_half_a_million_steps_a_second_keeps_time() -> Result<(), Box<dyn Error>> {
    let fast = [
        "$0=0.5",
        "$100=1300",
        "$101=1300",
        "$110=32767",
        "$111=32767",
        "$120=20000",
        "$121=20000",
        "$201=32767",
        "$202=32767",
        "$page=130x130",
        "$margin=5",
    ];
    keeps_time("diagonal.obj", &fast, 300_000)
}
