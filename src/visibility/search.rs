//! Each edge, and each seam, through the cells of the page and past the faces there.

use super::edges::sides;
use super::grid::{Grid, coarse_depth};
use super::pace::Pace;
use super::profile::{FEWEST_PIECES, Part, Piece, Profile, mark};
use super::raster::Bounds;
use super::seams::seam;
use super::sight::{Sight, Surroundings};
use super::{Options, Stretch, StretchSink, VisibilityError};
use crate::geometry::{Along, COORDINATE_LIMIT};
use crate::stage::{Aborted, Scratch};

/// Pieces that the profile of an edge may have before the edge is done in parts.
const MOST_PIECES: usize = 24;

/// Instructions for a look at one face, on the average.
const LOOK: usize = 1000;

/// The search for the stretches of one edge after the other.
pub struct Search<'a> {
    around: Surroundings<'a>,
    grid: Grid<'a>,
    /// One bit for each rank: whether the edge has met this face.
    seen: &'a mut [u32],
    /// The same: whether a face has met this one, for seams.
    met: &'a mut [u32],
    profile: Profile<'a>,
    options: Options,
}

impl<'a> Search<'a> {
    /// Bytes with which it does its work, slowly.
    pub const fn least_bytes(faces: usize) -> usize {
        2 * Scratch::bytes_for::<u32>(faces.div_ceil(32))
            + Scratch::bytes_for::<Piece>(FEWEST_PIECES)
            + Grid::least_bytes(faces)
    }

    /// Makes ready, with all of `scratch`.
    pub fn new(
        around: Surroundings<'a>,
        options: Options,
        mut scratch: Scratch<'a>,
        pace: &mut Pace<'_>,
    ) -> Result<Self, VisibilityError> {
        let faces = around.faces.len();
        let seen = scratch.take(faces.div_ceil(32))?;
        let met = scratch.take(faces.div_ceil(32))?;
        let spare = scratch.available_bytes().saturating_sub(Self::least_bytes(faces));
        let more_pieces = spare / 8 / size_of::<Piece>();
        let pieces = scratch.take(MOST_PIECES.min(FEWEST_PIECES + more_pieces))?;
        let grid = Grid::new(&around.outlook, around.outlines, &around.faces, scratch, pace)?;
        Ok(Self { around, grid, seen, met, profile: Profile::new(pieces), options })
    }

    /// How many faces have no area.
    pub fn degenerate_faces(&self) -> u32 {
        self.around.faces.degenerate()
    }

    /// Finds the stretches of every edge.
    pub fn follow_edges(
        &mut self,
        pace: &mut Pace<'_>,
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        for (first, element) in self.around.outlines.elements() {
            for (number, p, q) in sides(element) {
                let side = first + number;
                if self.around.chosen.contains(side) {
                    let outlook = &self.around.outlook;
                    let sight = Sight::new(side, outlook.end(p), outlook.end(q));
                    self.follow(&sight, [None; 2], pace, sink)?;
                }
            }
        }
        Ok(())
    }

    /// Finds the seams and what is seen of them.
    pub fn follow_seams(
        &mut self,
        pace: &mut Pace<'_>,
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        for one in 0..self.around.faces.len() {
            self.meet(one);
            let extent = self.around.extent(one);
            for word in one / 32..self.met.len() {
                let mut bits = self.met[word];
                while bits != 0 {
                    let other = 32 * word + bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    if extent.meets(&self.around.extent(other)) {
                        self.follow_seams_of(one, other, pace, sink)?;
                    }
                    pace.spend(200)?;
                }
            }
            pace.spend(1000)?;
        }
        Ok(())
    }

    fn follow_seams_of(
        &mut self,
        one: usize,
        other: usize,
        pace: &mut Pace<'_>,
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        let [face_one, face_other] = [one, other].map(|rank| self.around.faces.get(rank));
        if self.around.share_edge(face_one, face_other) {
            return Ok(());
        }
        let mut n = 0;
        while let Some(triangle_one) = self.around.triangle(face_one, n) {
            n += 1;
            pace.spend(1500)?;
            if !self.around.passes_through(face_other, triangle_one) {
                continue;
            }
            let mut m = 0;
            while let Some(triangle_other) = self.around.triangle(face_other, m) {
                m += 1;
                pace.spend(3000)?;
                if !self.around.passes_through(face_one, triangle_other) {
                    continue;
                }
                let outlook = &self.around.outlook;
                let triangles = [triangle_one, triangle_other];
                let [corners_one, corners_other] =
                    triangles.map(|triangle| triangle.map(|number| outlook.vertex(number)));
                let of_one = outlook.heights(triangle_other, triangle_one);
                let of_other = outlook.heights(triangle_one, triangle_other);
                if let Some((p, q)) = seam(corners_one, corners_other, of_one, of_other) {
                    let (p, q) = (outlook.free_end(p), outlook.free_end(q));
                    let sight = Sight::of_seam(triangles, p, q);
                    self.follow(&sight, [Some(one), Some(other)], pace, sink)?;
                }
            }
        }
        Ok(())
    }

    /// Leaves in `met` the faces after `one` that may pass through it where something is seen.
    fn meet(&mut self, one: usize) {
        let Self { around, grid, met, .. } = self;
        met.fill(0);
        let corners = around.outlines.element(around.faces.get(one).first);
        let bounds = Bounds::of(&around.outlook, corners);
        let depths = corners.iter().map(|corner| around.outlook.vertex(corner.vertex()).z);
        let far = depths.max().unwrap_or(-COORDINATE_LIMIT);
        grid.within(&bounds, |ranks| {
            let near_enough = ranks
                .iter()
                .map(|&rank| usize::from(rank))
                .take_while(|&rank| !around.faces.begins_behind(rank, far));
            for other in near_enough.filter(|&other| other > one) {
                met[other / 32] |= 1 << (other % 32);
            }
        });
    }

    /// Finds the stretches of an edge, or of the seam of two faces.
    fn follow(
        &mut self,
        sight: &Sight,
        seam_of: [Option<usize>; 2],
        pace: &mut Pace<'_>,
        sink: &mut dyn StretchSink,
    ) -> Result<(), VisibilityError> {
        let outlook = &self.around.outlook;
        let ends = (sight.p.vertex, sight.q.vertex);
        if outlook.direction(ends.0, ends.1).is_none() {
            return Ok(());
        }
        let pen_at = |corner: usize| self.around.outlines.pens.at(corner);
        let pen_of = |rank: &usize| pen_at(self.around.faces.get(*rank).first);
        let pen = seam_of.iter().flatten().map(pen_of).min().unwrap_or_else(|| pen_at(sight.side));
        let edge = (sight.side != Sight::NO_SIDE).then_some((sight.p.number, sight.q.number));
        let mut pending: Option<Stretch> = None;
        let mut start = Along::START;
        while start < Along::END {
            self.profile.open(start);
            self.look_around(sight, seam_of, pace)?;
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

    /// Marks on the profile what every face along the way does to the edge.
    fn look_around(
        &mut self,
        sight: &Sight,
        seam_of: [Option<usize>; 2],
        pace: &mut Pace<'_>,
    ) -> Result<(), Aborted> {
        let Self { around, grid, seen, profile, options, .. } = self;
        let faces_by_rank = &around.faces;
        let near = coarse_depth(sight.near);
        let way = grid.way(sight.p.place, sight.q.place, near);
        let (mut any_covered, mut all_covered) = (false, true);
        way.visit(|cell| {
            any_covered |= cell.cover.is_some();
            all_covered &= cell.cover.is_some();
            true
        });
        if all_covered {
            profile.mark(Part::WHOLE, mark::HIDDEN);
            return pace.spend(1000);
        }
        seen.fill(0);
        for rank in seam_of.into_iter().flatten() {
            seen[rank / 32] |= 1 << (rank % 32);
            if options.merged_blocks {
                sight.touch(around, faces_by_rank.get(rank), rank, profile);
            }
        }
        let mut spent = pace.spend(1000);
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
            spent = spent.and_then(|()| pace.spend(LOOK));
            spent.is_ok() && !profile.is_hidden()
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
        spent
    }
}
