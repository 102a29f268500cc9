//! Paths of which more becomes known while the machine moves.

use super::*;
use crate::motion::event::tests::Events;
use crate::motion::limits::tests::settings;

/// A pen that moves while the machine is at rest.
pub(super) const PEN: PenPositions = PenPositions {
    up_height: 0,
    down_height: 100,
    up_ticks: 2_000_000,
    down_ticks: 2_000_000,
    ramp_ticks: 0,
    dot_length: PathLength::ZERO,
    lift: None,
    #[cfg(feature = "pen-overlap")]
    overlap: PenOverlap { down_ticks: 0, up_ticks: 0 },
};

/// Appends a straight move.
pub(super) fn push(runner: &mut Runner<'_>, [x, y]: [i32; 2], ink: Option<LineType>) {
    let (motors, from) = (PagePoint { x, y }, runner.end());
    let chord = runner.chord(x - from.x, y - from.y).expect("short");
    runner.push(&Move::whole(motors, motors, &chord), ink, SpeedLimit::NONE).expect("room");
}

/// Runs all that is known, and returns the ticks of all events so far.
fn run(runner: &mut Runner<'_>, events: &mut Events) -> u32 {
    while runner.produce(events) == Ok(Progress::More) {}
    runner.ticks()
}

#[test]
fn a_line_that_goes_on_while_it_is_drawn_takes_as_long_as_one_known_before() {
    let limits = Limits::new(&settings()).expect("valid");
    let [known, late] = [false, true].map(|is_late| {
        let (mut blocks, mut events) = ([Block::EMPTY; 32], Events::default());
        let mut runner = Runner::new(limits, PEN, &mut blocks);
        for piece in 1..=8 {
            push(&mut runner, [800 * piece, 0], Some(LineType::Full));
            // It has moved 2 mm of the last piece when it hears of the next.
            while is_late && piece < 8 && runner.position().x < 800 * piece - 600 {
                assert_eq!(runner.produce(&mut events), Ok(Progress::More));
            }
        }
        run(&mut runner, &mut events)
    });
    assert!(late.abs_diff(known) < known / 100, "{late} {known}");
}

#[test]
fn a_bend_that_is_known_late_binds_the_chord_in_work() {
    let limits = Limits::new(&settings()).expect("valid");
    let (mut blocks, mut events) = ([Block::EMPTY; 32], Events::default());
    let mut runner = Runner::new(limits, PEN, &mut blocks);
    // Chords of a circle of 2 mm, each of 10 degrees.
    let chord = |number: u32| {
        let (sin, cos) = libm::sincos(f64::from(number) * core::f64::consts::PI / 18.0);
        [sin, 1.0 - cos].map(|part| libm::round(200.0 * part) as i32)
    };
    push(&mut runner, chord(1), Some(LineType::Full));
    while runner.course.is_none() {
        assert_eq!(runner.produce(&mut events), Ok(Progress::More));
    }
    let limit = |runner: &Runner<'_>| runner.course.as_ref().map(|course| course.curve_limit);
    let before = limit(&runner).expect("a chord");
    for number in 2..12 {
        push(&mut runner, chord(number), Some(LineType::Full));
    }
    let late = runner.lookahead.late_limit();
    assert!(late < before, "{late} {before}");
    assert_eq!(limit(&runner), Some(late));
}

#[test]
fn a_cruise_is_given_up_where_a_bend_appears_behind_it() {
    let mut settings = settings();
    settings.jerk_m_per_s3 = Millimetres::from_num(20);
    let limits = Limits::new(&settings).expect("valid");
    let (mut blocks, mut events) = ([Block::EMPTY; 64], Events::default());
    let mut runner = Runner::new(limits, PEN, &mut blocks);
    push(&mut runner, [6000, 0], Some(LineType::Full));
    let cruises = |runner: &Runner<'_>| match &runner.plan {
        Some(Plan::Interval(interval)) => interval.is_cruise(),
        _ => false,
    };
    while !cruises(&runner) {
        assert_eq!(runner.produce(&mut events), Ok(Progress::More));
    }
    // A straight line in pieces gives no reason.
    for piece in 1..=4 {
        push(&mut runner, [6000 + 40 * piece, 0], Some(LineType::Full));
        assert!(cruises(&runner));
    }
    // Chords of half a circle of 1 mm.
    for number in 1..=9 {
        let (sin, cos) = libm::sincos(f64::from(number) * core::f64::consts::PI / 9.0);
        let [x, y] = [sin, 1.0 - cos].map(|part| libm::round(100.0 * part) as i32);
        push(&mut runner, [6160 + x, y], Some(LineType::Full));
    }
    assert!(!cruises(&runner));
}
