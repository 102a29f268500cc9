//! Runs the library's own interrupt code on simulated pins that record their changes.

use penup::board_table::LM3S6965;
use penup::boards::host::{Stamped, traced_steps};
use penup::drawing::PagePoint;
use penup::machine::{EventRing, Machine, MachineError, Path, PulserState, Settings};
use penup::motion::{Block, EventQueue, StepEvent};

/// An event queue that never fills and records everything.
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

/// Records all events of one job, which starts at the page's origin, without pins.
///
/// # Errors
/// The machine refuses the job.
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

/// The time of each move of `events` in ticks, and the point that it leads to, relative to the
/// origin.
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

/// The duration of all events, in ticks.
pub fn duration(events: &[StepEvent]) -> u64 {
    events.iter().map(|event| u64::from(event.ticks())).sum()
}

/// What [`run`] passes to its visitor at each iteration of the main loop.
pub struct Turn<'a, 'm> {
    /// The machine, to which the visitor may give commands.
    pub machine: &'a mut Machine<'m>,
    /// The time since the start in ticks.
    pub now: u64,
    /// The sum of the steps at the pins so far, without those that take up backlash.
    pub pins: PagePoint,
    /// The sum of all steps so far.
    pub motors: PagePoint,
}

/// Runs a job through the interrupt code, with a main loop iteration every `turn_ticks` and
/// interrupts when they are due. `visit` is called before each iteration and may give commands; the
/// run ends when it returns `false`.
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

/// Does the same as [`run`], but lets the visitor fill the queue itself.
pub fn run_with(
    settings: Settings,
    turn_ticks: u64,
    turn: &mut dyn FnMut(Turn<'_, '_>, &mut dyn EventQueue) -> bool,
) -> Vec<Stamped> {
    let state = PulserState::new();
    let mut ring = EventRing::new();
    let (mut queue, mut steps) = traced_steps(&mut ring, &state);
    // Speeds are those that the smallest board's queue holds.
    state.set_queue(LM3S6965.memory.steps);
    let mut blocks = [Block::EMPTY; 128];
    let mut machine = Machine::new(settings, &mut blocks, &state, 2_500_000);
    loop {
        let now = steps.trace().now();
        queue.sync_consumed();
        let (x, y) = state.steps();
        let (pins, backlash) = (PagePoint { x, y }, state.backlash());
        let motors = PagePoint { x: x + backlash.0, y: y + backlash.1 };
        let this = Turn { machine: &mut machine, now, pins, motors };
        if !turn(this, &mut queue) {
            return steps.trace().changes();
        }
        steps.pass_until(now + turn_ticks);
    }
}
