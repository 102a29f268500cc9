//! The one place that owns memory: capacities are chosen here, by the board.

use crate::model::{Corner, Position};
use crate::motion::Block;
use crate::protocol::LineReader;

/// The moves planned ahead with 64 KiB of RAM, before any is: see [`crate::motion`].
pub const EMPTY_LOOKAHEAD: [Block; 32] = [Block::EMPTY; 32];

/// The same for 264 KiB of RAM: at 500 mm/s and 15 m/s² the machine stops within 167 chords of 0.05 mm.
pub const EMPTY_LOOKAHEAD_OF_PICO: [Block; 192] = [Block::EMPTY; 192];

/// The large memory of a plotter: a model, what its jobs are computed in, and the line that each of
/// its serial ports is sending.
///
/// New, it is all zero bits, so that a static one costs no flash and is never built on the stack.
#[derive(Debug)]
pub struct Memory<
    const VERTICES: usize,
    const CORNERS: usize,
    const WORDS: usize,
    const PORTS: usize = 1,
> {
    vertices: heapless::Vec<Position, VERTICES>,
    corners: heapless::Vec<Corner, CORNERS>,
    words: [u64; WORDS],
    readers: [LineReader; PORTS],
}

/// For 64 KiB of RAM: a lattice of 125 cubes, and a stack of 9,840 bytes beside it.
pub type Lm3s6965Memory = Memory<1000, 3000, 4208>;

/// For 264 KiB of RAM: a lattice of 343 cubes. Its ports are the UART and USB.
pub type PicoMemory = Memory<4096, 12288, 16384, 2>;

impl<const VERTICES: usize, const CORNERS: usize, const WORDS: usize, const PORTS: usize>
    Memory<VERTICES, CORNERS, WORDS, PORTS>
{
    /// Empty.
    pub const fn new() -> Self {
        Self {
            vertices: heapless::Vec::new(),
            corners: heapless::Vec::new(),
            words: [0; WORDS],
            readers: [const { LineReader::new() }; PORTS],
        }
    }

    /// Lends it to a plotter, with memory for the moves planned ahead.
    pub fn lend<'m>(&'m mut self, blocks: &'m mut [Block]) -> MemorySlices<'m> {
        MemorySlices {
            vertices: &mut self.vertices,
            corners: &mut self.corners,
            blocks,
            words: &mut self.words,
            readers: &mut self.readers,
        }
    }
}

impl<const VERTICES: usize, const CORNERS: usize, const WORDS: usize, const PORTS: usize> Default
    for Memory<VERTICES, CORNERS, WORDS, PORTS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// Memory lent to a plotter, of whatever size.
#[derive(Debug)]
pub struct MemorySlices<'m> {
    /// For the model's vertices.
    pub vertices: &'m mut heapless::VecView<Position>,
    /// For the corners of its faces and the ends of its bars.
    pub corners: &'m mut heapless::VecView<Corner>,
    /// For the moves planned ahead.
    pub blocks: &'m mut [Block],
    /// For the stages of a job and the drawing that comes of it.
    pub words: &'m mut [u64],
    /// For the line that each serial port is sending, by the port's number.
    pub readers: &'m mut [LineReader],
}
