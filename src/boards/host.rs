//! A board of plain memory, for tests and preview: the library's own interrupt code on pins that
//! remember what they did, and a serial line that is two buffers.
//!
//! Time passes only in [`Board::wait`] and [`HostBoard::pass`], so a run is the same every time.

use crate::machine::{Contacts, Pen, Pins, Pulser, PulserState, StepQueue};
use crate::model::{Corner, Position};
use crate::motion::{EventQueue, StepEvent};
use crate::plotter::{Board, Lent, NO_MOVES};
use crate::protocol::{RealTime, Sorter};
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, OutputPin};
use heapless::spsc::Queue;
use std::boxed::Box;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

/// As many events as the smallest board's queue holds.
pub const QUEUE_LENGTH: usize = 624;

/// Memory for a plotter on a computer: as many vertices as an element can name, and as much to work
/// in as any board's jobs ten times over. It is lent for as long as the process lives.
pub fn lend_memory() -> Lent<'static> {
    const VERTICES: usize = crate::model::VERTEX_NUMBER_LIMIT;
    const CORNERS: usize = 1 << 16;
    const WORDS: usize = 1 << 19;
    Lent {
        vertices: Box::leak(Box::new(heapless::Vec::<Position, VERTICES>::new())),
        corners: Box::leak(Box::new(heapless::Vec::<Corner, CORNERS>::new())),
        blocks: Box::leak(Box::new(NO_MOVES)),
        words: std::vec![0; WORDS].leak(),
    }
}

/// What a pin did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Step pin of x.
    StepX(bool),
    /// Step pin of y.
    StepY(bool),
    /// Direction pin of x; high counts up.
    UpX(bool),
    /// Direction pin of y; high counts up.
    UpY(bool),
    /// Enable pin of the drivers.
    Enable(bool),
    /// Height of the pen, 0 raised to 127 lowered.
    Pen(u8),
    /// Step pin of the pen's motor.
    StepZ(bool),
    /// Its direction pin; high lowers the pen.
    DownZ(bool),
}

/// A change and its time in ticks from the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamped {
    /// Ticks from the start.
    pub time: u64,
    /// What changed.
    pub change: Change,
}

/// What all pins did, in order. Writes that change nothing leave no trace.
#[derive(Debug, Default)]
pub struct Trace {
    now: Cell<u64>,
    changes: RefCell<Vec<Stamped>>,
}

impl Trace {
    fn note(&self, change: Change) {
        self.changes.borrow_mut().push(Stamped { time: self.now.get(), change });
    }

    /// Ticks from the start.
    pub fn now(&self) -> u64 {
        self.now.get()
    }

    /// Sets the clock.
    pub fn set_now(&self, now: u64) {
        self.now.set(now);
    }

    /// All changes so far.
    pub fn changes(&self) -> Vec<Stamped> {
        self.changes.borrow().clone()
    }

    /// The changes so far, which are forgotten here.
    pub fn take_changes(&self) -> Vec<Stamped> {
        self.changes.take()
    }
}

/// A pin that notes its changes.
#[derive(Debug)]
pub struct TracedPin {
    trace: Rc<Trace>,
    level: Option<bool>,
    change: fn(bool) -> Change,
}

impl ErrorType for TracedPin {
    type Error = Infallible;
}

impl TracedPin {
    fn set(&mut self, level: bool) {
        if self.level.replace(level) != Some(level) {
            self.trace.note((self.change)(level));
        }
    }
}

impl OutputPin for TracedPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

/// A pen that notes its heights.
#[derive(Debug)]
pub struct TracedPen {
    trace: Rc<Trace>,
    height: Option<u8>,
}

impl Pen for TracedPen {
    fn set_height(&mut self, height: u8) {
        if self.height.replace(height) != Some(height) {
            self.trace.note(Change::Pen(height));
        }
    }
}

/// The library's interrupt code on traced pins.
pub type TracedPulser<'q> = Pulser<
    'q,
    Pins<TracedPin, TracedPin, TracedPin, TracedPin, TracedPin, TracedPin, TracedPin>,
    TracedPen,
>;

/// A pulser whose pins note their changes in the trace, and the queue's other end.
pub fn traced_pulser<'q, const N: usize>(
    queue: &'q mut Queue<StepEvent, N>,
    state: &'q PulserState,
) -> (StepQueue<'q>, TracedPulser<'q>, Rc<Trace>) {
    let trace = Rc::new(Trace::default());
    let pin = |change| TracedPin { trace: Rc::clone(&trace), level: None, change };
    let pins = Pins {
        step_x: pin(Change::StepX),
        direction_x: pin(Change::UpX),
        step_y: pin(Change::StepY),
        direction_y: pin(Change::UpY),
        enable: pin(Change::Enable),
        step_z: pin(Change::StepZ),
        direction_z: pin(Change::DownZ),
    };
    let pen = TracedPen { trace: Rc::clone(&trace), height: None };
    let (pulser, producer) = Pulser::new(pins, pen, queue, state);
    (producer, pulser, trace)
}

/// The board.
pub struct HostBoard<'q> {
    received: VecDeque<u8>,
    sorter: Sorter,
    asked: RealTime,
    sent: Vec<u8>,
    producer: StepQueue<'q>,
    pulser: TracedPulser<'q>,
    trace: Rc<Trace>,
    /// When the step interrupt is due, in ticks from the start.
    due: Option<u64>,
    contacts: Contacts,
    state: &'q PulserState,
    /// Ticks that sending a byte takes.
    byte_ticks: u64,
}

impl core::fmt::Debug for HostBoard<'_> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("HostBoard").field("now", &self.trace.now()).finish_non_exhaustive()
    }
}

impl<'q> HostBoard<'q> {
    /// A board at rest.
    pub fn new(queue: &'q mut Queue<StepEvent, QUEUE_LENGTH>, state: &'q PulserState) -> Self {
        let (producer, pulser, trace) = traced_pulser(queue, state);
        Self {
            received: VecDeque::new(),
            sorter: Sorter::new(),
            asked: RealTime::default(),
            sent: Vec::new(),
            producer,
            pulser,
            trace,
            due: None,
            contacts: Contacts::default(),
            state,
            byte_ticks: 0,
        }
    }

    /// Bytes come over the line.
    pub fn receive(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match self.sorter.sort(*byte) {
                Some(asked) => {
                    if asked.has(RealTime::ABORT) {
                        self.received.clear();
                    }
                    self.asked = self.asked.and(asked);
                }
                None => self.received.push_back(*byte),
            }
        }
    }

    /// Sends at this speed from now on; at first bytes take no time.
    pub fn set_baud(&mut self, baud: u32) {
        self.byte_ticks = u64::from(10 * crate::motion::TICKS_PER_SECOND / baud);
    }

    /// Closes and opens contacts.
    pub fn set_contacts(&mut self, contacts: Contacts) {
        self.contacts = contacts;
    }

    /// How often the queue of steps ran dry while the machine moved.
    pub fn underruns(&self) -> u32 {
        self.state.underruns()
    }

    /// Whether all bytes received have been read, and real-time ones acted on.
    pub fn has_read_all(&self) -> bool {
        self.received.is_empty() && self.asked == RealTime::default()
    }

    /// What was sent back; it is forgotten here.
    pub fn take_sent(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.sent)
    }

    /// What the pins did.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Lets `ticks` pass: the step interrupts that are due in them run.
    pub fn pass(&mut self, ticks: u64) {
        let end = self.trace.now() + ticks;
        let mut due = self.due.unwrap_or(self.trace.now());
        self.due = loop {
            if due >= end {
                break Some(due);
            }
            self.trace.set_now(due);
            match self.pulser.tick() {
                Some(ticks) => due += u64::from(ticks),
                None => break None,
            }
        };
        self.trace.set_now(end);
    }
}

impl Board for HostBoard<'_> {
    const NAME: &'static str = "host";

    fn read_byte(&mut self) -> Option<u8> {
        self.received.pop_front()
    }

    fn take_real_time(&mut self) -> RealTime {
        core::mem::take(&mut self.asked)
    }

    fn write(&mut self, bytes: &[u8]) {
        self.sent.extend_from_slice(bytes);
        self.pass(self.byte_ticks * bytes.len() as u64);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        &mut self.producer
    }

    fn contacts(&mut self) -> Contacts {
        self.contacts
    }

    fn step_now(&mut self) {
        if !self.pulser.pulse_is_high() {
            self.due = Some(self.trace.now());
        }
    }

    fn wait(&mut self) {
        self.pass(u64::from(crate::motion::TICKS_PER_SECOND / 1000));
    }
}
