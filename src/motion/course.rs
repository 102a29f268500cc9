//! The block in work: its moves, and how far they are.

use super::emitter::whole_ticks;
use super::lookahead::BlockKind;
use super::profile::Slice;
use super::{Block, PathLength};
use crate::drawing::LineType;
use crate::step::{Line, Pattern};

/// The block in work.
#[derive(Debug, Clone)]
pub(super) struct Course {
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
    /// The slice in work begins at `place`.
    pub(super) slice: Option<Slice>,
}

impl Course {
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

    /// The same as a length.
    pub(super) fn left(&self) -> PathLength {
        // Rounded by less than 2^-18 mm; a move is 2^-12 mm or longer and the last one is due half
        // a move before the end, so none is lost. A block is no longer than its length.
        PathLength::from_bits((self.room() >> 14) as u32)
    }

    /// The next moves that fall into `slice`, as many as there is place for: puts the time of each, in
    /// whole ticks, into `times` if the slice begins at `start`, and says how many they are.
    pub(super) fn next_times(&mut self, slice: Slice, start: u32, times: &mut [u32]) -> usize {
        let Some(room) = u64::from(slice.distance).checked_sub(self.to_next + 1) else {
            return 0;
        };
        // Below 1 mm, or 2^32: the settings allow no longer steps.
        let move_length = (self.move_length as u32).max(1);
        // Less than the slice.
        let (room, first) = (room as u32, self.to_next as u32);
        let count = times.len().min((room / move_length) as usize + 1);
        SliceClock::new(slice).times(start, first, move_length, &mut times[..count]);
        self.to_next += u64::from(move_length) * count as u64;
        count
    }

    /// Begins the next piece of a dotted line.
    pub(super) fn next_piece(&mut self) {
        self.piece += 1;
        self.place = self.move_length * u64::from(self.piece_moves);
        self.to_next = self.move_length / 2;
        self.piece_moves = self.pattern.end_of(self.piece);
    }
}

/// Tells when the places of a slice are reached.
struct SliceClock {
    shift: u32,
    distance: u32,
    time: u32,
}

impl SliceClock {
    fn new(slice: Slice) -> Self {
        // 16 bits of the distance are true to an eighth of a tick.
        let shift = (u32::BITS - slice.distance.leading_zeros()).saturating_sub(16);
        Self { shift, distance: slice.distance >> shift, time: slice.time }
    }

    /// When the places from `first` on, each by `step` further, are reached if the slice begins at
    /// `start`: whole ticks.
    #[inline(never)] // On its own it stays in the registers of a small core.
    fn times(&self, start: u32, first: u32, step: u32, times: &mut [u32]) {
        let Self { shift, distance, time } = *self;
        let mut place = first;
        for reached in times {
            // At most 2^16 - 1 times the time of a whole slice, 2^16.
            let offset = ((place >> shift) * time).checked_div(distance).unwrap_or(0);
            *reached = whole_ticks(start.wrapping_add(offset));
            // Only behind the last can it wrap.
            place = place.wrapping_add(step);
        }
    }
}
