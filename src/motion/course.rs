//! The block in work: its moves, and how far they are.

use super::emitter::Train;
use super::lookahead::BlockKind;
use super::profile::Slice;
use super::{Block, PathLength};
use crate::drawing::LineType;
use crate::step::{Line, Pattern};

/// The block in work.
#[derive(Debug, Clone)]
pub(super) struct BlockCursor {
    pub(super) line: Line,
    pub(super) ink: Option<LineType>,
    kind: BlockKind,
    pub(super) pattern: Pattern,
    pub(super) piece: u32,
    pub(super) length: PathLength,
    pub(super) curve_limit: PathLength,
    /// mm per move, 2^-32.
    pub(super) move_length: u64,
    pub(super) moves: u32,
    pub(super) moves_done: u32,
    /// Moves at the end of the piece.
    pub(super) piece_moves: u32,
    /// From the start of the block to where the plan is, 2^-32 mm.
    pub(super) place: u64,
    /// From there to where the next move is due.
    pub(super) to_next: u64,
    /// Where it shall stand, if that is not the end: a place like the one above, and else the greatest
    /// number.
    stop: u64,
    /// The slice in work begins at `place`.
    pub(super) slice: Option<SliceMoves>,
}

impl BlockCursor {
    /// The beginning of a block, its dots about `dot_length` long.
    pub(super) fn new(block: &Block, dot_length: PathLength) -> Self {
        let line = Line::beside(block.dx, block.dy, block.offsets);
        let moves = line.remaining();
        let move_length = (u64::from(block.length.to_bits()) << 14) / u64::from(moves.max(1));
        let line_type = block.ink.unwrap_or_default();
        let pattern = if line_type == LineType::Full {
            Pattern::full(moves)
        } else {
            let dot_moves = (u64::from(dot_length.to_bits()) << 14) / move_length.max(1);
            Pattern::of(line_type, moves, u32::try_from(dot_moves).unwrap_or(u32::MAX))
        };
        Self {
            line,
            ink: block.ink,
            kind: block.kind,
            pattern,
            piece: 0,
            length: block.length,
            curve_limit: block.curve_limit,
            move_length,
            moves,
            moves_done: 0,
            piece_moves: pattern.end_of(0),
            place: 0,
            to_next: move_length / 2,
            stop: u64::MAX,
            slice: None,
        }
    }

    /// Whether the piece in work is drawn.
    pub(super) fn is_inked(&self) -> bool {
        self.ink.is_some() && self.kind != BlockKind::Gap && Pattern::inked(self.piece)
    }

    /// Whether the motors only take up their slack: the pen stays where it is.
    pub(super) fn is_slack(&self) -> bool {
        self.kind == BlockKind::Slack
    }

    /// Whether it is the last one.
    pub(super) fn is_last_piece(&self) -> bool {
        self.piece_moves == self.moves
    }

    /// From the plan's place to the end of the piece, 2^-32 mm.
    pub(super) fn room(&self) -> u64 {
        let end = if self.is_last_piece() {
            u64::from(self.length.to_bits()) << 14
        } else {
            self.move_length * u64::from(self.piece_moves)
        };
        end.saturating_sub(self.place)
    }

    /// From the plan's place to the first where the machine can stand, which is half a move behind
    /// one, not nearer than `least`: 2^-32 mm. No further than the end of the piece.
    pub(super) fn to_whole_step(&self, least: u64) -> u64 {
        let length = self.move_length.max(1);
        // The first such place, or the one before it.
        let behind = (self.to_next + length / 2) % length;
        let steps = least.saturating_sub(behind).div_ceil(length);
        (behind + steps * length).min(self.room())
    }

    /// Stands at the first such place that is not nearer than `least`, and stays with it: how far that
    /// is, 2^-32 mm.
    pub(super) fn stop_behind(&mut self, least: u64) -> u64 {
        if self.stop == u64::MAX {
            self.stop = self.place + self.to_whole_step(least);
        }
        self.stop.saturating_sub(self.place)
    }

    /// Goes on to the end.
    pub(super) fn resume(&mut self) {
        self.stop = u64::MAX;
    }

    /// The same as a length.
    pub(super) fn left(&self) -> PathLength {
        // Rounded by less than 2^-18 mm; a move is 2^-12 mm or longer and the last one is due half
        // a move before the end, so none is lost. A block is no longer than its length.
        PathLength::from_bits((self.room() >> 14) as u32)
    }

    /// Takes the next slice into work.
    pub(super) fn begin_slice(&mut self, slice: Slice) {
        let mut moves = SliceMoves { slice, left: 0, due: 0, interval: 0 };
        if let Some(room) = u64::from(slice.distance).checked_sub(self.to_next + 1) {
            // Below 1 mm, or 2^32: the settings allow no longer steps.
            let move_length = (self.move_length as u32).max(1);
            // Less than the slice.
            let (room, first) = (room as u32, self.to_next as u32);
            // The length of a move is rounded down, which leaves a rest of nothing behind the last.
            moves.left = (room / move_length + 1).min(self.line.remaining());
            let clock = SliceClock::new(slice);
            moves.due = clock.time_of(first);
            moves.interval = clock.time_of(move_length.min(slice.distance));
        }
        self.slice = Some(moves);
    }

    /// The slice in work is done.
    pub(super) fn end_slice(&mut self, slice: Slice) {
        self.place += u64::from(slice.distance);
        // What is behind the last move is a rest of nothing.
        self.to_next = self.to_next.saturating_sub(slice.distance.into());
        self.slice = None;
    }

    /// So many moves of the slice in work are made.
    pub(super) fn advance(&mut self, count: usize) {
        self.moves_done += count as u32;
        self.to_next += self.move_length * count as u64;
        if let Some(moves) = &mut self.slice {
            moves.left = moves.left.saturating_sub(count as u32);
            moves.due = moves.due.wrapping_add(moves.interval.wrapping_mul(count as u32));
        }
    }

    /// Begins the next piece of a dotted line.
    pub(super) fn next_piece(&mut self) {
        self.piece += 1;
        self.place = self.move_length * u64::from(self.piece_moves);
        self.to_next = self.move_length / 2;
        self.piece_moves = self.pattern.end_of(self.piece);
    }
}

/// A slice in work.
#[derive(Debug, Clone, Copy)]
pub(super) struct SliceMoves {
    pub(super) slice: Slice,
    /// Moves left.
    pub(super) left: u32,
    /// When the next one is due after the slice's beginning, and how long it is from one to the next: units of
    /// [`Train`], below 2^31.
    due: u32,
    interval: u32,
}

impl SliceMoves {
    /// The next moves, at most `most`.
    pub(super) fn train(&self, most: usize) -> Train {
        let count = most.min(self.left as usize);
        Train { first: self.due, interval: self.interval, count }
    }
}

/// Tells when the places of a slice are reached.
struct SliceClock {
    /// By which a distance is shifted so that it counts as a fraction of the slice's.
    zeros: u32,
    /// Time over distance, 2^31 in all at most.
    slowness: u32,
}

impl SliceClock {
    fn new(slice: Slice) -> Self {
        let zeros = slice.distance.leading_zeros();
        // From 2^31 on, and up to 2^31, so that 2^31 is the greatest quotient.
        let distance = u64::from(slice.distance << zeros).max(1);
        let time = u64::from(slice.time << Train::BITS_BELOW);
        Self { zeros, slowness: ((time << 31) / distance) as u32 }
    }

    /// When a place within the slice is reached: below 2^31 units of [`Train`], and 2 units early at most.
    fn time_of(&self, place: u32) -> u32 {
        ((u64::from(place << self.zeros) * u64::from(self.slowness)) >> 31) as u32
    }
}
