//! The nearest stations of each station.
//!
//! A grid of cells about as many as half the stations is filled once; each search goes around the
//! cell in square rings until nothing nearer can come.

use super::network::Network;
use super::pace::Pace;
use super::{NONE, OrderError};
use crate::drawing::PagePoint;
use crate::stage::{OutOfScratch, Scratch};

/// For each station the same number of others, the nearest first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near<'a> {
    stations: &'a [u16],
    per_station: usize,
}

impl<'a> Near<'a> {
    /// Finds up to `per_station` neighbours of each station, half of them at most in its own part:
    /// the points of a fine curve must not hide what is beside it.
    pub fn new(
        network: Network<'_>,
        per_station: usize,
        scratch: &mut Scratch<'a>,
        pace: &mut Pace<'_>,
    ) -> Result<Self, OrderError> {
        let stations = scratch.take(usize::from(network.stations()) * per_station)?;
        stations.fill(NONE);
        let mut lent = scratch.reborrow();
        let part = network.parts(&mut lent)?;
        let grid = Grid::new(network, &mut lent)?;
        for (station, near) in (0..).zip(stations.chunks_exact_mut(per_station)) {
            grid.search(station, part, near, pace)?;
        }
        Ok(Self { stations, per_station })
    }

    /// Bytes of scratch that stay taken for so many stations.
    pub const fn bytes(stations: usize, per_station: usize) -> usize {
        Scratch::bytes_for::<u16>(stations * per_station)
    }

    /// The neighbours of `station`, the nearest first.
    pub fn of(&self, station: u16) -> impl Iterator<Item = u16> + use<'a> {
        let begin = usize::from(station) * self.per_station;
        let near = self.stations.get(begin..begin + self.per_station).unwrap_or(&[]);
        near.iter().copied().take_while(|&station| station != NONE)
    }
}

struct Grid<'s, 'a> {
    network: Network<'a>,
    corner: PagePoint,
    /// Cells are squares of 2^`cell_bits` steps.
    cell_bits: u32,
    columns: i32,
    rows: i32,
    /// Where the stations of each cell begin, and where the last one's end.
    begin: &'s [u16],
    stations: &'s [u16],
}

impl<'s, 'a> Grid<'s, 'a> {
    fn new(network: Network<'a>, scratch: &mut Scratch<'s>) -> Result<Self, OutOfScratch> {
        let count = network.stations();
        let places = || (0..count).map(|station| network.place(station));
        let least = |of: fn(PagePoint) -> i32| places().map(of).min().unwrap_or(0);
        let most = |of: fn(PagePoint) -> i32| places().map(of).max().unwrap_or(0);
        let corner = PagePoint { x: least(|place| place.x), y: least(|place| place.y) };
        let (width, height) = (most(|place| place.x) - corner.x, most(|place| place.y) - corner.y);
        let mut cell_bits = 0;
        let cells = |bits: u32| ((width >> bits) + 1).saturating_mul((height >> bits) + 1);
        while cells(cell_bits) > i32::from(count / 2).max(1) {
            cell_bits += 1;
        }
        let mut grid = Self {
            network,
            corner,
            cell_bits,
            columns: (width >> cell_bits) + 1,
            rows: (height >> cell_bits) + 1,
            begin: &[],
            stations: &[],
        };
        let begin: &mut [u16] = scratch.take(cells(cell_bits) as usize + 1)?;
        let stations: &mut [u16] = scratch.take(usize::from(count))?;
        let cell_of = |station| {
            let (column, row) = grid.cell(network.place(station));
            (row * grid.columns + column) as usize
        };
        for station in 0..count {
            begin[cell_of(station)] += 1;
        }
        let mut sum = 0;
        for begin in begin.iter_mut() {
            sum += *begin;
            *begin = sum;
        }
        // Filled from behind, each cell's end comes down to its begin.
        for station in (0..count).rev() {
            let begin = &mut begin[cell_of(station)];
            *begin -= 1;
            stations[usize::from(*begin)] = station;
        }
        (grid.begin, grid.stations) = (begin, stations);
        Ok(grid)
    }

    fn cell(&self, place: PagePoint) -> (i32, i32) {
        let along = |at: i32, corner: i32| (at - corner) >> self.cell_bits;
        (along(place.x, self.corner.x), along(place.y, self.corner.y))
    }

    /// The stations of the cells from `from` to `to` of a row.
    fn stretch(&self, row: i32, from: i32, to: i32) -> &'s [u16] {
        let (from, to) = (from.max(0), to.min(self.columns - 1));
        if row < 0 || row >= self.rows || from > to {
            return &[];
        }
        let begin = |column| usize::from(self.begin[(row * self.columns + column) as usize]);
        &self.stations[begin(from)..begin(to + 1)]
    }

    /// Fills `near` with the nearest stations of `station`, half of them at most of its own part.
    fn search(
        &self,
        station: u16,
        part: &[u16],
        near: &mut [u16],
        pace: &mut Pace<'_>,
    ) -> Result<(), OrderError> {
        let (column, row) = self.cell(self.network.place(station));
        let own = part[usize::from(station)];
        let own_most = near.len().div_ceil(2);
        let (mut found, mut own_found) = (0, 0);
        for ring in 0..self.columns.max(self.rows) {
            // Whatever is in this ring or beyond is farther than the cells within are wide.
            let reach = ((ring - 1).max(0) as u64) << (self.cell_bits + 8);
            let full = found == near.len();
            if full && u64::from(self.network.distance(station, near[found - 1])) <= reach {
                break;
            }
            for line in row - ring..=row + ring {
                let edge = line == row - ring || line == row + ring;
                let sides = if edge {
                    [self.stretch(line, column - ring, column + ring), &[]]
                } else {
                    [column - ring, column + ring].map(|side| self.stretch(line, side, side))
                };
                pace.work(0)?;
                for &other in sides.into_iter().flatten() {
                    if other == station {
                        continue;
                    }
                    pace.work(2)?;
                    let is_own = |other: u16| part[usize::from(other)] == own;
                    let distance = self.network.distance(station, other);
                    let nearer = |other: u16| {
                        (self.network.distance(station, other), other) < (distance, NONE)
                    };
                    // Who gives way: the last of its own kind if that is full, else the last.
                    let leaves = if is_own(other) && own_found == own_most {
                        near[..found].iter().rposition(|&other| is_own(other)).unwrap_or(0)
                    } else if found < near.len() {
                        found
                    } else {
                        found - 1
                    };
                    if leaves < found && nearer(near[leaves]) {
                        continue;
                    }
                    if leaves < found {
                        own_found -= usize::from(is_own(near[leaves]));
                    } else {
                        found += 1;
                    }
                    own_found += usize::from(is_own(other));
                    let mut place = leaves;
                    while place > 0 && !nearer(near[place - 1]) {
                        near[place] = near[place - 1];
                        place -= 1;
                    }
                    near[place] = other;
                }
            }
        }
        Ok(())
    }
}
