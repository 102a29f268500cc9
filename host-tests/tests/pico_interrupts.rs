//! Tests that no handler of the Raspberry Pi Pico runs longer, and no interrupt is masked longer,
//! than docs/reliability.md says, while everything that has a handler is busy.
#![cfg(feature = "emulator")]

use penup_client::emulator::{
    EmulatedBoard as _, InterruptTimes, Machine, MachineEventKind, Pico, image_path,
};
use penup_host_tests::emulated_jobs::{Line, PEN_ON_A_MOTOR};
use penup_host_tests::spiral;
use penup_host_tests::whole_jobs::job_lines;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

const DOCUMENT: &str = include_str!("../../docs/reliability.md");

/// The rows of the document's table, and the numbers of their exceptions (RP2040 datasheet, section
/// 2.3.2, with 16 for the first interrupt).
const HANDLERS: [(&str, u8); 5] = [
    ("handler of the steps", 16 + 11),
    ("handler of the pen", 16 + 7),
    ("handler of the clock and the contacts", 16),
    ("handler of the USB port", 16 + 5),
    ("handler of the serial line", 16 + 20),
];
/// The rows of the document's table, and the interrupts that are masked.
const MASKS: [(&str, u8); 6] = [
    ("all interrupts masked", InterruptTimes::ALL),
    ("all interrupts masked, flash being changed", InterruptTimes::ALL_FOR_FLASH),
    ("all but the steps and the pen masked", 0),
    ("all but the steps and the pen masked", 5),
    ("pen masked", 7),
    ("all but the steps and the pen masked", 20),
];

/// Requests that keep a port busy: the status, lists, and a line that is refused.
const BUSY: &[u8] = b"??$options\n$\n??v 1 1e99 x\n?";
/// The pin of the emergency stop.
const STOP: u8 = 10;

/// Sends these lines, the last of which draws.
fn send(line: &mut Line<Pico>, lines: &[String]) -> TestResult {
    for text in lines {
        line.emulator.send(format!("{text}\n").as_bytes())?;
        while line.hear()? != "ok" {}
    }
    Ok(())
}

/// Lets both ports send and receive until the board has drawn, or until `turns` requests.
fn disturb(line: &mut Line<Pico>, turns: usize) -> TestResult {
    for turn in 0..turns {
        if line.status()?.starts_with("<Idle") {
            break;
        }
        line.emulator.send_by_usb(BUSY)?;
        if turn % 4 == 0 {
            line.emulator.send(BUSY)?;
        }
        while line.emulator.receive_by_usb(&mut [0; 256], Duration::ZERO)? > 0 {}
        sleep(Duration::from_millis(5));
    }
    Ok(())
}

fn measured() -> Result<InterruptTimes, Box<dyn Error>> {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    line.emulator.time_interrupts()?;
    // The second time begins anew.
    line.emulator.time_interrupts()?;
    line.emulator.plug_usb_in()?;
    while line.emulator.receive_by_usb(&mut [0; 256], Duration::from_secs(1))? > 0 {}
    send(&mut line, &spiral::at_half_a_million())?;
    disturb(&mut line, usize::MAX)?;
    send(&mut line, &["$clear".to_owned()])?;
    // Each stroke is noted in the flash.
    send(&mut line, &job_lines("lattice2.obj", &["$page=45x45", "$margin=3", "$110=8000"]))?;
    disturb(&mut line, 60)?;
    line.emulator.reset_usb(20, 7)?;
    disturb(&mut line, 60)?;
    line.emulator.bounce(STOP, false, Duration::from_millis(5))?;
    while !line.status()?.starts_with("<Alarm") {}
    Ok(line.emulator.interrupt_times()?)
}

/// The time, in microseconds, that the document allows for a row.
fn allowed(row: &str) -> Option<u64> {
    let line = DOCUMENT.lines().find(|line| line.starts_with(&format!("| {row} |")))?;
    line.trim_end_matches(" |").rsplit("| ").next()?.replace(',', "").parse().ok()
}

/// Checks that each of these was measured, that there is no other, and that none took longer than
/// the document says. A time that is far shorter would mean that its work was not measured.
fn assert_bounded(rows: &[(&str, u8)], times: &BTreeMap<u8, Duration>) {
    let numbers: BTreeSet<u8> = rows.iter().map(|(_, number)| *number).collect();
    assert_eq!(times.keys().copied().collect::<BTreeSet<_>>(), numbers);
    for (row, number) in rows {
        let most = allowed(row).map(Duration::from_micros);
        println!("{row}: {:?} of {most:?}", times[number]);
        assert!(most.is_some_and(|most| times[number] <= most && times[number] > most / 100));
    }
}

/// Each step of the motor takes two interrupts of the pen, 50 µs apart, and the masks of the USB
/// port last longer. If one came so late, the next one would be lost.
#[test]
fn a_motor_that_lifts_the_pen_loses_no_step_while_the_port_is_busy() -> TestResult {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    line.emulator.plug_usb_in()?;
    while line.emulator.receive_by_usb(&mut [0; 256], Duration::from_secs(1))? > 0 {}
    let quick = ["$132=5", "$102=400", "$112=1500", "$page=45x45"];
    let settings = [&PEN_ON_A_MOTOR[..], &quick].concat();
    send(&mut line, &job_lines("lattice2.obj", &settings))?;
    // The resets of the bus mask the longest.
    for _ in 0..100 {
        line.emulator.reset_usb(10, 5)?;
        disturb(&mut line, 2)?;
    }
    disturb(&mut line, usize::MAX)?;
    // The lengths of the moves of the pen, up and down, between steps of the other motors.
    let (mut machine, mut moves, mut lasts) =
        (Machine::default(), Vec::<(bool, u32)>::new(), false);
    for change in line.emulator.pin_changes()? {
        let Some(event) = machine.change(change) else { continue };
        match event.kind {
            MachineEventKind::ZStep { down } => match moves.last_mut() {
                Some((is_down, steps)) if lasts && *is_down == down => *steps += 1,
                _ => moves.push((down, 1)),
            },
            MachineEventKind::Step { .. } => {}
            _ => continue,
        }
        lasts = matches!(event.kind, MachineEventKind::ZStep { .. });
    }
    // At first the pen goes up to its stop and back from there.
    let lengths = |downward: bool| -> BTreeSet<u32> {
        moves.iter().skip(2).filter(|it| it.0 == downward).map(|it| it.1).collect()
    };
    let (lowered, raised) = (lengths(true), lengths(false));
    assert!(moves.len() > 20 && lowered.len() == 1 && lowered == raised, "{moves:?}");
    Ok(())
}

#[test]
fn no_handler_and_no_mask_takes_longer_than_the_document_says() -> TestResult {
    let times = measured()?;
    assert_bounded(&HANDLERS, &times.handlers);
    assert_bounded(&MASKS, &times.masks);
    Ok(())
}
