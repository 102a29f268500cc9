//! Decides how often a long computation checks whether the user has cancelled it.

use crate::stage::{Aborted, Cancel};

/// The number of instructions between two checks, as accurate as the estimates of the callers are
/// (for thumbv6m).
const INSTRUCTIONS_BETWEEN_CHECKS: usize = 50_000;

/// Counts the instructions spent and checks for cancelling whenever enough have been spent.
pub struct YieldCounter<'t> {
    /// Called to find out whether the user has cancelled.
    cancel: &'t mut dyn Cancel,
    /// The estimated number of instructions since the last check.
    done: usize,
}

impl<'t> YieldCounter<'t> {
    /// Makes a counter that asks `cancel` and has counted nothing yet.
    pub fn new(cancel: &'t mut dyn Cancel) -> Self {
        Self { cancel, done: 0 }
    }

    /// Adds an estimate of the instructions spent, and checks for cancelling if enough have
    /// accumulated.
    ///
    /// # Errors
    /// Returns [`Aborted`] if the user has cancelled.
    #[inline]
    pub fn spend(&mut self, instructions: usize) -> Result<(), Aborted> {
        self.done += instructions;
        if self.done < INSTRUCTIONS_BETWEEN_CHECKS {
            return Ok(());
        }
        self.done = 0;
        self.cancel.check()
    }
}
