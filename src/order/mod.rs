//! In which order, and which way, the segments are drawn: odd points, pen-up matching, Eulerian
//! tour, joining of the separate parts.
//!
//! A pen draws a connected drawing without a lift if no more than two of its points are *odd*
//! (an odd number of segments meet there). Else the odd points are paired, and the pen is lifted
//! from one of a pair to the other (Harrison 5.6). The way of the data:
//!
//! 1. `network`: the segments of one pen become stations and chains;
//! 2. `matching` pairs the odd stations at the least length, or `greedy` in less memory;
//! 3. `euler` traces the strokes, part by part, nearest first;
//! 4. `improve` shortens the tour of several parts: `patch_cycles` joins them by their own moves, `exchange`
//!    changes moves while that helps (`search` finds how), `orient` turns strokes around.
//!
//! Call [`order`] with a [`Drawing`], [`Options`] and memory. Refused: a drawing whose segments name
//! points that are not there, too many segments, too little memory; the tour is then worth nothing.

mod cycle;
mod distances;
mod euler;
mod exchange;
mod greedy;
mod improve;
mod incidence;
mod matching;
mod patch_cycles;
mod metric;
mod neighbours;
mod network;
mod odd;
mod orient;
mod work_budget;
mod partition;
mod search;

pub use matching::scratch_bytes as matching_bytes;
pub use metric::length;

use crate::drawing::{Drawing, PAGE_LIMIT, PagePoint};
use crate::stage::{Cancel, OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use euler::Unused;
use improve::{Tour, improve};
use network::{Network, start_point};
use odd::OddPoints;
use work_budget::WorkBudget;

/// Points beyond so many have no number of their own: [`NONE`] is not one.
const POINT_LIMIT: usize = NONE as usize;
/// No station, no partner.
const NONE: u16 = u16::MAX;
/// In the place of a partner: a station of a part that has no odd point.
const EVEN_PART: u16 = u16::MAX - 1;

/// One segment of the tour and the way it is drawn. At most [`Leg::LIMIT`] segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Leg(u16);

impl Leg {
    /// As many segments can be numbered.
    pub const LIMIT: usize = (1 << 15) - 1;

    /// Segment `segment`, drawn from its `to` end if `reversed`.
    pub fn new(segment: u16, reversed: bool) -> Self {
        Self(segment << 1 | u16::from(reversed))
    }
    /// The number of the segment in the drawing.
    pub fn segment(self) -> usize {
        usize::from(self.0 >> 1)
    }
    /// Whether it is drawn from its `to` end to its `from` end.
    pub fn reversed(self) -> bool {
        self.0 & 1 != 0
    }
    /// The same segment drawn the other way.
    pub fn flipped(self) -> Self {
        Self(self.0 ^ 1)
    }
    fn code(self) -> u16 {
        self.0
    }
    fn from_code(code: u16) -> Self {
        Self(code)
    }
}

/// How the pen-up moves are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Exact where it fits in memory and is worth its time ([`EXACT_POINTS`]), else greedy.
    #[default]
    Auto,
    /// Greedy with regret (Harrison 5.10.1), then pair exchange.
    Greedy,
    /// Minimum-weight perfect matching.
    Exact,
}

/// [`Method::Auto`] pairs more odd points than this by greed. The exact pairing's work grows faster than their square: a
/// Cortex-M0+ would take minutes for 2000, and move the pen a hundredth less.
pub const EXACT_POINTS: u16 = 1000;

/// Whether the pen returns to where it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// From the first stroke's start to the last stroke's end.
    #[default]
    OpenPath,
    /// And back to the first stroke's start.
    ClosedCycle,
}

/// What the user may choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// How the pen-up moves are chosen.
    pub method: Method,
    /// Open or closed.
    pub shape: Shape,
    /// How much work may go into improving the first tour of separate parts, in distances for each
    /// move: a budget in work and not in time, so that every machine gives the same tour. With 0
    /// the parts are drawn nearest first.
    pub effort: u32,
    /// How much longer a way with the pen up may be for one lift less, in 1/256 steps, up to 2^30: each
    /// takes its time, and shows where it is within a stroke.
    pub lift: u32,
}

impl Default for Options {
    /// The exact open path where it fits, and as much effort as brings a page of some hundred strokes
    /// within 3 % of the best known.
    fn default() -> Self {
        Self { method: Method::default(), shape: Shape::default(), effort: 4000, lift: 0 }
    }
}

/// What came of it. Lengths in 1/256 steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Report {
    /// Points where an odd number of segments meet.
    pub odd_points: u32,
    /// Separate parts.
    pub components: u32,
    /// Length drawn.
    pub pen_down: u64,
    /// Length of the moves between strokes.
    pub pen_up: u64,
    /// Moves between strokes.
    pub lifts: u32,
    /// Lower bound of the pen-up length.
    pub bound: u64,
    /// Whether `pen_up` is proved the least.
    pub optimal: bool,
}

/// Why there is no order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The user gave up.
    Aborted,
    /// More segments than a tour can number ([`Leg::LIMIT`]).
    TooManySegments,
    /// The tour has not as many places as the drawing has segments.
    TourLength,
    /// This segment names a point that is not there or beyond [`PAGE_LIMIT`], or twice the same.
    BadSegment(u16),
}

/// Orders `drawing` into `tour` (as long as `drawing.segments`).
///
/// Each segment stands in the tour once; the pen goes up where a leg does not begin where the one
/// before it ended. The segments of one pen stand together, the lowest pen first; each pen after it
/// begins at that end of its path that is nearer.
///
/// # Errors
/// See [`OrderError`].
pub fn order(
    drawing: Drawing<'_>,
    options: Options,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    tour: &mut [Leg],
) -> Result<Report, OrderError> {
    let drawing =
        Drawing { points: drawing.points.get(..POINT_LIMIT).unwrap_or(drawing.points), ..drawing };
    check(drawing, tour.len())?;
    let mut work_budget = WorkBudget::new(cancel);
    let mut report = Report::default();
    let mut rest = &mut *tour;
    let pens = || drawing.segments.iter().map(|segment| segment.pen);
    // Of several pens none returns to its own beginning.
    let shape = if pens().min() == pens().max() { options.shape } else { Shape::OpenPath };
    let mut next_pen = pens().min();
    let mut pen_at = None;
    while let Some(pen) = next_pen {
        let count = pens().filter(|&other| other == pen).count();
        let (legs, others) = rest.split_at_mut(count);
        rest = others;
        let options = Options { shape, ..options };
        order_pen(drawing, pen, options, scratch.reborrow(), &mut work_budget, legs, &mut report)?;
        let place = |leg: Leg| drawing.points[usize::from(start_point(drawing.segments, leg))];
        if let (Some(at), Some(&first), Some(&last)) = (pen_at, legs.first(), legs.last())
            && length(at, place(last.flipped())) < length(at, place(first))
        {
            reverse(legs);
        }
        pen_at = legs.last().map(|last| place(last.flipped()));
        next_pen = pens().filter(|&other| other > pen).min();
    }
    measure(drawing, tour, options.shape, &mut report);
    Ok(report)
}

fn check(drawing: Drawing<'_>, tour_length: usize) -> Result<(), OrderError> {
    if drawing.segments.len() > Leg::LIMIT {
        return Err(OrderError::TooManySegments);
    }
    if tour_length != drawing.segments.len() {
        return Err(OrderError::TourLength);
    }
    let on_the_page = |point: u16| {
        let limits = -PAGE_LIMIT..=PAGE_LIMIT;
        let within = |place: &PagePoint| limits.contains(&place.x) && limits.contains(&place.y);
        drawing.points.get(usize::from(point)).is_some_and(within)
    };
    match (0..).zip(drawing.segments).find(|(_, segment)| {
        segment.from == segment.to || !on_the_page(segment.from) || !on_the_page(segment.to)
    }) {
        Some((number, _)) => Err(OrderError::BadSegment(number)),
        None => Ok(()),
    }
}

fn order_pen<'a>(
    drawing: Drawing<'a>,
    pen: u8,
    options: Options,
    mut scratch: Scratch<'a>,
    work_budget: &mut WorkBudget<'_>,
    tour: &mut [Leg],
    report: &mut Report,
) -> Result<(), OrderError> {
    work_budget.answer()?;
    let network = Network::new(drawing, pen, &mut scratch)?;
    work_budget.answer()?;
    let route: &mut [Leg] = scratch.take(usize::from(network.chains()))?;
    let bound = report.bound;
    {
        let mut scratch = scratch.reborrow();
        let mate: &mut [u16] = scratch.take(usize::from(network.stations()))?;
        let Parts { count: parts, odd: odd_parts } = mark_parts(network, scratch.reborrow(), mate)?;
        let odd_before = report.odd_points;
        work_budget.answer()?;
        let start = pair_odd(network, options, scratch.reborrow(), work_budget, mate, report)?;
        {
            let mut scratch = scratch.reborrow();
            let unused: &mut [u16] = scratch.take(mate.len())?;
            unused.copy_from_slice(mate);
            Unused::new(network, unused, &mut scratch)?.nearest_first(
                start,
                None,
                route,
                work_budget,
            )?;
        }
        report.components += parts;
        if parts > 1 && options.effort > 0 {
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
                lift: options.lift,
            };
            improve(network, tour, scratch, work_budget)?;
        }
    }
    turn(network, options.shape, route);
    network.expand(route, tour, pen, &mut scratch)?;
    Ok(())
}

/// How many parts there are, and how many of them have odd points.
struct Parts {
    count: u32,
    odd: u32,
}

/// Marks each station: an odd one by its own number, an even one by [`NONE`], or by [`EVEN_PART`] if
/// its part has no odd one.
fn mark_parts(
    network: Network<'_>,
    mut scratch: Scratch<'_>,
    marks: &mut [u16],
) -> Result<Parts, OutOfScratch> {
    let odd: &mut [u8] = scratch.take(marks.len())?;
    for code in 0..2 * network.chains() {
        odd[usize::from(network.start(Leg::from_code(code)))] ^= 1;
    }
    let lowest = network.parts(&mut scratch)?;
    marks.fill(EVEN_PART);
    for (&odd, &lowest) in odd.iter().zip(lowest.iter()) {
        if odd == 1 {
            marks[usize::from(lowest)] = NONE;
        }
    }
    let mut parts = Parts { count: 0, odd: 0 };
    for (station, (&odd, &lowest)) in (0..).zip(odd.iter().zip(lowest.iter())) {
        if lowest == station {
            parts.count += 1;
            parts.odd += u32::from(marks[usize::from(station)] == NONE);
        }
        // The lowest comes first, and its mark is asked for until the part's last station.
        marks[usize::from(station)] = marks[usize::from(lowest)];
        if odd == 1 && lowest != station {
            marks[usize::from(station)] = station;
        }
    }
    for (station, (&odd, &lowest)) in (0..).zip(odd.iter().zip(lowest.iter())) {
        if odd == 1 && lowest == station {
            marks[usize::from(station)] = station;
        }
    }
    Ok(parts)
}

/// Pairs the odd stations of `mate` (marked by themselves). Returns where an open path begins.
fn pair_odd(
    network: Network<'_>,
    options: Options,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [u16],
    report: &mut Report,
) -> Result<Option<u16>, OrderError> {
    let odd_stations = || (0..).zip(mate.iter()).filter(|&(station, &mark)| station == mark);
    let stations: &mut [u16] = scratch.take(odd_stations().count())?;
    for (place, (station, _)) in stations.iter_mut().zip(odd_stations()) {
        *place = station;
    }
    work_budget.sort(stations, |&station| (network.place(station).x, station))?;
    let odd = OddPoints::new(network, stations, options.shape == Shape::OpenPath);
    report.odd_points += u32::from(odd.real_count());
    let partners: &mut [u16] = scratch.take(usize::from(odd.count()))?;
    report.bound += pair_points(&odd, options.method, scratch, work_budget, partners)?;
    for (&station, &partner) in stations.iter().zip(partners.iter()) {
        mate[usize::from(station)] = odd.station(partner).unwrap_or(NONE);
    }
    if !odd.has_free_ends() {
        return Ok(None);
    }
    let ends = odd.free_ends().map(|end| partners[usize::from(end)]);
    let ends = ends.into_iter().filter_map(|end| odd.station(end));
    Ok(ends.min_by_key(|&station| (network.place(station).x, station)))
}

/// Pairs odd points. Returns a lower bound of the length of their moves in 1/256 steps, 0 if none is known.
#[inline(never)] // Its frame is gone before the tour is improved; and its cycles can be counted.
fn pair_points(
    odd: &OddPoints<'_>,
    method: Method,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    partners: &mut [u16],
) -> Result<u64, OrderError> {
    let exact = match method {
        Method::Greedy => false,
        Method::Exact => true,
        Method::Auto => {
            let fits = matching::scratch_bytes(partners.len()) <= scratch.available_bytes();
            fits && odd.real_count() <= EXACT_POINTS
        }
    };
    if exact {
        return matching::pair(odd, scratch, work_budget, partners);
    }
    greedy::pair(odd, &mut scratch, work_budget, partners)?;
    Ok(0)
}

/// Makes a closed cycle begin at the lowest x, and an open path at the lower of its ends.
fn turn(network: Network<'_>, shape: Shape, route: &mut [Leg]) {
    let x_of = |leg: &Leg| network.place(network.start(*leg)).x;
    match shape {
        Shape::ClosedCycle => {
            let first = (0..route.len()).min_by_key(|&index| x_of(&route[index]));
            route.rotate_left(first.unwrap_or(0));
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

/// The same tour from its end to its start.
fn reverse(tour: &mut [Leg]) {
    tour.reverse();
    for leg in tour {
        *leg = leg.flipped();
    }
}

/// Measures `tour` into `report`.
fn measure(drawing: Drawing<'_>, tour: &[Leg], shape: Shape, report: &mut Report) {
    let place = |leg: Leg| drawing.points[usize::from(start_point(drawing.segments, leg))];
    let closing = match shape {
        Shape::OpenPath => None,
        Shape::ClosedCycle => tour.first(),
    };
    let mut pen = tour.first().map(|&leg| place(leg)).unwrap_or_default();
    for &leg in tour {
        report.lifts += u32::from(place(leg) != pen);
        report.pen_up += u64::from(length(pen, place(leg)));
        report.pen_down += u64::from(length(place(leg), place(leg.flipped())));
        pen = place(leg.flipped());
    }
    if let Some(&leg) = closing {
        report.lifts += u32::from(place(leg) != pen);
        report.pen_up += u64::from(length(pen, place(leg)));
    }
    report.optimal = report.pen_up == report.bound;
}
