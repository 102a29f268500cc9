//! The Raspberry Pi Pico's steps in time: each pulse rises and falls when it was planned to, to the
//! cycle, at any speed.
#![cfg(feature = "emulator")]

use penup_client::machines::Board::Pico;
use penup_host_tests::emulated_jobs::begin;
use penup_host_tests::spiral;
use penup_host_tests::step_edges::{Edge, HALF_A_MILLION, assert_in_time, of_changes, planned};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

/// How often the board is asked whether it is done.
const PATIENCE: Duration = Duration::from_millis(50);

/// No event came late.
fn at_the_pins(lines: &[String]) -> Result<Vec<Edge>, Box<dyn Error>> {
    let mut line = begin(Pico, lines)?;
    let mut status = line.status()?;
    let mut asked_at = line.emulator.clock()?;
    while !status.starts_with("<Idle") {
        std::thread::sleep(Duration::from_millis(20));
        // By the board's clock: on a slow computer it would have to answer more often, which costs it time.
        let now = line.emulator.clock()?;
        if now >= asked_at + PATIENCE {
            asked_at = now;
            status = line.status()?;
        }
    }
    assert!(!status.contains("|Late"), "{status}");
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

#[test]
fn a_long_diagonal_at_half_a_million_steps_a_second_keeps_time() -> Result<(), Box<dyn Error>> {
    keeps_time("diagonal.obj", &HALF_A_MILLION, 300_000)
}

/// The drawn events a second, without the tenths at the beginning and the end, where the speed changes.
fn events_a_second(edges: &[Edge]) -> f64 {
    let mut rises: Vec<_> = edges.iter().filter(|edge| edge.1).map(|edge| edge.2).collect();
    rises.dedup();
    // Behind the pause in which the pen goes down.
    let is_pause = |pair: &[Duration]| pair[1] - pair[0] > Duration::from_millis(20);
    let begin = rises.windows(2).rposition(is_pause).map_or(0, |last| last + 1);
    let drawn = &rises[begin..];
    let tenth = drawn.len() / 10;
    let steady = &drawn[tenth..drawn.len() - tenth];
    let (first, last) = (steady[0], steady[steady.len() - 1]);
    (steady.len() - 1) as f64 / (last - first).as_secs_f64()
}

/// 2800 chords a second, of 180 moves on average: 510,000 steps a second, 564,000 where one axis goes straight.
#[test]
fn a_spiral_of_short_chords_at_half_a_million_steps_a_second_keeps_time()
-> Result<(), Box<dyn Error>> {
    let lines = spiral::at_half_a_million();
    let pins = at_the_pins(&lines)?;
    assert_in_time(&planned(Pico, &lines), &pins, 400_000, Duration::ZERO);
    let rate = events_a_second(&pins);
    assert!(rate > 500_000.0, "{rate} steps a second");
    Ok(())
}

/// The greatest speed that can be set: 10,900 chords a second, of 45 moves on average.
#[test]
fn a_spiral_of_short_chords_at_the_greatest_speed_keeps_time() -> Result<(), Box<dyn Error>> {
    let settings =
        ["$100=1000", "$101=1000", "$120=32767", "$121=32767", "$201=32767", "$202=32767"];
    let lines = spiral::lines(1500, 12.0, &settings);
    let pins = at_the_pins(&lines)?;
    assert_in_time(&planned(Pico, &lines), &pins, 100_000, Duration::ZERO);
    let rate = events_a_second(&pins);
    assert!(rate > 470_000.0, "{rate} steps a second");
    Ok(())
}
