//! Commands, refusals and the paths that they lead to.

use crate::fixtures::{ink, job, point, polargraph, to};
use penup::machine::{Machine, Path, PulserState, Setting, Settings, TapePath, TargetList, Value};
use penup::motion::Block;
use penup::step::tape;
use penup_host_tests::pin_machine;
use penup_host_tests::transcript::transcript;

#[test]
fn what_leads_beyond_the_travel_is_refused_before_anything_moves() {
    // The travel is 420 mm of 80 steps.
    let expected = "\
> job to 33600,0 ink 33601,5 ink 0,0
< BeyondTravel { target: 1, x: 0.0125, y: 0 }
> jog 0,-7
< BeyondTravel { target: 0, x: 0, y: -0.0875 }
> wait
= Idle at 0,0
> $20=0
< ok
> job to 33600,0 ink 33601,5 ink 0,0
< ok, strokes: 1
> jog 0,0
< State(Run)
> sleep
< State(Run)
> check
< State(Run)
> unlock
< State(Run)
";
    assert_eq!(transcript(Settings::default(), expected), expected);
}

#[test]
fn a_hold_rests_with_the_pen_up_and_a_resumed_job_goes_on() {
    let expected = "\
> job ink 800,0 to 0,0
< ok, strokes: 1
> wait 0.3
= drivers on
= down 475 steps to 475,0
= Run at 475,0
> hold
< ok
> wait
= down 325 steps to 800,0
= Hold at 800,0
> resume
< ok
> wait
= up 800 steps to 0,0
= Idle at 0,0
";
    assert_eq!(transcript(Settings::default(), expected), expected);
}

#[test]
fn a_change_of_kinematics_leaves_the_pen_where_it_is() {
    let expected = "\
> job to 1000,400
< ok, strokes: 0
> wait
= drivers on
= up 1000 steps to 1000,400
= Idle at 1000,400
> $230=1
< ok
> wait
= Idle at 1000,400
";
    assert_eq!(transcript(Settings::default(), expected), expected);
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
