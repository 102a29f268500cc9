//! Distances between stations, remembered.
//!
//! Exchanges ask for the same few distances again and again, and a root costs a small core far more
//! than a look into a table. A pair of stations has one place in the table, where the last pair that
//! fell there is found; how large the table is changes the work and nothing else. After Helsgaun, "An
//! effective implementation of the Lin–Kernighan traveling salesman heuristic" (2000), 4.2.

use super::NONE;
use super::network::Network;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use core::cell::Cell;

/// A pair of stations, the lower first, and how far they are from each other in 1/256 steps.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Known {
    pair: [u16; 2],
    length: u32,
}

/// The distances of a network.
pub(super) struct Distances<'s, 'a> {
    network: Network<'a>,
    /// As many as a power of two, or none.
    known: &'s [Cell<Known>],
    /// What is left of a pair's 32 mixed bits is its place.
    shift: u32,
}

impl<'s, 'a> Distances<'s, 'a> {
    /// More places would not be worth the time that it takes to clear them.
    const MOST_BITS: u32 = 13;

    /// Remembers as much as there is memory for.
    pub fn new(network: Network<'a>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let places = scratch.available_bytes() / size_of::<Known>();
        let bits = places.checked_ilog2().unwrap_or(0).min(Self::MOST_BITS);
        let known: &mut [Known] = scratch.take(if bits == 0 { 0 } else { 1 << bits })?;
        known.fill(Known { pair: [NONE; 2], length: 0 });
        Ok(Self {
            network,
            known: Cell::from_mut(known).as_slice_of_cells(),
            shift: (32 - bits).min(31),
        })
    }

    /// The distance between two stations in 1/256 steps.
    pub fn between(&self, from: u16, to: u16) -> u32 {
        self.below(u32::MAX, from, to).unwrap_or(u32::MAX)
    }

    /// The distance between two stations in 1/256 steps, if it is below `bound`.
    pub fn below(&self, bound: u32, from: u16, to: u16) -> Option<u32> {
        let pair = if from < to { [from, to] } else { [to, from] };
        // Knuth's multiplicative hashing, by a prime near 2^32 times the golden section.
        let mixed = (u32::from(pair[0]) << 16 | u32::from(pair[1])).wrapping_mul(2_654_435_761);
        let place = self.known.get((mixed >> self.shift) as usize);
        let known = place.map(Cell::get).filter(|known| known.pair == pair);
        let length = match known {
            Some(known) => known.length,
            None if self.network.least_distance(from, to) >= bound => return None,
            None => {
                let length = self.network.distance(from, to);
                if let Some(place) = place {
                    place.set(Known { pair, length });
                }
                length
            }
        };
        (length < bound).then_some(length)
    }
}
