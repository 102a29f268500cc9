//! Searches the next step of an exchange.
//!
//! From the first cut, new moves are tried to the stations near it. Each move there is cut in turn,
//! and the same is repeated from the far side of that cut. This is the innermost loop of the
//! ordering. Therefore what remains of the gain is mostly found without computing a distance, and a
//! cut is looked up only where the tour would stay in one piece.

use super::cycle::LegPosition;
use super::exchange::{Exchanges, Step};
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::index::Index;

/// The result of trying a new move to a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Nothing was found yet, and other stations may give a better step.
    GoOn,
    /// The station is too far away, and so are those after it.
    TooFar,
    /// A step that makes the tour shorter has been found.
    Found,
}

/// Where in the tour the move at the start of a leg lies, seen from the first cut.
struct Before {
    /// The position and the direction of the leg.
    position: LegPosition,
    /// Whether the leg runs in the direction of the leg before the first cut.
    onward: bool,
    /// The number of legs between the first cut and this move, counted in the direction of the
    /// first cut.
    legs_between: usize,
}

/// A move that an exchange takes out of the tour, so that new ones can replace it.
struct Cut<I> {
    /// The leg before the cut, in the direction of the first cut.
    leg: Leg<I>,
    /// Whether the new move leads to the start of the leg after the cut; otherwise it leads to the
    /// end of the leg before the cut.
    onward: bool,
    /// The station on the other side of the cut, from which the search goes on.
    far: I,
    /// The number of legs between the first cut and this one.
    legs_between: usize,
}

/// Looks for the best step of an exchange that begins with the cut after the leg `a`.
pub(super) struct StepSearch<'e, 's, 'a, I: Index> {
    /// The tour whose moves are exchanged, with its tables.
    tour: &'e Exchanges<'s, 'a, I>,
    /// The leg after which the tour is cut first.
    a: Leg<I>,
    /// The leg that followed `a` before the tour was cut.
    b: Leg<I>,
    /// The position of the leg `a` in the cycle, and its direction there.
    a_position: LegPosition,
    /// The station at which `b` begins, to which the exchange leads back at last.
    first: I,
    /// The cost from `first` to the nearer end of the path; very large if the tour is a closed
    /// cycle.
    to_ends: i64,
    /// The best step found: one that makes the tour shorter, or else the one that leaves most to go
    /// on with.
    best: Option<Step<I>>,
}

impl<'e, 's, 'a, I: Index> StepSearch<'e, 's, 'a, I> {
    /// Returns the first step found that makes the tour shorter, or else the one that leaves the
    /// most of `hand` (the moves taken out less those put in); `None` if no step is possible.
    pub fn best_step(
        tour: &'e Exchanges<'s, 'a, I>,
        a: Leg<I>,
        hand: i64,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<Step<I>>, OrderError> {
        let end = tour.end(a);
        if end == I::NONE {
            return Ok(None);
        }
        let b = tour.cycle.next(a);
        let first = tour.start(b);
        let a_position = tour.cycle.position(a);
        let to_ends = tour.distance_to_path_ends(first);
        let mut search = Self { tour, a, b, a_position, first, to_ends, best: None };
        work_budget.work(2)?;
        for second in tour.candidates(end, tour.is_open()) {
            if search.second_cut(hand, end, second, work_budget)? != Outcome::GoOn {
                break;
            }
        }
        Ok(search.best)
    }

    /// Tries a new move from `end` to the station `second`, and takes each move there out in turn.
    fn second_cut(
        &mut self,
        hand: i64,
        end: I,
        second: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Outcome, OrderError> {
        work_budget.work(1)?;
        let tour = self.tour;
        let hand = tour.left(hand, end, second);
        if hand == 0 {
            return Ok(Outcome::TooFar);
        }
        for leg in tour.legs_from(second) {
            if leg == self.a || leg == self.b || leg.flipped() == self.a {
                continue;
            }
            let cut = self.cut(leg, self.before(leg));
            work_budget.work(2)?;
            let hand = hand + tour.distance(cut.far, second);
            let gain = tour.left(hand, cut.far, self.first);
            if !cut.onward && gain > 0 {
                let Cut { leg: c, onward, .. } = cut;
                self.best = Some(Step { gain, hand, c, onward, third: None });
                return Ok(Outcome::Found);
            }
            // A longer step through the gap is found from its other end.
            if cut.far != I::NONE
                && second != I::NONE
                && self.third_cuts(hand, &cut, work_budget)? == Outcome::Found
            {
                return Ok(Outcome::Found);
            }
        }
        Ok(Outcome::GoOn)
    }

    /// Tries new moves from the open end of the second cut to the stations near it.
    fn third_cuts(
        &mut self,
        hand: i64,
        second: &Cut<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Outcome, OrderError> {
        let by_gap = self.tour.is_open() && hand > self.to_ends;
        for third in self.tour.candidates(second.far, by_gap) {
            match self.third_cut(hand, second, third, work_budget)? {
                Outcome::GoOn => {}
                Outcome::TooFar => break,
                Outcome::Found => return Ok(Outcome::Found),
            }
        }
        Ok(Outcome::GoOn)
    }

    /// Tries a new move from the open end of the second cut to the station `third`, and takes each
    /// move there out in turn.
    fn third_cut(
        &mut self,
        hand: i64,
        second: &Cut<I>,
        third: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Outcome, OrderError> {
        work_budget.work(1)?;
        let tour = self.tour;
        for leg in tour.legs_from(third) {
            let before = self.before(leg);
            // Only some positions of the third cut keep the tour in one piece, and it must differ
            // from the first two cuts.
            let within = before.legs_between <= second.legs_between;
            let onward = second.onward || before.onward;
            if within == onward
                || before.legs_between == 0
                || before.legs_between == second.legs_between
            {
                continue;
            }
            // Most candidates are refused by their position, for which no distance is needed.
            let hand = tour.left(hand, second.far, third);
            if hand == 0 {
                return Ok(Outcome::TooFar);
            }
            work_budget.work(2)?;
            let cut = self.cut(leg, before);
            let hand = hand + tour.distance(cut.far, third);
            let gain = tour.left(hand, cut.far, self.first);
            if gain > 0 || self.best.is_none_or(|best| hand > best.hand) {
                let third = Some((cut.leg, cut.onward));
                let (c, onward) = (second.leg, second.onward);
                self.best = Some(Step { gain, hand, c, onward, third });
            }
            if gain > 0 {
                return Ok(Outcome::Found);
            }
        }
        Ok(Outcome::GoOn)
    }

    /// Returns the position of the move at the start of `leg`.
    fn before(&self, leg: Leg<I>) -> Before {
        let cycle = &self.tour.cycle;
        let position = cycle.position(leg);
        let onward = position.forward == self.a_position.forward;
        let legs_between = match (onward, cycle.legs_between(self.a_position, position)) {
            (false, legs_between) => legs_between,
            (true, 0) => cycle.len() - 1,
            (true, legs_between) => legs_between - 1,
        };
        Before { position, onward, legs_between }
    }

    /// Returns the cut that takes the move at the start of `leg` out of the tour.
    fn cut(&self, leg: Leg<I>, Before { position, onward, legs_between }: Before) -> Cut<I> {
        let previous = self.tour.cycle.before(position);
        let far = self.tour.end(previous);
        Cut { leg: if onward { previous } else { leg.flipped() }, onward, far, legs_between }
    }
}
