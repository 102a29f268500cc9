//! Changes a tour at random (kicks it) where exchanges alone find nothing better any more.

use super::exchange::Exchanges;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::array::MapEach;
use crate::index::Index;

/// The seed of the kicks' random numbers. It must not be 0; on a dozen drawings this one was no
/// worse than others.
const SEED: u32 = 2;

/// Changes a tour at random (kicks it) where exchanges alone find nothing better any more.
pub(super) struct Kicks {
    /// The state of the random number generator, which is never 0.
    random: u32,
}

impl Kicks {
    /// The kicks of one drawing; they are the same on every machine.
    pub(super) const fn new() -> Self {
        Self { random: SEED }
    }

    /// Changes four moves near each other at random (a double bridge), and then exchanges moves
    /// around them. The moves are at most `reach` moves apart. The result is kept if it costs no
    /// more than before, or by chance if it costs less than `heat` more. Returns the gain.
    pub(super) fn kick<I: Index>(
        &mut self,
        tour: &mut Exchanges<'_, '_, I>,
        reach: u32,
        heat: u32,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<i64, OrderError> {
        tour.cycle.settle();
        let begin = self.below(tour.cycle.len() as u32) as usize;
        let mut at = tour.cycle.leg(begin);
        let mut cuts = [at; 4];
        for cut in &mut cuts {
            for _ in 0..=self.below(reach) {
                let Some(leg) = next_move(tour, at, work_budget)? else {
                    return Ok(0);
                };
                at = leg;
            }
            *cut = at;
        }
        let [a, c, e, g] = cuts;
        // On a short tour the walk may have gone all the way around.
        let [to_c, to_e, to_g] = [c, e, g].map_each(|cut| tour.cycle.steps(a, cut));
        if to_c == 0 || to_e <= to_c || to_g <= to_e {
            return Ok(0);
        }
        let [b, d, f, h] = cuts.map_each(|leg| tour.cycle.next(leg));
        let ends = [(a, b), (c, d), (e, f), (g, h), (a, f), (g, d), (e, b), (c, h)];
        let costs = ends.map(|(from, to)| tour.distance(tour.end(from), tour.start(to)));
        let loss = costs[4..].iter().sum::<i64>() - costs[..4].iter().sum::<i64>();
        // The tour becomes … a, f … g, d … e, b … c, h …
        let moved = tour.cycle.swap(a, d, g) + tour.cycle.swap(a, f, g);
        work_budget.work(8 + moved as u32 / 32)?;
        tour.wake(&[a, b.flipped(), c, d.flipped(), e, f.flipped(), g, h.flipped()]);
        let gain = tour.exchange_all(false, work_budget)? - loss;
        if gain < -i64::from(self.below(heat)) {
            tour.cycle.take_back(0);
            return Ok(0);
        }
        Ok(gain)
    }

    /// Returns a random number below `limit` (Marsaglia's xorshift).
    fn below(&mut self, limit: u32) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        ((u64::from(self.random) * u64::from(limit)) >> 32) as u32
    }
}

/// Returns the next leg after `from` at whose end the pen is lifted, or `None` if the pen is lifted
/// nowhere.
fn next_move<I: Index>(
    tour: &Exchanges<'_, '_, I>,
    from: Leg<I>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<Option<Leg<I>>, OrderError> {
    let mut leg = tour.cycle.next(from);
    for _ in 0..tour.cycle.len() {
        work_budget.work(1)?;
        let next = tour.cycle.next(leg);
        if tour.lifts_between(leg, next) {
            return Ok(Some(leg));
        }
        leg = next;
    }
    Ok(None)
}
