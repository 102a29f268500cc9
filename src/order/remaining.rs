//! Finds what is near a place among points that become fewer and fewer, such as the odd points that
//! have no partner yet.
//!
//! A search visits square rings of cells around the place until nothing nearer can follow, and
//! removes on its way the points that no longer count.

use super::cells::Cells;
use super::network::Network;
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

/// The points that are left, in the cells of a grid.
pub(super) struct Remaining<'s, I> {
    /// All points, cell after cell. Those of a cell that were removed come last.
    cells: Cells<'s, I>,
    /// For each cell, where those of its points end that are left.
    end: &'s mut [I],
}

impl<'s, I: Index> Remaining<'s, I> {
    /// Begins with the points `0..count`. `station` returns the station at which a point lies.
    ///
    /// # Errors
    /// [`OutOfScratch`] if there are fewer than [`Remaining::bytes`].
    pub fn new(
        network: Network<'_, I>,
        count: I,
        station: &dyn Fn(I) -> I,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let cells = Cells::new(network, count, station, scratch)?;
        let ends = cells.begin.get(1..).unwrap_or(&[]);
        let end: &mut [I] = scratch.take(ends.len())?;
        end.copy_from_slice(ends); // as long as what was taken
        Ok(Self { cells, end })
    }

    /// Returns the most scratch memory that this many points need, in bytes.
    pub const fn bytes(count: usize) -> usize {
        Cells::<I>::bytes(count) + Scratch::bytes_for::<I>(Cells::<I>::most_cells(count))
    }

    /// Calls `look` with the points around a place, which is within the grid, from near cells to
    /// far ones. `look` returns the distance beyond which points do not matter, in 1/256 steps, or
    /// `None` if the point is to be removed.
    pub fn search(&mut self, around: PagePoint, look: &mut dyn FnMut(I) -> Option<u32>) {
        let Cells { columns, rows, cell_bits, .. } = self.cells;
        let (column, row) = self.cells.cell(around);
        let mut limit = u32::MAX;
        for ring in 0..columns.max(rows) {
            // All points in this ring or beyond are at least so far away.
            let least = u64::from((ring - 1).max(0).cast_unsigned()) << (cell_bits + 8);
            if u64::from(limit) < least {
                break;
            }
            for line in (row - ring).max(0)..=(row + ring).min(rows - 1) {
                let is_edge = line == row - ring || line == row + ring;
                let step = if is_edge || ring == 0 { 1 } else { 2 * ring };
                let mut at = column - ring;
                while at <= column + ring {
                    if (0..columns).contains(&at) {
                        self.look_into((line * columns + at) as usize, &mut limit, look);
                    }
                    at += step;
                }
            }
        }
    }

    /// Calls `look` with the points of one cell that are left.
    fn look_into(&mut self, cell: usize, limit: &mut u32, look: &mut dyn FnMut(I) -> Option<u32>) {
        let (Some(begin), Some(end)) = (self.cells.begin.get(cell), self.end.get_mut(cell)) else {
            return;
        };
        let mut points = self.cells.points.get_mut(begin.get()..end.get()).unwrap_or_default();
        let mut at = 0;
        while let Some(&point) = points.get(at) {
            match look(point) {
                Some(farthest) => {
                    *limit = farthest;
                    at += 1;
                }
                None => {
                    // The last point takes its place.
                    let Some((last, rest)) = core::mem::take(&mut points).split_last_mut() else {
                        return;
                    };
                    if let Some(place) = rest.get_mut(at) {
                        *place = *last;
                    }
                    points = rest;
                    *end -= I::ONE;
                }
            }
        }
    }
}
