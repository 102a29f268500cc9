//! The Raspberry Pi Pico's steps in time: each pulse rises and falls when it was planned to, to the
//! cycle, at any speed.
#![cfg(feature = "emulator")]

use penup::boards::host::{Change, Stamped};
use penup_client::emulator::Pin;
use penup_client::machines::Board::Pico;
use penup_host_tests::emulated_jobs::{begin, bench_like};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

/// A level of a step pin, and when it came.
type Edge = (Pin, bool, Duration);

const TICK: Duration = Duration::from_nanos(40);

/// A turn of the host's main loop: its queue is short.
const TURN_TICKS: u64 = 2_500;

fn planned(lines: &[String]) -> Vec<Edge> {
    let mut bench = bench_like(Pico);
    for line in lines {
        bench.say(&format!("{line}\n"));
    }
    while bench.plotter.poll(&mut bench.board) || !bench.plotter.machine().stands() {
        bench.board.pass(TURN_TICKS);
    }
    let (mut x, mut y) = (false, false);
    let mut edge = |stamped: &Stamped| {
        let (pin, level, high) = match stamped.change {
            Change::StepX(high) => (Pin::StepX, &mut x, high),
            Change::StepY(high) => (Pin::StepY, &mut y, high),
            _ => return None,
        };
        let at = Duration::from_nanos(stamped.time * TICK.as_nanos() as u64);
        (std::mem::replace(level, high) != high).then_some((pin, high, at))
    };
    bench.board.trace().changes().iter().filter_map(&mut edge).collect()
}

fn at_the_pins(lines: &[String]) -> Result<Vec<Edge>, Box<dyn Error>> {
    let mut line = begin(Pico, lines)?;
    while !line.status()?.starts_with("<Idle") {
        std::thread::sleep(Duration::from_millis(200));
    }
    let changes = line.emulator.pin_changes()?;
    let is_step = |pin| matches!(pin, Pin::StepX | Pin::StepY);
    Ok(changes.iter().filter(|c| is_step(c.pin)).map(|c| (c.pin, c.high, c.at)).collect())
}

/// From the first edge on, every edge has its planned time.
fn keeps_time(scene: &str, settings: &[&str], least: usize) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    let (planned, pins) = (planned(&lines), at_the_pins(&lines)?);
    assert!(planned.len() > least, "{} edges", planned.len());
    assert_eq!(planned.len(), pins.len());
    let (first_planned, first) = (planned[0].2, pins[0].2);
    for (number, (planned, pin)) in planned.iter().zip(&pins).enumerate() {
        let since_first = (planned.0, planned.1, planned.2 - first_planned);
        assert_eq!((pin.0, pin.1, pin.2 - first), since_first, "{scene}, edge {number}");
    }
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
