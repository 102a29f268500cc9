//! Orders the segments of a drawing and chooses the direction of each, so that the pen travels as
//! little as possible while it is up.
//!
//! A pen draws a connected drawing without a lift if at most two of its points are *odd* (an odd
//! number of segments meet there). Otherwise the odd points are paired, and the pen moves, lifted,
//! from one point of a pair to the other (Harrison 5.6). The steps are:
//!
//! 1. `network` turns the segments of one pen into a graph of stations and chains.
//! 2. `pairing` has the odd stations paired: `matching` does so with the least total length,
//!    `greedy` in less memory, without that guarantee; `remaining` finds for it, and for step 3,
//!    what is near.
//! 3. `euler` traces the strokes along Eulerian tours, one connected part after another, the
//!    nearest part first.
//! 4. `improve` shortens the tour of several parts: `patch_cycles` changes pen-up moves so that
//!    they join the parts, `exchange` exchanges moves while that helps (`search` finds the
//!    exchanges), `orient` chooses the direction of each stroke, and `kicks` changes the tour at
//!    random where nothing else helps any more. On a computer, all cores may share the last of
//!    these (`improve::subproblems`).
//!
//! Where the pen begins while this is done, `first` chooses the strokes that it draws meanwhile.
//!
//! Call [`order`] with a [`Drawing`], [`Options`] and working memory. It refuses a drawing whose
//! segments name points that do not exist, too many segments, and too little memory. On an error
//! the contents of the tour are unspecified.

mod cells;
mod cycle;
mod distances;
mod euler;
mod exchange;
#[cfg(feature = "early-ink")]
mod first;
#[cfg(feature = "early-ink")]
mod later;
mod greedy;
mod improve;
mod incidence;
mod kicks;
mod matching;
mod patch_cycles;
mod metric;
mod neighbours;
mod network;
mod odd;
mod orient;
mod pairing;
mod work_budget;
mod partition;
mod remaining;
mod search;

#[cfg(feature = "early-ink")]
pub use first::{FirstStrokes, StrokeTime, choose_first, first_legs, order_rest};
#[cfg(feature = "early-ink")]
pub use later::{Released, improve_rest};
pub use matching::scratch_bytes as matching_bytes;
pub use metric::length;
use metric::measure;
#[cfg(feature = "tiles")]
pub(crate) use metric::{true_length, y_in_x};

use crate::array::rotate_left;
use crate::drawing::{Drawing, PAGE_LIMIT, PagePoint, StepsPerMillimetre};
use crate::index::Index;
use crate::stage::{Cancel, OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use euler::Unused;
use improve::{Tour, improve};
use network::{Anchor, Network, start_point};
use pairing::pair_odd;
use work_budget::WorkBudget;

/// Returns the value that marks, in place of a partner, a station of a part that has no odd point.
/// [`Index::NONE`] in that place means that there is no partner.
fn even_part<I: Index>() -> I {
    I::NONE - I::ONE
}

/// One segment of the tour and the direction in which it is drawn. Within this module it may stand
/// for a chain (a run of segments) and its direction as well. There are at most [`Leg::LIMIT`]
/// segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Leg<I = u16>(I);

impl<I: Index> Leg<I> {
    /// The greatest number of segments that can be numbered: each may have two ends of its own, and
    /// the order adds the two ends of the tour to these points.
    pub const LIMIT: usize = (1 << (I::BITS - 1)) - 2;

    /// Makes the leg of segment `segment`, which is drawn from its `to` end if `reversed`.
    pub fn new(segment: I, reversed: bool) -> Self {
        Self(segment << 1 | if reversed { I::ONE } else { I::ZERO })
    }
    /// Returns the number of the segment in the drawing.
    pub fn segment(self) -> usize {
        (self.0 >> 1).get()
    }
    /// Whether the segment is drawn from its `to` end to its `from` end.
    pub fn reversed(self) -> bool {
        self.0 & I::ONE != I::ZERO
    }
    /// Returns the same segment, drawn in the opposite direction.
    pub fn flipped(self) -> Self {
        Self(self.0 ^ I::ONE)
    }
    /// Returns the leg as a number: twice the segment's number, plus 1 if it is reversed.
    fn code(self) -> I {
        self.0
    }
    /// Makes the leg whose [`Leg::code`] this is.
    fn from_code(code: I) -> Self {
        Self(code)
    }
}

/// The method that pairs the odd points, and so chooses the pen-up moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Exact if it fits in memory and there are at most [`EXACT_POINTS`] odd points, otherwise
    /// greedy.
    #[default]
    Auto,
    /// Greedy with regret (Harrison 5.10.1), followed by pair exchange.
    Greedy,
    /// The pairing with the least total length (minimum-weight perfect matching).
    Exact,
}

/// The greatest number of odd points of one pen that [`Method::Auto`] pairs exactly; more are
/// paired by the greedy method. The work of the exact method grows faster than the square of the
/// number of points: a Cortex-M0+ would take minutes for 2000 points, to make the pen-up travel one
/// hundredth shorter.
pub const EXACT_POINTS: u32 = 1000;

/// Whether the pen, after it has drawn all strokes, returns to where it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// The path goes from the start of the first stroke to the end of the last.
    #[default]
    OpenPath,
    /// After the last stroke the pen returns to the start of the first.
    ClosedCycle,
}

/// How long pen-up travel and the search for a better order take. These durations decide whether a
/// shorter path is worth the work of finding it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeModel {
    /// The greatest speed with the pen up, in steps per second, below 2^22.
    pub speed: u32,
    /// The greatest acceleration, in steps per second squared, below 2^27.
    pub acceleration: u32,
    /// The units of work (distance computations) that count as one second.
    pub units_per_second: u32,
}

impl TimeModel {
    /// The units of work that count as one second on every board, and wherever a board's order is
    /// shown. The Pico's core, which takes 417 cycles for a unit on text300 and 534 on lattice7
    /// (`cargo xtask bench --board pico`), does this many at 125 MHz.
    pub const BOARD: u32 = 250_000;
    /// The units that count as one second where a computer computes for a plotter. They are more
    /// than it does in that time, because the plotter draws meanwhile. With this many or more, and
    /// with the feature `threads`, all cores of the computer share the work on a long tour. The
    /// tour does not depend on their number.
    pub const COMPUTER: u32 = 30_000_000;
}

impl Default for TimeModel {
    /// The model of a board with the default settings of its machine: 100 mm/s and 800 mm/s², with
    /// 80 steps to the millimetre.
    fn default() -> Self {
        Self { speed: 8000, acceleration: 64_000, units_per_second: Self::BOARD }
    }
}

/// The work that may be spent on improving the first tour of several parts. It is counted in
/// distance computations, not in time, so that every machine gives the same tour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// As much as pays: until a further second of work saves less than a second of drawing,
    /// according to this model. What is saved is taken from the moves with the pen up, each lift at
    /// its cost ([`Options::lift_cost`]).
    Auto(TimeModel),
    /// So many distance computations for each pen-up move. With 0 the tour is not improved: the
    /// parts are drawn nearest first.
    Units(u32),
}

impl Default for Effort {
    fn default() -> Self {
        Self::Auto(TimeModel::default())
    }
}

/// The settings by which the user may influence the order of the strokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// The method that pairs the odd points.
    pub method: Method,
    /// Whether the path is open or closed. A drawing with several pens has an open path for each
    /// pen.
    pub shape: Shape,
    /// The work that may be spent on improving the first tour of several parts.
    pub effort: Effort,
    /// Extra pen-up travel that is accepted to save one pen lift, in 1/256 steps, at most 2^30.
    /// Each lift takes time, and leaves a visible mark if it lies within a stroke.
    pub lift_cost: u32,
    /// The steps per millimetre, for the [`Report`] alone: the order takes those of y for as long
    /// as those of x. Both are as long if they are 0.
    pub steps: StepsPerMillimetre,
}

/// The measures of the resulting tour. Lengths are in 1/256 steps of x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Report {
    /// Number of points where an odd number of segments meet, added over all pens.
    pub odd_points: u32,
    /// Number of connected parts, added over all pens.
    pub components: u32,
    /// Total length drawn with the pen down.
    pub pen_down: u64,
    /// Total length of the moves between strokes, with the pen up.
    pub pen_up: u64,
    /// The number of moves between strokes, in which the pen is up.
    pub lifts: u32,
    /// Lower bound of the pen-up length; 0 if none is known, as where the steps of x and y differ.
    pub bound: u64,
    /// Whether `pen_up` is proved to be the least possible: it equals `bound`.
    pub optimal: bool,
    /// Whether a move with the pen up, which `lifts` and `pen_up` contain, leads from the end of
    /// the tour back to its start.
    pub returns: bool,
}

/// The reasons why a drawing cannot be ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderError {
    /// There is not enough working memory.
    Scratch(OutOfScratch),
    /// The user aborted the job.
    Aborted,
    /// The drawing has more segments than a tour can number ([`Leg::LIMIT`]).
    TooManySegments,
    /// The tour's length is not the number of segments in the drawing.
    TourLength,
    /// This segment names a point that does not exist or lies beyond [`PAGE_LIMIT`], or both its
    /// ends are the same point.
    BadSegment(u32),
}

/// Orders the segments of `drawing` and writes the result to `tour`, which must be as long as
/// `drawing.segments`.
///
/// Each segment occurs in the tour once. The pen is lifted wherever a leg does not begin where the
/// leg before it ended. The segments of one pen follow each other, those of the lowest pen first.
/// Each later pen begins at that end of its path that is nearer to where the pen before it ended.
///
/// # Errors
/// See [`OrderError`].
pub fn order<I: Index>(
    drawing: Drawing<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    tour: &mut [Leg<I>],
) -> Result<Report, OrderError> {
    let drawing = Drawing {
        points: drawing.points.get(..I::NONE.get()).unwrap_or(drawing.points),
        ..drawing
    };
    check(drawing, tour.len())?;
    let pens = || drawing.segments.iter().map(|segment| segment.pen());
    // With several pens, none returns to its own start.
    let shape = if pens().min() == pens().max() { options.shape } else { Shape::OpenPath };
    let options = Options { shape, ..options };
    let mut report = Report::default();
    order_pens(drawing, options, Anchor::default(), scratch, cancel, tour, &mut report)?;
    measure(drawing, tour, options, &mut report);
    Ok(report)
}

/// Orders the segments of all pens, which must have been checked, and adds to `report` what is not
/// measured in the end. The pen comes from `anchor`. Only the path of a single pen may be closed.
#[cfg_attr(feature = "early-ink", inline(never))] // Its three callers share one copy of the code.
#[cfg_attr(not(feature = "early-ink"), inline(always))]
fn order_pens<I: Index>(
    drawing: Drawing<'_, I>,
    options: Options,
    anchor: Anchor,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    tour: &mut [Leg<I>],
    report: &mut Report,
) -> Result<(), OrderError> {
    let mut work_budget = WorkBudget::new(cancel);
    let mut rest = &mut *tour;
    let pens = || drawing.segments.iter().map(|segment| segment.pen());
    let mut next_pen = pens().min();
    let mut pen_at = anchor.place();
    let mut anchor = anchor;
    while let Some(pen) = next_pen {
        let count = pens().filter(|&other| other == pen).count();
        // Each segment has one pen, so all counts together are the length of `tour`.
        let (legs, others) = rest.split_at_mut(count);
        rest = others;
        let scratch = scratch.reborrow();
        let from = core::mem::take(&mut anchor);
        order_pen(drawing, pen, options, from, scratch, &mut work_budget, legs, report)?;
        // `expand` has written all of these legs: the route has each chain, and each segment of the
        // pen lies in a chain. They name segments of `drawing`, and `check` has seen their points.
        let position = |leg: Leg<I>| drawing.points[start_point(drawing.segments, leg).get()];
        if let (Some(at), Some(&first), Some(&last)) = (pen_at, legs.first(), legs.last())
            && length(at, position(last.flipped())) < length(at, position(first))
        {
            reverse(legs);
        }
        pen_at = legs.last().map(|last| position(last.flipped()));
        next_pen = pens().filter(|&other| other > pen).min();
    }
    Ok(())
}

/// Checks that the tour has the right length and that every segment joins two different points of
/// the page.
fn check<I: Index>(drawing: Drawing<'_, I>, tour_length: usize) -> Result<(), OrderError> {
    if drawing.segments.len() > Leg::<I>::LIMIT {
        return Err(OrderError::TooManySegments);
    }
    if tour_length != drawing.segments.len() {
        return Err(OrderError::TourLength);
    }
    let on_the_page = |point: I| {
        let limits = -PAGE_LIMIT..=PAGE_LIMIT;
        let within =
            |position: &PagePoint| limits.contains(&position.x) && limits.contains(&position.y);
        drawing.points.get(point.get()).is_some_and(within)
    };
    match I::all().zip(drawing.segments).find(|(_, segment)| {
        segment.from() == segment.to() || !on_the_page(segment.from()) || !on_the_page(segment.to())
    }) {
        Some((number, _)) => Err(OrderError::BadSegment(number.into())),
        None => Ok(()),
    }
}

/// Decides in which order and direction one pen draws its segments. Writes this to `tour`, and adds
/// its measures to `report`.
#[inline(never)] // Inlined in its only caller, the code would be larger.
#[allow(clippy::too_many_arguments, reason = "they are what a pen's order depends on")]
fn order_pen<'a, I: Index>(
    drawing: Drawing<'a, I>,
    pen: u8,
    options: Options,
    anchor: Anchor,
    mut scratch: Scratch<'a>,
    work_budget: &mut WorkBudget<'_>,
    tour: &mut [Leg<I>],
    report: &mut Report,
) -> Result<(), OrderError> {
    work_budget.answer()?;
    let network = Network::new(drawing, pen, anchor, &mut scratch)?;
    work_budget.answer()?;
    let route: &mut [Leg<I>] = scratch.take(network.chains().get())?;
    let bound = report.bound;
    {
        let mut scratch = scratch.reborrow();
        let mate: &mut [I] = scratch.take(network.stations().get())?;
        let Parts { count: parts, odd: odd_parts } = mark_parts(network, scratch.reborrow(), mate)?;
        let odd_before = report.odd_points;
        work_budget.answer()?;
        let start = pair_odd(network, options, scratch.reborrow(), work_budget, mate, report)?;
        {
            let mut scratch = scratch.reborrow();
            let unused: &mut [I] = scratch.take(mate.len())?;
            unused.copy_from_slice(mate); // as long as what was taken
            Unused::new(network, unused, &mut scratch)?.nearest_first(
                start,
                None,
                route,
                work_budget,
            )?;
        }
        report.components += parts;
        if parts > 1 && options.effort != Effort::Units(0) {
            let open = options.shape == Shape::OpenPath;
            let strokes_only = report.odd_points - odd_before == 2 * odd_parts;
            let bound = report.bound - bound;
            let tour = Tour {
                route,
                open,
                bound,
                mate,
                start,
                strokes_only,
                effort: options.effort,
                lift_cost: options.lift_cost,
            };
            improve(network, tour, scratch, work_budget)?;
        }
    }
    if anchor.place().is_none() {
        turn(network, options.shape, route);
    }
    network.expand(route, tour, pen, &mut scratch)?;
    Ok(())
}

/// What [`mark_parts`] finds out about the connected parts of a drawing.
struct Parts {
    /// The number of connected parts of the drawing.
    count: u32,
    /// The number of those that have odd points.
    odd: u32,
}

/// Marks each station. An odd station is marked by its own number. An even one is marked by
/// [`Index::NONE`], or by [`even_part`] if its part has no odd station.
fn mark_parts<I: Index>(
    network: Network<'_, I>,
    mut scratch: Scratch<'_>,
    marks: &mut [I],
) -> Result<Parts, OutOfScratch> {
    // No index below can fail: `marks`, `odd` and `lowest` have an entry for each station, chains
    // begin at stations, and `lowest` holds stations.
    let odd: &mut [u8] = scratch.take(marks.len())?;
    for code in I::below(network.chains() << 1) {
        odd[network.start(Leg::from_code(code)).get()] ^= 1;
    }
    let lowest = network.parts(&mut scratch)?;
    marks.fill(even_part());
    for (&odd, &lowest) in odd.iter().zip(lowest.iter()) {
        if odd == 1 {
            marks[lowest.get()] = I::NONE;
        }
    }
    let mut parts = Parts { count: 0, odd: 0 };
    for (station, (&odd, &lowest)) in I::all().zip(odd.iter().zip(lowest.iter())) {
        if lowest == station {
            parts.count += 1;
            parts.odd += u32::from(marks[station.get()] == I::NONE);
        }
        // The lowest station of a part comes first. Its mark must stay until the last station of
        // the part has read it, so it gets its own number only in the next loop.
        marks[station.get()] = marks[lowest.get()];
        if odd == 1 && lowest != station {
            marks[station.get()] = station;
        }
    }
    for (station, (&odd, &lowest)) in I::all().zip(odd.iter().zip(lowest.iter())) {
        if odd == 1 && lowest == station {
            marks[station.get()] = station;
        }
    }
    Ok(parts)
}

/// Makes a closed cycle begin at its lowest x, and an open path at that of its ends that has the
/// lower x.
fn turn<I: Index>(network: Network<'_, I>, shape: Shape, route: &mut [Leg<I>]) {
    let x_of = |leg: &Leg<I>| network.position(network.start(*leg)).x;
    match shape {
        Shape::ClosedCycle => {
            // `index` counts to the length of the route.
            let first = (0..route.len()).min_by_key(|&index| x_of(&route[index]));
            rotate_left(route, first.unwrap_or(0));
        }
        Shape::OpenPath => {
            if let (Some(first), Some(last)) = (route.first(), route.last())
                && x_of(&last.flipped()) < x_of(first)
            {
                reverse(route);
            }
        }
    }
}

/// Reverses the tour, so that it goes from its end to its start.
fn reverse<I: Index>(tour: &mut [Leg<I>]) {
    crate::array::reverse(tour);
    for leg in tour {
        *leg = leg.flipped();
    }
}

#[cfg(test)]
mod tests;
