//! What the effort of `order` buys as drawings grow: `order_growth EFFORT SEEDS [KIND] COUNT...`
//! for COUNT strokes of four kinds of drawings or of one, each the mean of SEEDS drawings. EFFORT
//! is a number, `auto` (as a board has it), or `computer` (as a computer that computes for a
//! plotter has it).
//!
//! It prints the seconds here, the units of work, the pen-up length in steps of 1/80 mm, and the
//! seconds that the pen travels at 100 mm/s and 800 mm/s².

#![allow(clippy::expect_used, reason = "a test fails by panicking")]
use penup::order::{Effort, Method, Options, TimeModel};
use penup_host_tests::order_drawings::{KINDS, Kind};
use std::time::Instant;

/// The effort with this name, or of so many units for each move.
fn effort_of(word: &str) -> Option<Effort> {
    let auto =
        |units_per_second| Effort::Auto(TimeModel { units_per_second, ..TimeModel::default() });
    match word {
        "auto" => Some(auto(TimeModel::BOARD)),
        "computer" => Some(auto(TimeModel::COMPUTER)),
        _ => word.parse().ok().map(Effort::Units),
    }
}

fn main() {
    let usage = "EFFORT SEEDS [KIND] COUNT...";
    let mut words = std::env::args().skip(1).peekable();
    let effort = words.next().and_then(|word| effort_of(&word)).expect(usage);
    let number = |word: String| word.parse::<u32>().expect("a number");
    let seeds = words.next().map(number).expect(usage);
    let only = words.next_if(|word| KINDS.iter().any(|(name, _)| name == word));
    for count in words.map(number) {
        let is_chosen = |(name, _): &(&str, Kind)| only.as_ref().is_none_or(|only| only == name);
        for (name, make) in KINDS.into_iter().filter(is_chosen) {
            let (mut seconds, mut units, mut pen_up, mut travel) = (0.0, 0, 0, 0.0);
            for seed in 1..=seeds {
                let drawing = make(count, seed);
                let options = Options { method: Method::Greedy, effort, ..Options::default() };
                let begin = Instant::now();
                let (tour, report, work) = drawing.order(options).expect("an order");
                seconds += begin.elapsed().as_secs_f64();
                units += work;
                pen_up += report.pen_up >> 8;
                travel += drawing.travel_seconds(&tour, 100.0, 800.0);
            }
            let [seconds, travel] = [seconds, travel].map(|sum| sum / f64::from(seeds));
            let [units, pen_up] = [units, pen_up].map(|sum| sum / u64::from(seeds));
            println!(
                "{count} {name}: {seconds:.3} s, {units} units, up {pen_up} steps, {travel:.2} s"
            );
        }
    }
}
