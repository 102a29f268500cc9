//! Pairs the odd points greedily with regret (Harrison 5.10.1), and then improves the pairs by
//! exchanges.
//!
//! The regret of a point is how much farther its second choice is than its first. The point with
//! the greatest regret is given its first choice; this is repeated until all are paired. Then any
//! two pairs exchange partners while that shortens them. The result has no proved bound. Points are
//! numbered in the order of their x. Those that are too far apart by x or y alone are skipped
//! without computing a square root.

use super::odd::OddPoints;
use super::work_budget::WorkBudget;
use super::{NONE, OrderError};
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// The two nearest unpaired points of an unpaired point.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Choice {
    /// How much farther the second choice is than the first, in 1/256 steps.
    regret: u32,
    /// The nearest unpaired point.
    first: u16,
    /// The second nearest unpaired point, or [`NONE`].
    second: u16,
}

/// A point first searches among those whose x differs by at most this many 1/256 steps (256 steps),
/// then within twice that, and so on.
const FIRST_REACH: u32 = 256 << 8;

/// Pairs all of `odd`: `mate[i]` becomes the partner of odd point `i`.
#[inline(never)] // Smaller than in its only caller.
pub(super) fn pair(
    odd: &OddPoints<'_>,
    scratch: &mut Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [u16],
) -> Result<(), OrderError> {
    mate.fill(NONE);
    with_regret(odd, scratch.reborrow(), work_budget, mate)?;
    if odd.has_free_ends() {
        free_the_longest(odd, mate);
    }
    let lengths: &mut [u32] = scratch.take(mate.len())?;
    for (point, (length, &partner)) in (0..).zip(lengths.iter_mut().zip(mate.iter())) {
        *length = odd.distance(point, partner);
    }
    while exchange(odd, lengths, work_budget, mate)? {}
    Ok(())
}

/// Finds the two nearest unpaired points of `chooser`.
fn choose(
    odd: &OddPoints<'_>,
    mate: &[u16],
    chooser: u16,
    work_budget: &mut WorkBudget<'_>,
) -> Result<Choice, OrderError> {
    let mut reach = FIRST_REACH;
    loop {
        let among = odd.around(chooser, reach);
        let is_everyone = among.len() == usize::from(odd.real_count());
        work_budget.work(1 + among.len() as u32 / 32)?;
        let [mut first, mut second] = [(u32::MAX, NONE); 2];
        for other in among {
            if other == chooser
                || mate[usize::from(other)] != NONE
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
            return Ok(Choice { regret: second.0 - first.0, first: first.1, second: second.1 });
        }
        reach = reach.saturating_mul(2);
    }
}

/// Pairs the odd points in the order of their regret.
fn with_regret(
    odd: &OddPoints<'_>,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [u16],
) -> Result<(), OrderError> {
    let count = odd.real_count();
    let choices: &mut [Choice] = scratch.take(usize::from(count))?;
    for (chooser, choice) in (0..).zip(choices.iter_mut()) {
        *choice = choose(odd, mate, chooser, work_budget)?;
    }
    for _ in 0..count / 2 {
        let unmatched = |&point: &u16| mate[usize::from(point)] == NONE;
        // Among points of equal regret, the one with the lowest number is taken.
        let Some(chooser) = (0..count)
            .rev()
            .filter(unmatched)
            .max_by_key(|&point| choices[usize::from(point)].regret)
        else {
            break;
        };
        let chosen = choices[usize::from(chooser)].first;
        mate[usize::from(chooser)] = chosen;
        mate[usize::from(chosen)] = chooser;
        work_budget.work(u32::from(count) / 32)?;
        for point in 0..count {
            let Choice { first, second, .. } = choices[usize::from(point)];
            let lost = |choice| choice == chooser || choice == chosen;
            if mate[usize::from(point)] == NONE && (lost(first) || lost(second)) {
                choices[usize::from(point)] = choose(odd, mate, point, work_budget)?;
            }
        }
    }
    Ok(())
}

/// Pairs the ends of the longest move with the two free ends of the path.
fn free_the_longest(odd: &OddPoints<'_>, mate: &mut [u16]) {
    let [start, end] = odd.free_ends();
    let longest = (0..odd.real_count()).max_by_key(|&point| {
        let partner = mate[usize::from(point)];
        odd.distance(point, partner)
    });
    if let Some(point) = longest {
        let partner = mate[usize::from(point)];
        join(mate, point, start);
        join(mate, partner, end);
    }
}

/// Makes `a` and `b` partners.
fn join(mate: &mut [u16], a: u16, b: u16) {
    mate[usize::from(a)] = b;
    mate[usize::from(b)] = a;
}

/// Tries once to exchange the partners of each two pairs. `lengths` holds the length of each move
/// at both of its points. Returns whether anything became shorter.
fn exchange(
    odd: &OddPoints<'_>,
    lengths: &mut [u32],
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [u16],
) -> Result<bool, OrderError> {
    let count = odd.count();
    let mut improved = false;
    let mut longest = lengths.iter().copied().max().unwrap_or(0);
    for a in 0..count {
        let mut looked_at = 0;
        for c in a + 1..count {
            // From this `c` on, the difference in x alone makes each new move from `a` as long as
            // both old moves together.
            if odd.distance_along_x(a, c) >= lengths[usize::from(a)].saturating_add(longest) {
                break;
            }
            looked_at += 1;
            let (b, d) = (mate[usize::from(a)], mate[usize::from(c)]);
            if b == c || b < a || d < c {
                continue;
            }
            let now = lengths[usize::from(a)] + lengths[usize::from(c)];
            let parallel = sum_below(odd, [a, c, b, d], now);
            let crossed = sum_below(odd, [a, d, b, c], now);
            if parallel.min(crossed) >= now {
                continue;
            }
            let pairs = if parallel <= crossed { [(a, c), (b, d)] } else { [(a, d), (b, c)] };
            for (from, to) in pairs {
                join(mate, from, to);
                lengths[usize::from(from)] = odd.distance(from, to);
                lengths[usize::from(to)] = lengths[usize::from(from)];
                longest = longest.max(lengths[usize::from(to)]);
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
fn sum_below(odd: &OddPoints<'_>, [a, b, c, d]: [u16; 4], bound: u32) -> u32 {
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
