//! Handling of panics and faults: the machine is made safe at once, and the cause is reported.
//!
//! This is the same on every board, and written here only: interrupts off, pen up, drivers off, the
//! message, the restart. A board implements [`Fault`] with what differs. A board that can keep the
//! cause through a reset restarts by itself and reports the cause afterwards; another one writes
//! the cause to the serial line and then restarts. A board that faults again and again soon after
//! its start does not restart by itself: there ctrl-X resets it.

use core::fmt::{self, Write};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use super::ThisBoard;
use super::line;
use super::pl011::Uart;

/// What differs between the boards after a panic or a fault. No interrupt handler runs any more.
pub trait Fault {
    /// The serial line for reports, to which bytes are written directly, without any queue.
    const UART: Uart;

    /// Stops the steps, raises the pen and switches the drivers off.
    fn release();

    /// The cause that is reported for a panic: the `PanicInfo` itself, or something shorter where
    /// the flash has no room for its text. The stack grows down from the address `stack_start`.
    fn cause(info: &PanicInfo, stack_start: usize) -> impl fmt::Display;

    /// Reports the cause and restarts the board, in either order. It returns only if the board must
    /// not be restarted by itself.
    fn report(cause: fmt::Arguments);

    /// Prepares for waiting: from now on nothing feeds a watchdog.
    fn begin_to_wait() {}

    /// Restarts the board because the user has asked for it.
    fn reset() -> !;
}

/// Used in place of the address of a fault if the stack had no room left for it.
const STACK_USED_UP: u32 = u32::MAX;

/// Whether a fault is being reported. A second fault during a report ends the report. It is read
/// and written with interrupts off.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// Called by the compiler's code when the program panics: makes the machine safe and reports the
/// cause.
#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let cause = ThisBoard::cause(info, &raw const _stack_start as usize);
    end(|| {
        defmt::error!("{}", defmt::Display2Format(&cause));
        ThisBoard::report(format_args!("{cause}"));
    })
}

/// The value of what is made once, at the start of the board. If it was made before, which is a
/// programming error, the program ends as by a fault.
#[inline]
pub fn once<T>(made: Option<T>) -> T {
    made.unwrap_or_else(|| stop("a part of the board was set up twice"))
}

/// Makes the machine safe and reports the cause: the board cannot go on.
#[cold]
#[inline(never)]
pub fn stop(cause: &str) -> ! {
    end(|| {
        defmt::error!("{=str}", cause);
        ThisBoard::report(format_args!("{cause}"));
    })
}

// SAFETY: `memory.x` and `cortex-m-rt` define these symbols. Only their addresses are used.
unsafe extern "C" {
    /// Where the stack begins. It grows down from there.
    static _stack_start: u32;
    /// Where the stack ends. Nothing may be pushed below.
    static _stack_end: u32;
}

/// Calls [`hard_fault`] with the address of the fault and a fresh stack. The fault may be a stack
/// overflow, and then nothing can be pushed onto the old stack. The instructions are those of a
/// Cortex-M0+, which larger cores have too.
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
        "ldr r0, [r1, #24]", // the program counter that the core has stored there
        "1: ldr r1, ={start}",
        "msr msp, r1",
        "ldr r1, ={hard_fault}",
        "bx r1",
        end = sym _stack_end,
        start = sym _stack_start,
        hard_fault = sym hard_fault,
    )
}

/// Makes the machine safe after a fault of the core and reports it. `address` is where it happened,
/// or [`STACK_USED_UP`].
extern "C" fn hard_fault(address: u32) -> ! {
    end(|| {
        if address == STACK_USED_UP {
            defmt::error!("the stack is used up");
            ThisBoard::report(format_args!("the stack is used up"));
        } else {
            defmt::error!("hard fault at {=u32:#010x}", address);
            ThisBoard::report(format_args!("hard fault at {address:#010x}"));
        }
    })
}

/// Makes the machine safe, reports the fault unless another one is being reported, and waits for
/// ctrl-X.
fn end(report: impl FnOnce()) -> ! {
    make_safe();
    if !REPORTING.load(Ordering::Relaxed) {
        REPORTING.store(true, Ordering::Relaxed);
        report();
    }
    wait_for_reset()
}

/// Disables interrupts and steps, raises the pen and switches the drivers off.
#[inline(never)]
pub fn make_safe() {
    cortex_m::interrupt::disable();
    ThisBoard::release();
}

/// Says in the report of a fault that the board waits to be restarted.
pub const WAITS: &str = "ctrl-X resets";

/// Reports the cause of a panic or a fault, and what comes `next`, as one line on the serial line.
pub fn say(next: &str, cause: fmt::Arguments) {
    ThisBoard::UART.write(b"\r\n");
    // This never fails, because `OneLine` accepts every byte.
    let _ = write!(OneLine, "[MSG:stopped by a fault, {next}: {cause}]");
    ThisBoard::UART.write(b"\r\n");
}

/// Waits for Ctrl-X at the serial line, then resets the board.
#[inline(never)]
fn wait_for_reset() -> ! {
    ThisBoard::begin_to_wait();
    while ThisBoard::UART.poll().map(|data| data as u8) != Some(line::ABORT) {}
    ThisBoard::reset()
}

/// Writes text to the serial line as one line: line ends become spaces.
struct OneLine;

impl Write for OneLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            let byte = if byte == b'\n' || byte == b'\r' { b' ' } else { byte };
            ThisBoard::UART.write(&[byte]);
        }
        Ok(())
    }
}
