//! Anneals a long tour on all cores of a computer.
//!
//! While annealing is hot it changes the tour everywhere, and one core does that. Then the tour is
//! cut into *subproblems*, each of some hundred moves that follow each other, which the cores
//! anneal at the same time. A subproblem is a small tour of its own: all that lies outside it is
//! one chain, which is never changed, so whatever it becomes, the whole remains one tour. The cuts
//! are elsewhere in each round, so that each move is sooner or later annealed with most of those
//! around it.
//!
//! The number of subproblems depends on the number of moves. It does not depend on the number of
//! cores, nor does the tour. Subproblems have memory of their own, beside the working memory of the
//! stage. After Karp, "Probabilistic analysis of partitioning algorithms for the traveling-salesman
//! problem in the plane" (1977), and the subproblems of Helsgaun's LKH.

use super::{
    ANNEALING_REACH, Best, LEAST_SHARED_MOVES, NEIGHBOURS, Until, WHOLE_HEAT, scratch_bytes,
};
use crate::index::Index;
use crate::order::exchange::Exchanges;
use crate::order::kicks::{KickPlan, Kicks};
use crate::order::neighbours::Neighbours;
use crate::order::network::Network;
use crate::order::work_budget::WorkBudget;
use crate::order::{Leg, OrderError, TimeModel, reverse};
use crate::stage::{CancelFlag, Scratch};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::vec;
use std::vec::Vec;

/// The heat at which the tour is cut for the first time, in 256 parts of a mean move.
const SUBPROBLEM_HEAT: u64 = 160;
/// The units of work for each move before the tour is cut.
const WHOLE_UNITS: u64 = 3500;
/// The units of work for each move in the subproblems.
const SUBPROBLEM_UNITS: u64 = 5500;
/// How often the tour is cut into subproblems anew.
const ROUNDS: u64 = 8;
/// The greatest number of subproblems. More would keep no more cores busy.
const MOST_SUBPROBLEMS: usize = 32;
/// The bytes of a subproblem's table of distances.
const TABLE_BYTES: usize = 1 << 15;
/// How long the calling thread waits for a subproblem before it asks whether the user has
/// cancelled.
const TIMEOUT: Duration = Duration::from_millis(20);

/// Returns into how many subproblems a tour with this many moves is cut: two for the shortest, and
/// a power of two for all, so that the cores are equally busy.
fn count(moves: u32) -> usize {
    let parts = (moves / (LEAST_SHARED_MOVES / 2)).max(2);
    (1 << parts.ilog2()).min(MOST_SUBPROBLEMS)
}

/// What the subproblems of a tour have in common.
struct Whole<'w, I> {
    /// The stations and the chains of the whole tour.
    network: Network<'w, I>,
    /// The stations near each of them.
    neighbours: Neighbours<'w, I>,
    /// The number of the gap between the end and the start of an open path.
    gap: Option<I>,
    /// The cost of a move besides its length, in 1/256 steps.
    lift_cost: u32,
    /// The heat at the beginning and at the end of the round, as [`KickPlan`] has it.
    heat: [u64; 2],
    /// The units of work for each leg of the tour in this round, in 1/256.
    units_per_leg: u64,
}

impl<I: Index> Best<'_, '_, I> {
    /// Shortens the shortest tour found so far by annealing.
    pub(super) fn anneal_on_all_cores(
        &mut self,
        cycle: &mut [Leg<I>],
        time_model: TimeModel,
        mut scratch: Scratch<'_>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let [hottest, coldest] = WHOLE_HEAT;
        let [whole_units, subproblem_units] =
            [WHOLE_UNITS, SUBPROBLEM_UNITS].map(|units| u64::from(self.moves) * units);
        self.restore(cycle);
        let heat = [hottest, SUBPROBLEM_HEAT];
        let until = Until::Annealed { units: whole_units, heat };
        self.work_on(cycle, until, scratch.reborrow(), work_budget)?;
        self.restore(cycle);
        let chains = self.network.chains();
        let (_, gap) = cycle.split_at_mut(self.route.len());
        gap.fill(Leg::new(chains, false));
        let mean = self.mean_move(self.cost);
        let heat_at =
            |round| mean * (coldest + (SUBPROBLEM_HEAT - coldest) * (ROUNDS - round) / ROUNDS);
        for round in 0..ROUNDS {
            let whole = Whole {
                network: self.network,
                neighbours: self.neighbours,
                gap: self.open.then_some(chains),
                lift_cost: self.lift_cost,
                heat: [heat_at(round), heat_at(round + 1)],
                units_per_leg: (subproblem_units << 8) / (ROUNDS * cycle.len() as u64).max(1),
            };
            let count = count(self.moves);
            // The cuts lie in the middle of the former subproblems, or a quarter beside it.
            let quarters = [2, 1, 2, 3][round as usize % 4];
            cycle.rotate_left(quarters * cycle.len() / (4 * count));
            whole.anneal(cycle, count, &mut self.kicks, work_budget)?;
        }
        if self.open {
            begin_after(cycle, chains);
        }
        self.work_on(cycle, Until::Exchanged(time_model), scratch, work_budget)?;
        Ok(())
    }
}

impl<I: Index> Whole<'_, I> {
    /// Whether `leg` is the gap between the end and the start of an open path.
    fn is_gap(&self, leg: Leg<I>) -> bool {
        self.gap.is_some_and(|gap| leg.segment() == gap.get())
    }

    /// Cuts `cycle` into `count` subproblems and anneals them on all cores.
    fn anneal(
        &self,
        cycle: &mut [Leg<I>],
        count: usize,
        kicks: &mut Kicks,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let subproblems = self.cut(cycle, count, kicks);
        let is_cancelled = &AtomicBool::new(false);
        if rayon::current_num_threads() < 2 {
            // The only thread of a pool may be this one, which must not wait for itself.
            for subproblem in subproblems {
                work_budget.work_long(subproblem.anneal(self, is_cancelled)?)?;
            }
            return Ok(());
        }
        rayon::in_place_scope(|scope| {
            let (sender, receiver) = mpsc::channel();
            for subproblem in subproblems {
                let sender = sender.clone();
                scope.spawn(move |_| {
                    // The other end is gone if the work has been cancelled.
                    let _ = sender.send(subproblem.anneal(self, is_cancelled));
                });
            }
            drop(sender);
            let outcome = wait(&receiver, work_budget);
            is_cancelled.store(true, Ordering::Relaxed);
            outcome
        })
    }

    /// Cuts `cycle` into `count` subproblems. No cut lies beside the gap, which has no stations.
    fn cut<'c>(
        &self,
        cycle: &'c mut [Leg<I>],
        count: usize,
        kicks: &mut Kicks,
    ) -> Vec<Subproblem<'c, I>> {
        let beside_gap = |before: Leg<I>, after: Leg<I>| self.is_gap(before) || self.is_gap(after);
        while let (Some(&first), Some(&last)) = (cycle.first(), cycle.last())
            && beside_gap(last, first)
            && cycle.len() > 2
        {
            cycle.rotate_left(1);
        }
        let (Some(&first), Some(&last)) = (cycle.first(), cycle.last()) else {
            return Vec::new();
        };
        let mut before = self.network.end(last);
        let length = cycle.len().div_ceil(count.max(1));
        let mut subproblems = Vec::new();
        let mut rest = cycle;
        while !rest.is_empty() {
            let mut at = length.min(rest.len());
            while let Some(&[before, after]) =
                rest.get(at - 1..).and_then(|legs| legs.first_chunk())
                && beside_gap(before, after)
            {
                at += 1;
            }
            let (legs, others) = core::mem::take(&mut rest).split_at_mut(at);
            let after = self.network.start(others.first().copied().unwrap_or(first));
            let outside = [after, before];
            before = self.network.end(legs.last().copied().unwrap_or(last));
            subproblems.push(Subproblem { legs, outside, kicks: kicks.fork() });
            rest = others;
        }
        subproblems
    }
}

/// Waits until all subproblems are annealed, and counts their units of work.
fn wait(
    receiver: &mpsc::Receiver<Result<u64, OrderError>>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<(), OrderError> {
    loop {
        match receiver.recv_timeout(TIMEOUT) {
            Ok(spent) => work_budget.work_long(spent?)?,
            Err(RecvTimeoutError::Timeout) => work_budget.answer()?,
            // All have sent what they had to send.
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}

/// A subproblem of a tour.
struct Subproblem<'c, I> {
    /// Its legs, in the order in which they are drawn; no gap is the first or the last.
    legs: &'c mut [Leg<I>],
    /// The stations at which the rest of the tour begins, after this subproblem, and ends, before
    /// it.
    outside: [I; 2],
    /// Its own random numbers.
    kicks: Kicks,
}

impl<I: Index> Subproblem<'_, I> {
    /// Anneals the subproblem. Returns the units of work.
    fn anneal(self, whole: &Whole<'_, I>, is_cancelled: &AtomicBool) -> Result<u64, OrderError> {
        let Self { legs, outside, mut kicks } = self;
        let local = LocalNetwork::new(whole, legs, outside);
        let network = local.network(whole);
        let mut lists = Vec::new();
        let neighbours = whole.neighbours.part(&local.stations, &local.number, &mut lists);
        let mut cycle = local.cycle(whole, legs);
        let has_gap = legs.iter().any(|&leg| whole.is_gap(leg));
        let gap = has_gap.then(|| network.chains());
        let bytes = scratch_bytes(network, cycle.len(), NEIGHBOURS[0]) + TABLE_BYTES;
        let mut memory = vec![0; bytes.div_ceil(size_of::<u64>())];
        let mut scratch = Scratch::new(&mut memory);
        let mut cancel = CancelFlag::new(is_cancelled);
        let work_budget = &mut WorkBudget::new(&mut cancel);
        let choices = scratch.take(cycle.len())?;
        let mut tour =
            Exchanges::new(network, neighbours, &mut cycle, gap, whole.lift_cost, &mut scratch)?;
        tour.rest();
        let budget = (whole.units_per_leg * legs.len() as u64) >> 8;
        let plan =
            KickPlan { heat: whole.heat, reach: ANNEALING_REACH, patience: u32::MAX, window: None };
        work_budget.grant(budget);
        kicks.improve(&mut tour, plan, budget, choices, work_budget)?;
        let spent = budget - work_budget.left();
        local.write(whole, &mut cycle, legs);
        Ok(spent)
    }
}

/// The stations and chains of a subproblem, with numbers of their own. The chains have the numbers
/// 0, 1, 2 and so on in the order of the subproblem; the last one is all that lies outside.
struct LocalNetwork<I> {
    /// The number of each station in the whole.
    stations: Vec<I>,
    /// The point of each station.
    at: Vec<I>,
    /// For each station of the whole its number here, or [`Index::NONE`].
    number: Vec<I>,
    /// The stations at which each chain begins and ends.
    ends: Vec<[I; 2]>,
    /// The leg of the whole that each chain is, but for the last chain.
    legs: Vec<Leg<I>>,
}

impl<I: Index> LocalNetwork<I> {
    /// Numbers the stations and the chains of a subproblem.
    fn new(whole: &Whole<'_, I>, legs: &[Leg<I>], outside: [I; 2]) -> Self {
        let number = vec![I::NONE; whole.network.stations().get()];
        let legs: Vec<_> = legs.iter().copied().filter(|&leg| !whole.is_gap(leg)).collect();
        let mut local =
            Self { stations: Vec::new(), at: Vec::new(), number, ends: Vec::new(), legs };
        for at in 0..local.legs.len() {
            let leg = local.legs[at];
            local.add([whole.network.start(leg), whole.network.end(leg)]);
        }
        local.add(outside);
        local.at = local.stations.iter().map(|&station| whole.network.point(station)).collect();
        local
    }

    /// Adds a chain between these stations of the whole.
    fn add(&mut self, ends: [I; 2]) {
        let ends = ends.map(|station| {
            let number = &mut self.number[station.get()];
            if *number == I::NONE {
                *number = I::new(self.stations.len());
                self.stations.push(station);
            }
            *number
        });
        self.ends.push(ends);
    }

    /// Returns the network of the subproblem. Its anchor matters only if the gap is in it.
    fn network<'p>(&'p self, whole: &Whole<'p, I>) -> Network<'p, I> {
        whole.network.part(&self.at, &self.ends)
    }

    /// Returns the number of the chain that is all that lies outside.
    fn outside(&self) -> usize {
        self.legs.len()
    }

    /// Returns the subproblem, whose legs in the whole are given, as a cycle.
    fn cycle(&self, whole: &Whole<'_, I>, legs: &[Leg<I>]) -> Vec<Leg<I>> {
        let mut next = 0;
        let inside = legs.iter().map(|&leg| {
            if whole.is_gap(leg) {
                return Leg::new(I::new(self.ends.len()), leg.reversed());
            }
            next += 1;
            Leg::new(I::new(next - 1), false)
        });
        inside.chain([Leg::new(I::new(self.outside()), false)]).collect()
    }

    /// Writes the subproblem, which is given as a cycle, to its legs in the whole.
    fn write(&self, whole: &Whole<'_, I>, cycle: &mut [Leg<I>], legs: &mut [Leg<I>]) {
        begin_after(cycle, I::new(self.outside()));
        for (slot, leg) in legs.iter_mut().zip(cycle.iter()) {
            let gap = Leg::new(whole.network.chains(), false);
            let old = self.legs.get(leg.segment()).copied().unwrap_or(gap);
            *slot = if leg.reversed() { old.flipped() } else { old };
        }
    }
}

/// Lets a cycle end with the leg of number `last`, drawn forward.
fn begin_after<I: Index>(cycle: &mut [Leg<I>], last: I) {
    let Some(at) = cycle.iter().position(|leg| leg.segment() == last.get()) else { return };
    cycle.rotate_left((at + 1) % cycle.len());
    if let Some((last, others)) = cycle.split_last_mut()
        && last.reversed()
    {
        reverse(others);
        *last = last.flipped();
    }
}
