//! The curves of a model while they are sent: an unfinished curve becomes a completed one.

use super::{Curves, HEAD, KNOT, header, units_of};
use crate::array::MapEach;
use crate::curve::{CurveError, KNOT_LIMIT, Knots, check_interior, check_shape, parameter_of};
use crate::fixed::{Decimal, shift_right_rounding};
use crate::index::Index;
use crate::model::ModelError;
use crate::model::store::Store;

/// The curves of a model: which half-words of the store are complete curves, and the state of the
/// unfinished one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(in crate::model) struct CurveList {
    /// The number of half-words of completed curves. Those of the unfinished curve follow.
    pub(super) completed: usize,
    /// The number of curves that were completed by `end`.
    pub count: usize,
    /// The degree of the curves that follow, or `None` before the user has sent one.
    degree: Option<u8>,
    /// The curve that has begun but not ended, if there is one.
    unfinished: Option<Unfinished>,
}

/// A curve that has begun, but whose `end` has not come yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Unfinished {
    /// The order of the curve, which is its degree plus 1.
    order: u8,
    /// The number of control points of the curve.
    control_points: u16,
    /// The two parameters of `curv`, in units of 2^-[`FINEST`], with |value| <= 2^44.
    ends: [i64; 2],
    /// The number of fraction bits of its knots, or `None` while it has no knots of its own.
    fraction_bits: Option<u8>,
}

/// The finest unit of a knot is 2^-22, with which |knot| is at most 1.
const FINEST: u32 = 22;

/// If a curve has no knots of its own, its ends are kept to 2^-16 of the distance between knots.
const UNIFORM_BITS: u32 = 16;

impl CurveList {
    /// Returns the completed curves, without the unfinished one.
    pub fn curves<'a, I: Index>(&self, store: &'a Store<'_, I>) -> Curves<'a, I> {
        Curves { halves: store.curves().get(..self.completed).unwrap_or(&[]) }
    }

    /// `deg`: sets the degree of the curves that follow, 1 to 5.
    pub fn set_degree(&mut self, degree: u8) -> Result<(), ModelError> {
        if !(1..=5).contains(&degree) {
            return Err(ModelError::Curve(CurveError::Order));
        }
        self.degree = Some(degree);
        Ok(())
    }

    /// `curv`: begins a curve between two parameters over the points numbered `control`, from 0.
    /// The points must exist.
    pub fn begin<I: Index>(
        &mut self,
        store: &mut Store<'_, I>,
        ends: [Decimal; 2],
        control: impl Iterator<Item = I> + Clone,
        pen: u8,
    ) -> Result<(), ModelError> {
        if self.unfinished.is_some() {
            return Err(ModelError::CurveUnfinished);
        }
        let order = self.degree.ok_or(ModelError::NoDegree)? + 1;
        let control_points = control.clone().count();
        check_shape(control_points, order, Knots::Uniform).map_err(ModelError::Curve)?;
        store.check_room(header::<I>() + control_points)?;
        let limit = i64::from(KNOT_LIMIT) << FINEST;
        let value = |end: Decimal| end.to_binary(FINEST).ok().filter(|end| end.abs() <= limit);
        let ends = match ends.map_each(value) {
            [Some(from), Some(to)] => [from, to],
            _ => return Err(ModelError::KnotTooLarge),
        };
        let curve = store.add_to_curves(header::<I>() + control_points)?;
        let head = [control_points, order.into(), 0, pen.into()].map_each(I::new);
        let header = head.into_iter().chain(core::iter::repeat_n(I::ZERO, header::<I>() - HEAD));
        for (unit, new) in curve.iter_mut().zip(header.chain(control)) {
            *unit = new;
        }
        let control_points = control_points as u16; // at most 2^12
        self.unfinished = Some(Unfinished { order, control_points, ends, fraction_bits: None });
        Ok(())
    }

    /// `parm u`: adds knots to the unfinished curve.
    ///
    /// All knots share one binary unit, which becomes coarser when a larger knot comes. Each keeps
    /// 22 bits of the largest.
    pub fn add_knots<I: Index>(
        &mut self,
        store: &mut Store<'_, I>,
        knots: impl Iterator<Item = Decimal> + Clone,
    ) -> Result<(), ModelError> {
        let unfinished = self.unfinished.ok_or(ModelError::NoCurve)?;
        let before = unfinished.fraction_bits.map_or(FINEST, u32::from);
        let fraction_bits = (0..=before)
            .rev()
            .find(|bits| knots.clone().all(|knot| in_unit(knot, *bits).is_some()))
            .ok_or(ModelError::KnotTooLarge)?;
        let count = knots.clone().count();
        store.check_room(units_of::<I>(KNOT) * count)?;
        let start = self.completed + header::<I>() + usize::from(unfinished.control_points);
        let listed = store.curves_mut().get_mut(start..).unwrap_or(&mut []);
        for knot in bytemuck::cast_slice_mut::<I, [u16; 2]>(listed) {
            *knot =
                bytemuck::cast(shift_right_rounding(bytemuck::cast(*knot), before - fraction_bits));
        }
        let new = knots.filter_map(|knot| in_unit(knot, fraction_bits));
        let added = store.add_to_curves(units_of::<I>(KNOT) * count)?;
        let added = bytemuck::cast_slice_mut::<I, [u16; 2]>(added);
        for (halves, knot) in added.iter_mut().zip(new) {
            *halves = bytemuck::cast(knot);
        }
        self.unfinished =
            Some(Unfinished { fraction_bits: Some(fraction_bits as u8), ..unfinished });
        Ok(())
    }

    /// `end`: completes the unfinished curve, which [`CurveList::count_completed`] then adds to the
    /// model. If it is refused it is discarded.
    pub fn end<I: Index>(&mut self, store: &mut Store<'_, I>) -> Result<(), ModelError> {
        let unfinished = self.unfinished.take().ok_or(ModelError::NoCurve)?;
        let closed = self.close(store, &unfinished);
        if closed.is_err() {
            store.truncate_curves(self.completed);
        }
        closed
    }

    /// Records that the store holds completed curves only, one more than before.
    pub fn count_completed<I: Index>(&mut self, store: &Store<'_, I>) {
        self.completed = store.curves().len();
        self.count += 1;
    }

    /// Checks the unfinished curve and completes its header.
    fn close<I: Index>(
        &self,
        store: &mut Store<'_, I>,
        unfinished: &Unfinished,
    ) -> Result<(), ModelError> {
        let Unfinished { order, control_points, .. } = *unfinished;
        let control_points = usize::from(control_points);
        let halves = store.curves_mut().get_mut(self.completed..).unwrap_or(&mut []);
        let (header, rest) =
            halves.split_at_mut_checked(header::<I>()).ok_or(ModelError::NoCurve)?;
        let knots: &[[u16; 2]] = bytemuck::cast_slice(rest.get(control_points..).unwrap_or(&[]));
        let knot_count = knots.len();
        let (knots, bits, fraction_bits) = match unfinished.fraction_bits {
            Some(bits) => (Knots::Packed(knots), u32::from(bits), 0),
            None => (Knots::Uniform, 0, UNIFORM_BITS),
        };
        check_shape(control_points, order, knots).map_err(ModelError::Curve)?;
        let shift = FINEST - bits - fraction_bits;
        let [from, to] = unfinished.ends.map_each(|end| (end + (1 << shift >> 1)) >> shift);
        // The same number may differ by one unit as an end and as a knot that was rounded twice.
        let first = knots.get(usize::from(order) - 1) << fraction_bits;
        let last = knots.get(control_points) << fraction_bits;
        if from < first - 1 || to > last + 1 {
            return Err(ModelError::Curve(CurveError::OutsideKnots));
        }
        let (from, to) = (from.max(first), to.min(last));
        check_interior(order, knots, from, to).map_err(ModelError::Curve)?;
        let [from, to] =
            [from, to].map_each(|u| parameter_of(control_points, order, knots, u, fraction_bits));
        let ends = [from.to_bits(), to.to_bits()];
        if let [_, _, count, _, stored_ends @ ..] = header {
            // It fits, because the memory has fewer half-words than there are vertex numbers.
            *count = I::new(knot_count);
            stored_ends.copy_from_slice(bytemuck::cast_slice(&ends));
        }
        Ok(())
    }

    /// Whether a curve has begun but not ended.
    pub fn is_unfinished(&self) -> bool {
        self.unfinished.is_some()
    }

    /// Returns the number of half-words of the unfinished curve.
    pub fn unfinished_length<I: Index>(&self, store: &Store<'_, I>) -> usize {
        store.curves().len() - self.completed
    }

    /// Restores `count` curves, which are all that the store holds, as they once were.
    pub fn restore<I: Index>(&mut self, store: &Store<'_, I>, count: usize) {
        let completed = store.curves().len();
        *self = Self { completed, count, degree: self.degree, unfinished: None };
    }
}

/// Returns a knot in units of 2^-`fraction_bits`, or `None` if it does not fit.
fn in_unit(knot: Decimal, fraction_bits: u32) -> Option<i32> {
    let value = i32::try_from(knot.to_binary(fraction_bits).ok()?).ok()?;
    (value.unsigned_abs() <= KNOT_LIMIT.unsigned_abs()).then_some(value)
}
