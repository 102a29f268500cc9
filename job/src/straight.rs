//! Straight lines in place of single steps.

use crate::path::PagePoint;

/// How far, in steps, a step may lie from the line that replaces it: half a step and a little more,
/// because the numbers of a picture are rounded.
pub const TOLERANCE: f64 = 0.501;

/// Simplifies a polyline while it comes: it removes points, from front to back as many as it can,
/// such that every point stays within a tolerance of the line that replaces it. The end points are
/// kept, and so are the points where the polyline reverses.
///
/// With a tolerance of half a step, the single steps of a line between two grid points become one
/// line. Only the points of that line are held meanwhile.
#[derive(Debug, Clone)]
pub struct Straightener {
    tolerance: f64,
    /// The points that stay. The last one is where the line that is being looked for begins.
    kept: Vec<PagePoint>,
    /// The points after those that stay.
    ahead: Vec<PagePoint>,
    /// The number of points ahead that were tested.
    seen: usize,
    reach: Reach,
}

impl Straightener {
    /// Begins at a point.
    pub fn new(start: PagePoint, tolerance: f64) -> Self {
        let (ahead, reach) = (Vec::new(), Reach::default());
        Self { tolerance, kept: vec![start], ahead, seen: 0, reach }
    }

    /// Whether no point has come but the first.
    pub fn is_empty(&self) -> bool {
        self.kept.len() == 1 && self.ahead.is_empty()
    }

    /// Adds the next point.
    pub fn push(&mut self, point: PagePoint) {
        self.ahead.push(point);
        self.test_points();
    }

    /// Returns the points that stay, once there are no more.
    pub fn end(mut self) -> Vec<PagePoint> {
        while !self.ahead.is_empty() {
            self.keep();
            self.test_points();
        }
        self.kept
    }

    /// Tests the points ahead that were not tested yet, and keeps those at which a line must end.
    fn test_points(&mut self) {
        while let (Some(&point), Some(start)) = (self.ahead.get(self.seen), self.kept.last()) {
            let place = [point[0] - start[0], point[1] - start[1]];
            if self.reach.goes_on(place, self.seen, self.tolerance) {
                self.seen += 1;
            } else {
                self.keep();
            }
        }
    }

    /// Ends the line at the farthest point that it may reach.
    fn keep(&mut self) {
        let reached = self.reach.passed.min(self.ahead.len().saturating_sub(1));
        self.kept.extend(self.ahead.get(reached).copied());
        self.ahead.drain(..self.ahead.len().min(reached + 1));
        self.seen = 0;
        self.reach = Reach::default();
    }
}

/// How far a straight line may go on. It goes to the last point that lies in the directions which
/// pass every earlier point, and at least as far away as all of them.
#[derive(Debug, Clone, Copy, Default)]
struct Reach {
    /// The number of that point.
    passed: usize,
    /// The square of its distance.
    farthest: f64,
    /// The directions that pass all points, once one is farther away than the tolerance.
    directions: Option<Directions>,
}

/// The directions between two others, less than half a turn apart.
#[derive(Debug, Clone, Copy)]
struct Directions {
    /// Towards the first point that limited them.
    first: [f64; 2],
    /// The one farthest to the right and the one farthest to the left, of length 1.
    right: [f64; 2],
    left: [f64; 2],
}

impl Reach {
    /// Takes the point with this number, which lies at `place` as seen from the start of the line.
    /// Returns whether the line may extend beyond it.
    fn goes_on(&mut self, place: [f64; 2], number: usize, tolerance: f64) -> bool {
        let square = dot(place, place);
        let is_near = square <= tolerance * tolerance;
        let Some(directions) = &mut self.directions else {
            if square >= self.farthest {
                (self.passed, self.farthest) = (number, square);
            }
            if !is_near {
                let [right, left] = tangents(place, square, tolerance);
                self.directions = Some(Directions { first: place, right, left });
            }
            return true;
        };
        // How far the point lies inwards of either edge.
        let inwards = [cross(directions.right, place), cross(place, directions.left)];
        if square >= self.farthest {
            if inwards[0] >= 0.0 && inwards[1] >= 0.0 {
                (self.passed, self.farthest) = (number, square);
            }
        } else if square.sqrt() + tolerance < self.farthest.sqrt() {
            return false;
        }
        if is_near {
            return true;
        }
        if dot(directions.first, place) <= 0.0 || inwards.iter().any(|depth| *depth < -tolerance) {
            return false;
        }
        if inwards.iter().any(|depth| *depth > tolerance) {
            let [right, left] = tangents(place, square, tolerance);
            if inwards[0] > tolerance {
                directions.right = right;
            }
            if inwards[1] > tolerance {
                directions.left = left;
            }
        }
        cross(directions.right, directions.left) >= 0.0
    }
}

/// The two directions that pass the place at the distance `tolerance`: to the right of it and to
/// the left. The place is farther away than that, by a distance of this square.
fn tangents([x, y]: [f64; 2], square: f64, tolerance: f64) -> [[f64; 2]; 2] {
    let along = (square - tolerance * tolerance).sqrt();
    [
        [(x * along + y * tolerance) / square, (y * along - x * tolerance) / square],
        [(x * along - y * tolerance) / square, (y * along + x * tolerance) / square],
    ]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Above 0 if `b` lies to the left of `a`.
fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Simplifies a polyline as [`Straightener`] does. With no tolerance all points stay.
///
/// ```
/// use penup_job::straight::straightened;
/// let steps = [
///     [0.0, 0.0],
///     [1.0, 0.0],
///     [2.0, 1.0],
///     [3.0, 1.0],
///     [4.0, 2.0],
///     [4.0, 3.0],
///     [4.0, 5.0],
/// ];
/// assert_eq!(straightened(&steps, 0.5), [[0.0, 0.0], [4.0, 2.0], [4.0, 5.0]]);
/// ```
pub fn straightened(points: &[PagePoint], tolerance: f64) -> Vec<PagePoint> {
    let Some((&start, ahead)) = points.split_first().filter(|_| tolerance > 0.0) else {
        return points.to_vec();
    };
    let mut line = Straightener::new(start, tolerance);
    ahead.iter().for_each(|&point| line.push(point));
    line.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_that_turns_back_keeps_its_turn() {
        let there_and_back = [[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [4.0, 0.0]];
        assert_eq!(straightened(&there_and_back, 0.1), [[0.0, 0.0], [10.0, 0.0], [4.0, 0.0]]);
        let closed = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]];
        assert_eq!(straightened(&closed, 0.1), closed);
        assert_eq!(straightened(&[], 0.1), [[0.0; 2]; 0]);
        assert_eq!(straightened(&[[1.0, 2.0]], 0.1), [[1.0, 2.0]]);
    }

    /// The grid points of a line, as a plotter steps through them.
    fn steps(from: [i32; 2], to: [i32; 2]) -> Vec<PagePoint> {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let count = dx.abs().max(dy.abs());
        let along = |start: i32, d: i32, i: i32| {
            (f64::from(start) + f64::from(d * i) / f64::from(count)).round()
        };
        (0..=count).map(|i| [along(from[0], dx, i), along(from[1], dy, i)]).collect()
    }

    #[test]
    fn a_line_of_steps_becomes_one_line_whatever_its_direction() {
        for to in [[140, 90], [-140, 90], [90, -141], [-7, -200], [300, 0], [0, -9], [-50, -50]] {
            let line = steps([0, 0], to);
            let ends = [line[0], line[line.len() - 1]];
            assert_eq!(straightened(&line, 0.501), ends);
        }
    }

    #[test]
    fn a_stroke_of_steps_keeps_to_its_steps_with_few_points() {
        let corners = [
            [0, 0],
            [500, 30],
            [510, 400],
            [80, 390],
            [500, 30],
            [-300, 20],
            [-310, -1000],
            [-310, 5],
            [0, 0],
        ];
        let pairs = corners.windows(2);
        let stroke: Vec<PagePoint> = pairs.flat_map(|pair| steps(pair[0], pair[1])).collect();
        let straight = straightened(&stroke, 0.501);
        assert!(straight.len() <= 4 * corners.len(), "{} points", straight.len());
        let mut spans = straight.windows(2);
        let mut span = spans.next().expect("several lines");
        for &point in &stroke {
            while distance(point, span) > 0.501 {
                span = spans.next().expect("a line near every step");
            }
        }
        assert!(spans.next().is_none(), "a line that no step is near");
    }

    /// The distance from `p` to the nearest point of a line segment.
    fn distance(p: PagePoint, line: &[PagePoint]) -> f64 {
        let [a, b] = [line[0], line[1]];
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let along = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy);
        let along = along.clamp(0.0, 1.0);
        (a[0] + along * dx - p[0]).hypot(a[1] + along * dy - p[1])
    }
}
