//! The chip's registers.

use core::ptr;

/// The registers of one peripheral.
#[derive(Clone, Copy)]
pub struct Peripheral {
    base: usize,
}

impl Peripheral {
    /// # Safety
    /// A peripheral of the chip begins at `base`, and its registers within 4 KiB may be read and
    /// written at any time by the code that has it.
    const unsafe fn at(base: usize) -> Self {
        Self { base }
    }

    /// Reads the register at `offset` bytes, a multiple of 4 below 4096.
    pub fn read(self, offset: usize) -> u32 {
        // SAFETY: within a peripheral (see `at`), aligned.
        unsafe { ptr::read_volatile((self.base + offset) as *const u32) }
    }

    /// Writes the register at `offset` bytes, a multiple of 4 below 4096.
    pub fn write(self, offset: usize, value: u32) {
        // SAFETY: within a peripheral (see `at`), aligned.
        unsafe { ptr::write_volatile((self.base + offset) as *mut u32, value) }
    }

    /// Sets `bits` of the register at `offset`. Not for a register that an interrupt changes too.
    pub fn set_bits(self, offset: usize, bits: u32) {
        self.write(offset, self.read(offset) | bits);
    }
}

// SAFETY of all: the memory map of the LM3S6965's data sheet, table 3-1; none reaches into memory.

/// System control: clocks. Used by `clock`, `pins`, `serial` and `steps` before interrupts are on.
pub const SYSTEM_CONTROL: Peripheral = unsafe { Peripheral::at(0x400F_E000) };
/// Port A, whose pins 0 and 1 are the serial line. Used by `serial`.
pub const GPIO_A: Peripheral = unsafe { Peripheral::at(0x4000_4000) };
/// Port B, the machine's pins. Used by `pins`.
pub const GPIO_B: Peripheral = unsafe { Peripheral::at(0x4000_5000) };
/// Port C, the contacts. Used by `contacts`.
pub const GPIO_C: Peripheral = unsafe { Peripheral::at(0x4000_6000) };
/// The serial line. Used by `serial`.
pub const UART0: Peripheral = unsafe { Peripheral::at(0x4000_C000) };
/// The step timer. Used by `steps`.
pub const TIMER0: Peripheral = unsafe { Peripheral::at(0x4003_0000) };
