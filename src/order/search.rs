//! Searches the next step of an exchange.
//!
//! From the first cut, new moves are tried to the stations near it. Each move there is cut in turn,
//! and the same is repeated from the far side of that cut. This is the innermost loop of the
//! ordering. Therefore what remains of the gain is mostly found without computing a distance, and a
//! cut is looked up only where the tour would stay in one piece.

use super::cycle::Origin;
use super::exchange::{Exchanges, Step};
use super::neighbours::Candidate;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::index::Index;
use crate::stage::Aborted;

/// Why no further stations are tried for a new move.
enum End {
    /// This station is too far away, and so are those after it.
    TooFar,
    /// A step that makes the tour shorter has been found.
    Found,
    /// The work was aborted.
    Aborted(Aborted),
}

impl From<Aborted> for End {
    fn from(aborted: Aborted) -> Self {
        Self::Aborted(aborted)
    }
}

/// The numbers of legs that may lie between the first cut and the third.
#[derive(Clone, Copy)]
struct Allowed {
    /// The least of these numbers.
    least: usize,
    /// How many there are.
    count: usize,
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
    /// The same leg, from which the moves after the first cut are counted.
    origin: Origin,
    /// The station at which `b` begins, to which the exchange leads back at last.
    first: I,
    /// The cost from `first` to the nearer end of the path, or on a computer a lower bound of it;
    /// very large if the tour is a closed cycle.
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
        let origin = Origin::new(tour.cycle.position(a));
        let to_ends = tour.least_to_path_ends(first);
        let mut search = Self { tour, a, b, origin, first, to_ends, best: None };
        work_budget.work(2)?;
        for second in tour.candidates(end, tour.is_open()) {
            match search.second_cut(hand, end, second, work_budget) {
                Ok(()) => {}
                Err(End::TooFar | End::Found) => break,
                Err(End::Aborted(aborted)) => return Err(aborted.into()),
            }
        }
        Ok(search.best)
    }

    /// Tries a new move from `end` to the station `second`, and takes each move there out in turn.
    fn second_cut(
        &mut self,
        hand: i64,
        end: I,
        second: Candidate<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), End> {
        work_budget.work(1)?;
        let tour = self.tour;
        let hand = tour.left_to(hand, end, second);
        if hand == 0 {
            return Err(End::TooFar);
        }
        let second = second.station;
        for leg in tour.legs_from(second) {
            if leg == self.a || leg == self.b || leg.flipped() == self.a {
                continue;
            }
            work_budget.work(2)?;
            if second == I::NONE && !self.reaches_ends(hand) {
                // The path cannot be opened elsewhere with a gain.
                continue;
            }
            let cut = self.cut(leg);
            let hand = hand + tour.distance(cut.far, second);
            let gain = tour.left(hand, cut.far, self.first);
            if !cut.onward && gain > 0 {
                let Cut { leg: c, onward, .. } = cut;
                self.best = Some(Step { gain, hand, c, onward, third: None });
                return Err(End::Found);
            }
            // A longer step through the gap is found from its other end.
            if cut.far != I::NONE && second != I::NONE {
                match self.third_cuts(hand, &cut, work_budget) {
                    Err(End::TooFar) => {}
                    result => result?,
                }
            }
        }
        Ok(())
    }

    /// Tries new moves from the open end of the second cut to the stations near it.
    #[cfg_attr(feature = "threads", inline(never))] // Its loop needs the registers.
    fn third_cuts(
        &mut self,
        hand: i64,
        second: &Cut<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), End> {
        let by_gap = self.reaches_ends(hand);
        // Only some positions of the third cut keep the tour in one piece, and it must differ from
        // the first two cuts.
        let within = Allowed { least: 1, count: second.legs_between.saturating_sub(1) };
        let beyond = Allowed { least: second.legs_between + 1, count: usize::MAX / 2 };
        let allowed = [if second.onward { beyond } else { within }, beyond];
        let mut candidates = self.tour.candidates(second.far, by_gap);
        if I::HAS_ROOM {
            // Most candidates are neighbours, and a loop for these alone is faster.
            while let Some(third) = candidates.first() {
                self.third_cut(hand, second, third, &allowed, work_budget)?;
            }
            for third in candidates.near.by_ref() {
                self.third_cut(hand, second, third, &allowed, work_budget)?;
            }
        }
        for third in candidates {
            self.third_cut(hand, second, third, &allowed, work_budget)?;
        }
        Ok(())
    }

    /// Tries a new move from the open end of the second cut to the station `third`, and takes each
    /// move there out in turn.
    #[cfg_attr(feature = "threads", inline(always))] // Most calls do nothing else.
    fn third_cut(
        &mut self,
        hand: i64,
        second: &Cut<I>,
        third: Candidate<I>,
        allowed: &[Allowed; 2],
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), End> {
        work_budget.work(1)?;
        let tour = self.tour;
        for leg in tour.legs_from(third.station) {
            let (onward, legs_between) = tour.cycle.moves_between(self.origin, leg);
            let Allowed { least, count } = allowed[usize::from(onward)];
            // Most candidates are refused by their position, for which no distance is needed.
            if legs_between.wrapping_sub(least) < count {
                self.third_leg(hand, second, third, leg, work_budget)?;
            }
        }
        Ok(())
    }

    /// Takes out the move at the start of `leg`, to which a new move from the open end of the
    /// second cut leads.
    #[cfg_attr(feature = "threads", inline(never))] // The loop around it needs the registers.
    fn third_leg(
        &mut self,
        hand: i64,
        second: &Cut<I>,
        third: Candidate<I>,
        leg: Leg<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), End> {
        let tour = self.tour;
        let hand = tour.left_to(hand, second.far, third);
        if hand == 0 {
            return Err(End::TooFar);
        }
        work_budget.work(2)?;
        let cut = self.cut(leg);
        let hand = hand + tour.distance(cut.far, third.station);
        let gain = tour.left(hand, cut.far, self.first);
        if gain > 0 || self.best.is_none_or(|best| hand > best.hand) {
            let third = Some((cut.leg, cut.onward));
            let (c, onward) = (second.leg, second.onward);
            self.best = Some(Step { gain, hand, c, onward, third });
        }
        if gain > 0 { Err(End::Found) } else { Ok(()) }
    }

    /// Whether `hand` is more than a move to the nearer end of the path costs.
    #[inline]
    fn reaches_ends(&self, hand: i64) -> bool {
        hand > self.to_ends && (!I::HAS_ROOM || hand > self.tour.distance_to_path_ends(self.first))
    }

    /// Returns the cut that takes the move at the start of `leg` out of the tour.
    #[cfg_attr(feature = "threads", inline(always))] // A call takes longer than the rest.
    fn cut(&self, leg: Leg<I>) -> Cut<I> {
        let (onward, legs_between) = self.tour.cycle.moves_between(self.origin, leg);
        let previous = self.tour.cycle.previous(leg);
        let far = self.tour.end(previous);
        Cut { leg: if onward { previous } else { leg.flipped() }, onward, far, legs_between }
    }
}
