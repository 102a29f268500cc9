//! Texas Instruments LM3S6965: Cortex-M3 at 50 MHz, 256 KiB flash, 64 KiB RAM.
//!
//! | what | where |
//! |---|---|
//! | STEP_X, DIR_X, STEP_Y, DIR_Y | PB0, PB1, PB2, PB3 |
//! | ENABLE (low: drivers on) | PB4 |
//! | PEN (high: down) | PB5 |
//! | STEP_Z, DIR_Z of a motor that lifts the pen (high: down) | PB6, PB7 |
//! | limit switches of x, y, emergency stop (high: closed; pulled down) | PC4, PC5, PC6 |
//! | serial line, 115200 8N1 | UART0: PA0 receives, PA1 sends |
//! | steps | timers 1 and 2, priority 0: nothing delays them |
//! | serial line's bytes | UART0, priority 1 |
//! | contacts | port C, priority 2: wakes the main loop |
//! | clock | SysTick, priority 2; stands still while the machine sleeps without a task |
//!
//! The board can be taken only once.
//!
//! This board is for the emulator only. It is QEMU's machine `lm3s6965evb`, a Cortex-M3 whose pins
//! can be observed. Do not flash the image onto an EK-LM3S6965 board. Three things would go wrong
//! there:
//!
//! - The log goes out by semihosting. Without a debugger each `bkpt` of it is a fault.
//! - The chip's first revisions need their LDO at 2.75 V before the PLL runs (erratum of the PLL);
//!   the image leaves it at 2.5 V.
//! - PC6, the emergency stop here, switches on the 15 V supply of the board's OLED display. PA2 to
//!   PA5 and PC7 belong to that display too.

mod callers;
mod clock;
mod contacts;
mod critical;
#[path = "../divide.rs"]
mod divide;
mod emergency;
#[path = "../memory.rs"]
mod memory;
mod pins;
mod registers;
mod serial;
mod steps;

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::interrupt;
use cortex_m::peripheral::Peripherals;
use penup::board_table::{self as table, BoardRow};
use penup::machine::{Contacts, PulserState};
use penup::motion::{Block, EventQueue};
use penup::plotter::{Board, Memory, MemorySlices};
use penup::protocol::RealTime;
use static_cell::{ConstStaticCell, StaticCell};

use super::fault::once;

/// Whether an interrupt has come since [`Board::wait`] last returned. It replaces the Cortex-M
/// event register in software, because QEMU's `wfe` does not sleep.
static HAPPENED: AtomicBool = AtomicBool::new(false);

/// What the table of the boards says about this board: its clock, pins and capacities.
const ROW: &BoardRow = &table::LM3S6965;

/// The plotter's memory, with the capacities of this board.
type BoardMemory = Memory<
    { ROW.memory.vertices },
    { ROW.memory.corners },
    { ROW.memory.words },
    { ROW.memory.ports },
>;

/// The board as the plotter sees it: it implements [`Board`].
pub struct Lm3s6965 {
    /// The clock, which is stopped while the machine sleeps without a task.
    clock: clock::Clock,
    /// The end of the serial line from which the main loop reads.
    serial: serial::Serial,
    /// The main loop's end of the queue of step events.
    steps: steps::Steps,
    /// Whether a fault has ended the previous run of the program.
    is_after_fault: bool,
}

/// Sets up the clock, the pins, the serial line and the timers. Afterwards the drivers are off, the
/// pen is up and nothing moves. To take the board twice is a fault: see [`once`].
pub fn take() -> (Lm3s6965, MemorySlices<'static>, &'static PulserState) {
    let mut core = once(Peripherals::take());
    let clock = clock::start(core.SYST, &mut core.SCB);
    let pins = pins::set_up();
    contacts::set_up(&mut core.NVIC);
    let serial = serial::set_up(&mut core.NVIC);
    let steps = steps::set_up(pins, &mut core.NVIC);
    defmt::info!("lm3s6965 at {=u32} Hz", clock::HERTZ);
    static MEMORY: ConstStaticCell<BoardMemory> = ConstStaticCell::new(BoardMemory::new());
    static BLOCKS: StaticCell<[Block; ROW.memory.blocks]> = StaticCell::new();
    let blocks = once(BLOCKS.try_init([Block::EMPTY; ROW.memory.blocks]));
    let memory = once(MEMORY.try_take()).lend(blocks);
    let is_after_fault = emergency::is_after_fault();
    (Lm3s6965 { clock, serial, steps, is_after_fault }, memory, &steps::STATE)
}

impl Board for Lm3s6965 {
    const NAME: &'static str = ROW.name;

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        self.serial.read_byte().map(|byte| (0, byte))
    }

    fn take_real_time(&mut self) -> RealTime {
        self.serial.take_real_time()
    }

    fn write(&mut self, bytes: &[u8]) {
        registers::UART0.write(bytes);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.steps.sync_consumed();
        &mut self.steps
    }

    fn contacts(&mut self) -> Contacts {
        contacts::read()
    }

    fn step_now(&mut self) {
        self.steps.start_now();
    }

    /// The cause was told before the restart and is not kept.
    fn fault(&self) -> Option<&str> {
        self.is_after_fault.then_some("told before")
    }

    fn microseconds(&mut self) -> u32 {
        clock::microseconds() as u32
    }

    fn receive_room(&mut self) -> usize {
        self.serial.receive_room()
    }

    /// Waits without sleeping: time stands still while the core sleeps, and an emulator would leap
    /// to the end of the wait before the sender can answer.
    fn wait_briefly(&mut self) {
        self.steps.start();
        self.steps.end_turn();
        for _ in 0..50 {
            if HAPPENED.swap(false, Ordering::Relaxed) || self.steps.wants_turn() {
                return;
            }
            // A 50th of a millisecond. Reading the clock instead would fill QEMU's trace.
            cortex_m::asm::delay(clock::HERTZ / 50_000);
        }
    }

    fn wait(&mut self) {
        self.steps.start();
        self.steps.end_turn();
        // Most step interrupts do not need a turn of the main loop.
        while !interrupt::free(|_| {
            let happened = HAPPENED.swap(false, Ordering::Relaxed) || self.steps.wants_turn();
            if happened {
            } else if self.steps.idle() {
                self.clock.sleep_stopped();
            } else {
                cortex_m::asm::wfi();
            }
            happened
        }) {}
    }
}
