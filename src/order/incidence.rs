//! For each station, the list of the legs that begin there, in little memory: linked lists over the
//! codes of the legs.

use super::network::Network;
use super::{Leg, NONE};
use crate::stage::{OutOfScratch, Scratch};

/// The lists of the legs that begin at each station, in ascending order of their codes.
pub(super) struct Incidence<'s> {
    /// For each station the code of the first leg of its list, or [`NONE`].
    first: &'s mut [u16],
    /// For each leg, by its code, the next leg of the same list, or [`NONE`].
    next: &'s mut [u16],
}

impl<'s> Incidence<'s> {
    /// Makes the lists of all legs of `network`.
    pub fn new(network: Network<'_>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let first: &mut [u16] = scratch.take(usize::from(network.stations()))?;
        let next: &mut [u16] = scratch.take(2 * usize::from(network.chains()))?;
        first.fill(NONE);
        for code in (0..2 * network.chains()).rev() {
            let start = usize::from(network.start(Leg::from_code(code)));
            next[usize::from(code)] = first[start];
            first[start] = code;
        }
        Ok(Self { first, next })
    }

    /// Returns the scratch memory needed for so many stations and chains, in bytes.
    pub const fn bytes(stations: usize, chains: usize) -> usize {
        Scratch::bytes_for::<u16>(stations) + Scratch::bytes_for::<u16>(2 * chains)
    }

    /// Returns the first leg that begins at `station`.
    pub fn first(&self, station: u16) -> Option<Leg> {
        leg(self.first[usize::from(station)])
    }

    /// Returns the leg that follows `after` in the list of the same station.
    pub fn next(&self, after: Leg) -> Option<Leg> {
        leg(self.next[usize::from(after.code())])
    }

    /// Removes the first leg from the list of `station`.
    pub fn drop_first(&mut self, station: u16) {
        let first = &mut self.first[usize::from(station)];
        if *first != NONE {
            *first = self.next[usize::from(*first)];
        }
    }
}

/// Returns the leg with this code; `None` if the code is [`NONE`].
fn leg(code: u16) -> Option<Leg> {
    (code != NONE).then(|| Leg::from_code(code))
}
