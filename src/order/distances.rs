//! Caches the distances between stations in a table.
//!
//! Exchanges ask for the same few distances again and again, and on a small core a square root
//! costs far more than a table lookup. Each pair of stations has one entry in the table, which
//! holds the last of the pairs that share it. The size of the table changes the work and never the
//! result. After Helsgaun, "An effective implementation of the Lin–Kernighan traveling salesman
//! heuristic" (2000), 4.2.

use super::metric::least_length;
use super::network::Network;
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use core::cell::Cell;

/// An entry of the table: a pair of stations, the lower first, and the distance between them in
/// 1/256 steps, which takes no more bits than a pair.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct DistanceEntry<P>([P; 2]);

/// What a computer keeps of each station, so that the commonest questions about it need no pair.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Station {
    /// Where the station lies.
    place: PagePoint,
    /// The station whose distance was asked for last. In most cases it is that at the other end of
    /// a move of the tour. At first it is the station itself.
    other: u32,
    /// The distance between both, in 1/256 steps.
    length: u32,
}

/// Returns the distances between the stations of a network, and remembers the last ones asked for.
pub(super) struct Distances<'s, 'a, I: Index> {
    /// The network in which the stations lie.
    network: Network<'a, I>,
    /// The table. Its length is a power of two, or 0.
    known: &'s [Cell<DistanceEntry<I::Pair>>],
    /// The hash of a pair, of 32 bits, is shifted right by this to give its index in the table.
    shift: u32,
    /// All stations, on a computer; otherwise none.
    stations: &'s [Cell<Station>],
}

impl<'s, 'a, I: Index> Distances<'s, 'a, I> {
    /// The table has at most 2^13 entries: to clear more would take longer than they save. A
    /// computer has more, for it clears them faster.
    const MOST_BITS: u32 = if I::HAS_ROOM { 15 } else { 13 };

    /// Makes an empty table, as large as the memory allows.
    pub fn new(network: Network<'a, I>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let count = if I::HAS_ROOM { network.stations().get() } else { 0 };
        let stations: &mut [Station] = scratch.take(count)?;
        for (number, station) in I::all().zip(stations.iter_mut()) {
            let place = network.position(number);
            *station = Station { place, other: number.into(), length: 0 };
        }
        let slots = scratch.available_bytes() / size_of::<DistanceEntry<I::Pair>>();
        let bits = slots.checked_ilog2().unwrap_or(0).min(Self::MOST_BITS);
        let known: &mut [DistanceEntry<I::Pair>] =
            scratch.take(if bits == 0 { 0 } else { 1 << bits })?;
        known.fill(DistanceEntry([I::pair(I::NONE, I::NONE), 0.into()]));
        Ok(Self {
            network,
            known: Cell::from_mut(known).as_slice_of_cells(),
            shift: (32 - bits).min(31),
            stations: Cell::from_mut(stations).as_slice_of_cells(),
        })
    }

    /// Returns the scratch memory needed besides the table for this many stations, in bytes.
    pub const fn bytes(stations: usize) -> usize {
        if I::HAS_ROOM { Scratch::bytes_for::<Station>(stations) } else { 0 }
    }

    /// Returns what is kept of a station; `None` for the anchor, and on a board.
    #[inline]
    fn station(&self, station: I) -> Option<&'s Cell<Station>> {
        if I::HAS_ROOM { self.stations.get(station.get()) } else { None }
    }

    /// Returns the distance between two stations in 1/256 steps.
    #[cfg_attr(feature = "threads", inline(always))] // In most cases it is kept.
    pub fn between(&self, from: I, to: I) -> u32 {
        if I::HAS_ROOM {
            for (one, other) in [(to, from), (from, to)] {
                if let Some(station) = self.station(one).map(Cell::get)
                    && station.other == other.into()
                {
                    return station.length;
                }
            }
            return self.between_anew(from, to);
        }
        self.known_below(u32::MAX, from, to).unwrap_or(u32::MAX)
    }

    /// Returns the distance between two stations in 1/256 steps, and keeps it with the second.
    #[inline(never)] // It is seldom needed.
    fn between_anew(&self, from: I, to: I) -> u32 {
        let length = self.known_below(u32::MAX, from, to).unwrap_or(u32::MAX);
        if let Some(slot) = self.station(to) {
            slot.set(Station { other: from.into(), length, ..slot.get() });
        }
        length
    }

    /// Returns a lower bound of the distance between two stations in 1/256 steps.
    #[cfg_attr(feature = "threads", inline(always))] // The call would take longer.
    pub fn at_least(&self, from: I, to: I) -> u32 {
        match (self.station(from), self.station(to)) {
            (Some(from), Some(to)) => least_length(from.get().place, to.get().place),
            _ => self.network.least_distance(from, to),
        }
    }

    /// Returns the distance between two stations in 1/256 steps, or `None` if it is not below
    /// `bound`.
    pub fn below(&self, bound: u32, from: I, to: I) -> Option<u32> {
        // A processor that multiplies fast is sooner done with the bound than with the table.
        if I::HAS_ROOM && self.at_least(from, to) >= bound {
            return None;
        }
        self.known_below(bound, from, to)
    }

    /// As [`Self::below`], from the table if the distance is there.
    #[cfg_attr(feature = "threads", inline(always))] // A call would take as long as the table.
    fn known_below(&self, bound: u32, from: I, to: I) -> Option<u32> {
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
