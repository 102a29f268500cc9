//! One polynomial of a spline, held by its Bézier points, so that it can be cut anywhere.

use super::{FRACTION_BITS, GREATEST_ORDER, Parameter};

const POINTS: usize = GREATEST_ORDER as usize;

/// A polynomial of degree 1 to 5 by its Bézier points, in units of 2^-[`FRACTION_BITS`].
///
/// |coordinate| <= 2^38, so a difference times a ratio of 23 bits fits 62 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Span {
    points: [[i64; 3]; POINTS],
    degree: usize,
}

/// Binomial coefficients up to those of order 6.
const BINOMIAL: [[i64; 7]; 7] = {
    let mut rows = [[0; 7]; 7];
    let mut n = 0;
    while n < 7 {
        rows[n][0] = 1;
        let mut k = 1;
        while k <= n {
            rows[n][k] = rows[n - 1][k - 1] + rows[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    rows
};

impl Span {
    /// By the recursion of Allard & Bown, equations 15 and 16, for knots one apart.
    ///
    /// `points`: the degree + 1 control points that act on this polynomial. From one knot to the next
    /// the polynomial changes by a correction (t - k)^(m-1) Σ (-1)^i C(m, i) P(k-i) / (m-1)!. Points
    /// that came before act no longer, so the recursion may begin with nothing at the first of these.
    /// (m-1)! times each coefficient is a whole number: nothing is rounded before the last line.
    pub(super) fn by_recursion(points: &[[i64; 3]; POINTS], degree: usize) -> Self {
        let order = degree + 1;
        let factorial: i64 = (1..=degree as i64).product();
        let mut span = Self { points: [[0; 3]; POINTS], degree };
        for axis in 0..3 {
            // (m-1)! R(t) by powers of the distance from the knot; below 2^51.
            let mut powers = [0i64; POINTS];
            for k in 0..order {
                // From the knot before to this one: t - (k - 1) = (t - k) + 1.
                for low in 0..degree {
                    for power in (low..degree).rev() {
                        powers[power] += powers[power + 1];
                    }
                }
                powers[degree] += (0..=k)
                    .map(|i| {
                        let sign = if i % 2 == 0 { 1 } else { -1 };
                        sign * BINOMIAL[order][i] * points[k - i][axis]
                    })
                    .sum::<i64>();
            }
            // Bézier point j is Σ C(j, i) / C(degree, i) times coefficient i; 60 is a multiple of every
            // C(degree, i). The coefficients are now below 2^5 5! C(degree, i) 2^30: no sum passes 2^54.
            for (j, point) in span.points.iter_mut().enumerate().take(order) {
                let sum: i64 =
                    (0..=j).map(|i| BINOMIAL[j][i] * (60 / BINOMIAL[degree][i]) * powers[i]).sum();
                point[axis] = divide_rounding(sum << FRACTION_BITS, 60 * factorial);
            }
        }
        span
    }

    /// By de Boor's recursion (the paper's reference 6), for knots at any distance.
    ///
    /// `around`: the `degree` knots up to the polynomial's beginning, and as many from its end on.
    /// `None` if the polynomial has no length. Inserts first its beginning, then its end, until each is
    /// a knot `degree` times: then the control points are the Bézier points.
    pub(super) fn by_de_boor(points: &[[i64; 3]; POINTS], around: &[i32]) -> Option<Self> {
        let degree = around.len() / 2;
        let knot = |index: usize| i64::from(around[index]);
        let (begin, end) = (knot(degree - 1), knot(degree));
        if begin >= end {
            return None;
        }
        let mut moving = points.map(|point| point.map(|c| c << FRACTION_BITS));
        let mut span = Self { points: moving, degree };
        for level in 1..=degree {
            for i in (level..=degree).rev() {
                let (low, high) = (knot(i - 1), knot(i + degree - level));
                moving[i] = between(moving[i - 1], moving[i], begin - low, high - low);
            }
            span.points[degree - level] = moving[degree];
        }
        for level in 2..=degree {
            for i in (level..=degree).rev() {
                let high = knot(degree + 1 + i - level);
                let ends = (span.points[i - 1], span.points[i]);
                span.points[i] = between(ends.0, ends.1, end - begin, high - begin);
            }
        }
        Some(span)
    }

    /// Its Bézier points; the first and the last lie on the curve.
    pub(super) fn points(&self) -> &[[i64; 3]] {
        &self.points[..=self.degree]
    }

    /// The place at `local` × 2^-20 of the way (de Casteljau).
    pub(super) fn at(&self, local: u32) -> [i64; 3] {
        self.split(local).0.points[self.degree]
    }

    /// Cuts it at `local` × 2^-20 of the way.
    pub(super) fn split(&self, local: u32) -> (Self, Self) {
        let degree = self.degree;
        let (mut left, mut right) = (*self, *self);
        for level in 1..=degree {
            for i in 0..=degree - level {
                right.points[i] = along(right.points[i], right.points[i + 1], local);
            }
            left.points[level] = right.points[0];
        }
        (left, right)
    }

    /// The part from `from` to `to` × 2^-20 of the way.
    pub(super) fn part(&self, from: u32, to: u32) -> Self {
        let rest = if from == 0 { *self } else { self.split(from).1 };
        if to >= Parameter::ONE {
            return rest;
        }
        let length = Parameter::ONE - from;
        let to = (u64::from(to - from) << Parameter::LOCAL_BITS) / u64::from(length.max(1));
        rest.split(to as u32).0 // at most 2^20, since to <= 2^20
    }
}

/// p + (q - p) numerator / denominator, rounded. Both below 2^23, the ratio within 0 to 1.
fn between(p: [i64; 3], q: [i64; 3], numerator: i64, denominator: i64) -> [i64; 3] {
    core::array::from_fn(|axis| {
        p[axis] + divide_rounding((q[axis] - p[axis]) * numerator, denominator)
    })
}

/// p + (q - p) local 2^-20, rounded.
fn along(p: [i64; 3], q: [i64; 3], local: u32) -> [i64; 3] {
    const HALF: i64 = 1 << (Parameter::LOCAL_BITS - 1);
    core::array::from_fn(|axis| {
        p[axis] + (((q[axis] - p[axis]) * i64::from(local) + HALF) >> Parameter::LOCAL_BITS)
    })
}

/// Divides, rounding half away from zero. `divisor` > 0.
fn divide_rounding(dividend: i64, divisor: i64) -> i64 {
    let half = divisor / 2;
    if dividend < 0 { -((half - dividend) / divisor) } else { (dividend + half) / divisor }
}
