//! What the edges and seams of a tile need: the part of the page whose elements must be loaded, and
//! how many edges and seams are too long for it.

use super::page::Rectangle;
use super::{LOOK, Listed, ModelSource, PLACE, Tiles};
use crate::stage::Cancel;
use crate::visibility::{VisibilityError, YieldCounter};

/// The memory and the elements that the edges and seams of a tile need.
#[derive(Debug, Clone, Copy)]
pub(super) struct TileNeeds {
    /// The rectangle around all of them, [`Rectangle::NONE`] if there are none.
    pub all: Rectangle,
    /// The rectangle around those that are not longer than the tile.
    pub short: Rectangle,
    /// The number of sides of elements that are longer.
    pub long_sides: usize,
    /// The number of pairs of faces that are both larger, if seams are drawn.
    pub large_pairs: usize,
    /// The number of elements on the tile.
    pub elements: usize,
}

/// Counts the pairs of faces whose rectangles have the lower left corner of their intersection on a
/// tile.
///
/// All faces that are counted meet the tile. The corner lies on the tile unless both faces begin to
/// the left of it or both begin below it.
#[derive(Debug, Clone, Copy, Default)]
struct Pairs {
    /// The number of faces.
    all: usize,
    /// The number of those that begin to the left of the tile.
    from_left: usize,
    /// The number of those that begin below it.
    from_below: usize,
    /// The number of those that do both.
    from_both: usize,
}

impl Pairs {
    /// Counts a face by its rectangle, as far as pairs with it may belong to `tile`.
    fn add(&mut self, face: Rectangle, tile: Rectangle) {
        let from_left = face.low.x < tile.low.x;
        let from_below = face.low.y < tile.low.y;
        self.all += 1;
        self.from_left += usize::from(from_left);
        self.from_below += usize::from(from_below);
        self.from_both += usize::from(from_left && from_below);
    }

    /// Returns the number of pairs.
    fn count(&self) -> usize {
        let pairs = |faces: usize| faces.saturating_mul(faces.saturating_sub(1)) / 2;
        let beside = pairs(self.from_left) + pairs(self.from_below) - pairs(self.from_both);
        pairs(self.all) - beside
    }
}

impl<S: ModelSource> Tiles<'_, S> {
    /// Finds out what the edges and seams of a tile need.
    pub(super) fn needs(
        &self,
        tile: Rectangle,
        no_small_faces: bool,
        listed: Option<&Listed<'_>>,
        cancel: &mut dyn Cancel,
    ) -> Result<TileNeeds, VisibilityError> {
        let none = Rectangle::NONE;
        let mut needs =
            TileNeeds { all: none, short: none, long_sides: 0, large_pairs: 0, elements: 0 };
        let (mut faces, mut large_faces) = (Pairs::default(), Pairs::default());
        let (mut of_faces, mut of_small_faces) = (none, none);
        let limit = tile.extent();
        let beyond = Rectangle { high: Rectangle::ALL.high, ..tile };
        let yield_counter = &mut YieldCounter::new(cancel);
        let window = self.survey.window(tile);
        for outline in self.outlines(tile, listed) {
            yield_counter.spend(LOOK)?;
            let Some(outline) = outline else { continue };
            if !outline.meets(&self.parameters, &self.survey, tile, &window) {
                continue;
            }
            yield_counter.spend(PLACE)?;
            let mut around = none;
            outline.each_side(&self.parameters, &self.survey, &mut |_, [a, b]| {
                let side = Rectangle::around(a, b);
                around = around.union(side);
                if !tile.holds(side.low) {
                    return;
                }
                needs.all = needs.all.union(side);
                if side.is_within(limit) {
                    needs.short = needs.short.union(side);
                } else {
                    needs.long_sides += 1;
                }
            });
            needs.elements += 1;
            if !self.options.with_seams || outline.is_bar() {
                continue;
            }
            let Some(part) = around.intersection(beyond) else { continue };
            faces.add(around, tile);
            of_faces = of_faces.union(part);
            if around.is_within(limit) && !no_small_faces {
                of_small_faces = of_small_faces.union(part);
            } else {
                large_faces.add(around, tile);
            }
        }
        needs.large_pairs = large_faces.count();
        if faces.count() > 0 {
            needs.all = needs.all.union(of_faces);
        }
        if faces.count() > needs.large_pairs {
            needs.short = needs.short.union(of_small_faces);
        }
        Ok(needs)
    }
}
