//! Joins single points into lines that lead through all of them.

use super::{Direction, Line};
use crate::drawing::PagePoint;

/// The greatest number of single moves that one line stands for.
const CHORD_MOVES: usize = 64;

/// Joins points into lines. It yields the ends of long consecutive lines whose moves lead through
/// every point.
///
/// A point that cannot be reached by one move from the previous point becomes the end of a line of
/// its own.
///
/// ```
/// use penup::drawing::PagePoint;
/// use penup::step::{Arc, Chords, Turn};
/// let at = |x, y| PagePoint { x, y };
/// let arc = Arc::new(at(0, 0), at(100, 0), at(0, 100), Turn::Counterclockwise)?;
/// assert!(Chords::new(at(100, 0), arc).count() < 30);
/// # Ok::<(), penup::step::ArcError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Chords<I> {
    /// The points still to be read.
    pub(super) points: I,
    /// The point where the next line begins.
    from: PagePoint,
    /// The moves that were read ahead.
    moves: heapless::Deque<Direction, CHORD_MOVES>,
    /// The point at which the moves that were read ahead end.
    ahead: PagePoint,
    /// A point that was read but cannot be reached by a single move.
    beyond: Option<PagePoint>,
}

impl<I: Iterator<Item = PagePoint>> Chords<I> {
    /// The lines that start at `from` and lead through `points`.
    pub fn new(from: PagePoint, points: I) -> Self {
        Self { points, from, moves: heapless::Deque::new(), ahead: from, beyond: None }
    }

    /// Reads points ahead while there is room for their moves.
    fn read_ahead(&mut self) {
        while self.beyond.is_none() && !self.moves.is_full() {
            let Some(point) = self.points.next() else {
                return;
            };
            let delta = (point.x - self.ahead.x, point.y - self.ahead.y);
            match Direction::from_delta(delta.0, delta.1) {
                Some(direction) if direction.delta() == delta => {
                    self.ahead = point;
                    // The queue is not full, so the move fits.
                    self.moves.push_back(direction).ok();
                }
                Some(_) => self.beyond = Some(point),
                None => {}
            }
        }
    }

    /// The end of the longest line whose moves are those read ahead, and the number of its moves.
    fn longest_line(&self) -> (PagePoint, usize) {
        let mut longest = (self.from, 0);
        let mut point = self.from;
        for (index, direction) in self.moves.iter().enumerate() {
            point = direction.from_point(point);
            let count = index + 1;
            let line = Line::new(self.from, point);
            if line.len() == count && line.zip(&self.moves).all(|(a, &b)| a == b) {
                longest = (point, count);
            }
        }
        longest
    }
}

impl<I: Iterator<Item = PagePoint>> Iterator for Chords<I> {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        self.read_ahead();
        let (end, count) = self.longest_line();
        if count == 0 {
            let beyond = self.beyond.take()?;
            self.from = beyond;
            self.ahead = beyond;
            return Some(beyond);
        }
        for _ in 0..count {
            self.moves.pop_front();
        }
        self.from = end;
        Some(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::{Arc, Turn};
    use std::vec::Vec;

    fn at(x: i32, y: i32) -> PagePoint {
        PagePoint { x, y }
    }

    #[test]
    fn chords_lead_through_every_point() {
        for radius in [1, 4, 30, 300, 3000] {
            let from = at(radius, 0);
            for turn in [Turn::Clockwise, Turn::Counterclockwise] {
                let arc = Arc::new(at(0, 0), from, from, turn).expect("a circle");
                let expected: Vec<_> = core::iter::once(from).chain(arc.clone()).collect();
                let mut drawn = std::vec![from];
                let mut corner = from;
                let mut chords = 0;
                for to in Chords::new(from, arc) {
                    for direction in Line::new(corner, to) {
                        drawn.push(direction.from_point(*drawn.last().expect("one")));
                    }
                    corner = to;
                    chords += 1;
                }
                assert_eq!(drawn, expected);
                assert!(radius < 300 || chords < expected.len() / 5, "{radius}: {chords} chords");
            }
        }
    }
}
