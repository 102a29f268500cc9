//! Writes a model that is too large for the memory to flash while it arrives.

use super::pens::PenBook;
use super::stored::{CORNER_BYTES, ModelSummary, Units, VERTEX_LIMIT, coarser_position, packed};
use super::{
    Corner, Element, FINEST_FRACTION_BITS, Model, ModelError, PenName, Position, StoredModel,
    check_numbers, resolve, truncated,
};
use crate::fixed::Decimal;
use crate::index::Index;
use crate::storage::area::{Area, AreaFlash, AreaWriter, NotWritten, Side};

/// The reasons why a part of a model was not written to flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UploadError {
    /// The model refuses it. All that came before is still there.
    Model(ModelError),
    /// The flash does not take it. What came before is lost.
    Flash,
}

impl From<ModelError> for UploadError {
    fn from(error: ModelError) -> Self {
        Self::Model(error)
    }
}

impl From<NotWritten> for UploadError {
    fn from(NotWritten: NotWritten) -> Self {
        Self::Flash
    }
}

/// A model whose parts are written to flash one after the other, as they come. It has vertices,
/// faces, bars and pens, but no curves. It counts once [`Upload::finish`] has written its record.
///
/// The flash and the area must be the same at each call.
#[derive(Debug)]
pub struct Upload {
    /// What has been written.
    writer: AreaWriter,
    /// The number of vertices.
    vertices: usize,
    /// The number of corners.
    corners: usize,
    /// What the record will say.
    summary: ModelSummary,
    /// The pen of the elements that follow, and the names of the pens.
    pens: PenBook,
}

impl Upload {
    /// Removes the model that the area holds, and begins a new one with all that `model` has.
    ///
    /// # Errors
    /// [`UploadError::Flash`]; the area is then empty, or still holds its model.
    /// [`ModelError::StoreFull`] if there is no area, or not even this fits; nothing is changed.
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn begin<I: Index>(
        model: &Model<'_, I>,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<Self, UploadError> {
        let corners = model.elements().corners().len();
        let needed = size_of_val(model.vertices()) + corners * CORNER_BYTES;
        if needed + 4 * crate::storage::PAGE_BYTES > area.bytes() {
            return Err(ModelError::StoreFull { vertices: 0, corners: 0 }.into());
        }
        let writer = AreaWriter::begin(area, flash)?;
        let mut upload = Self {
            writer,
            vertices: 0,
            corners: 0,
            summary: ModelSummary {
                faces: 0,
                bars: 0,
                rounding: model.rounding,
                pens: 0,
                void_before: 0,
                bounds: model.bounds().unwrap_or_default(),
                units: Units::new(model.fraction_bits()),
            },
            pens: model.pens,
        };
        for &position in model.vertices() {
            upload.put_vertex(position, area, flash)?;
        }
        for (element, pen) in model.elements().iter_with_pens() {
            match element {
                Element::Face(corners) => {
                    let vertices = corners.iter().map(|corner| corner.vertex().into());
                    upload.put_element(vertices, corners.len(), false, pen, area, flash)?;
                }
                Element::Bar(from, to) => {
                    let ends = [from.into(), to.into()].into_iter();
                    upload.put_element(ends, 2, true, pen, area, flash)?;
                }
            }
        }
        Ok(upload)
    }

    /// The numbers of vertices, faces, bars and corners that have come.
    pub fn counts(&self) -> [usize; 4] {
        [self.vertices, self.summary.faces, self.summary.bars, self.corners]
    }

    /// The error that there is no room.
    fn full(&self) -> ModelError {
        ModelError::StoreFull { vertices: self.vertices, corners: self.corners }
    }

    /// Adds a vertex.
    ///
    /// # Errors
    /// See [`UploadError`].
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn add_vertex(
        &mut self,
        coordinates: [Decimal; 3],
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), UploadError> {
        let (_, before) = self.summary.units.last();
        let (position, fraction_bits) = truncated(coordinates, before)?;
        if self.vertices >= VERTEX_LIMIT || !self.writer.has_room(area, size_of::<Position>(), 0) {
            return Err(self.full().into());
        }
        if fraction_bits < before {
            let (low, high) = &mut self.summary.bounds;
            for corner in [low, high] {
                *corner = coarser_position(*corner, before - fraction_bits);
            }
            self.summary.rounding.coarsen(before - fraction_bits);
            self.summary.units.coarsen(self.vertices, fraction_bits);
        }
        self.summary.rounding.write(&coordinates);
        let (low, high) = &mut self.summary.bounds;
        let Position { x, y, z } = position;
        *low = Position { x: low.x.min(x), y: low.y.min(y), z: low.z.min(z) };
        *high = Position { x: high.x.max(x), y: high.y.max(y), z: high.z.max(z) };
        self.put_vertex(position, area, flash)
    }

    /// Adds a face through vertices numbered as in OBJ, as [`Model::add_face`] does.
    ///
    /// # Errors
    /// See [`UploadError`].
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn add_face(
        &mut self,
        numbers: impl Iterator<Item = i32> + Clone,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), UploadError> {
        let count = check_numbers::<u32>(numbers.clone(), 3, self.vertices)?;
        if !self.writer.has_room(area, 0, count * CORNER_BYTES) {
            return Err(self.full().into());
        }
        let vertices = self.vertices;
        let numbers = numbers.filter_map(|number| resolve::<u32>(number, vertices));
        self.put_element(numbers, count, false, self.pens.current, area, flash)
    }

    /// Adds the bars of a polyline, as [`Model::add_polyline`] does.
    ///
    /// # Errors
    /// See [`UploadError`].
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn add_polyline(
        &mut self,
        numbers: impl Iterator<Item = i32> + Clone,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), UploadError> {
        let count = check_numbers::<u32>(numbers.clone(), 2, self.vertices)?;
        if !self.writer.has_room(area, 0, 2 * (count - 1) * CORNER_BYTES) {
            return Err(self.full().into());
        }
        let vertices = self.vertices;
        let mut last = None;
        for to in numbers.filter_map(|number| resolve::<u32>(number, vertices)) {
            if let Some(from) = last.replace(to) {
                let ends = [from, to].into_iter();
                self.put_element(ends, 2, true, self.pens.current, area, flash)?;
            }
        }
        Ok(())
    }

    /// Chooses the pen of the elements that follow, as [`Model::choose_pen`] does.
    ///
    /// # Errors
    /// [`ModelError::TooManyPens`].
    pub fn choose_pen(&mut self, by_material: bool, name: PenName) -> Result<(), UploadError> {
        let book = self.pens.after(by_material, name)?;
        if book.by_material != self.pens.by_material {
            self.summary.void_before = self.corners;
            self.summary.pens = u32::from(self.corners > 0);
        }
        self.pens = book;
        Ok(())
    }

    /// Writes the record, with which the model counts.
    ///
    /// # Errors
    /// [`UploadError::Flash`].
    #[inline(never)] // Its variables take no stack while a job is computed.
    pub fn finish<'f>(
        self,
        area: Area<'f>,
        flash: &mut dyn AreaFlash,
    ) -> Result<StoredModel<'f>, UploadError> {
        self.writer.finish(&self.summary.words(), area, flash)?;
        StoredModel::new(area).ok_or(UploadError::Flash)
    }

    /// Writes a vertex.
    fn put_vertex(
        &mut self,
        position: Position,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), UploadError> {
        for coordinate in position.coordinates() {
            self.writer.push(Side::Low, &coordinate.to_le_bytes(), area, flash)?;
        }
        self.vertices += 1;
        Ok(())
    }

    /// Writes an element with this many corners, at these vertices.
    fn put_element(
        &mut self,
        vertices: impl Iterator<Item = u32>,
        count: usize,
        of_bar: bool,
        pen: u8,
        area: Area<'_>,
        flash: &mut dyn AreaFlash,
    ) -> Result<(), UploadError> {
        for (number, vertex) in vertices.enumerate() {
            let corner = Corner::new(vertex, of_bar, number + 1 == count);
            self.writer.push(Side::High, &packed(corner, pen), area, flash)?;
        }
        self.corners += count;
        *(if of_bar { &mut self.summary.bars } else { &mut self.summary.faces }) += 1;
        self.summary.pens |= 1u32.checked_shl(pen.into()).unwrap_or(0);
        Ok(())
    }
}

const _: () = assert!(FINEST_FRACTION_BITS < 32);
