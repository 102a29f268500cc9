//! Tests of the machine over the serial line: G-code, jogging, homing, contacts, real-time bytes.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::boards::host::Change;
use penup::machine::Settings;
use penup::machine::{Contacts, State};
use penup::plotter::Board;
use penup::plotter::{EMPTY_LOOKAHEAD, Memory};
use penup_host_tests::event_checker::{self, Backlash, Drawn};
use penup_host_tests::ink;
use penup_host_tests::whole_jobs::Bench;
use penup_job::pins::Machine;
use proptest::prelude::*;
use std::sync::LazyLock;

fn bench() -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    bench
}

/// The field of the status report that begins with this text.
fn field(bench: &mut Bench, name: &str) -> String {
    let answers = bench.say("?");
    let status = answers.lines().find(|line| line.starts_with('<')).unwrap_or_default();
    let inner = status.trim_start_matches('<').trim_end_matches('>');
    inner.split('|').find(|field| field.starts_with(name)).unwrap_or("").to_owned()
}

fn position_of(bench: &mut Bench) -> String {
    let field = field(bench, "MPos");
    let position = field.strip_prefix("MPos:").and_then(|position| position.strip_suffix(",0.000"));
    position.expect("a status").to_owned()
}

/// The length in mm moved with the pen down according to the pins.
fn inked(bench: &Bench) -> f64 {
    let (points, _) = ink::inked(bench);
    let length = |ends: &[[i32; 2]]| match ends {
        [[ax, ay], [bx, by]] => f64::from(bx - ax).hypot(f64::from(by - ay)) / 80.0,
        _ => 0.0,
    };
    points.windows(2).map(length).sum()
}

#[test]
fn a_program_is_drawn_and_ends_with_the_pen_up() {
    let mut bench = bench();
    let program =
        "%\nG21 G90 (mm)\nG0 X10 Y10\nM3\nG1 X30 F2400\nY30\nG91 X-20\nG90 Y10\nM5\nG28\nM2\n";
    let lines = program.lines().count();
    bench.board.receive(program.as_bytes());
    bench.finish();
    assert_eq!(bench.heard(), "ok\n".repeat(lines - 1) + "[MSG:Pgm End]\nok\n");
    assert_eq!(
        bench.say("?"),
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000|Drawn:1/1|Ink:80/80|Left:0>\n"
    );
    assert!((inked(&bench) - 80.0).abs() < 0.1, "{}", inked(&bench));
}

/// Stippling programs lower the pen by a line that has the place of the one before.
#[test]
fn a_line_that_leads_nowhere_draws_a_dot_unless_a_stroke_goes_on() {
    for (program, strokes) in [
        ("G0 X20 Y20 Z5\nG1 X20 Y20 Z-1\nG0 X20 Y20 Z5\nG0 X30\nG1 X30 Z-1\nG0 Z5\n", 2),
        ("M5\nG0 X20 Y20\nM3\nG1 X20 Y20\nM5\nG0 X30\nM3\nG1 X30 Y20\nM5\n", 2),
        ("G0 X20 Z5\nG1 X20 Z-1\nG1 X30\nG1 X30\nG1 X40\nG0 Z5\n", 1),
        ("G0 X20 Z5\nG0 X20 Y0\nG0 Z6\n", 0),
    ] {
        let mut bench = bench();
        bench.say("F2000\n");
        let answer = bench.say(program);
        bench.finish();
        assert_eq!(field(&mut bench, "Drawn"), format!("Drawn:{strokes}/{strokes}"), "{answer}");
    }
}

#[test]
fn arcs_by_centre_and_by_radius_inches_and_bounds() {
    let mut bench = bench();
    bench.say("G0 X20 Y50\nM3\nG2 X20 Y50 I30 J0\n");
    bench.finish();
    assert!((inked(&bench) - 60.0 * std::f64::consts::PI).abs() < 12.0);
    assert_eq!(position_of(&mut bench), "20.000,50.000");
    bench.say("M5\nG20 G0 X1 Y1\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "25.400,25.400");
    // A quarter circle counter-clockwise from (60, 50) around (50, 50), and three quarters around
    // (60, 60).
    bench.say("G21 G0 X60 Y50\nM3\nG3 X50 Y60 R10\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "50.000,60.000");
    bench.say("G0 X10 Y10\nG3 X30 Y10 I10 J1\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "30.000,10.000");
    // The ends of the arc are within the travel, but its lowest point is not.
    let answer = bench.say("G0 X5 Y5\nG3 X25 Y5 I10 J0\n");
    bench.finish();
    let answer = answer + &bench.heard();
    assert!(answer.contains("beyond") && answer.ends_with("error:15\nALARM:2\n"), "{answer}");
    assert_eq!(position_of(&mut bench), "5.000,5.000");
}

/// What comes behind a line that leaves the travel would be drawn from a wrong place.
#[test]
fn a_line_that_leads_beyond_the_travel_ends_the_program_behind_the_moves_before_it() {
    for line in ["G1 X60 Y5000", "G0 X-1", "G2 X60 Y20 I300", "G53 G1 X5000"] {
        let mut bench = bench();
        let program = format!("G0 X20 Y20\nM3\nG1 X60 F2000\n{line}\nG1 X60 Y90\nM5\n");
        bench.board.receive(program.as_bytes());
        bench.finish();
        let answers = bench.heard();
        let numbers: Vec<&str> = answers.lines().filter(|it| !it.starts_with("[MSG:")).collect();
        let expected = ["ok", "ok", "ok", "error:15", "ALARM:2", "error:9", "error:9"];
        assert_eq!(numbers, expected, "{line}: {answers}");
        assert!((inked(&bench) - 40.0).abs() < 0.1, "{line}: {}", inked(&bench));
        assert_eq!(field(&mut bench, "Alarm:"), "Alarm:2", "{line}");
        // The position is known, so the alarm ends without homing.
        assert_eq!(bench.say("$X\n"), "[MSG:Caution: Unlocked]\nok\n", "{line}");
        assert_eq!(position_of(&mut bench), "60.000,20.000", "{line}");
        bench.say("G0 X20 Y20\n");
        bench.finish();
        assert_eq!(position_of(&mut bench), "20.000,20.000", "{line}");
    }
    // Ctrl-X gives up the moves before it, and with them the alarm.
    let mut bench = bench();
    bench.board.receive(b"M3\nG1 X200 F600\nG1 X5000\n");
    bench.work(1000);
    bench.board.receive(b"\x18");
    bench.finish();
    assert_eq!(field(&mut bench, "Idle"), "Idle");
    // A jog is refused alone, and so is a line of a program that is only checked.
    assert!(bench.say("$J=X5000 F1000\n").ends_with("error:15\n"));
    assert_eq!(field(&mut bench, "Idle"), "Idle");
}

/// Programs that fit arcs to points make some that are shorter than a step.
#[test]
fn an_arc_that_is_shorter_than_a_step_is_no_whole_circle() {
    let circle = 20.0 * std::f64::consts::PI;
    for (arc, length) in [
        ("G2 X60.004 Y50 I0 J-10", 0.0),
        ("G2 X60.004 Y50 R10", 0.0),
        ("G3 X60.004 Y50 I0 J10", 0.0),
        ("G3 X60.004 Y50 I0 J-10", circle),
        ("G2 X59.996 Y50 I0 J-10", circle),
        ("G2 X59.996 Y50 R-10", circle),
        ("G2 X60 Y50 I0 J-10", circle),
    ] {
        let mut bench = bench();
        let program = format!("G0 X50 Y50\nM3\nG1 X60 F2000\n{arc}\nG1 X70\nM5\n");
        bench.board.receive(program.as_bytes());
        bench.finish();
        let drawn = inked(&bench) - 20.0;
        // Steps along a circle are up to a third longer than the circle.
        assert!((length - 0.1..1.3 * length + 0.1).contains(&drawn), "{arc}: {drawn}");
    }
}

/// Programs go up to where the machine says, or to a stored position.
#[test]
fn z_in_machine_coordinates_and_stored_positions_lift_the_pen() {
    for lift in
        ["G53 G0 Z0", "G53 G0 Z-5", "G91 G28 Z0\nG90", "G91 G30 Z0\nG90", "G28 X50 Z5", "G28"]
    {
        let mut bench = bench();
        let program =
            format!("G0 Z5\nG0 X10 Y10\nG1 Z-1 F2000\nG1 X50\n{lift}\nG0 X10 Y20\nZ5\nM2\n");
        bench.board.receive(program.as_bytes());
        bench.finish();
        let answers = bench.heard();
        assert!(!answers.contains("error"), "{lift}: {answers}");
        assert!((inked(&bench) - 40.0).abs() < 1.0, "{lift}: {}", inked(&bench));
    }
}

/// The drivers are off between the copies of a figure, and the motors stand on the side of their
/// backlash that they have reached.
#[test]
fn copies_do_not_creep_where_the_drivers_are_off_between_them() {
    let mut bench = bench();
    bench.say("$1=100\n$235=0.1\n");
    let (mut seen, mut machine) = (0, Machine::default());
    let (mut pen, mut backlash) = ((0, 0), Backlash::in_the_middle(8));
    let mut ends = Vec::new();
    for _ in 0..6 {
        bench.say("M3\nG1 X10 F3000\n");
        for line in ["", "G1 X0\n"] {
            bench.say(line);
            bench.finish();
            bench.work(300);
            let changes = bench.board.trace().changes();
            for change in &changes[seen..] {
                let before = machine.position();
                machine.change(change.into());
                pen.0 += backlash.turn(machine.position().0 - before.0);
            }
            seen = changes.len();
            ends.push(pen.0);
        }
    }
    // The first move may be off by the backlash, because nobody knows its side.
    assert!(ends[3..].chunks_exact(2).all(|pair| pair == &ends[1..3]), "{ends:?}");
    assert_eq!(ends[1] + 800, ends[2], "{ends:?}");
}

/// A thousandth of an inch is no whole number of 2^-16 inches: rounded to these, each line would be
/// off by 0.7 %, and one of a tenth of that by 7 %.
#[test]
fn relative_lines_in_inches_add_up() {
    const LINES: u16 = 1000;
    let mut bench = bench();
    bench
        .board
        .receive(format!("G20 G91\n{}", "G0 X.001 Y.0001\n".repeat(LINES.into())).as_bytes());
    bench.finish();
    let (_, sum) = ink::inked(&bench);
    // Each line is rounded to 2^-16 mm, and their sum to a step.
    let rounding = f64::from(LINES) * 2f64.powi(-17) * 80.0 + 0.5;
    for (steps, inches) in sum.into_iter().zip([1.0, 0.1]) {
        let beside = f64::from(steps) - inches * 25.4 * 80.0;
        assert!(beside.abs() <= rounding, "{beside} steps beside {inches} inches");
    }
}

#[test]
fn circles_are_round_on_the_page_whatever_the_steps() {
    for (x, y) in [(80.0, 50.0), (40.0, 120.0), (79.8, 80.3)] {
        let mut bench = bench();
        bench.say(&format!("$100={x}\n$101={y}\n"));
        // Around (50, 50) by its centre; then, around (50, 20), by the radius.
        bench
            .board
            .receive(b"G0 X80 Y50\nM3\nG3 X80 Y50 I-30\nM5\nG0 X65 Y20\nM3\nG3 X35 Y20 R15\nM5\n");
        bench.finish();
        let (points, _) = ink::inked(&bench);
        let (mut full, mut half) = (0, 0);
        for [px, py] in points {
            let (px, py) = (f64::from(px), f64::from(py));
            let off = |cx: f64, cy: f64, radius: f64| {
                let (dx, dy) = (px - (cx * x).round(), py - (cy * y).round());
                let across = |wide: f64, high: f64, along: f64| {
                    wide * (1.0 - (along / high).powi(2)).max(0.0).sqrt()
                };
                let (wide, high) = (radius * x, radius * y);
                (across(wide, high, dy) - dx.abs())
                    .abs()
                    .min((across(high, wide, dx) - dy.abs()).abs())
            };
            let [whole, part] = [off(50.0, 50.0, 30.0), off(50.0, 20.0, 15.0)];
            // The tolerance is half a step plus the effect of the rounded ends on the radius.
            assert!(whole.min(part) <= 0.75, "{x} {y}: {whole} and {part} steps off at {px},{py}");
            full += u32::from(whole <= 0.75);
            half += u32::from(part <= 0.75);
        }
        assert!(full > 5000 && half > 1000, "{x} {y}: {full} and {half} points");
    }
}

#[test]
fn a_pen_that_goes_down_and_up_leaves_a_dot() {
    let mut bench = bench();
    bench.say("G0 X5\nM3\nM5\nG0 X10\n");
    bench.finish();
    let heights: Vec<_> = bench
        .board
        .trace()
        .changes()
        .iter()
        .filter_map(
            |stamped| if let Change::Pen(height) = stamped.change { Some(height) } else { None },
        )
        .collect();
    assert_eq!(heights, [127, 0]);
    assert_eq!(position_of(&mut bench), "10.000,0.000");
}

#[test]
fn moves_by_hand_are_cancelled_where_they_are() {
    let mut bench = bench();
    assert_eq!(bench.say("$J=G91 X100 F3000\n$J=G91 Y10 F3000\n"), "ok\nok\n");
    bench.work(500);
    assert_eq!(field(&mut bench, "Jog"), "Jog");
    bench.board.receive(&[0x85]);
    bench.finish();
    let position = position_of(&mut bench);
    let x: f64 = position.split(',').next().and_then(|x| x.parse().ok()).expect("a number");
    assert!((15.0..40.0).contains(&x), "{position}");
    assert_eq!(field(&mut bench, "Idle"), "Idle");
    assert_eq!(bench.say("$J=X0 F3000\n"), "ok\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "0.000,0.000");
}

#[test]
fn homing_answers_when_it_is_done() {
    for alarm in ["", "ALARM:10\n"] {
        home_answers_when_it_is_done(alarm);
    }
}

/// Homes a machine that is idle, or in this alarm, which the homing ends.
fn home_answers_when_it_is_done(alarm: &str) {
    let mut bench = bench();
    assert_eq!(bench.say("$22=1\n$130=60\n$131=60\n$J=X30 Y20 F3000\n"), "ok\n".repeat(4));
    bench.finish();
    if !alarm.is_empty() {
        bench.board.receive(&[0xFD]);
        bench.work(20);
        assert_eq!(bench.heard(), alarm);
    }
    bench.board.receive(b"$H\n$J=X1 F3000\n");
    let mut seen = Vec::new();
    for _ in 0..60_000 {
        bench.plotter.poll(&mut bench.board);
        let pins = bench.plotter.machine().position();
        let home = bench.plotter.machine().state() == State::Home;
        // The switches are 5 mm from where the machine began, while it searches for them.
        let contacts = Contacts { x: home && pins.x <= 400, y: home && pins.y <= 400, stop: false };
        bench.board.set_contacts(contacts);
        seen.push(bench.plotter.machine().state());
        bench.board.wait();
        if bench.board.has_read_all() && bench.plotter.machine().state() == State::Idle {
            break;
        }
    }
    assert!(seen.contains(&State::Home) && seen.contains(&State::Jog));
    assert_eq!(bench.heard(), "ok\nok\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "1.000,0.000");
}

#[test]
fn a_limit_and_the_emergency_stop_are_alarms() {
    for (contacts, byte, alarm) in [
        (Contacts { x: true, ..Contacts::default() }, None, "ALARM:1\n"),
        (Contacts { stop: true, ..Contacts::default() }, None, "ALARM:10\n"),
        (Contacts::default(), Some(0xFD), "ALARM:10\n"),
    ] {
        let mut bench = bench();
        assert_eq!(bench.say("$21=1\nG0 X1\nM3\nG1 X90\n"), "ok\n".repeat(4));
        bench.work(900);
        let before = bench.board.trace().now();
        bench.board.set_contacts(contacts);
        bench.board.receive(byte.as_slice());
        bench.work(2);
        let changes = bench.board.trace().changes();
        let late = changes.iter().filter(|stamped| stamped.time > before + 50);
        assert!(late.count() <= 2, "no pulse after the alarm");
        let last_pen = changes.iter().rev().find_map(|stamped| match stamped.change {
            Change::Pen(height) => Some((stamped.time - before, height)),
            _ => None,
        });
        let (after, height) = last_pen.expect("the pen moved");
        assert!(height == 0 && after < 25_000, "the pen is up within a millisecond");
        assert_eq!(bench.heard(), alarm);
        assert!(bench.say("G0 X0\n").ends_with("error:9\n"));
        bench.work(20);
        let position = position_of(&mut bench);
        if contacts.stop {
            assert!(field(&mut bench, "Pn").contains('E'));
            assert!(bench.say("$X\n").ends_with("error:9\n"));
        }
        bench.board.set_contacts(Contacts::default());
        assert_eq!(bench.say("$X\n"), "[MSG:Caution: Unlocked]\nok\n");
        assert_eq!(position_of(&mut bench), position);
        bench.say("G0 X0\n");
        bench.finish();
        assert_eq!(position_of(&mut bench), "0.000,0.000");
    }
}

#[test]
fn speeds_change_while_it_draws() {
    let seconds_of = |program: &str, bytes: &[u8]| {
        let mut bench = bench();
        bench.say(program);
        bench.work(300);
        for byte in bytes {
            bench.board.receive(&[*byte]);
            bench.work(1);
        }
        bench.finish();
        bench.board.trace().now() as f64 / 25e6
    };
    let seconds = |bytes: &[u8]| seconds_of("M3\nG1 X100\n", bytes);
    let plain = seconds(&[]);
    // 93 mm at 45 mm/s instead of 50.
    let slow = seconds(&[0x92]);
    assert!((0.15..0.25).contains(&(slow - plain)), "{slow} {plain}");
    let reset = seconds(&[0x92, 0x90]);
    assert!((reset - plain).abs() < 0.01, "{reset} {plain}");
    let fast = seconds(&[0x91]);
    assert!((0.1..0.25).contains(&(plain - fast)), "{fast} {plain}");
    // F is scaled, too, also that of the line that waits. Some 7.3 s are left.
    let seconds = |bytes: &[u8]| seconds_of("M3\nG1 X50 F1200\nG1 X100 F600\n", bytes);
    let plain = seconds(&[]);
    let slow = seconds(&[0x92; 5]);
    assert!((6.9..7.7).contains(&(slow - plain)), "{slow} {plain}");
    let fast = seconds(&[0x91; 10]);
    assert!((3.4..3.9).contains(&(plain - fast)), "{fast} {plain}");
    let mut bench = bench();
    bench.board.receive(&[0x93]);
    bench.work(1);
    // The first report has the origin of the coordinates instead.
    field(&mut bench, "WCO");
    assert_eq!(field(&mut bench, "Ov"), "Ov:101,100,100");
}

#[test]
fn pauses_wait_for_the_user() {
    let mut bench = bench();
    bench.board.receive(b"M3\nG1 X10\nM0\nG1 X20\n");
    bench.work(1500);
    assert_eq!(bench.heard(), "ok\nok\n[MSG:to go on, send ~]\nok\nok\n");
    assert_eq!(field(&mut bench, "Hold"), "Hold:0");
    assert_eq!(position_of(&mut bench), "10.000,0.000");
    bench.say("~");
    bench.finish();
    assert_eq!(position_of(&mut bench), "20.000,0.000");
    // At the end of the stroke.
    bench.say("M5\nG0 X0\nM3\nG1 X10\nG1 X20\nM5\nG0 X50\nG0 X60\n");
    bench.board.receive(&[0xFB]);
    bench.work(3000);
    assert_eq!(position_of(&mut bench), "20.000,0.000");
    assert_eq!(field(&mut bench, "Hold"), "Hold:0");
    bench.say("~");
    bench.finish();
    assert_eq!(position_of(&mut bench), "60.000,0.000");
    // The dwell is measured by the pins' own clock.
    let before = bench.board.trace().now();
    assert_eq!(bench.say("G4 P1.5\n"), "");
    bench.finish();
    assert_eq!(bench.heard(), "ok\n");
    let waited = (bench.board.trace().now() - before) as f64 / 25e6;
    assert!((1.5..1.6).contains(&waited), "{waited}");
    assert!(bench.say("G4 P-1\n").ends_with("error:4\n"), "there is no time before now");
}

#[test]
fn checking_refuses_what_would_be_refused_and_moves_nothing() {
    let mut bench = bench();
    let answers = bench.say("$C\nM3\nG1 X10\nG91 X100\nG2 X10 I5\nM0\nG4 P9\n");
    assert_eq!(answers, "[MSG:Enabled]\n".to_owned() + &"ok\n".repeat(7));
    assert_eq!(field(&mut bench, "Check"), "Check");
    assert!(bench.say("G91 G1 X400\n").ends_with("error:15\n"));
    let answers = bench.say("v 0 0 0\nv 9 9 0\nl 1 2\n$plot\n$C\n");
    assert!(answers.starts_with(&("ok\n".repeat(4) + "[MSG:Disabled]\nok\n\nGrbl ")), "{answers}");
    bench.finish();
    assert!(bench.board.trace().changes().is_empty());
    assert_eq!(
        bench.say("?"),
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000|Drawn:0/0|Ink:0/0|Left:0>\n"
    );
    // A line that was only checked does not change where the next line begins.
    bench.say("G91 G0 X1\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "1.000,0.000");
}

#[test]
fn asleep_it_takes_nothing_but_the_order_to_wake() {
    let mut bench = bench();
    bench.say("G0 X3\n");
    bench.finish();
    assert_eq!(bench.say("$SLP\n"), "[MSG:Sleeping]\nok\n");
    bench.work(50);
    assert_eq!(field(&mut bench, "Sleep"), "Sleep");
    let enable =
        bench.board.trace().changes().iter().rev().find_map(|stamped| match stamped.change {
            Change::Enable(on) => Some(on),
            _ => None,
        });
    assert_eq!(enable, Some(false));
    assert!(bench.say("G0 X0\n").ends_with("error:9\n"));
    assert!(
        bench.say("$plot\n").ends_with("error:120\n")
            || bench.say("$plot\n").ends_with("error:9\n")
    );
    assert_eq!(bench.say("$X\nG0 X0\n"), "[MSG:Caution: Unlocked]\nok\nok\n");
    bench.finish();
    assert_eq!(position_of(&mut bench), "0.000,0.000");
}

#[test]
fn no_talk_starves_the_steps() {
    // The fastest pen of the default settings, on a path of many short moves.
    let mut program = "$201=6000\nG0 X20 Y20\nM3\n".to_owned();
    for point in 0..400 {
        let angle = f64::from(point) / 20.0;
        let (x, y) = (120.0 + 100.0 * angle.cos(), 120.0 + 100.0 * angle.sin());
        program.push_str(&format!("G1 X{x:.3} Y{y:.3}\n"));
    }
    let run = |talk: bool| {
        let mut bench = bench();
        bench.board.set_baud(115_200);
        let mut lines = program.lines();
        let mut turn = 0u32;
        loop {
            turn += 1;
            if bench.board.has_read_all() {
                // Long lines and lists between the moves, a status at every turn.
                if talk && turn.is_multiple_of(9) {
                    let long = "x".repeat(250);
                    bench.board.receive(format!("# {long}\n$$\n$\n$options\n").as_bytes());
                }
                let Some(line) = lines.next() else { break };
                bench.board.receive(format!("{line}\n").as_bytes());
            }
            if talk {
                bench.board.receive(b"?");
            }
            if !bench.plotter.poll(&mut bench.board) {
                bench.board.wait();
            }
        }
        bench.finish();
        assert_eq!(bench.board.underruns(), 0);
        event_checker::check_pins(&bench.board.trace().changes(), &Settings::default())
    };
    let (quiet, busy) = (run(false), run(true));
    assert_eq!(quiet.inked, busy.inked);
    assert_eq!(quiet.end, busy.end);
}

/// A program with a few strokes, an arc and a dot.
const PROGRAM: &str = "$21=1\nG0 X5 Y5\nM3\nG1 X14 Y6\nX15 Y12\nG2 X9 Y18 I-6 J0\nG1 X9.5 Y12 \
 F1200\nM5\n\
                       G0 X2 Y2\nM3\nM5\nG0 X3 Y9\nM3\nG1 Y10 F3000\nX12 Y10.5\nM5\nG0 X1 Y1\n";

/// A disturbance of the running program.
#[derive(Debug, Clone, Copy)]
enum Disturbance {
    Nothing,
    HoldAndResume,
    Abort,
    Limit,
    StopContact,
    StopByte,
}

/// Runs the program and disturbs it after this many milliseconds. Checks that the plotter's
/// position agrees with its pins and that it can continue from there. Returns what was drawn before
/// the disturbance.
fn disturbed(disturbance: Disturbance, instant: u32) -> Drawn {
    let memory = Box::leak(Box::new(Memory::<4, 4, 16>::new()));
    let mut bench = Bench::with_memory(memory.lend(Box::leak(Box::new(EMPTY_LOOKAHEAD))));
    bench.heard();
    bench.board.receive(PROGRAM.as_bytes());
    bench.work(instant);
    let closed = match disturbance {
        Disturbance::Limit => Contacts { y: true, ..Contacts::default() },
        Disturbance::StopContact => Contacts { stop: true, ..Contacts::default() },
        _ => Contacts::default(),
    };
    bench.board.set_contacts(closed);
    match disturbance {
        Disturbance::HoldAndResume => bench.board.receive(b"!"),
        Disturbance::Abort => bench.board.receive(b"\x18"),
        Disturbance::StopByte => bench.board.receive(&[0xFD]),
        _ => {}
    }
    if matches!(disturbance, Disturbance::HoldAndResume) {
        bench.work(1500);
        assert!(bench.plotter.machine().is_stopped());
        bench.board.receive(b"~");
    }
    bench.finish();
    bench.board.set_contacts(Contacts::default());
    let drawn =
        event_checker::check_pins_in_alarms(&bench.board.trace().changes(), &Settings::default());
    assert_eq!(drawn.pen, 0);
    assert_eq!(bench.plotter.machine().position(), drawn.end);
    bench.heard();
    // An alarm also causes the lines that follow to be refused.
    if matches!(bench.plotter.machine().state(), State::Alarm(_)) {
        assert_eq!(bench.say("$X\n"), "[MSG:Caution: Unlocked]\nok\n");
    }
    assert_eq!(bench.plotter.machine().end(), drawn.end);
    assert_eq!(bench.say("M5\nG90 G21 G0 X1 Y1\n"), "ok\nok\n");
    bench.finish();
    let after =
        event_checker::check_pins_in_alarms(&bench.board.trace().changes(), &Settings::default());
    assert_eq!((after.end.x, after.end.y), (80, 80));
    drawn
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 1000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn whatever_happens_the_plotter_knows_where_it_is(
        disturbance in prop::sample::select(vec![
            Disturbance::HoldAndResume,
            Disturbance::Abort,
            Disturbance::Limit,
            Disturbance::StopContact,
            Disturbance::StopByte,
        ]),
        // A feed hold while nothing moves has no effect.
        instant in 1u32..3500,
    ) {
        static UNDISTURBED: LazyLock<Drawn> =
            LazyLock::new(|| disturbed(Disturbance::Nothing, 0));
        let drawn = disturbed(disturbance, instant);
        if matches!(disturbance, Disturbance::HoldAndResume) {
            prop_assert_eq!(&drawn.inked, &UNDISTURBED.inked);
            prop_assert_eq!(drawn.end, UNDISTURBED.end);
        } else {
            prop_assert!(drawn.inked.is_subset(&UNDISTURBED.inked));
        }
    }
}

/// Who sees `Hold:0` may put a hand to the pen.
#[test]
fn a_hold_is_reported_as_standing_when_nothing_moves_any_more() {
    let mut bench = Bench::new();
    bench.say("$120=10\n$121=10\nG0X100\n");
    bench.work(2000);
    bench.board.receive(b"!");
    let mut slowed_down = 0;
    loop {
        bench.work(5);
        let status = bench.say("?");
        if status.contains("<Hold:0") {
            break;
        }
        slowed_down += usize::from(status.contains("<Hold:1"));
    }
    assert!(slowed_down > 10, "{slowed_down}");
    let changes = bench.board.trace().changes().len();
    bench.work(3000);
    assert_eq!(bench.board.trace().changes().len(), changes);
}
