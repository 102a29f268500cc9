//! Tests that a job keeps its timing whatever arrives on the serial line: the steps at the pins of
//! the LM3S6965 have their planned times.
#![cfg(feature = "emulator")]

use penup::board_table::LM3S6965;
use penup_host_tests::emulated_jobs::begin;
use penup_host_tests::step_edges::{assert_in_time, of_changes, planned};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

/// The interrupt is late only when the length of the steps changes, and then by one of its own
/// calls.
const JITTER: Duration = Duration::from_micros(5);

#[test]
fn lists_long_lines_and_status_requests_make_no_gap_between_steps() -> Result<(), Box<dyn Error>> {
    // Short pieces of curves.
    let lines = job_lines("isobars.obj", &["$fit=on", "$page=25x25", "$margin=5"]);
    let planned = planned(&LM3S6965, &lines);
    let mut line = begin(&LM3S6965, &lines)?;
    let mut changes = line.emulator.pin_changes()?;
    // As much as its queue of 255 bytes takes at once.
    let long = format!("# {}\n", "x".repeat(150));
    let talk = [long.as_str(), "v 1 2\n$nonsense\n", "$$\n", "$100=81\n", "$options\n", "$\n"];
    let mut answers = 0;
    'job: for words in talk.iter().cycle() {
        line.emulator.send("?".repeat(20).as_bytes())?;
        line.emulator.send(words.as_bytes())?;
        for _ in 0..words.lines().count() {
            loop {
                let answer = line.hear()?;
                if answer.starts_with("<Idle") {
                    break 'job;
                }
                assert!(!answer.contains("|Late:"), "{answer}");
                if answer == "ok" || answer.starts_with("error:") {
                    answers += 1;
                    break;
                }
            }
        }
        changes.extend(line.emulator.pin_changes()?);
        if answers > 1_500 {
            // Each costs the emulator a wait.
            while !line.status()?.starts_with("<Idle") {
                std::thread::sleep(Duration::from_millis(200));
            }
            break;
        }
    }
    changes.extend(line.emulator.pin_changes()?);
    assert!(answers > 50, "{answers} lines are no flood");
    assert_in_time(&planned, &of_changes(&changes), 10_000, JITTER);
    Ok(())
}
