//! Edits of the completed curves of a model.

use super::{CurveList, PEN, header, lengths};
use crate::array::rotate_left;
use crate::index::Index;
use crate::model::ModelError;
use crate::model::store::Store;
use core::ops::Range;

impl CurveList {
    /// Gives control points new numbers, as the model does with its vertices. A curve with a
    /// control point for which `new` returns `None` is removed.
    pub fn renumber<I: Index>(&mut self, store: &mut Store<'_, I>, new: &dyn Fn(I) -> Option<I>) {
        self.retain(store, &mut |control| {
            control.iter_mut().all(|number| new(*number).inspect(|new| *number = *new).is_some())
        });
    }

    /// Deletes the curves in `range`. If `plug`, the last curve moves to the position of the first
    /// of them.
    pub fn delete<I: Index>(&mut self, store: &mut Store<'_, I>, range: Range<usize>, plug: bool) {
        let length = |number| self.curves(store).iter().nth(number).map(|curve| curve.length());
        let mut gone = range.clone();
        let last = self.count - 1; // the range is not empty
        if plug && range.start < last {
            let before: usize = (0..range.start).filter_map(length).sum();
            let last = length(last).unwrap_or(0);
            let curves = store.curves_mut().get_mut(before..self.completed).unwrap_or(&mut []);
            let before = curves.len().saturating_sub(last);
            rotate_left(curves, before);
            gone = range.start + 1..range.start + 2;
        }
        let mut number = 0;
        self.retain(store, &mut |_| {
            number += 1;
            !gone.contains(&(number - 1))
        });
    }

    /// Keeps the curves for which `stays` returns `true`; it may change their control points.
    fn retain<I: Index>(
        &mut self,
        store: &mut Store<'_, I>,
        stays: &mut dyn FnMut(&mut [I]) -> bool,
    ) {
        let halves = store.curves_mut();
        let (mut read, mut write, mut kept) = (0, 0, 0);
        while let Some((length, control_points)) =
            halves.get(read..self.completed).and_then(lengths)
        {
            let control = read + header::<I>()..read + header::<I>() + control_points;
            if stays(halves.get_mut(control).unwrap_or(&mut [])) {
                halves.copy_within(read..read + length, write);
                write += length;
                kept += 1;
            }
            read += length;
        }
        store.truncate_curves(write);
        (self.completed, self.count) = (write, kept);
    }

    /// Adds a copy of each curve for which `is_copied` returns `true`, with new control points.
    ///
    /// # Errors
    /// [`ModelError::TooManyCorners`], once there is no room for another copy.
    pub fn copy<I: Index>(
        &mut self,
        store: &mut Store<'_, I>,
        is_copied: &dyn Fn(&mut dyn Iterator<Item = I>) -> bool,
        new: &dyn Fn(I) -> Option<I>,
    ) -> Result<(), ModelError> {
        let (mut at, end) = (0, self.completed);
        while let Some((length, control_points)) = store.curves().get(at..end).and_then(lengths) {
            let (control, curve) = (header::<I>()..header::<I>() + control_points, at..at + length);
            at += length;
            let numbers =
                store.curves().get(curve.clone()).and_then(|all| all.get(control.clone()));
            if !is_copied(&mut numbers.unwrap_or(&[]).iter().copied()) {
                continue;
            }
            let start = store.curves().len();
            store.add_to_curves(length)?;
            let curves = store.curves_mut();
            curves.copy_within(curve, start);
            let copy = curves.get_mut(start..).and_then(|copy| copy.get_mut(control));
            for number in copy.unwrap_or(&mut []) {
                *number = new(*number).unwrap_or(*number);
            }
            (self.completed, self.count) = (start + length, self.count + 1);
        }
        Ok(())
    }

    /// Gives all curves the first pen, including the unfinished one.
    pub fn forget_pens<I: Index>(&mut self, store: &mut Store<'_, I>) {
        let (curves, mut at) = (store.curves_mut(), 0);
        while let Some(header) = curves.get_mut(at..).and_then(|rest| rest.get_mut(..header::<I>()))
        {
            header[PEN] = I::ZERO;
            match lengths(header) {
                // The header of the unfinished curve has no number of knots yet, but it is the last
                // curve.
                Some((length, _)) if at < self.completed => at += length,
                _ => break,
            }
        }
    }
}
