//! Flattens the curves of a model, as the view shows them, into straight lines.
//!
//! A linear map of the control points is the same map of the whole curve. So a curve is evaluated
//! in view coordinates, and its chords are then bars like any others.

use super::View;
use super::clip::clip_edge;
use crate::curve::{FRACTION_BITS, Fine, Point};
use crate::geometry::{Projection, Vertex};
use crate::index::Index;
use crate::model::{Corner, Elements, Model, PenWriter};
use crate::stage::{Cancel, OutOfScratch, Scratch, StageError};

/// Flattens curves into as few straight lines as stay within a tolerance on the page.
#[derive(Clone, Copy)]
pub struct Flattening<'f> {
    /// Maps the image point (x/w, y/w) to the page, in fine units, usually 1/256 step.
    pub on_page: &'f dyn Fn(i64, i64, i64) -> Fine,
    /// The greatest deviation of a chord from its curve on the page, in the same units.
    pub tolerance: u16,
}

/// A model whose curves are straight bars: its vertices together with the ends of these chords, its
/// elements together with a bar for each chord, and for each curve the vertex number after that of
/// its last chord end.
type Flattened<'a, I> = (&'a [Vertex], Elements<'a, I>, &'a [I]);

impl Flattening<'_> {
    /// Flattens the curves of the model. `points` are its vertices in view coordinates. `each`
    /// receives the end of each chord, and whether a curve begins there.
    fn flatten<I: Index>(
        &self,
        view: &View,
        model: &Model<'_, I>,
        points: &[Vertex],
        cancel: &mut dyn Cancel,
        each: &mut dyn FnMut(Point, bool) -> Result<(), OutOfScratch>,
    ) -> Result<(), StageError> {
        let near = i64::from(view.near().unwrap_or(0)) << FRACTION_BITS;
        let project = |[x, y, z]: [i64; 3]| match view.projection() {
            Projection::Perspective => (z >= near).then(|| (self.on_page)(x, y, z)),
            Projection::Parallel => Some((self.on_page)(x, y, 1 << FRACTION_BITS)),
        };
        // A vertex and a point have the same form: three numbers of 32 bits.
        let points: &[Point] = bytemuck::cast_slice(points);
        model.curves().flatten(points, &project, self.tolerance, cancel, each)
    }

    /// Hands each chord of the curves of the model to `each`, in view coordinates. What is nearer
    /// than the near plane is cut off. It takes 12 bytes of memory for each vertex of the model.
    ///
    /// # Errors
    /// See [`StageError`].
    pub fn each_chord<I: Index>(
        &self,
        view: &View,
        model: &Model<'_, I>,
        mut scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        each: &mut dyn FnMut([Vertex; 2]),
    ) -> Result<(), StageError> {
        let points = scratch.take::<Vertex>(model.vertices().len())?;
        view.fill(model, points, cancel)?;
        let near = view.near().unwrap_or(i32::MIN);
        let mut before = None;
        self.flatten(view, model, points, cancel, &mut |[x, y, z], begins| {
            let end = Vertex { x, y, z };
            if let Some(before) = before.replace(end).filter(|_| !begins)
                && let Some(chord) = clip_edge([before, end], near)
            {
                each(chord);
            }
            Ok(())
        })
    }

    /// Makes straight bars of the curves of a model, besides its `elements`.
    pub(super) fn add<'a, I: Index>(
        &self,
        view: &View,
        model: &Model<'_, I>,
        elements: Elements<'_, I>,
        scratch: &mut Scratch<'a>,
        cancel: &mut dyn Cancel,
    ) -> Result<Flattened<'a, I>, StageError> {
        let curve_ends = scratch.take::<I>(model.curve_count())?;
        let first = model.vertices().len();
        let vertices = scratch.take_filled::<Vertex, StageError>(|room| {
            let available = size_of_val(room);
            let full = OutOfScratch { needed: available + size_of::<Vertex>(), available };
            let (points, room) = room.split_at_mut_checked(first).ok_or(full)?;
            view.fill(model, points, cancel)?;
            let limit = <Corner<I>>::VERTEX_NUMBER_LIMIT.saturating_sub(first);
            let mut rest = room.iter_mut().take(limit);
            let (mut number, mut curve) = (first, 0);
            self.flatten(view, model, points, cancel, &mut |[x, y, z], begins| {
                *rest.next().ok_or(full)? = Vertex { x, y, z };
                number += 1;
                curve += usize::from(begins);
                if let Some(end) = curve_ends.get_mut(curve - 1) {
                    *end = I::new(number); // at most the limit of a corner
                }
                Ok(())
            })?;
            Ok(number)
        })?;
        let old = elements.corners();
        let chords = vertices.len() - first - curve_ends.len().min(vertices.len() - first);
        let corners = scratch.take::<Corner<I>>(old.len() + 2 * chords)?;
        // `corners` has as many items as `old` and two for each chord.
        let (same, new) = corners.split_at_mut(old.len());
        same.copy_from_slice(old);
        let mut pens = PenWriter::new(scratch, elements.pens().changes() + curve_ends.len())?;
        let mut at = 0;
        for (element, pen) in elements.iter_with_pens() {
            pens.element(at, pen);
            at += element.corner_count();
        }
        let mut begin = I::new(first);
        let mut pairs = new.chunks_exact_mut(2);
        for (curve, &end) in model.curves().iter().zip(&*curve_ends) {
            for (to, pair) in (begin + I::ONE).to(end).zip(&mut pairs) {
                pens.element(at, curve.pen);
                // Each of `pairs` has two items.
                pair.copy_from_slice(&[
                    Corner::new(to - I::ONE, true, false),
                    Corner::new(to, true, true),
                ]);
                at += 2;
            }
            begin = end;
        }
        let corners: &'a [Corner<I>] = corners;
        Ok((vertices, Elements::with_pens(corners, pens.finish()), curve_ends))
    }
}
