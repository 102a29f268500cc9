//! Tests of stroke orders: each segment is drawn once, and the pen-up moves are no longer than they
//! must be.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::drawing::{Drawing, LineType, PagePoint, Segment};
use penup::order::{EXACT_POINTS, Effort, Leg, Method, Options, OrderError, Report, Shape, order};
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup_host_tests::order_drawings::two_columns;
use penup_host_tests::order_reference::Sheet;
use penup_host_tests::scene_files;
use proptest::prelude::*;

const ALL: [(Method, Shape); 4] = [
    (Method::Greedy, Shape::OpenPath),
    (Method::Greedy, Shape::ClosedCycle),
    (Method::Auto, Shape::OpenPath),
    (Method::Auto, Shape::ClosedCycle),
];

fn polylines(reach: i32) -> impl Strategy<Value = Vec<Vec<(i32, i32)>>> {
    let point = (-reach..=reach, -reach..=reach);
    prop::collection::vec(prop::collection::vec(point, 0..6), 0..20)
}

fn orders_everything(sheet: &Sheet) -> Result<(), OrderError> {
    for (method, shape) in ALL {
        let (_, nearest_first) = sheet.order(Options {
            method,
            shape,
            effort: Effort::Units(0),
            ..Options::default()
        })?;
        let (_, improved) = sheet.order(Options {
            method,
            shape,
            effort: Effort::Units(3),
            ..Options::default()
        })?;
        if sheet.segments.iter().all(|segment| segment.pen() == 0) {
            assert!(improved.pen_up <= nearest_first.pen_up);
        }
        let (_, seldom_lifted) = sheet.order(Options {
            method,
            shape,
            effort: Effort::Units(3),
            lift_cost: 5 << 8,
            ..Options::default()
        })?;
        assert_eq!(improved.pen_down, nearest_first.pen_down);
        assert_eq!(seldom_lifted.pen_down, nearest_first.pen_down);
    }
    Ok(())
}

fn scene(name: &str) -> Sheet {
    let path = scene_files::scene(&format!("{name}.obj"));
    Sheet::from_obj(&std::fs::read_to_string(path).expect("a scene"))
}

fn millimetres(length: u64) -> f64 {
    length as f64 / 256.0 / 80.0
}

#[test]
fn a_connected_drawing_is_drawn_at_the_optimum() {
    let sheet = scene("grid20");
    for (shape, optimum) in [(Shape::OpenPath, 315.0), (Shape::ClosedCycle, 324.0)] {
        let (_, report) = sheet.order(Options { shape, ..Options::default() }).expect("fits");
        assert!((millimetres(report.pen_up) - optimum).abs() < 0.01, "{report:?}");
        assert!(report.optimal);
    }
}

#[test]
fn separate_parts_are_drawn_within_three_hundredths_of_the_best_known() {
    let sheet = scene("text300");
    for (shape, best_known) in [(Shape::OpenPath, 2030.0), (Shape::ClosedCycle, 2067.0)] {
        let (_, report) = sheet.order(Options { shape, ..Options::default() }).expect("fits");
        assert!(millimetres(report.pen_up) < 1.03 * best_known, "{report:?}");
    }
}

/// The best known tour of 500 lines in two columns was found by LKH: back and forth, down one
/// column and up the other.
#[test]
fn a_hatching_is_drawn_within_three_hundredths_of_the_best_known() {
    let sheet = two_columns();
    for (shape, best_known) in [(Shape::OpenPath, 653.7), (Shape::ClosedCycle, 661.7)] {
        let (_, report) = sheet.order(Options { shape, ..Options::default() }).expect("fits");
        assert!(millimetres(report.pen_up) < 1.03 * best_known, "{report:?}");
    }
}

#[test]
fn an_exact_order_is_never_longer_than_a_greedy_one() {
    let sheet = scene("grid20");
    let pen_up =
        |method| sheet.order(Options { method, ..Options::default() }).expect("fits").1.pen_up;
    assert!(pen_up(Method::Exact) <= pen_up(Method::Greedy));
}

#[test]
fn a_lift_is_saved_where_it_is_worth_the_way() {
    let sheet = scene("text300");
    let in_steps = |millimetres: u32| millimetres * 80 * 256;
    let prices = [0, 2, 10].map(in_steps);
    let [free, cheap, dear] = prices.map(|lift_cost| {
        // The default effort may stop one lift short of the least.
        let options = Options { lift_cost, effort: Effort::Units(4000), ..Options::default() };
        let (_, report) = sheet.order(options).expect("fits");
        (report.lifts, report.pen_up)
    });
    let cost = |(lifts, pen_up), price: u32| pen_up + u64::from(price) * u64::from(lifts);
    for (price, tour) in prices.into_iter().zip([free, cheap, dear]) {
        assert!(cost(tour, price) <= cost(free, price), "{tour:?}, not {free:?}");
    }
    assert!(free.0 > cheap.0 && cheap.0 > dear.0, "{free:?} {cheap:?} {dear:?}");
    // One stroke for each of 300 parts.
    assert_eq!(dear.0, 299);
}

#[test]
fn very_many_odd_points_are_paired_exactly_only_when_asked() {
    let dashes = (0..600).map(|dash| vec![(40 * dash, 0), (40 * dash + 30, dash % 7)]);
    let sheet = Sheet::from_polylines(&dashes.collect::<Vec<_>>());
    let paired = |method| {
        let (_, report) = sheet
            .order(Options { method, effort: Effort::Units(0), ..Options::default() })
            .expect("fits");
        assert!(report.odd_points > EXACT_POINTS);
        report.bound > 0
    };
    assert!(!paired(Method::Auto) && paired(Method::Exact));
}

#[test]
fn with_less_memory_the_order_is_worse_or_refused_but_never_wrong() {
    let sheet = scene("text300");
    let (mut orders, mut refusals) = (0, 0);
    for words in (0..8000).step_by(250) {
        let mut memory = vec![0; words];
        let mut tour = vec![Leg::new(0, false); sheet.segments.len()];
        let options = Options { effort: Effort::Units(20), ..Options::default() };
        match order(
            sheet.drawing(),
            options,
            Scratch::new(&mut memory),
            &mut NeverCancel,
            &mut tour,
        ) {
            Ok(report) => {
                sheet.check(options.shape, &tour, &report);
                orders += 1;
            }
            Err(OrderError::Scratch(missing)) => {
                assert!(missing.needed > missing.available);
                refusals += 1;
            }
            Err(error) => panic!("{error:?}"),
        }
    }
    assert!(orders > 3 && refusals > 3, "{orders} {refusals}");
}

#[test]
fn a_job_given_up_ends_at_once() {
    struct GivenUpAfter(u32);
    impl Cancel for GivenUpAfter {
        fn check(&mut self) -> Result<(), Aborted> {
            self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
            Ok(())
        }
    }
    let sheet = scene("text300");
    for checks in [0, 1, 10, 100, 1000] {
        let mut memory = vec![0; 1 << 15];
        let mut tour = vec![Leg::new(0, false); sheet.segments.len()];
        let options = Options { effort: Effort::Units(1 << 20), ..Options::default() };
        let mut cancel = GivenUpAfter(checks);
        let scratch = Scratch::new(&mut memory);
        let result = order(sheet.drawing(), options, scratch, &mut cancel, &mut tour);
        assert_eq!(result, Err(OrderError::Aborted));
    }
}

#[test]
fn a_drawing_that_is_none_is_refused() {
    let points =
        [PagePoint { x: 0, y: 0 }, PagePoint { x: 9, y: 0 }, PagePoint { x: 1 << 21, y: 0 }];
    let segment = |from, to| Segment::new(from, to);
    let attempt = |segments: Vec<Segment>, positions: usize| {
        let mut tour = vec![Leg::new(0, false); positions];
        let drawing = Drawing { points: &points, segments: &segments };
        let mut memory = [0; 100];
        let scratch = Scratch::new(&mut memory);
        order(drawing, Options::default(), scratch, &mut NeverCancel, &mut tour)
    };
    assert_eq!(attempt(vec![segment(0, 1)], 2), Err(OrderError::TourLength));
    assert_eq!(attempt(vec![segment(0, 1), segment(1, 3)], 2), Err(OrderError::BadSegment(1)));
    assert_eq!(attempt(vec![segment(0, 2)], 1), Err(OrderError::BadSegment(0)));
    assert_eq!(attempt(vec![segment(1, 1)], 1), Err(OrderError::BadSegment(0)));
    let many = vec![segment(0, 1); <Leg>::LIMIT + 1];
    assert_eq!(attempt(many, <Leg>::LIMIT + 1), Err(OrderError::TooManySegments));
    assert_eq!(attempt(vec![], 0), Ok(Report { optimal: true, ..Report::default() }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn each_segment_is_drawn_once(crowded in polylines(2), loose in polylines(1 << 20)) {
        for polylines in [crowded, loose] {
            let sheet = Sheet::from_polylines(&polylines);
            prop_assert_eq!(orders_everything(&sheet), Ok(()));
        }
    }

    #[test]
    fn the_width_of_numbers_changes_nothing(
        polylines in polylines(1 << 12),
        pens in prop::collection::vec(0u8..3, 100),
        closed: bool,
    ) {
        let mut sheet = Sheet::from_polylines(&polylines);
        for (segment, &pen) in sheet.segments.iter_mut().zip(&pens) {
            *segment = segment.inked(LineType::Full, pen);
        }
        let shape = if closed { Shape::ClosedCycle } else { Shape::OpenPath };
        for (method, effort) in [(Method::Auto, 200), (Method::Greedy, 0), (Method::Exact, 20)] {
            let (effort, lift_cost) = (Effort::Units(effort), 300);
            let options = Options { method, shape, effort, lift_cost, ..Options::default() };
            let (tour, report) = sheet.order(options).expect("fits");
            let (wide, wide_report) = sheet.order_wide(options).expect("fits");
            prop_assert_eq!(report, wide_report);
            let plain = |segment, reversed| (segment, reversed);
            let tour = tour.iter().map(|leg| plain(leg.segment(), leg.reversed()));
            prop_assert!(tour.eq(wide.iter().map(|leg| plain(leg.segment(), leg.reversed()))));
        }
    }

    #[test]
    fn each_pen_draws_its_own(crowded in polylines(3), pens in prop::collection::vec(0u8..4, 100)) {
        let mut sheet = Sheet::from_polylines(&crowded);
        for (segment, &pen) in sheet.segments.iter_mut().zip(&pens) {
            *segment = segment.inked(LineType::Full, pen);
        }
        prop_assert_eq!(orders_everything(&sheet), Ok(()));
        let (method, shape) = (Method::Auto, Shape::OpenPath);
        let options = Options { method, shape, effort: Effort::Units(1), ..Options::default() };
        let (tour, _) = sheet.order(options).expect("as above");
        let pens = tour.iter().map(|leg| sheet.segments[leg.segment()].pen());
        prop_assert!(pens.is_sorted());
    }
}
