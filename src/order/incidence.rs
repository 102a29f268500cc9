//! For each station, the list of the legs that begin there, in little memory: linked lists over the
//! codes of the legs.

use super::Leg;
use super::network::Network;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

// No index can fail: `first` has an entry for each station and `next` one for each leg. Both hold
// codes of legs, or `NONE`, for which `leg` and `drop_first` test. Who asks has a station of the
// network, or a leg that came from here.

/// For each station (each point where the pen may stop), the list of the legs that begin there, in
/// ascending order of their codes.
pub(super) struct Incidence<'s, I> {
    /// For each station the code of the first leg of its list, or [`Index::NONE`].
    first: &'s mut [I],
    /// For each leg, by its code, the next leg of the same list, or [`Index::NONE`].
    next: &'s mut [I],
}

impl<'s, I: Index> Incidence<'s, I> {
    /// Lists, for each station, the legs that begin there.
    pub fn new(network: Network<'_, I>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let first: &mut [I] = scratch.take(network.stations().get())?;
        let next: &mut [I] = scratch.take(2 * network.chains().get())?;
        first.fill(I::NONE);
        for code in I::below(network.chains() << 1).rev() {
            let start = network.start(Leg::from_code(code)).get();
            next[code.get()] = first[start];
            first[start] = code;
        }
        Ok(Self { first, next })
    }

    /// Returns the scratch memory needed for this many stations and chains, in bytes.
    pub const fn bytes(stations: usize, chains: usize) -> usize {
        Scratch::bytes_for::<I>(stations) + Scratch::bytes_for::<I>(2 * chains)
    }

    /// Returns the first leg that begins at `station`.
    pub fn first(&self, station: I) -> Option<Leg<I>> {
        leg(self.first[station.get()])
    }

    /// Returns the leg that follows `after` in the list of the same station.
    pub fn next(&self, after: Leg<I>) -> Option<Leg<I>> {
        leg(self.next[after.code().get()])
    }

    /// As [`Incidence::first`], but `None` if `station` is none of the network.
    #[inline]
    pub fn first_at(&self, station: I) -> Option<Option<Leg<I>>> {
        self.first.get(station.get()).map(|&code| leg(code))
    }

    /// As [`Incidence::next`], but `None` if `after` is no leg of the network.
    #[inline]
    pub fn next_after(&self, after: Leg<I>) -> Option<Option<Leg<I>>> {
        self.next.get(after.code().get()).map(|&code| leg(code))
    }

    /// Removes the first leg from the list of `station`.
    pub fn drop_first(&mut self, station: I) {
        let first = &mut self.first[station.get()];
        if *first != I::NONE {
            *first = self.next[first.get()];
        }
    }
}

/// Returns the leg with this code; `None` if the code is [`Index::NONE`].
fn leg<I: Index>(code: I) -> Option<Leg<I>> {
    (code != I::NONE).then(|| Leg::from_code(code))
}
