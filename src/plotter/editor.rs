//! Changes of the model over the line, listed and taken back.

use super::{Board, Inner, Reply};
use crate::fixed::BinaryFraction;
use crate::model::{Change, Edit, Element, Numbers, Part};
use crate::protocol::Refusal;
use crate::stage::Scratch;
use core::fmt;

impl Inner<'_> {
    /// Copies the model to the working memory, if that is idle, before it is changed.
    pub(super) fn remember(&mut self) {
        if self.is_idle() {
            self.job.release();
            self.can_undo = self.model.save(self.words);
        }
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn edit<B: Board>(&mut self, edit: Edit, board: &mut B) -> Result<(), Refusal> {
        if !self.is_idle() {
            return Err(Refusal::Busy);
        }
        // The copy stands at the front; the edit works behind it.
        let free = if self.can_undo { self.model.saved_words() } else { 0 };
        let scratch = Scratch::new(self.words.get_mut(free..).unwrap_or(&mut []));
        match self.model.edit(edit, scratch) {
            Ok(Change { vertices, bars, faces, curves }) => {
                Reply(board).line(format_args!(
                    "[EDIT:vertices {vertices:+}, bars {bars:+}, faces {faces:+}, curves {curves:+}]"
                ));
                if !self.can_undo {
                    Reply(board).line(format_args!("[MSG:no memory to take this back]"));
                }
                Ok(())
            }
            Err(error) => Err(Refusal::Model(error)),
        }
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn undo(&mut self) -> Result<(), Refusal> {
        if !core::mem::take(&mut self.can_undo) {
            return Err(Refusal::NothingToUndo);
        }
        self.model.restore(self.words);
        Ok(())
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn list<B: Board>(
        &self,
        part: Part,
        numbers: Numbers,
        board: &mut B,
    ) -> Result<(), Refusal> {
        let range = self.model.range(part, numbers).map_err(Refusal::Model)?;
        let mut reply = Reply(board);
        let (first, count) = (range.start, range.len());
        let bits = self.model.fraction_bits();
        let coordinate =
            |c: i32| BinaryFraction { units: c.into(), fraction_bits: bits, places: 6 };
        let elements = self.model.elements();
        match part {
            Part::Vertices => {
                let vertices = self.model.vertices().iter().enumerate();
                for (at, vertex) in vertices.skip(first).take(count) {
                    let [x, y, z] = vertex.coordinates().map(coordinate);
                    reply.line(format_args!("[v {}: {x} {y} {z}]", at + 1));
                }
            }
            Part::Bars => {
                let bars = elements.iter().filter_map(|element| match element {
                    Element::Bar(from, to) => Some([from, to]),
                    Element::Face(_) => None,
                });
                for (at, ends) in bars.enumerate().skip(first).take(count) {
                    reply.line(format_args!("[l {}:{}]", at + 1, List(ends.iter().copied())));
                }
            }
            Part::Faces => {
                let faces = elements.iter().filter_map(|element| match element {
                    Element::Face(corners) => Some(corners),
                    Element::Bar(..) => None,
                });
                for (at, corners) in faces.enumerate().skip(first).take(count) {
                    let numbers = List(corners.iter().map(|corner| corner.vertex()));
                    reply.line(format_args!("[f {}:{numbers}]", at + 1));
                }
            }
            Part::Curves => {
                let curves = self.model.curves();
                for (at, curve) in curves.iter().enumerate().skip(first).take(count) {
                    let numbers = List(curve.control.iter().copied());
                    let degree = curve.order - 1;
                    reply.line(format_args!("[c {} of degree {degree}:{numbers}]", at + 1));
                }
            }
        }
        Ok(())
    }
}

/// Numbers from 1, each after a space.
struct List<I>(I);

impl<I: Iterator<Item = u16> + Clone> fmt::Display for List<I> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.clone().try_for_each(|number| write!(formatter, " {}", u32::from(number) + 1))
    }
}
