//! Chooses the strokes with which the pen begins before the order of the others is known.
//!
//! To order strokes takes seconds on a small core. So [`choose_first`] takes a few connected parts
//! of the drawing that lie together at its left end, orders their strokes, which takes no time, and
//! puts them to the front. They are as many as the pen is busy with while the rest is ordered, as
//! far as that can be told from the number of odd points. The choice depends on the drawing and on
//! settings alone, never on a clock, and so it is the same on every machine.
//!
//! [`order_rest`] then orders the rest. Its path begins where the first strokes end.
//!
//! The first strokes lie together because the path of the rest is then hardly longer than before:
//! it need not come back to where they are.
//!
//! No strokes are chosen if the order takes too little time to be worth it, or if the parts at the
//! left end are too large to be ordered at once.

use super::metric::length;
use super::network::{Anchor, pen_segments};
use super::partition::Partition;
use super::{
    EXACT_POINTS, Effort, Leg, Options, OrderError, Report, Shape, check, measure, order_pens,
};
use crate::array::MapEach;
use crate::drawing::{Drawing, PagePoint, Segment};
use crate::index::Index;
use crate::stage::{Cancel, OutOfScratch, Scratch};

/// No strokes are chosen if the order takes less than this, in milliseconds: the pen does not wait
/// long then, and nothing of the order is given away.
const LEAST_MILLISECONDS: u64 = 1000;
/// No more strokes than these are chosen. They are ordered before the pen begins.
const MOST_STROKES: u32 = 48;

/// The square of the number of odd points that a board's core pairs exactly in a millisecond. This
/// and the next two are a little less than what was measured on the Pico (`docs/performance.md`).
const SQUARED_POINTS_A_MILLISECOND: u64 = 120;
/// The microseconds of the greedy pairing, for each odd point.
const GREEDY_MICROSECONDS: u64 = 600;
/// The microseconds of everything else in the order, for each odd point.
const POINT_MICROSECONDS: u64 = 1500;

/// The time in milliseconds by which the pen is busy longer than the order is estimated to take.
/// The order is improved during that time, so it costs no time.
const SPARE_MILLISECONDS: u64 = 4000;

/// The choice of the strokes that are drawn first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FirstStrokes {
    /// The number of their segments. They are the first ones of the drawing, each of them drawn
    /// from its `from` end, in this order.
    pub segments: usize,
    /// The number of points where an odd number of them meet.
    pub odd_points: u32,
    /// The number of connected parts that they are.
    pub parts: u32,
    /// About how many strokes are left besides them.
    pub strokes_left: u32,
    /// The milliseconds for which the pen is busy with them beyond those that the order takes
    /// anyway.
    pub spare_milliseconds: u32,
}

/// Estimates how long the pen is busy with strokes.
pub trait StrokeDurations {
    /// Returns the milliseconds that this many strokes take, without the moves between them. Their
    /// total length is given in 1/256 steps.
    fn milliseconds(&self, strokes: u32, length: u64) -> u64;
}

/// The connected parts of what a pen draws. A part is known by its lowest point.
struct Parts<'s, I> {
    /// For each point its part.
    part: &'s mut [I],
    /// For each part the distance of its farthest point from where the choice begins, in 1/256
    /// steps, and [`CHOSEN`] once it is chosen.
    far: &'s mut [u32],
    /// For each part, the length of its segments in 1/256 steps.
    length: &'s mut [u32],
    /// For each part, the number of its odd points.
    odd: &'s mut [I],
    /// The point furthest to the left, where the choice begins.
    corner: PagePoint,
}

/// The value in place of a distance that means that the part has been chosen.
const CHOSEN: u32 = u32::MAX;

impl<'s, I: Index> Parts<'s, I> {
    /// Finds the parts of a pen's segments. `is_odd` tells for each point whether an odd number of
    /// them meet there.
    fn new(
        drawing: Drawing<'_, I>,
        pen: u8,
        is_odd: &[u8],
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let count = drawing.points.len();
        let (part, odd) = (scratch.take::<I>(count)?, scratch.take::<I>(count)?);
        let (far, lengths) = (scratch.take::<u32>(count)?, scratch.take::<u32>(count)?);
        let mut parts = Partition::singletons(part);
        for (_, segment) in pen_segments(drawing.segments, pen) {
            parts.unite(segment.from(), segment.to());
        }
        parts.flatten();
        let ends = |segment: &Segment<I>| {
            let numbers = [segment.from(), segment.to()];
            numbers.map_each(|point| drawing.points.get(point.get()).copied().unwrap_or_default())
        };
        let corner = pen_segments(drawing.segments, pen).flat_map(|(_, segment)| ends(segment));
        let corner = corner.min().unwrap_or_default();
        for (_, segment) in pen_segments(drawing.segments, pen) {
            let part = part.get(segment.from().get()).map_or(usize::MAX, |part| part.get());
            let [from, to] = ends(segment);
            if let Some((far, sum)) = far.get_mut(part).zip(lengths.get_mut(part)) {
                *far = (*far).max(length(corner, from)).max(length(corner, to));
                *sum = sum.saturating_add(length(from, to));
            }
        }
        for (&is_odd, part) in is_odd.iter().zip(part.iter()) {
            if let Some(odd) = odd.get_mut(part.get()).filter(|_| is_odd == 1) {
                *odd += I::ONE;
            }
        }
        Ok(Self { part, far, length: lengths, odd, corner })
    }

    /// Returns the part that lies nearest as a whole and is not chosen, with the number of its odd
    /// points and their length in 1/256 steps.
    fn nearest(&self) -> Option<(usize, u32, u64)> {
        let left = self.far.iter().zip(self.length.iter()).enumerate();
        let left = left.filter(|&(_, (&far, &length))| far < CHOSEN && length > 0);
        let (part, (_, &length)) = left.min_by_key(|&(part, (&far, _))| (far, part))?;
        Some((part, self.odd.get(part).copied()?.into(), length.into()))
    }

    /// Whether a segment of the pen belongs to a part that has been chosen.
    fn has_chosen(&self, segment: &Segment<I>) -> bool {
        let part = self.part.get(segment.from().get());
        part.and_then(|part| self.far.get(part.get())) == Some(&CHOSEN)
    }
}

/// Marks with 1 the points where an odd number of a pen's segments meet, and others with 0. Returns
/// the number of odd points.
fn mark_odd<I: Index>(drawing: Drawing<'_, I>, pen: u8, is_odd: &mut [u8]) -> u64 {
    is_odd.fill(0);
    for (_, segment) in pen_segments(drawing.segments, pen) {
        for point in [segment.from(), segment.to()] {
            if let Some(is_odd) = is_odd.get_mut(point.get()) {
                *is_odd ^= 1;
            }
        }
    }
    is_odd.iter().map(|&is_odd| u64::from(is_odd)).sum()
}

/// Returns about how many milliseconds a board's core takes to order the strokes of all pens, and
/// the number of odd points.
fn milliseconds_to_order<I: Index>(
    drawing: Drawing<'_, I>,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<(u64, u64), OrderError> {
    let is_odd: &mut [u8] = scratch.take(drawing.points.len())?;
    let pens = || drawing.segments.iter().map(|segment| segment.pen());
    let mut next = pens().min();
    let (mut milliseconds, mut all) = (0, 0);
    while let Some(pen) = next {
        cancel.check()?;
        let odd = mark_odd(drawing, pen, is_odd);
        all += odd;
        let paired = if odd <= u64::from(EXACT_POINTS) {
            odd * odd / SQUARED_POINTS_A_MILLISECOND
        } else {
            odd * GREEDY_MICROSECONDS / 1000
        };
        milliseconds += paired + odd * POINT_MICROSECONDS / 1000;
        next = pens().filter(|&other| other > pen).min();
    }
    Ok((milliseconds, all))
}

/// Chooses strokes that are drawn first, orders them, and puts their segments to the front of
/// `segments`, in the order and the directions in which they are drawn. The others may change
/// places. No stroke is chosen where that does not pay: see the module.
///
/// # Errors
/// [`OrderError::Aborted`].
pub fn choose_first<I: Index>(
    points: &[PagePoint],
    segments: &mut [Segment<I>],
    options: Options,
    meanwhile: &dyn StrokeDurations,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<FirstStrokes, OrderError> {
    match choose(points, segments, options, meanwhile, scratch, cancel) {
        // Where memory is short, the whole order is computed before the pen begins.
        Err(OrderError::Scratch(_)) => Ok(FirstStrokes::default()),
        chosen => chosen,
    }
}

/// Carries out [`choose_first`].
///
/// # Errors
/// [`OrderError::Scratch`] and [`OrderError::Aborted`].
fn choose<I: Index>(
    points: &[PagePoint],
    segments: &mut [Segment<I>],
    options: Options,
    meanwhile: &dyn StrokeDurations,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<FirstStrokes, OrderError> {
    let drawing = Drawing { points, segments: &*segments };
    let (order_takes, all_odd) = milliseconds_to_order(drawing, scratch.reborrow(), cancel)?;
    let pen = segments.iter().map(|segment| segment.pen()).min();
    let Some(pen) = pen.filter(|_| order_takes >= LEAST_MILLISECONDS) else {
        return Ok(FirstStrokes::default());
    };
    let mut first = FirstStrokes::default();
    let corner;
    let (mut odd, mut strokes, mut milliseconds) = (0, 0, 0);
    {
        let mut scratch = scratch.reborrow();
        let is_odd: &mut [u8] = scratch.take(points.len())?;
        let drawing = Drawing { points, segments: &*segments };
        mark_odd(drawing, pen, is_odd);
        let parts = Parts::new(drawing, pen, is_odd, &mut scratch)?;
        corner = parts.corner;
        while milliseconds < order_takes + SPARE_MILLISECONDS {
            cancel.check()?;
            let Some((part, odd_points, length)) = parts.nearest() else { break };
            let of_part = (odd_points / 2).max(1);
            if strokes + of_part > MOST_STROKES {
                break;
            }
            if let Some(far) = parts.far.get_mut(part) {
                *far = CHOSEN;
            }
            milliseconds += meanwhile.milliseconds(of_part, length);
            strokes += of_part;
            odd += odd_points;
            first.parts += 1;
        }
        for index in 0..segments.len() {
            let is_chosen =
                |segment: &&Segment<I>| segment.pen() == pen && parts.has_chosen(segment);
            if segments.get(index).filter(is_chosen).is_some() {
                segments.swap(first.segments, index);
                first.segments += 1;
            }
        }
    }
    let (chosen, _) = segments.split_at_mut(first.segments);
    arrange(points, chosen, corner, options, scratch, cancel)?;
    let spare = milliseconds.saturating_sub(order_takes);
    first.spare_milliseconds = u32::try_from(spare).unwrap_or(u32::MAX);
    first.odd_points = odd;
    let strokes_left = all_odd.saturating_sub(odd.into()) / 2;
    first.strokes_left = u32::try_from(strokes_left).unwrap_or(u32::MAX).max(1);
    Ok(first)
}

/// Orders the segments that are drawn first, and puts them into that order, each from its `from`
/// end. They begin near `corner`, where the choice began, and so where the pen is.
fn arrange<I: Index>(
    points: &[PagePoint],
    segments: &mut [Segment<I>],
    corner: PagePoint,
    options: Options,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<(), OrderError> {
    let tour: &mut [Leg<I>] = scratch.take(segments.len())?;
    let arranged: &mut [Segment<I>] = scratch.take(segments.len())?;
    let drawing = Drawing { points, segments: &*segments };
    let options = Options { shape: Shape::OpenPath, ..options };
    let mut report = Report::default();
    let anchor = Anchor::new(corner, 0);
    order_pens(drawing, options, anchor, scratch, cancel, tour, &mut report)?;
    for (slot, leg) in arranged.iter_mut().zip(tour) {
        if let Some(segment) = segments.get(leg.segment()) {
            let [from, to] = [segment.from(), segment.to()];
            let [from, to] = if leg.reversed() { [to, from] } else { [from, to] };
            *slot = Segment::new(from, to).inked(segment.line_type(), segment.pen());
        }
    }
    segments.copy_from_slice(arranged);
    Ok(())
}

/// Writes the legs of the strokes that [`choose_first`] has chosen to `tour`.
pub fn first_legs<I: Index>(tour: &mut [Leg<I>]) {
    for (number, leg) in I::all().zip(tour) {
        *leg = Leg::new(number, false);
    }
}

/// Orders the segments of `drawing` behind those that [`choose_first`] has chosen, whose legs are
/// `drawn`, as [`order`](super::order) does, and writes them to `rest`. The path is open, and goes
/// on from where the first strokes end. The report is that of the whole drawing.
///
/// # Errors
/// See [`OrderError`].
pub fn order_rest<I: Index>(
    drawing: Drawing<'_, I>,
    first: FirstStrokes,
    drawn: &[Leg<I>],
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    rest: &mut [Leg<I>],
) -> Result<Report, OrderError> {
    check(drawing, drawn.len() + rest.len())?;
    let count = drawn.len();
    let (before, segments) =
        drawing.segments.split_at_checked(count).ok_or(OrderError::TourLength)?;
    let end = before.last().and_then(|last| drawing.points.get(last.to().get()));
    let free_units = match options.effort {
        Effort::Auto(time_model) => {
            u64::from(first.spare_milliseconds) * u64::from(time_model.units_per_second) / 1000
        }
        Effort::Units(_) => 0,
    };
    let anchor = end.map_or_else(Anchor::default, |&end| Anchor::new(end, free_units));
    let options = Options { shape: Shape::OpenPath, ..options };
    let mut report = Report::default();
    let others = Drawing { segments, ..drawing };
    order_pens(others, options, anchor, scratch, cancel, rest, &mut report)?;
    for leg in rest.iter_mut() {
        *leg = Leg::new(I::new(leg.segment() + count), leg.reversed());
    }
    for legs in [drawn, rest] {
        measure(drawing, legs, Shape::OpenPath, &mut report);
    }
    let begin = rest.first().and_then(|leg| {
        let segment = drawing.segments.get(leg.segment())?;
        drawing.points.get(if leg.reversed() { segment.to() } else { segment.from() }.get())
    });
    if let Some((&end, &begin)) = end.zip(begin).filter(|(end, begin)| end != begin) {
        report.lifts += 1;
        report.pen_up += u64::from(length(end, begin));
    }
    report.odd_points += first.odd_points;
    report.components += first.parts;
    // The least length of the rest says nothing of the whole.
    report.bound = 0;
    report.optimal = false;
    Ok(report)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]

    use super::*;
    use crate::stage::{Aborted, NeverCancel};
    use std::vec::Vec;

    /// A pen for which each stroke takes this many milliseconds.
    struct Pen(u64);

    impl StrokeDurations for Pen {
        fn milliseconds(&self, strokes: u32, _: u64) -> u64 {
            u64::from(strokes) * self.0
        }
    }

    /// Cancels after this many calls.
    struct CancelAfter(u32);

    impl Cancel for CancelAfter {
        fn check(&mut self) -> Result<(), Aborted> {
            self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
            Ok(())
        }
    }

    /// Polylines of one to four segments at random places, drawn by pens 0 to `pens` - 1.
    fn polylines<I: Index>(count: u32, pens: u8, seed: u32) -> (Vec<PagePoint>, Vec<Segment<I>>) {
        let mut state = seed;
        let mut below = |limit: i32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((u64::from(state) * limit as u64) >> 32) as i32
        };
        let (mut points, mut segments) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let mut at = PagePoint { x: below(20_000), y: below(14_000) };
            let pen = below(pens.into()) as u8;
            points.push(at);
            for _ in 0..=below(4) {
                at = PagePoint { x: at.x + 1 + below(80), y: at.y + below(80) };
                points.push(at);
                let [from, to] = [2, 1].map(|back| I::new(points.len() - back));
                let ends = if below(2) == 0 { [from, to] } else { [to, from] };
                let segment = Segment::new(ends[0], ends[1]);
                segments.push(segment.inked(crate::drawing::LineType::Full, pen));
            }
        }
        (points, segments)
    }

    /// The numbers of the points at both ends of each leg, in the order of the tour.
    fn path<I: Index>(segments: &[Segment<I>], tour: &[Leg<I>]) -> Vec<[u32; 2]> {
        let ends = |leg: &Leg<I>| {
            let segment = segments[leg.segment()];
            let ends = [segment.from().into(), segment.to().into()];
            if leg.reversed() { [ends[1], ends[0]] } else { ends }
        };
        tour.iter().map(ends).collect()
    }

    /// Orders such a drawing. Returns the segments as they were before and are now, the choice, the
    /// tour, and the report.
    type Ordered<I> = (Vec<Segment<I>>, Vec<Segment<I>>, FirstStrokes, Vec<Leg<I>>, Report);

    fn order_all<I: Index>(count: u32, pens: u8, seed: u32, options: Options) -> Ordered<I> {
        let (points, before) = polylines::<I>(count, pens, seed);
        let mut segments = before.clone();
        let mut memory = std::vec![0; (1 << 17) * size_of::<I>()];
        let scratch = Scratch::new(&mut memory);
        let cancel = &mut NeverCancel;
        let first = choose_first(&points, &mut segments, options, &Pen(500), scratch, cancel)
            .expect("room");
        let mut tour = std::vec![Leg::new(I::ZERO, false); segments.len()];
        let (drawn, rest) = tour.split_at_mut(first.segments);
        first_legs(drawn);
        let drawing = Drawing { points: &points, segments: &segments };
        let scratch = Scratch::new(&mut memory);
        let report = order_rest(drawing, first, drawn, options, scratch, cancel, rest);
        (before, segments, first, tour, report.expect("an order"))
    }

    #[test]
    fn each_segment_is_drawn_once_and_the_first_strokes_come_first() {
        for (seed, pens) in [(1, 1), (2, 1), (3, 3)] {
            let (before, segments, first, tour, report) =
                order_all::<u16>(600, pens, seed, Options::default());
            assert!(first.parts >= 4, "{first:?}");
            let sorted = |segments: &[Segment<u16>]| {
                let ends = |segment: &Segment<u16>| {
                    let ends = [segment.from(), segment.to()];
                    (ends.iter().min().copied(), ends.iter().max().copied(), segment.pen())
                };
                let mut all: Vec<_> = segments.iter().map(ends).collect();
                all.sort_unstable();
                all
            };
            assert_eq!(sorted(&before), sorted(&segments), "the segments are the same");
            let mut numbers: Vec<_> = tour.iter().map(|leg| leg.segment()).collect();
            let (drawn, _) = numbers.split_at(first.segments);
            assert!(drawn.iter().copied().eq(0..first.segments));
            assert!(tour[..first.segments].iter().all(|leg| !leg.reversed()));
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..segments.len()));
            let path = path(&segments, &tour);
            let lifts = path.windows(2).filter(|pair| pair[0][1] != pair[1][0]).count();
            assert_eq!(report.lifts as usize, lifts);
            assert_eq!(report.components, 600);
            assert_eq!(report.odd_points, 1200);
            let pens: Vec<_> = tour.iter().map(|leg| segments[leg.segment()].pen()).collect();
            assert!(pens.is_sorted(), "one pen comes after the other");
        }
    }

    #[test]
    fn the_width_of_the_numbers_changes_nothing() {
        let (_, segments, first, tour, report) = order_all::<u16>(400, 1, 5, Options::default());
        let (_, wide, wide_first, wide_tour, wide_report) =
            order_all::<u32>(400, 1, 5, Options::default());
        assert_eq!((first, report), (wide_first, wide_report));
        assert_eq!(path(&segments, &tour), path(&wide, &wide_tour));
    }

    /// The path of the rest begins where that is worth it, and is improved while the pen is busy.
    /// The way from the left end to the beginning counts, for the pen comes from there; of a path
    /// that is not begun early, to its nearer end.
    #[test]
    fn the_pen_travels_no_farther_than_without() {
        let (mut early, mut late) = (0, 0);
        for seed in 10..14 {
            let (points, segments) = polylines::<u32>(500, 1, seed);
            let corner = points.iter().min().copied().unwrap_or_default();
            let distance = |point: u32| u64::from(length(corner, points[point as usize]));
            let (_, now, _, tour, report) = order_all::<u32>(500, 1, seed, Options::default());
            early += report.pen_up + distance(path(&now, &tour)[0][0]);
            let mut memory = std::vec![0; 1 << 19];
            let mut tour = std::vec![Leg::new(0, false); segments.len()];
            let drawing = Drawing { points: &points, segments: &segments };
            let scratch = Scratch::new(&mut memory);
            let options = Options::default();
            late += crate::order::order(drawing, options, scratch, &mut NeverCancel, &mut tour)
                .expect("an order")
                .pen_up;
            let path = path(&segments, &tour);
            late += distance(path[0][0]).min(path.last().map_or(0, |leg| distance(leg[1])));
        }
        assert!(early < late + late / 100, "{early} and {late}");
    }

    #[test]
    fn nothing_is_chosen_where_it_does_not_pay() {
        // Few strokes; and a part that is too large.
        let (_, _, first, ..) = order_all::<u16>(100, 1, 1, Options::default());
        assert_eq!(first, FirstStrokes::default());
        let points: Vec<_> = (0..1000).map(|at| PagePoint { x: at * 7 % 901, y: at }).collect();
        let mut star: Vec<Segment<u16>> = (1..1000).map(|to| Segment::new(0, to)).collect();
        let mut memory = std::vec![0; 1 << 17];
        let scratch = Scratch::new(&mut memory);
        let options = Options::default();
        let first = choose_first(&points, &mut star, options, &Pen(500), scratch, &mut NeverCancel);
        assert_eq!(first.expect("room").segments, 0);
    }

    #[test]
    fn memory_that_is_short_and_an_abort_are_told() {
        let (points, mut segments) = polylines::<u16>(600, 1, 1);
        let options = Options::default();
        let mut memory = [0; 64];
        let scratch = Scratch::new(&mut memory);
        let pen = &Pen(500);
        let first = choose_first(&points, &mut segments, options, pen, scratch, &mut NeverCancel);
        assert_eq!(first, Ok(FirstStrokes::default()));
        let mut memory = std::vec![0; 1 << 17];
        let scratch = Scratch::new(&mut memory);
        let first =
            choose_first(&points, &mut segments, options, pen, scratch, &mut CancelAfter(3));
        assert_eq!(first, Err(OrderError::Aborted));
    }
    /// Says the same of any strokes.
    struct Always(u64);

    impl StrokeDurations for Always {
        fn milliseconds(&self, _: u32, _: u64) -> u64 {
            self.0
        }
    }

    #[test]
    fn strokes_are_chosen_until_they_take_as_long_as_the_order_and_a_second_more() {
        let (points, before) = polylines::<u16>(600, 1, 1);
        let mut memory = std::vec![0; 1 << 17];
        let drawing = Drawing { points: &points, segments: &before };
        let scratch = Scratch::new(&mut memory);
        let (order_takes, _) =
            milliseconds_to_order(drawing, scratch, &mut NeverCancel).expect("room");
        let enough = order_takes + SPARE_MILLISECONDS;
        for (each, parts) in [(enough / 4, 4), (enough / 4 + 1, 4), (enough / 4 - 1, 5)] {
            let mut segments = before.clone();
            let (scratch, options) = (Scratch::new(&mut memory), Options::default());
            // An order that takes a multiple of four is needed for the first row.
            assert_eq!(enough % 4, 0);
            let pen = Always(each);
            let first =
                choose_first(&points, &mut segments, options, &pen, scratch, &mut NeverCancel);
            assert_eq!(first.expect("room").parts, parts, "{each} of {enough}");
        }
    }

    /// Counts the calls.
    struct Calls(u32);

    impl Cancel for Calls {
        fn check(&mut self) -> Result<(), Aborted> {
            self.0 += 1;
            Ok(())
        }
    }

    #[test]
    fn while_the_pen_is_busy_the_rest_is_improved_for_longer() {
        let (points, mut segments) = polylines::<u16>(600, 1, 3);
        let mut memory = std::vec![0; 1 << 17];
        let options = Options::default();
        let scratch = Scratch::new(&mut memory);
        let first =
            choose_first(&points, &mut segments, options, &Pen(500), scratch, &mut NeverCancel)
                .expect("room");
        let [short, long] = [0, 60_000].map(|spare_milliseconds| {
            let mut tour = std::vec![Leg::new(0, false); segments.len()];
            let (drawn, rest) = tour.split_at_mut(first.segments);
            first_legs(drawn);
            let drawing = Drawing { points: &points, segments: &segments };
            let (first, mut calls) = (FirstStrokes { spare_milliseconds, ..first }, Calls(0));
            let scratch = Scratch::new(&mut memory);
            let report = order_rest(drawing, first, drawn, options, scratch, &mut calls, rest);
            (report.expect("an order").pen_up, calls.0)
        });
        assert!(long.0 < short.0 && long.1 > 2 * short.1, "{short:?} {long:?}");
    }
}
