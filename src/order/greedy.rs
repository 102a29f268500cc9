//! Pairs the odd points greedily with regret (Harrison 5.10.1), and then improves the pairs by
//! exchanges.
//!
//! The regret of a point is how much farther its second choice is than its first. The point with
//! the greatest regret is given its first choice; this is repeated until all are paired. Then any
//! two pairs exchange partners while that shortens them. The result has no proved bound. Points are
//! numbered in the order of their x. Those that are too far apart by x or y alone are skipped
//! without computing a square root.

use super::OrderError;
use super::odd::OddPoints;
use super::work_budget::WorkBudget;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// The two nearest unpaired points of an unpaired point, and its regret.
///
/// The two points are a pair, whose second is [`Index::NONE`] if there is only one; the regret,
/// which takes no more bits, is how much farther the second is than the first, in 1/256 steps.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct Choice<P>([P; 2]);

/// The [`Choice`] of a point with this width of numbers.
type ChoiceOf<I> = Choice<<I as Index>::Pair>;

/// A point first searches among those whose x differs by at most this many 1/256 steps (256 steps),
/// then within twice that, and so on.
const FIRST_REACH: u32 = 256 << 8;

/// Pairs all odd points, between which the pen will be lifted: `mate[i]` becomes the partner of odd
/// point `i`.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub(super) fn pair<I: Index>(
    odd: &OddPoints<'_, I>,
    scratch: &mut Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<(), OrderError> {
    mate.fill(I::NONE);
    with_regret(odd, scratch.reborrow(), work_budget, mate)?;
    if odd.has_free_ends() {
        free_the_longest(odd, mate);
    }
    let lengths: &mut [u32] = scratch.take(mate.len())?;
    for (point, (length, &partner)) in I::all().zip(lengths.iter_mut().zip(mate.iter())) {
        *length = odd.distance(point, partner);
    }
    while exchange(odd, lengths, work_budget, mate)? {}
    Ok(())
}

/// Finds the two nearest unpaired points of `chooser`.
fn choose<I: Index>(
    odd: &OddPoints<'_, I>,
    mate: &[I],
    chooser: I,
    work_budget: &mut WorkBudget<'_>,
) -> Result<ChoiceOf<I>, OrderError> {
    let mut reach = FIRST_REACH;
    loop {
        let among = odd.around(chooser, reach);
        let is_everyone = among.len() == odd.real_count().get();
        work_budget.work(1 + among.len() as u32 / 32)?;
        let [mut first, mut second] = [(u32::MAX, I::NONE); 2];
        for other in among {
            if other == chooser
                || mate[other.get()] != I::NONE
                || odd.least_distance(chooser, other) >= second.0
            {
                continue;
            }
            work_budget.work(1)?;
            let distance = odd.distance(chooser, other);
            if distance < first.0 {
                second = first;
                first = (distance, other);
            } else if distance < second.0 {
                second = (distance, other);
            }
        }
        // All points not yet looked at are farther than `reach`.
        if is_everyone || second.0 <= reach {
            return Ok(Choice([I::pair(first.1, second.1), (second.0 - first.0).into()]));
        }
        reach = reach.saturating_mul(2);
    }
}

/// Pairs the odd points, of which the one with the greatest regret chooses first. The regret is how
/// much worse its second choice is than its first.
fn with_regret<I: Index>(
    odd: &OddPoints<'_, I>,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<(), OrderError> {
    let count = odd.real_count();
    let choices: &mut [ChoiceOf<I>] = scratch.take(count.get())?;
    for (chooser, choice) in I::all().zip(choices.iter_mut()) {
        *choice = choose(odd, mate, chooser, work_budget)?;
    }
    for _ in 0..count.get() / 2 {
        let unmatched = |&point: &I| mate[point.get()] == I::NONE;
        // Among points of equal regret, the one with the lowest number is taken.
        let Some(chooser) =
            I::below(count).rev().filter(unmatched).max_by_key(|&point| choices[point.get()].0[1])
        else {
            break;
        };
        let chosen = I::halves(choices[chooser.get()].0[0])[0];
        mate[chooser.get()] = chosen;
        mate[chosen.get()] = chooser;
        work_budget.work(count.into() / 32)?;
        for point in I::below(count) {
            let [first, second] = I::halves(choices[point.get()].0[0]);
            let lost = |choice| choice == chooser || choice == chosen;
            if mate[point.get()] == I::NONE && (lost(first) || lost(second)) {
                choices[point.get()] = choose(odd, mate, point, work_budget)?;
            }
        }
    }
    Ok(())
}

/// Makes the ends of the longest move the start and the end of the path, so that this move is not
/// made.
fn free_the_longest<I: Index>(odd: &OddPoints<'_, I>, mate: &mut [I]) {
    let [start, end] = odd.free_ends();
    let longest = I::below(odd.real_count()).max_by_key(|&point| {
        let partner = mate[point.get()];
        odd.distance(point, partner)
    });
    if let Some(point) = longest {
        let partner = mate[point.get()];
        join(mate, point, start);
        join(mate, partner, end);
    }
}

/// Makes the points `a` and `b` partners, between which the pen will be lifted.
fn join<I: Index>(mate: &mut [I], a: I, b: I) {
    mate[a.get()] = b;
    mate[b.get()] = a;
}

/// Tries once to exchange the partners of each two pairs. `lengths` holds the length of each move
/// at both of its points. Returns whether anything became shorter.
fn exchange<I: Index>(
    odd: &OddPoints<'_, I>,
    lengths: &mut [u32],
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<bool, OrderError> {
    let count = odd.count();
    let mut improved = false;
    let mut longest = lengths.iter().copied().max().unwrap_or(0);
    for a in I::below(count) {
        let mut looked_at = 0;
        for c in (a + I::ONE).to(count) {
            // From this `c` on, the difference in x alone makes each new move from `a` as long as
            // both old moves together.
            if odd.distance_along_x(a, c) >= lengths[a.get()].saturating_add(longest) {
                break;
            }
            looked_at += 1;
            let (b, d) = (mate[a.get()], mate[c.get()]);
            if b == c || b < a || d < c {
                continue;
            }
            let now = lengths[a.get()] + lengths[c.get()];
            let parallel = sum_below(odd, [a, c, b, d], now);
            let crossed = sum_below(odd, [a, d, b, c], now);
            if parallel.min(crossed) >= now {
                continue;
            }
            let pairs = if parallel <= crossed { [(a, c), (b, d)] } else { [(a, d), (b, c)] };
            for (from, to) in pairs {
                join(mate, from, to);
                lengths[from.get()] = odd.distance(from, to);
                lengths[to.get()] = lengths[from.get()];
                longest = longest.max(lengths[to.get()]);
            }
            improved = true;
        }
        work_budget.work(1 + looked_at / 16)?;
    }
    Ok(improved)
}

/// Returns the total length of two moves, from `a` to `b` and from `c` to `d`. If it is not below
/// `bound`, the result may be any number from `bound` on; in most cases this is found without a
/// square root.
fn sum_below<I: Index>(odd: &OddPoints<'_, I>, [a, b, c, d]: [I; 4], bound: u32) -> u32 {
    if odd.least_distance(a, b) + odd.least_distance(c, d) >= bound {
        return u32::MAX;
    }
    odd.distance(a, b).saturating_add(odd.distance(c, d))
}

impl From<crate::stage::Aborted> for OrderError {
    fn from(_: crate::stage::Aborted) -> Self {
        Self::Aborted
    }
}

impl From<OutOfScratch> for OrderError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}
