//! A computation that answers the line as it goes, and knows when to end.

use crate::stage::{Aborted, Cancel, heap_sort_cancellable};

/// Counts work and calls [`Cancel::check`] in time.
pub(super) struct WorkBudget<'a> {
    cancel: &'a mut dyn Cancel,
    /// Units since the last answer.
    done: u32,
    /// Units left at the last answer.
    budget: u64,
}

impl<'a> WorkBudget<'a> {
    /// Distances between two answers: each takes up to 500 instructions on the smallest core.
    const UNITS: u32 = 256;

    pub fn new(cancel: &'a mut dyn Cancel) -> Self {
        Self { cancel, done: 0, budget: 0 }
    }

    /// Answers now: between two passes over the whole drawing.
    pub fn answer(&mut self) -> Result<(), Aborted> {
        self.work(Self::UNITS)
    }

    /// Notes `units` of work, each as much as a distance costs.
    pub fn work(&mut self, units: u32) -> Result<(), Aborted> {
        self.done += units;
        if self.done >= Self::UNITS {
            self.budget = self.budget.saturating_sub(self.done.into());
            self.done = 0;
            self.cancel.check()?;
        }
        Ok(())
    }

    /// Sorts by a key, answering as it goes.
    pub fn sort<T, K: Ord>(
        &mut self,
        items: &mut [T],
        key: impl Fn(&T) -> K,
    ) -> Result<(), Aborted> {
        heap_sort_cancellable(items, key, self.cancel)
    }

    /// Sets how many units may be worked from now until it [is over](Self::is_over).
    pub fn grant(&mut self, units: u64) {
        self.budget = units.saturating_add(self.done.into());
    }

    /// Whether the units granted have been used up.
    pub fn is_over(&self) -> bool {
        self.budget <= u64::from(self.done)
    }
}
