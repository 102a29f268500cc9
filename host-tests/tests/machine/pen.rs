//! The pen: a motor or a servo that lifts it, ramps, changes of pens, and pauses.

use crate::fixtures::{ink, is_ready, job, lifted, to};
use penup::machine::{Setting, SettingError, Settings, State, TargetList, Value};
use penup::motion::{EventKind, LimitsError};
use penup::step::tape;
use penup_host_tests::transcript::transcript;
use penup_host_tests::{event_checker, pin_machine};

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
    let expected = "\
> restarted
< ok
> unlock
< State(Alarm(Restarted))
> wait 1
= the pen at height 20
= drivers on
= the pen's motor up 451 steps
= the pen's motor down 62 steps
= drivers off
= Alarm(Restarted) at 0,0
> unlock
< ok
> jog 50,60
< ok
> wait
= drivers on
= the pen's motor up 451 steps
= the pen's motor down 62 steps
= up 60 steps to 50,60
= Idle at 50,60
";
    assert_eq!(transcript(lifted(Settings::default(), true), expected), expected);
}

#[test]
fn a_height_that_changes_in_a_hold_counts_when_the_pen_goes_down_again() {
    let expected = "\
> job ink 4000,0 to 0,0
< ok, strokes: 1
> wait 0.3
= drivers on
= down 475 steps to 475,0
= Run at 475,0
> $211=100
< Busy
> hold
< ok
> wait
= down 530 steps to 1005,0
= Hold at 1005,0
> $211=100
< ok
> $100=70
< Busy
> resume
< ok
> wait
= the pen at height 100
= down 2995 steps to 4000,0
= up 4000 steps to 0,0
= Idle at 0,0
";
    assert_eq!(transcript(Settings::default(), expected), expected);
}

#[test]
fn a_motor_that_slept_looks_for_its_stop_again() {
    let expected = "\
> job ink 50,60 to 0,0
< ok, strokes: 1
> wait
= drivers on
= the pen's motor up 451 steps
= the pen's motor down 400 steps
= down 60 steps to 50,60
= the pen's motor up 338 steps
= the pen at height 20
= up 60 steps to 0,0
= Idle at 0,0
> sleep
< ok
> wait
= drivers off
= Sleep at 0,0
> unlock
< ok
> job ink 50,60 to 0,0
< ok, strokes: 1
> wait
= drivers on
= the pen's motor up 451 steps
= the pen's motor down 400 steps
= down 60 steps to 50,60
= the pen's motor up 338 steps
= the pen at height 20
= up 60 steps to 0,0
= Idle at 0,0
";
    assert_eq!(transcript(lifted(Settings::default(), true), expected), expected);
}

#[test]
fn a_motor_of_the_pen_that_steps_too_fast_is_refused() {
    let mut settings = lifted(Settings::default(), true);
    let refused = settings.set(Setting::MaxRateZ, Value::from_num(1600));
    let too_many = LimitsError::TooManySteps { asked: 10_666, possible: 10_000 };
    assert_eq!(refused, Err(SettingError::Conflict(too_many)));
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
    let expected = "\
> job to 100,0 ink 300,0 pen 2 to 400,0 ink 500,100 to 0,0
< ok, strokes: 2
> wait
= drivers on
= up 100 steps to 100,0
= down 200 steps to 300,0
= Hold for pen 2 at 300,0
> resume
< ok
> wait
= up 100 steps to 400,0
= down 100 steps to 500,100
= up 500 steps to 0,0
= Idle at 0,0
";
    assert_eq!(transcript(Settings::default(), expected), expected);
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
            if turn.machine.state() == (State::Hold { stopped: true }) && turn.machine.is_stopped()
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
        settings.set(Setting::Tool, Value::ONE).expect("valid");
        settings.set(Setting::TravelZ, Value::from_num(travel)).expect("valid");
        settings.set(Setting::MaxRateZ, Value::from_num(rate)).expect("valid");
        let mut estimate = 0;
        let mut time = 0;
        let mut path = TargetList::new(&targets);
        pin_machine::run(settings, &mut path, 25_000, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
                estimate = turn.machine.status().seconds_left;
            }
            time = turn.now;
            !is_ready(turn.machine)
        });
        // The search for the upper stop, which comes before everything else, is not included.
        let search = 1.125 * travel * 4.0 / (rate / 60.0);
        let truth = (time as f64 / 25e6 - search) as u32;
        assert!(
            truth > 10 && estimate.abs_diff(truth) <= 1 + truth / 20,
            "{estimate} s, not {truth}"
        );
    }
}
