//! Improves the order of strokes while the pen draws those before them.
//!
//! The order of a drawing whose pen has begun early ([`order_rest`](super::order_rest)) is made in
//! little time, because the pen would wait for it. From then on the pen is always given strokes
//! that keep it busy for some seconds ([`Released`]), and the order of those behind them is
//! improved meanwhile ([`improve_rest`]). That is repeated until it no longer helps.
//!
//! How many strokes the pen is given, and how much work is done meanwhile, depends on the drawing
//! and on settings alone, never on a clock. So the order is the same on every machine, and the same
//! once more if it is computed again after a loss of power.

use super::first::{StrokeTime, end_of, ends, measure_all};
use super::improve::improve_further;
use super::metric::length;
use super::network::{Anchor, Network};
use super::work_budget::WorkBudget;
use super::{Effort, Leg, Options, OrderError, Report};
use crate::drawing::{Drawing, Segment};
use crate::index::Index;
use crate::stage::{Cancel, Scratch};

/// The pen is given strokes that keep it busy for this many milliseconds at least.
const BUSY_MILLISECONDS: u64 = 8000;
/// The milliseconds of work that are done meanwhile. What is left is for finding the neighbours
/// anew, which is not counted as work.
const WORK_MILLISECONDS: u64 = 6400;
/// The order is improved at most this many times. If the power fails meanwhile, all of that is
/// computed again before the drawing goes on.
const MOST_ROUNDS: u32 = 10;
/// It is not improved any more after this many rounds that changed nothing.
const MOST_IN_VAIN: u32 = 2;

/// How many strokes the pen may draw while the order of the others is still being improved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Released {
    /// The number of legs at the beginning of the tour that do not change any more.
    pub legs: usize,
    /// How often the order of the others was improved.
    rounds: u32,
    /// How many rounds in succession, the last ones, changed nothing.
    in_vain: u32,
}

impl Released {
    /// The first strokes are released, and the order of the others is not known yet.
    pub const fn first(legs: usize) -> Self {
        Self { legs, rounds: 0, in_vain: 0 }
    }

    /// Releases some more strokes of `tour`, so that the order of those behind them can be
    /// improved. `None` if that does not pay any more: the order then stays as it is. The last
    /// step of the computation has changed the report of the order from `before` to `after`; before
    /// the first one there is none, and `before` does not count.
    pub fn more<I: Index>(
        self,
        drawing: Drawing<'_, I>,
        tour: &[Leg<I>],
        options: Options,
        time: StrokeTime,
        [before, after]: [Report; 2],
    ) -> Option<Self> {
        let is_in_vain = self.rounds > 0 && before == after;
        let in_vain = if is_in_vain { self.in_vain + 1 } else { 0 };
        let is_auto = matches!(options.effort, Effort::Auto(_));
        if !is_auto || self.rounds == MOST_ROUNDS || in_vain == MOST_IN_VAIN {
            return None;
        }
        let (released, rest) = tour.split_at_checked(self.legs)?;
        let legs = released.len() + busy_legs(drawing, rest, time)?;
        Some(Self { legs, rounds: self.rounds + 1, in_vain })
    }
}

/// Returns how many of these legs are drawn for [`BUSY_MILLISECONDS`]. They are whole strokes.
/// `None` if no strokes are left behind them, or if several pens draw the legs.
fn busy_legs<I: Index>(
    drawing: Drawing<'_, I>,
    legs: &[Leg<I>],
    time: StrokeTime,
) -> Option<usize> {
    let (mut strokes, mut drawn, mut at, mut pen) = (0, 0, None, None);
    let mut busy = None;
    for (index, leg) in legs.iter().enumerate() {
        let segment = drawing.segments.get(leg.segment())?;
        if pen.replace(segment.pen()).is_some_and(|pen| pen != segment.pen()) {
            return None;
        }
        if busy.is_some() {
            continue;
        }
        let [from, to] = ends(segment, *leg);
        if at != Some(from) {
            if time.milliseconds(strokes, drawn) >= BUSY_MILLISECONDS {
                busy = Some(index);
            }
            strokes += 1;
        }
        at = Some(to);
        let [from, to] = [from, to].map(|point| drawing.points.get(point.get()).copied());
        drawn += from.zip(to).map_or(0, |(from, to)| u64::from(length(from, to)));
    }
    busy
}

/// Improves the order `rest` of the strokes behind those of `drawn`, which [`Released::more`] has
/// released. All legs belong to one pen. Returns the report of the whole drawing, which was
/// `report`; it stays the same if nothing shorter was found or if there is too little memory.
///
/// # Errors
/// [`OrderError::Aborted`]. The contents of `rest` are then unspecified.
pub fn improve_rest<I: Index>(
    drawing: Drawing<'_, I>,
    drawn: &[Leg<I>],
    report: Report,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    rest: &mut [Leg<I>],
) -> Result<Report, OrderError> {
    match improve_legs(drawing, drawn, options, scratch, cancel, rest) {
        Err(OrderError::Scratch(_)) => Ok(report),
        Err(error) => Err(error),
        Ok(()) => Ok(measure_all(drawing, drawn, rest, options, report)),
    }
}

/// Carries out [`improve_rest`].
///
/// # Errors
/// [`OrderError::Scratch`], before `rest` is changed, and [`OrderError::Aborted`].
fn improve_legs<I: Index>(
    drawing: Drawing<'_, I>,
    drawn: &[Leg<I>],
    options: Options,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    rest: &mut [Leg<I>],
) -> Result<(), OrderError> {
    let Effort::Auto(time_model) = options.effort else { return Ok(()) };
    let end = drawn.last().and_then(|leg| end_of(drawing, *leg));
    let first = rest.first().and_then(|leg| drawing.segments.get(leg.segment()));
    let (Some(end), Some(pen)) = (end, first.map(|segment| segment.pen())) else { return Ok(()) };
    // The rest becomes a drawing of its own, whose segments lie in the order that is improved.
    let segments: &mut [Segment<I>] = scratch.take(rest.len())?;
    let before: &mut [Leg<I>] = scratch.take(rest.len())?;
    before.copy_from_slice(rest); // as long as what was taken
    for (slot, leg) in segments.iter_mut().zip(rest.iter()) {
        let Some(segment) = drawing.segments.get(leg.segment()) else { return Ok(()) };
        let [from, to] = ends(segment, *leg);
        *slot = Segment::new(from, to).inked(segment.line_type(), segment.pen());
    }
    let others = Drawing { points: drawing.points, segments: &*segments };
    let mut scratch = scratch.reborrow();
    let network = Network::of_strokes(others, pen, Anchor::new(end), &mut scratch)?;
    let route: &mut [Leg<I>] = scratch.take(network.chains().get())?;
    for (leg, chain) in route.iter_mut().zip(I::all()) {
        *leg = Leg::new(chain, false);
    }
    let units = u64::from(time_model.units_per_second) * WORK_MILLISECONDS / 1000;
    let mut work_budget = WorkBudget::new(cancel);
    improve_further(
        network,
        route,
        units,
        options.lift_cost,
        scratch.reborrow(),
        &mut work_budget,
    )?;
    network.expand(route, rest, pen, &mut scratch)?;
    for leg in rest.iter_mut() {
        if let Some(old) = before.get(leg.segment()) {
            *leg = if leg.reversed() { old.flipped() } else { *old };
        }
    }
    // The machine raises the pen behind what is released, and counts what follows as another
    // stroke. An order that goes on at the very point would count both as one.
    let end = |leg: Leg<I>| Some(ends(drawing.segments.get(leg.segment())?, leg)[1]);
    let [drawn_to, from] = [drawn.last().copied(), rest.first().map(|leg| leg.flipped())];
    if drawn_to.and_then(end) == from.and_then(end) {
        rest.copy_from_slice(before);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
