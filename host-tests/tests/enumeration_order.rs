//! Tests of the pen-up moves that `order` chooses against the enumeration.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]
use penup::order::{Effort, Method, Options, Shape, length};
use penup::stage::{NeverCancel, Scratch};
use penup_host_tests::enumeration::{Distances, Options as Variants, optimum};
use penup_host_tests::order_reference::Sheet;
use proptest::prelude::*;

/// A star: points that are connected to one in the middle. It has one component, so the pen-up
/// length depends only on the matching of the odd points.
fn star(points: &[(i32, i32)], side: i32) -> Sheet {
    let middle = (side / 2, side / 2);
    let rays: Vec<_> = points.iter().map(|&point| vec![middle, point]).collect();
    Sheet::from_polylines(&rays)
}

/// The minimum pen-up length; if the path is open, two ends cost nothing.
fn least(sheet: &Sheet, shape: Shape) -> u64 {
    let mut degrees = vec![0; sheet.points.len()];
    for segment in &sheet.segments {
        degrees[usize::from(segment.from())] += 1;
        degrees[usize::from(segment.to())] += 1;
    }
    let positions = sheet.points.iter().zip(degrees).filter(|&(_, degree)| degree % 2 == 1);
    let mut odd: Vec<_> = positions.map(|(&position, _)| Some(position)).collect();
    if shape == Shape::OpenPath && !odd.is_empty() {
        odd.extend([None, None]);
    }
    let distance = |a, b| match (a, b) {
        (Some(a), Some(b)) => length(a, b),
        (None, None) => u32::MAX / 4,
        _ => 0,
    };
    let below: Vec<u32> = (0..odd.len())
        .flat_map(|row| {
            odd[..row].iter().map(|&other| distance(odd[row], other)).collect::<Vec<_>>()
        })
        .collect();
    let distances = Distances::new(odd.len(), &below).expect("an even number of odd points");
    let mut memory = vec![0; 2000];
    let scratch = Scratch::new(&mut memory);
    optimum(distances, Variants::default(), scratch, &mut NeverCancel, &mut |_| {})
        .expect("an optimum")
        .cost
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_method_beats_the_enumeration_and_what_is_proved_equals_it(
        (side, points) in prop_oneof![Just(6), Just(4000)].prop_flat_map(|side| {
            (Just(side), prop::collection::vec((0..side, 0..side), 0..18))
        }),
        method in prop_oneof![Just(Method::Auto), Just(Method::Greedy), Just(Method::Exact)],
        shape in prop_oneof![Just(Shape::OpenPath), Just(Shape::ClosedCycle)],
    ) {
        let sheet = star(&points, side);
        let options = Options { method, shape, effort: Effort::Units(0), ..Options::default() };
        let (_, report) = sheet.order(options).expect("an order");
        let least = least(&sheet, shape);
        prop_assert!(report.bound <= least && least <= report.pen_up);
        if report.optimal {
            prop_assert_eq!(report.pen_up, least);
        }
    }
}
