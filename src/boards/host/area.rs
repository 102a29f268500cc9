//! A simulated flash memory for models, whose power may fail between any two bytes.

use super::flash::PowerCut;
use crate::storage::PAGE_BYTES;
use crate::storage::area::{Area, AreaFlash, NotWritten, SECTOR_BYTES};
use std::sync::atomic::{AtomicU32, Ordering};
use std::vec::Vec;

/// Flash for models. It refuses to clear a bit that is clear already, which is stricter than a
/// chip.
#[derive(Debug)]
pub struct CutArea {
    /// The contents. They are leaked, so they last as long as the process.
    words: &'static [AtomicU32],
    /// The number of bytes that can still be erased or written before the power fails.
    pub budget: usize,
    /// How often each sector was erased.
    pub erasures: Vec<u32>,
    /// The number of pages that were written.
    pub pages: usize,
    /// A brown-out: after so many uses of the area, one finds garbage in the word with this index,
    /// however often it reads it, because the cache of the flash keeps it; `None` for never.
    pub garbage: Option<[usize; 2]>,
    /// Whether sectors may be erased: nothing moves.
    pub(super) may_erase: bool,
}

impl CutArea {
    /// Creates an erased flash memory of this size whose power does not fail.
    pub fn new(bytes: usize) -> Self {
        let words: Vec<_> = (0..bytes / 4).map(|_| AtomicU32::new(u32::MAX)).collect();
        Self {
            words: words.leak(),
            budget: usize::MAX,
            erasures: std::vec![0; bytes / SECTOR_BYTES],
            pages: 0,
            garbage: None,
            may_erase: true,
        }
    }

    /// The area that lies in this flash.
    pub fn area(&self) -> Area<'static> {
        Area::new(self.words)
    }

    /// The area for one use.
    pub(super) fn next_use(&mut self) -> Area<'static> {
        let Some([left, word]) = self.garbage else { return self.area() };
        self.garbage = left.checked_sub(1).map(|left| [left, word]);
        if left > 0 {
            return self.area();
        }
        let copy = self.words.iter().map(|word| AtomicU32::new(word.load(Ordering::Relaxed)));
        let copy: Vec<_> = copy.collect();
        copy[word].fetch_xor(0xA5C3_96F0, Ordering::Relaxed);
        Area::new(copy.leak())
    }

    /// The bytes as they are now.
    pub fn bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()).collect()
    }

    /// Changes a byte, as nothing but damage does.
    pub fn set_byte(&self, at: usize, byte: u8) {
        let word = &self.words[at / 4];
        let mut bytes = word.load(Ordering::Relaxed).to_le_bytes();
        bytes[at % 4] = byte;
        word.store(u32::from_le_bytes(bytes), Ordering::Relaxed);
    }

    /// Changes one byte after the other until the power fails.
    fn each(&mut self, from: usize, bytes: &[u8], erases: bool) -> Result<(), PowerCut> {
        for (at, &byte) in (from..).zip(bytes) {
            self.budget = self.budget.checked_sub(1).ok_or(PowerCut)?;
            let before = self.words[at / 4].load(Ordering::Relaxed).to_le_bytes()[at % 4];
            self.set_byte(at, if erases { byte } else { byte & before });
        }
        Ok(())
    }
}

impl AreaFlash for CutArea {
    fn erase_sector(&mut self, at: usize) -> Result<(), NotWritten> {
        assert!(at.is_multiple_of(SECTOR_BYTES));
        assert!(self.may_erase, "flash is erased while something moves");
        self.erasures[at / SECTOR_BYTES] += 1;
        self.each(at, &[0xFF; SECTOR_BYTES], true).map_err(|PowerCut| NotWritten)
    }

    fn write_page(&mut self, at: usize, page: &[u8; PAGE_BYTES]) -> Result<(), NotWritten> {
        assert!(at.is_multiple_of(PAGE_BYTES));
        assert!(self.may_erase, "a model is written while something moves");
        let words = self.words[at / 4..][..PAGE_BYTES / 4].iter();
        let before: Vec<u8> =
            words.flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()).collect();
        let clears_once = before.iter().zip(page).all(|(before, new)| !before & !new == 0);
        assert!(clears_once, "a bit is cleared twice at {at:#x}");
        self.pages += 1;
        self.each(at, page, false).map_err(|PowerCut| NotWritten)
    }
}
