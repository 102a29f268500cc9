//! The page in cells, each with the faces that lie on it, nearest first (Griffith, Brown III).
//!
//! A cell that one face covers wholly needs no face that lies behind that one: whatever such a face
//! hides there is hidden already. An edge that lies behind the covering face of every cell on its
//! way is hidden without another look.

use super::edges::Outlines;
use super::faces::Faces;
use super::outlook::{Outlook, PLACE_BITS, Place};
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// One cell of the page.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Cell {
    /// Where its faces end in the list of entries; they begin where those of the cell before end.
    end: u16,
    /// Nothing at this depth or farther is seen in this cell.
    cover_depth: u16,
    /// The face that covers it at that depth, by rank.
    cover: u16,
}

/// The depth that nothing has: no face covers the cell.
const NO_COVER: u16 = u16::MAX;

/// A depth on a scale of 2^15, rounded down. Monotonic, so that a greater one is surely farther.
pub fn coarse_depth(z: i32) -> u16 {
    ((z + crate::geometry::COORDINATE_LIMIT) >> 5) as u16
}

/// The cells and their lists.
#[derive(Debug)]
pub struct Grid<'a> {
    shift_x: u32,
    shift_y: u32,
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

impl<'a> Grid<'a> {
    /// Bytes for the coarsest grid.
    pub const fn least_bytes(faces: usize) -> usize {
        Scratch::bytes_for::<Cell>(1) + Scratch::bytes_for::<u16>(faces)
    }

    /// Sorts the faces into the finest grid that fits what is left of `scratch`, not finer than is useful.
    pub fn new(
        outlook: &Outlook<'_>,
        outlines: Outlines<'_>,
        faces: &Faces<'_>,
        mut scratch: Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        let far = outlook.places.iter().fold(Place::default(), |far, place| Place {
            x: far.x.max(place.x),
            y: far.y.max(place.y),
        });
        let wanted_cells = (faces.len() * CELLS_FOR_EACH_FACE).clamp(1, usize::from(u16::MAX));
        let (mut shift_x, mut shift_y) = (0, 0);
        loop {
            let columns = usize::from(far.x >> shift_x) + 1;
            let rows = usize::from(far.y >> shift_y) + 1;
            let cell_count = columns * rows;
            let fits = cell_count == 1
                || Scratch::bytes_for::<Cell>(cell_count) + Scratch::bytes_for::<u16>(faces.len())
                    <= scratch.available_bytes();
            if cell_count <= wanted_cells && fits {
                let mut attempt = scratch.reborrow();
                let cells: &mut [Cell] = attempt.take(cell_count)?;
                let mut counting = Raster { shift_x, shift_y, columns, rows, cells };
                let room =
                    (attempt.available_bytes() / size_of::<u16>()).min(usize::from(u16::MAX));
                let total = counting.count(outlook, outlines, faces);
                if total <= room || cell_count == 1 {
                    let cells: &'a mut [Cell] = scratch.take(cell_count)?;
                    let entries: &'a mut [u16] = scratch.take(total)?;
                    let mut raster = Raster { shift_x, shift_y, columns, rows, cells };
                    raster.count(outlook, outlines, faces);
                    raster.fill(outlook, outlines, faces, entries);
                    return Ok(Self { shift_x, shift_y, columns, cells, entries });
                }
            }
            if columns > rows {
                shift_x += 1;
            } else {
                shift_y += 1;
            }
        }
    }

    fn view(&self, cell: usize, near: u16) -> CellView<'_> {
        let begin = cell.checked_sub(1).map_or(0, |before| self.cells[before].end);
        let Cell { end, cover_depth, cover } = self.cells[cell];
        CellView {
            cover: (cover_depth < near).then_some(cover),
            faces: &self.entries[usize::from(begin)..usize::from(end)],
        }
    }

    /// Visits every cell that the edge from `p` to `q`, nowhere nearer than `near`, passes or
    /// touches, until the visitor says no.
    ///
    /// The edge lies less than one unit right and up of the line between the places.
    pub fn along(
        &self,
        p: Place,
        q: Place,
        near: u16,
        mut visit: impl FnMut(CellView<'_>) -> bool,
    ) -> bool {
        let (low, high) = if p.y <= q.y { (p, q) } else { (q, p) };
        let (dx, dy) = (i32::from(high.x) - i32::from(low.x), i32::from(high.y) - i32::from(low.y));
        let (left, right) = (i32::from(p.x.min(q.x)), i32::from(p.x.max(q.x)));
        let rows = (low.y >> self.shift_y)..=(high.y >> self.shift_y);
        for row in rows {
            let (mut from, mut to) = (left, right);
            if dy > 0 {
                let bottom = (i32::from(row) << self.shift_y) - 1;
                let top = (i32::from(row) + 1) << self.shift_y;
                let x_at = |y: i32| {
                    let rise = (y - i32::from(low.y)).clamp(0, dy);
                    i32::from(low.x) + dx * rise / dy
                };
                let (x0, x1) = (x_at(bottom), x_at(top));
                from = from.max(x0.min(x1) - 1);
                to = to.min(x0.max(x1) + 2);
            }
            let first = usize::from(row) * self.columns;
            for column in (from >> self.shift_x)..=(to >> self.shift_x) {
                if !visit(self.view(first + column as usize, near)) {
                    return false;
                }
            }
        }
        true
    }
}

/// More cells cost memory and time to fill, fewer make longer lists.
const CELLS_FOR_EACH_FACE: usize = 2;

/// Corners of a face up to which its shape is compared with each cell; beyond, its bounding box is.
const MOST_SIDES: usize = 8;

/// A side of a convex face on the page: `x * X + y * Y + constant` is positive inside, with a doubt.
#[derive(Clone, Copy, Default)]
struct HalfPlane {
    x: i32,
    y: i32,
    constant: i32,
    doubt: i32,
}

struct Raster<'c> {
    shift_x: u32,
    shift_y: u32,
    columns: usize,
    rows: usize,
    cells: &'c mut [Cell],
}

impl Raster<'_> {
    /// Leaves in each cell where its list begins, and returns how many entries there are.
    fn count(&mut self, outlook: &Outlook<'_>, outlines: Outlines<'_>, faces: &Faces<'_>) -> usize {
        self.cells.fill(Cell { end: 0, cover_depth: NO_COVER, cover: 0 });
        let mut total = 0usize;
        self.visit(outlook, outlines, faces, |cell, _| {
            cell.end = cell.end.saturating_add(1);
            total += 1;
        });
        let mut begin = 0u16;
        for cell in self.cells.iter_mut() {
            let count = cell.end;
            *cell = Cell { end: begin, cover_depth: NO_COVER, cover: 0 };
            begin = begin.saturating_add(count);
        }
        total
    }

    fn fill(
        &mut self,
        outlook: &Outlook<'_>,
        outlines: Outlines<'_>,
        faces: &Faces<'_>,
        entries: &mut [u16],
    ) {
        self.visit(outlook, outlines, faces, |cell, rank| {
            entries[usize::from(cell.end)] = rank;
            cell.end += 1;
        });
    }

    /// Calls `enter` for each face and each cell where it may be seen; notes the covering faces.
    fn visit(
        &mut self,
        outlook: &Outlook<'_>,
        outlines: Outlines<'_>,
        faces: &Faces<'_>,
        mut enter: impl FnMut(&mut Cell, u16),
    ) {
        for rank in 0..faces.len() {
            let face = faces.get(rank);
            let corners = outlines.element(face.first);
            let (mut near, mut far) = (i32::MAX, i32::MIN);
            let (mut x0, mut y0, mut x1, mut y1) = (u16::MAX, u16::MAX, 0, 0);
            for corner in corners {
                let place = outlook.place(corner.vertex());
                (x0, y0) = (x0.min(place.x), y0.min(place.y));
                (x1, y1) = (x1.max(place.x), y1.max(place.y));
                let z = outlook.vertex(corner.vertex()).z;
                (near, far) = (near.min(z), far.max(z));
            }
            let (near, far) = (coarse_depth(near), coarse_depth(far));
            let (column0, column1) = (x0 >> self.shift_x, x1 >> self.shift_x);
            let (row0, row1) = (y0 >> self.shift_y, y1 >> self.shift_y);
            let mut sides = [HalfPlane::default(); MOST_SIDES];
            let reach = i32::from(x1 - x0)
                + i32::from(y1 - y0)
                + (1 << self.shift_x)
                + (1 << self.shift_y)
                + 4;
            let convex = half_planes(outlook, corners, reach, &mut sides);
            let may_cover = convex && face.is_fan && corners.len() >= 3;
            let sides = if convex { &sides[..corners.len()] } else { &[] };
            for row in row0..=row1 {
                for column in column0..=column1 {
                    let cell =
                        &mut self.cells[usize::from(row) * self.columns + usize::from(column)];
                    if near > cell.cover_depth {
                        continue;
                    }
                    let low_x = i32::from(column) << self.shift_x;
                    let low_y = i32::from(row) << self.shift_y;
                    let (size_x, size_y) = (1 << self.shift_x, 1 << self.shift_y);
                    let mut covered = may_cover;
                    let mut outside = false;
                    for side in sides {
                        let at_low = side.x * low_x + side.y * low_y + side.constant;
                        let across = side.x * size_x;
                        let up = side.y * size_y;
                        let best = at_low + across.max(0) + up.max(0);
                        let worst = at_low + across.min(0) + up.min(0);
                        outside |= best <= -side.doubt;
                        covered &= worst >= side.doubt;
                    }
                    if outside {
                        continue;
                    }
                    enter(cell, rank as u16);
                    if covered && far < cell.cover_depth {
                        cell.cover_depth = far;
                        cell.cover = rank as u16;
                    }
                }
            }
        }
        debug_assert!(self.cells.len() == self.columns * self.rows);
    }
}

/// The sides of a face that is surely convex on the page; false if it may not be.
///
/// `reach` bounds the distance, across and up together, from a corner to any point that is asked for.
fn half_planes(
    outlook: &Outlook<'_>,
    corners: &[crate::model::Corner],
    reach: i32,
    sides: &mut [HalfPlane; MOST_SIDES],
) -> bool {
    let count = corners.len();
    if !(3..=MOST_SIDES).contains(&count) {
        return false;
    }
    let number = |n: usize| corners[n % count].vertex();
    let place = |n: usize| outlook.place(number(n));
    let turn = super::outlook::coarse_side(place(0), place(1), place(2));
    if turn == 0 {
        return false;
    }
    for (n, half_plane) in sides.iter_mut().enumerate().take(count) {
        let (a, b) = (place(n), place(n + 1));
        // Convex: every other corner lies on the inner side of every side.
        for other in n + 2..n + count {
            if super::outlook::coarse_side(a, b, place(other)) != turn {
                return false;
            }
        }
        let dx = i32::from(b.x) - i32::from(a.x);
        let dy = i32::from(b.y) - i32::from(a.y);
        *half_plane = HalfPlane {
            x: -dy * turn,
            y: dx * turn,
            constant: (dy * i32::from(a.x) - dx * i32::from(a.y)) * turn,
            doubt: dx.abs() + dy.abs() + reach + 2,
        };
    }
    true
}

const _: () = assert!(PLACE_BITS == 14, "products of a side and a place fit 31 bits");
