//! Tests how the Raspberry Pi Pico starts: after each kind of reset, after faults, and with a worn
//! flash.
#![cfg(feature = "emulator")]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup_client::emulator::{
    EmulatedBoard, Machine, MachineEventKind, Pico, PicoByUsb, image_path,
};
use penup_host_tests::emulated_jobs::{Line, STAGES, STAGES_IN_TILES};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;

type TestResult = Result<(), Box<dyn Error>>;

fn start() -> Result<Line<Pico>, Box<dyn Error>> {
    Line::to(Box::new(Pico::start(&image_path("pico"))?))
}

/// The output of the board on its serial line until it answers a status query, including the
/// answer.
fn hear_start(line: &mut Line<Pico>) -> Result<Vec<String>, Box<dyn Error>> {
    line.hear_greeting()?;
    line.emulator.send(b"?")?;
    let mut heard = Vec::new();
    loop {
        heard.push(line.hear()?);
        if heard.last().is_some_and(|last| last.starts_with('<')) {
            return Ok(heard);
        }
    }
}

/// The message of the board about a job that was stopped.
const STOPPED: &str = "[MSG:a job stopped at stroke 1 of ";

/// Takes the message about a job that was stopped out of what the board said.
///
/// # Panics
/// Panics if it is missing.
fn without_stopped_job(mut heard: Vec<String>) -> Vec<String> {
    let at = heard.iter().position(|line| line.starts_with(STOPPED));
    heard.remove(at.unwrap_or_else(|| panic!("no job has stopped: {heard:?}")));
    let status = heard.last().expect("the status");
    assert!(status.contains("|Stopped:0/"), "{status}");
    heard
}

fn assert_fresh(heard: &[String]) {
    assert!(heard.len() == 1 && heard[0].starts_with("<Idle"), "{heard:?}");
}

fn assert_fault(heard: &[String], cause: &str) {
    assert!(heard[0].starts_with("[MSG:started again after a fault: "), "{heard:?}");
    assert!(heard[0].contains(cause), "{heard:?}");
    assert_eq!(heard[1], "[MSG:'$H'|'$X' to unlock]");
    assert_eq!(heard[2], "ALARM:101");
    assert!(heard[3].contains("|Alarm:101"), "{heard:?}");
}

/// Checks that the drivers are off and the pen is up.
fn assert_safe(line: &mut Line<Pico>) -> TestResult {
    let (mut machine, mut drivers_on) = (Machine::default(), false);
    let changes = line.emulator.pin_changes()?;
    let mut events: Vec<_> = changes.into_iter().filter_map(|pin| machine.change(pin)).collect();
    events.extend(machine.last());
    for event in events {
        if let MachineEventKind::Drivers { on } = event.kind {
            drivers_on = on;
        }
    }
    assert!(!drivers_on && !machine.pen_is_down());
    Ok(())
}

#[test]
fn each_kind_of_reset_is_distinguished() -> TestResult {
    let mut line = start()?;
    line.emulator.copy_image()?;
    assert_fresh(&hear_start(&mut line)?);
    line.emulator.pull_run_low()?;
    assert_fresh(&hear_start(&mut line)?);
    line.emulator.hang()?;
    assert_fault(&hear_start(&mut line)?, "the watchdog");
    assert!(line.unlock()?);
    // Neither reset is mistaken for one by the watchdog.
    line.emulator.copy_image()?;
    assert_fresh(&hear_start(&mut line)?);
    line.emulator.hang()?;
    assert_fault(&hear_start(&mut line)?, "the watchdog");
    line.emulator.pull_run_low()?;
    assert_fresh(&hear_start(&mut line)?);
    line.emulator.cut_power()?;
    assert_fresh(&hear_start(&mut line)?);
    Ok(())
}

#[test]
fn a_panic_in_a_job_makes_the_machine_safe_and_is_reported_after_the_restart() -> TestResult {
    let mut line = start()?;
    for text in job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]) {
        assert_eq!(line.ask(&text)?, "ok", "{text}");
    }
    // The entry point runs a second time, so the board is initialised twice.
    line.emulator.jump_to_function(&image_path("pico"), "main", false)?;
    assert_fault(
        &without_stopped_job(hear_start(&mut line)?),
        "a part of the board was set up twice",
    );
    assert_safe(&mut line)?;
    assert!(line.unlock()?);
    // The fault is reported once.
    line.emulator.pull_run_low()?;
    assert_fresh(&without_stopped_job(hear_start(&mut line)?));
    Ok(())
}

#[test]
fn so_are_a_hard_fault_and_a_stack_that_is_used_up() -> TestResult {
    let mut line = start()?;
    // There is no memory at this address.
    line.emulator.jump_to(0x3000_0000, false)?;
    assert_fault(&hear_start(&mut line)?, "hard fault at 0x3000000");
    assert_safe(&mut line)?;
    line.emulator.pull_run_low()?;
    assert_fresh(&hear_start(&mut line)?);
    line.emulator.jump_to_function(&image_path("pico"), "main", true)?;
    assert_fault(&hear_start(&mut line)?, "the stack is used up");
    Ok(())
}

#[test]
fn a_program_that_faults_at_every_start_is_given_up_but_answers() -> TestResult {
    let mut line = start()?;
    for _ in 0..2 {
        line.emulator.jump_to_function(&image_path("pico"), "main", false)?;
        assert_fault(&hear_start(&mut line)?, "a part of the board was set up twice");
    }
    line.emulator.jump_to_function(&image_path("pico"), "main", false)?;
    while !line.hear()?.starts_with("[MSG:the program faults as soon as it starts") {}
    assert_eq!(line.hear()?, "ALARM:101");
    assert!(line.status()?.starts_with("<Alarm"));
    assert!(line.ask("$plot")?.is_empty());
    assert!(line.hear()?.contains("a part of the board was set up twice"));
    assert_eq!(line.hear()?, "ALARM:101");
    assert_eq!(line.hear()?, "error:9");
    assert_safe(&mut line)?;
    // USB answers, too.
    line.emulator.plug_usb_in()?;
    let mut usb = Line::silent(Box::new(PicoByUsb(*line.emulator)));
    assert_eq!(usb.hear()?, "");
    let message = usb.hear()?;
    assert!(message.contains("a part of the board was set up twice"), "{message}");
    let mut line = Line::silent(Box::new(usb.emulator.0));
    line.emulator.send(b"\x18")?;
    assert_fresh(&hear_start(&mut line)?);
    Ok(())
}

/// The offsets of the settings and of the job in the flash.
const SETTINGS: u32 = 0x1B_8000;
const JOB: u32 = 0x1B_A000;

fn travel_is(line: &mut Line<Pico>, wanted: &str) -> Result<bool, Box<dyn Error>> {
    line.emulator.send(b"$$\n")?;
    let mut is_found = false;
    loop {
        match line.hear()? {
            heard if heard == "ok" => return Ok(is_found),
            heard => is_found |= heard == format!("$130={wanted}"),
        }
    }
}

#[test]
fn a_flash_that_does_not_hold_the_settings_is_reported() -> TestResult {
    // A bit that is not erased, and one that is not written: the upper byte of the first setting's
    // number.
    for (offset, mask, high) in [(SETTINGS + 900, 4, false), (SETTINGS + 256 + 1, 0x80, true)] {
        let mut line = start()?;
        line.emulator.wear_flash(offset, mask, high)?;
        let message = line.ask("$130=300")?;
        assert!(message.starts_with("[MSG:in force"), "{message}");
        assert_eq!(line.hear()?, "error:160");
        assert!(travel_is(&mut line, "300.000")?);
        line.emulator.cut_power()?;
        line.hear_greeting()?;
        assert!(travel_is(&mut line, "420.000")?);
    }
    Ok(())
}

#[test]
fn a_flash_that_does_not_hold_the_job_is_reported_and_the_job_is_drawn() -> TestResult {
    let mut line = start()?;
    line.emulator.wear_flash(JOB + 300, 1, false)?;
    let lines = job_lines("cube.obj", &["$page=60x60", "$margin=5"]);
    let (plot, model) = lines.split_last().ok_or("no line")?;
    for text in model {
        assert_eq!(line.ask(text)?, "ok", "{text}");
    }
    let message = line.ask(plot)?;
    assert!(message.starts_with("[MSG:$again will not draw this"), "{message}");
    assert_eq!(line.hear()?, "ok");
    assert!(line.status()?.starts_with("<Run"));
    Ok(())
}

/// The compiler may inline a function, which then cannot be timed any more.
#[test]
fn the_functions_that_are_timed_are_in_the_image() -> TestResult {
    let mut line = start()?;
    let in_tiles = STAGES_IN_TILES.map(|(name, _)| name);
    for name in STAGES.into_iter().chain(in_tiles) {
        line.emulator.time_function(&image_path("pico"), name, 0)?;
    }
    Ok(())
}
