//! Stores the curves of a model, in the half-words that its faces and bars leave free.
//!
//! They arrive as in OBJ: `deg 3`, `curv u0 u1 i1 i2 …`, `parm u k1 k2 …` (no such line, or as many
//! as needed), `end`. Without `parm` the knots are 0, 1, 2, … Each curve is stored in half-words: a
//! header of eight, its control points, and two for each knot if it has knots of its own. The
//! curves follow the corners of the elements, and are moved up when another element comes.

use super::{Corner, ModelError};
use crate::curve::{
    CurveError, Fine, KNOT_LIMIT, Knots, Parameter, Point, Spline, check_interior, check_shape,
    parameter_of,
};
use crate::fixed::{Decimal, shift_right_rounding};
use crate::stage::{Cancel, OutOfScratch, StageError};
use core::ops::Range;

type Memory = heapless::VecView<Corner>;

/// A stored curve.
#[derive(Debug, Clone, Copy)]
pub struct StoredCurve<'a> {
    /// The degree plus 1.
    pub order: u8,
    /// The pen that draws it, from 0.
    pub pen: u8,
    /// The vertex numbers of its control points, from 0.
    pub control: &'a [u16],
    /// Its knots.
    pub knots: Knots<'a>,
    /// The parameter at which it begins.
    pub from: Parameter,
    /// The parameter at which it ends.
    pub to: Parameter,
}

impl<'a> StoredCurve<'a> {
    /// Returns how many half-words of the model's memory it takes.
    pub fn half_words(&self) -> usize {
        HEADER + self.control.len() + 2 * self.knots.count().unwrap_or(0)
    }

    /// Returns the curve over these points.
    ///
    /// # Errors
    /// [`CurveError::UnknownPoint`] if `points` has not all of its control points.
    pub fn spline(&self, points: &'a [Point]) -> Result<Spline<'a>, CurveError> {
        Spline::new(points, self.control, self.order, self.knots)
            .map(|whole| whole.between(self.from, self.to))
    }
}

/// The completed curves of a model, in the order in which they came.
///
/// If they come from a model, every control point exists and every curve is valid.
#[derive(Debug, Clone, Copy, Default)]
pub struct Curves<'a> {
    /// The half-words of the curves, one curve after another.
    halves: &'a [u16],
}

impl<'a> Curves<'a> {
    /// Returns each curve in turn.
    pub fn iter(&self) -> impl Iterator<Item = StoredCurve<'a>> + Clone + use<'a> {
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
    // Not inlined, so that its stack frame is not below those of the stages.
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

/// The position of the curves in the model's memory, and the state of the unfinished one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct CurveList {
    /// The number of half-words before the first curve: those of the elements and their pens.
    pub(super) start: usize,
    /// The number of half-words of completed curves. Those of the unfinished curve follow.
    whole: usize,
    /// The number of completed curves.
    pub(super) count: usize,
    /// The degree of the curves that follow, once it is set.
    degree: Option<u8>,
    /// The unfinished curve.
    in_hand: Option<InHand>,
}

/// An unfinished curve: its `end` has not come yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct InHand {
    order: u8,
    control_points: u16,
    /// The two parameters of `curv`, in units of 2^-[`FINEST`], with |value| <= 2^44.
    ends: [i64; 2],
    /// The number of fraction bits of its knots, or `None` while it has no knots of its own.
    fraction_bits: Option<u8>,
}

/// The number of half-words before the control points. They hold the number of control points, the
/// order, the number of knots, the pen, and both ends.
const HEADER: usize = 8;
/// The index of the pen in the header.
const PEN: usize = 3;

/// The finest unit of a knot is 2^-22, with which |knot| is at most 1.
const FINEST: u32 = 22;

/// If a curve has no knots of its own, its ends are kept to 2^-16 of the distance between knots.
const UNIFORM_BITS: u32 = 16;

impl CurveList {
    /// Returns the completed curves.
    pub(super) fn curves<'a>(&self, memory: &'a Memory) -> Curves<'a> {
        let halves = memory.get(self.start..self.start + self.whole).unwrap_or(&[]);
        Curves { halves: bytemuck::cast_slice(halves) }
    }

    /// `deg`: sets the degree of the curves that follow, 1 to 5.
    pub(super) fn set_degree(&mut self, degree: u8) -> Result<(), ModelError> {
        if !(1..=5).contains(&degree) {
            return Err(ModelError::Curve(CurveError::Order));
        }
        self.degree = Some(degree);
        Ok(())
    }

    /// `curv`: begins a curve between two parameters over the points numbered `control`, from 0.
    /// The points must exist.
    pub(super) fn begin(
        &mut self,
        memory: &mut Memory,
        ends: [Decimal; 2],
        control: impl Iterator<Item = u16> + Clone,
        pen: u8,
    ) -> Result<(), ModelError> {
        if self.in_hand.is_some() {
            return Err(ModelError::CurveUnfinished);
        }
        let order = self.degree.ok_or(ModelError::NoDegree)? + 1;
        let control_points = control.clone().count();
        check_shape(control_points, order, Knots::Uniform).map_err(ModelError::Curve)?;
        check_room(memory, HEADER + control_points)?;
        let limit = i64::from(KNOT_LIMIT) << FINEST;
        let value = |end: Decimal| end.to_binary(FINEST).ok().filter(|end| end.abs() <= limit);
        let ends = match ends.map(value) {
            [Some(from), Some(to)] => [from, to],
            _ => return Err(ModelError::KnotTooLarge),
        };
        let control_points = control_points as u16; // at most 2^12
        let header = [control_points, u16::from(order), 0, u16::from(pen), 0, 0, 0, 0];
        memory.extend(header.into_iter().chain(control).map(Corner));
        self.in_hand = Some(InHand { order, control_points, ends, fraction_bits: None });
        Ok(())
    }

    /// `parm u`: adds knots to the unfinished curve.
    ///
    /// All knots share one binary unit, which becomes coarser when a larger knot comes. Each keeps
    /// 22 bits of the largest.
    pub(super) fn add_knots(
        &mut self,
        memory: &mut Memory,
        knots: impl Iterator<Item = Decimal> + Clone,
    ) -> Result<(), ModelError> {
        let in_hand = self.in_hand.ok_or(ModelError::NoCurve)?;
        let before = in_hand.fraction_bits.map_or(FINEST, u32::from);
        let fraction_bits = (0..=before)
            .rev()
            .find(|bits| knots.clone().all(|knot| in_unit(knot, *bits).is_some()))
            .ok_or(ModelError::KnotTooLarge)?;
        check_room(memory, 2 * knots.clone().count())?;
        let start = self.start + self.whole + HEADER + usize::from(in_hand.control_points);
        let listed = memory.get_mut(start..).unwrap_or(&mut []);
        for knot in bytemuck::cast_slice_mut::<Corner, [u16; 2]>(listed) {
            *knot =
                bytemuck::cast(shift_right_rounding(bytemuck::cast(*knot), before - fraction_bits));
        }
        let halves = knots
            .filter_map(|knot| in_unit(knot, fraction_bits))
            .flat_map(bytemuck::cast::<i32, [u16; 2]>);
        memory.extend(halves.map(Corner));
        self.in_hand = Some(InHand { fraction_bits: Some(fraction_bits as u8), ..in_hand });
        Ok(())
    }

    /// `end`: completes the unfinished curve, which [`CurveList::count_in`] then adds to the model.
    /// If it is refused it is discarded.
    pub(super) fn end(&mut self, memory: &mut Memory) -> Result<(), ModelError> {
        let in_hand = self.in_hand.take().ok_or(ModelError::NoCurve)?;
        let closed = self.close(memory, &in_hand);
        if closed.is_err() {
            memory.truncate(self.start + self.whole);
        }
        closed
    }

    /// Records that the memory up to `end` holds completed curves, one more than before.
    pub(super) fn count_in(&mut self, end: usize) {
        self.whole = end - self.start;
        self.count += 1;
    }

    /// Checks the unfinished curve and completes its header.
    fn close(&self, memory: &mut Memory, in_hand: &InHand) -> Result<(), ModelError> {
        let InHand { order, control_points, .. } = *in_hand;
        let control_points = usize::from(control_points);
        let start = self.start + self.whole;
        let halves: &mut [u16] =
            bytemuck::cast_slice_mut(memory.get_mut(start..).unwrap_or(&mut []));
        let (header, rest) = halves.split_at_mut_checked(HEADER).ok_or(ModelError::NoCurve)?;
        let knots: &[[u16; 2]] = bytemuck::cast_slice(rest.get(control_points..).unwrap_or(&[]));
        let knot_count = knots.len();
        let (knots, bits, fraction_bits) = match in_hand.fraction_bits {
            Some(bits) => (Knots::Packed(knots), u32::from(bits), 0),
            None => (Knots::Uniform, 0, UNIFORM_BITS),
        };
        check_shape(control_points, order, knots).map_err(ModelError::Curve)?;
        let shift = FINEST - bits - fraction_bits;
        let [from, to] = in_hand.ends.map(|end| (end + (1 << shift >> 1)) >> shift);
        // The same number may differ by one unit as an end and as a knot that was rounded twice.
        let first = knots.get(usize::from(order) - 1) << fraction_bits;
        let last = knots.get(control_points) << fraction_bits;
        if from < first - 1 || to > last + 1 {
            return Err(ModelError::Curve(CurveError::OutsideKnots));
        }
        let (from, to) = (from.max(first), to.min(last));
        check_interior(order, knots, from, to).map_err(ModelError::Curve)?;
        let [from, to] =
            [from, to].map(|u| parameter_of(control_points, order, knots, u, fraction_bits));
        let ends: [u16; 4] = bytemuck::cast([from.to_bits(), to.to_bits()]);
        if let [_, _, count, _, stored_ends @ ..] = header {
            // It fits, because the memory has fewer half-words than there are vertex numbers.
            *count = knot_count as u16;
            stored_ends.copy_from_slice(&ends);
        }
        Ok(())
    }

    /// Whether there is an unfinished curve.
    pub(super) fn is_in_hand(&self) -> bool {
        self.in_hand.is_some()
    }

    /// Gives control points new numbers, as the model does with its vertices. A curve with a
    /// control point for which `new` returns `None` is removed.
    pub(super) fn renumber(&mut self, memory: &mut Memory, new: &dyn Fn(u16) -> Option<u16>) {
        self.retain(memory, &mut |control| {
            control.iter_mut().all(|number| new(*number).inspect(|new| *number = *new).is_some())
        });
    }

    /// Deletes the curves in `range`. If `plug`, the last curve moves to the position of the first
    /// of them.
    pub(super) fn delete(&mut self, memory: &mut Memory, range: Range<usize>, plug: bool) {
        let length =
            |number| self.curves(memory).iter().nth(number).map(|curve| curve.half_words());
        let mut gone = range.clone();
        let last = self.count - 1; // the range is not empty
        if plug && range.start < last {
            let before: usize = (0..range.start).filter_map(length).sum();
            let last = length(last).unwrap_or(0);
            let (start, end) = (self.start + before, self.start + self.whole);
            memory.get_mut(start..end).unwrap_or(&mut []).rotate_right(last);
            gone = range.start + 1..range.start + 2;
        }
        let mut number = 0;
        self.retain(memory, &mut |_| {
            number += 1;
            !gone.contains(&(number - 1))
        });
    }

    /// Keeps the curves for which `stays` returns `true`; it may change their control points.
    fn retain(&mut self, memory: &mut Memory, stays: &mut dyn FnMut(&mut [u16]) -> bool) {
        let halves: &mut [u16] =
            bytemuck::cast_slice_mut(memory.get_mut(self.start..).unwrap_or(&mut []));
        let (mut read, mut write, mut kept) = (0, 0, 0);
        while let Some((length, control_points)) = halves.get(read..self.whole).and_then(lengths) {
            let control = read + HEADER..read + HEADER + control_points;
            if stays(halves.get_mut(control).unwrap_or(&mut [])) {
                halves.copy_within(read..read + length, write);
                write += length;
                kept += 1;
            }
            read += length;
        }
        memory.truncate(self.start + write);
        (self.whole, self.count) = (write, kept);
    }

    /// Adds a copy of each curve for which `is_copied` returns `true`, with new control points.
    /// There must be room.
    pub(super) fn copy(
        &mut self,
        memory: &mut Memory,
        is_copied: &dyn Fn(&mut dyn Iterator<Item = u16>) -> bool,
        new: &dyn Fn(u16) -> Option<u16>,
    ) {
        let end = self.start + self.whole;
        let mut at = self.start;
        while let Some((length, control_points)) =
            memory.get(at..end).map(bytemuck::cast_slice).and_then(lengths)
        {
            let control = at + HEADER..at + HEADER + control_points;
            let numbers = memory.get(control.clone()).unwrap_or(&[]);
            if is_copied(&mut numbers.iter().map(|number| number.0)) {
                for half in at..at + length {
                    let Some(Corner(old)) = memory.get(half).copied() else { continue };
                    let copy = if control.contains(&half) { new(old).unwrap_or(old) } else { old };
                    let _ = memory.push(Corner(copy)); // there is room
                }
                self.count += 1;
            }
            at += length;
        }
        self.whole = memory.len() - self.start;
    }

    /// Gives all curves the first pen, including the unfinished one.
    pub(super) fn forget_pens(&mut self, memory: &mut Memory) {
        let mut at = self.start;
        while let Some(header) = memory.get_mut(at..).and_then(|rest| rest.get_mut(..HEADER)) {
            header[PEN] = Corner(0);
            match lengths(bytemuck::cast_slice(header)) {
                // The header of the unfinished curve has no number of knots yet, but it is the last
                // curve.
                Some((length, _)) if at < self.start + self.whole => at += length,
                _ => break,
            }
        }
    }

    /// Returns the number of half-words of completed curves.
    pub(super) fn whole(&self) -> usize {
        self.whole
    }

    /// Restores `count` curves in `whole` half-words after `start`, as they once were.
    pub(super) fn restore(&mut self, start: usize, whole: usize, count: usize) {
        *self = Self { start, whole, count, degree: self.degree, in_hand: None };
    }
}

fn check_room(memory: &Memory, more: usize) -> Result<(), ModelError> {
    let limit = memory.capacity();
    let needed = memory.len().saturating_add(more);
    if needed > limit { Err(ModelError::TooManyCorners { limit, needed }) } else { Ok(()) }
}

/// Returns how many half-words the first curve takes, and how many control points it has.
fn lengths(halves: &[u16]) -> Option<(usize, usize)> {
    let [control_points, _, knots, ..] = *halves else { return None };
    let control_points = usize::from(control_points);
    Some((HEADER + control_points + 2 * usize::from(knots), control_points))
}

/// Returns the first curve, and the half-words after it.
fn read(halves: &[u16]) -> Option<(StoredCurve<'_>, &[u16])> {
    let (length, control_points) = lengths(halves)?;
    let (curve, after) = halves.split_at_checked(length)?;
    let (header, rest) = curve.split_at_checked(HEADER)?;
    let (control, knots) = rest.split_at_checked(control_points)?;
    let knots = match knots {
        [] => Knots::Uniform,
        knots => Knots::Packed(bytemuck::cast_slice(knots)),
    };
    let [_, order, _, pen, a, b, c, d] = *header else { return None };
    let ends: [u32; 2] = bytemuck::cast([a, b, c, d]);
    let [from, to] = ends.map(Parameter::from_bits);
    Some((StoredCurve { order: order as u8, pen: pen as u8, control, knots, from, to }, after))
}

/// Returns a knot in units of 2^-`fraction_bits`, or `None` if it does not fit.
fn in_unit(knot: Decimal, fraction_bits: u32) -> Option<i32> {
    let value = i32::try_from(knot.to_binary(fraction_bits).ok()?).ok()?;
    (value.unsigned_abs() <= KNOT_LIMIT.unsigned_abs()).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::super::{Corner, Model, Position, unkept};
    use super::*;
    use std::vec::Vec;

    fn decimal(text: &str) -> Decimal {
        Decimal::parse(text).unwrap()
    }

    fn decimals(text: &str) -> impl Iterator<Item = Decimal> + Clone {
        text.split(' ').map(decimal)
    }

    /// A model with eight vertices and room for 48 half-words.
    fn with_model(test: impl FnOnce(&mut Model<'_>)) {
        let mut memory = (heapless::Vec::<Position, 8>::new(), heapless::Vec::<Corner, 48>::new());
        let mut model = Model::new(&mut memory.0, &mut memory.1);
        for _ in 0..8 {
            model.add_vertex(["0", "0", "0"].map(decimal), &mut unkept).unwrap();
        }
        test(&mut model);
    }

    fn sent(
        model: &mut Model<'_>,
        ends: [&str; 2],
        control: &[i32],
        knots: &[&str],
    ) -> Result<(), ModelError> {
        model.begin_curve(ends.map(decimal), control.iter().copied())?;
        for line in knots {
            model.add_knots(decimals(line))?;
        }
        model.end_curve(&mut unkept)
    }

    fn controls(model: &Model<'_>) -> Vec<Vec<u16>> {
        model.curves().iter().map(|curve| curve.control.to_vec()).collect()
    }

    fn knots(curve: &StoredCurve<'_>) -> Vec<i64> {
        (0..curve.control.len() + usize::from(curve.order)).map(|at| curve.knots.get(at)).collect()
    }

    #[test]
    fn curves_come_back_as_they_were_sent_wherever_the_elements_come() {
        with_model(|model| {
            model.set_degree(2).unwrap();
            model.add_polyline([1, 2].into_iter(), &mut unkept).unwrap();
            sent(model, ["2.5", "4"], &[1, 2, -5, 4, 1], &[]).unwrap();
            model.begin_curve(["0", "3"].map(decimal), [5, 4, 3, 2].into_iter()).unwrap();
            model.add_knots(decimals("0 0 0")).unwrap();
            model.add_face([1, 2, 3].into_iter(), &mut unkept).unwrap();
            // A knot past 1 coarsens those before it.
            model.add_knots(decimals("0.5")).unwrap();
            model.add_knots(decimals("3 3 3")).unwrap();
            model.end_curve(&mut unkept).unwrap();
            let curves: Vec<_> = model.curves().iter().collect();
            assert_eq!((curves.len(), model.curve_count()), (2, 2));
            assert_eq!(
                (curves[0].order, curves[0].control, curves[0].knots),
                (3, &[0, 1, 3, 3, 0][..], Knots::Uniform)
            );
            assert_eq!((curves[0].from.to_bits(), curves[0].to.to_bits()), (1 << 19, 2 << 20));
            let unit = 1 << 20;
            assert_eq!(curves[1].control, [4, 3, 2, 1]);
            assert_eq!(knots(&curves[1]), [0, 0, 0, unit / 2, 3 * unit, 3 * unit, 3 * unit]);
            assert!(curves[1].spline(&[[0; 3]; 5]).is_ok());
            assert!(matches!(
                curves[1].spline(&[[0; 3]; 4]),
                Err(CurveError::UnknownPoint { number: 4 })
            ));
            assert_eq!(model.corner_count(), 5 + (8 + 5) + (8 + 4 + 14));
            assert_eq!(model.elements().iter().count(), 2);
            model.clear();
            assert_eq!((model.curve_count(), model.curves().iter().count()), (0, 0));
        });
    }

    #[test]
    fn what_is_refused_leaves_nothing_behind() {
        with_model(|model| {
            let three = [1, 2, 3];
            assert_eq!(sent(model, ["2", "3"], &three, &[]), Err(ModelError::NoDegree));
            assert_eq!(model.add_knots(decimals("1")), Err(ModelError::NoCurve));
            assert_eq!(model.end_curve(&mut unkept), Err(ModelError::NoCurve));
            for degree in [0, 6] {
                assert_eq!(model.set_degree(degree), Err(ModelError::Curve(CurveError::Order)));
            }
            model.set_degree(2).unwrap();
            sent(model, ["2", "3"], &three, &[]).unwrap();
            let full = ModelError::TooManyCorners { limit: 48, needed: 11 + 8 + 30 };
            let unknown = ModelError::UnknownVertex { number: 9, vertices: 8 };
            let outside = ModelError::Curve(CurveError::OutsideKnots);
            let few = ModelError::Curve(CurveError::TooFewControlPoints { needed: 3 });
            let count = ModelError::Curve(CurveError::WrongKnotCount { needed: 6, given: 5 });
            let falls = ModelError::Curve(CurveError::KnotDecreases { knot: 5 });
            for (ends, control, knots, error) in [
                (["2", "3"], &three[..2], &[][..], few),
                (["2", "3"], &[1, 2, 9], &[], unknown),
                (["2", "3"], &[7; 30], &[], full),
                (["0", "1"], &three, &[], outside),
                (["3", "2"], &three, &[], outside),
                (["2", "1e30"], &three, &[], ModelError::KnotTooLarge),
                (["2", "4"], &three, &[], outside),
                (["0", "1"], &three, &["0 0 0 1 1"], count),
                (["0", "1"], &three, &["0 0 0 1 2 1"], falls),
            ] {
                assert_eq!(sent(model, ends, control, knots), Err(error), "{ends:?} {knots:?}");
                assert_eq!((model.curve_count(), model.corner_count()), (1, 11));
            }
            assert_eq!(controls(model), [[0, 1, 2]]);
        });
    }

    #[test]
    fn a_refused_line_leaves_the_curve_in_hand() {
        with_model(|model| {
            model.set_degree(1).unwrap();
            model.begin_curve(["0", "1"].map(decimal), [4, 5].into_iter()).unwrap();
            assert_eq!(
                model.begin_curve(["0", "1"].map(decimal), [4, 5].into_iter()),
                Err(ModelError::CurveUnfinished)
            );
            model.add_knots(decimals("0 0")).unwrap();
            assert_eq!(model.add_knots(decimals("1e9")), Err(ModelError::KnotTooLarge));
            let many = core::iter::repeat_n(decimal("7"), 99);
            assert_eq!(
                model.add_knots(many),
                Err(ModelError::TooManyCorners { limit: 48, needed: 8 + 2 + 4 + 2 * 99 })
            );
            model.add_knots(decimals("1 1")).unwrap();
            model.end_curve(&mut unkept).unwrap();
            let curve = model.curves().iter().next().unwrap();
            assert_eq!(knots(&curve), [0, 0, 1 << 22, 1 << 22]);
        });
    }
}
