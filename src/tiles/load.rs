//! Loads a part of the model as a small scene with numbers of 16 bits.
//!
//! Vertices and elements keep the order of the model, so every choice between equals is the same.

use super::page::{GridPoint, Rectangle};
use super::{LOOK, Listed, ModelSource, PLACE, Tiles};
use crate::geometry::Vertex;
use crate::index::Index;
use crate::model::{Corner, Element, Elements, PenWriter, Position};
use crate::stage::{Aborted, Cancel, OutOfScratch, Scratch, StageError, heap_sort_cancellable};
use crate::view::{Sources, cut, weld};
use crate::visibility::{
    Ownership, Scene, SinkFull, Stretch, StretchSink, Unrounded, VisibilityError, YieldCounter,
    find_owned_stretches, scratch_bytes,
};

/// The greatest number of corners of a small scene.
const MOST_CORNERS: usize = u16::MAX as usize;

/// How many times the least memory of the search is wanted. With it the search is as fast as it can
/// be; with the least, every face is tested against every edge.
const WANTED_TIMES: usize = 3;

/// Which elements are loaded.
#[derive(Debug, Clone, Copy)]
pub(super) enum Reach {
    /// The elements that meet a rectangle of the page.
    Rectangle(Rectangle),
    /// The elements that may meet a segment of the page, or come within this distance of it.
    Segment([GridPoint; 2], u16),
    /// Two elements, which begin at these corners of the model.
    Pair([usize; 2]),
}

impl Reach {
    /// Returns a rectangle that every element meets that is loaded.
    fn bounds(&self) -> Rectangle {
        match *self {
            Self::Rectangle(rectangle) => rectangle,
            Self::Segment([a, b], near) => Rectangle::around(a, b).grown(near),
            Self::Pair(_) => Rectangle::ALL,
        }
    }

    /// Whether an element that begins at a corner of the model, with this rectangle around it, is
    /// loaded.
    fn includes(&self, first: usize, bounds: Rectangle) -> bool {
        match *self {
            Self::Rectangle(rectangle) => rectangle.meets(bounds),
            Self::Segment([a, b], near) => bounds.grown(near).may_meet_segment(a, b),
            Self::Pair(firsts) => firsts.contains(&first),
        }
    }
}

/// A part of the model as a small scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loaded<'a> {
    /// For each element the index of its first corner in the model.
    firsts: &'a [u32],
    /// For each vertex its number in the model. The vertices where edges are cut come last and have
    /// none.
    numbers: &'a [u32],
    /// The positions of the vertices in the model, if they are known.
    positions: &'a [Position],
    /// The view coordinates of the vertices, and of the points where edges are cut.
    vertices: &'a [Vertex],
    /// For each of these points the numbers here of the ends of its edge.
    cuts: &'a [u32],
    /// The faces and bars in front of the near plane.
    pub elements: Elements<'a, u16>,
    /// Where each vertex lies on the page.
    pub points: &'a [GridPoint],
}

impl Loaded<'_> {
    /// Returns the index here of the first corner of an element, given that in the model.
    pub fn find(&self, first: usize) -> Option<usize> {
        let element = self.firsts.binary_search_by_key(&first, |&first| first as usize).ok()?;
        let lengths = self.elements.iter().map(|element| element.corner_count());
        Some(lengths.take(element).sum())
    }

    /// Returns the numbers here of the ends of a side of the element that begins at a corner.
    pub fn side(&self, first: usize, number: usize) -> Option<[u16; 2]> {
        let rest = self.elements.corners().get(first..)?;
        let length = rest.iter().position(|corner| corner.is_last())? + 1;
        let next = if number + 1 == length { 0 } else { number + 1 };
        Some([rest.get(number)?.vertex(), rest.get(next)?.vertex()])
    }

    /// Whether no side before `corner` joins the two vertices `pair`, in either order.
    pub fn is_first_side(&self, corner: usize, pair: [u16; 2]) -> bool {
        let mut start = 0;
        !self.elements.iter().any(|element| {
            let here = start;
            start += element.corner_count();
            let sides =
                if matches!(element, Element::Bar(..)) { 1 } else { element.corner_count() };
            (0..sides.min(corner.saturating_sub(here)))
                .filter_map(|number| self.side(here, number))
                .any(|[a, b]| pair == [a, b] || pair == [b, a])
        })
    }

    /// Returns the rectangle around the element that begins at a corner.
    pub fn bounds(&self, first: usize) -> Rectangle {
        let mut bounds = Rectangle::NONE;
        for corner in self.elements.corners().iter().skip(first) {
            if let Some(&point) = self.points.get(corner.vertex().get()) {
                bounds = bounds.with(point);
            }
            if corner.is_last() {
                break;
            }
        }
        bounds
    }

    /// Returns the places of two vertices on the page.
    pub fn places(&self, ends: [u16; 2]) -> Option<[GridPoint; 2]> {
        let [a, b] = ends.map(|end| self.points.get(end.get()).copied());
        Some([a?, b?])
    }

    /// Whether an edge lies in the near plane, where the model was cut.
    pub fn is_cut(&self, ends: [u16; 2], near: Option<i32>) -> bool {
        let depth = |end: u16| self.vertices.get(end.get()).map(|vertex| vertex.z);
        near.is_some() && ends.iter().all(|&end| depth(end) == near)
    }
}

impl<'t, S: ModelSource> Tiles<'t, S> {
    /// Loads a part of the model. `listed` may spare a pass over the model.
    ///
    /// # Errors
    /// [`VisibilityError::Scratch`], [`VisibilityError::TooManyCorners`] or
    /// [`VisibilityError::TooManyVertices`] if the part is too large, [`VisibilityError::Aborted`].
    pub(super) fn load<'a>(
        &self,
        reach: Reach,
        listed: Option<&Listed<'_>>,
        scratch: &mut Scratch<'a>,
        cancel: &mut dyn Cancel,
    ) -> Result<Loaded<'a>, VisibilityError> {
        let (source, parameters) = (self.source, &self.parameters);
        let (mut corner_count, mut changes, mut pen) = (0, 0, 0);
        let window = self.survey.window(reach.bounds());
        let firsts: &[u32] = scratch.take_filled(|room| {
            let mut count = 0;
            let yield_counter = &mut YieldCounter::new(cancel);
            for outline in self.outlines(reach.bounds(), listed) {
                yield_counter.spend(LOOK)?;
                let Some(outline) = outline else { continue };
                let first = outline.first();
                let is_reached = match reach {
                    Reach::Rectangle(near) => {
                        yield_counter.spend(LOOK)?;
                        outline.meets(parameters, &self.survey, near, &window)
                    }
                    _ => {
                        yield_counter.spend(PLACE)?;
                        let bounds = outline.bounds(parameters, &self.survey);
                        bounds.is_some_and(|bounds| reach.includes(first, bounds))
                    }
                };
                if !is_reached || !outline.has_extent() {
                    continue;
                }
                let length = room.len();
                *room.get_mut(count).ok_or_else(|| out_of(length))? = first as u32;
                count += 1;
                corner_count += outline.end() - first;
                changes += usize::from(source.pen(first) != pen);
                pen = source.pen(first);
            }
            Ok::<_, VisibilityError>(count)
        })?;
        if corner_count > MOST_CORNERS {
            return Err(VisibilityError::TooManyCorners(MOST_CORNERS));
        }
        let corners_of = |first: u32| {
            let mut next = Some(first as usize);
            core::iter::from_fn(move || {
                let corner = source.corner(next?);
                next = next.filter(|_| !corner.is_last()).map(|next| next + 1);
                Some(corner)
            })
        };
        let numbers: &[u32] = scratch.take_filled(|room| {
            let mut count = 0;
            for corner in firsts.iter().flat_map(|&first| corners_of(first)) {
                if count % 256 == 0 {
                    cancel.check()?;
                }
                if count == room.len() {
                    count = sort_without_repeats(room, cancel)?;
                }
                let length = room.len();
                *room.get_mut(count).ok_or_else(|| out_of(length))? = corner.vertex();
                count += 1;
            }
            let room = room.get_mut(..count).unwrap_or(&mut []);
            Ok::<_, VisibilityError>(sort_without_repeats(room, cancel)?)
        })?;
        let limit = <Corner<u16>>::VERTEX_NUMBER_LIMIT;
        if numbers.len() > limit {
            return Err(VisibilityError::TooManyVertices { count: numbers.len(), limit });
        }
        let corners: &mut [Corner<u16>] = scratch.take(corner_count)?;
        let mut pens = PenWriter::new(scratch, changes)?;
        let mut slots = corners.iter_mut();
        let mut written = 0;
        let yield_counter = &mut YieldCounter::new(cancel);
        for &first in firsts {
            yield_counter.spend(LOOK)?;
            pens.element(written, source.pen(first as usize));
            for (corner, slot) in corners_of(first).zip(&mut slots) {
                let number = numbers.binary_search(&corner.vertex()).unwrap_or(0);
                *slot = Corner::new(u16::new(number), corner.of_bar(), corner.is_last());
                written += 1;
            }
        }
        let corners: &'a [Corner<u16>] = corners;
        let mut elements = Elements::with_pens(corners, pens.finish());
        let known = numbers.iter().map_while(|&number| source.position(number));
        let positions: &mut [Position] = scratch.take(known.clone().count())?;
        for (slot, position) in positions.iter_mut().zip(known) {
            yield_counter.spend(100)?;
            *slot = position;
        }
        let positions: &'a [Position] = positions;
        if !positions.is_empty() {
            elements = weld(positions, elements, scratch, cancel).map_err(refused)?.0;
        }
        let yield_counter = &mut YieldCounter::new(cancel);
        let seen: &mut [Vertex] = scratch.take(numbers.len())?;
        for (slot, &number) in seen.iter_mut().zip(numbers) {
            yield_counter.spend(LOOK / 3)?;
            *slot = source.vertex(number);
        }
        let (mut vertices, mut cuts): (&'a [Vertex], &'a [u32]) = (seen, &[]);
        if let Some(near) = parameters.near
            && vertices.iter().any(|vertex| vertex.z < near)
        {
            (vertices, elements, cuts) = cut(vertices, elements, near, scratch)?;
        }
        let points: &mut [GridPoint] = scratch.take(vertices.len())?;
        for (slot, &vertex) in points.iter_mut().zip(vertices) {
            yield_counter.spend(PLACE / 3)?;
            *slot = self.survey.point(parameters.projection, vertex);
        }
        Ok(Loaded { firsts, numbers, positions, vertices, cuts, elements, points })
    }

    /// Finds the stretches of those edges and seams of a loaded part that belong to `owner`. With
    /// `is_fast` the part is refused if the search would have too little memory to be fast.
    ///
    /// # Errors
    /// See [`VisibilityError`]. If it is [`VisibilityError::Scratch`], nothing has been handed
    /// over.
    pub(super) fn search<N: Index>(
        &self,
        loaded: &Loaded<'_>,
        owner: &mut dyn Ownership<u16>,
        is_fast: bool,
        scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        sink: &mut dyn StretchSink<N>,
    ) -> Result<(), VisibilityError> {
        let Loaded { vertices, cuts, elements, positions, numbers, .. } = *loaded;
        let sources = Sources::<u16>::of_cuts(numbers.len(), cuts);
        let parameters = &self.parameters;
        let unrounded = Unrounded::new(
            bytemuck::cast_slice(positions),
            parameters.precision,
            parameters.error_bound.max(1),
        )
        .made_of(&sources);
        let scene = Scene { vertices, elements, projection: parameters.projection, unrounded };
        if is_fast {
            let available = scratch.available_bytes();
            let needed = WANTED_TIMES * scratch_bytes(&scene);
            if needed > available {
                return Err(OutOfScratch { needed, available }.into());
            }
        }
        let mut sink = Renumbered { numbers, sink };
        find_owned_stretches(&scene, self.options, scratch, cancel, owner, &mut sink)
    }
}

/// Hands over stretches with the numbers that the vertices have in the model.
struct Renumbered<'r, N> {
    /// For each vertex of a small scene its number in the model.
    numbers: &'r [u32],
    /// The receiver of the stretches.
    sink: &'r mut dyn StretchSink<N>,
}

impl<N: Index> StretchSink<u16> for Renumbered<'_, N> {
    fn stretch(&mut self, stretch: Stretch<u16>) -> Result<(), SinkFull> {
        let Stretch { edge, ends, from, to, visible, pen } = stretch;
        let number =
            |here: u16| self.numbers.get(here.get()).map_or(N::NONE, |&n| N::new(n as usize));
        let edge = edge.map(|(a, b)| (number(a), number(b)));
        self.sink.stretch(Stretch { edge, ends, from, to, visible, pen })
    }
}

/// Sorts numbers, moves each different one to the front, and returns how many these are.
fn sort_without_repeats(numbers: &mut [u32], cancel: &mut dyn Cancel) -> Result<usize, Aborted> {
    heap_sort_cancellable(numbers, |number| *number, cancel)?;
    let mut kept = 0;
    let mut last = None;
    for at in 0..numbers.len() {
        let next = numbers.get(at).copied();
        if let (true, Some(slot), Some(number)) = (last != next, numbers.get_mut(kept), next) {
            *slot = number;
            kept += 1;
        }
        last = next;
    }
    Ok(kept)
}

/// The error that there is room for this many numbers and not for one more.
fn out_of(room: usize) -> VisibilityError {
    let available = room * size_of::<u32>();
    OutOfScratch { needed: available + size_of::<u32>(), available }.into()
}

/// Converts the error of a stage before.
fn refused(error: StageError) -> VisibilityError {
    match error {
        StageError::Scratch(missing) => missing.into(),
        StageError::Aborted => VisibilityError::Aborted,
    }
}
