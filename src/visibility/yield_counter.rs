//! How often a long computation looks up from its work.

use crate::stage::{Aborted, Cancel};

/// Instructions between two looks, as near as the callers' estimates go (for thumbv6m).
const BETWEEN_LOOKS: usize = 50_000;

/// Counts work and gives attention when enough has been done.
pub struct YieldCounter<'t> {
    cancel: &'t mut dyn Cancel,
    done: usize,
}

impl<'t> YieldCounter<'t> {
    pub fn new(cancel: &'t mut dyn Cancel) -> Self {
        Self { cancel, done: 0 }
    }

    /// Notes that about so many instructions were spent.
    #[inline]
    pub fn spend(&mut self, instructions: usize) -> Result<(), Aborted> {
        self.done += instructions;
        if self.done < BETWEEN_LOOKS {
            return Ok(());
        }
        self.done = 0;
        self.cancel.check()
    }
}
