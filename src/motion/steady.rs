//! The greatest constant speed for a stretch of a path, which its narrowest bend determines.

use super::curvature::Curvature;
use super::junction::{Corner, Heading, bends_apart, corner};
use super::long_move::LongMove;
use super::{Limits, Lookahead, PathLength, SpeedLimit};
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
    /// The last long move, if no more than a few steps lie behind it.
    long: Option<LongMove>,
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
        let (last, long, lowest) = (None, None, PathLength::MAX);
        Self { limits, at: start, last, long, curvature, bends, lowest, moves: 0 }
    }

    /// The number of moves in the stretch.
    pub fn moves(&self) -> u32 {
        self.moves
    }

    /// Appends a move to `point`. Returns `false`, and appends nothing, if there is a sharp corner
    /// before the move, be it hidden by short moves, or if the move is longer than 16 m.
    pub fn add(&mut self, point: PagePoint) -> bool {
        let (dx, dy) = (point.x.wrapping_sub(self.at.x), point.y.wrapping_sub(self.at.y));
        let Some(length) = self.limits.length(dx, dy) else {
            return false;
        };
        if length > 0 {
            let heading = Heading::new(self.limits, dx, dy, length);
            let mut corner = self.last.map_or(Corner::NONE, |(before, length_before)| {
                let shorter = length.min(length_before);
                corner(self.limits, before, heading, shorter, PathLength::ZERO)
            });
            let mut long = self.long;
            if LongMove::is_short(length, self.limits) {
                long = long.and_then(|long| long.followed_by(length, self.limits));
            } else {
                corner = LongMove::replace(&mut long, heading, length, corner, self.limits);
            }
            if corner.is_sharp {
                return false;
            }
            self.long = long;
            self.lowest = self.lowest.min(corner.limit);
            if let Some((_, length_before)) = self.last
                && bends_apart(self.limits, length_before, length)
            {
                self.curvature.restart(self.limits, self.at, &mut self.bends);
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

    /// Returns the greatest speed that every bend of the stretch allows; more than 0.
    pub fn limit(self) -> SpeedLimit {
        SpeedLimit::constant(self.stopping_distance())
    }

    /// The greatest stopping distance that every bend of the stretch allows; more than 0.
    fn stopping_distance(mut self) -> PathLength {
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
        assert!(stretch.stopping_distance() < PathLength::MAX);
    }

    /// The end of the first line, of the short move behind it, and of the second line, which turns
    /// by so many degrees.
    fn corner_with_a_short_move(degrees: f64, steps: i32) -> [PagePoint; 3] {
        let point = |x: f64, y: f64| PagePoint { x: x.round() as i32, y: y.round() as i32 };
        let (turn, steps) = (degrees.to_radians(), f64::from(steps));
        let (x, y) = (4000.0 + steps * (turn / 2.0).cos(), steps * (turn / 2.0).sin());
        let end = point(x.round() + 4000.0 * turn.cos(), y.round() + 4000.0 * turn.sin());
        [point(4000.0, 0.0), point(x, y), end]
    }

    #[test]
    fn a_step_or_two_hide_no_sharp_corner() {
        let limits = Limits::new(&super::super::limits::tests::settings()).expect("valid");
        for degrees in [94.0, 150.0] {
            for steps in 1..=2 {
                let mut stretch = SteadySpeed::new(&limits, PagePoint { x: 0, y: 0 });
                let points = corner_with_a_short_move(degrees, steps);
                let ends = points.into_iter().position(|point| !stretch.add(point));
                assert!(matches!(ends, Some(1 | 2)), "{degrees} {steps}: {ends:?}");
            }
        }
    }

    #[test]
    fn a_step_or_two_hide_no_slight_corner() {
        let limits = Limits::new(&super::super::limits::tests::settings()).expect("valid");
        let limit = |points: &[PagePoint]| {
            let mut stretch = SteadySpeed::new(&limits, PagePoint { x: 0, y: 0 });
            assert!(points.iter().all(|point| stretch.add(*point)));
            stretch.stopping_distance()
        };
        let [corner, _, end] = corner_with_a_short_move(30.0, 0);
        let open = limit(&[corner, end]).to_num::<f64>();
        for steps in 1..=2 {
            let hidden = limit(&corner_with_a_short_move(30.0, steps)).to_num::<f64>();
            // It may be passed a little faster, as if the short move rounded it.
            assert!(hidden < 1.5 * open, "{steps}: {hidden} mm, and {open} mm without it");
        }
    }
}
