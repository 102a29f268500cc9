//! A strict checker for event streams and for pins: it rejects everything that a real driver, motor
//! or pen would not tolerate.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::boards::host::{Change, Stamped};
use penup::drawing::PagePoint;
use penup::machine::{Setting, Settings, Target, Value};
use penup::motion::{EventKind, LiftRule, StepEvent, TICKS_PER_SECOND};
use penup::step::Line;
use std::collections::BTreeSet;

/// The motion that the events of a job amount to.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The runs between changes of the pen's height.
    pub runs: Vec<Run>,
    /// The final position.
    pub end: PagePoint,
}

/// The motion between two moves of the pen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// The pen's height.
    pub height: u8,
    /// The time in seconds from the first event of the run to the end of the last one.
    pub seconds: f64,
    /// The time of each move in seconds from the start of the run.
    pub times: Vec<f64>,
    /// The position after each move.
    pub points: Vec<PagePoint>,
}

/// Checks the events against the settings.
///
/// # Panics
/// Panics at the first event that violates a rule, with its number. The rules forbid: pulses closer
/// than twice their width, a pulse too soon after a change of its direction, a change of direction
/// during a pulse, a step beyond the soft limits, a step during the pen's dwell, while the pen's
/// motor moves, or with the drivers off, an event without duration, a pen height that differs from
/// the steps of the pen's motor, a pen that moves faster or accelerates more than set, and a stream
/// that does not end at rest with the pen up.
pub fn check(events: &[StepEvent], settings: &Settings) -> Verdict {
    let pulse = u64::from(settings.microseconds_as_ticks(Setting::StepPulse));
    let setup = u64::from(settings.microseconds_as_ticks(Setting::DirectionSetup));
    let dwell = |height: u8| {
        let lowered = i64::from(height) == settings.get(Setting::PenDownHeight).to_num::<i64>();
        let dwell = if lowered { Setting::PenDownDwell } else { Setting::PenUpDwell };
        u64::from(settings.milliseconds_as_ticks(dwell))
    };
    let travel = |travel, steps| {
        (settings.get(travel).to_num::<f64>() * settings.get(steps).to_num::<f64>()) as i32
    };
    let most = (
        travel(Setting::TravelX, Setting::StepsPerMmX),
        travel(Setting::TravelY, Setting::StepsPerMmY),
    );
    let mut at = PagePoint::default();
    let mut time = 0u64;
    let mut run_start = 0u64;
    let mut pen_ready = 0u64;
    // For x and y: the direction level, the time of its last change, and the time of the axis's
    // last pulse.
    let mut axes = [(false, None::<u64>, None::<u64>); 2];
    let mut lift = LiftWatch::new(settings, false);
    let mut runs = vec![Run::default()];
    let second = f64::from(TICKS_PER_SECOND);
    for (number, event) in events.iter().enumerate() {
        assert!(event.ticks() > 0, "event {number} takes no time");
        match event.kind() {
            EventKind::Lift { step, down } => {
                assert!(event.ticks() >= setup as u32, "event {number}: no time for the direction");
                if step {
                    lift.step(down, time);
                }
                // The pen is not ready until it has reached its height.
                pen_ready = u64::MAX;
            }
            EventKind::Pen { height } => {
                lift.assert_at(height, "an event of the pen");
                pen_ready = time + dwell(height);
                // On a ramp, the pen moves again before its dwell.
                let run = runs.last_mut().expect("never empty");
                run.seconds = time.saturating_sub(run_start) as f64 / second;
                runs.push(Run { height, ..Run::default() });
                run_start = pen_ready;
            }
            EventKind::Levels(levels) => {
                for (axis, down_bit, pulse_bit) in [
                    (0, StepEvent::DOWN_X, StepEvent::STEP_X),
                    (1, StepEvent::DOWN_Y, StepEvent::STEP_Y),
                ] {
                    let (level, changed, pulsed) = &mut axes[axis];
                    let down = levels & down_bit != 0;
                    if down != *level {
                        *level = down;
                        *changed = Some(time);
                        assert!(
                            pulsed.is_none_or(|pulsed| time >= pulsed + pulse),
                            "event {number}: direction changes during a pulse"
                        );
                    }
                    if levels & pulse_bit != 0 {
                        assert!(
                            changed.is_none_or(|changed| time >= changed + setup),
                            "event {number}: pulse too soon after the change of direction"
                        );
                        assert!(
                            pulsed.is_none_or(|pulsed| time >= pulsed + 2 * pulse),
                            "event {number}: pulses run together"
                        );
                        *pulsed = Some(time);
                    }
                }
                if event.pulses() != (0, 0) {
                    assert!(time >= pen_ready, "event {number}: moves while the pen moves");
                    assert!(levels & StepEvent::DRIVERS_ON != 0, "event {number}: drivers off");
                }
                let (dx, dy) = event.step();
                if (dx, dy) != (0, 0) {
                    at = PagePoint { x: at.x + dx, y: at.y + dy };
                    let page = settings.kinematics().page(at);
                    assert!(
                        (0..=most.0).contains(&page.x) && (0..=most.1).contains(&page.y),
                        "event {number}: beyond the travel at {at:?}"
                    );
                    let run = runs.last_mut().expect("never empty");
                    run.times.push((time - run_start) as f64 / second);
                    run.points.push(at);
                }
            }
        }
        time += u64::from(event.ticks());
    }
    assert!(time >= pen_ready, "the events end while the pen moves");
    if let Some(run) = runs.last_mut() {
        run.seconds = (time - run_start) as f64 / second;
        assert!(run.height < 64, "the events end with the pen down");
    }
    Verdict { runs, end: at }
}

/// The true position of the motor that lifts the pen; the upper stop limits it.
#[derive(Debug)]
struct LiftWatch {
    rule: Option<LiftRule>,
    acceleration: f64,
    /// Whether an alarm may stop it at once.
    may_be_cut: bool,
    /// The number of steps below the upper stop. It began at the lowest position.
    place: i32,
    /// The time, direction and speed (steps per second) of the last step.
    last: Option<(u64, bool, f64)>,
}

impl LiftWatch {
    fn new(settings: &Settings, may_be_cut: bool) -> Self {
        let value = |setting| settings.get(setting).to_num::<f64>();
        let steps = value(Setting::StepsPerMmZ);
        let acceleration = value(Setting::AccelerationZ) * steps;
        let rule = settings.is_on(Setting::PenLift).then(|| {
            let (travel, rate) =
                (value(Setting::TravelZ) * steps, value(Setting::MaxRateZ) * steps / 60.0);
            LiftRule::new(travel as i32, rate as u32, acceleration as u32)
        });
        let place = rule.map_or(0, |rule| rule.travel);
        Self { rule, acceleration, may_be_cut, place, last: None }
    }

    /// # Panics
    /// Panics if there is no such motor, at a step that comes too soon, and at too great an
    /// acceleration.
    fn step(&mut self, down: bool, time: u64) {
        let rule = self.rule.expect("a motor lifts the pen");
        self.place = (self.place + if down { 1 } else { -1 }).max(0);
        assert!(self.place <= rule.travel, "{time}: the pen is driven too low");
        let second = f64::from(TICKS_PER_SECOND);
        let mut speed = 0.0;
        if let Some((before, downward, slower)) = self.last {
            let ticks = time - before;
            assert!(ticks >= u64::from(rule.least_ticks), "{time}: the pen is too fast");
            speed = if down == downward { second / ticks as f64 } else { 0.0 };
            let slowest = self.acceleration.sqrt();
            if slower == 0.0 || speed <= slowest {
                let jerks = speed.max(slower) > 1.42 * slowest;
                assert!(!jerks || self.may_be_cut, "{time}: the pen jerks to {speed} steps/s");
            } else {
                // The time between the middles of two successive intervals. Pulses are at whole
                // ticks.
                let change = (speed - slower).abs() * 2.0 / (1.0 / speed + 1.0 / slower);
                let rounding = 2.0 * speed.max(slower).powi(3) / second;
                assert!(change <= 1.02 * self.acceleration + rounding, "{time}: {change} steps/s2");
            }
        }
        self.last = Some((time, down, speed));
    }

    /// # Panics
    /// Panics if the pen is not at `height`.
    fn assert_at(&self, height: u8, what: &str) {
        if let Some(rule) = self.rule {
            assert_eq!(self.place, rule.steps(height), "{what} at height {height}");
        }
    }
}

/// The maximum acceleration along the path, in mm/s², over windows of at least `window` seconds.
///
/// `places` are the path lengths (mm) of the plan at the start of each move, and `times` are the
/// times of these starts. The speed between two moves is assigned to the time midway between them,
/// which is exact for constant acceleration.
pub fn greatest_acceleration(times: &[f64], places: &[f64], window: f64) -> f64 {
    let speeds: Vec<(f64, f64)> = times
        .windows(2)
        .zip(places.windows(2))
        .map(|(t, s)| ((t[0] + t[1]) / 2.0, (s[1] - s[0]) / (t[1] - t[0])))
        .collect();
    let mut greatest = 0.0f64;
    let mut first = 0;
    for (index, &(time, speed)) in speeds.iter().enumerate() {
        while first < index && speeds[first + 1].0 <= time - window {
            first += 1;
        }
        let (before, slower) = speeds[first];
        if time - before >= window {
            greatest = greatest.max((speed - slower).abs() / (time - before));
        }
    }
    greatest
}

/// The maximum jerk along the path, in mm/s³. The windows are so long that a jerk of `about`
/// (mm/s³) can be determined to 8 % in spite of the errors of the places: 4 nm each, which is a
/// tick at 100 mm/s.
///
/// `places` and `times` are as in [`greatest_acceleration`]. Six times the third divided difference
/// of the places at four times is a weighted mean of the jerk between the first and the last of
/// them. The four times are at least a third of the window apart.
pub fn greatest_jerk(times: &[f64], places: &[f64], about: f64) -> f64 {
    // The weights of the places add up to 8 divided by the cube of a third of the window.
    let third = (8.0 * 4e-6 / (0.08 * about)).cbrt();
    let mut greatest = 0.0f64;
    let mut knots = [0; 4];
    for first in 0..times.len() {
        knots[0] = first;
        for k in 1..4 {
            knots[k] = knots[k].max(knots[k - 1]);
            while knots[k] < times.len() && times[knots[k]] < times[knots[k - 1]] + third {
                knots[k] += 1;
            }
            if knots[k] == times.len() {
                return greatest;
            }
        }
        let mut differences = knots.map(|knot| places[knot]);
        for order in 1..4 {
            for k in 0..4 - order {
                let time = times[knots[k + order]] - times[knots[k]];
                differences[k] = (differences[k + 1] - differences[k]) / time;
            }
        }
        greatest = greatest.max(6.0 * differences[0].abs());
    }
    greatest
}

/// The path length (mm) of the plan along `targets` from the origin at the start of each move, and
/// the point that the move leads to. The machine must be Cartesian.
fn plan(targets: &[Target], settings: &Settings) -> Vec<(f64, PagePoint)> {
    let [x, y] = settings.page_steps().map(|steps| steps.to_num::<f64>());
    let (mut at, mut start) = (PagePoint::default(), 0.0);
    let mut moves = Vec::new();
    for target in targets {
        let (dx, dy) = (target.point.x - at.x, target.point.y - at.y);
        let length = (f64::from(dx) / x).hypot(f64::from(dy) / y);
        let count = f64::from(dx.abs().max(dy.abs()));
        let mut place = start + length * 0.5 / count;
        for direction in Line::new(at, target.point) {
            at = direction.from_point(at);
            moves.push((place, at));
            place += length / count;
        }
        start += length;
    }
    moves
}

/// Checks that `runs` follow `targets` from the origin, from rest to rest between two moves of the
/// pen. `cut` tells that an alarm ended the last run.
///
/// # Panics
/// Panics if a run leaves the path; if the acceleration over any 5 ms, or over the time needed to
/// determine it to 4 %, exceeds 1.05 times the limit; if the jerk, where it is limited, exceeds 1.1
/// times the limit; and if a run does not begin or end at rest.
pub fn check_speed(runs: &[Run], targets: &[Target], settings: &Settings, cut: bool) {
    let acceleration: f64 =
        settings.get(Setting::AccelerationX).min(settings.get(Setting::AccelerationY)).to_num();
    let jerk = 1000.0 * settings.get(Setting::Jerk).to_num::<f64>();
    let plan = plan(targets, settings);
    let mut rest = plan.as_slice();
    for (number, run) in runs.iter().enumerate() {
        let (moves, later) = rest.split_at(run.points.len());
        rest = later;
        let (places, points): (Vec<f64>, Vec<PagePoint>) = moves.iter().copied().unzip();
        assert_eq!(run.points, points, "off the path");
        // The window suits two speeds, each of a step of 12.5 µm at 50 mm/s between places that are
        // exact to 4 nm.
        let window = f64::max(0.005, 0.064 / (0.04 * acceleration));
        let measured = greatest_acceleration(&run.times, &places, window);
        assert!(measured <= 1.05 * acceleration, "run {number}: {measured} mm/s2");
        if jerk > 0.0 {
            let measured = greatest_jerk(&run.times, &places, jerk);
            assert!(measured <= 1.1 * jerk, "run {number}: {measured} mm/s3, not {jerk}");
        }
        let from_rest = |times: [f64; 2], places: [f64; 2]| {
            let length = places[1] - places[0];
            let speed = length / (times[1] - times[0]);
            // The standstill is at most one move before the first of them.
            let most = (2.0 * acceleration * 2.0 * length).sqrt();
            assert!(speed <= 1.05 * most, "run {number}: {speed} mm/s beside a rest, not {most}");
        };
        let is_cut = cut && runs[number + 1..].iter().all(|later| later.points.is_empty());
        if let (&[a, b, ..], &[s, t, ..]) = (&run.times[..], &places[..]) {
            from_rest([a, b], [s, t]);
        }
        if let (&[.., a, b], &[.., s, t], false) = (&run.times[..], &places[..], is_cut) {
            from_rest([a, b], [s, t]);
        }
    }
}

/// A model of the backlash of a motor, which moves the pen only at either end of the backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Play {
    slack: i32,
    /// The offset of the motor relative to the pen at the lower end; `None` before it has moved.
    low: Option<i32>,
    beyond: i32,
}

impl Play {
    /// A motor at the end of its backlash at which its first move finds it.
    pub fn new(slack: i32) -> Self {
        Self { slack, low: None, beyond: 0 }
    }

    /// A motor in the middle of its backlash.
    pub fn in_the_middle(slack: i32) -> Self {
        Self { slack, low: Some(-slack / 2), beyond: 0 }
    }

    /// Moves the motor by `steps` and returns by how many steps the pen moves.
    pub fn turn(&mut self, steps: i32) -> i32 {
        if steps == 0 {
            return 0;
        }
        let low = *self.low.get_or_insert(if steps > 0 { -self.slack } else { 0 });
        let beyond = (self.beyond + steps).clamp(low, low + self.slack);
        let moved = self.beyond + steps - beyond;
        self.beyond = beyond;
        moved
    }
}

/// The backlash of each motor in steps.
pub fn slack_steps(settings: &Settings) -> [i32; 2] {
    let [x, y] = settings.page_steps();
    [(Setting::BacklashX, x), (Setting::BacklashY, y)]
        .map(|(slack, steps)| (settings.get(slack).to_num::<f64>() * steps.to_num::<f64>()) as i32)
}

/// The result of the changes of the pins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawn {
    /// The moves made with the pen down, with the smaller point first.
    pub inked: BTreeSet<(PagePoint, PagePoint)>,
    /// The sum of the steps.
    pub end: PagePoint,
    /// The time of the start of the last pulse, in ticks.
    pub last_step: u64,
    /// The pen's height at the end.
    pub pen: u8,
    /// The steps of the motor that lifts the pen, from its upper stop.
    pub lift: i32,
    /// The runs between changes of the pen's height.
    pub runs: Vec<Run>,
    /// The moves in which motors took up their backlash in one go, in steps of the motors.
    pub slack: Vec<Run>,
}

/// Checks the changes of the pins against the settings.
///
/// # Panics
/// Panics at the first change that violates a rule. The rules forbid: a pulse, or a pause between
/// pulses, shorter than the pulse width, a change of direction during a pulse or too shortly before
/// one, a step with the drivers off, a step before the pen's dwell is over, a step that leaves the
/// soft limits or leads further beyond them (the origin is where the pins began), a motor that
/// takes up its backlash while the other one moves the pen, and a step while the pen's motor moves
/// or is not at the pen's height.
pub fn check_pins(trace: &[Stamped], settings: &Settings) -> Drawn {
    follow_pins(trace, settings, false)
}

/// Does the same as [`check_pins`] for a job that an alarm may interrupt at any time. The pen then
/// rises at once, even during a pulse, which ends by itself.
///
/// # Panics
/// Panics as [`check_pins`] does.
pub fn check_pins_in_alarms(trace: &[Stamped], settings: &Settings) -> Drawn {
    follow_pins(trace, settings, true)
}

fn follow_pins(trace: &[Stamped], settings: &Settings, alarms: bool) -> Drawn {
    let pulse = u64::from(settings.microseconds_as_ticks(Setting::StepPulse));
    let setup = u64::from(settings.microseconds_as_ticks(Setting::DirectionSetup));
    let mut drawn = Drawn { runs: vec![Run::default()], ..Drawn::default() };
    let build = settings.kinematics();
    let second = f64::from(TICKS_PER_SECOND);
    // For x, y and z: whether the pulse is high, since when, whether the direction is up, and since
    // when.
    let mut axes = [(false, None::<u64>, true, None::<u64>); 3];
    let mut lift = LiftWatch::new(settings, true);
    let (mut enabled, mut pen_ready) = (false, 0);
    let (mut at, mut motors) = (PagePoint::default(), PagePoint::default());
    let mut plays = slack_steps(settings).map(Play::new);
    let mut takes_up = false;
    let mut index = 0;
    while let Some(&Stamped { time, .. }) = trace.get(index) {
        let mut delta = (0, 0);
        // All changes of one interrupt.
        while let Some(stamped) = trace.get(index).filter(|stamped| stamped.time == time) {
            index += 1;
            match stamped.change {
                Change::Enable(on) => enabled = on,
                Change::Pen(height) => {
                    let is_pulse = axes[0].0 || axes[1].0;
                    let may_be = alarms && height < drawn.pen;
                    assert!(!is_pulse || may_be, "{time}: the pen moves during a pulse");
                    let dwell = if height > drawn.pen {
                        Setting::PenDownDwell
                    } else {
                        Setting::PenUpDwell
                    };
                    pen_ready = time + u64::from(settings.milliseconds_as_ticks(dwell));
                    drawn.pen = height;
                    drawn.runs.push(Run { height, ..Run::default() });
                }
                Change::UpX(up) => turn(&mut axes[0], up, time),
                Change::UpY(up) => turn(&mut axes[1], up, time),
                Change::DownZ(down) => turn(&mut axes[2], down, time),
                Change::StepZ(high) => {
                    assert!(!axes[0].0 && !axes[1].0, "{time}: the pen moves during a pulse");
                    match rise(&mut axes[2], high, time, pulse, setup) {
                        0 => {}
                        steps => lift.step(steps > 0, time),
                    }
                    assert!(enabled, "{time}: the pen moves with the drivers off");
                    pen_ready = pen_ready.max(time);
                }
                Change::StepX(high) => delta.0 += rise(&mut axes[0], high, time, pulse, setup),
                Change::StepY(high) => delta.1 += rise(&mut axes[1], high, time, pulse, setup),
            }
        }
        if delta != (0, 0) {
            assert!(enabled, "{time}: step with the drivers off");
            assert!(time >= pen_ready, "{time}: step while the pen moves");
            lift.assert_at(drawn.pen, "a step with the pen");
            motors = PagePoint { x: motors.x + delta.0, y: motors.y + delta.1 };
            let moved = (plays[0].turn(delta.0), plays[1].turn(delta.1));
            if moved == (0, 0) {
                if !std::mem::replace(&mut takes_up, true) {
                    drawn.slack.push(Run::default());
                }
                let run = drawn.slack.last_mut().expect("never empty");
                run.times.push(time as f64 / second);
                run.points.push(motors);
                continue;
            }
            takes_up = false;
            assert_eq!(moved, delta, "{time}: slack is taken up while the pen moves");
            let next = PagePoint { x: at.x + delta.0, y: at.y + delta.1 };
            if drawn.pen >= 64 {
                drawn.inked.insert((at.min(next), at.max(next)));
            }
            if settings.is_on(Setting::SoftLimits) && !settings.is_on(Setting::Homing) {
                let beyond = [at, next].map(|motors| beyond(build.page(motors), settings));
                assert!(beyond[1] <= beyond[0], "{time}: out of the soft limits at {next:?}");
            }
            let run = drawn.runs.last_mut().expect("never empty");
            run.times.push(time as f64 / second);
            run.points.push(next);
            at = next;
            drawn.last_step = time;
        }
    }
    drawn.end = at;
    drawn.lift = lift.place;
    drawn
}

/// The number of steps beyond the travel.
fn beyond(page: PagePoint, settings: &Settings) -> i64 {
    let [x, y] = settings.page_steps();
    let over = |at: i32, travel: Setting, steps: Value| {
        let most = settings.get(travel).to_num::<f64>() * steps.to_num::<f64>();
        i64::from(at - at.clamp(0, most as i32)).abs()
    };
    over(page.x, Setting::TravelX, x) + over(page.y, Setting::TravelY, y)
}

type AxisPins = (bool, Option<u64>, bool, Option<u64>);

fn turn(axis: &mut AxisPins, up: bool, time: u64) {
    assert!(!axis.0, "{time}: direction changes during a pulse");
    (axis.2, axis.3) = (up, Some(time));
}

fn rise(axis: &mut AxisPins, high: bool, time: u64, pulse: u64, setup: u64) -> i32 {
    if let Some(since) = axis.1 {
        assert!(time >= since + pulse, "{time}: pulse or pause too short");
    }
    (axis.0, axis.1) = (high, Some(time));
    if !high {
        return 0;
    }
    if let Some(turned) = axis.3 {
        assert!(time >= turned + setup, "{time}: pulse too soon after the direction");
    }
    if axis.2 { 1 } else { -1 }
}
