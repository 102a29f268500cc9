#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use super::*;
use crate::drawing::PagePoint;
use crate::order::TimeModel;
use crate::order::first::tests::{CancelAfter, order_all, path, pen, polylines, random};
use crate::order::{choose_first, first_legs, order_rest};
use crate::stage::NeverCancel;
use std::vec::Vec;

/// A drawing with an order that is improved in rounds.
struct Improved<I> {
    points: Vec<PagePoint>,
    segments: Vec<Segment<I>>,
    tour: Vec<Leg<I>>,
    /// How many legs were released before each round, and the report before it.
    rounds: Vec<(usize, Report)>,
    report: Report,
}

/// Improves the order of a drawing that [`order_all`] has ordered. All that is released must stay
/// as it is, and each stroke that is released must be whole.
fn improve_all<I: Index>(count: u32, seed: u32, stroke_milliseconds: u32) -> Improved<I> {
    let options = Options::default();
    let (points, _) = polylines::<I>(count, 1, seed);
    let (_, segments, first, mut tour, mut report) = order_all::<I>(count, 1, seed, options);
    let drawing = Drawing { points: &points, segments: &segments };
    let mut memory = std::vec![0; (1 << 17) * size_of::<I>()];
    let (mut released, mut before) = (Released::first(first.segments), Report::default());
    let mut rounds = Vec::new();
    while let Some(more) =
        released.more(drawing, &tour, options, pen(stroke_milliseconds), [before, report])
    {
        released = more;
        rounds.push((released.legs, report));
        let (drawn, rest) = tour.split_at_mut(released.legs);
        let end_and_begin = [drawn.last(), rest.first()].map(|leg| leg.copied().expect("a leg"));
        let [end, begin] = [end_and_begin[0], end_and_begin[1].flipped()]
            .map(|leg| end_of(drawing, leg).expect("a point"));
        assert_ne!(end, begin, "a stroke is whole");
        let as_drawn = drawn.to_vec();
        let cancel = &mut NeverCancel;
        let scratch = Scratch::new(&mut memory);
        before = report;
        report = improve_rest(drawing, drawn, report, options, scratch, cancel, rest).expect("");
        assert_eq!(drawn, as_drawn, "what is released stays");
        assert_eq!(report, measure_all(drawing, drawn, rest, options, report));
        assert!(report.pen_up <= before.pen_up);
    }
    Improved { points, segments, tour, rounds, report }
}

#[test]
fn rounds_make_the_moves_shorter_and_each_segment_is_drawn_once() {
    for seed in [1, 2, 3] {
        let Improved { segments, tour, rounds, report, .. } = improve_all::<u16>(600, seed, 500);
        let (_, first) = rounds.first().copied().expect("a round");
        assert!(report.pen_up < first.pen_up - first.pen_up / 100, "{first:?} {report:?}");
        let mut numbers: Vec<_> = tour.iter().map(|leg| leg.segment()).collect();
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..segments.len()));
        let path = path(&segments, &tour);
        let lifts = path.windows(2).filter(|pair| pair[0][1] != pair[1][0]).count();
        assert_eq!((report.lifts as usize, report.components), (lifts, 600));
    }
}

/// Pieces of six points with lines between most of them, so that strokes meet at points.
fn pieces(count: u32, seed: u32) -> (Vec<PagePoint>, Vec<Segment<u16>>) {
    let mut below = random(seed);
    let (mut points, mut segments) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let corner = PagePoint { x: below(12_000), y: below(9_000) };
        let begin = points.len() as u16;
        for _ in 0..6 {
            let [x, y] = [below(400), below(400)];
            points.push(PagePoint { x: corner.x + x, y: corner.y + y });
        }
        for one in 0..6 {
            for other in one + 1..6 {
                if other == one + 1 || below(3) > 0 {
                    segments.push(Segment::new(begin + one, begin + other));
                }
            }
        }
    }
    (points, segments)
}

/// The machine counts what follows the released strokes as another stroke. If it began at the point
/// where they end, the path would count both as one, and a job that goes on would leave one out.
/// These drawings have orders of which that is true, and which are as short as any.
#[test]
fn what_is_released_never_goes_on_in_the_same_stroke() {
    for (seed, count, lift_cost, milliseconds) in
        [(4, 20, 0, 7999), (279, 80, 4000, 7999), (396, 80, 0, 1500)]
    {
        let (points, mut segments) = pieces(count, seed);
        let options = Options { lift_cost, ..Options::default() };
        let (cancel, time) = (&mut NeverCancel, pen(milliseconds));
        let mut memory = std::vec![0; 1 << 18];
        let scratch = Scratch::new(&mut memory);
        let first = choose_first(&points, &mut segments, options, time, scratch, cancel);
        let first = first.expect("room");
        let mut tour = std::vec![Leg::new(0, false); segments.len()];
        let (drawn, rest) = tour.split_at_mut(first.segments);
        first_legs(drawn);
        let drawing = Drawing { points: &points, segments: &segments };
        let scratch = Scratch::new(&mut memory);
        let report = order_rest(drawing, first, drawn, options, scratch, cancel, rest);
        let (mut before, mut report) = (Report::default(), report.expect("an order"));
        let mut released = Released::first(first.segments);
        while let Some(more) = released.more(drawing, &tour, options, time, [before, report]) {
            released = more;
            let (drawn, rest) = tour.split_at_mut(released.legs);
            let scratch = Scratch::new(&mut memory);
            before = report;
            report = improve_rest(drawing, drawn, report, options, scratch, cancel, rest)
                .expect("an order");
            assert_eq!(report, measure_all(drawing, drawn, rest, options, report));
            let path = path(&segments, &tour);
            assert_ne!(path[released.legs - 1][1], path[released.legs][0], "{seed}");
        }
    }
}

#[test]
fn the_rounds_end() {
    // Each stroke takes long, so that many are left; and few are left.
    for (count, milliseconds) in [(600, 8000), (600, 1000), (300, 20)] {
        let Improved { rounds, report, .. } = improve_all::<u16>(count, 4, milliseconds);
        assert!(rounds.len() <= MOST_ROUNDS as usize, "{}", rounds.len());
        assert!(rounds.is_sorted_by(|a, b| a.0 < b.0));
        let reports: Vec<Report> = rounds.iter().map(|(_, report)| *report).collect();
        let in_vain = reports.windows(2).map(|pair| pair[0] == pair[1]);
        let in_vain: Vec<bool> = in_vain.chain(reports.last().map(|it| *it == report)).collect();
        assert!(!in_vain.windows(3).any(|three| three == [true; 3]), "{in_vain:?}");
    }
}

#[test]
fn the_width_of_the_numbers_changes_nothing() {
    let narrow = improve_all::<u16>(400, 5, 300);
    let wide = improve_all::<u32>(400, 5, 300);
    assert_eq!((&narrow.rounds, narrow.report), (&wide.rounds, wide.report));
    assert_eq!(path(&narrow.segments, &narrow.tour), path(&wide.segments, &wide.tour));
    assert_eq!(narrow.points, wide.points);
}

#[test]
fn strokes_are_released_until_they_keep_the_pen_busy() {
    let (points, _) = polylines::<u16>(600, 1, 6);
    let options = Options::default();
    let (_, segments, first, tour, report) = order_all::<u16>(600, 1, 6, options);
    let drawing = Drawing { points: &points, segments: &segments };
    let strokes = |legs: &[Leg]| {
        let path = path(&segments, legs);
        1 + path.windows(2).filter(|pair| pair[0][1] != pair[1][0]).count()
    };
    let released = Released::first(first.segments);
    let more = |options, milliseconds, before| {
        released.more(drawing, &tour, options, pen(milliseconds), [before, report])
    };
    for (milliseconds, count) in [(8000, 1), (7999, 2), (4000, 2), (800, 10), (799, 11)] {
        let more = more(options, milliseconds, Report::default()).expect("more");
        assert_eq!(strokes(&tour[released.legs..more.legs]), count);
    }
    // All strokes together do not keep the pen busy.
    assert_eq!(more(options, 1, Report::default()), None);
    // The user has said how much work is done.
    let fixed = Options { effort: Effort::Units(4000), ..options };
    assert_eq!(more(fixed, 800, Report::default()), None);
    let spent = Released { rounds: MOST_ROUNDS, ..released };
    let reports = [Report::default(), report];
    assert_eq!(spent.more(drawing, &tour, options, pen(800), reports), None);
    // Before the first round there is nothing to compare with. Then one round changes nothing, and
    // a second one.
    let first = released.more(drawing, &tour, options, pen(800), [report; 2]).expect("more");
    let once = first.more(drawing, &tour, options, pen(800), [report; 2]).expect("more");
    assert_eq!(once.more(drawing, &tour, options, pen(800), [report; 2]), None);
    assert!(once.more(drawing, &tour, options, pen(800), reports).is_some());
    // The strokes of a second pen have an order of their own.
    let (points, _) = polylines::<u16>(600, 2, 6);
    let (_, segments, first, tour, report) = order_all::<u16>(600, 2, 6, options);
    let drawing = Drawing { points: &points, segments: &segments };
    let (released, reports) = (Released::first(first.segments), [Report::default(), report]);
    assert_eq!(released.more(drawing, &tour, options, pen(800), reports), None);
}

#[test]
fn a_stroke_may_end_where_two_segments_meet() {
    // The strokes meet at point 1, and another one is drawn between them.
    let at = |(x, y)| PagePoint { x, y };
    let points = [(0, 0), (100, 0), (200, 0), (100, 50), (140, 50), (0, 400), (9, 400)].map(at);
    let ends: [[u16; 2]; 4] = [[5, 6], [1, 2], [3, 4], [1, 0]];
    let segments = ends.map(|[from, to]| Segment::new(from, to));
    let drawing = Drawing { points: &points, segments: &segments };
    let mut memory = [0; 1 << 12];
    let mut scratch = Scratch::new(&mut memory);
    let others = Drawing { segments: &segments[1..], ..drawing };
    let anchor = Anchor::new(points[6]);
    let network = Network::of_strokes(others, 0, anchor, &mut scratch).expect("room");
    assert_eq!(network.chains(), 3);
    let mut tour = [0, 1, 2, 3].map(|number| Leg::new(number, false));
    let (drawn, rest) = tour.split_at_mut(1);
    let report = measure_all(drawing, drawn, rest, Options::default(), Report::default());
    let (options, scratch) = (Options::default(), Scratch::new(&mut memory));
    let better = improve_rest(drawing, drawn, report, options, scratch, &mut NeverCancel, rest);
    let better = better.expect("an order");
    // The two segments are drawn in one stroke.
    assert_eq!((report.lifts, better.lifts), (3, 2));
    let mut numbers = tour.map(|leg| leg.segment());
    numbers.sort_unstable();
    assert_eq!(numbers, [0, 1, 2, 3]);
}

#[test]
fn memory_that_is_short_changes_nothing_and_an_abort_is_told() {
    let (points, _) = polylines::<u16>(600, 1, 7);
    let options = Options::default();
    let (_, segments, first, tour, report) = order_all::<u16>(600, 1, 7, options);
    let drawing = Drawing { points: &points, segments: &segments };
    for words in [0, 400, 1000, 1500, 2500, 4000] {
        let mut memory = std::vec![0; words];
        let mut now = tour.clone();
        let (drawn, rest) = now.split_at_mut(first.segments);
        let scratch = Scratch::new(&mut memory);
        let again = improve_rest(drawing, drawn, report, options, scratch, &mut NeverCancel, rest);
        assert_eq!(again, Ok(report), "{words}");
        assert_eq!(now, tour, "{words}");
    }
    let mut memory = std::vec![0; 1 << 17];
    for checks in [0, 1, 50, 1000] {
        let mut now = tour.clone();
        let (drawn, rest) = now.split_at_mut(first.segments);
        let (scratch, cancel) = (Scratch::new(&mut memory), &mut CancelAfter(checks));
        let ended = improve_rest(drawing, drawn, report, options, scratch, cancel, rest);
        assert_eq!(ended, Err(OrderError::Aborted), "{checks}");
    }
}

/// Counts the calls.
struct Calls(u64);

impl Cancel for Calls {
    fn check(&mut self) -> Result<(), crate::stage::Aborted> {
        self.0 += 1;
        Ok(())
    }
}

#[test]
fn a_round_works_as_long_as_the_pen_is_busy_and_no_longer() {
    let (points, _) = polylines::<u16>(600, 1, 8);
    let mut memory = std::vec![0; 1 << 17];
    for units_per_second in [1000, 100_000, 250_000] {
        let effort = Effort::Auto(TimeModel { units_per_second, ..TimeModel::default() });
        let options = Options { effort, ..Options::default() };
        let (_, segments, first, mut tour, report) = order_all::<u16>(600, 1, 8, options);
        let drawing = Drawing { points: &points, segments: &segments };
        let (drawn, rest) = tour.split_at_mut(first.segments);
        let (scratch, mut calls) = (Scratch::new(&mut memory), Calls(0));
        improve_rest(drawing, drawn, report, options, scratch, &mut calls, rest).expect("an order");
        let units = u64::from(units_per_second) * WORK_MILLISECONDS / 1000;
        // It is asked after each 256 units, and for each station when the neighbours are found.
        let most = units / 256 + 4 * points.len() as u64;
        assert!((units / 600..=most).contains(&calls.0), "{} of {units}", calls.0);
    }
}
