//! Changes of the model over the line, listed and taken back.

use super::stream::{Listing, Task};
use super::{Board, Inner, Job, Reply};
use crate::fixed::BinaryFraction;
use crate::machine::State;
use crate::model::{Change, Edit, Element, ElementKind, Model, Numbers};
use crate::protocol::CommandError;
use crate::stage::Scratch;
use core::fmt;

/// Keeps a copy of the model, where there is room for one.
pub(super) struct Keeper<'k> {
    words: &'k mut [u64],
    kept_words: &'k mut usize,
    job: &'k mut Job,
    is_idle: bool,
}

impl Keeper<'_> {
    /// Copies the model in place of the last copy: it is about to change.
    #[inline(never)] // Once is enough.
    pub(super) fn save(&mut self, model: &Model<'_>) {
        *self.kept_words = 0;
        if self.is_idle {
            self.job.release();
            if model.save(self.words) {
                *self.kept_words = model.saved_words();
            }
        }
    }
}

impl<'m> Inner<'m> {
    /// The model, and who keeps a copy of it at the front of the working memory, which `edit` may use only behind.
    pub(super) fn split(&mut self) -> (&mut Model<'m>, Keeper<'_>, Scratch<'_>) {
        // A change that is refused must leave the last copy.
        let next = Some(self.model.saved_words()).filter(|words| *words <= self.words.len());
        let copies = self.kept_words.max(next.unwrap_or(0));
        let (words, free) = self.words.split_at_mut(copies.min(self.words.len()));
        let is_idle = self.machine.state() == State::Idle;
        let keeper =
            Keeper { words, kept_words: &mut self.kept_words, job: &mut self.job, is_idle };
        (&mut self.model, keeper, Scratch::new(free))
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn edit<B: Board>(&mut self, edit: Edit, board: &mut B) -> Result<(), CommandError> {
        if self.machine.state() != State::Idle {
            return Err(CommandError::Busy);
        }
        self.job.release();
        let (model, mut keeper, scratch) = self.split();
        match model.edit(edit, scratch, &mut |model| keeper.save(model)) {
            Ok(Change { vertices, bars, faces, curves }) => {
                Reply(board).line(format_args!(
                    "[EDIT:vertices {vertices:+}, bars {bars:+}, faces {faces:+}, curves {curves:+}]"
                ));
                if self.kept_words == 0 {
                    Reply(board).line(format_args!("[MSG:no memory to take this back]"));
                }
                Ok(())
            }
            Err(error) => Err(CommandError::Model(error)),
        }
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn undo(&mut self) -> Result<(), CommandError> {
        if core::mem::take(&mut self.kept_words) == 0 {
            return Err(CommandError::NothingToUndo);
        }
        self.model.restore(self.words);
        Ok(())
    }

    /// Begins to list what has these numbers.
    pub(super) fn begin_list(
        &mut self,
        part: ElementKind,
        numbers: Numbers,
    ) -> Result<(), CommandError> {
        let range = self.model.range(part, numbers).map_err(CommandError::Model)?;
        self.task = Some(Task::List(Listing::Model(part, range.end), range.start));
        Ok(())
    }

    /// Lists the element at a place in its array.
    #[inline(never)] // Its frame must not lie under the stages'.
    pub(super) fn list_one<B: Board>(&self, part: ElementKind, at: usize, board: &mut B) {
        let mut reply = Reply(board);
        let number = at + 1;
        let elements = self.model.elements().iter();
        match part {
            ElementKind::Vertices => {
                let Some(vertex) = self.model.vertices().get(at) else { return };
                let fraction_bits = self.model.fraction_bits();
                let [x, y, z] = vertex.coordinates().map(|c| BinaryFraction {
                    units: c.into(),
                    fraction_bits,
                    places: 6,
                });
                reply.line(format_args!("[v {number}: {x} {y} {z}]"));
            }
            ElementKind::Bars => {
                let mut bars = elements.filter(|element| matches!(element, Element::Bar(..)));
                let Some(Element::Bar(from, to)) = bars.nth(at) else { return };
                reply.line(format_args!("[l {number}:{}]", List([from, to].into_iter())));
            }
            ElementKind::Faces => {
                let mut faces = elements.filter(|face| matches!(face, Element::Face(_)));
                let Some(Element::Face(corners)) = faces.nth(at) else { return };
                let numbers = List(corners.iter().map(|corner| corner.vertex()));
                reply.line(format_args!("[f {number}:{numbers}]"));
            }
            ElementKind::Curves => {
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
