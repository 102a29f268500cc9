//! The odd points, between which the pen must be lifted, and the distances between them.

use super::metric::length;
use super::network::Network;
use super::remaining::Remaining;
use crate::drawing::PagePoint;
use crate::index::{Index, Numbers};
use crate::stage::{OutOfScratch, Scratch};

/// The odd stations of a network, numbered from 0. For an open path two *free ends* follow them.
/// Each free end is at distance 0 from every odd point, so that the stations paired with the free
/// ends are the start and the end of the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct OddPoints<'a, I> {
    /// The network to which the stations belong; it knows where they lie.
    network: Network<'a, I>,
    /// The odd stations, sorted by x.
    stations: &'a [I],
    /// Whether two free ends follow the odd stations.
    free_ends: bool,
}

impl<'a, I: Index> OddPoints<'a, I> {
    /// Makes the odd points of `network` from its odd `stations`, which must be sorted by x. If
    /// `open`, free ends are added.
    pub fn new(network: Network<'a, I>, stations: &'a [I], open: bool) -> Self {
        let free_ends = open && !stations.is_empty();
        Self { network, stations, free_ends }
    }

    /// Returns the number of odd stations, where the pen must be lifted or lowered, without the
    /// free ends.
    pub fn real_count(&self) -> I {
        I::new(self.stations.len())
    }

    /// Returns the number of odd stations and free ends.
    pub fn count(&self) -> I {
        self.real_count() + I::new(2 * usize::from(self.free_ends))
    }

    /// Whether two free ends are added, because the path is open.
    pub fn has_free_ends(&self) -> bool {
        self.free_ends
    }

    /// Returns the numbers of the two free ends, which stand for the start and the end of an open
    /// path.
    pub fn free_ends(&self) -> [I; 2] {
        [self.real_count(), self.real_count() + I::ONE]
    }

    /// Returns the numbers of the free ends as a range, which is empty if there are none.
    pub fn free_numbers(&self) -> Numbers<I> {
        self.real_count().to(self.count())
    }

    /// Returns the station of an odd point, or `None` for a free end.
    pub fn station(&self, odd: I) -> Option<I> {
        self.stations.get(odd.get()).copied()
    }

    /// Sorts all odd points but the free ends into the cells of a grid, where those near a place
    /// are found.
    ///
    /// # Errors
    /// [`OutOfScratch`] if there are fewer than [`Remaining::bytes`].
    pub fn remaining<'s>(
        &self,
        scratch: &mut Scratch<'s>,
    ) -> Result<Remaining<'s, I>, OutOfScratch> {
        // `Remaining` asks for the numbers below `real_count` only, of which each has a station.
        let station = |odd: I| self.stations[odd.get()];
        Remaining::new(self.network, self.real_count(), &station, scratch)
    }

    /// Returns the position of an odd point that is no free end.
    // Each caller has a number below `real_count`, so the station exists.
    pub fn position(&self, odd: I) -> PagePoint {
        self.network.position(self.stations[odd.get()])
    }

    /// Returns the length of the move between two odd points in 1/256 steps. It is very large
    /// between the two free ends, which may not be paired with each other.
    pub fn distance(&self, a: I, b: I) -> u32 {
        match (self.station(a), self.station(b)) {
            (Some(a), Some(b)) => self.network.distance(a, b),
            (None, None) => u32::MAX / 4,
            _ => 0,
        }
    }

    /// Returns a lower bound of the length of the move between two odd points in 1/256 steps,
    /// without a square root.
    pub fn least_distance(&self, a: I, b: I) -> u32 {
        match (self.station(a), self.station(b)) {
            (Some(a), Some(b)) => self.network.least_distance(a, b),
            _ => 0,
        }
    }

    /// Returns the distance between two odd points along x in 1/256 steps; 0 for a free end.
    pub fn distance_along_x(&self, a: I, b: I) -> u32 {
        let x = |odd| self.station(odd).map(|station| self.network.position(station).x);
        x(a).zip(x(b)).map_or(0, |(a, b)| a.abs_diff(b) << 8)
    }

    /// Returns a range that holds all odd stations whose x is at most `reach` 1/256 steps from that
    /// of `odd`; all other stations are farther from it than `reach`. For a free end it holds all
    /// of them.
    pub fn around(&self, odd: I, reach: u32) -> Numbers<I> {
        let x_of = |station: &I| self.network.position(*station).x;
        let Some(x) = self.stations.get(odd.get()).map(x_of) else {
            return I::below(self.real_count());
        };
        let reach = (reach >> 8) as i32 + 1;
        let begin = self.stations.partition_point(|station| x_of(station) < x - reach);
        let end = self.stations.partition_point(|station| x_of(station) <= x + reach);
        I::new(begin).to(I::new(end))
    }

    /// Returns an upper bound of the length of any move in 1/256 steps: the diagonal of the box
    /// around the stations.
    pub fn extent(&self) -> u32 {
        let positions = || self.stations.iter().map(|&station| self.network.position(station));
        let corner =
            |x: Option<i32>, y: Option<i32>| PagePoint { x: x.unwrap_or(0), y: y.unwrap_or(0) };
        length(
            corner(positions().map(|p| p.x).min(), positions().map(|p| p.y).min()),
            corner(positions().map(|p| p.x).max(), positions().map(|p| p.y).max()),
        )
    }
}
