//! Handling of panics and faults: the machine is made safe at once, and the cause is reported.
//!
//! Each board chooses how the cause is reported ([`Fault::report`]). By default the board writes
//! the cause to its serial line and waits for ctrl-X, which resets it. A board that can keep the
//! cause through a reset restarts by itself and reports the cause afterwards.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use super::line;

/// What a board does after a panic or a fault. No interrupt handler runs any more.
pub trait Fault {
    /// Disables interrupts and steps, raises the pen and switches the drivers off.
    fn make_safe();
    /// Reports the cause, or restarts the board, which then reports it.
    fn report(cause: fmt::Arguments) {
        say::<Self>(cause);
    }
    /// Sends bytes directly, without any queue.
    fn write(bytes: &[u8]);
    /// Prepares for waiting: from now on nothing feeds a watchdog.
    fn begin_to_wait() {}
    /// Reads a byte directly from the receiver, if there is one.
    fn poll() -> Option<u8>;
    /// Restarts the board because the user has asked for it.
    fn reset() -> !;
}

/// Used in place of the address of a fault if the stack had no room left for it.
pub const STACK_USED_UP: u32 = u32::MAX;

/// Whether a fault is being reported. A second fault during a report ends the report. It is read
/// and written with interrupts off.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// Handles a panic. `cause` is the `PanicInfo` itself, or something shorter where the flash has no
/// room for its text.
pub fn panic<F: Fault>(cause: impl fmt::Display) -> ! {
    if begin_report::<F>() {
        defmt::error!("{}", defmt::Display2Format(&cause));
        F::report(format_args!("{cause}"));
    }
    wait_for_reset::<F>()
}

/// Handles a fault at `address`, or at [`STACK_USED_UP`].
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

/// Makes the machine safe. Returns whether the fault is to be reported, which is not so while
/// another fault is being reported.
fn begin_report<F: Fault>() -> bool {
    F::make_safe();
    if REPORTING.load(Ordering::Relaxed) {
        return false;
    }
    REPORTING.store(true, Ordering::Relaxed);
    true
}

/// Writes the cause to the serial line.
pub fn say<F: Fault + ?Sized>(cause: fmt::Arguments) {
    F::write(b"\r\n");
    // This never fails, because `OneLine` accepts every byte.
    let _ = write!(OneLine(F::write), "[MSG:stopped by a fault, ctrl-X resets: {cause}]");
    F::write(b"\r\n");
}

fn wait_for_reset<F: Fault>() -> ! {
    F::begin_to_wait();
    while F::poll() != Some(line::ABORT) {}
    F::reset()
}

/// Writes to the serial line and replaces line ends by spaces.
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
