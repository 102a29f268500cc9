//! Follows each edge and each seam through the cells of the page and tests it against the faces
//! there.
//!
//! What is known about the scene does not change meanwhile, so several finders, each with marks of
//! its own, may follow different edges at the same time.
//!
//! The tests leave marks on the profile of the edge. Runs of pieces with the same outcome become
//! the stretches that the sink receives.

use super::edge_query::EdgeQuery;
use super::edges::sides;
use super::face_set::FaceSet;
use super::grid::{Grid, coarse_depth};
use super::profile::{EdgeInterval, FEWEST_PIECES, Profile, ProfilePiece, mark};
use super::scene_index::SceneIndex;
use super::seams::{Extent, seam};
use super::yield_counter::YieldCounter;
use super::{Options, Owner, Stretch, StretchSink, VisibilityError};
use crate::array::MapEach;
use crate::geometry::{EdgeParameter, Vertex};
use crate::index::Index;
use crate::stage::{Aborted, Scratch};
use core::ops::Range;

/// The most pieces that the profile of an edge may have. An edge that needs more is processed in
/// several parts.
const MOST_PIECES: usize = 24;

/// The average number of instructions for testing an edge against one face. A face that is passed
/// over, because it was tested in another cell or lies beside the edge, counts as much, so that the
/// main loop of a board fills the queue of steps often enough.
const FACE_TEST: usize = 1000;

/// What a [`StretchFinder`] notes about the edge, the seam or the face that it is working on.
pub struct Marks<'m, I> {
    /// The faces against which the current edge has been tested.
    seen: FaceSet<'m, I>,
    /// The faces that share a cell with the face whose seams (lines where faces pass through each
    /// other) are being found.
    met: FaceSet<'m, I>,
    /// Which parts of the current edge are hidden, as far as it has been tested.
    profile: Profile<'m>,
}

impl<'m, I: Index> Marks<'m, I> {
    /// Returns the least number of bytes of working memory that are enough.
    pub const fn least_bytes(faces: usize) -> usize {
        2 * FaceSet::<I>::bytes(faces) + Scratch::bytes_for::<ProfilePiece>(FEWEST_PIECES)
    }

    /// Returns the number of bytes of working memory beyond which more is no gain, because an
    /// eighth of what lies beyond the least is all the pieces that a profile may have.
    #[cfg(feature = "threads")]
    pub const fn most_bytes(faces: usize) -> usize {
        2 * FaceSet::<I>::bytes(faces) + 8 * Scratch::bytes_for::<ProfilePiece>(MOST_PIECES)
    }

    /// Takes memory for the marks. Of what `scratch` has beyond `least` bytes, an eighth at most is
    /// taken for longer profiles.
    ///
    /// # Errors
    /// Returns an error if the memory is too small.
    pub fn new(
        faces: usize,
        least: usize,
        scratch: &mut Scratch<'m>,
    ) -> Result<Self, VisibilityError> {
        let seen = FaceSet::new(faces, scratch)?;
        let met = FaceSet::new(faces, scratch)?;
        let spare = scratch.available_bytes().saturating_sub(least);
        let more_pieces = spare / 8 / size_of::<ProfilePiece>();
        let pieces = scratch.take(MOST_PIECES.min(FEWEST_PIECES + more_pieces))?;
        Ok(Self { seen, met, profile: Profile::new(pieces) })
    }
}

/// Finds which stretches of each edge are visible, one edge after the other.
pub struct StretchFinder<'s, I: Index> {
    /// The scene: its vertices, its faces in the order of their depth, and its edges.
    around: &'s SceneIndex<'s, I>,
    /// The faces on each cell of the page.
    grid: &'s Grid<'s, I>,
    /// What is known about the edge in work.
    marks: Marks<'s, I>,
    /// Which kinds of stretches the user wants to see.
    options: Options,
    /// Which edges and seams are followed; all of them with `None`.
    #[cfg(feature = "tiles")]
    owner: Owner<'s, I>,
}

impl<'s, I: Index> StretchFinder<'s, I> {
    /// Returns the least number of bytes of working memory that are enough for the marks and the
    /// grid. The search is then slow.
    pub const fn least_bytes(faces: usize) -> usize {
        Marks::<I>::least_bytes(faces) + Grid::<I>::least_bytes(faces)
    }

    /// Prepares the search of a scene.
    pub fn new(
        around: &'s SceneIndex<'s, I>,
        grid: &'s Grid<'s, I>,
        marks: Marks<'s, I>,
        options: Options,
        _owner: Owner<'s, I>,
    ) -> Self {
        Self {
            around,
            grid,
            marks,
            options,
            #[cfg(feature = "tiles")]
            owner: _owner,
        }
    }

    /// Whether to follow the edge between two vertices.
    #[inline(always)] // Without owners it is nothing.
    fn owns_edge(&mut self, _ends: [I; 2]) -> bool {
        #[cfg(feature = "tiles")]
        return self.owner.as_mut().is_none_or(|owner| owner.owns_edge(_ends));
        #[cfg(not(feature = "tiles"))]
        true
    }

    /// Whether to look for the seams of the elements with two ranks.
    #[inline(always)] // Without owners it is nothing.
    fn owns_pair(&mut self, _ranks: [usize; 2]) -> bool {
        #[cfg(feature = "tiles")]
        {
            let faces = &self.around.faces;
            let owner = self.owner.as_mut();
            owner.is_none_or(|owner| owner.owns_pair(_ranks.map_each(|rank| faces.get(rank).first)))
        }
        #[cfg(not(feature = "tiles"))]
        true
    }

    /// Whether to follow the seam between two points.
    #[inline(always)] // Without owners it is nothing.
    fn owns_seam(&mut self, _ends: [Vertex; 2]) -> bool {
        #[cfg(feature = "tiles")]
        return self.owner.as_mut().is_none_or(|owner| owner.owns_seam(_ends));
        #[cfg(not(feature = "tiles"))]
        true
    }

    /// Finds the stretches of the edges of a range of elements, in the order of the model. The
    /// range is one of corners, which begins and ends with an element.
    ///
    /// # Errors
    /// Returns an error if the sink is full or the user cancels.
    pub fn follow_edges(
        &mut self,
        corners: Range<usize>,
        yield_counter: &mut YieldCounter<'_>,
        sink: &mut dyn StretchSink<I>,
    ) -> Result<(), VisibilityError> {
        for (first, element) in self.around.outlines.elements_in(corners) {
            for (number, p, q) in sides(element) {
                let side = first + number;
                if self.around.chosen.contains(side) && self.owns_edge([p, q]) {
                    let coarse_projection = &self.around.coarse_projection;
                    let edge_query =
                        EdgeQuery::new(side, coarse_projection.end(p), coarse_projection.end(q));
                    self.follow(&edge_query, [None; 2], yield_counter, sink)?;
                }
            }
        }
        Ok(())
    }

    /// Finds the seams of the faces with a range of ranks, each with the faces of higher rank, and
    /// hands over their visible stretches.
    ///
    /// # Errors
    /// Returns an error if the sink is full or the user cancels.
    #[inline(never)] // Inlined in its only caller, the code would be larger.
    pub fn follow_seams(
        &mut self,
        ranks: Range<usize>,
        yield_counter: &mut YieldCounter<'_>,
        sink: &mut dyn StretchSink<I>,
    ) -> Result<(), VisibilityError> {
        for one in ranks {
            let extent = self.around.extent(one);
            if self.has_no_visible_seam(one, &extent) {
                yield_counter.spend(1000)?;
                continue;
            }
            self.meet(one, &extent);
            // Most faces near a triangle lie on one side of it.
            let plane = self.around.plane(self.around.faces.get(one));
            let mut met = core::mem::take(&mut self.marks.met);
            let outcome = met.each(one, &mut |other| {
                let is_beside = || extent.meets(&self.around.extent(other));
                let may_pass = || {
                    plane.as_ref().is_none_or(|plane| self.around.is_on_both_sides(plane, other))
                };
                // Only a computer knows the boxes at once, and asks for them first.
                let knows_boxes = SceneIndex::<I>::HAS_SHORTCUTS;
                let may_cross =
                    (!knows_boxes || is_beside()) && may_pass() && (knows_boxes || is_beside());
                if may_cross && self.owns_pair([one, other]) {
                    self.follow_seams_of(one, other, yield_counter, sink)?;
                }
                yield_counter.spend(200).map_err(VisibilityError::from)
            });
            self.marks.met = met;
            outcome?;
            yield_counter.spend(1000)?;
        }
        Ok(())
    }

    /// Whether it is known at once that no part of a seam of the face with this rank is visible.
    /// `extent` is the box around the face.
    ///
    /// That is so where the face is part of a sheet in each of its cells, because no other face of
    /// a sheet lies above or below it. It is also so where something nearer covers all its cells,
    /// and those that the rounded ends of a seam may reach. Of a fine mesh, most faces are of one
    /// kind or the other.
    #[inline(always)] // On a board it is nothing.
    fn has_no_visible_seam(&self, _one: usize, _extent: &Extent) -> bool {
        #[cfg(feature = "threads")]
        if SceneIndex::<I>::HAS_SHORTCUTS {
            let Self { around, grid, options, .. } = self;
            let near = coarse_depth(_extent.near());
            let bounds = around.bounds_of(_one);
            let is_in_sheets = || grid.are_all(&bounds, near, |cell| cell.shows);
            let reach = || bounds.grown(around.coarse_projection.rounding_error());
            return !options.merged_blocks && is_in_sheets()
                || grid.are_all(&reach(), near, |cell| cell.hides);
        }
        false
    }

    /// Finds the seams of the triangles of two faces and hands over their visible stretches.
    fn follow_seams_of(
        &mut self,
        one: usize,
        other: usize,
        yield_counter: &mut YieldCounter<'_>,
        sink: &mut dyn StretchSink<I>,
    ) -> Result<(), VisibilityError> {
        let [face_one, face_other] = [one, other].map_each(|rank| self.around.faces.get(rank));
        if self.around.share_edge(face_one, face_other) {
            return Ok(());
        }
        let mut n = 0;
        while let Some(triangle_one) = self.around.triangle(face_one, n) {
            n += 1;
            yield_counter.spend(1500)?;
            if !self.around.passes_through(face_other, triangle_one) {
                continue;
            }
            let mut m = 0;
            while let Some(triangle_other) = self.around.triangle(face_other, m) {
                m += 1;
                yield_counter.spend(3000)?;
                if !self.around.passes_through(face_one, triangle_other) {
                    continue;
                }
                let coarse_projection = &self.around.coarse_projection;
                let triangles = [triangle_one, triangle_other];
                let [corners_one, corners_other] = triangles.map_each(|triangle| {
                    triangle.map_each(|number| coarse_projection.vertex(number))
                });
                let of_one = coarse_projection.heights(triangle_other, triangle_one);
                let of_other = coarse_projection.heights(triangle_one, triangle_other);
                if let Some((p, q)) = seam(corners_one, corners_other, of_one, of_other)
                    && self.owns_seam([p, q])
                {
                    let (p, q) = (coarse_projection.free_end(p), coarse_projection.free_end(q));
                    let edge_query = EdgeQuery::of_seam(triangles, p, q);
                    self.follow(&edge_query, [Some(one), Some(other)], yield_counter, sink)?;
                }
            }
        }
        Ok(())
    }

    /// Puts the faces with a higher rank than `one` that may pass through it, so that there is a
    /// seam, into `met`. `extent` is the box around it.
    fn meet(&mut self, one: usize, extent: &Extent) {
        let Self { around, grid, marks: Marks { met, .. }, .. } = self;
        met.clear();
        let far = extent.far();
        grid.within(&around.bounds_of(one), &mut |ranks| {
            // The ranks in a cell ascend.
            // A partition point is at most the length of the slice, so it can be split there.
            let (_, higher) = ranks.split_at(ranks.partition_point(|rank| rank.get() <= one));
            let higher = higher.iter().map(|rank| rank.get());
            for other in higher.take_while(|&other| !around.faces.begins_behind(other, far)) {
                met.insert(other);
            }
        });
    }

    /// Finds the visible and hidden stretches of an edge or of a seam and hands them to the sink.
    /// `seam_of` holds the ranks of the two faces of a seam.
    fn follow(
        &mut self,
        edge_query: &EdgeQuery<I>,
        seam_of: [Option<usize>; 2],
        yield_counter: &mut YieldCounter<'_>,
        sink: &mut dyn StretchSink<I>,
    ) -> Result<(), VisibilityError> {
        let coarse_projection = &self.around.coarse_projection;
        let ends = (edge_query.p.vertex, edge_query.q.vertex);
        if coarse_projection.direction(ends.0, ends.1).is_none() {
            return Ok(());
        }
        let pen_at = |corner: usize| self.around.outlines.pens.at(corner);
        // The ranks of a seam are those of two faces of the scene: see `Faces`.
        let pen_of = |rank: &usize| pen_at(self.around.faces.get(*rank).first);
        let pen =
            seam_of.iter().flatten().map(pen_of).min().unwrap_or_else(|| pen_at(edge_query.side));
        let edge = (edge_query.side != EdgeQuery::<I>::NO_SIDE)
            .then_some((edge_query.p.number, edge_query.q.number));
        let mut pending: Option<Stretch<I>> = None;
        let mut start = EdgeParameter::START;
        while start < EdgeParameter::END {
            self.marks.profile.open(start);
            self.test_faces(edge_query, seam_of, yield_counter)?;
            let end = self.marks.profile.end();
            let pieces = self.marks.profile.pieces();
            let next = pieces.iter().skip(1).map(|piece| piece.from).chain([end]);
            for (piece, to) in pieces.iter().zip(next) {
                let visible = piece.marks & mark::HIDDEN != mark::HIDDEN;
                let handed = if visible {
                    piece.marks & mark::ENCLOSED == 0
                        && !(self.options.merged_blocks
                            && edge_query.is_within_plane(self.around, piece.marks))
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
                        let from = piece.from;
                        let next = handed.then_some(Stretch { edge, ends, from, to, visible, pen });
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

    /// Tests the edge against the faces in all cells that it passes, and marks on its profile which
    /// parts they hide.
    fn test_faces(
        &mut self,
        edge_query: &EdgeQuery<I>,
        seam_of: [Option<usize>; 2],
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<(), Aborted> {
        let Self { around, grid, marks: Marks { seen, profile, .. }, options, .. } = self;
        let faces_by_rank = &around.faces;
        let near = coarse_depth(edge_query.near);
        let margin = if options.merged_blocks { around.coarse_projection.error_bound() } else { 0 };
        let cells_along =
            grid.cells_along(edge_query.p.position, edge_query.q.position, near, margin);
        let (mut any_covered, mut is_hidden, mut is_shown) = (false, true, true);
        cells_along.visit(&mut |cell| {
            any_covered |= cell.cover.is_some();
            is_hidden &= cell.hides;
            is_shown &= cell.shows;
            true
        });
        if is_hidden {
            profile.mark(EdgeInterval::WHOLE, mark::HIDDEN);
            return yield_counter.spend(1000);
        }
        if is_shown && edge_query.seam.is_none() && !options.merged_blocks {
            return yield_counter.spend(1000);
        }
        seen.clear();
        for rank in seam_of.into_iter().flatten() {
            seen.insert(rank);
        }
        let mut spent = yield_counter.spend(1000);
        let mut test_face = |rank: I, is_cover: bool| {
            let rank = rank.get();
            if !seen.insert(rank) || !around.may_meet(rank, &edge_query.bounds) {
                spent = spent.and_then(|()| yield_counter.spend(FACE_TEST));
                return spent.is_ok();
            }
            let face = faces_by_rank.get(rank);
            // Where there is a covering face, the others are not tested.
            let hides = is_cover || !around.is_spared(face, edge_query.near);
            edge_query.mark_face(around, rank, face, hides, profile);
            spent = spent.and_then(|()| yield_counter.spend(FACE_TEST));
            spent.is_ok() && !profile.is_hidden()
        };
        // The covering faces come first: they hide most, and what they leave visible may need no
        // other cell.
        let _ = (!any_covered
            || cells_along.visit(&mut |cell| cell.cover.is_none_or(|rank| test_face(rank, true))))
            && cells_along.visit(&mut |cell| {
                let faces = if cell.cover.is_some() { &[] } else { cell.faces };
                faces
                    .iter()
                    .take_while(|&&rank| !faces_by_rank.begins_behind(rank.get(), edge_query.far))
                    .all(|&rank| test_face(rank, false))
            });
        spent?;
        if options.merged_blocks && !profile.is_hidden() {
            // Within the precision of the model, several faces may be equally near, and then it
            // matters which comes first. So they are asked in the order of their ranks, whatever
            // the cells are.
            seen.each(0, &mut |rank| {
                edge_query.touch(around, faces_by_rank.get(rank), rank, profile);
                yield_counter.spend(FACE_TEST)
            })?;
        }
        Ok(())
    }
}
