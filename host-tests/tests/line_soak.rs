//! Tests both emulated boards behind a line that damages bytes, with noise on it, and with senders
//! that leave; and measures how long the status is waited for. `cargo xtask line-soak` does it for
//! as long as one wishes.
#![cfg(feature = "emulator")]

use penup::board_table::{BoardRow, LM3S6965, PICO};
use penup_host_tests::line_soak::{DamagedLine, Disturbance, Job};
use penup_host_tests::wish::wish;
use std::error::Error;
use std::time::{Duration, Instant};

type TestResult = Result<(), Box<dyn Error>>;

/// Does each thing to a board once.
fn each(row: &'static BoardRow) -> TestResult {
    let mut job = Job::for_board(row);
    let mut line = DamagedLine::start(row, 2111)?;
    for by in Disturbance::all(row) {
        let begun = Instant::now();
        line.disturb(&mut job, by)?;
        eprintln!("{}: {by:?}: {:?}", row.name, begun.elapsed());
    }
    // A job may be refused before the machine moves.
    for _ in 0..5 {
        if line.counts.asked_in_damage > 0 {
            break;
        }
        line.disturb(&mut job, Disturbance::DamagedLine(300))?;
    }
    eprintln!("{}: {:?}", row.name, line.counts);
    assert!(line.counts.asked_in_damage > 0, "statuses were compared while bytes were damaged");
    Ok(())
}

#[test]
fn the_pico_draws_what_it_was_sent_or_the_client_says_what_is_wrong() -> TestResult {
    each(&PICO)
}

#[test]
fn so_does_the_lm3s6965() -> TestResult {
    each(&LM3S6965)
}

/// Disturbs a board at random, and says how often.
fn soak(row: &'static BoardRow) -> TestResult {
    let (minutes, seed) = (wish("PENUP_MINUTES", 10), wish("PENUP_SEED", 1));
    let mut job = Job::for_board(row);
    let begun = Instant::now();
    let mut line = DamagedLine::start(row, seed)?;
    while begun.elapsed() < Duration::from_secs(60 * minutes) {
        let done = line.disturb_at_random(&mut job);
        println!("{} s: {}: {:?}", begun.elapsed().as_secs(), row.name, line.counts);
        done.map_err(|error| format!("{}, seed {seed}: {error}", row.name))?;
    }
    Ok(())
}

#[test]
#[ignore = "`cargo xtask line-soak` runs it for many minutes"]
fn soak_the_pico() -> TestResult {
    soak(&PICO)
}

#[test]
#[ignore = "`cargo xtask line-soak` runs it for many minutes"]
fn soak_the_lm3s6965() -> TestResult {
    soak(&LM3S6965)
}
