//! A panic or a fault: steps stop, pen up, drivers off, a report, then nothing until ctrl-X resets.

use core::fmt::{self, Write};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

use super::{pins, serial, steps};

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
    while serial::poll() != Some(serial::ABORT) {}
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

/// # Safety
/// Called by the core alone, on a fault.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    if make_safe(format_args!("hard fault at {:#010x}", frame.pc())) {
        defmt::error!("hard fault at {=u32:#010x}", frame.pc());
    }
    wait_for_reset()
}
