//! A drawing, from its lines to the pins.

use crate::event_checker;
use crate::motion_cases::Case;
use crate::motion_paths::STEPS_PER_MM;
use crate::order_reference::Sheet;
use crate::pin_machine;
use penup::drawing::{LineType, PagePoint};
use penup::machine::{State, Target, TargetList};
use penup::order::{Leg, Options};
use penup::step::Line;
use std::collections::BTreeSet;

/// The most points. The reference for the order is slow.
const MOST_POINTS: usize = 60;

/// For how many seconds at most the machine goes from point to point, in the order of the input and
/// at the least speed. A main loop that was simulated for hours would take the fuzzer's time.
const MOST_SECONDS: f64 = 60.0;

/// Orders a drawing and draws it, while the user holds and goes on, and changes the speed. The
/// order must draw each line once, the pins must keep every rule and limit and ink just the lines,
/// and the pen must end raised.
///
/// The first eight bytes choose the speed, the acceleration, the jerk, the junction deviation, how
/// late the main loop is, and two holds and an override. Each further pair of bytes is a point, in
/// tenths of a millimetre; a point that lies at the right border ends a stroke instead. Points too
/// far away are left out.
pub fn fuzz(input: &[u8]) {
    let [speed, acceleration, jerk, deviation, late, holds @ .., percent] = match *input {
        [a, b, c, d, e, f, g, h, ..] => [a, b, c, d, e, f, g, h],
        _ => return,
    };
    let case = Case {
        speed: 2.0 + f64::from(speed) / 4.0,
        acceleration: 50.0 * f64::from(acceleration % 64 + 1),
        jerk: if jerk < 64 { 0.0 } else { 100.0 * 1.03_f64.powi(jerk.into()) },
        deviation: f64::from(deviation % 16) / 100.0,
    };
    let percent = percent.clamp(10, 200);
    let mut strokes = vec![Vec::new()];
    let (mut at, mut seconds) = ([0; 2], 0.0);
    for pair in input[8..].chunks_exact(2).take(MOST_POINTS) {
        let [x, y] = [pair[0], pair[1]].map(|tenths| 10 * i32::from(tenths));
        if pair[0] == 0xFF {
            strokes.push(Vec::new());
            continue;
        }
        let way = f64::from(x - at[0]).hypot(f64::from(y - at[1])) / STEPS_PER_MM;
        let takes = way / (case.speed * f64::from(percent.min(100)) / 100.0);
        if seconds + takes <= MOST_SECONDS
            && let Some(stroke) = strokes.last_mut()
        {
            (at, seconds) = ([x, y], seconds + takes);
            stroke.push((x, y));
        }
    }
    let sheet = Sheet::from_polylines(&strokes);
    if sheet.segments.is_empty() {
        return;
    }
    let (tour, _) = sheet.order(Options::default()).expect("there is room");
    let targets = targets(&sheet, &tour);
    let turn_ticks = 5_000 + 200 * u64::from(late);
    let settings = case.settings();
    let (mut path, mut first) = (TargetList::new(&targets), TargetList::new(&targets));
    let mut holds = holds.map(|at| 1_000_000 * u64::from(at)).into_iter().peekable();
    let mut started = false;
    let trace = pin_machine::run(settings, &mut path, turn_ticks, &mut |turn| {
        if !started {
            started = true;
            turn.machine.start(&mut first).expect("within the travel");
            turn.machine.set_override(percent);
        }
        if holds.next_if(|at| turn.now >= *at).is_some() {
            turn.machine.hold();
        }
        if turn.machine.state() == (State::Hold { stopped: true }) && turn.machine.is_stopped() {
            assert_eq!(turn.machine.planned_position(), turn.pins);
            turn.machine.resume();
        }
        turn.machine.state() != State::Idle || !turn.machine.is_stopped()
    });
    let drawn = event_checker::check_pins(&trace, &settings);
    assert_eq!(drawn.pen, 0, "the pen is not raised");
    assert_eq!(Some(drawn.end), targets.last().map(|target| target.point));
    assert_eq!(drawn.inked, moves(&sheet), "the ink is that of the lines");
    let ratios = event_checker::speed_ratios(&drawn.runs, &targets, &settings, false);
    assert!(ratios.acceleration <= 1.05 && ratios.jerk <= 1.1 && ratios.rest <= 1.05, "{ratios:?}");
}

/// The way of the pen along a tour, which begins at the origin.
fn targets(sheet: &Sheet, tour: &[Leg]) -> Vec<Target> {
    let mut targets = Vec::new();
    let mut at = PagePoint::default();
    for &leg in tour {
        let (start, end) = (sheet.start(leg), sheet.end(leg));
        if start != at || targets.is_empty() {
            targets.push(Target { point: start, ink: None });
        }
        targets.push(Target { point: end, ink: Some(LineType::Full) });
        at = end;
    }
    targets
}

/// The moves of all lines, each with the smaller point first.
fn moves(sheet: &Sheet) -> BTreeSet<(PagePoint, PagePoint)> {
    let mut moves = BTreeSet::new();
    for number in 0..sheet.segments.len() {
        let leg = Leg::new(number as u16, false);
        let mut at = sheet.start(leg);
        for direction in Line::new(at, sheet.end(leg)) {
            let next = direction.from_point(at);
            moves.insert((at.min(next), at.max(next)));
            at = next;
        }
    }
    moves
}
