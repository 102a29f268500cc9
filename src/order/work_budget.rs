//! Counts the work of a long computation, so that it answers the serial line regularly and ends
//! when its budget is used up.

use crate::stage::{Aborted, Cancel, heap_sort_cancellable};

/// Counts units of work, and calls [`Cancel::check`] at regular intervals.
pub(super) struct WorkBudget<'a> {
    /// Called after every [`WorkBudget::UNITS`] units of work, so that the machine can answer and
    /// the user can abort.
    cancel: &'a mut dyn Cancel,
    /// Units of work done since [`Cancel::check`] was last called.
    done: u32,
    /// Units of the budget that were left when it was last called.
    budget: u64,
}

impl<'a> WorkBudget<'a> {
    /// Units of work between two calls of [`Cancel::check`]. A unit is the computation of one
    /// distance, up to 500 instructions on the smallest core.
    const UNITS: u32 = 256;

    /// Makes a counter that calls `cancel` regularly. Its budget is 0 until [`WorkBudget::grant`].
    pub fn new(cancel: &'a mut dyn Cancel) -> Self {
        Self { cancel, done: 0, budget: 0 }
    }

    /// Calls [`Cancel::check`] now. Used between two passes over the whole drawing.
    pub fn answer(&mut self) -> Result<(), Aborted> {
        self.work(Self::UNITS)
    }

    /// Counts `units` of work, each as much as the computation of one distance.
    #[inline]
    pub fn work(&mut self, units: u32) -> Result<(), Aborted> {
        self.done += units;
        if self.done >= Self::UNITS { self.check() } else { Ok(()) }
    }

    /// Counts any number of units of work that other threads have done.
    #[cfg(feature = "threads")]
    pub fn work_long(&mut self, units: u64) -> Result<(), Aborted> {
        for _ in 0..units / u64::from(Self::UNITS) {
            self.answer()?;
        }
        Ok(())
    }

    /// Takes the units done from the budget, and calls [`Cancel::check`].
    #[cold]
    #[inline(never)] // Inlined, it would make every search 5 % slower.
    fn check(&mut self) -> Result<(), Aborted> {
        self.budget = self.budget.saturating_sub(self.done.into());
        self.done = 0;
        self.cancel.check()
    }

    /// Sorts `items` by a key, and calls [`Cancel::check`] meanwhile.
    pub fn sort<T, K: Ord>(
        &mut self,
        items: &mut [T],
        key: impl Fn(&T) -> K,
    ) -> Result<(), Aborted> {
        heap_sort_cancellable(items, key, self.cancel)
    }

    /// Sets how many units of work may be done from now until the budget [is over](Self::is_over).
    pub fn grant(&mut self, units: u64) {
        self.budget = units.saturating_add(self.done.into());
    }

    /// Returns how many of the units granted are left.
    pub fn left(&self) -> u64 {
        self.budget.saturating_sub(self.done.into())
    }

    /// Whether the units granted have been used up.
    pub fn is_over(&self) -> bool {
        self.budget <= u64::from(self.done)
    }
}
