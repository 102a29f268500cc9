//! Orders a job whose first strokes may be drawn already.

use super::{Job, Unordered};
use crate::drawing::{Drawing, StepsPerMillimetre};
use crate::index::Index;
use crate::order::{
    self, Effort, FirstStrokes, Leg, Method, Options, OrderError, Released, Report, Shape,
    StrokeTime, TimeModel,
};
use crate::protocol::CommandError;
use crate::stage::{Cancel, OutOfScratch, Scratch, items};

/// The part of a job that the machine may read while the order of the job is being computed.
#[derive(Debug, Clone, Copy)]
pub(in crate::plotter) struct Begun<'d, I> {
    /// The drawing.
    pub drawing: Drawing<'d, I>,
    /// The legs of the strokes that are released.
    pub drawn: &'d [Leg<I>],
}

/// The number of words of an [`Unordered`].
pub(in crate::plotter) const UNORDERED_WORDS: usize = 12;

impl Unordered {
    /// The order is not known yet, but for the first strokes.
    pub(in crate::plotter) fn new(first: FirstStrokes, options: Options) -> Self {
        Self { first, options, released: Released::first(first.segments) }
    }

    /// This as numbers, which [`Unordered::from_words`] reads.
    pub(in crate::plotter) fn words(self) -> [u32; UNORDERED_WORDS] {
        let Self { first, options, .. } = self;
        let FirstStrokes { segments, odd_points, parts, strokes_left, time } = first;
        let StrokeTime { steps_per_second, stroke_milliseconds } = time;
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
            steps_per_second,
            stroke_milliseconds,
            method,
            lift_cost,
            kind,
            speed,
            acceleration,
            units,
        ]
    }

    /// Restores the value from these words; `None` if they hold none. The path is open, and the
    /// steps are those that [`Job::for_steps`] sets.
    pub(in crate::plotter) fn from_words(words: [u32; UNORDERED_WORDS]) -> Option<Self> {
        let [segments, odd_points, parts, strokes_left, rest @ ..] = words;
        let segments = usize::try_from(segments).ok()?;
        let [steps_per_second, stroke_milliseconds, method, lift_cost, kind, rest @ ..] = rest;
        let [speed, acceleration, units_per_second] = rest;
        let method = match method {
            0 => Method::Auto,
            1 => Method::Greedy,
            2 => Method::Exact,
            _ => return None,
        };
        let effort = match kind {
            // No board counts more work as a second.
            0 if units_per_second > TimeModel::BOARD => return None,
            0 => Effort::Auto(TimeModel { speed, acceleration, units_per_second }),
            1 => Effort::Units(speed),
            _ => return None,
        };
        let time = StrokeTime { steps_per_second, stroke_milliseconds };
        let first = FirstStrokes { segments, odd_points, parts, strokes_left, time };
        let options =
            Options { method, shape: Shape::OpenPath, effort, lift_cost, ..Options::default() };
        Some(Self::new(first, options))
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
        let legs = self.unordered.map_or(self.legs, |unordered| unordered.released.legs);
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

    /// The same job, whose order will be measured for these steps per millimetre.
    pub(in crate::plotter) fn for_steps(self, steps: StepsPerMillimetre) -> Self {
        let unordered = self.unordered.map(|unordered| Unordered {
            options: Options { steps, ..unordered.options },
            ..unordered
        });
        Self { unordered, ..self }
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
        let from_the_first = |Unordered { first, options, .. }| Unordered::new(first, options);
        let mut job = Self { unordered: self.unordered.map(from_the_first), ..self };
        while job.unordered.is_some() {
            job =
                job.order_further(words, |step, scratch, rest| step.run(scratch, cancel, rest))?;
        }
        Ok(job)
    }

    /// Carries out the next step of the computation of the order, by `run`, and releases the
    /// strokes that may be drawn then. The first step finds an order and each further one improves
    /// it. `run` gets working memory and the legs of the strokes that are not released yet.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(always)] // Adds no frame to the stack.
    pub(in crate::plotter) fn order_further<F>(
        self,
        words: &mut [u64],
        run: F,
    ) -> Result<Self, CommandError>
    where
        F: FnOnce(OrderStep<'_, I>, Scratch<'_>, &mut [Leg<I>]) -> Result<Report, OrderError>,
    {
        let Some(unordered) = self.unordered else { return Ok(self) };
        let Unordered { first, options, released } = unordered;
        let (drawing, mut scratch) =
            self.stored.split(words).map_err(CommandError::DrawingTooLarge)?;
        let out_of_scratch = OutOfScratch {
            needed: Scratch::bytes_for::<Leg<I>>(self.legs),
            available: scratch.available_bytes(),
        };
        // What a former step has written there stays.
        let tour = scratch.take_filled(|legs: &mut [Leg<I>]| {
            if legs.len() < self.legs { Err(out_of_scratch) } else { Ok(self.legs) }
        });
        let tour = tour.map_err(CommandError::DrawingTooLarge)?;
        let (drawn, rest) = tour.split_at_mut(released.legs.min(tour.len()));
        if released == Released::first(first.segments) {
            order::first_legs(drawn);
        }
        let step = OrderStep { begun: Begun { drawing, drawn }, unordered, report: self.report };
        let report = run(step, scratch, rest)?;
        let has_first = first.segments > 0;
        let more = released.more(drawing, tour, options, first.time, [self.report, report]);
        let more = more.filter(|_| has_first);
        let unordered = more.map(|released| Unordered { released, ..unordered });
        Ok(Self { report, unordered, ..self })
    }
}

/// One step of the computation of an order, which finds one or improves it.
#[derive(Debug, Clone, Copy)]
pub(in crate::plotter) struct OrderStep<'d, I> {
    /// The part of the job that the machine may read meanwhile.
    pub begun: Begun<'d, I>,
    /// What the order is computed from.
    unordered: Unordered,
    /// The report of the order as it is.
    report: Report,
}

impl<I: Index> OrderStep<'_, I> {
    /// Carries out this step. Changes the legs of the strokes that are not released yet, and
    /// returns the report of the whole order.
    ///
    /// # Errors
    /// See [`OrderError`].
    pub fn run(
        self,
        scratch: Scratch<'_>,
        cancel: &mut dyn Cancel,
        rest: &mut [Leg<I>],
    ) -> Result<Report, OrderError> {
        let Self { begun: Begun { drawing, drawn }, unordered, report } = self;
        let Unordered { first, options, released } = unordered;
        if drawn.is_empty() {
            order::order(drawing, options, scratch, cancel, rest)
        } else if released == Released::first(first.segments) {
            order::order_rest(drawing, first, drawn, options, scratch, cancel, rest)
        } else {
            order::improve_rest(drawing, drawn, report, options, scratch, cancel, rest)
        }
    }
}
