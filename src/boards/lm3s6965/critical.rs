//! The priorities of the interrupts, and a critical section that does not delay the step interrupt.

use cortex_m::peripheral::NVIC;
use cortex_m::register::basepri;
use lm3s6965::Interrupt;

/// Converts a priority from 0 (highest) to 7 to the form in which the chip takes it: in the upper
/// three bits.
const fn priority(number: u8) -> u8 {
    number << 5
}

/// The priority of the steps, above everything else, including critical sections.
pub const STEP_PRIORITY: u8 = priority(0);
/// The priority of the serial line's interrupt.
pub const SERIAL_PRIORITY: u8 = priority(1);
/// The priority of the interrupt of the clock, which counts the time.
pub const CLOCK_PRIORITY: u8 = priority(2);

/// Sets the priority of an interrupt and unmasks it, during set-up.
pub fn enable(nvic: &mut NVIC, interrupt: Interrupt, priority: u8) {
    // SAFETY: no critical section is held at set-up that this could break.
    unsafe {
        nvic.set_priority(interrupt, priority);
        NVIC::unmask(interrupt);
    }
}

/// The critical section of this board. It masks every interrupt except that of the steps.
struct MaskAllButSteps;
critical_section::set_impl!(MaskAllButSteps);

// SAFETY: `acquire` masks every handler below the step interrupt's rank and `release` restores the
// mask, so sections do not overlap. The step interrupt is not masked, therefore its handler takes
// no critical section, logs nothing, and shares only atomics and the ends of a lock-free queue.
unsafe impl critical_section::Impl for MaskAllButSteps {
    unsafe fn acquire() -> critical_section::RawRestoreState {
        let before = basepri::read();
        // SAFETY: raising the mask; sections nest, so it is never lowered here.
        unsafe { basepri::write(SERIAL_PRIORITY) };
        before
    }

    unsafe fn release(before: critical_section::RawRestoreState) {
        // SAFETY: the value that the paired `acquire` found.
        unsafe { basepri::write(before) };
    }
}
