//! Changes of the model over the line, listed and taken back.

use super::stream::{Listing, Task};
use super::{Board, Inner, Reply};
use crate::fixed::BinaryFraction;
use crate::machine::State;
use crate::model::{Change, Edit, Element, Numbers, Part};
use crate::protocol::Refusal;
use crate::stage::Scratch;
use core::fmt;

impl Inner<'_> {
    /// Copies the model to the working memory, if that is idle, before it is changed.
    pub(super) fn remember(&mut self) {
        if self.machine.state() == State::Idle {
            self.job.release();
            self.can_undo = self.model.save(self.words);
        }
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn edit<B: Board>(&mut self, edit: Edit, board: &mut B) -> Result<(), Refusal> {
        if self.machine.state() != State::Idle {
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

    /// Begins to list what has these numbers.
    pub(super) fn begin_list(&mut self, part: Part, numbers: Numbers) -> Result<(), Refusal> {
        let range = self.model.range(part, numbers).map_err(Refusal::Model)?;
        self.task = Some(Task::List(Listing::Model(part, range.end), range.start));
        Ok(())
    }

    /// Lists the element at a place in its array.
    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn list_one<B: Board>(&self, part: Part, at: usize, board: &mut B) {
        let mut reply = Reply(board);
        let number = at + 1;
        let elements = self.model.elements().iter();
        match part {
            Part::Vertices => {
                let Some(vertex) = self.model.vertices().get(at) else { return };
                let fraction_bits = self.model.fraction_bits();
                let [x, y, z] = vertex.coordinates().map(|c| BinaryFraction {
                    units: c.into(),
                    fraction_bits,
                    places: 6,
                });
                reply.line(format_args!("[v {number}: {x} {y} {z}]"));
            }
            Part::Bars => {
                let mut bars = elements.filter(|element| matches!(element, Element::Bar(..)));
                let Some(Element::Bar(from, to)) = bars.nth(at) else { return };
                reply.line(format_args!("[l {number}:{}]", List([from, to].into_iter())));
            }
            Part::Faces => {
                let mut faces = elements.filter(|face| matches!(face, Element::Face(_)));
                let Some(Element::Face(corners)) = faces.nth(at) else { return };
                let numbers = List(corners.iter().map(|corner| corner.vertex()));
                reply.line(format_args!("[f {number}:{numbers}]"));
            }
            Part::Curves => {
                let Some(curve) = self.model.curves().iter().nth(at) else { return };
                let numbers = List(curve.control.iter().copied());
                reply.line(format_args!("[c {number} of degree {}:{numbers}]", curve.order - 1));
            }
        }
    }
}

/// Numbers from 1, each after a space.
struct List<I>(I);

impl<I: Iterator<Item = u16> + Clone> fmt::Display for List<I> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.clone().try_for_each(|number| write!(formatter, " {}", u32::from(number) + 1))
    }
}
