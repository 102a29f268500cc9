//! A job: a drawing and the order of its strokes, ready to be drawn.
//!
//! A [`Pipeline`] computes it from the model, in the working memory, where it then lies. The files
//! of this folder are the stages of this computation and what they share; [`plan`](super::plan),
//! [`solid`](super::solid) and [`title`](super::title) are stages, too.

mod errors;
mod hidden_lines;
mod lines;
mod pipeline;
mod scale;
mod strokes;
#[cfg(feature = "early-ink")]
mod unordered;

pub(super) use lines::{Collector, PageSink, move_to_front};
pub(super) use pipeline::{Found, Pipeline};
#[cfg(any(feature = "convex", feature = "tiles"))]
pub(super) use scale::fit;
pub(super) use scale::{FOR_BOUNDS, HALF_A_STEP};
pub use strokes::{Cursor, Strokes};
#[cfg(feature = "early-ink")]
pub(super) use unordered::{Begun, OrderStep, UNORDERED_WORDS};

#[cfg(not(feature = "early-ink"))]
use crate::drawing::Drawing;
use crate::drawing::Stored;
use crate::index::Index;
use crate::machine::StrokeEnds;
use crate::order::{self, Leg};
#[cfg(feature = "early-ink")]
use crate::order::{FirstStrokes, Released};
use crate::stage::Scratch;
#[cfg(not(feature = "early-ink"))]
use crate::stage::items;
use crate::view::View;
use crate::visibility::Stretch;

/// Receives each stretch as soon as it is found, in view coordinates. A preview is drawn with it.
pub trait Observer<I = u16> {
    /// Called with each stretch of an edge that is drawn, as seen through `view`.
    fn stretch(&mut self, view: &View, stretch: &Stretch<I>);

    /// Called when everything shown so far is void, because the search begins again with another
    /// division of the memory.
    fn start_again(&mut self) {}

    /// A bar of a plan from `from` to `to`, in the plan's own coordinates, and its pen, counted
    /// from 0.
    fn plan_bar(&mut self, from: [f64; 2], to: [f64; 2], pen: u8);
}

/// An observer that ignores everything, for where nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl<I: Index> Observer<I> for Unobserved {
    fn stretch(&mut self, _: &View, _: &Stretch<I>) {}
    fn plan_bar(&mut self, _: [f64; 2], _: [f64; 2], _: u8) {}
}

/// Number of the figures of a job.
pub(super) const FIGURES: usize = 13;

/// What is needed to compute the order of a job, besides its drawing.
#[cfg(feature = "early-ink")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Unordered {
    /// The strokes that are drawn first.
    pub(super) first: FirstStrokes,
    /// The options of the order.
    pub(super) options: order::Options,
    /// The strokes that may be drawn already. If they are more than the first ones, the others have
    /// an order, which is still being improved.
    pub(super) released: Released,
}

/// A drawing and the order of its strokes, both of which lie in the working memory.
#[derive(Debug, Clone, Copy)]
pub struct Job<I = u16> {
    /// Where the drawing lies in the working memory.
    stored: Stored<I>,
    /// Number of segments in the tour, which lies behind the drawing.
    legs: usize,
    /// The result of the ordering: lengths and lifts.
    report: order::Report,
    /// What is needed to compute the order beyond the first strokes, while it is not known.
    #[cfg(feature = "early-ink")]
    unordered: Option<Unordered>,
    /// Number of faces that were left out because they have no area.
    degenerate_faces: u32,
    /// Number of edges of a convex solid that were left out because the faces beside them may be
    /// coplanar.
    joined_edges: usize,
}

impl<I: Index> Default for Job<I> {
    fn default() -> Self {
        Self {
            stored: Stored::default(),
            legs: 0,
            report: order::Report::default(),
            #[cfg(feature = "early-ink")]
            unordered: None,
            degenerate_faces: 0,
            joined_edges: 0,
        }
    }
}

impl<I: Index> Job<I> {
    /// Number of words of the working memory that the job occupies.
    pub(super) fn words(&self) -> usize {
        (self.stored.bytes() + Scratch::bytes_for::<Leg<I>>(self.legs)) / size_of::<u64>()
    }

    /// The job without its memory, as numbers. [`Job::from_figures`] reads them.
    pub(super) fn figures(&self) -> [u32; FIGURES] {
        let [segments, points] = self.stored.counts().map(|count| count as u32);
        let report = &self.report;
        let low = |length: u64| length as u32;
        let high = |length: u64| (length >> 32) as u32;
        [
            segments,
            points,
            self.legs as u32,
            report.odd_points,
            report.components,
            report.lifts,
            u32::from(report.optimal) | u32::from(report.returns) << 1,
            low(report.pen_down),
            high(report.pen_down),
            low(report.pen_up),
            high(report.pen_up),
            low(report.bound),
            high(report.bound),
        ]
    }

    /// The job with these figures, or `None` if its memory would be larger than any board's.
    /// Whatever the figures are, [`Job::strokes`] stays within its memory.
    pub(super) fn from_figures(figures: [u32; FIGURES]) -> Option<Self> {
        let [segments, points, legs, odd_points, components, lifts, signs, lengths @ ..] = figures;
        let [down, down_high, up, up_high, bound, bound_high] = lengths;
        let count =
            |count: u32| usize::try_from(count).ok().filter(|&count| count <= I::NONE.get());
        let length = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
        Some(Self {
            stored: Stored::of_counts([count(segments)?, count(points)?]),
            legs: count(legs)?,
            report: order::Report {
                odd_points,
                components,
                lifts,
                optimal: signs & 1 != 0,
                returns: signs & 2 != 0,
                pen_down: length(down, down_high),
                pen_up: length(up, up_high),
                bound: length(bound, bound_high),
            },
            #[cfg(feature = "early-ink")]
            unordered: None,
            degenerate_faces: 0,
            joined_edges: 0,
        })
    }

    /// The job of a drawing that lies at the front of the working memory, with this many segments
    /// in the tour behind it.
    #[cfg(feature = "tiles")]
    pub(super) fn of(stored: Stored<I>, legs: usize, report: order::Report) -> Self {
        Self { stored, legs, report, ..Self::default() }
    }

    /// A job without strokes, from which this many faces were left out.
    #[cfg(feature = "tiles")]
    pub(super) fn left_out(degenerate_faces: u32) -> Self {
        Self { degenerate_faces, ..Self::default() }
    }

    /// Adds what the ordering of another part of the drawing has achieved.
    #[cfg(feature = "tiles")]
    pub(super) fn add_report(&mut self, more: &order::Report) {
        let report = &mut self.report;
        report.odd_points += more.odd_points;
        report.components += more.components;
        report.lifts += more.lifts;
        report.pen_down += more.pen_down;
        report.pen_up += more.pen_up;
    }

    /// Gives up the memory of the job. [`Job::report`] remains valid.
    pub fn release(&mut self) {
        (self.stored, self.legs) = (Stored::default(), 0);
    }

    /// The result of the ordering: number of pen lifts, lengths, and whether it is proved optimal.
    pub fn report(&self) -> &order::Report {
        &self.report
    }

    /// Number of faces of the model that were left out because they have no area.
    pub fn degenerate_faces(&self) -> u32 {
        self.degenerate_faces
    }

    /// Number of edges of a convex solid that were left out because the faces beside them may be
    /// coplanar.
    pub fn joined_edges(&self) -> usize {
        self.joined_edges
    }

    /// Returns the strokes of the job from `cursor` on. `words` is the working memory that holds
    /// the job. `ends` says by how much strokes are made longer.
    #[cfg(feature = "early-ink")]
    pub fn strokes<'a>(
        &self,
        words: &'a mut [u64],
        cursor: &'a mut Cursor<I>,
        ends: Option<StrokeEnds>,
    ) -> Strokes<'a, I> {
        self.strokes_of(None, words, cursor, ends)
    }

    /// Returns the strokes of `begun` if it is given, and otherwise those of the job.
    #[cfg(feature = "early-ink")]
    // Where steps are planned.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub(super) fn strokes_of<'a>(
        &self,
        begun: Option<Begun<'a, I>>,
        words: &'a mut [u64],
        cursor: &'a mut Cursor<I>,
        ends: Option<StrokeEnds>,
    ) -> Strokes<'a, I> {
        let words: &'a [u64] = words;
        let (Begun { drawing, drawn: tour }, has_more) = self.readable(words, begun);
        Strokes {
            drawing,
            tour,
            has_more,
            returns: self.report.returns,
            cursor,
            ends,
            #[cfg(feature = "stream")]
            streamed: None,
            #[cfg(feature = "stream")]
            ring: words,
        }
    }

    /// Returns the strokes of the job from `cursor` on. `words` is the working memory that holds
    /// the job. `ends` says by how much strokes are made longer.
    #[cfg(not(feature = "early-ink"))]
    pub fn strokes<'a>(
        &self,
        words: &'a mut [u64],
        cursor: &'a mut Cursor<I>,
        ends: Option<StrokeEnds>,
    ) -> Strokes<'a, I> {
        // `compute` filled this memory, so both reads succeed. Otherwise there are no strokes.
        let nothing = Drawing::<I> { points: &[], segments: &[] };
        let leg_words = self.stored.bytes() / size_of::<u64>();
        let words: &'a [u64] = words;
        let tour =
            words.get(leg_words..).and_then(|rest| items::<Leg<I>>(rest, self.legs)).unwrap_or(&[]);
        let drawing = self.stored.drawing(words).unwrap_or(nothing);
        Strokes {
            drawing,
            tour,
            returns: self.report.returns,
            cursor,
            ends,
            #[cfg(feature = "stream")]
            streamed: None,
            #[cfg(feature = "stream")]
            ring: words,
        }
    }
}
