//! Drawings that go on or wait while the computer is silent, as `$218` says, judged by what the
//! pins do.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::board_table::PICO;
use penup::boards::host::{CutArea, lend_memory_of};
use penup::machine::State;
use penup::plotter::Board as _;
use penup_host_tests::cut_jobs::{Point, ink, strokes_of};
use penup_host_tests::emulated_jobs::bench_like;
use penup_host_tests::ink::places;
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use penup_job::pins::PinChange;
use std::collections::BTreeSet;

/// What the plotter says when a drawing waits.
const WAITS: &str = "s ($218): the drawing waits]";
/// What it says when the drawing goes on.
const GOES_ON: &str = "[MSG:the computer is back: the drawing goes on]";

/// A drawing of a minute or so, in one pen.
fn cube(settings: &[&str]) -> Vec<String> {
    let quick = ["$212=20", "$213=20", "$page=60x60", "$margin=5", "$201=600"];
    job_lines("cube.obj", &[&quick[..], settings].concat())
}

/// Lets the plotter run for so many seconds of its clock, while nothing comes from the computer.
/// Returns what it says.
fn be_silent(bench: &mut Bench, seconds: u32) -> String {
    for _ in 0..seconds * 1000 {
        while bench.plotter.poll(&mut bench.board) {}
        bench.board.wait();
    }
    bench.heard()
}

/// Where the pen was down.
fn drawn(bench: &mut Bench) -> Vec<Vec<Point>> {
    strokes_of(bench.board.trace().changes().iter().map(PinChange::from))
}

/// Whether the machine has stopped and holds.
fn holds(bench: &Bench) -> bool {
    bench.plotter.machine().state() == State::Hold { stopped: true }
}

/// Whether the drawing has ended, and the pins stand.
fn is_done(bench: &Bench) -> bool {
    bench.plotter.machine().state() == State::Idle && bench.plotter.machine().is_stopped()
}

/// What a plotter draws that nothing disturbs.
fn undisturbed(lines: &[String]) -> Vec<Vec<Point>> {
    let mut bench = bench_like(&PICO);
    bench.order(lines);
    bench.finish();
    drawn(&mut bench)
}

/// Without the setting, a drawing goes on to its end, whatever becomes of the computer.
#[test]
fn a_drawing_goes_on_in_silence_unless_it_is_told_to_wait() {
    let mut bench = bench_like(&PICO);
    bench.order(&cube(&[]));
    let heard = be_silent(&mut bench, 600);
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    assert!(!heard.contains("$218"), "{heard}");
    assert!(drawn(&mut bench) == undisturbed(&cube(&[])));
}

/// It waits with the pen raised for as long as it takes, also beyond the 71 minutes after which
/// the count of microseconds begins anew, and goes on with the first byte.
#[test]
fn a_drawing_waits_in_silence_and_goes_on_with_the_first_byte() {
    let lines = cube(&["$218=5"]);
    let whole = undisturbed(&cube(&[]));
    for byte in ["?", "\n", "~", "\u{85}"] {
        let mut bench = bench_like(&PICO);
        bench.order(&lines);
        let heard = be_silent(&mut bench, 4);
        assert!(!heard.contains(WAITS), "{heard}");
        let heard = be_silent(&mut bench, 3);
        assert!(heard.contains("silent for 5 s ($218): the drawing waits]"), "{heard}");
        assert!(holds(&bench));
        let before = drawn(&mut bench);
        let heard = be_silent(&mut bench, if byte == "?" { 2 * 3600 } else { 20 });
        assert_eq!(heard, "");
        assert!(drawn(&mut bench) == before, "the pins move while the drawing waits");
        let heard = bench.say(byte);
        assert!(heard.contains(GOES_ON), "{byte:?}: {heard}");
        // A status that is asked for tells the new state.
        assert_eq!(heard.contains("<Run|"), byte == "?", "{byte:?}: {heard}");
        let mut turns = 0;
        while !is_done(&bench) {
            be_silent(&mut bench, 2);
            bench.say("?");
            turns += 1;
            assert!(turns < 200, "the drawing does not end");
        }
        assert!(ink(&drawn(&mut bench)) == ink(&whole), "{byte:?}");
    }
}

/// A computer that asks often enough does not change a step.
#[test]
fn a_computer_that_asks_for_the_status_is_not_silent() {
    let lines = cube(&["$218=3"]);
    let mut bench = bench_like(&PICO);
    bench.order(&lines);
    let mut heard = String::new();
    while !is_done(&bench) {
        heard += &be_silent(&mut bench, 2);
        heard += &bench.say("?");
    }
    assert!(!heard.contains("$218"), "{heard}");
    assert!(drawn(&mut bench) == undisturbed(&cube(&[])));
}

/// A hold that the user asks for ends by `~` alone, whether it comes before or in a silence.
#[test]
fn a_hold_of_the_user_stays_one() {
    for hold in ["!", "\u{fb}"] {
        let mut bench = bench_like(&PICO);
        bench.order(&cube(&["$218=5"]));
        be_silent(&mut bench, 7);
        assert!(holds(&bench));
        bench.board.receive(&hold.chars().map(|letter| letter as u8).collect::<Vec<_>>());
        be_silent(&mut bench, 1);
        for _ in 0..3 {
            bench.say("?");
            be_silent(&mut bench, 8);
            assert!(holds(&bench), "{hold:?}");
        }
        bench.say("~");
        be_silent(&mut bench, 1);
        assert_eq!(bench.plotter.machine().state(), State::Run);
    }
    let mut bench = bench_like(&PICO);
    bench.order(&cube(&["$218=5"]));
    be_silent(&mut bench, 2);
    bench.say("!");
    be_silent(&mut bench, 20);
    bench.say("?");
    be_silent(&mut bench, 1);
    assert!(holds(&bench));
}

/// What is given up in a silence is given up, and the next drawing has its own silence.
#[test]
fn a_drawing_that_waits_can_be_given_up() {
    let lines = cube(&["$218=5"]);
    let mut bench = bench_like(&PICO);
    bench.order(&lines);
    be_silent(&mut bench, 7);
    let heard = bench.say("\u{18}");
    assert!(!heard.contains(GOES_ON), "{heard}");
    be_silent(&mut bench, 100);
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    bench.say("$plot\n");
    be_silent(&mut bench, 4);
    assert_eq!(bench.plotter.machine().state(), State::Run);
    be_silent(&mut bench, 3);
    assert!(holds(&bench));
}

/// Nobody has put in the pen while the computer was away, also where the silence begins while the
/// machine comes to rest for the pen.
#[test]
fn a_byte_behind_a_silence_confirms_no_pen() {
    let lines = ["v 0 0 0", "v 9 0 0", "v 0 9 0", "l 1 2", "usemtl pen2", "l 2 3", "$212=20"];
    let lines = lines.iter().chain(&["$213=20", "$page=60x60", "$218=1", "$plot"]);
    let lines: Vec<_> = lines.map(|line| (*line).to_owned()).collect();
    for seed in 0..40 {
        let (mut random, mut bench) = (Random::new(seed), bench_like(&PICO));
        bench.order(&lines);
        let (mut heard, mut turns) = (String::new(), 0);
        while bench.plotter.machine().pen_wanted().is_none() {
            for _ in 0..random.below(1800) {
                while bench.plotter.poll(&mut bench.board) {}
                bench.board.wait();
            }
            heard += &bench.say("?");
            turns += 1;
            assert!(turns < 200, "no pen is asked for: {heard}");
        }
        for _ in 0..3 {
            heard += &be_silent(&mut bench, 4);
            heard += &bench.say("?");
            assert!(bench.plotter.machine().pen_wanted().is_some(), "{heard}");
        }
        assert_eq!(heard.matches("put in pen 2").count(), 1, "{heard}");
        bench.say("~");
        bench.finish();
        bench.say("?");
        bench.finish();
        assert!(bench.plotter.machine().pen_wanted().is_none());
    }
}

/// The pen begins while the order is computed, and a silence holds it then, too.
#[test]
fn a_drawing_waits_while_its_order_is_computed() {
    let options = ["$212=20", "$213=20", "$page=60x60", "$margin=5", "$218=1"];
    let lines = job_lines("lattice4.obj", &options);
    let new = || {
        let bench = bench_like(&PICO);
        let mut bench = Bench { plotter: bench.plotter.with_early_ink(true), ..bench };
        bench.board.set_work_ticks(5 * 25_000);
        bench
    };
    let mut whole = new();
    whole.order(&lines[..lines.len() - 1]);
    whole.order(&["$218=0".into(), "$plot".into()]);
    whole.finish();
    let whole = drawn(&mut whole);
    let mut bench = new();
    bench.board.receive(lines.join("\n").as_bytes());
    bench.board.receive(b"\n");
    let mut heard = String::new();
    for _ in 0..20 {
        heard += &be_silent(&mut bench, 3);
        heard += &bench.say("?");
        if heard.matches(GOES_ON).count() > 3 {
            break;
        }
    }
    assert!(heard.contains(WAITS) && heard.contains(GOES_ON), "{heard}");
    bench.say("$218=0\n");
    while !is_done(&bench) {
        be_silent(&mut bench, 1);
        bench.say("?");
    }
    assert!(ink(&drawn(&mut bench)) == ink(&whole));
}

/// So does a drawing whose parts are computed one after the other.
#[test]
fn a_drawing_in_parts_waits_in_silence() {
    let new = || {
        let mut bench = Bench::with_memory(lend_memory_of(20, 60, 1500, 64));
        bench.board.set_model_flash(Some(CutArea::new(96 << 10)));
        bench.heard();
        bench
    };
    let quick = ["$212=20", "$213=20", "$110=6000", "$111=6000", "$page=80x80", "$margin=5"];
    let lines = job_lines("lattice3.obj", &[&quick[..], &["$218=3"]].concat());
    let mut whole = new();
    whole.order(&job_lines("lattice3.obj", &quick));
    whole.finish();
    let mut bench = new();
    let heard = bench.order(&lines);
    assert!(heard.contains("part by part"), "{heard}");
    let (mut random, mut heard, mut turns) = (Random::new(218), String::new(), 0);
    while !is_done(&bench) {
        heard += &be_silent(&mut bench, 1 + random.below(6) as u32);
        heard += &bench.say("?");
        turns += 1;
        assert!(turns < 1000, "the drawing does not end");
    }
    assert!(heard.matches(WAITS).count() > 3, "{heard}");
    let sets = [&whole, &bench].map(|bench| {
        let places = places(bench).into_iter();
        places.map(|point| point.map(|part| part as i64)).collect::<BTreeSet<_>>()
    });
    assert!(sets[0] == sets[1]);
}

/// A sender that waits for the answer to a slow line is silent because the plotter lets it wait.
#[test]
fn lines_of_g_code_never_wait() {
    let mut bench = bench_like(&PICO);
    bench.say("$218=2\nG21\nM3\nG1X10F100\n");
    let heard = be_silent(&mut bench, 30);
    assert!(!heard.contains("$218"), "{heard}");
    assert!(bench.plotter.machine().is_stopped());
}

/// Silences at random, of random lengths, leave the ink of the undisturbed drawing.
#[test]
fn silences_change_no_ink() {
    let whole = undisturbed(&cube(&[]));
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let mut bench = bench_like(&PICO);
        bench.order(&cube(&["$218=1"]));
        let (mut heard, mut turns) = (String::new(), 0);
        while !is_done(&bench) {
            for _ in 0..random.below(2500) {
                while bench.plotter.poll(&mut bench.board) {}
                bench.board.wait();
            }
            heard += &bench.say(if random.once_in(3) { "\n" } else { "?" });
            turns += 1;
            assert!(turns < 1000, "the drawing does not end");
        }
        heard += &bench.heard();
        assert!(heard.contains(WAITS) && heard.contains(GOES_ON), "{heard}");
        assert!(ink(&drawn(&mut bench)) == ink(&whole), "seed {seed}");
    }
}
