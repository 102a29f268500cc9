//! Tests that the handlers of the LM3S6965 and its masks of interrupts take no more instructions
//! than documented (`src/boards/lm3s6965/steps.rs`, docs/reliability.md).
#![cfg(feature = "emulator")]

use penup_host_tests::counted_board::{
    CLOCK, Calls, Counted, END_OF_PULSES, EVENT, PIECE_OF_BRAKE, SERIAL,
};
use penup_host_tests::emulated_jobs::PEN_ON_A_MOTOR;
use std::error::Error;

type TestResult = Result<(), Box<dyn Error>>;

const CHORDS: [&str; 6] = ["M3", "G1X8Y3F15000", "G1X8.05Y3.02", "G1X8.1Y3.06", "G1X8.1Y0", "M5"];

const DOCUMENT: &str = include_str!("../../docs/reliability.md");

/// Draws chords with these settings, sends a part of a line, and stops at once. No call for an
/// event may take more than `event` instructions.
fn no_call_takes_more(settings: &[&str], event: usize) -> TestResult {
    let mut board = Counted::boot()?;
    for line in settings.iter().chain(&CHORDS) {
        board.ask(line)?;
    }
    board.wait_for("<Idle")?;
    for line in ["M3", "G1X20Y30"] {
        board.ask(line)?;
    }
    board.order(0x18, "Grbl")?;
    let counts = board.end()?.handlers;
    for (number, calls) in &counts {
        let worst = calls.last_key_value().map(|(worst, _)| *worst);
        // The serial line's handler empties a queue of 16 bytes.
        let most = match *number {
            EVENT | END_OF_PULSES | PIECE_OF_BRAKE => continue,
            SERIAL => 2000,
            CLOCK => 10,
            _ => return Err(format!("handler {number} is not known").into()),
        };
        assert!(worst.is_some_and(|worst| (5..=most).contains(&worst)), "{number}: {calls:?}");
    }
    for (number, most) in [(EVENT, event), (END_OF_PULSES, 51), (PIECE_OF_BRAKE, 71)] {
        let calls = counts.get(&number).ok_or("a handler was not called")?;
        // How far the pen comes before it is stopped depends on the computer.
        assert!(calls.values().sum::<usize>() > 300, "{number}: {calls:?}");
        let worst = calls.last_key_value().map(|(worst, _)| *worst);
        // Far less were no count.
        assert!(worst.is_some_and(|worst| (40..=most).contains(&worst)), "{number}: {calls:?}");
    }
    Ok(())
}

#[test]
fn a_move_takes_no_more_instructions_than_the_source_says() -> TestResult {
    // First few steps wait, then the queue holds the stopping distance.
    no_call_takes_more(&["$110=20000", "$111=20000", "$120=2000", "$121=2000"], 59)
}

#[test]
fn steps_of_the_pen_and_of_backlash_take_no_more_instructions_than_the_source_says() -> TestResult {
    no_call_takes_more(&[&PEN_ON_A_MOTOR[..], &["$235=0.2", "$236=0.2"]].concat(), 76)
}

/// The number of instructions that the document allows for a row.
fn allowed(row: &str) -> Option<usize> {
    let line = DOCUMENT.lines().find(|line| line.starts_with(&format!("| {row} |")))?;
    line.trim_end_matches(" |").rsplit("| ").next()?.replace(',', "").parse().ok()
}

/// Checks that these masks were counted, and that none took longer than the document says.
fn assert_bounded(row: &str, masks: &Calls) {
    let worst = masks.last_key_value().map(|(worst, _)| *worst);
    let most = allowed(row);
    println!("{row}: {worst:?} of {most:?}, {} masks", masks.values().sum::<usize>());
    assert!(masks.values().sum::<usize>() > 100, "{row}: {masks:?}");
    // Far less would mean that the longest ones were not counted.
    assert!(worst.zip(most).is_some_and(|(worst, most)| worst <= most && worst > most / 4));
}

#[test]
fn no_mask_takes_more_instructions_than_the_document_says() -> TestResult {
    let mut board = Counted::boot()?;
    for line in ["$110=20000", "$111=20000", "$120=2000", "$121=2000"] {
        board.ask(line)?;
    }
    // The queue begins, runs dry and begins anew, while requests and lines come.
    for line in CHORDS {
        board.send(b"??")?;
        board.ask(line)?;
        board.send(b"?\x90?")?;
    }
    board.ask("$G")?;
    board.wait_for("<Idle")?;
    for line in ["M3", "G1X100Y100"] {
        board.ask(line)?;
    }
    board.send(b"!")?;
    board.wait_for("<Hold")?;
    board.send(b"~??")?;
    board.send(&[b'x'; 250])?;
    board.order(0x18, "Grbl")?;
    let counts = board.end()?;
    assert_bounded("all interrupts masked on the LM3S6965", &counts.all_masked);
    assert_bounded("all but the steps masked on the LM3S6965", &counts.all_but_steps_masked);
    Ok(())
}
