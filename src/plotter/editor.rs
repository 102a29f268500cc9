//! The commands that edit the model: `$list`, `$undo`, and edits such as `$move`.
//!
//! Before a change, a copy of the model is saved at the front of the working memory, if it fits.
//! `$undo` restores that copy.

use super::stream::{Listing, Task};
use super::{Board, Inner, Job, Reply};
use crate::array::MapEach;
use crate::fixed::BinaryFraction;
use crate::index::Index;
use crate::machine::State;
use crate::model::{Change, Edit, Element, ElementKind, Model, ModelError, Numbers};
use crate::protocol::CommandError;
use crate::stage::Scratch;
use core::fmt;

/// Saves a copy of the model before it changes, so that `$undo` can restore it.
pub(super) struct UndoCopy<'k, I> {
    /// The front of the working memory, where the copy goes.
    words: &'k mut [u64],
    /// Length of the copy in words; 0 if there is none.
    copy_words: &'k mut usize,
    /// The last job; its memory is given up to the copy.
    job: &'k mut Job<I>,
    /// Whether a copy may be made: not while a job may still be drawn from the same memory, and not
    /// by a plotter that cannot undo.
    is_made: bool,
}

impl<I: Index> UndoCopy<'_, I> {
    /// Saves `model`, which is about to change, in place of the last copy. Keeps no copy if it does
    /// not fit or may not be made.
    #[inline(never)] // Several callers share one copy of the code.
    pub(super) fn save(&mut self, model: &Model<'_, I>) {
        *self.copy_words = 0;
        if self.is_made {
            self.job.release();
            if model.save(self.words) {
                *self.copy_words = model.saved_words();
            }
        }
    }
}

impl<'m, I: Index> Inner<'m, I> {
    /// Borrows the model, what saves its copy for `$undo`, and the working memory behind the copy,
    /// which an edit may use.
    pub(super) fn split(&mut self) -> (&mut Model<'m, I>, UndoCopy<'_, I>, Scratch<'_>) {
        // A refused change must not overwrite the last copy, so room is left for the longer of
        // both.
        let next = Some(self.model.saved_words()).filter(|words| *words <= self.words.len());
        let copies = self.copy_words.max(next.unwrap_or(0));
        let (words, free) = self.words.split_at_mut(copies.min(self.words.len()));
        let is_made = self.can_undo && self.machine.state() == State::Idle;
        let undo_copy =
            UndoCopy { words, copy_words: &mut self.copy_words, job: &mut self.job, is_made };
        (&mut self.model, undo_copy, Scratch::new(free))
    }

    /// Edits the model and reports how many elements have been added or removed.
    ///
    /// # Errors
    /// [`CommandError::Busy`] unless the machine is idle, or the model's refusal.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn edit<B: Board>(&mut self, edit: Edit, board: &mut B) -> Result<(), CommandError> {
        if self.machine.state() != State::Idle {
            return Err(CommandError::Busy);
        }
        self.job.release();
        let (model, mut undo_copy, scratch) = self.split();
        match model.edit(edit, scratch, &mut |model| undo_copy.save(model)) {
            Ok(Change { vertices, bars, faces, curves }) => {
                Reply(board).line(format_args!(
                    "[EDIT:vertices {vertices:+}, bars {bars:+}, faces {faces:+}, \
                     curves {curves:+}]"
                ));
                if self.copy_words == 0 {
                    Reply(board).line(format_args!("[MSG:no memory to take this back]"));
                }
                Ok(())
            }
            Err(error) => Err(CommandError::Model(error)),
        }
    }

    /// Restores the copy of the model.
    ///
    /// # Errors
    /// [`CommandError::NothingToUndo`] if there is no copy, or [`ModelError::CurveUnfinished`], for
    /// the copy has not the curve that has begun since.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn undo(&mut self) -> Result<(), CommandError> {
        if self.model.has_unfinished_curve() {
            return Err(CommandError::Model(ModelError::CurveUnfinished));
        }
        if core::mem::take(&mut self.copy_words) == 0 {
            return Err(CommandError::NothingToUndo);
        }
        self.model.restore(self.words);
        Ok(())
    }

    /// Begins to list the elements of one kind that have these numbers.
    pub(super) fn begin_list(
        &mut self,
        part: ElementKind,
        numbers: Numbers,
    ) -> Result<(), CommandError> {
        let range = self.model.range(part, numbers).map_err(CommandError::Model)?;
        self.task = Some(Task::List(Listing::Model(part, range.end), range.start));
        Ok(())
    }

    /// Writes the row of the element at index `at` among those of its kind.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn list_one<B: Board>(&self, part: ElementKind, at: usize, board: &mut B) {
        let mut reply = Reply(board);
        let number = at + 1;
        let elements = self.model.elements().iter();
        match part {
            ElementKind::Vertices => {
                let Some(vertex) = self.model.vertices().get(at) else { return };
                let fraction_bits = self.model.fraction_bits();
                let [x, y, z] = vertex.coordinates().map_each(|c| BinaryFraction {
                    units: c.into(),
                    fraction_bits,
                    decimals: 6,
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

/// Indices from 0, shown as numbers from 1 with a space before each.
struct List<N>(N);

impl<N: Iterator<Item: Index> + Clone> fmt::Display for List<N> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.clone().try_for_each(|number| write!(formatter, " {}", number.get() + 1))
    }
}
