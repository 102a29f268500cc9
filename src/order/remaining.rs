//! Finds what is near a place among points that become fewer and fewer, such as the odd points that
//! have no partner yet.
//!
//! The points are sorted into the cells of a grid. A search visits square rings of cells around the
//! place until nothing nearer can follow, and removes on its way the points that no longer count.

use super::network::Network;
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

/// The points that are left, in the cells of a grid.
pub(super) struct Remaining<'s, I> {
    /// The lower left corner of the grid.
    corner: PagePoint,
    /// Cells are squares of 2^`cell_bits` steps.
    cell_bits: u32,
    /// The number of columns of the grid.
    columns: i32,
    /// The number of rows of the grid.
    rows: i32,
    /// For each cell, where its points begin in `points`.
    begin: &'s mut [I],
    /// For each cell, where those of its points end that are left.
    end: &'s mut [I],
    /// The numbers of the points, cell by cell.
    points: &'s mut [I],
}

impl<'s, I: Index> Remaining<'s, I> {
    /// Sorts the points `0..count` into cells. `station` returns the station of a point.
    ///
    /// # Errors
    /// [`OutOfScratch`] if [`Remaining::bytes`] are more than there are.
    pub fn new(
        network: Network<'_, I>,
        count: I,
        station: impl Fn(I) -> I,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let position = |point| network.position(station(point));
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for point in I::below(count) {
            let PagePoint { x, y } = position(point);
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let size = [0, 1].map(|axis| high[axis].saturating_sub(low[axis]).max(0));
        let mut cell_bits = 0;
        let cells = |bits: u32| ((size[0] >> bits) + 1).saturating_mul((size[1] >> bits) + 1);
        while cells(cell_bits) as usize > Self::cells(count.get()) {
            cell_bits += 1;
        }
        let all = cells(cell_bits) as usize;
        let (begin, end, points) =
            (scratch.take(all)?, scratch.take(all)?, scratch.take(count.get())?);
        let remaining = Self {
            corner: PagePoint { x: low[0], y: low[1] },
            cell_bits,
            columns: (size[0] >> cell_bits) + 1,
            rows: (size[1] >> cell_bits) + 1,
            begin,
            end,
            points,
        };
        let cell_of = |remaining: &Self, point| {
            let [column, row] = remaining.cell(position(point));
            (row * remaining.columns + column) as usize
        };
        for point in I::below(count) {
            let cell = cell_of(&remaining, point);
            remaining.end[cell] += I::ONE;
        }
        let mut sum = I::ZERO;
        for (begin, end) in remaining.begin.iter_mut().zip(remaining.end.iter_mut()) {
            *begin = sum;
            sum += *end;
            *end = *begin;
        }
        for point in I::below(count) {
            let cell = cell_of(&remaining, point);
            remaining.points[remaining.end[cell].get()] = point;
            remaining.end[cell] += I::ONE;
        }
        Ok(remaining)
    }

    /// Returns the most cells for so many points.
    const fn cells(count: usize) -> usize {
        if count < 2 { 1 } else { count / 2 }
    }

    /// Returns the scratch memory that so many points need, in bytes.
    pub const fn bytes(count: usize) -> usize {
        2 * Scratch::bytes_for::<I>(Self::cells(count)) + Scratch::bytes_for::<I>(count)
    }

    /// Returns the column and the row of the cell that contains a position.
    fn cell(&self, position: PagePoint) -> [i32; 2] {
        [position.x - self.corner.x, position.y - self.corner.y].map(|at| at >> self.cell_bits)
    }

    /// Calls `look` with the points around a place, which is within the grid, from near cells to far
    /// ones. `look` returns the distance beyond which points do not matter, in 1/256 steps, or
    /// `None` if the point is to be removed.
    pub fn search(&mut self, around: PagePoint, look: &mut dyn FnMut(I) -> Option<u32>) {
        let [column, row] = self.cell(around);
        let mut limit = u32::MAX;
        for ring in 0..self.columns.max(self.rows) {
            // All points in this ring or beyond are at least so far away.
            let least = u64::from((ring - 1).max(0).cast_unsigned()) << (self.cell_bits + 8);
            if u64::from(limit) < least {
                break;
            }
            let rows = (row - ring).max(0)..=(row + ring).min(self.rows - 1);
            for line in rows {
                let is_edge = line == row - ring || line == row + ring;
                let step = if is_edge || ring == 0 { 1 } else { 2 * ring };
                let mut at = column - ring;
                while at <= column + ring {
                    if (0..self.columns).contains(&at) {
                        self.look_into((line * self.columns + at) as usize, &mut limit, look);
                    }
                    at += step;
                }
            }
        }
    }

    /// Calls `look` with the points of one cell.
    fn look_into(&mut self, cell: usize, limit: &mut u32, look: &mut dyn FnMut(I) -> Option<u32>) {
        let mut at = self.begin[cell];
        while at < self.end[cell] {
            match look(self.points[at.get()]) {
                Some(farthest) => {
                    *limit = farthest;
                    at += I::ONE;
                }
                None => {
                    self.end[cell] -= I::ONE;
                    self.points[at.get()] = self.points[self.end[cell].get()];
                }
            }
        }
    }
}
