//! Draws one figure, `figure.svg`, from G-code in the dialects that programs for plotters write,
//! and compares what the pins ink with the figure: within a step, and nothing else.
//!
//! The files `vpype-*.gcode`, `svg-to-gcode.gcode` and `gscrib.gcode` were written by the programs
//! of these names (vpype 1.15 with vpype-gcode 0.13, svg-to-gcode 1.5.4, gscrib 1.2.0). The other
//! programs cannot be installed from a package; their files were written by hand, in the form that
//! they give: LaserGRBL, gcodetools, juicy-gcode with Z0 as its tool, the extension of MakerBot's
//! Unicorn (`mm-plotter.gcode`), and servos of Marlin and of Grbl.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::machine::{Contacts, State};
use penup::plotter::Board;
use penup_host_tests::ink::{self, Segment};
use penup_host_tests::whole_jobs::Bench;
use std::path::PathBuf;

/// Steps per millimetre.
const STEPS: f64 = 80.0;
/// The height of the figure's page in millimetres.
const HEIGHT: f64 = 80.0;

/// The files, with the settings that they need beside the default ones, and whether they count y
/// downward, as the figure does.
const FILES: [(&str, &str, bool); 13] = [
    ("vpype-gcode.gcode", "", false),
    ("vpype-gcodemm.gcode", "", false),
    ("vpype-gcode_relative.gcode", "", false),
    // Z3 is up, Z6 is down.
    ("vpype-ninja.gcode", "$207=4.5\n$208=1\n", true),
    // Z- is up, Z+ is down.
    ("vpype-step_motor.gcode", "$208=1\n", true),
    ("vpype-step_motor_relative.gcode", "$208=1\n", true),
    ("svg-to-gcode.gcode", "", false),
    ("gscrib.gcode", "", false),
    ("gcodetools.ngc", "", false),
    ("juicy.gcode", "", false),
    ("marlin-servo.gcode", "$206=3\n$216=60\n$217=1\n", false),
    ("servo-m3.gcode", "$206=3\n$216=60\n", false),
    ("mm-plotter.gcode", "$206=3\n$216=40\n$217=1\n", false),
];

/// LaserGRBL's file is drawn without a setting, too, since its S0 is up.
const LASER: [(&str, &str, bool); 2] =
    [("lasergrbl.nc", "$32=1\n", false), ("lasergrbl.nc", "", false)];

fn folder() -> PathBuf {
    penup_client::workspace::root().join("host-tests/tests/dialects")
}

fn file(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).expect("a file beside this one")
}

/// The lines of the figure in steps, with y counted upward or downward.
fn figure(downward: bool) -> Vec<Segment> {
    let svg = file("figure.svg");
    let lines = svg.split("points=\"").skip(1).map(|rest| rest.split('"').next().unwrap_or(""));
    let mut pieces = Vec::new();
    for line in lines {
        let points: Vec<[f64; 2]> = line
            .split(' ')
            .map(|point| {
                let (x, y) = point.split_once(',').expect("x,y");
                let [x, y]: [f64; 2] = [x, y].map(|number| number.parse().expect("a number"));
                [x * STEPS, if downward { y } else { HEIGHT - y } * STEPS]
            })
            .collect();
        pieces.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
    }
    pieces
}

fn bench(settings: &str) -> Bench {
    let mut bench = Bench::small();
    let answer = bench.say(settings);
    assert!(!answer.contains("error"), "{answer}");
    bench
}

/// Lets a millisecond pass. While the machine homes, its switches lie 5 mm from where it began.
fn pass(bench: &mut Bench) {
    while bench.plotter.poll(&mut bench.board) {}
    let pins = bench.plotter.machine().position();
    let home = bench.plotter.machine().state() == State::Home;
    let contacts = Contacts { x: home && pins.x <= 400, y: home && pins.y <= 400, stop: false };
    bench.board.set_contacts(contacts);
    bench.board.wait();
}

/// Sends a program line by line, each after the answer to the one before. Returns all answers.
fn send(bench: &mut Bench, program: &str) -> String {
    let mut heard = String::new();
    for line in program.lines() {
        bench.board.receive(format!("{line}\n").as_bytes());
        let mut answer = String::new();
        let mut waited = 0;
        while !answer.lines().any(|line| line == "ok" || line.starts_with("error:")) {
            pass(bench);
            answer += &bench.heard();
            waited += 1;
            assert!(waited < 300_000, "no answer to {line}: {answer}");
        }
        assert!(!answer.contains("error:"), "{line}: {answer}");
        heard += &answer;
    }
    // The program ends a second after the last move.
    let mut idle = 0;
    while idle < 1500 {
        pass(bench);
        let is_idle = matches!(bench.plotter.machine().state(), State::Idle);
        idle = if is_idle && bench.plotter.machine().is_stopped() { idle + 1 } else { 0 };
    }
    heard + &bench.heard()
}

/// The positions of the machine, in steps, at which ink came onto the page.
fn inked(bench: &Bench) -> Vec<[f64; 2]> {
    let (points, [x, y]) = ink::inked(bench);
    // Homing has shifted the coordinates.
    let position = bench.plotter.machine().position();
    let shift = [position.x - x, position.y - y];
    points.iter().map(|[x, y]| [f64::from(x + shift[0]), f64::from(y + shift[1])]).collect()
}

#[test]
fn every_dialect_draws_the_figure_and_nothing_else() {
    let mut faults = String::new();
    for (name, settings, downward) in FILES.into_iter().chain(LASER) {
        let program = file(name);
        let homes = program.contains("$H");
        let mut bench = bench(settings);
        if homes {
            bench.say("$22=1\n$130=200\n$131=200\n$J=X30 Y20 F3000\n");
            bench.finish();
        }
        let heard = send(&mut bench, &program);
        let notes: Vec<_> = heard.lines().filter(|line| line.starts_with("[MSG:")).collect();
        let difference = ink::difference(&inked(&bench), &figure(downward), 0.0);
        if difference.is_some() || notes.iter().any(|note| !note.contains("Pgm End")) {
            faults += &format!("{name} {settings:?}: {difference:?}, {notes:?}\n");
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn a_program_that_draws_nothing_or_too_little_says_which_setting_to_change() {
    for (name, settings, note) in [
        ("vpype-gcodemm.gcode", "$206=1\n", "no ink was drawn: M3 never came"),
        ("vpype-gcodemm.gcode", "$206=2\n", "no ink was drawn: Z never came"),
        ("vpype-gcodemm.gcode", "$206=3\n", "no ink was drawn: S never came"),
        ("vpype-gcodemm.gcode", "$32=1\n", "no ink was drawn: with $32=1"),
        ("vpype-ninja.gcode", "", "most of G1 to G3 had the pen up"),
        ("servo-m3.gcode", "", "S changed while M3 was on"),
        ("gcodetools.ngc", "$207=-1\n", "no ink was drawn: Z never went down"),
    ] {
        let mut bench = bench(settings);
        let heard = send(&mut bench, &file(name));
        assert!(heard.contains(&format!("[MSG:{note}")), "{name} {settings:?}: {heard}");
        assert_eq!(inked(&bench).is_empty(), note.starts_with("no ink"), "{name}");
    }
    let mut bench = bench("");
    bench.board.receive(b"M280 P0 S30\n");
    for _ in 0..10 {
        pass(&mut bench);
    }
    assert!(
        bench.heard().ends_with("set $206=3, and $216 to an S between up and down]\nerror:20\n")
    );
}

#[test]
fn a_first_line_without_ink_is_told() {
    let mut bench = bench("");
    let heard = send(&mut bench, "G1 X10 F3000\nG1 Y10");
    assert!(heard.contains("[MSG:the first line was not inked"), "{heard}");
    assert!(!inked(&bench).contains(&[5.0 * STEPS, 0.0]));
    // The program has drawn by G1, so that it draws on behind a pause of its sender.
    assert!(!send(&mut bench, "G1 X0\nG1 Y0").contains("MSG"));
    assert!(inked(&bench).contains(&[5.0 * STEPS, 10.0 * STEPS]));
    // Behind its end another one begins.
    let heard = send(&mut bench, "M2\nG1 X10\nG1 Y10");
    assert!(heard.contains("[MSG:the first line was not inked"), "{heard}");
}

#[test]
fn a_line_that_is_typed_alone_never_inks_unless_the_pen_was_put_down() {
    let mut bench = bench("");
    for line in ["G1 X10 F3000", "G1 Y10", "G0 X0", "G2 X10 Y10 I5", "G1 X0 Y0"] {
        assert!(send(&mut bench, line).contains("ok\n"));
    }
    assert_eq!(inked(&bench), Vec::<[f64; 2]>::new());
    // Two lines in a row are a program.
    send(&mut bench, "G0 X10\nG1 X20");
    assert!(!inked(&bench).is_empty());
    // A pen that was put down stays so.
    for line in ["M3", "G4 P2", "G1 X30"] {
        send(&mut bench, line);
    }
    assert!(inked(&bench).iter().any(|[x, _]| *x == 30.0 * STEPS));
}
