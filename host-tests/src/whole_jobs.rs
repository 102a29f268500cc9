//! Runs whole jobs on the board in memory, over its serial line.

use penup::board_table::PICO;
use penup::boards::host::{HostBoard, Stamped, lend_memory};
use penup::machine::{EventRing, PulserState};
use penup::plotter::{Board, EMPTY_LOOKAHEAD, Memory, MemorySlices, Plotter};
use penup_client::emulator::{Machine, MachineEventKind};

/// A plotter in memory at the other end of a serial line.
pub struct Bench {
    /// Its board.
    pub board: HostBoard<'static>,
    /// Its firmware.
    pub plotter: Plotter<'static>,
}

impl Bench {
    /// Starts a plotter with the capacities of `memory` and waits for its greeting.
    pub fn with_memory(memory: MemorySlices<'static>) -> Self {
        Self::with_queue(memory, PICO.memory.steps)
    }

    /// The same for a plotter that is never faster than it could stop within 13/16 of so many
    /// `steps`.
    pub fn with_queue(memory: MemorySlices<'static>, steps: u32) -> Self {
        // The memory is leaked: the plotter borrows it until the test's process ends, which is
        // soon.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins = Box::leak(Box::new(PulserState::new()));
        let mut board = HostBoard::new(ring, pins);
        pins.set_queue(steps);
        let plotter = Plotter::new(memory, pins);
        plotter.greet(&mut board);
        Self { board, plotter }
    }

    /// Starts a plotter with the capacities of a computer.
    pub fn new() -> Self {
        Self::with_memory(lend_memory())
    }

    /// Starts a plotter that has hardly any memory for models, which is enough for G-code and
    /// HP-GL. Its greeting has been heard.
    pub fn small() -> Self {
        let memory = Box::leak(Box::new(Memory::<4, 4, 16, 2>::new()));
        let mut bench = Self::with_memory(memory.lend(Box::leak(Box::new(EMPTY_LOOKAHEAD))));
        bench.heard();
        bench
    }

    /// Lets a number of milliseconds of the plotter's time pass.
    pub fn work(&mut self, milliseconds: u32) {
        for _ in 0..milliseconds {
            while self.plotter.poll(&mut self.board) {}
            self.board.wait();
        }
    }

    /// Sends `text`, runs the plotter until it has read all of it, and returns its output.
    pub fn say(&mut self, text: &str) -> String {
        self.board.receive(text.as_bytes());
        while self.plotter.poll(&mut self.board) || !self.board.has_read_all() {}
        self.heard()
    }

    /// Sends lines, each of which must be accepted. Returns all that was answered.
    ///
    /// # Panics
    /// A line is refused.
    pub fn order(&mut self, lines: &[String]) -> String {
        let mut all = String::new();
        for line in lines {
            let answer = self.say(&format!("{line}\n"));
            assert!(answer.ends_with("ok\n"), "{line}: {answer}");
            all += &answer;
        }
        all
    }

    /// Returns the output since the last call.
    pub fn heard(&mut self) -> String {
        String::from_utf8_lossy(&self.board.take_sent()).replace("\r\n", "\n")
    }

    /// Runs the plotter until nothing moves any more, at most for an hour of its time.
    pub fn finish(&mut self) {
        for _ in 0..3_600_000 {
            let busy = self.plotter.poll(&mut self.board);
            self.board.wait();
            // Work that waited for the last event continues in the iteration after it.
            let is_stopped = !busy && self.plotter.machine().is_stopped();
            if is_stopped && !self.plotter.poll(&mut self.board) {
                return;
            }
        }
        panic!("the job does not end");
    }
}

impl Default for Bench {
    fn default() -> Self {
        Self::new()
    }
}

/// The actions of the machine, in order, according to the changes of its pins.
pub fn machine_events(changes: &[Stamped]) -> Vec<MachineEventKind> {
    let mut machine = Machine::default();
    let mut events: Vec<_> =
        changes.iter().filter_map(|change| machine.change(change.into())).collect();
    events.extend(machine.last());
    events.iter().map(|event| event.kind).collect()
}

/// The protocol lines of a job: a file of `scenes/`, its camera, and additional settings.
pub fn job_lines(scene: &str, settings: &[&str]) -> Vec<String> {
    let path = penup_client::workspace::root().join("scenes").join(scene);
    let text = std::fs::read_to_string(&path).expect("a scene of the project");
    let model = text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned);
    let settings = settings.iter().map(|line| (*line).to_owned());
    model.chain(settings).chain(["$plot".to_owned()]).collect()
}
