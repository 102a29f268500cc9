//! The blocks that are known but not yet begun, and the speed with which the first of them may be
//! entered.
//!
//! The file is longer than 500 lines, because most of it are the short questions and orders of the
//! planner about one list of blocks.

use super::speed_limit::{CornerLimit, FeedOverride, SpeedLimit};
use super::{Limits, PathLength};
use crate::drawing::LineType;

/// A straight move that waits, or up to six short ones that are planned as one. It takes 52 bytes,
/// or 56 with the feature `spread-backlash`.
///
/// The LM3S6965 lends 15 of them and the Pico 128 (`src/board_table.rs`). Short moves are joined as
/// far as the stopping distance requires it (`Lookahead::join`). If the blocks cannot hold that
/// distance, the machine is slower, but never wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    pub(super) dx: i32,
    pub(super) dy: i32,
    pub(super) length: PathLength,
    /// The greatest stopping distance with which the block may be entered; see
    /// [`Lookahead::passes_limits_on`].
    pub(super) entry_limit: PathLength,
    /// The greatest stopping distance within the block, which may be part of a curve.
    pub(super) curve_limit: PathLength,
    /// The feed, or another limit that belongs to the block.
    pub(super) speed_limit: SpeedLimit,
    /// What the corner at its beginning allows. `entry_limit` is derived from it again when the
    /// override changes. [`Lookahead::push`] sets it.
    pub(super) corner: CornerLimit,
    pub(super) ink: Option<LineType>,
    /// See [`Move`](super::Move).
    pub(super) offsets: [i16; 2],
    pub(super) kind: BlockKind,
    /// The number of chords behind the first one, which is given by `dx` and `dy`.
    pub(super) chord_count: u8,
    /// The number of moves that were joined to this block, including those that continue a straight
    /// line.
    pub(super) points: u8,
    /// The chords behind the first one. Entries beyond `chord_count` have no meaning.
    pub(super) chords: [Chord; MOST_CHORDS - 1],
    /// By how much the path of the motors is longer than what the pen draws, because it takes up
    /// backlash as well.
    #[cfg(feature = "spread-backlash")]
    pub(super) extra: PathLength,
}

/// A chord of a block behind the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(align(4))] // Copied as one word.
pub(super) struct Chord {
    pub(super) dx: i8,
    pub(super) dy: i8,
    /// The length in units of 2^-18 mm, so up to 1/4 mm. The first chord has the rest of the
    /// block's length.
    length: u16,
}

impl Chord {
    pub(super) fn length(&self) -> PathLength {
        PathLength::from_bits(self.length.into())
    }

    /// The number of single moves of the chord.
    pub(super) fn moves(&self) -> u32 {
        u32::from(self.dx.unsigned_abs().max(self.dy.unsigned_abs()))
    }
}

/// The most chords that are one block.
pub(super) const MOST_CHORDS: usize = 6;

/// The purpose of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BlockKind {
    /// A line.
    Line,
    /// A gap within an inked line: the pen is raised.
    Gap,
    /// The motors only take up their backlash: the pen stays where it is.
    Backlash,
    /// A line at whose beginning a motor reverses, which takes up its backlash while the pen draws.
    #[cfg(feature = "spread-backlash")]
    Reversal,
}

impl Block {
    /// A block that fills the memory lent to a [`Lookahead`].
    pub const EMPTY: Self = Self {
        dx: 0,
        dy: 0,
        length: PathLength::ZERO,
        entry_limit: PathLength::ZERO,
        curve_limit: PathLength::MAX,
        speed_limit: SpeedLimit::NONE,
        corner: CornerLimit::STOP,
        ink: None,
        offsets: [0; 2],
        kind: BlockKind::Line,
        chord_count: 0,
        points: 1,
        chords: [Chord { dx: 0, dy: 0, length: 0 }; MOST_CHORDS - 1],
        #[cfg(feature = "spread-backlash")]
        extra: PathLength::ZERO,
    };

    /// The chords behind the first one.
    pub(super) fn chords(&self) -> &[Chord] {
        self.chords.get(..usize::from(self.chord_count)).unwrap_or(&[])
    }

    /// Appends a chord, if there is room and it is short enough.
    fn push_chord(&mut self, dx: i32, dy: i32, length: PathLength) -> bool {
        let length = u16::try_from(length.to_bits());
        if let (Ok(dx), Ok(dy), Ok(length)) = (dx.try_into(), dy.try_into(), length)
            && let Some(chord) = self.chords.get_mut(usize::from(self.chord_count))
        {
            *chord = Chord { dx, dy, length };
            self.chord_count += 1;
            return true;
        }
        false
    }

    /// The greatest stopping distance at its beginning.
    pub(super) fn limit(&self) -> PathLength {
        self.entry_limit.min(self.curve_limit)
    }
}

/// A ring of blocks, in the order in which they are drawn.
#[derive(Debug)]
pub struct Lookahead<'m> {
    blocks: &'m mut [Block],
    first: usize,
    count: usize,
    /// How the feeds of the blocks are scaled.
    feed_override: FeedOverride,
    /// The total length of all blocks, in units of 2^-18 mm.
    length: u64,
    /// The total length of the last blocks, which later points may show to be part of a bend.
    open: PathLength,
    /// The number of blocks that consist of more than one move.
    joined: usize,
    /// Whether each block's `entry_limit` is lowered to what the blocks behind it allow, and to its
    /// `curve_limit`, so that nothing has to be searched when the block before it begins.
    passes_limits_on: bool,
    /// The lowest limit of all blocks, known only if limits are not passed on.
    lowest: PathLength,
    /// The index of the last block that has this limit.
    lowest_at: usize,
    /// The lowest limit that was imposed on waiting blocks since [`Lookahead::take_lowered`].
    lowered: PathLength,
    /// The lowest limit that came too late for the block taken last.
    late: PathLength,
}

impl<'m> Lookahead<'m> {
    /// Creates a ring in this memory, whose length is the capacity.
    pub fn new(blocks: &'m mut [Block]) -> Self {
        Self {
            blocks,
            first: 0,
            count: 0,
            feed_override: FeedOverride::NONE,
            length: 0,
            open: PathLength::ZERO,
            joined: 0,
            passes_limits_on: true,
            lowest: PathLength::MAX,
            lowest_at: 0,
            lowered: PathLength::MAX,
            late: PathLength::MAX,
        }
    }

    /// The number of blocks that fit.
    pub fn capacity(&self) -> usize {
        self.blocks.len()
    }

    /// The number of blocks that wait.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether no block waits.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether no more blocks fit.
    pub fn is_full(&self) -> bool {
        self.count == self.blocks.len()
    }

    /// Chooses whether limits are passed on to earlier blocks, which is exact only without a limit
    /// on jerk. No block may wait.
    pub(super) fn pass_limits_on(&mut self, on: bool) {
        self.passes_limits_on = on;
        self.find_lowest();
    }

    /// Scales the feeds of all blocks, and determines anew how fast each may be entered. It is
    /// called seldom, so it goes through all of them.
    #[inline(never)]
    pub(super) fn set_override(&mut self, feed_override: FeedOverride) {
        self.feed_override = feed_override;
        let mut behind = PathLength::MAX;
        for index in (0..self.count).rev() {
            let at = self.wrapped(index);
            let Some(block) = self.blocks.get_mut(at) else {
                continue;
            };
            let feed = feed_override.stopping_distance(block.speed_limit);
            block.entry_limit = block.corner.limit().min(feed);
            if self.passes_limits_on {
                let allowed = block.curve_limit.min(behind.saturating_add(block.length));
                block.entry_limit = block.entry_limit.min(allowed);
                behind = block.entry_limit;
            }
        }
        self.find_lowest();
    }

    /// The greatest stopping distance within a block.
    pub(super) fn limit_within(&self, block: &Block) -> PathLength {
        block.curve_limit.min(self.feed_override.stopping_distance(block.speed_limit))
    }

    /// Whether less than half of the memory is in use.
    pub(super) fn is_short(&self) -> bool {
        2 * self.count < self.blocks.len()
    }

    /// Appends a block. Its `entry_limit` is that of its corner.
    ///
    /// # Errors
    /// Hands the block back if the ring is full.
    // So that the caller makes no whole block either.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub(super) fn push(&mut self, block: Block) -> Result<(), Block> {
        if self.is_full() {
            return Err(block);
        }
        let at = self.wrapped(self.count);
        let Some(slot) = self.blocks.get_mut(at) else {
            return Err(block);
        };
        // The fields are copied one by one, without the chords behind the first one, because
        // copying these would cost as much as a plan.
        slot.dx = block.dx;
        slot.dy = block.dy;
        slot.length = block.length;
        slot.speed_limit = block.speed_limit;
        slot.corner = CornerLimit::new(block.entry_limit);
        let feed = self.feed_override.stopping_distance(block.speed_limit);
        slot.entry_limit = block.entry_limit.min(feed);
        slot.curve_limit = block.curve_limit;
        let limit = slot.limit();
        slot.ink = block.ink;
        slot.offsets = block.offsets;
        slot.kind = block.kind;
        #[cfg(feature = "spread-backlash")]
        {
            slot.extra = block.extra;
        }
        slot.chord_count = 0;
        slot.points = 1;
        self.count += 1;
        self.length += u64::from(block.length.to_bits());
        self.open = self.open.saturating_add(block.length);
        if !self.passes_limits_on {
            self.note(self.count - 1, limit);
        } else if limit < PathLength::MAX {
            self.limit_curve(1, 1, block.curve_limit);
        }
        Ok(())
    }

    /// Joins a line to the last block, if that is a line of the same ink. Nothing may limit the
    /// speed between the two. Returns whether it was joined.
    ///
    /// A line that goes on in the same direction (`goes_on`) makes a short block longer, so that
    /// one plan serves for both. Other lines are joined only if the blocks might otherwise not hold
    /// the machine's stopping distance: nothing is joined while the whole path is
    /// [long enough](Limits::enough_path) or less than half of the memory is in use, nor to a block
    /// that has its share of it.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub(super) fn join(&mut self, line: &Block, goes_on: bool, limits: &Limits) -> bool {
        let enough = limits.enough_path.to_bits();
        let is_needed = !self.is_short() && self.length < u64::from(enough);
        let share = if is_needed { enough / self.blocks.len().max(1) as u32 } else { 0 };
        (goes_on || is_needed) && self.join_to_last(line, share, limits)
    }

    /// Joins a line to the last block if that is shorter than its `share`. Returns whether it was
    /// joined.
    ///
    /// The limits of a bend apply to whole blocks. So also one straight line becomes no longer than
    /// that, or than 16 times what rounding explains, which is less than the circles through points
    /// span that find the bend.
    #[inline(never)] // Where chords are long it would only fill the cache.
    fn join_to_last(&mut self, line: &Block, share: u32, limits: &Limits) -> bool {
        let Some(at) = self.count.checked_sub(1).map(|last| self.wrapped(last)) else {
            return false;
        };
        let Some(block) = self.blocks.get_mut(at) else {
            return false;
        };
        let Some(length) = block.length.checked_add(line.length) else {
            return false;
        };
        let are_lines = [&*block, line].iter().all(|block| {
            let is_whole = matches!(block.ink, None | Some(LineType::Full));
            #[cfg(feature = "spread-backlash")]
            let is_whole = is_whole && block.extra == 0;
            is_whole && block.kind == BlockKind::Line && block.offsets == [0; 2]
        });
        let is_in_line =
            block.chord_count == 0 && is_in_line([block.dx, block.dy], [line.dx, line.dy]);
        let most = if is_in_line { share.max(16 * limits.rounding.to_bits()) } else { share };
        if block.length.to_bits() >= most
            || !are_lines
            || block.ink != line.ink
            || block.length == 0
        {
            return false;
        }
        let Some(points) = block.points.checked_add(1) else {
            return false;
        };
        if is_in_line {
            (block.dx, block.dy) = (block.dx + line.dx, block.dy + line.dy);
        } else if !block.push_chord(line.dx, line.dy, line.length) {
            return false;
        }
        block.points = points;
        self.joined += usize::from(points == 2);
        block.length = length;
        self.length += u64::from(line.length.to_bits());
        self.open = self.open.saturating_add(line.length);
        true
    }

    /// Removes the block to be drawn next after `read` has read it in place, because a copy costs
    /// as much as a plan.
    pub(super) fn pop<T>(&mut self, read: impl FnOnce(&Block) -> T) -> Option<T> {
        let block = self.front()?;
        let (length, is_joined) = (block.length, block.points > 1);
        let read = read(block);
        self.joined -= usize::from(is_joined);
        self.late = PathLength::MAX;
        self.first = self.wrapped(1);
        self.count -= 1;
        self.length -= u64::from(length.to_bits());
        match self.lowest_at.checked_sub(1) {
            Some(at) => self.lowest_at = at,
            None if self.passes_limits_on => {}
            None => self.find_lowest(),
        }
        Some(read)
    }

    pub(super) fn front(&self) -> Option<&Block> {
        if self.is_empty() { None } else { self.blocks.get(self.first) }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.joined = 0;
        self.length = 0;
        self.end_curve();
        self.find_lowest();
    }

    /// Determines the lowest limit anew, because the block that had it may have been removed.
    fn find_lowest(&mut self) {
        (self.lowest, self.lowest_at) = (PathLength::MAX, 0);
        if !self.passes_limits_on {
            for index in 0..self.count {
                let limit = self.blocks.get(self.wrapped(index)).map(Block::limit);
                self.note(index, limit.unwrap_or(PathLength::MAX));
            }
        }
    }

    /// Takes account of the limit of a block that is new, or whose limit was lowered.
    fn note(&mut self, index: usize, limit: PathLength) {
        if limit < self.lowest || (limit == self.lowest && index > self.lowest_at) {
            (self.lowest, self.lowest_at) = (limit, index);
        }
    }

    /// The lowest limit of all blocks. It is known only if limits are not passed on.
    pub(super) fn lowest_limit(&self) -> PathLength {
        debug_assert!(!self.passes_limits_on);
        self.lowest
    }

    /// Returns the lowest limit that was imposed on waiting blocks since the last call.
    pub(super) fn take_lowered(&mut self) -> PathLength {
        core::mem::replace(&mut self.lowered, PathLength::MAX)
    }

    /// The total length of all blocks, in units of 2^-32 mm.
    pub(super) fn known(&self) -> u64 {
        self.length << 14
    }

    /// Records that all bends of the blocks so far are known.
    pub(super) fn end_curve(&mut self) {
        self.open = PathLength::ZERO;
    }

    /// The lowest limit for the block taken last that was found only after it was taken.
    pub(super) fn late_limit(&self) -> PathLength {
        self.late
    }

    /// The greatest stopping distance, at a distance `to_end` before the end of all blocks (2^-18
    /// mm), with which the machine can still come to rest there, and can still keep the limits of
    /// bends that later points may reveal.
    ///
    /// At a distance D before the end, a bend that only later points reveal is so wide that the
    /// stopping distance may be D² over [`Limits::surely_known`]. From further away the machine can
    /// brake to that.
    pub(super) fn stopping_distance_at(&self, to_end: u64, limits: &Limits) -> u64 {
        if !limits.centripetal || self.is_empty() {
            return to_end;
        }
        let open = u32::try_from(to_end).unwrap_or(u32::MAX).min(self.open.to_bits());
        let known = limits.surely_known;
        if open >= known.div_ceil(2) {
            to_end - u64::from(known / 4)
        } else {
            let radius = u64::from(open) * u64::from(open) / u64::from(known.max(1));
            to_end - u64::from(open) + radius
        }
    }

    fn wrapped(&self, index: usize) -> usize {
        let index = self.first + index;
        if index >= self.blocks.len() { index - self.blocks.len() } else { index }
    }

    /// The blocks in their order, one by one.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn in_order(&self) -> impl Iterator<Item = &Block> {
        (0..self.count).filter_map(|index| self.blocks.get(self.wrapped(index)))
    }

    /// The blocks in their order, in two parts.
    pub(super) fn blocks(&self) -> [&[Block]; 2] {
        let (wrapped, straight) = self.blocks.split_at(self.first.min(self.blocks.len()));
        let count = self.count.min(straight.len());
        let rest = (self.count - count).min(wrapped.len());
        [&straight[..count], &wrapped[..rest]]
    }

    /// Limits the blocks that end at certain points of a curve: from the `least`th to the `most`th
    /// of the last points, counted from 1 at the end.
    ///
    /// What a block allows is passed on to the blocks before it, each of which may be entered with
    /// a stopping distance that is greater by its own length. This ends where a block already has a
    /// lower limit, which on smooth paths is not far.
    pub(super) fn limit_curve(&mut self, least: u32, most: u32, limit: PathLength) {
        self.lowered = self.lowered.min(limit);
        let mut allowed = PathLength::MAX;
        // If no blocks are joined, each block ends at one point, and the first points need not be
        // counted.
        let mut points = if self.joined == 0 { least.saturating_sub(1) } else { 0 };
        for back in points as usize + 1.. {
            let Some(index) = self.count.checked_sub(back) else {
                if points < most {
                    self.late = self.late.min(limit);
                }
                return;
            };
            let at = self.wrapped(index);
            let Some(block) = self.blocks.get_mut(at) else {
                return;
            };
            let before = points;
            points += u32::from(block.points);
            if points < least {
                continue;
            }
            if before < most {
                block.curve_limit = block.curve_limit.min(limit);
                if !self.passes_limits_on {
                    let limit = block.limit();
                    self.note(index, limit);
                    continue;
                }
                allowed = allowed.min(block.curve_limit);
            } else if !self.passes_limits_on || block.entry_limit <= allowed {
                return;
            }
            block.entry_limit = block.entry_limit.min(allowed);
            let before = at.checked_sub(1).unwrap_or(self.blocks.len().saturating_sub(1));
            let length = self.blocks.get(before).map_or(PathLength::ZERO, |block| block.length);
            allowed = self
                .blocks
                .get(at)
                .map_or(allowed, |block| block.entry_limit)
                .saturating_add(length);
        }
    }

    /// The greatest stopping distance with which the first block may be entered, such that every
    /// known junction is passed within its limit and the machine can stop at the end of the known
    /// path. At most `top`.
    pub(super) fn entry_allowed(&self, top: PathLength, limits: &Limits) -> PathLength {
        debug_assert!(self.passes_limits_on);
        let Some(front) = self.front() else {
            return PathLength::ZERO;
        };
        // At the end of the known path the machine must be able to be at rest.
        let length = self.stopping_distance_at(self.length, limits);
        let length = u32::try_from(length).map_or(PathLength::MAX, PathLength::from_bits);
        top.min(front.entry_limit).min(length)
    }
}

/// Whether two vectors have the same direction, so that both together are one line.
pub(super) fn is_in_line([dx, dy]: [i32; 2], [more_x, more_y]: [i32; 2]) -> bool {
    let product = |a: i32, b: i32| i64::from(a) * i64::from(b);
    product(dx, more_y) == product(dy, more_x) && product(dx, more_x) + product(dy, more_y) > 0
}

#[cfg(test)]
mod tests;
