//! A main loop that is late: the queue runs dry while the machine moves.

use crate::fixtures::{ink, is_ready, to, with, with_backlash};
use penup::board_table::PICO;
use penup::boards::host::traced_steps;
use penup::machine::{
    Alarm, EventRing, Machine, PulserState, Setting, SettingError, Settings, Target, TargetList,
    Value,
};
use penup::motion::Block;
use penup_host_tests::event_checker::{self, Drawn};
use penup_host_tests::pin_machine;
use penup_host_tests::random::Random;

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
    let mut random = Random::new(1971);
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
    starve_often(with_backlash(true), with_backlash(true), 20);
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

/// Speeds from which the machine cannot stop within the queue, as they may be stored.
fn too_fast() -> Settings {
    with(&[
        (Setting::MaxRateX, 15_000.0),
        (Setting::MaxRateY, 15_000.0),
        (Setting::TravelSpeed, 15_000.0),
        (Setting::DrawSpeed, 9_000.0),
        (Setting::AccelerationX, 400.0),
        (Setting::AccelerationY, 400.0),
    ])
}

#[test]
fn what_the_queue_cannot_hold_is_not_braked_harder() {
    starve_often(too_fast(), too_fast(), 40);
    let mut with_jerk = too_fast();
    with_jerk.set(Setting::Jerk, Value::from_num(20)).expect("valid");
    starve_often(with_jerk, too_fast(), 20);
}

/// The speed from which the machine can stop within 13/16 of the steps of the queue, and the
/// greatest that the settings ask for, in mm/min.
fn held_and_asked(settings: &Settings) -> [f64; 2] {
    let value = |setting| settings.get(setting).to_num::<f64>();
    let least = |x, y| value(x).min(value(y));
    let asked =
        [Setting::DrawSpeed, Setting::TravelSpeed, Setting::HomingSeek, Setting::HomingFeed]
            .map(value)
            .into_iter()
            .fold(0.0, f64::max)
            .min(least(Setting::MaxRateX, Setting::MaxRateY));
    let acceleration = least(Setting::AccelerationX, Setting::AccelerationY);
    let motor_steps = match settings.get(Setting::Kinematics).to_num() {
        0 => value(Setting::StepsPerMmX).max(value(Setting::StepsPerMmY)),
        1 => value(Setting::StepsPerMmX) * 2f64.sqrt(),
        _ => value(Setting::StepsPerMmX),
    };
    let held = f64::from(PICO.memory.steps) * 13.0 / 16.0 / motor_steps;
    [60.0 * (2.0 * acceleration * held).sqrt(), asked]
}

#[test]
fn the_machine_says_how_fast_it_is_where_its_settings_ask_for_more_than_the_queue_holds() {
    const CHANGED: [(Setting, f64, f64); 12] = [
        (Setting::MaxRateX, 100.0, 32_767.0),
        (Setting::MaxRateY, 100.0, 32_767.0),
        (Setting::DrawSpeed, 100.0, 32_767.0),
        (Setting::TravelSpeed, 100.0, 32_767.0),
        (Setting::HomingSeek, 100.0, 32_767.0),
        (Setting::HomingFeed, 10.0, 32_767.0),
        (Setting::AccelerationX, 10.0, 32_767.0),
        (Setting::AccelerationY, 10.0, 32_767.0),
        (Setting::StepsPerMmX, 5.0, 800.0),
        (Setting::StepsPerMmY, 5.0, 800.0),
        (Setting::Jerk, 0.0, 900.0),
        (Setting::Kinematics, 0.0, 2.9),
    ];
    let (state, mut ring) = (PulserState::new(), EventRing::new());
    let _pins = traced_steps(&mut ring, &state);
    let mut blocks = [Block::EMPTY; 4];
    let mut machine = Machine::new(Settings::default(), &mut blocks, &state, u32::MAX);
    assert_eq!(machine.held_to(), None, "the default settings hold");
    let mut random = Random::new(1492);
    let mut held_count = 0;
    for _ in 0..4000 {
        let (setting, least, greatest) = *random.one_of(&CHANGED.each_ref());
        // Small values are more likely than great ones.
        let part = random.below(1 << 20) as f64 / f64::from(1 << 20);
        let value = least + (greatest - least) * part * part;
        let value = if setting == Setting::Kinematics { value.floor() } else { value };
        if let Err(refusal) = machine.set(setting, Value::from_num(value)) {
            assert!(matches!(refusal, SettingError::Conflict(_)), "{refusal:?}");
        }
        let [held, asked] = held_and_asked(machine.settings());
        match machine.held_to() {
            Some(rate) => {
                held_count += 1;
                assert!((rate.to_num::<f64>() / held - 1.0).abs() < 0.001, "{rate} {held}");
                assert!(held < asked, "{held} {asked}");
            }
            None => assert!(asked < held * 1.001, "{asked} {held}"),
        }
    }
    assert!((500..3500).contains(&held_count), "{held_count}");
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
fn backlash_is_taken_up_at_rest_and_leaves_the_same_ink() {
    let [tight, loose] = [false, true].map(|loose| starve(with_backlash(loose), 0, 0, 25_000).0);
    assert_eq!((&loose.inked, loose.end, loose.pen), (&tight.inked, tight.end, 0));
    event_checker::check_speed(&loose.runs, &fast_job(), &with_backlash(true), false);
    // The circle alone reverses x twice and y twice, and the zigzag reverses y at each corner.
    assert!(loose.backlash.len() > 12 && tight.backlash.is_empty());
    for run in &loose.backlash {
        let positions: Vec<f64> = (0..run.times.len()).map(|step| step as f64 / 80.0).collect();
        assert!(
            event_checker::backlash_steps(&with_backlash(true)).contains(&(run.times.len() as i32))
        );
        let measured = event_checker::greatest_acceleration(&run.times, &positions, 0.005);
        assert!(measured <= 1.05 * 800.0, "{measured} mm/s2");
    }
}

#[test]
fn an_alarm_raises_the_pen_of_a_dry_queue_before_it_can_be_unlocked() {
    let targets = fast_job();
    let mut queue_dry = 0;
    for instant in (0..40).map(|case| 12_000_000 + 1_700_000 * case) {
        let mut path = TargetList::new(&targets);
        let mut unlocked = None;
        let trace = pin_machine::run_with(Settings::default(), 25_000, &mut |turn, queue| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&targets)).expect("valid");
            }
            if turn.now < instant {
                turn.machine.fill(&mut path, queue);
            } else if turn.now == instant + 25_000_000 {
                // Nothing came for a second.
                queue_dry += u32::from(turn.machine.underruns() > 0);
                turn.machine.alarm(Alarm::EmergencyStop);
            }
            if turn.now >= instant + 25_000_000 && turn.machine.unlock().is_ok() {
                unlocked = Some(turn.now);
            }
            unlocked.is_none()
        });
        let drawn = event_checker::check_pins_in_alarms(&trace, &Settings::default());
        assert_eq!(drawn.pen, 0, "{instant}");
        assert!(unlocked.is_some_and(|at| at <= instant + 25_100_000), "{unlocked:?}");
    }
    assert!(queue_dry > 10, "{queue_dry}");
}
