//! Dotted and dashed lines (Harrison, procedure LINEDOT of appendix 1).

use super::{Direction, Line};
use crate::drawing::{LineType, PagePoint};

/// How the moves of one line divide into inked and bare pieces.
///
/// Harrison counts a fixed number of moves from the start and lets the end fall where it may. Here
/// the line divides into an odd number of pieces, each as near to the wished length as that allows,
/// so that both ends are inked and the same points are inked from either end.
///
/// ```
/// use penup::step::Pattern;
/// let dots = Pattern::new(25, 5);
/// let ends: Vec<_> = (0..dots.pieces()).map(|piece| dots.end_of(piece)).collect();
/// assert_eq!(ends, [5, 10, 15, 20, 25]);
/// assert!(Pattern::inked(0) && !Pattern::inked(1) && Pattern::inked(4));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pattern {
    moves: u32,
    pieces: u32,
}

impl Pattern {
    /// A line of `moves` moves in pieces of about `piece_moves` (0 counts as 1), dots and gaps alike.
    pub const fn new(moves: u32, piece_moves: u32) -> Self {
        let length = if piece_moves == 0 { 1 } else { piece_moves };
        // The odd number nearest to moves / length, and at least 1.
        let pieces = moves / length;
        let pieces = if pieces.is_multiple_of(2) { pieces + 1 } else { pieces };
        // Never more pieces than moves: each piece holds one at least.
        let most = if moves == 0 { 1 } else { moves - (1 - moves % 2) };
        Self { moves, pieces: if pieces > most { most } else { pieces } }
    }

    /// A line of one piece, all inked.
    pub const fn full(moves: u32) -> Self {
        Self { moves, pieces: 1 }
    }

    /// How many pieces; odd.
    pub const fn pieces(self) -> u32 {
        self.pieces
    }

    /// Moves from the start of the line to the end of piece number `piece`, counted from 0.
    pub const fn end_of(self, piece: u32) -> u32 {
        if self.pieces == 1 {
            return self.moves;
        }
        // Rounded to nearest. No tie: an odd number of pieces never halves a move.
        let pieces = self.pieces as u64;
        let doubled = 2 * (piece as u64 + 1) * self.moves as u64 + pieces;
        (doubled / (2 * pieces)) as u32
    }

    /// Whether piece number `piece` is inked: the first is, then every other one.
    pub const fn inked(piece: u32) -> bool {
        piece.is_multiple_of(2)
    }
}

/// A move and whether the pen is down during it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InkedMove {
    /// The move.
    pub direction: Direction,
    /// Whether it is inked.
    pub inked: bool,
}

/// The moves of a dotted or dashed line, each with the state of the pen.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::step::DottedLine;
/// let to = PagePoint { x: 9, y: 0 };
/// let inked: String = DottedLine::new(PagePoint::default(), to, 3)
///     .map(|step| if step.inked { '-' } else { ' ' })
///     .collect();
/// assert_eq!(inked, "---   ---");
/// ```
#[derive(Debug, Clone)]
pub struct DottedLine {
    line: Line,
    pattern: Pattern,
    piece: u32,
    done: u32,
}

impl DottedLine {
    /// The line from `from` to `to` in dots and gaps of about `piece_moves` moves.
    pub const fn new(from: PagePoint, to: PagePoint, piece_moves: u32) -> Self {
        let line = Line::new(from, to);
        let pattern = Pattern::new(line.remaining(), piece_moves);
        Self { line, pattern, piece: 0, done: 0 }
    }
}

impl Iterator for DottedLine {
    type Item = InkedMove;

    fn next(&mut self) -> Option<InkedMove> {
        let direction = self.line.next()?;
        if self.done == self.pattern.end_of(self.piece) {
            self.piece += 1;
        }
        self.done += 1;
        Some(InkedMove { direction, inked: Pattern::inked(self.piece) })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.line.size_hint()
    }
}

impl ExactSizeIterator for DottedLine {}

impl Pattern {
    /// The pattern of a line of `moves` moves; a dash is three dots long.
    pub const fn of(line_type: LineType, moves: u32, dot_moves: u32) -> Self {
        match line_type {
            LineType::Full => Self::full(moves),
            LineType::Dotted => Self::new(moves, dot_moves),
            LineType::Dashed => Self::new(moves, dot_moves.saturating_mul(3)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn inked_points(from: PagePoint, to: PagePoint, dot: u32) -> Vec<(PagePoint, PagePoint)> {
        let mut at = from;
        let mut inked = Vec::new();
        for step in DottedLine::new(from, to, dot) {
            let next = step.direction.from_point(at);
            if step.inked {
                inked.push((at.min(next), at.max(next)));
            }
            at = next;
        }
        inked.sort_unstable();
        inked
    }

    #[test]
    fn the_same_moves_are_inked_from_either_end_and_both_ends_are_inked() {
        for dx in -40..=40 {
            for dy in [-37, -8, 0, 5, 12, 40] {
                for dot in [0, 1, 2, 3, 8, 1000] {
                    let from = PagePoint { x: 3, y: -4 };
                    let to = PagePoint { x: 3 + dx, y: dy - 4 };
                    let there = inked_points(from, to, dot);
                    assert_eq!(there, inked_points(to, from, dot));
                    let line = DottedLine::new(from, to, dot);
                    let count = from.x.abs_diff(to.x).max(from.y.abs_diff(to.y)) as usize;
                    assert_eq!(line.size_hint(), (count, Some(count)));
                    let moves: Vec<_> = line.collect();
                    assert!(Line::new(from, to).eq(moves.iter().map(|step| step.direction)));
                    assert!(moves.first().is_none_or(|step| step.inked));
                    assert!(moves.last().is_none_or(|step| step.inked));
                    // The pen changes at the end of each piece, and nowhere else.
                    let pattern = Pattern::new(count as u32, dot);
                    let ends = (0..pattern.pieces() - 1).map(|piece| pattern.end_of(piece));
                    let changes = (1..count).filter(|&at| moves[at].inked != moves[at - 1].inked);
                    assert!(ends.eq(changes.map(|at| at as u32)), "to {to:?} in {dot}");
                }
            }
        }
    }

    #[test]
    fn pieces_are_as_near_to_the_wish_as_an_odd_number_allows() {
        for moves in 1..300_u32 {
            for dot in 1..20_u32 {
                let pattern = Pattern::new(moves, dot);
                // How far the line would be from its length if each piece had the wished length.
                let error = |pieces: u32| (pieces * dot).abs_diff(moves);
                let least = (1..=moves).step_by(2).map(error).min();
                let pieces = pattern.pieces();
                assert_eq!((pieces % 2, Some(error(pieces))), (1, least), "{moves} of {dot}");
                let mut start = 0;
                for piece in 0..pieces {
                    let end = pattern.end_of(piece);
                    assert!(end > start, "{moves} of {dot}");
                    // The nearest move to the place where equal pieces would end.
                    let error = (end * pieces).abs_diff((piece + 1) * moves);
                    assert!(2 * error < pieces, "{moves} of {dot}");
                    start = end;
                }
                assert_eq!(start, moves);
            }
            assert_eq!(Pattern::new(moves, 0), Pattern::new(moves, 1));
        }
        assert_eq!(Pattern::new(0, 5).pieces(), 1);
    }

    #[test]
    fn a_dash_is_three_dots_long() {
        let lengths = |line_type| {
            let pattern = Pattern::of(line_type, 45, 3);
            (pattern.pieces(), pattern.end_of(0))
        };
        assert_eq!(lengths(LineType::Full), (1, 45));
        assert_eq!(lengths(LineType::Dotted), (15, 3));
        assert_eq!(lengths(LineType::Dashed), (5, 9));
    }
}
