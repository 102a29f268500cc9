//! Counts the instructions of each stage of a job on a Cortex-M3. `cargo xtask bench` runs this in
//! QEMU.
//!
//! The scenes are sent line by line through the library's own protocol, into the memory of the
//! largest board. Their jobs are then computed as by `$plot`, but not drawn.
#![no_std]
#![no_main]

#[path = "boards/mps2.rs"]
mod mps2;

use cortex_m_semihosting::{debug, hprintln};
use mps2::Counter;
use panic_semihosting as _;
use penup::board_table::PICO;
use penup::machine::PulserState;
use penup::motion::{EventQueue, StepEvent};
use penup::plotter::{Board, EMPTY_LOOKAHEAD, Memory, Plotter, Unobserved};
use penup::protocol::RealTime;
use penup::stage::{Aborted, Cancel, Stage};
use static_cell::StaticCell;

/// The name, model and eye of each scene; the eye looks at the middle of the model.
const SCENES: [(&str, &str, &str); 9] = [
    ("lattice1", include_str!("../scenes/lattice1.obj"), "$eye=-3.37,-4.71,5.13\n"),
    ("lattice2", include_str!("../scenes/lattice2.obj"), "$eye=-6.37,-8.71,10.13\n"),
    ("lattice3", include_str!("../scenes/lattice3.obj"), "$eye=-9.37,-12.71,15.13\n"),
    ("lattice4", include_str!("../scenes/lattice4.obj"), "$eye=-12.37,-16.71,20.13\n"),
    ("lattice5", include_str!("../scenes/lattice5.obj"), "$eye=-15.37,-20.71,25.13\n"),
    ("lattice6", include_str!("../scenes/lattice6.obj"), "$eye=-18.37,-24.71,30.13\n"),
    ("lattice7", include_str!("../scenes/lattice7.obj"), "$eye=-21.37,-28.71,35.13\n"),
    ("grid20", include_str!("../scenes/grid20.obj"), ""),
    ("text300", include_str!("../scenes/text300.obj"), ""),
];

/// A board that receives `text` and prints only refusals.
struct BenchBoard<'t> {
    /// The bytes that the plotter has still to read.
    text: &'t [u8],
    /// Where step events would go. No job is drawn, so none comes.
    queue: NoSteps,
}

/// A queue for step events that takes none, because the jobs are only computed.
struct NoSteps;

impl EventQueue for NoSteps {
    fn room(&self) -> usize {
        0
    }
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        Err(event)
    }
}

impl Board for BenchBoard<'_> {
    const NAME: &'static str = "mps2";

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        let (byte, rest) = self.text.split_first()?;
        self.text = rest;
        Some((0, *byte))
    }
    fn take_real_time(&mut self) -> RealTime {
        RealTime::default()
    }
    fn write(&mut self, bytes: &[u8]) {
        if bytes.starts_with(b"error") || bytes.starts_with(b"[MSG") {
            hprintln!("{}", core::str::from_utf8(bytes).unwrap_or("a refusal"));
        }
    }
    fn queue(&mut self) -> &mut dyn EventQueue {
        &mut self.queue
    }
    // No time passes: a job is computed, and no program is idle.
    fn microseconds(&mut self) -> u32 {
        0
    }

    fn wait(&mut self) {}
}

/// Counts the instructions of each stage of the computation of a job: view, visibility and order.
struct Stages<'c> {
    /// Counts the instructions that are executed, in whichever stage.
    counter: &'c mut Counter,
    /// The current stage and the count at its beginning.
    begun: Option<(Stage, u64)>,
    /// The instructions of each stage so far, in the order of [`Stage`].
    counts: [u64; 3],
}

impl Stages<'_> {
    /// Ends the current stage and adds its instructions to its count.
    fn end(&mut self) {
        let now = self.counter.read();
        if let Some((stage, begun)) = self.begun.take() {
            self.counts[stage as usize] += now - begun;
        }
    }
}

impl Cancel for Stages<'_> {
    fn check(&mut self) -> Result<(), Aborted> {
        self.counter.read();
        Ok(())
    }

    fn enter(&mut self, stage: Stage) {
        self.end();
        self.begun = Some((stage, self.counter.read()));
    }
}

/// Measures one scene after the other and prints a row of figures for each.
#[cortex_m_rt::entry]
fn main() -> ! {
    /// Memory for the scenes of the largest board, and so of every board.
    type BenchMemory =
        Memory<{ PICO.memory.vertices }, { PICO.memory.corners }, { PICO.memory.words }>;
    static MEMORY: StaticCell<BenchMemory> = StaticCell::new();
    static PINS: StaticCell<PulserState> = StaticCell::new();
    let mut moves = EMPTY_LOOKAHEAD;
    let memory = MEMORY.init_with(BenchMemory::new).lend(&mut moves);
    let mut plotter = Plotter::new(memory, PINS.init_with(PulserState::new));
    let mut counter = Counter::start();
    for (name, scene, eye) in SCENES {
        for text in ["$clear\n$view=auto\n", eye, scene] {
            let mut line = BenchBoard { text: text.as_bytes(), queue: NoSteps };
            while !line.text.is_empty() {
                plotter.poll(&mut line);
            }
        }
        let mut stages = Stages { counter: &mut counter, begun: None, counts: [0; 3] };
        let outcome = plotter.compute(&mut stages, &mut Unobserved).map(|_| ());
        stages.end();
        let [view, visibility, order] = stages.counts;
        let (vertices, corners) =
            (plotter.model().vertices().len(), plotter.model().corner_count());
        match outcome {
            Ok(()) => {
                hprintln!("{} {} {} {} {} {}", name, vertices, corners, view, visibility, order)
            }
            Err(command_error) => hprintln!("{}: {}", name, command_error),
        }
    }
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
