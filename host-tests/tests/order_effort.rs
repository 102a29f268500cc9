//! Tests of where the default effort stops: neither at once nor late, and where it no longer pays.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::order::{Effort, Options, TimeModel};
use penup_client::workspace;
use penup_host_tests::order_drawings::{KINDS, Strokes, random, two_columns};
use penup_host_tests::order_reference::Sheet;
use penup_host_tests::scene_files;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::Instant;

/// What an order costs with some effort.
#[derive(Debug, Clone, Copy)]
struct Cost {
    /// The units of work.
    units: u64,
    /// The seconds in which the pen travels.
    travel: f64,
}

impl Cost {
    fn of(drawing: &Strokes, effort: Effort) -> Self {
        // A lift is worth 2 mm, as by default.
        let options = Options { effort, lift_cost: 2 * 80 * 256, ..Options::default() };
        let (tour, _, units) = drawing.order(options).expect("an order");
        Self { units, travel: drawing.travel_seconds(&tour, 100.0, 800.0) }
    }

    /// The time of computing on a board and of travel, in seconds.
    fn total(self) -> f64 {
        self.units as f64 / f64::from(TimeModel::BOARD) + self.travel
    }
}

/// The effort that was the default before it stopped by itself.
const FIXED: Effort = Effort::Units(4000);

#[test]
fn it_stops_neither_at_once_nor_late() {
    let mut table = String::new();
    for count in [100, 500, 1000, 5000] {
        for (name, make) in KINDS {
            let drawing = make(count, 1);
            let costs = [Effort::Units(0), Effort::default(), FIXED];
            let [none, auto, fixed] = costs.map(|effort| Cost::of(&drawing, effort));
            let second = f64::from(TimeModel::BOARD);
            let saved = (fixed.units as f64 - auto.units as f64) / second;
            let lost = auto.travel - fixed.travel;
            table += &format!("{count} {name}: {lost:.2} s lost, {saved:.2} s of work saved\n");
            // With one part there is nothing to improve.
            if fixed.units == none.units {
                assert_eq!(auto.units, none.units, "{table}");
                continue;
            }
            assert!(auto.total() <= fixed.total(), "not late\n{table}");
            assert!(lost <= 0.25 * saved + 0.1, "what is lost is less than what is saved\n{table}");
            // What any effort saves, most of it this one does.
            let (most, this) = (none.travel - fixed.travel, none.travel - auto.travel);
            assert!(this >= 0.75 * most - 0.1, "not at once\n{table}");
        }
    }
    println!("{table}");
}

#[test]
fn what_a_further_second_saves_is_less_than_a_second() {
    // The fixed effort that takes a second more than the default one.
    for (name, make) in KINDS {
        for seed in 2..4 {
            let drawing = make(1000, seed);
            let [none, auto] =
                [Effort::Units(0), Effort::default()].map(|effort| Cost::of(&drawing, effort));
            if auto.units == none.units {
                continue;
            }
            let time_model =
                TimeModel { units_per_second: TimeModel::BOARD * 4, ..TimeModel::default() };
            let longer = Cost::of(&drawing, Effort::Auto(time_model));
            let seconds = (longer.units as f64 - auto.units as f64) / f64::from(TimeModel::BOARD);
            let saved = auto.travel - longer.travel;
            assert!(saved <= seconds, "{name} {seed}: {saved:.2} s saved in {seconds:.2} s");
        }
    }
}

#[test]
fn a_slow_machine_is_worth_more_work() {
    let (_, random) = KINDS[0];
    let drawing = random(500, 7);
    let slow = TimeModel { speed: 800, acceleration: 3200, ..TimeModel::default() };
    let [usual, slow] =
        [TimeModel::default(), slow].map(|time_model| Cost::of(&drawing, Effort::Auto(time_model)));
    assert!(slow.units > usual.units && slow.travel <= usual.travel, "{slow:?} {usual:?}");
}

#[test]
fn the_longest_second_and_the_slowest_machine_end() {
    let (_, random) = KINDS[0];
    let drawing = random(60, 3);
    let time_models = [
        TimeModel { speed: 0, acceleration: 0, units_per_second: 0 },
        TimeModel { speed: 1, acceleration: 1, units_per_second: 1 },
        TimeModel { speed: 1 << 22, acceleration: 1 << 27, units_per_second: 1 },
        TimeModel { speed: 1 << 22, acceleration: 1 << 27, units_per_second: u32::MAX },
        TimeModel { speed: 0, acceleration: 0, units_per_second: u32::MAX },
    ];
    let none = Cost::of(&drawing, Effort::Units(0));
    for time_model in time_models {
        let cost = Cost::of(&drawing, Effort::Auto(time_model));
        assert!(cost.travel < none.travel, "{time_model:?}: {cost:?}, without effort {none:?}");
    }
}

/// The length that a computer finds with its default effort in mm, and the units of work.
fn by_a_computer(drawing: &Strokes) -> (f64, u64) {
    let time_model = TimeModel { units_per_second: TimeModel::COMPUTER, ..TimeModel::default() };
    let options =
        Options { effort: Effort::Auto(time_model), lift_cost: 2 * 80 * 256, ..Options::default() };
    let (_, report, units) = drawing.order(options).expect("an order");
    (report.pen_up as f64 / 256.0 / 80.0, units)
}

/// The length that LKH finds for the strokes of a drawing, in mm; `None` if it cannot be installed.
fn by_lkh(drawing: &Strokes) -> Option<f64> {
    let folder = workspace::root().join("target/elkai");
    let python = folder.join("bin/python");
    let made = Command::new("python3").args(["-m", "venv"]).arg(&folder).status().ok()?;
    let install = ["-m", "pip", "--quiet", "install", "elkai==2.0.1"];
    let installed = Command::new(&python).args(install).status().ok()?;
    if !made.success() || !installed.success() {
        return None;
    }
    let mut lkh = Command::new(python)
        .args(["-c", include_str!("../src/lkh.py")])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Python, which has installed elkai");
    let mut strokes = lkh.stdin.take().expect("a pipe");
    for [from, to] in drawing.ends() {
        writeln!(strokes, "{} {} {} {}", from.x, from.y, to.x, to.y).expect("a script that reads");
    }
    drop(strokes);
    let answer = lkh.wait_with_output().expect("an answer");
    assert!(answer.status.success(), "{answer:?}");
    let text = String::from_utf8_lossy(&answer.stdout).into_owned();
    Some(text.trim().parse::<f64>().expect("a length") / 80.0)
}

#[test]
#[ignore = "installs LKH (elkai) from PyPI and runs for minutes"]
fn a_computer_comes_near_to_lkh() {
    let text = std::fs::read_to_string(scene_files::scene("text300.obj")).expect("a scene");
    let mut drawings = vec![
        ("500 hatch lines".into(), Strokes::from(&two_columns())),
        ("300 words".into(), Strokes::from(&Sheet::from_obj(&text))),
    ];
    let seeds = 1..=BY_LKH.len() as u32;
    drawings.extend(seeds.map(|seed| (format!("1000 random strokes, {seed}"), random(1000, seed))));
    for (name, drawing) in drawings {
        let begin = Instant::now();
        let (length, units) = by_a_computer(&drawing);
        let milliseconds = begin.elapsed().as_millis();
        let Some(best) = by_lkh(&drawing) else {
            println!("skipped: elkai cannot be installed");
            return;
        };
        println!(
            "{name}: {length:.1} mm, by LKH {best:.1} mm, {:+.2} %, {units} units in \
             {milliseconds} ms",
            100.0 * (length / best - 1.0)
        );
        assert!(length <= 1.01 * best, "{name}");
    }
}

/// The lengths that LKH found for 1000 random strokes in mm, by the seed of the drawing, from 1.
const BY_LKH: [f64; 10] =
    [4634.4, 4614.1, 4593.0, 4566.5, 4614.7, 4633.6, 4601.1, 4581.8, 4644.5, 4629.6];

#[test]
fn a_computer_is_within_a_hundredth_of_what_lkh_found() {
    for (seed, best) in (1..).zip(BY_LKH) {
        let (length, units) = by_a_computer(&random(1000, seed));
        assert!(length <= 1.01 * best, "seed {seed}: {length:.1} mm, by LKH {best:.1} mm");
        // More would take two cores longer than a tenth of a second.
        assert!(units <= 12_500_000, "seed {seed}: {units} units");
    }
}
