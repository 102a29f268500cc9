//! What becomes of a panic or a fault: the machine is made safe at once, and the cause is reported.
//!
//! How it is reported is the board's choice ([`Fault::report`]). Without a choice of its own it
//! says the cause on its serial line and waits for ctrl-X, which resets it. A board that can keep
//! the cause through a reset starts again by itself, and tells the cause then.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use super::line;

/// What a board does then. No handler runs any more.
pub trait Fault {
    /// No interrupt, no step, pen up, drivers off.
    fn make_safe();
    /// Reports the cause, or starts again and reports it then.
    fn report(cause: fmt::Arguments) {
        say::<Self>(cause);
    }
    /// Sends bytes past any queue.
    fn write(bytes: &[u8]);
    /// From here on it only waits: nothing feeds a watchdog.
    fn begin_to_wait() {}
    /// A byte straight from the receiver.
    fn poll() -> Option<u8>;
    /// Starts again, because the user has asked for it.
    fn reset() -> !;
}

/// Stands for the address of a fault for which the stack had no place left.
pub const STACK_USED_UP: u32 = u32::MAX;

/// A second fault while the first is reported ends the report. Read and written with interrupts off.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// What a panic comes to. `cause` says where it came from: the `PanicInfo` itself, or less where
/// the flash has no room for its text.
pub fn panic<F: Fault>(cause: impl fmt::Display) -> ! {
    if begin_report::<F>() {
        defmt::error!("{}", defmt::Display2Format(&cause));
        F::report(format_args!("{cause}"));
    }
    wait_for_reset::<F>()
}

/// What a fault at this address comes to, or at [`STACK_USED_UP`].
pub fn hard_fault<F: Fault>(address: u32) -> ! {
    if begin_report::<F>() {
        if address == STACK_USED_UP {
            defmt::error!("the stack is used up");
            F::report(format_args!("the stack is used up"));
        } else {
            defmt::error!("hard fault at {=u32:#010x}", address);
            F::report(format_args!("hard fault at {address:#010x}"));
        }
    }
    wait_for_reset::<F>()
}

/// Makes the machine safe. Whether there is something to report: not while another fault is
/// reported.
fn begin_report<F: Fault>() -> bool {
    F::make_safe();
    if REPORTING.load(Ordering::Relaxed) {
        return false;
    }
    REPORTING.store(true, Ordering::Relaxed);
    true
}

/// Says the cause on the serial line.
pub fn say<F: Fault + ?Sized>(cause: fmt::Arguments) {
    F::write(b"\r\n");
    // Fails never: `OneLine` takes every byte.
    let _ = write!(OneLine(F::write), "[MSG:stopped by a fault, ctrl-X resets: {cause}]");
    F::write(b"\r\n");
}

fn wait_for_reset<F: Fault>() -> ! {
    F::begin_to_wait();
    while F::poll() != Some(line::ABORT) {}
    F::reset()
}

/// Writes to the serial line, with line ends as spaces.
struct OneLine(fn(&[u8]));

impl Write for OneLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            let byte = if byte == b'\n' || byte == b'\r' { b' ' } else { byte };
            (self.0)(&[byte]);
        }
        Ok(())
    }
}
