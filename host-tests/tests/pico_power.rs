//! The Raspberry Pi Pico through a loss of power and a hanging program.
#![cfg(feature = "emulator")]

use penup_client::emulator::{EmulatedBoard, Machine, MachineEventKind, Pico, image_path};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;

type TestResult = Result<(), Box<dyn Error>>;

fn start() -> Result<Line<Pico>, Box<dyn Error>> {
    Line::to(Box::new(Pico::start(&image_path("pico"))?))
}

/// The value of setting 130.
fn travel(line: &mut Line<Pico>) -> Result<String, Box<dyn Error>> {
    line.emulator.send(b"$$\n")?;
    let mut travel = None;
    loop {
        let heard = line.hear()?;
        if heard == "ok" {
            return travel.ok_or_else(|| "there is no $130".into());
        }
        if let Some(value) = heard.strip_prefix("$130=") {
            travel = value.split(' ').next().map(str::to_owned);
        }
    }
}

#[test]
fn settings_outlive_the_power() -> TestResult {
    let mut line = start()?;
    assert_eq!(travel(&mut line)?, "420.000");
    assert_eq!(line.ask("$130=300")?, "ok");
    line.emulator.cut_power()?;
    line.hear_greeting()?;
    assert_eq!(travel(&mut line)?, "300.000");
    Ok(())
}

#[test]
fn a_cut_while_the_flash_changes_leaves_the_old_settings_or_the_new_ones() -> TestResult {
    let mut line = start()?;
    assert_eq!(line.ask("$130=300")?, "ok");
    let mut before = 300;
    // In the erasing of a sector, in the payload's page, in the header's.
    for (number, bytes) in (301..).zip([0, 1, 2000, 4095, 4096, 4100, 4351, 4352, 4355, 4367, 4368])
    {
        line.emulator.cut_power_in_flash(bytes)?;
        line.emulator.send(format!("$130={number}\n").as_bytes())?;
        line.hear_greeting()?;
        let after = travel(&mut line)?;
        let is_new = after == format!("{number}.000");
        assert!(is_new || after == format!("{before}.000"), "{before}, {number}: {after}");
        // Valid with the last byte of its sum.
        assert_eq!(is_new, bytes >= 4096 + 256 + 16, "cut after {bytes} bytes");
        if is_new {
            before = number;
        }
    }
    Ok(())
}

#[test]
fn a_hanging_program_is_started_again_in_alarm() -> TestResult {
    let mut line = start()?;
    for text in job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]) {
        assert_eq!(line.ask(&text)?, "ok", "{text}");
    }
    line.emulator.hang()?;
    line.hear_greeting()?;
    assert_eq!(line.hear()?, "ALARM:101");
    assert!(line.status()?.contains("|Alarm:101"));
    let mut machine = Machine::default();
    let mut drivers_on = false;
    for change in line.emulator.pin_changes()? {
        if let Some(MachineEventKind::Drivers { on }) =
            machine.change(change).map(|event| event.kind)
        {
            drivers_on = on;
        }
    }
    if let Some(MachineEventKind::Drivers { on }) = machine.last().map(|event| event.kind) {
        drivers_on = on;
    }
    assert!(!drivers_on && !machine.pen_is_down());
    assert_eq!(line.ask("$X")?, "ok");
    Ok(())
}
