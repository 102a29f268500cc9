//! Turns the paths of an SVG into polylines in millimetres with few points.
//!
//! A path is first flattened finely, and then points are left out as long as the polyline stays
//! near all of them. So a run of short lines needs few points as well as a curve does.
//!
//! `usvg` writes each arc as cubic Béziers, which may be several hundredths of a millimetre off on
//! a large page. Where the source has an arc, the ellipse is computed from the Bézier again.

use crate::region::TooMuch;
use kurbo::{Affine, BezPath, ParamCurveArclen as _, PathEl, Point};
use usvg::tiny_skia_path::{Path, PathSegment};

/// How far off a point may be, in mm, before it is told: less than half of a usual motor step.
const MOST_ERROR: f64 = 0.01;

/// The tolerance of flattening curves, in mm. Together with [`COARSE`] and the rounding to
/// thousandths of a millimetre it stays below half a motor step, 0.00625 mm.
const FINE: f64 = 0.0001;

/// The distance within which points are left out, in mm.
const COARSE: f64 = 0.0054;

/// The greatest size of a curve, in mm. Such curves do not go on any page, and the number of their
/// points would grow without bound.
const LONGEST: f64 = 1e6;

/// A polyline in millimetres.
#[derive(Debug, Clone)]
pub(super) struct Polyline {
    /// The points of the polyline, two or more. If it is closed, the last point equals the first.
    pub(super) points: Vec<Point>,
}

impl Polyline {
    /// Returns the points of the polyline.
    pub(super) fn positions(&self) -> Vec<[f64; 2]> {
        self.points.iter().map(|point| [point.x, point.y]).collect()
    }

    /// Goes on to where it began, if it is no straight line.
    pub(super) fn close(&mut self) {
        if let [first, _, .., last] = *self.points
            && first != last
        {
            self.points.push(first);
        }
    }
}

/// A file has more points than fit in memory, a curve that is too large, or clip paths of too many
/// sides.
#[derive(Debug)]
pub(super) struct TooManyPoints;

impl From<TooMuch> for TooManyPoints {
    fn from(_: TooMuch) -> Self {
        Self
    }
}

/// Which cubic Béziers of a path are arcs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arcs {
    /// All that could be arcs, because the source has arcs.
    Any,
    /// Quarters of an ellipse: what the source has is unknown.
    Quarters,
    /// None.
    None,
}

/// Flattens `path`, of which `to_page` makes millimetres. The points of the fine polylines are
/// taken from `budget`.
///
/// # Errors
/// The budget is used up, or a curve is longer than [`LONGEST`].
pub(super) fn flatten(
    path: &Path,
    to_page: Affine,
    arcs: Arcs,
    budget: &mut usize,
) -> Result<Vec<Polyline>, TooManyPoints> {
    let point = |point: usvg::tiny_skia_path::Point| {
        to_page * Point::new(f64::from(point.x), f64::from(point.y))
    };
    let mut polylines = Vec::new();
    let mut points: Vec<Point> = Vec::new();
    let mut end = |points: &mut Vec<Point>| {
        let points = std::mem::take(points);
        if points.len() > 1 {
            polylines.push(Polyline { points: simplified(&points) });
        }
    };
    for segment in path.segments() {
        let before = points.len();
        match segment {
            PathSegment::MoveTo(to) => {
                end(&mut points);
                points.push(point(to));
            }
            PathSegment::LineTo(to) => points.push(point(to)),
            PathSegment::QuadTo(by, to) => {
                let (Some(&from), by, to) = (points.last(), point(by), point(to)) else { continue };
                curve(&[from, by, to], PathEl::QuadTo(by, to), &mut points)?;
            }
            PathSegment::CubicTo(first, second, to) => {
                let Some(&from) = points.last() else { continue };
                let cubic = [from, point(first), point(second), point(to)];
                match Arc::of(cubic, arcs) {
                    Some(arc) => arc.flatten(&mut points)?,
                    None => {
                        let [_, first, second, to] = cubic;
                        curve(&cubic, PathEl::CurveTo(first, second, to), &mut points)?;
                    }
                }
            }
            PathSegment::Close => {
                // A segment that follows without a move begins where the closed part began.
                let first = points.first().copied();
                points.extend(first);
                end(&mut points);
                points.extend(first);
            }
        }
        let added = points.len().saturating_sub(before) + 1;
        *budget = budget.checked_sub(added).ok_or(TooManyPoints)?;
    }
    end(&mut points);
    Ok(polylines)
}

/// The length of a path in its own units, of which `1 / scale` is a length that may be neglected.
pub(super) fn path_length(path: &Path, scale: f64) -> f64 {
    let point = |it: usvg::tiny_skia_path::Point| Point::new(it.x.into(), it.y.into());
    let elements = path.segments().map(|segment| match segment {
        PathSegment::MoveTo(to) => PathEl::MoveTo(point(to)),
        PathSegment::LineTo(to) => PathEl::LineTo(point(to)),
        PathSegment::QuadTo(by, to) => PathEl::QuadTo(point(by), point(to)),
        PathSegment::CubicTo(by, then, to) => PathEl::CurveTo(point(by), point(then), point(to)),
        PathSegment::Close => PathEl::ClosePath,
    });
    kurbo::segments(elements).map(|segment| segment.arclen(0.1 / scale)).sum()
}

/// Appends the points of a curve with these control points, without its first.
fn curve(control: &[Point], element: PathEl, points: &mut Vec<Point>) -> Result<(), TooManyPoints> {
    let Some(&from) = control.first() else { return Ok(()) };
    let length: f64 = control.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    if length >= LONGEST || length.is_nan() {
        return Err(TooManyPoints);
    }
    let path = BezPath::from_vec(vec![PathEl::MoveTo(from), element]);
    kurbo::flatten(&path, FINE, |element| {
        if let PathEl::LineTo(point) = element {
            points.push(point);
        }
    });
    Ok(())
}

/// An arc of an ellipse.
struct Arc {
    from: Point,
    /// Where the tangents at both ends meet.
    corner: Point,
    to: Point,
    /// The angle of the arc of the circle from which the ellipse comes, in radians: up to a quarter
    /// turn.
    angle: f64,
}

impl Arc {
    /// The arc that `cubic` approximates, as `kurbo` writes arcs; `None` if it is a curve of its
    /// own.
    fn of(cubic: [Point; 4], arcs: Arcs) -> Option<Self> {
        /// The part of the way to the corner at which the control points of a quarter lie.
        const QUARTER: f64 = 0.552_284_75;
        const NEAR: f64 = 2e-4;
        if arcs == Arcs::None {
            return None;
        }
        let [from, first, second, to] = cubic;
        let (start, end) = (first - from, second - to);
        let across = start.cross(end);
        let between = to - from;
        let to_corner = between.cross(end) / across;
        let corner = from + start * to_corner;
        let parts = [1.0 / to_corner, across / between.cross(start)];
        let part = (parts[0] + parts[1]) / 2.0;
        let is_near = |value: f64, to: f64| (value - to).abs() < NEAR;
        // An arc of less than a twentieth of a turn is nearly its cubic.
        let is_arc = is_near(parts[0], parts[1])
            && match arcs {
                Arcs::Quarters => is_near(part, QUARTER),
                _ => (QUARTER - NEAR..0.66).contains(&part),
            };
        is_arc.then(|| {
            let angle = 4.0 * (1.0 - 1.5 * part).sqrt().atan();
            Self { from, corner, to, angle }
        })
    }

    /// Appends the points of the arc without its first.
    fn flatten(&self, points: &mut Vec<Point>) -> Result<(), TooManyPoints> {
        let half = (self.angle / 2.0).tan();
        // The half axes of the ellipse are not longer than this.
        let start = (self.corner - self.from).hypot() / half;
        let end = (self.corner - self.to).hypot() / half;
        let radius = (start.hypot(end)).max(FINE);
        let count = (self.angle / (2.0 * (1.0 - FINE / radius).acos())).ceil();
        if radius >= LONGEST || count.is_nan() {
            return Err(TooManyPoints);
        }
        for number in 1..count as u32 {
            let at = self.angle * f64::from(number) / count;
            let b = (1.0 - at.cos()) / (1.0 - self.angle.cos());
            let a = (at.sin() - b * (self.angle.sin() - half)) / half;
            points.push(self.from + (self.corner - self.from) * a + (self.to - self.corner) * b);
        }
        points.push(self.to);
        Ok(())
    }
}

/// Leaves out points that are within [`COARSE`] of the line between the points that remain.
///
/// From each point that remains, the directions are kept that pass all points since within the
/// tolerance. A point outside of them, or nearer than the one before, begins a new line.
fn simplified(points: &[Point]) -> Vec<Point> {
    let Some((&first, rest)) = points.split_first() else { return Vec::new() };
    let mut kept = vec![first];
    let mut anchor = first;
    let mut last = first;
    let mut beam: Option<Beam> = None;
    for &point in rest {
        let reaches = match &beam {
            Some(beam) => {
                beam.contains(point - anchor) && {
                    let (before, now) = ((last - anchor).hypot(), (point - anchor).hypot());
                    now >= before
                }
            }
            None => true,
        };
        if !reaches {
            kept.push(last);
            anchor = last;
            beam = None;
        }
        let away = point - anchor;
        if away.hypot() > COARSE {
            let own = Beam::around(away);
            beam = Some(match beam {
                Some(beam) => beam.and(own),
                None => own,
            });
        }
        last = point;
    }
    kept.push(last);
    kept
}

/// A range of directions, in radians around a middle direction.
struct Beam {
    middle: kurbo::Vec2,
    low: f64,
    high: f64,
}

impl Beam {
    /// The directions that pass the end of `away` within [`COARSE`].
    fn around(away: kurbo::Vec2) -> Self {
        let half = (COARSE / away.hypot()).min(1.0).asin();
        Self { middle: away, low: -half, high: half }
    }

    fn angle(&self, direction: kurbo::Vec2) -> f64 {
        self.middle.cross(direction).atan2(self.middle.dot(direction))
    }

    fn contains(&self, direction: kurbo::Vec2) -> bool {
        (self.low..=self.high).contains(&self.angle(direction))
    }

    fn and(self, other: Self) -> Self {
        let turn = self.angle(other.middle);
        Self {
            middle: self.middle,
            low: self.low.max(turn + other.low),
            high: self.high.min(turn + other.high),
        }
    }
}

/// Whether single precision, in which the coordinates of a path are read, moves its points by more
/// than [`MOST_ERROR`] on the page. Of a path that only reaches far, what is near counts.
pub(super) fn is_coarse(path: &usvg::Path, to_page: Affine) -> bool {
    let bounds = path.bounding_box();
    let nearest = |from: f32, to: f32| f64::from(from.max(-to).max(0.0));
    let far = nearest(bounds.left(), bounds.right()).max(nearest(bounds.top(), bounds.bottom()));
    let scale = to_page.determinant().abs().sqrt();
    far * f64::from(f32::EPSILON) * scale > MOST_ERROR
}
