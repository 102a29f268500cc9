//! The same bits everywhere: a job's steps and pen moves from the LM3S6965's pins are those of the
//! library on the host, one by one.
#![cfg(feature = "emulator")]

use penup::plotter::{Lm3s6965Memory, NO_MOVES};
use penup_client::emulator::{
    EmulatedBoard, Emulator, Machine, MachineEventKind, Options, image_path,
};
use penup_host_tests::whole_jobs::{Bench, job_lines, machine_events};
use std::error::Error;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

fn on_the_host(lines: &[String]) -> Vec<MachineEventKind> {
    // The board's capacities: memory decides how far the order of strokes is improved.
    let memory = Box::leak(Box::new(Lm3s6965Memory::new()));
    let mut bench = Bench::with_memory(memory.lend(Box::leak(Box::new(NO_MOVES))));
    bench.heard();
    for line in lines {
        assert_eq!(bench.say(&format!("{line}\n")), "ok\n", "{line}");
    }
    bench.finish();
    machine_events(&bench.board.trace().changes())
}

struct Line {
    emulator: Emulator,
    heard: Vec<u8>,
}

impl Line {
    fn next(&mut self) -> Result<String, Box<dyn Error>> {
        loop {
            if let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                return Ok(String::from_utf8(line)?.trim().to_owned());
            }
            let mut buffer = [0; 256];
            let count = self.emulator.receive(&mut buffer, PATIENCE)?;
            if count == 0 {
                return Err("the board is silent".into());
            }
            self.heard.extend_from_slice(&buffer[..count]);
        }
    }
}

/// A board that has begun the job.
fn begin(lines: &[String]) -> Result<Line, Box<dyn Error>> {
    let emulator = Emulator::start(&image_path("lm3s6965"), Options::default())?;
    let mut line = Line { emulator, heard: Vec::new() };
    while !line.next()?.starts_with("Grbl") {}
    for text in lines {
        line.emulator.send(format!("{text}\n").as_bytes())?;
        assert_eq!(line.next()?, "ok", "{text}");
    }
    Ok(line)
}

fn at_the_pins(lines: &[String]) -> Result<Vec<MachineEventKind>, Box<dyn Error>> {
    let mut line = begin(lines)?;
    let (mut machine, mut events) = (Machine::default(), Vec::new());
    loop {
        line.emulator.send(b"?")?;
        let idle = line.next()?.starts_with("<Idle");
        for change in line.emulator.pin_changes()? {
            events.extend(machine.change(change).map(|event| event.kind));
        }
        if idle {
            events.extend(machine.last().map(|event| event.kind));
            return Ok(events);
        }
        // Each question costs the emulator a wait.
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Without what the pins do at boot, before the first job.
fn job_of(events: &[MachineEventKind]) -> &[MachineEventKind] {
    let is_boot = |event: &&MachineEventKind| {
        matches!(
            event,
            MachineEventKind::Drivers { on: false } | MachineEventKind::Pen { down: false }
        )
    };
    let boot = events.iter().take_while(is_boot).count();
    &events[boot..]
}

fn compare(scene: &str, settings: &[&str]) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    let (host, pins) = (on_the_host(&lines), at_the_pins(&lines)?);
    let (host, pins) = (job_of(&host), job_of(&pins));
    assert!(host.len() > 10_000, "{} events are no job", host.len());
    let differs = host.iter().zip(pins).position(|(host, pin)| host != pin);
    assert_eq!(differs, None, "{scene}");
    assert_eq!(host.len(), pins.len(), "{scene}");
    Ok(())
}

#[test]
fn a_concave_solid_in_perspective() -> Result<(), Box<dyn Error>> {
    compare("notched.obj", &["$eye=5.5,9,5", "$at=2,1.5,1", "$page=80x80", "$margin=5"])
}

#[test]
fn solids_through_each_other_with_dotted_hidden_lines() -> Result<(), Box<dyn Error>> {
    compare(
        "interpen.obj",
        &["$projection=isometric", "$hidden=dotted", "$page=80x80", "$margin=5"],
    )
}

#[test]
fn many_parts_with_many_odd_points() -> Result<(), Box<dyn Error>> {
    compare("lattice2.obj", &["$page=60x80", "$margin=5"])
}

#[test]
fn a_lattice_of_125_cubes_in_64_kilobytes() -> Result<(), Box<dyn Error>> {
    let camera = ["$eye=-15.37,-20.71,25.13", "$at=4.5,4.5,4.5", "$up=0,0,1"];
    compare("lattice5.obj", &[&camera[..], &["$page=40x40", "$margin=2"]].concat())
}

#[test]
fn ctrl_x_stops_the_steps_raises_the_pen_and_knows_the_position() -> Result<(), Box<dyn Error>> {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin(&lines)?;
    let mut machine = Machine::default();
    while !machine.pen_is_down() {
        line.emulator.send(b"?")?;
        assert!(line.next()?.starts_with("<Run"));
        for change in line.emulator.pin_changes()? {
            machine.change(change);
        }
    }
    line.emulator.send(b"\x18")?;
    while !line.next()?.starts_with("Grbl") {}
    let status = loop {
        line.emulator.send(b"?")?;
        let status = line.next()?;
        if status.starts_with("<Idle") {
            break status;
        }
    };
    for change in line.emulator.pin_changes()? {
        machine.change(change);
    }
    assert!(!machine.pen_is_down());
    // 80 steps a millimetre: the reported position is that of the pins.
    let (x, y) = machine.position();
    let position = status.split("|MPos:").nth(1).ok_or("no position")?.split(',');
    let reported: Vec<f64> = position.take(2).map(str::parse).collect::<Result<_, _>>()?;
    for (reported, steps) in reported.into_iter().zip([x, y]) {
        assert!((reported - f64::from(steps) / 80.0).abs() < 0.001, "{status} {steps}");
    }
    // Nothing more moves, and it is ready: the model is still there.
    assert_eq!(line.emulator.pin_changes()?, []);
    line.emulator.send(b"$plot\n")?;
    assert_eq!(line.next()?, "ok");
    Ok(())
}
