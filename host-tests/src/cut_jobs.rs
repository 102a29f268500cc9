//! Jobs on the board in memory whose power fails, and the ink that they leave on the paper.

use penup::boards::host::{CutArea, CutFlash, HostBoard, LAYOUT, PORTS, QUEUE_LENGTH, Stamped};
use penup::machine::{Contacts, EventRing, PulserState};
use penup::plotter::{Board, EMPTY_LOOKAHEAD, Memory, Plotter, start};
use penup_client::emulator::{Machine, MachineEventKind};
use penup_job::pins::PinChange;
use std::collections::BTreeSet;

/// A point of the page in steps.
pub type Point = (i32, i32);

/// The length of strokes, in steps.
pub fn drawn_length(strokes: &[Vec<Point>]) -> f64 {
    let legs = strokes.iter().flat_map(|stroke| stroke.windows(2));
    let length = |leg: &[Point]| match leg {
        [from, to] => f64::from(to.0 - from.0).hypot(f64::from(to.1 - from.1)),
        _ => 0.0,
    };
    legs.map(length).sum()
}

/// Creates the erased flash of a board in memory.
pub fn empty_flash() -> CutFlash {
    CutFlash::new(LAYOUT.end() as usize)
}

/// A plotter that runs until its power fails.
pub struct Powered<'s, 'm> {
    /// Its board.
    pub board: &'s mut HostBoard<'m>,
    /// Its firmware.
    pub plotter: &'s mut Plotter<'m>,
}

impl Powered<'_, '_> {
    /// Returns the output since the last call.
    pub fn heard(&mut self) -> String {
        String::from_utf8_lossy(&self.board.take_sent()).replace("\r\n", "\n")
    }

    /// Whether the power has failed while the flash was written.
    pub fn is_cut(&mut self) -> bool {
        self.board.flash().is_some_and(|flash| flash.is_cut)
    }

    /// Sends a line, runs the plotter until it has read the line, and returns its output.
    pub fn say(&mut self, line: &str) -> String {
        self.send(&format!("{line}\n"));
        self.heard()
    }

    /// Sends bytes, and runs the plotter until it has read them.
    pub fn send(&mut self, bytes: &str) {
        self.board.receive(bytes.as_bytes());
        while self.plotter.poll(self.board) || !self.board.has_read_all() {}
    }

    /// Sends lines, each of which must be accepted, unless the power fails.
    ///
    /// # Panics
    /// Panics if one is refused.
    pub fn order(&mut self, lines: &[String]) {
        for line in lines {
            let answer = self.say(line);
            if self.is_cut() {
                return;
            }
            assert_eq!(answer.lines().last(), Some("ok"), "{line}: {answer}");
        }
    }

    /// Runs for this many milliseconds, or until nothing moves any more, or until the power fails
    /// while the flash is written. Returns how many passed.
    pub fn run(&mut self, milliseconds: u64) -> u64 {
        for passed in 0..milliseconds {
            let busy = self.plotter.poll(self.board);
            if self.is_cut() || (!busy && self.plotter.machine().is_stopped()) {
                return passed;
            }
            self.board.wait();
        }
        milliseconds
    }

    /// Runs until the job has ended.
    ///
    /// # Panics
    /// Panics if it does not end within an hour of the plotter's time.
    pub fn finish(&mut self) -> u64 {
        let passed = self.run(3_600_000);
        assert!(passed < 3_600_000, "the job does not end");
        passed
    }

    /// Homes the machine, whose pen was left at `at` when the power came, in steps from its
    /// switches. Returns where it is homed, in steps from there.
    ///
    /// # Panics
    /// Panics if the machine is not homed within a minute.
    pub fn home(&mut self, at: Point) -> Point {
        self.heard();
        self.board.receive(b"$H\n");
        let (mut machine, mut seen) = (Machine::default(), 0);
        for _ in 0..60_000 {
            let changes = self.board.trace().changes();
            for change in &changes[seen..] {
                machine.change(PinChange::from(change));
            }
            seen = changes.len();
            let (x, y) = machine.position();
            self.board.set_contacts(Contacts { x: at.0 + x <= 0, y: at.1 + y <= 0, stop: false });
            while self.plotter.poll(self.board) {}
            self.board.wait();
            if self.heard().ends_with("ok\n") {
                return machine.position();
            }
        }
        panic!("the machine is not homed: {}", self.status());
    }

    /// Where the pen is, in steps from where it was when the power came.
    pub fn position(&self) -> Point {
        let mut machine = Machine::default();
        for change in self.board.trace().changes() {
            machine.change(PinChange::from(&change));
        }
        machine.position()
    }

    /// The status report.
    pub fn status(&mut self) -> String {
        self.heard();
        self.send("?");
        self.heard()
    }
}

/// Switches a board with this flash on, lets `work` use it, and cuts the power. Returns the flash
/// as it is then, and the changes of the pins.
///
/// # Panics
/// Panics if `work` takes the board's flash away.
pub fn switch_on(
    flash: CutFlash,
    work: impl FnOnce(&mut Powered<'_, '_>),
) -> (CutFlash, Vec<Stamped>) {
    switch_on_early::<16384>(flash, None, work)
}

/// Does the same with a board that has so many `WORDS` of working memory, and whose pen begins
/// while the order is computed, if `work_ticks` are given: so many pass in a millisecond of
/// computing.
///
/// # Panics
/// As [`switch_on`].
pub fn switch_on_early<const WORDS: usize>(
    flash: CutFlash,
    work_ticks: Option<u64>,
    work: impl FnOnce(&mut Powered<'_, '_>),
) -> (CutFlash, Vec<Stamped>) {
    let mut memory = Memory::<1024, 4096, WORDS, PORTS>::new();
    let (flash, _, changes) = powered(&mut memory, flash, None, work_ticks, work);
    (flash, changes)
}

/// Switches a board on that has little memory and this flash for a model, which takes the models
/// that do not fit. So many ticks pass in a millisecond of computing. Otherwise as [`switch_on`];
/// returns the model's flash, too.
///
/// # Panics
/// Panics if `work` takes a flash of the board away.
pub fn switch_on_small(
    flash: CutFlash,
    model: CutArea,
    work_ticks: u64,
    work: impl FnOnce(&mut Powered<'_, '_>),
) -> (CutFlash, CutArea, Vec<Stamped>) {
    let mut memory = Memory::<20, 60, 4000, PORTS>::new();
    let (flash, model, changes) = powered(&mut memory, flash, Some(model), Some(work_ticks), work);
    (flash, model.expect("the board has flash for models"), changes)
}

/// Switches a board with this memory on, lets `work` use it, and cuts the power.
fn powered<const VERTICES: usize, const CORNERS: usize, const WORDS: usize>(
    memory: &mut Memory<VERTICES, CORNERS, WORDS, PORTS>,
    flash: CutFlash,
    model: Option<CutArea>,
    work_ticks: Option<u64>,
    work: impl FnOnce(&mut Powered<'_, '_>),
) -> (CutFlash, Option<CutArea>, Vec<Stamped>) {
    let mut blocks = EMPTY_LOOKAHEAD;
    let mut ring = EventRing::<QUEUE_LENGTH>::new();
    let pins = PulserState::new();
    let mut board = HostBoard::new(&mut ring, &pins);
    board.set_flash(flash);
    board.set_model_flash(model);
    // A millisecond, which is more than a page takes typically.
    board.set_write_ticks(25_000);
    let memory = memory.lend(&mut blocks);
    board.set_work_ticks(work_ticks.unwrap_or(0));
    let plotter = start(&mut board, memory, &pins);
    let mut plotter = plotter.with_early_ink(work_ticks.is_some());
    work(&mut Powered { board: &mut board, plotter: &mut plotter });
    let changes = board.trace().changes();
    let model = board.set_model_flash(None);
    (board.take_flash().expect("the board has flash"), model, changes)
}

/// The strokes that the pins have drawn: the points of the pen while it was down, beginning at the
/// origin.
pub fn strokes_of(changes: impl IntoIterator<Item = PinChange>) -> Vec<Vec<Point>> {
    let mut machine = Machine::default();
    let mut events: Vec<MachineEventKind> = changes
        .into_iter()
        .filter_map(|change| machine.change(change))
        .map(|event| event.kind)
        .collect();
    events.extend(machine.last().map(|event| event.kind));
    let (mut at, mut is_down, mut strokes) = ((0, 0), false, Vec::<Vec<Point>>::new());
    for event in events {
        match event {
            MachineEventKind::Pen { down } => {
                is_down = down;
                if down {
                    strokes.push(vec![at]);
                }
            }
            MachineEventKind::Step { x, y } => {
                at = (at.0 + i32::from(x), at.1 + i32::from(y));
                if let Some(stroke) = strokes.last_mut().filter(|_| is_down) {
                    stroke.push(at);
                }
            }
            _ => {}
        }
    }
    strokes.retain(|stroke| stroke.len() > 1);
    strokes
}

/// The ink of strokes: each step with the pen down, whichever way it went and however often.
pub fn ink<'a>(strokes: impl IntoIterator<Item = &'a Vec<Point>>) -> BTreeSet<[Point; 2]> {
    let mut ink = BTreeSet::new();
    for stroke in strokes {
        for pair in stroke.windows(2) {
            let &[from, to] = pair else { continue };
            ink.insert([from.min(to), from.max(to)]);
        }
    }
    ink
}

/// Checks that the strokes of the runs of a job, one after the other, are those of the `whole` job:
/// each run begins with the stroke that was interrupted in the run before, or with the one behind
/// the last, and no stroke is missing. Returns how many strokes were drawn twice.
///
/// # Panics
/// Panics if they are not.
pub fn assert_one_drawing(whole: &[Vec<Point>], runs: &[Vec<Vec<Point>>]) -> usize {
    let (mut next, mut twice) = (0, 0);
    for (number, run) in runs.iter().enumerate() {
        let Some(first) = run.first() else { continue };
        let begins = |index: usize| whole.get(index).is_some_and(|s| s.starts_with(first));
        if !begins(next) {
            assert!(next > 0 && begins(next - 1), "run {number} begins elsewhere than at {next}");
            next -= 1;
            twice += 1;
        }
        for (index, stroke) in run.iter().enumerate() {
            let planned = &whole[next];
            let is_last = index + 1 == run.len();
            assert!(
                planned == stroke || (is_last && planned.starts_with(stroke)),
                "run {number}: stroke {next} is another one"
            );
            next += 1;
        }
    }
    assert_eq!(next, whole.len(), "strokes are missing");
    let drawn = ink(runs.iter().flatten());
    assert_eq!(drawn, ink(whole), "the ink differs");
    twice
}
