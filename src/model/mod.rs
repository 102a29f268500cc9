//! The model that the user sent: its vertices, bars, faces and curves, and the edits of them.
//!
//! A [`Model`] holds vertices in one array and faces and bars in another, in the order in which
//! they came (Cárdenas & Seeley's joints and bars in two sequential arrays). It refuses whatever
//! would make it invalid, such as a face through a vertex that does not exist or more than fits in
//! the memory; it is then unchanged. [`Model::edit`] changes it, and [`Model::restore`] undoes a
//! change.

mod checksum;
mod curves;
mod edit;
mod elements;
mod error;
mod pens;
mod precision;
mod undo;

pub use curves::{Curves, StoredCurve};
pub use edit::{Change, Edit, ElementKind, Numbers};
pub use elements::{Corner, Element, Elements, VERTEX_NUMBER_LIMIT};
pub use error::ModelError;
pub use pens::{PEN_LIMIT, PenName, PenRun, PenWriter, Pens};

use crate::fixed::Decimal;
use bytemuck::{Pod, Zeroable};
use core::ops::Range;
use curves::CurveList;
use pens::{PenBook, RUN};
use precision::Rounding;

/// A position in the model's own space. Each coordinate is in units of 2^-[`Model::fraction_bits`],
/// and its absolute value is at most 2^30.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Position {
    /// First coordinate.
    pub x: i32,
    /// Second coordinate.
    pub y: i32,
    /// Third coordinate.
    pub z: i32,
}

impl Position {
    /// Returns the coordinates in order.
    pub fn coordinates(self) -> [i32; 3] {
        [self.x, self.y, self.z]
    }
}

/// The limit of the absolute value of stored coordinates, so that their differences fit 32 bits.
pub const POSITION_LIMIT: i32 = 1 << 30;

/// The finest unit of a model is 2^-30, with which |coordinate| is at most 1.
const FINEST_FRACTION_BITS: u32 = 30;

/// A callback that gets the model just before a change that will succeed, and is never called when
/// a change is refused. It may copy the model with [`Model::save`].
pub type Before<'b> = &'b mut dyn FnMut(&Model<'_>);

/// A [`Before`] that does nothing: no copy is kept.
pub fn unkept(_: &Model<'_>) {}

/// The vertices, faces, bars and curves that the user sent, in memory lent by the owner.
///
/// All coordinates share one binary unit. It is 2^-30 at first and becomes coarser when a larger
/// coordinate comes, so that a model of any size keeps 30 bits of its largest coordinate.
#[derive(Debug)]
pub struct Model<'m> {
    vertices: &'m mut heapless::VecView<Position>,
    /// The corners of the elements, followed by their [`PenRun`]s and by the curves.
    corners: &'m mut heapless::VecView<Corner>,
    fraction_bits: u32,
    /// The error bound of the coordinates.
    rounding: Rounding,
    faces: usize,
    bars: usize,
    curves: CurveList,
    /// The number of [`PenRun`]s.
    runs: usize,
    pens: PenBook,
}

impl<'m> Model<'m> {
    /// Makes an empty model that can hold as much as the two vectors can. Their contents are
    /// discarded.
    pub fn new(
        vertices: &'m mut heapless::VecView<Position>,
        corners: &'m mut heapless::VecView<Corner>,
    ) -> Self {
        let mut model = Self {
            vertices,
            corners,
            fraction_bits: FINEST_FRACTION_BITS,
            rounding: Rounding::default(),
            faces: 0,
            bars: 0,
            curves: CurveList::default(),
            runs: 0,
            pens: PenBook::default(),
        };
        model.clear();
        model
    }

    /// Removes everything from the model.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.corners.clear();
        self.fraction_bits = FINEST_FRACTION_BITS;
        self.rounding = Rounding::default();
        self.faces = 0;
        self.bars = 0;
        self.curves = CurveList::default();
        self.runs = 0;
        self.pens = PenBook::default();
    }

    /// Returns the vertices, in units of 2^-[`Model::fraction_bits`].
    pub fn vertices(&self) -> &[Position] {
        self.vertices
    }

    /// Returns the number of fraction bits, 0 to 30: the unit of every coordinate is 2^-this.
    pub fn fraction_bits(&self) -> u32 {
        self.fraction_bits
    }

    /// Returns the faces and bars.
    pub fn elements(&self) -> Elements<'_> {
        let corners = self.corners.get(..self.elements_end()).unwrap_or(&[]);
        Elements { corners, pens: self.pens() }
    }

    /// Returns the index at which the corners of the elements end.
    fn elements_end(&self) -> usize {
        self.curves.start - RUN * self.runs
    }

    /// Returns the pens of the elements.
    fn pens(&self) -> Pens<'_> {
        let runs = self.corners.get(self.elements_end()..self.curves.start).unwrap_or(&[]);
        Pens::new(bytemuck::cast_slice(runs))
    }

    /// Chooses the pen of the elements and curves that follow, by a `usemtl` or a `g` statement.
    /// The first `usemtl` makes all `g` statements void: later ones are ignored, and elements whose
    /// pen an earlier one chose get the first pen again.
    ///
    /// # Errors
    /// [`ModelError::TooManyPens`]; the model is unchanged.
    // Not inlined, so that its stack frame is not below those of the stages.
    #[inline(never)]
    pub fn choose_pen(
        &mut self,
        by_material: bool,
        name: PenName,
        before: Before<'_>,
    ) -> Result<(), ModelError> {
        if self.pens.by_material && !by_material {
            return Ok(());
        }
        let mut book = self.pens;
        if by_material != book.by_material {
            book = PenBook { by_material, ..PenBook::default() };
        }
        book.choose(name)?;
        if book != self.pens {
            before(self);
            if book.by_material != self.pens.by_material {
                self.remove_halves(self.elements_end()..self.curves.start);
                self.runs = 0;
                self.curves.forget_pens(self.corners);
            }
            self.pens = book;
        }
        Ok(())
    }

    /// Returns the curves.
    pub fn curves(&self) -> Curves<'_> {
        self.curves.curves(self.corners)
    }

    /// Returns the number of faces.
    pub fn face_count(&self) -> usize {
        self.faces
    }

    /// Returns the number of bars.
    pub fn bar_count(&self) -> usize {
        self.bars
    }

    /// Returns the number of curves.
    pub fn curve_count(&self) -> usize {
        self.curves.count
    }

    /// Returns the greatest number of vertices.
    pub fn vertex_limit(&self) -> usize {
        self.vertices.capacity().min(VERTEX_NUMBER_LIMIT)
    }

    /// Returns the number of 16-bit units in use: corners of elements, and the half-words of curves
    /// and of pen changes.
    pub fn corner_count(&self) -> usize {
        self.corners.len()
    }

    /// Returns the greatest number of these units.
    pub fn corner_limit(&self) -> usize {
        self.corners.capacity()
    }

    /// Adds a vertex. Its coordinates are rounded towards zero to 30 bits of the model's largest
    /// coordinate, so that equal coordinates stay equal whatever comes between them.
    ///
    /// # Errors
    /// [`ModelError::TooManyVertices`], [`ModelError::CoordinateTooLarge`]; the model is unchanged.
    pub fn add_vertex(
        &mut self,
        coordinates: [Decimal; 3],
        before: Before<'_>,
    ) -> Result<(), ModelError> {
        let limit = self.vertex_limit();
        if self.vertices.len() >= limit {
            return Err(ModelError::TooManyVertices { limit });
        }
        let place = self.place(coordinates, before)?;
        self.vertices.push(place).map_err(|_| ModelError::TooManyVertices { limit })
    }

    /// Converts coordinates to the model's unit, which is made coarser if necessary.
    fn place(
        &mut self,
        coordinates: [Decimal; 3],
        before: Before<'_>,
    ) -> Result<Position, ModelError> {
        let fraction_bits = (0..=self.fraction_bits)
            .rev()
            .find(|bits| {
                coordinates.iter().all(|coordinate| {
                    coordinate
                        .to_binary_truncated(*bits)
                        .is_ok_and(|value| value.unsigned_abs() <= POSITION_LIMIT as u64)
                })
            })
            .ok_or(ModelError::CoordinateTooLarge)?;
        let [x, y, z] = coordinates.map(|coordinate| {
            // It is in range, because the search above tried it.
            coordinate
                .to_binary_truncated(fraction_bits)
                .ok()
                .and_then(|value| i32::try_from(value).ok())
                .unwrap_or(0)
        });
        before(self);
        self.coarsen(self.fraction_bits - fraction_bits);
        self.rounding.write(&coordinates);
        Ok(Position { x, y, z })
    }

    /// Makes the unit coarser by a factor of 2^`bits`, and converts all vertices to it.
    fn coarsen(&mut self, bits: u32) {
        if bits == 0 {
            return;
        }
        let unit = 1 << bits; // at most 2^FINEST_FRACTION_BITS
        for vertex in self.vertices.iter_mut() {
            *vertex = Position { x: vertex.x / unit, y: vertex.y / unit, z: vertex.z / unit };
        }
        self.rounding.coarsen(bits);
        self.fraction_bits -= bits;
    }

    /// Adds a face through vertices numbered as in OBJ: from 1, or from -1 backwards for the last
    /// ones.
    ///
    /// It is an error if a corner is repeated immediately, or if the last corner repeats the first.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn add_face(
        &mut self,
        numbers: impl Iterator<Item = i32> + Clone,
        before: Before<'_>,
    ) -> Result<(), ModelError> {
        let count = self.check_numbers(numbers.clone(), 3)?;
        let first = numbers.clone().next();
        let last = numbers.clone().last();
        if let (Some(first), Some(last)) = (first, last)
            && self.resolve(first) == self.resolve(last)
        {
            return Err(ModelError::RepeatedVertex { number: last });
        }
        self.check_corners(count + self.run_for(self.pens.current))?;
        before(self);
        self.begin_run(self.pens.current);
        for (at, number) in numbers.enumerate() {
            self.push_corner(number, false, at + 1 == count)?;
        }
        self.faces += 1;
        Ok(())
    }

    /// Adds the bars of a polyline through vertices numbered as in OBJ.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn add_polyline(
        &mut self,
        numbers: impl Iterator<Item = i32> + Clone,
        before: Before<'_>,
    ) -> Result<(), ModelError> {
        let count = self.check_numbers(numbers.clone(), 2)?;
        self.check_corners(2 * (count - 1) + self.run_for(self.pens.current))?;
        before(self);
        self.begin_run(self.pens.current);
        for (from, to) in numbers.clone().zip(numbers.skip(1)) {
            self.push_corner(from, true, false)?;
            self.push_corner(to, true, true)?;
            self.bars += 1;
        }
        Ok(())
    }

    /// Returns how many numbers there are, if each names a vertex and differs from the one before.
    fn check_numbers(
        &self,
        numbers: impl Iterator<Item = i32>,
        needed: usize,
    ) -> Result<usize, ModelError> {
        let mut count = 0;
        let mut previous = None;
        for number in numbers {
            let vertex = self
                .resolve(number)
                .ok_or(ModelError::UnknownVertex { number, vertices: self.vertices.len() })?;
            if previous == Some(vertex) {
                return Err(ModelError::RepeatedVertex { number });
            }
            previous = Some(vertex);
            count += 1;
        }
        if count < needed { Err(ModelError::TooFewCorners { needed }) } else { Ok(count) }
    }

    /// Checks that there is room for `count` more half-words.
    fn check_corners(&self, count: usize) -> Result<(), ModelError> {
        let limit = self.corner_limit();
        let needed = self.corners.len().saturating_add(count);
        if needed > limit { Err(ModelError::TooManyCorners { limit, needed }) } else { Ok(()) }
    }

    /// Appends a corner to the elements, by its OBJ number.
    fn push_corner(&mut self, number: i32, of_bar: bool, last: bool) -> Result<(), ModelError> {
        let vertex = self
            .resolve(number)
            .ok_or(ModelError::UnknownVertex { number, vertices: self.vertices.len() })?;
        self.insert(Corner::new(vertex, of_bar, last))
    }

    /// Inserts a corner after those of the elements.
    fn insert(&mut self, corner: Corner) -> Result<(), ModelError> {
        self.insert_half(self.elements_end(), corner.0)
    }

    /// Inserts a half-word at a position before the curves.
    fn insert_half(&mut self, at: usize, half: u16) -> Result<(), ModelError> {
        let limit = self.corner_limit();
        self.corners
            .push(Corner(half))
            .map_err(|_| ModelError::TooManyCorners { limit, needed: limit + 1 })?;
        self.corners.get_mut(at..).unwrap_or(&mut []).rotate_right(1);
        self.curves.start += 1;
        Ok(())
    }

    /// Removes half-words that are before the curves.
    fn remove_halves(&mut self, gone: Range<usize>) {
        let count = self.corners.len();
        self.corners.copy_within(gone.end..count, gone.start);
        self.corners.truncate(count - gone.len());
        self.curves.start -= gone.len();
    }

    /// Returns how many half-words are needed so that elements with this pen can follow.
    fn run_for(&self, pen: u8) -> usize {
        if pen == self.pens().last() { 0 } else { RUN }
    }

    /// Records that elements with this pen follow. There must be room.
    fn begin_run(&mut self, pen: u8) {
        if pen != self.pens().last() {
            let first = self.elements_end() as u16; // the memory has fewer half-words than 2^16
            for half in [first, pen.into()] {
                let _ = self.insert_half(self.curves.start, half);
            }
            self.runs += 1;
        }
    }

    /// Sets the degree of the curves that follow, 1 to 5.
    ///
    /// # Errors
    /// [`ModelError::Curve`]; the model is unchanged.
    pub fn set_degree(&mut self, degree: u8) -> Result<(), ModelError> {
        self.curves.set_degree(degree)
    }

    /// Begins a curve between two parameter values (`ends`) over control points numbered as in OBJ.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn begin_curve(
        &mut self,
        ends: [Decimal; 2],
        numbers: impl Iterator<Item = i32> + Clone,
    ) -> Result<(), ModelError> {
        let vertices = self.vertices.len();
        let resolve = |number| resolve(number, vertices);
        if let Some(number) = numbers.clone().find(|number| resolve(*number).is_none()) {
            return Err(ModelError::UnknownVertex { number, vertices });
        }
        self.curves.begin(self.corners, ends, numbers.filter_map(resolve), self.pens.current)
    }

    /// Adds knots to the unfinished curve.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn add_knots(
        &mut self,
        knots: impl Iterator<Item = Decimal> + Clone,
    ) -> Result<(), ModelError> {
        self.curves.add_knots(self.corners, knots)
    }

    /// Completes the unfinished curve. If it is refused it is discarded.
    ///
    /// # Errors
    /// [`ModelError::NoCurve`], [`ModelError::KnotTooLarge`], [`ModelError::Curve`].
    pub fn end_curve(&mut self, before: Before<'_>) -> Result<(), ModelError> {
        self.curves.end(self.corners)?;
        before(self);
        self.curves.count_in(self.corners.len());
        Ok(())
    }

    /// Returns the vertex that an OBJ number names.
    fn resolve(&self, number: i32) -> Option<u16> {
        resolve(number, self.vertices.len())
    }

    /// Returns the smallest box around all vertices (the least and the greatest of each
    /// coordinate), or `None` if there are none.
    pub fn bounds(&self) -> Option<(Position, Position)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(low, high), vertex| {
            (
                Position { x: low.x.min(vertex.x), y: low.y.min(vertex.y), z: low.z.min(vertex.z) },
                Position {
                    x: high.x.max(vertex.x),
                    y: high.y.max(vertex.y),
                    z: high.z.max(vertex.z),
                },
            )
        }))
    }

    /// Whether this is a plan: it has only bars and curves, and all vertices are at one height.
    pub fn is_plan(&self) -> bool {
        self.faces == 0
            && self.bars + self.curves.count > 0
            && self.bounds().is_some_and(|(low, high)| low.z == high.z)
    }
}

/// Returns the vertex that an OBJ number names in a model with so many vertices.
fn resolve(number: i32, vertices: usize) -> Option<u16> {
    let count = vertices as i64; // at most VERTEX_NUMBER_LIMIT
    let index = if number < 0 { count + i64::from(number) } else { i64::from(number) - 1 };
    if (0..count).contains(&index) { u16::try_from(index).ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Vertices = heapless::Vec<Position, 4>;
    type Corners = heapless::Vec<Corner, 8>;

    fn decimals(texts: [&str; 3]) -> [Decimal; 3] {
        texts.map(|text| Decimal::parse(text).unwrap())
    }

    fn with_vertices(count: usize, test: impl FnOnce(&mut Model<'_>)) {
        let (mut vertices, mut corners) = (Vertices::new(), Corners::new());
        let mut model = Model::new(&mut vertices, &mut corners);
        for _ in 0..count {
            model.add_vertex(decimals(["0.25", "-0.5", "0"]), &mut unkept).unwrap();
        }
        test(&mut model);
    }

    #[test]
    fn a_larger_coordinate_coarsens_the_unit_for_all() {
        with_vertices(1, |model| {
            assert_eq!(model.fraction_bits(), 30);
            model.add_vertex(decimals(["100", "0", "0.1"]), &mut unkept).unwrap();
            assert_eq!(model.fraction_bits(), 23);
            assert_eq!(model.vertices()[0], Position { x: 1 << 21, y: -(1 << 22), z: 0 });
            assert_eq!(model.vertices()[1].x, 100 << 23);
        });
    }

    #[test]
    fn equal_coordinates_stay_equal_when_the_unit_coarsens() {
        with_vertices(0, |model| {
            let place = ["0.123456789", "-0.7", "0.3"];
            for place in [place, ["9", "0", "0"], ["-700", "0", "0"], place] {
                model.add_vertex(decimals(place), &mut unkept).unwrap();
            }
            assert_eq!(model.vertices()[0], model.vertices()[3]);
        });
    }

    #[test]
    fn refused_vertices_change_nothing() {
        with_vertices(3, |model| {
            assert_eq!(
                model.add_vertex(decimals(["1e10", "0", "0"]), &mut unkept),
                Err(ModelError::CoordinateTooLarge)
            );
            assert_eq!((model.vertices().len(), model.fraction_bits()), (3, 30));
            model.add_vertex(decimals(["0", "0", "0"]), &mut unkept).unwrap();
            assert_eq!(
                model.add_vertex(decimals(["9", "0", "0"]), &mut unkept),
                Err(ModelError::TooManyVertices { limit: 4 })
            );
            assert_eq!((model.vertices().len(), model.fraction_bits()), (4, 30));
        });
    }

    #[test]
    fn refused_elements_change_nothing() {
        with_vertices(4, |model| {
            let unknown = |number| Err(ModelError::UnknownVertex { number, vertices: 4 });
            for number in [0, 5, -5, i32::MIN, i32::MAX] {
                assert_eq!(
                    model.add_face([1, 2, number].into_iter(), &mut unkept),
                    unknown(number)
                );
                assert_eq!(
                    model.add_polyline([1, number].into_iter(), &mut unkept),
                    unknown(number)
                );
            }
            assert_eq!(
                model.add_face([1, 2].into_iter(), &mut unkept),
                Err(ModelError::TooFewCorners { needed: 3 })
            );
            assert_eq!(
                model.add_polyline([1].into_iter(), &mut unkept),
                Err(ModelError::TooFewCorners { needed: 2 })
            );
            assert_eq!(
                model.add_face([1, 2, 2].into_iter(), &mut unkept),
                Err(ModelError::RepeatedVertex { number: 2 })
            );
            assert_eq!(
                model.add_face([1, 2, 3, -4].into_iter(), &mut unkept),
                Err(ModelError::RepeatedVertex { number: -4 })
            );
            assert_eq!(
                model.add_face([1, 2, 3, 1, 2, 3, 1, 2, 3].into_iter(), &mut unkept),
                Err(ModelError::TooManyCorners { limit: 8, needed: 9 })
            );
            assert_eq!((model.corner_count(), model.face_count(), model.bar_count()), (0, 0, 0));
        });
    }

    #[test]
    fn elements_come_back_as_they_were_sent() {
        with_vertices(4, |model| {
            model.add_polyline([1, 2, -1].into_iter(), &mut unkept).unwrap();
            model.add_face([-4, -3, -2, -1].into_iter(), &mut unkept).unwrap();
            let mut elements = model.elements().iter();
            assert_eq!(elements.next(), Some(Element::Bar(0, 1)));
            assert_eq!(elements.next(), Some(Element::Bar(1, 3)));
            let Some(Element::Face(corners)) = elements.next() else { panic!("a face was sent") };
            assert!(corners.iter().map(|corner| corner.vertex()).eq(0..4));
            assert_eq!(elements.next(), None);
            assert_eq!((model.face_count(), model.bar_count()), (1, 2));
            assert!(!model.is_plan());
        });
    }

    #[test]
    fn bars_at_one_height_are_a_plan() {
        with_vertices(2, |model| {
            assert!(!model.is_plan());
            model.add_polyline([1, 2].into_iter(), &mut unkept).unwrap();
            assert!(model.is_plan());
            model.add_vertex(decimals(["0", "0", "1"]), &mut unkept).unwrap();
            assert!(!model.is_plan());
        });
    }
}
