//! The search for the next step of an exchange.
//!
//! From the first cut the way goes on to the stations near it, each move there is cut in turn, and the same
//! again from the other side of that cut. It is the innermost of all loops of the order: what a way leaves
//! in hand is mostly seen without a distance, and a cut is looked up only where the tour would stay one.

use super::cycle::Stand;
use super::exchange::{Exchanges, Step};
use super::work_budget::WorkBudget;
use super::{Leg, NONE, OrderError};

/// What became of trying a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Others may do better.
    GoOn,
    /// It is too far away, and so are those after it.
    TooFar,
    /// A step with a gain is found.
    Found,
}

/// Where the move at the start of a leg is.
struct Before {
    /// How the leg stands.
    stand: Stand,
    /// Whether the leg goes the way of the first cut.
    onward: bool,
    /// How many legs the move is after the first cut, that way.
    way: usize,
}

/// A move that is cut.
struct Cut {
    /// The leg before it, the way of the first cut.
    leg: Leg,
    /// Whether the leg after it was sought, else that before it.
    onward: bool,
    /// The station on the other side of it.
    far: u16,
    /// How many legs it is after the first cut.
    way: usize,
}

/// A search for a step from the cut after `a`.
pub(super) struct StepSearch<'e, 's, 'a> {
    tour: &'e Exchanges<'s, 'a>,
    a: Leg,
    b: Leg,
    a_stands: Stand,
    /// The station after the first cut, where the tour is to be joined again.
    first: u16,
    /// From there to the nearer end of the path; far if it is a cycle.
    to_ends: i64,
    /// The step that leaves a gain, or the most in hand.
    best: Option<Step>,
}

impl<'e, 's, 'a> StepSearch<'e, 's, 'a> {
    /// The first step found that leaves a gain, else the one that leaves the most of `hand`.
    pub fn best_step(
        tour: &'e Exchanges<'s, 'a>,
        a: Leg,
        hand: i64,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<Step>, OrderError> {
        let end = tour.end(a);
        if end == NONE {
            return Ok(None);
        }
        let b = tour.cycle.next(a);
        let first = tour.start(b);
        let a_stands = tour.cycle.stand(a);
        let to_ends = tour.distance_to_path_ends(first);
        let mut search = Self { tour, a, b, a_stands, first, to_ends, best: None };
        work_budget.work(2)?;
        for second in tour.candidates(end, tour.is_open()) {
            if search.second_cut(hand, end, second, work_budget)? != Outcome::GoOn {
                break;
            }
        }
        Ok(search.best)
    }

    /// Goes from `end` to `second` and cuts each move there.
    fn second_cut(
        &mut self,
        hand: i64,
        end: u16,
        second: u16,
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
            // What a longer step by the gap can do is found from its other end.
            if cut.far != NONE
                && second != NONE
                && self.third_cuts(hand, &cut, work_budget)? == Outcome::Found
            {
                return Ok(Outcome::Found);
            }
        }
        Ok(Outcome::GoOn)
    }

    /// Goes on from the far side of the second cut to the stations near it.
    fn third_cuts(
        &mut self,
        hand: i64,
        second: &Cut,
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

    /// Goes from the far side of the second cut to `third` and cuts each move there.
    fn third_cut(
        &mut self,
        hand: i64,
        second: &Cut,
        third: u16,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Outcome, OrderError> {
        work_budget.work(1)?;
        let tour = self.tour;
        let hand = tour.left(hand, second.far, third);
        if hand == 0 {
            return Ok(Outcome::TooFar);
        }
        for leg in tour.legs_from(third) {
            let before = self.before(leg);
            // Where the third cut may be for the tour to stay one; not at the first two.
            let within = before.way <= second.way;
            let onward = second.onward || before.onward;
            if within == onward || before.way == 0 || before.way == second.way {
                continue;
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

    /// Where the move at the start of `leg` is.
    fn before(&self, leg: Leg) -> Before {
        let cycle = &self.tour.cycle;
        let stand = cycle.stand(leg);
        let onward = stand.forward == self.a_stands.forward;
        let way = match (onward, cycle.way(self.a_stands, stand)) {
            (false, way) => way,
            (true, 0) => cycle.len() - 1,
            (true, way) => way - 1,
        };
        Before { stand, onward, way }
    }

    /// The cut of the move at the start of `leg`.
    fn cut(&self, leg: Leg, Before { stand, onward, way }: Before) -> Cut {
        let previous = self.tour.cycle.before(stand);
        let far = self.tour.end(previous);
        Cut { leg: if onward { previous } else { leg.flipped() }, onward, far, way }
    }
}
