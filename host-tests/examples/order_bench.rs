//! Pen-up lengths and times of `order` for plans in millimetres: `order_bench EFFORT LIFT FILE...`,
//! where EFFORT is `auto` or a number and a lift is worth `LIFT` mm.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]
use penup::order::{Effort, Leg, Method, Options, Shape, order};
use penup::stage::{NeverCancel, Scratch};
use penup_host_tests::order_reference::Sheet;
use std::time::Instant;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let effort = arguments.next().expect("EFFORT LIFT FILE...");
    let effort = match effort.as_str() {
        "auto" => Effort::default(),
        units => Effort::Units(units.parse().expect("auto or a number")),
    };
    let lift_cost: f64 = arguments.next().and_then(|word| word.parse().ok()).expect("LIFT FILE...");
    let lift_cost = (lift_cost * 80.0 * 256.0) as u32;
    for file in arguments {
        let text = std::fs::read_to_string(&file).expect("a file that can be read");
        let sheet = Sheet::from_obj(&text);
        for method in [Method::Auto] {
            for shape in [Shape::OpenPath, Shape::ClosedCycle] {
                let options = Options { method, shape, effort, lift_cost, ..Options::default() };
                let (_, report) = sheet.order(options).expect("an order");
                let mut memory = vec![0; 1 << 16];
                let mut tour = vec![Leg::new(0, false); sheet.segments.len()];
                let best = (0..5)
                    .map(|_| {
                        let begin = Instant::now();
                        let scratch = Scratch::new(&mut memory);
                        order(sheet.drawing(), options, scratch, &mut NeverCancel, &mut tour)
                            .expect("an order");
                        begin.elapsed()
                    })
                    .min()
                    .unwrap_or_default();
                let mm = |length: u64| length as f64 / 256.0 / 80.0;
                println!(
                    "{file} {method:?} {shape:?}: up {:.1} bound {:.1} optimal {} odd {} parts {} \
                     lifts {} down {:.1}; {:.2?}",
                    mm(report.pen_up),
                    mm(report.bound),
                    report.optimal,
                    report.odd_points,
                    report.components,
                    report.lifts,
                    mm(report.pen_down),
                    best
                );
            }
        }
    }
}
