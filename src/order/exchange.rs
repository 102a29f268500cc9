//! Shortens a tour by exchanges of pen-up moves (Lin and Kernighan).
//!
//! The tour is a cycle of chains. The moves between them have a cost; to stay at a station costs
//! nothing. An exchange cuts a move, adds one to a station that is nearer than the cut move was
//! long, cuts the tour there, and so on, until the open ends can be joined with a gain. The *gain
//! in hand* is the cost of the moves cut so far minus that of the moves added; the exchange goes on
//! only while it is positive. One step of an exchange changes two moves, in any of the ways that
//! keep the tour in one piece; these are found from positions in the cycle alone. Only if no step
//! joins the ends with a gain is the best step made, and the next one sought from there. After Lin
//! and Kernighan, "An effective heuristic algorithm for the traveling-salesman problem" (1973), and
//! Helsgaun's implementation of it (2000).

use super::cycle::Cycle;
use super::distances::Distances;
use super::incidence::Incidence;
use super::neighbours::{Candidate, Near, Neighbours};
use super::network::Network;
use super::search::StepSearch;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError};
use crate::array::MapEach;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

/// The greatest number of steps in one exchange, each of which changes two more moves.
const STEPS: usize = 3;

/// One step of an exchange: at which legs the tour is cut after the first cut, and how its parts
/// are joined anew.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<I> {
    /// The gain of the exchange if its open ends are joined after this step; 0 if there is none.
    pub gain: i64,
    /// The cost of the moves taken out so far less that of the moves put in, before the ends are
    /// joined.
    pub hand: i64,
    /// The leg after which the tour is cut for the second time.
    pub c: Leg<I>,
    /// Whether the new move from the first cut leads to the start of the leg after `c`; otherwise
    /// it leads to the end of `c`.
    pub onward: bool,
    /// The leg after which the tour is cut for the third time, and the same choice there; `None` if
    /// two cuts are enough.
    pub third: Option<(Leg<I>, bool)>,
}

// No index can fail: `is_waiting` lets a number in only if it is that of a station which is not in
// the queue. So `count` is below the length of `queue` before one is added; and `first` is below it
// too while `count` is not 0.

/// A queue of the stations around which an exchange may help, because a move near them has changed.
/// Each station is in it at most once.
struct Waiting<'s, I> {
    /// The stations, in a ring buffer with room for all.
    queue: &'s mut [I],
    /// 1 for each station that is in the queue, otherwise 0.
    is_waiting: &'s mut [u8],
    /// The index in `queue` of the station that comes next.
    first: usize,
    /// The number of stations in the queue.
    count: usize,
}

impl<'s, I: Index> Waiting<'s, I> {
    /// Makes an empty queue. Both slices must have one entry for each station, and those of
    /// `is_waiting` must be 0.
    fn new(queue: &'s mut [I], is_waiting: &'s mut [u8]) -> Self {
        Self { queue, is_waiting, first: 0, count: 0 }
    }

    /// Puts a station at the end of the queue, unless it is in it already.
    fn add(&mut self, station: I) {
        // The end of the gap is not a station.
        let Some(is_waiting) = self.is_waiting.get_mut(station.get()) else {
            return;
        };
        if core::mem::replace(is_waiting, 1) == 0 {
            let all = self.queue.len();
            let last = self.first + self.count;
            self.queue[if last >= all { last - all } else { last }] = station;
            self.count += 1;
        }
    }

    /// Takes the next station from the queue.
    fn next(&mut self) -> Option<I> {
        if self.count == 0 {
            return None;
        }
        let station = self.queue[self.first];
        self.first = if self.first + 1 == self.queue.len() { 0 } else { self.first + 1 };
        self.count -= 1;
        self.is_waiting[station.get()] = 0;
        Some(station)
    }
}

/// The stations to which a new move from a station may lead, in the order in which they are tried.
pub(super) struct Candidates<'s, I> {
    /// Whether the gap comes first.
    gap: bool,
    /// The station itself, if it comes next.
    own: Option<I>,
    /// Then the neighbours of the station.
    pub near: Near<'s, I>,
    /// The anchor, if it comes last.
    anchor: Option<I>,
}

impl<I: Index> Candidates<'_, I> {
    /// Returns the next of those before the neighbours.
    #[inline]
    pub fn first(&mut self) -> Option<Candidate<I>> {
        if core::mem::take(&mut self.gap) {
            return Some(Candidate::new(I::NONE));
        }
        self.own.take().map(Candidate::new)
    }
}

impl<I: Index> Iterator for Candidates<'_, I> {
    type Item = Candidate<I>;

    #[inline]
    fn next(&mut self) -> Option<Candidate<I>> {
        let near = self.first().or_else(|| self.near.next());
        near.or_else(|| self.anchor.take().map(Candidate::new))
    }
}

/// A tour that is being shortened, and the tables that are needed to exchange its pen-up moves.
pub(super) struct Exchanges<'s, 'a, I: Index> {
    /// The tour, as a cycle of legs that can be turned around and restored.
    pub cycle: Cycle<'s, I>,
    /// The stations (the points where the pen may stop) and the chains of segments between them.
    network: Network<'a, I>,
    /// Answers how far apart two stations are.
    distances: Distances<'s, 'a, I>,
    /// Lists the legs that begin at each station.
    incidence: Incidence<'s, I>,
    /// Lists the stations near each station, to which a new move may lead.
    neighbours: Neighbours<'s, I>,
    /// The stations around which an exchange is still to be tried.
    waiting: Waiting<'s, I>,
    /// The number of the gap among the legs; [`Index::NONE`] if the tour is a closed cycle. The gap
    /// stands for the open side of an open path.
    gap: I,
    /// The cost of a move besides its length, in 1/256 steps.
    lift_cost: u32,
}

impl<'s, 'a, I: Index> Exchanges<'s, 'a, I> {
    /// Makes the tour of `legs`. The gap, if there is one, has the number after those of the
    /// chains. All stations are put into the queue.
    pub fn new(
        network: Network<'a, I>,
        neighbours: Neighbours<'s, I>,
        legs: &'s mut [Leg<I>],
        gap: Option<I>,
        lift_cost: u32,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let stations = network.stations().get();
        let slots = scratch.take(legs.len())?;
        let mut waiting = Waiting::new(scratch.take(stations)?, scratch.take(stations)?);
        for station in I::below(network.stations()) {
            waiting.add(station);
        }
        let cycle = Cycle::new(legs, slots, scratch.take(Cycle::<I>::MEMORY)?);
        let incidence = Incidence::new(network, scratch)?;
        Ok(Self {
            cycle,
            network,
            distances: Distances::new(network, scratch)?,
            incidence,
            neighbours,
            waiting,
            gap: gap.unwrap_or(I::NONE),
            lift_cost,
        })
    }

    /// Takes all stations out of the queue.
    #[cfg(feature = "threads")]
    pub fn rest(&mut self) {
        while self.waiting.next().is_some() {}
    }

    /// Returns the scratch memory needed for this many stations, chains, and legs including the
    /// gap, in bytes. The cache of distances takes whatever else there is.
    pub const fn bytes(stations: usize, chains: usize, legs: usize) -> usize {
        Incidence::<I>::bytes(stations, chains)
            + Scratch::bytes_for::<I>(legs)
            + Scratch::bytes_for::<[I; 2]>(Cycle::<I>::MEMORY)
            + Scratch::bytes_for::<I>(stations)
            + Scratch::bytes_for::<u8>(stations)
            + Distances::<I>::bytes(stations)
    }

    /// Whether the tour is an open path, which is stored as a cycle with a gap.
    pub fn is_open(&self) -> bool {
        self.gap != I::NONE
    }

    /// Returns the station where a leg ends; [`Index::NONE`] for the gap, whose end is the
    /// [anchor](Network::anchor) if there is one.
    pub fn end(&self, leg: Leg<I>) -> I {
        if !self.is_gap(leg) {
            return self.network.end(leg);
        }
        match self.network.anchor() {
            Some(anchor) if !leg.reversed() => anchor,
            _ => I::NONE,
        }
    }

    /// Whether `leg` is the gap between the end and the start of an open path.
    pub fn is_gap(&self, leg: Leg<I>) -> bool {
        self.gap == I::new(leg.segment())
    }

    /// Returns the station where a leg begins; [`Index::NONE`] for the gap.
    pub fn start(&self, leg: Leg<I>) -> I {
        self.end(leg.flipped())
    }

    /// Returns the cost of a move in 1/256 steps: its length, the cost of the lift, and 1 more.
    /// Lengths are rounded down; without the 1, two moves might seem shorter than one.
    pub fn distance(&self, from: I, to: I) -> i64 {
        if from == I::NONE || to == I::NONE || from == to {
            0
        } else {
            i64::from(self.distances.between(from, to)) + i64::from(self.lift_cost) + 1
        }
    }

    /// Returns what remains of the saving `hand`, in the units of [`Self::distance`], when the cost
    /// of a move between two stations is subtracted from it; 0 if nothing remains. In most cases
    /// nothing does, and a bound shows this without a square root.
    pub fn left(&self, hand: i64, from: I, to: I) -> i64 {
        if from == I::NONE || to == I::NONE || from == to {
            return hand.max(0);
        }
        let hand = hand - i64::from(self.lift_cost);
        let bound = u32::try_from(hand.clamp(0, i64::from(u32::MAX))).unwrap_or(u32::MAX);
        // 1 more than the length is subtracted: see `distance`.
        self.distances.below(bound, from, to).map_or(0, |length| hand - i64::from(length) - 1)
    }

    /// As [`Self::left`], for the move from a station to one of its candidates.
    #[inline]
    pub fn left_to(&self, hand: i64, from: I, candidate: Candidate<I>) -> i64 {
        let Candidate { station, length } = candidate;
        if I::HAS_ROOM && length != Candidate::<I>::UNKNOWN {
            (hand - i64::from(self.lift_cost) - i64::from(length) - 1).max(0)
        } else {
            self.left(hand, from, station)
        }
    }

    /// Returns the cost of all moves of the tour.
    pub fn cost(&self) -> u64 {
        (0..self.cycle.len())
            .map(|index| self.move_after(self.cycle.leg(index)).max(0) as u64)
            .sum()
    }

    /// Returns the cost of the move after `leg`; 0 if `leg` ends where the next leg begins.
    pub fn move_after(&self, leg: Leg<I>) -> i64 {
        self.distance(self.end(leg), self.start(self.cycle.next(leg)))
    }

    /// Whether the pen is lifted after `leg`, so that [`Self::move_after`] is more than 0.
    pub fn lifts_after(&self, leg: Leg<I>) -> bool {
        self.lifts_between(leg, self.cycle.next(leg))
    }

    /// Whether the pen is lifted between two successive legs.
    #[inline]
    pub fn lifts_between(&self, leg: Leg<I>, next: Leg<I>) -> bool {
        let (from, to) = (self.end(leg), self.start(next));
        from != I::NONE && to != I::NONE && from != to
    }

    /// Tries exchanges around all stations in the queue, until it is empty or the budget is used
    /// up. Returns how much shorter the tour has become. If `keep`, the exchanges are final,
    /// otherwise they can be undone.
    pub fn exchange_all(
        &mut self,
        keep: bool,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<i64, OrderError> {
        let mut gain = 0;
        while let Some(station) = self.waiting.next() {
            while !work_budget.is_over()
                && let Some(more) = self.exchange_at(station, work_budget)?
            {
                gain += more;
                if keep {
                    self.cycle.settle();
                }
            }
        }
        Ok(gain)
    }

    /// Makes one exchange that takes out a pen-up move at `station`, if that makes the tour
    /// shorter. Returns by how much.
    fn exchange_at(
        &mut self,
        station: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let mut from = self.incidence.first(station);
        while let Some(leg) = from {
            if self.lifts_after(leg.flipped())
                && self.cycle.can_turn()
                && let Some(gain) = self.exchange(leg.flipped(), work_budget)?
            {
                return Ok(Some(gain));
            }
            from = self.incidence.next(leg);
        }
        Ok(None)
    }

    /// Takes out the move after `a`, and changes two more moves at a time as long as the moves
    /// taken out are longer than those put in, until joining the ends makes the tour shorter.
    /// Returns by how much. If nothing is found, the tour is unchanged.
    fn exchange(
        &mut self,
        a: Leg<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let turned = self.cycle.turned();
        let mut a = a;
        let mut hand = self.move_after(a);
        let mut touched = [[I::NONE; 6]; STEPS];
        for touched_now in 0..STEPS {
            let Some(step) = StepSearch::best_step(self, a, hand, work_budget)? else {
                break;
            };
            if I::HAS_ROOM && step.gain == 0 && touched_now + 1 == STEPS {
                // It would be taken back at once.
                work_budget.work(1 + self.moved(a, step) as u32 / 32)?;
                break;
            }
            touched[touched_now] = self.ends_of(a, step);
            a = self.make(a, step, work_budget)?;
            if step.gain > 0 {
                for station in touched.into_iter().flatten() {
                    self.waiting.add(station);
                }
                return Ok(Some(step.gain));
            }
            hand = step.hand;
        }
        self.cycle.take_back(turned);
        Ok(None)
    }

    /// Returns the stations to which a new move from `station` may lead: [`Index::NONE`] for the
    /// gap, if `by_gap`, then `station` itself, if several legs begin there, then its neighbours,
    /// and last, if `by_gap`, the anchor.
    #[inline]
    pub fn candidates(&self, station: I, by_gap: bool) -> Candidates<'s, I> {
        Candidates {
            gap: by_gap,
            own: self.legs_from(station).nth(1).map(|_| station),
            near: self.neighbours.of(station),
            anchor: self.network.anchor().filter(|_| by_gap),
        }
    }

    /// Returns the cost of a move from `station` to the nearer end of the path, or a very large
    /// number if the tour is a closed cycle.
    pub fn distance_to_path_ends(&self, station: I) -> i64 {
        self.to_path_ends(|end| self.distance(end, station))
    }

    /// Returns a lower bound of that cost with little work on a computer, and the cost itself on a
    /// board.
    pub fn least_to_path_ends(&self, station: I) -> i64 {
        if !I::HAS_ROOM {
            return self.distance_to_path_ends(station);
        }
        self.to_path_ends(|end| {
            if end == I::NONE || station == I::NONE || end == station {
                return 0;
            }
            i64::from(self.distances.at_least(end, station)) + i64::from(self.lift_cost) + 1
        })
    }

    /// Returns the lower of the costs of both ends of the path.
    #[inline]
    fn to_path_ends(&self, cost: impl Fn(I) -> i64) -> i64 {
        if !self.is_open() {
            return i64::MAX;
        }
        let gap = Leg::new(self.gap, false);
        let ends = [gap, gap.flipped()].map_each(|gap| self.start(self.cycle.next(gap)));
        let [a, b] = ends.map_each(cost);
        a.min(b)
    }

    /// Returns the stations (points where the pen may stop) at both ends of each of the moves that
    /// a step of an exchange takes out.
    fn ends_of(&self, a: Leg<I>, step: Step<I>) -> [I; 6] {
        let third = step.third.map_or(step.c, |(e, _)| e);
        let mut ends = [I::NONE; 6];
        for (pair, leg) in ends.chunks_exact_mut(2).zip([a, step.c, third]) {
            pair.copy_from_slice(&[self.end(leg), self.start(self.cycle.next(leg))]);
        }
        ends
    }

    /// Returns how many legs [`Self::make`] moves in a step of an exchange that cuts the tour after
    /// `a`.
    fn moved(&self, a: Leg<I>, step: Step<I>) -> usize {
        let position = |leg| self.cycle.position(leg);
        let steps = |from, to| self.cycle.legs_between(from, to);
        let (a, c) = (position(a), position(step.c));
        let Some((e, third_onward)) = step.third else {
            return self.cycle.turned_by(steps(a, c));
        };
        let e = position(e);
        let turns = match (step.onward, third_onward) {
            (true, true) => [steps(a, e), steps(c, e), steps(a, c)],
            (true, false) => [steps(a, e), steps(c, e), 0],
            (false, true) => [steps(a, c), steps(e, c), 0],
            (false, false) => [steps(a, c), steps(a, e), 0],
        };
        turns.into_iter().map(|inner| self.cycle.turned_by(inner)).sum()
    }

    /// Makes a step of an exchange that cuts the tour after `a`. Returns the leg after which the
    /// tour is still open.
    fn make(
        &mut self,
        a: Leg<I>,
        step: Step<I>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Leg<I>, OrderError> {
        let c = step.c;
        let (b, d) = (self.cycle.next(a), self.cycle.next(c));
        let Some((e, third_onward)) = step.third else {
            let moved = self.cycle.turn(a, c);
            work_budget.work(1 + moved as u32 / 32)?;
            return Ok(d.flipped());
        };
        let f = self.cycle.next(e);
        let moved = match (step.onward, third_onward) {
            // The tour becomes … a, d … e, b … c, f …
            (true, true) => self.cycle.swap(a, d, e),
            // The tour becomes … a, d … e, c … b, f … with `c … b` flipped.
            (true, false) => self.cycle.turn(a, e) + self.cycle.turn(a, d.flipped()),
            // The tour becomes … e, b … c, a … f, d … with `a … f` flipped.
            (false, true) => self.cycle.turn(a, c) + self.cycle.turn(d.flipped(), f.flipped()),
            // The tour becomes … a, c … f, b … e, d … with `c … f` flipped.
            (false, false) => self.cycle.turn(a, c) + self.cycle.turn(f.flipped(), b.flipped()),
        };
        work_budget.work(1 + moved as u32 / 32)?;
        Ok(if third_onward { e } else { f.flipped() })
    }

    /// Returns the legs that begin at a station; for [`Index::NONE`], the gap in both directions.
    /// With an anchor, each end of the gap is a station of its own.
    pub fn legs_from(&self, station: I) -> impl Iterator<Item = Leg<I>> + '_ {
        let first = match self.incidence.first_at(station) {
            Some(first) => first,
            None => self.gap_from(station),
        };
        core::iter::successors(first, |&leg| match self.incidence.next_after(leg) {
            Some(next) => next,
            None => self.gap_after(leg),
        })
    }

    /// Returns the direction of the gap that begins at what is no station of the network.
    fn gap_from(&self, station: I) -> Option<Leg<I>> {
        self.is_open().then(|| Leg::new(self.gap, station != I::NONE))
    }

    /// Returns the other direction of the gap, which begins at the same station as `gap` if there
    /// is no anchor.
    fn gap_after(&self, gap: Leg<I>) -> Option<Leg<I>> {
        let is_first = self.network.anchor().is_none() && !gap.reversed();
        is_first.then(|| gap.flipped())
    }

    /// Puts the stations where `legs` end into the queue, so that exchanges are tried around them.
    pub fn wake(&mut self, legs: &[Leg<I>]) {
        for &leg in legs {
            let station = self.end(leg);
            self.waiting.add(station);
        }
    }
}
