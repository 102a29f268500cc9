//! The incremental line algorithm with the Knight's move rule (Harrison 1.6, procedure LINE of
//! appendix 1).

use super::Direction;
use crate::array::MapEach;
use crate::drawing::PagePoint;

/// The moves from one point to another.
///
/// An iterator of exactly max(|dx|, |dy|) moves. After each move the pen is at most half a step
/// from the true line, measured along the axis of fewer moves.
///
/// ```
/// use penup::step::{Direction, Line};
/// let there: Vec<_> = Line::by(2, 1).collect();
/// assert_eq!(there, [Direction::UpRight, Direction::Right]);
/// let back: Vec<_> = Line::by(-2, -1).map(Direction::reversed).collect();
/// assert_eq!(back, [Direction::Right, Direction::UpRight]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The direction of the moves along one axis.
    straight: Direction,
    /// The direction of the moves along both axes at once.
    diagonal: Direction,
    /// Says which move comes next (Harrison's B): if it is positive, the diagonal move is nearer to
    /// the line; if it is negative, the straight move is.
    balance: i32,
    /// The amount that a straight move adds to `balance`.
    straight_gain: i32,
    /// The amount that a diagonal move subtracts from `balance`.
    diagonal_loss: i32,
    /// Whether a tie is resolved by the diagonal move. This is so if x increases.
    ties_diagonal: bool,
    /// The number of moves still to come.
    remaining: u32,
}

impl Line {
    /// The number of offset units of [`Line::beside`] in one step.
    pub const OFFSET_UNIT: i32 = 8191;

    /// The greatest offset, which is just less than half a step.
    pub const GREATEST_OFFSET: i16 = (Line::OFFSET_UNIT / 2) as i16;

    /// The moves from `from` to `to`, both within the page.
    pub const fn new(from: PagePoint, to: PagePoint) -> Self {
        Self::by(to.x - from.x, to.y - from.y)
    }

    /// The moves by `dx`, `dy` steps, each within ±2^22.
    pub const fn by(dx: i32, dy: i32) -> Self {
        let (width, height) = (dx.abs(), dy.abs());
        let (more, fewer) = if width > height { (width, height) } else { (height, width) };
        // A line without diagonal moves, or without straight ones, never uses that direction, so
        // any direction will do.
        let diagonal = match Direction::from_delta(dx, if dy == 0 { 1 } else { dy }) {
            Some(direction) => direction,
            None => Direction::Up,
        };
        let straight = if width > height {
            Direction::from_delta(dx, 0)
        } else {
            Direction::from_delta(0, dy)
        };
        let straight = match straight {
            Some(direction) => direction,
            None => Direction::Up,
        };
        let straight_moves = more - fewer;
        Self {
            straight,
            diagonal,
            balance: fewer - straight_moves,
            straight_gain: 2 * fewer,
            diagonal_loss: 2 * straight_moves,
            ties_diagonal: dx > 0,
            remaining: more as u32,
        }
    }

    /// The moves by `dx`, `dy` steps of a segment of a line or curve whose exact ends lie beside
    /// the grid points. `offsets` says how far they lie beside them at the start and at the end, in
    /// units of 1/8191 of a step within ±4095, along the axis of fewer moves (x if both axes have
    /// equally many). Segments made this way join to a line that is nowhere off by more than half a
    /// step.
    ///
    /// `dx` and `dy` must be within ±2^16, unless both offsets are 0.
    ///
    /// ```
    /// use penup::step::{Direction::{Right, UpRight}, Line};
    /// let moves: Vec<_> = Line::beside(3, 1, [0, 0]).collect();
    /// assert_eq!(moves, [Right, UpRight, Right]);
    /// let moves: Vec<_> = Line::beside(3, 1, [3200, 3200]).collect();
    /// assert_eq!(moves, [UpRight, Right, Right]);
    /// ```
    pub fn beside(dx: i32, dy: i32, offsets: [i16; 2]) -> Self {
        const UNIT: i32 = Line::OFFSET_UNIT;
        let mut line = Self::by(dx, dy);
        if offsets == [0; 2] {
            return line;
        }
        let (more, fewer) = if dx.abs() > dy.abs() { (dx, dy) } else { (dy, dx) };
        let [start, end] = offsets.map_each(|offset| i32::from(offset) * fewer.signum());
        let (more, fewer) = (more.abs(), fewer.abs());
        // Measured in offset units, a straight move falls behind the line by `gain` over the number
        // of moves. `gain` is never below 0. On a line of diagonal moves alone it can be a little
        // too great, but that changes none of the moves.
        let gain = UNIT * fewer + end - start;
        line.straight_gain = 2 * gain;
        line.diagonal_loss = 2 * (UNIT * more - gain);
        line.balance = 2 * (start * more + gain) - UNIT * more;
        line
    }

    /// The two kinds of moves of the line: the straight one and the diagonal one.
    #[inline]
    pub const fn moves(&self) -> [Direction; 2] {
        [self.straight, self.diagonal]
    }

    /// How many of the next `count` moves are diagonal.
    ///
    /// ```
    /// use penup::step::Line;
    /// assert_eq!(Line::by(4, 1).diagonals_within(2), 1);
    /// assert_eq!(Line::by(4, 1).diagonals_within(1), 0);
    /// ```
    pub fn diagonals_within(&self, count: usize) -> usize {
        let mut line = self.clone();
        (0..count).filter(|_| line.next_is_diagonal()).count()
    }

    /// Makes the next move and returns whether it is diagonal.
    pub(crate) fn next_is_diagonal(&mut self) -> bool {
        let [balance, gain, loss] = self.rule();
        let is_diagonal = balance > 0;
        self.go_on(if is_diagonal { balance - loss } else { balance + gain }, 1);
        is_diagonal
    }

    /// Returns the numbers of the rule that chooses the moves. The next move is diagonal if the
    /// first number is positive. A straight move adds the second number to it, and a diagonal move
    /// subtracts the third.
    pub(crate) fn rule(&self) -> [i32; 3] {
        let balance = self.balance + i32::from(self.ties_diagonal);
        [balance, self.straight_gain, self.diagonal_loss]
    }

    /// Records that `moves` moves were made by that rule, which left the first number at `balance`.
    pub(crate) fn go_on(&mut self, balance: i32, moves: usize) {
        self.balance = balance - i32::from(self.ties_diagonal);
        self.remaining = self.remaining.saturating_sub(moves as u32);
    }

    /// How far the true line is ahead of the moves made, and how far a move leads, both along the
    /// axis of fewer moves: two numerators, for steps, over the third number.
    #[cfg(feature = "input-shaping")]
    pub(crate) fn ahead(&self) -> [i64; 3] {
        let [fewer, rest] =
            [self.straight_gain, self.diagonal_loss].map_each(|twice| i64::from(twice / 2));
        let more = fewer + rest;
        // A line begins with a balance of 2 fewer - more.
        [i64::from(self.balance) + more - 2 * fewer, 2 * fewer, 2 * more]
    }

    /// The number of moves still to come.
    pub const fn remaining(&self) -> u32 {
        self.remaining
    }
}

impl Iterator for Line {
    type Item = Direction;

    #[inline]
    fn next(&mut self) -> Option<Direction> {
        self.remaining = self.remaining.checked_sub(1)?;
        if self.balance > 0 || (self.balance == 0 && self.ties_diagonal) {
            self.balance -= self.diagonal_loss;
            Some(self.diagonal)
        } else {
            self.balance += self.straight_gain;
            Some(self.straight)
        }
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let count = usize::try_from(self.remaining).unwrap_or(usize::MAX);
        (count, Some(count))
    }
}

impl ExactSizeIterator for Line {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn points(dx: i32, dy: i32) -> Vec<PagePoint> {
        let mut at = PagePoint::default();
        let mut all = std::vec![at];
        for direction in Line::by(dx, dy) {
            at = direction.from_point(at);
            all.push(at);
        }
        all
    }

    fn digits(dx: i32, dy: i32) -> Vec<u8> {
        Line::by(dx, dy).map(|direction| direction as u8).collect()
    }

    #[test]
    fn forward_is_backward_reversed_and_within_half_a_step() {
        for dx in -64i32..=64 {
            for dy in -64i32..=64 {
                let there = points(dx, dy);
                assert_eq!(there.last(), Some(&PagePoint { x: dx, y: dy }));
                assert_eq!(there.len() as i32, dx.abs().max(dy.abs()) + 1);
                let mut back: Vec<_> = points(-dx, -dy)
                    .into_iter()
                    .map(|p| PagePoint { x: p.x + dx, y: p.y + dy })
                    .collect();
                back.reverse();
                assert_eq!(there, back, "to {dx},{dy}");
                for p in there {
                    // |minor - major * slope| <= 1/2, without the division.
                    let off = 2 * (p.x * dy - p.y * dx).abs();
                    assert!(off <= dx.abs().max(dy.abs()), "to {dx},{dy} at {p:?}");
                }
            }
        }
    }

    #[test]
    fn harrison_figures_1_and_2() {
        assert_eq!(digits(2, 1), [2, 3]);
        assert_eq!(digits(-2, -1), [7, 6]);
        // From (0,0) to (14,9) the tie is at the middle, (7, 4.5).
        assert_eq!(digits(14, 9), [2, 3, 2, 2, 3, 2, 2, 3, 2, 3, 2, 2, 3, 2]);
        assert_eq!(digits(-14, -9), [6, 7, 6, 6, 7, 6, 7, 6, 6, 7, 6, 6, 7, 6]);
    }

    #[test]
    fn pieces_whose_ends_lie_beside_the_grid_are_within_half_a_step() {
        for dx in -9i32..=40 {
            for dy in -40i32..=9 {
                for offsets in [[0, 2900], [-4095, 4095], [4095, -4095], [1600, -100], [4095, 4095]]
                {
                    let (more, fewer) = if dx.abs() > dy.abs() { (dx, dy) } else { (dy, dx) };
                    let mut at = PagePoint::default();
                    for (index, direction) in Line::beside(dx, dy, offsets).enumerate() {
                        at = direction.from_point(at);
                        // The unit is an offset unit over the number of moves.
                        let [start, end] = offsets.map(i32::from);
                        let rise = Line::OFFSET_UNIT * fewer + end - start;
                        let line = start * more.abs() + rise * (index as i32 + 1);
                        let minor = if dx.abs() > dy.abs() { at.y } else { at.x };
                        let off = line - Line::OFFSET_UNIT * minor * more.abs();
                        let half = Line::OFFSET_UNIT * more.abs();
                        assert!(2 * off.abs() <= half, "to {dx},{dy} {offsets:?} at {at:?}: {off}");
                    }
                    assert_eq!(at, PagePoint { x: dx, y: dy });
                }
            }
        }
    }

    #[test]
    fn no_move_one_move_and_the_longest() {
        assert!(digits(0, 0).is_empty());
        for direction in Direction::ALL {
            let (dx, dy) = direction.delta();
            assert_eq!(digits(dx, dy), [direction as u8]);
        }
        let far = 1 << 22;
        let (mut x, mut y) = (0, 0);
        for direction in Line::by(far, 1 - far) {
            let (dx, dy) = direction.delta();
            (x, y) = (x + dx, y + dy);
        }
        assert_eq!((x, y), (far, 1 - far));
    }

    #[test]
    fn the_greatest_offset_is_just_less_than_half_a_step() {
        let most = i32::from(Line::GREATEST_OFFSET);
        assert!(2 * most < Line::OFFSET_UNIT && 2 * (most + 1) > Line::OFFSET_UNIT);
    }
}
