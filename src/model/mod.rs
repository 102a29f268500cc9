//! The model that the user sent: its vertices, bars, faces and curves, and the edits of them.
//!
//! A [`Model`] holds vertices in one array and faces and bars in another, in the order in which
//! they came (Cárdenas & Seeley's joints and bars in two sequential arrays); the second also holds
//! the pens and the curves. It refuses whatever would make it invalid, such as a face through a
//! vertex that does not exist or more than fits in the memory; it is then unchanged.
//! [`Model::edit`] changes it, and [`Model::restore`] undoes a change.

mod checksum;
mod curves;
mod edit;
mod elements;
mod error;
mod pens;
mod positions;
mod precision;
mod sources;
mod store;
#[cfg(feature = "tiles")]
mod stored;
mod undo;
#[cfg(feature = "tiles")]
mod upload;
mod vertices;

pub use curves::{Curves, StoredCurve};
pub use edit::{Change, Edit, ElementKind, Numbers};
pub use elements::{Corner, Element, Elements};
pub use error::ModelError;
pub use pens::{PEN_LIMIT, PenBook, PenName, PenRun, PenWriter, Pens};
pub use positions::{POSITION_LIMIT, Position, Positions};
pub use sources::VertexSources;
#[cfg(feature = "tiles")]
pub use stored::StoredModel;
#[cfg(feature = "tiles")]
pub use upload::{Upload, UploadError};

use crate::fixed::Decimal;
use crate::index::Index;
use curves::CurveList;
use pens::RUN;
use positions::truncated;
use precision::Rounding;
use store::Store;
use vertices::Vertices;

/// The finest unit of a model is 2^-30, with which |coordinate| is at most 1.
const FINEST_FRACTION_BITS: u32 = 30;

/// A callback that gets the model just before a change that will succeed, and is never called when
/// a change is refused. It may copy the model with [`Model::save`].
pub type BeforeChange<'b, I> = &'b mut dyn FnMut(&Model<'_, I>);

/// Does nothing. Pass it as a [`BeforeChange`] where a change need not be undone.
pub fn no_undo<I: Index>(_: &Model<'_, I>) {}

/// The vertices, faces, bars and curves that the user sent, in memory lent by the owner.
///
/// All coordinates share one binary unit. It is 2^-30 at first and becomes coarser when a larger
/// coordinate comes, so that a model of any size keeps 30 bits of its largest coordinate.
#[derive(Debug)]
pub struct Model<'m, I = u16> {
    /// The positions of the vertices, in the order in which they were sent.
    vertices: Vertices<'m>,
    /// The corners of the elements, their [`PenRun`]s and the curves.
    store: Store<'m, I>,
    /// The unit of every coordinate is 2^-`fraction_bits`; from 0 to 30.
    fraction_bits: u32,
    /// How far the coordinates may be off, which decides which points count as coplanar.
    rounding: Rounding,
    /// The number of faces that the model has.
    faces: usize,
    /// The number of bars that the model has.
    bars: usize,
    /// Where in `store` the curves lie, and the one that is still being sent.
    curves: CurveList,
    /// The pen of the elements that follow, and the names of the pens.
    pens: PenBook,
}

impl<'m, I: Index> Model<'m, I> {
    /// Makes an empty model that can hold as many vertices as the first slice has, and as many
    /// corners as the slice has. Their contents are discarded.
    pub fn new(vertices: &'m mut [Position], corners: &'m mut [Corner<I>]) -> Self {
        Self {
            vertices: Vertices::new(vertices),
            store: Store::new(corners),
            fraction_bits: FINEST_FRACTION_BITS,
            rounding: Rounding::default(),
            faces: 0,
            bars: 0,
            curves: CurveList::default(),
            pens: PenBook::default(),
        }
    }

    /// The memory for vertices, which others may use while the model is empty. It is empty if the
    /// model is not.
    #[cfg(feature = "tiles")]
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub fn spare_words(&mut self) -> &mut [u64] {
        let (_, words, _) = bytemuck::pod_align_to_mut(self.vertices.spare());
        words
    }

    /// Removes all vertices, elements, curves and pens.
    pub fn clear(&mut self) {
        self.vertices.truncate(0);
        self.store.clear();
        self.fraction_bits = FINEST_FRACTION_BITS;
        self.rounding = Rounding::default();
        self.faces = 0;
        self.bars = 0;
        self.curves = CurveList::default();
        self.pens = PenBook::default();
    }

    /// Returns the vertices, in units of 2^-[`Model::fraction_bits`].
    pub fn vertices(&self) -> &[Position] {
        &self.vertices
    }

    /// Returns the number of fraction bits, 0 to 30: the unit of every coordinate is 2^-this.
    pub fn fraction_bits(&self) -> u32 {
        self.fraction_bits
    }

    /// Returns the faces and bars.
    pub fn elements(&self) -> Elements<'_, I> {
        Elements { corners: self.store.corners(), pens: self.pens() }
    }

    /// Returns which pen draws each element.
    fn pens(&self) -> Pens<'_, I> {
        Pens::new(self.store.pen_runs())
    }

    /// Chooses the pen of the elements and curves that follow, by a `usemtl` or a `g` statement.
    /// The first `usemtl` makes all `g` statements void: later ones are ignored, and elements whose
    /// pen an earlier one chose get the first pen again.
    ///
    /// # Errors
    /// [`ModelError::TooManyPens`]; the model is unchanged.
    // Not inlined, so that its variables take no stack while a job is computed.
    #[inline(never)]
    pub fn choose_pen(
        &mut self,
        by_material: bool,
        name: PenName,
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let book = self.pens.after(by_material, name)?;
        if book != self.pens {
            before(self);
            if book.by_material != self.pens.by_material {
                self.store.truncate_pen_runs(0);
                self.curves.forget_pens(&mut self.store);
            }
            self.pens = book;
        }
        Ok(())
    }

    /// Returns the completed curves.
    pub fn curves(&self) -> Curves<'_, I> {
        self.curves.curves(&self.store)
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

    /// Returns the greatest number of vertices that the model can hold.
    pub fn vertex_limit(&self) -> usize {
        self.vertices.capacity().min(<Corner<I>>::VERTEX_NUMBER_LIMIT)
    }

    /// Returns the number of 16-bit units in use: corners of elements, and the half-words of curves
    /// and of pen changes.
    pub fn corner_count(&self) -> usize {
        self.store.used()
    }

    /// Returns the same for a model whose numbers have the width of `J`. Curves take fewer numbers
    /// of 32 bits than of 16.
    pub fn corner_count_of<J: Index>(&self) -> usize {
        let curves = self.curves();
        let (mut here, mut there) = (0, 0);
        for curve in curves.iter() {
            here += curve.length();
            there += curve.length_of::<J>();
        }
        self.store.used() - here + there
    }

    /// Returns the greatest number of these 16-bit units that the model can hold.
    pub fn corner_limit(&self) -> usize {
        self.store.capacity()
    }

    /// Adds a vertex. Its coordinates are rounded towards zero to 30 bits of the model's largest
    /// coordinate, so that equal coordinates stay equal whatever comes between them.
    ///
    /// # Errors
    /// [`ModelError::TooManyVertices`], [`ModelError::CoordinateTooLarge`]; the model is unchanged.
    pub fn add_vertex(
        &mut self,
        coordinates: [Decimal; 3],
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let limit = self.vertex_limit();
        if self.vertices.len() >= limit {
            return Err(ModelError::TooManyVertices { limit });
        }
        let position = self.position(coordinates, before)?;
        self.vertices.push(position).ok_or(ModelError::TooManyVertices { limit })
    }

    /// Converts coordinates to the model's unit, which is made coarser if necessary.
    fn position(
        &mut self,
        coordinates: [Decimal; 3],
        before: BeforeChange<'_, I>,
    ) -> Result<Position, ModelError> {
        let (position, fraction_bits) = truncated(coordinates, self.fraction_bits)?;
        before(self);
        self.coarsen(self.fraction_bits - fraction_bits);
        self.rounding.write(&coordinates);
        Ok(position)
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
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let count = self.check_numbers(numbers.clone(), 3)?;
        self.store.check_room(count + self.run_for(self.pens.current))?;
        before(self);
        self.begin_run(self.pens.current)?;
        let vertices = self.vertices.len();
        let corners = self.store.add_corners(count)?;
        for (corner, vertex) in corners.iter_mut().zip(numbers.filter_map(|n| resolve(n, vertices)))
        {
            *corner = Corner::new(vertex, false, false);
        }
        if let Some(last) = corners.last_mut() {
            *last = Corner::new(last.vertex(), false, true);
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
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let count = self.check_numbers(numbers.clone(), 2)?;
        let bars = count - 1;
        self.store.check_room(2 * bars + self.run_for(self.pens.current))?;
        before(self);
        self.begin_run(self.pens.current)?;
        let vertices = self.vertices.len();
        let mut corners = self.store.add_corners(2 * bars)?.chunks_exact_mut(2);
        let mut last = None;
        for to in numbers.filter_map(|number| resolve(number, vertices)) {
            if let Some(from) = last.replace(to)
                && let Some(bar) = corners.next()
            {
                bar.copy_from_slice(&[Corner::new(from, true, false), Corner::new(to, true, true)]);
            }
        }
        self.bars += bars;
        Ok(())
    }

    /// Returns how many numbers there are, if each names a vertex and differs from the one before.
    /// Where three are `needed`, for a face, the last must also differ from the first.
    fn check_numbers(
        &self,
        numbers: impl Iterator<Item = i32>,
        needed: usize,
    ) -> Result<usize, ModelError> {
        check_numbers::<I>(numbers, needed, self.vertices.len())
    }

    /// Returns how many half-words of memory it takes to let elements with this pen follow: none if
    /// the last one has it already.
    fn run_for(&self, pen: u8) -> usize {
        if pen == self.pens().last() { 0 } else { RUN }
    }

    /// Records that elements with this pen follow.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`]; nothing is changed.
    fn begin_run(&mut self, pen: u8) -> Result<(), ModelError> {
        if pen != self.pens().last() {
            let run = PenRun::new(self.store.corners().len(), pen);
            self.store.add_pen_runs(1)?.fill(run);
        }
        Ok(())
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
        self.curves.begin(&mut self.store, ends, numbers.filter_map(resolve), self.pens.current)
    }

    /// Adds knots to the unfinished curve.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn add_knots(
        &mut self,
        knots: impl Iterator<Item = Decimal> + Clone,
    ) -> Result<(), ModelError> {
        self.curves.add_knots(&mut self.store, knots)
    }

    /// Completes the unfinished curve. If it is refused it is discarded.
    ///
    /// # Errors
    /// [`ModelError::NoCurve`], [`ModelError::KnotTooLarge`], [`ModelError::Curve`].
    pub fn end_curve(&mut self, before: BeforeChange<'_, I>) -> Result<(), ModelError> {
        self.curves.end(&mut self.store)?;
        before(self);
        self.curves.count_completed(&self.store);
        Ok(())
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

    /// Whether a curve has begun that has not ended. It is not among [`Model::curves`].
    pub fn has_unfinished_curve(&self) -> bool {
        self.curves.is_unfinished()
    }

    /// Whether this is a plan: it has only bars and curves, and all vertices are at one height.
    pub fn is_plan(&self) -> bool {
        self.faces == 0
            && self.bars + self.curves.count > 0
            && self.bounds().is_some_and(|(low, high)| low.z == high.z)
    }
}

/// Returns how many numbers there are, if each names one of this many vertices and differs from the
/// one before. Where three are `needed`, for a face, the last must also differ from the first.
#[inline(always)] // On a board with little flash it has one caller.
fn check_numbers<I: Index>(
    numbers: impl Iterator<Item = i32>,
    needed: usize,
    vertices: usize,
) -> Result<usize, ModelError> {
    let (mut count, mut first, mut last) = (0, None, None);
    for number in numbers {
        let vertex =
            resolve::<I>(number, vertices).ok_or(ModelError::UnknownVertex { number, vertices })?;
        if last.replace((vertex, number)).is_some_and(|(before, _)| before == vertex) {
            return Err(ModelError::RepeatedVertex { number });
        }
        first = first.or(Some(vertex));
        count += 1;
    }
    match last {
        _ if count < needed => Err(ModelError::TooFewCorners { needed }),
        Some((vertex, number)) if needed > 2 && first == Some(vertex) => {
            Err(ModelError::RepeatedVertex { number })
        }
        _ => Ok(count),
    }
}

/// Returns the vertex that an OBJ number names in a model with this many vertices.
fn resolve<I: Index>(number: i32, vertices: usize) -> Option<I> {
    let count = vertices as i64; // at most the limit of a corner
    let index = if number < 0 { count + i64::from(number) } else { i64::from(number) - 1 };
    if (0..count).contains(&index) { Some(I::new(index as usize)) } else { None }
}

#[cfg(test)]
mod tests;
