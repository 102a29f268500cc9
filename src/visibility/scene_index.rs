//! What the search for visible stretches knows about a scene, and what it asks of its faces.

use super::Report;
use super::coarse_projection::CoarseProjection;
use super::edges::{ChosenSides, Outlines};
use super::faces::{Face, Faces};
use super::raster::Bounds;
use super::seams::Extent;
#[cfg(feature = "threads")]
use super::solids::Solids;
use super::triangles::Ears;
#[cfg(feature = "threads")]
use super::yield_counter::YieldCounter;
#[cfg(feature = "threads")]
use super::{Cores, VisibilityError};
use crate::array::MapEach;
use crate::geometry::Plane;
use crate::index::Index;
use crate::model::Corner;
use crate::stage::Scratch;
#[cfg(feature = "threads")]
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// Everything that the search for visible stretches needs to know about a scene.
pub struct SceneIndex<'a, I: Index> {
    /// The vertices, in view coordinates and on the coarse grid.
    pub coarse_projection: CoarseProjection<'a>,
    /// The corners of the faces and bars, and their pens.
    pub outlines: Outlines<'a, I>,
    /// The triangles of the faces that are not covered by a fan of triangles from their first
    /// corner.
    pub ears: Ears<'a, I>,
    /// Which sides of faces stand for their edges, so that each edge is drawn once.
    pub chosen: ChosenSides<'a>,
    /// The faces and bars in the order of their depth, nearest first.
    pub faces: Faces<'a, I>,
    /// The rectangles around the faces on the coarse grid, by rank.
    #[cfg(feature = "threads")]
    pub bounds: &'a [Bounds],
    /// The bounding boxes of the faces, by rank.
    #[cfg(feature = "threads")]
    pub extents: &'a [Extent],
    /// The senses in which the faces turn on the page, by rank: what [`Self::facing`] returns, and
    /// 0 for none.
    #[cfg(feature = "threads")]
    pub facings: &'a [i8],
    /// The faces whose solids hide what is behind them without them.
    #[cfg(feature = "threads")]
    pub solids: Solids<'a>,
}

#[cfg(feature = "threads")]
impl<'a, I: Index> SceneIndex<'a, I> {
    /// Fills `bounds`, `extents`, `facings` and `solids` where the numbers are those of a computer.
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    pub fn with_shortcuts(
        mut self,
        cores: Cores,
        scratch: &mut Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        if Self::HAS_SHORTCUTS {
            let count = self.faces.len();
            let bounds: &mut [Bounds] = scratch.take(count)?;
            let extents: &mut [Extent] = scratch.take(count)?;
            let facings: &mut [i8] = scratch.take(count)?;
            let of_face = |rank: usize| {
                let face = self.faces.get(rank);
                let bounds = Bounds::of(&self.coarse_projection, self.outlines.element(face.first));
                (bounds, self.extent(rank), self.facing(face).unwrap_or(0) as i8)
            };
            match cores {
                Cores::One => {
                    let slots = bounds.iter_mut().zip(&mut *extents).zip(&mut *facings);
                    for (rank, ((bounds, extent), facing)) in slots.enumerate() {
                        (*bounds, *extent, *facing) = of_face(rank);
                        yield_counter.spend(450)?;
                    }
                }
                Cores::All => {
                    let slots = bounds.par_iter_mut().zip(&mut *extents).zip(&mut *facings);
                    slots.enumerate().for_each(|(rank, ((bounds, extent), facing))| {
                        (*bounds, *extent, *facing) = of_face(rank);
                    });
                }
            }
            (self.bounds, self.extents, self.facings) = (bounds, extents, facings);
            let depths = scratch.take(self.outlines.corners.len())?;
            self.solids = Solids::find(&self, depths, yield_counter)?;
        }
        Ok(self)
    }
}

impl<I: Index> SceneIndex<'_, I> {
    /// Whether `bounds` and what follows it are filled, with which most questions about a face are
    /// answered without a look at its corners. On a board their memory is worth more as cells.
    pub const HAS_SHORTCUTS: bool = I::HAS_ROOM;

    /// Returns the bytes that `bounds` and what follows it take.
    pub const fn bytes_of_shortcuts(corners: usize, faces: usize) -> usize {
        if Self::HAS_SHORTCUTS {
            Scratch::bytes_for::<Bounds>(faces)
                + Scratch::bytes_for::<Extent>(faces)
                + Scratch::bytes_for::<i8>(faces)
                + Scratch::bytes_for::<i32>(corners)
        } else {
            0
        }
    }

    /// Returns the rectangle around the face with this rank on the coarse grid.
    #[inline(always)] // On a board it is nothing but `Bounds::of`.
    pub fn bounds_of(&self, rank: usize) -> Bounds {
        #[cfg(feature = "threads")]
        if let Some(bounds) = self.bounds.get(rank) {
            return *bounds;
        }
        Bounds::of(&self.coarse_projection, self.outlines.element(self.faces.get(rank).first))
    }

    /// Whether the face with this rank may meet what lies within a rectangle of the coarse grid, as
    /// far as that is known without its corners.
    #[inline(always)] // On a board it is nothing.
    pub fn may_meet(&self, _rank: usize, _within: &Bounds) -> bool {
        #[cfg(feature = "threads")]
        if Self::HAS_SHORTCUTS {
            return self.bounds.get(_rank).is_none_or(|bounds| bounds.may_meet(_within));
        }
        true
    }

    /// Returns the nearest and the farthest depth of the face with this rank, and the sense in
    /// which all its triangles turn on the page: 1 anticlockwise, -1 clockwise. Returns `None` if
    /// that is not known at once.
    #[inline(always)] // On a board it is nothing.
    pub fn outlook(&self, _rank: usize) -> Option<(i32, i32, i32)> {
        #[cfg(feature = "threads")]
        if let (Some(extent), Some(&facing @ (1 | -1))) =
            (self.extents.get(_rank), self.facings.get(_rank))
        {
            return Some((extent.near(), extent.far(), facing.into()));
        }
        None
    }

    /// Whether the other faces on the page hide as much as this one of an edge that is nowhere
    /// nearer than `near`.
    #[inline(always)] // On a board it is nothing.
    pub fn is_spared(&self, _face: Face, _near: i32) -> bool {
        #[cfg(feature = "threads")]
        if Self::HAS_SHORTCUTS {
            return self.solids.spare(_face.first, _near);
        }
        false
    }

    /// Returns what was noticed about the scene, for the user to be told.
    pub fn report(&self) -> Report {
        Report { degenerate_faces: self.faces.degenerate() }
    }

    /// Returns the triangle with this number, counted from 0, of a face. Returns `None` if the face
    /// has fewer.
    pub fn triangle(&self, face: Face, number: usize) -> Option<[I; 3]> {
        if face.has_ears {
            return self.ears.of(face.first).get(number).copied();
        }
        let corners = self.outlines.element(face.first);
        // If these two corners exist, so does the first one.
        match corners.get(number + 1..number + 3) {
            Some([b, c]) if face.is_fan => Some([corners[0].vertex(), b.vertex(), c.vertex()]),
            _ => None,
        }
    }

    /// Returns the bounding box of the face with this rank.
    pub fn extent(&self, rank: usize) -> Extent {
        #[cfg(feature = "threads")]
        if let Some(extent) = self.extents.get(rank) {
            return *extent;
        }
        let corners = self.outlines.element(self.faces.get(rank).first);
        Extent::around(corners.iter().map(|corner| self.coarse_projection.vertex(corner.vertex())))
    }

    /// Whether an edge of one of two faces has both ends at corners of the other one, as their view
    /// coordinates tell. Such faces do not cross anywhere else. Faces whose common corners are no
    /// such edge, as two squares with a common diagonal, may cross.
    pub fn share_edge(&self, one: Face, other: Face) -> bool {
        let [one, other] = [one, other].map_each(|face| self.outlines.element(face.first));
        let at = |corner: &Corner<I>| self.coarse_projection.vertex(corner.vertex());
        let is_same = |a: &Corner<I>, b: &Corner<I>| at(a) == at(b);
        // Most faces share the vertices themselves.
        Self::HAS_SHORTCUTS && has_edge_of(one, other, &|a, b| a.vertex() == b.vertex())
            || has_edge_of(one, other, &is_same)
            || has_edge_of(other, one, &is_same)
    }

    /// Returns the plane of a face that is a single triangle, and `None` for any other face.
    pub fn plane(&self, face: Face) -> Option<Plane> {
        let [a, b, c] =
            self.triangle(face, 0)?.map_each(|number| self.coarse_projection.vertex(number));
        self.triangle(face, 1).is_none().then(|| Plane::through(a, b, c))
    }

    /// Whether the element with this rank has corners on both sides of a plane as they are rounded.
    /// If it has not, it does not pass through a triangle of the plane either
    /// ([`Self::passes_through`]), for which a corner may at most count as lying in the plane.
    pub fn is_on_both_sides(&self, plane: &Plane, rank: usize) -> bool {
        let (mut before, mut behind) = (false, false);
        self.outlines.element(self.faces.get(rank).first).iter().any(|corner| {
            let side = plane.side(self.coarse_projection.vertex(corner.vertex()));
            before |= side < 0;
            behind |= side > 0;
            before && behind
        })
    }

    /// Whether a face has corners on both sides of the plane of a triangle. A face that only
    /// touches the plane ends there, with an edge or a corner.
    pub fn passes_through(&self, face: Face, triangle: [I; 3]) -> bool {
        let (mut before, mut behind) = (false, false);
        self.outlines.element(face.first).iter().any(|corner| {
            let height = self
                .coarse_projection
                .height(triangle, self.coarse_projection.end(corner.vertex()));
            before |= height < 0;
            behind |= height > 0;
            before && behind
        })
    }

    /// Iterates over the triangles of a face.
    pub fn triangles(&self, face: Face) -> impl Iterator<Item = [I; 3]> {
        (0..).map_while(move |number| self.triangle(face, number))
    }
}

/// Whether an edge of `face` has both ends at corners of `other`.
fn has_edge_of<I: Index>(
    face: &[Corner<I>],
    other: &[Corner<I>],
    is_same: &dyn Fn(&Corner<I>, &Corner<I>) -> bool,
) -> bool {
    let is_shared = |corner: &Corner<I>| other.iter().any(|there| is_same(corner, there));
    let mut was_shared = face.last().is_some_and(is_shared);
    face.iter().any(|corner| {
        let is_shared = is_shared(corner);
        core::mem::replace(&mut was_shared, is_shared) && is_shared
    })
}
