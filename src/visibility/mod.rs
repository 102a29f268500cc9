//! Hidden-line removal: finds the visible stretches of every edge of a scene.
//!
//! [`find_stretches`] takes a [`Scene`] of faces and bars. The faces may be convex or concave,
//! closed or open; they may touch, share a plane or pass through each other. It hands the visible
//! stretches of each distinct edge to a sink, and the hidden ones if the options ask for them. The
//! result is exact for the rounded vertices. Only one question is answered from the model instead,
//! if the positions of its vertices are known: whether a vertex lies in the plane of a face.
//!
//! * A face hides what lies behind it from both of its sides. A face is treated as the triangles
//!   that it is cut into.
//! * The rule for ties: a point of an edge is hidden if nearer faces cover the points of the page
//!   just to the left *and* just to the right of the edge there. A face that touches the edge there
//!   is not nearer.
//! * Of several edges that coincide on the page, the nearest is drawn. Of edges that coincide in
//!   space, the one with the lowest pen is drawn, and of those with the same pen the first in the
//!   model. An edge has the lowest pen of the faces that share it; a seam has the
//!   lower pen of its two faces.
//! * An edge that the eye sees end-on has no length on the page and therefore no stretch.
//!
//! The search runs in these steps:
//!
//! * Choose one side of a face to represent each edge (`edges`, `crease`).
//! * Sort the faces by depth (`faces`).
//! * Cut concave faces into triangles (`triangles`).
//! * Place the vertices on a coarse grid of the page (`coarse_projection`).
//! * Sort the faces into the cells of the page (`grid`, `raster`).
//! * Of a fine mesh, find the cells that one sheet of faces covers (`sheet`), where it is known at
//!   once which edges are visible.
//! * On a computer, find the solids whose back faces need not be tested against the edges behind
//!   them (`solids`).
//! * Follow each edge through the cells (`search`) and mark on its `profile` which part each face
//!   hides (`edge_query`), each face once (`face_set`).
//! * If the options ask for it, find the lines where faces pass through each other (`seams`) and
//!   omit the edges between two faces of one plane (`blocks`).
//!
//! # Memory
//! [`scratch_bytes`] returns the smallest working memory that is enough. With more memory the grid
//! is finer, and fewer faces are tested against each edge. The result is the same.
//!
//! | scene | vertices | faces | least bytes |
//! |---|---|---|---|
//! | lattice5 | 1000 | 750 | 9176 |
//! | lattice7 | 2744 | 2058 | 24992 |
//! | torus of 2400 quads | 2400 | 2400 | 26400 |
//!
//! With the least memory the grid has a single cell, and every face is tested against every edge. A
//! tenth more memory makes the search several times faster. More than twice the least brings no
//! further gain.
//!
//! The search takes 4 bytes for each vertex, 1/8 for each corner, 4 1/4 for each element, 2 for
//! each entry of the grid and 6 for each cell. Before that, the choice of the edges takes 2 bytes
//! for each vertex and 2 1/8 for each corner. Each face that no fan of triangles covers takes 4
//! bytes, and 6 for each of its triangles. With the numbers of a computer most of this is twice as
//! much, and 33 bytes for each element and 4 for each corner are added (`bounds`, `extents`,
//! `facings` and `solids`).
//!
//! # Limits
//! Refused are vertices out of range, a model that is too large and too little working memory.

mod blocks;
mod crease;
mod edges;
mod face_set;
mod faces;
mod grid;
#[cfg(feature = "tiles")]
mod owned;
mod coarse_projection;
mod yield_counter;
mod profile;
mod raster;
mod seams;
mod scene_index;
mod search;
mod sheet;
#[cfg(feature = "threads")]
mod solids;
#[cfg(feature = "threads")]
pub mod threads;
mod edge_query;
mod triangles;
mod unrounded;
mod wire;

use crate::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use crate::index::Index;
use crate::model::Elements;
pub use crate::stage::SinkFull;
use crate::stage::{Aborted, Cancel, OutOfScratch, Scratch};
use coarse_projection::{CoarsePoint, CoarseProjection};
use edges::{ChosenSides, Outlines, most_corners};
use faces::Faces;
use grid::Grid;
use scene_index::SceneIndex;
use search::{Marks, StretchFinder};
#[cfg(feature = "threads")]
use solids::Solids;
use triangles::Ears;
#[cfg(not(feature = "tiles"))]
use yield_counter::YieldCounter;

pub use crate::geometry::EdgeParameter;
pub use crease::Crease;
pub use unrounded::Unrounded;
pub use wire::follow_wire;
#[cfg(feature = "tiles")]
pub(crate) use {
    coarse_projection::page_position,
    owned::{Ownership, find_owned_stretches},
    yield_counter::YieldCounter,
};

/// A scene as the camera sees it: rounded vertices, and the faces and bars between them.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a, I = u16> {
    /// The rounded view coordinates of every vertex of the model.
    pub vertices: &'a [Vertex],
    /// The faces and bars. Each corner is the number of a vertex in `vertices`.
    pub elements: Elements<'a, I>,
    /// Whether the view is perspective or parallel.
    pub projection: Projection,
    /// The positions of the same vertices in the model, before rounding, as far as they are known.
    /// With them, vertices that lie in one plane in the model also count as lying in one plane in
    /// the view.
    pub unrounded: Unrounded<'a>,
}

/// The choices that the user has about which lines are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Also hand over the hidden stretches, which may be drawn dotted or solid.
    pub with_hidden: bool,
    /// Also hand over the visible parts of the seams, the lines where faces pass through each
    /// other.
    pub with_seams: bool,
    /// Draw blocks that touch as one shape: no visible line is drawn between two faces that lie in
    /// one plane.
    pub merged_blocks: bool,
    /// Draw only silhouettes, open edges and edges that are sharper than this. With `None` every
    /// edge is drawn.
    pub crease: Option<Crease>,
}

/// What [`find_stretches`] noticed about the scene, for the user to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// The number of faces without an area. Such faces hide nothing, but their edges are drawn.
    pub degenerate_faces: u32,
}

/// A maximal piece of one edge that is entirely visible or entirely hidden, or a visible piece of a
/// seam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch<I = u16> {
    /// The numbers of the vertices that the edge joins; `None` for a seam.
    pub edge: Option<(I, I)>,
    /// The view coordinates of those two vertices, or the rounded ends of the seam.
    pub ends: (Vertex, Vertex),
    /// Where on the edge the stretch begins.
    pub from: EdgeParameter,
    /// Where on the edge the stretch ends; always after `from`.
    pub to: EdgeParameter,
    /// Whether the stretch is visible.
    pub visible: bool,
    /// The pen that draws the stretch, counted from 0.
    pub pen: u8,
}

/// Receives the visible and hidden stretches of the edges as they are found.
pub trait StretchSink<I = u16> {
    /// Receives one stretch.
    ///
    /// # Errors
    /// An implementation returns [`SinkFull`] to end the search.
    fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull>;
}

/// The reasons why hidden-line removal ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityError {
    /// There is not enough working memory.
    Scratch(OutOfScratch),
    /// The sink had no room for another stretch.
    SinkFull,
    /// The user cancelled the search.
    Aborted,
    /// The elements together have more corners than can be numbered. The value is the limit.
    TooManyCorners(usize),
    /// The elements together have more vertices than can be numbered.
    TooManyVertices {
        /// How many they have.
        count: usize,
        /// How many can be numbered.
        limit: usize,
    },
    /// An element refers to a vertex that does not exist. The value is the number of that vertex.
    UnknownVertex(u32),
    /// A coordinate is beyond [`COORDINATE_LIMIT`], or, in perspective, a vertex is not in front of
    /// the eye. The value is the number of the vertex.
    OutOfRange(u32),
}

impl From<OutOfScratch> for VisibilityError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}
impl From<SinkFull> for VisibilityError {
    fn from(_: SinkFull) -> Self {
        Self::SinkFull
    }
}
impl From<Aborted> for VisibilityError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

/// Returns the smallest number of bytes of working memory with which [`find_stretches`] can process
/// this scene.
///
/// With more memory the search uses a finer grid, so that fewer faces are tested against each edge.
///
/// Returns zero for a scene that [`find_stretches`] refuses however much memory there is.
pub fn scratch_bytes<I: Index>(scene: &Scene<'_, I>) -> usize {
    if check(scene).is_err() {
        return 0;
    }
    let outlines = Outlines::of(scene.elements);
    let corners = outlines.corners.len();
    let vertices = scene.vertices.len();
    let faces = outlines.elements().count();
    least_bytes::<I>(vertices, corners, faces) + Ears::bytes(outlines, scene.vertices)
}

/// Returns the same as [`scratch_bytes`], from the numbers of vertices, corners and faces alone. It
/// is valid if each face is convex or can be covered by one fan of triangles.
pub const fn least_bytes<I: Index>(vertices: usize, corners: usize, faces: usize) -> usize {
    let choosing = ChosenSides::bytes_while_choosing::<I>(vertices, corners);
    let searching = Scratch::bytes_for::<CoarsePoint>(vertices)
        + Scratch::bytes_for::<I::Pair>(faces)
        + SceneIndex::<I>::bytes_of_shortcuts(corners, faces)
        + StretchFinder::<I>::least_bytes(faces);
    ChosenSides::bytes(corners) + if choosing > searching { choosing } else { searching }
}

/// Finds the stretches of every edge and bar of the scene and hands them to `sink` in the order of
/// the model.
///
/// # Errors
/// See [`VisibilityError`]. By then the sink may already have received some of the stretches.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub fn find_stretches<I: Index>(
    scene: &Scene<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<I>,
) -> Result<Report, VisibilityError> {
    find_some(scene, options, scratch, cancel, Owner::default(), sink)
}

/// The cores on which a scene is made ready. The result is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cores {
    /// The core that calls.
    One,
    /// All cores of a computer.
    #[cfg(feature = "threads")]
    All,
}

/// Which edges and seams are followed; all of them with `None`.
#[cfg(feature = "tiles")]
type Owner<'o, I> = Option<&'o mut dyn Ownership<I>>;
/// All edges and seams are followed.
#[cfg(not(feature = "tiles"))]
type Owner<'o, I> = core::marker::PhantomData<(&'o (), I)>;

/// Finds the stretches of the edges and seams of an owner.
#[cfg_attr(feature = "tiles", inline(never))] // Both callers share one copy of the code.
#[cfg_attr(not(feature = "tiles"), inline(always))]
fn find_some<I: Index>(
    scene: &Scene<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    owner: Owner<'_, I>,
    sink: &mut dyn StretchSink<I>,
) -> Result<Report, VisibilityError> {
    let mut scratch = scratch; // It lives no longer than the scene.
    let yield_counter = &mut YieldCounter::new(cancel);
    let around = &index(scene, options, Cores::One, &mut scratch, yield_counter)?;
    let faces = around.faces.len();
    let marks = Marks::new(faces, StretchFinder::<I>::least_bytes(faces), &mut scratch)?;
    #[cfg(feature = "tiles")]
    let is_part = owner.is_some();
    #[cfg(not(feature = "tiles"))]
    let is_part = false;
    let grid = &Grid::new(around, is_part, Cores::One, scratch, yield_counter)?;
    #[cfg(feature = "tiles")]
    let owner: Owner<'_, I> = match owner {
        Some(owner) => Some(&mut *owner), // It lives no longer than the scene.
        None => None,
    };
    let mut search = StretchFinder::new(around, grid, marks, options, owner);
    search.follow_edges(0..around.outlines.corners.len(), yield_counter, sink)?;
    if options.with_seams {
        search.follow_seams(0..faces, yield_counter, sink)?;
    }
    Ok(around.report())
}

/// Finds out what the search needs to know about a scene: chooses the edges, sorts the faces by
/// depth, and cuts them into triangles.
fn index<'a, I: Index>(
    scene: &Scene<'a, I>,
    options: Options,
    cores: Cores,
    scratch: &mut Scratch<'a>,
    yield_counter: &mut YieldCounter<'_>,
) -> Result<SceneIndex<'a, I>, VisibilityError> {
    check(scene)?;
    let outlines = Outlines::of(scene.elements);
    let (vertices, projection) = (scene.vertices, scene.projection);
    let creases = (options.crease, scene.unrounded);
    let chosen =
        ChosenSides::choose(outlines, projection, vertices, creases, scratch, yield_counter)?;
    let faces = Faces::sort(outlines, vertices, cores, scratch, yield_counter)?;
    let ears = if faces.has_ears() {
        Ears::cut(outlines, vertices, scratch, yield_counter)?
    } else {
        Ears::default()
    };
    let coarse_projection = CoarseProjection::new(scene, scratch, yield_counter)?;
    let around = SceneIndex {
        coarse_projection,
        outlines,
        ears,
        chosen,
        faces,
        #[cfg(feature = "threads")]
        bounds: &[],
        #[cfg(feature = "threads")]
        extents: &[],
        #[cfg(feature = "threads")]
        facings: &[],
        #[cfg(feature = "threads")]
        solids: Solids::default(),
    };
    #[cfg(feature = "threads")]
    let around = around.with_shortcuts(cores, scratch, yield_counter)?;
    Ok(around)
}

/// Refuses a scene whose numbers would overflow the arithmetic or that refers to unknown vertices.
// This module indexes by the numbers of a scene without further checks. What is established here
// proves that they exist: `scratch_bytes`, `index` and `follow_wire` begin with it, and a scene
// does not change while it is borrowed. Every corner is the number of a vertex. The number of each
// corner is below `most_corners`, so it fits `I` and is not `NONE`. In perspective every depth is
// above zero. Besides, the last corner of a scene is marked as the last of its element: a model
// marks the last corner of each element, and `Elements::with_pens` cuts off what follows the last
// mark.
fn check<I: Index>(scene: &Scene<'_, I>) -> Result<(), VisibilityError> {
    let corners = scene.elements.corners();
    if corners.len() > most_corners::<I>() {
        return Err(VisibilityError::TooManyCorners(most_corners::<I>()));
    }
    if let Some(corner) =
        corners.iter().find(|corner| corner.vertex().get() >= scene.vertices.len())
    {
        return Err(VisibilityError::UnknownVertex(corner.vertex().into()));
    }
    let range = -COORDINATE_LIMIT..=COORDINATE_LIMIT;
    let nearest = match scene.projection {
        Projection::Perspective => 1,
        Projection::Parallel => -COORDINATE_LIMIT,
    };
    let is_good = |vertex: &Vertex| {
        range.contains(&vertex.x)
            && range.contains(&vertex.y)
            && (nearest..=COORDINATE_LIMIT).contains(&vertex.z)
    };
    match scene.vertices.iter().position(|vertex| !is_good(vertex)) {
        Some(number) => Err(VisibilityError::OutOfRange(number as u32)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
