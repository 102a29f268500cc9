//! The watchdog, and what becomes of a panic or a fault: see [`fault`].

use core::panic::PanicInfo;

use super::registers::{UART0, WATCHDOG};
use super::{pen, steps};
use crate::boards::fault::{self, Fault};

mod watchdog {
    pub const CONTROL: usize = 0x0;
    pub const LOAD: usize = 0x4;
    pub const REASON: usize = 0x8;
    pub const TRIGGER: u32 = 1 << 31;
    pub const TIMED_OUT: u32 = 1;
}
/// Longer than the longest event, 0.67 s, and than erasing a sector; the chip counts two in a
/// microsecond.
const PATIENCE: u32 = 2 * 3_000_000;

/// Whether the watchdog, unfed, has started the chip again.
pub fn was_restarted() -> bool {
    WATCHDOG.read(watchdog::REASON) & watchdog::TIMED_OUT != 0
}

/// Feeds the watchdog.
pub fn feed() {
    WATCHDOG.write(watchdog::LOAD, PATIENCE);
}

struct Pico;

impl Fault for Pico {
    fn make_safe() {
        cortex_m::interrupt::disable();
        steps::release();
        pen::set_height(0);
    }

    fn write(bytes: &[u8]) {
        UART0.write(bytes);
    }

    fn begin_to_wait() {
        WATCHDOG.write(watchdog::CONTROL, 0);
    }

    fn poll() -> Option<u8> {
        UART0.poll()
    }

    /// Resets the whole chip. The core's own request would leave its peripherals as they are.
    fn reset() -> ! {
        WATCHDOG.write(watchdog::CONTROL, watchdog::TRIGGER);
        loop {
            cortex_m::asm::nop();
        }
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    fault::panic::<Pico>(info)
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Goes to [`report_fault`] with the address of the fault, on a fresh stack: the fault may be that
/// the stack is used up, and then nothing can be put onto it.
///
/// # Safety
/// Called by the core alone, on a fault.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mrs r1, msp",
        "ldr r2, ={end}",
        "movs r0, #0",
        "mvns r0, r0", // fault::STACK_USED_UP
        "cmp r1, r2",
        "blo 1f",
        "ldr r0, [r1, #24]", // the program counter that the core has put there
        "1: ldr r1, ={start}",
        "msr msp, r1",
        "ldr r1, ={report_fault}",
        "bx r1",
        end = sym _stack_end,
        start = sym _stack_start,
        report_fault = sym report_fault,
    )
}

extern "C" fn report_fault(address: u32) -> ! {
    fault::hard_fault::<Pico>(address)
}
