//! Handling of panics and faults on this board: see [`fault`].

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;

use super::callers::Callers;
use super::registers::UART0;
use super::{pins, steps};
use crate::boards::fault::{self, Fault};

struct Lm3s6965;

impl Fault for Lm3s6965 {
    fn make_safe() {
        cortex_m::interrupt::disable();
        steps::halt();
        pins::release();
    }

    fn write(bytes: &[u8]) {
        UART0.write(bytes);
    }

    fn poll() -> Option<u8> {
        UART0.poll().map(|data| data as u8)
    }

    fn reset() -> ! {
        SCB::sys_reset()
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    fault::panic::<Lm3s6965>(Callers::new(&raw const _stack_start as usize))
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Calls [`report_fault`] with the address of the fault and a fresh stack. The fault may be a stack
/// overflow, and then nothing can be pushed onto the old stack.
///
/// # Safety
/// Called by the core alone, on a fault.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "ldr r1, ={end}",
        "cmp r0, r1",
        "mvn r2, #0", // fault::STACK_USED_UP
        "it hs",
        "ldrhs r2, [r0, #24]", // the program counter that the core has stored there
        "mov r0, r2",
        "ldr r1, ={start}",
        "msr msp, r1",
        "b {report_fault}",
        end = sym _stack_end,
        start = sym _stack_start,
        report_fault = sym report_fault,
    )
}

extern "C" fn report_fault(address: u32) -> ! {
    fault::hard_fault::<Lm3s6965>(address)
}
