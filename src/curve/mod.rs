//! B-splines: a smooth curve from few control points (Allard & Bown 1978).
//!
//! A [`Spline`] looks at control points in memory that others own; it copies none. [`Spline::at`] gives a
//! place on it, [`Spline::chords`] the fewest straight lines that stay within a tolerance on the page.
//! An affine map of the control points is the same map of the curve, so a curve may be evaluated in the
//! model's space or in view coordinates alike.
//!
//! Order m is degree m - 1: order 2 is the polygon itself, 3 the paper's quadratic, 4 the common cubic.
//! Multiplicity is a control point named several times: the first and the last one m - 1 times make the
//! curve begin and end there; naming the first m - 1 ones again at the end closes it. Refused: what is
//! no curve (see [`CurveError`]).

mod chords;
mod span;

pub use chords::{Chords, Fine};

use span::Span;

/// The lowest order: straight lines.
pub const LEAST_ORDER: u8 = 2;
/// The highest order: degree 5.
pub const GREATEST_ORDER: u8 = 6;

/// Knots stay within ± this, in any unit: then 64 bits hold every product.
pub const KNOT_LIMIT: i32 = 1 << 22;

/// Between whole units of a coordinate, places on a curve have this many bits more.
pub const FRACTION_BITS: u32 = 8;

/// Three coordinates of a control point, each within ±2^30; a plane curve leaves the third zero.
pub type Point = [i32; 3];

/// Where the polynomials of a spline meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Knots<'a> {
    /// 0, 1, 2, …: control point i acts from knot i to knot i + order, as in the paper.
    Uniform,
    /// As many as control points and order together, never decreasing, in any unit,
    /// within ±[`KNOT_LIMIT`].
    Listed(&'a [i32]),
    /// The same, each in two halves as it lies in memory.
    Packed(&'a [[u16; 2]]),
}

impl Knots<'_> {
    /// Knot `index`; past the end the last one.
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

    /// How many the user listed; `None` if they are uniform.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Uniform => None,
            Self::Listed(knots) => Some(knots.len()),
            Self::Packed(knots) => Some(knots.len()),
        }
    }
}

/// Why there is no such curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CurveError {
    /// The order is not 2 to 6 (the degree 1 to 5).
    Order,
    /// A curve of this order needs more control points.
    TooFewControlPoints {
        /// How many it needs.
        needed: usize,
    },
    /// More control points than a [`Parameter`] can tell apart.
    TooManyControlPoints {
        /// How many there can be.
        limit: usize,
    },
    /// A control point that does not exist.
    UnknownPoint {
        /// Its number, from 0.
        number: u16,
    },
    /// There must be as many knots as control points and order together.
    WrongKnotCount {
        /// How many there must be.
        needed: usize,
        /// How many there are.
        given: usize,
    },
    /// A knot is less than the one before it.
    KnotDecreases {
        /// Which, from 0.
        knot: usize,
    },
    /// A knot is past ±[`KNOT_LIMIT`].
    KnotTooLarge {
        /// Which, from 0.
        knot: usize,
    },
    /// A knot inside the curve is repeated more often than the degree: the curve would break there.
    KnotRepeated {
        /// The first of them, from 0.
        knot: usize,
    },
    /// The curve's ends are not in order, or lie outside the knots number order - 1 to number of control
    /// points (from 0).
    OutsideKnots,
}

/// A place along a spline: which polynomial, and where along it in units of 2^-20 of its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Parameter(u32);

impl Parameter {
    const LOCAL_BITS: u32 = 20;
    const ONE: u32 = 1 << Self::LOCAL_BITS;
    /// So many polynomials that 32 bits hold the end of the last.
    const SPAN_LIMIT: usize = (1 << (32 - Self::LOCAL_BITS)) - 1;

    fn start_of(span: usize) -> Self {
        Self((span.min(Self::SPAN_LIMIT) as u32) << Self::LOCAL_BITS)
    }

    fn span(self) -> usize {
        (self.0 >> Self::LOCAL_BITS) as usize
    }

    fn local(self) -> u32 {
        self.0 & (Self::ONE - 1)
    }

    /// As 32 bits, to be kept in little memory.
    pub const fn to_bits(self) -> u32 {
        self.0
    }

    /// What [`Parameter::to_bits`] gave. A spline takes any other bits for its nearest end.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

/// A B-spline over control points, or a part of one.
///
/// Guarantees: every control point exists, every knot is in range and in order.
///
/// ```
/// use penup::curve::{Knots, Spline};
/// // The curve of section 2.4, order 3, in tenths; the first and last points have multiplicity 2.
/// let points = [[0, 0, 0], [30, 90, 0], [60, 30, 0], [90, 60, 0]];
/// let curve = Spline::new(&points, &[0, 0, 1, 2, 3, 3], 3, Knots::Uniform)?;
/// // The paper's t = 2 is knot 3 here: halfway between two points (equation 25).
/// assert_eq!(curve.at(curve.parameter(3, 0)), [15, 45, 0]);
/// # Ok::<(), penup::curve::CurveError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Spline<'a> {
    points: &'a [Point],
    control: &'a [u16],
    order: u8,
    knots: Knots<'a>,
    from: Parameter,
    to: Parameter,
}

impl<'a> Spline<'a> {
    /// The spline of `order` over the control points numbered `control` in `points`.
    ///
    /// It runs over all of its knots: from number order - 1 to number of control points, from 0.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn new(
        points: &'a [Point],
        control: &'a [u16],
        order: u8,
        knots: Knots<'a>,
    ) -> Result<Self, CurveError> {
        check_shape(control.len(), order, knots)?;
        let unknown = control.iter().find(|number| usize::from(**number) >= points.len());
        if let Some(number) = unknown {
            return Err(CurveError::UnknownPoint { number: *number });
        }
        let spans = control.len() + 1 - usize::from(order);
        let (from, to) = (Parameter::start_of(0), Parameter::start_of(spans));
        let whole = Self { points, control, order, knots, from, to };
        check_interior(whole.order, knots, whole.knot(0), whole.knot(spans))?;
        Ok(whole)
    }

    /// The part of it between two parameters, each moved to the curve's nearest end if outside.
    #[must_use]
    pub fn between(self, from: Parameter, to: Parameter) -> Self {
        let end = Parameter::start_of(self.spans());
        let from = from.min(end);
        Self { from, to: to.clamp(from, end), ..self }
    }

    /// Where it begins and ends.
    pub fn ends(&self) -> (Parameter, Parameter) {
        (self.from, self.to)
    }

    /// How many polynomials it is made of, those of no length included.
    fn spans(&self) -> usize {
        self.control.len() + 1 - usize::from(self.order)
    }

    /// The knot where polynomial `span` begins.
    fn knot(&self, span: usize) -> i64 {
        self.knots.get(span + usize::from(self.order) - 1)
    }

    /// The parameter of the knot value `u` × 2^-`fraction_bits` in the knots' unit; the nearest end of
    /// the whole spline if it is outside. `fraction_bits` at most 16.
    pub fn parameter(&self, u: i64, fraction_bits: u32) -> Parameter {
        parameter_of(self.control.len(), self.order, self.knots, u, fraction_bits)
    }

    /// The place at `t`, rounded to whole units.
    ///
    /// Before that last rounding it is within 1/16 unit of the exact place.
    pub fn at(&self, t: Parameter) -> Point {
        rounded(self.exactly_at(t))
    }

    /// The place at `t` in units of 2^-[`FRACTION_BITS`].
    fn exactly_at(&self, t: Parameter) -> [i64; 3] {
        let t = t.min(Parameter::start_of(self.spans()));
        let mut span = Span::default();
        // The polynomial that `t` lies on, or else the next that has a length, or else the one before.
        match (t.span()..self.spans()).find(|number| self.load(*number, &mut span)) {
            Some(number) => span.at(if number == t.span() { t.local() } else { 0 }),
            None => {
                let _ = (0..t.span()).rev().find(|number| self.load(*number, &mut span));
                span.at(Parameter::ONE)
            }
        }
    }

    /// Chord ends, from the curve's beginning to its end: see [`Chords`].
    ///
    /// `project` takes a place (in units of 2^-[`FRACTION_BITS`] of the control points' unit) to the page
    /// in fine units, usually 1/256 step; `None` for a place that is cut off because it is nearer than
    /// the near plane. It must take straight lines to straight lines. `tolerance` in the same fine units.
    pub fn chords<F>(&self, project: F, tolerance: u16) -> Chords<'a, F>
    where
        F: Fn([i64; 3]) -> Option<Fine>,
    {
        Chords::new(*self, project, tolerance)
    }

    /// Makes `span` polynomial `number`. `false` if that has no length or does not exist.
    #[inline(never)] // Its frame must not lie under that of a search.
    fn load(&self, number: usize, span: &mut Span) -> bool {
        let degree = usize::from(self.order) - 1;
        let Some(numbers) = self.control.get(number..number + degree + 1) else { return false };
        span.hold(numbers.iter().map(|number| {
            // `new` has made sure that it exists.
            self.points.get(usize::from(*number)).map_or([0; 3], |point| point.map(i64::from))
        }));
        if self.knots == Knots::Uniform {
            span.turn_by_recursion();
            return true;
        }
        // The 2 m - 2 knots around the polynomial: it lies between the middle two.
        let mut around = [0; 2 * (GREATEST_ORDER as usize - 1)];
        for (knot, index) in around.iter_mut().take(2 * degree).zip(number + 1..) {
            *knot = self.knots.get(index) as i32; // within KNOT_LIMIT
        }
        span.turn_by_de_boor(&around)
    }
}

/// To whole units. The curve stays within the box around its control points, so it fits.
fn rounded(place: [i64; 3]) -> Point {
    place.map(|c| ((c + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS) as i32)
}

/// See [`Spline::parameter`].
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
    // Below 2^(23 + 16 + 21).
    let local = (((u - knot(span)) << (Parameter::LOCAL_BITS + 1)) / length + 1) >> 1;
    Parameter(Parameter::start_of(span).0 + local as u32)
}

/// Checks what does not depend on where the points are.
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

/// Checks that the curve has a length and hangs together from one knot value to the other.
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
