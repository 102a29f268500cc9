//! Lets a long enumeration be cancelled.

use penup::stage::{Aborted, Cancel};

/// Counts work, and asks after a fixed amount of it whether the enumeration is to end.
pub(super) struct WorkCounter<'a> {
    cancel: &'a mut dyn Cancel,
    /// Units of work since it was last asked.
    done: u32,
}

impl<'a> WorkCounter<'a> {
    /// Units of work between two questions.
    const UNITS: u32 = 256;

    /// Nothing has been counted yet.
    pub fn new(cancel: &'a mut dyn Cancel) -> Self {
        Self { cancel, done: 0 }
    }

    /// Counts `units` of work.
    ///
    /// # Errors
    /// [`Aborted`], if the enumeration is to end.
    pub fn work(&mut self, units: u32) -> Result<(), Aborted> {
        self.done = self.done.saturating_add(units);
        if self.done >= Self::UNITS {
            self.done = 0;
            self.cancel.check()?;
        }
        Ok(())
    }
}
