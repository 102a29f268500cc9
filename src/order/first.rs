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

use super::metric::{length, true_length, y_in_x};
use super::network::{Anchor, pen_segments};
use super::partition::Partition;
use super::{EXACT_POINTS, Leg, Options, OrderError, Report, Shape, check, measure, order_pens};
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
    /// How long strokes take, by which it is told later how many keep the pen busy.
    pub time: StrokeTime,
}

/// How long the pen is busy with strokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StrokeTime {
    /// The speed with the pen down; 0 counts as no time.
    pub steps_per_second: u32,
    /// The milliseconds that lowering and raising the pen take.
    pub stroke_milliseconds: u32,
}

impl StrokeTime {
    /// Returns the milliseconds that this many strokes take, without the moves between them. Their
    /// total length is given in 1/256 steps.
    pub(super) fn milliseconds(self, strokes: u32, length: u64) -> u64 {
        let drawn = ((length >> 8) * 1000).checked_div(self.steps_per_second.into());
        u64::from(strokes) * u64::from(self.stroke_milliseconds) + drawn.unwrap_or(0)
    }
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
    time: StrokeTime,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<FirstStrokes, OrderError> {
    match choose(points, segments, options, time, scratch, cancel) {
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
    time: StrokeTime,
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
        while milliseconds < order_takes {
            cancel.check()?;
            let Some((part, odd_points, length)) = parts.nearest() else { break };
            let of_part = (odd_points / 2).max(1);
            if strokes + of_part > MOST_STROKES {
                break;
            }
            if let Some(far) = parts.far.get_mut(part) {
                *far = CHOSEN;
            }
            milliseconds += time.milliseconds(of_part, length);
            strokes += of_part;
            odd += odd_points;
            first.parts += 1;
        }
        for index in 0..segments.len() {
            let is_chosen =
                |segment: &&Segment<I>| segment.pen() == pen && parts.has_chosen(segment);
            if segments.get(index).filter(is_chosen).is_some() {
                // It counts some of the segments before `index`.
                segments.swap(first.segments, index);
                first.segments += 1;
            }
        }
    }
    // At most all of them were counted.
    let (chosen, _) = segments.split_at_mut(first.segments);
    arrange(points, chosen, corner, options, scratch, cancel)?;
    first.odd_points = odd;
    first.time = time;
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
    let anchor = Anchor::new(corner);
    order_pens(drawing, options, anchor, scratch, cancel, tour, &mut report)?;
    for (slot, leg) in arranged.iter_mut().zip(tour) {
        if let Some(segment) = segments.get(leg.segment()) {
            let [from, to] = ends(segment, *leg);
            *slot = Segment::new(from, to).inked(segment.line_type(), segment.pen());
        }
    }
    segments.copy_from_slice(arranged); // as long as what was taken
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
    let anchor = end.map_or_else(Anchor::default, |&end| Anchor::new(end));
    let options = Options { shape: Shape::OpenPath, ..options };
    let mut report = Report::default();
    let others = Drawing { segments, ..drawing };
    order_pens(others, options, anchor, scratch, cancel, rest, &mut report)?;
    for leg in rest.iter_mut() {
        *leg = Leg::new(I::new(leg.segment() + count), leg.reversed());
    }
    report.odd_points += first.odd_points;
    report.components += first.parts;
    Ok(measure_all(drawing, drawn, rest, options, report))
}

/// Measures an open path that consists of two parts, and returns its report. What is not measured
/// is as in `report`. No lower bound of the length is known of the whole.
pub(super) fn measure_all<I: Index>(
    drawing: Drawing<'_, I>,
    drawn: &[Leg<I>],
    rest: &[Leg<I>],
    options: Options,
    report: Report,
) -> Report {
    let mut all = Report {
        odd_points: report.odd_points,
        components: report.components,
        ..Report::default()
    };
    let options = Options { shape: Shape::OpenPath, ..options };
    for legs in [drawn, rest] {
        measure(drawing, legs, options, &mut all);
    }
    let end = drawn.last().and_then(|leg| end_of(drawing, *leg));
    let begin = rest.first().and_then(|leg| end_of(drawing, leg.flipped()));
    if let Some((end, begin)) = end.zip(begin).filter(|(end, begin)| end != begin) {
        all.lifts += 1;
        all.pen_up += true_length(end, begin, y_in_x(options.steps));
    }
    Report { bound: 0, optimal: false, ..all }
}

/// Returns the points at which a leg begins and ends.
pub(super) fn ends<I: Index>(segment: &Segment<I>, leg: Leg<I>) -> [I; 2] {
    let [from, to] = [segment.from(), segment.to()];
    if leg.reversed() { [to, from] } else { [from, to] }
}

/// Returns the point at which a leg ends.
pub(super) fn end_of<I: Index>(drawing: Drawing<'_, I>, leg: Leg<I>) -> Option<PagePoint> {
    let segment = drawing.segments.get(leg.segment())?;
    let [_, end] = ends(segment, leg);
    drawing.points.get(end.get()).copied()
}

#[cfg(test)]
pub(super) mod tests;
