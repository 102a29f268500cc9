//! Records in flash that another version wrote, or that no version wrote.

use penup::boards::host::{HostBoard, PORTS, QUEUE_LENGTH};
use penup::hpgl::Session;
use penup::machine::{Contacts, EventRing, PulserState, Settings, Value};
use penup::model::{Corner, Position};
use penup::motion::EventQueue;
use penup::plotter::{Board, EMPTY_LOOKAHEAD, MemorySlices, Plotter, Record, Stored};
use penup::protocol::{LineReader, RealTime};

/// The size of a stored setting: two bytes for its number, four for its value.
const SETTING_BYTES: usize = 6;

/// Starts a plotter with settings and a job from the input, and draws the job. The first byte is
/// the number of settings; they follow, and the rest is the job.
pub fn fuzz(input: &[u8]) {
    let Some((count, rest)) = input.split_first() else { return };
    let (settings, job) = rest.split_at(rest.len().min(usize::from(*count) * SETTING_BYTES));
    let values = settings.chunks_exact(SETTING_BYTES).map(|entry| {
        let [a, b, c, d, e, f] = <[u8; SETTING_BYTES]>::try_from(entry).expect("its length");
        (u16::from_le_bytes([a, b]), Value::from_bits(i32::from_le_bytes([c, d, e, f])))
    });

    let mut vertices = [Position::ORIGIN; 64];
    let mut corners = [<Corner>::ZERO; 256];
    let mut blocks = EMPTY_LOOKAHEAD;
    let mut words = vec![0; 8192];
    let mut hpgl = Session::new();
    let mut readers = [const { LineReader::new() }; PORTS];
    let mut ring = EventRing::<QUEUE_LENGTH>::new();
    let pins = PulserState::new();
    let mut board = Flash { board: HostBoard::new(&mut ring, &pins), job };
    let memory = MemorySlices {
        vertices: &mut vertices,
        corners: &mut corners,
        blocks: &mut blocks,
        words: &mut words,
        readers: &mut readers,
        hpgl: &mut hpgl,
    };
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
