//! The cache between the RP2040's core and its flash, as a count of the cycles for which the core
//! waits.
//!
//! The data sheet (2.6.3) gives 16 KiB in two ways of lines of 8 bytes, and one cycle for a hit. It
//! does not say which way is replaced; here it is the one that was used longest ago.
//!
//! A miss is a transfer by the SSI as the second boot stage sets it up (`boot2_w25q080.S`): quad,
//! in continuous read mode, at half of the core's clock (the crate `rp2040-boot2` is assembled with
//! `PICO_FLASH_SPI_CLKDIV=2`). It sends no command, 8 clocks of address and mode bits and 4 of
//! waiting, and reads a 32-bit word in 8 clocks: 20 clocks, which are 40 cycles. With the way
//! through the bus, the SSI's FIFOs and the chip select some 50 are waited; users have measured 400
//! ns, which is as much. The rest of the line comes with it here.
//!
//! The core fetches one word ahead of what it executes. A line that is fetched ahead of a branch
//! and then not needed is not counted.
//!
//! While the voltage falls or rises, flash may return garbage. A line that was fetched then stays
//! garbage in the cache: reading it again does not ask the flash again.

use crate::chip::Shared;

/// The number of cycles that the core waits on a miss.
pub const MISS_CYCLES: u32 = 50;
const SETS: usize = 1024;
/// The mask of the numbers of lines in the 24-bit address space.
const LINES: u32 = 0x1f_ffff;
/// The number of no line.
const NONE: u32 = u32::MAX;
/// An address that is further from every address in flash than a line is long.
const NOWHERE: u32 = 0;
/// The value that [`Shared::garbage_after`] has if flash returns no garbage.
const NEVER: u32 = u32::MAX;
/// What garbage differs in from what the flash holds.
const GARBAGE: u32 = 0xa5c3_96f0;

/// Whether an address lies in flash, through the cache or one of its three other windows.
pub const fn is_flash(address: u32) -> bool {
    address >> 26 == 0x1000_0000 >> 26
}

/// Which lines of flash the cache holds.
#[derive(Debug)]
pub struct Cache {
    /// The numbers of the lines that are held: two ways of each set.
    held: [[u32; 2]; SETS],
    /// Of each set, the way that was used longest ago.
    oldest: [u8; SETS],
    /// The line that was fetched as garbage, as long as it is held.
    garbled: u32,
}

impl Default for Cache {
    fn default() -> Self {
        Self { held: [[NONE; 2]; SETS], oldest: [0; SETS], garbled: NONE }
    }
}

impl Cache {
    /// Forgets everything, as `flash_flush_cache` of the boot ROM does.
    pub fn flush(&mut self, shared: &mut Shared) {
        self.held = [[NONE; 2]; SETS];
        self.garbled = NONE;
        shared.line = NOWHERE;
    }

    /// Reads flash at an address, which may have to be waited for. Returns whether garbage is read.
    #[inline(always)]
    pub fn read(&mut self, shared: &mut Shared, address: u32) -> bool {
        // 0x12 and 0x13 do not look into the cache; 0x11 and 0x13 leave it as it is.
        let looks = address >> 24 & 2 == 0;
        let line = address >> 3 & LINES;
        let set = line as usize & (SETS - 1);
        if looks {
            let [first, second] = self.held[set];
            if first == line {
                self.oldest[set] = 1;
                return self.garbled == line;
            }
            if second == line {
                self.oldest[set] = 0;
                return self.garbled == line;
            }
        }
        self.miss(shared, address, line, set)
    }

    /// Reads a line that is not held, or not looked for.
    #[inline(never)]
    fn miss(&mut self, shared: &mut Shared, address: u32, line: u32, set: usize) -> bool {
        let fills = address >> 24 & 1 == 0;
        shared.stalled += MISS_CYCLES;
        let is_garbage = comes_as_garbage(shared, address);
        if !fills {
            return is_garbage;
        }
        let way = usize::from(self.oldest[set] & 1);
        let replaced = self.held[set][way];
        if replaced == self.garbled {
            self.garbled = NONE;
        }
        if is_garbage {
            self.garbled = line;
        }
        if replaced == shared.line >> 3 & LINES {
            shared.line = NOWHERE;
        }
        self.held[set][way] = line;
        self.oldest[set] = way as u8 ^ 1;
        is_garbage
    }

    /// Fetches the instruction at an address, whose first half word is `first`. Need not be called
    /// for the first three half words of [`Shared::line`]: they are held, and are too far from its
    /// end for an instruction of two half words to cross it.
    #[inline(always)]
    pub fn fetch(&mut self, shared: &mut Shared, address: u32, first: u16) {
        if !is_flash(address) {
            return;
        }
        self.read(shared, address);
        let is_last = address & 6 == 6;
        if is_last && first >> 11 >= 0b11101 {
            self.read(shared, address.wrapping_add(2));
        }
        if address >> 24 == 0x10 {
            shared.line = address & !7;
        }
    }

    /// Reads data at an address. Returns what garbage makes of them, as bits that are inverted.
    /// Instructions come this way, too, and have been counted.
    #[inline(always)]
    pub fn data(&mut self, shared: &mut Shared, address: u32) -> u32 {
        if address.wrapping_sub(shared.line) < 8 || !is_flash(address) {
            return 0;
        }
        if self.read(shared, address) { GARBAGE >> (8 * (address & 3)) } else { 0 }
    }
}

/// Whether the flash, which is asked now, returns garbage.
fn comes_as_garbage(shared: &mut Shared, address: u32) -> bool {
    if address & 0xff_ffff < shared.garbage_from {
        return false;
    }
    shared.reads += 1;
    match shared.garbage_after {
        NEVER => return false,
        0 => shared.garbage_after = NEVER,
        after => {
            shared.garbage_after = after - 1;
            return false;
        }
    }
    shared.has_garbled = 1;
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the cycles that each of these takes.
    fn waits(does: &[fn(&mut Cache, &mut Shared)]) -> Vec<u32> {
        let (mut cache, mut shared) = (Cache::default(), Shared::default());
        shared.garbage_after = NEVER;
        let mut wait = |does: &fn(&mut Cache, &mut Shared)| {
            shared.stalled = 0;
            does(&mut cache, &mut shared);
            shared.stalled
        };
        does.iter().map(&mut wait).collect()
    }

    /// Returns the cycles that reading each of these addresses takes.
    fn reads(addresses: &[u32]) -> Vec<u32> {
        let (mut cache, mut shared) = (Cache::default(), Shared::default());
        let mut wait = |&address: &u32| {
            shared.stalled = 0;
            cache.read(&mut shared, address);
            shared.stalled
        };
        addresses.iter().map(&mut wait).collect()
    }

    #[test]
    fn lines_are_held_in_two_ways_until_flushed() {
        // A line of 8 bytes.
        assert_eq!(reads(&[0x1000_0000, 0x1000_0004, 0x1000_0007, 0x1000_0008]), [50, 0, 0, 50]);
        // 8 KiB further lies the same set: the third drives out what was used longest ago.
        let three = [0x1000_0000, 0x1000_2000, 0x1000_0000, 0x1000_4000, 0x1000_0000, 0x1000_2000];
        assert_eq!(reads(&three), [50, 50, 0, 50, 0, 50]);
        let flushed = waits(&[
            |cache, shared| _ = cache.read(shared, 0x1000_0000),
            |cache, shared| cache.flush(shared),
            |cache, shared| _ = cache.read(shared, 0x1000_0000),
        ]);
        assert_eq!(flushed, [50, 0, 50]);
    }

    #[test]
    fn the_other_aliases_look_and_fill_as_the_data_sheet_says() {
        // 0x11: looks, does not fill; 0x12: does not look, fills; 0x13: neither.
        assert_eq!(reads(&[0x1100_0000, 0x1000_0000, 0x1100_0000]), [50, 50, 0]);
        assert_eq!(reads(&[0x1200_0000, 0x1200_0000, 0x1000_0000]), [50, 50, 0]);
        assert_eq!(reads(&[0x1300_0000, 0x1000_0000, 0x1300_0000]), [50, 50, 50]);
    }

    #[test]
    fn code_waits_for_flash_alone_and_for_both_lines_of_a_long_instruction() {
        let short = waits(&[
            |cache, shared| cache.fetch(shared, 0x2000_0000, 0),
            |cache, shared| cache.fetch(shared, 0x0000_0100, 0),
            |cache, shared| cache.fetch(shared, 0x1000_0006, 0),
        ]);
        assert_eq!(short, [0, 0, 50]);
        let long = waits(&[
            |cache, shared| cache.fetch(shared, 0x1000_0006, 0xf000),
            |cache, shared| cache.fetch(shared, 0x1000_0008, 0),
        ]);
        assert_eq!(long, [100, 0]);
    }

    #[test]
    fn garbage_comes_once_and_stays_in_the_cache_until_its_line_is_replaced() {
        let (mut cache, mut shared) = (Cache::default(), Shared::default());
        (shared.garbage_from, shared.garbage_after) = (0x1000, 1);
        assert_eq!(cache.data(&mut shared, 0x1000_0ff8), 0);
        assert_eq!((shared.reads, cache.data(&mut shared, 0x1000_1000)), (0, 0));
        assert_eq!((shared.reads, cache.data(&mut shared, 0x1000_1008)), (1, GARBAGE));
        assert_eq!((shared.reads, shared.has_garbled), (2, 1));
        assert_eq!(cache.data(&mut shared, 0x1000_1009), GARBAGE >> 8);
        assert_eq!(shared.reads, 2);
        for replacing in [0x1000_3008, 0x1000_5008] {
            assert_eq!(cache.data(&mut shared, replacing), 0);
        }
        assert_eq!(cache.data(&mut shared, 0x1000_1008), 0);
        assert_eq!(shared.garbage_after, NEVER);
    }
}
