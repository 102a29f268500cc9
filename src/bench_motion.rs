//! Counts the instructions of motion planning per step event on a Cortex-M3. `cargo xtask bench
//! --motion` runs this in QEMU.
//!
//! Everything that the main loop does from a target to the queue is counted, and nothing that the
//! interrupt does. The computation of the targets and the move to the first one are not counted.
#![no_std]
#![no_main]

#[path = "boards/mps2.rs"]
mod mps2;

use core::hint::black_box;
use cortex_m_semihosting::{debug, hprintln};
use mps2::Counter;
use panic_semihosting as _;
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Machine, Path, PulserState, Setting, Settings, Target, Value};
use penup::motion::{Block, EventQueue, StepEvent};
use penup::step::{Arc, Turn};
use static_cell::StaticCell;

/// A queue that is never full. It only counts the step events that are put in, and so measures the
/// planner without a board's queue.
struct Count(u64);

impl EventQueue for Count {
    fn room(&self) -> usize {
        128
    }
    fn push(&mut self, _event: StepEvent) -> Result<(), StepEvent> {
        self.0 += 1;
        Ok(())
    }
}

/// A job whose planning is measured.
struct Job {
    /// What the job is, as the report names it.
    name: &'static str,
    /// How many steps per millimetre the motors of both axes make in this job.
    steps: u16,
    /// How fast the pen goes in this job, in mm/s.
    speed: u16,
    /// The number of points of a circle from one target to the next; `None` is a straight line.
    stride: Option<usize>,
}

/// The jobs whose planning is measured.
const JOBS: [Job; 4] = [
    Job { name: "a line, 5 000 moves a second", steps: 100, speed: 50, stride: None },
    Job { name: "a line, 100 000 moves a second", steps: 200, speed: 500, stride: None },
    Job { name: "chords of 5 moves, 5 000 moves a second", steps: 100, speed: 50, stride: Some(5) },
    Job {
        name: "chords of 50 moves, 50 000 moves a second",
        steps: 250,
        speed: 200,
        stride: Some(50),
    },
];

/// The limits of the jerk with which each job is measured, in m/s³; 0 is no limit.
const JERKS: [u16; 4] = [0, 100, 10, 1];

/// Where the pen moves in a job, one target after the other.
#[derive(Clone)]
enum Targets {
    /// A straight move to a point; `None` once it has been handed out.
    Line(Option<Target>),
    /// Points of a circle. Each target is this many points after the one before.
    Circle(Arc, usize),
}

impl Targets {
    /// Makes a path without any target, to begin a job whose targets are handed over separately.
    const fn nowhere() -> Self {
        Self::Line(None)
    }

    /// The pen-up move to the start of the job, and the job itself.
    fn of(job: &Job) -> [Self; 2] {
        let line = |point, ink| Self::Line(Some(Target { point, ink }));
        let ink = Some(LineType::Full);
        let Some(stride) = job.stride else {
            return [Self::nowhere(), line(PagePoint { x: 40_000, y: 17_000 }, ink)];
        };
        let steps = i32::from(job.steps);
        let [center, start] = [100, 190].map(|x| PagePoint { x: x * steps, y: 100 * steps });
        let circle = Arc::new(center, start, start, Turn::Clockwise);
        [line(start, None), circle.map_or(Self::nowhere(), |arc| Self::Circle(arc, stride))]
    }
}

impl Path for Targets {
    fn next_target(&mut self) -> Option<Target> {
        match self {
            Self::Circle(arc, stride) => {
                Some(Target { point: arc.nth(*stride - 1)?, ink: Some(LineType::Full) })
            }
            Self::Line(target) => target.take(),
        }
    }
    fn rewind(&mut self) {}
}

/// Plans all events of `targets`. The machine does not measure the strokes beforehand.
fn run(machine: &mut Machine, targets: &mut Targets) -> Count {
    let mut queue = Count(0);
    if machine.start(&mut Targets::nowhere()).is_err() {
        hprintln!("refused");
    }
    machine.fill(targets, &mut queue);
    queue
}

/// Returns the settings of the machine for a job with this limit of the jerk in m/s³.
fn settings(job: &Job, jerk: u16) -> Settings {
    let mut settings = Settings::default();
    let acceleration = if job.speed > 100 { 5000 } else { 800 };
    for (setting, value) in [
        (Setting::StepPulse, 1),
        (Setting::StepsPerMmX, i32::from(job.steps)),
        (Setting::StepsPerMmY, i32::from(job.steps)),
        (Setting::MaxRateX, 60 * i32::from(job.speed)),
        (Setting::MaxRateY, 60 * i32::from(job.speed)),
        (Setting::DrawSpeed, 60 * i32::from(job.speed)),
        (Setting::AccelerationX, acceleration),
        (Setting::AccelerationY, acceleration),
        (Setting::Jerk, jerk.into()),
    ] {
        if settings.set(setting, Value::from_num(value)).is_err() {
            hprintln!("refused: {} {}", setting.info().name, value);
        }
    }
    settings
}

/// Measures one job after the other and prints a row for each: the instructions for each event,
/// with each limit of the jerk.
#[cortex_m_rt::entry]
fn main() -> ! {
    static PINS: StaticCell<PulserState> = StaticCell::new();
    static BLOCKS: StaticCell<[Block; 128]> = StaticCell::new();
    let pins = PINS.init_with(PulserState::new);
    let blocks = BLOCKS.init_with(|| [Block::EMPTY; 128]);
    let mut counter = Counter::start();
    for job in &JOBS {
        let counts = JERKS.map(|jerk| {
            let mut machine = Machine::new(settings(job, jerk), blocks, pins, u32::MAX);
            let [mut approach, mut targets] = Targets::of(job);
            run(&mut machine, &mut approach);
            let (mut read, mut begun) = (targets.clone(), counter.read());
            while black_box(read.next_target()).is_some() {}
            let free = counter.read() - begun;
            begun = counter.read();
            let queue = run(&mut machine, &mut targets);
            (counter.read() - begun - free) / queue.0.max(1)
        });
        let [none, high, middle, low] = counts;
        hprintln!("{}|{}|{}|{}|{}", job.name, none, high, middle, low);
    }
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
