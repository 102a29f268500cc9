//! Whole jobs on emulated boards, and the same jobs on the host.

use crate::whole_jobs::{Bench, job_lines, machine_events};
use penup::plotter::{EMPTY_LOOKAHEAD, EMPTY_LOOKAHEAD_OF_PICO, Lm3s6965Memory, PicoMemory};
use penup_client::emulator::{EmulatedBoard, Machine, MachineEventKind};
use penup_client::machines::Board;
use std::error::Error;
use std::time::Duration;

/// How long a board may compute without a word: minutes, on a machine with much else to do.
const PATIENCE: Duration = Duration::from_secs(300);

/// A board of plain memory with the capacities of `board`: memory decides how far the order of
/// strokes is improved.
pub fn bench_like(board: Board) -> Bench {
    let mut bench = Bench::with_memory(match board {
        Board::Lm3s6965 => {
            Box::leak(Box::new(Lm3s6965Memory::new())).lend(Box::leak(Box::new(EMPTY_LOOKAHEAD)))
        }
        Board::Pico => Box::leak(Box::new(PicoMemory::new()))
            .lend(Box::leak(Box::new(EMPTY_LOOKAHEAD_OF_PICO))),
    });
    bench.heard();
    bench
}

/// What its pins do in a job.
fn on_the_host(board: Board, lines: &[String]) -> Vec<MachineEventKind> {
    let mut bench = bench_like(board);
    for line in lines {
        let answer = bench.say(&format!("{line}\n"));
        assert_eq!(answer.lines().last(), Some("ok"), "{line}: {answer}");
    }
    bench.finish();
    // Each pen is put in at once.
    while bench.heard().contains("then send ~") {
        bench.say("~");
        bench.finish();
    }
    machine_events(&bench.board.trace().changes())
}

/// An emulated board at the other end of a serial line.
pub struct Line<E: ?Sized = dyn EmulatedBoard> {
    heard: Vec<u8>,
    /// The board.
    pub emulator: Box<E>,
}

impl Line {
    /// A board that has greeted.
    ///
    /// # Errors
    /// It does not start.
    pub fn open(board: Board) -> Result<Self, Box<dyn Error>> {
        Self::to(board.boot()?)
    }
}

impl<E: EmulatedBoard + ?Sized> Line<E> {
    /// A line to a board that is starting.
    ///
    /// # Errors
    /// It does not greet.
    pub fn to(emulator: Box<E>) -> Result<Self, Box<dyn Error>> {
        let mut line = Self::silent(emulator);
        line.hear_greeting()?;
        Ok(line)
    }

    /// A line to a board that has not spoken.
    pub fn silent(emulator: Box<E>) -> Self {
        Self { heard: Vec::new(), emulator }
    }

    /// Forgets half a line: the board has started again.
    pub fn forget(&mut self) {
        self.heard.clear();
    }

    /// Listens until the board greets.
    ///
    /// # Errors
    /// It does not.
    pub fn hear_greeting(&mut self) -> Result<(), Box<dyn Error>> {
        while !self.hear()?.starts_with("Grbl") {}
        Ok(())
    }

    /// The next line that comes back.
    ///
    /// # Errors
    /// None comes.
    pub fn hear(&mut self) -> Result<String, Box<dyn Error>> {
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

    /// Sends a line and returns the next that comes back.
    ///
    /// # Errors
    /// The emulator has ended, or is silent.
    pub fn ask(&mut self, text: &str) -> Result<String, Box<dyn Error>> {
        self.emulator.send(format!("{text}\n").as_bytes())?;
        self.hear()
    }

    /// The status.
    ///
    /// # Errors
    /// The emulator has ended, or is silent.
    pub fn status(&mut self) -> Result<String, Box<dyn Error>> {
        self.emulator.send(b"?")?;
        self.hear()
    }
}

/// A board that has begun the job.
///
/// # Errors
/// It does not start.
pub fn begin(board: Board, lines: &[String]) -> Result<Line, Box<dyn Error>> {
    begin_on(Line::open(board)?, lines)
}

/// The same on a board that has greeted.
///
/// # Errors
/// It falls silent.
pub fn begin_on<E: EmulatedBoard + ?Sized>(
    mut line: Line<E>,
    lines: &[String],
) -> Result<Line<E>, Box<dyn Error>> {
    for text in lines {
        let mut answer = line.ask(text)?;
        while answer.starts_with('[') {
            answer = line.hear()?;
        }
        assert_eq!(answer, "ok", "{text}");
    }
    Ok(line)
}

/// What the pins of an emulated board do in a job.
///
/// # Errors
/// The emulator fails.
pub fn at_the_pins(
    board: Board,
    lines: &[String],
) -> Result<Vec<MachineEventKind>, Box<dyn Error>> {
    events_until_idle(&mut begin(board, lines)?)
}

/// What the pins do until the job that has begun is done.
///
/// # Errors
/// The emulator fails.
pub fn events_until_idle<E: EmulatedBoard + ?Sized>(
    line: &mut Line<E>,
) -> Result<Vec<MachineEventKind>, Box<dyn Error>> {
    let (mut machine, mut events) = (Machine::default(), Vec::new());
    loop {
        let idle = line.status()?.starts_with("<Idle");
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

/// Runs a job of `scenes/` on an emulated board and on the host: the steps and pen moves are the
/// same, one by one.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// If they are not.
pub fn compare(board: Board, scene: &str, settings: &[&str]) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    let pins = at_the_pins(board, &lines)?;
    assert_same_as_on_the_host(board, &lines, &pins);
    Ok(())
}

/// The job of `lines` on the host has these steps and pen moves, one by one.
///
/// # Panics
/// If it has not.
pub fn assert_same_as_on_the_host(board: Board, lines: &[String], pins: &[MachineEventKind]) {
    let host = on_the_host(board, lines);
    let (host, pins) = (job_of(&host), job_of(pins));
    assert!(host.len() > 10_000, "{} events are no job", host.len());
    let differs = host.iter().zip(pins).position(|(host, pin)| host != pin);
    let around = differs.map(|at| {
        let part = |events: &[MachineEventKind]| {
            format!("{:?}", &events[at.saturating_sub(3)..events.len().min(at + 5)])
        };
        (at, part(host), part(pins))
    });
    assert_eq!(around, None);
    assert_eq!(host.len(), pins.len());
}

/// Gives a job up with the pen down, and plots it again: the steps stop, the pen is raised, the
/// position is that of the pins.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// If they do not.
pub fn give_up(board: Board) -> Result<(), Box<dyn Error>> {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin(board, &lines)?;
    let mut machine = Machine::default();
    while !machine.pen_is_down() {
        assert!(line.status()?.starts_with("<Run"));
        for change in line.emulator.pin_changes()? {
            machine.change(change);
        }
    }
    line.emulator.send(b"\x18")?;
    while !line.hear()?.starts_with("Grbl") {}
    let status = loop {
        let status = line.status()?;
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
    let reported = status.split("MPos:").nth(1).unwrap_or_default().split(',');
    let reported: Vec<f64> = reported.take(2).map(str::parse).collect::<Result<_, _>>()?;
    for (reported, steps) in reported.iter().zip([x, y]) {
        assert!((reported - f64::from(steps) / 80.0).abs() <= 0.001, "{status} {x} {y}");
    }
    // Nothing more moves, and it is ready: the model is still there.
    assert_eq!(line.emulator.pin_changes()?, []);
    assert_eq!(line.ask("$plot")?, "ok");
    Ok(())
}

/// Settings of a machine whose pen a motor lifts: 400 steps, of which 62 when it is raised.
pub const PEN_ON_A_MOTOR: [&str; 5] = ["$132=1", "$112=900", "$122=500", "$210=20", "$209=1"];

/// An emergency stop with the pen down: no step of x and y comes after it, and a motor raises the pen
/// before the board can be unlocked.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// If it does not.
pub fn stop_at_once(board: Board) -> Result<(), Box<dyn Error>> {
    let settings = [&PEN_ON_A_MOTOR[..], &["$page=60x80", "$margin=5"]].concat();
    let mut line = begin(board, &job_lines("lattice2.obj", &settings))?;
    let (mut machine, mut events) = (Machine::default(), Vec::new());
    while !machine.pen_is_down() {
        for change in line.emulator.pin_changes()? {
            events.extend(machine.change(change).map(|event| event.kind));
        }
    }
    line.emulator.send(b"\xFD")?;
    while line.hear()? != "ALARM:10" {}
    for change in line.emulator.pin_changes()? {
        events.extend(machine.change(change).map(|event| event.kind));
    }
    let stopped_at = events.len();
    while line.ask("$X")? != "ok" {
        // A refusal is two lines.
        line.hear()?;
    }
    for change in line.emulator.pin_changes()? {
        events.extend(machine.change(change).map(|event| event.kind));
    }
    events.extend(machine.last().map(|event| event.kind));
    // It began as low as it can be, and the stop holds it.
    let place = |events: &[MachineEventKind]| {
        events.iter().fold(400, |place: i32, event| match event {
            MachineEventKind::Lift { down } => (place + if *down { 1 } else { -1 }).max(0),
            _ => place,
        })
    };
    assert_eq!(place(&events), 62);
    let after = &events[stopped_at + 1..];
    assert!(!after.iter().any(|event| matches!(event, MachineEventKind::Step { .. })), "{after:?}");
    Ok(())
}
