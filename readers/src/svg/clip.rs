//! Cuts polylines at the border of a convex area, the page.

use super::flatten::Polyline;
use kurbo::{Point, Vec2};

/// A convex area, whose corners are given in either direction of rotation.
#[derive(Debug, Clone)]
pub(super) struct ConvexArea {
    /// A point of each side and the direction across it, into the area.
    sides: Vec<(Point, Vec2)>,
}

impl ConvexArea {
    /// The area within `corners`, the last of which may repeat the first. `None` if they are not
    /// those of a convex area.
    pub(super) fn new(corners: &[Point]) -> Option<Self> {
        let mut corners = corners.to_vec();
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let following = |at: usize| corners.get(at % corners.len().max(1)).copied();
        let mut area = 0.0;
        for (at, corner) in corners.iter().enumerate() {
            area += corner.to_vec2().cross(following(at + 1)?.to_vec2());
        }
        if corners.len() < 3 || !area.is_normal() {
            return None;
        }
        let (sign, mut turned) = (area.signum(), 0.0);
        let mut sides = Vec::new();
        for (at, &corner) in corners.iter().enumerate() {
            let (next, last) = (following(at + 1)?, following(at + 2)?);
            let (side, after) = (next - corner, last - next);
            let turn = sign * side.cross(after).atan2(side.dot(after));
            // Rounding may bend a straight side outward by very little.
            if turn < -1e-3 {
                return None;
            }
            turned += turn;
            sides.push((corner, Vec2::new(-side.y, side.x) * (sign / side.hypot())));
        }
        // A star turns the same way at every corner, but more than once around.
        (turned < 1.5 * std::f64::consts::TAU).then_some(Self { sides })
    }

    /// The parts of `polyline` inside the area, or less than `tolerance` outside it. Appends them
    /// to `parts` and returns whether anything was cut off.
    pub(super) fn cut(
        &self,
        polyline: &Polyline,
        tolerance: f64,
        parts: &mut Vec<Polyline>,
    ) -> bool {
        let points = &polyline.points;
        let mut is_cut = false;
        let mut part: Vec<Point> = Vec::new();
        let mut end = |part: &mut Vec<Point>| {
            if part.len() > 1 {
                parts.push(Polyline { points: std::mem::take(part) });
            }
            part.clear();
        };
        for pair in points.windows(2) {
            let &[from, to] = pair else { continue };
            let Some((enter, leave)) = self.inside(from, to, tolerance) else {
                is_cut = true;
                end(&mut part);
                continue;
            };
            if enter > 0.0 {
                is_cut = true;
                end(&mut part);
            }
            if part.is_empty() {
                part.push(from.lerp(to, enter));
            }
            part.push(from.lerp(to, leave));
            if leave < 1.0 {
                is_cut = true;
                end(&mut part);
            }
        }
        end(&mut part);
        is_cut
    }

    /// The sides as points and the directions across them, into the area.
    pub(super) fn sides(&self) -> Vec<([f64; 2], [f64; 2])> {
        self.sides
            .iter()
            .map(|(point, inward)| ([point.x, point.y], [inward.x, inward.y]))
            .collect()
    }

    /// A point inside: the middle of the corners.
    pub(super) fn middle(&self) -> [f64; 2] {
        let corners = self.sides.iter().map(|(corner, _)| corner.to_vec2());
        let middle = corners.fold(Vec2::ZERO, |sum, corner| sum + corner) / self.sides.len() as f64;
        [middle.x, middle.y]
    }

    /// How far inside of the area a point lies; below 0 if it is outside.
    pub(super) fn depth(&self, at: Point) -> f64 {
        let depths = self.sides.iter().map(|&(point, inward)| (at - point).dot(inward));
        depths.fold(f64::INFINITY, f64::min)
    }

    /// The range of the segment's parameter, 0 to 1, in which it is inside; `None` if it is
    /// outside.
    fn inside(&self, from: Point, to: Point, tolerance: f64) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for &(point, inward) in &self.sides {
            let at_start = (from - point).dot(inward) + tolerance;
            let at_end = (to - point).dot(inward) + tolerance;
            match (at_start < 0.0, at_end < 0.0) {
                (true, true) => return None,
                (true, false) => enter = enter.max(at_start / (at_start - at_end)),
                (false, true) => leave = leave.min(at_start / (at_start - at_end)),
                (false, false) => {}
            }
        }
        (enter < leave).then_some((enter, leave))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(positions: &[[f64; 2]]) -> Vec<Point> {
        positions.iter().map(|&[x, y]| Point::new(x, y)).collect()
    }

    #[test]
    fn a_line_is_cut_at_both_sides_of_a_square() {
        for corners in [
            [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]],
            [[0.0, 2.0], [2.0, 2.0], [2.0, 0.0], [0.0, 0.0]],
        ] {
            let square = ConvexArea::new(&points(&corners)).expect("convex");
            let line = Polyline { points: points(&[[-1.0, 1.0], [1.0, 1.0], [1.0, 5.0]]) };
            let mut parts = Vec::new();
            assert!(square.cut(&line, 0.0, &mut parts));
            let [part] = parts.as_slice() else { panic!("{parts:?}") };
            assert_eq!(part.points, points(&[[0.0, 1.0], [1.0, 1.0], [1.0, 2.0]]));
        }
    }

    #[test]
    fn an_area_with_a_dent_or_without_an_inside_is_none() {
        let dented = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
        let flat = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        assert!(ConvexArea::new(&points(&dented)).is_none());
        assert!(ConvexArea::new(&points(&flat)).is_none());
        let star = [[0.0, 3.0], [2.0, -3.0], [-3.0, 1.0], [3.0, 1.0], [-2.0, -3.0]];
        assert!(ConvexArea::new(&points(&star)).is_none());
    }
}
