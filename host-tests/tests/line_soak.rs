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

/// As many bytes of noise as the emulators take in some ten seconds.
const NOISE: u64 = 100_000;

/// Gives so many bytes of noise to a board, half of it made of what lines are made of.
fn flood(line: &mut DamagedLine, row: &'static BoardRow, count: u64) -> TestResult {
    let begun = Instant::now();
    let flood = line.flood(count)?;
    eprintln!("{}: {count} bytes of noise in {:?}: {flood:?}", row.name, begun.elapsed());
    assert!(count == 0 || flood.steps + u64::from(flood.set) > 0, "the machine moves");
    Ok(())
}

#[test]
fn noise_leaves_a_pico_that_answers_and_knows_its_position() -> TestResult {
    flood(&mut DamagedLine::start(&PICO, 2117)?, &PICO, wish("PENUP_NOISE", NOISE))
}

#[test]
fn so_it_does_an_lm3s6965() -> TestResult {
    flood(&mut DamagedLine::start(&LM3S6965, 2117)?, &LM3S6965, wish("PENUP_NOISE", NOISE))
}

/// Disturbs a board at random, and says how often. Gives it ten megabytes of noise meanwhile, or
/// `PENUP_NOISE` bytes.
fn soak(row: &'static BoardRow) -> TestResult {
    let (minutes, seed) = (wish("PENUP_MINUTES", 10), wish("PENUP_SEED", 1));
    let mut job = Job::for_board(row);
    let begun = Instant::now();
    let mut line = DamagedLine::start(row, seed)?;
    let mut noise = wish("PENUP_NOISE", 10_000_000);
    while begun.elapsed() < Duration::from_secs(60 * minutes) {
        flood(&mut line, row, noise.min(NOISE))?;
        noise -= noise.min(NOISE);
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
