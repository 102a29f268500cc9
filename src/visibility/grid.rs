//! Divides the page into cells, each with a list of the faces that lie on it, nearest first
//! (Griffith, Brown III). An edge is then tested only against the faces in the cells that it
//! passes.
//!
//! A cell that one face covers entirely does not list the faces that lie behind it: whatever they
//! hide there is hidden already. An edge that lies behind the covering face of every cell on its
//! path is hidden without a further test.

use super::coarse_projection::CoarsePoint;
use super::raster::{Bounds, Raster, Shape};
use super::scene_index::SceneIndex;
use super::yield_counter::YieldCounter;
use super::{Cores, VisibilityError};
use crate::array::MapEach;
use crate::geometry::COORDINATE_LIMIT;
use crate::index::Index;
use crate::stage::Scratch;
use bytemuck::{Pod, Zeroable};
#[cfg(feature = "threads")]
use rayon::iter::{IntoParallelIterator, ParallelIterator};
#[cfg(feature = "threads")]
use std::vec::Vec;

/// One cell of the page: where the list of its faces ends, which begins where that of the previous
/// cell ends, and its covering face.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct Cell<I>([I; 3]);

impl<I: Index> Cell<I> {
    /// Makes a cell without a covering face, whose list ends at index `end`.
    pub fn uncovered(end: I) -> Self {
        Self([end, I::new(NO_COVER.into()), I::ZERO])
    }

    /// Returns the index at which the list of its faces ends.
    #[inline]
    pub fn end(&self) -> I {
        self.0[0]
    }

    /// Empties the list, which then begins and ends at index `begin`.
    #[inline]
    pub fn begin_at(&mut self, begin: I) {
        self.0[0] = begin;
    }

    /// Moves the end of the list by one.
    #[inline]
    pub fn lengthen(&mut self) {
        self.0[0] += I::ONE;
    }

    /// Returns the coarse depth of the covering face. Nothing at this depth or farther is visible
    /// in this cell.
    #[inline]
    pub fn cover_depth(&self) -> u16 {
        self.0[1].get() as u16
    }

    /// Returns the rank of the covering face.
    #[inline]
    pub fn cover(&self) -> I {
        self.0[2]
    }

    /// Makes the face with this rank the covering face; `depth` is its coarse depth.
    #[inline]
    pub fn cover_with(&mut self, rank: I, depth: u16) {
        (self.0[1], self.0[2]) = (I::new(depth.into()), rank);
    }
}

/// A depth that no face has. It means that no face covers the cell.
const NO_COVER: u16 = u16::MAX;

/// Returns a depth on a scale of 2^15, rounded down. The map is monotonic: a greater result means a
/// greater depth.
pub fn coarse_depth(z: i32) -> u16 {
    ((z + COORDINATE_LIMIT) >> 5) as u16
}

/// The page divided into cells, each with a list of the faces on it.
#[derive(Debug)]
pub struct Grid<'a, I> {
    /// The division of the page into cells.
    shape: Shape,
    /// The number of cells in a row.
    columns: usize,
    /// For each cell, where its list ends in `entries`, and the face that covers all of it. The
    /// cells are stored row by row, from the lower left of the page.
    // The number of a cell is its row times `columns` plus its column. It is always an index of
    // `cells`, because no cell beyond that of `shape.far` is looked up: `far` has the greatest
    // coordinates of all vertices, so the bounds of a face do not exceed it, and `are_all`,
    // `cells_along` and `EdgeCells::visit` move what may lie outside the grid back to its border.
    cells: &'a mut [Cell<I>],
    /// The lists of all cells one after the other. An entry is the rank of a face.
    // The ends of the lists ascend, and the last is the number of entries: `Raster::count` puts at
    // each cell the sum of the lengths of the lists before, and `Raster::fill` adds the length of
    // its own. The sums fit `I`, since `new` divides the page only where `most_entries` is at most
    // `NONE`, and a single cell lists each face once.
    entries: &'a mut [I],
}

/// What a certain edge or face meets in one cell.
pub struct CellView<'g, I> {
    /// The rank of the face that covers the whole cell, if that face is nearer than all of it.
    pub cover: Option<I>,
    /// Whether that face or the sheet in the cell is nearer than all of it.
    pub hides: bool,
    /// Whether it is part of the sheet in the cell, if it is a face or a side of a face, and is in
    /// the cell: every face there that begins nearer than the sheet ends is part of it.
    pub shows: bool,
    /// The ranks of the faces on the cell, nearest first.
    pub faces: &'g [I],
}

/// The wanted number of cells for each face. More cells cost memory and time to fill; fewer make
/// the lists longer.
const CELLS_FOR_EACH_FACE: usize = 2;

/// How many faces there are for each wanted cell if sheets are looked for. It takes some time to
/// look for one, which larger cells save; smaller ones leave fewer edges to be tested.
const FACES_FOR_EACH_SHEET: usize = 2;

/// From this number of faces on, sheets are looked for. In a scene of fewer faces, most cells have
/// an outline in them and therefore no sheet.
const MANY_FACES: usize = 4096;

impl<'a, I: Index> Grid<'a, I> {
    /// Whether there may be scenes in which sheets are looked for: on a computer, and on a board
    /// that draws large models tile by tile. The scenes of other boards are small.
    const MAY_HAVE_SHEETS: bool = I::BITS > 16 || cfg!(feature = "tiles");

    /// Returns the bytes that the coarsest grid, a single cell, needs.
    pub const fn least_bytes(faces: usize) -> usize {
        Scratch::bytes_for::<Cell<I>>(1) + Scratch::bytes_for::<I>(faces)
    }

    /// Sorts the faces into the finest grid that fits into `scratch` and is still useful. The scene
    /// may be part of one with many more faces (`is_part`).
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    #[inline(never)] // Inlined in its only caller, the code would be larger.
    pub fn new(
        around: &SceneIndex<'_, I>,
        is_part: bool,
        cores: Cores,
        mut scratch: Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let SceneIndex { coarse_projection, outlines, faces, .. } = around;
        let outlines = *outlines;
        let with_sheets = Self::MAY_HAVE_SHEETS && (is_part || faces.len() >= MANY_FACES);
        let wanted_cells = if with_sheets {
            faces.len() / FACES_FOR_EACH_SHEET
        } else {
            faces.len() * CELLS_FOR_EACH_FACE
        };
        let wanted_cells = wanted_cells.min(I::NONE.get());
        let mut shape = Shape::finest(coarse_projection);
        while shape.cells() > 1 {
            let fits = |entries: usize| {
                let bytes =
                    Scratch::bytes_for::<Cell<I>>(shape.cells()) + Scratch::bytes_for::<I>(entries);
                entries <= I::NONE.get() && bytes <= scratch.available_bytes()
            };
            if shape.cells() <= wanted_cells
                && fits(faces.len())
                && fits(shape.most_entries(around, yield_counter)?)
            {
                break;
            }
            shape.coarsen();
        }
        let mut raster = Raster::new(shape, scratch.take(shape.cells())?);
        #[cfg(feature = "threads")]
        if SceneIndex::<I>::HAS_SHORTCUTS {
            // What the lists do not take serves for the notes.
            let most_entries = shape.most_entries(around, yield_counter)?;
            let (lists, mut notes) = scratch.split(Scratch::bytes_for::<I>(most_entries));
            scratch = lists;
            raster.note_in(notes.take_rest());
        }
        let entry_count = raster.count(coarse_projection, outlines, faces, yield_counter)?;
        let entries: &mut [I] = scratch.take(entry_count)?;
        raster.fill(coarse_projection, outlines, faces, entries, yield_counter)?;
        let mut grid = Self { shape, columns: shape.columns(), cells: raster.cells(), entries };
        if with_sheets {
            grid.find_sheets(around, cores, yield_counter)?;
        }
        Ok(grid)
    }

    /// Returns the number of cells that a sheet covers.
    #[cfg(test)]
    pub fn sheets(&self) -> usize {
        self.cells.iter().filter(|cell| cell.cover() == I::NONE).count()
    }

    /// Finds the cells that a sheet of faces covers where no single face does.
    fn find_sheets(
        &mut self,
        around: &SceneIndex<'_, I>,
        cores: Cores,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<(), VisibilityError> {
        match cores {
            Cores::One => {
                for cell in 0..self.cells.len() {
                    if let Some(depth) = self.sheet_depth(around, cell) {
                        self.cells[cell].cover_with(I::NONE, depth);
                    }
                    yield_counter.spend(500)?;
                }
            }
            #[cfg(feature = "threads")]
            Cores::All => {
                let depth = |cell| Some((cell, self.sheet_depth(around, cell)?));
                let found: Vec<_> =
                    (0..self.cells.len()).into_par_iter().filter_map(depth).collect();
                for (cell, depth) in found {
                    self.cells[cell].cover_with(I::NONE, depth);
                }
            }
        }
        Ok(())
    }

    /// Returns the coarse depth of the sheet in a cell that no single face covers, one unit behind
    /// its farthest point.
    fn sheet_depth(&self, around: &SceneIndex<'_, I>, cell: usize) -> Option<u16> {
        if self.cells[cell].cover_depth() != NO_COVER {
            return None;
        }
        // There is at least one column.
        let area = self.shape.area(cell % self.columns, cell / self.columns);
        let far = around.sheet(&area, self.view(cell, 0).faces)?;
        Some(coarse_depth(far + 1))
    }

    /// Returns what an edge or a face meets in a cell if no point of it is nearer than the coarse
    /// depth `near`.
    fn view(&self, cell: usize, near: u16) -> CellView<'_, I> {
        let begin = cell.checked_sub(1).map_or(I::ZERO, |before| self.cells[before].end());
        let cell = self.cells[cell];
        let hides = cell.cover_depth() < near;
        let is_sheet = cell.cover() == I::NONE;
        CellView {
            cover: (hides && !is_sheet).then_some(cell.cover()),
            hides,
            shows: is_sheet && near < cell.cover_depth(),
            faces: &self.entries[begin.get()..cell.end().get()],
        }
    }

    /// Calls `visit` with the faces of every cell that touches a rectangle.
    #[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
    pub fn within(&self, bounds: &Bounds, visit: &mut dyn FnMut(&[I])) {
        let [column0, column1, row0, row1] = self.shape.span(bounds).map_each(usize::from);
        for row in row0..=row1 {
            for column in column0..=column1 {
                visit(self.view(row * self.columns + column, 0).faces);
            }
        }
    }

    /// Whether each cell that touches a rectangle is as `is` asks, for a face that begins at the
    /// coarse depth `near`. The rectangle may reach beyond the grid.
    #[cfg(feature = "threads")]
    pub fn are_all(
        &self,
        bounds: &Bounds,
        near: u16,
        is: impl Fn(&CellView<'_, I>) -> bool,
    ) -> bool {
        let bounds = Bounds { low: bounds.low, high: bounds.high.low(self.shape.far) };
        let [column0, column1, row0, row1] = self.shape.span(&bounds).map_each(usize::from);
        let mut cells = (row0..=row1)
            .flat_map(|row| (column0..=column1).map(move |column| row * self.columns + column));
        cells.all(|cell| is(&self.view(cell, near)))
    }

    /// Returns the cells on the path of an edge from `p` to `q`, and those that are at most
    /// `margin` units of the coarse grid beside it. No point of the edge is nearer than the coarse
    /// depth `near`.
    pub fn cells_along(
        &self,
        p: CoarsePoint,
        q: CoarsePoint,
        near: u16,
        margin: i32,
    ) -> EdgeCells<'_, I> {
        // The rounded ends of a seam may lie beyond the last cell.
        let [p, q] = [p, q].map_each(|at| at.low(self.shape.far));
        let (low, high) = if p.y <= q.y { (p, q) } else { (q, p) };
        let dx = i32::from(high.x) - i32::from(low.x);
        let dy = i32::from(high.y) - i32::from(low.y);
        let slope = if dy > 0 { (dx << 16) / dy } else { 0 };
        EdgeCells { grid: self, near, margin, low, high, slope }
    }
}

/// The cells on the path of an edge: those that it crosses or touches.
#[derive(Debug, Clone, Copy)]
pub struct EdgeCells<'g, I> {
    /// The cells that the edge passes.
    grid: &'g Grid<'g, I>,
    /// The coarse depth of the nearest point of the edge.
    near: u16,
    /// How far beside the edge cells are visited, too, in units of the coarse grid.
    margin: i32,
    /// The lower end of the edge, which is not above `high`.
    low: CoarsePoint,
    /// The upper end of the edge.
    high: CoarsePoint,
    /// The steps to the right for each step up, in units of 2^-16.
    slope: i32,
}

impl<'g, I: Index> EdgeCells<'g, I> {
    /// Calls `visit` for each cell until it returns `false`. Returns whether it never did.
    ///
    /// The edge lies less than one unit to the right of the line between the coarse points, and
    /// less than one unit above it.
    #[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
    pub fn visit(&self, visit: &mut dyn FnMut(CellView<'g, I>) -> bool) -> bool {
        let Shape { shift_x, shift_y, far } = self.grid.shape;
        let margin = self.margin;
        let (low_x, low_y) = (i32::from(self.low.x), i32::from(self.low.y));
        let dy = i32::from(self.high.y) - low_y;
        let left = (i32::from(self.low.x.min(self.high.x)) - margin).max(0);
        let right = (i32::from(self.low.x.max(self.high.x)) + margin).min(far.x.into());
        let top = (low_y + dy + margin).min(far.y.into());
        for row in (low_y - margin).max(0) >> shift_y..=top >> shift_y {
            let (mut from, mut to) = (left, right);
            if dy > 0 {
                // The product is rounded down, towards the lower end. It is below 2^30, as the
                // slope is at most 2^30 / dy. As `dy` is above zero, the limits of `clamp` are in
                // order.
                let x_at = |y: i32| low_x + ((self.slope * (y - low_y).clamp(0, dy)) >> 16);
                let x_below = x_at((row << shift_y) - 1 - margin);
                let x_above = x_at(((row + 1) << shift_y) + margin);
                from = from.max(x_below.min(x_above) - 2 - margin);
                to = to.min(x_below.max(x_above) + 3 + margin);
            }
            let first = row as usize * self.grid.columns;
            for column in (from >> shift_x)..=(to >> shift_x) {
                if !visit(self.grid.view(first + column as usize, self.near)) {
                    return false;
                }
            }
        }
        true
    }
}
