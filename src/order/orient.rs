//! Chooses the best direction of each stroke and leaves the order of the strokes as it is.
//!
//! Exchanges repair some faults only slowly. For example, in a hatching drawn to and fro, two
//! successive lines may start from the same side; then every line from this fault to the next must
//! be reversed. For a given order, dynamic programming finds the best directions of all strokes at
//! once: the best cost up to a stroke depends only on the direction of that stroke (Bellman's
//! principle).

use super::exchange::Exchanges;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::array::MapEach;
use crate::index::Index;

/// Reverses strokes (what is drawn between two pen-up moves) where that makes the tour shorter.
/// Returns by how much. `choices` must have an entry for each leg of the tour.
pub(super) fn orient<I: Index>(
    tour: &mut Exchanges<'_, '_, I>,
    choices: &mut [u8],
    work_budget: &mut WorkBudget<'_>,
) -> Result<i64, OrderError> {
    let Some(begin) = tour.first_of_a_stroke() else {
        return Ok(0);
    };
    // The least cost up to a stroke that is drawn as it is, and that of the same stroke reversed,
    // which then ends where it began. The first stroke is not reversed.
    let mut least = [0, i64::MAX / 2];
    let (mut ends, mut first_start, mut old) = ([I::NONE; 2], I::NONE, 0);
    // No index below can fail: each stroke has at least one leg, and the walk ends at the leg where
    // it began. So there are no more strokes than legs, and `choices` has an entry for each of
    // these. A direction is 0 or 1.
    let mut strokes = 0;
    let mut leg = begin;
    loop {
        work_budget.work(4)?;
        let last = tour.last_of_stroke(leg, begin);
        let (start, end) = (tour.start(leg), tour.end(last));
        if strokes == 0 {
            first_start = start;
        } else {
            let reach = |to| {
                [0, 1].map_each(|direction| least[direction] + tour.distance(ends[direction], to))
            };
            let (unchanged, reversed) = (reach(start), reach(end));
            choices[strokes] =
                u8::from(unchanged[1] < unchanged[0]) | u8::from(reversed[1] < reversed[0]) << 1;
            least = [unchanged, reversed].map_each(|[a, b]| a.min(b));
            // Last, so that the distance that is kept with `start` is that of a move of the tour.
            old += tour.distance(ends[0], start);
        }
        ends = [end, start];
        strokes += 1;
        leg = tour.cycle.next(last);
        if leg == begin {
            break;
        }
    }
    old += tour.distance(ends[0], first_start);
    let closed =
        [0, 1].map_each(|direction| least[direction] + tour.distance(ends[direction], first_start));
    let gain = old - closed[0].min(closed[1]);
    if gain <= 0 {
        return Ok(0);
    }
    // Go back from the last stroke, and find for each stroke the direction that gives the best end.
    let mut direction = u8::from(closed[1] < closed[0]);
    for stroke in (1..strokes).rev() {
        direction = core::mem::replace(&mut choices[stroke], direction) >> direction & 1;
    }
    let mut leg = begin;
    for (stroke, &direction) in choices.iter().enumerate().take(strokes) {
        let last = tour.last_of_stroke(leg, begin);
        let (before, after) = (tour.cycle.previous(leg), tour.cycle.next(last));
        if stroke > 0 && direction == 1 {
            tour.wake(&[before, leg.flipped(), last, after.flipped()]);
            let moved = tour.cycle.turn(before, last);
            work_budget.work(moved as u32 / 32)?;
        }
        leg = after;
    }
    tour.cycle.settle();
    Ok(gain)
}

impl<I: Index> Exchanges<'_, '_, I> {
    /// Returns a leg before which the pen is lifted; for an open path, the gap between its end and
    /// its start.
    fn first_of_a_stroke(&self) -> Option<Leg<I>> {
        let legs = || (0..self.cycle.len()).map(|index| self.cycle.leg(index));
        let begins = |leg: &Leg<I>| self.lifts_after(self.cycle.previous(*leg));
        legs().find(|&leg| self.is_gap(leg)).or_else(|| legs().find(begins))
    }

    /// Returns the last leg that is drawn without a lift from `leg` on. The gap of an open path is
    /// a stroke by itself, and a stroke ends before `begin`.
    fn last_of_stroke(&self, leg: Leg<I>, begin: Leg<I>) -> Leg<I> {
        let mut last = leg;
        while !self.is_gap(last) {
            let next = self.cycle.next(last);
            if self.lifts_between(last, next) || self.is_gap(next) || next == begin {
                break;
            }
            last = next;
        }
        last
    }
}
