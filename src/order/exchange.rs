//! Exchanges of moves that make a tour shorter (Lin and Kernighan).
//!
//! The tour is a cycle of chains; the moves between them cost, staying at a station costs nothing.
//! An exchange cuts a move, goes to a station nearer than that move was long, cuts the tour there,
//! and so on while there is still gain in hand, until the ends are joined with some gain left. A
//! step of it changes two moves, in any of the ways that leave the tour whole, found by their places
//! in the cycle alone; only when no step joins with a gain is the best of them made and the next one
//! sought from there. After Lin and Kernighan, "An effective heuristic algorithm for the
//! traveling-salesman problem" (1973), and Helsgaun's implementation of it (2000).

use super::cycle::Cycle;
use super::distances::Distances;
use super::incidence::Incidence;
use super::neighbours::Neighbours;
use super::network::Network;
use super::search::StepSearch;
use super::work_budget::WorkBudget;
use super::{Leg, NONE, OrderError};
use crate::stage::{OutOfScratch, Scratch};

/// How many steps an exchange may take.
const STEPS: usize = 2;

/// A part of an exchange: which moves are cut after the first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// What joining the ends after it leaves, 0 if nothing.
    pub gain: i64,
    /// What is left before that.
    pub hand: i64,
    /// The leg before the second cut.
    pub c: Leg,
    /// Whether the way goes on from the first cut to the leg after `c`, else to the end of `c`.
    pub onward: bool,
    /// The same for the third cut, if there is one.
    pub third: Option<(Leg, bool)>,
}

/// Stations around which an exchange may help, each once, first come first served.
struct Waiting<'s> {
    queue: &'s mut [u16],
    is_waiting: &'s mut [u8],
    first: usize,
    count: usize,
}

impl<'s> Waiting<'s> {
    fn new(queue: &'s mut [u16], is_waiting: &'s mut [u8]) -> Self {
        Self { queue, is_waiting, first: 0, count: 0 }
    }

    fn add(&mut self, station: u16) {
        // Nowhere, the end of the gap, is no station.
        let Some(is_waiting) = self.is_waiting.get_mut(usize::from(station)) else {
            return;
        };
        if core::mem::replace(is_waiting, 1) == 0 {
            let all = self.queue.len();
            let last = self.first + self.count;
            self.queue[if last >= all { last - all } else { last }] = station;
            self.count += 1;
        }
    }

    fn next(&mut self) -> Option<u16> {
        if self.count == 0 {
            return None;
        }
        let station = self.queue[self.first];
        self.first = if self.first + 1 == self.queue.len() { 0 } else { self.first + 1 };
        self.count -= 1;
        self.is_waiting[usize::from(station)] = 0;
        Some(station)
    }
}

/// The tour, and what is needed to exchange its moves.
pub(super) struct Exchanges<'s, 'a> {
    pub cycle: Cycle<'s>,
    network: Network<'a>,
    distances: Distances<'s, 'a>,
    incidence: Incidence<'s>,
    neighbours: Neighbours<'s>,
    waiting: Waiting<'s>,
    /// The number of the gap among the legs, if there is one.
    gap: Option<u16>,
    /// What a move costs besides its length, in 1/256 steps.
    lift: u32,
}

impl<'s, 'a> Exchanges<'s, 'a> {
    /// The tour of `legs`, in which `gap`, if there is one, has the number after those of the
    /// chains. All stations wait.
    pub fn new(
        network: Network<'a>,
        neighbours: Neighbours<'s>,
        legs: &'s mut [Leg],
        gap: Option<u16>,
        lift: u32,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let stations = usize::from(network.stations());
        let places = scratch.take(legs.len())?;
        let mut waiting = Waiting::new(scratch.take(stations)?, scratch.take(stations)?);
        for station in 0..network.stations() {
            waiting.add(station);
        }
        let cycle = Cycle::new(legs, places, scratch.take(Cycle::MEMORY)?);
        let incidence = Incidence::new(network, scratch)?;
        Ok(Self {
            cycle,
            network,
            distances: Distances::new(network, scratch)?,
            incidence,
            neighbours,
            waiting,
            gap,
            lift,
        })
    }

    /// Bytes of scratch for so many stations, chains, and legs with the gap.
    pub const fn bytes(stations: usize, chains: usize, legs: usize) -> usize {
        Incidence::bytes(stations, chains)
            + Scratch::bytes_for::<u16>(legs)
            + Scratch::bytes_for::<[u16; 2]>(Cycle::MEMORY)
            + Scratch::bytes_for::<u16>(stations)
            + Scratch::bytes_for::<u8>(stations)
    }

    /// Whether the tour has a gap, and so two ends.
    pub fn is_open(&self) -> bool {
        self.gap.is_some()
    }

    /// The station where a leg ends; [`NONE`] of the gap.
    pub fn end(&self, leg: Leg) -> u16 {
        if self.is_gap(leg) { NONE } else { self.network.end(leg) }
    }

    /// Whether a leg is the gap.
    pub fn is_gap(&self, leg: Leg) -> bool {
        self.gap == Some(leg.segment() as u16)
    }

    /// The station where a leg begins; [`NONE`] of the gap.
    pub fn start(&self, leg: Leg) -> u16 {
        self.end(leg.flipped())
    }

    /// What a move costs: its length and the lift, and a little more, lest two moves be better than
    /// one because their lengths are rounded down.
    pub fn distance(&self, from: u16, to: u16) -> i64 {
        if from == NONE || to == NONE || from == to {
            0
        } else {
            i64::from(self.distances.between(from, to)) + i64::from(self.lift) + 1
        }
    }

    /// What a move leaves of `hand`: 0 if nothing is left, mostly seen without a root.
    pub fn left(&self, hand: i64, from: u16, to: u16) -> i64 {
        if from == NONE || to == NONE || from == to {
            return hand.max(0);
        }
        let hand = hand - i64::from(self.lift);
        let bound = u32::try_from(hand.clamp(0, i64::from(u32::MAX))).unwrap_or(u32::MAX);
        // A little more than the length is taken: see `distance`.
        self.distances.below(bound, from, to).map_or(0, |length| hand - i64::from(length) - 1)
    }

    /// What all moves cost.
    pub fn cost(&self) -> u64 {
        (0..self.cycle.len())
            .map(|index| self.move_after(self.cycle.leg(index)).max(0) as u64)
            .sum()
    }

    /// The cost of the move after `leg`.
    pub fn move_after(&self, leg: Leg) -> i64 {
        self.distance(self.end(leg), self.start(self.cycle.next(leg)))
    }

    /// Tries exchanges around all stations that wait, until the work is done or its end has come,
    /// and returns the gain. If `keep`, what was gained stays, else it can be taken back.
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

    /// Makes one exchange that cuts a move at `station`, if one helps.
    fn exchange_at(
        &mut self,
        station: u16,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let mut from = self.incidence.first(station);
        while let Some(leg) = from {
            if self.move_after(leg.flipped()) > 0
                && self.cycle.can_turn()
                && let Some(gain) = self.exchange(leg.flipped(), work_budget)?
            {
                return Ok(Some(gain));
            }
            from = self.incidence.next(leg);
        }
        Ok(None)
    }

    /// CutPositions the move after `a` and changes two moves more at a time while that leaves something in
    /// hand, until joining the ends leaves a gain; returns it. Else all is as it was.
    fn exchange(
        &mut self,
        a: Leg,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let turned = self.cycle.turned();
        let mut a = a;
        let mut hand = self.move_after(a);
        let mut touched = [[NONE; 6]; STEPS];
        for touched_now in 0..STEPS {
            let Some(step) = StepSearch::best_step(self, a, hand, work_budget)? else {
                break;
            };
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

    /// Where a move from `station` may go: by the gap, if that is wanted, to itself, and to those near it.
    pub fn candidates(&self, station: u16, by_gap: bool) -> impl Iterator<Item = u16> + use<'s> {
        let own = [NONE, station].into_iter().skip(usize::from(!by_gap));
        own.chain(self.neighbours.of(station))
    }

    /// How far `station` is from the nearer end of the path; far if it is a cycle.
    pub fn distance_to_path_ends(&self, station: u16) -> i64 {
        let Some(gap) = self.gap.map(|gap| Leg::new(gap, false)) else {
            return i64::MAX;
        };
        let ends = [gap, gap.flipped()].map(|gap| self.start(self.cycle.next(gap)));
        let [a, b] = ends.map(|end| self.distance(end, station));
        a.min(b)
    }

    /// The ends of the moves that a step cuts.
    fn ends_of(&self, a: Leg, step: Step) -> [u16; 6] {
        let third = step.third.map_or(step.c, |(e, _)| e);
        let mut ends = [NONE; 6];
        for (pair, leg) in ends.chunks_exact_mut(2).zip([a, step.c, third]) {
            pair.copy_from_slice(&[self.end(leg), self.start(self.cycle.next(leg))]);
        }
        ends
    }

    /// Makes a step from the cut after `a`. Returns the leg after which the ends are joined.
    fn make(
        &mut self,
        a: Leg,
        step: Step,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Leg, OrderError> {
        let c = step.c;
        let (b, d) = (self.cycle.next(a), self.cycle.next(c));
        let Some((e, third_onward)) = step.third else {
            let moved = self.cycle.turn(a, c);
            work_budget.work(1 + moved as u32 / 32)?;
            return Ok(d.flipped());
        };
        let f = self.cycle.next(e);
        let moved = match (step.onward, third_onward) {
            // … a, d … e, b … c, f …
            (true, true) => self.cycle.swap(a, d, e),
            // … a, d … e, c … b, f … with `c … b` flipped.
            (true, false) => self.cycle.turn(a, e) + self.cycle.turn(a, d.flipped()),
            // … e, b … c, a … f, d … with `a … f` flipped.
            (false, true) => self.cycle.turn(a, c) + self.cycle.turn(d.flipped(), f.flipped()),
            // … a, c … f, b … e, d … with `c … f` flipped.
            (false, false) => self.cycle.turn(a, c) + self.cycle.turn(f.flipped(), b.flipped()),
        };
        work_budget.work(1 + moved as u32 / 32)?;
        Ok(if third_onward { e } else { f.flipped() })
    }

    /// The legs from a station; from nowhere, the gap both ways.
    pub fn legs_from(&self, station: u16) -> impl Iterator<Item = Leg> + '_ {
        let first = if station == NONE {
            self.gap.map(|gap| Leg::new(gap, false))
        } else {
            self.incidence.first(station)
        };
        core::iter::successors(first, |&leg| {
            if self.is_gap(leg) {
                (!leg.reversed()).then(|| leg.flipped())
            } else {
                self.incidence.next(leg)
            }
        })
    }

    /// Lets the ends of `legs` wait for exchanges.
    pub fn wake(&mut self, legs: &[Leg]) {
        for &leg in legs {
            let station = self.end(leg);
            self.waiting.add(station);
        }
    }
}
