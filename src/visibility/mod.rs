//! For each edge, the visible stretches.
//!
//! [`find_stretches`] takes a [`Scene`], any faces at all (convex or concave, closed or open, touching,
//! sharing planes, passing through each other) and any bars, and hands over the visible stretches
//! of each distinct edge, and the hidden ones if asked. The result is exact for the rounded vertices.
//!
//! * Both sides of a face hide. A face counts as its triangles.
//! * The rule for ties: a point of an edge is hidden if the points of the page just to its left *and* just
//!   to its right along the edge are covered by a nearer face. A face that touches the edge there is
//!   not nearer.
//! * Of edges that coincide on the page, the nearest is drawn; of those that coincide in space, the
//!   first of the model.
//! * An edge that the eye sees end-on has no length on the page and no stretch.
//!
//! The way: choose one side of a face for each edge (`edges`), place the vertices on a coarse grid of
//! the page (`outlook`), cut concave faces (`triangles`), sort the faces by depth (`faces`) and into
//! cells (`grid`); then follow each edge through the cells and mark on its `profile` what each
//! face hides (`sight`). Refused: vertices out of range, a model too large, too little memory.

mod blocks;
mod crease;
mod edges;
mod faces;
mod grid;
mod outlook;
mod profile;
mod raster;
mod seams;
mod sight;
mod triangles;

use crate::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use crate::model::Elements;
use crate::stage::{Aborted, Attention, OutOfScratch, Scratch};
use edges::{ChosenSides, MOST_CORNERS, Outlines, sides};
use faces::Faces;
use grid::Grid;
use outlook::{Outlook, Place};
use profile::{FEWEST_PIECES, Part, Piece, Profile, mark};
use raster::Bounds;
use seams::seam;
use sight::{Sight, Surroundings};
use triangles::Ears;

pub use crate::geometry::Along;
pub use crease::Crease;

/// A scene as the camera sees it: rounded vertices, and the faces and bars between them.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// View coordinates of every vertex of the model.
    pub vertices: &'a [Vertex],
    /// Faces and bars, by vertex number.
    pub elements: Elements<'a>,
    /// Perspective or parallel.
    pub projection: Projection,
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
    pub from: Along,
    /// Where it ends, after `from`.
    pub to: Along,
    /// Whether it is seen.
    pub visible: bool,
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
pub fn scratch_bytes(scene: &Scene<'_>) -> usize {
    let outlines = Outlines { corners: scene.elements.corners() };
    let corners = outlines.corners.len();
    let vertices = scene.vertices.len();
    let faces = outlines.elements().count();
    ChosenSides::bytes(corners)
        + Ears::bytes(outlines, scene.vertices)
        + ChosenSides::bytes_while_choosing(vertices, corners).max(
            Scratch::bytes_for::<Place>(vertices)
                + Scratch::bytes_for::<u32>(faces)
                + 2 * Scratch::bytes_for::<u32>(faces.div_ceil(32))
                + Scratch::bytes_for::<Piece>(FEWEST_PIECES)
                + Grid::least_bytes(faces),
        )
}

/// Pieces that the profile of an edge may have before the edge is done in parts.
const MOST_PIECES: usize = 24;

/// Finds the stretches of every edge and bar of the scene, in the order of the model.
///
/// # Errors
/// See [`VisibilityError`]. The sink has then been handed a part of the stretches.
pub fn find_stretches(
    scene: &Scene<'_>,
    options: Options,
    mut scratch: Scratch<'_>,
    attention: &mut dyn Attention,
    sink: &mut dyn StretchSink,
) -> Result<Report, VisibilityError> {
    check(scene)?;
    let outlines = Outlines { corners: scene.elements.corners() };
    let vertices = scene.vertices;
    let chosen = ChosenSides::choose(
        outlines,
        scene.projection,
        vertices,
        options.crease,
        &mut scratch,
        attention,
    )?;
    let ears = Ears::cut(outlines, vertices, &mut scratch, attention)?;
    let outlook = Outlook::new(scene.projection, vertices, &mut scratch)?;
    attention.check()?;
    let faces = Faces::sort(outlines, vertices, &mut scratch, attention)?;
    attention.check()?;
    let seen = scratch.take(faces.len().div_ceil(32))?;
    let met = if options.with_seams { Some(scratch.take(faces.len().div_ceil(32))?) } else { None };
    let piece_count = MOST_PIECES.min(scratch.available_bytes() / 8 / size_of::<Piece>());
    let pieces = scratch.take(piece_count.max(FEWEST_PIECES))?;
    let grid = Grid::new(&outlook, outlines, &faces, scratch, attention)?;
    let mut search = Search {
        around: Surroundings { outlook, outlines, ears, chosen, faces },
        grid,
        seen,
        profile: Profile::new(pieces),
        options,
    };
    for (first, element) in outlines.elements() {
        attention.check()?;
        for (number, p, q) in sides(element) {
            let side = first + number;
            if search.around.chosen.contains(side) {
                let sight = Sight::new(side, outlook.end(p), outlook.end(q));
                search.follow(&sight, [None; 2], sink)?;
            }
        }
    }
    if let Some(met) = met {
        search.follow_seams(met, attention, sink)?;
    }
    Ok(Report { degenerate_faces: search.around.faces.degenerate() })
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

/// The search for the stretches of one edge after the other.
struct Search<'a> {
    around: Surroundings<'a>,
    grid: Grid<'a>,
    /// One bit for each rank: whether the edge has met this face.
    seen: &'a mut [u32],
    profile: Profile<'a>,
    options: Options,
}

impl Search<'_> {
    /// Finds the seams and what is seen of them. `met` has a bit for each rank.
    fn follow_seams(
        &mut self,
        met: &mut [u32],
        attention: &mut dyn Attention,
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        for one in 0..self.around.faces.len() {
            attention.check()?;
            self.meet(one, met);
            for other in one + 1..self.around.faces.len() {
                if met[other / 32] >> (other % 32) & 1 == 0 {
                    continue;
                }
                attention.check()?;
                let (face_one, face_other) =
                    (self.around.faces.get(one), self.around.faces.get(other));
                for n in 0.. {
                    let Some(triangle_one) = self.around.triangle(face_one, n) else {
                        break;
                    };
                    for m in 0.. {
                        let Some(triangle_other) = self.around.triangle(face_other, m) else {
                            break;
                        };
                        let outlook = &self.around.outlook;
                        let corners = [triangle_one, triangle_other]
                            .map(|triangle| triangle.map(|number| outlook.vertex(number)));
                        if let Some((p, q)) = seam(corners[0], corners[1]) {
                            let sight = Sight::new(
                                Sight::NO_SIDE,
                                outlook.free_end(p),
                                outlook.free_end(q),
                            );
                            self.follow(&sight, [Some(one), Some(other)], sink)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Leaves in `met` the faces after `one` that may pass through it where something is seen.
    fn meet(&self, one: usize, met: &mut [u32]) {
        met.fill(0);
        let outlook = &self.around.outlook;
        let corners = self.around.outlines.element(self.around.faces.get(one).first);
        let bounds = Bounds::of(outlook, corners);
        let far = corners.iter().map(|corner| outlook.vertex(corner.vertex()).z).max();
        let far = far.unwrap_or(-COORDINATE_LIMIT);
        self.grid.within(&bounds, |ranks| {
            for &other in ranks {
                let other = usize::from(other);
                if self.around.faces.begins_behind(other, far) {
                    break;
                }
                if other > one {
                    met[other / 32] |= 1 << (other % 32);
                }
            }
        });
    }

    /// Finds the stretches of an edge, or of the seam of two faces.
    fn follow(
        &mut self,
        sight: &Sight,
        seam_of: [Option<usize>; 2],
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        let outlook = &self.around.outlook;
        let ends = (sight.p.vertex, sight.q.vertex);
        if outlook.direction(ends.0, ends.1).is_none() {
            return Ok(());
        }
        let edge = (sight.side != Sight::NO_SIDE).then_some((sight.p.number, sight.q.number));
        let mut pending: Option<Stretch> = None;
        let mut start = Along::START;
        while start < Along::END {
            self.profile.open(start);
            self.look_around(sight, seam_of);
            let end = self.profile.end();
            let pieces = self.profile.pieces();
            let next = pieces.iter().skip(1).map(|piece| piece.from).chain([end]);
            for (piece, to) in pieces.iter().zip(next) {
                let visible = piece.marks & mark::HIDDEN != mark::HIDDEN;
                let handed = if visible {
                    piece.marks & mark::STOOD_IN == 0
                        && !(self.options.merged_blocks
                            && sight.is_within_plane(&self.around, piece.marks))
                } else {
                    self.options.with_hidden && edge.is_some()
                };
                match &mut pending {
                    Some(stretch)
                        if handed && stretch.visible == visible && stretch.to == piece.from =>
                    {
                        stretch.to = to;
                    }
                    _ => {
                        let next =
                            handed.then_some(Stretch { edge, ends, from: piece.from, to, visible });
                        if let Some(stretch) = core::mem::replace(&mut pending, next) {
                            sink.stretch(stretch)?;
                        }
                    }
                }
            }
            start = end;
        }
        if let Some(stretch) = pending {
            sink.stretch(stretch)?;
        }
        Ok(())
    }

    /// Marks on the profile what every face along the way does to the edge.
    fn look_around(&mut self, sight: &Sight, seam_of: [Option<usize>; 2]) {
        let Self { around, grid, seen, profile, options } = self;
        let faces_by_rank = &around.faces;
        let near = grid::coarse_depth(sight.near);
        let way = grid.way(sight.p.place, sight.q.place, near);
        let (mut any_covered, mut all_covered) = (false, true);
        way.visit(|cell| {
            any_covered |= cell.cover.is_some();
            all_covered &= cell.cover.is_some();
            true
        });
        if all_covered {
            profile.mark(Part::WHOLE, mark::HIDDEN);
            return;
        }
        seen.fill(0);
        for rank in seam_of.into_iter().flatten() {
            seen[rank / 32] |= 1 << (rank % 32);
        }
        let mut look_at = |rank: u16| {
            let word = &mut seen[usize::from(rank) / 32];
            let bit = 1 << (rank % 32);
            if *word & bit == 0 {
                *word |= bit;
                let rank = usize::from(rank);
                sight.look_at(around, faces_by_rank.get(rank), profile);
                if options.merged_blocks {
                    sight.touch(around, faces_by_rank.get(rank), rank, profile);
                }
            }
            !profile.is_hidden()
        };
        // Covering faces first: they hide most, and what they leave may need no other cell.
        let _ = (!any_covered || way.visit(|cell| cell.cover.is_none_or(&mut look_at)))
            && way.visit(|cell| {
                let faces = if cell.cover.is_some() { &[] } else { cell.faces };
                faces
                    .iter()
                    .take_while(|&&rank| !faces_by_rank.begins_behind(usize::from(rank), sight.far))
                    .all(|&rank| look_at(rank))
            });
    }
}
