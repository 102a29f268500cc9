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

mod offset {
    pub const RAW_INTERRUPT_STATUS: usize = 0x050;
    pub const RUN_MODE_CLOCK: usize = 0x060;
}
const SYSTEM_DIVIDER: u32 = 0xF << 23;
const USE_SYSTEM_DIVIDER: u32 = 1 << 22;
const PLL_POWER_DOWN: u32 = 1 << 13;
const PLL_BYPASS: u32 = 1 << 11;
const CRYSTAL: u32 = 0xF << 6;
const CRYSTAL_8_MHZ: u32 = 0xE << 6;
const OSCILLATOR_SOURCE: u32 = 0x3 << 4;
const MAIN_OSCILLATOR_OFF: u32 = 1;
const PLL_LOCKED: u32 = 1 << 6;
/// The PLL's 200 MHz divided by 4.
const DIVIDE_BY_4: u32 = 3 << 23;

/// The number of times that SysTick has restarted.
static WRAPS: AtomicU32 = AtomicU32::new(0);

/// The running clock.
pub struct Clock {
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

/// The same count, counted down. The step interrupt uses it.
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

#[exception]
fn SysTick() {
    // This is the only writer, so a load and a store are as good as an increment.
    WRAPS.store(WRAPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

defmt::timestamp!("{=u64:us}", microseconds());
