//! Changes a tour at random (kicks it) where exchanges alone find nothing better any more.

use super::exchange::Exchanges;
use super::orient::orient;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::array::MapEach;
use crate::index::Index;

/// The seed of the kicks' random numbers. It must not be 0; on a dozen drawings this one was no
/// worse than others.
const SEED: u32 = 2;

/// The directions of the strokes are improved after each this many kicks.
const KICKS_BETWEEN_TURNS: u32 = 64;

/// How a tour is kicked.
pub(super) struct KickPlan {
    /// By how much a kick may make the tour longer at the beginning and at the end of the budget,
    /// in 1/65,536 steps. In between it is in proportion to what is left of the budget.
    pub heat: [u64; 2],
    /// The moves that a kick changes are at most this many moves apart.
    pub reach: u32,
    /// The work ends after so many kicks in vain.
    pub patience: u32,
    /// The work also ends where such a stretch of it gains too little.
    pub window: Option<Window>,
}

/// A stretch of work at whose end it is decided whether kicks still pay.
#[derive(Clone, Copy)]
pub(super) struct Window {
    /// The units of work in it.
    pub units: u64,
    /// The least gain with which the work goes on, in 1/256 steps.
    pub least_gain: i64,
}

/// Exchanges moves and reverses strokes until neither makes the tour shorter. Returns by how much
/// it became shorter.
pub(super) fn shorten<I: Index>(
    tour: &mut Exchanges<'_, '_, I>,
    choices: &mut [u8],
    work_budget: &mut WorkBudget<'_>,
) -> Result<i64, OrderError> {
    let mut gain = tour.exchange_all(true, work_budget)?;
    while !work_budget.is_over() {
        let more = orient(tour, choices, work_budget)?;
        if more == 0 {
            break;
        }
        gain += more + tour.exchange_all(true, work_budget)?;
    }
    Ok(gain)
}

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

    /// Returns a generator of other random numbers, a different one at each call.
    #[cfg(feature = "threads")]
    pub(super) fn fork(&mut self) -> Self {
        self.below(1);
        // The multiplication (Knuth's) keeps the forks from repeating each other's numbers.
        Self { random: self.random.wrapping_mul(2_654_435_761) | 1 }
    }

    /// Kicks a tour until the budget is used up, or until the plan says that it no longer helps.
    /// `budget` is what was granted at first. `choices` must have an entry for each leg.
    #[inline(always)] // On a board it has one caller.
    pub(super) fn improve<I: Index>(
        &mut self,
        tour: &mut Exchanges<'_, '_, I>,
        plan: KickPlan,
        budget: u64,
        choices: &mut [u8],
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let KickPlan { heat: [hottest, coldest], reach, patience, window } = plan;
        let (mut in_vain, mut window_gain) = (0, 0);
        let mut window_begin = work_budget.left();
        for count in 1.. {
            if in_vain >= patience || work_budget.is_over() {
                break;
            }
            // Of 256 parts of the budget; the mean length of a move is below 2^31.
            let parts_left = work_budget.left() / (budget / 256 + 1);
            let heat = (coldest + (((hottest - coldest) * parts_left) >> 8)) >> 8;
            let mut gain = self.kick(tour, reach, heat as u32, work_budget)?;
            if count % KICKS_BETWEEN_TURNS == 0 {
                gain += shorten(tour, choices, work_budget)?;
            }
            in_vain = if gain > 0 { 0 } else { in_vain + 1 };
            window_gain += gain;
            if let Some(Window { units, least_gain }) = window
                && window_begin - work_budget.left() >= units
            {
                if window_gain < least_gain {
                    break;
                }
                (window_gain, window_begin) = (0, work_budget.left());
            }
        }
        Ok(())
    }

    /// Changes four moves near each other at random (a double bridge), and then exchanges moves
    /// around them. The moves are at most `reach` moves apart. The result is kept if it costs no
    /// more than before, or by chance if it costs less than `heat` more. Returns the gain.
    fn kick<I: Index>(
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
