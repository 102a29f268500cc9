//! Hidden-line removal for a model that is larger than the working memory, one part of the page
//! after the other.
//!
//! The page is divided into tiles. The edges and seams of a tile are those that begin in it, and a
//! small scene is loaded for them: every element of the model that meets the rectangle around them.
//! Nothing else can change what is seen of them. So [`find_stretches`] hands over the same
//! stretches as [`crate::visibility::find_stretches`], in another order. No edge is cut where tiles
//! meet.
//!
//! * A tile whose scene does not fit is divided.
//! * An edge that is longer than a tile would draw in much that only it needs. If the scene does
//!   not fit, such edges are followed one by one, each with the elements that meet it. The same is
//!   done with the seams of two faces that are both larger than the tile.
//! * An edge is not followed if the near plane made it.
//!
//! The model is read again and again ([`ModelSource`]), so it may lie in slow memory. A coarse
//! index says which parts of it lie where on the page.
//!
//! # Memory
//! A search can be paused between two tiles ([`Tiles::pause`]); only its index then stays in
//! memory. A sixteenth of the memory at most is the index of the blocks; another KiB counts the
//! elements on each part of the page, and a sixteenth lists the elements around the next tiles. A
//! small scene takes 8 bytes for each element, 32 for each
//! vertex (20 if no positions are known), 2 for each corner, and what the search takes. The fewest
//! elements for which there must be room are those that meet a single edge.
//!
//! # Limits
//! Refused are an edge that meets more elements than fit into the memory, and a point at which more
//! elements meet.

mod alone;
mod blocks;
mod load;
mod needs;
mod outline;
mod outlines;
mod owner;
mod page;
mod region;
mod source;

use crate::geometry::{Precision, Projection, Vertex};
use crate::index::Index;
use crate::model::{Corner, Position};
use crate::stage::{Aborted, Cancel, Scratch};
use crate::visibility::{Options, StretchSink, VisibilityError, YieldCounter};
use blocks::{Blocks, PausedBlocks};
use load::Reach;
use outline::Outline;
use owner::OfTile;
use page::{Rectangle, Tile};
use region::{PausedRegion, Region};

pub use page::Survey;
pub use source::{Projected, ProjectedStored};

/// A model that is read repeatedly: its corners, and its vertices as a camera sees them.
pub trait ModelSource {
    /// Returns the number of corners of all faces and bars.
    fn corner_count(&self) -> usize;

    /// Returns the corner with an index below [`ModelSource::corner_count`]. The last one is marked
    /// as the last of its element.
    fn corner(&self, index: usize) -> Corner<u32>;

    /// Returns the pen, from 0, of the element to which a corner belongs.
    fn pen(&self, corner: usize) -> u8;

    /// Returns the position of a vertex in the model. `None` if positions are not known, which is
    /// then so for all vertices.
    fn position(&self, vertex: u32) -> Option<Position>;

    /// Returns a vertex in view coordinates.
    fn vertex(&self, vertex: u32) -> Vertex;
}

/// The parameters of the view of a model: how vertices are projected, and how exact they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ViewParameters {
    /// Whether the view is perspective or parallel.
    pub projection: Projection,
    /// The least depth that is drawn; what is nearer is cut off.
    pub near: Option<i32>,
    /// The greatest possible error of the positions in the model.
    pub precision: Precision,
    /// Twice the possible error of a view coordinate, at least 1.
    pub error_bound: u32,
}

/// The greatest number of long edges, or of pairs of large faces, that are followed one by one as
/// long as a tile can be divided.
const MOST_ALONE: usize = 12;

/// The number of instructions for finding out whether an element may meet a rectangle.
const LOOK: usize = 3000;
/// The number of instructions for placing an element on the page.
const PLACE: usize = 8000;

/// The margin of a region is its shorter side divided by this number, because the next tiles also
/// need the elements beside them.
const REGION_MARGIN: u16 = 16;

/// The bytes that are needed for each element of a tile in most models, including those for
/// elements beside the tile and for the search. A tile with more elements than fit by this estimate
/// is divided before it is loaded.
const LIKELY_BYTES: usize = 72;

/// The search for the stretches of a model, tile after tile.
pub struct Tiles<'t, S> {
    /// The model.
    source: &'t S,
    /// The parameters of the view.
    parameters: ViewParameters,
    /// Which kinds of stretches the user wants to see.
    options: Options,
    /// What is known of all elements.
    survey: Survey,
    /// Where the elements lie on the page.
    blocks: Blocks<'t>,
    /// The elements around the next tiles.
    region: Region<'t>,
    /// The tile that comes next.
    next: Option<Tile>,
}

/// A search between two tiles. Its index lies in memory that others must not change.
#[derive(Debug, Clone, Copy)]
pub struct PausedTiles {
    /// What is known of all elements.
    survey: Survey,
    /// How the index of the blocks lies in memory.
    blocks: PausedBlocks,
    /// The elements around the next tiles.
    region: PausedRegion,
    /// The tile that comes next.
    next: Option<Tile>,
}

impl PausedTiles {
    /// The number of words at the front of the memory that the index takes.
    pub fn index_words(&self) -> usize {
        self.blocks.words() + self.region.words()
    }

    /// The number of faces that are left out because they have no area.
    pub fn degenerate_faces(&self) -> u32 {
        self.survey.degenerate_faces
    }

    /// Whether there is no tile left.
    pub fn is_over(&self) -> bool {
        self.next.is_none()
    }

    /// Begins anew with the first tile.
    pub fn restart(&mut self) {
        self.next = Some(Tile::FIRST);
    }

    /// Divides the tile that comes next. Returns whether that is possible.
    pub fn divide(&mut self) -> bool {
        let divided = self.next.and_then(Tile::divided);
        self.next = divided.or(self.next);
        divided.is_some()
    }
}

/// Finds the stretches of every edge, every bar and every seam of a model and hands them to `sink`.
/// They are those of [`crate::visibility::find_stretches`], in another order. Where the near plane
/// cuts an edge, the vertex there has the number [`Index::NONE`]; of several vertices at one
/// position, the stretch may name another than the first.
///
/// # Errors
/// See [`VisibilityError`]. By then the sink may already have received some of the stretches.
pub fn find_stretches<S: ModelSource, N: Index>(
    source: &S,
    parameters: ViewParameters,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<N>,
) -> Result<Option<Survey>, VisibilityError> {
    let mut scratch = scratch; // It lives no longer than the source.
    let Some(mut tiles) = Tiles::new(source, parameters, options, &mut scratch, cancel)? else {
        return Ok(None);
    };
    while tiles.follow_next(scratch.reborrow(), cancel, sink)? {}
    Ok(Some(tiles.survey))
}

/// The elements that may meet a rectangle, in the order of the model.
#[derive(Debug, Clone, Copy)]
struct Listed<'a> {
    /// For each the index of its first corner.
    firsts: &'a [u32],
    /// The rectangle.
    near: Rectangle,
}

impl<'t, S: ModelSource> Tiles<'t, S> {
    /// Goes through the model twice and prepares the search. Returns `None` if nothing is seen.
    ///
    /// # Errors
    /// [`VisibilityError::Scratch`] or [`VisibilityError::Aborted`].
    pub fn new(
        source: &'t S,
        parameters: ViewParameters,
        options: Options,
        scratch: &mut Scratch<'t>,
        cancel: &mut dyn Cancel,
    ) -> Result<Option<Self>, VisibilityError> {
        let Some(survey) = Survey::new(source, &parameters, cancel)? else { return Ok(None) };
        let blocks = Blocks::new(source, &parameters, &survey, scratch, cancel)?;
        let region = Region::new(scratch)?;
        Ok(Some(Self {
            source,
            parameters,
            options,
            survey,
            blocks,
            region,
            next: Some(Tile::FIRST),
        }))
    }

    /// Ends for now, so that the memory can be used for other things. The index, which lies at the
    /// front of the memory that was given to [`Tiles::new`], must stay as it is.
    pub fn pause(self) -> PausedTiles {
        let Self { survey, blocks, region, next, .. } = self;
        PausedTiles { survey, blocks: blocks.pause(), region: region.known, next }
    }

    /// Goes on with a search, with the same model and options. `index` is the memory that was given
    /// to [`Tiles::new`], or the front of it. Returns `None` if it is shorter than the index.
    pub fn go_on(
        source: &'t S,
        parameters: ViewParameters,
        options: Options,
        paused: PausedTiles,
        index: &'t mut [u64],
    ) -> Option<Self> {
        let PausedTiles { survey, blocks, region, next } = paused;
        let (of_blocks, of_region) = index.split_at_mut_checked(blocks.words())?;
        let blocks = Blocks::go_on(blocks, of_blocks)?;
        let region = Region::go_on(region, of_region)?;
        Some(Self { source, parameters, options, survey, blocks, region, next })
    }

    /// Calls `visit` with each point of each element that has an extent and is seen.
    ///
    /// # Errors
    /// [`VisibilityError::Aborted`].
    pub fn each_point(
        &self,
        cancel: &mut dyn Cancel,
        visit: &mut dyn FnMut(Vertex),
    ) -> Result<(), VisibilityError> {
        let yield_counter = &mut YieldCounter::new(cancel);
        let mut first = 0;
        while first < self.source.corner_count() {
            yield_counter.spend(PLACE)?;
            let outline = Outline::at(self.source, first);
            first = outline.end();
            let is_seen = outline.bounds(&self.parameters, &self.survey).is_some();
            if is_seen && outline.has_extent() {
                outline.each_point(self.parameters.near, visit);
            }
        }
        Ok(())
    }

    /// Finds the stretches of the next tile. Returns whether there was one.
    ///
    /// # Errors
    /// See [`VisibilityError`]. If the sink is full, [`PausedTiles::divide`] makes the tile
    /// smaller, and the search may go on with it; what the sink has received of it is void.
    pub fn follow_next<N: Index>(
        &mut self,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<bool, VisibilityError> {
        let Some(mut tile) = self.next else { return Ok(false) };
        while !self.follow(tile, scratch.reborrow(), cancel, sink)? {
            // If the tile was not followed, it can be divided.
            tile = tile.divided().unwrap_or(tile);
            self.next = Some(tile);
        }
        self.next = tile.next();
        Ok(true)
    }

    /// Makes the region one that has a tile, as large as there is room for. If even the tile has
    /// too many elements, there is no region.
    fn move_region(&mut self, tile: Tile, cancel: &mut dyn Cancel) -> Result<(), Aborted> {
        if self.region.includes(tile.rectangle()) {
            return Ok(());
        }
        self.region.clear();
        while let Some(part) = tile.part_of(self.region.known.depth) {
            let part = part.rectangle();
            if self.blocks.count_at_least(part) <= self.region.room()
                && self.list_region(part, cancel)?
            {
                return Ok(());
            }
            self.region.known.depth += 1;
        }
        self.region.known.depth = tile.depth();
        Ok(())
    }

    /// Lists the elements around a part of the page as the region. Returns whether they fit.
    fn list_region(&mut self, part: Rectangle, cancel: &mut dyn Cancel) -> Result<bool, Aborted> {
        let margin = part.extent().iter().min().map_or(0, |extent| extent / REGION_MARGIN);
        let near = part.grown(margin);
        let extent = self.blocks.extent(near);
        let mut region = self.region.take();
        let mut outcome = Ok(true);
        let yield_counter = &mut YieldCounter::new(cancel);
        for outline in self.outlines(near, None) {
            outcome = yield_counter
                .spend(LOOK)
                .map(|()| outline.is_none_or(|outline| region.push(outline.first())));
            if outcome != Ok(true) {
                break;
            }
        }
        self.region = region;
        if outcome == Ok(true) {
            self.region.finish(near, extent);
        }
        outcome
    }

    /// Lists the elements that may meet a rectangle. Returns `None` if they do not fit.
    fn list<'a>(
        &self,
        near: Rectangle,
        scratch: &mut Scratch<'a>,
        cancel: &mut dyn Cancel,
    ) -> Result<Option<Listed<'a>>, VisibilityError> {
        let mut is_whole = true;
        let firsts = scratch.take_filled(|room| {
            let mut count = 0;
            let yield_counter = &mut YieldCounter::new(cancel);
            for outline in self.outlines(near, None) {
                yield_counter.spend(LOOK)?;
                let Some(outline) = outline else { continue };
                let Some(slot) = room.get_mut(count) else {
                    is_whole = false;
                    break;
                };
                *slot = outline.first() as u32;
                count += 1;
            }
            Ok::<_, VisibilityError>(if is_whole { count } else { 0 })
        })?;
        Ok(is_whole.then_some(Listed { firsts, near }))
    }

    /// Returns how far on the grid a face may lie beside a seam or an edge that it touches.
    fn error_bound(&self) -> u16 {
        // The ends of a seam are rounded. In a parallel view they stay within both faces.
        let is_rounded =
            self.options.with_seams && self.parameters.projection == Projection::Perspective;
        let of_seams = if is_rounded { self.survey.error_bound(1) } else { 0 };
        // A block touches another if it does so within the error of both.
        let of_blocks = if self.options.merged_blocks {
            self.survey.error_bound(self.parameters.error_bound.saturating_mul(2))
        } else {
            0
        };
        of_seams.max(of_blocks)
    }

    /// Finds the stretches of a tile. Returns `false`, and hands over nothing, if it must be
    /// divided.
    fn follow<N: Index>(
        &mut self,
        tile: Tile,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<bool, VisibilityError> {
        let can_divide = tile.divided().is_some();
        let rectangle = tile.rectangle();
        let available = scratch.available_bytes();
        let is_full =
            |elements: usize| can_divide && elements.saturating_mul(LIKELY_BYTES) > available;
        if is_full(self.blocks.count_at_least(rectangle)) {
            return Ok(false);
        }
        let limit = rectangle.extent();
        let no_small_faces = limit.iter().any(|&part| part < self.error_bound());
        // Most edges that begin in the tile end not far beside it.
        let margin = limit.iter().min().map_or(0, |limit| limit / 4);
        self.move_region(tile, cancel)?;
        let near = self.region.clip(rectangle, rectangle.grown(margin));
        let listed = self.list(near, &mut scratch, cancel)?;
        let listed = listed.as_ref();
        let needs = self.needs(rectangle, no_small_faces, listed, cancel)?;
        if needs.all == Rectangle::NONE {
            return Ok(true);
        }
        if is_full(needs.elements) {
            return Ok(false);
        }
        let mut batch = |reach: Rectangle, limit: Option<[u16; 2]>| {
            let mut scratch = scratch.reborrow();
            let reach = Reach::Rectangle(reach.grown(self.error_bound()));
            let loaded = &self.load(reach, listed, &mut scratch, cancel)?;
            let near = self.parameters.near;
            let mut owner = OfTile { tile: rectangle, limit, no_small_faces, loaded, near };
            self.search(loaded, &mut owner, can_divide, scratch, cancel, sink)
        };
        match batch(needs.all, None) {
            Ok(()) => return Ok(true),
            Err(error) if !is_too_large(error) => return Err(error),
            Err(error) => {
                let alone = needs.long_sides.max(needs.large_pairs);
                if alone == 0 {
                    return if can_divide { Ok(false) } else { Err(error) };
                }
                if can_divide && alone > MOST_ALONE {
                    return Ok(false);
                }
            }
        }
        if needs.short != Rectangle::NONE {
            match batch(needs.short, Some(limit)) {
                Ok(()) => {}
                Err(error) if can_divide && is_too_large(error) => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        self.follow_long_edges(rectangle, listed, scratch.reborrow(), cancel, sink)?;
        if self.options.with_seams {
            self.follow_large_pairs(rectangle, no_small_faces, listed, scratch, cancel, sink)?;
        }
        Ok(true)
    }
}

/// Whether a smaller part of the model may do where this error came.
fn is_too_large(error: VisibilityError) -> bool {
    matches!(
        error,
        VisibilityError::Scratch(_)
            | VisibilityError::TooManyCorners(_)
            | VisibilityError::TooManyVertices { .. }
    )
}
