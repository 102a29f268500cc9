//! Traces Eulerian trails (Harrison 5.11 and appendix 5.2), and joins those of the separate parts
//! into one tour.
//!
//! Harrison traces a cycle, looks along it for a point with unused segments, and splices in the
//! cycle traced from there. Here the trail that is being traced and the finished one share one
//! slice and grow towards each other. This takes linear time and no further list.

use super::incidence::Incidence;
use super::metric::length;
use super::neighbours::{Candidate, Neighbours};
use super::network::Network;
use super::remaining::Remaining;
use super::work_budget::WorkBudget;
use super::{Leg, OrderError, even_part};
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

// Why no index in this file can fail:
// * A station is below the length of `mate`, which has an entry for each: it is an end of a chain,
//   or comes from a list of stations, or is a partner in `mate`. `lift` tests for the other marks.
// * `used` has an entry for each chain, and each leg is that of a chain.
// * `trace` gets room for each chain that is not used yet. Each leg before `traced` and from
//   `finished` on is another of these. So `traced` is below `finished` when a leg is added, and
//   `finished` is not 0 when one is moved there. `done` counts chains, so it is within the route.

/// What remains to be traced: the chains (runs of segments) and the pen-up moves that no trail has
/// used yet.
pub(super) struct Unused<'s, 'a, I> {
    /// The graph that is traced. It says at which stations each chain begins and ends.
    network: Network<'a, I>,
    /// The legs from each station, without those at the front that were found to be used.
    legs: Incidence<'s, I>,
    /// 1 for each chain that has been used, otherwise 0.
    used: &'s mut [u8],
    /// For each station, the other end of its pen-up move; or [`Index::NONE`] or [`even_part`].
    mate: &'s mut [I],
    /// The entrances that are left, and some that are no more; `None` if there is no memory for
    /// them.
    entrances: Option<Remaining<'s, I>>,
}

impl<'s, 'a, I: Index> Unused<'s, 'a, I> {
    /// Begins with nothing drawn: all chains of `network`, and a pen-up move from each station to
    /// its `mate`.
    pub fn new(
        network: Network<'a, I>,
        mate: &'s mut [I],
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let legs = Incidence::new(network, scratch)?;
        let used = scratch.take(network.chains().get())?;
        let stations = network.stations();
        let has_room = cfg!(feature = "many-strokes")
            && Remaining::<I>::bytes(stations.get()) <= scratch.available_bytes();
        let entrances = has_room
            .then(|| Remaining::new(network, stations, &|station| station, scratch))
            .transpose()?;
        Ok(Self { network, legs, used, mate, entrances })
    }

    /// Returns the next leg from `station` whose segments no trail has drawn yet.
    fn peek(&mut self, station: I) -> Option<Leg<I>> {
        while let Some(leg) = self.legs.first(station) {
            if self.used.get(leg.segment()) == Some(&0) {
                return Some(leg);
            }
            self.legs.drop_first(station);
        }
        None
    }

    /// Returns the next leg from `station` that no trail has drawn yet, and marks it as drawn.
    fn take(&mut self, station: I) -> Option<Leg<I>> {
        let leg = self.peek(station)?;
        self.used[leg.segment()] = 1;
        Some(leg)
    }

    /// Marks the move from `station` as used and returns the station to which it leads.
    fn lift(&mut self, station: I) -> Option<I> {
        let mate = self.mate[station.get()];
        if mate == I::NONE || mate == even_part() {
            return None;
        }
        self.mate[station.get()] = I::NONE;
        self.mate[mate.get()] = I::NONE;
        Some(mate)
    }

    /// Traces all chains and moves that are connected with `start`, and writes the legs to the
    /// front of `route`. Returns the number of legs. If one station other than `start` has an odd
    /// number of uses left, the trail ends there, otherwise where it began.
    fn trace(
        &mut self,
        start: I,
        route: &mut [Leg<I>],
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<usize, OrderError> {
        let mut traced = 0;
        let mut finished = route.len();
        let mut here = start;
        loop {
            work_budget.work(1)?;
            if let Some(leg) = self.take(here) {
                route[traced] = leg;
                traced += 1;
                here = self.network.end(leg);
            } else if let Some(there) = self.lift(here) {
                here = there;
            } else if let Some(&last) = route[..traced].last() {
                if self.network.end(last) == here {
                    traced -= 1;
                    finished -= 1;
                    route[finished] = last;
                    here = self.network.start(last);
                } else {
                    // The pen came here by a pen-up move, so the search returns along it.
                    here = self.network.end(last);
                }
            } else {
                let legs = route.len() - finished;
                route.copy_within(finished.., 0);
                return Ok(legs);
            }
        }
    }

    /// Whether an undrawn part may be entered at `station`. It may if a pen-up move leads from
    /// there, which the entrance then replaces, or if no station of the part has such a move.
    fn is_entrance(&mut self, station: I) -> bool {
        self.mate.get(station.get()) != Some(&I::NONE) && self.peek(station).is_some()
    }

    /// Returns the station at which an undrawn part is best entered: the one for which `far` is
    /// least. `None` if everything is drawn.
    pub fn entrance(
        &mut self,
        far: &dyn Fn(PagePoint) -> u32,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<I>, OrderError> {
        let mut best = None;
        let mut least = u32::MAX;
        for station in I::below(self.network.stations()) {
            if self.is_entrance(station) {
                work_budget.work(1)?;
                let distance = far(self.network.position(station));
                if distance < least || best.is_none() {
                    (least, best) = (distance, Some(station));
                }
            }
        }
        Ok(best)
    }

    /// Returns the entrance (the station at which an undrawn part may be entered) nearest to the
    /// station `pen`. If `near` lists any entrance, it is the first of those.
    fn next_entrance(
        &mut self,
        pen: I,
        near: Option<Neighbours<'_, I>>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Option<I>, OrderError> {
        for Candidate { station, .. } in near.into_iter().flat_map(|near| near.of(pen)) {
            work_budget.work(1)?;
            if self.is_entrance(station) {
                return Ok(Some(station));
            }
        }
        let at = self.network.position(pen);
        let Some(mut entrances) = self.entrances.take() else {
            return self.entrance(&|position| length(at, position), work_budget);
        };
        let mut nearest = (u32::MAX, I::NONE);
        let mut looked_at = 1;
        entrances.search(at, &mut |station| {
            looked_at += 1;
            if !self.is_entrance(station) {
                return None;
            }
            if self.network.least_distance(pen, station) <= nearest.0 {
                nearest = nearest.min((self.network.distance(pen, station), station));
            }
            Some(nearest.0)
        });
        self.entrances = Some(entrances);
        work_budget.work(looked_at)?;
        Ok((nearest.1 != I::NONE).then_some(nearest.1))
    }

    /// Traces all parts, from `start` if it is given and otherwise from the entrance with the
    /// lowest x. Each further part is entered at the entrance nearest to the pen, or nearly so: the
    /// neighbours listed in `near` come first.
    pub fn nearest_first(
        &mut self,
        start: Option<I>,
        near: Option<Neighbours<'_, I>>,
        route: &mut [Leg<I>],
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let network = self.network;
        let from_the_left = |position: PagePoint| position.x.wrapping_sub(i32::MIN) as u32;
        let mut entrance = match start {
            Some(start) => Some(start),
            None => self.entrance(&from_the_left, work_budget)?,
        };
        let mut done = 0;
        while let Some(start) = entrance {
            // The part is left at the other end of the move that would close it, so that move is
            // not needed.
            self.lift(start);
            done += self.trace(start, &mut route[done..], work_budget)?;
            let Some(&last) = route[..done].last() else {
                break;
            };
            entrance = self.next_entrance(network.end(last), near, work_budget)?;
        }
        Ok(())
    }
}
