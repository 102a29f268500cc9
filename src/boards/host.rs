//! A simulated board for tests and previews. It runs the library's own interrupt code on pins that
//! record their changes, and its serial line consists of two buffers.
//!
//! Time passes only in [`Board::wait`] and [`HostBoard::pass`], and while bytes are sent at a set
//! baud rate. So a run gives the same result every time.

#[cfg(feature = "tiles")]
mod area;
mod flash;
mod trace;

#[cfg(feature = "tiles")]
pub use area::CutArea;
pub use flash::{CutFlash, PowerCut};
pub use trace::{Change, Stamped, Trace, TracedPen, TracedPin, TracedSteps, traced_steps};

use crate::index::Index;
use crate::machine::{Contacts, EventRing, PulserState, StepQueue};
use crate::model::{Corner, Position};
use crate::motion::{Block, EventQueue};
use crate::plotter::{
    Board, EMPTY_LOOKAHEAD, FlashRecords, HpGlMemory, Layout, MemorySlices, NotStored, Record,
    Replies, Stored,
};
use crate::protocol::{LineReader, RealTime, Sorter};
use crate::storage::LogProgress;
#[cfg(feature = "tiles")]
use crate::storage::area::{Area, AreaFlash};
use core::ops::Range;
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

/// The number of serial ports of this board, which has no hardware.
pub const PORTS: usize = 2;

/// The number of slots in the queue: as many steps as on the Pico fit.
pub const QUEUE_LENGTH: usize = crate::board_table::PICO.memory.steps as usize + 5;

/// Where the records lie in the flash of this board: as on the board with the largest ones.
pub const LAYOUT: Layout = Layout::from(0, 132 << 10);

/// Allocates memory for a plotter with numbers of 16 bits: as many vertices as an element can name,
/// and ten times the working memory that any board's jobs use. See [`lend_memory_of`].
pub fn lend_memory() -> MemorySlices<'static> {
    lend_memory_of(<Corner>::VERTEX_NUMBER_LIMIT, 1 << 16, 1 << 19, EMPTY_LOOKAHEAD.len())
}

/// Allocates memory for a plotter: for this many vertices, corners, words to work in and moves
/// planned ahead. It is leaked, so it lasts as long as the process.
pub fn lend_memory_of<I: Index>(
    vertices: usize,
    corners: usize,
    words: usize,
    blocks: usize,
) -> MemorySlices<'static, I> {
    MemorySlices {
        vertices: std::vec![Position::ORIGIN; vertices].leak(),
        corners: std::vec![Corner::ZERO; corners].leak(),
        blocks: std::vec![Block::EMPTY; blocks].leak(),
        words: std::vec![0; words].leak(),
        readers: Box::leak(Box::new([const { LineReader::new() }; PORTS])),
        hpgl: Box::leak(Box::new(HpGlMemory::new())),
    }
}

/// A simulated board: the library's interrupt code on pins that record their changes, and two
/// serial ports.
pub struct HostBoard<'q> {
    /// The ordinary bytes that were received, each with the number of its port.
    received: VecDeque<(usize, u8)>,
    /// Each separates the real-time bytes of one port from the ordinary ones.
    sorters: [Sorter; PORTS],
    /// The real-time requests that were not taken yet.
    requests: RealTime,
    /// The bytes that the plotter has sent and nobody has taken yet, by any port.
    sent: Vec<u8>,
    /// Whether each port has sent something.
    has_heard: [bool; PORTS],
    /// The ports to which replies go.
    replies: Replies,
    /// The main loop's end of the queue of events.
    queue: StepQueue<'q, QUEUE_LENGTH>,
    /// The interrupt code and its pins.
    steps: TracedSteps<'q>,
    /// The contacts that are closed.
    contacts: Contacts,
    /// How many times the contacts were read, and at which of these times the emergency stop was
    /// pressed besides.
    contact_reads: u64,
    stop_reads: Range<u64>,
    /// The state shared with the interrupt code.
    state: &'q PulserState,
    /// The number of ticks that sending a byte takes; 0 if no baud rate is set.
    byte_ticks: u64,
    /// The ticks during which the output has no room.
    full_during: Range<u64>,
    /// The records in flash, if the board has flash.
    kept: Option<FlashRecords<CutFlash>>,
    /// How long it takes to write to the flash while a job is drawn, in ticks.
    write_ticks: u64,
    /// What is received while the plotter computes and steps run, and when, in ticks.
    #[cfg(feature = "early-ink")]
    meanwhile: Vec<(u64, Vec<u8>)>,
    /// The ticks that pass for each millisecond of computing while steps run.
    #[cfg(feature = "early-ink")]
    work_ticks: u64,
    /// Which step pins are inverted, as a mask, and whether the enable pin is.
    inverted: (u8, bool),
    /// The flash for a model that is too large for the memory, if the board has it.
    #[cfg(feature = "tiles")]
    model_flash: Option<CutArea>,
}

impl core::fmt::Debug for HostBoard<'_> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter
            .debug_struct("HostBoard")
            .field("now", &self.trace().now())
            .finish_non_exhaustive()
    }
}

impl<'q> HostBoard<'q> {
    /// Makes a board at rest, which has received nothing.
    pub fn new(ring: &'q mut EventRing<QUEUE_LENGTH>, state: &'q PulserState) -> Self {
        let (queue, steps) = traced_steps(ring, state);
        Self {
            received: VecDeque::new(),
            sorters: [Sorter::new(); PORTS],
            requests: RealTime::default(),
            sent: Vec::new(),
            has_heard: [false; PORTS],
            replies: Replies::All,
            queue,
            steps,
            contacts: Contacts::default(),
            contact_reads: 0,
            stop_reads: 0..0,
            state,
            byte_ticks: 0,
            full_during: 0..0,
            kept: None,
            write_ticks: 0,
            #[cfg(feature = "early-ink")]
            work_ticks: 0,
            #[cfg(feature = "early-ink")]
            meanwhile: Vec::new(),
            inverted: (0, false),
            #[cfg(feature = "tiles")]
            model_flash: None,
        }
    }

    /// Gives the board flash, which it does not have otherwise. It keeps its records there, as
    /// [`LAYOUT`] says.
    pub fn set_flash(&mut self, flash: CutFlash) {
        self.kept = Some(FlashRecords::new(flash, LAYOUT));
    }

    /// The flash of the board, if it has one.
    pub fn flash(&mut self) -> Option<&mut CutFlash> {
        self.kept.as_mut().map(|kept| &mut kept.flash)
    }

    /// Takes the flash out of the board, as it is.
    pub fn take_flash(&mut self) -> Option<CutFlash> {
        self.kept.take().map(|kept| kept.flash)
    }

    /// Receives `bytes` at this time in ticks or later, while the plotter computes and steps run.
    #[cfg(feature = "early-ink")]
    pub fn receive_meanwhile(&mut self, at: u64, bytes: &[u8]) {
        self.meanwhile.push((at, bytes.to_vec()));
    }

    /// Sets the ticks that pass each time that the plotter, while it computes, sees to the steps
    /// that run: about once in a millisecond of computing.
    #[cfg(feature = "early-ink")]
    pub fn set_work_ticks(&mut self, ticks: u64) {
        self.work_ticks = ticks;
    }

    /// Gives the board flash for a model that is too large for the memory, or takes it away.
    /// Returns what it had before.
    #[cfg(feature = "tiles")]
    pub fn set_model_flash(&mut self, flash: Option<CutArea>) -> Option<CutArea> {
        core::mem::replace(&mut self.model_flash, flash)
    }

    /// Sets how long it takes, in ticks, to write to the flash while a job is drawn. Without it,
    /// writing takes no time.
    pub fn set_write_ticks(&mut self, ticks: u64) {
        self.write_ticks = ticks;
    }

    /// Receives bytes by the first serial port. [`DAMAGED`](crate::protocol::DAMAGED) among them
    /// represents bytes that were lost or damaged.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.receive_by(0, bytes);
    }

    /// Receives bytes by the serial port with this number, from 0 to [`PORTS`] - 1.
    ///
    /// # Panics
    /// When there is no such port.
    pub fn receive_by(&mut self, port: usize, bytes: &[u8]) {
        self.has_heard[port] = true;
        for byte in bytes {
            match self.sorters[port].sort(*byte) {
                Some(requests) => {
                    if requests.has(RealTime::ABORT) {
                        self.received.clear();
                        self.sorters = [Sorter::new(); PORTS];
                    }
                    self.requests = self.requests.and(requests);
                }
                None => self.received.push_back((port, *byte)),
            }
        }
    }

    /// Lets nobody read what the board sends during these ticks, in which it has no room for more.
    pub fn set_full_during(&mut self, ticks: Range<u64>) {
        self.full_during = ticks;
    }

    /// Sets the baud rate for sending. Without it, sending takes no time.
    pub fn set_baud(&mut self, baud: u32) {
        self.byte_ticks = u64::from(10 * crate::motion::TICKS_PER_SECOND / baud);
    }

    /// Sets which contacts (limit switches and emergency stop) are closed.
    pub fn set_contacts(&mut self, contacts: Contacts) {
        self.contacts = contacts;
    }

    /// Presses the emergency stop while the plotter reads the contacts for these times from now on,
    /// counted from 1.
    pub fn press_stop_during(&mut self, reads: Range<u64>) {
        (self.contact_reads, self.stop_reads) = (0, reads);
    }

    /// Which step pins are inverted, as a mask, and whether the enable pin is. The trace shows the
    /// pins as the drivers take them, as if they were not.
    pub fn inverted_pins(&self) -> (u8, bool) {
        self.inverted
    }

    /// How often the queue of steps ran empty while the machine moved.
    pub fn underruns(&self) -> u32 {
        self.state.underruns()
    }

    /// Whether all received bytes have been read, and all real-time requests have been taken.
    pub fn has_read_all(&self) -> bool {
        self.received.is_empty() && self.requests == RealTime::default()
    }

    /// The number of bytes that were received and have not been read.
    pub fn waiting(&self) -> usize {
        self.received.len()
    }

    /// Returns the bytes that were sent and removes them.
    pub fn take_sent(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.sent)
    }

    /// The recorded changes of the pins.
    pub fn trace(&self) -> &Trace {
        self.steps.trace()
    }

    /// Advances the time by `ticks`. The step interrupts that are due in this time run.
    pub fn pass(&mut self, ticks: u64) {
        self.steps.pass_until(self.trace().now() + ticks);
        self.queue.sync_consumed();
    }
}

impl Board for HostBoard<'_> {
    const NAME: &'static str = "host";

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        self.received.pop_front()
    }

    fn take_real_time(&mut self) -> RealTime {
        core::mem::take(&mut self.requests)
    }

    fn has_room(&mut self, _: usize) -> bool {
        !self.full_during.contains(&self.trace().now())
    }

    fn reply_to(&mut self, replies: Replies) {
        self.replies = replies;
    }

    fn write(&mut self, bytes: &[u8]) {
        let is_heard = match self.replies {
            Replies::All | Replies::Only(_) | Replies::OthersIfAny(_) => true,
            Replies::Others(not) => (0..PORTS).any(|port| port != not && self.has_heard[port]),
        };
        if !is_heard {
            return;
        }
        self.sent.extend_from_slice(bytes);
        self.pass(self.byte_ticks * bytes.len() as u64);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.queue.sync_consumed();
        &mut self.queue
    }

    fn contacts(&mut self) -> Contacts {
        self.contact_reads += 1;
        let stop = self.contacts.stop || self.stop_reads.contains(&self.contact_reads);
        Contacts { stop, ..self.contacts }
    }

    fn step_now(&mut self) {
        self.steps.step_now();
    }

    /// # Panics
    /// When something moves, because a sector is erased.
    fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        assert!(self.state.is_drained(), "flash is erased while something moves");
        self.kept.as_mut().map_or(Ok(()), |kept| kept.save(record, parts))
    }

    /// # Panics
    /// As [`HostBoard::save`].
    #[cfg(feature = "early-ink")]
    fn save_with_room(
        &mut self,
        record: Record,
        parts: &[&[u8]],
        room: u32,
    ) -> Result<(), NotStored> {
        assert!(self.state.is_drained(), "flash is erased while something moves");
        self.kept.as_mut().map_or(Ok(()), |kept| kept.save_with_room(record, parts, room))
    }

    /// # Panics
    /// As [`HostBoard::save`].
    #[cfg(feature = "early-ink")]
    fn erase_ahead(&mut self, bytes: u32) -> bool {
        assert!(self.state.is_drained(), "flash is erased while something moves");
        self.kept.as_mut().is_some_and(|kept| kept.erase_ahead(bytes))
    }

    /// # Panics
    /// When a step is due meanwhile, because a board that writes to its flash delays it.
    #[cfg(feature = "early-ink")]
    fn add(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        let before = self.state.steps();
        self.pass(self.write_ticks);
        assert_eq!(self.state.steps(), before, "a step is due while the flash is written");
        self.kept.as_mut().map_or(Ok(()), |kept| kept.add(record, parts))
    }

    #[cfg(feature = "early-ink")]
    fn load_added(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        if let Some(kept) = &mut self.kept {
            kept.load_added(record, take);
        }
    }

    #[cfg(feature = "early-ink")]
    fn begin_steps(&mut self) {
        // Where the power has failed, nothing moves any more.
        if self.flash().is_some_and(|flash| flash.is_cut) {
            return;
        }
        self.pass(self.work_ticks);
        let now = self.trace().now();
        let (due, later) =
            core::mem::take(&mut self.meanwhile).into_iter().partition(|&(at, _)| at <= now);
        self.meanwhile = later;
        let due: Vec<(u64, Vec<u8>)> = due;
        for (_, bytes) in due {
            self.receive(&bytes);
        }
    }

    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        if let Some(kept) = &mut self.kept {
            kept.load(record, take);
        }
    }

    fn keeps_progress(&self) -> bool {
        self.kept.is_some()
    }

    /// # Panics
    /// When something moves, because a sector is erased.
    fn begin_progress(&mut self, notes: &[u8], strokes: u32) -> Result<(), NotStored> {
        assert!(self.state.is_drained(), "flash is erased while something moves");
        self.kept.as_mut().ok_or(NotStored)?.begin_progress(notes, strokes)
    }

    /// # Panics
    /// When a step is due meanwhile, because a board that writes to its flash delays it.
    fn note_progress(&mut self, strokes: u32) -> Result<(), NotStored> {
        let before = self.state.steps();
        self.pass(self.write_ticks);
        assert_eq!(self.state.steps(), before, "a step is due while the flash is written");
        self.kept.as_mut().ok_or(NotStored)?.note_progress(strokes)
    }

    /// # Panics
    /// When a step is due meanwhile, because a board that writes to its flash delays it.
    fn note_point(&mut self, points: u32) -> Result<(), NotStored> {
        let before = self.state.steps();
        self.pass(self.write_ticks);
        assert_eq!(self.state.steps(), before, "a step is due while the flash is written");
        self.kept.as_mut().ok_or(NotStored)?.note_point(points)
    }

    fn progress(&mut self, notes: &mut [u8]) -> Option<(usize, LogProgress)> {
        self.kept.as_mut()?.progress(notes)
    }

    /// # Panics
    /// The returned writer panics if something moves.
    #[cfg(feature = "tiles")]
    fn start_steps(&mut self) {
        #[cfg(feature = "early-ink")]
        self.begin_steps();
    }

    #[cfg(feature = "tiles")]
    fn model_flash(&mut self) -> Option<(Area<'static>, &mut dyn AreaFlash)> {
        let state = self.state;
        let flash = self.model_flash.as_mut()?;
        flash.may_erase = state.is_drained();
        Some((flash.next_use(), flash))
    }

    fn invert_driver_pins(&mut self, steps: u8, enable: bool) {
        self.inverted = (steps, enable);
    }

    fn microseconds(&mut self) -> u32 {
        let ticks = u64::from(crate::motion::TICKS_PER_SECOND / 1_000_000);
        (self.trace().now() / ticks) as u32
    }

    fn wait(&mut self) {
        self.pass(u64::from(crate::motion::TICKS_PER_SECOND / 1000));
    }
}
