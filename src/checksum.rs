//! The checksums, each defined once: CRC-16 for lines; CRC-32 for models, options and records in
//! flash.

use crc::{CRC_16_IBM_3740, Crc, Table};

/// CRC-16 with the polynomial 0x1021 and the initial value 0xFFFF, also known as
/// CRC-16/CCITT-FALSE. It works without a table, because lines are short.
pub const CRC_16: Crc<u16, Table<0>> = Crc::<u16, Table<0>>::new(&CRC_16_IBM_3740);

/// CRC-32 as in Ethernet and zip files, also known as CRC-32/ISO-HDLC. It is computed from pieces
/// of the bytes, one after the other.
///
/// It takes each byte in two halves, by a table of 64 bytes. The usual table of 1 KiB would halve
/// its time, which matters nowhere: a model that fills the memory of a board takes milliseconds.
///
/// ```
/// use penup::checksum::Crc32;
/// let mut sum = Crc32::new();
/// sum.update(b"1234");
/// sum.update(b"56789");
/// assert_eq!(sum.finalize(), 0xCBF4_3926);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Crc32(u32);

impl Crc32 {
    /// Begins a checksum, of no bytes so far.
    #[expect(clippy::new_without_default, reason = "the checksum of no bytes is no default value")]
    pub const fn new() -> Self {
        Self(!0)
    }

    /// Adds bytes to those of which the checksum is computed.
    #[inline(never)] // Its callers share one copy of the code.
    pub fn update(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 ^= u32::from(*byte);
            self.0 = self.0 >> 4 ^ HALF_BYTES[(self.0 & 15) as usize];
            self.0 = self.0 >> 4 ^ HALF_BYTES[(self.0 & 15) as usize];
        }
    }

    /// Returns the checksum of all bytes that were added.
    pub const fn finalize(self) -> u32 {
        !self.0
    }
}

/// What each value of four bits contributes to a [`Crc32`], computed once when the library is
/// compiled.
static HALF_BYTES: [u32; 16] = {
    let mut table = [0; 16];
    let mut value = 0;
    while value < 16 {
        let (mut rest, mut bit) = (value, 0);
        while bit < 4 {
            // The polynomial, its lowest power in the highest bit.
            rest = if rest & 1 == 1 { rest >> 1 ^ 0xEDB8_8320 } else { rest >> 1 };
            bit += 1;
        }
        table[value as usize] = rest;
        value += 1;
    }
    table
};
