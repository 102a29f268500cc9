//! Random jobs with random settings and orders, as many as asked for, and the worst of each kind as
//! a part of its limit: the property tests of `jerk.rs` with other numbers, and none stops at the
//! first failure.
//!
//!     cargo run --release -p penup-host-tests --example motion_soak [FIRST_SEED [SEEDS]]
//!
//! Each seed is ten jobs of each kind. Where a limit is passed by more than the checker measures,
//! the job is printed, and the program fails. In curves the acceleration towards the centre is
//! measured against that of a machine which knows the whole path, as a part of the limit where that
//! is more; 1.3 is allowed, because a bend may be found late.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::PagePoint;
use penup_host_tests::motion_cases::{Case, Orders, in_bends, number, random_curve};
use penup_host_tests::motion_paths::draw;
use penup_host_tests::random::Random;
use std::panic::catch_unwind;
use std::process::ExitCode;

/// The jobs of each kind for one seed.
const JOBS: u32 = 10;

/// A random path; with `back`, one that turns back nearly into itself again and again.
fn path(random: &mut Random, back: bool) -> Vec<PagePoint> {
    let mut points = vec![PagePoint { x: 20_000, y: 20_000 }];
    let scale = random.between(1, 39);
    for _ in 0..random.between(1, if back { 29 } else { 59 }) {
        let (dx, dy) = (random.between(-300, 299), random.between(-300, 299));
        let (more_x, more_y) = (random.between(-3, 3), random.between(-3, 3));
        let ways = [(dx, dy), (more_x - dx, more_y - dy)];
        for (dx, dy) in &ways[..1 + usize::from(back)] {
            let at = points[points.len() - 1];
            points.push(PagePoint { x: at.x + dx / scale, y: at.y + dy / scale });
        }
    }
    points.dedup();
    points
}

/// What was measured of the jobs of one kind: its names, limits, and the worst so far.
struct Worst {
    kind: &'static str,
    jobs: u32,
    failed: u32,
    measures: [(&'static str, f64, f64); 3],
}

impl Worst {
    fn new(kind: &'static str, third: &'static str, most: f64) -> Self {
        let measures = [("acceleration", 1.05, 0.0), ("jerk", 1.1, 0.0), (third, most, 0.0)];
        Self { kind, jobs: 0, failed: 0, measures }
    }

    /// Takes what was measured of one job; `None` if a rule was broken.
    fn add(&mut self, measured: Option<[f64; 3]>, job: &dyn Fn() -> String) {
        self.jobs += 1;
        let is_kept = measured.is_some_and(|measured| {
            let mut is_kept = true;
            for (slot, value) in self.measures.iter_mut().zip(measured) {
                slot.2 = slot.2.max(value);
                is_kept &= value <= slot.1;
            }
            is_kept
        });
        if !is_kept {
            self.failed += 1;
            println!("{}: {measured:.3?} {}", self.kind, job());
        }
    }
}

/// Draws a path in one stroke and measures it.
fn stroke(worst: &mut Worst, case: Case, points: &[PagePoint], blocks: usize) {
    if points.len() < 2 {
        return;
    }
    let measured = catch_unwind(|| {
        let nearness = case.measure(points, &draw(points, case.settings(), blocks));
        [nearness.acceleration, nearness.jerk, nearness.speed]
    });
    worst.add(measured.ok(), &|| described(case, points, blocks));
}

fn described(case: Case, points: &[PagePoint], blocks: usize) -> String {
    let first = points[0];
    let points: Vec<_> = points.iter().map(|at| (at.x - first.x, at.y - first.y)).collect();
    format!("{case:?} {blocks} blocks {points:?}")
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).filter_map(|number| number.parse().ok());
    let (first, count): (u64, u64) =
        (arguments.next().unwrap_or(1), arguments.next().unwrap_or(100));
    let mut worst = [
        Worst::new("random paths", "speed", 1.03),
        Worst::new("near reversals", "speed", 1.03),
        Worst::new("curves", "in bends", 1.3),
        Worst::new("curves without a limit on jerk", "in bends", 1.3),
        Worst::new("orders with a limit on jerk", "beside a rest", 1.05),
        Worst::new("orders without one", "beside a rest", 1.05),
        Worst::new("orders, the main loop late by up to 20 ms", "beside a rest", 1.05),
        Worst::new("orders and feeds with a limit on jerk", "beside a rest", 1.05),
        Worst::new("orders and feeds without one", "beside a rest", 1.05),
    ];
    for seed in first..first + count {
        let mut random = Random::new(seed);
        for _ in 0..JOBS {
            let blocks = random.between(2, 129) as usize;
            let now = Case::random(&mut random, [2.7, 5.0]);
            stroke(&mut worst[0], now, &path(&mut random, false), blocks);
            let now = Case::random(&mut random, [2.7, 5.9]);
            stroke(&mut worst[1], now, &path(&mut random, true), blocks);
            let now = Case::random(&mut random, [2.7, 5.9]);
            let (points, bends) = random_curve(&mut random);
            for (kind, case) in [(2, now), (3, Case { jerk: 0.0, ..now })] {
                let measured = catch_unwind(|| {
                    let run = draw(&points, case.settings(), blocks);
                    let nearness = case.measure(&points, &run);
                    // What is known of the whole path beforehand is the most that can be known.
                    let all = draw(&points, case.settings(), points.len());
                    let [bend, known] =
                        [&run, &all].map(|run| in_bends(case, &points, &bends, run));
                    let bend = bend / known.max(1.0);
                    [nearness.acceleration, nearness.jerk, bend]
                });
                worst[kind].add(measured.ok(), &|| described(case, &points, blocks));
            }
            let count = random.between(1, 5);
            let orders = (0..count)
                .map(|_| {
                    let percent = random.between(10, 199) as u8;
                    (random.below(150_000_000), random.below(3) as u8, percent)
                })
                .collect();
            let aborts = random.once_in(2);
            let turn_ticks = 5_000 + random.below(45_000);
            let orders = Orders { orders, aborts, turn_ticks, feeds: Vec::new() };
            let acceleration = number(&mut random, 50.0, 5000.0);
            let jerk = number(&mut random, 500.0, 100_000.0);
            let case = Case { speed: 50.0, acceleration, jerk, deviation: 0.05 };
            let without = Case { jerk: 0.0, ..case };
            // What the queue holds in 20 ms, and the stop besides.
            let late = Orders { turn_ticks: 5_000 + random.below(495_000), ..orders.clone() };
            let count = random.between(1, 5);
            let feeds = (0..count).map(|_| random.between(30, 3999) as u16).collect();
            let fed = Orders { feeds, ..orders.clone() };
            let slow = Case { speed: 20.0, acceleration: acceleration.max(500.0), ..without };
            for (kind, orders, case) in [
                (4, &orders, case),
                (5, &orders, without),
                (6, &late, slow),
                (7, &fed, case),
                (8, &fed, without),
            ] {
                let measured = catch_unwind(|| {
                    let ratios = orders.measure(case);
                    [ratios.acceleration, ratios.jerk, ratios.rest]
                });
                worst[kind].add(measured.ok(), &|| format!("{case:?} {orders:?}"));
            }
        }
    }
    for Worst { kind, jobs, failed, measures } in &worst {
        let measures = measures.map(|(name, _, value)| format!("{name} {value:.3}"));
        println!("{kind}: {failed} of {jobs} failed; {}", measures.join(", "));
    }
    if worst.iter().any(|kind| kind.failed > 0) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
