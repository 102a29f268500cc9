//! The greatest constant speed for a stretch of a path, which its narrowest bend determines.

use super::curvature::Curvature;
use super::junction::{Heading, bends_apart, corner};
use super::{Limits, Lookahead, PathLength};
use crate::drawing::PagePoint;

/// Determines the greatest constant speed for a stretch of the path without sharp corners, before
/// it is drawn.
#[derive(Debug)]
pub struct SteadySpeed<'l> {
    limits: &'l Limits,
    /// The end of the stretch so far.
    at: PagePoint,
    /// The direction and the length of the last move.
    last: Option<(Heading, PathLength)>,
    curvature: Curvature,
    /// A look-ahead without blocks, which only reports the lowest limit of the bends.
    bends: Lookahead<'static>,
    lowest: PathLength,
    moves: u32,
}

impl<'l> SteadySpeed<'l> {
    /// Begins a stretch at `start`, without moves.
    pub fn new(limits: &'l Limits, start: PagePoint) -> Self {
        let mut bends = Lookahead::new(&mut []);
        let mut curvature = Curvature::default();
        curvature.restart(limits, start, &mut bends);
        let (last, lowest) = (None, PathLength::MAX);
        Self { limits, at: start, last, curvature, bends, lowest, moves: 0 }
    }

    /// The number of moves in the stretch.
    pub fn moves(&self) -> u32 {
        self.moves
    }

    /// Appends a move to `point`. Returns `false`, and appends nothing, if there is a sharp corner
    /// before the move, or if the move is longer than 16 m.
    pub fn add(&mut self, point: PagePoint) -> bool {
        let (dx, dy) = (point.x.wrapping_sub(self.at.x), point.y.wrapping_sub(self.at.y));
        let Some(length) = self.limits.length(dx, dy) else {
            return false;
        };
        if length > 0 {
            let heading = Heading::new(self.limits, dx, dy, length);
            if let Some((before, length_before)) = self.last {
                let corner = corner(
                    self.limits,
                    before,
                    heading,
                    length.min(length_before),
                    PathLength::ZERO,
                );
                if corner.is_sharp {
                    return false;
                }
                self.lowest = self.lowest.min(corner.limit);
                if bends_apart(self.limits, length_before, length) {
                    self.curvature.restart(self.limits, self.at, &mut self.bends);
                }
            }
            if self.limits.centripetal {
                self.curvature.extend(self.limits, point, &mut self.bends);
            }
            self.last = Some((heading, length));
            self.at = point;
        }
        self.moves += 1;
        true
    }

    /// Returns the greatest stopping distance that every bend of the stretch allows; more than 0.
    pub fn limit(mut self) -> PathLength {
        self.curvature.restart(self.limits, self.at, &mut self.bends);
        self.lowest.min(self.bends.take_lowered()).max(PathLength::DELTA)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_counts_its_moves_and_ends_at_a_sharp_corner() {
        let limits = Limits::new(&super::super::limits::tests::settings()).expect("valid");
        let mut stretch = SteadySpeed::new(&limits, PagePoint { x: 100, y: 100 });
        assert_eq!(stretch.moves(), 0);
        for moves in 1..=20 {
            assert!(stretch.add(PagePoint { x: 100 + 50 * moves, y: 100 + moves * moves / 2 }));
            assert_eq!(stretch.moves(), moves.unsigned_abs());
        }
        assert!(!stretch.add(PagePoint { x: 100, y: 300 }), "it turns back");
        assert_eq!(stretch.moves(), 20);
        assert!(stretch.limit() < PathLength::MAX);
    }
}
