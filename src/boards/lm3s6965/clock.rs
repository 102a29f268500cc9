//! The clock of the core, and the time since the start.
//!
//! SysTick counts time in cycles of the core with 24 bits, which an interrupt extends. Time is
//! stopped while the machine sleeps without a task, so that an emulator that jumps in time to the
//! next timer has nothing to jump to.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;

use super::critical;
use super::registers::SYSTEM_CONTROL;

/// The clock frequency in cycles per second.
pub const HERTZ: u32 = super::ROW.clock_hertz;

/// The mask of a SysTick count. SysTick counts one cycle more than this number and then restarts.
pub const CYCLE_MASK: u32 = 0x00FF_FFFF;

/// The registers of system control that are used here, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register of the states that may cause an interrupt; only the bit of the PLL is read.
    pub const RAW_INTERRUPT_STATUS: Offset = Offset::new(0x050);
    /// The register that says which clock the core gets, and by how much it is divided.
    pub const RUN_MODE_CLOCK: Offset = Offset::new(0x060);
}
/// The bits of the clock register that hold the divider, less 1.
const SYSTEM_DIVIDER: u32 = 0xF << 23;
/// The bit that makes the core's clock the divided one.
const USE_SYSTEM_DIVIDER: u32 = 1 << 22;
/// The bit that switches the PLL (the circuit that multiplies the clock) off.
const PLL_POWER_DOWN: u32 = 1 << 13;
/// The bit that makes the clock go past the PLL (the circuit that multiplies its frequency).
const PLL_BYPASS: u32 = 1 << 11;
/// The bits of the clock register that say by a code which crystal the board has.
const CRYSTAL: u32 = 0xF << 6;
/// The bits of the clock register that stand for a crystal of 8 MHz.
const CRYSTAL_8_MHZ: u32 = 0xE << 6;
/// The bits that choose the oscillator; zeros choose the main one, which has the crystal.
const OSCILLATOR_SOURCE: u32 = 0x3 << 4;
/// The bit that switches the main oscillator off.
const MAIN_OSCILLATOR_OFF: u32 = 1;
/// The bit that says that the PLL runs at its frequency.
const PLL_LOCKED: u32 = 1 << 6;
/// The divider that makes the core's clock of the PLL's 200 MHz: by 4.
const DIVIDE_BY_4: u32 = 3 << 23;

/// The number of times that SysTick has restarted.
static WRAPS: AtomicU32 = AtomicU32::new(0);

/// The clock of the board while it runs.
pub struct Clock {
    /// The core's timer, which counts the time.
    systick: SYST,
}

/// Sets the core to [`HERTZ`] and starts the time. It must be called first of all.
pub fn start(mut systick: SYST, scb: &mut SCB) -> Clock {
    let set = |value| SYSTEM_CONTROL.write(offset::RUN_MODE_CLOCK, value);
    let mut run_mode = SYSTEM_CONTROL.read(offset::RUN_MODE_CLOCK);
    // This is the order of the data sheet, 6.1.5: leave the PLL, set the crystal, the PLL and the
    // divider, return to the PLL.
    run_mode = (run_mode | PLL_BYPASS) & !(USE_SYSTEM_DIVIDER | MAIN_OSCILLATOR_OFF);
    set(run_mode);
    run_mode &= !(CRYSTAL | OSCILLATOR_SOURCE | PLL_POWER_DOWN);
    run_mode |= CRYSTAL_8_MHZ;
    set(run_mode);
    run_mode = (run_mode & !SYSTEM_DIVIDER) | DIVIDE_BY_4 | USE_SYSTEM_DIVIDER;
    set(run_mode);
    while SYSTEM_CONTROL.read(offset::RAW_INTERRUPT_STATUS) & PLL_LOCKED == 0 {}
    set(run_mode & !PLL_BYPASS);

    // SAFETY: ranks SysTick below every other handler; no critical section is held at set-up.
    unsafe { scb.set_priority(SystemHandler::SysTick, critical::CLOCK_PRIORITY) };
    systick.set_clock_source(SystClkSource::Core);
    systick.set_reload(CYCLE_MASK);
    systick.clear_current();
    systick.enable_interrupt();
    systick.enable_counter();
    Clock { systick }
}

impl Clock {
    /// Sleeps until an interrupt comes, with the time stopped. The caller has masked interrupts.
    pub fn sleep_stopped(&mut self) {
        self.systick.disable_counter();
        cortex_m::asm::wfi();
        self.systick.enable_counter();
    }
}

/// The cycles since the start, modulo 2^24.
#[inline(always)]
pub fn cycles_24() -> u32 {
    !count_down() & CYCLE_MASK
}

/// Whether the board has been awake for five seconds since its start, so that it counts as started.
pub fn has_started() -> bool {
    WRAPS.load(Ordering::Relaxed) > 5 * HERTZ / (CYCLE_MASK + 1)
}

/// Returns SysTick's own count, which goes down. The step interrupt uses it because it costs least.
#[inline(always)]
pub fn count_down() -> u32 {
    SYST::get_current()
}

/// The time awake since the start, in microseconds.
pub fn microseconds() -> u64 {
    loop {
        let wraps = WRAPS.load(Ordering::Relaxed);
        let cycles = cycles_24();
        // SysTick may have restarted without being counted yet, because this code runs at a higher
        // priority than its interrupt.
        let uncounted = SCB::is_pendst_pending() && cycles < CYCLE_MASK / 2;
        if wraps == WRAPS.load(Ordering::Relaxed) {
            let wraps = u64::from(wraps) + u64::from(uncounted);
            return ((wraps << 24) + u64::from(cycles)) / u64::from(HERTZ / 1_000_000);
        }
    }
}

/// The interrupt for a restart of SysTick, every 2^24 cycles (a third of a second).
#[exception]
fn SysTick() {
    // This is the only writer, so a load and a store are as good as an increment.
    WRAPS.store(WRAPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

defmt::timestamp!("{=u64:us}", microseconds());
