//! A model in memory or in flash, as the tiles read it.

use super::{ModelSource, ViewParameters};
use crate::geometry::{Precision, Vertex};
use crate::index::Index;
use crate::model::{Corner, Elements, Model, Position, StoredModel};
use crate::view::View;

/// A model in memory, seen through a camera. Its curves are left out.
#[derive(Debug, Clone, Copy)]
pub struct Projected<'m, I> {
    /// The positions of its vertices.
    positions: &'m [Position],
    /// Its faces and bars.
    elements: Elements<'m, I>,
    /// The camera.
    view: &'m View,
}

impl<'m, I: Index> Projected<'m, I> {
    /// Makes the source of a model.
    pub fn new(model: &'m Model<'_, I>, view: &'m View) -> Self {
        Self { positions: model.vertices(), elements: model.elements(), view }
    }

    /// Returns the parameters of the view of a model whose positions have this precision.
    pub fn parameters(&self, precision: Precision) -> ViewParameters {
        ViewParameters::new(self.view, precision)
    }
}

impl ViewParameters {
    /// Returns the parameters of a view of a model whose positions have this precision.
    pub fn new(view: &View, precision: Precision) -> Self {
        Self {
            projection: view.projection(),
            near: view.near(),
            precision,
            error_bound: view.error_bound(precision.written),
        }
    }
}

impl<I: Index> ModelSource for Projected<'_, I> {
    fn corner_count(&self) -> usize {
        self.elements.corners().len()
    }

    fn corner(&self, index: usize) -> Corner<u32> {
        let corner = self.elements.corners().get(index);
        corner.map_or(Corner::new(0, false, true), |corner| {
            Corner::new(corner.vertex().into(), corner.of_bar(), corner.is_last())
        })
    }

    fn pen(&self, corner: usize) -> u8 {
        self.elements.pens().at(corner)
    }

    fn position(&self, vertex: u32) -> Option<Position> {
        // A model has every vertex that its elements name.
        Some(self.positions.get(vertex as usize).copied().unwrap_or_default())
    }

    fn vertex(&self, vertex: u32) -> Vertex {
        self.view.vertex(self.positions.get(vertex as usize).copied().unwrap_or_default())
    }
}

/// A model in flash, seen through a camera.
#[derive(Debug, Clone, Copy)]
pub struct ProjectedStored<'m, 'f> {
    /// The model.
    model: &'m StoredModel<'f>,
    /// The camera.
    view: &'m View,
}

impl<'m, 'f> ProjectedStored<'m, 'f> {
    /// Makes the source of a model.
    pub fn new(model: &'m StoredModel<'f>, view: &'m View) -> Self {
        Self { model, view }
    }
}

impl ModelSource for ProjectedStored<'_, '_> {
    fn corner_count(&self) -> usize {
        self.model.corner_count()
    }

    fn corner(&self, index: usize) -> Corner<u32> {
        self.model.corner(index)
    }

    fn pen(&self, corner: usize) -> u8 {
        self.model.pen(corner)
    }

    fn position(&self, vertex: u32) -> Option<Position> {
        Some(self.model.position(vertex as usize))
    }

    fn vertex(&self, vertex: u32) -> Vertex {
        self.view.vertex(self.model.position(vertex as usize))
    }
}
