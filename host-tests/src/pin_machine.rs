//! A plotter made of pins: the library's own interrupt code on pins that remember what they did.

use embedded_hal::digital::{ErrorType, OutputPin};
use heapless::spsc::Queue;
use penup::drawing::PagePoint;
use penup::machine::{Machine, MachineError, Path, Pen, Pins, Pulser, PulserState, Settings};
use penup::motion::{Block, EventQueue, StepEvent};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::rc::Rc;

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
    /// Height of the pen.
    Pen(u8),
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
    /// All changes so far.
    pub fn changes(&self) -> Vec<Stamped> {
        self.changes.borrow().clone()
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

type TracedPulser<'q> =
    Pulser<'q, TracedPin, TracedPin, TracedPin, TracedPin, TracedPin, TracedPen>;

/// A queue that never fills and remembers everything.
#[derive(Debug, Default)]
pub struct Recorder(pub Vec<StepEvent>);

impl EventQueue for Recorder {
    fn room(&self) -> usize {
        usize::MAX
    }
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.0.push(event);
        Ok(())
    }
}

/// All events of one job from the page's origin, without pins.
///
/// # Errors
/// What the machine refuses.
pub fn record(
    settings: Settings,
    path: &mut dyn Path,
    blocks: usize,
) -> Result<Vec<StepEvent>, MachineError> {
    let pins = PulserState::new();
    let mut blocks = vec![Block::EMPTY; blocks];
    let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
    let mut recorder = Recorder::default();
    machine.start(path)?;
    machine.fill(path, &mut recorder);
    Ok(recorder.0)
}

/// The time of each move of `events` in ticks, and where it leads from the origin.
pub fn moves(events: &[StepEvent]) -> Vec<(u64, PagePoint)> {
    let mut at = PagePoint::default();
    let mut time = 0;
    let mut moves = Vec::new();
    for event in events {
        let (dx, dy) = event.step();
        if (dx, dy) != (0, 0) {
            at = PagePoint { x: at.x + dx, y: at.y + dy };
            moves.push((time, at));
        }
        time += u64::from(event.ticks());
    }
    moves
}

/// How long all events take, in ticks.
pub fn duration(events: &[StepEvent]) -> u64 {
    events.iter().map(|event| u64::from(event.ticks())).sum()
}

/// What [`run`] gives its visitor at each turn of the main loop.
pub struct Turn<'a, 'm> {
    /// To give orders to.
    pub machine: &'a mut Machine<'m>,
    /// Ticks since the start.
    pub now: u64,
    /// The sum of the steps at the pins so far.
    pub pins: PagePoint,
}

/// Runs a job through the interrupt's code: a main loop turn every `turn_ticks`, interrupts when
/// they are due. `visit` is called before each turn and may give orders; the run ends when it
/// returns `false`.
pub fn run(
    settings: Settings,
    path: &mut dyn Path,
    turn_ticks: u64,
    visit: &mut dyn FnMut(Turn<'_, '_>) -> bool,
) -> Vec<Stamped> {
    run_with(settings, turn_ticks, &mut |turn, queue| {
        let Turn { machine, now, pins } = turn;
        let goes_on = visit(Turn { machine: &mut *machine, now, pins });
        machine.fill(path, queue);
        goes_on
    })
}

/// The same, but each turn fills the queue itself.
pub fn run_with(
    settings: Settings,
    turn_ticks: u64,
    turn: &mut dyn FnMut(Turn<'_, '_>, &mut dyn EventQueue) -> bool,
) -> Vec<Stamped> {
    let state = PulserState::new();
    let mut queue: Queue<StepEvent, 256> = Queue::new();
    let (mut producer, consumer) = queue.split();
    let trace = Rc::new(Trace::default());
    let pin = |change| TracedPin { trace: Rc::clone(&trace), level: None, change };
    let pins = Pins {
        step_x: pin(Change::StepX),
        direction_x: pin(Change::UpX),
        step_y: pin(Change::StepY),
        direction_y: pin(Change::UpY),
        enable: pin(Change::Enable),
    };
    let pen = TracedPen { trace: Rc::clone(&trace), height: None };
    let mut pulser: TracedPulser<'_> = Pulser::new(pins, pen, consumer, &state);
    let mut blocks = [Block::EMPTY; 128];
    let mut machine = Machine::new(settings, &mut blocks, &state, 2_500_000);
    let mut interrupt: Option<u64> = None;
    loop {
        let now = trace.now();
        let (x, y) = state.steps();
        let this = Turn { machine: &mut machine, now, pins: PagePoint { x, y } };
        if !turn(this, &mut producer) {
            return trace.changes();
        }
        let next_turn = now + turn_ticks;
        let mut due = interrupt.unwrap_or(now);
        interrupt = loop {
            if due >= next_turn {
                break Some(due);
            }
            trace.now.set(due);
            match pulser.tick() {
                Some(ticks) => due += u64::from(ticks),
                None => break None,
            }
        };
        trace.now.set(next_turn);
    }
}
