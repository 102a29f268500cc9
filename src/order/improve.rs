//! A shorter tour of all parts, within a budget of work.
//!
//! When no exchange of moves helps any more, four moves near each other are changed at random, the
//! exchanges are tried again around them, and all is taken back unless it came out no longer: a
//! tour only ever gets better. The same budget gives the same tour on every machine. After Martin,
//! Otto and Felten, "Large-step Markov chains for the traveling salesman problem" (1991).

use super::euler::Unused;
use super::exchange::Exchanges;
use super::mend::mend;
use super::near::Near;
use super::network::Network;
use super::pace::Pace;
use super::{Leg, OrderError};
use crate::stage::Scratch;

/// Neighbours of each station that are worth the memory, and what will do with less.
const NEIGHBOURS: [usize; 2] = [8, 4];
/// A kick changes moves that are at most so many moves apart.
const KICK_REACH: u32 = 6;
/// So many kicks in vain for each move of the tour are enough.
const PATIENCE: usize = 50;

/// A tour to be improved.
pub(super) struct Tour<'t> {
    /// All chains of the network.
    pub route: &'t mut [Leg],
    /// The way back from the end to the start does not count.
    pub open: bool,
    /// No tour is shorter.
    pub bound: u64,
    /// The pen-up moves from odd station to odd station that are the shortest by themselves.
    pub mate: &'t mut [u16],
    /// Where a route with these moves begins.
    pub start: Option<u16>,
    /// How much may be worked when the first tour stands.
    pub budget: u64,
}

/// Shortens `tour.route`, if it can, while `tour.budget` lasts. It sets out from that route or, if that
/// is shorter, from the one with the moves `tour.mate`, mended so that they join the parts. Does
/// nothing where there is too little memory.
pub(super) fn improve(
    network: Network<'_>,
    tour: Tour<'_>,
    mut scratch: Scratch<'_>,
    pace: &mut Pace<'_>,
) -> Result<(), OrderError> {
    let Tour { route, open, bound, mate, start, budget } = tour;
    let length = route_length(network, route, open);
    let legs = route.len() + usize::from(open);
    let fits = |per_station: &usize| {
        scratch_bytes(network, legs, *per_station) <= scratch.available_bytes()
    };
    let Some(per_station) = NEIGHBOURS.into_iter().find(fits) else {
        return Ok(());
    };
    if length == bound {
        return Ok(());
    }
    let near = Near::new(network, per_station, &mut scratch, pace)?;
    let cycle: &mut [Leg] = scratch.take(legs)?;
    mend(network, near, mate, scratch.reborrow(), pace)?;
    let (mended, after) = cycle.split_at_mut(route.len());
    Unused::new(network, mate, &mut scratch.reborrow())?.nearest_first(start, mended, pace)?;
    if route_length(network, mended, open) > length {
        mended.copy_from_slice(route);
    }
    let gap = open.then_some(network.chains());
    after.fill(Leg::new(network.chains(), false));
    let mut exchanges = Exchanges::new(network, near, cycle, gap, &mut scratch)?;
    pace.grant(budget);
    exchanges.exchange_all(true, pace)?;
    let moves = (0..legs).filter(|&index| exchanges.move_after(exchanges.cycle.leg(index)) > 0);
    let patience = PATIENCE * moves.count();
    let mut kicks = Kicks { random: 1 };
    let mut in_vain = 0;
    while in_vain < patience && !pace.is_over() {
        in_vain += 1;
        if kicks.kick(&mut exchanges, pace)? > 0 {
            in_vain = 0;
        }
    }
    if exchanges.length() < length {
        let leg = |index: usize| exchanges.cycle.leg(index % legs);
        let gap = (0..legs).find(|&index| exchanges.is_gap(leg(index)));
        let start = gap.map_or(0, |gap| gap + 1);
        for (index, place) in route.iter_mut().enumerate() {
            *place = leg(start + index);
        }
    }
    Ok(())
}

/// The most scratch that is taken at a time, in bytes.
fn scratch_bytes(network: Network<'_>, legs: usize, per_station: usize) -> usize {
    let (stations, chains) = (usize::from(network.stations()), usize::from(network.chains()));
    let lists = Near::bytes(stations, per_station);
    let exchanges = Scratch::bytes_for::<u16>(legs) + Exchanges::bytes(stations, chains, legs);
    lists + exchanges.max(Near::bytes_to_find(stations))
}

/// The length of the moves of a route, with the one back if it is not open.
fn route_length(network: Network<'_>, route: &[Leg], open: bool) -> u64 {
    let moves = route.iter().zip(route.iter().cycle().skip(1));
    moves
        .take(route.len() - usize::from(open))
        .map(|(&from, &to)| u64::from(network.distance(network.end(from), network.start(to))))
        .sum()
}

/// A source of kicks.
struct Kicks {
    random: u32,
}

impl Kicks {
    /// Changes four moves near each other at random (a double bridge), and what follows from that;
    /// keeps it if the tour is no longer for it. Returns the gain.
    fn kick(
        &mut self,
        tour: &mut Exchanges<'_, '_>,
        pace: &mut Pace<'_>,
    ) -> Result<i64, OrderError> {
        tour.cycle.settle();
        let begin = self.below(tour.cycle.len() as u32) as usize;
        let mut at = tour.cycle.leg(begin);
        let mut cuts = [at; 4];
        for cut in &mut cuts {
            for _ in 0..=self.below(KICK_REACH) {
                let Some(leg) = next_move(tour, at, pace)? else {
                    return Ok(0);
                };
                at = leg;
            }
            *cut = at;
        }
        let [a, c, e, g] = cuts;
        // The walk may have gone all the way around a short tour.
        let [to_c, to_e, to_g] = [c, e, g].map(|cut| tour.cycle.steps(a, cut));
        if to_c == 0 || to_e <= to_c || to_g <= to_e {
            return Ok(0);
        }
        let [b, d, f, h] = cuts.map(|leg| tour.cycle.next(leg));
        let ends = [(a, b), (c, d), (e, f), (g, h), (a, f), (g, d), (e, b), (c, h)];
        let costs = ends.map(|(from, to)| tour.distance(tour.end(from), tour.start(to)));
        let loss = costs[4..].iter().sum::<i64>() - costs[..4].iter().sum::<i64>();
        // … a, f … g, d … e, b … c, h …
        let moved = tour.cycle.swap(a, d, g) + tour.cycle.swap(a, f, g);
        pace.work(8 + moved as u32 / 32)?;
        tour.wake(&[a, b.flipped(), c, d.flipped(), e, f.flipped(), g, h.flipped()]);
        let gain = tour.exchange_all(false, pace)? - loss;
        if gain < 0 {
            tour.cycle.take_back(0);
        }
        Ok(gain.max(0))
    }

    /// A number below `limit` (Marsaglia's xorshift).
    fn below(&mut self, limit: u32) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        ((u64::from(self.random) * u64::from(limit)) >> 32) as u32
    }
}

/// The next leg after `from` at whose end the pen is lifted, if there is any.
fn next_move(
    tour: &Exchanges<'_, '_>,
    from: Leg,
    pace: &mut Pace<'_>,
) -> Result<Option<Leg>, OrderError> {
    let mut leg = from;
    for _ in 0..tour.cycle.len() {
        pace.work(1)?;
        leg = tour.cycle.next(leg);
        if tour.move_after(leg) > 0 {
            return Ok(Some(leg));
        }
    }
    Ok(None)
}
