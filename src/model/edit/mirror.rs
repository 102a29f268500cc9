//! Adds the mirror image of a part of the model.

use super::delete::{element_length, reverse};
use super::map::{Map, in_unit};
use crate::index::Index;
use crate::model::pens::RUN;
use crate::model::{BeforeChange, Corner, Model, ModelError};
use crate::stage::Scratch;
use core::ops::Range;

/// A vertex that differs from its image by at most this many units in each coordinate counts as on
/// the plane, because of rounding. A 2^-25th of its distance from the first vertex of the plane is
/// added, for the normal of the plane is rounded, too.
const ON_PLANE: u64 = 16;

impl<I: Index> Model<'_, I> {
    /// Adds the image of the vertices in `range`, and of the elements and curves that have all
    /// their vertices there.
    pub(super) fn mirror(
        &mut self,
        map: &Map,
        range: Range<usize>,
        mut scratch: Scratch<'_>,
        before: BeforeChange<'_, I>,
    ) -> Result<(), ModelError> {
        let images = scratch.take::<I>(range.len()).map_err(ModelError::Scratch)?;
        let (old, limit) = (self.vertices.len(), self.vertex_limit());
        let mut count = old;
        for (at, image) in range.clone().zip(images.iter_mut()) {
            let Some(position) = self.vertices.get(at) else { continue };
            let most = ON_PLANE + (map.distance(*position) >> 25);
            let near = |(image, c): (i64, i32)| (image - i64::from(c)).unsigned_abs() <= most;
            let stays = map.apply(*position).into_iter().zip(position.coordinates()).all(near);
            // The number fits a corner, otherwise the edit is refused below.
            *image = I::new(if stays { at } else { count });
            count += usize::from(!stays);
        }
        if count > limit {
            return Err(ModelError::TooManyVertices { limit });
        }
        let image = |number: I| {
            let at = number.get().checked_sub(range.start)?;
            images.get(at).copied()
        };
        // What lies in the plane is its own image and is not copied.
        let is_copied = |mut numbers: &mut dyn Iterator<Item = I>| {
            let mut moves = false;
            Iterator::all(&mut numbers, |number| {
                image(number).inspect(|new| moves |= *new != number).is_some()
            }) && moves
        };
        let elements = self.elements();
        let (mut of_elements, mut at, mut pen) = (0, 0, elements.pens().last());
        for element in elements.corners().split_inclusive(|corner| corner.is_last()) {
            if is_copied(&mut element.iter().map(|corner| corner.vertex())) {
                let last = core::mem::replace(&mut pen, elements.pens().at(at));
                of_elements += element.len() + if pen == last { 0 } else { RUN };
            }
            at += element.len();
        }
        let of_curves: usize = self
            .curves()
            .iter()
            .filter(|curve| is_copied(&mut curve.control.iter().copied()))
            .map(|curve| curve.length())
            .sum();
        self.store.check_room(of_elements + of_curves)?;
        let coarser = self.coarser_for(map, range.clone())?;

        before(self);
        for at in range.clone() {
            let Some(position) = self.vertices.get(at) else { continue };
            if image(I::new(at)) != Some(I::new(at)) {
                let position = in_unit(map.apply(*position), coarser);
                // There is room, because it was counted.
                let _ = self.vertices.push(position);
            }
        }
        self.coarsen_others(coarser, old..count);
        let (mut at, end) = (0, self.store.corners().len());
        while let Some(length) = self.store.corners().get(at..end).and_then(element_length) {
            let element = at..at + length;
            at += length;
            let corners = self.store.corners().get(element.clone()).unwrap_or(&[]);
            if !is_copied(&mut corners.iter().map(|corner| corner.vertex())) {
                continue;
            }
            self.begin_run(self.pens().at(element.start))?;
            let start = self.store.corners().len();
            self.store.add_corners(length)?;
            let corners = self.store.corners_mut();
            corners.copy_within(element, start);
            let copy = corners.get_mut(start..).unwrap_or(&mut []);
            for corner in copy.iter_mut() {
                let number = image(corner.vertex()).unwrap_or(I::ZERO);
                *corner = Corner::new(number, corner.of_bar(), corner.is_last());
            }
            if copy.first().is_some_and(|corner| corner.of_bar()) {
                self.bars += 1;
            } else {
                reverse(copy);
                self.faces += 1;
            }
        }
        self.curves.copy(&mut self.store, &is_copied, &image)
    }
}
