//! Finds the faces that need not be tested against edges behind them, because another face of the
//! same solid hides as much.
//!
//! A solid is a run of elements, in the order of the model, whose sides cancel: each side belongs
//! to as many faces that run along it in one direction as in the other. On the page, such a chain
//! of triangles without boundary covers each point equally often in both senses (its degree is
//! zero). So, for an edge that lies behind the whole solid, each point that a clockwise triangle
//! covers is also covered by an anticlockwise one, and all of them are nearer. It does not matter
//! whether the solid is convex, inside out or bent by rounding.
//!
//! It costs four bytes for each corner, and one pass over the model. Only a computer does it.

use super::VisibilityError;
use super::edges::sides;
use super::scene_index::SceneIndex;
use super::sheet::OpenSides;
use super::yield_counter::YieldCounter;
use crate::geometry::COORDINATE_LIMIT;
use crate::index::Index;

/// Faces whose other faces hide as much as they do.
#[derive(Debug, Default)]
pub struct Solids<'a> {
    /// For each face, at the number of its first corner: the greatest depth of its solid, if no
    /// edge behind that needs to be tested against the face. It is [`NEVER`] for all others.
    depths: &'a [i32],
}

/// A depth that no edge lies behind.
const NEVER: i32 = i32::MAX;

impl<'a> Solids<'a> {
    /// Finds the faces that need not be tested. There is an item of `depths` for each corner.
    ///
    /// # Errors
    /// Returns an error if the user cancels.
    pub fn find<I: Index>(
        around: &SceneIndex<'_, I>,
        depths: &'a mut [i32],
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        depths.fill(NEVER);
        // While solids are looked for, the sense in which it turns stands at a face whose triangles
        // are a fan and therefore bounded by its sides. Those of other faces may not be.
        for (rank, &facing) in around.facings.iter().enumerate() {
            let face = around.faces.get(rank);
            if let Some(depth) = depths.get_mut(face.first).filter(|_| face.is_fan) {
                *depth = facing.into();
            }
        }
        let (mut begin, mut far) = (0, -COORDINATE_LIMIT);
        let mut open = OpenSides::new();
        for (first, corners) in around.outlines.elements() {
            yield_counter.spend(200 * corners.len())?;
            let is_fan = depths.get(first).is_some_and(|&facing| facing != NEVER);
            let end = first + corners.len();
            let is_open = !is_fan
                || sides(corners).any(|(_, a, b)| {
                    far = far.max(around.coarse_projection.vertex(a).z);
                    open.meet([a, b]).is_none()
                });
            if is_open || open.sides().is_empty() {
                for depth in depths.get_mut(begin..end).into_iter().flatten() {
                    *depth = if !is_open && *depth == -1 { far } else { NEVER };
                }
                (begin, far) = (end, -COORDINATE_LIMIT);
                open = OpenSides::new();
            }
        }
        // The last run has no end.
        depths.iter_mut().skip(begin).for_each(|depth| *depth = NEVER);
        Ok(Self { depths })
    }

    /// Whether another face hides as much of an edge as the face that begins at corner `first`, if
    /// no point of the edge is nearer than `near`.
    #[inline]
    pub fn spare(&self, first: usize, near: i32) -> bool {
        // A face must be nearer by more than one unit to hide an edge wherever it is.
        self.depths.get(first).is_some_and(|&depth| depth < near - 1)
    }
}
