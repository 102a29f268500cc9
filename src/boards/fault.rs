//! A panic or a fault: the machine is made safe, a report goes out on the serial line, then nothing
//! until ctrl-X resets.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use super::line;

/// What a board does then. No handler runs any more.
pub trait Fault {
    /// No interrupt, no step, pen up, drivers off.
    fn make_safe();
    /// Sends bytes past any queue.
    fn write(bytes: &[u8]);
    /// From here on it only waits: nothing feeds a watchdog.
    fn begin_to_wait() {}
    /// A byte straight from the receiver.
    fn poll() -> Option<u8>;
    /// Starts again.
    fn reset() -> !;
}

/// Stands for the address of a fault for which the stack had no place left.
pub const STACK_USED_UP: u32 = u32::MAX;

/// A second fault while the first is reported ends the report. Read and written with interrupts off.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// What a panic comes to. `cause` says where it came from: the `PanicInfo` itself, or less where
/// the flash has no room for its text.
pub fn panic<F: Fault>(cause: impl fmt::Display) -> ! {
    if make_safe::<F>(format_args!("{cause}")) {
        defmt::error!("{}", defmt::Display2Format(&cause));
    }
    wait_for_reset::<F>()
}

/// What a fault at this address comes to, or at [`STACK_USED_UP`].
pub fn hard_fault<F: Fault>(address: u32) -> ! {
    if address == STACK_USED_UP {
        if make_safe::<F>(format_args!("the stack is used up")) {
            defmt::error!("the stack is used up");
        }
    } else if make_safe::<F>(format_args!("hard fault at {address:#010x}")) {
        defmt::error!("hard fault at {=u32:#010x}", address);
    }
    wait_for_reset::<F>()
}

/// Makes the machine safe, then reports `cause` on the serial line. Returns whether to go on
/// reporting.
fn make_safe<F: Fault>(cause: fmt::Arguments) -> bool {
    F::make_safe();
    if REPORTING.load(Ordering::Relaxed) {
        return false;
    }
    REPORTING.store(true, Ordering::Relaxed);
    F::write(b"\r\n");
    // Fails never: `OneLine` takes every byte.
    let _ = write!(OneLine(F::write), "[MSG:stopped by a fault, ctrl-X resets: {cause}]");
    F::write(b"\r\n");
    true
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
