//! A shorter tour of all parts: Lin and Kernighan's exchanges, then kicks.
//!
//! The tour is a cycle of chains; the moves between them cost, staying at a station costs nothing.
//! An exchange cuts a move, goes to a station nearer than that move was long, cuts the tour there,
//! and so on while there is still gain in hand, until the ends are joined with some gain left. When
//! no exchange helps, three moves near each other are changed at random (a double bridge), the
//! exchanges are tried again around them, and all is taken back unless it came out no longer. So a
//! tour only ever gets better. The same budget gives the same tour on every machine.
//! After Lin and Kernighan, "An effective heuristic algorithm for the traveling-salesman problem"
//! (1973), and Martin, Otto and Felten, "Large-step Markov chains" (1991).

use super::cycle::Cycle;
use super::euler::Unused;
use super::incidence::Incidence;
use super::mend::mend;
use super::near::Near;
use super::network::Network;
use super::pace::Pace;
use super::{Leg, NONE, OrderError};
use crate::stage::Scratch;

/// Neighbours of each station that are worth the memory, and as few as are of any use.
const NEIGHBOURS: core::ops::RangeInclusive<usize> = 4..=8;
/// A kick changes moves that are at most so many moves apart.
const KICK_REACH: u32 = 9;

/// What a tour can come to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// The way back from the end to the start does not count.
    pub open: bool,
    /// No tour is shorter.
    pub bound: u64,
}

/// Shortens `route`, which has all chains of `network`, if it can, with up to `kicks` kicks. It sets
/// out from `route` or, if that is shorter, from the tour that begins at `start` with the moves `mate`,
/// mended so that they join the parts. Does nothing where there is too little memory.
#[allow(clippy::too_many_arguments)] // All of it belongs to the caller's one job; a struct would serve this call alone.
pub(super) fn improve(
    network: Network<'_>,
    mate: &mut [u16],
    start: Option<u16>,
    route: &mut [Leg],
    goal: Goal,
    kicks: u32,
    mut scratch: Scratch<'_>,
    pace: &mut Pace<'_>,
) -> Result<(), OrderError> {
    let Goal { open, bound } = goal;
    let length = route_length(network, route, open);
    let stations = usize::from(network.stations());
    let legs = route.len() + usize::from(open);
    let fixed = fixed_bytes(stations, route.len(), legs);
    let fits = |per_station: &usize| {
        fixed + Near::bytes(stations, *per_station) <= scratch.available_bytes()
    };
    let Some(per_station) = NEIGHBOURS.rev().find(fits) else {
        return Ok(());
    };
    if length == bound {
        return Ok(());
    }
    let near = Near::new(network, per_station, &mut scratch, pace)?;
    let cycle_legs: &mut [Leg] = scratch.take(legs)?;
    mend(network, near, mate, scratch.reborrow(), pace)?;
    let (mended, gap) = cycle_legs.split_at_mut(route.len());
    Unused::new(network, mate, &mut scratch.reborrow())?.nearest_first(start, mended, pace)?;
    if route_length(network, mended, open) > length {
        mended.copy_from_slice(route);
    }
    gap.fill(Leg::new(route.len() as u16, false));
    let incidence = Incidence::new(network, &mut scratch)?;
    let cycle = Cycle::new(cycle_legs, scratch.take(legs)?, scratch.take(Cycle::MEMORY)?);
    let mut search = Search {
        network,
        incidence,
        near,
        cycle,
        waiting: Waiting::new(scratch.take(stations)?, scratch.take(stations)?),
        gap: if open { route.len() } else { usize::MAX },
        random: 1,
    };
    for station in 0..network.stations() {
        search.waiting.add(station);
    }
    search.exchange_all(true, pace)?;
    for _ in 0..kicks {
        if !search.kick(pace)? {
            break;
        }
    }
    if search.length() < length {
        let gap = (0..legs).find(|&index| search.cycle.leg(index).segment() == search.gap);
        let start = gap.map_or(0, |gap| gap + 1);
        for (index, leg) in route.iter_mut().enumerate() {
            *leg = search.cycle.leg((start + index) % legs);
        }
    }
    Ok(())
}

/// The length of the moves of a route, with the one back if it is not open.
fn route_length(network: Network<'_>, route: &[Leg], open: bool) -> u64 {
    let moves = route.iter().zip(route.iter().cycle().skip(1));
    moves
        .take(route.len() - usize::from(open))
        .map(|(&from, &to)| u64::from(network.distance(network.end(from), network.start(to))))
        .sum()
}

/// Bytes of scratch besides the lists of neighbours.
const fn fixed_bytes(stations: usize, chains: usize, legs: usize) -> usize {
    Incidence::bytes(stations, chains)
        + 2 * Scratch::bytes_for::<u16>(legs)
        + Scratch::bytes_for::<[u16; 2]>(Cycle::MEMORY)
        + Scratch::bytes_for::<u16>(stations)
        + Scratch::bytes_for::<u8>(stations)
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

struct Search<'s, 'a> {
    network: Network<'a>,
    incidence: Incidence<'s>,
    near: Near<'s>,
    cycle: Cycle<'s>,
    waiting: Waiting<'s>,
    /// The number of the gap among the legs.
    gap: usize,
    random: u32,
}

impl Search<'_, '_> {
    /// The station where a leg ends; [`NONE`] of the gap.
    fn end(&self, leg: Leg) -> u16 {
        if leg.segment() == self.gap { NONE } else { self.network.end(leg) }
    }

    fn start(&self, leg: Leg) -> u16 {
        self.end(leg.flipped())
    }

    /// What a move costs: its length and a little more, lest two moves be better than one because
    /// their lengths are rounded down.
    fn distance(&self, from: u16, to: u16) -> i64 {
        if from == NONE || to == NONE || from == to {
            0
        } else {
            i64::from(self.network.distance(from, to)) + 1
        }
    }

    /// The length of all moves.
    fn length(&self) -> u64 {
        (0..self.cycle.len())
            .map(|index| self.move_after(self.cycle.leg(index)))
            .map(|cost| cost.saturating_sub(1).max(0) as u64)
            .sum()
    }

    /// The cost of the move after `leg`.
    fn move_after(&self, leg: Leg) -> i64 {
        self.distance(self.end(leg), self.start(self.cycle.next(leg)))
    }

    /// Tries exchanges around all stations that wait, and returns the gain. If `keep`, what was
    /// gained stays, else it can be taken back.
    fn exchange_all(&mut self, keep: bool, pace: &mut Pace<'_>) -> Result<i64, OrderError> {
        let mut gain = 0;
        while let Some(station) = self.waiting.next() {
            while let Some(more) = self.exchange_at(station, pace)? {
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
        pace: &mut Pace<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let mut from = self.incidence.first(station);
        while let Some(leg) = from {
            if self.move_after(leg.flipped()) > 0
                && self.cycle.can_turn()
                && let Some(gain) = self.exchange(leg.flipped(), pace)?
            {
                return Ok(Some(gain));
            }
            from = self.incidence.next(leg);
        }
        Ok(None)
    }

    /// Cuts the move from `a` to `b`, goes on to some `c` that is nearer, cuts there, and so once more,
    /// if joining the ends then leaves a gain; returns it.
    fn exchange(&mut self, a: Leg, pace: &mut Pace<'_>) -> Result<Option<i64>, OrderError> {
        let b = self.cycle.next(a);
        let hand = self.move_after(a);
        let end = self.end(a);
        let near = self.near;
        for station in [NONE, end].into_iter().chain(near.of(end)) {
            pace.work(1)?;
            let hand = hand - self.distance(end, station);
            if hand <= 0 {
                break;
            }
            let mut from = self.first_from(station);
            while let Some(leg) = from {
                from = self.next_from(leg);
                if leg == a || leg == b || leg.flipped() == a {
                    continue;
                }
                // One of the two ways of a leg is the way of `a`.
                let gain = if self.cycle.forward(leg) == self.cycle.forward(a) {
                    self.exchange_onward(a, leg, hand, pace)?
                } else {
                    self.exchange_flipped(a, leg.flipped(), hand, pace)?
                };
                if gain.is_some() {
                    return Ok(gain);
                }
            }
        }
        Ok(None)
    }

    /// From `… a, b … c, d …` with the move from `a` to `c` already paid for: either closes it with
    /// `b` to `d`, or goes on from `d` to cut a third move.
    fn exchange_flipped(
        &mut self,
        a: Leg,
        c: Leg,
        hand: i64,
        pace: &mut Pace<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let (b, d) = (self.cycle.next(a), self.cycle.next(c));
        let (first, end) = (self.start(b), self.start(d));
        let hand = hand + self.move_after(c);
        pace.work(2)?;
        let gain = hand - self.distance(end, first);
        if gain > 0 {
            self.cycle.turn(a, c);
            return self.made(&[a, b.flipped(), c, d.flipped()], gain, pace);
        }
        if end == NONE {
            return Ok(None);
        }
        let to_c = self.cycle.steps(a, c);
        let near = self.near;
        for station in [NONE, end].into_iter().chain(near.of(end)) {
            pace.work(1)?;
            let hand = hand - self.distance(end, station);
            if hand <= 0 {
                break;
            }
            let mut from = self.first_from(station);
            while let Some(leg) = from {
                from = self.next_from(leg);
                let onward = self.cycle.forward(leg) == self.cycle.forward(a);
                let within = |leg: Leg| (1..=to_c).contains(&self.cycle.steps(a, leg));
                // The leg before the third cut, and the one after.
                let (e, f) = if onward {
                    (self.cycle.previous(leg), leg)
                } else {
                    (leg.flipped(), self.cycle.next(leg.flipped()))
                };
                if e == a || e == c || within(e) == onward {
                    continue;
                }
                let far = if onward { self.end(e) } else { self.start(f) };
                pace.work(2)?;
                let gain = hand + self.move_after(e) - self.distance(far, first);
                if gain <= 0 {
                    continue;
                }
                self.cycle.turn(a, c);
                if onward {
                    // … e, b … c, a … f, d … with `a … f` flipped.
                    self.cycle.turn(d.flipped(), f.flipped());
                } else {
                    // … a, c … f, b … e, d … with `c … f` flipped.
                    self.cycle.turn(f.flipped(), b.flipped());
                }
                let ends = [a, b.flipped(), c, d.flipped(), e, f.flipped()];
                return self.made(&ends, gain, pace);
            }
        }
        Ok(None)
    }

    /// From `… a, b … c, d …` with the move from `a` to `d` already paid for, which would make a
    /// cycle of `d … a`: goes on from `c` to cut a move in that and take it in.
    fn exchange_onward(
        &mut self,
        a: Leg,
        d: Leg,
        hand: i64,
        pace: &mut Pace<'_>,
    ) -> Result<Option<i64>, OrderError> {
        let (b, c) = (self.cycle.next(a), self.cycle.previous(d));
        let (first, end) = (self.start(b), self.end(c));
        let hand = hand + self.move_after(c);
        if end == NONE {
            return Ok(None);
        }
        let to_d = self.cycle.steps(a, d);
        let near = self.near;
        for station in [NONE, end].into_iter().chain(near.of(end)) {
            pace.work(1)?;
            let hand = hand - self.distance(end, station);
            if hand <= 0 {
                break;
            }
            let mut from = self.first_from(station);
            while let Some(leg) = from {
                from = self.next_from(leg);
                let onward = self.cycle.forward(leg) == self.cycle.forward(a);
                let (e, f) = if onward {
                    (self.cycle.previous(leg), leg)
                } else {
                    (leg.flipped(), self.cycle.next(leg.flipped()))
                };
                if e == a || self.cycle.steps(a, e) < to_d {
                    continue;
                }
                let far = if onward { self.end(e) } else { self.start(f) };
                pace.work(2)?;
                let gain = hand + self.move_after(e) - self.distance(far, first);
                if gain <= 0 {
                    continue;
                }
                if onward {
                    // … a, d … e, b … c, f …
                    self.cycle.swap(a, d, e);
                } else {
                    // … a, d … e, c … b, f … with `c … b` flipped.
                    self.cycle.turn(a, e);
                    self.cycle.turn(a, d.flipped());
                }
                let ends = [a, b.flipped(), c, d.flipped(), e, f.flipped()];
                return self.made(&ends, gain, pace);
            }
        }
        Ok(None)
    }

    /// Lets the ends of `legs` wait again, now that an exchange between them has been made.
    fn made(
        &mut self,
        legs: &[Leg],
        gain: i64,
        pace: &mut Pace<'_>,
    ) -> Result<Option<i64>, OrderError> {
        self.wake(legs);
        pace.work(1 + self.cycle.len() as u32 / 32)?;
        Ok(Some(gain))
    }

    /// The legs from a station; from nowhere, the gap both ways.
    fn first_from(&self, station: u16) -> Option<Leg> {
        if station == NONE {
            (self.gap != usize::MAX).then(|| Leg::new(self.gap as u16, false))
        } else {
            self.incidence.first(station)
        }
    }

    fn next_from(&self, leg: Leg) -> Option<Leg> {
        if leg.segment() == self.gap {
            (!leg.reversed()).then(|| leg.flipped())
        } else {
            self.incidence.next(leg)
        }
    }

    /// Lets the ends of `legs` wait for exchanges.
    fn wake(&mut self, legs: &[Leg]) {
        for &leg in legs {
            let station = self.end(leg);
            self.waiting.add(station);
        }
    }

    /// Changes three moves near each other at random, and what follows from that; keeps it if the
    /// tour is no longer for it. Says whether there is anything to kick.
    fn kick(&mut self, pace: &mut Pace<'_>) -> Result<bool, OrderError> {
        self.cycle.settle();
        let begin = self.below(self.cycle.len() as u32) as usize;
        let mut a = self.cycle.leg(begin);
        let mut cuts = [a; 3];
        for cut in &mut cuts {
            let moves = 1 + self.below(KICK_REACH);
            for _ in 0..moves {
                let mut legs = 0;
                loop {
                    a = self.cycle.next(a);
                    legs += 1;
                    if self.move_after(a) > 0 {
                        break;
                    }
                    if legs > self.cycle.len() {
                        return Ok(false);
                    }
                }
                pace.work(1 + legs as u32)?;
            }
            *cut = a;
        }
        let [a, c, e] = cuts;
        let to_c = self.cycle.steps(a, c);
        if to_c == 0 || self.cycle.steps(a, e) <= to_c {
            return Ok(true);
        }
        let [b, d, f] = cuts.map(|leg| self.cycle.next(leg));
        let ends = [(a, b), (c, d), (e, f), (a, d), (e, b), (c, f)];
        let lengths = ends.map(|(from, to)| self.distance(self.end(from), self.start(to)));
        let loss = lengths[3..].iter().sum::<i64>() - lengths[..3].iter().sum::<i64>();
        let moved = self.cycle.swap(a, d, e);
        pace.work(6 + moved as u32 / 32)?;
        self.wake(&[a, b.flipped(), c, d.flipped(), e, f.flipped()]);
        if self.exchange_all(false, pace)? < loss {
            self.cycle.take_back(0);
        }
        Ok(true)
    }

    /// A number below `limit` (Marsaglia's xorshift).
    fn below(&mut self, limit: u32) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        ((u64::from(self.random) * u64::from(limit)) >> 32) as u32
    }
}
