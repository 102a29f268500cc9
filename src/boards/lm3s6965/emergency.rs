//! A panic or a fault: steps stop, pen up, drivers off, a report, then nothing until ctrl-X resets.

use core::fmt::{self, Write};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;

use super::{pins, serial, steps};
use crate::boards::line;

/// A second fault while the first is reported ends the report.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// Makes the machine safe, then reports `cause` on the serial line. Returns whether to go on
/// reporting.
fn make_safe(cause: fmt::Arguments) -> bool {
    cortex_m::interrupt::disable();
    steps::halt();
    pins::release();
    if REPORTING.swap(true, Ordering::Relaxed) {
        return false;
    }
    // Fails never: `OneLine` takes every byte.
    serial::write(b"\r\n");
    let _ = write!(OneLine, "[MSG:stopped by a fault, ctrl-X resets: {cause}]");
    serial::write(b"\r\n");
    true
}

fn wait_for_reset() -> ! {
    while serial::poll() != Some(line::ABORT) {}
    SCB::sys_reset()
}

/// Writes to the serial line, with line ends as spaces.
struct OneLine;

impl Write for OneLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            let byte = if byte == b'\n' || byte == b'\r' { b' ' } else { byte };
            serial::write(&[byte]);
        }
        Ok(())
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    if make_safe(format_args!("{info}")) {
        defmt::error!("{}", defmt::Display2Format(info));
    }
    wait_for_reset()
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Stands for the address of a fault for which the stack had no place left.
const STACK_USED_UP: u32 = u32::MAX;

/// Goes to [`report_fault`] with the address of the fault, on a fresh stack: the fault may be that
/// the stack is used up, and then nothing can be put onto it.
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
        "mvn r2, #0", // STACK_USED_UP
        "it hs",
        "ldrhs r2, [r0, #24]", // the program counter that the core has put there
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
    if address == STACK_USED_UP {
        if make_safe(format_args!("the stack is used up")) {
            defmt::error!("the stack is used up");
        }
    } else if make_safe(format_args!("hard fault at {address:#010x}")) {
        defmt::error!("hard fault at {=u32:#010x}", address);
    }
    wait_for_reset()
}
