//! Tests the timing of the Raspberry Pi Pico's steps: each pulse rises and falls at its planned
//! time, exact to the cycle, at any speed.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_host_tests::emulated_jobs::{Line, begin, begin_on};
use penup_host_tests::spiral;
use penup_host_tests::step_edges::{Edge, FASTEST, assert_in_time, of_changes, planned};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

/// The interval at which the board is asked whether it has finished.
const TIMEOUT: Duration = Duration::from_millis(50);

/// The edges of the step pins in a job on the board, in which no event may be late.
fn at_the_pins(lines: &[String]) -> Result<Vec<Edge>, Box<dyn Error>> {
    let mut line = begin(&PICO, lines)?;
    let mut status = line.status()?;
    let mut asked_at = line.emulator.clock()?;
    while !status.starts_with("<Idle") {
        std::thread::sleep(Duration::from_millis(20));
        // The interval is measured by the board's clock. On a slow computer, the board would
        // otherwise have to answer more often, which costs it time.
        let now = line.emulator.clock()?;
        if now >= asked_at + TIMEOUT {
            asked_at = now;
            status = line.status()?;
        }
    }
    assert!(!status.contains("|Late"), "{status}");
    Ok(of_changes(&line.emulator.pin_changes()?))
}

/// Checks that every edge from the first on has its planned time.
fn keeps_time(scene: &str, settings: &[&str], least: usize) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    assert_in_time(&planned(&PICO, &lines), &at_the_pins(&lines)?, least, Duration::ZERO);
    Ok(())
}

#[test]
fn a_job_of_several_strokes_keeps_time_to_the_cycle() -> Result<(), Box<dyn Error>> {
    keeps_time("notched.obj", &["$page=60x60", "$margin=5"], 50_000)
}

#[test]
fn a_long_diagonal_at_the_greatest_speed_keeps_time() -> Result<(), Box<dyn Error>> {
    keeps_time("diagonal.obj", &FASTEST, 300_000)
}

/// The number of drawn events per second, without the tenths at the beginning and the end, in which
/// the speed changes.
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

/// 2800 chords per second, of 180 moves on average: 510,000 steps per second, and 564,000 where one
/// axis moves alone.
#[test]
fn a_spiral_of_short_chords_at_half_a_million_steps_a_second_keeps_time()
-> Result<(), Box<dyn Error>> {
    let lines = spiral::at_half_a_million();
    let pins = at_the_pins(&lines)?;
    assert_in_time(&planned(&PICO, &lines), &pins, 400_000, Duration::ZERO);
    let rate = events_a_second(&pins);
    println!("{rate:.0} steps a second");
    assert!(rate > 500_000.0, "{rate} steps a second");
    Ok(())
}

/// The maximum speed that can be set: 10,900 chords per second, of 13 moves on average.
#[test]
fn a_spiral_of_short_chords_at_the_greatest_speed_keeps_time() -> Result<(), Box<dyn Error>> {
    let settings = ["$100=300", "$101=300", "$120=32767", "$121=32767", "$201=32767", "$202=32767"];
    let lines = spiral::lines(1500, 12.0, &settings);
    let pins = at_the_pins(&lines)?;
    assert_in_time(&planned(&PICO, &lines), &pins, 30_000, Duration::ZERO);
    let rate = events_a_second(&pins);
    println!("{rate:.0} steps a second");
    assert!(rate > 140_000.0, "{rate} steps a second");
    Ok(())
}

/// Queries of the lists of options and commands, which are answered while the machine moves: the
/// UART takes half a second to send them.
const LISTS: [&str; 5] = ["$options", "$", "$options", "$", "$options"];

/// The number of times that they are queried, so that there is always something to send while steps
/// run.
const TIMES: usize = 4;

/// The rows of the lists, queried at once, each list with the `ok` that ends it.
fn hear_lists(line: &mut Line, lists: &[&str]) -> Result<Vec<String>, Box<dyn Error>> {
    line.emulator.send((lists.join("\n") + "\n").as_bytes())?;
    let (mut rows, mut ended) = (Vec::new(), 0);
    while ended < lists.len() {
        let row = line.hear()?;
        assert!(!row.starts_with("error"), "{row} after {rows:?}");
        ended += usize::from(row == "ok");
        rows.push(row);
    }
    Ok(rows)
}

/// Sending a list over the UART takes longer than the ring of steps lasts. The rows wait for room
/// one by one, and the steps do not wait for them.
#[test]
fn lists_at_the_pace_of_the_uart_keep_half_a_million_steps_a_second_in_time()
-> Result<(), Box<dyn Error>> {
    let lines = spiral::at_half_a_million();
    let (plot, before) = lines.split_last().ok_or("an empty job")?;
    let mut line = begin_on(Line::open(&PICO)?, before)?;
    let at_rest = hear_lists(&mut line, &LISTS)?;
    let bytes: usize = at_rest.iter().map(|row| row.len() + 2).sum();
    assert!(at_rest.len() > 80 && bytes > 5_000, "{bytes} bytes in {} rows", at_rest.len());

    assert_eq!(line.ask(plot)?, "ok");
    let asked_at = line.emulator.clock()?;
    let rows = hear_lists(&mut line, &LISTS.repeat(TIMES))?;
    assert_eq!(rows, vec![at_rest; TIMES].concat());
    let status = line.status()?;
    assert!(status.starts_with("<Idle") && !status.contains("|Late"), "{status}");
    let pins = of_changes(&line.emulator.pin_changes()?);
    assert_in_time(&planned(&PICO, &lines), &pins, 400_000, Duration::ZERO);
    // They were asked for before the first step, and the last step came before they were sent.
    let sending = Duration::from_secs_f64((TIMES * bytes * 10) as f64 / 115_200.0);
    assert!(asked_at < pins[0].2 && pins[pins.len() - 1].2 < asked_at + sending);
    Ok(())
}
