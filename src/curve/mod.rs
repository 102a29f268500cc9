//! B-splines: smooth curves defined by few control points (Allard & Bown 1978).
//!
//! A [`Spline`] borrows its control points and copies none. [`Spline::at`] returns a point on the
//! curve, and [`Spline::chords`] returns few straight lines that stay within a tolerance of the
//! curve on the page. An affine map of the control points maps the curve in the same way, so a
//! curve can be evaluated in model space or in view coordinates.
//!
//! A curve of order m has degree m - 1: order 2 is the polygon itself, order 3 the paper's
//! quadratic, order 4 the usual cubic. The multiplicity of a control point is the number of times
//! that it is listed in a row. If the first and the last point are listed m - 1 times, the curve
//! begins and ends there. If the first m - 1 points are listed again at the end, the curve is
//! closed. Input that gives no curve is refused (see [`CurveError`]).

mod chords;
mod span;

pub use chords::{Chords, Fine};

use crate::array::MapEach;
use crate::index::Index;
use span::Span;

/// The lowest order, which gives straight lines.
pub const LEAST_ORDER: u8 = 2;
/// The highest order of a curve (its degree plus 1) that is accepted: degree 5.
pub const GREATEST_ORDER: u8 = 6;

/// The greatest absolute value of a knot, in any unit. With this limit, 64 bits hold every product.
pub const KNOT_LIMIT: i32 = 1 << 22;

/// The number of additional fraction bits that points on a curve have over the units of the
/// coordinates.
pub const FRACTION_BITS: u32 = 8;

/// The coordinates of a control point, each within ±2^30. A plane curve sets the third to zero.
pub type Point = [i32; 3];

/// The knots, which are the parameter values where the polynomials of a spline meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Knots<'a> {
    /// The knots are 0, 1, 2, …. Control point i has an effect from knot i to knot i + order, as in
    /// the paper.
    Uniform,
    /// A list of as many knots as the number of control points plus the order. The knots never
    /// decrease and are within ±[`KNOT_LIMIT`], in any unit.
    Listed(&'a [i32]),
    /// As [`Knots::Listed`], with each knot stored as two halves in memory order, as a model stores
    /// them.
    Packed(&'a [[u16; 2]]),
}

impl Knots<'_> {
    /// Returns the knot with this index, or the last knot if there are fewer.
    pub(crate) fn get(&self, index: usize) -> i64 {
        match self {
            Self::Uniform => index as i64,
            Self::Listed(knots) => {
                knots.get(index).or(knots.last()).map_or(0, |knot| i64::from(*knot))
            }
            Self::Packed(knots) => knots
                .get(index)
                .or(knots.last())
                .map_or(0, |knot| i64::from(bytemuck::cast::<[u16; 2], i32>(*knot))),
        }
    }

    /// Returns how many knots are listed, or `None` if the knots are uniform.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Uniform => None,
            Self::Listed(knots) => Some(knots.len()),
            Self::Packed(knots) => Some(knots.len()),
        }
    }
}

/// The reasons why a curve is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CurveError {
    /// The order is not one of 2 to 6, which are the degrees 1 to 5.
    Order,
    /// A curve of this order needs more control points.
    TooFewControlPoints {
        /// The number of control points that the order needs.
        needed: usize,
    },
    /// There are more control points than a [`Parameter`] can tell apart.
    TooManyControlPoints {
        /// The greatest possible number of control points.
        limit: usize,
    },
    /// The curve refers to a control point that does not exist.
    UnknownPoint {
        /// The number of the missing point, from 0.
        number: u32,
    },
    /// The number of knots must be the number of control points plus the order.
    WrongKnotCount {
        /// The number of knots that is needed.
        needed: usize,
        /// The number of knots that was given.
        given: usize,
    },
    /// A knot is less than the one before it.
    KnotDecreases {
        /// The number of the knot that is less than the one before it, from 0.
        knot: usize,
    },
    /// The absolute value of a knot is greater than [`KNOT_LIMIT`].
    KnotTooLarge {
        /// The number of the knot that is too large, from 0.
        knot: usize,
    },
    /// A knot inside the curve is repeated more often than the degree, so the curve would be
    /// discontinuous there.
    KnotRepeated {
        /// The number of the first of these knots, from 0.
        knot: usize,
    },
    /// The ends of the curve are not in order, or they are outside the range from knot number
    /// (order - 1) to the knot whose number is the number of control points. Numbers count from 0.
    OutsideKnots,
}

/// A position along a spline: the number of the polynomial, and the position on it in units of
/// 2^-20 of its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Parameter(u32);

impl Parameter {
    /// The number of bits that say where on its polynomial a position lies.
    const LOCAL_BITS: u32 = 20;
    /// The length of one polynomial in units of the parameter.
    const ONE: u32 = 1 << Self::LOCAL_BITS;
    /// The greatest number of polynomials for which 32 bits hold the end of the last one.
    const SPAN_LIMIT: usize = (1 << (32 - Self::LOCAL_BITS)) - 1;

    /// Returns the parameter at which a span begins.
    fn start_of(span: usize) -> Self {
        Self((span.min(Self::SPAN_LIMIT) as u32) << Self::LOCAL_BITS)
    }

    /// Returns the number of the polynomial (the span) on which the position lies.
    fn span(self) -> usize {
        (self.0 >> Self::LOCAL_BITS) as usize
    }

    /// Returns the position within the span, in units of 2^-[`Self::LOCAL_BITS`].
    fn local(self) -> u32 {
        self.0 & (Self::ONE - 1)
    }

    /// The position as 32 bits, for compact storage.
    pub const fn to_bits(self) -> u32 {
        self.0
    }

    /// Restores a position from the result of [`Parameter::to_bits`]. A spline treats any other
    /// bits as its nearest end.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

/// A B-spline with its control points and knots, or a part of one.
///
/// A value of this type guarantees that every control point exists and that every knot is in range
/// and in order.
///
/// ```
/// use penup::curve::{Knots, Spline};
/// // The curve of section 2.4, order 3, in tenths; the first and last points have multiplicity 2.
/// let points = [[0, 0, 0], [30, 90, 0], [60, 30, 0], [90, 60, 0]];
/// let curve = Spline::<u16>::new(&points, &[0, 0, 1, 2, 3, 3], 3, Knots::Uniform)?;
/// // The paper's t = 2 is knot 3 here: halfway between two points (equation 25).
/// assert_eq!(curve.at(curve.parameter(3, 0)), [15, 45, 0]);
/// # Ok::<(), penup::curve::CurveError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Spline<'a, I = u16> {
    /// All points, from which `control` selects.
    points: &'a [Point],
    /// The numbers of the control points, in order.
    control: &'a [I],
    /// The order of the spline, which is its degree plus 1.
    order: u8,
    /// The knots, which are the parameter values where its polynomials meet.
    knots: Knots<'a>,
    /// The position at which the curve begins.
    from: Parameter,
    /// The position at which the curve ends.
    to: Parameter,
}

impl<'a, I: Index> Spline<'a, I> {
    /// The spline of `order` over the control points numbered `control` in `points`.
    ///
    /// The curve covers its whole range: from knot number order - 1 to the knot whose number is the
    /// number of control points, counted from 0.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn new(
        points: &'a [Point],
        control: &'a [I],
        order: u8,
        knots: Knots<'a>,
    ) -> Result<Self, CurveError> {
        check_shape(control.len(), order, knots)?;
        let unknown = control.iter().find(|number| number.get() >= points.len());
        if let Some(number) = unknown {
            return Err(CurveError::UnknownPoint { number: (*number).into() });
        }
        let spans = control.len() + 1 - usize::from(order);
        let (from, to) = (Parameter::start_of(0), Parameter::start_of(spans));
        let whole = Self { points, control, order, knots, from, to };
        check_interior(whole.order, knots, whole.knot(0), whole.knot(spans))?;
        Ok(whole)
    }

    /// The part of the curve between two positions. Each of them is moved to the nearest end of the
    /// curve if it is outside.
    #[must_use]
    pub fn between(self, from: Parameter, to: Parameter) -> Self {
        let end = Parameter::start_of(self.spans());
        let from = from.min(end);
        Self { from, to: to.clamp(from, end), ..self }
    }

    /// Returns the positions at which the curve begins and ends.
    pub fn ends(&self) -> (Parameter, Parameter) {
        (self.from, self.to)
    }

    /// The number of polynomials of the spline, including those of zero length.
    fn spans(&self) -> usize {
        self.control.len() + 1 - usize::from(self.order)
    }

    /// Returns the knot at which polynomial number `span` begins.
    fn knot(&self, span: usize) -> i64 {
        self.knots.get(span + usize::from(self.order) - 1)
    }

    /// The position for the knot value `u` × 2^-`fraction_bits`, in the unit of the knots. A value
    /// outside the whole spline gives its nearest end. `fraction_bits` is at most 16.
    pub fn parameter(&self, u: i64, fraction_bits: u32) -> Parameter {
        parameter_of(self.control.len(), self.order, self.knots, u, fraction_bits)
    }

    /// The point at `t`, rounded to whole units.
    ///
    /// Before this rounding the result is within 1/16 unit of the exact point.
    pub fn at(&self, t: Parameter) -> Point {
        rounded(self.exactly_at(t))
    }

    /// Returns the point of the curve at `t`, in units of 2^-[`FRACTION_BITS`] and not rounded to
    /// whole units.
    fn exactly_at(&self, t: Parameter) -> [i64; 3] {
        let t = t.min(Parameter::start_of(self.spans()));
        let mut span = Span::default();
        // Use the polynomial on which `t` lies. If it has zero length, use the next one that has a
        // length, otherwise the previous one.
        match (t.span()..self.spans()).find(|number| self.load(*number, &mut span)) {
            Some(number) => span.at(if number == t.span() { t.local() } else { 0 }),
            None => {
                let _ = (0..t.span()).rev().find(|number| self.load(*number, &mut span));
                span.at(Parameter::ONE)
            }
        }
    }

    /// The ends of the chords that approximate the curve, from its beginning to its end: see
    /// [`Chords`].
    ///
    /// `project` maps a point (in units of 2^-[`FRACTION_BITS`] of the unit of the control points)
    /// to the page in fine units, usually 1/256 step. It returns `None` for a point that is clipped
    /// because it is nearer than the near plane. It must map straight lines to straight lines.
    /// `tolerance` is in the same fine units.
    pub fn chords<F>(&self, project: F, tolerance: u16) -> Chords<'a, F, I>
    where
        F: Fn([i64; 3]) -> Option<Fine>,
    {
        Chords::new(*self, project, tolerance)
    }

    /// Loads polynomial number `number` into `span`. Returns `false` if it has zero length or does
    /// not exist.
    #[inline(never)] // Its stack frame must not add to that of a search.
    fn load(&self, number: usize, span: &mut Span) -> bool {
        let degree = usize::from(self.order) - 1;
        let Some(numbers) = self.control.get(number..number + degree + 1) else { return false };
        span.hold(numbers.iter().map(|number| {
            // `new` has checked that the point exists.
            self.points.get(number.get()).map_or([0; 3], |point| point.map_each(i64::from))
        }));
        if self.knots == Knots::Uniform {
            span.turn_by_recursion();
            return true;
        }
        // These are the 2 m - 2 knots around the polynomial, which lies between the middle two.
        let mut around = [0; 2 * (GREATEST_ORDER as usize - 1)];
        for (knot, index) in around.iter_mut().take(2 * degree).zip(number + 1..) {
            *knot = self.knots.get(index) as i32; // within KNOT_LIMIT
        }
        span.turn_by_de_boor(&around)
    }
}

/// Rounds to whole units. The result fits, because the curve stays within the bounding box of its
/// control points.
fn rounded(position: [i64; 3]) -> Point {
    position.map_each(|c| ((c + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS) as i32)
}

/// Does the work of [`Spline::parameter`] where the control points are not known yet.
pub(crate) fn parameter_of(
    control_points: usize,
    order: u8,
    knots: Knots<'_>,
    u: i64,
    fraction_bits: u32,
) -> Parameter {
    let degree = usize::from(order) - 1;
    let spans = control_points - degree;
    let knot = |span: usize| knots.get(span + degree) << fraction_bits.min(16);
    let Some(span) = (0..spans).rev().find(|span| knot(*span) <= u) else {
        return Parameter::start_of(0);
    };
    let length = knot(span + 1) - knot(span);
    if length == 0 || u >= knot(span + 1) {
        return Parameter::start_of(spans);
    }
    // The product is below 2^(23 + 16 + 21).
    let twice = ((u - knot(span)) << (Parameter::LOCAL_BITS + 1)).checked_div(length);
    let local = (twice.unwrap_or(0) + 1) >> 1;
    Parameter(Parameter::start_of(span).0 + local as u32)
}

/// Checks order, number of control points and knots, which do not depend on where the points are.
pub(crate) fn check_shape(
    control_points: usize,
    order: u8,
    knots: Knots<'_>,
) -> Result<(), CurveError> {
    if !(LEAST_ORDER..=GREATEST_ORDER).contains(&order) {
        return Err(CurveError::Order);
    }
    let needed = usize::from(order);
    if control_points < needed {
        return Err(CurveError::TooFewControlPoints { needed });
    }
    if control_points > Parameter::SPAN_LIMIT {
        return Err(CurveError::TooManyControlPoints { limit: Parameter::SPAN_LIMIT });
    }
    let Some(given) = knots.count() else { return Ok(()) };
    let needed = control_points + usize::from(order);
    if given != needed {
        return Err(CurveError::WrongKnotCount { needed, given });
    }
    let is_too_large = |knot: &usize| knots.get(*knot).abs() > i64::from(KNOT_LIMIT);
    if let Some(knot) = (0..given).find(is_too_large) {
        return Err(CurveError::KnotTooLarge { knot });
    }
    let decreases = |knot: &usize| knots.get(*knot) < knots.get(*knot - 1);
    if let Some(knot) = (1..given).find(decreases) {
        return Err(CurveError::KnotDecreases { knot });
    }
    Ok(())
}

/// Checks that the curve has a length and is continuous between the knot values `from` and `to`.
pub(crate) fn check_interior(
    order: u8,
    knots: Knots<'_>,
    from: i64,
    to: i64,
) -> Result<(), CurveError> {
    if from >= to {
        return Err(CurveError::OutsideKnots);
    }
    let Some(count) = knots.count() else { return Ok(()) };
    let order = usize::from(order);
    let breaks = |first: &usize| {
        let knot = knots.get(*first);
        from < knot && knot < to && knots.get(*first + order - 1) == knot
    };
    match (0..=count.saturating_sub(order)).find(breaks) {
        Some(knot) => Err(CurveError::KnotRepeated { knot }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
