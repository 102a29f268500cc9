//! The ranks of the interrupts, and a critical section that the steps do not wait for.
//!
//! A Cortex-M0+ can mask all interrupts at once or each by itself. Sections mask all but the next block of steps
//! one by one: some, of the USB driver, last longer than the state machine's queue. What shares data
//! with that interrupt masks it too, by [`with_steps_masked`], and briefly: the queue holds 8 words, 8 µs at the greatest
//! rate.
//!
//! The code runs from flash behind a cache, and 50 cycles go by for each 8 bytes that are not in
//! it. 8 µs hold 20 of these misses. So the handler of the steps, all that it calls, reads and is
//! called by way of, and what runs while it is masked, lie in RAM: functions by
//! `#[unsafe(link_section = ".data.in_ram")]`. `cargo xtask build` checks it on the image.

use core::sync::atomic::{AtomicU32, Ordering, fence};

use cortex_m::peripheral::NVIC;
use rp2040_hal::pac::Interrupt;

use super::registers::SYSTEM;

/// The chip tells four ranks by the upper two bits.
const fn priority(number: u8) -> u8 {
    number << 6
}

/// The next block of steps.
pub const STEP_PRIORITY: u8 = priority(0);
/// The pen's heights, which come in with the steps.
pub const PEN_PRIORITY: u8 = priority(1);
/// Bytes of the serial line.
pub const SERIAL_PRIORITY: u8 = priority(2);
/// The clock's millisecond.
pub const CLOCK_PRIORITY: u8 = priority(3);

/// Registers of the interrupts' masks: those that are enabled, by a write too; a write to the other disables.
const ENABLED: usize = 0x100;
const MASK: usize = 0x180;

/// Ranks and unmasks an interrupt, at set-up.
pub fn enable(nvic: &mut NVIC, interrupt: Interrupt, priority: u8) {
    // SAFETY: no critical section is held at set-up that this could break.
    unsafe {
        nvic.set_priority(interrupt, priority);
        NVIC::unmask(interrupt);
    }
}

/// Carries `work` out with every interrupt masked, that of the steps too. The caller lies in RAM,
/// with all that `work` calls.
#[inline(always)]
pub fn with_steps_masked<T>(work: impl FnOnce() -> T) -> T {
    cortex_m::interrupt::free(|_| work())
}

/// Carries `work` out with the interrupt of the pen's heights masked. Not in a critical section,
/// which it would break.
pub fn with_pen_masked<T>(work: impl FnOnce() -> T) -> T {
    NVIC::mask(Interrupt::PIO0_IRQ_0);
    // So that it does not come any more.
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    let done = work();
    // SAFETY: it was unmasked at set-up, before there was a pen to move.
    unsafe { NVIC::unmask(Interrupt::PIO0_IRQ_0) };
    done
}

/// As many as a Cortex-M0+ has.
const VECTORS: usize = 16 + 32;

/// The vectors of the exceptions, as they are in flash. The core reads one on each interrupt.
#[repr(align(256))] // The core ignores the lower bits of its address.
struct Vectors([AtomicU32; VECTORS]);

static IN_RAM: Vectors = Vectors([const { AtomicU32::new(0) }; VECTORS]);

/// Lets the core read the vectors from RAM. Called at set-up, before any interrupt is unmasked.
pub fn move_vectors_to_ram() {
    const VECTOR_TABLE: usize = 0xD08;
    unsafe extern "C" {
        static __vector_table: [u32; VECTORS];
    }
    // SAFETY: the linker puts the table of so many vectors there (`cortex-m-rt`), and nothing
    // writes flash now.
    let in_flash = unsafe { &__vector_table };
    for (place, vector) in IN_RAM.0.iter().zip(in_flash) {
        place.store(*vector, Ordering::Relaxed);
    }
    // They are there before the core may look.
    fence(Ordering::SeqCst);
    SYSTEM.write(VECTOR_TABLE, IN_RAM.0.as_ptr() as u32);
    cortex_m::asm::dsb();
}

/// Every interrupt but that of the next block of steps.
const OTHERS: u32 = !(1 << Interrupt::DMA_IRQ_0 as u32);

/// Those that the outermost section has masked.
static MASKED: AtomicU32 = AtomicU32::new(0);

struct MaskAllButSteps;
critical_section::set_impl!(MaskAllButSteps);

// SAFETY: one core runs, and `acquire` masks each of its interrupts but one until the outermost
// `release`. The handler of that one takes no critical section, logs nothing, and shares only atomics.
unsafe impl critical_section::Impl for MaskAllButSteps {
    unsafe fn acquire() -> critical_section::RawRestoreState {
        // A handler that comes in between leaves the set as it was.
        let set = SYSTEM.read(ENABLED) & OTHERS;
        SYSTEM.write(MASK, OTHERS);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        if set != 0 {
            MASKED.store(set, Ordering::Relaxed);
        }
        u8::from(set != 0)
    }

    unsafe fn release(outermost: critical_section::RawRestoreState) {
        if outermost != 0 {
            // What the section did must be done before a handler looks.
            core::sync::atomic::compiler_fence(Ordering::SeqCst);
            SYSTEM.write(ENABLED, MASKED.load(Ordering::Relaxed));
        }
    }
}
