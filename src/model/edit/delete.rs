//! Deletes vertices, elements and curves, and reverses faces.

use super::ElementKind;
use crate::array::rotate_left;
use crate::index::Index;
use crate::model::pens::{close_gap, open_gap};
use crate::model::{Corner, Model};
use core::ops::Range;

impl<I: Index> Model<'_, I> {
    /// Deletes the elements of a kind in `range`. If `plug`, the last element replaces the deleted
    /// one.
    // `Model::range` has made the range: it is not empty, and all elements in it exist. So the
    // vertices that are swapped or moved here exist, and there is a last one.
    pub(super) fn delete(&mut self, part: ElementKind, range: Range<usize>, plug: bool) {
        match part {
            ElementKind::Vertices => {
                let gone = range.len();
                if plug {
                    let last = self.vertices.len() - 1;
                    self.vertices.swap(range.start, last);
                    self.vertices.truncate(last);
                } else {
                    let count = self.vertices.len();
                    self.vertices.copy_within(range.end..count, range.start);
                    self.vertices.truncate(count - gone);
                }
                let last = self.vertices.len();
                self.renumber(&|number| {
                    let at = number.get();
                    if range.contains(&at) {
                        None
                    } else if plug && at == last {
                        Some(I::new(range.start)) // below the number of vertices
                    } else if plug || at < range.start {
                        Some(number)
                    } else {
                        Some(number - I::new(gone))
                    }
                });
            }
            ElementKind::Curves => self.curves.delete(&mut self.store, range, plug),
            ElementKind::Bars | ElementKind::Faces => {
                self.delete_elements(part == ElementKind::Bars, range, plug)
            }
        }
    }

    /// Deletes the bars, or faces, whose positions among their kind are in `range`.
    fn delete_elements(&mut self, bars: bool, range: Range<usize>, plug: bool) {
        if plug {
            // Move the last element to just before the one that is deleted.
            let corners = self.store.corners_mut();
            let (mut at, mut number, mut hole) = (0, 0, 0);
            let mut last = 0..0;
            while let Some(length) = corners.get(at..).and_then(element_length) {
                if corners.get(at).is_some_and(|corner| corner.of_bar() == bars) {
                    if number == range.start {
                        hole = at;
                    }
                    number += 1;
                    last = at..at + length;
                }
                at += length;
            }
            if let Some(between) = corners.get_mut(hole..last.end).filter(|_| last.start > hole) {
                let before = between.len().saturating_sub(last.len());
                rotate_left(between, before);
                self.move_pen(last, hole);
                self.remove_elements(bars, range.start + 1..range.end + 1);
                return;
            }
        }
        self.remove_elements(bars, range);
    }

    /// Removes the bars, or faces, whose positions among their kind are in `gone`.
    fn remove_elements(&mut self, bars: bool, gone: Range<usize>) {
        let mut number = 0;
        self.retain(&mut |element| {
            let counts = element.first().is_some_and(|corner| corner.of_bar() == bars);
            number += usize::from(counts);
            !(counts && gone.contains(&(number - 1)))
        });
    }

    /// Gives every corner and control point its new number. Elements and curves with a vertex for
    /// which `new` returns `None` are removed.
    fn renumber(&mut self, new: &dyn Fn(I) -> Option<I>) {
        self.retain(&mut |element| {
            element.iter_mut().all(|corner| match new(corner.vertex()) {
                Some(number) => {
                    *corner = Corner::new(number, corner.of_bar(), corner.is_last());
                    true
                }
                None => false,
            })
        });
        self.curves.renumber(&mut self.store, new);
    }

    /// Keeps the elements for which `stays` returns `true`; it may change them.
    fn retain(&mut self, stays: &mut dyn FnMut(&mut [Corner<I>]) -> bool) {
        let mut runs = self.store.pen_runs().len();
        let (mut read, mut write, mut bars, mut faces) = (0, 0, 0, 0);
        while let Some(length) = self.store.corners().get(read..).and_then(element_length) {
            let corners = self.store.corners_mut();
            let element = corners.get_mut(read..read + length).unwrap_or(&mut []);
            let of_bar = element.first().is_some_and(|corner| corner.of_bar());
            if stays(element) {
                corners.copy_within(read..read + length, write);
                write += length;
                *(if of_bar { &mut bars } else { &mut faces }) += 1;
            } else {
                runs = close_gap(self.store.pen_runs_mut(), runs, write..write + length);
            }
            read += length;
        }
        self.store.truncate_corners(write);
        self.truncate_pen_runs(runs);
        (self.bars, self.faces) = (bars, faces);
    }

    /// Updates the pens after the corners in `from` were moved to `to`, which is before them. There
    /// must be room for two more runs.
    fn move_pen(&mut self, from: Range<usize>, to: usize) {
        let (count, pen) = (self.store.pen_runs().len(), self.pens().at(from.start));
        if count == 0 || self.store.add_pen_runs(2).is_err() {
            return;
        }
        let runs = self.store.pen_runs_mut();
        let count = close_gap(runs, count, from.clone());
        let count = open_gap(runs, count, to, from.len(), pen);
        self.truncate_pen_runs(count);
    }

    /// Keeps the first `count` changes of the pen, without the last one if no element follows it.
    fn truncate_pen_runs(&mut self, count: usize) {
        let (end, runs) = (self.store.corners().len(), self.store.pen_runs());
        let last = count.checked_sub(1).and_then(|last| runs.get(last));
        let is_empty = last.is_some_and(|run| run.begins_at(end));
        self.store.truncate_pen_runs(count - usize::from(is_empty));
    }

    /// Reverses the faces that have all their vertices in `range`, so that they face outwards
    /// again.
    pub(super) fn reverse_faces(&mut self, range: &Range<usize>) {
        self.retain(&mut |element| {
            let inside = element.iter().all(|corner| range.contains(&corner.vertex().get()));
            if inside && element.first().is_some_and(|corner| !corner.of_bar()) {
                reverse(element);
            }
            true
        });
    }
}

/// Returns the number of corners of the first element.
pub(super) fn element_length<I: Index>(corners: &[Corner<I>]) -> Option<usize> {
    corners.iter().position(|corner| corner.is_last()).map(|last| last + 1)
}

/// Reverses the order of a face's corners, so that it faces the other way. It begins at the same
/// vertex.
pub(super) fn reverse<I: Index>(face: &mut [Corner<I>]) {
    let Some((_, rest)) = face.split_first_mut() else { return };
    crate::array::reverse(rest);
    let last = face.len() - 1;
    for (at, corner) in face.iter_mut().enumerate() {
        *corner = Corner::new(corner.vertex(), false, at == last);
    }
}
