//! The ranks of the interrupts, and the critical section.
//!
//! A Cortex-M0+ can mask all interrupts or none. The next block of steps waits for a section to end,
//! so each must be shorter than the state machine's queue lasts: 4 words, 4 µs at the greatest rate.

use cortex_m::peripheral::NVIC;
use cortex_m::register::primask;
use rp2040_hal::pac::Interrupt;

/// The chip tells four ranks by the upper two bits.
const fn rank(number: u8) -> u8 {
    number << 6
}

/// The next block of steps.
pub const STEP_PRIORITY: u8 = rank(0);
/// The pen's heights, which come in with the steps.
pub const PEN_PRIORITY: u8 = rank(1);
/// Bytes of the serial line.
pub const SERIAL_PRIORITY: u8 = rank(2);
/// The clock's millisecond.
pub const CLOCK_PRIORITY: u8 = rank(3);

/// Ranks and unmasks an interrupt, at set-up.
pub fn enable(nvic: &mut NVIC, interrupt: Interrupt, priority: u8) {
    // SAFETY: no critical section is held at set-up that this could break.
    unsafe {
        nvic.set_priority(interrupt, priority);
        NVIC::unmask(interrupt);
    }
}

struct MaskAll;
critical_section::set_impl!(MaskAll);

// SAFETY: one core runs, and `acquire` masks all its interrupts until the outermost `release`.
unsafe impl critical_section::Impl for MaskAll {
    unsafe fn acquire() -> critical_section::RawRestoreState {
        let before = primask::read();
        cortex_m::interrupt::disable();
        u8::from(before.is_active())
    }

    unsafe fn release(before: critical_section::RawRestoreState) {
        if before != 0 {
            // SAFETY: interrupts were on when the paired `acquire` was called.
            unsafe { cortex_m::interrupt::enable() };
        }
    }
}
