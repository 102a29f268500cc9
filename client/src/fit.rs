//! Traced polylines to few B-spline control points (what Allard & Bown left to a man at a screen).
//!
//! [`fit_obj`] reads the `l` elements of a plan in millimetres and writes the same plan with `curv`
//! elements, and says what was saved. [`fit`] does the work on polylines: it cuts each at its corners,
//! fits every piece by least squares with knots where they are needed, takes away the knots that are
//! not, and keeps the order, 2 to 4, that takes the fewest control points. The ends of every polyline
//! and its corners stay where they are.
//!
//! The curve stays within the tolerance of the polyline, and the polyline of the curve. Refused: a
//! tolerance that makes no sense on paper, a file without polylines or with faces or curves, one that is
//! not flat, coordinates that no plotter takes.

mod least_squares;
mod obj;
mod piece;

pub use obj::{FitError, Fitted, Saving, TOLERANCES, fit_obj, write_obj};

use piece::Piece;

/// A place on the plan in millimetres.
pub type Place = [f64; 2];

/// A polynomial's degree + 1: cubics, parabolas, straight lines.
const ORDERS: [usize; 3] = [4, 3, 2];

/// An order that needs so many times more knots than another did is not looked into further.
const HOPELESS: usize = 3;

/// What the rounding of control points in the file may take of the tolerance.
const ROUNDING_SHARE: f64 = 0.03;

/// What leaving out places that are almost the same may take of it.
const THINNING_SHARE: f64 = 1.0 / 64.0;

/// How many places before and after one are looked at to see whether it is a corner.
const NEIGHBOURS: usize = 1024;

/// A clamped B-spline that stands for one traced polyline.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedCurve {
    /// Degree + 1, 2 to 4.
    pub order: usize,
    /// In millimetres; the first and last are the polyline's ends.
    pub control: Vec<Place>,
    /// As many as control points and order together, whole numbers from 0.
    pub knots: Vec<i32>,
}

/// Fits a curve to each polyline, within `tolerance` mm. Those without a length are left out. `progress`
/// is told from time to time how many of all vertices are done.
///
/// The time grows little faster than the number of vertices.
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
    polylines: &[Vec<Place>],
    tolerance: f64,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<FittedCurve> {
    fit_each(polylines, tolerance, progress).into_iter().flatten().collect()
}

/// The same, with a place in the result for each polyline, also for those without a length.
fn fit_each(
    polylines: &[Vec<Place>],
    tolerance: f64,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<Option<FittedCurve>> {
    let all = polylines.iter().map(Vec::len).sum();
    let mut done = 0;
    let mut curves = Vec::new();
    for polyline in polylines {
        let mut tell = |share: f64| progress(done + (share * polyline.len() as f64) as usize, all);
        curves.push(fit_one(polyline, tolerance, &mut tell));
        done += polyline.len();
    }
    curves
}

/// `progress` is told which part of the work is done, 0 to 1.
fn fit_one(
    polyline: &[Place],
    tolerance: f64,
    progress: &mut dyn FnMut(f64),
) -> Option<FittedCurve> {
    let close = tolerance * THINNING_SHARE;
    let places = thinned(polyline, close);
    if places.len() < 2 {
        return None;
    }
    let is_thinned = places.len() < polyline.len();
    let thinning_share = if is_thinned { THINNING_SHARE } else { 0.0 };
    let strict = tolerance * (1.0 - ROUNDING_SHARE - thinning_share);
    let pieces = cut_at_corners(&places, tolerance);
    let mut fewest = as_it_is(&places);
    for (number, order) in ORDERS.into_iter().enumerate() {
        let most = HOPELESS * fewest.control.len();
        let mut tell = |share: f64| progress((number as f64 + share) / ORDERS.len() as f64);
        if let Some(curve) = joined(&pieces, order, strict, most, &mut tell)
            && curve.control.len() <= fewest.control.len()
        {
            fewest = curve;
        }
    }
    Some(fewest)
}

/// The polyline without places that are closer than `close` to the one before; its end stays. Places so
/// close say nothing, and thousands of them would all be looked at around each corner.
fn thinned(polyline: &[Place], close: f64) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for place in polyline {
        if places.last().is_none_or(|last| distance(*last, *place) >= close) {
            places.push(*place);
        }
    }
    if let (Some(end), Some(last)) = (polyline.last(), places.last())
        && end != last
        && places.len() > 1
    {
        places.pop();
        places.push(*end);
    }
    places
}

/// The polyline itself as a curve of order 2.
fn as_it_is(places: &[Place]) -> FittedCurve {
    let last = places.len() as i32 - 1;
    let knots = std::iter::once(0).chain(0..=last).chain([last]).collect();
    FittedCurve { order: 2, control: places.to_vec(), knots }
}

/// The curves of all pieces as one, which may turn sharply where they join; `None` if one of them needs
/// more than `most` knots at first, or cannot be fitted.
fn joined(
    pieces: &[Vec<Place>],
    order: usize,
    tolerance: f64,
    most: usize,
    progress: &mut dyn FnMut(f64),
) -> Option<FittedCurve> {
    let all: usize = pieces.iter().map(Vec::len).sum();
    let mut done = 0;
    let mut control: Vec<Place> = Vec::new();
    let mut knots = vec![0; order];
    let mut begin = 0;
    for places in pieces {
        let mut tell = |share: f64| {
            progress((done as f64 + share * places.len() as f64) / all as f64);
        };
        let piece = Piece::fit(places, order, begin, tolerance, most, &mut tell)?;
        tell(1.0);
        done += places.len();
        control.extend(&piece.control[usize::from(!control.is_empty())..]);
        knots.extend(piece.inner);
        knots.extend(std::iter::repeat_n(piece.end, order - 1));
        begin = piece.end;
    }
    knots.push(begin);
    Some(FittedCurve { order, control, knots })
}

/// Cuts a polyline where it turns sharply.
///
/// The turn is taken between what lies a few tolerances before and after, so that the steps of a
/// scanner are no corners.
fn cut_at_corners(places: &[Place], tolerance: f64) -> Vec<Vec<Place>> {
    const SHARP_DEGREES: f64 = 50.0;
    let reach = 4.0 * tolerance;
    let turns: Vec<f64> = (0..places.len()).map(|at| turn(places, at, reach)).collect();
    let mut pieces = Vec::new();
    let mut begin = 0;
    for at in 1..places.len() - 1 {
        let is_sharpest = || {
            let near = |other: &usize| distance(places[*other], places[at]) < reach;
            let before = (begin..at).rev().take(NEIGHBOURS).take_while(near);
            let after = (at + 1..places.len()).take(NEIGHBOURS).take_while(near);
            before.into_iter().all(|other| turns[other] < turns[at])
                && after.into_iter().all(|other| turns[other] <= turns[at])
        };
        if turns[at] > SHARP_DEGREES.to_radians() && is_sharpest() {
            pieces.push(places[begin..=at].to_vec());
            begin = at;
        }
    }
    pieces.push(places[begin..].to_vec());
    pieces
}

/// By how many radians the polyline turns at place number `at`; zero at its ends.
fn turn(places: &[Place], at: usize, reach: f64) -> f64 {
    let here = places[at];
    let far = |place: &&Place| distance(**place, here) >= reach;
    let before = &places[at.saturating_sub(NEIGHBOURS)..at];
    let after = &places[at + 1..places.len().min(at + 1 + NEIGHBOURS)];
    let before = before.iter().rev().find(far).or(before.first());
    let after = after.iter().find(far).or(after.last());
    let (Some(before), Some(after)) = (before, after) else { return 0.0 };
    let (came, goes) = (minus(here, *before), minus(*after, here));
    (came[0] * goes[1] - came[1] * goes[0]).atan2(dot(came, goes)).abs()
}

fn minus(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn distance(a: Place, b: Place) -> f64 {
    let between = minus(a, b);
    between[0].hypot(between[1])
}

#[cfg(test)]
mod tests;
