//! Backlash that is taken up while the pen draws on: what a drive with that backlash draws.

use crate::fixtures::{is_ready, point, with};
use penup::boards::host::{Change, Stamped};
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Alarm, JobSize, Path, PendingTarget, Setting, SettingError, Settings, State};
use penup::machine::{Target, TargetList, Value};
use penup::motion::LimitsError;
use penup_host_tests::event_checker::{Backlash, backlash_steps};
use penup_host_tests::pin_machine::{self, Turn};

/// Steps per millimetre of the default settings.
const STEPS_PER_MM: f64 = 80.0;

/// Two strokes of ten loops each, as in handwriting: each motor turns round twenty times in each.
fn loops() -> Vec<Target> {
    let mut targets = Vec::new();
    for line in 0..2 {
        for chord in 0..=900 {
            let turns = f64::from(chord) / 90.0;
            let (sine, cosine) = (turns * std::f64::consts::TAU).sin_cos();
            let x = 10.0 + 2.5 * turns + 1.5 * sine;
            let y = 20.0 + 10.0 * f64::from(line) + 2.0 * (1.0 - cosine);
            let point = point((x * STEPS_PER_MM).round() as i32, (y * STEPS_PER_MM).round() as i32);
            targets.push(Target { point, ink: (chord > 0).then_some(LineType::Full) });
        }
    }
    targets
}

/// Two strokes of sharp corners, at each of which y turns round, and lines that end soon behind
/// their last corner.
fn zigzags() -> Vec<Target> {
    let mut targets = Vec::new();
    for line in 0..2 {
        for corner in 0..12 {
            let y = 1600 + 800 * line + if corner % 2 == 0 { 0 } else { 320 };
            let point = point(800 + 100 * corner, y);
            targets.push(Target { point, ink: (corner > 0).then_some(LineType::Full) });
        }
        let last = targets.last().expect("a corner").point;
        targets.push(Target { point: point(last.x - 3, last.y + 5), ink: Some(LineType::Full) });
    }
    targets
}

/// A machine with this backlash of both drives, which is taken up within this distance; mm.
fn settings(backlash: f64, within: f64) -> Settings {
    with(&[
        (Setting::BacklashX, backlash),
        (Setting::BacklashY, backlash),
        (Setting::BacklashDistance, within),
    ])
}

/// What a drive with backlash made of the pins.
struct Inked {
    /// Where the pen was on the paper, after each step that moved it.
    points: Vec<PagePoint>,
    end: PagePoint,
    /// From the first to the last step of the strokes, in seconds.
    seconds: f64,
    /// The steps by which backlash was taken up at rest.
    at_rest: u32,
    /// The greatest acceleration of a motor over any 24 ms, in mm/s².
    acceleration: f64,
}

/// Draws `targets`. `visit` is called at each iteration of the main loop, every millisecond, and
/// ends the run by returning `false`.
///
/// # Panics
/// Panics if the machine's position is ever another than that of the pen.
fn draw(
    settings: Settings,
    targets: &[Target],
    visit: &mut dyn FnMut(&mut Turn<'_, '_>) -> bool,
) -> Inked {
    let mut path = TargetList::new(targets);
    let mut seen = Vec::new();
    let (mut at_rest, mut backlash_before) = (0, point(0, 0));
    let trace = pin_machine::run(settings, &mut path, 25_000, &mut |mut turn| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(targets)).expect("within the travel");
        }
        seen.push((turn.now, turn.motors, turn.machine.position()));
        let backlash = point(turn.motors.x - turn.pins.x, turn.motors.y - turn.pins.y);
        at_rest += backlash.x.abs_diff(backlash_before.x) + backlash.y.abs_diff(backlash_before.y);
        backlash_before = backlash;
        visit(&mut turn)
    });
    let mut inked = follow(&trace, &settings, &seen);
    inked.at_rest = at_rest;
    inked
}

/// Follows the pins with a drive that has backlash, and compares where the machine said that it
/// was.
fn follow(trace: &[Stamped], settings: &Settings, seen: &[(u64, PagePoint, PagePoint)]) -> Inked {
    let mut drives = backlash_steps(settings).map(Backlash::new);
    let (mut up, mut height) = ([true; 2], 0);
    let (mut motors, mut pen) = (point(0, 0), point(0, 0));
    let mut seen = seen.iter().peekable();
    let mut compared = 0;
    let (mut points, mut seconds, mut begun) = (Vec::new(), 0.0, None);
    let mut waves = [Vec::new(), Vec::new()];
    for stamped in trace.chunk_by(|one, next| one.time == next.time) {
        let time = stamped[0].time;
        while let Some(&(now, at, position)) = seen.next_if(|turn| turn.0 < time) {
            // The main loop may not have counted the last step yet.
            if at == motors {
                assert_eq!(position, pen, "{now}");
                compared += 1;
            }
        }
        let mut moved = [0; 2];
        let mut step = |axis: usize, up: bool| moved[axis] = if up { 1 } else { -1 };
        for stamped in stamped {
            match stamped.change {
                Change::UpX(is_up) => up[0] = is_up,
                Change::UpY(is_up) => up[1] = is_up,
                Change::StepX(true) => step(0, up[0]),
                Change::StepY(true) => step(1, up[1]),
                Change::Pen(to) => (height, begun) = (to, None),
                _ => {}
            }
        }
        if moved == [0; 2] {
            continue;
        }
        motors = point(motors.x + moved[0], motors.y + moved[1]);
        let now = time as f64 / 25e6;
        for (wave, (moved, at)) in waves.iter_mut().zip(moved.into_iter().zip([motors.x, motors.y]))
        {
            if moved != 0 {
                wave.push((now, f64::from(at) / STEPS_PER_MM));
            }
        }
        pen = point(pen.x + drives[0].turn(moved[0]), pen.y + drives[1].turn(moved[1]));
        if height >= 64 {
            seconds += begun.map_or(0.0, |before| now - before);
            begun = Some(now);
            points.push(pen);
        }
    }
    assert!(compared > 100, "compared {compared} times");
    let acceleration = waves.iter().map(|wave| greatest_acceleration(wave)).fold(0.0, f64::max);
    Inked { points, end: pen, seconds, at_rest: 0, acceleration }
}

/// The second difference of the places that a motor reaches at these times, over twice 12 ms.
fn greatest_acceleration(wave: &[(f64, f64)]) -> f64 {
    const WINDOW: f64 = 0.012;
    let at = |time: f64| match wave.partition_point(|step| step.0 <= time) {
        0 => 0.0,
        index if index == wave.len() => wave[index - 1].1,
        index => {
            let (before, after) = (wave[index - 1], wave[index]);
            before.1 + (after.1 - before.1) * (time - before.0) / (after.0 - before.0)
        }
    };
    let end = wave.last().map_or(0.0, |step| step.0);
    (12..(end * 1000.0) as u32)
        .map(|millisecond| {
            let time = f64::from(millisecond) / 1000.0;
            let difference = at(time + WINDOW) - 2.0 * at(time) + at(time - WINDOW);
            (difference / WINDOW.powi(2)).abs()
        })
        .fold(0.0, f64::max)
}

/// The greatest distance of a point of the ink from the lines of `targets`, and of an end of these
/// lines from the ink, in millimetres.
fn deviation(inked: &Inked, targets: &[Target]) -> [f64; 2] {
    let mm =
        |point: PagePoint| (f64::from(point.x) / STEPS_PER_MM, f64::from(point.y) / STEPS_PER_MM);
    let distance = |point: (f64, f64), from: (f64, f64), to: (f64, f64)| {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let along = ((point.0 - from.0) * dx + (point.1 - from.1) * dy) / (dx * dx + dy * dy);
        let along = along.clamp(0.0, 1.0);
        (point.0 - from.0 - along * dx).hypot(point.1 - from.1 - along * dy)
    };
    let lines: Vec<_> = targets
        .windows(2)
        .filter(|ends| ends[1].ink.is_some())
        .map(|ends| (mm(ends[0].point), mm(ends[1].point)))
        .collect();
    let off = inked.points.iter().map(|&ink| {
        lines.iter().map(|&(from, to)| distance(mm(ink), from, to)).fold(f64::MAX, f64::min)
    });
    let missed = lines.iter().map(|&(_, to)| {
        inked
            .points
            .iter()
            .map(|&ink| (mm(ink).0 - to.0).hypot(mm(ink).1 - to.1))
            .fold(f64::MAX, f64::min)
    });
    [off.fold(0.0, f64::max), missed.fold(0.0, f64::max)]
}

#[test]
fn backlash_is_taken_up_without_a_stop_and_near_the_lines() {
    let draw = |settings, targets: &[Target]| {
        draw(settings, targets, &mut |turn| turn.now == 0 || !is_ready(turn.machine))
    };
    // Of 0.1 mm of backlash, the loops and the zigzags: how far the ink may be off, in mm.
    for (targets, reversals, most) in [(loops(), 80, 0.045), (zigzags(), 24, 0.035)] {
        let end = targets.last().expect("a target").point;
        let tight = draw(settings(0.0, 0.0), &targets);
        let at_rest = draw(settings(0.1, 0.0), &targets);
        // Eight steps each time.
        assert!(at_rest.at_rest >= 8 * (reversals - 6), "{}", at_rest.at_rest);
        for (within, most) in [(0.3, most), (1.0, 2.2 * most)] {
            let smooth = draw(settings(0.1, within), &targets);
            let [off, missed] = deviation(&smooth, &targets);
            println!(
                "{reversals} turns: {:.2} s without backlash, {:.2} s at rest, {:.2} s within \
                 {within} mm; {} steps at rest; the ink is off by {off:.3} mm, and misses \
                 {missed:.3} mm; {:.0} mm/s2, {:.0} without backlash",
                tight.seconds,
                at_rest.seconds,
                smooth.seconds,
                smooth.at_rest,
                smooth.acceleration,
                tight.acceleration,
            );
            assert_eq!(smooth.end, end);
            assert!(off <= most && missed <= most, "{off} {missed}");
            // At the beginning of strokes only, and on the travels to them.
            assert!(smooth.at_rest <= 8 * 4, "{}", smooth.at_rest);
            assert!(smooth.seconds < 1.04 * tight.seconds, "{}", smooth.seconds);
            assert!(smooth.seconds < at_rest.seconds - 0.02 * f64::from(reversals));
            // 800 mm/s² are the limit. A corner counts as rounded by the junction deviation.
            assert!(smooth.acceleration <= 1.25 * tight.acceleration.max(1000.0));
        }
    }
}

#[test]
fn with_a_limit_on_jerk_it_is_the_same() {
    let targets = loops();
    let mut settings = settings(0.1, 0.5);
    settings.set(Setting::Jerk, Value::from_num(20)).expect("valid");
    let inked = draw(settings, &targets, &mut |turn| turn.now == 0 || !is_ready(turn.machine));
    let [off, missed] = deviation(&inked, &targets);
    assert!(off <= 0.065 && missed <= 0.065, "{off} {missed}");
    assert!(inked.at_rest <= 8 * 4, "{}", inked.at_rest);
}

/// Wherever the machine is interrupted, it knows where the pen is: [`draw`] compares it.
#[test]
fn the_position_stays_known_whatever_interrupts_the_backlash() {
    let targets = zigzags();
    for case in 0..60u64 {
        let instant = 12_000_000 + 1_370_000 * case;
        let (mut ordered, mut begun_again) = (false, false);
        let inked = draw(settings(0.25, 0.8), &targets, &mut |turn| {
            if turn.now >= instant && !ordered {
                ordered = true;
                match case % 3 {
                    0 => turn.machine.hold(),
                    1 => turn.machine.abort(),
                    _ => turn.machine.alarm(Alarm::EmergencyStop),
                }
            }
            match turn.machine.state() {
                State::Hold { stopped: true } if turn.machine.is_stopped() => turn.machine.resume(),
                State::Alarm(_) if turn.machine.is_stopped() => {
                    let _ = turn.machine.unlock();
                }
                State::Idle if ordered && !begun_again && is_ready(turn.machine) => {
                    // The backlash goes on from where it is.
                    begun_again = true;
                    if case % 3 > 0 {
                        let mut first = TargetList::new(&targets);
                        turn.machine.start(&mut first).expect("within the travel");
                    }
                }
                _ => {}
            }
            !(begun_again && is_ready(turn.machine))
        });
        if case % 3 == 0 {
            assert_eq!(inked.end, targets.last().expect("a target").point, "{instant}");
        }
    }
}

#[test]
fn belts_take_backlash_up_at_rest_only() {
    let refused = Err(SettingError::Conflict(LimitsError::BacklashOfBelts));
    let mut settings = settings(0.1, 0.5);
    assert_eq!(settings.set(Setting::Kinematics, Value::from_num(2)), refused);
    let mut settings = crate::fixtures::polargraph();
    assert_eq!(settings.set(Setting::BacklashDistance, Value::ONE), refused);
}

/// A path whose targets all come but the last ones, which are late. The machine waits for them.
struct Late {
    targets: Vec<Target>,
    next: usize,
    /// The number of targets that have come.
    come: usize,
}

impl Path for Late {
    fn next_target(&mut self) -> Option<Target> {
        let target = *self.targets[..self.come].get(self.next)?;
        self.next += 1;
        Some(target)
    }

    fn rewind(&mut self) {
        self.next = 0;
    }

    fn late(&self) -> Option<PendingTarget> {
        let is_late = self.next == self.come && self.come < self.targets.len();
        is_late.then_some(PendingTarget { within_stroke: true })
    }
}

/// A line to the right, and 2 mm of the way back, within which half the backlash is taken up.
fn short_way_back() -> [Target; 3] {
    let target = |x, ink: Option<LineType>| Target { point: point(x, 800), ink };
    [target(800, None), target(4000, Some(LineType::Full)), target(3840, Some(LineType::Full))]
}

#[test]
fn a_line_whose_next_moves_are_late_is_drawn_to_its_end() {
    let settings = settings(0.5, 5.0);
    for sent_alone in [true, false] {
        let mut path = Late { targets: short_way_back().to_vec(), next: 0, come: 3 };
        path.targets.push(Target { point: point(3840, 1600), ink: Some(LineType::Full) });
        let (mut sent, mut waited) = (0, 0);
        let mut seen = Vec::new();
        let trace = pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
            let machine = turn.machine;
            seen.push((turn.now, turn.motors, machine.position()));
            let begins = turn.now == 0;
            if sent_alone && sent < 3 {
                machine.draw_to(path.targets[sent], None).expect("room");
                sent += 1;
            } else if begins {
                let [least, greatest] = [point(800, 800), point(4000, 1600)];
                let size = JobSize { strokes: 1, ..JobSize::default() };
                machine.start_streamed(size, [least, greatest]).expect("within the travel");
            }
            if sent_alone {
                machine.fill(&mut TargetList::new(&[]), queue);
            } else {
                machine.fill(&mut path, queue);
            }
            waited = if machine.is_stopped() && !begins { waited + 1 } else { 0 };
            waited < 100
        });
        let inked = follow(&trace, &settings, &seen);
        assert_eq!(inked.end, point(3840, 800), "{sent_alone}");
        let (_, motors, position) = seen.last().expect("a turn");
        assert_eq!(*position, point(3840, 800));
        // All 40 steps of the backlash are taken up.
        assert_eq!(*motors, point(3800, 800), "{sent_alone}");
        assert!(inked.points.contains(&point(3840, 800)), "{sent_alone}");
    }
}

#[test]
fn a_rest_within_a_stroke_is_at_the_end_of_the_line() {
    let targets = zigzags();
    let mut settings = settings(0.3, 5.0);
    settings.set(Setting::PointDistance, Value::from_num(0.001)).expect("valid");
    let inked = draw(settings, &targets, &mut |turn| turn.now == 0 || !is_ready(turn.machine));
    let [_, missed] = deviation(&inked, &targets);
    assert!(missed < 1.5 / STEPS_PER_MM, "{missed}");
}
