//! The watchdog. A panic or a fault: steps stop, pen up, drivers off, a report, then nothing until ctrl-X resets.

use core::fmt::{self, Write};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use super::registers::WATCHDOG;
use super::{pen, serial, steps};
use crate::boards::line;

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

/// A second fault while the first is reported ends the report.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// Makes the machine safe, then reports `cause` on the serial line. Returns whether to go on
/// reporting.
fn make_safe(cause: fmt::Arguments) -> bool {
    cortex_m::interrupt::disable();
    steps::release();
    pen::set_height(0);
    if REPORTING.load(Ordering::Relaxed) {
        return false;
    }
    REPORTING.store(true, Ordering::Relaxed);
    // Fails never: `OneLine` takes every byte.
    serial::write_now(b"\r\n");
    let _ = write!(OneLine, "[MSG:stopped by a fault, ctrl-X resets: {cause}]");
    serial::write_now(b"\r\n");
    true
}

fn wait_for_reset() -> ! {
    WATCHDOG.write(watchdog::CONTROL, 0);
    while serial::poll() != Some(line::ABORT) {}
    reset()
}

/// Resets the whole chip. The core's own request would leave its peripherals as they are.
fn reset() -> ! {
    WATCHDOG.write(watchdog::CONTROL, watchdog::TRIGGER);
    loop {
        cortex_m::asm::nop();
    }
}

/// Writes to the serial line, with line ends as spaces.
struct OneLine;

impl Write for OneLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            let byte = if byte == b'\n' || byte == b'\r' { b' ' } else { byte };
            serial::write_now(&[byte]);
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
        "mrs r1, msp",
        "ldr r2, ={end}",
        "movs r0, #0",
        "mvns r0, r0", // STACK_USED_UP
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
    if address == STACK_USED_UP {
        if make_safe(format_args!("the stack is used up")) {
            defmt::error!("the stack is used up");
        }
    } else if make_safe(format_args!("hard fault at {address:#010x}")) {
        defmt::error!("hard fault at {=u32:#010x}", address);
    }
    wait_for_reset()
}
