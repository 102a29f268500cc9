//! The priorities of the interrupts, and a critical section that does not delay the steps.
//!
//! A Cortex-M0+ can mask all interrupts at once or each one separately. Critical sections mask all
//! interrupts separately except two. That for the next block of steps must come, because some
//! sections, those of the USB driver, last longer than the queue of the state machine; so must that
//! for the pen's height, because a step of its motor would be lost if the next one came meanwhile.
//! Code that shares data with the first masks it too, by [`with_steps_masked`], and only briefly:
//! the queue holds 8 words, which last 8 µs at the greatest rate. Code that shares data with the
//! other masks it by [`with_pen_masked`].
//!
//! The code runs from flash behind a cache, and each 8 bytes that are not in the cache cost 50
//! cycles. 20 of these misses take 8 µs. So the handler of the steps, everything that it calls or
//! reads, whatever leads to its call, and everything that runs while it is masked are in RAM:
//! functions by `#[unsafe(link_section = ".data.in_ram")]`. `cargo xtask build` checks this on the
//! image.

use core::sync::atomic::{AtomicU32, Ordering, fence};

use cortex_m::peripheral::NVIC;
use rp2040_hal::pac::Interrupt;

use super::registers::{Get, PPB, Put};

/// Converts a priority from 0 (highest) to 3 to the form in which the chip takes it: in the upper
/// two bits.
const fn priority(number: u8) -> u8 {
    number << 6
}

/// The priority of the interrupt that hands over the next block of steps.
pub const STEP_PRIORITY: u8 = priority(0);
/// The priority of the interrupt that moves the pen to the height due.
pub const PEN_PRIORITY: u8 = priority(1);
/// The priority of the serial lines.
pub const SERIAL_PRIORITY: u8 = priority(2);
/// The priority of the millisecond interrupt.
pub const CLOCK_PRIORITY: u8 = priority(3);

/// Sets the priority of an interrupt and unmasks it, during set-up.
pub fn enable(nvic: &mut NVIC, interrupt: Interrupt, priority: u8) {
    // SAFETY: no critical section is held at set-up that this could break.
    unsafe {
        nvic.set_priority(interrupt, priority);
        NVIC::unmask(interrupt);
    }
}

/// Runs `work` with every interrupt masked, including that of the steps. The caller must be in RAM,
/// with everything that `work` calls.
#[inline(always)]
pub fn with_steps_masked<T>(work: impl FnOnce() -> T) -> T {
    cortex_m::interrupt::free(|_| work())
}

/// Runs `work` with the interrupt of the pen's heights masked. It must not be called within itself,
/// because the inner call would unmask the interrupt.
pub fn with_pen_masked<T>(work: impl FnOnce() -> T) -> T {
    NVIC::mask(Interrupt::PIO0_IRQ_0);
    // These barriers ensure that the interrupt does not come any more.
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    let done = work();
    // SAFETY: it was unmasked at set-up, before there was a pen to move.
    unsafe { NVIC::unmask(Interrupt::PIO0_IRQ_0) };
    done
}

/// The number of vectors of a Cortex-M0+.
const VECTORS: usize = 16 + 32;

/// A copy of the exception vectors in flash. The core reads one of them on each interrupt.
#[repr(align(256))] // The core ignores the lower bits of its address.
struct Vectors([AtomicU32; VECTORS]);

/// The copy of the exception vectors, which the core reads once [`move_vectors_to_ram`] was called.
static IN_RAM: Vectors = Vectors([const { AtomicU32::new(0) }; VECTORS]);

/// Makes the core read the vectors from RAM. It is called during set-up, before any interrupt is
/// unmasked.
pub fn move_vectors_to_ram() {
    // SAFETY: `cortex-m-rt` defines this symbol, as an array of at least so many words.
    unsafe extern "C" {
        static __vector_table: [u32; VECTORS];
    }
    // SAFETY: the linker puts the table of this many vectors there (`cortex-m-rt`), and nothing
    // writes flash now.
    let in_flash = unsafe { &__vector_table };
    for (slot, vector) in IN_RAM.0.iter().zip(in_flash) {
        slot.store(*vector, Ordering::Relaxed);
    }
    // The vectors must be in RAM before the core may read them.
    fence(Ordering::SeqCst);
    // SAFETY: the table in RAM holds the same vectors, and stays there.
    unsafe { PPB.registers() }.vtor().put(IN_RAM.0.as_ptr() as u32);
    cortex_m::asm::dsb();
}

/// The mask of every interrupt except those for the next block of steps and for the pen's height.
const OTHERS: u32 = !(1 << Interrupt::DMA_IRQ_0 as u32 | 1 << Interrupt::PIO0_IRQ_0 as u32);

/// The interrupts that the outermost critical section has masked.
static MASKED: AtomicU32 = AtomicU32::new(0);

/// The critical section of this board. It masks every interrupt except those that move something.
struct MaskAllButSteps;
critical_section::set_impl!(MaskAllButSteps);

// SAFETY: one core runs, and `acquire` masks each of its interrupts but two until the outermost
// `release`. The handlers of these take no critical section, log nothing, and share only atomics
// that they load and store.
unsafe impl critical_section::Impl for MaskAllButSteps {
    unsafe fn acquire() -> critical_section::RawRestoreState {
        // A handler that runs in between leaves the set as it was.
        // SAFETY: it masks interrupts, and so never makes anything run.
        let ppb = unsafe { PPB.registers() };
        let set = ppb.nvic_iser().get() & OTHERS;
        ppb.nvic_icer().put(OTHERS);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        if set != 0 {
            MASKED.store(set, Ordering::Relaxed);
        }
        u8::from(set != 0)
    }

    // SAFETY: called in pairs with `acquire`, as the trait demands, it unmasks what that masked.
    unsafe fn release(outermost: critical_section::RawRestoreState) {
        if outermost != 0 {
            // The work of the section must be finished before a handler runs.
            core::sync::atomic::compiler_fence(Ordering::SeqCst);
            // SAFETY: it lets the interrupts come again that `acquire` masked.
            unsafe { PPB.registers() }.nvic_iser().put(MASKED.load(Ordering::Relaxed));
        }
    }
}
