//! Raspberry Pi Pico: RP2040, Cortex-M0+ at 125 MHz, 2 MiB flash, 264 KiB RAM.
//!
//! | what | where |
//! |---|---|
//! | serial line, 115200 8N1 | UART0: GP0 sends, GP1 receives |
//! | STEP_X, STEP_Y, DIR_X, DIR_Y | GP2, GP3, GP4, GP5: PIO 0, fed by DMA channel 0 |
//! | ENABLE (low: drivers on) | GP6: the same |
//! | PEN (servo) | GP7: PWM slice 3 |
//! | next block of steps | DMA_IRQ_0, priority 0 |
//! | pen's heights | PIO0_IRQ_0, priority 1 |
//! | serial line's bytes | UART0_IRQ, priority 2 |
//! | millisecond | TIMER_IRQ_0, priority 3 |
//!
//! What is refused: to be taken twice.

mod clock;
mod critical;
mod divider;
mod emergency;
mod pen;
mod pins;
mod registers;
mod serial;
mod steps;

use cortex_m::peripheral::Peripherals as Core;
use penup::machine::PulserState;
use penup::motion::{Block, EventQueue};
use penup::plotter::{Board, Lent, NO_MOVES, PicoMemory};
use penup::protocol::RealTime;
use rp2040_hal::clocks::init_clocks_and_plls;
use rp2040_hal::gpio::Pins;
use rp2040_hal::pac::Peripherals;
use rp2040_hal::{Sio, Watchdog};
use static_cell::{ConstStaticCell, StaticCell};

use crate::boards::line::Line;

/// What the boot ROM runs to set the flash up.
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT_2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

const CRYSTAL_HERTZ: u32 = 12_000_000;

/// The board, as the plotter sees it.
pub struct Pico {
    line: Line,
    sender: serial::Sender,
    steps: steps::Steps,
}

/// Sets up clock, pins, serial line, state machine and timer: drivers off, pen up, nothing moving.
///
/// # Panics
/// If the board was taken before, or its crystal does not swing.
#[allow(clippy::panic)] // Without clocks there is nothing to go on with.
pub fn take() -> (Pico, Lent<'static>, &'static PulserState) {
    let (Some(mut core), Some(mut chip)) = (Core::take(), Peripherals::take()) else {
        panic!("the board was taken twice")
    };
    let mut watchdog = Watchdog::new(chip.WATCHDOG);
    let clocks = init_clocks_and_plls(
        CRYSTAL_HERTZ,
        chip.XOSC,
        chip.CLOCKS,
        chip.PLL_SYS,
        chip.PLL_USB,
        &mut chip.RESETS,
        &mut watchdog,
    );
    if clocks.is_err() {
        panic!("the clocks do not start")
    }
    registers::restart(registers::reset::TIMER);
    let sio = Sio::new(chip.SIO);
    let gpio = Pins::new(chip.IO_BANK0, chip.PADS_BANK0, sio.gpio_bank0, &mut chip.RESETS);
    let steps = steps::set_up(&mut core.NVIC);
    pen::set_up();
    let (line, sender) = serial::set_up(&mut core.NVIC);
    pins::set_up(gpio);
    clock::start(&mut core.NVIC);
    defmt::info!("pico at {=u32} Hz", clock::HERTZ);
    static MEMORY: ConstStaticCell<PicoMemory> = ConstStaticCell::new(PicoMemory::new());
    static BLOCKS: StaticCell<[Block; NO_MOVES.len()]> = StaticCell::new();
    let memory = MEMORY.take().lend(BLOCKS.init(NO_MOVES));
    (Pico { line, sender, steps }, memory, &steps::STATE)
}

impl Board for Pico {
    const NAME: &'static str = "pico";

    fn read_byte(&mut self) -> Option<u8> {
        self.line.read_byte()
    }

    fn take_real_time(&mut self) -> RealTime {
        self.line.take_real_time()
    }

    fn write(&mut self, bytes: &[u8]) {
        self.sender.write(bytes);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.steps.follow();
        &mut self.steps
    }

    fn wait(&mut self) {
        self.steps.start();
        // An interrupt since the last wait makes this return at once.
        cortex_m::asm::wfe();
    }
}
