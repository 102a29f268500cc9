//! Hidden-line removal for some of the edges and seams of a scene.
//!
//! All faces of the scene may hide, but only the edges and seams that belong to an [`Ownership`]
//! are followed. So the edges of a larger scene can be shared out among small ones, each of which
//! has all the faces that matter to its own edges.

use super::grid::Grid;
use super::search::{Marks, StretchFinder};
use super::yield_counter::YieldCounter;
use super::{Options, Scene, StretchSink, VisibilityError, index};
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
    let mut scratch = scratch; // It lives no longer than the scene.
    let yield_counter = &mut YieldCounter::new(cancel);
    let around = &index(scene, options, &mut scratch, yield_counter)?;
    let faces = around.faces.len();
    let marks = Marks::new(faces, StretchFinder::<I>::least_bytes(faces), &mut scratch)?;
    let grid = &Grid::new(around, scratch, yield_counter)?;
    let mut search = StretchFinder::new(around, grid, marks, options).owned_by(owner);
    search.follow_edges(0..around.outlines.corners.len(), yield_counter, sink)?;
    if options.with_seams {
        search.follow_seams(0..faces, yield_counter, sink)?;
    }
    Ok(())
}
