//! A plotter made of pins: the library's own interrupt code on pins that remember what they did.

use penup::boards::host::{Stamped, traced_steps};
use penup::drawing::PagePoint;
use penup::machine::{EventRing, Machine, MachineError, Path, PulserState, Settings};
use penup::motion::{Block, EventQueue, StepEvent};

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
    /// The sum of the steps at the pins so far, without those that take up slack.
    pub pins: PagePoint,
    /// The sum of all steps.
    pub motors: PagePoint,
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
        let Turn { machine, now, pins, motors } = turn;
        let goes_on = visit(Turn { machine: &mut *machine, now, pins, motors });
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
    let mut ring = EventRing::new();
    let (mut queue, mut steps) = traced_steps(&mut ring, &state);
    let mut blocks = [Block::EMPTY; 128];
    let mut machine = Machine::new(settings, &mut blocks, &state, 2_500_000);
    loop {
        let now = steps.trace().now();
        queue.sync_consumed();
        let (x, y) = state.steps();
        let (pins, slack) = (PagePoint { x, y }, state.slack());
        let motors = PagePoint { x: x + slack.0, y: y + slack.1 };
        let this = Turn { machine: &mut machine, now, pins, motors };
        if !turn(this, &mut queue) {
            return steps.trace().changes();
        }
        steps.pass_until(now + turn_ticks);
    }
}
