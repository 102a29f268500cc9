//! A coarse index of the model: where on the page the elements of each stretch of corners lie.

use super::outline::Outline;
use super::page::{GridPoint, Rectangle, Survey};
use super::{ModelSource, ViewParameters};
use crate::stage::{Cancel, Scratch, items};
use crate::visibility::VisibilityError;
use bytemuck::{Pod, Zeroable};

/// The index takes at most the working memory divided by this number.
const SHARE: usize = 16;
/// The fewest corners in a block: the index gains little from fewer.
const FEWEST_CORNERS: usize = 24;

/// The rectangle around all elements of a block, in units of 2^8 points of the grid.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct Block {
    /// The lower left corner.
    low: [u8; 2],
    /// The upper right corner; it lies to the left of the other if the block is empty.
    high: [u8; 2],
    /// The greatest extent of an element of the block, to the right and upwards.
    extent: [u8; 2],
}

impl Block {
    /// Returns the smallest block that contains a rectangle.
    fn around(bounds: Rectangle) -> Self {
        let coarse = |point: GridPoint| [(point.x >> 8) as u8, (point.y >> 8) as u8];
        Self { low: coarse(bounds.low), high: coarse(bounds.high), extent: [0; 2] }
    }

    /// Returns how far an element of the block extends on the grid, or a little more.
    fn extent(self) -> [u16; 2] {
        self.extent.map(|extent| u16::from(extent) << 8 | 0xFF)
    }

    /// Whether the block may meet another one.
    fn meets(self, other: Self) -> bool {
        (0..2).all(|axis: usize| {
            self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis]
        })
    }
}

/// The page is divided into this many rows and columns to count the elements on it.
const DIVISIONS: u16 = 16;

/// The number of parts that this makes.
const PARTS: usize = (DIVISIONS * DIVISIONS) as usize;

/// The layout of the index of a model in memory: the blocks, and the counts behind them.
#[derive(Debug, Clone, Copy)]
pub(super) struct PausedBlocks {
    /// The number of blocks.
    count: usize,
    /// The number of corners of a block.
    length: usize,
}

impl PausedBlocks {
    /// The number of words of memory.
    pub fn words(self) -> usize {
        let bytes = Scratch::bytes_for::<Block>(self.count) + Scratch::bytes_for::<u32>(PARTS);
        bytes / size_of::<u64>()
    }
}

/// The index of a model.
#[derive(Debug)]
pub(super) struct Blocks<'t> {
    /// The blocks, in the order of the model.
    blocks: &'t [Block],
    /// The number of elements that have their lower left corner in each part of the page, row by
    /// row.
    counts: &'t [u32],
    /// The number of corners of a block. An element belongs to the block in which it begins.
    length: usize,
}

impl<'t> Blocks<'t> {
    /// Goes through the model and makes the index.
    ///
    /// # Errors
    /// [`VisibilityError::Scratch`] or [`VisibilityError::Aborted`].
    pub fn new<S: ModelSource>(
        source: &S,
        parameters: &ViewParameters,
        survey: &Survey,
        scratch: &mut Scratch<'t>,
        cancel: &mut dyn Cancel,
    ) -> Result<Self, VisibilityError> {
        let corners = source.corner_count();
        let most = (scratch.available_bytes() / (SHARE * size_of::<Block>())).max(1);
        let length = corners.div_ceil(most).max(FEWEST_CORNERS);
        let blocks: &mut [Block] = scratch.take(corners.div_ceil(length))?;
        let counts: &mut [u32] = scratch.take(PARTS)?;
        let mut first = 0;
        for (number, block) in blocks.iter_mut().enumerate() {
            let (mut all, mut extent) = (Rectangle::NONE, [0; 2]);
            while first < corners.min((number + 1) * length) {
                cancel.check()?;
                let outline = Outline::at(source, first);
                first = outline.end();
                let Some(bounds) = outline.bounds(parameters, survey) else { continue };
                all = all.union(bounds);
                for (most, here) in extent.iter_mut().zip(bounds.extent()) {
                    *most = here.max(*most);
                }
                if let Some(count) = counts.get_mut(part_of(bounds.low)) {
                    *count += 1;
                }
            }
            *block = Block { extent: extent.map(|most| (most >> 8) as u8), ..Block::around(all) };
        }
        Ok(Self { blocks, counts, length })
    }

    /// Returns how the index lies in memory.
    pub fn pause(&self) -> PausedBlocks {
        PausedBlocks { count: self.blocks.len(), length: self.length }
    }

    /// Restores the index, which lies at the front of the memory in which it was made.
    pub fn go_on(paused: PausedBlocks, memory: &'t [u64]) -> Option<Self> {
        let PausedBlocks { count, length } = paused;
        let blocks = items(memory, count)?;
        let behind = memory.get(Scratch::bytes_for::<Block>(count) / size_of::<u64>()..)?;
        Some(Self { blocks, counts: items(behind, PARTS)?, length })
    }

    /// Returns a number of elements that have their lower left corner in a rectangle. There may be
    /// more if the rectangle is small.
    pub fn count_at_least(&self, rectangle: Rectangle) -> usize {
        let size = u16::MAX / DIVISIONS + 1;
        let Rectangle { low, high } = rectangle;
        let whole = |low: u16, high: u16| {
            low.div_ceil(size)..high.checked_add(1).map_or(DIVISIONS, |end| end / size)
        };
        let rows = whole(low.y, high.y);
        rows.flat_map(|row| {
            whole(low.x, high.x).map(move |column| usize::from(row * DIVISIONS + column))
        })
        .filter_map(|part| self.counts.get(part))
        .map(|&count| count as usize)
        .sum()
    }

    /// Returns how far the elements of the blocks that may meet a rectangle extend on the grid at
    /// most, or a little more.
    pub fn extent(&self, near: Rectangle) -> [u16; 2] {
        let wanted = Block::around(near);
        self.blocks.iter().filter(|block| block.meets(wanted)).fold([0; 2], |most, block| {
            let extent = block.extent();
            [most[0].max(extent[0]), most[1].max(extent[1])]
        })
    }

    /// Begins to go through the elements of all blocks that may meet a rectangle.
    pub fn cursor(&self, near: Rectangle) -> BlockCursor {
        BlockCursor { near: Block::around(near), block: 0, next: 0, end: 0, extent: [0; 2] }
    }

    /// Returns the next element, and how far those of its block extend on the grid at most.
    pub fn next<'s, S: ModelSource>(
        &self,
        cursor: &mut BlockCursor,
        source: &'s S,
    ) -> Option<(Outline<'s, S>, [u16; 2])> {
        while cursor.next >= cursor.end {
            let block = self.blocks.get(cursor.block)?;
            if block.meets(cursor.near) {
                cursor.next = start_after(source, cursor.block * self.length);
                cursor.end = source.corner_count().min((cursor.block + 1) * self.length);
                cursor.extent = block.extent();
            }
            cursor.block += 1;
        }
        let outline = Outline::at(source, cursor.next);
        cursor.next = outline.end();
        Some((outline, cursor.extent))
    }
}

/// The position in an iteration over the blocks.
pub(super) struct BlockCursor {
    /// The rectangle that the blocks may meet.
    near: Block,
    /// The number of the next block.
    block: usize,
    /// The first corner of the next element of the block before it, unless it is `end`.
    next: usize,
    /// The corner at which that block ends.
    end: usize,
    /// The greatest extent of the elements of that block on the grid.
    extent: [u16; 2],
}

/// Returns the index of the count to which a point belongs.
fn part_of(point: GridPoint) -> usize {
    let size = u16::MAX / DIVISIONS + 1;
    usize::from(point.y / size * DIVISIONS + point.x / size)
}

/// Returns where the first element begins at a corner or after it.
fn start_after<S: ModelSource>(source: &S, corner: usize) -> usize {
    let Some(before) = corner.checked_sub(1) else { return 0 };
    Outline::at(source, before).end()
}
