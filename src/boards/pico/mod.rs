//! Raspberry Pi Pico: RP2040, Cortex-M0+ at 125 MHz, 2 MiB flash, 264 KiB RAM.
//!
//! | what | where |
//! |---|---|
//! | serial line | USB, and UART0 at 115200 8N1: GP0 sends, GP1 receives |
//! | STEP_X, STEP_Y, DIR_X, DIR_Y | GP2, GP3, GP4, GP5: PIO 0, fed by DMA channel 0 |
//! | ENABLE (low: drivers on) | GP6: the same |
//! | PEN (servo) | GP7: PWM slice 3 |
//! | limit switches of x and y, emergency stop (closed: low) | GP8, GP9, GP10 |
//! | STEP_Z, DIR_Z of a motor that lifts the pen (high: down) | GP11, GP12 |
//! | nothing: `usb` uses the pin when a host resets the bus | GP15 |
//! | a model that is too large for the memory | the 1120 KiB of flash before the records |
//! | settings, last job and its progress | the last 288 KiB of flash |
//! | next block of steps | DMA_IRQ_0, priority 0 |
//! | pen's heights, and the steps of its motor | PIO0_IRQ_0, priority 1 |
//! | serial line's bytes | DMA channels 1 and 2; UART0_IRQ, USBCTRL_IRQ, priority 2 |
//! | millisecond | TIMER_IRQ_0, priority 3 |
//!
//! The watchdog is fed only while the main loop turns, or reads real-time requests during a long
//! computation, and the steps make progress.
//!
//! The board can be taken only once.

mod clock;
mod contacts;
mod critical;
mod divider;
mod emergency;
mod flash;
mod multiply;
mod pen;
mod pins;
mod ports;
mod registers;
mod rescue;
mod serial;
mod steps;
mod usb;
mod words;
mod z_axis;

use cortex_m::peripheral::Peripherals as Core;
use penup::board_table::{self as table, BoardRow};
use penup::machine::{Contacts, PulserState};
use penup::motion::{Block, EventQueue};
use penup::plotter::{
    Board, FlashRecords, Memory, MemorySlices, NotStored, Record, Replies, Stored,
};
use penup::protocol::RealTime;
use penup::storage::LogProgress;
#[cfg(feature = "tiles")]
use penup::storage::area::{Area, AreaFlash};
use rp2040_hal::clocks::init_clocks_and_plls;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::Pins;
use rp2040_hal::pac::Peripherals;
use rp2040_hal::{Sio, Watchdog};
use static_cell::{ConstStaticCell, StaticCell};

use self::emergency::Start;
use self::ports::Ports;
use super::fault::{self, once};

/// The second-stage boot loader, which the boot ROM runs to set up the flash.
// SAFETY: the section is where the boot ROM looks for just these 256 bytes (`boards/pico.x`).
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT_2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

/// The frequency of the crystal on the board, from which all clocks are made.
const CRYSTAL_HERTZ: u32 = 12_000_000;

/// What the table of the boards says about this board: its clock, pins and capacities.
const ROW: &BoardRow = &table::PICO;

/// The plotter's memory, with the capacities of this board.
type BoardMemory = Memory<
    { ROW.memory.vertices },
    { ROW.memory.corners },
    { ROW.memory.words },
    { ROW.memory.ports },
>;

/// The board as the plotter sees it: it implements [`Board`].
pub struct Pico {
    /// The two serial ports, from which commands come and to which replies go.
    ports: Ports,
    /// The main loop's end of the queue of step events.
    steps: steps::Steps,
    /// The records in flash.
    kept: FlashRecords<flash::Flash>,
    /// The fault after which the board restarted, if any.
    fault: Option<emergency::Cause>,
}

/// Sets up the clock, the pins, the serial lines, the state machine and the timer. Afterwards the
/// drivers are off, the pen is not driven and nothing moves. It is a fault if the board was taken
/// before, or if its crystal does not oscillate.
pub fn take() -> (Pico, MemorySlices<'static>, &'static PulserState) {
    let (mut core, mut chip) = (once(Core::take()), once(Peripherals::take()));
    critical::move_vectors_to_ram();
    let start = emergency::start();
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
        fault::stop("the clocks do not start");
    }
    registers::restart(registers::reset::TIMER);
    let sio = Sio::new(chip.SIO);
    // It takes the pins out of reset.
    Pins::new(chip.IO_BANK0, chip.PADS_BANK0, sio.gpio_bank0, &mut chip.RESETS);
    let steps = steps::set_up(&mut core.NVIC);
    pen::set_up();
    z_axis::set_up();
    let mut flash = flash::Flash::new();
    let lines = ports::set_up();
    let uart = serial::set_up(&mut core.NVIC);
    static NUMBER: StaticCell<heapless::String<16>> = StaticCell::new();
    let number = once(NUMBER.try_init(flash.number()));
    let usb = usb::set_up(&mut core.NVIC, number);
    let ports = Ports::new(lines, uart, usb);
    pins::hand_over();
    serial::open();
    contacts::set_up();
    clock::start(&mut core.NVIC);
    contacts::wait_until_known();
    watchdog.start(3.secs());
    defmt::info!("pico at {=u32} Hz", clock::HERTZ);
    static MEMORY: ConstStaticCell<BoardMemory> = ConstStaticCell::new(BoardMemory::new());
    static BLOCKS: ConstStaticCell<[Block; ROW.memory.blocks]> =
        ConstStaticCell::new([Block::EMPTY; ROW.memory.blocks]);
    let fault = match start {
        Start::Fresh => None,
        Start::AfterFault(cause) => Some(cause),
        Start::Rescue(cause) => rescue::run(ports, &cause),
    };
    let blocks = once(BLOCKS.try_take());
    let memory = once(MEMORY.try_take()).lend(blocks);
    let kept = FlashRecords::new(flash, flash::LAYOUT);
    let board = Pico { ports, steps, kept, fault };
    (board, memory, &steps::STATE)
}

impl Board for Pico {
    const NAME: &'static str = ROW.name;
    const HAS_DRIVE: bool = true;

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        self.ports.read_byte()
    }

    fn take_real_time(&mut self) -> RealTime {
        usb::go_on();
        emergency::note_running(clock::microseconds());
        if self.steps.is_progressing() {
            emergency::feed();
        }
        self.ports.take_real_time()
    }

    fn has_room(&mut self, bytes: usize) -> bool {
        self.ports.has_room(bytes)
    }

    fn write(&mut self, bytes: &[u8]) {
        self.ports.write(bytes);
    }

    fn take_opened(&mut self) -> bool {
        usb::take_opened()
    }

    fn reply_only_to_opened(&mut self, only_to_opened: bool) {
        self.ports.reply_only_to_opened(only_to_opened);
    }

    fn reply_to(&mut self, replies: Replies) {
        self.ports.reply_to(replies);
    }

    fn wants_drive(&mut self) -> bool {
        usb::take_touched()
    }

    fn show_drive(&mut self) {
        /// How long to wait until the last reply has been sent, even on the slower of the two
        /// ports, in microseconds.
        const SENDING: u32 = 100_000;
        let began = clock::microseconds();
        while clock::microseconds().wrapping_sub(began) < SENDING {
            cortex_m::asm::wfe();
        }
        emergency::show_drive()
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.steps.sync_consumed();
        &mut self.steps
    }

    fn contacts(&mut self) -> Contacts {
        contacts::closed()
    }

    fn step_now(&mut self) {
        self.steps.sync_consumed();
    }

    #[cfg(feature = "tiles")]
    fn start_steps(&mut self) {
        self.steps.start();
    }

    #[cfg(feature = "tiles")]
    fn model_flash(&mut self) -> Option<(Area<'static>, &mut dyn AreaFlash)> {
        Some((flash::model_area(false), &mut self.kept.flash))
    }

    #[cfg(feature = "tiles")]
    fn uncached_model(&mut self) -> Option<Area<'static>> {
        Some(flash::model_area(true))
    }

    fn invert_driver_pins(&mut self, steps: u8, enable: bool) {
        pins::invert(steps, enable);
    }

    fn microseconds(&mut self) -> u32 {
        clock::microseconds()
    }

    fn receive_room(&mut self) -> usize {
        self.ports.receive_room()
    }

    fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }

    fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        self.kept.save(record, parts)
    }

    #[cfg(feature = "early-ink")]
    fn save_with_room(
        &mut self,
        record: Record,
        parts: &[&[u8]],
        room: u32,
    ) -> Result<(), NotStored> {
        self.kept.save_with_room(record, parts, room)
    }

    #[cfg(feature = "early-ink")]
    fn erase_ahead(&mut self, bytes: u32) -> bool {
        self.kept.erase_ahead(bytes)
    }

    #[cfg(feature = "early-ink")]
    fn add(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        self.kept.add(record, parts)
    }

    #[cfg(feature = "early-ink")]
    fn load_added(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        self.kept.load_added(record, take);
    }

    #[cfg(feature = "early-ink")]
    fn begin_steps(&mut self) {
        self.steps.start();
    }

    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        self.kept.load(record, take);
    }

    fn keeps_progress(&self) -> bool {
        true
    }

    fn begin_progress(&mut self, notes: &[u8], strokes: u32) -> Result<(), NotStored> {
        self.kept.begin_progress(notes, strokes)
    }

    fn note_progress(&mut self, strokes: u32) -> Result<(), NotStored> {
        self.kept.note_progress(strokes)
    }

    fn note_point(&mut self, points: u32) -> Result<(), NotStored> {
        self.kept.note_point(points)
    }

    fn progress(&mut self, notes: &mut [u8]) -> Option<(usize, LogProgress)> {
        self.kept.progress(notes)
    }

    fn wait(&mut self) {
        self.steps.start();
        // If an interrupt has come since the last wait, this returns at once.
        cortex_m::asm::wfe();
    }
}
