//! Orders of strokes: each segment once, and not farther than it must be.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::order::{Method, Options, OrderError, Shape};
use penup_host_tests::order_reference::Sheet;
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
        for effort in [0, 1] {
            sheet.order(Options { method, shape, effort })?;
        }
    }
    Ok(())
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
    fn each_pen_draws_its_own(crowded in polylines(3), pens in prop::collection::vec(0u8..4, 100)) {
        let mut sheet = Sheet::from_polylines(&crowded);
        for (segment, &pen) in sheet.segments.iter_mut().zip(&pens) {
            segment.pen = pen;
        }
        prop_assert_eq!(orders_everything(&sheet), Ok(()));
        let options = Options { method: Method::Auto, shape: Shape::OpenPath, effort: 1 };
        let (tour, _) = sheet.order(options).expect("as above");
        let pens = tour.iter().map(|leg| sheet.segments[leg.segment()].pen);
        prop_assert!(pens.is_sorted());
    }
}
