//! Orders a job whose first strokes may be drawn already.

use super::{Job, Unordered};
use crate::drawing::Drawing;
use crate::index::Index;
use crate::order::{self, Effort, FirstStrokes, Leg, Method, Options, Shape, TimeModel};
use crate::protocol::CommandError;
use crate::stage::{Cancel, Scratch, items};

/// The part of a job that the machine may read while the order of the job is being computed.
#[derive(Debug, Clone, Copy)]
pub(in crate::plotter) struct Begun<'d, I> {
    /// The drawing.
    pub drawing: Drawing<'d, I>,
    /// The legs of its first strokes.
    pub drawn: &'d [Leg<I>],
}

/// The number of words of an [`Unordered`].
pub(in crate::plotter) const UNORDERED_WORDS: usize = 11;

impl Unordered {
    /// This as numbers, which [`Unordered::from_words`] reads.
    pub(in crate::plotter) fn words(self) -> [u32; UNORDERED_WORDS] {
        let Self { first, options } = self;
        let FirstStrokes { segments, odd_points, parts, strokes_left, spare_milliseconds } = first;
        let Options { method, effort, lift_cost, .. } = options;
        let method = match method {
            Method::Auto => 0,
            Method::Greedy => 1,
            Method::Exact => 2,
        };
        let effort = match effort {
            Effort::Auto(TimeModel { speed, acceleration, units_per_second }) => {
                [0, speed, acceleration, units_per_second]
            }
            Effort::Units(units) => [1, units, 0, 0],
        };
        let [kind, speed, acceleration, units] = effort;
        let segments = segments as u32;
        [
            segments,
            odd_points,
            parts,
            strokes_left,
            spare_milliseconds,
            method,
            lift_cost,
            kind,
            speed,
            acceleration,
            units,
        ]
    }

    /// Restores the value from these words; `None` if they hold none. The path is open.
    pub(in crate::plotter) fn from_words(words: [u32; UNORDERED_WORDS]) -> Option<Self> {
        let [segments, odd_points, parts, strokes_left, spare_milliseconds, rest @ ..] = words;
        let segments = usize::try_from(segments).ok()?;
        let [method, lift_cost, kind, speed, acceleration, units_per_second] = rest;
        let method = match method {
            0 => Method::Auto,
            1 => Method::Greedy,
            2 => Method::Exact,
            _ => return None,
        };
        let effort = match kind {
            0 => Effort::Auto(TimeModel { speed, acceleration, units_per_second }),
            1 => Effort::Units(speed),
            _ => return None,
        };
        let first = FirstStrokes { segments, odd_points, parts, strokes_left, spare_milliseconds };
        let options = Options { method, shape: Shape::OpenPath, effort, lift_cost };
        Some(Self { first, options })
    }
}

impl<I: Index> Job<I> {
    /// What the machine may read of the job: the drawing, the legs whose order is known, and
    /// whether more follow. That is `begun`, if it is given, and otherwise what `words` hold.
    #[inline(never)] // Inlined, it would take room where steps are planned.
    pub(in crate::plotter) fn readable<'a>(
        &self,
        words: &'a [u64],
        begun: Option<Begun<'a, I>>,
    ) -> (Begun<'a, I>, bool) {
        if let Some(begun) = begun {
            return (begun, true);
        }
        let legs = self.unordered.map_or(self.legs, |unordered| unordered.first.segments);
        let behind = words.get(self.drawing_words()..);
        let drawn = behind.and_then(|rest| items::<Leg<I>>(rest, legs)).unwrap_or(&[]);
        // The job's memory was filled, so the drawing is there. Otherwise there are no strokes.
        let drawing = self.stored.drawing(words).unwrap_or(Drawing { points: &[], segments: &[] });
        (Begun { drawing, drawn }, self.unordered.is_some())
    }

    /// Returns the strokes that are drawn first, and what is needed to order the others; `None` if
    /// the order is known.
    pub(in crate::plotter) fn unordered(&self) -> Option<Unordered> {
        self.unordered
    }

    /// A job of this drawing whose order is not known yet.
    pub(in crate::plotter) fn without_order(self, unordered: Unordered) -> Self {
        Self { unordered: Some(unordered), ..self }
    }

    /// The drawing of the job, which `words` hold.
    pub(in crate::plotter) fn drawing<'d>(&self, words: &'d [u64]) -> Option<Drawing<'d, I>> {
        self.stored.drawing(words)
    }

    /// Number of words of the working memory that the drawing alone occupies. The order lies behind
    /// it.
    pub(in crate::plotter) fn drawing_words(&self) -> usize {
        self.stored.bytes() / size_of::<u64>()
    }

    /// Writes the order of the first strokes to `words`, so that they can be drawn. Returns whether
    /// there is memory enough to order the others for sure.
    pub(in crate::plotter) fn lay_first(&self, words: &mut [u64]) -> bool {
        let Ok((drawing, mut rest)) = self.stored.split(words) else { return false };
        let items = drawing.points.len() + drawing.segments.len();
        let Ok(tour) = rest.take::<Leg<I>>(self.legs) else { return false };
        order::first_legs(tour);
        // Each part of the order takes less than eight numbers for each point and each segment.
        8 * items * size_of::<I>() <= rest.available_bytes()
    }

    /// Computes the order of a job whose drawing lies in `words`, and writes it behind that.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
    pub(in crate::plotter) fn ordered(
        self,
        words: &mut [u64],
        cancel: &mut dyn Cancel,
    ) -> Result<Self, CommandError> {
        self.ordered_by(words, |begun, scratch, rest, Unordered { first, options }| {
            let Begun { drawing, drawn } = begun;
            if drawn.is_empty() {
                return order::order(drawing, options, scratch, cancel, rest);
            }
            order::order_rest(drawing, first, drawn, options, scratch, cancel, rest)
        })
    }

    /// Computes the order as [`Job::ordered`] does, by `order`. It gets what the machine may draw
    /// meanwhile, working memory, and where the legs of the other strokes go.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(always)] // Adds no frame to the stack.
    pub(in crate::plotter) fn ordered_by(
        self,
        words: &mut [u64],
        order: impl FnOnce(
            Begun<'_, I>,
            Scratch<'_>,
            &mut [Leg<I>],
            Unordered,
        ) -> Result<order::Report, order::OrderError>,
    ) -> Result<Self, CommandError> {
        let Some(unordered) = self.unordered else { return Ok(self) };
        let (drawing, mut scratch) =
            self.stored.split(words).map_err(CommandError::DrawingTooLarge)?;
        let tour = scratch.take::<Leg<I>>(self.legs).map_err(CommandError::DrawingTooLarge)?;
        let (drawn, rest) = tour.split_at_mut(unordered.first.segments.min(tour.len()));
        order::first_legs(drawn);
        let begun = Begun { drawing, drawn };
        let report = order(begun, scratch, rest, unordered)?;
        Ok(Self { report, unordered: None, ..self })
    }
}
