//! The width of the numbers by which models refer to their vertices, and the memory for them.

use penup::boards::host::lend_memory;
use penup::plotter::MemorySlices;
use penup_job::room::Room;

/// A number by which a model refers to a vertex: as on a board.
#[cfg(not(feature = "wide"))]
pub type Number = u16;
/// A number by which a large model refers to a vertex.
#[cfg(feature = "wide")]
pub type Number = u32;

/// Whether numbers of 16 bits are too narrow for a model that needs this room.
pub fn is_wide(room: Room) -> bool {
    room.vertices > <penup::model::Corner<u16>>::VERTEX_NUMBER_LIMIT || room.corners > 1 << 16
}

/// Memory for a model that needs this room. It lasts as long as the worker.
#[cfg(not(feature = "wide"))]
pub fn memory(_: Room) -> MemorySlices<'static, Number> {
    // As much as numbers of 16 bits can use: then nothing depends on the file.
    lend_memory()
}

/// Memory for a model that needs this room. It lasts as long as the worker.
#[cfg(feature = "wide")]
pub fn memory(room: Room) -> MemorySlices<'static, Number> {
    room.lend()
}
