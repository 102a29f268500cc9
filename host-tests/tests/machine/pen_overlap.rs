//! The pen that moves while the machine arrives and leaves: what is inked, how long it stands, and
//! what holds, aborts, overrides and alarms do to it.

use crate::fixtures::{
    dotted, ink, is_ready, job, never_cancel, polargraph, raised, run_job, to, with, with_backlash,
};
use penup::boards::host::Stamped;
use penup::drawing::{LineType, PagePoint};
use penup::fixed::Millimetres;
use penup::machine::{Alarm, Setting, SettingError, Settings, State, Target, TargetList, Value};
use penup::motion::{
    Block, Limits, LimitsError, MotionSettings, Move, PathLength, PenOverlap, PenPositions,
    Progress, Runner, SpeedLimit,
};
use penup_host_tests::event_checker::{self, Drawn, Standstill};
use penup_host_tests::pin_machine::{self, Recorder};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Settings with such an overlap when the pen is lowered and raised, in ms.
fn overlapping(mut settings: Settings, down: f64, up: f64) -> Settings {
    for (setting, value) in [(Setting::PenDownEarly, down), (Setting::TravelEarly, up)] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// The changes of the pins that draw a path to its end.
fn trace(settings: Settings, targets: &[Target]) -> Vec<Stamped> {
    pin_machine::run(settings, &mut TargetList::new(targets), 25_000, &mut |turn| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(targets)).expect("valid");
        }
        !is_ready(turn.machine)
    })
}

/// Draws a path to its end.
fn draw(settings: Settings, targets: &[Target]) -> Drawn {
    event_checker::check_pins(&trace(settings, targets), &settings)
}

/// Text-like strokes: some 3 mm long, 2 to 6 mm apart, in rows.
fn text() -> Vec<Target> {
    let mut targets = Vec::new();
    for row in 0..3 {
        for column in 0..12 {
            let (x, y) = (800 + 400 * column, 4000 - 800 * row);
            targets.extend([to(x, y), ink(x + 80, y - 240), ink(x + 160, y)]);
            targets.extend([to(x + 40, y - 120), ink(x + 130, y - 120)]);
        }
    }
    targets.push(to(0, 0));
    targets
}

/// Strokes whose travels are each longer than the pen takes: 4.5 mm.
fn long_travels() -> Vec<Target> {
    (0..8)
        .flat_map(|stroke| {
            let x = 1600 + 2400 * (stroke % 4);
            [to(x, 800 + 1200 * stroke), ink(x + 300, 900 + 1200 * stroke)]
        })
        .collect()
}

fn milliseconds(drawn: &Drawn) -> f64 {
    drawn.last_step as f64 / 25_000.0
}

#[test]
fn long_travels_leave_20_ms_at_rest_and_a_text_is_faster() {
    let targets = long_travels();
    for (jerk, most) in [(0.0, 10.0), (20.0, 35.0), (100.0, 30.0)] {
        let plain = with(&[(Setting::Jerk, jerk)]);
        let settings = overlapping(plain, 150.0, 150.0);
        let (before, after) = (draw(plain, &targets), draw(settings, &targets));
        assert_eq!(after.inked, before.inked);
        // From the last pulse of the travel to the first of the stroke: half a step of braking and
        // one of starting are in it, 8 ms without a limit on jerk and some 15 to 25 ms with one,
        // which no setting avoids.
        println!("{jerk} m/s3: from pulse to pulse {:.1?} ms", after.stood);
        assert_eq!(after.stood.len(), 8);
        assert!(after.stood.iter().all(|&stands| stands <= most), "{jerk}: {:?}", after.stood);
        // Both dwells of every travel but the first pass on the displacement.
        let saved = milliseconds(&before) - milliseconds(&after);
        assert!(saved >= 7.0 * (300.0 - 2.0 * most), "{jerk}: {saved} ms");
    }
    let plain = Settings::default();
    let (before, after) = (draw(plain, &text()), draw(overlapping(plain, 150.0, 150.0), &text()));
    assert_eq!(after.inked, before.inked);
    println!(
        "text of {} strokes: {:.0} ms, {:.0} ms; stood {:.0} ms, {:.0} ms",
        after.stood.len(),
        milliseconds(&before),
        milliseconds(&after),
        before.stood.iter().sum::<f64>(),
        after.stood.iter().sum::<f64>()
    );
    assert!(milliseconds(&after) < 0.81 * milliseconds(&before));
}

/// For how many milliseconds the machine of the default settings is within half a diagonal step of
/// where it rests, before or behind it, with a limit on jerk in m/s³.
fn half_step(jerk: f64) -> f64 {
    let displacement = 0.01 * std::f64::consts::SQRT_2 / 2.0;
    // Braking is reckoned with 16/18 of the jerk.
    let seconds = if jerk == 0.0 {
        (2.0 * displacement / 800.0).sqrt()
    } else {
        (6.0 * displacement / (jerk * 1000.0 * 16.0 / 18.0)).cbrt()
    };
    seconds * 1000.0
}

#[test]
fn a_pen_stands_still_on_the_paper_while_the_machine_brakes_and_starts_half_a_step() {
    for (name, targets) in [("long travels", long_travels()), ("text", text())] {
        for jerk in [0.0, 20.0, 100.0] {
            let strokes = |early: f64, contact: f64| {
                let settings = overlapping(with(&[(Setting::Jerk, jerk)]), early, early);
                event_checker::standstill(&trace(settings, &targets), &settings, contact)
            };
            let greatest = |strokes: &[Standstill], of: fn(&Standstill) -> f64| {
                strokes.iter().map(of).fold(0.0, f64::max)
            };
            for contact in [0.0, 0.1] {
                for early in [0.0, 150.0] {
                    let strokes = strokes(early, contact);
                    println!(
                        "{name}, {jerk} m/s3, on the paper for {contact} of its way, overlap \
                         {early} ms: begin {:.1}, corners {:.1}, end {:.1}, all {:.1} ms, at most \
                         {:.0} steps of travels",
                        greatest(&strokes, |stroke| stroke.begin),
                        greatest(&strokes, |stroke| stroke.corners),
                        greatest(&strokes, |stroke| stroke.end),
                        greatest(&strokes, Standstill::sum),
                        greatest(&strokes, |stroke| stroke.dragged as f64),
                    );
                }
            }
            // A pen that is on the paper when it has arrived stands there for no longer than half a
            // step takes, twice in a corner, and draws nothing of the travels.
            let (even, half) = (strokes(150.0, 0.0), half_step(jerk));
            assert_eq!(
                even.len(),
                targets.iter().filter(|target| target.ink.is_none()).count()
                    - usize::from(name == "text")
            );
            for stroke in &even {
                let Standstill { begin, corners, end, dragged } = *stroke;
                assert!(begin < half + 0.3 && end < half + 0.3, "{name} {jerk}: {stroke:?}");
                assert!(corners < 2.0 * half + 0.5 && dragged == 0, "{name} {jerk}: {stroke:?}");
            }
            if jerk != 20.0 {
                assert!(greatest(&even, Standstill::sum) < 15.0, "{name} {jerk}");
            }
            // One that is on it for a tenth of its displacement stands for that tenth, too, where
            // it is not told early enough.
            let tenth = greatest(&strokes(150.0, 0.1), Standstill::sum);
            let both = if jerk == 0.0 { 15.0 } else { 30.0 };
            assert!(tenth < 4.0 * half + 0.5 + both, "{name} {jerk}: {tenth}");
        }
    }
}

#[test]
fn gaps_ramps_polargraphs_and_chains_of_travels_keep_their_ink() {
    let targets = [
        to(2400, 2000),
        to(4000, 2040),
        to(5600, 2100),
        ink(6400, 2900),
        to(6500, 2900),
        dotted(2000, 4000),
        to(2300, 4300),
        to(2310, 4300),
        to(2310, 4500),
        ink(2400, 4300),
        ink(2390, 4200),
        to(2400, 2000),
    ];
    let smooth = [(Setting::Jerk, 30.0), (Setting::DotLength, 4.0)];
    let ramp = [(Setting::PenRamp, 254.0), (Setting::DotLength, 4.0)];
    for plain in [with(&[]), with(&smooth), with(&ramp), with_backlash(true), polargraph()] {
        for (down, up) in [(150.0, 150.0), (40.0, 0.0), (0.0, 90.0), (500.0, 500.0)] {
            let (before, after) =
                (draw(plain, &targets), draw(overlapping(plain, down, up), &targets));
            assert_eq!(after.inked, before.inked);
            assert!(after.last_step < before.last_step, "{down} {up}");
        }
    }
}

#[test]
fn backlash_is_taken_up_before_the_pen_is_lowered() {
    let plain = with_backlash(true);
    let travels = text().iter().filter(|target| target.ink.is_none()).count();
    for settings in [overlapping(plain, 0.0, 1.0), overlapping(plain, 150.0, 150.0)] {
        let drawn = draw(settings, &text());
        assert_eq!(drawn.inked, draw(Settings::default(), &text()).inked);
        println!(
            "text with backlash: {:.0} ms, taken up {} times, {} with the pen down",
            milliseconds(&drawn),
            drawn.backlash.len(),
            drawn.backlash.iter().filter(|run| run.height >= 64).count()
        );
        // Within a stroke there is one corner at which y reverses.
        let down = drawn.backlash.iter().filter(|run| run.height >= 64).count();
        assert!(down <= travels / 2, "{down}");
    }
}

#[test]
fn a_travel_that_becomes_slow_does_not_lower_the_pen_too_early() {
    let undisturbed = never_cancel();
    for jerk in [0.0, 30.0] {
        let settings = overlapping(with(&[(Setting::Jerk, jerk)]), 150.0, 150.0);
        for instant in (23_000_000..29_000_000).step_by(100_000) {
            let drawn = run_job(settings, 50_000, &mut |turn| {
                if turn.now >= instant {
                    turn.machine.set_override(10);
                    turn.machine.set_rapid_override(50);
                }
                !is_ready(turn.machine)
            });
            assert_eq!(drawn.inked, undisturbed.inked, "{instant}");
        }
    }
}

/// The travel is then too short for the pen, which is waited for behind it.
#[test]
fn a_travel_that_becomes_faster_does_not_stand_on_the_way() {
    let per_mm = |count: u32| Millimetres::from_num(count);
    let limits = Limits::new(&MotionSettings {
        steps_per_mm: [per_mm(100); 2],
        motor_steps_per_mm: per_mm(100),
        draw_mm_per_min: per_mm(3000),
        travel_mm_per_min: per_mm(6000),
        acceleration_mm_per_s2: per_mm(200),
        jerk_m_per_s3: Millimetres::ZERO,
        junction_deviation_mm: Millimetres::from_num(0.127),
        centripetal: true,
        pulse_ticks: 50,
        direction_setup_ticks: 25,
        queue_steps: u32::MAX,
    });
    let pen = PenPositions {
        up_height: 0,
        down_height: 100,
        up_ticks: 10_000_000,
        down_ticks: 4_000_000,
        ramp_ticks: 0,
        dot_length: PathLength::ZERO,
        lift: None,
        overlap: PenOverlap { down_ticks: 3_000_000, up_ticks: 10_000_000 },
    };
    let mut blocks = [Block::EMPTY; 8];
    let mut runner = Runner::new(limits.expect("valid"), pen, &mut blocks);
    for (x, ink) in [(1000, true), (1600, false), (3000, true)] {
        let (motors, from) = (PagePoint { x, y: 0 }, runner.end());
        let chord = runner.chord(x - from.x, 0).expect("short");
        let piece = Move::whole(motors, motors, &chord);
        runner.push(&piece, ink.then_some(LineType::Full), SpeedLimit::NONE).expect("room");
    }
    let mut events = Recorder(Vec::new());
    runner.set_override(100, 20);
    while runner.position().x < 1100 {
        assert_eq!(runner.produce(&mut events), Ok(Progress::More));
    }
    runner.set_override(100, 100);
    while runner.produce(&mut events) == Ok(Progress::More) {}
    let (mut gaps, mut gap) = (Vec::new(), 0.0);
    for event in &events.0 {
        gap += f64::from(event.ticks());
        if event.is_step() {
            gaps.push(std::mem::take(&mut gap));
        }
    }
    assert_eq!(gaps.len(), 3000);
    for (at, pair) in gaps[1090..1590].windows(2).enumerate() {
        assert!(pair[1] < 2.0 * pair[0], "{pair:?} ticks at step {}", 1090 + at);
    }
    assert!(gaps[1600] > 1_300_000.0, "the pen is waited for: {:?}", &gaps[1597..1602]);
}

#[test]
fn a_motor_that_lifts_the_pen_is_refused_with_an_overlap() {
    let refused = Err(SettingError::Conflict(LimitsError::PenByMotor));
    let mut settings = overlapping(Settings::default(), 100.0, 0.0);
    assert_eq!(settings.set(Setting::Tool, Value::ONE), refused);
    let mut settings = with(&[(Setting::Tool, 1.0)]);
    for setting in [Setting::PenDownEarly, Setting::TravelEarly] {
        assert_eq!(settings.set(setting, Value::ONE), refused);
    }
}

/// An instant of the job and the length of a main loop iteration, both in ticks.
fn instants() -> impl Strategy<Value = (u64, u64)> {
    (1u64..100_000_000, 5_000u64..200_000)
}

/// How the machine is set.
fn settings() -> impl Strategy<Value = Settings> {
    let times = || prop_oneof![Just(0.0), Just(150.0), 1.0..200.0f64];
    (times(), times(), any::<bool>(), prop_oneof![Just(0.0), Just(30.0)]).prop_map(
        |(down, up, loose, jerk)| {
            let mut settings = with_backlash(loose);
            settings.set(Setting::Jerk, Value::from_num(jerk)).expect("valid");
            overlapping(settings, down, up)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn hold_and_resume_leave_the_same_ink(
        (instant, turn_ticks) in instants(),
        again in 0u64..9_000_000,
        percent in 10u8..200,
        settings in settings(),
    ) {
        static UNDISTURBED: LazyLock<Drawn> = LazyLock::new(never_cancel);
        let mut holds = vec![instant + again, instant];
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
            if holds.last().is_some_and(|&due| turn.now >= due) {
                holds.pop();
                if holds.is_empty() {
                    turn.machine.set_override(percent);
                }
                turn.machine.hold();
            }
            if turn.machine.state() == (State::Hold { stopped: true })
                && turn.machine.is_stopped()
            {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                turn.machine.resume();
            }
            !is_ready(turn.machine)
        });
        prop_assert_eq!(&drawn.inked, &UNDISTURBED.inked);
        prop_assert_eq!(drawn.end, UNDISTURBED.end);
        prop_assert_eq!((drawn.pen, drawn.lift), raised(false));
    }

    #[test]
    fn overrides_at_any_time_leave_the_same_ink(
        (instant, turn_ticks) in instants(),
        every in 100_000u64..9_000_000,
        percents in proptest::collection::vec(10u8..200, 1..9),
        settings in settings(),
    ) {
        static UNDISTURBED: LazyLock<Drawn> = LazyLock::new(never_cancel);
        let mut changes = percents.into_iter();
        let mut due = instant;
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
            if turn.now >= due && let Some(percent) = changes.next() {
                due += every;
                turn.machine.set_override(percent);
                turn.machine.set_rapid_override([25, 50, 100][usize::from(percent) % 3]);
            }
            !is_ready(turn.machine)
        });
        prop_assert_eq!(&drawn.inked, &UNDISTURBED.inked);
        prop_assert_eq!(drawn.end, UNDISTURBED.end);
    }

    #[test]
    fn abort_raises_the_pen_and_keeps_the_position(
        (instant, turn_ticks) in instants(),
        settings in settings(),
    ) {
        static UNDISTURBED: LazyLock<Drawn> = LazyLock::new(never_cancel);
        let mut rest_position = None;
        let drawn = run_job(settings, turn_ticks, &mut |turn| {
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
        prop_assert_eq!(drawn.pen, 0);
        prop_assert!(drawn.inked.is_subset(&UNDISTURBED.inked));
        event_checker::check_speed(&drawn.runs, &job(), &settings, false);
    }

    #[test]
    fn an_alarm_raises_the_pen_at_once(
        (instant, turn_ticks) in instants(),
        settings in settings(),
    ) {
        let mut alarm_at = None;
        let targets = job();
        let mut path = TargetList::new(&targets);
        let trace = pin_machine::run(settings, &mut path, turn_ticks, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&job())).expect("valid");
            }
            if alarm_at.is_none() && turn.now >= instant {
                turn.machine.alarm(Alarm::EmergencyStop);
                alarm_at = Some(turn.now);
            }
            alarm_at.is_none() || turn.machine.unlock().is_err()
        });
        let drawn = event_checker::check_pins_in_alarms(&trace, &settings);
        prop_assert_eq!(drawn.pen, 0);
        prop_assert!(alarm_at.is_some_and(|time| drawn.last_step < time));
    }
}
