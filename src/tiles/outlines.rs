//! Goes through the elements that may meet a rectangle of the page.

use super::blocks::BlockCursor;
use super::outline::Outline;
use super::page::{Rectangle, Window};
use super::region::RegionCursor;
use super::{Listed, ModelSource, Tiles};
use core::slice;

/// Where the elements are found.
enum Origin<'a> {
    /// In a list that contains exactly these elements.
    List(slice::Iter<'a, u32>),
    /// In the list of a region, which also contains other elements.
    Region(RegionCursor<'a>),
    /// In the blocks of the model that may meet the rectangle.
    Model(BlockCursor),
}

/// Iterates over the elements that may meet a rectangle, in the order of the model. Each other
/// element that has to be examined yields `None`, so that the caller can check for cancelling.
pub(super) struct Outlines<'a, 't, S> {
    /// The search.
    tiles: &'a Tiles<'t, S>,
    /// Where the elements are found.
    origin: Origin<'a>,
    /// The rectangle.
    near: Rectangle,
    /// The rectangle as bounds on the page.
    window: Window,
    /// The bounds within which each element begins that meets the rectangle, if it extends no
    /// farther than `extent`.
    around: Window,
    /// The greatest extent of the elements on the grid.
    extent: [u16; 2],
}

impl<'t, S: ModelSource> Tiles<'t, S> {
    /// Iterates over the elements that may meet a rectangle. They are taken from `listed`, if it
    /// has all of them, else from the region, if it has, else from the model.
    pub(super) fn outlines<'a>(
        &'a self,
        near: Rectangle,
        listed: Option<&'a Listed<'_>>,
    ) -> Outlines<'a, 't, S> {
        let origin = match listed.filter(|listed| listed.near.includes(near)) {
            Some(listed) => Origin::List(listed.firsts.iter()),
            None if self.region.includes(near) => Origin::Region(self.region.cursor()),
            None => Origin::Model(self.blocks.cursor(near)),
        };
        let window = self.survey.window(near);
        Outlines { tiles: self, origin, near, window, around: window, extent: [0; 2] }
    }
}

impl<'t, S: ModelSource> Iterator for Outlines<'_, 't, S> {
    type Item = Option<Outline<'t, S>>;

    #[inline(never)] // All that go through the elements share one copy of the code.
    fn next(&mut self) -> Option<Self::Item> {
        let Tiles { source, parameters, survey, blocks, region, .. } = self.tiles;
        let (outline, extent) = match &mut self.origin {
            Origin::List(firsts) => {
                return Some(Some(Outline::at(*source, *firsts.next()? as usize)));
            }
            Origin::Region(cursor) => (Outline::at(*source, cursor.next()?), region.extent()),
            Origin::Model(cursor) => blocks.next(cursor, *source)?,
        };
        if self.near == Rectangle::ALL {
            return Some(Some(outline));
        }
        // Most elements are small and lie far away: then one of their vertices is enough.
        if self.extent != extent {
            (self.around, self.extent) = (survey.window_around(self.near, extent), extent);
        }
        Some(outline.may_meet(parameters, &self.window, &self.around).then_some(outline))
    }
}
