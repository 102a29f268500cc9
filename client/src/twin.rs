//! What the plotter must hold after a job was sent: the same lines, read by the same library
//! here.

use crate::source::Lines;
use penup::boards::host::HostBoard;
use penup::machine::{EventRing, PulserState};
use penup::model::{Corner, Position, VERTEX_NUMBER_LIMIT};
use penup::plotter::{EMPTY_LOOKAHEAD, MemorySlices, Plotter};
use penup::protocol::LineReader;

/// The checksums of the model and of the options that come of the first `count` of `lines`, sent
/// to a plotter that was just switched on; `None` if it refuses one of them.
pub fn contents(lines: &dyn Lines, count: usize) -> Option<[u32; 2]> {
    let (mut ring, pins) = (EventRing::new(), PulserState::new());
    let mut board = HostBoard::new(&mut ring, &pins);
    let mut vertices = Box::new(heapless::Vec::<Position, VERTEX_NUMBER_LIMIT>::new());
    let mut corners = Box::new(heapless::Vec::<Corner, { 1 << 16 }>::new());
    let mut blocks = EMPTY_LOOKAHEAD;
    // Without memory to work in, no copy of the model is kept for each line.
    let words = &mut [];
    let readers = &mut [LineReader::new()];
    let blocks = &mut blocks;
    let memory =
        MemorySlices { vertices: &mut *vertices, corners: &mut *corners, blocks, words, readers };
    let mut plotter = Plotter::new(memory, &pins);
    for line in (0..count).filter_map(|index| lines.line(index)) {
        board.receive(line.sent.as_bytes());
        board.receive(b"\n");
        while plotter.poll(&mut board) || !board.has_read_all() {}
        if !board.take_sent().ends_with(b"ok\r\n") {
            return None;
        }
    }
    Some([plotter.model().checksum(), plotter.options().checksum()])
}
