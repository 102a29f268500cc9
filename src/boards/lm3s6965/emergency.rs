//! What this board does on panics and faults: see [`crate::boards::fault`].
//!
//! The board tells the cause by the serial line and restarts. Of the fault only a number is kept
//! through the reset: how many came one after the other, each soon after the start. At the last one
//! the board waits for ctrl-X instead.

use core::fmt;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;

use super::callers::Callers;
use super::registers::UART0;
use super::{Lm3s6965, clock, pins, steps};
use crate::boards::fault::{self, Fault};
use crate::boards::pl011::Uart;

/// The number of faults, each soon after the start, after which the board does not restart by
/// itself.
const FAULTS: u32 = 3;
/// What is added to the number of faults when it is kept, because memory holds arbitrary data after
/// a loss of power.
const KEPT: u32 = 0x6661_7500;
/// The bit that is set in the kept word when the start after the fault was told. A reset for
/// another reason is none after a fault.
const TOLD: u32 = 0x80;

// SAFETY: the memory map (`boards/lm3s6965.x`) defines this symbol, as the address of a word of RAM
// that belongs to nothing else and that no start clears.
unsafe extern "C" {
    /// The number of faults one after the other, as [`KEPT`] and [`TOLD`] say.
    static mut _kept: u32;
}

/// Reads the kept word.
fn kept() -> u32 {
    // SAFETY: only this module uses it: at the start, and by the handler of a fault, after which
    // nothing else runs. Every pattern of bits is a number.
    unsafe { (&raw const _kept).read_volatile() }
}

/// Writes the kept word.
fn keep(word: u32) {
    // SAFETY: as in `kept`.
    unsafe { (&raw mut _kept).write_volatile(word) };
}

/// Whether a fault ended the previous run of the program. It is asked once, at the start.
pub fn is_after_fault() -> bool {
    let word = kept();
    let is_after_fault = (1..FAULTS).contains(&word.wrapping_sub(KEPT));
    if is_after_fault {
        keep(word | TOLD);
    }
    is_after_fault
}

impl Fault for Lm3s6965 {
    const UART: Uart = UART0;

    fn release() {
        steps::halt();
        pins::release();
    }

    #[inline(always)] // So that the calls begin with the handler's.
    fn cause(_: &PanicInfo, stack_start: usize) -> impl fmt::Display {
        Callers::new(stack_start)
    }

    fn report(cause: fmt::Arguments) {
        let before = (kept() & !TOLD).wrapping_sub(KEPT);
        let faults = if before < FAULTS && !clock::has_started() { before + 1 } else { 1 };
        if faults == FAULTS {
            return fault::say(fault::WAITS, cause);
        }
        keep(KEPT + faults);
        fault::say("starts again", cause);
        UART0.flush();
        // A reset of the chip drops what it has received, but one of the emulator does not.
        while UART0.poll().is_some() {}
        SCB::sys_reset()
    }

    fn reset() -> ! {
        keep(0);
        SCB::sys_reset()
    }
}
