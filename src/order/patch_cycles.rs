//! Changes pen-up moves so that they join the parts of the tour.
//!
//! The shortest moves often leave the tour in many cycles. If two moves of different parts exchange
//! their ends, the two parts become one. The exchanges that add the least length should come first;
//! this is approximated by an allowance that doubles from round to round (after Karp, "A patching
//! algorithm for the nonsymmetric traveling-salesman problem", 1979).

use super::neighbours::{Candidate, Neighbours};
use super::network::Network;
use super::partition::Partition;
use super::work_budget::WorkBudget;
use super::{OrderError, even_part};
use crate::index::Index;
use crate::stage::Scratch;

/// The length that an exchange may add in the first round, in 1/256 steps: 8 steps.
const FIRST_ALLOWANCE: i64 = 8 << 8;

/// Joins parts of the tour that do not meet, until no exchange between two neighbours in `near` can
/// join two more. For each odd station (where the pen must be lifted or put down), `mate` says to
/// which station its pen-up move leads; these moves are changed.
pub(super) fn patch_cycles<I: Index>(
    network: Network<'_, I>,
    near: Neighbours<'_, I>,
    mate: &mut [I],
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<(), OrderError> {
    let mut parts = Partition::singletons(scratch.take(mate.len())?);
    for chain in I::below(network.chains()) {
        let [start, end] = network.ends(chain);
        parts.unite(start, end);
    }
    let is_move = |mate: I| mate != I::NONE && mate != even_part();
    for (station, &mate) in I::all().zip(mate.iter()) {
        if is_move(mate) {
            parts.unite(station, mate);
        }
    }
    // No index below can fail: `mate` has an entry for each station, a neighbour is a station, and
    // what `is_move` lets through is the partner of one.
    let mut allowance = FIRST_ALLOWANCE;
    let mut apart = true;
    while core::mem::take(&mut apart) {
        for a in I::below(network.stations()) {
            for Candidate { station: c, .. } in near.of(a) {
                let (b, d) = (mate[a.get()], mate[c.get()]);
                work_budget.work(1)?;
                if !is_move(b) || !is_move(d) || parts.find(a) == parts.find(c) {
                    continue;
                }
                work_budget.work(4)?;
                let length = |from, to| i64::from(network.distance(from, to));
                let longer = length(a, c) + length(b, d) - length(a, b) - length(c, d);
                if longer <= allowance {
                    for (from, to) in [(a, c), (b, d)] {
                        mate[from.get()] = to;
                        mate[to.get()] = from;
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
