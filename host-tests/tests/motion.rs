//! Tests of the speed, measured from the events, against the optimum, published results of known
//! plotters, and the limits.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::board_table::PICO;
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Setting, Settings, Target, TargetList, Value};
use penup::step::{Arc, Chords, Turn};
use penup_host_tests::event_checker::{self, Run};
use penup_host_tests::motion_optimum::{self, Limits};
use penup_host_tests::motion_paths::{
    STEPS_PER_MM, circle, dense, draw, positions, settings, star, steps, zigzag,
};
use penup_host_tests::pin_machine;
use proptest::prelude::*;

fn optimum(
    points: &[PagePoint],
    speed: f64,
    acceleration: f64,
    deviation: f64,
    bends: bool,
) -> f64 {
    let points: Vec<_> = points
        .iter()
        .map(|p| (f64::from(p.x) / STEPS_PER_MM, f64::from(p.y) / STEPS_PER_MM))
        .collect();
    motion_optimum::seconds(
        &points,
        Limits {
            speed,
            acceleration,
            junction_deviation: deviation,
            centripetal: bends,
            beside_bends: true,
            step: 1.0 / STEPS_PER_MM,
        },
    )
}

#[test]
fn known_paths_are_no_slower_than_known_plotters() {
    // Without the limit in bends, as saxi has none.
    for (path, saxi) in [(circle(30.0, 100), 4.019), (zigzag(), 12.402), (star(), 6.826)] {
        let points = steps(&path);
        let run = draw(&points, settings(50.0, 200.0, 0.127, false), 128);
        assert!(run.seconds <= saxi + 0.0005, "{} s, saxi {saxi} s", run.seconds);
    }
}

#[test]
fn every_path_takes_the_time_of_the_optimum_and_keeps_the_acceleration() {
    let paths = [
        ("circle 30", circle(30.0, 100)),
        ("zigzag", zigzag()),
        ("star", star()),
        ("circle 3", circle(3.0, 100)),
        ("circle 0.3", circle(0.3, 40)),
        ("dense", dense()),
        ("one move", vec![(1.0, 1.0), (1.01, 1.01)]),
        ("short", vec![(1.0, 1.0), (1.5, 1.0)]),
        ("long", vec![(0.0, 0.0), (400.0, 300.0)]),
    ];
    for (name, path) in &paths {
        let points = steps(path);
        for (speed, acceleration, deviation) in
            [(50.0, 200.0, 0.127), (50.0, 200.0, 0.01), (100.0, 1000.0, 0.05), (30.0, 2000.0, 0.0)]
        {
            for bends in [true, false] {
                let run = draw(&points, settings(speed, acceleration, deviation, bends), 1000);
                let least = optimum(&points, speed, acceleration, deviation, bends);
                let measured =
                    event_checker::greatest_acceleration(&run.times, &positions(&points), 0.005);
                let case = format!("{name} {speed} {acceleration} {deviation} {bends}");
                assert!(
                    (run.seconds / least - 1.0).abs() < 0.01,
                    "{case}: {} s, optimum {least} s",
                    run.seconds
                );
                assert!(measured <= 1.05 * acceleration, "{case}: {measured} mm/s2");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    #[test]
    fn whatever_the_settings_the_drivers_forgive_it(
        targets in prop::collection::vec((0i32..3000, 0i32..3000, 0u8..5), 1..30),
        near in 1i32..60,
        pulse in 0.2f64..10.0,
        setup in 0.1f64..30.0,
        dwell in 1.0f64..899.0,
        speed in 60.0f64..32000.0,
        acceleration in 10.0f64..32000.0,
        deviation in 0.0f64..1.0,
        kinematics in 0i32..2,
        jerk in prop_oneof![Just(0.0), 0.1f64..10.0, 10.0f64..1000.0],
        blocks in 1usize..40,
    ) {
        let mut settings = Settings::default();
        let values = [
            (Setting::StepPulse, pulse),
            (Setting::DirectionSetup, setup),
            (Setting::PenUpDwell, dwell),
            (Setting::PenDownDwell, 900.0 - dwell),
            (Setting::MaxRateX, 32000.0),
            (Setting::MaxRateY, 32000.0),
            (Setting::DrawSpeed, speed),
            (Setting::TravelSpeed, speed),
            (Setting::AccelerationX, acceleration),
            (Setting::AccelerationY, acceleration),
            (Setting::Jerk, jerk),
            (Setting::JunctionDeviation, deviation),
            (Setting::TravelX, 100.0),
            (Setting::TravelY, 100.0),
            (Setting::Kinematics, f64::from(kinematics)),
        ];
        for (setting, value) in values {
            prop_assume!(settings.set(setting, Value::from_num(value)).is_ok());
        }
        let inks = [
            None,
            Some(LineType::Full),
            Some(LineType::Full),
            Some(LineType::Dotted),
            Some(LineType::Dashed),
        ];
        let targets: Vec<_> = targets
            .into_iter()
            .map(|(x, y, ink)| Target {
                point: PagePoint { x: x / near, y: y / near },
                ink: inks[usize::from(ink)],
            })
            .collect();
        let events = pin_machine::record(settings, &mut TargetList::new(&targets), blocks)
            .expect("within the travel");
        let end = targets.last().map(|target| settings.kinematics().motors(target.point));
        prop_assert_eq!(Some(event_checker::check(&events, &settings).end), end);
    }
}

#[test]
fn a_short_look_ahead_is_enough_for_dense_points() {
    let points = steps(&dense());
    let run = draw(&points, settings(50.0, 200.0, 0.127, true), 128);
    assert!(run.seconds < 1.01 * optimum(&points, 50.0, 200.0, 0.127, true));
    // With a tenth of it the machine is slower, but never stands.
    let slow = draw(&points, settings(50.0, 200.0, 0.127, true), 12);
    let pauses = slow.times[100..slow.times.len() - 100].windows(2).map(|t| t[1] - t[0]);
    assert!(pauses.fold(0.0, f64::max) < 0.002);
}

/// With the number of blocks of the Pico.
#[test]
fn the_look_ahead_holds_the_stopping_distance_however_short_the_chords() {
    let line = |chord: f64| -> Vec<_> {
        let count = (60.0 / chord) as u32;
        let along = (0..count).map(|number| f64::from(number) * chord);
        along.map(|along| (10.0 + 0.93 * along, 10.0 + 0.36 * along)).collect()
    };
    // A staircase of single steps, every `run`th of them upward.
    let stairs = |run: u32| -> Vec<_> {
        let points = (0..6000u32).map(|number| (number - number / run, number / run));
        points.map(|(x, y)| (10.0 + f64::from(x) / 100.0, 10.0 + f64::from(y) / 100.0)).collect()
    };
    for (name, path) in [
        ("line 0.03", line(0.03)),
        ("line 0.012", line(0.012)),
        ("stairs", stairs(2)),
        ("flat stairs", stairs(5)),
        ("circle 0.03", circle(30.0, 6283)),
        ("circle 0.02", circle(8.0, 2513)),
    ] {
        let points = steps(&path);
        let run = draw(&points, settings(50.0, 200.0, 0.127, true), PICO.memory.blocks);
        let ratio = run.seconds / optimum(&points, 50.0, 200.0, 0.127, true);
        assert!((ratio - 1.0).abs() < 0.01, "{name}: {ratio}");
        let measured = event_checker::greatest_acceleration(&run.times, &positions(&points), 0.005);
        assert!(measured <= 1.03 * 200.0, "{name}: {measured} mm/s2");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    #[test]
    fn random_paths_take_the_time_of_the_optimum(
        turns in prop::collection::vec((-300i32..300, -300i32..300), 1..60),
        scale in 1i32..40,
        speed in 5.0f64..120.0,
        acceleration in 50.0f64..5000.0,
        deviation in 0.001f64..0.5,
        bends: bool,
    ) {
        let mut at = PagePoint { x: 20_000, y: 20_000 };
        let mut points = vec![at];
        for (dx, dy) in turns {
            at = PagePoint {
                x: (at.x + dx / scale).clamp(0, 42_000),
                y: (at.y + dy / scale).clamp(0, 42_000),
            };
            points.push(at);
        }
        points.dedup();
        prop_assume!(points.len() > 1);
        let run = draw(&points, settings(speed, acceleration, deviation, bends), 128);
        let least = optimum(&points, speed, acceleration, deviation, bends);
        prop_assert!((run.seconds / least - 1.0).abs() < 0.01, "{} s, not {least}", run.seconds);
        let measured = event_checker::greatest_acceleration(&run.times, &positions(&points), 0.005);
        prop_assert!(measured <= 1.05 * acceleration, "{measured} mm/s2");
    }
}

/// What rounding explains is no bend, however tight: three of these points are as far from a line
/// as rounding may lift them.
#[test]
fn a_path_of_few_steps_takes_the_time_of_the_optimum() {
    let steps = [(4, 0), (2, 4), (1, 1), (0, 2), (-1, 0), (0, -1), (0, 1)];
    let mut at = PagePoint { x: 20_000, y: 20_000 };
    let mut points = vec![at];
    for (dx, dy) in steps {
        at = PagePoint { x: at.x + dx, y: at.y + dy };
        points.push(at);
    }
    let (speed, acceleration, deviation) = (52.087, 50.0, 0.32096);
    let run = draw(&points, settings(speed, acceleration, deviation, true), 128);
    let least = optimum(&points, speed, acceleration, deviation, true);
    assert!((run.seconds / least - 1.0).abs() < 0.001, "{} s, not {least}", run.seconds);
}

/// The maximum speed over any 5 ms, in mm/s.
fn fastest(run: &Run, positions: &[f64]) -> f64 {
    let mut fastest = 0.0f64;
    let mut first = 0;
    for (&time, &position) in run.times.iter().zip(positions) {
        while run.times[first + 1] <= time - 0.005 {
            first += 1;
        }
        if time - run.times[first] >= 0.005 {
            fastest = fastest.max((position - positions[first]) / (time - run.times[first]));
        }
    }
    fastest
}

#[test]
fn arcs_keep_the_acceleration_and_lead_through_their_points() {
    for radius in [50, 300, 1000] {
        let (center, start) =
            (PagePoint { x: 5000, y: 5000 }, PagePoint { x: 5000 + radius, y: 5000 });
        let arc = Arc::new(center, start, start, Turn::Clockwise).expect("a circle");
        let points: Vec<_> =
            std::iter::once(start).chain(Chords::new(start, arc.clone())).collect();
        let run = draw(&points, settings(50.0, 200.0, 0.127, true), 128);
        assert_eq!(run.points, arc.collect::<Vec<_>>());
        let speed = fastest(&run, &positions(&points));
        let radius = f64::from(radius) / STEPS_PER_MM;
        assert!(speed * speed / radius <= 1.05 * 200.0, "{radius} mm: {speed} mm/s");
        let ideal =
            std::f64::consts::TAU * radius / (200.0 * radius).sqrt() + (radius / 200.0).sqrt();
        assert!((run.seconds / ideal - 1.0).abs() < 0.01, "{radius} mm: {} s", run.seconds);
    }
}

#[test]
fn bends_keep_the_acceleration_whatever_the_chords() {
    let acceleration = 200.0;
    for radius in [1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0] {
        for chord in [0.05, 0.1, 0.2, 0.4] {
            let chords = (std::f64::consts::TAU * radius / chord) as u32;
            let points = steps(&circle(radius, chords));
            let run = draw(&points, settings(50.0, acceleration, 0.127, true), 128);
            let ideal = {
                let speed = (acceleration * radius).sqrt().min(50.0);
                std::f64::consts::TAU * radius / speed + speed / acceleration
            };
            let fastest = fastest(&run, &positions(&points));
            let case = format!("r {radius} chord {chord}: {:.4} s, {fastest:.2} mm/s", run.seconds);
            assert!(fastest * fastest / radius <= 1.05 * acceleration, "{case}");
            assert!((run.seconds / ideal - 1.0).abs() < 0.015, "{case}, ideally {ideal:.4} s");
        }
    }
}
