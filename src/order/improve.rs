//! Shortens the tour of several parts within a budget of work.
//!
//! Several first tours are made. Each is shortened until neither an exchange of moves nor a
//! reversal of strokes helps any more, and the shortest tour is kept. The first tours are: the tour
//! of the matched moves, part by part; the tour of the same moves after they were changed to join
//! the parts; and, where each part is one stroke, as in hatching and lettering, the shortest of the
//! tours that start at a corner of the page and always take the nearest part next.
//!
//! Then lifts are given their cost. Four moves near each other are changed at random (a kick), the
//! exchanges are tried again around them, and everything is undone if the result costs too much.
//! Where the budget is known, a result may at first cost up to a mean move more, and less and less
//! as the budget is used up (annealing), which finds tours that cannot be reached otherwise. The
//! same budget gives the same tour on every machine, and it is never worse than the first tours.
//! After Martin, Otto and Felten, "Large-step Markov chains for the traveling salesman problem"
//! (1991).
//!
//! With [`Effort::Units`] the budget is fixed. With [`Effort::Auto`] it is as large as annealing
//! needs, if that pays. Otherwise no result may cost more, and the work ends where it no longer
//! pays. What is gained is compared with what was spent, over the last eighth of a second of
//! counted work ([`TimeModel::units_per_second`]), not kick by kick: most kicks gain nothing, and
//! hundreds of them are needed to see a rate. A further first tour is made only if it takes so
//! little work that it may pay, too.
//!
//! The file is longer than 500 lines, because all these searches change one tour and share its
//! budget.

#[cfg(feature = "threads")]
mod subproblems;

use super::euler::Unused;
use super::exchange::Exchanges;
use super::kicks::{KickPlan, Kicks, Window, shorten};
use super::metric::{length, root};
use super::neighbours::Neighbours;
use super::network::Network;
use super::patch_cycles::patch_cycles;
use super::work_budget::WorkBudget;
use super::{Effort, Leg, OrderError, TimeModel, even_part, mark_parts, reverse};
use crate::array::MapEach;
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::Scratch;

/// The number of neighbours of each station, and the number to use where memory is short.
const NEIGHBOURS: [usize; 2] = [8, 4];
/// The moves that a kick changes are at most this many moves apart.
const KICK_REACH: u32 = 6;
/// The search ends after this many kicks (random changes) in vain for each move of the tour.
const PATIENCE: u32 = 50;
/// The part of a fixed budget that may be spent on each of the three first tours. What is left is
/// spent on the best of them.
const FIRST_TOUR_SHARE: u64 = 12;
/// With [`Effort::Auto`], the gain is compared with the work after each such part of a second.
const WINDOWS_PER_SECOND: u64 = 8;
/// Where a tour has few moves, the gain is compared with the work as soon as each move had this
/// many units of work.
const WINDOW_UNITS_PER_MOVE: u64 = 800;
/// With [`Effort::Auto`], another first tour is made if the last one took at most this part of the
/// time in which the pen travels, or of a second. A further one seldom saves more.
const FIRST_TOUR_PART: u64 = 256;

/// With [`Effort::Auto`], annealing has this many units of work for each move.
const ANNEALING_UNITS_PER_MOVE: u64 = 10_000;
/// The part of its length by which annealing makes a tour shorter at least, as measured: it pays if
/// that saves more time than the work takes.
const ANNEALING_PART: u64 = 32;
/// The moves that a kick changes while it anneals are at most this many moves apart.
const ANNEALING_REACH: u32 = 20;
/// All cores of a computer anneal a tour that has at least this many moves.
const LEAST_SHARED_MOVES: u32 = 800;
/// Before all cores anneal, the tour from a corner is worked on only if it is shorter than so many
/// of 256 parts of the tour that was worked on before. Tours of hatching are, and they become
/// better; those of random strokes are not.
const CORNER_TOUR_PARTS: u64 = 328;
/// By how many of 256 parts of a mean move a kick may make a tour longer, at the beginning and at
/// the end of annealing.
const WHOLE_HEAT: [u64; 2] = [256, 0];

/// A tour to be improved, and the limits for it.
pub(super) struct Tour<'t, I> {
    /// All chains of the network, in the order and the directions in which they are drawn.
    pub route: &'t mut [Leg<I>],
    /// Whether the tour is an open path, so that the move from its end to its start does not count.
    pub open: bool,
    /// A lower bound of the pen-up length of any tour, in 1/256 steps.
    pub bound: u64,
    /// The partner of each odd station by the pairs with the least total length, and the marks of
    /// the others.
    pub mate: &'t mut [I],
    /// The station where a route with these moves begins; `None` if it may begin anywhere.
    pub start: Option<I>,
    /// Whether no part has more than two odd stations, so that each part is drawn in one stroke.
    pub strokes_only: bool,
    /// The budget of work.
    pub effort: Effort,
    /// The cost of a move besides its length, in 1/256 steps.
    pub lift_cost: u32,
}

/// Shortens `tour.route` as far as the budget allows. Does nothing if there is too little memory.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub(super) fn improve<'t, I: Index>(
    network: Network<'_, I>,
    tour: Tour<'t, I>,
    mut scratch: Scratch<'t>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<(), OrderError> {
    let Tour { route, open, bound, mate, start, strokes_only, effort, lift_cost } = tour;
    if route_moves(network, route, open).sum::<u64>() == bound {
        return Ok(());
    }
    let Some(mut best) = Best::new(network, route, open, &mut scratch, work_budget)? else {
        return Ok(());
    };
    let Best { neighbours, moves, .. } = best;
    let cycle = scratch.take(best.route.len() + usize::from(open))?;
    let annealing = u64::from(moves) * ANNEALING_UNITS_PER_MOVE;
    let first = match effort {
        Effort::Auto(time_model) => Until::Exchanged(time_model),
        Effort::Units(units) => {
            Until::Spent(u64::from(moves) * u64::from(units) / FIRST_TOUR_SHARE)
        }
    };
    best.restore(cycle);
    let mut pays = best.work_on(cycle, first, scratch.reborrow(), work_budget)?;
    let all_cores = best.anneals_on_all_cores(effort, annealing);
    if pays && all_cores.is_none() {
        patch_cycles(network, neighbours, mate, scratch.reborrow(), work_budget)?;
        best.follow(mate, start, None, cycle, scratch.reborrow(), work_budget)?;
        pays = best.work_on(cycle, first, scratch.reborrow(), work_budget)?;
    }
    if strokes_only && pays {
        // Each part becomes one stroke without any move inside it.
        mark_parts(network, scratch.reborrow(), mate)?;
        for mate in mate.iter_mut().filter(|mate| **mate != I::NONE) {
            *mate = even_part();
        }
        let mut shortest = (u64::MAX, None);
        // With an anchor, they all start there.
        let starts = if network.anchor().is_some() { 1 } else { CORNERS.len() };
        for corner in CORNERS.into_iter().take(starts) {
            best.follow(mate, None, Some(corner), cycle, scratch.reborrow(), work_budget)?;
            // A cycle is as long as the route, or longer by the gap. So no split of it can fail.
            let (route, _) = cycle.split_at(best.route.len());
            let length = route_moves(network, route, open).sum();
            if length < shortest.0 {
                shortest = (length, Some(corner));
            }
        }
        // Annealing leaves nothing of what makes a further first tour a little better.
        if all_cores.is_none() || shortest.0 < best.cost / 256 * CORNER_TOUR_PARTS {
            best.follow(mate, None, shortest.1, cycle, scratch.reborrow(), work_budget)?;
            best.work_on(cycle, first, scratch.reborrow(), work_budget)?;
        }
    }
    #[cfg(feature = "threads")]
    if let Some(time_model) = all_cores {
        best.charge_lifts(lift_cost);
        best.cost += 1;
        return best.anneal_on_all_cores(cycle, time_model, scratch, work_budget);
    }
    let last = match effort {
        Effort::Auto(time_model) if best.pays(annealing, ANNEALING_PART, time_model, best.cost) => {
            Until::Annealed { units: annealing, heat: WHOLE_HEAT }
        }
        Effort::Auto(time_model) => Until::Unpaid(time_model),
        Effort::Units(units) => {
            let budget = u64::from(moves) * u64::from(units);
            Until::Annealed { units: budget.saturating_sub(best.spent), heat: WHOLE_HEAT }
        }
    };
    // Lifts get their cost only now: with a cost from the start, the exchanges that shorten the
    // moves would be rejected.
    best.charge_lifts(lift_cost);
    // Of two tours that cost the same, the one that was found last is kept.
    best.cost += 1;
    best.restore(cycle);
    best.work_on(cycle, last, scratch, work_budget)?;
    Ok(())
}

/// Shortens an open `route`, which is a good one already, by annealing with this many units of work
/// at this cost of a lift. Does nothing if that finds nothing shorter, or if there is too little
/// memory.
#[cfg(feature = "early-ink")]
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub(super) fn improve_further<'r, I: Index>(
    network: Network<'_, I>,
    route: &'r mut [Leg<I>],
    units: u64,
    lift_cost: u32,
    mut scratch: Scratch<'r>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<(), OrderError> {
    if let Some(mut best) = Best::new(network, route, true, &mut scratch, work_budget)? {
        let cycle = scratch.take(best.route.len() + 1)?;
        best.charge_lifts(lift_cost);
        best.restore(cycle);
        let until = Until::Annealed { units, heat: WHOLE_HEAT };
        best.work_on(cycle, until, scratch, work_budget)?;
    }
    Ok(())
}

/// When the work on a tour ends.
#[derive(Clone, Copy)]
enum Until {
    /// When exchanges alone find nothing better any more, but at the latest when this many units of
    /// work are spent. No kick is made.
    Spent(u64),
    /// When exchanges alone find nothing better any more. No kick is made.
    Exchanged(TimeModel),
    /// When this many units of work are spent. A kick may make the tour longer, by less and less:
    /// at first and at last by so many of 256 parts of a mean move.
    Annealed {
        /// The units of work.
        units: u64,
        /// By how many parts of a mean move at first, and at last.
        heat: [u64; 2],
    },
    /// When the kicks save less time than they take.
    Unpaid(TimeModel),
}

impl Until {
    /// Returns the units of work that may be spent.
    fn budget(self) -> u64 {
        // Work without a limit ends by itself long before this number of units.
        match self {
            Self::Spent(units) | Self::Annealed { units, .. } => units,
            Self::Exchanged(_) | Self::Unpaid(_) => u64::MAX >> 1,
        }
    }
}

/// The corners of the page. A sign of 1 stands for the side of low x or y, -1 for the side of high
/// x or y.
const CORNERS: [(i32, i32); 4] = [(1, 1), (1, -1), (-1, 1), (-1, -1)];

/// Returns the distance of a point from a corner far outside the page, in steps, measured along x
/// and y.
fn from_corner(position: PagePoint, (x, y): (i32, i32)) -> u32 {
    // A coordinate is within ±2^20, so the sum is positive.
    (x * position.x + y * position.y + (1 << 22)).cast_unsigned()
}

/// The shortest tour found so far, and the settings of the search.
struct Best<'b, 'a, I> {
    /// The stations and the chains of which every tour is made.
    network: Network<'a, I>,
    /// The stations near each station, to which an exchange may lead a move.
    neighbours: Neighbours<'b, I>,
    /// Whether the tour is an open path, so that the move from its end to its start costs nothing.
    open: bool,
    /// The cost of a move besides its length, in 1/256 steps.
    lift_cost: u32,
    /// The number of moves of the first tour. The search ends after [`PATIENCE`] times as many
    /// successive kicks (random changes) without a shorter tour.
    moves: u32,
    /// The cost of the shortest tour, with the present cost of a lift.
    cost: u64,
    /// The shortest tour that was found so far.
    route: &'b mut [Leg<I>],
    /// Gives the random numbers of the kicks. They continue from one first tour to the next.
    kicks: Kicks,
    /// The units of work that were spent on exchanges before the kicks, for all tours.
    spent: u64,
}

impl<'b, 'a, I: Index> Best<'b, 'a, I> {
    /// Begins with `route`, and finds the neighbours of its stations. `None` if there is too little
    /// memory for the search.
    #[inline(always)] // Adds no frame to the stack.
    fn new(
        network: Network<'a, I>,
        route: &'b mut [Leg<I>],
        open: bool,
        scratch: &mut Scratch<'b>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<Self>, OrderError> {
        let legs = route.len() + usize::from(open);
        let fits = |per_station: &usize| {
            scratch_bytes(network, legs, *per_station) <= scratch.available_bytes()
        };
        let Some(per_station) = NEIGHBOURS.into_iter().find(fits) else {
            return Ok(None);
        };
        let neighbours = Neighbours::new(network, per_station, scratch, work_budget)?;
        let moves = route_moves(network, route, open).filter(|&length| length > 0).count() as u32;
        let (kicks, cost) = (Kicks::new(), u64::MAX);
        Ok(Some(Self {
            network,
            neighbours,
            open,
            lift_cost: 0,
            moves,
            cost,
            route,
            kicks,
            spent: 0,
        }))
    }

    /// Makes a tour of the pen-up moves `mate`, part by part, the nearest part next. It starts at
    /// the entrance nearest to `corner`, if one is given (or to the anchor, if there is one), and
    /// otherwise at `start`.
    fn follow(
        &self,
        mate: &[I],
        start: Option<I>,
        corner: Option<(i32, i32)>,
        cycle: &mut [Leg<I>],
        mut scratch: Scratch<'_>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let moves: &mut [I] = scratch.take(mate.len())?;
        moves.copy_from_slice(mate); // as long as what was taken
        let mut unused = Unused::new(self.network, moves, &mut scratch)?;
        let start = match corner {
            Some(corner) => {
                let far = |position| match self.network.anchor() {
                    Some(anchor) => length(self.network.position(anchor), position),
                    None => from_corner(position, corner),
                };
                unused.entrance(&far, work_budget)?
            }
            None => start,
        };
        // Every caller gives a cycle that is as long as the route, or longer by the gap.
        let (route, _) = cycle.split_at_mut(self.route.len());
        unused.nearest_first(start, Some(self.neighbours), route, work_budget)
    }

    /// Gives each lift this cost from now on, also in the cost of the shortest tour found so far.
    fn charge_lifts(&mut self, lift_cost: u32) {
        let network = self.network;
        let begin = self.route.first().map(|&leg| network.start(leg));
        let first_move = network.anchor().zip(begin);
        let first_move = first_move.map(|(from, to)| u64::from(network.distance(from, to)));
        let moves = route_moves(network, self.route, self.open).filter(|&length| length > 0);
        // As `Exchanges::distance` counts them.
        let lift = u64::from(lift_cost) + 1;
        let costs = first_move.into_iter().chain(moves).map(|length| length + lift);
        (self.lift_cost, self.cost) = (lift_cost, costs.sum());
    }

    /// Copies the shortest tour found so far into `cycle`, to be changed there.
    fn restore(&self, cycle: &mut [Leg<I>]) {
        // As in `follow`.
        let (route, _) = cycle.split_at_mut(self.route.len());
        route.copy_from_slice(self.route);
    }

    /// Shortens the tour in `cycle` until the work ends, and keeps it if it is the shortest so far.
    /// Returns whether the same work on another tour may save more time than it takes; with a fixed
    /// budget it always may.
    fn work_on(
        &mut self,
        cycle: &mut [Leg<I>],
        until: Until,
        mut scratch: Scratch<'_>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<bool, OrderError> {
        let mut scratch = scratch.reborrow();
        let chains = self.network.chains();
        // As in `follow`.
        let (_, gap) = cycle.split_at_mut(self.route.len());
        gap.fill(Leg::new(chains, false));
        let gap = self.open.then_some(chains);
        let choices: &mut [u8] = scratch.take(cycle.len())?;
        let mut tour = Exchanges::new(
            self.network,
            self.neighbours,
            cycle,
            gap,
            self.lift_cost,
            &mut scratch,
        )?;
        work_budget.grant(until.budget());
        shorten(&mut tour, choices, work_budget)?;
        let mut pays = true;
        let mut plan = KickPlan {
            heat: [0; 2],
            reach: KICK_REACH,
            patience: PATIENCE.saturating_mul(self.moves),
            window: None,
        };
        let budget = until.budget();
        let spent = budget - work_budget.left();
        match until {
            Until::Spent(_) => work_budget.grant(0),
            Until::Exchanged(time_model) => {
                pays = self.pays(spent, FIRST_TOUR_PART, time_model, tour.cost());
                work_budget.grant(0);
            }
            Until::Annealed { heat, .. } => {
                let mean = self.mean_move(tour.cost());
                plan.heat = heat.map_each(|part| mean * part);
                plan.reach = ANNEALING_REACH;
            }
            Until::Unpaid(time_model) => plan.window = Some(self.window(time_model, tour.cost())),
        }
        self.spent += spent;
        self.kicks.improve(&mut tour, plan, budget, choices, work_budget)?;
        self.keep(&tour);
        Ok(pays)
    }

    /// Returns the time model if the tour is to be annealed on all cores, where annealing takes so
    /// many units of work.
    #[inline(always)] // On a board it is never so.
    fn anneals_on_all_cores(&self, effort: Effort, annealing: u64) -> Option<TimeModel> {
        match effort {
            Effort::Auto(time_model)
                if cfg!(feature = "threads")
                    && time_model.units_per_second >= TimeModel::COMPUTER
                    && self.moves >= LEAST_SHARED_MOVES
                    && self.pays(annealing, ANNEALING_PART, time_model, self.cost) =>
            {
                Some(time_model)
            }
            _ => None,
        }
    }

    /// Whether so many units of work save more time than they take, if they make a tour that costs
    /// `cost` shorter by one of so many parts.
    fn pays(&self, units: u64, parts: u64, time_model: TimeModel, cost: u64) -> bool {
        let second = u64::from(time_model.units_per_second).max(1);
        let seconds = units.saturating_mul(parts) / second;
        seconds.saturating_mul(self.rate(time_model, cost)) <= cost
    }

    /// Returns the mean length of a move in a tour that costs `cost`, in 1/256 steps.
    fn mean_move(&self, cost: u64) -> u64 {
        (cost / u64::from(self.moves.max(1))).saturating_sub(self.lift_cost.into())
    }

    /// Returns by how much a saving of one second shortens a tour that costs `cost`, in 1/256
    /// steps. A pen that accelerates all along a move of length `l` takes `2 √(l / a)` for it, of
    /// which the derivative is `1 / √(a l)`; on a long move it is one over the speed.
    #[inline(never)] // Its callers share one copy of the code.
    fn rate(&self, time_model: TimeModel, cost: u64) -> u64 {
        let mean = self.mean_move(cost);
        // The acceleration is below 2^27 and the length of a move below 2^31.
        let accelerating = 16 * u64::from(root(u64::from(time_model.acceleration) * mean));
        accelerating.min(u64::from(time_model.speed) << 8).max(1)
    }

    /// Returns over how much work the gain of the kicks is watched, and how much it must be.
    fn window(&self, time_model: TimeModel, cost: u64) -> Window {
        let second = u64::from(time_model.units_per_second).max(1);
        let moves = u64::from(self.moves) * WINDOW_UNITS_PER_MOVE;
        let units = moves.min(second / WINDOWS_PER_SECOND);
        // Both factors are below 2^33.
        let least_gain = units * self.rate(time_model, cost) / second;
        Window { units, least_gain: (least_gain as i64).max(1) }
    }

    /// Keeps the tour if it is the shortest so far.
    fn keep(&mut self, tour: &Exchanges<'_, '_, I>) {
        let cost = tour.cost();
        if cost >= self.cost {
            return;
        }
        self.cost = cost;
        let legs = tour.cycle.len(); // at least 1, because a pen without segments has no tour
        let leg = |index: usize| tour.cycle.leg(index % legs);
        let gap = (0..legs).find(|&index| tour.is_gap(leg(index)));
        let start = gap.map_or(0, |gap| gap + 1);
        for (index, slot) in self.route.iter_mut().enumerate() {
            *slot = leg(start + index);
        }
        // The path begins at that side of the gap to which the anchor belongs.
        if self.network.anchor().is_some() && gap.is_some_and(|gap| leg(gap).reversed()) {
            reverse(self.route);
        }
    }
}

/// Returns the most scratch memory that is in use at any time, in bytes.
fn scratch_bytes<I: Index>(network: Network<'_, I>, legs: usize, per_station: usize) -> usize {
    let (stations, chains) = (network.stations().get(), network.chains().get());
    let lists = Neighbours::<I>::bytes(stations, per_station);
    let exchanges = Scratch::bytes_for::<I>(legs)
        + Scratch::bytes_for::<u8>(legs)
        + Exchanges::<I>::bytes(stations, chains, legs);
    lists + exchanges.max(Neighbours::<I>::bytes_to_find(stations))
}

/// Returns the lengths of the moves between the legs of a route, 0 where there is no move. Unless
/// the route is `open`, the move from its end to its start is included.
fn route_moves<I: Index>(
    network: Network<'_, I>,
    route: &[Leg<I>],
    open: bool,
) -> impl Iterator<Item = u64> {
    let pairs = route.iter().zip(route.iter().cycle().skip(1));
    pairs
        .take(route.len() - usize::from(open))
        .map(move |(&from, &to)| u64::from(network.distance(network.end(from), network.start(to))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tour_is_begun_at_each_corner_of_the_page() {
        let ends = [-1000, 1000];
        let points = ends.map(|x| ends.map(|y| PagePoint { x, y }));
        let nearest = CORNERS.map(|corner| {
            let far = |point: &&PagePoint| from_corner(**point, corner);
            points.iter().flatten().min_by_key(far).expect("a point")
        });
        for (at, point) in nearest.iter().enumerate() {
            assert!(!nearest[..at].contains(point), "{nearest:?}");
        }
    }
}
