//! Sorts points into the square cells of a grid, so that those near a place are found without
//! looking at all of them.

use super::network::Network;
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

/// The cells of a grid, and the points in each.
pub(super) struct Cells<'s, I> {
    /// The lower left corner of the grid, from which cells are counted.
    corner: PagePoint,
    /// The size of a cell: a square of 2^`cell_bits` steps.
    pub cell_bits: u32,
    /// The number of cells of the grid from left to right.
    pub columns: i32,
    /// The number of cells of the grid from bottom to top.
    pub rows: i32,
    /// For each cell, where its points begin in `points`; then the end of the last cell.
    pub begin: &'s [I],
    /// The numbers of all points, cell after cell. Those of one cell are in ascending order.
    pub points: &'s mut [I],
}

impl<'s, I: Index> Cells<'s, I> {
    /// Sorts the points `0..count` into at most half as many cells. `station` returns the station
    /// at which a point lies.
    ///
    /// # Errors
    /// [`OutOfScratch`] if there are fewer than [`Cells::bytes`].
    pub fn new(
        network: Network<'_, I>,
        count: I,
        station: &dyn Fn(I) -> I,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let position = |point| network.position(station(point));
        let positions = || I::below(count).map(position);
        let least = |of: fn(PagePoint) -> i32| positions().map(of).min().unwrap_or(0);
        let most = |of: fn(PagePoint) -> i32| positions().map(of).max().unwrap_or(0);
        let corner = PagePoint { x: least(|position| position.x), y: least(|position| position.y) };
        let (width, height) =
            (most(|position| position.x) - corner.x, most(|position| position.y) - corner.y);
        let mut cell_bits = 0;
        let cells = |bits: u32| ((width >> bits) + 1).saturating_mul((height >> bits) + 1);
        while cells(cell_bits) as usize > Self::most_cells(count.get()) {
            cell_bits += 1;
        }
        let begin: &mut [I] = scratch.take(cells(cell_bits) as usize + 1)?;
        let points: &mut [I] = scratch.take(count.get())?;
        let mut sorted = Self {
            corner,
            cell_bits,
            columns: (width >> cell_bits) + 1,
            rows: (height >> cell_bits) + 1,
            begin: &[],
            points: &mut [],
        };
        let cell_of = |point| {
            let (column, row) = sorted.cell(position(point));
            (row * sorted.columns + column) as usize
        };
        for point in I::below(count) {
            if let Some(begin) = begin.get_mut(cell_of(point)) {
                *begin += I::ONE;
            }
        }
        let mut sum = I::ZERO;
        for begin in begin.iter_mut() {
            sum += *begin;
            *begin = sum;
        }
        // The cells are filled from the back, so that the end of each cell is counted down to its
        // begin.
        for point in I::below(count).rev() {
            let Some(begin) = begin.get_mut(cell_of(point)) else {
                continue;
            };
            *begin -= I::ONE;
            if let Some(slot) = points.get_mut(begin.get()) {
                *slot = point;
            }
        }
        (sorted.begin, sorted.points) = (begin, points);
        Ok(sorted)
    }

    /// Returns the greatest number of cells for this many points.
    pub const fn most_cells(count: usize) -> usize {
        if count < 2 { 1 } else { count / 2 }
    }

    /// Returns the most scratch memory that this many points need, in bytes.
    pub const fn bytes(count: usize) -> usize {
        Scratch::bytes_for::<I>(Self::most_cells(count) + 1) + Scratch::bytes_for::<I>(count)
    }

    /// Returns the column and the row of the cell that contains a point.
    pub fn cell(&self, position: PagePoint) -> (i32, i32) {
        let along = |at: i32, corner: i32| (at - corner) >> self.cell_bits;
        (along(position.x, self.corner.x), along(position.y, self.corner.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::Scratch;

    #[test]
    fn the_bytes_hold_the_most_cells_and_all_points() {
        for count in [1, 2, 3, 7, 64, 1001] {
            let bytes = Cells::<u16>::bytes(count);
            let mut words = [0; 512];
            let mut scratch = Scratch::new(&mut words[..bytes.div_ceil(8)]);
            scratch.take::<u16>(Cells::<u16>::most_cells(count) + 1).unwrap();
            assert_eq!(scratch.take::<u16>(count).unwrap().len(), count);
            // Hardly anything is left.
            assert!(scratch.take::<u64>(2).is_err(), "{count}");
        }
    }
}
