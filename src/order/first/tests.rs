#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use super::*;
use crate::stage::{Aborted, NeverCancel};
use std::vec::Vec;

/// A pen for which each stroke takes this many milliseconds.
pub(crate) fn pen(stroke_milliseconds: u32) -> StrokeTime {
    StrokeTime { steps_per_second: 0, stroke_milliseconds }
}

/// Cancels after this many calls.
pub(crate) struct CancelAfter(pub u32);

impl Cancel for CancelAfter {
    fn check(&mut self) -> Result<(), Aborted> {
        self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
        Ok(())
    }
}

/// Random numbers, each from 0 to below a limit.
pub(crate) fn random(seed: u32) -> impl FnMut(i32) -> i32 {
    let mut state = seed;
    move |limit| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((u64::from(state) * limit as u64) >> 32) as i32
    }
}

/// Polylines of one to four segments at random places, drawn by pens 0 to `pens` - 1.
pub(crate) fn polylines<I: Index>(
    count: u32,
    pens: u8,
    seed: u32,
) -> (Vec<PagePoint>, Vec<Segment<I>>) {
    let mut below = random(seed);
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
pub(crate) fn path<I: Index>(segments: &[Segment<I>], tour: &[Leg<I>]) -> Vec<[u32; 2]> {
    let ends = |leg: &Leg<I>| {
        let segment = segments[leg.segment()];
        let ends = [segment.from().into(), segment.to().into()];
        if leg.reversed() { [ends[1], ends[0]] } else { ends }
    };
    tour.iter().map(ends).collect()
}

/// Orders such a drawing. Returns the segments as they were before and are now, the choice, the
/// tour, and the report.
pub(crate) type Ordered<I> = (Vec<Segment<I>>, Vec<Segment<I>>, FirstStrokes, Vec<Leg<I>>, Report);

pub(crate) fn order_all<I: Index>(count: u32, pens: u8, seed: u32, options: Options) -> Ordered<I> {
    let (points, before) = polylines::<I>(count, pens, seed);
    let mut segments = before.clone();
    let mut memory = std::vec![0; (1 << 17) * size_of::<I>()];
    let scratch = Scratch::new(&mut memory);
    let cancel = &mut NeverCancel;
    let first =
        choose_first(&points, &mut segments, options, pen(500), scratch, cancel).expect("room");
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
    let first = choose_first(&points, &mut star, options, pen(500), scratch, &mut NeverCancel);
    assert_eq!(first.expect("room").segments, 0);
}

#[test]
fn memory_that_is_short_and_an_abort_are_told() {
    let (points, mut segments) = polylines::<u16>(600, 1, 1);
    let options = Options::default();
    let mut memory = [0; 64];
    let scratch = Scratch::new(&mut memory);
    let pen = pen(500);
    let first = choose_first(&points, &mut segments, options, pen, scratch, &mut NeverCancel);
    assert_eq!(first, Ok(FirstStrokes::default()));
    let mut memory = std::vec![0; 1 << 17];
    let scratch = Scratch::new(&mut memory);
    let first = choose_first(&points, &mut segments, options, pen, scratch, &mut CancelAfter(3));
    assert_eq!(first, Err(OrderError::Aborted));
}

#[test]
fn strokes_are_chosen_until_they_take_as_long_as_the_order() {
    let (points, before) = polylines::<u16>(600, 1, 1);
    let mut memory = std::vec![0; 1 << 17];
    let drawing = Drawing { points: &points, segments: &before };
    let scratch = Scratch::new(&mut memory);
    let (order_takes, _) = milliseconds_to_order(drawing, scratch, &mut NeverCancel).expect("room");
    // Rounded up, so that four strokes take just long enough.
    let enough = u32::try_from(order_takes).expect("a number").next_multiple_of(4);
    for (each, parts) in [(enough / 4, 4), (enough / 4 + 1, 4), (enough / 4 - 1, 5)] {
        let mut segments = before.clone();
        let (scratch, options) = (Scratch::new(&mut memory), Options::default());
        let pen = pen(each);
        let first = choose_first(&points, &mut segments, options, pen, scratch, &mut NeverCancel);
        assert_eq!(first.expect("room").parts, parts, "{each} of {enough}");
    }
}
