//! The outline of one element, read from the model: its corners, seen through the camera and cut
//! along the near plane.

use super::ModelSource;
use super::ViewParameters;
use super::page::{GridPoint, Rectangle, Survey, Window};
use crate::geometry::Vertex;
use crate::model::Corner;
use crate::view::{on_plane, spans_area};

/// A face or a bar, in the model where it lies.
#[derive(Clone, Copy)]
pub(super) struct Outline<'s, S> {
    /// The model.
    source: &'s S,
    /// The index of its first corner.
    first: usize,
    /// The first corner of the element.
    start: Corner<u32>,
    /// The index after that of its last corner.
    end: usize,
}

impl<'s, S: ModelSource> Outline<'s, S> {
    /// Finds the element that begins at a corner.
    pub fn at(source: &'s S, first: usize) -> Self {
        let start = source.corner(first);
        let (mut end, mut is_last) = (first + 1, start.is_last());
        while !is_last && end < source.corner_count() {
            is_last = source.corner(end).is_last();
            end += 1;
        }
        Self { source, first, start, end }
    }

    /// Returns the vertex at a corner, in view coordinates.
    #[inline(never)] // One copy of the code is enough: it is long.
    fn vertex(&self, corner: usize) -> Vertex {
        let corner = if corner == self.first { self.start } else { self.source.corner(corner) };
        self.source.vertex(corner.vertex())
    }

    /// Returns the index of the first corner.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Returns the index after that of the last corner, where the next element begins.
    pub fn end(&self) -> usize {
        self.end
    }

    /// Whether the element is a bar.
    pub fn is_bar(&self) -> bool {
        self.start.of_bar()
    }

    /// Whether it is a bar or a face with an area. It is a matter of the model's positions; where
    /// these are unknown, it has.
    pub fn has_extent(&self) -> bool {
        let position = |corner: usize| self.source.position(self.source.corner(corner).vertex());
        let Some(start) = position(self.first).filter(|_| !self.is_bar()) else { return true };
        spans_area(start, (self.first..self.end).filter_map(position))
    }

    /// Calls `visit` with each point of the outline, in its order. What is nearer than `near` is
    /// cut off as [`crate::view`] does it.
    #[inline(never)] // One copy of the code is enough: it is long.
    pub fn each_point(&self, near: Option<i32>, visit: &mut dyn FnMut(Vertex)) {
        let is_seen = |vertex: Vertex| near.is_none_or(|near| vertex.z >= near);
        let is_bar = self.is_bar();
        let start = self.vertex(self.first);
        let mut from = start;
        for corner in self.first..self.end {
            let is_last = corner + 1 == self.end;
            let to = if is_last { start } else { self.vertex(corner + 1) };
            if is_seen(from) {
                visit(from);
            }
            if let Some(near) = near
                && is_seen(from) != is_seen(to)
                && !(is_bar && is_last)
            {
                visit(on_plane(from, to, near));
            }
            from = to;
        }
    }

    /// Whether the rectangle around the outline may meet a window. The first vertex decides if it
    /// lies beyond `around`, in which each outline begins that meets the window. It takes a third
    /// of the time that [`Outline::bounds`] takes, as no division is needed.
    pub fn may_meet(&self, parameters: &ViewParameters, window: &Window, around: &Window) -> bool {
        let mut beyond = u32::MAX;
        for corner in self.first..self.end {
            let vertex = self.vertex(corner);
            if parameters.near.is_some_and(|near| vertex.z < near) {
                return true;
            }
            if corner == self.first && around.outcode(parameters.projection, vertex) != 0 {
                return false;
            }
            beyond &= window.outcode(parameters.projection, vertex);
            if beyond == 0 {
                return true;
            }
        }
        false
    }

    /// Whether the rectangle around the outline meets another one, whose bounds on the page are
    /// `window`.
    #[inline(never)] // One copy of the code is enough: it is long.
    pub fn meets(
        &self,
        parameters: &ViewParameters,
        survey: &Survey,
        other: Rectangle,
        window: &Window,
    ) -> bool {
        let mut beyond = u32::MAX;
        for corner in self.first..self.end {
            let vertex = self.vertex(corner);
            if parameters.near.is_some_and(|near| vertex.z < near) {
                // The near plane cuts the element, so the bounds of what is left of it must be
                // computed.
                return self.bounds(parameters, survey).is_some_and(|bounds| bounds.meets(other));
            }
            beyond &= window.outcode(parameters.projection, vertex);
        }
        beyond == 0
    }

    /// Returns the rectangle around the outline on the page, `None` if nothing of it is seen.
    #[inline(never)] // One copy of the code is enough: it is long.
    pub fn bounds(&self, parameters: &ViewParameters, survey: &Survey) -> Option<Rectangle> {
        let (mut bounds, mut count) = (Rectangle::NONE, 0);
        self.each_point(parameters.near, &mut |vertex| {
            bounds = bounds.with(survey.point(parameters.projection, vertex));
            count += 1;
        });
        (count >= if self.is_bar() { 2 } else { 3 }).then_some(bounds)
    }

    /// Calls `visit` with each side of the outline on the page: its number, from 0, and its ends.
    pub fn each_side(
        &self,
        parameters: &ViewParameters,
        survey: &Survey,
        visit: &mut dyn FnMut(usize, [GridPoint; 2]),
    ) {
        let mut ends: Option<[GridPoint; 2]> = None;
        let mut count = 0;
        self.each_point(parameters.near, &mut |vertex| {
            let point = survey.point(parameters.projection, vertex);
            if let Some([_, last]) = ends {
                visit(count - 1, [last, point]);
            }
            ends = Some([ends.map_or(point, |[first, _]| first), point]);
            count += 1;
        });
        if let Some([first, last]) = ends.filter(|_| !self.is_bar() && count >= 3) {
            visit(count - 1, [last, first]);
        }
    }
}
