//! Tests of the settings by which strokes overlap, begin early, end late, and keep one speed.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PagePoint};
use penup::machine::{Setting, Settings, Target, TargetList, Value};
use penup_client::emulator::MachineEventKind;
use penup_host_tests::event_checker::{self, Run};
use penup_host_tests::motion_cases::Case;
use penup_host_tests::motion_optimum::squared_limits;
use penup_host_tests::motion_paths::{STEPS_PER_MM, draw, positions, star, steps};
use penup_host_tests::pin_machine;
use penup_host_tests::whole_jobs::{Bench, machine_events};

/// The points in steps through which the pen goes while it is down, stroke by stroke, as the pins
/// say.
fn strokes_at_the_pins(lines: &str) -> Vec<Vec<(i32, i32)>> {
    let mut bench = Bench::new();
    bench.heard();
    let answer = bench.say(&format!("{lines}$plot\n"));
    assert!(!answer.contains("error"), "{answer}");
    bench.finish();
    let (mut at, mut down, mut strokes) = ((0, 0), false, Vec::new());
    for event in machine_events(&bench.board.trace().changes()) {
        match event {
            MachineEventKind::Step { x, y } => {
                at = (at.0 + i32::from(x), at.1 + i32::from(y));
                if down {
                    let stroke: &mut Vec<_> = strokes.last_mut().expect("begun");
                    stroke.push(at);
                }
            }
            MachineEventKind::Pen { down: now } if now != down => {
                down = now;
                if down {
                    strokes.push(vec![at]);
                }
            }
            _ => {}
        }
    }
    strokes
}

/// A closed triangle, an open angle of two lines, and a single line, in mm.
const PLAN: &str = "v 10 10 0\nv 40 10 0\nv 40 50 0\nv 60 10 0\nv 60 40 0\nv 90 80 0\nv 10 90 0\n\
                    v 50 90 0\nl 1 2 3 1\nl 4 5 6\nl 7 8\n";

fn millimetres(stroke: &[(i32, i32)]) -> f64 {
    let diagonal = |pair: &[(i32, i32)]| {
        f64::from(pair[1].0 - pair[0].0).hypot(f64::from(pair[1].1 - pair[0].1)) / 80.0
    };
    stroke.windows(2).map(diagonal).sum()
}

fn is_closed(stroke: &[(i32, i32)]) -> bool {
    stroke.first() == stroke.last()
}

#[test]
fn closed_strokes_go_on_and_open_ones_begin_early_and_end_late() {
    let as_drawn = strokes_at_the_pins(PLAN);
    let (closed, open): (Vec<_>, Vec<_>) =
        as_drawn.iter().partition(|stroke| is_closed(stroke.as_slice()));
    assert_eq!((closed.len(), open.len()), (1, 2));

    // Longer than a side of the triangle: it goes on around the corner.
    for overlap in [2.5f64, 31.0, 35.0] {
        let longer = strokes_at_the_pins(&format!("{PLAN}$221={}\n", overlap.min(10.0)));
        assert_eq!(longer.len(), 3);
        for (before, after) in as_drawn.iter().zip(&longer) {
            assert_eq!(after[..before.len()], before[..]);
            let beyond = &after[before.len() - 1..];
            if is_closed(before) {
                // Its beginning once more, step by step.
                let again = &before[..beyond.len()];
                assert_eq!(again, beyond);
                let first = before[0];
                let last = beyond[beyond.len() - 1];
                let length = f64::from(last.0 - first.0).hypot(f64::from(last.1 - first.1)) / 80.0;
                assert!((length - overlap.min(10.0)).abs() < 0.02, "{length}");
            } else {
                assert_eq!(beyond.len(), 1);
            }
        }
    }

    let longer = strokes_at_the_pins(&format!("{PLAN}$222=1.5\n$223=3\n"));
    for (before, after) in as_drawn.iter().zip(&longer) {
        if is_closed(before) {
            assert_eq!(before, after);
            continue;
        }
        // In the direction of the first line, and of the last one.
        let shift = |from: (i32, i32), to: (i32, i32)| {
            (f64::from(to.0 - from.0) / 80.0, f64::from(to.1 - from.1) / 80.0)
        };
        for (end, further, next, length) in [
            (before[0], after[0], before[before.len() / 4], 1.5),
            (
                before[before.len() - 1],
                after[after.len() - 1],
                before[before.len() - before.len() / 4],
                3.0,
            ),
        ] {
            let (out, back) = (shift(end, further), shift(end, next));
            assert!((out.0.hypot(out.1) - length).abs() < 0.02, "{out:?}");
            let cosine =
                (out.0 * back.0 + out.1 * back.1) / out.0.hypot(out.1) / back.0.hypot(back.1);
            assert!(cosine < -0.999, "{out:?} {back:?}");
        }
        let added = millimetres(after) - millimetres(before);
        // Steps on a diagonal make a longer way than the line.
        assert!((4.4..6.5).contains(&added), "{added}");
    }
}

/// Small overlaps over several segments of a closed curve in short chords.
#[test]
fn an_overlap_runs_along_many_short_chords() {
    let mut circle = String::new();
    for k in 0..60 {
        let angle = f64::from(k) / 60.0 * std::f64::consts::TAU;
        circle += &format!("v {:.3} {:.3} 0\n", 30.0 + 5.0 * angle.cos(), 30.0 + 5.0 * angle.sin());
    }
    circle += "l ";
    for k in 0..=60 {
        circle += &format!("{} ", k % 60 + 1);
    }
    circle += "\n";
    let [before, after] =
        [0.0, 4.0].map(|overlap| strokes_at_the_pins(&format!("{circle}$221={overlap}\n")));
    assert_eq!((before.len(), after.len()), (1, 1));
    assert_eq!(after[0][..before[0].len()], before[0][..]);
    let beyond = &after[0][before[0].len() - 1..];
    // The last chord is cut, so its steps may lie beside those of the whole chord.
    let same = beyond.len() - 40;
    assert_eq!(beyond[..same], before[0][..same]);
    let radius = |at: &(i32, i32)| {
        let middle = (before[0].iter().map(|at| at.0).max(), before[0].iter().map(|at| at.0).min());
        let (Some(most), Some(least)) = middle else { return 0.0 };
        let y = before[0].iter().map(|at| at.1);
        let (high, low) = (y.clone().max().unwrap_or(0), y.min().unwrap_or(0));
        let (x, y) = (f64::from(most + least) / 2.0, f64::from(high + low) / 2.0);
        (f64::from(at.0) - x).hypot(f64::from(at.1) - y) / 80.0
    };
    assert!(beyond.iter().all(|at| (radius(at) - 5.0).abs() < 0.05));
    // 4 mm of a circle of 5 mm: the chord is 2 * 5 * sin(0.4).
    let (first, last) = (beyond[0], beyond[beyond.len() - 1]);
    let chord = f64::from(last.0 - first.0).hypot(f64::from(last.1 - first.1)) / 80.0;
    assert!((chord - 10.0 * 0.4f64.sin()).abs() < 0.05, "{chord}");
}

#[test]
fn strokes_that_would_leave_the_travel_are_refused() {
    for (lead, is_refused) in [("0", false), ("10", true)] {
        let mut bench = Bench::new();
        bench.heard();
        let line = "v 0 10 0\nv 400 10 0\nl 1 2\n$130=401\n$page=401x100\n$margin=0\n";
        let answer = bench.say(&format!("{line}$222={lead}\n$223={lead}\n"));
        assert!(!answer.contains("error"), "{answer}");
        assert_eq!(bench.say("$plot\n").contains("error:"), is_refused, "{lead}");
        if is_refused {
            assert!(bench.plotter.machine().is_stopped());
        }
    }
}

fn with_one_speed(case: Case) -> Settings {
    let mut settings = case.settings();
    settings.set(Setting::SteadySpeed, Value::ONE).expect("valid");
    settings
}

/// The places and speeds between moves, mm/s, each over at least 2 ms.
fn speeds(run: &Run, positions: &[f64]) -> Vec<(f64, f64)> {
    let mut first = 0;
    let mut speeds = Vec::new();
    for index in 1..run.times.len() {
        if run.times[index] - run.times[first] >= 0.002 {
            let (time, way) =
                (run.times[index] - run.times[first], positions[index] - positions[first]);
            speeds.push((positions[first], way / time));
            first = index;
        }
    }
    speeds
}

/// A curve whose radius goes from 30 mm to 3 mm and back, again and again.
fn wave() -> Vec<(f64, f64)> {
    let (mut x, mut y, mut heading) = (20.0f64, 100.0f64, 0.0f64);
    (0..900)
        .map(|k| {
            let bend = (f64::from(k) / 40.0).sin();
            heading += 0.2 * bend.powi(3) / 3.0;
            (x, y) = (x + 0.2 * heading.cos(), y + 0.2 * heading.sin());
            (x, y)
        })
        .collect()
}

#[test]
fn a_line_has_one_speed_the_greatest_that_its_bends_allow() {
    let points = steps(&wave());
    let positions = positions(&points);
    let length = positions[positions.len() - 1];
    let mm: Vec<_> = points
        .iter()
        .map(|p| (f64::from(p.x) / STEPS_PER_MM, f64::from(p.y) / STEPS_PER_MM))
        .collect();
    for jerk in [0.0, 100_000.0, 20_000.0] {
        let case = Case { speed: 80.0, acceleration: 500.0, jerk, deviation: 0.127 };
        let (corners, bends) = squared_limits(&mm, case.limits());
        let inner = corners[1..corners.len() - 1].iter().chain(&bends);
        let allowed = inner.copied().fold(f64::INFINITY, f64::min).sqrt();
        let run = draw(&points, with_one_speed(case), 128);
        // The time to reach it from rest, and to lose it, without the limit on jerk and with it.
        let ramp = allowed * allowed / case.acceleration + if jerk > 0.0 { 4.0 } else { 0.0 };
        for (place, speed) in speeds(&run, &positions) {
            if place > ramp && place < length - ramp {
                let part = speed / allowed;
                assert!((0.99..1.001).contains(&part), "{jerk}: {speed} of {allowed} at {place}");
            }
        }
        case.check("one speed", &points, &run);
        // Otherwise the speed follows the bends.
        let run = draw(&points, case.settings(), 128);
        let fastest = speeds(&run, &positions).into_iter().map(|at| at.1).fold(0.0, f64::max);
        assert!(fastest > 1.5 * allowed, "{fastest}");
    }
}

#[test]
fn sharp_corners_divide_a_stroke_into_lines_of_their_own_speed() {
    let case = Case { speed: 60.0, acceleration: 800.0, jerk: 0.0, deviation: 0.05 };
    let points = steps(&star());
    let [one, any] = [with_one_speed(case), case.settings()].map(|set| draw(&points, set, 128));
    assert_eq!(one, any);
}

/// Pen-up moves are as fast as they may be, and each stroke has its own speed, also behind a pause.
#[test]
fn each_stroke_has_its_own_speed() {
    let case = Case { speed: 50.0, acceleration: 400.0, jerk: 0.0, deviation: 0.127 };
    let ring = |radius: f64, x: f64| {
        (0..=80).map(move |k| {
            let angle = f64::from(k) / 80.0 * std::f64::consts::TAU;
            (x + radius * angle.cos(), 40.0 + radius * angle.sin())
        })
    };
    let targets: Vec<_> = [(1.0, 20.0), (5.0, 40.0)]
        .into_iter()
        .flat_map(|(radius, x)| {
            let points = steps(&ring(radius, x).collect::<Vec<_>>());
            points
                .into_iter()
                .enumerate()
                .map(|(index, point)| Target { point, ink: (index > 0).then_some(LineType::Full) })
        })
        .collect();
    let settings = with_one_speed(case);
    let events = pin_machine::record(settings, &mut TargetList::new(&targets), 128).expect("fits");
    let verdict = event_checker::check(&events, &settings);
    let inked: Vec<_> = verdict.runs.iter().filter(|run| run.height > 0).collect();
    assert_eq!(inked.len(), 2);
    for (run, radius) in inked.iter().zip([1.0f64, 5.0]) {
        let middle = run.times.len() / 2;
        let around = &run.points[middle - 40..middle + 40];
        let way = |ends: &[PagePoint]| {
            f64::from(ends[1].x - ends[0].x).hypot(f64::from(ends[1].y - ends[0].y))
        };
        // Steps make a longer way than the circle: by at most 8 %.
        let length: f64 = around.windows(2).map(way).sum::<f64>() / STEPS_PER_MM;
        let speed = length / (run.times[middle + 39] - run.times[middle - 40]);
        let ideal = (400.0 * radius).sqrt().min(50.0);
        assert!((0.95..1.13).contains(&(speed / ideal)), "{radius} mm: {speed}, not {ideal}");
    }
}
