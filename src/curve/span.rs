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
    /// `self` holds the degree + 1 control points that act on this polynomial. From one knot to the next
    /// the polynomial changes by a correction (t - k)^(m-1) Σ (-1)^i C(m, i) P(k-i) / (m-1)!. Points
    /// that came before act no longer, so the recursion may begin with nothing at the first of these.
    /// (m-1)! times each coefficient is a whole number: nothing is rounded before the last line.
    pub(super) fn turn_by_recursion(&mut self) {
        let degree = self.degree;
        let order = degree + 1;
        let factorial: i64 = (1..=degree as i64).product();
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
                        sign * BINOMIAL[order][i] * self.points[k - i][axis]
                    })
                    .sum::<i64>();
            }
            // Bézier point j is Σ C(j, i) / C(degree, i) times coefficient i; 60 is a multiple of every
            // C(degree, i). The coefficients are now below 2^5 5! C(degree, i) 2^30: no sum passes 2^54.
            for (j, point) in self.points.iter_mut().enumerate().take(order) {
                let sum: i64 =
                    (0..=j).map(|i| BINOMIAL[j][i] * (60 / BINOMIAL[degree][i]) * powers[i]).sum();
                point[axis] = divide_rounding(sum << FRACTION_BITS, 60 * factorial);
            }
        }
    }

    /// By de Boor's recursion (the paper's reference 6), for knots at any distance.
    ///
    /// `self` holds the control points as before. `around`: the `degree` knots up to the polynomial's
    /// beginning, and as many from its end on. `false` if the polynomial has no length. Inserts first its beginning, then its end, until each is
    /// a knot `degree` times: then the control points are the Bézier points.
    pub(super) fn turn_by_de_boor(&mut self, around: &[i32]) -> bool {
        let degree = self.degree;
        let knot = |index: usize| i64::from(around[index]);
        let (begin, end) = (knot(degree - 1), knot(degree));
        if begin >= end {
            return false;
        }
        let mut moving = self.points.map(|point| point.map(|c| c << FRACTION_BITS));
        let last = moving[degree];
        for level in 1..=degree {
            for i in (level..=degree).rev() {
                let (low, high) = (knot(i - 1), knot(i + degree - level));
                moving[i] = between(moving[i - 1], moving[i], begin - low, high - low);
            }
            self.points[degree - level] = moving[degree];
        }
        self.points[degree] = last;
        for level in 2..=degree {
            for i in (level..=degree).rev() {
                let high = knot(degree + 1 + i - level);
                let ends = (self.points[i - 1], self.points[i]);
                self.points[i] = between(ends.0, ends.1, end - begin, high - begin);
            }
        }
        true
    }

    /// Holds control points, to be turned into Bézier points.
    pub(super) fn hold(&mut self, control: impl ExactSizeIterator<Item = [i64; 3]>) {
        self.degree = control.len() - 1;
        for (point, control) in self.points.iter_mut().zip(control) {
            *point = control;
        }
    }

    /// Its Bézier points; the first and the last lie on the curve.
    pub(super) fn points(&self) -> &[[i64; 3]] {
        &self.points[..=self.degree]
    }

    /// The place at `local` × 2^-20 of the way (de Casteljau).
    pub(super) fn at(&self, local: u32) -> [i64; 3] {
        let mut rest = *self;
        rest.keep_from(local);
        rest.points[0]
    }

    /// The part from `from` to `to` × 2^-20 of the way.
    pub(super) fn part(&self, from: u32, to: u32) -> Self {
        let mut part = *self;
        if from > 0 {
            part.keep_from(from);
        }
        if to < Parameter::ONE {
            let length = Parameter::ONE - from;
            let to = (u64::from(to - from) << Parameter::LOCAL_BITS) / u64::from(length.max(1));
            part.keep_to(to as u32); // at most 2^20, since to <= 2^20
        }
        part
    }

    /// Leaves what comes after `local` × 2^-20 of the way.
    fn keep_from(&mut self, local: u32) {
        for level in 1..=self.degree {
            for i in 0..=self.degree - level {
                self.points[i] = along(self.points[i], self.points[i + 1], local);
            }
        }
    }

    /// Leaves what comes before `local` × 2^-20 of the way.
    fn keep_to(&mut self, local: u32) {
        for level in 1..=self.degree {
            for i in (level..=self.degree).rev() {
                self.points[i] = along(self.points[i - 1], self.points[i], local);
            }
        }
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
