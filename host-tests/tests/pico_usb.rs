//! The Raspberry Pi Pico's second serial port: USB.
#![cfg(feature = "emulator")]

use penup_client::emulator::{EmulatedBoard, Pico, PicoByUsb, image_path};
use penup_client::machines::Board;
use penup_host_tests::emulated_jobs::{
    Line, assert_same_as_on_the_host, begin_on, events_until_idle,
};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// A board that answers by USB.
fn plugged_in() -> Result<Line<PicoByUsb>, Box<dyn Error>> {
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    Ok(line)
}

/// All lines up to the reply to the one that was sent.
fn hear_all(line: &mut Line<PicoByUsb>) -> Result<Vec<String>, Box<dyn Error>> {
    let mut heard = Vec::new();
    loop {
        heard.push(line.hear()?);
        if heard.last().is_some_and(|last| last == "ok" || last.starts_with("error")) {
            return Ok(heard);
        }
    }
}

#[test]
fn a_job_that_comes_by_usb_is_the_same() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin_on(plugged_in()?, &lines)?;
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(Board::Pico, &lines, &pins);
    Ok(())
}

#[test]
fn replies_longer_than_a_packet_and_floods_lose_no_byte() -> TestResult {
    let mut line = plugged_in()?;
    line.emulator.send(b"$$\n")?;
    let settings = hear_all(&mut line)?;
    assert!(settings.len() > 20, "{settings:?}");
    assert!(
        settings[..settings.len() - 1].iter().all(|line| line.starts_with('$')),
        "{settings:?}"
    );
    assert!(settings.iter().map(String::len).sum::<usize>() > 1000);
    // Far more than any queue holds, and nobody counts.
    let flood: String = (0..400).map(|n| format!("v {n}.125 {n} 0.5\n")).collect();
    line.emulator.send(flood.as_bytes())?;
    for _ in 0..400 {
        assert_eq!(line.hear()?, "ok");
    }
    line.emulator.send(b"$model\n")?;
    assert_eq!(hear_all(&mut line)?[0], "[MODEL:vertices 400 of 4096]");
    Ok(())
}

#[test]
fn real_time_bytes_act_while_a_job_computes_and_runs() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let (plot, before) = lines.split_last().ok_or("no line")?;
    let mut line = begin_on(plugged_in()?, before)?;
    line.emulator.send(format!("{plot}\n").as_bytes())?;
    while !line.status()?.contains("|Stage:") {}
    line.emulator.send(b"?")?;
    while line.hear()? != "ok" {}
    assert!(line.status()?.starts_with("<Run"));
    line.emulator.send(b"!")?;
    while !line.status()?.starts_with("<Hold:0") {}
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    while !line.status()?.starts_with("<Idle") {}
    Ok(())
}

/// The host stops taking what is sent in the middle of a job, with more asked than any queue holds:
/// the job goes on, the other port answers, and so does USB when the host is back.
#[test]
fn a_host_that_is_gone_keeps_nobody_waiting() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut usb = begin_on(plugged_in()?, &lines)?;
    usb.emulator.0.let_usb_take(false)?;
    for _ in 0..3 {
        usb.emulator.send(b"$$\n")?;
    }
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    let pins = events_until_idle(&mut uart)?;
    assert_same_as_on_the_host(Board::Pico, &lines, &pins);
    uart.emulator.send(b"$I\n")?;
    while !uart.hear()?.starts_with("[VER") {}
    uart.emulator.let_usb_take(true)?;
    let mut usb = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    // What was on its way comes first.
    while usb.emulator.receive(&mut [0; 256], Duration::from_millis(500))? > 0 {}
    usb.emulator.send(b"?")?;
    while !usb.hear()?.starts_with("<Idle") {}
    Ok(())
}

#[test]
fn a_line_that_the_other_port_interrupts_is_refused() -> TestResult {
    let mut usb = plugged_in()?;
    usb.emulator.send(b"v 1 2 3\nv 4 5")?;
    assert_eq!(usb.hear()?, "ok");
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    let refused = uart.ask("$model")?;
    assert!(refused.starts_with("[MSG:"), "{refused}");
    assert!(uart.hear()?.starts_with("error:"));
    assert_eq!(uart.hear()?, "[MODEL:vertices 1 of 4096]");
    Ok(())
}
