//! Finds the nearest stations of each station, among which the exchanges choose their new moves.
//!
//! The stations are sorted into a grid of about half as many cells as there are stations. Each
//! search visits square rings of cells around the station until no nearer station can follow.

use super::OrderError;
use super::cells::Cells;
use super::network::Network;
use super::work_budget::WorkBudget;
use crate::array::MapEach;
use crate::index::Index;
use crate::stage::Scratch;

/// For each station the same number of other stations, the nearest first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbours<'a, I> {
    /// The neighbours of each station in turn; [`Index::NONE`] fills unused entries. On a computer,
    /// the length of the move to it, in 1/256 steps, follows each neighbour.
    lists: &'a [I],
    /// The number of neighbours in the list of each station.
    per_station: usize,
}

/// A station to which a new move may lead.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate<I> {
    /// The station.
    pub station: I,
    /// The length of the move to it, in 1/256 steps; [`Candidate::UNKNOWN`] where it is not stored.
    pub length: u32,
}

impl<I: Index> Candidate<I> {
    /// The length of a move that is still to be computed. No move is so long.
    pub const UNKNOWN: u32 = u32::MAX;

    /// A station to which the length of a move is not stored.
    pub fn new(station: I) -> Self {
        Self { station, length: Self::UNKNOWN }
    }
}

/// The neighbours of one station that are still to come, the nearest first.
pub(super) struct Near<'a, I>(&'a [I]);

impl<I: Index> Iterator for Near<'_, I> {
    type Item = Candidate<I>;

    #[inline]
    fn next(&mut self) -> Option<Candidate<I>> {
        let (candidate, rest) = if I::HAS_ROOM {
            let (&[station, length], rest) = self.0.split_first_chunk()?;
            (Candidate { station, length: length.into() }, rest)
        } else {
            let (&station, rest) = self.0.split_first()?;
            (Candidate::new(station), rest)
        };
        self.0 = rest;
        (candidate.station != I::NONE).then_some(candidate)
    }
}

impl<'a, I: Index> Neighbours<'a, I> {
    /// Finds up to `per_station` neighbours of each station, a quarter of them in each quadrant. A
    /// crowd of stations on one side, such as the ends of a hatching, must not hide those on the
    /// other sides.
    #[inline(never)] // Inlined in its only caller, the code would be larger.
    pub fn new(
        network: Network<'_, I>,
        per_station: usize,
        scratch: &mut Scratch<'a>,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<Self, OrderError> {
        let entries = Self::entries(per_station);
        let lists: &mut [I] = scratch.take(network.stations().get() * entries)?;
        lists.fill(I::NONE);
        let mut lent = scratch.reborrow();
        let count = network.stations();
        let cells = Cells::new(network, count, &|station| station, &mut lent)?;
        let grid = Grid { network, cells };
        // `per_station` is 8 or 4, and `entries` is as much or twice as much.
        for (station, list) in I::all().zip(lists.chunks_exact_mut(entries)) {
            grid.search(station, &mut list[..per_station], work_budget)?;
            if I::HAS_ROOM {
                // From the last neighbour on, so that none is overwritten before it is moved.
                for at in (0..per_station).rev() {
                    let other = list[at];
                    let length =
                        if other == I::NONE { 0 } else { network.distance(station, other) };
                    list[2 * at] = other;
                    list[2 * at + 1] = I::new(length as usize);
                }
            }
        }
        Ok(Self { lists, per_station })
    }

    /// Writes to `lists` what the lists of these stations hold of each other. `number` has for each
    /// station its number in the result, or [`Index::NONE`].
    #[cfg(feature = "threads")]
    pub fn part<'p>(
        &self,
        stations: &[I],
        number: &[I],
        lists: &'p mut std::vec::Vec<I>,
    ) -> Neighbours<'p, I> {
        let entries = Self::entries(self.per_station);
        for (count, &station) in (1..).zip(stations) {
            for Candidate { station, length } in self.of(station) {
                let number = number[station.get()];
                if number != I::NONE {
                    lists.push(number);
                    lists.extend(I::HAS_ROOM.then(|| I::new(length as usize)));
                }
            }
            lists.resize(count * entries, I::NONE);
        }
        Neighbours { lists, per_station: self.per_station }
    }

    /// Returns the number of entries of the list of each station.
    const fn entries(per_station: usize) -> usize {
        if I::HAS_ROOM { 2 * per_station } else { per_station }
    }

    /// Returns the scratch memory that the result occupies for this many stations, in bytes.
    pub const fn bytes(stations: usize, per_station: usize) -> usize {
        Scratch::bytes_for::<I>(stations * Self::entries(per_station))
    }

    /// Returns the further scratch memory that the search needs for this many stations, in bytes.
    pub const fn bytes_to_find(stations: usize) -> usize {
        Cells::<I>::bytes(stations)
    }

    /// Returns the neighbours of `station`, the nearest first.
    #[inline]
    pub fn of(&self, station: I) -> Near<'a, I> {
        let entries = Self::entries(self.per_station);
        let begin = station.get() * entries;
        Near(self.lists.get(begin..begin + entries).unwrap_or(&[]))
    }
}

/// The stations, sorted into the cells of a grid.
struct Grid<'s, 'a, I> {
    /// The network whose stations are sorted; it knows where they lie.
    network: Network<'a, I>,
    /// The numbers of all stations.
    cells: Cells<'s, I>,
}

impl<I: Index> Grid<'_, '_, I> {
    /// Returns the stations of the cells from column `from` to column `to` of a row.
    fn stretch(&self, row: i32, from: i32, to: i32) -> &[I] {
        let Cells { columns, rows, begin, .. } = self.cells;
        let (from, to) = (from.max(0), to.min(columns - 1));
        if row < 0 || row >= rows || from > to {
            return &[];
        }
        // The cell is in the grid, so it has an entry in `begin`, and so has the end of the last
        // cell. The entries ascend, and the last is the number of points.
        let begin = |column| begin[(row * columns + column) as usize].get();
        &self.cells.points[begin(from)..begin(to + 1)]
    }

    /// Fills `near` with the nearest stations around `station`, the same number from each quadrant,
    /// the nearest first.
    fn search(
        &self,
        station: I,
        near: &mut [I],
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let position = self.network.position(station);
        let (column, row) = self.cells.cell(position);
        let distance = |other: I| match other == I::NONE {
            true => u64::MAX,
            false => self.network.square(station, other),
        };
        // At least 1. Below, `quadrant` is at most 3, so four quadrants have their place in `near`.
        let per_quadrant = near.len() / 4;
        let mut enough = None;
        for ring in 0..self.cells.columns.max(self.cells.rows) {
            // All stations in this ring or beyond are at least `reach` away. Where a quadrant has
            // too few stations, the search ends at twice the ring at which two quadrants were full.
            let reach = ((ring - 1).max(0) as u64) << self.cells.cell_bits;
            let last = near.chunks_exact(per_quadrant).filter_map(|quadrant| quadrant.last());
            if last.clone().filter(|&&last| last != I::NONE).count() >= 2 && enough.is_none() {
                enough = Some(2 * ring);
            }
            let done = |&last: &I| match last == I::NONE {
                true => enough.is_some_and(|enough| ring > enough),
                false => distance(last) <= reach * reach,
            };
            if last.clone().all(done) {
                break;
            }
            for line in row - ring..=row + ring {
                let edge = line == row - ring || line == row + ring;
                let sides = if edge {
                    [self.stretch(line, column - ring, column + ring), &[]]
                } else {
                    [column - ring, column + ring].map_each(|side| self.stretch(line, side, side))
                };
                for &other in sides.into_iter().flatten().filter(|&&other| other != station) {
                    work_budget.work(1)?;
                    let there = self.network.position(other);
                    let quadrant =
                        2 * usize::from(there.y < position.y) + usize::from(there.x < position.x);
                    let begin = quadrant * per_quadrant;
                    insert(&mut near[begin..begin + per_quadrant], other, distance);
                }
            }
        }
        for index in 1..near.len() {
            let other = core::mem::replace(&mut near[index], I::NONE);
            insert(&mut near[..=index], other, distance);
        }
        Ok(())
    }
}

/// Inserts `station` into a list sorted by distance; the last station of the list is dropped.
fn insert<I: Index>(list: &mut [I], station: I, distance: impl Fn(I) -> u64) {
    let Some((last, _)) = list.split_last_mut() else {
        return;
    };
    let own = (distance(station), station);
    if own >= (distance(*last), *last) {
        return;
    }
    *last = station;
    for index in (1..list.len()).rev() {
        // Both `index` and the one before it are indices of the list.
        if (distance(list[index - 1]), list[index - 1]) <= own {
            break;
        }
        list.swap(index - 1, index);
    }
}
