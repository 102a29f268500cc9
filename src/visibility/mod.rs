//! For each edge, the visible stretches.
//!
//! [`find_stretches`] takes a [`Scene`], any faces at all (convex or concave, closed or open, touching,
//! sharing planes, passing through each other) and any bars, and hands over the visible stretches
//! of each distinct edge, and the hidden ones if asked. The result is exact for the rounded vertices; only
//! whether a vertex lies in the plane of a face is asked of the model, if its positions are known.
//!
//! * Both sides of a face hide. A face counts as its triangles.
//! * The rule for ties: a point of an edge is hidden if the points of the page just to its left *and* just
//!   to its right along the edge are covered by a nearer face. A face that touches the edge there is
//!   not nearer.
//! * Of edges that coincide on the page, the nearest is drawn; of those that coincide in space, that of the
//!   lowest pen, and of one pen the first of the model. An edge has the lowest pen of its faces, a seam too.
//! * An edge that the eye sees end-on has no length on the page and no stretch.
//!
//! The way: choose one side of a face for each edge (`edges`, `crease`), cut concave faces into
//! triangles (`triangles`), place the vertices on a coarse grid of the page (`coarse_projection`), sort the faces by
//! depth (`faces`) and into cells (`grid`, `raster`); then follow each edge through the cells (`search`) and
//! mark on its `profile` what each face hides (`edge_query`). On request, find the lines where faces pass
//! through each other (`seams`) and leave out those within one plane (`blocks`).
//!
//! # Memory
//! [`scratch_bytes`] is the least; with more, the grid is finer and fewer faces are tried for each edge.
//!
//! | scene | vertices | faces | least bytes |
//! |---|---|---|---|
//! | lattice5 | 1000 | 750 | 9176 |
//! | lattice7 | 2744 | 2058 | 24992 |
//! | torus of 2400 quads | 2400 | 2400 | 26400 |
//!
//! The least means one cell, and every face is tried for every edge. A tenth more makes it several times
//! faster; twice as much is as good as any.
//!
//! For each vertex 4 bytes; for each corner 1/8; for each element 4 and 1/4; for each entry of the grid 2 and for
//! each cell 6. Before that, while edges are chosen, 2 for each vertex and 2 1/8 for each corner. Faces that no fan
//! of triangles covers take 4 bytes and 6 for each of their triangles.
//!
//! Refused: vertices out of range, a model too large, too little memory.

mod blocks;
mod crease;
mod edges;
mod faces;
mod grid;
mod coarse_projection;
mod yield_counter;
mod profile;
mod raster;
mod seams;
mod search;
mod edge_query;
mod triangles;
mod unrounded;
mod wire;

use crate::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use crate::model::Elements;
use crate::stage::{Aborted, Cancel, OutOfScratch, Scratch};
use coarse_projection::{CoarsePoint, CoarseProjection};
use edge_query::SceneIndex;
use edges::{ChosenSides, MOST_CORNERS, Outlines};
use faces::Faces;
use search::StretchFinder;
use triangles::Ears;
use yield_counter::YieldCounter;

pub use crate::geometry::EdgeParameter;
pub use crease::Crease;
pub use unrounded::Unrounded;
pub use wire::follow_wire;

/// A scene as the camera sees it: rounded vertices, and the faces and bars between them.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// View coordinates of every vertex of the model.
    pub vertices: &'a [Vertex],
    /// Faces and bars, by vertex number.
    pub elements: Elements<'a>,
    /// Perspective or parallel.
    pub projection: Projection,
    /// The same vertices before they were rounded, as far as known: what lies in one plane in the model
    /// lies there in the view, too.
    pub unrounded: Unrounded<'a>,
}

/// What the user may choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Also hand over the hidden stretches (dotted or shown).
    pub with_hidden: bool,
    /// Also hand over what is seen of the seams, where faces pass through each other.
    pub with_seams: bool,
    /// Draw blocks that touch as one shape: no visible line between two faces that lie in one plane.
    pub merged_blocks: bool,
    /// Draw only silhouettes, open edges and edges sharper than this; `None` draws every edge.
    pub crease: Option<Crease>,
}

/// What was found on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// Faces without an area, which hide nothing; their edges are drawn.
    pub degenerate_faces: u32,
}

/// A longest piece of one edge that is all visible or all hidden, or a visible piece of a seam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// The numbers of the vertices that the edge joins; `None` for a seam.
    pub edge: Option<(u16, u16)>,
    /// Those vertices, or the ends of the seam, rounded.
    pub ends: (Vertex, Vertex),
    /// Where it begins.
    pub from: EdgeParameter,
    /// Where it ends, after `from`.
    pub to: EdgeParameter,
    /// Whether it is seen.
    pub visible: bool,
    /// The pen that draws it, from 0.
    pub pen: u8,
}

/// Who takes the stretches as they are found.
pub trait StretchSink {
    /// Takes one stretch.
    ///
    /// # Errors
    /// [`SinkFull`] ends the search.
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull>;
}

/// The sink has no room for another stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinkFull;

/// Why visibility ended without a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The sink took no more.
    SinkFull,
    /// The user gave up.
    Aborted,
    /// The elements have more corners together than can be numbered; this is the limit.
    TooManyCorners(usize),
    /// An element names a vertex that does not exist.
    UnknownVertex(u16),
    /// A coordinate beyond [`COORDINATE_LIMIT`], or a vertex not before the eye in perspective.
    OutOfRange(u16),
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

/// The least working memory with which [`find_stretches`] does a scene of this size.
///
/// It uses more where it is given more: a finer grid, so that fewer faces are tried for each edge.
///
/// Zero for a scene that is refused for what it is.
pub fn scratch_bytes(scene: &Scene<'_>) -> usize {
    if check(scene).is_err() {
        return 0;
    }
    let outlines = Outlines::of(scene.elements);
    let corners = outlines.corners.len();
    let vertices = scene.vertices.len();
    let faces = outlines.elements().count();
    least_bytes(vertices, corners, faces) + Ears::bytes(outlines, scene.vertices)
}

/// The same for faces that are convex, or are covered by one fan of triangles, by numbers alone.
pub const fn least_bytes(vertices: usize, corners: usize, faces: usize) -> usize {
    let choosing = ChosenSides::bytes_while_choosing(vertices, corners);
    let searching = Scratch::bytes_for::<CoarsePoint>(vertices)
        + Scratch::bytes_for::<u32>(faces)
        + StretchFinder::least_bytes(faces);
    ChosenSides::bytes(corners) + if choosing > searching { choosing } else { searching }
}

/// Finds the stretches of every edge and bar of the scene, in the order of the model.
///
/// # Errors
/// See [`VisibilityError`]. The sink has then been handed a part of the stretches.
pub fn find_stretches(
    scene: &Scene<'_>,
    options: Options,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink,
) -> Result<Report, VisibilityError> {
    check(scene)?;
    let outlines = Outlines::of(scene.elements);
    let (vertices, projection) = (scene.vertices, scene.projection);
    let yield_counter = &mut YieldCounter::new(cancel);
    let memory = &mut scratch;
    let creases = (options.crease, scene.unrounded);
    let chosen =
        ChosenSides::choose(outlines, projection, vertices, creases, memory, yield_counter)?;
    let ears = Ears::cut(outlines, vertices, memory, yield_counter)?;
    let coarse_projection = CoarseProjection::new(scene, memory, yield_counter)?;
    let faces = Faces::sort(outlines, vertices, memory, yield_counter)?;
    let around = SceneIndex { coarse_projection, outlines, ears, chosen, faces };
    let mut search = StretchFinder::new(around, options, scratch, yield_counter)?;
    search.follow_edges(yield_counter, sink)?;
    if options.with_seams {
        search.follow_seams(yield_counter, sink)?;
    }
    Ok(Report { degenerate_faces: search.degenerate_faces() })
}

/// Refuses what the arithmetic cannot take.
fn check(scene: &Scene<'_>) -> Result<(), VisibilityError> {
    let corners = scene.elements.corners();
    if corners.len() > MOST_CORNERS {
        return Err(VisibilityError::TooManyCorners(MOST_CORNERS));
    }
    if let Some(corner) =
        corners.iter().find(|corner| usize::from(corner.vertex()) >= scene.vertices.len())
    {
        return Err(VisibilityError::UnknownVertex(corner.vertex()));
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
        Some(number) => Err(VisibilityError::OutOfRange(number as u16)),
        None => Ok(()),
    }
}
