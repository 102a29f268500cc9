//! Sorts the faces into the cells of the page: finds which cells each face overlaps and which it
//! covers entirely.

use super::coarse_projection::{
    COARSE_BITS, CoarseLine, CoarsePoint, CoarseProjection, coarse_side,
};
use super::edges::Outlines;
use super::faces::Faces;
use super::grid::{Cell, coarse_depth};
use super::scene_index::SceneIndex;
use super::sheet::CellArea;
use super::yield_counter::YieldCounter;
use crate::array::MapEach;
use crate::index::Index;
use crate::model::Corner;
use crate::stage::Aborted;
use bytemuck::{Pod, Zeroable};

/// The division of the page into cells of equal size, which are blocks of the coarse grid.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// A cell is 2^`shift_x` units of the coarse grid wide.
    pub shift_x: u32,
    /// A cell is 2^`shift_y` units of the coarse grid high.
    pub shift_y: u32,
    /// The upper right corner of the page, in units of the coarse grid.
    pub far: CoarsePoint,
}

impl Shape {
    /// Returns the finest division: one cell for each point of the coarse grid.
    pub fn finest(coarse_projection: &CoarseProjection<'_>) -> Self {
        let far = coarse_projection
            .positions
            .iter()
            .fold(CoarsePoint::LOWEST, |far, &position| far.high(position));
        Self { shift_x: 0, shift_y: 0, far }
    }

    /// Halves the number of columns or of rows, whichever are more, by joining neighbouring cells.
    pub fn coarsen(&mut self) {
        if self.columns() > self.rows() {
            self.shift_x += 1;
        } else {
            self.shift_y += 1;
        }
    }

    /// Returns the number of columns of cells.
    pub fn columns(&self) -> usize {
        usize::from(self.far.x >> self.shift_x) + 1
    }

    /// Returns the number of rows of cells.
    fn rows(&self) -> usize {
        usize::from(self.far.y >> self.shift_y) + 1
    }

    /// Returns the number of cells on the whole page.
    pub fn cells(&self) -> usize {
        self.columns() * self.rows()
    }

    /// Returns the area of the cell in a column and a row.
    pub fn area(&self, column: usize, row: usize) -> CellArea {
        let corner = |column: usize, row: usize| CoarsePoint {
            x: (column << self.shift_x) as u16,
            y: (row << self.shift_y) as u16,
        };
        CellArea { low: corner(column, row), high: corner(column + 1, row + 1) }
    }

    /// Returns the first and the last column and the first and the last row that a face touches.
    pub fn span(&self, bounds: &Bounds) -> [u16; 4] {
        [
            bounds.low.x >> self.shift_x,
            bounds.high.x >> self.shift_x,
            bounds.low.y >> self.shift_y,
            bounds.high.y >> self.shift_y,
        ]
    }

    /// Returns an upper bound of the number of entries that the faces have in all cells together.
    pub fn most_entries<I: Index>(
        &self,
        around: &SceneIndex<'_, I>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<usize, Aborted> {
        let cells_of = |rank: usize| {
            let bounds = around.bounds_of(rank);
            let [column0, column1, row0, row1] = self.span(&bounds).map_each(usize::from);
            (column1 - column0 + 1) * (row1 - row0 + 1)
        };
        (0..around.faces.len()).try_fold(0, |sum, rank| {
            yield_counter.spend(200)?;
            Ok(sum + cells_of(rank))
        })
    }
}

/// The bounding rectangle of a face on the coarse grid.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// The lower left corner of the rectangle.
    pub low: CoarsePoint,
    /// The upper right corner of the rectangle.
    pub high: CoarsePoint,
}

impl Bounds {
    /// The rectangle around no point.
    pub const NOWHERE: Self = Self { low: CoarsePoint::HIGHEST, high: CoarsePoint::LOWEST };

    /// Whether both rectangles may have a point of the page in common.
    #[inline]
    pub fn may_meet(&self, other: &Self) -> bool {
        !self.high.is_before(other.low) && !other.high.is_before(self.low)
    }

    /// Returns the rectangle whose sides lie this far outside its own.
    #[cfg(feature = "threads")]
    pub fn grown(&self, by: u16) -> Self {
        let Self { low, high } = *self;
        Self {
            low: CoarsePoint { x: low.x.saturating_sub(by), y: low.y.saturating_sub(by) },
            high: CoarsePoint { x: high.x.saturating_add(by), y: high.y.saturating_add(by) },
        }
    }

    /// Returns the rectangle around the given corners.
    pub fn of<I: Index>(coarse_projection: &CoarseProjection<'_>, corners: &[Corner<I>]) -> Self {
        let mut bounds = Self::NOWHERE;
        for corner in corners {
            bounds.add(coarse_projection.position(corner.vertex()));
        }
        bounds
    }

    /// Extends the rectangle to a point.
    #[inline]
    pub fn add(&mut self, point: CoarsePoint) {
        *self = Self { low: self.low.low(point), high: self.high.high(point) };
    }
}

/// The most corners with which a face is compared with each cell by its exact shape. For a face
/// with more corners only the bounding rectangle is used.
const MOST_SIDES: usize = 8;

/// A side of a convex face on the page, as a linear function of the lower left corner of a cell.
/// The function is greater farther inside.
///
/// Each product of a side and a coordinate is below 2^28, and there are at most four of them.
#[derive(Clone, Copy, Default)]
struct HalfPlane {
    /// The increase of the function from one column to the next.
    right: i32,
    /// The increase of the function from one row to the next.
    up: i32,
    /// The value of the function at the lower left corner of the page.
    constant: i32,
    /// At this value or below, the whole cell lies outside.
    outside: i32,
    /// At this value or above, the whole cell lies inside.
    within: i32,
}

const _: () = assert!(COARSE_BITS == 14);

/// The cells while the faces are being sorted into them.
pub struct Raster<'c, I> {
    /// The division of the page into cells.
    shape: Shape,
    /// The number of cells in a row.
    columns: usize,
    /// The cells, row by row from the lower left.
    cells: &'c mut [Cell<I>],
    /// What a computer notes while it counts, to fill the lists without another visit.
    #[cfg(feature = "threads")]
    trail: Option<Trail<'c, I>>,
}

/// The numbers of the cells that the faces enter, face after face. Behind those of each face stands
/// [`Index::NONE`].
#[cfg(feature = "threads")]
struct Trail<'c, I> {
    /// The memory for the numbers, the first `count` of which are in use.
    memory: &'c mut [I],
    /// How many numbers there are; more than `memory` can hold if some are missing.
    count: usize,
}

#[cfg(feature = "threads")]
impl<I: Index> Trail<'_, I> {
    /// Adds a number.
    #[inline]
    fn add(&mut self, number: I) {
        if let Some(slot) = self.memory.get_mut(self.count) {
            *slot = number;
        }
        self.count += 1;
    }
}

impl<'c, I: Index> Raster<'c, I> {
    /// Prepares to sort faces into `cells`, one for each cell of `shape` and all of them zero.
    pub fn new(shape: Shape, cells: &'c mut [Cell<I>]) -> Self {
        Self {
            shape,
            columns: shape.columns(),
            cells,
            #[cfg(feature = "threads")]
            trail: None,
        }
    }

    /// Notes in `memory` which cells the faces enter while they are counted. If it is large enough,
    /// the lists are then filled without another look at the faces.
    #[cfg(feature = "threads")]
    pub fn note_in(&mut self, memory: &'c mut [I]) {
        self.trail = Some(Trail { memory, count: 0 });
    }

    /// Gives the cells back when all faces have been sorted into them.
    pub fn cells(self) -> &'c mut [Cell<I>] {
        self.cells
    }

    /// Computes for each cell the index at which its list of faces begins, stores it as `end`, and
    /// returns the total number of entries.
    pub fn count(
        &mut self,
        coarse_projection: &CoarseProjection<'_>,
        outlines: Outlines<'_, I>,
        faces: &Faces<'_, I>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<usize, Aborted> {
        self.cells.fill(Cell::uncovered(I::ZERO));
        self.visit(coarse_projection, outlines, faces, yield_counter, &mut |cell, _| {
            cell.lengthen()
        })?;
        let is_noted = self.has_noted_all();
        let mut begin = I::ZERO;
        for cell in self.cells.iter_mut() {
            let count = cell.end();
            if is_noted {
                cell.begin_at(begin);
            } else {
                *cell = Cell::uncovered(begin);
            }
            begin += count;
        }
        Ok(begin.get())
    }

    /// Whether there was room to note all cells that the faces enter.
    #[inline(always)] // On a board it is a constant.
    fn has_noted_all(&self) -> bool {
        #[cfg(feature = "threads")]
        return self.trail.as_ref().is_some_and(|trail| trail.count <= trail.memory.len());
        #[cfg(not(feature = "threads"))]
        false
    }

    /// Writes the list of each cell. Afterwards `end` is the index at which the list ends.
    pub fn fill(
        &mut self,
        coarse_projection: &CoarseProjection<'_>,
        outlines: Outlines<'_, I>,
        faces: &Faces<'_, I>,
        entries: &mut [I],
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<(), Aborted> {
        #[cfg(feature = "threads")]
        if let Some(noted) = self.trail.take().and_then(|trail| trail.memory.get(..trail.count)) {
            yield_counter.spend(10 * noted.len())?;
            for (rank, of_face) in noted.split(|&number| number == I::NONE).enumerate() {
                for &number in of_face {
                    let cell = &mut self.cells[number.get()];
                    entries[cell.end().get()] = I::new(rank);
                    cell.lengthen();
                }
            }
            return Ok(());
        }
        // The visits are those of `count`, because both begin with cells without a cover. So no
        // list grows beyond where the next one begins, nor the last one beyond `entries`.
        self.visit(coarse_projection, outlines, faces, yield_counter, &mut |cell, rank| {
            entries[cell.end().get()] = rank;
            cell.lengthen();
        })
    }

    /// Calls `enter` for each face and each cell in which the face may be visible, and records the
    /// faces that cover cells.
    #[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
    fn visit(
        &mut self,
        coarse_projection: &CoarseProjection<'_>,
        outlines: Outlines<'_, I>,
        faces: &Faces<'_, I>,
        yield_counter: &mut YieldCounter<'_>,
        enter: &mut dyn FnMut(&mut Cell<I>, I),
    ) -> Result<(), Aborted> {
        for rank in 0..faces.len() {
            let face = faces.get(rank);
            let corners = outlines.element(face.first);
            let (mut near, mut far) = (i32::MAX, i32::MIN);
            for corner in corners {
                let z = coarse_projection.vertex(corner.vertex()).z;
                (near, far) = (near.min(z), far.max(z));
            }
            // One is added to the far depth because a point that rounding moved just behind the
            // face may lie on it.
            let (near, far) = (coarse_depth(near), coarse_depth(far + 1));
            let bounds = Bounds::of(coarse_projection, corners);
            let mut sides = [HalfPlane::default(); MOST_SIDES];
            let side_count = self.half_planes(coarse_projection, corners, &bounds, &mut sides);
            // `half_planes` fills at most as many as there are.
            let sides = &sides[..side_count];
            let may_cover = face.is_fan && side_count > 0;
            let [column0, column1, row0, row1] = self.shape.span(&bounds);
            for row in row0..=row1 {
                yield_counter.spend(200 + 50 * usize::from(column1 - column0))?;
                // An element has a corner, so its first row and column are not beyond its last, and
                // these lie in the grid: see `Grid::cells`.
                let first = usize::from(row) * self.columns;
                let cells = first + usize::from(column0)..=first + usize::from(column1);
                let mut values = [0; MOST_SIDES];
                for (value, side) in values.iter_mut().zip(sides) {
                    *value =
                        side.constant + side.right * i32::from(column0) + side.up * i32::from(row);
                }
                let first = *cells.start();
                for (_number, cell) in (first..).zip(&mut self.cells[cells]) {
                    let mut covered = may_cover;
                    let mut outside = near > cell.cover_depth();
                    for (value, side) in values.iter_mut().zip(sides) {
                        outside |= *value <= side.outside;
                        covered &= *value >= side.within;
                        *value += side.right;
                    }
                    if outside {
                        continue;
                    }
                    enter(cell, I::new(rank));
                    #[cfg(feature = "threads")]
                    if let Some(trail) = &mut self.trail {
                        trail.add(I::new(_number));
                    }
                    if covered && far < cell.cover_depth() {
                        cell.cover_with(I::new(rank), far);
                    }
                }
            }
            #[cfg(feature = "threads")]
            if let Some(trail) = &mut self.trail {
                trail.add(I::NONE);
            }
        }
        Ok(())
    }

    /// Computes the sides of a face that is certainly convex on the page and returns their number.
    /// Returns 0 if the face may not be convex or has too many sides.
    fn half_planes(
        &self,
        coarse_projection: &CoarseProjection<'_>,
        corners: &[Corner<I>],
        bounds: &Bounds,
        sides: &mut [HalfPlane; MOST_SIDES],
    ) -> usize {
        let count = corners.len();
        if !(3..=MOST_SIDES).contains(&count) {
            return 0;
        }
        // It is asked for n up to `count - 1 + others`, which is below twice `count`.
        let position = |n: usize| {
            let n = if n < count { n } else { n - count };
            coarse_projection.position(corners[n].vertex())
        };
        let (width, height) = (1 << self.shape.shift_x, 1 << self.shape.shift_y);
        // No corner of a cell under test lies farther than this from a corner of the face.
        let reach = i32::from(bounds.high.x - bounds.low.x)
            + i32::from(bounds.high.y - bounds.low.y)
            + 2 * (width + height);
        let turn = coarse_side(position(0), position(1), position(2));
        // Every other corner must lie on the inner side. For three or four corners it is enough to
        // check the next one.
        let others = if count <= 4 { 1 } else { count - 2 };
        let (mut a, mut b) = (position(count - 1), position(0));
        for (n, side) in sides.iter_mut().enumerate().take(count) {
            let line = CoarseLine::new(a, b);
            if turn == 0 || (1..=others).any(|ahead| line.side(position(n + ahead)) != turn) {
                return 0;
            }
            let dx = (i32::from(b.x) - i32::from(a.x)) * turn;
            let dy = (i32::from(b.y) - i32::from(a.y)) * turn;
            let (right, up) = (-dy * width, dx * height);
            let error_bound = dx.abs() + dy.abs() + reach + 2;
            *side = HalfPlane {
                right,
                up,
                constant: dy * i32::from(a.x) - dx * i32::from(a.y),
                outside: -error_bound - right.max(0) - up.max(0),
                within: error_bound - right.min(0) - up.min(0),
            };
            (a, b) = (b, position(n + 1));
        }
        count
    }
}
