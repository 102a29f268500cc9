//! Draws a convex solid that is given without faces: by its vertices alone, or by its vertices and
//! edges. The visible edges become lines on the page.

use super::job::{Collector, Found, PageSink, Pipeline, fit, move_to_front};
use super::{HiddenLines, VisibilityMode};
use crate::array::MapEach;
use crate::convex::{self, EdgeVisibility, Eye, SinkFull, SolidEdge, SolidError, SolidSink};
use crate::drawing::Bounds;
use crate::index::Index;
use crate::model::Corner;
use crate::protocol::CommandError;
use crate::stage::{OutOfScratch, Scratch, Stage, items_mut};
use crate::view::{SightLines, distinct_edges};
use crate::visibility::{EdgeParameter, Stretch, StretchSink};

/// Finds the visible edges of the solid, whose lines are then at the front of the working memory.
///
/// # Errors
/// [`CommandError::Solid`] if this is no convex solid, [`CommandError::View`],
/// [`CommandError::Page`], [`CommandError::DrawingTooLarge`], [`CommandError::Aborted`].
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn project<I: Index>(pipeline: &mut Pipeline<'_, I>) -> Result<Found, CommandError> {
    let (camera, view) = pipeline.camera_view()?;
    let Pipeline { model, options, steps, words, cancel, observer, .. } = pipeline;
    let (model, options, words) = (*model, *options, &mut **words);
    let eye = match camera.sight_lines(model.fraction_bits()).map_err(CommandError::View)? {
        SightLines::Through(position) => Eye::At(position),
        SightLines::Along(direction) => Eye::Towards(direction),
    };
    cancel.enter(Stage::Visibility);
    let positions = bytemuck::cast_slice(model.vertices());
    let precision = options.precision_of(model);
    // A solid has no more edges than its number of vertices allows (Euler), nor more than were
    // sent.
    let most = match options.see {
        VisibilityMode::Edges => model.corner_count(),
        _ => 3 * model.vertices().len(),
    };
    let mut scratch = Scratch::new(words);
    let pairs = scratch.take(most).map_err(CommandError::DrawingTooLarge)?;
    let mut edges = Edges { pairs, shown: 0, hidden: 0, wanted: options.hidden };
    let found = if options.see == VisibilityMode::Edges {
        let sent = distinct_edges(model.elements(), &mut scratch);
        let sent = sent.map_err(CommandError::DrawingTooLarge)?;
        convex::from_edges(positions, sent, eye, precision, scratch, *cancel, &mut edges)
    } else {
        convex::from_vertices(positions, eye, precision, scratch, *cancel, &mut edges)
    };
    let summary = found.map_err(|error| match error {
        SolidError::Scratch(missing) => CommandError::DrawingTooLarge(missing),
        SolidError::Aborted => CommandError::Aborted,
        error => CommandError::Solid(error),
    })?;
    let (shown, hidden) = (edges.shown, edges.hidden);
    let edge_bytes = Scratch::bytes_for::<[I; 2]>(most);
    // The search took at least that much.
    let missing = OutOfScratch { needed: edge_bytes, available: size_of_val(words) };
    let (edge_words, line_words) = words
        .split_at_mut_checked(edge_bytes / size_of::<u64>())
        .ok_or(CommandError::DrawingTooLarge(missing))?;
    let edges: &[[I; 2]] = items_mut(edge_words, most).unwrap_or(&mut []);
    let on_view = |ends: &[I; 2]| {
        let [p, q] = ends.map_each(|number| model.vertices().get(number.get()));
        view.clip_edge([view.vertex(*p?), view.vertex(*q?)])
    };
    let all = || {
        let visible = edges.iter().take(shown).map(|ends| (ends, true));
        visible.chain(edges.iter().rev().take(hidden).map(|ends| (ends, false)))
    };
    let is_nearer = |near| model.vertices().iter().any(|position| view.vertex(*position).z < near);
    let is_cut = view.near().is_some_and(is_nearer);
    let mut bounds = Bounds::NOTHING;
    for ends in all().filter_map(|(ends, _)| on_view(ends)) {
        cancel.check()?;
        for end in ends {
            bounds.add(end, view.projection());
        }
    }
    let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
    let map = fit(&view, is_cut, &bounds, options, *steps)?;
    let collector = Collector::new(line_words);
    let mut sink =
        PageSink { collector, map: &map, view: &view, options, observer: &mut **observer };
    for (numbers, visible) in all() {
        cancel.check()?;
        let Some([p, q]) = on_view(numbers) else { continue };
        let (from, to) = (EdgeParameter::START, EdgeParameter::END);
        let edge = Some((numbers[0], numbers[1]));
        sink.stretch(Stretch { edge, ends: (p, q), from, to, visible, pen: 0 })
            .map_err(|SinkFull| sink.collector.out_of_memory())?;
    }
    let count = sink.collector.count;
    move_to_front(words, Scratch::bytes_for::<[I; 2]>(most) / 8, count);
    Ok(Found { lines: count, joined_edges: summary.joined, degenerate_faces: 0 })
}

/// The edges of the solid that are to be drawn. Visible edges fill the array from the front, hidden
/// ones from the back.
struct Edges<'a, I> {
    /// For each edge, the vertex numbers of its ends.
    pairs: &'a mut [[I; 2]],
    /// Number of visible edges, which are at the front of `pairs`.
    shown: usize,
    /// Number of hidden edges, which are at the back of `pairs`.
    hidden: usize,
    /// The treatment of hidden edges; they are stored only if they are drawn.
    wanted: HiddenLines,
}

impl<I: Index> SolidSink<I> for Edges<'_, I> {
    fn face(&mut self, _: &[Corner<I>], _: bool) -> Result<(), SinkFull> {
        Ok(())
    }

    fn edge(&mut self, edge: SolidEdge<I>) -> Result<(), SinkFull> {
        let at = match (edge.visibility, self.wanted) {
            (EdgeVisibility::Outline | EdgeVisibility::Visible, _) => {
                self.shown += 1;
                self.shown - 1
            }
            (EdgeVisibility::BehindOutline, _) | (EdgeVisibility::Hidden, HiddenLines::Erased) => {
                return Ok(());
            }
            (EdgeVisibility::Hidden, _) => {
                self.hidden += 1;
                self.pairs.len().checked_sub(self.hidden).ok_or(SinkFull)?
            }
        };
        *self.pairs.get_mut(at).ok_or(SinkFull)? = [edge.ends.0, edge.ends.1];
        Ok(())
    }
}
