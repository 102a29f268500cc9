//! Tests a panic of the Raspberry Pi Pico in the middle of a job. No input makes the firmware
//! panic, so the emulator lets the main loop go on where a check of bounds has failed.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{
    EmulatedBoard as _, Machine, MachineEvent, MachineEventKind, Pico, Pin, PinChange, image_path,
};
use penup_host_tests::cut_jobs::{assert_one_drawing, strokes_of};
use penup_host_tests::emulated_jobs::{Line, bench_like};
use penup_host_tests::panic_calls::failed_checks;
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

type TestResult<T = ()> = Result<T, Box<dyn Error>>;

/// What the host hears by USB until this line has ended.
fn heard_by_usb(pico: &mut Pico, last: &str) -> TestResult<String> {
    let mut heard = String::new();
    while !heard.contains(&format!("{last}\r\n")) {
        let mut buffer = [0; 256];
        let count = pico.receive_by_usb(&mut buffer, Duration::from_secs(60))?;
        if count == 0 {
            return Err(format!("heard only {heard:?}").into());
        }
        heard += &String::from_utf8_lossy(&buffer[..count]);
    }
    Ok(heard)
}

/// Waits until the pen is down for the `stroke`th time, from 1, of the changes of the pins since
/// they were asked for last. Returns those changes.
fn until_pen_is_down(line: &mut Line<Pico>, stroke: usize) -> TestResult<Vec<PinChange>> {
    let (mut machine, mut changes, mut downs) = (Machine::default(), Vec::new(), 0);
    loop {
        for change in line.emulator.pin_changes()? {
            let event = machine.change(change).map(|event| event.kind);
            downs += usize::from(event == Some(MachineEventKind::Pen { down: true }));
            changes.push(change);
        }
        if downs >= stroke && machine.pen_is_down() {
            return Ok(changes);
        }
        let status = line.status()?;
        if status.starts_with("<Idle") {
            return Err("the job is over".into());
        }
    }
}

/// Sends a line and returns the last line of the answer.
fn ask(line: &mut Line<Pico>, text: &str) -> TestResult<String> {
    let mut answer = line.ask(text)?;
    while answer.starts_with('[') {
        answer = line.hear()?;
    }
    Ok(answer)
}

#[test]
fn a_panic_raises_the_pen_is_reported_at_both_ports_and_the_job_goes_on() -> TestResult {
    let image = image_path("pico");
    let checks = failed_checks(&std::fs::read(&image)?)?;
    assert!(checks.len() > 20, "{checks:?}");
    let settings = ["$212=30", "$213=30", "$page=45x45", "$margin=3", "$hidden=erased"];
    let lines = job_lines("lattice2.obj", &settings);
    let mut bench = bench_like(&PICO);
    for line in &lines {
        bench.say(&format!("{line}\n"));
    }
    bench.finish();
    let whole = strokes_of(bench.board.trace().changes().iter().map(PinChange::from));

    let mut line = Line::to(Box::new(Pico::start(&image)?))?;
    line.emulator.plug_usb_in()?;
    heard_by_usb(&mut line.emulator, "for help]")?;
    for text in &lines {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    let mut runs = Vec::new();
    for (number, check) in [checks.len() / 3, 2 * checks.len() / 3].into_iter().enumerate() {
        let check = &checks[check];
        let mut changes = until_pen_is_down(&mut line, 5)?;
        let faulted_at = line.emulator.clock()?;
        line.emulator.jump_to(check.address, false)?;
        line.hear_greeting()?;
        let restarted_at = line.emulator.clock()?;
        // What was asked before the panic may be answered now.
        let expected = format!("[MSG:started again after a fault: panicked at {}: ", check.place);
        let message = line.hear()?;
        assert!(message.starts_with(&expected), "{expected} {message}");
        assert!(message.contains("index out of bounds: the len is "), "{message}");
        let usb = heard_by_usb(&mut line.emulator, "ALARM:101")?;
        assert!(usb.contains(&message), "{usb}");
        while !line.hear()?.starts_with("ALARM:101") {}
        // The servo gets its next pulse within 20 ms.
        for _ in 0..10 {
            line.status()?;
        }

        // The pen is up and the drivers are off.
        changes.extend(line.emulator.pin_changes()?);
        let (mut machine, mut drivers_on) = (Machine::default(), true);
        let events = changes.iter().filter_map(|change| machine.change(*change));
        let mut events: Vec<_> = events.collect();
        events.extend(machine.last());
        // The servo has its time to raise the pen before the restart ends its pulses.
        let is_lift = |event: &&MachineEvent| {
            event.at > faulted_at && event.kind == MachineEventKind::Pen { down: false }
        };
        let lifted_at = events.iter().find(is_lift).ok_or("the pen stays down")?.at;
        assert!(lifted_at < faulted_at + Duration::from_millis(60), "{lifted_at:?}");
        assert!(restarted_at >= lifted_at + Duration::from_millis(350), "{restarted_at:?}");
        for event in events {
            if let MachineEventKind::Drivers { on } = event.kind {
                drivers_on = on;
            }
        }
        assert!(!drivers_on && !machine.pen_is_down());
        runs.push(strokes_of(changes));

        assert_eq!(ask(&mut line, "$resume")?, "error:9");
        while !line.unlock()? {}
        // Nobody has said yet where the pen is.
        assert_eq!(ask(&mut line, "$resume")?, "error:164");
        assert!(line.status()?.contains("|Stopped:"), "panic {number}");
        assert_eq!(ask(&mut line, "$resume=origin")?, "ok");
    }
    while !line.status()?.starts_with("<Idle") {}
    runs.push(strokes_of(line.emulator.pin_changes()?));
    assert!(assert_one_drawing(&whole, &runs) <= 2);
    assert_eq!(ask(&mut line, "$resume")?, "error:163");
    Ok(())
}

/// A servo that is mounted the other way round has its pen raised at height 127. After the first
/// raise it is lowered by nothing but the order to draw.
#[test]
fn a_servo_mounted_the_other_way_round_is_raised_by_faults_and_starts() -> TestResult {
    let image = image_path("pico");
    let checks = failed_checks(&std::fs::read(&image)?)?;
    let check = checks.first().ok_or("no check")?;
    let mut line = Line::to(Box::new(Pico::start(&image)?))?;
    for text in ["$210=127", "$211=0", "$212=30", "$213=30", "G0 X1"] {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    let mut is_raised = false;
    let mut follow = |line: &mut Line<Pico>| -> TestResult<bool> {
        for change in line.emulator.pin_changes()? {
            if change.pin == Pin::Pen {
                is_raised = !change.high;
            }
        }
        Ok(is_raised)
    };
    while !line.status()?.starts_with("<Idle") {}
    assert!(follow(&mut line)?, "the first move raises it");
    for text in ["M3", "G1 X60 F600"] {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    while follow(&mut line)? {
        line.status()?;
    }
    line.emulator.jump_to(check.address, false)?;
    line.hear_greeting()?;
    while !line.hear()?.starts_with("ALARM:101") {}
    for _ in 0..10 {
        line.status()?;
    }
    assert!(follow(&mut line)?, "the fault has raised it");
    while !line.unlock()? {}
    line.emulator.cut_power()?;
    line.hear_greeting()?;
    for _ in 0..10 {
        line.status()?;
    }
    assert!(follow(&mut line)?, "it is raised as soon as the settings are read");
    Ok(())
}
