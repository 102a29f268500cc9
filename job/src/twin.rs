//! Computes what the plotter must contain after a job was sent, by feeding the same lines to the
//! same plotter library on this computer.

use crate::room::Room;
use penup::boards::host::HostBoard;
use penup::index::Index;
use penup::machine::{EventRing, PulserState};
use penup::model::{Corner, Position};
use penup::plotter::{EMPTY_LOOKAHEAD, HpGlMemory, MemorySlices, Plotter};
use penup::protocol::LineReader;
use penup_readers::lines::Lines;

/// Returns the checksums of the model and of the options that a freshly started plotter has after
/// the first `count` of `lines`. Returns `None` if the library refuses one of these lines.
pub fn contents(lines: &dyn Lines, count: usize) -> Option<[u32; 2]> {
    contents_of::<u32>(lines, count)
}

/// Does the same as [`contents`] by a plotter whose numbers have this width, for a program that
/// has the plotter's code for that width anyway.
pub fn contents_of<I: Index>(lines: &dyn Lines, count: usize) -> Option<[u32; 2]> {
    let (mut ring, pins) = (EventRing::new(), PulserState::new());
    let mut board = HostBoard::new(&mut ring, &pins);
    // The checksums do not depend on the width of the numbers.
    let room = Room::for_job(lines);
    let mut vertices = vec![Position::ORIGIN; room.vertices];
    let mut corners = vec![Corner::<I>::ZERO; room.corners];
    let mut blocks = EMPTY_LOOKAHEAD;
    // Without working memory, the plotter does not copy the model after each line, which saves
    // time.
    let words = &mut [];
    let readers = &mut [LineReader::new()];
    let hpgl = &mut HpGlMemory::new();
    let blocks = &mut blocks;
    let memory = MemorySlices {
        vertices: &mut vertices,
        corners: &mut corners,
        blocks,
        words,
        readers,
        hpgl,
    };
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
