//! Access to the registers of a chip's peripherals.

use core::ptr;

/// The registers of one peripheral of the chip, such as a timer or a port.
#[derive(Clone, Copy)]
pub struct Peripheral {
    /// The address of the peripheral's first register, from which the offsets count.
    base: usize,
}

impl Peripheral {
    /// Gives access to the peripheral whose registers begin at the address `base`.
    ///
    /// # Safety
    /// A peripheral of the chip begins at `base`, and its registers within 16 KiB may be read and
    /// written at any time by the code that has it.
    pub const unsafe fn at(base: usize) -> Self {
        Self { base }
    }

    /// The address of the register at `offset`, for a DMA channel.
    pub const fn address(self, offset: usize) -> u32 {
        (self.base + offset) as u32
    }

    /// Reads the register at `offset` bytes, a multiple of 4 below 16384.
    #[inline(always)]
    pub fn read(self, offset: usize) -> u32 {
        // SAFETY: within a peripheral (see `at`), aligned.
        unsafe { ptr::read_volatile((self.base + offset) as *const u32) }
    }

    /// Writes the register at `offset` bytes, a multiple of 4 below 16384.
    #[inline(always)]
    pub fn write(self, offset: usize, value: u32) {
        // SAFETY: within a peripheral (see `at`), aligned.
        unsafe { ptr::write_volatile((self.base + offset) as *mut u32, value) }
    }

    /// Sets `bits` of the register at `offset`. Do not use it for a register that an interrupt
    /// changes too.
    pub fn set_bits(self, offset: usize, bits: u32) {
        self.write(offset, self.read(offset) | bits);
    }
}
