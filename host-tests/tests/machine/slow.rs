//! The slowest settings: waits that are longer than one event can last.

use crate::fixtures::{ink, is_ready, to, with};
use penup::boards::host::{Change, Stamped};
use penup::machine::{SETTINGS, Setting, Settings, State, Target, TargetList};
use penup::motion::TICKS_PER_SECOND;
use penup_host_tests::pin_machine;

const SECOND: u64 = TICKS_PER_SECOND as u64;

/// Draws the targets with this override in percent, and returns the changes of the pins; `None` if
/// the settings do not allow such a job.
///
/// # Panics
/// Panics if the machine is not idle at the last target within two hours.
fn draw(targets: &[Target], settings: Settings, percent: u8) -> Option<Vec<Stamped>> {
    let mut path = TargetList::new(targets);
    let mut is_refused = false;
    let trace = pin_machine::run(settings, &mut path, SECOND / 20, &mut |turn| {
        if turn.now == 0 {
            is_refused = turn.machine.start(&mut TargetList::new(targets)).is_err();
            turn.machine.set_override(percent);
            return !is_refused;
        }
        assert!(turn.now < 7200 * SECOND, "the machine never stops");
        assert!(!matches!(turn.machine.state(), State::Alarm(_)));
        let is_ready = is_ready(turn.machine);
        if is_ready {
            let (at, last) = (turn.machine.position(), targets[targets.len() - 1].point);
            // The belts of a polargraph do not reach every point.
            let off = (at.x - last.x).abs().max((at.y - last.y).abs());
            assert!(off <= 1, "{at:?}, not {last:?}");
        }
        !is_ready
    });
    (!is_refused).then_some(trace)
}

/// Travels two steps and draws two. Returns the seconds between the pulses of x, and those between
/// the pulses of the pen's motor.
fn pulses(settings: Settings, percent: u8) -> [Vec<f64>; 2] {
    let trace = draw(&[to(2, 0), ink(4, 0)], settings, percent).expect("allowed");
    [Change::StepX(true), Change::StepZ(true)].map(|pulse| {
        let pulses = trace.iter().filter(|stamped| stamped.change == pulse);
        let times: Vec<_> = pulses.map(|pulse| pulse.time as f64 / SECOND as f64).collect();
        times.windows(2).map(|pair| pair[1] - pair[0]).collect()
    })
}

#[test]
fn the_slowest_motor_of_the_pen_makes_two_steps_a_minute() {
    let settings = [
        (Setting::Tool, 1.0),
        (Setting::StepsPerMmZ, 2.0),
        (Setting::TravelZ, 2.0),
        (Setting::MaxRateZ, 1.0),
    ];
    let [_, pulses] = pulses(with(&settings), 100);
    // The search for the stop takes five steps, of which each takes four times as long.
    let (search, moves) = pulses.split_at(4);
    let slow = |pulses: &[f64], seconds: f64| {
        pulses.iter().filter(|between| (*between - seconds).abs() < 0.001).count()
    };
    assert_eq!(slow(search, 120.0), 4, "{pulses:?}");
    // Down and up again by four steps.
    assert_eq!((slow(moves, 30.0), moves.len()), (6, 8), "{pulses:?}");
}

#[test]
fn the_slowest_axes_take_five_minutes_for_a_step() {
    for jerk in [0.0, 0.1, 1000.0] {
        let settings = [
            (Setting::StepsPerMmX, 2.0),
            (Setting::StepsPerMmY, 2.0),
            (Setting::MaxRateX, 1.0),
            (Setting::Jerk, jerk),
        ];
        // 0.5 mm at 1 mm/min, and at a tenth of that.
        for (percent, seconds) in [(100, 30.0), (10, 300.0)] {
            let [pulses, _] = pulses(with(&settings), percent);
            // The first and the third pulse are half a step behind a rest.
            for between in [pulses[0], pulses[2]] {
                // The unit of speed is 1/1172 of the lesser one.
                let error = (between - seconds).abs();
                assert!(error < 0.08 * seconds, "{jerk} {percent}: {pulses:?}");
            }
        }
    }
}

#[test]
fn no_end_of_the_range_of_a_setting_keeps_the_machine_from_its_target() {
    let targets = [to(2, 0), ink(4, 2), ink(4, 4), ink(3, 1), to(1, 0)];
    let bases: [&[(Setting, f64)]; 4] = [
        &[],
        &[(Setting::Tool, 1.0), (Setting::StepsPerMmZ, 2.0)],
        &[(Setting::Jerk, 0.1), (Setting::StepsPerMmX, 2.0), (Setting::StepsPerMmY, 2.0)],
        &[(Setting::BacklashX, 0.1), (Setting::BacklashY, 0.1), (Setting::AccelerationX, 10.0)],
    ];
    let mut drawn = 0;
    for base in bases.map(with) {
        for row in SETTINGS {
            for value in [row.least, row.greatest] {
                let mut settings = base;
                if settings.set(row.setting, value).is_ok() {
                    // Shown if the test fails.
                    println!("{} = {value}", row.name);
                    let trace = draw(&targets, settings, if value == row.least { 10 } else { 100 });
                    drawn += usize::from(trace.is_some());
                }
            }
        }
    }
    assert!(drawn > 7 * SETTINGS.len(), "{drawn}");
}
