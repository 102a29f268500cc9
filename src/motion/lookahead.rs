//! The blocks that are known but not yet begun, and how fast the first of them may end.

use super::PathLength;
use crate::drawing::LineType;

/// A straight move that waits: 24 bytes.
///
/// A small board lends 100 to 128 of them (2.4 to 3 KiB): at 50 mm/s and 200 mm/s² the stopping
/// distance is 6.25 mm, which is 125 blocks of 0.05 mm. With fewer blocks the machine is slower on
/// such paths, never wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    pub(super) dx: i32,
    pub(super) dy: i32,
    pub(super) length: PathLength,
    /// Stopping distance with which the block may be entered.
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
}

/// A ring of blocks, in the order in which they are drawn.
#[derive(Debug)]
pub struct Lookahead<'m> {
    blocks: &'m mut [Block],
    first: usize,
    count: usize,
}

impl<'m> Lookahead<'m> {
    /// A ring in the memory lent; its length is the capacity.
    pub fn new(blocks: &'m mut [Block]) -> Self {
        Self { blocks, first: 0, count: 0 }
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
        Ok(())
    }

    /// Takes the block to be drawn next.
    pub(super) fn pop(&mut self) -> Option<Block> {
        let block = *self.front()?;
        self.first = self.wrapped(1);
        self.count -= 1;
        Some(block)
    }

    pub(super) fn front(&self) -> Option<&Block> {
        self.iter().next()
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    fn wrapped(&self, index: usize) -> usize {
        let index = self.first + index;
        if index >= self.blocks.len() { index - self.blocks.len() } else { index }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Block> {
        let (wrapped, straight) = self.blocks.split_at(self.first);
        straight.iter().chain(wrapped).take(self.count)
    }

    /// The last blocks, from the `least`th to the `most`th counted from 1 at the end, are part of a
    /// curve.
    pub(super) fn limit_curve(&mut self, least: u32, most: u32, limit: PathLength) {
        for back in least.max(1)..=most {
            let Some(index) = self.count.checked_sub(back as usize) else {
                return;
            };
            let at = self.wrapped(index);
            if let Some(block) = self.blocks.get_mut(at) {
                block.curve_limit = block.curve_limit.min(limit);
            }
        }
    }

    /// The greatest stopping distance with which the first block may be entered, such that every
    /// junction known is passed within its limit and the path known is not overrun. At most `top`.
    ///
    /// A limit that stands `d` further on allows `d` more here. Beyond `top` nothing binds, so the
    /// search ends there; it visits each block at most once.
    pub(super) fn entry_allowed(&self, top: PathLength) -> PathLength {
        let mut allowed = top;
        let mut distance = PathLength::ZERO;
        for block in self.iter() {
            let limit = block.entry_limit.min(block.curve_limit);
            allowed = allowed.min(distance.saturating_add(limit));
            distance = distance.saturating_add(block.length);
            if distance >= allowed {
                return allowed;
            }
        }
        // At the end of what is known the machine must be able to stand.
        allowed.min(distance)
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
}
