//! Follows edges and seams one by one: those that would draw in much that the others of a tile do
//! not need.

use super::load::Reach;
use super::outline::Outline;
use super::owner::{OneEdge, OneSeam};
use super::page::{GridPoint, Rectangle};
use super::{Listed, ModelSource, Tiles};
use crate::array::MapEach;
use crate::geometry::Vertex;
use crate::index::Index;
use crate::stage::{Cancel, Scratch};
use crate::visibility::{SinkFull, Stretch, StretchSink, VisibilityError};

impl<'t, S: ModelSource> Tiles<'t, S> {
    /// Follows the edges of a tile that are longer than the tile, one by one.
    pub(super) fn follow_long_edges<N: Index>(
        &self,
        tile: Rectangle,
        listed: Option<&Listed<'_>>,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<(), VisibilityError> {
        let limit = tile.extent();
        for outline in self.outlines(tile, listed) {
            cancel.check()?;
            let Some(outline) = outline.filter(Outline::has_extent) else { continue };
            let mut outcome = Ok(());
            outline.each_side(&self.parameters, &self.survey, &mut |number, ends| {
                let side = Rectangle::around(ends[0], ends[1]);
                if outcome.is_ok() && tile.holds(side.low) && !side.is_within(limit) {
                    let side = (outline.first(), number);
                    outcome = self.follow_edge(side, ends, scratch.reborrow(), cancel, sink);
                }
            });
            outcome?;
        }
        Ok(())
    }

    /// Follows the edge of one side of an element, which is given by its first corner and the
    /// number of the side, if it is the first side along that edge.
    fn follow_edge<N: Index>(
        &self,
        (first, number): (usize, usize),
        ends: [GridPoint; 2],
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<(), VisibilityError> {
        let reach = Reach::Segment(ends, self.error_bound());
        let loaded = self.load(reach, None, &mut scratch, cancel)?;
        let Some(here) = loaded.find(first) else { return Ok(()) };
        let Some(pair) = loaded.side(here, number) else { return Ok(()) };
        // All elements with this edge are loaded.
        if !loaded.is_first_side(here + number, pair) || loaded.is_cut(pair, self.parameters.near) {
            return Ok(());
        }
        self.search(&loaded, &mut OneEdge(pair), false, scratch, cancel, sink)
    }

    /// Follows the seams of a tile whose faces are both larger than the tile, one by one.
    pub(super) fn follow_large_pairs<N: Index>(
        &self,
        tile: Rectangle,
        no_small_faces: bool,
        listed: Option<&Listed<'_>>,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<(), VisibilityError> {
        let limit = tile.extent();
        let large = |outline: Option<Outline<'t, S>>| {
            let outline = outline?;
            let bounds = outline.bounds(&self.parameters, &self.survey)?;
            let is_large = no_small_faces || !bounds.is_within(limit);
            (!outline.is_bar() && is_large && bounds.meets(tile) && outline.has_extent())
                .then(|| (outline.first(), bounds))
        };
        for one in self.outlines(tile, listed).map(large) {
            cancel.check()?;
            let Some((one, bounds)) = one else { continue };
            for other in self.outlines(tile, listed).map(large) {
                cancel.check()?;
                let Some((other, others)) = other else { continue };
                let both = bounds.intersection(others).filter(|_| one < other);
                if both.is_some_and(|both| tile.holds(both.low)) {
                    self.follow_pair([one, other], scratch.reborrow(), cancel, sink)?;
                }
            }
        }
        Ok(())
    }

    /// Follows the seams of two faces, which begin at these corners in ascending order, one by one.
    fn follow_pair<N: Index>(
        &self,
        firsts: [usize; 2],
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<(), VisibilityError> {
        for number in 0.. {
            let Some(ends) = self.seam(firsts, number, scratch.reborrow(), cancel)? else { break };
            let ends = ends.map_each(|end| self.survey.point(self.parameters.projection, end));
            let mut scratch = scratch.reborrow();
            let loaded =
                self.load(Reach::Segment(ends, self.error_bound()), None, &mut scratch, cancel)?;
            let [Some(one), Some(other)] = firsts.map_each(|first| loaded.find(first)) else {
                continue;
            };
            let mut owner = OneSeam::new([one, other], number, true);
            self.search(&loaded, &mut owner, false, scratch, cancel, sink)?;
        }
        Ok(())
    }

    /// Returns the ends of the seam with this number of two faces. `None` if they have fewer seams.
    fn seam(
        &self,
        firsts: [usize; 2],
        number: usize,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
    ) -> Result<Option<[Vertex; 2]>, VisibilityError> {
        let numbers = firsts.map_each(|first| first as u32);
        let both = Listed { firsts: &numbers, near: Rectangle::ALL };
        let loaded = self.load(Reach::Pair(firsts), Some(&both), &mut scratch, cancel)?;
        let [Some(one), Some(other)] = firsts.map_each(|first| loaded.find(first)) else {
            return Ok(None);
        };
        let mut owner = OneSeam::new([one, other], number, false);
        self.search::<u16>(&loaded, &mut owner, false, scratch, cancel, &mut Nowhere)?;
        Ok(owner.ends)
    }
}

/// A sink that receives nothing, because no stretch is followed.
struct Nowhere;

impl StretchSink<u16> for Nowhere {
    fn stretch(&mut self, _: Stretch<u16>) -> Result<(), SinkFull> {
        Ok(())
    }
}
