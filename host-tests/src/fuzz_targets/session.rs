//! A plotter that receives any bytes at any time, and whose power may fail.

mod seeds;

pub use seeds::sessions;

use crate::cut_jobs::empty_flash;
use penup::boards::host::{CutArea, CutFlash, HostBoard, PORTS, QUEUE_LENGTH};
use penup::machine::{Contacts, EventRing, PulserState, Settings};
use penup::plotter::{Board, EMPTY_LOOKAHEAD, Memory, MemorySlices, Plotter, start};
use std::cell::Cell;

/// In the input, this byte begins an order to the bench; any other byte is sent to the plotter.
///
/// - followed by 0: this byte itself is sent;
/// - followed by 1 to 0xDF: that many milliseconds pass;
/// - followed by 0xE0 to 0xE7: the lower bits say which contacts are closed;
/// - followed by 0xE8: the power fails, and comes back;
/// - followed by 0xE9 to 0xEF: so it does once some bytes of flash were erased or written from now
///   on: as many as [`BUDGETS`] says;
/// - followed by 0xF1, 0xF2 or 0xF3, as the first bytes of the input: the board has flash; see
///   [`Kind`];
/// - followed by 0xFF: the bytes behind it arrive at the other port.
const ORDER: u8 = 0xFF;

/// The numbers of bytes after which the power fails: within a page, behind one, within a sector,
/// behind one, and later.
const BUDGETS: [usize; 7] = [10, 256, 300, 4096, 4200, 9000, 40_000];

/// How often the power may fail. Later orders to fail have no effect, because a start takes long.
const OUTAGES: usize = 8;

/// The size of the flash for a model, in bytes.
const MODEL_BYTES: usize = 16 << 10;

/// How many ticks pass in a millisecond of computing, where time passes then.
const WORK_TICKS: u64 = 25_000;

/// How many ticks it takes to write to the flash while a job is drawn.
const WRITE_TICKS: u64 = 25_000;

/// The byte that aborts a job and clears the queues.
const CTRL_X: u8 = 0x18;

/// How long a line may keep the main loop busy, in turns of the loop. It is more than the longest
/// job of the corpus needs.
const TURNS: u32 = 2_000_000;

/// The boards on which a session may run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A board without flash.
    WithoutFlash,
    /// A board that keeps settings, jobs and their progress in flash.
    WithFlash,
    /// The same, and the pen begins while the order of the strokes is computed.
    EarlyInk,
    /// The same with little memory, and with flash for the models that do not fit.
    LittleMemory,
}

/// Lets a small plotter receive the input, and checks at its end that the machine comes to rest,
/// that it can be unlocked, and that it answers. If the plotter has flash, it is then switched off
/// and on again, has the same settings, and answers.
pub fn fuzz(input: &[u8]) {
    output(input);
}

/// Does the same, and returns what the plotter has sent up to the end of the input.
pub fn output(input: &[u8]) -> String {
    begun_by(&[], input)
}

/// Does the same with a plotter that first receives `beginning`.
pub(super) fn begun_by(beginning: &[u8], input: &[u8]) -> String {
    let (kind, rest) = match input {
        [ORDER, 0xF1, rest @ ..] => (Kind::WithFlash, rest),
        [ORDER, 0xF2, rest @ ..] => (Kind::EarlyInk, rest),
        [ORDER, 0xF3, rest @ ..] => (Kind::LittleMemory, rest),
        _ => (Kind::WithoutFlash, input),
    };
    if kind == Kind::LittleMemory {
        session::<20, 60, 4000>(kind, beginning, rest)
    } else {
        session::<256, 1024, 8192>(kind, beginning, rest)
    }
}

/// Runs a session on a board with this memory. Returns what was sent up to the end of the input.
fn session<const VERTICES: usize, const CORNERS: usize, const WORDS: usize>(
    kind: Kind,
    beginning: &[u8],
    input: &[u8],
) -> String {
    let mut bench = Bench {
        kind,
        flash: (kind != Kind::WithoutFlash).then(empty_flash),
        model: (kind == Kind::LittleMemory).then(erased_model_flash),
        outages: 0,
        sent: Vec::new(),
    };
    let script: Vec<u8> = beginning.iter().chain(input).copied().collect();
    let mut script = script.into_iter();
    let memory = || Box::new(Memory::<VERTICES, CORNERS, WORDS, PORTS>::new());
    let settings = loop {
        let mut blocks = EMPTY_LOOKAHEAD;
        let ended = bench.switch_on(memory().lend(&mut blocks), |powered| {
            powered.obey(&mut script).then(|| powered.end())
        });
        if let Some(settings) = ended {
            break settings;
        }
        bench.outages += 1;
    };
    let length = bench.sent.len();
    if kind != Kind::WithoutFlash {
        let mut blocks = EMPTY_LOOKAHEAD;
        bench.switch_on(memory().lend(&mut blocks), |powered| {
            assert_eq!(*powered.plotter.machine().settings(), settings, "settings were lost");
            powered.end();
        });
    }
    if bench.model.is_some() {
        MODEL_FLASH.set(bench.model);
    }
    bench.sent.truncate(length);
    String::from_utf8_lossy(&bench.sent).replace("\r\n", "\n")
}

thread_local! {
    /// One flash for models serves for all inputs, because its memory is never freed.
    static MODEL_FLASH: Cell<Option<CutArea>> = const { Cell::new(None) };
}

/// Takes the flash for models of this thread, erased.
fn erased_model_flash() -> CutArea {
    let mut flash = MODEL_FLASH.take().unwrap_or_else(|| CutArea::new(MODEL_BYTES));
    for (at, byte) in flash.bytes().into_iter().enumerate() {
        if byte != 0xFF {
            flash.set_byte(at, 0xFF);
        }
    }
    flash.budget = usize::MAX;
    flash
}

/// What stays when the power fails.
struct Bench {
    kind: Kind,
    flash: Option<CutFlash>,
    model: Option<CutArea>,
    /// How often the power has failed.
    outages: usize,
    /// What was sent until then, or up to the end of the input.
    sent: Vec<u8>,
}

impl Bench {
    /// Switches a board on, lets `work` use it, and switches it off.
    fn switch_on<T>(
        &mut self,
        memory: MemorySlices<'_>,
        work: impl FnOnce(&mut Powered<'_, '_>) -> T,
    ) -> T {
        let mut ring = EventRing::<QUEUE_LENGTH>::new();
        let pins = PulserState::new();
        let mut board = HostBoard::new(&mut ring, &pins);
        if let Some(flash) = self.flash.take() {
            board.set_flash(flash.powered());
            board.set_write_ticks(WRITE_TICKS);
        }
        if let Some(flash) = &mut self.model {
            flash.budget = usize::MAX;
        }
        board.set_model_flash(self.model.take());
        let has_early_ink = matches!(self.kind, Kind::EarlyInk | Kind::LittleMemory);
        board.set_work_ticks(if has_early_ink { WORK_TICKS } else { 0 });
        let mut plotter = start(&mut board, memory, &pins).with_early_ink(has_early_ink);
        let may_fail = self.outages < OUTAGES;
        let sent = &mut self.sent;
        let done = work(&mut Powered { board: &mut board, plotter: &mut plotter, may_fail, sent });
        self.flash = board.take_flash();
        self.model = board.set_model_flash(None);
        done
    }
}

/// A plotter that is switched on.
struct Powered<'s, 'm> {
    board: &'s mut HostBoard<'m>,
    plotter: &'s mut Plotter<'m>,
    /// Whether the power may fail.
    may_fail: bool,
    /// What was sent up to the end of the input.
    sent: &'s mut Vec<u8>,
}

impl Powered<'_, '_> {
    /// Does what the script says to its end, or until the power fails. Returns whether it has come
    /// to its end.
    fn obey(&mut self, script: &mut impl Iterator<Item = u8>) -> bool {
        let mut port = 0;
        while let Some(byte) = script.next() {
            self.sent.append(&mut self.board.take_sent());
            match (byte, if byte == ORDER { script.next() } else { None }) {
                (ORDER, None) => break,
                (ORDER, Some(milliseconds @ 1..=0xDF)) => {
                    for _ in 0..milliseconds {
                        self.plotter.poll(self.board);
                        if self.is_cut() {
                            return false;
                        }
                        self.board.wait();
                    }
                }
                (ORDER, Some(bits @ 0xE0..=0xE7)) => self.board.set_contacts(contacts(bits)),
                (ORDER, Some(0xE8)) if self.may_fail => return false,
                (ORDER, Some(number @ 0xE9..=0xEF)) if self.may_fail => {
                    self.set_budget(BUDGETS[usize::from(number - 0xE9)]);
                }
                (ORDER, Some(0xE8..=0xFE)) => {}
                (ORDER, Some(0xFF)) => port = 1 - port,
                (byte, _) => {
                    self.board.receive_by(port, &[byte]);
                    if byte == b'\n' {
                        self.plotter.poll(self.board);
                        if self.is_cut() {
                            return false;
                        }
                    }
                }
            }
        }
        true
    }

    /// Lets the power fail once so many bytes of flash were erased or written.
    fn set_budget(&mut self, bytes: usize) {
        if let Some(flash) = self.board.flash() {
            flash.budget = bytes;
        }
        let mut model = self.board.set_model_flash(None);
        if let Some(flash) = &mut model {
            flash.budget = bytes;
        }
        self.board.set_model_flash(model);
    }

    /// Whether the power has failed while flash was written.
    fn is_cut(&mut self) -> bool {
        let model = self.board.set_model_flash(None);
        let is_model_cut = model.as_ref().is_some_and(|flash| flash.budget == 0);
        self.board.set_model_flash(model);
        is_model_cut || self.board.flash().is_some_and(|flash| flash.is_cut)
    }

    /// Lets the plotter read all that came, then ends the job, whatever it is, leaves the alarm,
    /// and asks for the status. Returns the settings.
    fn end(&mut self) -> Settings {
        self.set_budget(usize::MAX);
        self.run("reads all lines", |_, board| board.has_read_all());
        self.sent.append(&mut self.board.take_sent());
        self.board.set_contacts(Contacts::default());
        self.board.receive(b"\n$5=0\n");
        self.board.receive(&[CTRL_X]);
        self.run("comes to rest", |plotter, board| {
            board.has_read_all() && plotter.machine().is_stopped()
        });
        self.board.take_sent();
        self.board.receive(b"\n?");
        self.run("reads the query", |_, board| board.has_read_all());
        for _ in 0..3 {
            self.plotter.poll(self.board);
        }
        let answer = self.board.take_sent();
        assert!(answer.contains(&b'<'), "no status: {}", String::from_utf8_lossy(&answer));
        *self.plotter.machine().settings()
    }

    /// Runs the plotter until `is_done`.
    fn run(&mut self, what: &str, is_done: impl Fn(&Plotter<'_>, &HostBoard<'_>) -> bool) {
        for turn in 0..TURNS {
            let is_busy = self.plotter.poll(self.board);
            if is_done(self.plotter, self.board) {
                return;
            }
            // A job that only draws takes long: give it up, as a user would.
            if turn == TURNS / 2 {
                self.board.receive(&[CTRL_X]);
            }
            if !is_busy {
                self.board.wait();
            }
        }
        panic!("the plotter never {what}");
    }
}

/// The contacts that are closed, by the lower bits.
fn contacts(bits: u8) -> Contacts {
    Contacts { x: bits & 1 != 0, y: bits & 2 != 0, stop: bits & 4 != 0 }
}
