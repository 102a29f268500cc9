//! Runs whole jobs on emulated boards and the same jobs on the host.

use crate::whole_jobs::{Bench, job_lines, machine_events};
use penup::board_table::{BoardRow, LM3S6965, PICO};
use penup::boards::host::CutArea;
use penup::motion::Block;
use penup::plotter::{Memory, MemorySlices};
use penup_client::emulator::{self, EmulatedBoard, Machine, MachineEventKind};
use std::error::Error;
use std::time::Duration;

/// How long a board may compute without output. It may take minutes on a busy computer.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Parts of the mangled names of the functions of the Pico's image that `pico_cycles` times: seeing
/// and hidden lines, hidden lines alone, the pairing of odd points, the improvement of the tour,
/// and the order of all strokes.
pub const STAGES: [&str; 5] = [
    "5penup4view4clip13project_scene17h",
    "5penup10visibility14find_stretches17h",
    "5penup5order7pairing11pair_points17h",
    "5penup5order7improve7improve17h",
    "5penup5order10order_pens17h",
];

/// Parts of the mangled names of the functions that `large_model` times, and what they do. The
/// machine draws meanwhile, which counts in.
pub const STAGES_IN_TILES: [(&str, &str); 4] = [
    ("stored7compute7prepare17h", "camera, index and place on the page"),
    ("stored7compute10find_lines17h", "hidden lines"),
    ("stored7compute11order_lines17h", "order"),
    ("11plot_stored17h", "from $plot until the first part is handed over"),
];

/// Allocates the memory of a board whose row is constant.
macro_rules! memory_of {
    ($row:ident) => {
        Box::leak(Box::new(Memory::<
            { $row.memory.vertices },
            { $row.memory.corners },
            { $row.memory.words },
            { $row.memory.ports },
        >::new()))
        .lend(vec![Block::EMPTY; $row.memory.blocks].leak())
    };
}

/// A board in memory with the capacities of `board`. The amount of memory affects how far the order
/// of strokes is improved.
pub fn bench_like(board: &'static BoardRow) -> Bench {
    let memory: MemorySlices = if board == &PICO { memory_of!(PICO) } else { memory_of!(LM3S6965) };
    let mut bench = Bench::with_queue(memory, board.memory.steps);
    if board.model_flash > 0 {
        bench.board.set_model_flash(Some(CutArea::new(board.model_flash as usize)));
    }
    bench.heard();
    Bench { plotter: bench.plotter.with_early_ink(board.early_ink), ..bench }
}

/// The machine events of a job on the host.
fn on_the_host(board: &'static BoardRow, lines: &[String]) -> Vec<MachineEventKind> {
    let mut bench = bench_like(board);
    for line in lines {
        let answer = bench.say(&format!("{line}\n"));
        assert_eq!(answer.lines().last(), Some("ok"), "{line}: {answer}");
    }
    bench.finish();
    // Each change of pen is confirmed at once.
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
    /// Boots a board and waits for its greeting.
    ///
    /// # Errors
    /// The board does not start.
    pub fn open(board: &'static BoardRow) -> Result<Self, Box<dyn Error>> {
        Self::to(emulator::boot(board)?)
    }
}

impl<E: EmulatedBoard + ?Sized> Line<E> {
    /// Connects to a board that is starting, and waits for its greeting.
    ///
    /// # Errors
    /// No greeting arrives.
    pub fn to(emulator: Box<E>) -> Result<Self, Box<dyn Error>> {
        let mut line = Self::silent(emulator);
        line.hear_greeting()?;
        Ok(line)
    }

    /// Connects to a board that has not sent anything.
    pub fn silent(emulator: Box<E>) -> Self {
        Self { heard: Vec::new(), emulator }
    }

    /// Discards a partial line, because the board was restarted.
    pub fn forget(&mut self) {
        self.heard.clear();
    }

    /// Waits for the board's greeting.
    ///
    /// # Errors
    /// No greeting arrives.
    pub fn hear_greeting(&mut self) -> Result<(), Box<dyn Error>> {
        while !self.hear()?.starts_with("Grbl") {}
        Ok(())
    }

    /// Returns the next line that the board sends.
    ///
    /// # Errors
    /// No line arrives in time, or the emulator has ended.
    pub fn hear(&mut self) -> Result<String, Box<dyn Error>> {
        loop {
            if let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                return Ok(String::from_utf8(line)?.trim().to_owned());
            }
            let mut buffer = [0; 256];
            let received = self.emulator.receive(&mut buffer, TIMEOUT);
            let count = received.map_err(|error| format!("{error}: {}", self.emulator.said()))?;
            if count == 0 {
                return Err("the board is silent".into());
            }
            self.heard.extend_from_slice(&buffer[..count]);
        }
    }

    /// Sends a line and returns the next line that the board sends.
    ///
    /// # Errors
    /// The emulator has ended, or is silent.
    pub fn ask(&mut self, text: &str) -> Result<String, Box<dyn Error>> {
        self.emulator.send(format!("{text}\n").as_bytes())?;
        self.hear()
    }

    /// Ends an alarm by `$X`, and returns whether the board agreed.
    ///
    /// # Errors
    /// The emulator has ended, or is silent.
    pub fn unlock(&mut self) -> Result<bool, Box<dyn Error>> {
        let answer = self.ask("$X")?;
        let end = self.hear()?;
        Ok(answer == "[MSG:Caution: Unlocked]" && end == "ok")
    }

    /// Queries the status report.
    ///
    /// # Errors
    /// The emulator has ended, or is silent.
    pub fn status(&mut self) -> Result<String, Box<dyn Error>> {
        self.emulator.send(b"?")?;
        self.hear()
    }
}

/// Boots a board and starts the job.
///
/// # Errors
/// The board does not start.
pub fn begin(board: &'static BoardRow, lines: &[String]) -> Result<Line, Box<dyn Error>> {
    begin_on(Line::open(board)?, lines)
}

/// Starts the job on a board that has sent its greeting.
///
/// # Errors
/// The board stops answering.
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

/// The machine events of a job according to the pins of an emulated board.
///
/// # Errors
/// The emulator fails.
pub fn at_the_pins(
    board: &'static BoardRow,
    lines: &[String],
) -> Result<Vec<MachineEventKind>, Box<dyn Error>> {
    events_until_idle(&mut begin(board, lines)?)
}

/// The machine events until the job that was started has ended.
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
        // Each query delays the emulator.
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Removes the events at boot, before the first job.
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

/// Runs a job of `scenes/` on an emulated board and on the host, and checks that the steps and pen
/// moves are identical, one by one.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// Panics if they differ.
pub fn compare(
    board: &'static BoardRow,
    scene: &str,
    settings: &[&str],
) -> Result<(), Box<dyn Error>> {
    let lines = job_lines(scene, settings);
    let pins = at_the_pins(board, &lines)?;
    assert_same_as_on_the_host(board, &lines, &pins);
    Ok(())
}

/// Checks that the job of `lines` on the host has exactly these steps and pen moves.
///
/// # Panics
/// Panics if they differ.
pub fn assert_same_as_on_the_host(
    board: &'static BoardRow,
    lines: &[String],
    pins: &[MachineEventKind],
) {
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

/// Aborts a job with the pen down, and plots it again. The steps must stop, the pen must be raised,
/// and the reported position must be that of the pins.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// Panics if one of these conditions is violated.
pub fn give_up(board: &'static BoardRow) -> Result<(), Box<dyn Error>> {
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
    // With 80 steps per millimetre, the reported position must be that of the pins.
    let (x, y) = machine.position();
    let reported = status.split("MPos:").nth(1).unwrap_or_default().split(',');
    let reported: Vec<f64> = reported.take(2).map(str::parse).collect::<Result<_, _>>()?;
    for (reported, steps) in reported.iter().zip([x, y]) {
        assert!((reported - f64::from(steps) / 80.0).abs() <= 0.001, "{status} {x} {y}");
    }
    // Nothing moves any more, and the board is ready: the model is still there.
    assert_eq!(line.emulator.pin_changes()?, []);
    assert_eq!(line.ask("$plot")?, "ok");
    Ok(())
}

/// Settings of a machine whose pen is lifted by a motor. It has 400 steps, and 62 of them remain
/// below the upper stop when the pen is raised.
pub const PEN_ON_A_MOTOR: [&str; 5] = ["$132=1", "$112=900", "$122=500", "$210=20", "$209=1"];

/// An emergency stop with the pen down. No step of x and y may follow it, and a motor must raise
/// the pen before the board can be unlocked.
///
/// # Errors
/// The emulator fails.
///
/// # Panics
/// Panics if one of these conditions is violated.
pub fn stop_at_once(board: &'static BoardRow) -> Result<(), Box<dyn Error>> {
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
    while !line.unlock()? {}
    for change in line.emulator.pin_changes()? {
        events.extend(machine.change(change).map(|event| event.kind));
    }
    events.extend(machine.last().map(|event| event.kind));
    // The motor began at the lowest position, and the upper stop limits it.
    let position = |events: &[MachineEventKind]| {
        events.iter().fold(400, |position: i32, event| match event {
            MachineEventKind::ZStep { down } => (position + if *down { 1 } else { -1 }).max(0),
            _ => position,
        })
    };
    assert_eq!(position(&events), 62);
    let after = &events[stopped_at + 1..];
    assert!(!after.iter().any(|event| matches!(event, MachineEventKind::Step { .. })), "{after:?}");
    Ok(())
}
