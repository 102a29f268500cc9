//! The current block: its moves, and how far they are carried out.

use super::emitter::Train;
use super::lookahead::{BlockKind, Chord, MOST_CHORDS};
use super::profile::Slice;
use super::{Block, PathLength, SpeedLimit};
#[cfg(feature = "input-shaping")]
use crate::array::MapEach;
use crate::drawing::LineType;
use crate::step::{Line, Pattern};

/// The current block and the progress within it.
#[derive(Debug, Clone)]
pub(super) struct BlockCursor {
    pub(super) line: Line,
    pub(super) ink: Option<LineType>,
    kind: BlockKind,
    pub(super) pattern: Pattern,
    /// The number of the current piece of a dotted line.
    pub(super) piece: u32,
    pub(super) length: PathLength,
    #[cfg(feature = "spread-backlash")]
    extra: PathLength,
    pub(super) curve_limit: PathLength,
    pub(super) speed_limit: SpeedLimit,
    /// The length of a move, in units of 2^-32 mm.
    pub(super) move_length: u64,
    /// The number of moves of the block.
    pub(super) moves: u32,
    pub(super) moves_done: u32,
    /// The number of moves up to the end of the current piece.
    pub(super) piece_moves: u32,
    /// The distance from the start of the block to the position of the plan, in units of 2^-32 mm.
    pub(super) position: u64,
    /// The distance from there to the position at which the next move is due.
    pub(super) to_next: u64,
    /// The position at which the machine is to stop, counted like `position`; the greatest number
    /// if it is to go on to the end.
    stop: u64,
    /// The moves of the current slice, which begins at `position`.
    pub(super) slice: Option<SliceMoves>,
    /// The rest of a slice that was cut at the end of a chord.
    rest: Slice,
    chords: [Chord; MOST_CHORDS - 1],
    chord_count: u8,
    /// The number of chords that are begun.
    begun: u8,
    /// The distance from the start of the block to the end of the current chord, in units of 2^-32
    /// mm. It has no meaning in the last chord.
    chord_end: u64,
}

/// Returns the total length of chords, and the number of their moves.
#[inline(never)] // Blocks without chords never come here: it would only fill the cache.
fn sums(chords: &[Chord]) -> (PathLength, u32) {
    (chords.iter().map(Chord::length).sum(), chords.iter().map(Chord::moves).sum())
}

impl BlockCursor {
    /// Begins a block whose dots, if it is dotted, are about `dot_length` long.
    #[inline(always)] // A copy of what it returns costs as much as a plan.
    pub(super) fn new(block: &Block, dot_length: PathLength) -> Self {
        let line = Line::beside(block.dx, block.dy, block.offsets);
        let (later_length, later_moves) =
            if block.chord_count == 0 { (PathLength::ZERO, 0) } else { sums(block.chords()) };
        let first = u64::from((block.length - later_length).to_bits()) << 14;
        let move_length = first / u64::from(line.remaining().max(1));
        let moves = line.remaining() + later_moves;
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
            #[cfg(feature = "spread-backlash")]
            extra: block.extra,
            curve_limit: block.curve_limit,
            speed_limit: block.speed_limit,
            move_length,
            moves,
            moves_done: 0,
            piece_moves: pattern.end_of(0),
            position: 0,
            to_next: move_length / 2,
            stop: u64::MAX,
            slice: None,
            rest: Slice::default(),
            chords: block.chords,
            chord_count: block.chord_count,
            begun: 0,
            chord_end: first,
        }
    }

    /// Whether the current piece is drawn.
    pub(super) fn is_inked(&self) -> bool {
        self.ink.is_some() && self.kind != BlockKind::Gap && Pattern::inked(self.piece)
    }

    /// Whether the motors only take up their backlash: the pen stays where it is.
    pub(super) fn takes_up_backlash(&self) -> bool {
        self.kind == BlockKind::Backlash
    }

    /// The length of what the pen draws in the block.
    pub(super) fn drawn(&self) -> PathLength {
        #[cfg(feature = "spread-backlash")]
        return self.length.saturating_sub(self.extra);
        #[cfg(not(feature = "spread-backlash"))]
        self.length
    }

    /// Whether a motor with backlash reverses in the block.
    #[cfg(feature = "spread-backlash")]
    pub(super) fn reverses(&self) -> bool {
        matches!(self.kind, BlockKind::Backlash | BlockKind::Reversal)
    }

    /// Whether the current piece is the last one.
    pub(super) fn is_last_piece(&self) -> bool {
        self.piece_moves == self.moves
    }

    /// The distance from the position of the plan to the end of the current piece, in units of
    /// 2^-32 mm.
    pub(super) fn room(&self) -> u64 {
        let end = if self.is_last_piece() {
            u64::from(self.length.to_bits()) << 14
        } else {
            self.move_length * u64::from(self.piece_moves)
        };
        end.saturating_sub(self.position)
    }

    /// The distance from the position of the plan to the first position, not nearer than `least`,
    /// at which the machine can be at rest: half a move after a step. It is in units of 2^-32 mm,
    /// and does not exceed the distance to the end of the piece.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn to_whole_step(&self, least: u64) -> u64 {
        let length = self.move_length.max(1);
        // The first position of this kind, or the one before it.
        let behind = (self.to_next + length / 2) % length;
        let stand = behind + least.saturating_sub(behind).div_ceil(length) * length;
        let end = self.chord_end.saturating_sub(self.position);
        if self.is_last_chord() || stand <= end {
            return stand.min(self.room());
        }
        self.to_whole_step_behind(least, stand, end)
    }

    /// Does the work of [`Self::to_whole_step`] from the `end` of the current chord on.
    #[inline(never)] // Blocks without chords never come here: it would only fill the cache.
    fn to_whole_step_behind(&self, least: u64, mut stand: u64, mut end: u64) -> u64 {
        for chord in self.later_chords().iter().skip(self.begun.into()) {
            if stand <= end {
                break;
            }
            // Where one chord ends, the next begins.
            let whole = u64::from(chord.length().to_bits()) << 14;
            let length = (whole / u64::from(chord.moves().max(1))).max(1);
            stand = end + least.saturating_sub(end).div_ceil(length) * length;
            end += whole;
        }
        stand.min(self.room())
    }

    /// Chooses the first position not nearer than `least` at which the machine can be at rest, and
    /// keeps this choice. Returns the distance to it, in units of 2^-32 mm.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn stop_behind(&mut self, least: u64) -> u64 {
        if self.stop == u64::MAX {
            self.stop = self.position + self.to_whole_step(least);
        }
        self.stop.saturating_sub(self.position)
    }

    /// Cancels the stop, so that the block is carried out to its end.
    pub(super) fn resume(&mut self) {
        self.stop = u64::MAX;
    }

    /// The distance from the position of the plan to the end of the current piece.
    pub(super) fn left(&self) -> PathLength {
        // Rounded by less than 2^-18 mm; a move is 2^-12 mm or longer and the last one is due half
        // a move before the end, so none is lost. A block is no longer than its length.
        PathLength::from_bits((self.room() >> 14) as u32)
    }

    /// Begins the rest of the last slice. Returns whether there is one.
    pub(super) fn begin_rest(&mut self) -> bool {
        let has_rest = self.rest.distance > 0;
        if has_rest {
            self.begin_that_rest();
        }
        has_rest
    }

    #[inline(never)] // Blocks without chords never come here: it would only fill the cache.
    fn begin_that_rest(&mut self) {
        let rest = core::mem::take(&mut self.rest);
        self.begin_slice(rest);
    }

    /// Begins the next slice, up to the end of the current chord.
    pub(super) fn begin_slice(&mut self, mut slice: Slice) {
        if !self.is_last_chord() {
            slice = self.cut_slice(slice);
        }
        let mut moves = SliceMoves { slice, left: 0, due: 0, interval: 0 };
        if let Some(room) = u64::from(slice.distance).checked_sub(self.to_next + 1) {
            // The settings limit a step to less than 1 mm, which is 2^32 units.
            let move_length = (self.move_length as u32).max(1);
            // Both are less than the distance of the slice.
            let (room, first) = (room as u32, self.to_next as u32);
            // The length of a move is rounded down, so a rest without a move follows the last one.
            moves.left = (room / move_length + 1).min(self.line.remaining());
            let clock = SliceClock::new(slice);
            moves.due = clock.time_of(first);
            moves.interval = clock.time_of(move_length.min(slice.distance));
        }
        self.slice = Some(moves);
    }

    /// Returns the part of a slice within the current chord, and keeps the rest.
    #[inline(never)] // Blocks without chords never come here: it would only fill the cache.
    fn cut_slice(&mut self, slice: Slice) -> Slice {
        let room = self.chord_end.saturating_sub(self.position);
        if u64::from(slice.distance) <= room {
            return slice;
        }
        // The room is less than the distance, so the result is less than the time.
        let time = (u64::from(slice.time) * room / u64::from(slice.distance)) as u32;
        let distance = room as u32;
        self.rest = Slice { distance: slice.distance - distance, time: slice.time - time };
        Slice { distance, time }
    }

    /// Ends the current slice. Returns whether a new chord begins.
    pub(super) fn end_slice(&mut self, slice: Slice) -> bool {
        self.position += u64::from(slice.distance);
        // After the last move only a rest without a move is left.
        self.to_next = self.to_next.saturating_sub(slice.distance.into());
        self.slice = None;
        let ends = !self.is_last_chord() && self.position >= self.chord_end;
        if ends {
            self.next_chord();
        }
        ends
    }

    #[inline(never)] // Blocks without chords never come here: it would only fill the cache.
    fn next_chord(&mut self) {
        if let Some(chord) = self.later_chords().get(usize::from(self.begun)).copied() {
            let length = u64::from(chord.length().to_bits()) << 14;
            self.line = Line::by(chord.dx.into(), chord.dy.into());
            self.move_length = length / u64::from(chord.moves().max(1));
            self.to_next = (self.chord_end + self.move_length / 2).saturating_sub(self.position);
            self.chord_end += length;
            self.begun += 1;
        }
    }

    /// The chords of the block behind the first one.
    fn later_chords(&self) -> &[Chord] {
        self.chords.get(..usize::from(self.chord_count)).unwrap_or(&[])
    }

    /// Whether the current chord is the last one of the block.
    fn is_last_chord(&self) -> bool {
        self.begun == self.chord_count
    }

    /// Records that `count` moves of the current slice were made.
    pub(super) fn advance(&mut self, count: usize) {
        self.moves_done += count as u32;
        self.to_next += self.move_length * count as u64;
        if let Some(moves) = &mut self.slice {
            moves.left = moves.left.saturating_sub(count as u32);
            moves.due = moves.due.wrapping_add(moves.interval.wrapping_mul(count as u32));
        }
    }

    /// The time from the beginning of the current slice to its next move, in sixteenths of ticks;
    /// `None` if it has no more moves.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn next_due(&self) -> Option<u32> {
        let moves = self.slice.as_ref().filter(|moves| moves.left > 0)?;
        Some(moves.due >> Train::BITS_BELOW)
    }

    /// How far the plan is ahead of the moves made, for each motor, in 2^-32 steps.
    #[cfg(feature = "input-shaping")]
    pub(super) fn ahead(&self) -> [i64; 2] {
        const HALF: i64 = 1 << 31;
        // The next move is due half of it before its end, and it is not much further away.
        let to_next = (self.to_next << 30).checked_div(self.move_length).unwrap_or(0) << 2;
        let mut moves = HALF - i64::try_from(to_next).unwrap_or(HALF);
        // The length of a move is rounded down, so the plan may seem to be behind the last one.
        if self.line.remaining() == 0 {
            moves = moves.min(0);
        }
        let [lag, fewer, more] = self.line.ahead();
        let slower = ((lag << 32) + fewer * moves).checked_div(more).unwrap_or(0);
        let [straight, diagonal] = self.line.moves().map_each(|direction| direction.delta());
        let motor = |straight: i32, diagonal: i32| {
            i64::from(straight) * moves + i64::from(diagonal - straight) * slower
        };
        [motor(straight.0, diagonal.0), motor(straight.1, diagonal.1)]
    }

    /// Begins the next piece of a dotted line.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn next_piece(&mut self) {
        self.piece += 1;
        self.position = self.move_length * u64::from(self.piece_moves);
        self.to_next = self.move_length / 2;
        self.piece_moves = self.pattern.end_of(self.piece);
    }
}

/// The moves of the current slice.
#[derive(Debug, Clone, Copy)]
pub(super) struct SliceMoves {
    pub(super) slice: Slice,
    /// The number of moves that are left.
    pub(super) left: u32,
    /// The time from the beginning of the slice to the next move, in units of [`Train`], below
    /// 2^31.
    due: u32,
    /// The time from one move to the next, in the same units.
    interval: u32,
}

impl SliceMoves {
    /// The next moves of the slice, at most `most`.
    pub(super) fn train(&self, most: usize) -> Train {
        let count = most.min(self.left as usize);
        Train { first: self.due, interval: self.interval, count }
    }
}

/// Converts distances within a slice to the times at which they are reached.
struct SliceClock {
    /// The shift that turns a distance into a fraction of that of the slice.
    zeros: u32,
    /// The time over the distance, at most 2^31.
    slowness: u32,
}

impl SliceClock {
    fn new(slice: Slice) -> Self {
        let zeros = slice.distance.leading_zeros();
        // The distance is at least 2^31 and the time at most 2^31, so that 2^31 is the greatest
        // quotient.
        let distance = u64::from(slice.distance << zeros).max(1);
        let time = u64::from(slice.time << Train::BITS_BELOW);
        Self { zeros, slowness: ((time << 31) / distance) as u32 }
    }

    /// Returns the time at which a position within the slice is reached, in units of [`Train`]. It
    /// is below 2^31, and at most 2 units early.
    fn time_of(&self, position: u32) -> u32 {
        ((u64::from(position << self.zeros) * u64::from(self.slowness)) >> 31) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Limits, Lookahead};
    use super::*;
    use std::vec::Vec;

    /// A block of some chords, each as long as it has moves, times a thousand units.
    fn joined(chords: &[(i32, i32)]) -> Block {
        joined_of(chords.iter().map(|&(dx, dy)| (dx, dy, 1000)))
    }

    /// A block of some chords, each move of which has a length of its own.
    fn joined_of(chords: impl Iterator<Item = (i32, i32, u32)>) -> Block {
        let limits = Limits { centripetal: false, ..Limits::default() };
        let mut memory = [Block::EMPTY; 1];
        let mut ring = Lookahead::new(&mut memory);
        for (dx, dy, move_length) in chords {
            let length = PathLength::from_bits(move_length * Line::by(dx, dy).remaining());
            let line = Block { dx, dy, length, ..Block::EMPTY };
            if !ring.join(&line, false, &limits) {
                ring.push(line).expect("room");
            }
        }
        *ring.front().expect("a block")
    }

    const CHORDS: [(i32, i32); 5] = [(9, 4), (3, -1), (1, 0), (-4, 2), (3, 3)];

    #[test]
    fn a_block_of_chords_makes_the_moves_of_each() {
        for distance in [350, 1000, 4321, 100_000] {
            let block = joined(&CHORDS);
            let mut course = BlockCursor::new(&block, PathLength::ZERO);
            assert_eq!(course.moves, 20);
            let (mut moves, mut time) = (Vec::new(), 0u64);
            while course.room() > 0 {
                let slice = if course.begin_rest() {
                    course.slice.expect("begun").slice
                } else {
                    let distance = (distance << 14).min(course.room() as u32);
                    course.begin_slice(Slice { distance, time: distance >> 6 });
                    course.slice.expect("begun").slice
                };
                let left = course.slice.map_or(0, |moves| moves.left);
                moves.extend((&mut course.line).take(left as usize));
                course.advance(left as usize);
                time += u64::from(slice.time);
                course.end_slice(slice);
            }
            let expected: Vec<_> = CHORDS.iter().flat_map(|&(dx, dy)| Line::by(dx, dy)).collect();
            assert_eq!(moves, expected, "{distance}");
            // 2^14 units of 2^-6 for each of 20,000.
            assert!(time.abs_diff(20_000 << 8) <= 300, "{distance}: {time}");
        }
    }

    #[test]
    fn a_stop_is_half_a_move_behind_a_pulse_in_every_chord() {
        let course = BlockCursor::new(&joined(&CHORDS), PathLength::ZERO);
        for least in 0..20_000u64 {
            let stand = course.to_whole_step(least << 14);
            assert_eq!(stand, (least.div_ceil(1000) * 1000) << 14, "{least}");
        }
    }

    #[test]
    fn a_stop_is_behind_a_move_of_the_chord_in_which_it_is() {
        let lengths = [1000, 1300, 700, 1500, 900];
        let chords = CHORDS.into_iter().zip(lengths).map(|((dx, dy), length)| (dx, dy, length));
        let course = BlockCursor::new(&joined_of(chords.clone()), PathLength::ZERO);
        let mut places = std::vec![0];
        for (dx, dy, length) in chords {
            for _ in Line::by(dx, dy) {
                places.push(places[places.len() - 1] + u64::from(length));
            }
        }
        for least in 0..=places[places.len() - 1] {
            let expected = places.iter().find(|position| **position >= least).expect("a position");
            assert_eq!(course.to_whole_step(least << 14), expected << 14, "{least}");
        }
    }
}
