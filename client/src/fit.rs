//! Fits B-splines with few control points to traced polylines. Allard & Bown left this work to an
//! operator at a screen.
//!
//! [`fit_obj`] reads the `l` elements of a plan in millimetres, writes the same plan with `curv`
//! elements, and reports what was saved. [`fit`] works on polylines. It cuts each at its corners,
//! fits every piece by least squares, inserts knots where the error is too large, and then removes
//! the knots that are not needed. Of the orders 2 to 4 it keeps the one with the fewest control
//! points. The ends and the corners of every polyline stay where they are.
//!
//! The curve stays within the tolerance of the polyline, and the polyline within that of the curve.
//! The following is refused: a tolerance that makes no sense on paper, a file without polylines or
//! with faces or curves, a plan that is not flat, and coordinates that no plotter accepts.

mod least_squares;
mod obj;
mod piece;

pub use obj::{FitError, Fitted, Saving, TOLERANCES, fit_obj, write_obj};

use piece::Piece;

/// A point of the plan in millimetres.
pub type PlanPoint = [f64; 2];

/// The orders to try (polynomial degree + 1): cubics, parabolas, straight lines.
const ORDERS: [usize; 3] = [4, 3, 2];

/// An order is abandoned when it needs more knots than this multiple of the best control point
/// count so far.
const HOPELESS: usize = 3;

/// The share of the tolerance that is reserved for rounding the control points in the file.
const ROUNDING_SHARE: f64 = 0.03;

/// The share of the tolerance that is reserved for removing vertices that almost coincide.
const THINNING_SHARE: f64 = 1.0 / 64.0;

/// The maximum number of vertices before and after a vertex that are examined to decide whether it
/// is a corner.
const NEIGHBOURS: usize = 1024;

/// A clamped B-spline that replaces one traced polyline.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedCurve {
    /// The order, which is the degree + 1: 2 to 4.
    pub order: usize,
    /// The control points in millimetres. The first and the last are the ends of the polyline.
    pub control: Vec<PlanPoint>,
    /// The knots: whole numbers that begin at 0. Their number is the number of control points plus
    /// the order.
    pub knots: Vec<i32>,
}

/// Fits a curve to each polyline within `tolerance` mm. Polylines without a length are left out.
/// From time to time it calls `progress` with the number of vertices done and the number of all
/// vertices.
///
/// The running time grows little faster than the number of vertices.
///
/// ```
/// use penup_client::fit::fit;
/// let quarter: Vec<[f64; 2]> = (0..=90)
///     .map(|degree| f64::from(degree).to_radians())
///     .map(|angle| [50.0 * angle.cos(), 50.0 * angle.sin()])
///     .collect();
/// let curves = fit(&[quarter], 0.1, &mut |_, _| ());
/// assert!(curves[0].control.len() <= 6);
/// ```
pub fn fit(
    polylines: &[Vec<PlanPoint>],
    tolerance: f64,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<FittedCurve> {
    fit_each(polylines, tolerance, progress).into_iter().flatten().collect()
}

/// Does the same as [`fit`] but returns an entry for every polyline: `None` for those without a
/// length.
fn fit_each(
    polylines: &[Vec<PlanPoint>],
    tolerance: f64,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<Option<FittedCurve>> {
    let all = polylines.iter().map(Vec::len).sum();
    let mut done = 0;
    let mut curves = Vec::new();
    for polyline in polylines {
        let mut report =
            |share: f64| progress(done + (share * polyline.len() as f64) as usize, all);
        curves.push(fit_one(polyline, tolerance, &mut report));
        done += polyline.len();
    }
    curves
}

/// Fits one polyline; `None` if it has no length. Calls `progress` with the share of the work that
/// is done, 0 to 1.
fn fit_one(
    polyline: &[PlanPoint],
    tolerance: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<FittedCurve> {
    let close = tolerance * THINNING_SHARE;
    let positions = thinned(polyline, close);
    if positions.len() < 2 {
        return None;
    }
    let is_thinned = positions.len() < polyline.len();
    let thinning_share = if is_thinned { THINNING_SHARE } else { 0.0 };
    let strict = tolerance * (1.0 - ROUNDING_SHARE - thinning_share);
    let pieces = cut_at_corners(&positions, tolerance);
    let mut fewest = as_it_is(&positions);
    for (number, order) in ORDERS.into_iter().enumerate() {
        let most = HOPELESS * fewest.control.len();
        let mut report = |share: f64| progress((number as f64 + share) / ORDERS.len() as f64);
        if let Some(curve) = joined(&pieces, order, strict, most, &mut report)
            && curve.control.len() <= fewest.control.len()
        {
            fewest = curve;
        }
    }
    Some(fewest)
}

/// Removes the vertices that are closer than `close` to the one before; the last vertex is kept.
/// Such vertices carry no information, and thousands of them would be examined around each corner.
fn thinned(polyline: &[PlanPoint], close: f64) -> Vec<PlanPoint> {
    let mut positions: Vec<PlanPoint> = Vec::new();
    for position in polyline {
        if positions.last().is_none_or(|last| distance(*last, *position) >= close) {
            positions.push(*position);
        }
    }
    if let (Some(end), Some(last)) = (polyline.last(), positions.last())
        && end != last
        && positions.len() > 1
    {
        positions.pop();
        positions.push(*end);
    }
    positions
}

/// Converts the polyline itself into a curve of order 2.
fn as_it_is(positions: &[PlanPoint]) -> FittedCurve {
    let last = positions.len() as i32 - 1;
    let knots = std::iter::once(0).chain(0..=last).chain([last]).collect();
    FittedCurve { order: 2, control: positions.to_vec(), knots }
}

/// Fits all pieces and joins them to one curve, which may have corners at the joints. Returns
/// `None` if one of the pieces needs more than `most` knots at first, or cannot be fitted.
fn joined(
    pieces: &[Vec<PlanPoint>],
    order: usize,
    tolerance: f64,
    most: usize,
    progress: &mut dyn FnMut(f64),
) -> Option<FittedCurve> {
    let all: usize = pieces.iter().map(Vec::len).sum();
    let mut done = 0;
    let mut control: Vec<PlanPoint> = Vec::new();
    let mut knots = vec![0; order];
    let mut begin = 0;
    for positions in pieces {
        let mut report = |share: f64| {
            progress((done as f64 + share * positions.len() as f64) / all as f64);
        };
        let piece = Piece::fit(positions, order, begin, tolerance, most, &mut report)?;
        report(1.0);
        done += positions.len();
        control.extend(&piece.control[usize::from(!control.is_empty())..]);
        knots.extend(piece.inner);
        knots.extend(std::iter::repeat_n(piece.end, order - 1));
        begin = piece.end;
    }
    knots.push(begin);
    Some(FittedCurve { order, control, knots })
}

/// Cuts a polyline at its corners.
///
/// The angle is measured between points a few tolerances before and after the vertex, so that the
/// staircase of a scanner does not count as corners.
fn cut_at_corners(positions: &[PlanPoint], tolerance: f64) -> Vec<Vec<PlanPoint>> {
    const SHARP_DEGREES: f64 = 50.0;
    let reach = 4.0 * tolerance;
    let turns: Vec<f64> = (0..positions.len()).map(|at| turn(positions, at, reach)).collect();
    let mut pieces = Vec::new();
    let mut begin = 0;
    for at in 1..positions.len() - 1 {
        let is_sharpest = || {
            let near = |other: &usize| distance(positions[*other], positions[at]) < reach;
            let before = (begin..at).rev().take(NEIGHBOURS).take_while(near);
            let after = (at + 1..positions.len()).take(NEIGHBOURS).take_while(near);
            before.into_iter().all(|other| turns[other] < turns[at])
                && after.into_iter().all(|other| turns[other] <= turns[at])
        };
        if turns[at] > SHARP_DEGREES.to_radians() && is_sharpest() {
            pieces.push(positions[begin..=at].to_vec());
            begin = at;
        }
    }
    pieces.push(positions[begin..].to_vec());
    pieces
}

/// The turning angle of the polyline at vertex number `at` in radians, measured to the vertices at
/// distance `reach`; zero at the ends.
fn turn(positions: &[PlanPoint], at: usize, reach: f64) -> f64 {
    let here = positions[at];
    let far = |position: &&PlanPoint| distance(**position, here) >= reach;
    let before = &positions[at.saturating_sub(NEIGHBOURS)..at];
    let after = &positions[at + 1..positions.len().min(at + 1 + NEIGHBOURS)];
    let before = before.iter().rev().find(far).or(before.first());
    let after = after.iter().find(far).or(after.last());
    let (Some(before), Some(after)) = (before, after) else { return 0.0 };
    let (came, goes) = (minus(here, *before), minus(*after, here));
    (came[0] * goes[1] - came[1] * goes[0]).atan2(dot(came, goes)).abs()
}

fn minus(a: PlanPoint, b: PlanPoint) -> PlanPoint {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: PlanPoint, b: PlanPoint) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn distance(a: PlanPoint, b: PlanPoint) -> f64 {
    let between = minus(a, b);
    between[0].hypot(between[1])
}

#[cfg(test)]
mod tests;
