//! Fits a curve to one piece of a polyline, which has no corner inside.

use super::least_squares::{Basis, least_squares};
use super::{PlanPoint, distance, dot, minus};
use std::ops::Range;

/// The maximum number of rounds of a fit from scratch and of one from an almost equal curve. After
/// each round the parameters are adapted to the curve.
const ROUNDS: usize = 40;
const MORE_ROUNDS: usize = 10;
/// The maximum number of passes over the knots to remove those that are not needed.
const PASSES: usize = 3;

/// The curve of a fitted piece.
#[derive(Debug, Clone)]
pub struct Piece {
    /// The control points.
    pub control: Vec<PlanPoint>,
    /// The inner knots in increasing order.
    pub inner: Vec<i32>,
    /// The knot at the end of the piece.
    pub end: i32,
}

/// The number of knots on either side of a candidate for removal up to which the curve is fitted
/// again. A spline hardly changes more than a few knots away. Fitting the whole curve for each of
/// its knots would take time quadratic in their number.
const REACH: usize = 12;

/// Closely spaced samples along the piece, and the parameters that all attempts share.
struct Samples {
    positions: Vec<PlanPoint>,
    /// The initial parameter of each sample, proportional to its distance along the piece.
    at: Vec<f64>,
    order: usize,
    ends: [i32; 2],
    tolerance: f64,
}

/// One attempt: the control points for some inner knots, and the distance of each sample from the
/// curve.
struct Try {
    control: Vec<PlanPoint>,
    at: Vec<f64>,
    errors: Vec<f64>,
}

/// A part of the curve between two of its knots that is fitted while the rest stays fixed.
struct Part {
    /// The knots that affect the part, including those before and after it.
    knots: Vec<f64>,
    /// The control points that affect the part; some of them also affect the curve outside it.
    control: Vec<PlanPoint>,
    /// The indices of the control points that affect only this part and may move.
    free: Range<usize>,
    /// The parameters at the two ends of the part.
    ends: [f64; 2],
    /// The indices of its samples, including one before and one after it.
    samples: Range<usize>,
}

impl Piece {
    /// Fits a curve of `order`, whose first knot is `begin`, to `positions`. Returns `None` if no
    /// number of knots suffices, or if more than `most` knots are needed before superfluous ones
    /// are removed. From time to time it calls `progress` with the share of the work that is done,
    /// 0 to 1.
    pub fn fit(
        positions: &[PlanPoint],
        order: usize,
        begin: i32,
        tolerance: f64,
        most: usize,
        progress: &mut dyn FnMut(f64),
    ) -> Option<Self> {
        let samples = Samples::new(positions, order, begin, tolerance);
        let mut inner = Vec::new();
        let mut found = samples.fit(&inner);
        while found.worst() > tolerance {
            inner = samples.divided(&inner, &found, tolerance)?;
            if inner.len() > most {
                return None;
            }
            found = samples.fit(&inner);
            progress(0.0);
        }
        for pass in 0..PASSES {
            let before = inner.len();
            let mut at = 0;
            while at < inner.len() {
                if samples.spares(&mut inner, at, &mut found) {
                    continue;
                }
                at += 1;
                if at.is_multiple_of(64) {
                    let share = at as f64 / inner.len() as f64;
                    progress((pass as f64 + share) / PASSES as f64);
                }
            }
            if inner.len() == before {
                break;
            }
        }
        Some(Self { control: found.control, inner, end: samples.ends[1] })
    }
}

impl Try {
    fn worst(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }
}

impl Samples {
    fn new(positions: &[PlanPoint], order: usize, begin: i32, tolerance: f64) -> Self {
        let length: f64 = positions.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let spacing = tolerance.max(length / 2000.0);
        let mut dense = vec![positions[0]];
        let mut along = vec![0.0];
        for pair in positions.windows(2) {
            let side = minus(pair[1], pair[0]);
            let start = along[along.len() - 1];
            let parts = (distance(pair[0], pair[1]) / spacing).ceil().max(1.0) as usize;
            for part in 1..=parts {
                let share = part as f64 / parts as f64;
                dense.push([pair[0][0] + share * side[0], pair[0][1] + share * side[1]]);
                along.push(start + share * side[0].hypot(side[1]));
            }
        }
        let width = dense.len() as i32;
        let scale = f64::from(width) / length;
        let ends = [begin, begin + width];
        let [from, to] = ends.map(f64::from);
        let at = along.into_iter().map(|along| (from + along * scale).min(to)).collect();
        Self { positions: dense, at, order, ends, tolerance }
    }

    fn knots(&self, inner: &[i32]) -> Vec<f64> {
        let [begin, end] = self.ends.map(|end| std::iter::repeat_n(end, self.order));
        begin.chain(inner.iter().copied()).chain(end).map(f64::from).collect()
    }

    /// Fits the whole curve.
    fn fit(&self, inner: &[i32]) -> Try {
        let mut control = vec![[0.0; 2]; self.order + inner.len()];
        let last = control.len() - 1;
        control[0] = self.positions[0];
        control[last] = self.positions[self.positions.len() - 1];
        let whole = Part {
            knots: self.knots(inner),
            control,
            free: 1..last,
            ends: self.ends.map(f64::from),
            samples: 0..self.positions.len(),
        };
        self.fit_part(whole, &self.at, ROUNDS)
    }

    /// Removes knot number `at`, or replaces it and the next one by one in the middle, if the curve
    /// stays within the tolerance. Returns whether it did.
    fn spares(&self, inner: &mut Vec<i32>, at: usize, found: &mut Try) -> bool {
        let knots_before = inner[at.saturating_sub(REACH)..at].to_vec();
        let (last, after) = (inner.len() - 1, at + 1);
        let after = &inner[after..last.min(at + 1 + REACH) + 1];
        let without = knots_before.iter().chain(after).copied().collect::<Vec<i32>>();
        let merged = after.split_first().map(|(next, rest)| {
            let middle = inner[at] + (next - inner[at]) / 2;
            knots_before.iter().chain([&middle]).chain(rest).copied().collect::<Vec<i32>>()
        });
        let first = at - knots_before.len();
        let replaced = first..at + 1 + after.len();
        for fewer in [Some(without), merged].into_iter().flatten() {
            let (part, points) = self.part(inner, &replaced, &fewer, found);
            let samples = part.samples.clone();
            let tried = self.fit_part(part, &found.at, MORE_ROUNDS);
            if tried.worst() <= self.tolerance {
                found.control.splice(points, tried.control);
                found.at[samples].copy_from_slice(&tried.at);
                inner.splice(replaced, fewer);
                return true;
            }
        }
        false
    }
    /// Creates the part of a curve in which the inner knots with the indices `replaced` become
    /// `fewer`. Also returns the indices of the control points that it replaces.
    fn part(
        &self,
        inner: &[i32],
        replaced: &Range<usize>,
        fewer: &[i32],
        found: &Try,
    ) -> (Part, Range<usize>) {
        let order = self.order;
        let knot = |number: usize| match number.checked_sub(order) {
            None => self.ends[0],
            Some(number) => inner.get(number).copied().unwrap_or(self.ends[1]),
        };
        // The indices, among all knots, of the knots between which the part lies.
        let (left, right) = (order + replaced.start - 1, order + replaced.end);
        let before = (left + 1 - order..=left).map(knot);
        let after = (right..right + order).map(knot);
        let points = left + 1 - order..right;
        // The control points at its ends also affect the curve beyond the part, except at the ends
        // of the curve.
        let shared = |is_end| if is_end { 1 } else { order - 1 };
        let (head, tail) = (shared(replaced.start == 0), shared(replaced.end == inner.len()));
        let free = head..order + fewer.len() - tail;
        let mut control = found.control[points.start..points.start + head].to_vec();
        control.resize(free.end, [0.0; 2]);
        control.extend(&found.control[points.end - tail..points.end]);
        let ends = [left, right].map(|number| f64::from(knot(number)));
        let first = found.at.partition_point(|t| *t < ends[0]).saturating_sub(1);
        let last = found.at.partition_point(|t| *t <= ends[1]).min(found.at.len() - 1);
        let knots = before.chain(fewer.iter().copied()).chain(after).map(f64::from).collect();
        (Part { knots, control, free, ends, samples: first..last + 1 }, points)
    }

    /// Alternates between fitting and moving each sample's parameter to the nearest point of the
    /// curve, until all errors are within the tolerance or that cannot be reached. `start` contains
    /// the parameters of all samples.
    fn fit_part(&self, part: Part, start: &[f64], rounds: usize) -> Try {
        let Part { knots, mut control, free, ends, samples } = part;
        let positions = &self.positions[samples.clone()];
        let mut at = start[samples].to_vec();
        let is_inside = |t: f64| (ends[0]..=ends[1]).contains(&t);
        let mut worst = f64::INFINITY;
        for round in 1.. {
            let bases: Vec<Basis> = at.iter().map(|t| Basis::at(&knots, self.order, *t)).collect();
            let inside = positions.iter().zip(&bases).zip(&at).filter(|(_, t)| is_inside(**t));
            least_squares(inside.map(|(sample, _)| sample), &mut control, free.clone());
            follow(positions, &mut at, &bases, &control, ends);
            let position = |t: f64| Basis::at(&knots, self.order, t).position(&control);
            let errors = errors(positions, &at, |t| is_inside(t).then(|| position(t)));
            let found = Try { control, at, errors };
            let gained = worst - found.worst();
            worst = found.worst();
            // The error that the remaining rounds can reach at the present rate.
            let reach = worst - gained.max(0.0) * rounds.saturating_sub(round) as f64;
            if worst <= self.tolerance || reach > self.tolerance || round >= rounds {
                return found;
            }
            (control, at) = (found.control, found.at);
        }
        unreachable!("the last round returns")
    }

    /// Adds a knot to every polynomial whose error is too large; `None` if one of them is too
    /// short.
    fn divided(&self, inner: &[i32], found: &Try, tolerance: f64) -> Option<Vec<i32>> {
        let mut knots = vec![self.ends[0]];
        knots.extend(inner);
        knots.push(self.ends[1]);
        let mut divided = Vec::new();
        for pair in knots.windows(2) {
            let (low, high) = (f64::from(pair[0]), f64::from(pair[1]));
            let first = found.at.partition_point(|t| *t < low);
            let last = found.at.partition_point(|t| *t <= high);
            if found.errors[first.min(last)..last].iter().any(|error| *error > tolerance) {
                let middle = pair[0] + (pair[1] - pair[0]) / 2;
                if middle == pair[0] {
                    return None;
                }
                divided.push(middle);
            }
            divided.push(pair[1]);
        }
        divided.pop();
        // An error exactly at a knot may be attributed to neither side.
        (divided.len() > inner.len()).then_some(divided)
    }
}

/// Moves each parameter by one step towards the nearest point of the curve, but never past
/// the one before. The first and the last parameter stay, and so do those outside `ends`.
fn follow(
    positions: &[PlanPoint],
    at: &mut [f64],
    bases: &[Basis],
    control: &[PlanPoint],
    ends: [f64; 2],
) {
    let between = 1..at.len() - 1;
    let [mut reached, end] = ends;
    for (number, (t, basis)) in at.iter_mut().zip(bases).enumerate() {
        if !between.contains(&number) {
            continue;
        }
        let away = minus(positions[number], basis.position(control));
        let slope = basis.slope(control);
        let step = dot(away, slope) / dot(slope, slope);
        if step.is_finite() {
            *t += step;
        }
        *t = t.clamp(reached, end);
        reached = *t;
    }
}

/// The error of each sample: its distance from its point on the curve, or the distance from the
/// curve to the polyline halfway to the sample before, whichever is larger. It is 0 where there is
/// no `position`.
fn errors(
    positions: &[PlanPoint],
    at: &[f64],
    position: impl Fn(f64) -> Option<PlanPoint>,
) -> Vec<f64> {
    let from = |t, to| position(t).map_or(0.0, |position| distance(position, to));
    let mut errors = vec![0.0];
    for (samples, at) in positions.windows(2).zip(at.windows(2)) {
        let middle = [0, 1].map(|axis: usize| (samples[0][axis] + samples[1][axis]) / 2.0);
        errors.push(from(at[1], samples[1]).max(from((at[0] + at[1]) / 2.0, middle)));
    }
    errors
}
