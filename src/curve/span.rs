//! One polynomial of a spline, stored by its Bézier points, so that it can be cut anywhere.

use super::{FRACTION_BITS, GREATEST_ORDER, Parameter};

/// The greatest number of Bézier points of a polynomial, one more than the highest degree.
const POINTS: usize = GREATEST_ORDER as usize;

// Why no index in this file can fail, and no division: `degree` is at most 5, because `Spline::new`
// refuses other orders than 2 to 6 and `Spline::load` holds as many control points as the order. It
// is 0 before a span is loaded, and at least 1 in the two conversions. `points` and `powers` have
// entries 0 to 5, and `BINOMIAL` has rows and columns 0 to 6. All indices of points and powers are
// from 0 to `degree`: where one lower is read, the loop begins at 1, and where one higher is read,
// it ends before `degree`. `around` has 10 knots, and the greatest index of a knot is
// 2 `degree` - 1. An axis is 0, 1 or 2.

/// A polynomial of degree 1 to 5, given by its Bézier points in units of 2^-[`FRACTION_BITS`].
///
/// Coordinates are within ±2^38, so a difference times a number of 23 bits fits in 62 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Span {
    /// The Bézier points, of which the first `degree` + 1 are used.
    points: [[i64; 3]; POINTS],
    /// The degree of the polynomial that this span is.
    degree: usize,
}

/// The binomial coefficients C(n, k) for n up to 6.
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
    /// Converts control points to Bézier points by the recursion of Allard & Bown, equations 15 and
    /// 16, for knots at unit distance.
    ///
    /// `self` holds the degree + 1 control points that affect this polynomial. From one knot to the
    /// next the polynomial changes by a correction (t - k)^(m-1) Σ (-1)^i C(m, i) P(k-i) / (m-1)!.
    /// Earlier points no longer have an effect, so the recursion can start from zero at the first
    /// of these points. (m-1)! times each coefficient is an integer, so nothing is rounded before
    /// the last line.
    pub(super) fn turn_by_recursion(&mut self) {
        let degree = self.degree;
        let order = degree + 1;
        let factorial: i64 = (1..=degree as i64).product();
        for axis in 0..3 {
            // These are the coefficients of (m-1)! R(t) in powers of the distance from the knot;
            // they are below 2^51.
            let mut powers = [0i64; POINTS];
            for k in 0..order {
                // Moves from the previous knot to this one: t - (k - 1) = (t - k) + 1.
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
            // Bézier point j is the sum of C(j, i) / C(degree, i) times coefficient i, where 60 is
            // a multiple of every C(degree, i). The coefficients are now below 2^5 5! C(degree, i)
            // 2^30, so no sum exceeds 2^54.
            for (j, point) in self.points.iter_mut().enumerate().take(order) {
                // Since i <= j <= degree, C(degree, i) is not 0.
                let sum: i64 =
                    (0..=j).map(|i| BINOMIAL[j][i] * (60 / BINOMIAL[degree][i]) * powers[i]).sum();
                point[axis] = divide_rounding(sum << FRACTION_BITS, 60 * factorial);
            }
        }
    }

    /// Converts control points to Bézier points by de Boor's recursion (the paper's reference 6),
    /// for knots at any distance.
    ///
    /// `self` holds the control points as in the other conversion. `around` holds the `degree`
    /// knots up to the beginning of the polynomial and as many from its end on. Returns `false` if
    /// the polynomial has zero length. The method inserts the knot at the beginning, then the one
    /// at the end, until each has multiplicity `degree`. Then the control points are the Bézier
    /// points.
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

    /// Stores control points, which are then to be converted to Bézier points.
    pub(super) fn hold(&mut self, control: impl ExactSizeIterator<Item = [i64; 3]>) {
        self.degree = control.len() - 1;
        for (point, control) in self.points.iter_mut().zip(control) {
            *point = control;
        }
    }

    /// Returns the Bézier points. The first and the last are on the curve; the others pull it
    /// towards them.
    pub(super) fn points(&self) -> &[[i64; 3]] {
        self.points.get(..=self.degree).unwrap_or(&self.points)
    }

    /// Returns the point at the position `local` × 2^-20 of the polynomial (de Casteljau).
    pub(super) fn at(&self, local: u32) -> [i64; 3] {
        let mut rest = *self;
        rest.keep_from(local);
        rest.points[0]
    }

    /// Returns the part of the polynomial between the positions `from` × 2^-20 and `to` × 2^-20.
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

    /// Keeps only the part after the position `local` × 2^-20.
    fn keep_from(&mut self, local: u32) {
        for level in 1..=self.degree {
            for i in 0..=self.degree - level {
                self.points[i] = along(self.points[i], self.points[i + 1], local);
            }
        }
    }

    /// Keeps only the part before the position `local` × 2^-20.
    fn keep_to(&mut self, local: u32) {
        for level in 1..=self.degree {
            for i in (level..=self.degree).rev() {
                self.points[i] = along(self.points[i - 1], self.points[i], local);
            }
        }
    }
}

/// p + (q - p) numerator / denominator, rounded. Numerator and denominator are below 2^23, and
/// their ratio is within 0 to 1.
fn between(p: [i64; 3], q: [i64; 3], numerator: i64, denominator: i64) -> [i64; 3] {
    core::array::from_fn(|axis| {
        p[axis] + divide_rounding((q[axis] - p[axis]) * numerator, denominator)
    })
}

/// Returns the point at `local` × 2^-20 of the way from `p` to `q`, rounded.
fn along(p: [i64; 3], q: [i64; 3], local: u32) -> [i64; 3] {
    const HALF: i64 = 1 << (Parameter::LOCAL_BITS - 1);
    core::array::from_fn(|axis| {
        p[axis] + (((q[axis] - p[axis]) * i64::from(local) + HALF) >> Parameter::LOCAL_BITS)
    })
}

/// Divides and rounds half away from zero. `divisor` must be positive.
fn divide_rounding(dividend: i64, divisor: i64) -> i64 {
    let divisor = divisor.unsigned_abs();
    let rounded = (dividend.unsigned_abs() + divisor / 2).checked_div(divisor);
    let rounded = rounded.unwrap_or(0).cast_signed();
    if dividend < 0 { -rounded } else { rounded }
}
