//! Access to the registers of a chip's peripherals.

use core::ptr;

/// Where a register lies within its peripheral: a multiple of 4 bytes below 4096, which is as far
/// as the registers of every peripheral reach.
#[derive(Clone, Copy)]
pub struct Offset(usize);

impl Offset {
    /// The register at `bytes` behind the first one. An offset that no register has does not
    /// compile.
    pub const fn new(bytes: usize) -> Self {
        assert!(bytes < 4096 && bytes.is_multiple_of(4), "no register has this offset");
        Self(bytes)
    }

    /// The word of this number, counted from the first one. A peripheral has 1024 of them.
    #[cfg_attr(not(feature = "pico"), expect(dead_code, reason = "the memory of one chip"))]
    pub const fn of_word(number: usize) -> Self {
        Self(number % 1024 * 4)
    }

    /// The data register of a port for these of its eight pins: reading gives the levels of these
    /// pins, and writing changes no other ones. Bits 2 to 9 of its address are the pins.
    #[cfg_attr(not(feature = "lm3s6965"), expect(dead_code, reason = "the ports of one chip"))]
    pub const fn of_pins(pins: u8) -> Self {
        Self((pins as usize) << 2)
    }
}

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
    /// A peripheral of the chip begins at `base`, and its registers within 4 KiB may be read and
    /// written at any time by the code that has it. None of them makes the chip read or write
    /// memory.
    pub const unsafe fn at(base: usize) -> Self {
        Self { base }
    }

    /// The address of the register at `offset`, for a DMA channel.
    pub const fn address(self, offset: Offset) -> u32 {
        (self.base + offset.0) as u32
    }

    /// Reads the register at `offset`.
    #[inline(always)]
    pub fn read(self, offset: Offset) -> u32 {
        // SAFETY: within a peripheral (see `at`), and aligned (see `Offset`).
        unsafe { ptr::read_volatile((self.base + offset.0) as *const u32) }
    }

    /// Writes the register at `offset`.
    #[inline(always)]
    pub fn write(self, offset: Offset, value: u32) {
        // SAFETY: within a peripheral (see `at`), and aligned (see `Offset`).
        unsafe { ptr::write_volatile((self.base + offset.0) as *mut u32, value) }
    }

    /// Sets `bits` of the register at `offset`. Do not use it for a register that an interrupt
    /// changes too.
    pub fn set_bits(self, offset: Offset, bits: u32) {
        self.write(offset, self.read(offset) | bits);
    }
}
