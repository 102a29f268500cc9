//! What the firmware does to the flash of the emulated Pico, and what is in the flash if the power
//! fails in between.

use super::process::State;
use super::record::{BOOT_SCATTERED, BOOT_WITHIN, RECORD_FLASH};
use super::{EmulatorError, Pico};
use crate::emulator::{EmulatedBoard as _, TIMEOUT};
use std::io;
use std::time::Duration;

/// The number of bits in which a number of bytes or a seed is sent.
const LOW_BITS: u32 = 24;

/// The erasure of a sector, or the writing of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FlashOperation {
    /// The time at which the operation began, on the board's clock.
    pub began: Duration,
    /// Whether a sector is erased.
    pub is_erasure: bool,
    /// Where the sector or the page begins in the flash, in bytes.
    pub offset: u32,
    /// The number of bytes of the sector or page that change.
    pub changes: u32,
}

impl Pico {
    /// From now on, records what the firmware does to the flash. What was recorded before is
    /// forgotten.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn record_flash(&mut self) -> io::Result<()> {
        self.send(RECORD_FLASH, 1, 0)
    }

    /// Ends the record and returns the operations in their order. [`Pico::boot_within`] and
    /// [`Pico::boot_scattered`] know them until the next record begins.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn end_flash_record(&mut self) -> Result<Vec<FlashOperation>, EmulatorError> {
        {
            let mut state = self.shared.lock();
            state.operations.clear();
            state.operation_count = None;
        }
        self.send(RECORD_FLASH, 0, 0)?;
        let waits = |state: &mut State| state.operation_count.is_none() && !state.ended;
        let mut state = self.shared.wait_while(TIMEOUT, waits);
        if state.operation_count.is_some() {
            return Ok(std::mem::take(&mut state.operations));
        }
        drop(state);
        Err(EmulatorError::Ended { said: self.said() })
    }

    /// Cuts the power and restores it. The flash is then as it was when recorded operation number
    /// `operation`, from 0, had changed `bytes` bytes, and of the next byte those bits that are in
    /// `mask`. If there is no such operation, all of them are done.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn boot_within(&mut self, operation: u32, bytes: u32, mask: u8) -> io::Result<()> {
        self.boot(BOOT_WITHIN, mask, operation, bytes)
    }

    /// Cuts the power and restores it. The flash is then as it was before recorded operation number
    /// `operation`, but each bit that the operation changes has changed with a probability of
    /// `share` in 256, decided by `seed`.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn boot_scattered(&mut self, operation: u32, share: u8, seed: u32) -> io::Result<()> {
        self.boot(BOOT_SCATTERED, share, operation, seed)
    }

    fn boot(&mut self, what: u8, value: u8, operation: u32, low: u32) -> io::Result<()> {
        let low = u64::from(low) & ((1 << LOW_BITS) - 1);
        self.send(what, value, u64::from(operation) << LOW_BITS | low)
    }
}
