//! A simulated flash memory whose power may fail between any two bytes.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// A flash memory that is stricter than the chip: it refuses every write that is not whole pages of
/// erased bytes.
#[derive(Debug, Clone)]
pub struct CutFlash {
    /// The contents.
    pub bytes: Vec<u8>,
    /// The number of bytes that can still be erased or written before the power fails.
    pub budget: usize,
}

/// The error of an operation during which the power fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cut;

impl NorFlashError for Cut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl CutFlash {
    const PAGE: usize = 256;
    const SECTOR: usize = 4096;

    /// Creates an erased flash memory of this size whose power does not fail.
    pub fn new(bytes: usize) -> Self {
        Self { bytes: vec![0xFF; bytes], budget: usize::MAX }
    }

    /// Applies `change` to one byte after the other until the power fails.
    fn each(
        &mut self,
        from: usize,
        to: usize,
        change: impl Fn(usize, u8) -> u8,
    ) -> Result<(), Cut> {
        for at in from..to {
            self.budget = self.budget.checked_sub(1).ok_or(Cut)?;
            self.bytes[at] = change(at, self.bytes[at]);
        }
        Ok(())
    }
}

impl ErrorType for CutFlash {
    type Error = Cut;
}

impl ReadNorFlash for CutFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Cut> {
        let from = offset as usize;
        bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for CutFlash {
    const WRITE_SIZE: usize = Self::PAGE;
    const ERASE_SIZE: usize = Self::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Cut> {
        let (from, to) = (from as usize, to as usize);
        assert!(from.is_multiple_of(Self::SECTOR) && to.is_multiple_of(Self::SECTOR));
        self.each(from, to, |_, _| 0xFF)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Cut> {
        let from = offset as usize;
        assert!(from.is_multiple_of(Self::PAGE) && bytes.len().is_multiple_of(Self::PAGE));
        let erased = &self.bytes[from..from + bytes.len()];
        assert!(erased.iter().all(|byte| *byte == 0xFF), "written twice at {offset:#x}");
        self.each(from, from + bytes.len(), |at, before| before & bytes[at - from])
    }
}
