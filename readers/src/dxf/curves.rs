//! Curves of a drawing, and the polylines that stay near them.

use crate::plan::Point;
use std::f64::consts::TAU;

/// The greatest distance of a chord from its curve in mm, below half a motor step.
const CHORD_ERROR: f64 = 0.003;

/// The most times that a piece of a spline is halved.
const MOST_HALVINGS: u32 = 16;

/// A map of the plane: x' = a x + c y + e and y' = b x + d y + f, in the order a to f.
#[derive(Debug, Clone, Copy)]
pub(super) struct Affine(pub(super) [f64; 6]);

impl Affine {
    pub(super) fn apply(self, [x, y]: Point) -> Point {
        let Self([a, b, c, d, e, f]) = self;
        [a * x + c * y + e, b * x + d * y + f]
    }

    /// The map that applies `first` and then this one.
    pub(super) fn after(self, first: Self) -> Self {
        let Self([a, b, c, d, _, _]) = self;
        let Self([fa, fb, fc, fd, fe, ff]) = first;
        let [e, f] = self.apply([fe, ff]);
        Self([a * fa + c * fb, b * fa + d * fb, a * fc + c * fd, b * fc + d * fd, e, f])
    }

    /// No length grows by more than this factor.
    fn most(self) -> f64 {
        let Self([a, b, c, d, _, _]) = self;
        (a * a + b * b + c * c + d * d).sqrt()
    }
}

/// A B-spline, rational if it has weights.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    pub(super) degree: usize,
    pub(super) knots: Vec<f64>,
    pub(super) control: Vec<Point>,
    /// As many as control points, or none.
    pub(super) weights: Vec<f64>,
}

impl Spline {
    /// Whether there are as many knots as the control points need, in their order.
    fn is_valid(&self) -> bool {
        let Self { degree, knots, control, weights } = self;
        (1..=10).contains(degree)
            && control.len() > *degree
            && knots.len() == control.len() + degree + 1
            && knots.windows(2).all(|pair| pair[0] <= pair[1])
            && (weights.is_empty() || weights.len() == control.len())
            && weights.iter().all(|weight| *weight > 0.0)
            && knots[*degree] < knots[control.len()]
    }

    /// The point at `at`, which lies between the knots number `span` and the next (de Boor).
    fn point(&self, span: usize, at: f64) -> Point {
        let Self { degree, knots, control, weights } = self;
        let homogeneous = |index: usize| {
            let weight = weights.get(index).copied().unwrap_or(1.0);
            let [x, y] = control[index];
            [x * weight, y * weight, weight]
        };
        let mut points: Vec<[f64; 3]> = (span - degree..=span).map(homogeneous).collect();
        for level in 1..=*degree {
            for index in (level..=*degree).rev() {
                let low = knots[span - degree + index];
                let high = knots[index + 1 + span - level];
                let part = if high > low { (at - low) / (high - low) } else { 0.0 };
                let (before, own) = (points[index - 1], points[index]);
                points[index] =
                    [0, 1, 2].map(|axis: usize| before[axis] + part * (own[axis] - before[axis]));
            }
        }
        let [x, y, weight] = points[*degree];
        [x / weight, y / weight]
    }
}

/// A piece of a [`Curve`].
#[derive(Debug, Clone)]
enum CurvePiece {
    /// A straight line to a point.
    Line(Point),
    /// An arc of an ellipse: its centre, its half axes as vectors, the angle at which it begins, in
    /// radians of the circle from which it comes, and the angle that it turns.
    Arc { centre: Point, axes: [Point; 2], start: f64, turn: f64 },
    /// A whole spline.
    Spline(Spline),
}

/// A curve that the pen draws without being lifted.
#[derive(Debug, Clone, Default)]
pub(super) struct Curve {
    begin: Option<Point>,
    pieces: Vec<CurvePiece>,
}

impl Curve {
    pub(super) fn polyline(points: &[Point]) -> Self {
        let pieces = points.iter().skip(1).map(|point| CurvePiece::Line(*point)).collect();
        Self { begin: points.first().copied(), pieces }
    }

    /// An arc from `start` degrees, which turns by `turn` degrees.
    pub(super) fn arc(centre: Point, radius: f64, start: f64, turn: f64) -> Self {
        let axes = [[radius, 0.0], [0.0, radius]];
        Self::elliptic(centre, axes, start.to_radians(), turn.to_radians())
    }

    /// An arc of an ellipse with these half axes and angles in radians.
    pub(super) fn ellipse(centre: Point, axes: [Point; 2], [start, end]: [f64; 2]) -> Self {
        // The end of a whole ellipse may be rounded.
        let is_whole = (TAU - 1e-5..TAU + 1e-5).contains(&(end - start));
        let turn = if is_whole { 0.0 } else { (end - start).rem_euclid(TAU) };
        let turn = if turn < 1e-9 { TAU } else { turn };
        Self::elliptic(centre, axes, start, turn)
    }

    fn elliptic(centre: Point, axes: [Point; 2], start: f64, turn: f64) -> Self {
        let begin = on_ellipse(centre, axes, start);
        Self { begin: Some(begin), pieces: vec![CurvePiece::Arc { centre, axes, start, turn }] }
    }

    /// A spline; `None` if its knots do not fit its points.
    pub(super) fn spline(spline: Spline) -> Option<Self> {
        if !spline.is_valid() {
            return None;
        }
        let begin = spline.point(spline.degree, spline.knots[spline.degree]);
        Some(Self { begin: Some(begin), pieces: vec![CurvePiece::Spline(spline)] })
    }

    /// Appends a side of a polyline, an arc if it has a bulge.
    pub(super) fn side(&mut self, from: Point, to: Point, bulge: f64) {
        self.begin.get_or_insert(from);
        let direction = [to[0] - from[0], to[1] - from[1]];
        if bulge == 0.0 || direction == [0.0; 2] {
            self.pieces.push(CurvePiece::Line(to));
            return;
        }
        // The centre lies to the left of the way if the arc turns left by less than a half turn.
        let off = (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = [
            f64::midpoint(from[0], to[0]) - direction[1] * off,
            f64::midpoint(from[1], to[1]) + direction[0] * off,
        ];
        let spoke = [from[0] - centre[0], from[1] - centre[1]];
        let radius = spoke[0].hypot(spoke[1]);
        let axes = [[radius, 0.0], [0.0, radius]];
        let (start, turn) = (spoke[1].atan2(spoke[0]), 4.0 * bulge.atan());
        self.pieces.push(CurvePiece::Arc { centre, axes, start, turn });
        // The end is the corner itself, whatever rounding says.
        self.pieces.push(CurvePiece::Line(to));
    }

    /// A polyline near the curve as `to_page` shows it, in mm; `None` if it has more than `most`
    /// points.
    pub(super) fn flattened(&self, to_page: Affine, most: usize) -> Option<Vec<Point>> {
        let Some(begin) = self.begin else { return Some(Vec::new()) };
        let mut points = vec![to_page.apply(begin)];
        for piece in &self.pieces {
            match piece {
                CurvePiece::Line(to) => points.push(to_page.apply(*to)),
                CurvePiece::Arc { centre, axes, start, turn } => {
                    let half = |[x, y]: Point| x.hypot(y);
                    let radius = half(axes[0]).max(half(axes[1])) * to_page.most();
                    let chord = 2.0 * (1.0 - CHORD_ERROR / radius.max(2.0 * CHORD_ERROR)).acos();
                    let count = (turn.abs() / chord).ceil().max(1.0);
                    if count.is_nan() || count >= most.saturating_sub(points.len()) as f64 {
                        return None;
                    }
                    points.extend((1..=count as u64).map(|at| {
                        let angle = start + turn * at as f64 / count;
                        to_page.apply(on_ellipse(*centre, *axes, angle))
                    }));
                }
                CurvePiece::Spline(spline) => {
                    for span in spline.degree..spline.control.len() {
                        let [low, high] = [spline.knots[span], spline.knots[span + 1]];
                        if low < high {
                            let at = |at: f64| to_page.apply(spline.point(span, at));
                            let ends = [(low, at(low)), (high, at(high))];
                            halve(&at, ends, MOST_HALVINGS, &mut points);
                        }
                        if points.len() > most {
                            return None;
                        }
                    }
                }
            }
        }
        (points.len() <= most).then_some(points)
    }
}

/// Appends points of a curve between two of them, without the first, so that chords stay near it.
fn halve(
    curve: &dyn Fn(f64) -> Point,
    [(low, from), (high, to)]: [(f64, Point); 2],
    halvings: u32,
    points: &mut Vec<Point>,
) {
    let off = |part: f64| {
        let point = curve(low + part * (high - low));
        let near = [0, 1].map(|axis: usize| from[axis] + part * (to[axis] - from[axis]));
        (point[0] - near[0]).hypot(point[1] - near[1])
    };
    // A curve may cross its chord in the middle.
    let is_near = [0.2, 0.4, 0.5, 0.6, 0.8].into_iter().all(|part| off(part) < CHORD_ERROR);
    if is_near || halvings == 0 {
        points.push(to);
        return;
    }
    let middle = f64::midpoint(low, high);
    let between = (middle, curve(middle));
    halve(curve, [(low, from), between], halvings - 1, points);
    halve(curve, [between, (high, to)], halvings - 1, points);
}

fn on_ellipse(centre: Point, axes: [Point; 2], angle: f64) -> Point {
    let (sine, cosine) = angle.sin_cos();
    [0, 1].map(|axis: usize| centre[axis] + axes[0][axis] * cosine + axes[1][axis] * sine)
}
