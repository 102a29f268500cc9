//! Jobs that go on after a loss of power, judged by the ink that the pins leave.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod origin;
mod refused;
mod within_strokes;

use penup::boards::host::{CutFlash, LAYOUT, Stamped};
use penup::machine::State;
use penup::plotter::Board as _;
use penup::storage::{LogProgress, NOTE_BYTES};
use penup_host_tests::cut_jobs::{
    Point, Powered, assert_one_drawing, empty_flash, ink, strokes_of, switch_on,
};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use penup_job::pins::PinChange;

/// A pen that takes little time, so that the tests do not either.
const QUICK_PEN: [&str; 2] = ["$212=20", "$213=20"];

/// What the pins have drawn: each time that the pen was down is a list of points.
type Run = Vec<Vec<Point>>;

/// The lines of a job of many strokes.
fn lattice(hidden: &str) -> Vec<String> {
    let options = ["$page=60x60", "$margin=5", hidden];
    job_lines("lattice2.obj", &[&QUICK_PEN[..], &options].concat())
}

/// The lines of a small job.
fn cube() -> Vec<String> {
    job_lines("cube.obj", &[&QUICK_PEN[..], &["$page=20x20", "$margin=4"]].concat())
}

/// Draws a job without a cut. Returns its strokes, how long it takes in milliseconds, and how many
/// bytes of flash change.
fn undisturbed(lines: &[String]) -> (Run, u64, usize) {
    let flash = CutFlash { budget: usize::MAX / 2, ..empty_flash() };
    let mut passed = 0;
    let (flash, changes) = switch_on(flash, |plotter| {
        plotter.order(lines);
        passed = plotter.finish();
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
        assert!(plotter.say("$resume").ends_with("error:163\n"));
    });
    let strokes = strokes_of(changes.iter().map(PinChange::from));
    (strokes, passed, usize::MAX / 2 - flash.budget)
}

/// Goes on with the job that has stopped. Returns whether there was one.
fn go_on(plotter: &mut Powered<'_, '_>) -> bool {
    let greeting = plotter.heard();
    let answer = plotter.say("$resume");
    if answer.ends_with("error:163\n") {
        assert!(!greeting.contains("stopped"), "{greeting}");
        return false;
    }
    assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
    // Nobody has said yet where the pen is.
    assert!(answer.ends_with("error:164\n"), "{answer}");
    let answer = plotter.say("$resume=origin");
    assert!(plotter.is_cut() || answer == "ok\n", "{answer}");
    true
}

/// Draws a job and cuts the power `cuts` times, at random instants of the time that it takes, or
/// while a random byte of the flash is written. Returns the strokes of the whole job and those of
/// each run.
fn draw_with_cuts(lines: &[String], cuts: usize, random: &mut Random) -> (Run, Vec<Run>) {
    let (whole, milliseconds, _) = undisturbed(lines);
    let strokes = whole.len() as u64;
    let mut flash = empty_flash();
    let mut runs: Vec<Run> = Vec::new();
    for number in 0..=cuts {
        let is_last = number == cuts;
        // Most cuts leave enough for the rest.
        let after = random.below(2 * milliseconds / (cuts as u64 + 1) + 1);
        let in_flash = !is_last && random.once_in(3);
        let (left, changes) = switch_on(flash.powered(), |plotter| {
            let goes_on = go_on(plotter);
            if in_flash {
                let budget = random.below(256 * (2 * strokes / (cuts as u64 + 1) + 1)) as usize;
                plotter.board.flash().expect("flash").budget = budget;
            }
            if !goes_on {
                // A cut before the job has begun, or behind its end.
                if runs.iter().any(|run| !run.is_empty()) {
                    return;
                }
                plotter.order(lines);
            }
            if is_last || in_flash {
                plotter.finish();
            } else {
                plotter.run(after);
            }
        });
        flash = left;
        runs.push(strokes_of(changes.iter().map(PinChange::from)));
    }
    (whole, runs)
}

#[test]
fn a_job_that_is_cut_ten_times_arrives_as_one_drawing() {
    let lines = lattice("$hidden=erased");
    let mut twice = 0;
    for seed in 0..6 {
        let (whole, runs) = draw_with_cuts(&lines, 10, &mut Random::new(1971 + seed));
        twice += assert_one_drawing(&whole, &runs);
    }
    // A cut comes in the middle of a stroke more often than not.
    assert!(twice > 10, "{twice}");
}

#[test]
fn dotted_lines_are_drawn_again_from_their_beginning() {
    let lines = lattice("$hidden=dotted");
    for seed in 0..3 {
        let (whole, runs) = draw_with_cuts(&lines, 10, &mut Random::new(1975 + seed));
        assert!(whole.len() > 100, "there are dots");
        assert_eq!(ink(runs.iter().flatten()), ink(&whole));
    }
}

#[test]
fn after_a_cut_at_any_of_a_thousand_instants_the_drawing_is_whole() {
    let lines = cube();
    let mut random = Random::new(1834);
    let mut cuts = 0;
    while cuts < 1000 {
        let more = 1 + random.below(3) as usize;
        let (whole, runs) = draw_with_cuts(&lines, more, &mut random);
        assert_one_drawing(&whole, &runs);
        cuts += more;
    }
}

/// Cuts the power before each of these bytes of flash, counted from the beginning of a job, and
/// goes on or begins anew.
fn cut_before_bytes(lines: &[String], offsets: impl Iterator<Item = usize>) {
    let (whole, ..) = undisturbed(lines);
    for budget in offsets {
        let (flash, changes) = switch_on(CutFlash { budget, ..empty_flash() }, |plotter| {
            plotter.order(lines);
            plotter.finish();
        });
        assert!(flash.is_cut, "{budget}");
        let mut runs = vec![strokes_of(changes.iter().map(PinChange::from))];
        let (_, changes) = switch_on(flash.powered(), |plotter| {
            if !go_on(plotter) {
                if runs.contains(&whole) {
                    return;
                }
                assert!(runs.iter().all(Vec::is_empty), "the job is lost: cut before {budget}");
                plotter.order(lines);
            }
            plotter.finish();
        });
        runs.push(strokes_of(changes.iter().map(PinChange::from)));
        assert_one_drawing(&whole, &runs);
    }
}

/// The settings of the pen are saved first. Then the job is erased and written, then its log.
#[test]
fn after_a_cut_at_the_borders_of_all_pages_the_drawing_is_whole() {
    let lines = cube();
    let (_, _, bytes) = undisturbed(&lines);
    let borders = (0..bytes).step_by(256).flat_map(|at| at.saturating_sub(1)..=at + 1);
    cut_before_bytes(&lines, borders.filter(|at| *at < bytes));
}

/// The last pages that are written are the page at the front of the log, and one for each stroke.
#[test]
fn after_a_cut_before_any_byte_of_the_log_the_drawing_is_whole() {
    let lines = cube();
    let (whole, _, bytes) = undisturbed(&lines);
    let log = 256 * (1 + whole.len());
    // The front, the first stroke, and the last.
    let front = bytes - log;
    cut_before_bytes(&lines, (front..front + 2 * 256).chain(bytes - 256..bytes));
}

/// A board with this flash, on which the power fails once 5 strokes are drawn.
fn cut_after_five_strokes(lines: &[String]) -> (CutFlash, Run) {
    let (flash, changes) = switch_on(empty_flash(), |plotter| {
        plotter.order(lines);
        draw_five_strokes(plotter);
    });
    (flash, strokes_of(changes.iter().map(PinChange::from)))
}

/// Draws on until the sixth stroke is planned.
fn draw_five_strokes(plotter: &mut Powered<'_, '_>) {
    for _ in 0..60_000 {
        plotter.run(1);
        if plotter.plotter.machine().status().done.strokes == 6 {
            break;
        }
    }
    assert_eq!(plotter.plotter.machine().status().done.strokes, 6);
    plotter.run(30);
}

#[test]
fn flash_that_returns_garbage_once_loses_nothing() {
    let lines = lattice("$hidden=erased");
    let (flash, _) = cut_after_five_strokes(&lines);
    let reads = |flash: CutFlash| {
        let mut greeting = String::new();
        let (flash, _) = switch_on(flash, |plotter| greeting = plotter.heard());
        (greeting, flash.garbage_after)
    };
    let many = 1 << 40;
    let (greeting, left) = reads(CutFlash { garbage_after: Some(many), ..flash.clone() });
    let count = many - left.expect("there are fewer reads");
    assert!(greeting.contains("a job stopped at stroke 6 of "), "{greeting}");
    assert!(count > 100, "{count}");
    for number in 0..count {
        let garbled = CutFlash { garbage_after: Some(number), ..flash.clone() };
        let (found, left) = reads(garbled);
        assert_eq!((found, left), (greeting.clone(), None), "garbage at read {number}");
    }
}

#[test]
fn garbage_while_a_job_goes_on_loses_nothing() {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let (flash, before) = cut_after_five_strokes(&lines);
    let mut random = Random::new(7);
    for _ in 0..30 {
        let (_, changes) = switch_on(flash.clone(), |plotter| {
            plotter.heard();
            let reads = random.below(1000) as usize;
            plotter.board.flash().expect("flash").garbage_after = Some(reads);
            assert_eq!(plotter.say("$resume=origin"), "ok\n");
            plotter.finish();
        });
        assert_one_drawing(
            &whole,
            &[before.clone(), strokes_of(changes.iter().map(PinChange::from))],
        );
    }
}

#[test]
fn what_the_job_depends_on_must_be_as_it_was() {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let (flash, before) = cut_after_five_strokes(&lines);
    let (flash, changes) = switch_on(flash, |plotter| {
        plotter.heard();
        // A setting that decides where ink falls.
        let settings = plotter.say("$$");
        for number in [3, 23, 27, 100, 101, 219, 220, 221, 222, 223] {
            let row = settings.lines().find_map(|row| row.strip_prefix(&format!("${number}=")));
            let value = row.and_then(|row| row.split(' ').next()).expect("a setting");
            let value: f64 = value.parse().expect("a number");
            let other = if value == 3.0 { 2.0 } else { value + 1.0 };
            let answer = plotter.say(&format!("${number}={other}"));
            assert!(answer.ends_with("ok\n"), "{number}: {answer}");
            let answer = plotter.say("$resume=origin");
            assert!(answer.contains(&format!("set ${number}={value:.3}")), "{answer}");
            assert!(answer.ends_with("error:166\n"), "{answer}");
            assert!(plotter.say(&format!("${number}={value}")).ends_with("ok\n"));
        }
        // The travel does not, because nothing is homed.
        assert!(plotter.say("$130=300").ends_with("ok\n"));
        // Speeds do not.
        assert_eq!(plotter.say("$201=2000"), "ok\n");
        // Another model, and then the same one.
        let model: Vec<String> =
            lines.iter().filter(|line| !line.starts_with('$')).cloned().collect();
        plotter.order(&model);
        plotter.order(&["v 9 9 9".to_owned()]);
        assert!(plotter.say("$resume=origin").ends_with("error:167\n"));
        plotter.order(&["$clear".to_owned()]);
        plotter.order(&model);
        assert!(plotter.status().contains("|Stopped:5/"), "{}", plotter.status());
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.finish();
        assert!(!plotter.status().contains("Stopped"));
    });
    let after = strokes_of(changes.iter().map(PinChange::from));
    assert_one_drawing(&whole, &[before, after]);
    // It is not drawn twice.
    switch_on(flash, |plotter| {
        let greeting = plotter.heard();
        assert!(!greeting.contains("stopped"), "{greeting}");
        assert!(plotter.say("$resume").ends_with("error:163\n"));
    });
}

/// A switch at the high end of an axis lies where the travel ends.
#[test]
fn the_travel_must_be_as_it_was_where_its_end_is_homed() {
    let lines: Vec<String> = ["$22=1", "$23=0", "$X"]
        .map(str::to_owned)
        .into_iter()
        .chain(lattice("$hidden=erased"))
        .collect();
    let (flash, _) = cut_after_five_strokes(&lines);
    switch_on(flash, |plotter| {
        plotter.say("$X");
        let settings = plotter.say("$$");
        for number in ["$130", "$131"] {
            let row = settings.lines().find_map(|row| row.strip_prefix(&format!("{number}=")));
            let same = row.and_then(|row| row.split(' ').next()).expect("a setting");
            assert!(plotter.say(&format!("{number}=300")).ends_with("ok\n"));
            let answer = plotter.say("$resume=origin");
            assert!(answer.contains(&format!("set {number}={same}")), "{answer}");
            assert!(plotter.say(&format!("{number}={same}")).ends_with("ok\n"));
        }
        // The travel has not changed, but what it means has.
        assert!(plotter.say("$22=0").ends_with("ok\n"));
        let answer = plotter.say("$resume=origin");
        assert!(answer.contains("set $22=1.000"), "{answer}");
        assert!(plotter.say("$22=1").ends_with("ok\n"));
        plotter.say("$X");
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        // Whoever interrupts that knows where the pen is, and must not say that it is elsewhere.
        plotter.run(3000);
        plotter.board.receive(&[0x18]);
        plotter.finish();
        plotter.heard();
        plotter.say("$X");
        let answer = plotter.say("$resume=origin");
        assert!(answer.ends_with("error:168\n"), "{answer}");
        assert_eq!(plotter.say("$resume"), "ok\n");
        plotter.finish();
    });
}

/// What has been noted stays in a flash that takes no more.
#[test]
fn whoever_has_a_worn_flash_is_told_where_the_job_will_go_on() {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let mut stroke = String::new();
    let (flash, changes) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.run(4000);
        plotter.board.flash().expect("flash").budget = 0;
        plotter.run(4000);
        let flash = plotter.board.flash().expect("flash");
        assert!(flash.is_cut);
        (flash.budget, flash.is_cut) = (usize::MAX, false);
        plotter.finish();
        let said = plotter.heard();
        let told = "a loss of power $resume draws it again from stroke ";
        let (_, behind) = said.split_once(told).expect("it is told");
        stroke = behind.split(' ').next().expect("a number").to_owned();
        assert!(!plotter.status().contains("Stopped"));
    });
    let strokes = |changes: &[Stamped]| strokes_of(changes.iter().map(PinChange::from));
    assert_eq!(ink(&strokes(&changes)), ink(&whole), "the job itself is drawn");
    let from = stroke.parse::<usize>().expect("a number") - 1;
    assert!((1..whole.len() - 2).contains(&from), "{from}");
    let (_, changes) = switch_on(flash, |plotter| {
        let greeting = plotter.heard();
        assert!(greeting.contains(&format!("a job stopped at stroke {stroke} of ")), "{greeting}");
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.finish();
    });
    assert_eq!(ink(&strokes(&changes)), ink(&whole[from..]));
}

#[test]
fn another_version_of_the_firmware_does_not_go_on() {
    let (mut flash, _) = cut_after_five_strokes(&lattice("$hidden=erased"));
    let (slot, sum) = LAYOUT.job.identify(&mut flash).expect("a job");
    let log = LAYOUT.logs[slot];
    let mut notes = [0; NOTE_BYTES];
    let (length, LogProgress { parts: strokes, .. }) =
        log.read(&mut flash, sum, &mut notes).expect("a log");
    notes[4] ^= 1;
    log.begin(&mut flash, sum, &notes[..length]).expect("it is taken");
    log.note(&mut flash, 0, strokes).expect("it is taken");
    switch_on(flash, |plotter| {
        let greeting = plotter.heard();
        assert!(greeting.contains("a job stopped at stroke 6 of "), "{greeting}");
        let answer = plotter.say("$resume=origin");
        assert!(answer.ends_with("error:165\n"), "{answer}");
        assert_eq!(plotter.say("$again"), "ok\n");
    });
}

#[test]
fn a_job_that_is_given_up_or_stopped_in_an_emergency_can_go_on() {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let (_, changes) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.run(4000);
        plotter.board.receive(&[0x18]);
        plotter.finish();
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
        // The position is still known.
        assert_eq!(plotter.say("$resume"), "ok\n");
        plotter.run(2000);
        let status = plotter.status();
        assert!(status.starts_with("<Run") && !status.contains("Stopped"), "{status}");
        plotter.board.receive(&[0x18]);
        plotter.finish();
        plotter.heard();
        assert_eq!(plotter.say("$J=G91 X5 F2000"), "ok\n");
        plotter.finish();
        assert_eq!(plotter.say("$resume"), "ok\n");
        plotter.finish();
    });
    let drawn = strokes_of(changes.iter().map(PinChange::from));
    assert_eq!(ink(&drawn), ink(&whole));
    assert!(drawn.len() <= whole.len() + 2, "{} {}", drawn.len(), whole.len());
    // After an emergency stop nobody knows where the pen is.
    switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.run(4000);
        plotter.board.receive(&[0xFD]);
        plotter.run(500);
        assert!(plotter.say("$resume").ends_with("error:9\n"));
        assert!(plotter.say("$X").ends_with("ok\n"));
        assert!(plotter.say("$resume").ends_with("error:164\n"));
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        assert!(
            plotter.status().contains("WCO:0.000,0.000") || plotter.status().starts_with("<Run")
        );
    });
}

#[test]
fn pens_are_asked_for_after_a_cut() {
    let pens = ["usemtl pen1", "l 1 2", "usemtl pen2", "l 3 4", "l 5 6"];
    let vertices = ["v 0 0 0", "v 9 0 0", "v 0 3 0", "v 9 3 0", "v 0 6 0", "v 9 6 0"];
    let options = ["$212=20", "$213=20", "$page=20x20", "$margin=2", "$plot"];
    let lines: Vec<String> =
        vertices.iter().chain(&pens).chain(&options).map(|line| (*line).to_owned()).collect();
    let (flash, first) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.finish();
        assert!(plotter.heard().contains("put in pen 2"));
        plotter.send("~");
        for _ in 0..60_000 {
            plotter.run(1);
            if plotter.plotter.machine().status().done.strokes == 3 {
                break;
            }
        }
        plotter.run(300);
    });
    let (_, second) = switch_on(flash, |plotter| {
        let greeting = plotter.heard();
        assert!(greeting.contains("stopped at stroke 3 of 3"), "{greeting}");
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.finish();
        // Which pen is in the holder is not known.
        assert!(plotter.heard().contains("put in pen 2"));
        plotter.send("~");
        plotter.finish();
    });
    let strokes = [first, second].map(|changes| strokes_of(changes.iter().map(PinChange::from)));
    assert_eq!(strokes.each_ref().map(Vec::len), [3, 1]);
    assert!(strokes[1][0].starts_with(&strokes[0][2]));
}

/// The power goes while the plotter asks for pen 1 for another copy, because pen 2 is in. After a
/// start the first pen is assumed to be in, but not for the rest of a job with several pens.
#[test]
fn the_first_pen_is_asked_for_after_a_cut() {
    let vertices = ["v 0 0 0", "v 9 0 0", "v 0 3 0", "v 9 3 0"];
    let pens = ["usemtl pen1", "l 1 2", "usemtl pen2", "l 3 4"];
    let options = ["$212=20", "$213=20", "$page=20x20", "$margin=2", "$plot"];
    let lines: Vec<String> =
        vertices.iter().chain(&pens).chain(&options).map(|line| (*line).to_owned()).collect();
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.finish();
        plotter.send("~");
        plotter.finish();
        plotter.heard();
        assert_eq!(plotter.say("$again"), "ok\n");
        plotter.finish();
        assert!(plotter.status().contains("|Pen:1|"), "{}", plotter.status());
    });
    let (_, changes) = switch_on(flash.powered(), |plotter| {
        plotter.heard();
        assert!(plotter.say("$resume=origin").ends_with("ok\n"));
        plotter.finish();
        for pen in [1, 2] {
            let status = plotter.status();
            assert!(status.contains(&format!("|Pen:{pen}|")), "{status}");
            plotter.send("~");
            plotter.finish();
        }
    });
    assert_eq!(strokes_of(changes.iter().map(PinChange::from)).len(), 2);
}

#[test]
fn boards_without_flash_refuse_it() {
    let mut bench = Bench::new();
    assert!(bench.say("$resume\n").ends_with("error:161\n"));
    assert!(bench.say("$resume=origin\n").ends_with("error:161\n"));
    assert!(bench.say("$resume=here\n").ends_with("error:105\n"));
}

/// Each job erases each sector once at most, and every other job uses the other slot, so that flash
/// that can be erased 100,000 times lasts for 200,000 jobs.
#[test]
fn a_job_erases_each_sector_once_in_two_jobs() {
    let lines = cube();
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.finish();
        for _ in 0..9 {
            plotter.heard();
            assert_eq!(plotter.say("$plot"), "ok\n");
            plotter.finish();
        }
    });
    let settings = 2;
    let most = flash.erasures[settings..].iter().max().expect("sectors");
    assert_eq!(*most, 5);
    // Drawn again, a job is not saved anew, and only its log is erased.
    let before = flash.erasures.clone();
    let (flash, _) = switch_on(flash, |plotter| {
        plotter.heard();
        assert_eq!(plotter.say("$again"), "ok\n");
        plotter.finish();
    });
    let more: Vec<usize> =
        (0..before.len()).filter(|sector| flash.erasures[*sector] != before[*sector]).collect();
    assert_eq!(more, [LAYOUT.logs[1].start as usize / 4096]);
}

/// The plan of a job is complete before the pins have drawn all of it.
#[test]
fn what_comes_right_behind_a_job_leaves_no_stroke_unnoted() {
    let lines = cube();
    for next in ["G1 X5 Y5 F6000", "$J=X5 F6000", "IN;SP1;PU400,400;PD800,800;PU;", "$plot"] {
        let (flash, _) = switch_on(empty_flash(), |plotter| {
            plotter.order(&lines);
            for _ in 0..600_000 {
                plotter.plotter.poll(plotter.board);
                let machine = plotter.plotter.machine();
                if machine.state() == State::Idle {
                    assert!(!machine.is_stopped(), "it is planned before it is drawn");
                    break;
                }
                plotter.board.wait();
            }
            plotter.heard();
            plotter.board.receive(format!("{next}\n").as_bytes());
            plotter.finish();
            let answer = plotter.heard();
            assert!(!answer.contains("error"), "{next}: {answer}");
            let status = plotter.status();
            assert!(!status.contains("Stopped"), "{next}: {status}");
        });
        switch_on(flash.powered(), |plotter| {
            let greeting = plotter.heard();
            assert!(!greeting.contains("stopped"), "{next}: {greeting}");
        });
    }
}

/// Each time wears the flash, and senders set what is set.
#[test]
fn what_is_set_as_it_was_is_not_kept_anew() {
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&["$130=300", "G10 L2 P1 X5", "$N0=G21", "$I=mine"].map(str::to_owned));
    });
    let mut before = 0;
    let (flash, _) = switch_on(flash.powered(), |plotter| {
        before = plotter.board.flash().map_or(0, |flash| flash.budget);
        for _ in 0..3 {
            plotter.order(&["$130=300", "G10 L2 P1 X5", "$N0=G21", "$I=mine"].map(str::to_owned));
        }
        assert_eq!(plotter.board.flash().map(|flash| flash.budget), Some(before));
        plotter.order(&["$130=301".to_owned()]);
    });
    assert!(flash.budget < before);
    switch_on(flash.powered(), |plotter| {
        plotter.heard();
        assert!(plotter.say("$$").contains("$130=301.000\n"));
    });
}

/// Who changes the pen between two parts of a drawing is asked for the one of the next part.
#[test]
fn a_job_goes_on_with_its_own_pen_behind_a_change_by_g_code() {
    let lines = lattice("$hidden=erased");
    let (flash, _) = cut_after_five_strokes(&lines);
    switch_on(flash.powered(), |plotter| {
        plotter.say("T2 M6");
        plotter.finish();
        plotter.say("~");
        plotter.finish();
        plotter.heard();
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.finish();
        assert!(plotter.heard().contains("[MSG:put in pen 1, then send ~]"));
        plotter.send("~");
        plotter.finish();
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
    });
}

/// Without current nobody knows where a motor holds the pen, so it counts as neither up nor down.
#[test]
fn a_job_whose_drivers_go_off_at_once_is_noted_to_its_end() {
    let motors = ["$209=1", "$132=5", "$102=400", "$1=0"].map(str::to_owned);
    let lines = [&motors[..], &cube()].concat();
    switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.finish();
        plotter.heard();
        plotter.board.receive(b"$I\n");
        for _ in 0..2000 {
            while plotter.plotter.poll(plotter.board) {}
            plotter.board.wait();
        }
        assert!(plotter.heard().ends_with("ok\n"), "the line is read");
        assert!(!plotter.status().contains("Stopped"));
    });
}
