//! An area of flash that is filled from both ends while its contents arrive, and read as memory.
//!
//! The first page is kept for the record, which says what the area holds and is written last. One
//! kind of contents grows upwards from the second page, the other downwards from the end. While
//! they grow there is no record, so a loss of power at any time leaves an empty area, or the old
//! contents if nothing of the new ones has been written, or all of the new ones.
//!
//! A sector is erased just before the first page of it is written, even if it reads as empty: an
//! erasure during which the power failed may leave cells that are not. A page is written once: what
//! does not fill a page waits in the [`AreaWriter`].
//!
//! The flash is read as words that may change behind the compiler's back ([`AtomicU32`]), in
//! little-endian order.

use super::PAGE_BYTES;
use crate::checksum::Crc32;
use core::sync::atomic::{AtomicU32, Ordering};

/// The unit in which an area is erased, in bytes.
pub const SECTOR_BYTES: usize = 4096;

/// The number of words of a record that its owner may use.
pub const RECORD_WORDS: usize = 58;

/// The number at the beginning of a record, by which one that was written is known.
const MARK: u32 = u32::from_le_bytes(*b"mod1");
/// What an empty word of flash holds.
const EMPTY: u32 = u32::MAX;
/// The number of words of a page.
const PAGE_WORDS: usize = PAGE_BYTES / size_of::<u32>();
/// A record has, beside its owner's words, the mark, the lengths and checksums of both contents,
/// and its own checksum at its end.
const _: () = assert!(RECORD_WORDS + 6 == PAGE_WORDS);

/// The error that the flash does not hold what was written to it, or did not take it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotWritten;

/// What erases and writes an area. It is not called while anything moves.
pub trait AreaFlash {
    /// Erases the sector that begins at this offset in the area, in bytes.
    ///
    /// # Errors
    /// [`NotWritten`] if it is not empty then.
    fn erase_sector(&mut self, at: usize) -> Result<(), NotWritten>;

    /// Writes the page at this offset in the area, in bytes. Bits that are clear stay clear.
    ///
    /// # Errors
    /// [`NotWritten`] if the page does not hold it then.
    fn write_page(&mut self, at: usize, page: &[u8; PAGE_BYTES]) -> Result<(), NotWritten>;
}

/// Which of the two contents of an area.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The contents that grow upwards from the second page.
    Low,
    /// The contents that grow downwards from the end.
    High,
}

/// An area of flash as it is read. Its size is a whole number of sectors.
#[derive(Debug, Clone, Copy)]
pub struct Area<'f>(&'f [AtomicU32]);

/// A record about both contents of an area, with their lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AreaRecord {
    /// The words of the record, which the owner chooses.
    pub words: [u32; RECORD_WORDS],
    /// The lengths of the low and the high contents, in bytes.
    pub lengths: [usize; 2],
    /// Their checksums.
    sums: [u32; 2],
}

impl<'f> Area<'f> {
    /// Makes the area of these words. What is beyond the last whole sector stays unused.
    pub fn new(words: &'f [AtomicU32]) -> Self {
        const SECTOR_WORDS: usize = SECTOR_BYTES / size_of::<u32>();
        let whole = words.len() / SECTOR_WORDS * SECTOR_WORDS;
        Self(words.get(..whole).unwrap_or(&[]))
    }

    /// The size in bytes; 0 if the board has no such area.
    pub fn bytes(self) -> usize {
        size_of_val(self.0)
    }

    /// The word with this index. Words beyond the end count as empty.
    #[inline]
    pub fn word(self, index: usize) -> u32 {
        self.0.get(index).map_or(EMPTY, |word| word.load(Ordering::Relaxed))
    }

    /// The index of the word at which the low contents begin.
    pub const LOW: usize = PAGE_WORDS;

    /// Three bytes of the high contents: those that came this many bytes after the first, in the
    /// order in which they came.
    #[inline]
    pub fn high_3(self, after: usize) -> [u8; 3] {
        // The high contents grow downwards, so the last of the three bytes comes first.
        let Some(at) = self.bytes().checked_sub(after + 3) else { return [0xFF; 3] };
        let (index, shift) = (at / 4, at % 4 * 8);
        let mut bits = self.word(index) >> shift;
        if shift > 8 {
            bits |= self.word(index + 1) << (32 - shift);
        }
        let [third, second, first, _] = bits.to_le_bytes();
        [first, second, third]
    }

    /// The record, if it is complete. This does not check the contents themselves: see
    /// [`Area::is_sound`].
    pub fn record(self) -> Option<AreaRecord> {
        let page = self.first_page();
        // While the voltage rises, flash may return garbage, which is not the same twice.
        let [MARK, low, high, sum_low, sum_high, words @ .., sum] = page else { return None };
        let lengths = [low as usize, high as usize];
        let is_whole = page == self.first_page() && sum == sum_of(&page);
        (is_whole && pages(lengths) < self.bytes() / PAGE_BYTES).then_some(AreaRecord {
            words,
            lengths,
            sums: [sum_low, sum_high],
        })
    }

    /// The words of the first page.
    fn first_page(self) -> [u32; PAGE_WORDS] {
        let mut page = [EMPTY; PAGE_WORDS];
        page.iter_mut().enumerate().for_each(|(index, word)| *word = self.word(index));
        page
    }

    /// Whether both contents are those for which the record was written. `check` is called after
    /// each KiB or so.
    ///
    /// # Errors
    /// That of `check`.
    pub fn is_sound<E>(
        self,
        record: &AreaRecord,
        check: &mut dyn FnMut() -> Result<(), E>,
    ) -> Result<bool, E> {
        let end = self.0.len();
        let mut sums = [0; 2];
        for (side, sum) in sums.iter_mut().enumerate() {
            let mut digest = Crc32::new();
            let length = record.lengths[side];
            for number in 0..length.div_ceil(4) {
                if number % 256 == 0 {
                    check()?;
                }
                let bytes = match side {
                    0 => self.word(Self::LOW + number).to_le_bytes(),
                    // The high contents grow downwards.
                    _ => self.word(end.saturating_sub(number + 1)).to_be_bytes(),
                };
                digest.update(bytes.get(..length - 4 * number).unwrap_or(&bytes));
            }
            *sum = digest.finalize();
        }
        Ok(sums == record.sums)
    }

    /// Makes the area empty, by a page that is written: nothing is erased.
    ///
    /// # Errors
    /// [`NotWritten`]; the contents may still be there.
    pub fn clear(self, flash: &mut dyn AreaFlash) -> Result<(), NotWritten> {
        if self.word(0) != MARK {
            return Ok(());
        }
        let mut page = [0xFF; PAGE_BYTES];
        for (byte, mark) in page.iter_mut().zip(MARK.to_le_bytes()) {
            *byte = !mark;
        }
        flash.write_page(0, &page)
    }
}

/// The checksum of a record, which is its last word.
fn sum_of(page: &[u32; PAGE_WORDS]) -> u32 {
    let mut digest = Crc32::new();
    for word in page.iter().take(PAGE_WORDS - 1) {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

/// The number of pages that contents of these lengths take.
fn pages(lengths: [usize; 2]) -> usize {
    let [low, high] = lengths.map(|length| length.div_ceil(PAGE_BYTES));
    low.saturating_add(high)
}

/// The progress of writing one of the two contents.
#[derive(Debug, Clone, Copy)]
struct ContentEnd {
    /// The number of bytes.
    length: usize,
    /// The bytes that do not fill a page yet, in the order in which they will lie in it.
    page: [u8; PAGE_BYTES],
    /// The checksum of all that has come.
    digest: Crc32,
    /// The number of sectors from this end on that have been erased.
    erased: usize,
}

impl ContentEnd {
    /// Nothing yet.
    const NEW: Self = Self { length: 0, page: [0xFF; PAGE_BYTES], digest: Crc32::new(), erased: 0 };
}

/// Fills an area. Until [`AreaWriter::finish`] there is no record.
#[derive(Debug, Clone, Copy)]
pub struct AreaWriter {
    /// The progress of the low contents.
    low: ContentEnd,
    /// The progress of the high contents.
    high: ContentEnd,
}

impl AreaWriter {
    /// Erases the area, and begins to fill it.
    ///
    /// # Errors
    /// [`NotWritten`]; the area is then empty, or holds what it held.
    pub fn begin(area: Area<'_>, flash: &mut dyn AreaFlash) -> Result<Self, NotWritten> {
        if area.bytes() == 0 {
            return Err(NotWritten);
        }
        flash.erase_sector(0)?;
        Ok(Self { low: ContentEnd { erased: 1, ..ContentEnd::NEW }, high: ContentEnd::NEW })
    }

    /// Whether this many more bytes of both contents fit.
    pub fn has_room(&self, area: Area<'_>, low: usize, high: usize) -> bool {
        let lengths = [self.low.length.saturating_add(low), self.high.length.saturating_add(high)];
        pages(lengths) < area.bytes() / PAGE_BYTES
    }

    /// Adds bytes, for which there must be room. Pages that they fill are written.
    ///
    /// # Errors
    /// [`NotWritten`]; what has come is then lost, and the area must be filled anew.
    #[inline(never)] // Its callers share one copy of the code.
    pub fn push(
        &mut self,
        side: Side,
        bytes: &[u8],
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), NotWritten> {
        for &byte in bytes {
            let (end, step) = match side {
                Side::Low => (&mut self.low, 0),
                Side::High => (&mut self.high, PAGE_BYTES - 1),
            };
            let here = end.length % PAGE_BYTES;
            // The high contents fill the page downwards from its last byte.
            if let Some(slot) = end.page.get_mut(step.abs_diff(here)) {
                *slot = byte;
            }
            end.length += 1;
            if here + 1 == PAGE_BYTES {
                self.put_page(side, area, flash)?;
            }
        }
        match side {
            Side::Low => self.low.digest.update(bytes),
            Side::High => self.high.digest.update(bytes),
        }
        Ok(())
    }

    /// Writes the page that is full, or the last one.
    #[inline(never)] // Called once for each page.
    fn put_page(
        &mut self,
        side: Side,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), NotWritten> {
        if !self.has_room(area, 0, 0) {
            return Err(NotWritten);
        }
        let sectors = area.bytes() / SECTOR_BYTES;
        let (end, other) = match side {
            Side::Low => (&mut self.low, &self.high),
            Side::High => (&mut self.high, &self.low),
        };
        // The page of the record comes before the low ones.
        let number = end.length.div_ceil(PAGE_BYTES);
        let at = match side {
            Side::Low => Some(number * PAGE_BYTES),
            Side::High => area.bytes().checked_sub(number * PAGE_BYTES),
        };
        let at = at.filter(|at| at + PAGE_BYTES <= area.bytes()).ok_or(NotWritten)?;
        let sector = at / SECTOR_BYTES;
        let from_end = if side == Side::Low { sector } else { sectors.saturating_sub(sector + 1) };
        if from_end >= end.erased {
            // The sector in which both meet has been erased from the other end.
            if from_end + other.erased < sectors {
                flash.erase_sector(sector * SECTOR_BYTES)?;
            }
            end.erased = from_end + 1;
        }
        flash.write_page(at, &end.page)?;
        end.page.fill(0xFF);
        Ok(())
    }

    /// Writes what waits, and then the record, with which the contents count.
    ///
    /// # Errors
    /// [`NotWritten`]; the area is then empty.
    pub fn finish(
        mut self,
        words: &[u32; RECORD_WORDS],
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), NotWritten> {
        let ends = [(Side::Low, self.low), (Side::High, self.high)];
        for (side, end) in ends {
            if !end.length.is_multiple_of(PAGE_BYTES) {
                self.put_page(side, area, flash)?;
            }
        }
        let [low, high] = ends.map(|(_, end)| end.length as u32);
        let [sum_low, sum_high] = ends.map(|(_, end)| end.digest.finalize());
        let head = [MARK, low, high, sum_low, sum_high];
        let mut page = [EMPTY; PAGE_WORDS];
        for (slot, word) in page.iter_mut().zip(head.iter().chain(words)) {
            *slot = *word;
        }
        let sum = sum_of(&page);
        if let Some(last) = page.last_mut() {
            *last = sum;
        }
        let mut bytes = [0; PAGE_BYTES];
        for (slot, word) in bytes.chunks_exact_mut(size_of::<u32>()).zip(page) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        flash.write_page(0, &bytes).inspect_err(|_| {
            // Although the write failed, the record itself may be whole. Erasing it makes sure that
            // it does not count. An error of that changes nothing any more.
            let _ = flash.erase_sector(0);
        })
    }
}

#[cfg(all(test, feature = "host"))]
mod tests {
    use super::*;
    use crate::boards::host::CutArea;
    use std::vec::Vec;

    /// Bytes of which no two neighbours are the same.
    fn contents(seed: u8, length: usize) -> Vec<u8> {
        (0..length).map(|at| (at as u8).wrapping_mul(37).wrapping_add(seed)).collect()
    }

    /// Fills the area of a flash by pieces of all lengths.
    fn fill(flash: &mut CutArea, low: &[u8], high: &[u8]) -> Result<(), NotWritten> {
        let area = flash.area();
        let mut writer = AreaWriter::begin(area, flash)?;
        for (side, bytes) in [(Side::Low, low), (Side::High, high)] {
            let (mut rest, mut length) = (bytes, 1);
            while !rest.is_empty() {
                let (piece, behind) = rest.split_at(length.min(rest.len()));
                writer.push(side, piece, area, flash)?;
                (rest, length) = (behind, length % 300 + 7);
            }
        }
        writer.finish(&[7; RECORD_WORDS], area, flash)
    }

    fn is_sound(area: Area<'_>) -> bool {
        let check = &mut || Ok::<_, ()>(());
        area.record().is_some_and(|record| area.is_sound(&record, check) == Ok(true))
    }

    #[test]
    fn what_is_filled_from_both_ends_is_read_again_and_each_sector_erased_once() {
        for (low, high) in [(0, 0), (1, 3), (256, 256), (511, 6000), (9000, 2999), (8192, 7680)] {
            let (low, high) = (contents(1, low), contents(2, high));
            let mut flash = CutArea::new(4 * SECTOR_BYTES);
            fill(&mut flash, &low, &high).unwrap();
            let area = flash.area();
            let record = area.record().unwrap();
            assert_eq!((record.words, record.lengths), ([7; 58], [low.len(), high.len()]));
            let mut checks = 0;
            let mut check = || {
                checks += 1;
                Ok::<_, ()>(())
            };
            assert_eq!(area.is_sound(&record, &mut check), Ok(true));
            assert_eq!(checks, low.len().div_ceil(1024) + high.len().div_ceil(1024));
            assert!(flash.erasures.iter().all(|&times| times <= 1), "{:?}", flash.erasures);
            assert_eq!(flash.pages, 1 + low.len().div_ceil(256) + high.len().div_ceil(256));
            let words = (0..low.len().div_ceil(4)).map(|index| area.word(Area::LOW + index));
            let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
            assert!(bytes.starts_with(&low));
            for after in 0..high.len().saturating_sub(2) {
                assert_eq!(area.high_3(after), high[after..after + 3]);
            }
        }
    }

    #[test]
    fn every_damaged_byte_is_found() {
        let mut flash = CutArea::new(2 * SECTOR_BYTES);
        let (low, high) = (contents(1, 301), contents(2, 259));
        fill(&mut flash, &low, &high).unwrap();
        let area = flash.area();
        for at in 0..2 * SECTOR_BYTES {
            let byte = flash.bytes()[at];
            flash.set_byte(at, byte ^ 4);
            let counts = at < 256 || (256..557).contains(&at) || at >= 2 * SECTOR_BYTES - 259;
            assert_eq!(is_sound(area), !counts, "byte {at}");
            flash.set_byte(at, byte);
        }
        assert!(is_sound(area));
    }

    #[test]
    fn a_full_area_takes_nothing_more() {
        let mut flash = CutArea::new(SECTOR_BYTES);
        let area = flash.area();
        let mut writer = AreaWriter::begin(area, &mut flash).unwrap();
        assert!(writer.has_room(area, 7 * 256, 8 * 256));
        assert!(!writer.has_room(area, 7 * 256 + 1, 8 * 256));
        assert!(!writer.has_room(area, usize::MAX, 1));
        writer.push(Side::High, &contents(1, 8 * 256), area, &mut flash).unwrap();
        writer.push(Side::Low, &contents(2, 7 * 256), area, &mut flash).unwrap();
        assert!(writer.has_room(area, 0, 0) && !writer.has_room(area, 1, 0));
        writer.finish(&[7; RECORD_WORDS], area, &mut flash).unwrap();
        assert!(is_sound(area));
        let too_much = fill(&mut flash, &contents(1, 10 * 256), &contents(2, 6 * 256));
        assert_eq!((too_much, area.record()), (Err(NotWritten), None));
        let mut none = CutArea::new(0);
        assert!(AreaWriter::begin(none.area(), &mut none).is_err());
    }

    #[test]
    fn an_area_is_cleared_by_a_page_and_nothing_erased() {
        let mut flash = CutArea::new(SECTOR_BYTES);
        fill(&mut flash, &[1], &[2]).unwrap();
        let area = flash.area();
        let (pages, erasures) = (flash.pages, flash.erasures.clone());
        area.clear(&mut flash).unwrap();
        assert_eq!((area.record(), flash.pages), (None, pages + 1));
        area.clear(&mut flash).unwrap();
        assert_eq!((flash.pages, flash.erasures), (pages + 1, erasures));
    }
}
