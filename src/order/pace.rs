//! A computation that answers the line as it goes.

use crate::stage::{Aborted, Attention};

/// Counts work and calls [`Attention::check`] in time.
pub(super) struct Pace<'a> {
    attention: &'a mut dyn Attention,
    done: u32,
}

impl<'a> Pace<'a> {
    /// Distances between two answers: each takes up to 800 instructions on the smallest core.
    const UNITS: u32 = 200;

    pub fn new(attention: &'a mut dyn Attention) -> Self {
        Self { attention, done: 0 }
    }

    /// Answers now: between two passes over the whole drawing.
    pub fn answer(&mut self) -> Result<(), Aborted> {
        self.work(Self::UNITS)
    }

    /// Notes `units` of work, each as much as a distance costs.
    pub fn work(&mut self, units: u32) -> Result<(), Aborted> {
        self.done += units;
        if self.done >= Self::UNITS {
            self.done = 0;
            self.attention.check()?;
        }
        Ok(())
    }
}
