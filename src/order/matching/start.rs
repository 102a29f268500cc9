//! Makes a starting solution that leaves few vertices unmatched: the duals are as large as the
//! nearest neighbours allow, and the pairs that then touch are matched.

use super::Matching;
use crate::order::work_budget::WorkBudget;
use crate::order::{NONE, OrderError};

impl Matching<'_, '_> {
    /// Sets the duals and matches the pairs that touch.
    pub(super) fn start(&mut self, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        let real = self.odd.real_count();
        for vertex in 0..real {
            let nearest = self.nearest(&mut (0..vertex).rev(), vertex, i32::MAX, work_budget)?;
            let nearest = self.nearest(&mut (vertex + 1..real), vertex, nearest, work_budget)?;
            // Each gets half the weight of its lightest pair, so that no two discs overlap.
            self.radius[usize::from(vertex)] = nearest / 2;
        }
        // With this weight the free ends, whose radius is 0, overlap no disc either.
        self.end_weight = self.radius.iter().copied().max().unwrap_or(0);
        self.widest = self.end_weight;
        for vertex in 0..self.odd.count() {
            if self.mate[usize::from(vertex)] == NONE {
                self.widen(vertex, work_budget)?;
            }
        }
        Ok(())
    }

    /// Returns the weight of the lightest pair of `vertex` with any of `others`, or `bound` if none
    /// is below it. The distance along x from `vertex` must increase from each of `others` to the
    /// next.
    fn nearest(
        &self,
        others: &mut dyn Iterator<Item = u16>,
        vertex: u16,
        bound: i32,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<i32, OrderError> {
        let mut nearest = bound;
        let mut looked_at = 0;
        for other in others {
            looked_at += 1;
            if self.weight_along_x(vertex, other) >= nearest {
                break;
            }
            if let Some(weight) = self.weight_below(vertex, other, nearest) {
                nearest = weight;
            }
        }
        self.charge(looked_at, work_budget)?;
        Ok(nearest)
    }

    /// Grows the disc of an unmatched vertex until it touches another, and matches them if that one
    /// is unmatched too.
    fn widen(&mut self, vertex: u16, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        let own = self.radius[usize::from(vertex)];
        let mut gap = i32::MAX / 2;
        let mut touched = NONE;
        // Its nearest neighbour is at most twice its radius and 1 away.
        let weight = 2 * i64::from(own) + 1 + i64::from(self.widest);
        for others in self.up_to(vertex, weight, work_budget)? {
            for other in others.filter(|&other| other != vertex) {
                let reach = own + self.radius[usize::from(other)];
                let free = self.mate[usize::from(other)] == NONE;
                let bound = gap + reach + i32::from(free);
                if let Some(weight) = self.weight_below(vertex, other, bound) {
                    gap = weight - reach;
                    touched = other;
                }
            }
        }
        let radius = own + gap;
        self.radius[usize::from(vertex)] = radius;
        self.widest = self.widest.max(radius);
        if let Some(&NONE) = self.mate.get(usize::from(touched)) {
            self.mate[usize::from(vertex)] = touched;
            self.mate[usize::from(touched)] = vertex;
        }
        Ok(())
    }
}
