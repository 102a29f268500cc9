//! Hidden-line removal for some of the edges and seams of a scene.
//!
//! All faces of the scene may hide, but only the edges and seams that belong to an [`Ownership`]
//! are followed. So the edges of a larger scene can be shared out among small ones, each of which
//! has all the faces that matter to its own edges.

use super::{Options, Scene, StretchSink, VisibilityError, find_some};
use crate::geometry::Vertex;
use crate::index::Index;
use crate::stage::{Cancel, Scratch};

/// Decides which edges and seams of a scene are followed.
pub trait Ownership<I> {
    /// Whether the edge between two vertices, of which the scene has the numbers, is followed.
    fn owns_edge(&mut self, ends: [I; 2]) -> bool;

    /// Whether the seams of two elements are looked for, which begin at these corners. The element
    /// that is nearer to the eye comes first.
    fn owns_pair(&mut self, firsts: [usize; 2]) -> bool;

    /// Whether a seam of the last two elements, between these ends, is followed. It is asked for
    /// each seam of the two, in the same order every time.
    fn owns_seam(&mut self, ends: [Vertex; 2]) -> bool;
}

/// Does the same as [`find_stretches`](super::find_stretches) for the edges and seams that `owner`
/// says are its own.
///
/// # Errors
/// See [`VisibilityError`]. By then the sink may already have received some of the stretches.
pub fn find_owned_stretches<I: Index>(
    scene: &Scene<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    owner: &mut dyn Ownership<I>,
    sink: &mut dyn StretchSink<I>,
) -> Result<(), VisibilityError> {
    find_some(scene, options, scratch, cancel, Some(owner), sink).map(|_| ())
}
