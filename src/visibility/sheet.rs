//! Finds out in which cells of the page the nearest faces form one sheet: together they cover the
//! cell once and leave no gap.
//!
//! Such a cell answers most questions at once. An edge that lies behind the sheet is hidden there,
//! and an edge that lies in it is visible there, because no other face of the sheet covers the page
//! beside it. On a closed mesh that is finer than the cells, only cells with an outline in them are
//! left, which are few.
//!
//! The nearest faces are those that begin before the farthest of them ends. Each is taken in the
//! sense in which it runs anticlockwise on the page. If every side that may touch the cell belongs
//! to two of them, in opposite directions, then no boundary of these faces enters the cell, so
//! every point of it is covered by the same number of faces (a chain without boundary). That number
//! is counted at the middle of the cell.

use super::coarse_projection::{CoarseLine, CoarsePoint, PagePoint};
use super::edges::sides;
use super::faces::Face;
use super::scene_index::SceneIndex;
use crate::array::MapEach;
use crate::geometry::COORDINATE_LIMIT;
use crate::index::Index;
use crate::model::Corner;

/// The most sides that may be waiting for their second face. A cell that needs more is taken to
/// have no sheet.
const MOST_OPEN_SIDES: usize = 32;

/// The part of the page whose coarse points lie between two corners, the upper right corner not
/// included.
#[derive(Debug, Clone, Copy)]
pub struct CellArea {
    /// The lower left corner.
    pub low: CoarsePoint,
    /// The upper right corner, just outside.
    pub high: CoarsePoint,
}

impl CellArea {
    /// Returns the four corners.
    fn corners(&self) -> [CoarsePoint; 4] {
        let Self { low, high } = *self;
        [low, CoarsePoint { x: high.x, ..low }, high, CoarsePoint { x: low.x, ..high }]
    }

    /// Whether the segment between two vertices at these coarse points may have a point in the cell
    /// or just beside it.
    fn may_touch(&self, a: CoarsePoint, b: CoarsePoint) -> bool {
        let (low, high) = (a.low(b), a.high(b));
        let is_beside = high.x < self.low.x
            || high.y < self.low.y
            || low.x >= self.high.x
            || low.y >= self.high.y;
        !is_beside && CoarseLine::new(a, b).may_cross(self.low, self.high)
    }
}

/// The two ends of a side, in the direction in which its face runs anticlockwise on the page.
type Directed<I> = [I; 2];

/// The sides of a chain of faces that were met in one direction only so far.
pub struct OpenSides<I> {
    sides: [Directed<I>; MOST_OPEN_SIDES],
    count: usize,
}

impl<I: Index> OpenSides<I> {
    /// No side was met so far.
    pub fn new() -> Self {
        Self { sides: [[I::ZERO; 2]; MOST_OPEN_SIDES], count: 0 }
    }

    /// Returns the sides that were met in one direction only.
    pub fn sides(&self) -> &[Directed<I>] {
        self.sides.get(..self.count).unwrap_or_default()
    }

    /// Removes the side that runs in the opposite direction, or adds this one. Returns `None` if
    /// there is no room for it.
    pub fn meet(&mut self, [from, to]: Directed<I>) -> Option<()> {
        let open = self.sides.get_mut(..self.count)?;
        if let Some(found) = open.iter().position(|side| *side == [to, from]) {
            // One side is open at least, and `count` then becomes the index of the last.
            self.count -= 1;
            open.swap(found, self.count);
        } else {
            *self.sides.get_mut(self.count)? = [from, to];
            self.count += 1;
        }
        Some(())
    }
}

impl<I: Index> SceneIndex<'_, I> {
    /// Returns the greatest depth of the sheet that the nearest of the faces with these ranks form
    /// in a cell; `None` if they form none, or if that is not certain. The ranks ascend, and all
    /// faces on the cell are among them.
    pub fn sheet(&self, cell: &CellArea, ranks: &[I]) -> Option<i32> {
        let mut open = OpenSides::new();
        let mut far = -COORDINATE_LIMIT;
        let mut count = 0;
        for rank in ranks.iter().map(|rank| rank.get()) {
            if count > 0 && self.faces.begins_behind(rank, far) {
                break;
            }
            count += 1;
            let face = self.faces.get(rank);
            let is_turned = self.facing(face)? < 0;
            for (_, a, b) in sides(self.outlines.element(face.first)) {
                far = far.max(self.coarse_projection.vertex(a).z);
                let [at_a, at_b] = [a, b].map_each(|end| self.coarse_projection.position(end));
                if cell.may_touch(at_a, at_b) {
                    open.meet(if is_turned { [b, a] } else { [a, b] })?;
                }
            }
        }
        if count == 0 || open.sides().iter().any(|&side| self.may_pass(side, cell)) {
            return None;
        }
        let middle = self.coarse_projection.middle(cell.low, cell.high);
        let mut layers = 0;
        for rank in ranks.iter().take(count) {
            for triangle in self.triangles(self.faces.get(rank.get())) {
                layers += u32::from(self.covers(triangle, &middle)?);
            }
        }
        (layers == 1).then_some(far)
    }

    /// Whether the line through two vertices that [may touch](CellArea::may_touch) a cell may have
    /// a point in it.
    ///
    /// On a computer, a cell of a fine mesh has some twenty units of the coarse grid, by which that
    /// cannot be told of many lines beside it. So the exact answer is given. On a board a cell has
    /// hundreds of units.
    #[inline]
    fn may_pass(&self, [a, b]: [I; 2], cell: &CellArea) -> bool {
        if !Self::HAS_SHORTCUTS {
            return true;
        }
        let sides = cell.corners().map_each(|corner| {
            let corner = self.coarse_projection.middle(corner, corner);
            self.coarse_projection.side_of_point(a, b, &corner)
        });
        sides.iter().any(|&side| side == 0 || side != sides[0])
    }

    /// Returns the sense in which all triangles of a face turn on the page: 1 anticlockwise, -1
    /// clockwise. `None` if they do not turn in one sense, or if the face is no fan of triangles.
    pub fn facing(&self, face: Face) -> Option<i32> {
        face.is_fan.then(|| self.turn(self.outlines.element(face.first)))?
    }

    /// Returns the sense in which all triangles of a fan turn on the page: 1 anticlockwise, -1
    /// clockwise. `None` if they do not turn in one sense.
    fn turn(&self, corners: &[Corner<I>]) -> Option<i32> {
        let (first, others) = corners.split_first()?;
        let mut turns = others.windows(2).map(|pair| match pair {
            [b, c] => self.coarse_projection.side(first.vertex(), b.vertex(), c.vertex()),
            _ => 0,
        });
        let facing = turns.next().filter(|&facing| facing != 0)?;
        turns.all(|turn| turn == facing).then_some(facing)
    }

    /// Whether a triangle contains a point of the page. `None` if the point lies on its outline.
    fn covers(&self, [a, b, c]: [I; 3], point: &PagePoint) -> Option<bool> {
        let side = |from, to| self.coarse_projection.side_of_point(from, to, point);
        let (first, second) = (side(a, b), side(b, c));
        if first * second < 0 {
            return Some(false);
        }
        let third = side(c, a);
        if first * third < 0 || second * third < 0 {
            return Some(false);
        }
        (first * second * third != 0).then_some(true)
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Projection, Vertex};
    use crate::index::Index;
    use crate::model::{Corner, Elements};
    use crate::stage::{NeverCancel, Scratch, SinkFull};
    #[cfg(feature = "threads")]
    use crate::visibility::coarse_projection::CoarsePoint;
    use crate::visibility::grid::Grid;
    use crate::visibility::search::{Marks, StretchFinder};
    #[cfg(feature = "threads")]
    use crate::visibility::sheet::CellArea;
    use crate::visibility::{
        Cores, Crease, Options, Scene, Stretch, StretchSink, Unrounded, YieldCounter, index,
    };
    use std::vec::Vec;

    /// The cells around a ball, and those from pole to pole.
    const AROUND: u32 = 20;
    const ALONG: u32 = 9;

    struct Random(u32);

    impl Random {
        /// Returns a number from 0 to 1.
        fn part(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 8) / f64::from(1 << 24)
        }

        fn is_one_of(&mut self, many: u32) -> bool {
            self.part() * f64::from(many) < 1.0
        }
    }

    /// A scene of bumpy balls, seen from a generic direction. Some are so bumpy that they have
    /// folds, some have holes, faces that are there twice or turned over, and bars.
    struct Balls {
        vertices: Vec<Vertex>,
        elements: Vec<Vec<u32>>,
    }

    impl Balls {
        fn new(seed: u32) -> Self {
            let mut random = Random(seed.wrapping_mul(0x9E37_79B9));
            let mut scene = Self { vertices: Vec::new(), elements: Vec::new() };
            let bumps = if seed.is_multiple_of(4) { 0.0 } else { 0.3 * random.part() };
            let is_damaged = seed.is_multiple_of(3);
            let (turn, tilt) = (6.0 * random.part(), 0.2 + random.part());
            for _ in 0..1 + seed % 3 {
                let middle = [(); 3].map(|()| 90_000.0 * (random.part() - 0.5));
                let radius = 40_000.0 + 80_000.0 * random.part();
                scene.add_ball(middle, radius, bumps, [turn, tilt], &mut random, is_damaged);
            }
            scene
        }

        fn add_ball(
            &mut self,
            middle: [f64; 3],
            radius: f64,
            bumps: f64,
            [turn, tilt]: [f64; 2],
            random: &mut Random,
            is_damaged: bool,
        ) {
            let first = self.vertices.len() as u32;
            for row in 0..=ALONG {
                for column in 0..AROUND {
                    let across = f64::from(row) / f64::from(ALONG) * 3.0 + 0.07;
                    let around = f64::from(column) / f64::from(AROUND) * core::f64::consts::TAU;
                    let r = radius * (1.0 + bumps * (random.part() - 0.5));
                    let (x, y, z) = (
                        r * across.sin() * around.cos(),
                        r * across.sin() * around.sin(),
                        r * across.cos(),
                    );
                    let (x, y) = (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
                    let (y, z) = (y * tilt.cos() - z * tilt.sin(), y * tilt.sin() + z * tilt.cos());
                    let [mx, my, mz] = middle;
                    let (x, y, z) = ((x + mx) as i32, (y + my) as i32, (z + mz) as i32);
                    self.vertices.push(Vertex::new(x, y, 300_000 + z));
                }
            }
            for row in 0..ALONG {
                for column in 0..AROUND {
                    let at = |row: u32, column: u32| first + row * AROUND + column % AROUND;
                    let [a, b] = [at(row, column), at(row, column + 1)];
                    let [d, c] = [at(row + 1, column), at(row + 1, column + 1)];
                    let faces = if column % 3 == 0 {
                        std::vec![std::vec![a, b, c, d]]
                    } else {
                        std::vec![std::vec![a, b, c], std::vec![a, c, d]]
                    };
                    for mut face in faces {
                        if is_damaged && random.is_one_of(12) {
                            face.reverse();
                        }
                        if is_damaged && random.is_one_of(25) {
                            self.elements.push(std::vec![a, c]);
                        }
                        if is_damaged && random.is_one_of(40) {
                            self.elements.push(face.clone());
                        }
                        if !(is_damaged && random.is_one_of(20)) {
                            self.elements.push(face);
                        }
                    }
                }
            }
        }

        fn corners<I: Index>(&self) -> Vec<Corner<I>> {
            let corners = self.elements.iter().flat_map(|element| {
                let (is_bar, last) = (element.len() == 2, element.len() - 1);
                let corner = move |(n, &to)| Corner::new(I::new(to as usize), is_bar, n == last);
                element.iter().enumerate().map(corner)
            });
            corners.collect()
        }
    }

    struct Stretches(Vec<Stretch<u32>>);

    impl<I: Index> StretchSink<I> for Stretches {
        fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull> {
            let Stretch { edge, ends, from, to, visible, pen } = stretch;
            let edge = edge.map(|(p, q)| (p.into(), q.into()));
            self.0.push(Stretch { edge, ends, from, to, visible, pen });
            Ok(())
        }
    }

    fn scene<'a, I: Index>(
        vertices: &'a [Vertex],
        corners: &'a [Corner<I>],
        projection: Projection,
    ) -> Scene<'a, I> {
        let elements = Elements::new(corners);
        Scene { vertices, elements, projection, unrounded: Unrounded::UNKNOWN }
    }

    /// Returns the stretches of a scene, and in how many cells a sheet was found. Sheets are looked
    /// for only in a part of a scene.
    fn find<I: Index>(
        scene: &Scene<'_, I>,
        options: Options,
        is_part: bool,
    ) -> (Vec<Stretch<u32>>, usize) {
        let is_large = scene.vertices.len() > 1000;
        let mut words = std::vec![0u64; if is_large { 1 << 18 } else { 1 << 14 }];
        let mut scratch = Scratch::new(&mut words);
        let mut never_cancel = NeverCancel;
        let yield_counter = &mut YieldCounter::new(&mut never_cancel);
        let around =
            &index(scene, options, Cores::One, &mut scratch, yield_counter).expect("an index");
        let faces = around.faces.len();
        let marks = Marks::new(faces, 1 << 14, &mut scratch).expect("marks");
        let grid = &Grid::new(around, is_part, Cores::One, scratch, yield_counter).expect("a grid");
        let mut search = StretchFinder::new(around, grid, marks, options, Default::default());
        let mut found = Stretches(Vec::new());
        let corners = around.outlines.corners.len();
        search.follow_edges(0..corners, yield_counter, &mut found).expect("edges");
        search.follow_seams(0..faces, yield_counter, &mut found).expect("seams");
        (found.0, grid.sheets())
    }

    #[test]
    fn what_begins_just_behind_a_sheet_is_hidden() {
        // The depths are so near each other that the coarse depth of the edges behind is that of
        // the sheet, though their faces do not count as part of it.
        let mut vertices = Vec::new();
        let mut corners = Vec::new();
        let count = 24;
        for (z, shift, size) in [(127, 0, 10_000), (130, 3_137, 9_700)] {
            let first = vertices.len() as u32;
            for at in 0..count * count {
                let [x, y] = [at % count, at / count].map(|at| at as i32 * size + shift);
                vertices.push(Vertex::new(x, y, z));
            }
            for at in (0..count * (count - 1)).filter(|at| at % count != count - 1) {
                let at = first + at;
                let face = [at, at + 1, at + 1 + count, at + count];
                corners.extend((0..4).map(|n| Corner::<u32>::new(face[n], false, n == 3)));
            }
        }
        for projection in [Projection::Perspective, Projection::Parallel] {
            let scene = scene(&vertices, &corners, projection);
            let (expected, _) = find(&scene, Options::default(), false);
            let (found, sheets) = find(&scene, Options::default(), true);
            assert!(sheets > 100, "{sheets}");
            assert!(found == expected, "{} and {}", found.len(), expected.len());
        }
    }

    #[cfg(feature = "threads")]
    #[test]
    fn a_sheet_is_found_however_near_its_sides_are() {
        // A bar makes the page wide, so that a face is 14 units of the coarse grid wide.
        let mut vertices = std::vec![Vertex::new(0, 0, 9000), Vertex::new(500_000, 500_000, 9000)];
        let mut corners = std::vec![Corner::<u32>::new(0, true, false), Corner::new(1, true, true)];
        let count = 24;
        for at in 0..count * count {
            let [x, y] = [at % count, at / count].map(|at| 100_000 + 448 * at as i32);
            vertices.push(Vertex::new(x + y / 3, y - x / 5, x / 100));
        }
        for at in (0..count * (count - 1)).filter(|at| at % count != count - 1) {
            let [a, b, c, d] = [at, at + 1, at + 1 + count, at + count].map(|at| 2 + at);
            for face in [[a, b, c], [a, c, d]] {
                corners.extend((0..3).map(|n| Corner::new(face[n], false, n == 2)));
            }
        }
        let scene = scene(&vertices, &corners, Projection::Parallel);
        let mut words = std::vec![0u64; 1 << 14];
        let (mut scratch, mut never_cancel) = (Scratch::new(&mut words), NeverCancel);
        let yield_counter = &mut YieldCounter::new(&mut never_cancel);
        let options = Options::default();
        let around = &index(&scene, options, Cores::One, &mut scratch, yield_counter).unwrap();
        let ranks: Vec<_> = (0..around.faces.len() as u32).collect();
        let middle = around.coarse_projection.positions[(2 + count * count / 2 + 12) as usize];
        let mut sheets = 0;
        for at in 0..100u16 {
            let low = |from: u16, at: u16| from - 100 + 20 * at;
            let low = CoarsePoint { x: low(middle.x, at % 10), y: low(middle.y, at / 10) };
            let high = CoarsePoint { x: low.x + 20, y: low.y + 20 };
            sheets += u32::from(around.sheet(&CellArea { low, high }, &ranks).is_some());
        }
        assert!(sheets > 95, "{sheets}");
    }

    /// With the numbers of a computer, what enters a cell is decided exactly, with those of a board
    /// by the coarse grid alone.
    #[cfg(feature = "threads")]
    #[test]
    fn sheets_that_are_found_exactly_change_no_stretch() {
        let count = 70;
        for seed in 0..if cfg!(miri) { 0 } else { 6 } {
            // A cloth with folds where its points are moved by more than their distance.
            let mut random = Random(seed);
            let mut vertices = Vec::new();
            for at in 0..count * count {
                let [x, y] = [at % count, at / count].map(|at| 6000.0 * f64::from(at));
                let is_folded = random.is_one_of(60);
                let reach = if is_folded { 20_000.0 } else { 3000.0 };
                let [x, y] = [x, y].map(|at| (at + reach * (random.part() - 0.5)) as i32);
                let slope = x / 8 + (9000.0 * random.part()) as i32;
                vertices.push(Vertex::new(x - 200_000, y - 200_000, 300_000 + slope));
            }
            let mut faces = Vec::new();
            for at in (0..count * (count - 1)).filter(|at| at % count != count - 1) {
                let [a, b, c, d] = [at, at + 1, at + 1 + count, at + count];
                faces.extend([std::vec![a, b, c], std::vec![a, c, d]]);
            }
            let cloth = Balls { vertices, elements: faces };
            let projection = [Projection::Perspective, Projection::Parallel][seed as usize % 2];
            let options = Options { with_seams: true, ..Options::default() };
            let (corners, wide_corners) = (cloth.corners::<u16>(), cloth.corners::<u32>());
            let narrow_scene = scene(&cloth.vertices, &corners, projection);
            let wide_scene = scene(&cloth.vertices, &wide_corners, projection);
            let (expected, fewer) = find(&narrow_scene, options, true);
            let (found, sheets) = find(&wide_scene, options, true);
            assert!(sheets > fewer && fewer > 500, "{seed}: {sheets} and {fewer}");
            assert!(found == expected, "{seed}: {} and {}", found.len(), expected.len());
        }
    }

    #[test]
    fn sheets_change_no_stretch() {
        let (mut sheets, mut seams) = (0, 0);
        for seed in 0..if cfg!(miri) { 1 } else { 240 } {
            let balls = Balls::new(seed);
            let projection = [Projection::Perspective, Projection::Parallel][seed as usize / 2 % 2];
            let options = Options {
                with_hidden: seed.is_multiple_of(2),
                with_seams: true,
                merged_blocks: seed % 5 == 1,
                crease: (seed % 7 == 2).then_some(Crease {
                    cosine: 992_000,
                    depth_stretch: (1, 1),
                    slants: [0; 2],
                }),
            };
            // Boards know no boxes of faces, so each seam is looked for there.
            let (corners, wide_corners) = (balls.corners::<u16>(), balls.corners::<u32>());
            let scene = scene(&balls.vertices, &corners, projection);
            let wide_scene = self::scene(&balls.vertices, &wide_corners, projection);
            let (expected, none) = find(&scene, options, false);
            assert_eq!(none, 0, "a whole scene of few faces");
            let found = [
                find(&scene, options, true),
                find(&wide_scene, options, false),
                find(&wide_scene, options, true),
            ];
            for (found, _) in &found {
                assert!(*found == expected, "{seed}: {} and {}", found.len(), expected.len());
            }
            seams += expected.iter().filter(|stretch| stretch.edge.is_none()).count();
            sheets += found[2].1;
        }
        assert!(sheets > 2000 && seams > 2000, "{sheets} and {seams}");
    }
}
