//! How long the emulated Pico does not call a function.

use super::record::TIME_GAPS;
use super::{EmulatorError, Pico, function};
use std::path::Path;
use std::time::Duration;

/// The shortest time that the emulator tells, in hundredths of a millisecond.
const LEAST: u8 = 20;

/// The longest times from a call of a function to the next one, on the board's clock. The time in
/// which the core sleeps does not count. A time under 0.2 ms is not told, and counts as none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CallGaps {
    /// The longest one in which the flash was neither erased nor written.
    pub longest: Duration,
    /// The longest one in which it was.
    pub longest_for_flash: Duration,
}

impl Pico {
    /// From now on, measures the times from each call of a function of `image` to the next one: the
    /// first function whose mangled name contains `name`.
    ///
    /// # Errors
    /// [`EmulatorError::BadImage`] if there is no such function, or another error if the emulator
    /// has ended.
    pub fn time_between_calls(&mut self, image: &Path, name: &str) -> Result<(), EmulatorError> {
        let address = function(image, |found| found.contains(name), name)?;
        Ok(self.send(TIME_GAPS, LEAST, address)?)
    }

    /// Returns the longest times since the last call, and forgets them.
    pub fn take_call_gaps(&mut self) -> CallGaps {
        std::mem::take(&mut self.shared.lock().call_gaps)
    }
}
