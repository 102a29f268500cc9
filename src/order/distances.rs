//! Caches the distances between stations in a table.
//!
//! Exchanges ask for the same few distances again and again, and on a small core a square root
//! costs far more than a table lookup. Each pair of stations has one entry in the table, which
//! holds the last of the pairs that share it. The size of the table changes the work and never the
//! result. After Helsgaun, "An effective implementation of the Lin–Kernighan traveling salesman
//! heuristic" (2000), 4.2.

use super::network::Network;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use core::cell::Cell;

/// An entry of the table: a pair of stations, the lower first, and the distance between them in
/// 1/256 steps, which takes no more bits than a pair.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct DistanceEntry<P>([P; 2]);

/// Returns the distances between the stations of a network, and remembers the last ones asked for.
pub(super) struct Distances<'s, 'a, I: Index> {
    /// The network in which the stations lie.
    network: Network<'a, I>,
    /// The table. Its length is a power of two, or 0.
    known: &'s [Cell<DistanceEntry<I::Pair>>],
    /// The hash of a pair, of 32 bits, is shifted right by this to give its index in the table.
    shift: u32,
}

impl<'s, 'a, I: Index> Distances<'s, 'a, I> {
    /// The table has at most 2^13 entries: to clear more would take longer than they save.
    const MOST_BITS: u32 = 13;

    /// Makes an empty table, as large as the memory allows.
    pub fn new(network: Network<'a, I>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let slots = scratch.available_bytes() / size_of::<DistanceEntry<I::Pair>>();
        let bits = slots.checked_ilog2().unwrap_or(0).min(Self::MOST_BITS);
        let known: &mut [DistanceEntry<I::Pair>] =
            scratch.take(if bits == 0 { 0 } else { 1 << bits })?;
        known.fill(DistanceEntry([I::pair(I::NONE, I::NONE), 0.into()]));
        Ok(Self {
            network,
            known: Cell::from_mut(known).as_slice_of_cells(),
            shift: (32 - bits).min(31),
        })
    }

    /// Returns the distance between two stations in 1/256 steps.
    pub fn between(&self, from: I, to: I) -> u32 {
        self.below(u32::MAX, from, to).unwrap_or(u32::MAX)
    }

    /// Returns the distance between two stations in 1/256 steps, or `None` if it is not below
    /// `bound`.
    pub fn below(&self, bound: u32, from: I, to: I) -> Option<u32> {
        let [low, high] = if from < to { [from, to] } else { [to, from] };
        let pair = I::pair(low, high);
        // Knuth's multiplicative hashing, with a prime near 2^32 times the golden ratio.
        let mixed = (low.into().rotate_left(16) ^ high.into()).wrapping_mul(2_654_435_761);
        let slot = self.known.get((mixed >> self.shift) as usize);
        let known = slot.map(Cell::get).filter(|DistanceEntry([known, _])| *known == pair);
        let length = match known {
            Some(DistanceEntry([_, length])) => length.into() as u32,
            None if self.network.least_distance(from, to) >= bound => return None,
            None => {
                let length = self.network.distance(from, to);
                if let Some(slot) = slot {
                    slot.set(DistanceEntry([pair, length.into()]));
                }
                length
            }
        };
        (length < bound).then_some(length)
    }
}
