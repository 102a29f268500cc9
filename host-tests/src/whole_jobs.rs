//! Whole jobs on the board of plain memory, over its serial line.

use penup::boards::host::{HostBoard, Stamped, lend_memory};
use penup::machine::{EventRing, PulserState};
use penup::plotter::{Board, MemorySlices, Plotter};
use penup_client::emulator::{Machine, MachineEventKind};

/// A plotter of plain memory at the other end of a serial line.
pub struct Bench {
    /// Its board.
    pub board: HostBoard<'static>,
    /// Its firmware.
    pub plotter: Plotter<'static>,
}

impl Bench {
    /// With the capacities of `memory`, switched on and greeted.
    pub fn with_memory(memory: MemorySlices<'static>) -> Self {
        // A test's process ends soon; until then the plotter borrows from these.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins = Box::leak(Box::new(PulserState::new()));
        let mut board = HostBoard::new(ring, pins);
        let plotter = Plotter::new(memory, pins);
        plotter.greet(&mut board);
        Self { board, plotter }
    }

    /// With the capacities of a computer.
    pub fn new() -> Self {
        Self::with_memory(lend_memory())
    }

    /// Sends `text` and returns what comes back until everything is read.
    pub fn say(&mut self, text: &str) -> String {
        self.board.receive(text.as_bytes());
        while self.plotter.poll(&mut self.board) || !self.board.has_read_all() {}
        self.heard()
    }

    /// What came back since last asked.
    pub fn heard(&mut self) -> String {
        String::from_utf8_lossy(&self.board.take_sent()).replace("\r\n", "\n")
    }

    /// Lets the plotter work until nothing moves any more; at most an hour of its time.
    pub fn finish(&mut self) {
        for _ in 0..3_600_000 {
            let busy = self.plotter.poll(&mut self.board);
            self.board.wait();
            // What waited for the last event goes on in the turn after it.
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

/// What the machine did, by the changes of its pins, in order.
pub fn machine_events(changes: &[Stamped]) -> Vec<MachineEventKind> {
    let mut machine = Machine::default();
    let mut events: Vec<_> =
        changes.iter().filter_map(|change| machine.change(change.into())).collect();
    events.extend(machine.last());
    events.iter().map(|event| event.kind).collect()
}

/// The lines of a job: a file of `scenes/`, its camera, and what else is to be set.
pub fn job_lines(scene: &str, settings: &[&str]) -> Vec<String> {
    let path = penup_client::workspace::root().join("scenes").join(scene);
    let text = std::fs::read_to_string(&path).expect("a scene of the project");
    let model = text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned);
    let settings = settings.iter().map(|line| (*line).to_owned());
    model.chain(settings).chain(["$plot".to_owned()]).collect()
}
