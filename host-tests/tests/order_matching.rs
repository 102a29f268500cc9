//! Tests of exact pen-up moves against a published solver and against all pairings.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use integer_blossom::min_weight_perfect_matching;
use penup::drawing::{PagePoint, Segment};
use penup::order::{Effort, Method, Options, Shape, length};
use penup_host_tests::order_reference::Sheet;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A star around a hub. Its tips are the odd points, so the pen-up moves are a matching of them.
fn star(tips: &[PagePoint]) -> Sheet {
    let hub = PagePoint { x: -7, y: 3 };
    let points = tips.iter().copied().chain([hub]).collect();
    let to = tips.len() as u16;
    let segments = (0..to).map(|from| Segment::new(from, to)).collect();
    Sheet { points, segments }
}

/// The lengths of all possible moves. For an open path, two free ends follow the points.
fn costs(points: &[PagePoint], shape: Shape) -> Vec<Vec<i64>> {
    let free = if shape == Shape::OpenPath { 2 } else { 0 };
    let count = points.len() + free;
    let cost = |a: usize, b: usize| match (points.get(a), points.get(b)) {
        (Some(&a), Some(&b)) => i64::from(length(a, b)),
        (None, None) => 1 << 40,
        _ => 0,
    };
    (0..count).map(|a| (0..count).map(|b| cost(a, b)).collect()).collect()
}

fn published(costs: &[Vec<i64>]) -> i64 {
    let mates = min_weight_perfect_matching(&costs.concat(), costs.len());
    let twice: i64 = mates.iter().enumerate().map(|(a, &b)| costs[a][b]).sum();
    twice / 2
}

/// The minimum over all pairings, computed over subsets of the points.
fn by_trial(costs: &[Vec<i64>]) -> i64 {
    let mut least = vec![i64::MAX / 2; 1 << costs.len()];
    least[0] = 0;
    for set in 1..least.len() {
        let first = set.trailing_zeros() as usize;
        for (other, cost) in costs[first].iter().enumerate().skip(first + 1) {
            if set >> other & 1 == 1 {
                let rest = set & !(1 << first) & !(1 << other);
                least[set] = least[set].min(least[rest] + cost);
            }
        }
    }
    least.last().copied().unwrap_or(0)
}

fn compare(tips: &[PagePoint], shape: Shape, solve: fn(&[Vec<i64>]) -> i64) {
    let tips = &tips[..tips.len() & !1];
    let options =
        Options { method: Method::Exact, shape, effort: Effort::Units(0), ..Options::default() };
    let (_, report) = star(tips).order(options).expect("plenty of memory");
    assert_eq!(report.pen_up as i64, solve(&costs(tips, shape)), "{shape:?}");
    assert!(report.optimal);
}

fn shapes() -> impl Strategy<Value = Shape> {
    prop_oneof![Just(Shape::OpenPath), Just(Shape::ClosedCycle)]
}

fn points(reach: i32, count: usize) -> impl Strategy<Value = Vec<PagePoint>> {
    let point = (-reach..=reach, -reach..=reach).prop_map(|(x, y)| PagePoint { x, y });
    prop::collection::vec(point, 2..=count)
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1971), ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(500))]

    #[test]
    fn equals_a_published_solver(loose in points(20_000, 200), shape in shapes()) {
        compare(&loose, shape, published);
    }

    #[test]
    fn equals_a_published_solver_with_ties(crowded in points(9, 200), shape in shapes()) {
        compare(&crowded, shape, published);
    }

    #[test]
    fn equals_the_trial_of_every_pairing(
        few in points(3, 12),
        wide in points(1 << 17, 12),
        shape in shapes(),
    ) {
        compare(&few, shape, by_trial);
        compare(&wide, shape, by_trial);
    }
}
