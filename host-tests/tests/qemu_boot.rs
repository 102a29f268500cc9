//! Tests of the LM3S6965's firmware in QEMU from boot to fault: the serial line, the pins, the
//! clock, the log.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::io;
use std::time::Duration;

use penup_client::emulator::{
    EmulatedBoard, Emulator, Machine, MachineEvent, MachineEventKind, Options, image_path,
};

type TestResult = Result<(), Box<dyn Error>>;

const GREETING: &str = "\r\nGrbl 1.1h [penup 0.1.0 '$' for help]\r\n";

fn start() -> Result<Emulator, Box<dyn Error>> {
    Ok(Emulator::start(&image_path("lm3s6965"), Options::default())?)
}

/// The output of the board up to and including `end`.
fn heard_until(emulator: &mut Emulator, end: &str) -> io::Result<String> {
    let mut heard = Vec::new();
    while !heard.ends_with(end.as_bytes()) {
        // A byte at a time: what follows `end` is left for the next call.
        let mut buffer = [0; 1];
        let count = emulator.receive(&mut buffer, Duration::from_secs(10))?;
        if count == 0 {
            let heard = String::from_utf8_lossy(&heard).into_owned();
            return Err(io::Error::new(io::ErrorKind::TimedOut, heard));
        }
        heard.extend_from_slice(&buffer[..count]);
    }
    Ok(String::from_utf8_lossy(&heard).into_owned())
}

fn machine_events(emulator: &mut Emulator) -> Result<Vec<MachineEvent>, Box<dyn Error>> {
    let mut machine = Machine::default();
    let changes = emulator.pin_changes()?;
    let mut events: Vec<_> =
        changes.into_iter().filter_map(|change| machine.change(change)).collect();
    events.extend(machine.last());
    Ok(events)
}

#[test]
fn greets_and_answers_status() -> TestResult {
    let mut emulator = start()?;
    assert_eq!(heard_until(&mut emulator, GREETING)?, GREETING);
    emulator.send(b"?")?;
    assert!(heard_until(&mut emulator, ">\r\n")?.starts_with("<Idle"));
    // Drivers off, pen up, before anything else.
    let off = MachineEventKind::Drivers { on: false };
    let kinds: Vec<_> = machine_events(&mut emulator)?.iter().map(|event| event.kind).collect();
    assert_eq!(kinds, [off]);
    Ok(())
}

#[test]
fn abort_is_seen_behind_a_full_queue_and_voids_what_came_before() -> TestResult {
    let mut emulator = start()?;
    heard_until(&mut emulator, GREETING)?;
    // Far more than the queue holds, without a line's end.
    emulator.send(&[b'x'; 2000])?;
    emulator.send(b"\x18")?;
    heard_until(&mut emulator, GREETING)?;
    // Sent before the greeting, it might find no room: the main loop empties the queue.
    emulator.send(b"\n")?;
    assert_eq!(heard_until(&mut emulator, "\r\n")?, "ok\r\n");
    Ok(())
}

#[test]
fn a_second_emulator_does_not_disturb_the_first() -> TestResult {
    let mut first = start()?;
    let mut second = start()?;
    for emulator in [&mut first, &mut second] {
        heard_until(emulator, GREETING)?;
    }
    drop(second);
    first.send(b"?")?;
    heard_until(&mut first, ">\r\n")?;
    Ok(())
}

#[test]
fn logs_with_the_clock() -> TestResult {
    let mut emulator = start()?;
    heard_until(&mut emulator, GREETING)?;
    let mut lines = Vec::new();
    // The log comes by another way than the greeting.
    for _ in 0..500 {
        lines.extend(emulator.log_lines());
        if !lines.is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let first = lines.first().ok_or("no log")?;
    assert!(first.contains("lm3s6965 at 50000000 Hz"), "{first}");
    Ok(())
}
