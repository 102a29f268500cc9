//! Plans the speed along a path and counts the step events: `cargo run --example plan_path`.

use penup::drawing::{LineType, PagePoint};
use penup::machine::{Machine, Path, PulserState, Settings, Target};
use penup::motion::{Block, EventQueue, StepEvent, TICKS_PER_SECOND};

/// A zigzag, drawn with the pen down. The first target is reached with the pen up.
struct Zigzag(i32);

impl Path for Zigzag {
    fn next_target(&mut self) -> Option<Target> {
        let point = PagePoint { x: 800 + 400 * self.0, y: 800 + self.0 % 2 * 1600 };
        let ink = (self.0 > 0).then_some(LineType::Full);
        self.0 += 1;
        (self.0 <= 20).then_some(Target { point, ink })
    }
    fn rewind(&mut self) {
        self.0 = 0;
    }
}

/// A queue that is never full. On a board, the step interrupt takes the events out again.
#[derive(Default)]
struct Events(Vec<StepEvent>);

impl EventQueue for Events {
    fn room(&self) -> usize {
        usize::MAX
    }
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.0.push(event);
        Ok(())
    }
}

fn main() -> Result<(), String> {
    let mut blocks = vec![Block::EMPTY; 128];
    let pins = PulserState::new();
    let mut machine = Machine::new(Settings::default(), &mut blocks, &pins, u32::MAX);
    let (mut path, mut events) = (Zigzag(0), Events::default());
    machine.start(&mut path).map_err(|error| format!("{error:?}"))?;
    machine.fill(&mut path, &mut events);
    let ticks: u64 = events.0.iter().map(|event| u64::from(event.ticks())).sum();
    let seconds = ticks as f64 / f64::from(TICKS_PER_SECOND);
    println!("{} step events in {seconds:.2} s", events.0.len());
    Ok(())
}
