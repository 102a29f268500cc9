//! Whole paths through the planning of speeds, against the laws of motion.

use super::*;
use crate::drawing::{LineType, PagePoint};
use crate::motion::event::tests::Events;
use crate::motion::{Block, EventKind, EventQueue, SpeedLimit, StepEvent, TICKS_PER_SECOND};
use crate::step::Line;
use core::f64::consts::TAU;
use std::vec::Vec;

/// Steps per mm of both axes.
const STEPS: f64 = 100.0;

/// The speed, mm/s, the acceleration, mm/s², the jerk, m/s³ (0 for none), and the junction
/// deviation, mm.
fn settings([speed, acceleration, jerk, deviation]: [f64; 4]) -> Settings {
    let mut settings = Settings::default();
    for (setting, value) in [
        (Setting::StepsPerMmX, STEPS),
        (Setting::StepsPerMmY, STEPS),
        (Setting::MaxRateX, 32_000.0),
        (Setting::MaxRateY, 32_000.0),
        (Setting::TravelSpeed, speed * 60.0),
        (Setting::DrawSpeed, speed * 60.0),
        (Setting::AccelerationX, acceleration),
        (Setting::AccelerationY, acceleration),
        (Setting::Jerk, jerk),
        (Setting::JunctionDeviation, deviation),
    ] {
        settings.set(setting, Value::from_num(value)).expect("a valid setting");
    }
    settings
}

/// A stroke: how long it takes, and when each of its steps is made.
struct Stroke {
    seconds: f64,
    steps: Vec<(f64, PagePoint)>,
}

/// Draws a stroke through points in mm, and checks that its steps are those of the lines.
fn draw(points: &[[f64; 2]], settings: Settings) -> Stroke {
    let steps = |mm: f64| libm::round(mm * STEPS) as i32;
    let mut points: Vec<PagePoint> =
        points.iter().map(|[x, y]| PagePoint { x: steps(*x), y: steps(*y) }).collect();
    points.dedup();
    let targets = points
        .iter()
        .enumerate()
        .map(|(index, &point)| Target { point, ink: (index > 0).then_some(LineType::Full) });
    let targets: Vec<Target> = targets.collect();
    let mut path = TargetList::new(&targets);
    let mut blocks = std::vec![Block::EMPTY; 128];
    let pins = PulserState::new();
    let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
    let mut events = Events::default();
    machine.start(&mut path).expect("within the travel");
    machine.fill(&mut path, &mut events);
    let (mut at, mut ticks, mut is_down) = (PagePoint::default(), 0u64, false);
    let (mut made, mut dwells) = (Vec::new(), Vec::new());
    for event in &events.0 {
        if let EventKind::Pen { height } = event.kind() {
            is_down = height > 0;
            dwells.push(ticks);
        }
        let (dx, dy) = event.step();
        if (dx, dy) != (0, 0) {
            at = PagePoint { x: at.x + dx, y: at.y + dy };
            if is_down {
                made.push((ticks as f64 / f64::from(TICKS_PER_SECOND), at));
            }
        }
        ticks += u64::from(event.ticks());
    }
    let mut expected = Vec::new();
    for ends in points.windows(2) {
        let mut from = ends[0];
        expected.extend(Line::new(ends[0], ends[1]).map(|direction| {
            from = direction.from_point(from);
            from
        }));
    }
    assert!(made.iter().map(|(_, at)| *at).eq(expected), "the steps are those of the lines");
    assert!(!is_down && dwells.len() >= 2, "the pen is raised in the end");
    // The last step is made half a step before the end, as the first one is behind the beginning.
    let seconds =
        made.last().map_or(0.0, |last| last.0) - made.first().map_or(0.0, |first| first.0);
    Stroke { seconds, steps: made }
}

fn circle(radius: f64, chords: u32) -> Vec<[f64; 2]> {
    let angle = |chord: u32| f64::from(chord) / f64::from(chords) * TAU;
    (0..=chords)
        .map(|chord| libm::sincos(angle(chord)))
        .map(|(sin, cos)| [60.0 + radius * cos, 60.0 + radius * sin])
        .collect()
}

/// Checks that a stroke takes this many seconds, but for the parts of steps at both ends.
fn assert_takes(stroke: &Stroke, seconds: f64, what: &str) {
    let off = stroke.seconds / seconds - 1.0;
    assert!(off.abs() < 0.025, "{what}: {} s, expected {seconds}", stroke.seconds);
}

/// Checks that the way of each `window` seconds is at most that of a speed and that the speed
/// changes between two of them at most as an acceleration allows.
fn assert_within(stroke: &Stroke, window: f64, speed: f64, acceleration: f64) {
    let mut places = Vec::new();
    let mut next = stroke.steps[0].0;
    for pair in stroke.steps.windows(2) {
        let [(from, a), (to, b)] = [pair[0], pair[1]];
        while next < to {
            let part = (next - from) / (to - from);
            let between = |a: i32, b: i32| (f64::from(a) + part * f64::from(b - a)) / STEPS;
            places.push([between(a.x, b.x), between(a.y, b.y)]);
            next += window;
        }
    }
    let change = |a: [f64; 2], b: [f64; 2]| [(b[0] - a[0]) / window, (b[1] - a[1]) / window];
    let size = |[x, y]: [f64; 2]| libm::sqrt(x * x + y * y);
    let speeds: Vec<[f64; 2]> = places.windows(2).map(|two| change(two[0], two[1])).collect();
    // Each place is off by up to a step.
    let rounding = 1.5 / STEPS / window;
    for at in &speeds {
        assert!(size(*at) <= speed + rounding, "{at:?}");
    }
    for two in speeds.windows(2) {
        let change = size(change(two[0], two[1]));
        assert!(change <= 1.05 * acceleration + 2.0 * rounding / window, "{change}: {two:?}");
    }
}

/// How long a straight way takes from rest to rest.
fn straight(distance: f64, [speed, acceleration, jerk, _]: [f64; 4]) -> f64 {
    // While it lasts, a ramp of the acceleration takes as long as this.
    let ramp = if jerk > 0.0 { acceleration / (jerk * 1000.0) } else { 0.0 };
    distance / speed + speed / acceleration + ramp
}

#[test]
fn straight_lines_take_as_long_as_the_laws_of_motion_say() {
    for motion in [[50.0, 400.0, 0.0, 0.05], [100.0, 1000.0, 0.0, 0.05], [50.0, 400.0, 10.0, 0.05]]
    {
        for end in [[130.0, 10.0], [10.0, 90.0], [100.0, 77.0]] {
            let stroke = draw(&[[10.0, 10.0], end], settings(motion));
            let distance = libm::hypot(end[0] - 10.0, end[1] - 10.0);
            assert_takes(&stroke, straight(distance, motion), "a line");
            assert_within(&stroke, 0.02, motion[0], motion[1]);
        }
    }
}

#[test]
fn a_line_in_pieces_takes_as_long_as_the_whole() {
    for motion in [[80.0, 600.0, 0.0, 0.05], [80.0, 600.0, 20.0, 0.05]] {
        let pieces: Vec<[f64; 2]> =
            (0..=200).map(|at| [10.0 + 0.5 * f64::from(at), 20.0]).collect();
        let stroke = draw(&pieces, settings(motion));
        assert_takes(&stroke, straight(100.0, motion), "pieces");
        assert_within(&stroke, 0.02, motion[0], motion[1]);
    }
}

#[test]
fn circles_are_as_fast_as_their_acceleration_allows() {
    for (radius, chords) in [(40.0, 360), (10.0, 120), (3.0, 60)] {
        for motion in [[100.0, 500.0, 0.0, 0.05], [100.0, 500.0, 30.0, 0.05]] {
            let stroke = draw(&circle(radius, chords), settings(motion));
            let speed = libm::sqrt(500.0 * radius).min(100.0);
            assert_takes(&stroke, straight(TAU * radius, [speed, 500.0, 0.0, 0.0]), "a circle");
            assert_within(&stroke, 0.02, speed, 1.45 * 500.0);
        }
    }
}

#[test]
fn corners_are_passed_at_the_speed_of_their_deviation() {
    let zigzag: Vec<[f64; 2]> =
        (0..=10).map(|at| [10.0 + 40.0 * f64::from(at % 2), 10.0 + 5.0 * f64::from(at)]).collect();
    for deviation in [0.0, 0.05, 0.5] {
        let motion = [60.0, 500.0, 0.0, deviation];
        let stroke = draw(&zigzag, settings(motion));
        // sin of half the angle between the lines, which is small.
        let distance = libm::hypot(40.0, 5.0);
        let sine = 5.0 / distance;
        let corner = libm::sqrt(500.0 * deviation * sine / (1.0 - sine));
        let speeding = (60.0 - corner) / 500.0;
        let seconds = |ends: f64| {
            // Each end that is a corner begins at its speed.
            distance / 60.0
                + (2.0 - ends) * 60.0 / 1000.0
                + ends * speeding * (60.0 - corner) / 120.0
        };
        assert_takes(&stroke, 8.0 * seconds(2.0) + 2.0 * seconds(1.0), "a zigzag");
    }
}

/// Durations that a change of the planning may lower within the limits of the motors, and should
/// raise only for a reason.
#[test]
fn paths_of_all_kinds_take_as_long_as_they_did() {
    let mut state = 1u32;
    let mut below = |limit: f64| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) * limit
    };
    let far: Vec<[f64; 2]> = (0..40).map(|_| [10.0 + below(120.0), 10.0 + below(120.0)]).collect();
    let mut at = [60.0, 60.0];
    let dense: Vec<[f64; 2]> = (0..600)
        .map(|_| {
            at = [at[0] + below(0.8) - 0.3, at[1] + below(0.8) - 0.4];
            at
        })
        .collect();
    let wave: Vec<[f64; 2]> = (0..900)
        .map(|at| [10.0 + 0.12 * f64::from(at), 60.0 + 12.0 * libm::sin(0.05 * f64::from(at))])
        .collect();
    for (path, known) in
        [(far, [35.121, 37.077]), (dense, [13.768, 21.938]), (wave, [7.130, 7.720])]
    {
        for (jerk, known) in [0.0, 15.0].into_iter().zip(known) {
            let stroke = draw(&path, settings([90.0, 700.0, jerk, 0.05]));
            let off = stroke.seconds / known - 1.0;
            assert!((-0.002..0.001).contains(&off), "{} s instead of {known}", stroke.seconds);
        }
    }
}

/// Strokes of all line types, dots and travels.
fn strokes() -> Vec<Target> {
    let mut targets = Vec::new();
    let types = [LineType::Full, LineType::Dotted, LineType::Dashed, LineType::Full];
    for (stroke, line_type) in (0..12).zip(types.into_iter().cycle()) {
        let (x, y) = (2000 + 1300 * (stroke % 5), 2500 + 900 * (stroke * 2 % 7));
        targets.push(Target { point: PagePoint { x, y }, ink: None });
        for point in 1..=stroke % 4 * 3 {
            let (dx, dy) =
                (250 * point - 40 * (point % 3) * stroke, 310 * (point % 2) - 90 * point);
            let point = PagePoint { x: x + dx, y: y + dy };
            targets.push(Target { point, ink: Some(line_type) });
        }
        if stroke % 4 == 0 {
            targets.push(Target { point: PagePoint { x, y }, ink: Some(LineType::Full) });
        }
    }
    targets
}

/// The settings that differ, and the seconds without jerk and with it.
type Row<'r> = (&'r [(Setting, f64)], [f64; 2]);

/// As above, of whole jobs.
#[test]
fn jobs_take_as_long_as_they_did_with_all_settings() {
    let rows: &[Row] = &[
        (&[], [28.056, 33.348]),
        (&[(Setting::PenDownEarly, 80.0), (Setting::TravelEarly, 60.0)], [24.981, 29.304]),
        (&[(Setting::PenDownEarly, 500.0), (Setting::TravelEarly, 500.0)], [23.623, 27.730]),
        (&[(Setting::PenRamp, 300.0), (Setting::PenUpHeight, 30.0)], [42.116, 47.408]),
        (&[(Setting::Tool, 1.0)], [87.633, 92.925]),
        (&[(Setting::DotLength, 3.0), (Setting::SteadySpeed, 1.0)], [19.695, 22.968]),
        (&[(Setting::BacklashX, 0.3), (Setting::BacklashY, 0.2)], [30.907, 38.653]),
        (&[(Setting::PointDistance, 0.02)], [29.330, 34.625]),
    ];
    let targets = strokes();
    for (changes, known) in rows {
        for (jerk, known) in [0.0, 15.0].into_iter().zip(known) {
            let mut settings = settings([70.0, 600.0, jerk, 0.05]);
            for (setting, value) in *changes {
                settings.set(*setting, Value::from_num(*value)).expect("a valid setting");
            }
            let mut blocks = std::vec![Block::EMPTY; 32];
            let pins = PulserState::new();
            let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
            let (mut path, mut events) = (TargetList::new(&targets), Events::default());
            machine.start(&mut path).expect("within the travel");
            machine.fill(&mut path, &mut events);
            let steps = events.0.iter().map(|event| event.step());
            let end = steps.fold((0, 0), |(x, y), step| (x + step.0, y + step.1));
            let last = targets.last().expect("a target").point;
            assert_eq!(end, (last.x, last.y), "the whole job: {changes:?}");
            let ticks: u64 = events.0.iter().map(|event| u64::from(event.ticks())).sum();
            let seconds = ticks as f64 / f64::from(TICKS_PER_SECOND);
            let off = seconds / known - 1.0;
            assert!(off.abs() < 0.0005, "{changes:?}, jerk {jerk}: {seconds} s, not {known}");
        }
    }
}

#[test]
fn the_planned_position_leaves_out_the_backlash_that_is_taken_up_on_the_way() {
    let mut settings = settings([70.0, 600.0, 0.0, 0.05]);
    for setting in [Setting::BacklashX, Setting::BacklashY, Setting::BacklashDistance] {
        settings.set(setting, Value::from_num(0.4)).expect("a valid setting");
    }
    let corners = [(3000, 3000), (6000, 3500), (4000, 5000), (5000, 4500), (4500, 5500)];
    for count in 1..=corners.len() {
        let target = |(at, &(x, y)): (usize, &(i32, i32))| Target {
            point: PagePoint { x, y },
            ink: (at > 0).then_some(LineType::Full),
        };
        let targets: Vec<Target> = corners[..count].iter().enumerate().map(target).collect();
        let mut blocks = std::vec![Block::EMPTY; 32];
        let pins = PulserState::new();
        let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
        let (mut path, mut events) = (TargetList::new(&targets), Events::default());
        machine.start(&mut path).expect("within the travel");
        machine.fill(&mut path, &mut events);
        assert_eq!(machine.planned_position(), targets[count - 1].point, "{count}");
    }
}

/// Hands over all events of the moves that wait, and returns the times of the steps, in ticks.
fn times_of_steps(machine: &mut Machine<'_>) -> Vec<u64> {
    let mut events = Events::default();
    machine.fill(&mut TargetList::new(&[]), &mut events);
    let (mut ticks, mut steps) = (0u64, Vec::new());
    for event in &events.0 {
        if event.step() != (0, 0) {
            steps.push(ticks);
        }
        ticks += u64::from(event.ticks());
    }
    steps
}

#[test]
fn every_feed_is_held() {
    for (acceleration, jerk) in
        [(10.0, 0.0), (800.0, 0.0), (32_000.0, 0.0), (800.0, 15.0), (800.0, 1000.0), (5000.0, 0.1)]
    {
        let settings = settings([70.0, acceleration, jerk, 0.05]);
        let mut blocks = std::vec![Block::EMPTY; 32];
        let pins = PulserState::new();
        let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
        let end = PagePoint { x: 400, y: 300 };
        for too_slow in [Value::DELTA, SpeedLimit::LEAST_FEED - Value::DELTA] {
            assert_eq!(machine.jog(end, Some(too_slow)), Err(MachineError::TooSlow));
            let target = Target { point: end, ink: Some(LineType::Full) };
            assert_eq!(machine.draw_to(target, Some(too_slow)), Err(MachineError::TooSlow));
            assert_eq!((machine.state(), machine.end()), (State::Idle, PagePoint::default()));
        }
        let feeds = [0.1, 0.33, 1.0, 2.0, 4.9, 7.0, 10.0, 24.0, 60.0, 160.0];
        let mut end = PagePoint::default();
        for feed in feeds {
            // 1 or 5 mm.
            let length = if feed < 10.0 { 20 } else { 100 };
            end = PagePoint { x: end.x + 4 * length, y: end.y + 3 * length };
            let to = end;
            machine.jog(to, Some(Value::from_num(feed))).expect("fast enough");
            let steps = times_of_steps(&mut machine);
            // The ramps at the ends take less than these steps.
            let (first, last) = (20, steps.len() - 20);
            let minutes = (steps[last] - steps[first]) as f64 / f64::from(TICKS_PER_SECOND) / 60.0;
            let mm = f64::from(length) / 20.0 * (last - first) as f64 / steps.len() as f64;
            let off = mm / minutes / feed - 1.0;
            assert!(off.abs() < 0.01, "{acceleration}, {jerk}: F{feed} is off by {off}");
        }
    }
}

/// A queue that takes only so many events at once, so that a test can act in between.
#[derive(Default)]
struct FewAtOnce {
    events: Vec<StepEvent>,
    room: usize,
}

impl EventQueue for FewAtOnce {
    fn room(&self) -> usize {
        self.room
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.room -= 1;
        self.events.push(event);
        Ok(())
    }
}

#[test]
fn the_override_scales_the_feeds_of_moves_that_wait() {
    for (acceleration, jerk) in [(900.0, 0.0), (2000.0, 100.0), (2000.0, 1000.0)] {
        let settings = settings([70.0, acceleration, jerk, 0.05]);
        let mut blocks = std::vec![Block::EMPTY; 32];
        let pins = PulserState::new();
        let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
        // Each line goes on in the direction of the one before it, but at another feed.
        let feeds = [600.0, 1200.0, 300.0, 2000.0, 600.0, 4000.0];
        for (number, feed) in (1..).zip(feeds) {
            let point = PagePoint { x: 3000 * number, y: 0 };
            let target = Target { point, ink: Some(LineType::Full) };
            machine.draw_to(target, Some(Value::from_num(feed))).expect("room");
        }
        // The override changes while the first line is drawn.
        let (mut events, mut percents) = (FewAtOnce::default(), [50, 200, 10, 150].into_iter());
        let (mut path, mut percent) = (TargetList::new(&[]), 100.0);
        let (mut at, mut ticks, mut seen) = (0, 0u64, 0);
        let mut steps = Vec::new();
        while machine.state() == State::Run {
            events.room = 40;
            machine.fill(&mut path, &mut events);
            for event in &events.events[seen..] {
                if event.step() != (0, 0) {
                    at += event.step().0;
                    steps.push((at, ticks, percent));
                }
                ticks += u64::from(event.ticks());
            }
            seen = events.events.len();
            // In the first line, in the second one, and so on.
            if at > 3000 * (4 - percents.len() as i32) + 1000
                && let Some(next) = percents.next()
            {
                machine.set_override(next);
                percent = f64::from(next);
            }
        }
        // In the last third of each line the speed is even again.
        for (number, feed) in (0..).zip(feeds) {
            let within = |at: i32| (3000 * number + 2000..3000 * number + 2500).contains(&at);
            let part: Vec<_> = steps.iter().filter(|(at, ..)| within(*at)).collect();
            let [(from, begin, percent), .., (to, end, _)] = part[..] else { panic!("no steps") };
            let minutes = (end - begin) as f64 / f64::from(TICKS_PER_SECOND) / 60.0;
            let speed = f64::from(to - from) / STEPS / minutes;
            let asked = (feed * percent / 100.0).min(4200.0);
            let off = speed / asked - 1.0;
            assert!(off.abs() < 0.01, "{acceleration}, {jerk}: F{feed} at {percent} %: {off}");
        }
    }
}

#[test]
fn jogs_have_no_override() {
    let settings = settings([70.0, 2000.0, 0.0, 0.05]);
    let mut blocks = std::vec![Block::EMPTY; 32];
    let pins = PulserState::new();
    let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
    let feed = Some(Value::from_num(600));
    let speed = |steps: &[u64]| {
        let (first, last) = (100, steps.len() - 100);
        let minutes = (steps[last] - steps[first]) as f64 / f64::from(TICKS_PER_SECOND) / 60.0;
        (last - first) as f64 / STEPS / minutes
    };
    machine.set_override(50);
    machine.jog(PagePoint { x: 1000, y: 0 }, feed).expect("idle");
    machine.set_override(30);
    let jogged = speed(&times_of_steps(&mut machine));
    assert!((jogged / 600.0 - 1.0).abs() < 0.01, "{jogged}");
    let target = Target { point: PagePoint { x: 2000, y: 0 }, ink: None };
    machine.draw_to(target, feed).expect("idle");
    let moved = speed(&times_of_steps(&mut machine));
    assert!((moved / 180.0 - 1.0).abs() < 0.01, "{moved}");
    assert_eq!(machine.percent(), 30);
    // A program that pauses before its first move goes on with the override.
    machine.jog(PagePoint { x: 3000, y: 0 }, feed).expect("idle");
    times_of_steps(&mut machine);
    machine.pause().expect("idle");
    machine.draw_to(Target { point: PagePoint { x: 4000, y: 0 }, ink: None }, feed).expect("held");
    machine.resume();
    let moved = speed(&times_of_steps(&mut machine));
    assert!((moved / 180.0 - 1.0).abs() < 0.01, "{moved}");
}
