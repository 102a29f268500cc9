//! The one place that owns memory: capacities are chosen here, by the board.

use crate::model::{Corner, Position};
use crate::motion::Block;

/// Step-planning blocks that look ahead: see [`crate::motion`].
pub const BLOCKS: usize = 64;

/// All memory of a plotter but the stack and the queues of its board.
#[derive(Debug)]
pub struct Memory<const VERTICES: usize, const CORNERS: usize, const WORDS: usize> {
    vertices: heapless::Vec<Position, VERTICES>,
    corners: heapless::Vec<Corner, CORNERS>,
    blocks: heapless::Vec<Block, BLOCKS>,
    words: [u64; WORDS],
}

/// For 64 KiB of RAM: a lattice of 125 cubes.
pub type Lm3s6965Memory = Memory<1024, 3072, 4352>;

/// For 264 KiB of RAM: a lattice of 343 cubes.
pub type PicoMemory = Memory<4096, 12288, 16384>;

/// For the preview on a computer: as many vertices as an element can name.
pub type HostMemory = Memory<16384, 65536, { 1 << 19 }>;

impl<const VERTICES: usize, const CORNERS: usize, const WORDS: usize>
    Memory<VERTICES, CORNERS, WORDS>
{
    /// Empty: all bytes zero, so that a static of it takes no flash.
    pub const fn new() -> Self {
        Self {
            vertices: heapless::Vec::new(),
            corners: heapless::Vec::new(),
            blocks: heapless::Vec::new(),
            words: [0; WORDS],
        }
    }

    /// Lends it to a plotter.
    pub fn lend(&mut self) -> Lent<'_> {
        while self.blocks.push(Block::EMPTY).is_ok() {}
        Lent {
            vertices: &mut self.vertices,
            corners: &mut self.corners,
            blocks: &mut self.blocks,
            words: &mut self.words,
        }
    }
}

impl<const VERTICES: usize, const CORNERS: usize, const WORDS: usize> Default
    for Memory<VERTICES, CORNERS, WORDS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// Memory lent to a plotter, of whatever size.
#[derive(Debug)]
pub struct Lent<'m> {
    /// For the model's vertices.
    pub vertices: &'m mut heapless::VecView<Position>,
    /// For the corners of its faces and the ends of its bars.
    pub corners: &'m mut heapless::VecView<Corner>,
    /// For the moves planned ahead.
    pub blocks: &'m mut [Block],
    /// For the stages of a job and the drawing that comes of it.
    pub words: &'m mut [u64],
}
