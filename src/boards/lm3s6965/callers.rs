//! Reports by addresses where a panic came from.
//!
//! The text of a panic costs some 19 KiB of flash: messages, file names, line numbers, and the code
//! that passes them on. The compiler omits all of that if the panic handler does not read it. What
//! remains is the chain of calls on the stack. This command turns its addresses into functions and
//! lines: `addr2line -f -i -e target/firmware/lm3s6965.elf ADDRESS …`.

use core::{arch, fmt};

/// The greatest number of calls that are reported, from the innermost outward.
const MOST: usize = 12;

/// The data that every function that calls another one pushes on entry, on this target, before it
/// points register 7 at it.
#[derive(Clone, Copy)]
#[repr(C)]
struct Frame {
    /// The address in the stack at which the frame of the calling function begins.
    caller: usize,
    /// The address at which the caller continues, with bit 0 set.
    return_address: usize,
}

/// The chain of calls that led to the creation of this value.
#[derive(Clone, Copy)]
pub struct Callers {
    /// The address in the stack at which the frame of the innermost function begins.
    innermost: usize,
    /// The address at which the stack starts; it grows down from there.
    stack_start: usize,
}

impl Callers {
    /// The callers of the function that calls this one. The stack grows down from `stack_start`.
    #[inline(always)] // So that register 7 is the caller's.
    pub fn new(stack_start: usize) -> Self {
        let innermost;
        // SAFETY: it copies a register and touches nothing else.
        unsafe {
            arch::asm!("mov {}, r7", out(reg) innermost, options(nomem, nostack, preserves_flags));
        }
        Self { innermost, stack_start }
    }
}

impl fmt::Display for Callers {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("panic, called from")?;
        let mut at = self.innermost;
        for _ in 0..MOST {
            if !at.is_multiple_of(4) || at > self.stack_start - size_of::<Frame>() {
                break;
            }
            // SAFETY: the address lies on the stack and is aligned. The first frame is the running
            // function's, and each further one lies above the one before and below the start of the
            // stack. Nobody writes it now.
            let frame = unsafe { *(at as *const Frame) };
            // This address is within the call instruction.
            write!(formatter, " {:#x}", (frame.return_address & !1).wrapping_sub(2))?;
            if frame.caller <= at {
                break;
            }
            at = frame.caller;
        }
        Ok(())
    }
}
