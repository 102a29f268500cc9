//! The page in cells, each with the faces that lie on it, nearest first (Griffith, Brown III).
//!
//! A cell that one face covers wholly needs no face that lies behind that one: whatever such a face
//! hides there is hidden already. An edge that lies behind the covering face of every cell on its
//! way is hidden without another look.

use super::VisibilityError;
use super::coarse_projection::{CoarsePoint, CoarseProjection};
use super::edges::Outlines;
use super::faces::Faces;
use super::raster::{Bounds, Raster, Shape};
use super::yield_counter::YieldCounter;
use crate::geometry::COORDINATE_LIMIT;
use crate::stage::Scratch;
use bytemuck::{Pod, Zeroable};

/// One cell of the page.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Cell {
    /// Where its faces end in the list of entries; they begin where those of the cell before end.
    pub end: u16,
    /// Nothing at this depth or farther is seen in this cell.
    pub cover_depth: u16,
    /// The face that covers it at that depth, by rank.
    pub cover: u16,
}

/// A depth on a scale of 2^15, rounded down. Monotonic, so that a greater one is surely farther.
pub fn coarse_depth(z: i32) -> u16 {
    ((z + COORDINATE_LIMIT) >> 5) as u16
}

/// The cells and their lists.
#[derive(Debug)]
pub struct Grid<'a> {
    shape: Shape,
    columns: usize,
    cells: &'a mut [Cell],
    entries: &'a mut [u16],
}

/// What an edge meets in one cell.
pub struct CellView<'g> {
    /// The covering face, if it is nearer than the whole edge.
    pub cover: Option<u16>,
    /// The faces, nearest first.
    pub faces: &'g [u16],
}

/// More cells cost memory and time to fill, fewer make longer lists.
const CELLS_FOR_EACH_FACE: usize = 2;

impl<'a> Grid<'a> {
    /// Bytes for the coarsest grid.
    pub const fn least_bytes(faces: usize) -> usize {
        Scratch::bytes_for::<Cell>(1) + Scratch::bytes_for::<u16>(faces)
    }

    /// Sorts the faces into the finest grid that fits what is left of `scratch`, not finer than is useful.
    pub fn new(
        coarse_projection: &CoarseProjection<'_>,
        outlines: Outlines<'_>,
        faces: &Faces<'_>,
        mut scratch: Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let wanted_cells = (faces.len() * CELLS_FOR_EACH_FACE).min(usize::from(u16::MAX));
        let mut shape = Shape::finest(coarse_projection);
        while shape.cells() > 1 {
            let fits = |entries: usize| {
                let bytes =
                    Scratch::bytes_for::<Cell>(shape.cells()) + Scratch::bytes_for::<u16>(entries);
                entries <= usize::from(u16::MAX) && bytes <= scratch.available_bytes()
            };
            if shape.cells() <= wanted_cells
                && fits(faces.len())
                && fits(shape.most_entries(coarse_projection, outlines, faces, yield_counter)?)
            {
                break;
            }
            shape.coarsen();
        }
        let mut raster = Raster::new(shape, scratch.take(shape.cells())?);
        let entry_count = raster.count(coarse_projection, outlines, faces, yield_counter)?;
        let entries: &mut [u16] = scratch.take(entry_count)?;
        raster.fill(coarse_projection, outlines, faces, entries, yield_counter)?;
        Ok(Self { shape, columns: shape.columns(), cells: raster.cells(), entries })
    }

    fn view(&self, cell: usize, near: u16) -> CellView<'_> {
        let begin = cell.checked_sub(1).map_or(0, |before| self.cells[before].end);
        let Cell { end, cover_depth, cover } = self.cells[cell];
        CellView {
            cover: (cover_depth < near).then_some(cover),
            faces: &self.entries[usize::from(begin)..usize::from(end)],
        }
    }

    /// Visits the faces of every cell within a rectangle.
    pub fn within(&self, bounds: &Bounds, mut visit: impl FnMut(&[u16])) {
        let [column0, column1, row0, row1] = self.shape.span(bounds).map(usize::from);
        for row in row0..=row1 {
            for column in column0..=column1 {
                visit(self.view(row * self.columns + column, 0).faces);
            }
        }
    }

    /// The way of an edge from `p` to `q` that is nowhere nearer than the coarse depth `near`.
    pub fn way(&self, p: CoarsePoint, q: CoarsePoint, near: u16) -> Way<'_> {
        let (low, high) = if p.y <= q.y { (p, q) } else { (q, p) };
        let dx = i32::from(high.x) - i32::from(low.x);
        let dy = i32::from(high.y) - i32::from(low.y);
        Way { grid: self, near, low, high, slope: if dy > 0 { (dx << 16) / dy } else { 0 } }
    }
}

/// The cells that an edge passes or touches.
#[derive(Debug, Clone, Copy)]
pub struct Way<'g> {
    grid: &'g Grid<'g>,
    near: u16,
    low: CoarsePoint,
    high: CoarsePoint,
    /// Steps to the right for each step up, in units of 2^-16.
    slope: i32,
}

impl<'g> Way<'g> {
    /// Visits each cell until the visitor says no; returns whether it never did.
    ///
    /// The edge lies less than one unit right and up of the line between the places.
    pub fn visit(&self, mut visit: impl FnMut(CellView<'g>) -> bool) -> bool {
        let Shape { shift_x, shift_y, .. } = self.grid.shape;
        let (low_x, low_y) = (i32::from(self.low.x), i32::from(self.low.y));
        let dy = i32::from(self.high.y) - low_y;
        let left = i32::from(self.low.x.min(self.high.x));
        let right = i32::from(self.low.x.max(self.high.x));
        for row in self.low.y >> shift_y..=self.high.y >> shift_y {
            let (mut from, mut to) = (left, right);
            if dy > 0 {
                // Rounded towards the lower end; below 2^30, as the slope is at most 2^30 / dy.
                let x_at = |y: i32| low_x + ((self.slope * (y - low_y).clamp(0, dy)) >> 16);
                let x_below = x_at((i32::from(row) << shift_y) - 1);
                let x_above = x_at((i32::from(row) + 1) << shift_y);
                from = from.max(x_below.min(x_above) - 2);
                to = to.min(x_below.max(x_above) + 3);
            }
            let first = usize::from(row) * self.grid.columns;
            for column in (from >> shift_x)..=(to >> shift_x) {
                if !visit(self.grid.view(first + column as usize, self.near)) {
                    return false;
                }
            }
        }
        true
    }
}
