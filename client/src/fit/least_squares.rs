//! Least-squares fitting of a B-spline with given knots, of which some control points are fixed, to
//! points with given parameters.

use super::PlanPoint;
use std::ops::Range;

/// The highest order.
const MOST: usize = 4;

#[cfg(test)]
thread_local! {
    /// The number of evaluations of basis functions in this thread, which measures the work of
    /// fitting.
    static EVALUATIONS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
pub fn evaluations() -> u64 {
    EVALUATIONS.get()
}

/// The values and derivatives of the basis functions that are not zero at one parameter.
#[derive(Debug, Clone, Copy)]
pub struct Basis {
    /// The index of the first control point with a nonzero basis function.
    pub first: usize,
    weights: [f64; MOST],
    /// The derivative of each weight with respect to the parameter.
    slopes: [f64; MOST],
    order: usize,
}

impl Basis {
    /// Evaluates the basis functions at parameter `t`, which lies between the first and the last
    /// knot.
    pub fn at(knots: &[f64], order: usize, t: f64) -> Self {
        #[cfg(test)]
        EVALUATIONS.with(|count| count.set(count.get() + 1));
        let control_points = knots.len() - order;
        let span = knots.partition_point(|knot| *knot <= t).clamp(order, control_points) - 1;
        let mut weights = [0.0; MOST];
        let mut slopes = [0.0; MOST];
        weights[0] = 1.0;
        for level in 1..order {
            let lower = weights;
            weights = [0.0; MOST];
            slopes = [0.0; MOST];
            for number in 0..level {
                let left = knots[span + 1 + number - level];
                let width = knots[span + 1 + number] - left;
                let share = lower[number] / width;
                weights[number] += (knots[span + 1 + number] - t) * share;
                weights[number + 1] += (t - left) * share;
                slopes[number] -= level as f64 * share;
                slopes[number + 1] += level as f64 * share;
            }
        }
        Self { first: span + 1 - order, weights, slopes, order }
    }

    /// The point on the curve.
    pub fn position(&self, control: &[PlanPoint]) -> PlanPoint {
        self.sum(&self.weights, control)
    }

    /// The derivative of that point with respect to the parameter.
    pub fn slope(&self, control: &[PlanPoint]) -> PlanPoint {
        self.sum(&self.slopes, control)
    }

    fn sum(&self, weights: &[f64; MOST], control: &[PlanPoint]) -> PlanPoint {
        let mut sum = [0.0; 2];
        for (weight, point) in weights.iter().zip(&control[self.first..self.first + self.order]) {
            sum[0] += weight * point[0];
            sum[1] += weight * point[1];
        }
        sum
    }
}

/// Moves the control points with the indices `free` to minimise the sum of the squared distances
/// between the spline and `positions`; the others stay. Each position comes with its basis.
pub fn least_squares<'a>(
    positions: impl Iterator<Item = (&'a PlanPoint, &'a Basis)>,
    control: &mut [PlanPoint],
    free: Range<usize>,
) {
    // The normal equations for the free control points. Each row contains the entries of the band
    // to the left of the diagonal, and the diagonal.
    let mut rows = vec![[0.0; MOST]; free.len()];
    let mut sides = vec![[0.0; 2]; free.len()];
    for (position, basis) in positions {
        let mut rest = *position;
        for (number, weight) in basis.weights.iter().enumerate().take(basis.order) {
            let point = basis.first + number;
            if !free.contains(&point) {
                let fixed = control[point];
                rest = [rest[0] - weight * fixed[0], rest[1] - weight * fixed[1]];
            }
        }
        for (i, weight) in basis.weights.iter().enumerate().take(basis.order) {
            let point = basis.first + i;
            if !free.contains(&point) {
                continue;
            }
            let row = point - free.start;
            sides[row][0] += weight * rest[0];
            sides[row][1] += weight * rest[1];
            for (j, other) in basis.weights.iter().enumerate().take(i + 1) {
                if free.contains(&(basis.first + j)) {
                    rows[row][MOST - 1 - (i - j)] += weight * other;
                }
            }
        }
    }
    solve(&mut rows, &mut sides);
    control[free].copy_from_slice(&sides);
}

/// Solves a symmetric band system by Cholesky factorisation; `sides` becomes the solution.
fn solve(rows: &mut [[f64; MOST]], sides: &mut [PlanPoint]) {
    const DIAGONAL: usize = MOST - 1;
    for i in 0..rows.len() {
        // This keeps a control point on which no place depends near zero instead of undefined.
        rows[i][DIAGONAL] += 1e-9;
        for j in i.saturating_sub(DIAGONAL)..=i {
            let mut rest = rows[i][DIAGONAL - (i - j)];
            for k in i.saturating_sub(DIAGONAL)..j {
                rest -= rows[i][DIAGONAL - (i - k)] * rows[j][DIAGONAL - (j - k)];
            }
            rows[i][DIAGONAL - (i - j)] =
                if i == j { rest.max(1e-12).sqrt() } else { rest / rows[j][DIAGONAL] };
        }
    }
    let count = rows.len();
    for i in 0..count {
        let known = i.saturating_sub(DIAGONAL)..i;
        sides[i] =
            rest(sides, i, rows[i][DIAGONAL], known.map(|k| (k, rows[i][DIAGONAL - (i - k)])));
    }
    for i in (0..count).rev() {
        let known = i + 1..count.min(i + MOST);
        sides[i] =
            rest(sides, i, rows[i][DIAGONAL], known.map(|k| (k, rows[k][DIAGONAL - (k - i)])));
    }
}

/// Computes unknown number `i` of a triangular system from the unknowns that are already `known`.
fn rest(
    sides: &[PlanPoint],
    i: usize,
    diagonal: f64,
    known: impl Iterator<Item = (usize, f64)>,
) -> PlanPoint {
    let [x, y] = known
        .fold(sides[i], |[x, y], (k, factor)| [x - factor * sides[k][0], y - factor * sides[k][1]]);
    [x / diagonal, y / diagonal]
}
