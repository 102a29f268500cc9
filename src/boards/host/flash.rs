//! A simulated flash memory whose power may fail between any two bytes.

use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use std::vec::Vec;

/// A flash memory that is stricter than a chip: it refuses a write that is not whole pages, or that
/// clears a bit which is clear already.
#[derive(Debug, Clone)]
pub struct CutFlash {
    /// The contents.
    pub bytes: Vec<u8>,
    /// The number of bytes that can still be erased or written before the power fails.
    pub budget: usize,
    /// The number of reads after which one returns garbage, as in a brown-out; `None` for never.
    pub garbage_after: Option<usize>,
    /// How often each sector was erased.
    pub erasures: Vec<u32>,
    /// Whether the power has failed. Nothing changes any more then.
    pub is_cut: bool,
    /// Whether bytes were changed from outside. A bit may then be clear that nothing has cleared,
    /// and may be cleared again, as a chip allows.
    pub is_damaged: bool,
}

/// The error of an operation during which the power fails, or after it has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PowerCut;

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl CutFlash {
    /// The unit in which the flash is written, in bytes.
    const PAGE: usize = 256;
    /// The unit in which the flash is erased, in bytes.
    const SECTOR: usize = 4096;

    /// Creates an erased flash memory of this size whose power does not fail.
    pub fn new(bytes: usize) -> Self {
        Self {
            bytes: std::vec![0xFF; bytes],
            budget: usize::MAX,
            garbage_after: None,
            erasures: std::vec![0; bytes / Self::SECTOR],
            is_cut: false,
            is_damaged: false,
        }
    }

    /// Returns the same flash memory after the power has come back.
    #[must_use]
    pub fn powered(self) -> Self {
        Self { budget: usize::MAX, is_cut: false, ..self }
    }

    /// Applies `change` to one byte after the other until the power fails.
    fn each(
        &mut self,
        from: usize,
        to: usize,
        change: impl Fn(usize, u8) -> u8,
    ) -> Result<(), PowerCut> {
        for at in from..to {
            match self.budget.checked_sub(1) {
                Some(budget) if !self.is_cut => self.budget = budget,
                _ => {
                    self.is_cut = true;
                    return Err(PowerCut);
                }
            }
            self.bytes[at] = change(at, self.bytes[at]);
        }
        Ok(())
    }
}

impl ErrorType for CutFlash {
    type Error = PowerCut;
}

impl ReadNorFlash for CutFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        let from = offset as usize;
        bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
        if let Some(left) = self.garbage_after {
            self.garbage_after = left.checked_sub(1);
            if left == 0 {
                // The bytes may read as 0, as 0xFF, or as anything else.
                for (at, byte) in (from..).zip(bytes) {
                    *byte = [0, 0xFF, at.wrapping_mul(167) as u8][from % 3];
                }
            }
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for CutFlash {
    const WRITE_SIZE: usize = Self::PAGE;
    const ERASE_SIZE: usize = Self::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        let (from, to) = (from as usize, to as usize);
        assert!(from.is_multiple_of(Self::SECTOR) && to.is_multiple_of(Self::SECTOR));
        for erasures in &mut self.erasures[from / Self::SECTOR..to / Self::SECTOR] {
            *erasures += u32::from(!self.is_cut);
        }
        self.each(from, to, |_, _| 0xFF)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        let from = offset as usize;
        assert!(from.is_multiple_of(Self::PAGE) && bytes.len().is_multiple_of(Self::PAGE));
        let before = &self.bytes[from..from + bytes.len()];
        let clears_once = before.iter().zip(bytes).all(|(before, new)| !before & !new == 0);
        assert!(clears_once || self.is_damaged, "a bit is cleared twice at {offset:#x}");
        self.each(from, from + bytes.len(), |at, before| before & bytes[at - from])
    }
}

impl MultiwriteNorFlash for CutFlash {}
