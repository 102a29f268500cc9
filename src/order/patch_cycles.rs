//! Changes pen-up moves so that they join the parts of the tour.
//!
//! The shortest moves often leave the tour in many cycles. If two moves of different parts exchange
//! their ends, the two parts become one. The exchanges that add the least length should come first;
//! this is approximated by an allowance that doubles from round to round (after Karp, "A patching
//! algorithm for the nonsymmetric traveling-salesman problem", 1979).

use super::neighbours::Neighbours;
use super::network::Network;
use super::partition::Partition;
use super::work_budget::WorkBudget;
use super::{EVEN_PART, NONE, OrderError};
use crate::stage::Scratch;

/// The length that an exchange may add in the first round, in 1/256 steps: 8 steps.
const FIRST_ALLOWANCE: i64 = 8 << 8;

/// Changes the moves `mate` between odd stations until no exchange between two neighbours in `near`
/// can join two more parts.
pub(super) fn patch_cycles(
    network: Network<'_>,
    near: Neighbours<'_>,
    mate: &mut [u16],
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<(), OrderError> {
    let mut parts = Partition::singletons(scratch.take(mate.len())?);
    for chain in 0..network.chains() {
        let [start, end] = network.ends(chain);
        parts.unite(start, end);
    }
    let is_move = |mate: u16| mate != NONE && mate != EVEN_PART;
    for (station, &mate) in (0..).zip(mate.iter()) {
        if is_move(mate) {
            parts.unite(station, mate);
        }
    }
    let mut allowance = FIRST_ALLOWANCE;
    let mut apart = true;
    while core::mem::take(&mut apart) {
        for a in 0..network.stations() {
            for c in near.of(a) {
                let (b, d) = (mate[usize::from(a)], mate[usize::from(c)]);
                work_budget.work(1)?;
                if !is_move(b) || !is_move(d) || parts.find(a) == parts.find(c) {
                    continue;
                }
                work_budget.work(4)?;
                let length = |from, to| i64::from(network.distance(from, to));
                let longer = length(a, c) + length(b, d) - length(a, b) - length(c, d);
                if longer <= allowance {
                    for (from, to) in [(a, c), (b, d)] {
                        mate[usize::from(from)] = to;
                        mate[usize::from(to)] = from;
                    }
                    parts.unite(a, c);
                } else {
                    apart = true;
                }
            }
        }
        allowance *= 2;
    }
    Ok(())
}
