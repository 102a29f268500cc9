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
    /// The neighbours of each station in turn; [`Index::NONE`] fills unused entries.
    stations: &'a [I],
    /// The number of entries in `stations` for each station.
    per_station: usize,
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
        let stations = scratch.take(network.stations().get() * per_station)?;
        stations.fill(I::NONE);
        let mut lent = scratch.reborrow();
        let count = network.stations();
        let cells = Cells::new(network, count, &|station| station, &mut lent)?;
        let grid = Grid { network, cells };
        for (station, near) in I::all().zip(stations.chunks_exact_mut(per_station)) {
            grid.search(station, near, work_budget)?;
        }
        Ok(Self { stations, per_station })
    }

    /// Returns the scratch memory that the result occupies for this many stations, in bytes.
    pub const fn bytes(stations: usize, per_station: usize) -> usize {
        Scratch::bytes_for::<I>(stations * per_station)
    }

    /// Returns the further scratch memory that the search needs for this many stations, in bytes.
    pub const fn bytes_to_find(stations: usize) -> usize {
        Cells::<I>::bytes(stations)
    }

    /// Returns the neighbours of `station`, the nearest first.
    pub fn of(&self, station: I) -> impl Iterator<Item = I> + use<'a, I> {
        let begin = station.get() * self.per_station;
        let near = self.stations.get(begin..begin + self.per_station).unwrap_or(&[]);
        near.iter().copied().take_while(|&station| station != I::NONE)
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
        if (distance(list[index - 1]), list[index - 1]) <= own {
            break;
        }
        list.swap(index - 1, index);
    }
}
