//! Which legs begin at which station.

use super::network::Network;
use super::{Leg, NONE};
use crate::stage::{OutOfScratch, Scratch};

/// For each station a list of the legs that begin there, the lowest first.
pub(super) struct Incidence<'s> {
    first: &'s mut [u16],
    next: &'s mut [u16],
}

impl<'s> Incidence<'s> {
    /// All legs of `network`.
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

    /// Bytes of scratch for so many stations and chains.
    pub const fn bytes(stations: usize, chains: usize) -> usize {
        Scratch::bytes_for::<u16>(stations) + Scratch::bytes_for::<u16>(2 * chains)
    }

    /// The first leg from `station`.
    pub fn first(&self, station: u16) -> Option<Leg> {
        leg(self.first[usize::from(station)])
    }

    /// The leg after `after` from the same station.
    pub fn next(&self, after: Leg) -> Option<Leg> {
        leg(self.next[usize::from(after.code())])
    }

    /// Takes the first leg from `station` off its list.
    pub fn drop_first(&mut self, station: u16) {
        let first = &mut self.first[usize::from(station)];
        if *first != NONE {
            *first = self.next[usize::from(*first)];
        }
    }
}

fn leg(code: u16) -> Option<Leg> {
    (code != NONE).then(|| Leg::from_code(code))
}
