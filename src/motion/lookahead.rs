//! The blocks that are known but not yet begun, and how fast the first of them may end.

use super::PathLength;
use crate::drawing::LineType;

/// A straight move that waits: 24 bytes.
///
/// The LM3S6965 lends 32 of them and the Pico 192 (`src/plotter/memory.rs`). At 50 mm/s and
/// 200 mm/s² the stopping distance is 6.25 mm, which is 125 blocks of 0.05 mm. With fewer blocks the
/// machine is slower on such paths, never wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    pub(super) dx: i32,
    pub(super) dy: i32,
    pub(super) length: PathLength,
    /// Stopping distance with which the block may be entered; see [`Lookahead::passes_limits_on`].
    pub(super) entry_limit: PathLength,
    /// Greatest stopping distance within the block, as it is part of a curve.
    pub(super) curve_limit: PathLength,
    pub(super) ink: Option<LineType>,
    /// See [`Move`](super::Move).
    pub(super) offsets: [i8; 2],
    pub(super) kind: BlockKind,
}

/// What a block is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BlockKind {
    /// A line.
    Line,
    /// A gap within an inked line: the pen is raised.
    Gap,
    /// The motors only take up their slack: the pen stays where it is.
    Slack,
}

impl Block {
    /// A block that fills the memory lent to a [`Lookahead`].
    pub const EMPTY: Self = Self {
        dx: 0,
        dy: 0,
        length: PathLength::ZERO,
        entry_limit: PathLength::ZERO,
        curve_limit: PathLength::MAX,
        ink: None,
        offsets: [0; 2],
        kind: BlockKind::Line,
    };

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
    /// Of all blocks, 2^-18 mm.
    length: u64,
    /// Whether each block's `entry_limit` is lowered to what the blocks behind it allow and to its
    /// `curve_limit`, so that none has to be looked for when the block before it begins.
    passes_limits_on: bool,
    /// The lowest limit of all blocks, and which of them is the last to have it: known only if limits are not passed on.
    lowest: PathLength,
    lowest_at: usize,
    /// The lowest limit that was set to blocks which waited, since it was asked for.
    lowered: PathLength,
}

impl<'m> Lookahead<'m> {
    /// A ring in the memory lent; its length is the capacity.
    pub fn new(blocks: &'m mut [Block]) -> Self {
        Self {
            blocks,
            first: 0,
            count: 0,
            length: 0,
            passes_limits_on: true,
            lowest: PathLength::MAX,
            lowest_at: 0,
            lowered: PathLength::MAX,
        }
    }

    /// Blocks that fit.
    pub fn capacity(&self) -> usize {
        self.blocks.len()
    }

    /// Blocks waiting.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether none wait.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether no more fit.
    pub fn is_full(&self) -> bool {
        self.count == self.blocks.len()
    }

    /// Whether limits are known at each block at once, as if speed might change by the acceleration without a
    /// limit on jerk; while none wait.
    pub(super) fn pass_limits_on(&mut self, on: bool) {
        self.passes_limits_on = on;
        self.find_lowest();
    }

    /// Whether less than half of the memory is in use.
    pub(super) fn is_short(&self) -> bool {
        2 * self.count < self.blocks.len()
    }

    /// Appends a block.
    ///
    /// # Errors
    /// Hands it back if the ring is full.
    pub(super) fn push(&mut self, block: Block) -> Result<(), Block> {
        if self.is_full() {
            return Err(block);
        }
        let at = self.wrapped(self.count);
        match self.blocks.get_mut(at) {
            Some(place) => *place = block,
            None => return Err(block),
        }
        self.count += 1;
        self.length += u64::from(block.length.to_bits());
        if !self.passes_limits_on {
            self.note(self.count - 1, block.limit());
        } else if block.limit() < PathLength::MAX {
            self.limit_curve(1, 1, block.curve_limit);
        }
        Ok(())
    }

    /// Takes the block to be drawn next.
    pub(super) fn pop(&mut self) -> Option<Block> {
        let block = *self.front()?;
        self.first = self.wrapped(1);
        self.count -= 1;
        self.length -= u64::from(block.length.to_bits());
        match self.lowest_at.checked_sub(1) {
            Some(at) => self.lowest_at = at,
            None if self.passes_limits_on => {}
            None => self.find_lowest(),
        }
        Some(block)
    }

    pub(super) fn front(&self) -> Option<&Block> {
        if self.is_empty() { None } else { self.blocks.get(self.first) }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.length = 0;
        self.find_lowest();
    }

    /// The lowest limit of all blocks, of which the one before the first may be the last to have had it.
    fn find_lowest(&mut self) {
        (self.lowest, self.lowest_at) = (PathLength::MAX, 0);
        if !self.passes_limits_on {
            for index in 0..self.count {
                let limit = self.blocks.get(self.wrapped(index)).map(Block::limit);
                self.note(index, limit.unwrap_or(PathLength::MAX));
            }
        }
    }

    /// A block has, or had a higher limit and now has, this one.
    fn note(&mut self, index: usize, limit: PathLength) {
        if limit < self.lowest || (limit == self.lowest && index > self.lowest_at) {
            (self.lowest, self.lowest_at) = (limit, index);
        }
    }

    /// The lowest limit of all blocks; while limits are not passed on.
    pub(super) fn lowest_limit(&self) -> PathLength {
        debug_assert!(!self.passes_limits_on);
        self.lowest
    }

    /// The lowest limit that was set to blocks which waited, since this was asked last.
    pub(super) fn take_lowered(&mut self) -> PathLength {
        core::mem::replace(&mut self.lowered, PathLength::MAX)
    }

    /// The length of all blocks, 2^-32 mm.
    pub(super) fn known(&self) -> u64 {
        self.length << 14
    }

    fn wrapped(&self, index: usize) -> usize {
        let index = self.first + index;
        if index >= self.blocks.len() { index - self.blocks.len() } else { index }
    }

    /// All in their order, in two parts.
    pub(super) fn blocks(&self) -> [&[Block]; 2] {
        let (wrapped, straight) = self.blocks.split_at(self.first.min(self.blocks.len()));
        let count = self.count.min(straight.len());
        let rest = (self.count - count).min(wrapped.len());
        [&straight[..count], &wrapped[..rest]]
    }

    /// The last blocks, from the `least`th to the `most`th counted from 1 at the end, are part of a
    /// curve.
    ///
    /// What one block allows is passed on to those before it, each of which may be entered with its own length
    /// more, as far as that is less than they had: on smooth paths, not far.
    pub(super) fn limit_curve(&mut self, least: u32, most: u32, limit: PathLength) {
        self.lowered = self.lowered.min(limit);
        let mut allowed = PathLength::MAX;
        for back in least.max(1).. {
            let is_curve = back <= most;
            let Some(index) = self.count.checked_sub(back as usize) else {
                return;
            };
            let at = self.wrapped(index);
            let Some(block) = self.blocks.get_mut(at) else {
                return;
            };
            if is_curve {
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
    /// junction known is passed within its limit and the path known is not overrun. At most `top`.
    pub(super) fn entry_allowed(&self, top: PathLength) -> PathLength {
        debug_assert!(self.passes_limits_on);
        let Some(front) = self.front() else {
            return PathLength::ZERO;
        };
        // At the end of what is known the machine must be able to stand.
        let length = u32::try_from(self.length).map_or(PathLength::MAX, PathLength::from_bits);
        top.min(front.entry_limit).min(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(length: u32, entry_limit: u32) -> Block {
        Block {
            length: PathLength::from_bits(length),
            entry_limit: PathLength::from_bits(entry_limit),
            ..Block::EMPTY
        }
    }

    #[test]
    fn a_full_ring_hands_the_block_back_and_keeps_the_order() {
        let mut memory = [Block::EMPTY; 3];
        let mut ring = Lookahead::new(&mut memory);
        for round in 0..5u32 {
            for k in 0..3 {
                assert_eq!(ring.push(block(round * 3 + k, 0)), Ok(()));
            }
            assert_eq!(ring.push(block(99, 0)), Err(block(99, 0)));
            for k in 0..3 {
                assert_eq!(ring.pop(), Some(block(round * 3 + k, 0)));
            }
            assert_eq!(ring.pop(), None);
            ring.push(block(0, 0)).expect("room");
            ring.pop();
        }
        let mut none = Lookahead::new(&mut []);
        assert!(none.push(block(1, 1)).is_err());
        assert_eq!(none.pop(), None);
        assert_eq!(none.entry_allowed(PathLength::MAX), PathLength::ZERO);
    }

    #[test]
    fn the_nearest_binding_limit_counts() {
        let mut memory = [Block::EMPTY; 4];
        let mut ring = Lookahead::new(&mut memory);
        let allowed =
            |ring: &Lookahead, top| ring.entry_allowed(PathLength::from_bits(top)).to_bits();
        ring.push(block(100, 1000)).expect("room");
        assert_eq!(allowed(&ring, 5000), 100);
        ring.push(block(300, 20)).expect("room");
        assert_eq!(allowed(&ring, 5000), 120);
        assert_eq!(allowed(&ring, 50), 50);
        ring.push(block(300, 1000)).expect("room");
        ring.pop();
        assert_eq!(allowed(&ring, 5000), 20);
    }

    #[test]
    fn the_lowest_limit_is_known() {
        let mut memory = [Block::EMPTY; 7];
        let mut ring = Lookahead::new(&mut memory);
        ring.pass_limits_on(false);
        for round in 0..300u32 {
            if ring.is_full() || round % 13 > 9 {
                ring.pop();
            }
            ring.push(block(10, 20 + round * 7 % 31)).expect("room");
            if round % 11 == 0 {
                ring.limit_curve(2, 4, PathLength::from_bits(round * 5 % 37));
            }
            let lowest = ring.blocks().concat().iter().map(Block::limit).min();
            assert_eq!(Some(ring.lowest_limit()), lowest, "{round}");
        }
        ring.clear();
        assert_eq!(ring.lowest_limit(), PathLength::MAX);
    }

    #[test]
    fn what_a_block_allows_is_known_to_all_before_it() {
        let mut memory = [Block::EMPTY; 7];
        let mut ring = Lookahead::new(&mut memory);
        for round in 0..200u32 {
            if ring.is_full() {
                ring.pop();
            }
            let limit = if round % 5 == 0 { round % 70 } else { 5000 };
            ring.push(block(10 + round * 7 % 90, limit)).expect("room");
            if round % 11 == 0 {
                ring.limit_curve(2, 4, PathLength::from_bits(30 + round));
            }
            // Each block by itself, from the end on.
            let blocks: std::vec::Vec<_> = ring.blocks().concat();
            let mut allowed = 0;
            for block in blocks.iter().rev() {
                let limit = block.entry_limit.min(block.curve_limit).to_bits();
                allowed = limit.min(allowed + block.length.to_bits());
            }
            assert_eq!(ring.entry_allowed(PathLength::MAX).to_bits(), allowed, "{round}");
        }
    }
}
