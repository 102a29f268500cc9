//! The large memory of a plotter. The table of the boards has the capacities of each:
//! [`crate::board_table`].

use crate::board_table::BOARDS;
use crate::model::{Corner, Position};
use crate::motion::Block;
use crate::protocol::LineReader;

/// Memory for the moves planned ahead on the first board of the table, which has the least, before
/// any is planned; see [`crate::motion`].
pub const EMPTY_LOOKAHEAD: [Block; BOARDS[0].memory.blocks] =
    [Block::EMPTY; BOARDS[0].memory.blocks];

/// What has been received of HP-GL, and its interpreter.
#[cfg(feature = "hpgl")]
pub type HpGlMemory = crate::hpgl::Session;

/// Without the feature `hpgl` there is nothing of HP-GL to remember.
#[cfg(not(feature = "hpgl"))]
#[derive(Debug, Default)]
pub struct HpGlMemory;

#[cfg(not(feature = "hpgl"))]
impl HpGlMemory {
    /// Makes the memory.
    pub const fn new() -> Self {
        Self
    }
}

/// The large memory of a plotter: the model, the working memory of its jobs, and the line that each
/// serial port is receiving.
///
/// A new one consists of zero bits only. As a static variable, it therefore takes no flash and is
/// never built on the stack.
#[derive(Debug)]
pub struct Memory<
    const VERTICES: usize,
    const CORNERS: usize,
    const WORDS: usize,
    const PORTS: usize = 1,
> {
    /// The vertices of the model.
    vertices: [Position; VERTICES],
    /// Memory for the corners of its faces and the ends of its bars.
    corners: [Corner; CORNERS],
    /// Working memory for the stages of a job (the parts of its computation) and for the drawing
    /// that they compute.
    words: [u64; WORDS],
    /// The line that each serial port is receiving.
    readers: [LineReader; PORTS],
    /// What has been received of HP-GL, and its interpreter.
    hpgl: HpGlMemory,
}

impl<const VERTICES: usize, const CORNERS: usize, const WORDS: usize, const PORTS: usize>
    Memory<VERTICES, CORNERS, WORDS, PORTS>
{
    /// Makes an empty memory, for a static variable.
    pub const fn new() -> Self {
        Self {
            vertices: [Position::ORIGIN; VERTICES],
            corners: [Corner::ZERO; CORNERS],
            words: [0; WORDS],
            readers: [const { LineReader::new() }; PORTS],
            hpgl: HpGlMemory::new(),
        }
    }

    /// Lends this memory to a plotter, together with `blocks` for the moves planned ahead.
    pub fn lend<'m>(&'m mut self, blocks: &'m mut [Block]) -> MemorySlices<'m> {
        MemorySlices {
            vertices: &mut self.vertices,
            corners: &mut self.corners,
            blocks,
            words: &mut self.words,
            readers: &mut self.readers,
            hpgl: &mut self.hpgl,
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

/// The memory that a plotter borrows. Its type does not depend on the capacities.
#[derive(Debug)]
pub struct MemorySlices<'m, I = u16> {
    /// Memory for the model's vertices.
    pub vertices: &'m mut [Position],
    /// Memory for the corners of its faces and the ends of its bars.
    pub corners: &'m mut [Corner<I>],
    /// Memory for the moves that are planned ahead.
    pub blocks: &'m mut [Block],
    /// Working memory for the stages of a job (the parts of its computation) and for the drawing
    /// that they compute.
    pub words: &'m mut [u64],
    /// The line that each serial port is receiving, indexed by the port's number.
    pub readers: &'m mut [LineReader],
    /// What has been received of HP-GL, and its interpreter.
    pub hpgl: &'m mut HpGlMemory,
}
