//! Records in flash that another version wrote, or that no version wrote.

mod interrupted;
mod kept_job;

pub use interrupted::interrupted_jobs;
pub use kept_job::KeptJob;

use crate::cut_jobs::{Powered, empty_flash, switch_on};
use crate::whole_jobs::job_lines;
use penup::boards::host::{CutFlash, HostBoard, LAYOUT, PORTS, QUEUE_LENGTH};
use penup::machine::{Contacts, EventRing, PulserState, Settings, Value};
use penup::motion::EventQueue;
use penup::plotter::{Board, EMPTY_LOOKAHEAD, FlashRecords, Memory, Plotter, Record, Stored};
use penup::protocol::RealTime;
use penup::storage::NOTE_BYTES;
use std::sync::OnceLock;

/// The size of a stored setting: two bytes for its number, four for its value.
const SETTING_BYTES: usize = 6;

/// Starts a plotter with settings and a job from the input, and draws the job. The first byte is
/// the number of settings; they follow, and the rest is the job.
///
/// Then starts a plotter whose flash holds that job and how far it has come, and one whose flash
/// holds a sound job that has stopped, but for some bytes, and goes on with each. If the settings
/// can be the progress of a [`KeptJob`] instead, goes on with that job, too.
pub fn fuzz(input: &[u8]) {
    again(input);
    resume_job(input);
    resume_image(input);
    if let Some(kept) = KeptJob::from_input(input) {
        kept.switch_on(try_to_go_on);
    }
}

/// A flash that holds a job, which was cut after some strokes.
fn stopped_job() -> &'static CutFlash {
    static FLASH: OnceLock<CutFlash> = OnceLock::new();
    FLASH.get_or_init(|| {
        let lines = job_lines("cube.obj", &["$212=20", "$213=20", "$page=20x20", "$margin=4"]);
        let (flash, _) = switch_on(empty_flash(), |plotter| {
            plotter.order(&lines);
            plotter.run(3000);
        });
        flash
    })
}

/// Divides the input into settings and a job.
fn divide(input: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = input.split_first()?;
    Some(rest.split_at(rest.len().min(usize::from(*count) * SETTING_BYTES)))
}

/// Goes on with a job from the input. The first bytes of the settings say how many of how many
/// strokes are said to be drawn, and what is wrong in the notes.
fn resume_job(input: &[u8]) {
    let Some((settings, job)) = divide(input) else { return };
    let [drawn, strokes, flags] = match *settings {
        [drawn, strokes, flags, ..] => [drawn, strokes, flags],
        _ => [1, 3, 0],
    };
    let mut sound = stopped_job().clone();
    let mut notes = [0; NOTE_BYTES];
    let Some((slot, sum)) = LAYOUT.job.identify(&mut sound) else { return };
    let Some((length, _)) = LAYOUT.logs[slot].read(&mut sound, sum, &mut notes) else { return };
    // The number of strokes may be another one, and a byte of the notes, too.
    notes[8] = strokes;
    if flags & 1 != 0 {
        notes[usize::from(flags) % length] ^= drawn;
    }
    let mut records = FlashRecords::new(empty_flash(), LAYOUT);
    if records.save(Record::Job, &[job]).is_err() {
        return;
    }
    if records.begin_progress(&notes[..length], u32::from(strokes)).is_ok() {
        // It may be more than there are.
        let _ = records.note_progress(u32::from(drawn));
    }
    go_on(records.flash);
}

/// Goes on with a sound job in a flash in which some bytes differ: four of the input say where, and
/// one says what.
fn resume_image(input: &[u8]) {
    let mut flash = CutFlash { is_damaged: true, ..stopped_job().clone() };
    for patch in input.chunks_exact(5).take(64) {
        let [a, b, c, d, value] = <[u8; 5]>::try_from(patch).expect("its length");
        let at = u32::from_le_bytes([a, b, c, d]) as usize % flash.bytes.len();
        flash.bytes[at] = value;
    }
    go_on(flash);
}

/// Starts a plotter with this flash, and goes on with the job that it holds.
fn go_on(flash: CutFlash) {
    switch_on(flash, try_to_go_on);
}

/// Goes on with the job that the plotter holds, and gives it up.
fn try_to_go_on(plotter: &mut Powered<'_, '_>) {
    plotter.send("$5=0\n$X\n$resume\n$resume=origin\n?");
    plotter.run(2000);
    plotter.board.receive(&[0x18]);
    assert!(plotter.run(20_000) < 20_000, "the machine does not stop");
}

/// Draws a job from the input again.
fn again(input: &[u8]) {
    let Some((settings, job)) = divide(input) else { return };
    let values = settings.chunks_exact(SETTING_BYTES).map(|entry| {
        let [a, b, c, d, e, f] = <[u8; SETTING_BYTES]>::try_from(entry).expect("its length");
        (u16::from_le_bytes([a, b]), Value::from_bits(i32::from_le_bytes([c, d, e, f])))
    });

    let mut memory = Box::new(Memory::<64, 256, 8192, PORTS>::new());
    let mut blocks = EMPTY_LOOKAHEAD;
    let mut ring = EventRing::<QUEUE_LENGTH>::new();
    let pins = PulserState::new();
    let mut board = Flash { board: HostBoard::new(&mut ring, &pins), job };
    let memory = memory.lend(&mut blocks);
    let mut plotter = Plotter::with_settings(memory, &pins, Settings::restored(values));
    plotter.greet(&mut board);
    // Whatever the contacts are said to be, the stop is not pressed.
    board.board.receive(b"$5=0\n$X\n$again\n?");
    for _ in 0..20_000 {
        plotter.poll(&mut board);
        board.wait();
    }
    board.board.receive(&[0x18]);
    for _ in 0..20_000 {
        plotter.poll(&mut board);
        board.wait();
        if plotter.machine().is_stopped() && board.board.has_read_all() {
            return;
        }
    }
    panic!("the machine does not stop");
}

/// A board whose flash holds a job.
struct Flash<'q, 'j> {
    board: HostBoard<'q>,
    job: &'j [u8],
}

impl Board for Flash<'_, '_> {
    const NAME: &'static str = "host";

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        self.board.read_byte()
    }

    fn take_real_time(&mut self) -> RealTime {
        self.board.take_real_time()
    }

    fn write(&mut self, bytes: &[u8]) {
        self.board.write(bytes);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.board.queue()
    }

    fn contacts(&mut self) -> Contacts {
        self.board.contacts()
    }

    fn step_now(&mut self) {
        self.board.step_now();
    }

    fn invert_driver_pins(&mut self, steps: u8, enable: bool) {
        self.board.invert_driver_pins(steps, enable);
    }

    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        if record == Record::Job {
            take(&mut Bytes(self.job));
        }
    }

    fn microseconds(&mut self) -> u32 {
        self.board.microseconds()
    }

    fn wait(&mut self) {
        self.board.wait();
    }
}

/// The bytes of a record that were not read yet.
struct Bytes<'b>(&'b [u8]);

impl Stored for Bytes<'_> {
    fn read(&mut self, into: &mut [u8]) -> usize {
        let count = into.len().min(self.0.len());
        let (read, left) = self.0.split_at(count);
        into[..count].copy_from_slice(read);
        self.0 = left;
        count
    }
}
