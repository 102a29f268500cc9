//! Dotted and dashed lines (Harrison, procedure LINEDOT of appendix 1).

use crate::drawing::LineType;

/// Divides the moves of one line into dots and gaps.
///
/// Harrison counts a fixed number of moves from the start, so the line may end anywhere in a dot or
/// gap. Here the line is divided into an odd number of pieces, each as near to the desired length
/// as that allows. So both ends are drawn with the pen down, and the same points are inked
/// whichever end the line starts from.
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
    /// The number of moves of the line.
    moves: u32,
    /// The number of dots and gaps, which is odd.
    pieces: u32,
}

impl Pattern {
    /// Divides a line of `moves` moves into dots and gaps of about `piece_moves` each (0 counts as
    /// 1).
    pub const fn new(moves: u32, piece_moves: u32) -> Self {
        let length = if piece_moves == 0 { 1 } else { piece_moves };
        // This is the odd number nearest to moves / length, but at least 1.
        let pieces = moves / length;
        let pieces = if pieces.is_multiple_of(2) { pieces + 1 } else { pieces };
        // There are never more pieces than moves, because each piece has at least one move.
        let most = if moves == 0 { 1 } else { moves - (1 - moves % 2) };
        Self { moves, pieces: if pieces > most { most } else { pieces } }
    }

    /// A line that is a single inked piece.
    pub const fn full(moves: u32) -> Self {
        Self { moves, pieces: 1 }
    }

    /// The number of pieces, which is odd.
    pub const fn pieces(self) -> u32 {
        self.pieces
    }

    /// The number of moves from the start of the line to the end of piece number `piece`, counted
    /// from 0.
    pub const fn end_of(self, piece: u32) -> u32 {
        if self.pieces == 1 {
            return self.moves;
        }
        // The result is rounded to the nearest number. There is no tie, because an odd number of
        // pieces never divides at half a move.
        let pieces = self.pieces as u64;
        let doubled = 2 * (piece as u64 + 1) * self.moves as u64 + pieces;
        (doubled / (2 * pieces)) as u32
    }

    /// Whether piece number `piece`, counted from 0, is inked. The first piece is, then every other
    /// one.
    pub const fn inked(piece: u32) -> bool {
        piece.is_multiple_of(2)
    }
}

impl Pattern {
    /// The pattern for a line of `moves` moves and this line type. Dots are `dot_moves` long, and a
    /// dash is three dots long.
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
    use std::string::String;

    /// Draws the pattern of a horizontal line: a dash for an inked move, a space for a bare one.
    fn picture(pattern: Pattern) -> String {
        let mut drawn = String::new();
        for piece in 0..pattern.pieces() {
            let ink = if Pattern::inked(piece) { "-" } else { " " };
            drawn += &ink.repeat(pattern.end_of(piece) as usize - drawn.len());
        }
        drawn
    }

    #[test]
    fn dots_and_dashes_look_the_same_from_either_end_and_have_inked_ends() {
        assert_eq!(picture(Pattern::new(9, 3)), "---   ---");
        assert_eq!(picture(Pattern::new(25, 5)), "-----     -----     -----");
        assert_eq!(picture(Pattern::new(11, 2)), "--  ---  --");
        assert_eq!(picture(Pattern::new(7, 1)), "- - - -");
        assert_eq!(picture(Pattern::new(8, 0)), "- -  - -");
        assert_eq!(picture(Pattern::new(4, 1000)), "----");
        assert_eq!(picture(Pattern::new(0, 3)), "");
        assert_eq!(picture(Pattern::of(LineType::Dashed, 9, 1)), "---   ---");
    }

    #[test]
    fn every_length_is_symmetric_and_inked_to_its_end() {
        for moves in 0..80 {
            for dot in [0, 1, 2, 3, 8, 1000] {
                let drawn = picture(Pattern::new(moves, dot));
                assert_eq!(drawn.len(), moves as usize);
                assert!(drawn.chars().rev().eq(drawn.chars()), "{moves} of {dot}: {drawn}");
                assert!(moves == 0 || drawn.starts_with('-'), "{moves} of {dot}: {drawn}");
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
