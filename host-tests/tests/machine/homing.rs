//! Homing and limit switches.

use crate::fixtures::{point, polargraph, to, with_backlash};
use penup::boards::host::{Change, Stamped};
use penup::drawing::PagePoint;
use penup::machine::{Alarm, Axis, Setting, Settings, State, Switches, TargetList, Value};
use penup_host_tests::event_checker::{self, Backlash};
use penup_host_tests::pin_machine;

/// Homes a machine that is `start` steps away from its switches; `press` simulates these. Returns
/// the final state and the final position, in steps from the switches.
fn home(
    start: PagePoint,
    kinematics: i32,
    loose: bool,
    press: &mut dyn FnMut(PagePoint, u64) -> Switches,
) -> (State, PagePoint) {
    let mut settings = with_backlash(loose);
    settings.set(Setting::Homing, Value::ONE).expect("valid");
    settings.set(Setting::Kinematics, Value::from_num(kinematics)).expect("valid");
    settings.set(Setting::TravelX, Value::from_num(60)).expect("valid");
    settings.set(Setting::TravelY, Value::from_num(60)).expect("valid");
    let build = settings.kinematics();
    let mut result = (State::Idle, start);
    let mut backlashes = event_checker::backlash_steps(&settings).map(Backlash::in_the_middle);
    let (mut motors, mut pen) = (point(0, 0), point(0, 0));
    let trace = pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        pen.x += backlashes[0].turn(turn.motors.x - motors.x);
        pen.y += backlashes[1].turn(turn.motors.y - motors.y);
        motors = turn.motors;
        let moved = build.page(pen);
        let position = point(start.x + moved.x, start.y + moved.y);
        let switches = press(position, turn.now);
        if turn.now == 0 {
            assert_eq!(turn.machine.state(), State::Alarm(Alarm::NotHomed));
            turn.machine.home(switches).expect("ready");
        }
        turn.machine.watch(switches);
        turn.machine.fill(&mut TargetList::new(&[]), queue);
        if turn.machine.state() == State::Idle {
            assert_eq!(turn.machine.position(), point(0, 0));
        }
        result = (turn.machine.state(), position);
        assert!(turn.now < 25_000_000 * 60, "homing takes more than a minute");
        turn.machine.state() == State::Home
    });
    if !loose {
        event_checker::check_pins(&trace, &settings);
    }
    result
}

fn corner(position: PagePoint, _now: u64) -> Switches {
    Switches { x: position.x <= 0, y: position.y <= 0 }
}

#[test]
fn homing_ends_a_pull_off_from_each_switch() {
    for (kinematics, loose) in [(0, false), (0, true), (1, false), (1, true)] {
        for start in [point(2000, 900), point(1, 1), point(4000, -100), point(-80, -80)] {
            let (state, position) = home(start, kinematics, loose, &mut corner);
            assert_eq!(state, State::Idle);
            // 2 mm of 80 steps; the second approach makes 80 steps a second.
            assert!(position.x.abs_diff(160) <= 1 && position.y.abs_diff(160) <= 1, "{position:?}");
        }
    }
}

#[test]
fn a_bouncing_switch_is_found_as_well() {
    let mut pressed_since = [None; 2];
    let mut bounce = |position: PagePoint, now: u64| {
        let mut bounced = |axis: usize, at: i32| {
            if at > 0 {
                pressed_since[axis] = None;
                return false;
            }
            let since = *pressed_since[axis].get_or_insert(now);
            now - since > 125_000 || (now / 25_000).is_multiple_of(2)
        };
        Switches { x: bounced(0, position.x), y: bounced(1, position.y) }
    };
    let (state, position) = home(point(1500, 700), 0, false, &mut bounce);
    assert_eq!(state, State::Idle);
    assert!(position.x.abs_diff(160) <= 1 && position.y.abs_diff(160) <= 1, "{position:?}");
}

#[test]
fn a_switch_that_is_stuck_or_missing_is_an_alarm() {
    let stuck = |_: PagePoint, _: u64| Switches { x: true, y: false };
    let (state, _) = home(point(500, 500), 0, false, &mut { stuck });
    assert_eq!(state, State::Alarm(Alarm::HomingFailed(Axis::X)));
    let missing = |position: PagePoint, _: u64| Switches { x: position.x <= 0, y: false };
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

/// Jogs to the right, and gives homing up on its way back.
fn jog_then_home_and_abort(settings: Settings) -> Vec<Stamped> {
    let (mut jogged, mut homes, mut aborted, mut waited) = (false, false, false, 0);
    pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        let machine = turn.machine;
        let open = Switches::default();
        machine.watch(open);
        if turn.now == 0 {
            machine.unlock().expect("an alarm");
            machine.jog(point(24_000, 0), None).expect("idle");
            jogged = true;
        } else if jogged && !homes && machine.state() == State::Idle && machine.is_stopped() {
            machine.home(open).expect("idle");
            homes = true;
        } else if homes && !aborted && turn.pins.x < 12_000 {
            machine.abort();
            assert_eq!(machine.state(), State::Abort);
            aborted = true;
        }
        machine.fill(&mut TargetList::new(&[]), queue);
        let is_over = aborted && machine.state() == State::Idle && machine.is_stopped();
        waited += u32::from(is_over);
        waited < 2
    })
}

#[test]
fn homing_that_is_given_up_slows_down_as_fast_as_it_may() {
    for changes in [
        &[(Setting::Shaper, 1.0), (Setting::ShakeX, 10.0), (Setting::ShakeY, 10.0)][..],
        &[(Setting::Jerk, 2.0)],
    ] {
        let mut settings = crate::fixtures::with(&[
            (Setting::Homing, 1.0),
            (Setting::HomingSeek, 6000.0),
            (Setting::MaxRateX, 6000.0),
            (Setting::MaxRateY, 6000.0),
            (Setting::TravelX, 4000.0),
            (Setting::ShapingDeviation, 0.0),
        ]);
        for (setting, value) in changes {
            settings.set(*setting, Value::from_num(*value)).expect("valid");
        }
        let trace = jog_then_home_and_abort(settings);
        event_checker::check_pins(&trace, &settings);
        // The times of the steps back, in seconds.
        let mut up = true;
        let mut times = Vec::new();
        for stamped in &trace {
            match stamped.change {
                Change::UpX(is_up) => up = is_up,
                Change::StepX(true) if !up => times.push(stamped.time as f64 / 25e6),
                _ => {}
            }
        }
        // The mean speeds over 20 steps each, which are 0.25 mm.
        let speeds: Vec<f64> = times
            .chunks(20)
            .zip(times.chunks(20).skip(1))
            .map(|(one, next)| 0.25 / (next[0] - one[0]))
            .collect();
        assert!(speeds.iter().any(|speed| *speed > 99.0), "the speed of homing");
        for pair in speeds.windows(2) {
            // From the middle of the one to that of the other.
            let seconds = 0.125 / pair[0] + 0.125 / pair[1];
            assert!((pair[1] - pair[0]).abs() <= 1.2 * 800.0 * seconds + 0.5, "{pair:?} mm/s");
        }
    }
}

/// Homes a machine whose switches depend on the position of its pins and on the time. Returns its
/// state then.
fn homed(settings: Settings, switches: &mut dyn FnMut(PagePoint, u64) -> Switches) -> State {
    let mut state = State::Idle;
    pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        let switches = switches(turn.pins, turn.now);
        if turn.now == 0 {
            turn.machine.home(switches).expect("ready");
        }
        turn.machine.watch(switches);
        turn.machine.fill(&mut TargetList::new(&[]), queue);
        state = turn.machine.state();
        state == State::Home
    });
    state
}

#[test]
fn a_belt_that_is_longer_than_its_anchors_are_apart_is_wound_to_its_switch() {
    let mut settings = polargraph();
    for (setting, value) in [
        (Setting::Homing, 1.0),
        (Setting::HomingSeek, 6000.0),
        (Setting::AnchorWidth, 600.0),
        (Setting::AnchorLeft, 150.0),
        (Setting::AnchorHeight, 1600.0),
        (Setting::TravelY, 1500.0),
        (Setting::TravelX, 300.0),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    let start = settings.kinematics().motors(point(12_000, 0));
    let mut belts = start;
    let state = homed(settings, &mut |pins, _| {
        belts = point(start.x + pins.x, start.y + pins.y);
        Switches { x: belts.x <= 19_200, y: belts.y <= 19_200 }
    });
    assert_eq!(state, State::Idle);
    assert!(belts.x.abs_diff(19_280) <= 1 && belts.y.abs_diff(19_280) <= 1, "{belts:?}");
}

#[test]
fn an_axis_of_many_fine_steps_is_homed_from_its_other_end() {
    let settings = crate::fixtures::with(&[
        (Setting::Homing, 1.0),
        (Setting::TravelSpeed, 3000.0),
        (Setting::StepsPerMmX, 2400.0),
        (Setting::StepsPerMmY, 2400.0),
    ]);
    let start = point(1_000_000, 10);
    let state =
        homed(settings, &mut |pins, now| corner(point(start.x + pins.x, start.y + pins.y), now));
    assert_eq!(state, State::Idle);
}

#[test]
fn a_program_that_pauses_behind_homing_has_the_override() {
    let settings = crate::fixtures::with(&[(Setting::Homing, 1.0)]);
    let (mut is_homed, mut fastest) = (false, Value::ZERO);
    pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        let machine = turn.machine;
        let switches = corner(point(200 + turn.pins.x, 200 + turn.pins.y), turn.now);
        if turn.now == 0 {
            machine.set_override(50);
            machine.home(switches).expect("ready");
        }
        machine.watch(switches);
        if !is_homed && machine.state() == State::Idle {
            is_homed = true;
            machine.pause().expect("idle");
            machine.draw_to(to(8000, 0), None).expect("room");
            machine.resume();
        }
        machine.fill(&mut TargetList::new(&[]), queue);
        if is_homed {
            fastest = fastest.max(machine.speed());
        }
        !is_homed || machine.state() == State::Run
    });
    // Half of the speed with the pen up.
    assert!((fastest - Value::from_num(3000)).abs() < 1, "{fastest}");
}
