//! Pen-up moves by greed with regret (Harrison 5.10.1), then by the exchange of pairs.
//!
//! The point whose second choice is so much worse than its first is given its first choice; so to
//! the end. Then any two moves give up their ends for each other's while that shortens them.
//! Nothing is proved of the result. Points are numbered by their x; those too far off by x or y alone
//! are passed over without a square root.

use super::odd::OddPoints;
use super::work_budget::WorkBudget;
use super::{NONE, OrderError};
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// What an unmatched point would choose.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Choice {
    /// How much farther the second choice is.
    regret: u32,
    first: u16,
    second: u16,
}

/// A point first chooses among those within so far by x, 256 steps, then within twice that, and so on.
const FIRST_REACH: u32 = 256 << 8;

/// Pairs all of `odd`: `mate[i]` is the partner of odd point `i`.
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
        // All others are farther off than `reach`.
        if is_everyone || second.0 <= reach {
            return Ok(Choice { regret: second.0 - first.0, first: first.1, second: second.1 });
        }
        reach = reach.saturating_mul(2);
    }
}

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
        // The lowest number among equals.
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

/// Gives the ends of the longest move to the two free ends of the path.
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

fn join(mate: &mut [u16], a: u16, b: u16) {
    mate[usize::from(a)] = b;
    mate[usize::from(b)] = a;
}

/// One round of exchanges over all pairs of moves, whose `lengths` stand with both of their points; says
/// whether it shortened anything.
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
            // From here on either new move from `a` is as long as both old ones, by its x alone.
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

/// The length of two moves, first to second and third to fourth point; any large number if it is not below
/// `bound`, which is mostly seen without a square root.
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
