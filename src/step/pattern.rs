//! Dotted and dashed lines (Harrison, procedure LINEDOT of appendix 1).

use crate::drawing::{Dashes, LineType};

/// Divides the moves of one line into dashes and gaps, as its line type says.
///
/// Harrison counts a fixed number of moves from the start, so the line may end anywhere in a dash
/// or gap. Here the dashes and gaps of the type are repeated as often as brings each nearest to the
/// desired length, and its first dash ends the line. So both ends are drawn with the pen down, and
/// the same points are inked whichever end the line starts from.
///
/// ```
/// use penup::drawing::LineType;
/// use penup::step::Pattern;
/// let dots = Pattern::of(LineType::Dotted, 25, 5);
/// let ends: Vec<_> = (0..dots.pieces()).map(|piece| dots.end_of(piece)).collect();
/// assert_eq!(ends, [5, 10, 15, 20, 25]);
/// assert!(Pattern::inked(0) && !Pattern::inked(1) && Pattern::inked(4));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pattern {
    /// The number of moves of which the line consists.
    moves: u32,
    /// How many times the dashes and gaps of the line type are repeated before the last dash.
    repeats: u32,
    /// The line type, which says how dashes and gaps follow each other.
    line_type: LineType,
}

impl Pattern {
    /// The pattern for a line of `moves` moves and this line type. Dots are about `dot_moves` long
    /// (0 counts as 1).
    pub const fn of(line_type: LineType, moves: u32, dot_moves: u32) -> Self {
        let Dashes { lengths, period, shortest } = line_type.dashes();
        let Some(first) = lengths.first() else { return Self::full(moves) };
        let (first, period) = (*first as u32, period as u32);
        let dots = moves / if dot_moves == 0 { 1 } else { dot_moves };
        // The line is first + repeats * period dots long; this is nearest to what fits.
        let repeats = dots.saturating_add(period / 2).saturating_sub(first) / period;
        // Each dash and gap has at least one move.
        let most = moves.saturating_mul(shortest as u32).saturating_sub(first) / period;
        Self { moves, repeats: if repeats > most { most } else { repeats }, line_type }
    }

    /// Makes the pattern of a solid line, which is a single inked piece.
    pub const fn full(moves: u32) -> Self {
        Self { moves, repeats: 0, line_type: LineType::Full }
    }

    /// Returns the number of dashes and gaps together, which is odd.
    pub const fn pieces(self) -> u32 {
        self.repeats * self.line_type.dashes().lengths.len() as u32 + 1
    }

    /// The number of moves from the start of the line to the end of piece number `piece`, counted
    /// from 0.
    #[inline]
    pub const fn end_of(self, piece: u32) -> u32 {
        if self.repeats == 0 { self.moves } else { self.end_of_dash(piece) }
    }

    /// Returns the end of a piece of a line with gaps.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    const fn end_of_dash(self, piece: u32) -> u32 {
        let Dashes { lengths, period, .. } = self.line_type.dashes();
        let Some(first) = lengths.first() else { return self.moves };
        let (count, period) = (lengths.len() as u32, period as u32);
        let mut dots = piece / count * period;
        let (mut rest, mut left) = (lengths, piece % count + 1);
        while left > 0
            && let [length, behind @ ..] = rest
        {
            dots += *length as u32;
            (rest, left) = (behind, left - 1);
        }
        let dots = dots as u64;
        let all = (self.repeats * period + *first as u32) as u64;
        let all = if all == 0 { 1 } else { all };
        // The result is rounded to the nearest number. There is no tie, because a line is an odd
        // number of dots long, which never divides at half a move.
        ((2 * dots * self.moves as u64 + all) / (2 * all)) as u32
    }

    /// Whether piece number `piece`, counted from 0, is inked. The first piece is, then every other
    /// one.
    pub const fn inked(piece: u32) -> bool {
        piece.is_multiple_of(2)
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

    fn dots(moves: u32, dot_moves: u32) -> Pattern {
        Pattern::of(LineType::Dotted, moves, dot_moves)
    }

    #[test]
    fn dots_and_dashes_look_the_same_from_either_end_and_have_inked_ends() {
        assert_eq!(picture(dots(9, 3)), "---   ---");
        assert_eq!(picture(dots(25, 5)), "-----     -----     -----");
        assert_eq!(picture(dots(11, 2)), "--  ---  --");
        assert_eq!(picture(dots(7, 1)), "- - - -");
        assert_eq!(picture(dots(8, 0)), "- -  - -");
        assert_eq!(picture(dots(4, 1000)), "----");
        assert_eq!(picture(dots(0, 3)), "");
        assert_eq!(picture(Pattern::of(LineType::Dashed, 9, 1)), "---   ---");
    }

    #[test]
    fn every_length_is_symmetric_and_inked_to_its_end() {
        for moves in 0..80 {
            for dot in [0, 1, 2, 3, 8, 1000] {
                let drawn = picture(dots(moves, dot));
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
                let pattern = dots(moves, dot);
                // How far the line would be from its length if each piece had the wished length.
                let error = |pieces: u32| (pieces * dot).abs_diff(moves);
                let least = (1..=moves).step_by(2).map(error).min();
                let pieces = pattern.pieces();
                assert_eq!((pieces % 2, Some(error(pieces))), (1, least), "{moves} of {dot}");
                let mut start = 0;
                for piece in 0..pieces {
                    let end = pattern.end_of(piece);
                    assert!(end > start, "{moves} of {dot}");
                    // The nearest move to the position where equal pieces would end.
                    let error = (end * pieces).abs_diff((piece + 1) * moves);
                    assert!(2 * error < pieces, "{moves} of {dot}");
                    start = end;
                }
                assert_eq!(start, moves);
            }
            assert_eq!(dots(moves, 0), dots(moves, 1));
        }
        assert_eq!(dots(0, 5).pieces(), 1);
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
