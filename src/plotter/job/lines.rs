//! Collects the lines that a stage finds, at the front of the working memory.

use super::super::PlotOptions;
use super::Observer;
use crate::drawing::{LineType, PackedLine, PageMap};
use crate::index::Index;
use crate::plotter::HiddenLines;
use crate::protocol::CommandError;
use crate::stage::{OutOfScratch, Scratch, items_mut};
use crate::view::View;
use crate::visibility::{SinkFull, Stretch, StretchSink};

/// Moves `count` lines from word `at` to the front, where
/// [`build_graph`](crate::drawing::build_graph) looks for them.
pub(in crate::plotter) fn move_to_front(words: &mut [u64], at: usize, count: usize) {
    let line_words = Scratch::bytes_for::<PackedLine>(count) / size_of::<u64>();
    // All these words are there.
    let start = at.min(words.len());
    let end = start.saturating_add(line_words).min(words.len());
    words.copy_within(start..end, 0);
}

/// Collects lines, packed, at the front of the memory. Lines without length are dropped.
pub(in crate::plotter) struct Collector<'a> {
    /// Room for the lines. Those collected so far come first.
    pub(super) lines: &'a mut [PackedLine],
    /// Number of lines collected so far.
    pub count: usize,
}

impl<'a> Collector<'a> {
    /// Begins to collect lines at the front of `words`, which is all used for them.
    pub fn new(words: &'a mut [u64]) -> Self {
        let room = size_of_val(words) / size_of::<PackedLine>();
        Self { lines: items_mut(words, room).unwrap_or(&mut []), count: 0 }
    }

    /// Adds a line.
    ///
    /// # Errors
    /// [`SinkFull`] if there is no room for it.
    pub fn line(&mut self, line: PackedLine) -> Result<(), SinkFull> {
        if line.has_length() {
            *self.lines.get_mut(self.count).ok_or(SinkFull)? = line;
            self.count += 1;
        }
        Ok(())
    }

    /// Returns how much memory one more line would need and how much there is, for the error.
    pub fn missing(&self) -> OutOfScratch {
        let available = size_of_val(self.lines);
        OutOfScratch { needed: available + size_of::<PackedLine>(), available }
    }

    /// Returns the error to reply with if there is no room for another line.
    pub fn out_of_memory(&self) -> CommandError {
        CommandError::DrawingTooLarge(self.missing())
    }
}

/// Maps each stretch that is to be drawn to the page and collects it as a line.
pub(in crate::plotter) struct PageSink<'a, I> {
    /// The collector, which turns the lines into a drawing.
    pub collector: Collector<'a>,
    /// The map from the view to the page, by which the stretches are placed there.
    pub map: &'a PageMap,
    /// The camera's view of the model, in whose coordinates the stretches come.
    pub view: &'a View,
    /// What is drawn and how. It says what becomes of hidden stretches.
    pub options: &'a PlotOptions,
    /// Is told of each stretch that is drawn, so that a preview can show it.
    pub observer: &'a mut dyn Observer<I>,
}

impl<I: Index> StretchSink<I> for PageSink<'_, I> {
    fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull> {
        let (p, q) = stretch.ends;
        // The intersection of a face with the near plane is not an edge of the model.
        let is_cut = |near| p.z == near && q.z == near && stretch.edge.is_some();
        if self.view.near().is_some_and(is_cut) {
            return Ok(());
        }
        let mut stretch = stretch;
        if self.options.one_pen {
            stretch.pen = 0;
        }
        let line_type = match (stretch.visible, self.options.hidden) {
            (true, _) => LineType::Full,
            (false, HiddenLines::Drawn(line_type)) => line_type,
            (false, HiddenLines::Pen(pen)) => {
                stretch.pen = pen;
                LineType::Full
            }
            (false, HiddenLines::Erased) => return Ok(()),
        };
        self.observer.stretch(self.view, &stretch);
        let along = [stretch.from, stretch.to];
        match self.map.stretch((p, q), along, self.view.projection()) {
            Some([from, to]) => {
                let line = PackedLine::new(from, to, line_type, stretch.pen);
                self.collector.line(if stretch.visible { line } else { line.under() })
            }
            None => Ok(()),
        }
    }
}
