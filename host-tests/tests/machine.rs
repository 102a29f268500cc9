//! Tests of jobs that run through the real interrupt code: hold, resume, abort, alarm, sleep.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PagePoint};
use penup::machine::{
    Alarm, Axis, Machine, MachineError, Path, PulserState, Setting, SettingError, Settings, State,
    Switches, TapePath, Target, TargetList, Value,
};
use penup::motion::{Block, EventKind, LimitsError};
use penup::step::tape;
use penup_host_tests::event_checker::{self, Drawn, Backlash};
use penup_host_tests::pin_machine::{self, Turn};
use proptest::prelude::*;
use std::sync::LazyLock;

fn point(x: i32, y: i32) -> PagePoint {
    PagePoint { x, y }
}

fn to(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: None }
}

fn ink(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Full) }
}

fn dotted(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Dotted) }
}

fn job() -> Vec<Target> {
    vec![
        to(400, 300),
        ink(1200, 300),
        ink(1200, 900),
        ink(1190, 910),
        ink(400, 300),
        to(50, 60),
        dotted(900, 333),
        ink(900, 333),
        ink(20, 1000),
        to(0, 0),
    ]
}

fn with(values: &[(Setting, f64)]) -> Settings {
    let mut settings = Settings::default();
    for &(setting, value) in values {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// The settings of a machine with 23 and 15 steps of backlash, or without any.
fn slack(loose: bool) -> Settings {
    let slack = f64::from(u8::from(loose));
    with(&[(Setting::BacklashX, 0.3 * slack), (Setting::BacklashY, 0.2 * slack)])
}

/// The settings of a machine whose pen is lifted by a motor, or by a servo.
fn lifted(mut settings: Settings, by_a_motor: bool) -> Settings {
    for (setting, value) in [
        (Setting::TravelZ, 1.0),
        (Setting::MaxRateZ, 900.0),
        (Setting::AccelerationZ, 500.0),
        (Setting::PenUpHeight, 20.0 * f64::from(u8::from(by_a_motor))),
        (Setting::PenLift, f64::from(u8::from(by_a_motor))),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// Draws the job in a pin machine. `visit` is called at each iteration of the main loop, which
/// takes `turn_ticks`, and ends the run by returning `false`.
fn run_job(
    settings: Settings,
    turn_ticks: u64,
    visit: &mut dyn FnMut(Turn<'_, '_>) -> bool,
) -> Drawn {
    let targets = job();
    let mut path = TargetList::new(&targets);
    let trace = pin_machine::run(settings, &mut path, turn_ticks, &mut |turn| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(&job())).expect("valid");
        }
        assert_eq!(turn.machine.position(), turn.pins);
        visit(turn)
    });
    event_checker::check_pins(&trace, &settings)
}

fn is_ready(machine: &Machine<'_>) -> bool {
    machine.state() == State::Idle && machine.is_stopped()
}

fn never_cancel() -> Drawn {
    run_job(Settings::default(), 25_000, &mut |turn| !is_ready(turn.machine))
}

#[test]
fn a_job_is_drawn_and_the_pins_end_where_the_path_does() {
    let drawn = never_cancel();
    assert_eq!(drawn.end, point(0, 0));
    // 800 + 600 + 10 + 790 moves, the line from (900, 333) to (20, 1000), and about half the dots.
    assert!(drawn.inked.len() > 800 + 600 + 10 + 790 + 880);
    assert_eq!(drawn.pen, 0);
}

/// An instant of the job and the length of a main loop iteration, both in ticks.
fn instants() -> impl Strategy<Value = (u64, u64)> {
    (1u64..100_000_000, 5_000u64..200_000)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn hold_and_resume_leave_the_same_ink(
        (instant, turn_ticks) in instants(),
        again in 0u64..9_000_000,
        loose: bool,
        by_a_motor: bool,
    ) {
        static UNDISTURBED: LazyLock<Drawn> = LazyLock::new(never_cancel);
        let mut holds = vec![instant + again, instant];
        let settings = lifted(slack(loose), by_a_motor);
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
            if holds.last().is_some_and(|&due| turn.now >= due) {
                holds.pop();
                turn.machine.hold();
            }
            if turn.machine.state() == (State::Hold { standing: true }) && turn.machine.is_stopped() {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                turn.machine.resume();
            }
            !is_ready(turn.machine)
        });
        prop_assert_eq!(&drawn.inked, &UNDISTURBED.inked);
        prop_assert_eq!(drawn.end, UNDISTURBED.end);
        prop_assert_eq!((drawn.pen, drawn.lift), raised(by_a_motor));
        event_checker::check_speed(&drawn.runs, &job(), &Settings::default(), false);
    }

    #[test]
    fn abort_keeps_the_position_and_leaves_the_machine_ready(
        (instant, turn_ticks) in instants(),
        loose: bool,
        by_a_motor: bool,
    ) {
        let mut stood_at = None;
        let drawn = run_job(lifted(slack(loose), by_a_motor), turn_ticks, &mut |turn| {
            if turn.now >= instant {
                turn.machine.abort();
            }
            if turn.now > instant && is_ready(turn.machine) {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                stood_at = Some(turn.pins);
            }
            stood_at.is_none()
        });
        prop_assert_eq!(Some(drawn.end), stood_at);
        prop_assert_eq!((drawn.pen, drawn.lift), raised(by_a_motor));
        event_checker::check_speed(&drawn.runs, &job(), &Settings::default(), false);
        // The next job begins where this one was aborted.
        prop_assert!(drawn.last_step < instant + turn_ticks + 10_000_000);
    }

    #[test]
    fn an_alarm_stops_the_pins_at_once(
        (instant, turn_ticks) in instants(),
        switch: bool,
        loose: bool,
        by_a_motor: bool,
    ) {
        let alarm = if switch { Alarm::HardLimit } else { Alarm::EmergencyStop };
        let mut alarm_at = None;
        let mut stands_at = None;
        let drawn = run_job(lifted(slack(loose), by_a_motor), turn_ticks, &mut |turn| {
            let Some(time) = alarm_at else {
                if turn.now >= instant {
                    turn.machine.alarm(alarm);
                    alarm_at = Some(turn.now);
                }
                return true;
            };
            // A pulse that was high counts when it ends, which is before this iteration.
            let pins = *stands_at.get_or_insert(turn.pins);
            assert_eq!(turn.pins, pins);
            assert_eq!(turn.machine.state(), State::Alarm(alarm));
            if turn.machine.unlock().is_err() {
                // The current event may be a dwell, and a motor raises the pen.
                assert!(turn.now < time + 5_000_000 + u64::from(by_a_motor) * 8_000_000);
                return true;
            }
            assert_eq!(turn.machine.planned_position(), pins);
            assert!(turn.machine.is_stopped());
            false
        });
        let (time, pins) = alarm_at.zip(stands_at).expect("given");
        event_checker::check_speed(&drawn.runs, &job(), &Settings::default(), true);
        prop_assert!(drawn.last_step < time);
        prop_assert_eq!(drawn.end, pins);
        if by_a_motor && drawn.runs.iter().any(|run| run.height == 20) {
            prop_assert_eq!((drawn.pen, drawn.lift), raised(true));
        } else {
            // The position of the pen's motor was not known yet, or there is no such motor.
            prop_assert_eq!(drawn.pen, 0);
        }
    }
}

/// The pen's height and the steps of its motor when the pen is raised.
fn raised(by_a_motor: bool) -> (u8, i32) {
    // The height is 20 of 127, and the motor has 400 steps.
    if by_a_motor { (20, 62) } else { (0, 0) }
}

#[test]
fn a_motor_lowers_the_pen_on_the_same_moves_and_tape() {
    let targets = job();
    let instructions = |settings| {
        let events = pin_machine::record(settings, &mut TargetList::new(&targets), 64);
        let events = events.expect("within the travel");
        event_checker::check(&events, &settings);
        let lifts = events.iter().filter(|event| matches!(event.kind(), EventKind::Lift { .. }));
        let tape: Vec<_> = events.iter().filter_map(|event| event.instruction()).collect();
        (lifts.count(), tape)
    };
    let (none, mut by_servo) = instructions(Settings::default());
    let (steps, by_motor) = instructions(lifted(Settings::default(), true));
    // The motor raises the pen before the first move.
    by_servo.insert(0, tape::Instruction::PenUp);
    assert_eq!(by_motor, by_servo);
    let heights = by_motor.iter().filter(|instruction| {
        matches!(instruction, tape::Instruction::PenUp | tape::Instruction::PenDown)
    });
    // There are 451 steps to find the stop, 62 down from it, and 338 and a direction for each
    // change.
    assert_eq!((none, steps), (0, 452 + 63 + 339 * (heights.count() - 1)));
}

#[test]
fn after_a_restart_a_motor_raises_the_pen_and_then_has_no_current() {
    let settings = lifted(Settings::default(), true);
    let targets = job();
    let mut path = TargetList::new(&targets);
    let mut stage = 0;
    let trace = pin_machine::run(settings, &mut path, 25_000, &mut |turn| {
        match stage {
            0 => turn.machine.alarm(Alarm::Restarted),
            1 => assert_eq!(turn.machine.unlock(), Err(MachineError::State(turn.machine.state()))),
            _ => {}
        }
        stage += 1;
        // There are 451 steps at 1500 per second and 62 at 6000, and 150 ms of dwell.
        turn.now < 25_000_000
    });
    let drawn = event_checker::check_pins(&trace, &settings);
    assert_eq!((drawn.pen, drawn.lift), raised(true));
    let last = trace.last().map(|stamped| stamped.change);
    assert_eq!(last, Some(penup::boards::host::Change::Enable(false)));
}

#[test]
fn a_motor_that_slept_looks_for_its_stop_again() {
    let settings = lifted(Settings::default(), true);
    let targets = [ink(50, 60), to(0, 0)];
    let mut path = TargetList::new(&targets);
    let mut jobs = 0;
    let trace = pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        if turn.machine.state() == State::Sleep && turn.machine.is_stopped() {
            turn.machine.unlock().expect("asleep");
        } else if is_ready(turn.machine) {
            jobs += 1;
            match jobs {
                2 => turn.machine.sleep().expect("idle"),
                4 => return false,
                _ => {
                    let size = turn.machine.start(&mut path);
                    assert_eq!(size.expect("valid").strokes, 1);
                }
            }
        }
        turn.machine.fill(&mut path, queue);
        true
    });
    event_checker::check_pins(&trace, &settings);
    let steps =
        trace.iter().filter(|stamped| stamped.change == penup::boards::host::Change::StepZ(true));
    // Each time up against the stop and down from it; down and up.
    assert_eq!(steps.count(), 2 * (451 + 62 + 2 * 338));
}

#[test]
fn a_motor_of_the_pen_that_steps_too_fast_is_refused() {
    let mut settings = lifted(Settings::default(), true);
    let refused = settings.set(Setting::MaxRateZ, Value::from_num(1600));
    let too_many = LimitsError::TooManySteps { asked: 10_666, possible: 10_000 };
    assert_eq!(refused, Err(SettingError::Conflict(too_many)));
}

/// Pseudo-random numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        // Knuth's MMIX.
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) % bound
    }
}

/// Long moves, a dense circle and a zigzag, so that at every instant something different is fast.
fn fast_job() -> Vec<Target> {
    let mut targets = vec![to(9000, 500)];
    for chord in 0..=180 {
        let angle = f64::from(chord) * std::f64::consts::TAU / 180.0;
        let (x, y) = (8000.0 + 1000.0 * angle.cos(), 2000.0 + 1000.0 * angle.sin());
        targets.push(ink(x.round() as i32, y.round() as i32));
    }
    targets.extend([to(500, 7000), ink(4000, 7400), ink(7500, 7000), ink(7600, 6900)]);
    targets.extend((0..8).map(|line| ink(6000 - 300 * line, 3000 + 900 * (line % 2))));
    targets.push(to(0, 0));
    targets
}

/// Draws the fast job while the main loop is stalled for `pause` ticks from `instant` on. Also
/// returns how often the queue ran dry.
fn starve(settings: Settings, instant: u64, pause: u64, turn_ticks: u64) -> (Drawn, u32) {
    let targets = fast_job();
    let mut path = TargetList::new(&targets);
    let mut underruns = 0;
    let trace = pin_machine::run_with(settings, turn_ticks, &mut |turn, queue| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
        }
        assert_eq!(turn.machine.position(), turn.pins);
        if !(instant..instant + pause).contains(&turn.now) {
            turn.machine.fill(&mut path, queue);
        }
        underruns = turn.machine.underruns();
        !is_ready(turn.machine)
    });
    (event_checker::check_pins(&trace, &settings), underruns)
}

/// Delays the main loop `count` times, each in a job of its own, and measures the acceleration
/// against that of `allowed`.
fn starve_often(settings: Settings, allowed: Settings, count: u32) {
    let never_cancel = starve(settings, 0, 0, 25_000).0;
    let mut random = Random(1971);
    let mut underruns = 0;
    for _ in 0..count {
        let instant = random.below(never_cancel.last_step);
        // The delay is 0.05 s to 2 s, and iterations before and after it take 0.2 ms to 4 ms.
        let pause = 1_250_000 + random.below(48_750_000);
        let (drawn, dry) = starve(settings, instant, pause, 5_000 + random.below(95_000));
        underruns += dry;
        assert_eq!(drawn.inked, never_cancel.inked);
        assert_eq!((drawn.end, drawn.pen), (never_cancel.end, 0));
        // From rest to rest, the acceleration over any 5 ms must be within 1.05 of the limit.
        event_checker::check_speed(&drawn.runs, &fast_job(), &allowed, false);
    }
    // In the other jobs, the delay came while the pen moved, or was shorter than the queue lasted.
    assert!((count / 2..=count).contains(&underruns), "{underruns} of {count}");
}

#[test]
fn a_main_loop_that_is_late_brakes_the_machine_on_the_path() {
    starve_often(Settings::default(), Settings::default(), 200);
    starve_often(slack(true), slack(true), 20);
}

#[test]
fn steps_of_any_length_and_slow_drivers_are_braked_as_well() {
    let settings = with(&[
        (Setting::StepsPerMmX, 100.0),
        (Setting::DirectionSetup, 20.0),
        (Setting::TravelSpeed, 4000.0),
    ]);
    starve_often(settings, settings, 40);
}

#[test]
fn an_underrun_keeps_the_acceleration_where_jerk_is_limited() {
    // The jerk limit is not respected here, because the interrupt does not know it.
    let allowed = with(&[(Setting::StepsPerMmX, 100.0), (Setting::TravelSpeed, 4000.0)]);
    let mut settings = allowed;
    settings.set(Setting::Jerk, Value::from_num(20)).expect("valid");
    starve_often(settings, allowed, 40);
}

#[test]
fn what_the_queue_cannot_hold_is_braked_within_what_it_holds() {
    let fast = with(&[
        (Setting::MaxRateX, 15_000.0),
        (Setting::MaxRateY, 15_000.0),
        (Setting::TravelSpeed, 15_000.0),
        (Setting::DrawSpeed, 9_000.0),
        (Setting::AccelerationX, 2000.0),
        (Setting::AccelerationY, 2000.0),
    ]);
    // 250 mm/s within 13/16 of 623 steps of 1/80 mm.
    let mut allowed = fast;
    let hardest = 250.0 * 250.0 / (2.0 * 13.0 / 16.0 * 623.0 / 80.0);
    for axis in [Setting::AccelerationX, Setting::AccelerationY] {
        allowed.set(axis, Value::from_num(hardest)).expect("valid");
    }
    starve_often(fast, allowed, 40);
}

#[test]
fn a_main_loop_that_is_in_time_is_not_slowed() {
    in_time_is_not_slowed(Settings::default());
    in_time_is_not_slowed(with(&[(Setting::Jerk, 20.0)]));
}

fn in_time_is_not_slowed(settings: Settings) {
    let targets = fast_job();
    let planned = pin_machine::record(settings, &mut TargetList::new(&targets), 128).expect("fits");
    let last = pin_machine::moves(&planned).last().map(|&(time, _)| time);
    // 0.2 ms and 10 ms.
    for turn_ticks in [5_000, 250_000] {
        let (drawn, underruns) = starve(settings, 0, 0, turn_ticks);
        assert_eq!((Some(drawn.last_step), underruns), (last, 0));
    }
}

#[test]
fn after_abort_and_alarm_the_next_job_starts_from_there() {
    // The second job would be offset by the backlash that the first one took up or did not take up.
    for (alarm, loose, instant) in
        (0..400).map(|case| (case % 2 == 1, case % 4 > 1, 1_000_000 + 220_000 * case))
    {
        let home = [ink(5, 6), to(0, 0)];
        let mut stage = 0;
        let targets = job();
        let mut first = TargetList::new(&targets);
        let mut second = TargetList::new(&home);
        let settings = slack(loose);
        let trace = pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
            match stage {
                0 => {
                    turn.machine.start(&mut first).expect("valid");
                    stage = 1;
                }
                1 if turn.now >= instant => {
                    if alarm {
                        turn.machine.alarm(Alarm::EmergencyStop);
                    } else {
                        turn.machine.abort();
                    }
                    stage = 2;
                }
                2 if turn.now >= instant + 30_000_000 => {
                    assert_eq!(turn.machine.unlock().is_ok(), alarm);
                    turn.machine.start(&mut second).expect("idle");
                    stage = 3;
                }
                3 if is_ready(turn.machine) => return false,
                _ => {}
            }
            if stage < 3 {
                turn.machine.fill(&mut first, queue);
            } else {
                turn.machine.fill(&mut second, queue);
            }
            true
        });
        let drawn = event_checker::check_pins(&trace, &settings);
        assert_eq!((drawn.end, drawn.pen), (point(0, 0), 0));
        assert!(drawn.inked.iter().any(|ends| ends.0 == point(5, 6) || ends.1 == point(5, 6)));
    }
}

#[test]
fn slack_is_taken_up_at_rest_and_leaves_the_same_ink() {
    let [tight, loose] = [false, true].map(|loose| starve(slack(loose), 0, 0, 25_000).0);
    assert_eq!((&loose.inked, loose.end, loose.pen), (&tight.inked, tight.end, 0));
    event_checker::check_speed(&loose.runs, &fast_job(), &slack(true), false);
    // The circle alone reverses x twice and y twice, and the zigzag reverses y at each corner.
    assert!(loose.backlash.len() > 12 && tight.backlash.is_empty());
    for run in &loose.backlash {
        let places: Vec<f64> = (0..run.times.len()).map(|step| step as f64 / 80.0).collect();
        assert!(event_checker::backlash_steps(&slack(true)).contains(&(run.times.len() as i32)));
        let measured = event_checker::greatest_acceleration(&run.times, &places, 0.005);
        assert!(measured <= 1.05 * 800.0, "{measured} mm/s2");
    }
}

#[test]
fn a_recorded_tape_replays_to_the_same_moves_and_pen() {
    let targets = job();
    let settings = Settings::default();
    let record = |path: &mut dyn Path| {
        let events = pin_machine::record(settings, path, 64).expect("within the travel");
        events.iter().filter_map(|event| event.instruction()).collect::<Vec<_>>()
    };
    let original = record(&mut TargetList::new(&targets));
    let tape: Vec<u8> = tape::encode(original.iter().copied()).collect();
    assert!(tape.len() <= original.len() / 2 + 100);
    let replayed = record(&mut TapePath::new(point(0, 0), tape.into_iter()));
    assert_eq!(replayed, original);
}

#[test]
fn what_leads_beyond_the_travel_is_refused_before_anything_moves() {
    let pins = PulserState::new();
    let mut blocks = [Block::EMPTY; 4];
    let mut machine = Machine::new(Settings::default(), &mut blocks, &pins, u32::MAX);
    // Towards 0.
    let mm = |mm: f64| Value::from_bits((mm * 65536.0) as i32);
    // 420 mm of 80 steps.
    let targets = [to(33_600, 0), ink(33_601, 5), ink(0, 0)];
    assert_eq!(
        machine.start(&mut TargetList::new(&targets)),
        Err(MachineError::BeyondTravel { target: 1, x: mm(0.0125), y: mm(0.0) })
    );
    assert_eq!(
        machine.jog(point(0, -7), None),
        Err(MachineError::BeyondTravel { target: 0, x: mm(0.0), y: mm(-0.0875) })
    );
    assert_eq!(machine.state(), State::Idle);
    machine.set(Setting::SoftLimits, Value::ZERO).expect("idle");
    assert!(machine.start(&mut TargetList::new(&targets)).is_ok());
    assert_eq!(machine.state(), State::Run);
    assert!(machine.jog(point(0, 0), None).is_err());
    assert!(machine.sleep().is_err());
    assert!(machine.check(true).is_err());
    assert!(machine.unlock().is_err());
}

/// Homes a machine that is `start` steps away from its switches; `press` simulates these. Returns
/// the final state and the final position, in steps from the switches.
fn home(
    start: PagePoint,
    kinematics: i32,
    loose: bool,
    press: &mut dyn FnMut(PagePoint, u64) -> Switches,
) -> (State, PagePoint) {
    let mut settings = slack(loose);
    settings.set(Setting::Homing, Value::ONE).expect("valid");
    settings.set(Setting::Kinematics, Value::from_num(kinematics)).expect("valid");
    settings.set(Setting::TravelX, Value::from_num(60)).expect("valid");
    settings.set(Setting::TravelY, Value::from_num(60)).expect("valid");
    let build = settings.kinematics();
    let mut result = (State::Idle, start);
    let mut plays = event_checker::backlash_steps(&settings).map(Backlash::in_the_middle);
    let (mut motors, mut pen) = (point(0, 0), point(0, 0));
    let trace = pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        pen.x += plays[0].turn(turn.motors.x - motors.x);
        pen.y += plays[1].turn(turn.motors.y - motors.y);
        motors = turn.motors;
        let moved = build.page(pen);
        let place = point(start.x + moved.x, start.y + moved.y);
        let switches = press(place, turn.now);
        if turn.now == 0 {
            assert_eq!(turn.machine.state(), State::Alarm(Alarm::NotHomed));
            turn.machine.home(switches).expect("ready");
        }
        turn.machine.watch(switches);
        turn.machine.fill(&mut TargetList::new(&[]), queue);
        if turn.machine.state() == State::Idle {
            assert_eq!(turn.machine.position(), point(0, 0));
        }
        result = (turn.machine.state(), place);
        assert!(turn.now < 25_000_000 * 60, "homing takes more than a minute");
        turn.machine.state() == State::Home
    });
    if !loose {
        event_checker::check_pins(&trace, &settings);
    }
    result
}

fn corner(place: PagePoint, _now: u64) -> Switches {
    Switches { x: place.x <= 0, y: place.y <= 0 }
}

#[test]
fn homing_ends_a_pull_off_from_each_switch() {
    for (kinematics, loose) in [(0, false), (0, true), (1, false), (1, true)] {
        for start in [point(2000, 900), point(1, 1), point(4000, -100), point(-80, -80)] {
            let (state, place) = home(start, kinematics, loose, &mut corner);
            assert_eq!(state, State::Idle);
            // 2 mm of 80 steps; the second approach makes 80 steps a second.
            assert!(place.x.abs_diff(160) <= 1 && place.y.abs_diff(160) <= 1, "{place:?}");
        }
    }
}

#[test]
fn a_bouncing_switch_is_found_as_well() {
    let mut pressed_since = [None; 2];
    let mut bounce = |place: PagePoint, now: u64| {
        let mut bounced = |axis: usize, at: i32| {
            if at > 0 {
                pressed_since[axis] = None;
                return false;
            }
            let since = *pressed_since[axis].get_or_insert(now);
            now - since > 125_000 || (now / 25_000).is_multiple_of(2)
        };
        Switches { x: bounced(0, place.x), y: bounced(1, place.y) }
    };
    let (state, place) = home(point(1500, 700), 0, false, &mut bounce);
    assert_eq!(state, State::Idle);
    assert!(place.x.abs_diff(160) <= 1 && place.y.abs_diff(160) <= 1, "{place:?}");
}

#[test]
fn a_switch_that_is_stuck_or_missing_is_an_alarm() {
    let stuck = |_: PagePoint, _: u64| Switches { x: true, y: false };
    let (state, _) = home(point(500, 500), 0, false, &mut { stuck });
    assert_eq!(state, State::Alarm(Alarm::HomingFailed(Axis::X)));
    let missing = |place: PagePoint, _: u64| Switches { x: place.x <= 0, y: false };
    let (state, _) = home(point(500, 500), 0, false, &mut { missing });
    assert_eq!(state, State::Alarm(Alarm::HomingFailed(Axis::Y)));
}

#[test]
fn a_limit_switch_is_an_alarm_only_if_asked_for() {
    for hard in [false, true] {
        let mut settings = Settings::default();
        settings.set(Setting::HardLimits, Value::from_num(hard)).expect("valid");
        let targets = [to(8000, 0)];
        let mut path = TargetList::new(&targets);
        let trace = pin_machine::run(settings, &mut path, 25_000, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
            }
            turn.machine.watch(Switches { x: turn.pins.x >= 3000, y: false });
            turn.machine.state() == State::Run || !turn.machine.is_stopped()
        });
        let end = event_checker::check_pins(&trace, &settings).end.x;
        // At 8 steps per millisecond, the machine stops at most two iterations after the switch.
        assert!(if hard { (3000..3020).contains(&end) } else { end == 8000 }, "{end}");
    }
}

#[test]
fn a_core_xy_machine_draws_the_same_page() {
    let targets = job();
    let mut settings = Settings::default();
    settings.set(Setting::Kinematics, Value::ONE).expect("valid");
    let events = pin_machine::record(settings, &mut TargetList::new(&targets), 64).expect("fits");
    let corners: Vec<_> = pin_machine::moves(&events)
        .iter()
        .map(|&(_, motors)| settings.kinematics().page(motors))
        .collect();
    for target in &targets {
        assert!(corners.contains(&target.point));
    }
    assert_eq!(corners.last(), Some(&point(0, 0)));
    // It is as fast as the other build: the lengths are the same except for rounding.
    let cartesian =
        pin_machine::record(Settings::default(), &mut TargetList::new(&targets), 64).expect("fits");
    let (a, b) = (pin_machine::duration(&events), pin_machine::duration(&cartesian));
    assert!(a.abs_diff(b) < b / 100, "{a} {b}");
}

#[test]
fn a_ramp_takes_the_pen_down_step_by_step() {
    let mut settings = Settings::default();
    settings.set(Setting::PenRamp, Value::from_num(254)).expect("valid");
    let targets = [to(10, 0), ink(20, 0), to(0, 0)];
    let events = pin_machine::record(settings, &mut TargetList::new(&targets), 8).expect("fits");
    event_checker::check(&events, &settings);
    let heights: Vec<_> = events
        .iter()
        .filter_map(|event| match event.kind() {
            EventKind::Pen { height } => Some(height),
            EventKind::Levels(_) | EventKind::Lift { .. } => None,
        })
        .collect();
    let expected: Vec<_> = (1..=127).chain((0..127).rev()).collect();
    assert_eq!(heights, expected);
}

#[test]
fn the_machine_waits_for_each_change_of_the_pen() {
    struct TwoPens<'a>(TargetList<'a>, usize);
    impl Path for TwoPens<'_> {
        fn next_target(&mut self) -> Option<Target> {
            self.1 += 1;
            self.0.next_target()
        }
        fn rewind(&mut self) {
            self.1 = 0;
            self.0.rewind();
        }
        fn pen(&self) -> u8 {
            u8::from(self.1 > 2)
        }
    }
    let targets = [to(100, 0), ink(300, 0), to(400, 0), ink(500, 100), to(0, 0)];
    let mut waits = Vec::new();
    let mut path = TwoPens(TargetList::new(&targets), 0);
    let trace = pin_machine::run(Settings::default(), &mut path, 25_000, &mut |turn| {
        if turn.now == 0 {
            let mut again = TwoPens(TargetList::new(&targets), 0);
            turn.machine.start(&mut again).expect("valid");
        }
        if turn.machine.state() == (State::Hold { standing: true }) && turn.machine.is_stopped() {
            waits.push((turn.machine.status().pen_wanted, turn.pins));
            turn.machine.resume();
        }
        !is_ready(turn.machine)
    });
    assert_eq!(waits, [(Some(1), point(300, 0))]);
    let drawn = event_checker::check_pins(&trace, &Settings::default());
    assert_eq!((drawn.inked.len(), drawn.end, drawn.pen), (300, point(0, 0), 0));
}

#[test]
fn a_pause_comes_at_the_end_of_the_stroke_and_after_so_much_ink() {
    // Strokes of 400 steps, 5 mm each.
    let mut targets = Vec::new();
    for line in 1..=20 {
        targets.extend([to(0, 10 * line), ink(200, 10 * line), ink(400, 10 * line)]);
    }
    for (ink_before_pause, asked, expected) in
        [(0.0, None, vec![]), (0.0, Some(1), vec![1]), (0.024, None, vec![5, 10, 15])]
    {
        let mut settings = Settings::default();
        settings.set(Setting::InkBeforePause, Value::from_num(ink_before_pause)).expect("valid");
        let mut waits = Vec::new();
        let mut seconds = Vec::new();
        let mut time = 0;
        let mut path = TargetList::new(&targets);
        pin_machine::run(settings, &mut path, 25_000, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
                assert_eq!(turn.machine.status().job.strokes, 20);
            }
            if asked.is_some() && turn.now == 5_000_000 {
                turn.machine.pause_after_stroke();
            }
            if turn.machine.state() == (State::Hold { standing: true }) && turn.machine.is_stopped()
            {
                assert_eq!(turn.pins.x, 400);
                waits.push(turn.pins.y / 10);
                turn.machine.resume();
            }
            seconds.push(turn.machine.status().seconds_left);
            time = turn.now;
            !is_ready(turn.machine)
        });
        assert_eq!(waits, expected);
        if expected.is_empty() {
            let truth = (time / 25_000_000) as u32;
            assert!(seconds[0].abs_diff(truth) <= 1, "{} s, not {truth}", seconds[0]);
        }
        assert!(seconds.is_sorted_by(|a, b| a >= b));
        assert_eq!(seconds.last(), Some(&0));
    }
}

#[test]
fn the_time_left_counts_the_ways_of_a_pen_on_a_motor() {
    let mut targets = Vec::new();
    for line in 1..=20 {
        targets.extend([to(0, 10 * line), ink(400, 10 * line)]);
    }
    // The whole travel in a ramp, and at the maximum speed.
    for (travel, rate) in [(1.0, 1200.0), (4.0, 300.0)] {
        let mut settings = Settings::default();
        settings.set(Setting::PenLift, Value::ONE).expect("valid");
        settings.set(Setting::TravelZ, Value::from_num(travel)).expect("valid");
        settings.set(Setting::MaxRateZ, Value::from_num(rate)).expect("valid");
        let mut told = 0;
        let mut time = 0;
        let mut path = TargetList::new(&targets);
        pin_machine::run(settings, &mut path, 25_000, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
                told = turn.machine.status().seconds_left;
            }
            time = turn.now;
            !is_ready(turn.machine)
        });
        // The search for the upper stop, which comes before everything else, is not included.
        let search = 1.125 * travel * 4.0 / (rate / 60.0);
        let truth = (time as f64 / 25e6 - search) as u32;
        assert!(truth > 10 && told.abs_diff(truth) <= 1 + truth / 20, "{told} s, not {truth}");
    }
}

#[test]
fn an_override_slows_the_job() {
    let targets = [ink(8000, 0)];
    let seconds = |percent| {
        let pins = PulserState::new();
        let mut blocks = [Block::EMPTY; 8];
        let mut machine = Machine::new(Settings::default(), &mut blocks, &pins, u32::MAX);
        machine.set_override(percent);
        let mut path = TargetList::new(&targets);
        machine.start(&mut path).expect("valid");
        let mut recorder = pin_machine::Recorder::default();
        machine.fill(&mut path, &mut recorder);
        pin_machine::duration(&recorder.0) as f64 / 25e6
    };
    // 100 mm at 50 mm/s and 800 mm/s², and 0.3 s of dwell.
    assert!((seconds(100) - 2.0625 - 0.3).abs() < 0.001);
    assert!((seconds(50) - 4.03125 - 0.3).abs() < 0.001);
}

#[test]
fn a_change_of_kinematics_leaves_the_pen_where_it_is() {
    let targets = [to(1000, 400)];
    let mut path = TargetList::new(&targets);
    let mut checked = false;
    pin_machine::run(Settings::default(), &mut path, 25_000, &mut |turn| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
        }
        if is_ready(turn.machine) {
            turn.machine.set(Setting::Kinematics, Value::ONE).expect("idle");
            assert_eq!(turn.machine.position(), point(1000, 400));
            assert_eq!(turn.machine.planned_position(), point(1000, 400));
            checked = true;
        }
        !checked
    });
    assert!(checked);
}

/// A polargraph with belts of 40 steps per millimetre from anchors 900 mm apart.
fn polargraph() -> Settings {
    let mut settings = Settings::default();
    for (setting, value) in [
        (Setting::StepsPerMmX, 40.0),
        (Setting::AnchorWidth, 900.0),
        (Setting::AnchorLeft, 200.0),
        (Setting::AnchorHeight, 750.0),
        (Setting::Kinematics, 2.0),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

#[test]
fn a_polargraph_draws_in_the_time_of_any_machine() {
    let targets =
        [to(1000, 2000), ink(15_000, 14_000), ink(15_000, 500), ink(1000, 2000), ink(9000, 2100)];
    let settings = polargraph();
    let events = pin_machine::record(settings, &mut TargetList::new(&targets), 64).expect("fits");
    // The same lengths at the same speeds on the page.
    let mut plain = Settings::default();
    for setting in [Setting::StepsPerMmX, Setting::StepsPerMmY] {
        plain.set(setting, Value::from_num(40)).expect("valid");
    }
    let cartesian = pin_machine::record(plain, &mut TargetList::new(&targets), 64).expect("fits");
    let (a, b) = (pin_machine::duration(&events), pin_machine::duration(&cartesian));
    assert!(a.abs_diff(b) < b / 100, "{a} {b}");
}

#[test]
fn a_polargraph_is_homed_belt_by_belt() {
    let mut settings = polargraph();
    settings.set(Setting::Homing, Value::ONE).expect("valid");
    // The belts have these lengths at the start; the switches close at 480 mm.
    let start = point(26_000, 25_000);
    let mut belts = start;
    pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        belts = point(start.x + turn.pins.x, start.y + turn.pins.y);
        let switches = Switches { x: belts.x <= 19_200, y: belts.y <= 19_200 };
        if turn.now == 0 {
            turn.machine.home(switches).expect("ready");
        }
        turn.machine.watch(switches);
        turn.machine.fill(&mut TargetList::new(&[]), queue);
        if turn.machine.state() == State::Idle {
            let expected = settings.kinematics().page(point(20_000, 20_000));
            assert_eq!(turn.machine.position(), expected);
        }
        assert!(turn.now < 25_000_000 * 60, "homing takes more than a minute");
        turn.machine.state() == State::Home
    });
    // A pull-off of 2 mm.
    assert!(belts.x.abs_diff(19_280) <= 1 && belts.y.abs_diff(19_280) <= 1, "{belts:?}");
}
