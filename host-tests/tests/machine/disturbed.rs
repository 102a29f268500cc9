//! Hold, abort and alarm at any instant of a job.

use crate::fixtures::{
    ink, is_ready, job, lifted, never_cancel, point, raised, run_job, to, with_backlash,
};
use penup::machine::{Alarm, Setting, SettingError, Settings, State, TargetList, Value};
use penup_host_tests::event_checker::{self, Drawn};
use penup_host_tests::pin_machine;
use proptest::prelude::*;
use std::sync::LazyLock;

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
        height in 90u8..=127,
    ) {
        static UNDISTURBED: LazyLock<Drawn> = LazyLock::new(never_cancel);
        let mut holds = vec![instant + again, instant];
        let settings = lifted(with_backlash(loose), by_a_motor);
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
            if holds.last().is_some_and(|&due| turn.now >= due) {
                holds.pop();
                turn.machine.hold();
            }
            if turn.machine.state() == (State::Hold { stopped: true })
                && turn.machine.is_stopped()
            {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                // The heights of the pen may change, and nothing else.
                let height = Value::from_num(height);
                assert_eq!(turn.machine.set(Setting::PenDownHeight, height), Ok(()));
                let others = [Setting::PenDownDwell, Setting::AccelerationX, Setting::StepsPerMmX];
                for other in others {
                    let value = turn.machine.settings().get(other);
                    assert_eq!(turn.machine.set(other, value), Err(SettingError::Busy));
                }
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
        let mut rest_position = None;
        let drawn = run_job(lifted(with_backlash(loose), by_a_motor), turn_ticks, &mut |turn| {
            if turn.now >= instant {
                turn.machine.abort();
            }
            if turn.now > instant && is_ready(turn.machine) {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                rest_position = Some(turn.pins);
            }
            rest_position.is_none()
        });
        prop_assert_eq!(Some(drawn.end), rest_position);
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
        let mut rest_position = None;
        let drawn = run_job(lifted(with_backlash(loose), by_a_motor), turn_ticks, &mut |turn| {
            let Some(time) = alarm_at else {
                if turn.now >= instant {
                    turn.machine.alarm(alarm);
                    alarm_at = Some(turn.now);
                }
                return true;
            };
            // A pulse that was high counts when it ends, which is before this iteration.
            let pins = *rest_position.get_or_insert(turn.pins);
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
        let (time, pins) = alarm_at.zip(rest_position).expect("given");
        event_checker::check_speed(&drawn.runs, &job(), &Settings::default(), true);
        prop_assert!(drawn.last_step < time);
        prop_assert_eq!(drawn.end, pins);
        let (height, lift) = raised(by_a_motor);
        prop_assert_eq!(drawn.pen, height);
        // Before the first step, the position of the pen's motor may not be known yet.
        if by_a_motor && drawn.last_step > 0 {
            prop_assert_eq!(drawn.lift, lift);
        }
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
        let settings = with_backlash(loose);
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
