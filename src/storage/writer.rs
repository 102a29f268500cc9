//! Writes a new state of a record.

use super::{MARK, PAGE_BYTES, Slots, StorageError, put_words, total};
use crate::checksum::Crc32;
use embedded_storage::nor_flash::NorFlash;

/// Writes a new state. If it is dropped before [`Writer::finish`], the previous state remains the
/// latest.
pub struct Writer<'f, F> {
    /// The flash to which the state is written.
    flash: &'f mut F,
    /// The two slots of the record, which say how long a slot is.
    slots: Slots,
    /// The offset in flash of the slot that is being written, in bytes.
    start: u32,
    /// The number that the state gets, one higher than that of the latest state.
    sequence: u32,
    /// The number of bytes of the state that were handed in so far; the last of them may still be
    /// in `page`.
    length: u32,
    /// Number of bytes that are erased, from the slot's beginning on.
    erased: u32,
    /// The page of the payload that is being filled. It is written when it is full.
    page: [u8; PAGE_BYTES],
    /// The checksum of the payload so far.
    digest: Crc32,
}

impl<F> core::fmt::Debug for Writer<'_, F> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("Writer").field("length", &self.length).finish_non_exhaustive()
    }
}

impl<'f, F: NorFlash> Writer<'f, F> {
    /// Begins to write a state with this number into the slot that begins at `start`, of which this
    /// many bytes are erased already.
    ///
    /// # Errors
    /// The error of the flash; the latest state is unchanged.
    pub(super) fn begin(
        flash: &'f mut F,
        slots: Slots,
        start: u32,
        sequence: u32,
        erased: u32,
    ) -> Result<Self, StorageError<F::Error>> {
        let (page, digest) = ([0xFF; PAGE_BYTES], Crc32::new());
        let mut writer = Self { flash, slots, start, sequence, length: 0, erased, page, digest };
        writer.erase_up_to(F::ERASE_SIZE as u32)?;
        Ok(writer)
    }

    /// Writes the next bytes of the new state.
    ///
    /// # Errors
    /// See [`StorageError`]; the latest state is still the previous one.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), StorageError<F::Error>> {
        for &byte in bytes {
            let slot = self.length as usize % PAGE_BYTES;
            self.page[slot] = byte;
            self.length += 1;
            if slot + 1 == PAGE_BYTES {
                self.put_page()?;
            }
        }
        self.digest.update(bytes);
        Ok(())
    }

    /// Leaves room behind the state for so many bytes that will be [added](Slots::add) to it:
    /// erases it. Call it when all of the state is written, before [`Writer::finish`].
    ///
    /// # Errors
    /// See [`StorageError`]; the latest state is still the previous one.
    #[cfg(feature = "early-ink")]
    pub fn leave_room(&mut self, bytes: u32) -> Result<(), StorageError<F::Error>> {
        const PAGE: u32 = PAGE_BYTES as u32;
        // The pages of both headers come before each payload.
        let pages = 2 + self.length.div_ceil(PAGE) + bytes.div_ceil(PAGE);
        if pages * PAGE > self.slots.bytes {
            return Err(StorageError::TooLong);
        }
        self.erase_up_to(pages * PAGE)
    }

    /// Completes the new state and makes it the latest one.
    ///
    /// # Errors
    /// See [`StorageError`]; the latest state is still the previous one.
    pub fn finish(mut self) -> Result<(), StorageError<F::Error>> {
        if !(self.length as usize).is_multiple_of(PAGE_BYTES) {
            self.put_page()?;
        }
        let sum = total(self.digest, self.sequence, self.length);
        let mut header = [0xFF; PAGE_BYTES];
        put_words(&mut header, [MARK, self.sequence, self.length, sum]);
        self.flash.write(self.start, &header).map_err(|error| {
            // Although the write failed, the header itself may be complete. Erasing the slot makes
            // sure that it is not valid. An error of that changes nothing any more.
            let _ = self.flash.erase(self.start, self.start + F::ERASE_SIZE as u32);
            StorageError::Flash(error)
        })
    }

    /// Writes the page of the payload that is full, or the last one, to the flash.
    fn put_page(&mut self) -> Result<(), StorageError<F::Error>> {
        // The payload's pages follow the header's.
        let page = self.length.div_ceil(PAGE_BYTES as u32);
        let (from, to) = (page * PAGE_BYTES as u32, (page + 1) * PAGE_BYTES as u32);
        if to > self.slots.bytes {
            return Err(StorageError::TooLong);
        }
        self.erase_up_to(to)?;
        self.flash.write(self.start + from, &self.page)?;
        self.page.fill(0xFF);
        Ok(())
    }

    /// Erases the slot up to this offset in it, as far as it is not erased.
    fn erase_up_to(&mut self, to: u32) -> Result<(), StorageError<F::Error>> {
        while to > self.erased {
            let start = self.start + self.erased;
            self.flash.erase(start, start + F::ERASE_SIZE as u32)?;
            self.erased += F::ERASE_SIZE as u32;
        }
        Ok(())
    }
}

#[cfg(all(test, feature = "host"))]
mod tests {
    use super::*;
    use crate::boards::host::CutFlash;
    use std::vec::Vec;

    const SLOTS: Slots = Slots { start: 0, bytes: 8192 };

    #[test]
    fn what_is_finished_is_the_latest_and_each_sector_is_erased_once() {
        let mut flash = CutFlash::new(4 * 4096);
        // With the header's page, a state of 3840 bytes fills a sector.
        for (length, sectors) in [(0, 1), (255, 1), (256, 1), (3840, 1), (3841, 2), (7000, 2)] {
            let before: u32 = flash.erasures.iter().sum();
            let state: Vec<u8> = (0..length).map(|at| (at as u8).wrapping_mul(29)).collect();
            let mut writer = SLOTS.write(&mut flash).unwrap();
            // In pieces that are no pages.
            state.chunks(100).for_each(|piece| writer.write(piece).unwrap());
            writer.finish().unwrap();
            assert_eq!(flash.erasures.iter().sum::<u32>() - before, sectors, "{length}");
            let mut reader = SLOTS.latest(&mut flash).unwrap();
            let mut read = std::vec![0; reader.left()];
            assert_eq!(reader.read(&mut read), length);
            assert_eq!(read, state);
        }
    }
}
