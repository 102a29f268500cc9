//! Makes a starting solution that leaves few vertices unmatched: the duals are as large as the
//! nearest neighbours allow, and the pairs that then touch are matched.

use super::Matching;
use crate::index::Index;
use crate::order::OrderError;
use crate::order::work_budget::WorkBudget;

// No index can fail: all vertices here are counted to `odd.count()`, the length of `radius` and of
// `mate`, and `touched` is one of them when `mate.get` finds it.
impl<I: Index> Matching<'_, '_, I> {
    /// Makes a starting solution: large duals without overlap, and a match of each pair that then
    /// touches.
    pub(super) fn start(&mut self, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        let real = self.odd.real_count();
        for vertex in I::below(real) {
            let nearest =
                self.nearest(&mut I::below(vertex).rev(), vertex, i32::MAX, work_budget)?;
            let nearest =
                self.nearest(&mut (vertex + I::ONE).to(real), vertex, nearest, work_budget)?;
            // Each gets half the weight of its lightest pair, so that no two discs overlap.
            self.radius[vertex.get()] = nearest / 2;
        }
        // With this weight the free ends, whose radius is 0, overlap no disc either.
        self.end_weight = self.radius.iter().copied().max().unwrap_or(0);
        self.widest = self.end_weight;
        for vertex in I::below(self.odd.count()) {
            if self.mate[vertex.get()] == I::NONE {
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
        others: &mut dyn Iterator<Item = I>,
        vertex: I,
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
    fn widen(&mut self, vertex: I, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        let own = self.radius[vertex.get()];
        let mut gap = i32::MAX / 2;
        let mut touched = I::NONE;
        // Its nearest neighbour is at most twice its radius and 1 away.
        let weight = 2 * i64::from(own) + 1 + i64::from(self.widest);
        for others in self.up_to(vertex, weight, work_budget)? {
            for other in others.filter(|&other| other != vertex) {
                let reach = own + self.radius[other.get()];
                let free = self.mate[other.get()] == I::NONE;
                let bound = gap + reach + i32::from(free);
                if let Some(weight) = self.weight_below(vertex, other, bound) {
                    gap = weight - reach;
                    touched = other;
                }
            }
        }
        let radius = own + gap;
        self.radius[vertex.get()] = radius;
        self.widest = self.widest.max(radius);
        if self.mate.get(touched.get()) == Some(&I::NONE) {
            self.mate[vertex.get()] = touched;
            self.mate[touched.get()] = vertex;
        }
        Ok(())
    }
}
