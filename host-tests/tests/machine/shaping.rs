//! Input shaping: what the shaped path is, how a machine that shakes answers it, and that no step
//! is lost wherever it is interrupted.

mod ringing;

use crate::fixtures::{dotted, ink, is_ready, job, point, polargraph, run_job, to, with};
use penup::drawing::PagePoint;
use penup::machine::{Alarm, Kinematics, Setting, SettingError, Settings, State, Target};
use penup::machine::{TargetList, Value};
use penup::motion::{LimitsError, Resonance, ShaperKind, Shaping, TICKS_PER_SECOND};
use penup_host_tests::event_checker::{self, Run, greatest_acceleration};
use penup_host_tests::pin_machine;
use penup_host_tests::random::Random;
use proptest::prelude::*;

/// Steps per millimetre of the default settings.
const STEPS_PER_MM: f64 = 80.0;

/// The settings of a shaper, by its number, its frequencies, and the deviation that it may have.
fn shaper(kind: u8, [x, y]: [f64; 2], deviation: f64) -> Vec<(Setting, f64)> {
    vec![
        (Setting::ShakeX, x),
        (Setting::ShakeY, y),
        (Setting::Damping, 0.05),
        (Setting::ShapingDeviation, deviation),
        (Setting::Shaper, f64::from(kind)),
    ]
}

/// The settings with more changes.
fn and(settings: &[(Setting, f64)], more: &[(Setting, f64)]) -> Settings {
    with(&[settings, more].concat())
}

/// The shapers that these settings ask for.
fn shaping(settings: &Settings) -> Shaping {
    let kind = match settings.get(Setting::Shaper).to_num::<u8>() {
        1 => ShaperKind::Zv,
        2 => ShaperKind::Zvd,
        _ => ShaperKind::Ei,
    };
    let hertz = [Setting::ShakeX, Setting::ShakeY].map(|axis| settings.get(axis));
    let resonance = Resonance { kind, hertz, damping: settings.get(Setting::Damping) };
    let couples_axes = settings.kinematics() == Kinematics::CoreXy;
    Shaping::new(&resonance, couples_axes).expect("fits")
}

/// The same motion without shaping: with the acceleration and the corners that it has.
fn unshaped(settings: &Settings) -> Settings {
    let mut plain = *settings;
    let value = |setting| settings.get(setting);
    let deviation = value(Setting::ShapingDeviation);
    if deviation > 0 {
        let acceleration = value(Setting::AccelerationX).min(value(Setting::AccelerationY));
        let (acceleration, corners) =
            shaping(settings).bounds(deviation, acceleration, value(Setting::JunctionDeviation));
        for (setting, value) in [
            (Setting::AccelerationX, acceleration),
            (Setting::AccelerationY, acceleration),
            (Setting::JunctionDeviation, corners),
        ] {
            plain.set(setting, value).expect("valid");
        }
    }
    plain.set(Setting::Shaper, Value::ZERO).expect("valid");
    plain
}

/// The runs between moves of the pen, and where the job ends.
fn drawn(settings: &Settings, targets: &[Target]) -> (Vec<Run>, f64) {
    let mut path = TargetList::new(targets);
    let events = pin_machine::record(*settings, &mut path, 128).expect("within the travel");
    let verdict = event_checker::check(&events, settings);
    let last = targets.last().expect("a target").point;
    assert_eq!(verdict.end, settings.kinematics().motors(last));
    (verdict.runs, pin_machine::duration(&events) as f64 / f64::from(TICKS_PER_SECOND))
}

/// The position of each motor over time, as straight lines between the instants at which it is half
/// a step from two positions.
struct Smoothed {
    /// The times and positions, in seconds and steps.
    knots: Vec<(f64, f64)>,
}

impl Smoothed {
    /// The motor `axis` in a run that begins at the position `from`.
    fn new(run: &Run, axis: usize, from: i32) -> Self {
        let mut before = from;
        let mut knots = vec![(f64::NEG_INFINITY, f64::from(from))];
        for (time, at) in run.times.iter().zip(&run.points) {
            let at = [at.x, at.y][axis];
            if at != before {
                knots.push((*time, f64::from(at + before) / 2.0));
                before = at;
            }
        }
        knots.push((f64::INFINITY, f64::from(before)));
        Self { knots }
    }

    fn at(&self, time: f64) -> f64 {
        let after =
            self.knots.partition_point(|knot| knot.0 <= time).clamp(1, self.knots.len() - 1);
        let ((t0, p0), (t1, p1)) = (self.knots[after - 1], self.knots[after]);
        match (t0.is_finite(), t1.is_finite()) {
            (true, true) => p0 + (p1 - p0) * ((time - t0) / (t1 - t0)).min(1.0),
            (false, _) => p0,
            (true, false) => p1,
        }
    }
}

/// A random job: strokes and travels, short and long, some of them round, within 250 mm.
fn random_job(random: &mut Random, moves: u32) -> Vec<Target> {
    let mut at = (5000, 5000);
    let mut targets = Vec::new();
    let mut turn = 0.0f64;
    for number in 0..moves {
        let reach = [3, 30, 400, 4000][random.below(4) as usize];
        let mut step = || random.below(2 * reach + 1) as i32 - reach as i32;
        let by = (step(), step());
        if random.below(6) == 0 {
            // A bend in chords.
            let radius = 8.0 + random.below(400) as f64;
            for _ in 0..12 {
                turn += 0.2;
                at.0 += (radius * 0.2 * turn.cos()).round() as i32;
                at.1 += (radius * 0.2 * turn.sin()).round() as i32;
                at = (at.0.clamp(0, 20_000), at.1.clamp(0, 20_000));
                targets.push(ink(at.0, at.1));
            }
        }
        at = ((at.0 + by.0).clamp(0, 20_000), (at.1 + by.1).clamp(0, 20_000));
        targets.push(match random.below(8) {
            0 | 1 => to(at.0, at.1),
            2 => dotted(at.0, at.1),
            _ => ink(at.0, at.1),
        });
        if number + 1 == moves {
            targets.push(to(at.0, at.1));
        }
    }
    targets
}

/// A random shaper and machine.
fn random_settings(random: &mut Random) -> Settings {
    let mut hertz = || if random.below(8) == 0 { 0.0 } else { 9.0 + random.below(60) as f64 };
    let hertz = [hertz(), hertz()];
    let deviation = if random.below(3) == 0 { 0.0 } else { 0.05 + random.below(30) as f64 / 100.0 };
    let kind = 1 + random.below(3) as u8;
    let mut settings = shaper(kind, hertz, deviation);
    settings.push((Setting::DrawSpeed, 600.0 + random.below(5400) as f64));
    settings.push((Setting::Kinematics, f64::from(u8::from(random.below(3) == 0))));
    if random.below(4) == 0 {
        settings.push((Setting::Jerk, 2.0 + random.below(40) as f64));
    }
    with(&settings)
}

/// The shaped path is the weighted sum of the delayed copies of the planned one, run by run, and
/// both end at the same point.
#[test]
fn shaped_steps_are_those_of_the_sum_of_delayed_copies() {
    let mut worst = 0.0f64;
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let settings = random_settings(&mut random);
        let targets = strokes(&mut random);
        let copies = shaping(&settings).weights_and_delays();
        let is_coupled = settings.kinematics() == Kinematics::CoreXy;
        let (planned, _) = drawn(&unshaped(&settings), &targets);
        let (shaped, _) = drawn(&settings, &targets);
        assert_eq!(planned.len(), shaped.len());
        let mut from = point(0, 0);
        for (planned, shaped) in planned.iter().zip(&shaped) {
            assert_eq!(planned.points.last(), shaped.points.last(), "seed {seed}");
            let Some(&end) = planned.points.last() else { continue };
            let motors = [0, 1].map(|axis| Smoothed::new(planned, axis, [from.x, from.y][axis]));
            let copy = |axis: usize, time: f64| {
                let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
                    copies[axis].iter().map(|&(weight, delay)| weight * of(time - delay)).sum()
                };
                match (is_coupled, axis) {
                    (false, _) => sum(&|time| motors[axis].at(time)),
                    (true, 0) => sum(&|time| motors[0].at(time) + motors[1].at(time)) / 2.0,
                    (true, _) => sum(&|time| motors[0].at(time) - motors[1].at(time)) / 2.0,
                }
            };
            for (time, at) in shaped.times.iter().zip(&shaped.points) {
                let [a, b] = [copy(0, *time), copy(1, *time)];
                let [x, y] = if is_coupled { [a + b, a - b] } else { [a, b] };
                // Besides the step by which a motor is off, and the half step by which the planned
                // one is, a corner of the motion within an entry of the delay line is cut: by a
                // step where the velocity changes by 18 mm/s.
                let off = (f64::from(at.x) - x).abs().max((f64::from(at.y) - y).abs());
                worst = worst.max(off);
                assert!(off < 3.0, "seed {seed}: {off} steps at {time} s");
            }
            from = end;
        }
    }
    println!("at most {worst} steps");
    // A motor is off by one step at most, and so is the planned position that its steps tell.
    assert!(worst > 0.5);
}

/// The distance of a point from the segment between two points.
fn distance(at: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let part = ((at[0] - a[0]) * along[0] + (at[1] - a[1]) * along[1]) / square.max(1e-9);
    let part = part.clamp(0.0, 1.0);
    (at[0] - a[0] - part * along[0]).hypot(at[1] - a[1] - part * along[1])
}

/// How far what is drawn is off its lines, and how far the ends of the lines are from what is
/// drawn, in steps.
fn deviation(runs: &[Run], targets: &[Target], kinematics: Kinematics) -> f64 {
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    let (mut before, mut was_inked) = ([0.0; 2], false);
    for target in targets {
        let at = [f64::from(target.point.x), f64::from(target.point.y)];
        if target.ink.is_some() {
            if !was_inked {
                lines.push(vec![before]);
            }
            lines.last_mut().expect("a line").push(at);
        }
        (before, was_inked) = (at, target.ink.is_some());
    }
    let strokes = runs.iter().filter(|run| run.height == 127);
    let page = |&at: &PagePoint| kinematics.page(at);
    let drawn: Vec<[f64; 2]> = strokes
        .flat_map(|run| run.points.iter().map(page))
        .map(|at| [f64::from(at.x), f64::from(at.y)])
        .collect();
    let nearest = |distances: &mut dyn Iterator<Item = f64>| distances.fold(f64::MAX, f64::min);
    let mut worst = 0.0f64;
    for at in drawn.iter().step_by(3) {
        let mut ends = lines.iter().flat_map(|line| line.windows(2));
        worst =
            worst.max(nearest(&mut ends.by_ref().map(|ends| distance(*at, [ends[0], ends[1]]))));
    }
    for corner in lines.iter().flatten() {
        let mut off = drawn.iter().map(|at| (at[0] - corner[0]).hypot(at[1] - corner[1]));
        worst = worst.max(nearest(&mut off));
    }
    worst
}

/// Strokes of full lines with corners of all kinds and bends in chords, so that each is one run.
fn strokes(random: &mut Random) -> Vec<Target> {
    let mut strokes: Vec<Target> = Vec::new();
    let mut before = point(0, 0);
    for Target { point, ink: line } in random_job(random, 30) {
        if point != before {
            strokes.push(if line.is_some() { ink(point.x, point.y) } else { to(point.x, point.y) });
            before = point;
        }
    }
    strokes
}

#[test]
fn the_pen_leaves_the_line_by_no_more_than_the_deviation() {
    let mut used = 0.0f64;
    for seed in 0..40 {
        let mut random = Random::new(500 + seed);
        let mut settings = random_settings(&mut random);
        let allowed = 0.05 + random.below(25) as f64 / 100.0;
        settings.set(Setting::ShapingDeviation, Value::from_num(allowed)).expect("valid");
        let targets = strokes(&mut random);
        let (runs, _) = drawn(&settings, &targets);
        let off = deviation(&runs, &targets, settings.kinematics()) / STEPS_PER_MM;
        // Each motor is off by up to a step besides.
        let plain = {
            let (runs, _) = drawn(&unshaped(&settings), &targets);
            deviation(&runs, &targets, settings.kinematics()) / STEPS_PER_MM
        };
        if off >= allowed + 1.5 / STEPS_PER_MM {
            println!(
                "seed {seed}: {off} of {allowed} mm; unshaped {plain} {:?}",
                [
                    Setting::ShakeX,
                    Setting::ShakeY,
                    Setting::Shaper,
                    Setting::Kinematics,
                    Setting::Jerk
                ]
                .map(|x| settings.get(x).to_num::<f64>())
            );
        }
        used = used.max(off / allowed);
    }
    println!("up to {used} of the deviation");
    assert!(used > 0.4, "the bound is not idle: {used}");
}

#[test]
fn what_shaping_cannot_do_is_refused() {
    let mut settings = and(&shaper(1, [20.0, 30.0], 0.25), &[]);
    let before = settings;
    let mut refused = |setting, value: f64| {
        let refused = settings.set(setting, Value::from_num(value));
        assert_eq!(settings, before);
        refused
    };
    let conflict = Err(SettingError::Conflict(LimitsError::ShapingConflict));
    assert_eq!(refused(Setting::BacklashDistance, 0.3), conflict);
    assert_eq!(refused(Setting::PenDownEarly, 50.0), conflict);
    assert_eq!(refused(Setting::TravelEarly, 50.0), conflict);
    assert_eq!(refused(Setting::Centripetal, 0.0), conflict);
    assert_eq!(refused(Setting::Kinematics, 2.0), conflict);
    let too_low = Err(SettingError::Conflict(LimitsError::ShapingFrequency { least: 369 }));
    assert_eq!(refused(Setting::ShakeX, 3.0), too_low);
    // 40,000 steps a second are 500 mm/s.
    let possible = Err(SettingError::Conflict(LimitsError::ShapedSteps { possible: 40_000 }));
    for setting in [Setting::MaxRateX, Setting::MaxRateY, Setting::AccelerationX] {
        settings.set(setting, Value::from_num(32_000)).expect("valid");
    }
    let acceleration = settings.set(Setting::AccelerationY, Value::from_num(32_000));
    assert_eq!(acceleration, Ok(()));
    settings.set(Setting::DrawSpeed, Value::from_num(29_900)).expect("valid");
    assert_eq!(settings.set(Setting::DrawSpeed, Value::from_num(30_100)), possible);
    let belts = polargraph().set(Setting::Shaper, Value::ONE);
    assert_eq!(belts, conflict);
}

/// The greatest acceleration of a motor, in mm/s², over any 24 ms of a run.
fn motor_acceleration(runs: &[Run]) -> f64 {
    let mut greatest = 0.0f64;
    for run in runs {
        for axis in [0, 1] {
            let first = run.points.first().map_or(0, |at| [at.x, at.y][axis]);
            let knots = Smoothed::new(run, axis, first).knots;
            let knots = &knots[1..knots.len().max(2) - 1];
            let times: Vec<f64> = knots.iter().map(|knot| knot.0).collect();
            let places: Vec<f64> = knots.iter().map(|knot| knot.1 / STEPS_PER_MM).collect();
            greatest = greatest.max(greatest_acceleration(&times, &places, 0.024));
        }
    }
    greatest
}

/// Shapers of different lengths on both axes.
fn uneven() -> Settings {
    with(&shaper(2, [12.0, 31.0], 0.2))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn shaped_motion_is_held_and_goes_on(
        instant in 1u64..120_000_000,
        turn_ticks in 5_000u64..200_000,
        again in 0u64..9_000_000,
        loose: bool,
    ) {
        let mut settings = uneven();
        if loose {
            settings.set(Setting::BacklashX, Value::from_num(0.3)).expect("valid");
        }
        let mut holds = vec![instant + again, instant];
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
            if holds.last().is_some_and(|&due| turn.now >= due) {
                holds.pop();
                turn.machine.hold();
            }
            if turn.machine.state() == (State::Hold { stopped: true }) && turn.machine.is_stopped()
            {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                turn.machine.resume();
            }
            !is_ready(turn.machine)
        });
        prop_assert_eq!(drawn.end, job().last().expect("a target").point);
        prop_assert_eq!(drawn.pen, 0);
    }

    #[test]
    fn shaped_motion_is_given_up_where_the_pins_are(
        instant in 1u64..120_000_000,
        turn_ticks in 5_000u64..200_000,
    ) {
        let mut rest = None;
        let drawn = run_job(uneven(), turn_ticks, &mut |turn| {
            if turn.now >= instant {
                turn.machine.abort();
            }
            if turn.now > instant && is_ready(turn.machine) {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                rest = Some(turn.pins);
            }
            rest.is_none()
        });
        prop_assert_eq!(Some(drawn.end), rest);
        prop_assert_eq!(drawn.pen, 0);
    }

    #[test]
    fn an_alarm_in_shaped_motion_keeps_the_position(
        instant in 1u64..120_000_000,
        turn_ticks in 5_000u64..200_000,
    ) {
        let settings = uneven();
        let targets = job();
        let mut path = TargetList::new(&targets);
        let (mut alarmed, mut again) = (false, false);
        let trace = pin_machine::run_with(settings, turn_ticks, &mut |turn, queue| {
            if turn.now == 0 || (again && is_ready(turn.machine) && turn.now < instant) {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
            }
            assert_eq!(turn.machine.position(), turn.pins);
            if turn.now >= instant && !alarmed {
                turn.machine.alarm(Alarm::EmergencyStop);
                alarmed = true;
            } else if alarmed && !again && turn.machine.unlock().is_ok() {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                again = true;
                // The next job begins where this one stopped.
                path = TargetList::new(&targets);
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
            }
            turn.machine.fill(&mut path, queue);
            !(again && is_ready(turn.machine))
        });
        let drawn = event_checker::check_pins_in_alarms(&trace, &settings);
        prop_assert_eq!(drawn.end, targets.last().expect("a target").point);
    }

    #[test]
    fn a_late_main_loop_loses_no_shaped_step(
        instant in 1u64..120_000_000,
        pause in 1_250_000u64..50_000_000,
        turn_ticks in 5_000u64..100_000,
    ) {
        let settings = uneven();
        let targets = job();
        let run = |pause: u64| {
            let mut path = TargetList::new(&targets);
            let trace = pin_machine::run_with(settings, turn_ticks, &mut |turn, queue| {
                if turn.now == 0 {
                    turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
                }
                assert_eq!(turn.machine.position(), turn.pins);
                if !(instant..instant + pause).contains(&turn.now) {
                    turn.machine.fill(&mut path, queue);
                }
                !is_ready(turn.machine)
            });
            event_checker::check_pins(&trace, &settings)
        };
        let (late, in_time) = (run(pause), run(0));
        prop_assert_eq!(&late.inked, &in_time.inked);
        prop_assert_eq!((late.end, late.pen), (in_time.end, 0));
        // The interrupt brakes at up to 1.5 times the acceleration.
        let greatest = [&late, &in_time].map(|drawn| motor_acceleration(&drawn.runs));
        prop_assert!(greatest[0] < 1.6 * greatest[1], "{greatest:?} mm/s2");
    }
}
