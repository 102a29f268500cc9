//! Stores the curves of a model, in a region of the [store](super::store).
//!
//! They arrive as in OBJ: `deg 3`, `curv u0 u1 i1 i2 …`, `parm u k1 k2 …` (no such line, or as many
//! as needed), `end`. Without `parm` the knots are 0, 1, 2, … Each curve is stored in half-words: a
//! header of eight, its control points, and two for each knot if it has knots of its own.
//! [`CurveList`] changes them, [`Curves`] reads them.

mod edit;
mod list;

pub(super) use list::CurveList;

use crate::array::MapEach;
use crate::curve::{CurveError, Fine, Knots, Parameter, Point, Spline};
use crate::index::Index;
use crate::stage::{Cancel, OutOfScratch, StageError};

/// One curve as the model stores it: its control points, its knots, its ends and its pen.
#[derive(Debug, Clone, Copy)]
pub struct StoredCurve<'a, I = u16> {
    /// The order of the curve, which is its degree plus 1.
    pub order: u8,
    /// The pen that draws the curve, from 0.
    pub pen: u8,
    /// The vertex numbers of its control points, from 0.
    pub control: &'a [I],
    /// The knots, which are the parameter values where its polynomials meet.
    pub knots: Knots<'a>,
    /// The parameter at which the curve begins.
    pub from: Parameter,
    /// The parameter at which the curve ends.
    pub to: Parameter,
}

impl<'a, I: Index> StoredCurve<'a, I> {
    /// Returns how many numbers of the model's memory it takes.
    pub fn length(&self) -> usize {
        self.length_of::<I>()
    }

    /// Returns how many numbers with the width of `J` it would take.
    pub fn length_of<J: Index>(&self) -> usize {
        length_of::<J>(self.control.len(), self.knots.count().unwrap_or(0))
    }

    /// Returns the curve over these points.
    ///
    /// # Errors
    /// [`CurveError::UnknownPoint`] if `points` has not all of its control points.
    pub fn spline(&self, points: &'a [Point]) -> Result<Spline<'a, I>, CurveError> {
        Spline::new(points, self.control, self.order, self.knots)
            .map(|whole| whole.between(self.from, self.to))
    }
}

/// The completed curves of a model, in the order in which they came.
///
/// If they come from a model, every control point exists and every curve is valid.
#[derive(Debug, Clone, Copy)]
pub struct Curves<'a, I = u16> {
    /// The half-words of the curves, one curve after another.
    halves: &'a [I],
}

impl<I> Default for Curves<'_, I> {
    fn default() -> Self {
        Self { halves: &[] }
    }
}

impl<'a, I: Index> Curves<'a, I> {
    /// Returns each curve in turn.
    pub fn iter(&self) -> impl Iterator<Item = StoredCurve<'a, I>> + Clone + use<'a, I> {
        let mut rest = self.halves;
        core::iter::from_fn(move || {
            let (curve, after) = read(rest)?;
            rest = after;
            Some(curve)
        })
    }

    /// Whether there are no curves.
    pub fn is_empty(&self) -> bool {
        self.halves.is_empty()
    }

    /// Calls `each` with the end of each chord of the curves over `points`, and with whether
    /// another curve begins there. The chords deviate from the curves by at most `tolerance`: see
    /// [`Spline::chords`].
    ///
    /// # Errors
    /// [`StageError::Aborted`], or what `each` returns.
    // Not inlined, so that its variables take no stack while a job is computed.
    #[inline(never)]
    pub fn flatten(
        &self,
        points: &[Point],
        project: &dyn Fn([i64; 3]) -> Option<Fine>,
        tolerance: u16,
        cancel: &mut dyn Cancel,
        each: &mut dyn FnMut(Point, bool) -> Result<(), OutOfScratch>,
    ) -> Result<(), StageError> {
        for curve in self.iter() {
            // All control points of a model's curves exist.
            let Ok(spline) = curve.spline(points) else { continue };
            let mut begins = true;
            for (_, end) in spline.chords(project, tolerance) {
                cancel.check()?;
                each(end, begins)?;
                begins = false;
            }
        }
        Ok(())
    }
}

/// The numbers at the beginning of a curve: the number of control points, the order, the number of
/// knots and the pen. Both ends follow, of 32 bits each, and then the control points.
const HEAD: usize = 4;
/// The index of the pen among them.
const PEN: usize = 3;
/// How many bytes a knot takes.
const KNOT: usize = 4;

/// Returns how many numbers of the store this many bytes take.
const fn units_of<I>(bytes: usize) -> usize {
    bytes / size_of::<I>()
}

/// Returns how many numbers of the store lie before the control points.
const fn header<I>() -> usize {
    HEAD + units_of::<I>(2 * size_of::<u32>())
}

/// Returns how many numbers of the store a curve takes.
const fn length_of<I>(control_points: usize, knots: usize) -> usize {
    header::<I>() + control_points + units_of::<I>(KNOT) * knots
}

/// Returns how many numbers the first curve takes, and how many control points it has.
fn lengths<I: Index>(units: &[I]) -> Option<(usize, usize)> {
    let [control_points, _, knots, ..] = *units else { return None };
    Some((length_of::<I>(control_points.get(), knots.get()), control_points.get()))
}

/// Returns the first curve, and the half-words after it.
fn read<I: Index>(halves: &[I]) -> Option<(StoredCurve<'_, I>, &[I])> {
    let (length, control_points) = lengths(halves)?;
    let (curve, after) = halves.split_at_checked(length)?;
    let (header, rest) = curve.split_at_checked(header::<I>())?;
    let (control, knots) = rest.split_at_checked(control_points)?;
    let knots = match knots {
        [] => Knots::Uniform,
        knots => Knots::Packed(bytemuck::cast_slice(knots)),
    };
    let [_, order, _, pen, ends @ ..] = header else { return None };
    // They are not aligned as numbers of 32 bits.
    let ends: [u32; 2] = bytemuck::try_pod_read_unaligned(bytemuck::cast_slice(ends)).ok()?;
    let [from, to] = ends.map_each(Parameter::from_bits);
    let [order, pen] = [order.get() as u8, pen.get() as u8];
    Some((StoredCurve { order, pen, control, knots, from, to }, after))
}

#[cfg(test)]
mod tests;
