//! Tests jobs whose pen begins while the order of the other strokes is computed: what is drawn does
//! not depend on how fast the plotter computes, and it can be held, given up, and go on after a
//! loss of power at any time.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::board_table::PICO;
use penup::boards::host::{CutFlash, LAYOUT, Stamped};
use penup::machine::{Contacts, JobSize, State};
use penup::plotter::{Board as _, Unobserved};
use penup::stage::NeverCancel;
use penup::storage::NOTE_BYTES;
use penup_host_tests::cut_jobs::{
    Point, Powered, assert_one_drawing, empty_flash, ink, strokes_of, switch_on_early,
};
use penup_host_tests::emulated_jobs::bench_like;
use penup_host_tests::whole_jobs::{Bench, job_lines, machine_events};
use penup_job::pins::PinChange;

/// What the pins have drawn: each time that the pen was down is a list of points.
type Run = Vec<Vec<Point>>;

/// So many ticks pass in a millisecond of computing.
const MILLISECOND: u64 = 25_000;

/// The lines of a job of 210 strokes, whose order takes a board two seconds.
fn lattice() -> Vec<String> {
    let options = ["$212=20", "$213=20", "$page=60x60", "$margin=5"];
    job_lines("lattice4.obj", &options)
}

/// A plotter like that of the Pico that has received all lines of a job but the last one.
fn loaded(lines: &[String], early_ink: bool) -> Bench {
    let bench = bench_like(&PICO);
    let mut bench = Bench { plotter: bench.plotter.with_early_ink(early_ink), ..bench };
    let (plot, model) = lines.split_last().expect("a job");
    assert_eq!(plot, "$plot");
    for line in model {
        assert!(bench.say(&format!("{line}\n")).ends_with("ok\n"), "{line}");
    }
    bench
}

fn drawn(changes: &[Stamped]) -> Run {
    strokes_of(changes.iter().map(PinChange::from))
}

/// Draws the job with a plotter for which so many ticks pass in a millisecond of computing. Returns
/// the plotter, and how many strokes were drawn when the job was answered.
fn draw(lines: &[String], early_ink: bool, work_ticks: u64) -> (Bench, usize) {
    let mut bench = loaded(lines, early_ink);
    bench.board.set_work_ticks(work_ticks);
    bench.board.receive(b"$plot\n");
    while !bench.board.has_read_all() || !bench.heard().ends_with("ok\n") {
        bench.plotter.poll(&mut bench.board);
    }
    let strokes = drawn(&bench.board.trace().changes()).len();
    bench.finish();
    (bench, strokes)
}

#[test]
fn the_speed_of_computing_changes_nothing() {
    let lines = lattice();
    let (first, none) = draw(&lines, true, 0);
    assert_eq!(none, 0, "no time has passed");
    let events = machine_events(&first.board.trace().changes());
    for (work_ticks, fewest) in [(MILLISECOND / 2, 2), (5 * MILLISECOND, 10)] {
        let (bench, strokes) = draw(&lines, true, work_ticks);
        assert!(strokes >= fewest, "{strokes} strokes were drawn while the order was computed");
        assert!(machine_events(&bench.board.trace().changes()) == events, "{work_ticks}");
    }
}

/// The pins leave the same ink, each part of it once, and the measures are those of what is drawn.
#[test]
fn the_drawing_is_the_same_as_without() {
    let lines = lattice();
    let (early, _) = draw(&lines, true, MILLISECOND);
    let (late, _) = draw(&lines, false, MILLISECOND);
    let [early_strokes, late_strokes] =
        [&early, &late].map(|bench| drawn(&bench.board.trace().changes()));
    assert_ne!(early_strokes, late_strokes);
    assert_eq!(ink(&early_strokes), ink(&late_strokes));
    let steps = |strokes: &Run| strokes.iter().map(|stroke| stroke.len() - 1).sum::<usize>();
    assert_eq!(steps(&early_strokes), steps(&late_strokes));
    let status = early.plotter.machine().status();
    assert_eq!(status.job.strokes as usize, early_strokes.len());
    let JobSize { strokes, drawn, travelled, .. } = status.job;
    let JobSize { strokes: all, drawn: ink, travelled: way, .. } = status.done;
    assert_eq!([strokes.into(), drawn, travelled], [all.into(), ink, way]);
    assert_eq!(early.plotter.job().report().lifts as usize + 1, early_strokes.len());
    assert_eq!(late.plotter.job().report().components, early.plotter.job().report().components);
    assert_eq!(late.plotter.job().report().odd_points, early.plotter.job().report().odd_points);
}

/// The order is told as soon as one is known, while the first strokes are still being drawn.
#[test]
fn the_measures_are_told_before_the_other_strokes_begin() {
    let lines = lattice();
    let mut bench = loaded(&lines, true);
    bench.board.receive(b"$plot\n$model\n");
    let mut heard = String::new();
    while !bench.board.has_read_all() || heard.matches("ok\n").count() < 2 {
        bench.plotter.poll(&mut bench.board);
        heard += &bench.heard();
    }
    let measures = |heard: &str| -> Vec<String> {
        heard.lines().filter(|line| line.starts_with("[JOB:")).map(str::to_owned).collect()
    };
    let early = measures(&heard);
    assert!(early.len() == 2 && !early[0].starts_with("[JOB:odd points 0"), "{early:?}");
    bench.finish();
    let late = measures(&bench.say("$model\n"));
    assert_eq!(late[0], early[0]);
    // The moves with the pen up become shorter until the order is not improved any more.
    let lengths = [&early, &late].map(|lines| {
        let (down, rest) = lines[1].split_once(" mm, up ").expect("two lengths");
        let (up, _) = rest.split_once(" mm").expect("a length");
        (down.to_owned(), up.parse::<f64>().expect("a number"))
    });
    let [(early_down, early_up), (late_down, late_up)] = lengths;
    assert_eq!(early_down, late_down);
    assert!(late_up <= early_up && late_up > 0.98 * early_up, "{early_up} {late_up}");
}

/// A preview computes the job without drawing it.
#[test]
fn a_job_that_is_only_computed_has_the_same_order() {
    let lines = lattice();
    let (bench, _) = draw(&lines, true, MILLISECOND);
    let mut computed = loaded(&lines, true);
    computed.plotter.compute(&mut NeverCancel, &mut Unobserved).expect("a job");
    assert_eq!(computed.plotter.job().report(), bench.plotter.job().report());
}

/// Jobs whose order takes no time, and settings with which what is drawn before a stop depends on
/// what follows: the order is that of a plotter without early ink.
#[test]
fn other_jobs_are_drawn_as_always() {
    let few = job_lines("lattice2.obj", &["$page=60x60"]);
    let mut jobs = vec![few];
    for option in ["$effort=0", "$cycle=on", "$order=exact", "$224=40", "$221=1"] {
        let mut lines = lattice();
        lines.insert(lines.len() - 1, option.to_owned());
        jobs.push(lines);
    }
    for lines in jobs {
        let [early, late] = [true, false].map(|early_ink| draw(&lines, early_ink, MILLISECOND).0);
        let option = lines.iter().rev().nth(1);
        assert_eq!(early.plotter.job().report(), late.plotter.job().report(), "{option:?}");
    }
}

/// Sends `bytes` while the order is computed, and returns the plotter once `$plot` is answered.
fn disturbed(bytes: &[u8], milliseconds: u64) -> (Bench, String) {
    let (bench, answer, _) = disturbed_at(bytes, milliseconds);
    (bench, answer)
}

/// As [`disturbed`]. Returns when the bytes were sent, too.
fn disturbed_at(bytes: &[u8], milliseconds: u64) -> (Bench, String, u64) {
    let mut bench = loaded(&lattice(), true);
    bench.board.set_work_ticks(MILLISECOND);
    let at = bench.board.trace().now() + milliseconds * MILLISECOND;
    bench.board.receive_meanwhile(at, bytes);
    let answer = bench.say("$plot\n");
    (bench, answer, at)
}

#[test]
fn the_status_tells_what_the_machine_does() {
    let (mut bench, answer, begun) = disturbed_at(b"?", 2500);
    let status = answer.lines().find(|line| line.starts_with('<')).expect("a report");
    assert!(status.starts_with("<Run|MPos:"), "{status}");
    // No line is read before the order is known, so a sender must not wait for an answer.
    let status = status.strip_suffix("|Stage:order>").expect("the stage");
    let of = |name: &str, status: &str| {
        let (_, rest) = status.split_once(name).expect("a field");
        let (done, all) = rest.split_once('/').expect("two numbers");
        let all = all.split(['|', '>']).next().expect("a number");
        [done, all].map(|number| number.parse::<u32>().expect("a number"))
    };
    let [done, all] = of("|Drawn:", status);
    let [_, ink] = of("|Ink:", status);
    let left: u32 =
        status.split_once("|Left:").and_then(|(_, left)| left.parse().ok()).expect("a time");
    assert!(done >= 1, "{status}");
    bench.finish();
    let took = (bench.board.trace().now() - begun) / 25_000_000;
    let size = bench.plotter.machine().status().job;
    // What is not known yet is estimated.
    assert!(all.abs_diff(size.strokes) * 10 < size.strokes, "{all} of {}", size.strokes);
    assert!(u64::from(ink).abs_diff(size.drawn >> 18) <= 1, "{ink}");
    assert!(u64::from(left).abs_diff(took) * 4 < took, "{left} s for {took} s");
}

#[test]
fn a_job_is_held_and_goes_on() {
    let (whole, _) = draw(&lattice(), true, MILLISECOND);
    let (mut bench, answer) = disturbed(b"!", 2500);
    assert!(answer.ends_with("ok\n"), "{answer}");
    bench.work(2000);
    assert_eq!(bench.plotter.machine().state(), State::Hold { stopped: true });
    let steps = drawn(&bench.board.trace().changes());
    bench.work(2000);
    assert_eq!(drawn(&bench.board.trace().changes()), steps);
    bench.say("~");
    bench.finish();
    let all = |bench: &Bench| ink(&drawn(&bench.board.trace().changes()));
    assert_eq!(all(&bench), all(&whole));
}

#[test]
fn a_job_is_given_up_while_its_order_is_computed() {
    let (whole, _) = draw(&lattice(), true, MILLISECOND);
    let whole = ink(&drawn(&whole.board.trace().changes()));
    // While it is found, and while it is improved.
    for (milliseconds, is_answered) in [(2100, false), (5000, true), (12_000, true)] {
        let (mut bench, answer) = disturbed(b"\x18", milliseconds);
        let answer = answer + &bench.heard();
        assert_eq!(answer.contains("ok\n"), is_answered, "{milliseconds} {answer}");
        assert_eq!(answer.matches("Grbl").count(), 1, "{milliseconds} {answer}");
        bench.finish();
        assert_eq!(bench.plotter.machine().state(), State::Idle);
        let strokes = drawn(&bench.board.trace().changes()).len();
        assert!((1..60).contains(&strokes), "{strokes}");
        // The next job is drawn whole.
        let answer = bench.say("$plot\n");
        assert!(answer.ends_with("ok\n"), "{answer}");
        bench.finish();
        let again = drawn(&bench.board.trace().changes()).split_off(strokes);
        assert!(ink(&again) == whole, "{milliseconds}");
    }
}

/// The order of the strokes that the pen has not reached is improved while it draws. A line is
/// answered before that is finished.
#[test]
fn the_order_is_improved_while_the_pen_draws() {
    let mut bench = loaded(&lattice(), true);
    bench.board.set_work_ticks(MILLISECOND);
    bench.board.receive(b"$plot\n");
    let (mut reports, mut heard, mut answered_with) = (Vec::new(), String::new(), None);
    for _ in 0..200_000 {
        let is_busy = bench.plotter.poll(&mut bench.board);
        bench.board.wait();
        heard += &bench.heard();
        if !is_busy && heard.ends_with("ok\n") && bench.plotter.machine().is_stopped() {
            break;
        }
        let report = *bench.plotter.job().report();
        if heard.ends_with("ok\n") && reports.last() != Some(&report) {
            if reports.is_empty() {
                bench.board.receive(b"$model\n");
            }
            reports.push(report);
        }
        if heard.contains("[JOB:") && answered_with.is_none() {
            answered_with = Some(reports.len());
        }
    }
    assert!(reports.len() >= 2, "{reports:?}");
    assert!(reports.is_sorted_by(|a, b| a.pen_up > b.pen_up), "{reports:?}");
    assert_eq!(reports.last(), Some(bench.plotter.job().report()));
    assert_eq!(answered_with, Some(1), "{heard}");
}

/// A status that is asked for while the output is full is sent when there is room, also where the
/// computation has ended meanwhile.
#[test]
fn a_status_waits_for_room_beyond_the_end_of_the_computation() {
    let mut bench = loaded(&lattice(), true);
    bench.board.set_work_ticks(MILLISECOND);
    let now = bench.board.trace().now();
    bench.board.set_full_during(now + MILLISECOND..u64::MAX);
    bench.board.receive_meanwhile(now + 1000 * MILLISECOND, b"?");
    let answer = bench.say("$plot\n");
    assert!(answer.ends_with("ok\n") && !answer.contains('<'), "{answer}");
    assert!(bench.board.trace().now() > now + 1000 * MILLISECOND && bench.board.has_read_all());
    bench.board.set_full_during(0..0);
    bench.work(1);
    let heard = bench.heard();
    assert_eq!(heard.matches('<').count(), 1, "{heard}");
}

/// While the lines are found, the pen travels to where it will begin. It can be held and the job be
/// given up meanwhile, and a limit switch stops it.
#[test]
fn the_pen_travels_to_the_left_end_meanwhile() {
    let (whole, _) = draw(&lattice(), true, MILLISECOND);
    let whole = ink(&drawn(&whole.board.trace().changes()));
    let (mut bench, answer) = disturbed(b"?", 25);
    let status = answer.lines().find(|line| line.starts_with('<')).expect("a report");
    assert!(status.ends_with("|Stage:visibility>"), "{status}");
    assert!(status.starts_with("<Run|MPos:"), "{status}");
    assert!(!status.starts_with("<Run|MPos:0.000,0.000,"), "{status}");
    bench.finish();
    assert_eq!(ink(&drawn(&bench.board.trace().changes())), whole);

    let (mut bench, answer) = disturbed(b"!", 25);
    assert!(answer.ends_with("ok\n"), "{answer}");
    bench.work(2000);
    assert_eq!(bench.plotter.machine().state(), State::Hold { stopped: true });
    assert_eq!(drawn(&bench.board.trace().changes()), Run::new());
    bench.say("~");
    bench.finish();
    assert_eq!(ink(&drawn(&bench.board.trace().changes())), whole);

    let (mut bench, answer) = disturbed(b"\x18", 25);
    assert!(answer.contains("error:"), "{answer}");
    bench.finish();
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    assert_eq!(drawn(&bench.board.trace().changes()), Run::new());
    let position = bench.plotter.machine().position();
    assert!(position.y > 0, "{position:?}");
    let answer = bench.say("$plot\n");
    assert!(answer.ends_with("ok\n"), "{answer}");
    bench.finish();
    assert_eq!(ink(&drawn(&bench.board.trace().changes())), whole);

    let mut bench = loaded(&lattice(), true);
    bench.board.set_work_ticks(MILLISECOND);
    assert_eq!(bench.say("$21=1\n"), "ok\n");
    bench.board.set_contacts(Contacts { x: true, ..Contacts::default() });
    let answer = bench.say("$plot\n");
    assert!(answer.contains("error:"), "{answer}");
    bench.work(100);
    assert!(matches!(bench.plotter.machine().state(), State::Alarm(_)));
    assert_eq!(drawn(&bench.board.trace().changes()), Run::new());
}

/// Nothing that a user asks for while the lines are found is lost, nor while the order is computed.
#[test]
fn overrides_and_pauses_act_whenever_they_come() {
    for (first, second) in [(25, 40), (25, 2500)] {
        let begin = |requests: [(u64, &[u8]); 2]| {
            let mut bench = loaded(&lattice(), true);
            bench.board.set_work_ticks(MILLISECOND);
            let now = bench.board.trace().now();
            for (milliseconds, bytes) in requests {
                bench.board.receive_meanwhile(now + milliseconds * MILLISECOND, bytes);
            }
            let answer = bench.say("$plot\n");
            (bench, answer)
        };
        let (bench, answer) = begin([(first, b"\x90\x91\x96"), (second, b"\x91\x93")]);
        assert!(answer.ends_with("ok\n"), "{answer}");
        let machine = bench.plotter.machine();
        assert_eq!((machine.percent(), machine.rapid_percent()), (121, 50), "at {second} ms");
        let (mut bench, _) = begin([(first, b"\x97"), (second, b"\xFB")]);
        bench.work(4000);
        assert_eq!(bench.plotter.machine().state(), State::Hold { stopped: true });
        let strokes = drawn(&bench.board.trace().changes()).len();
        assert_eq!(bench.plotter.machine().rapid_percent(), 25);
        assert!(strokes >= 1, "at {second} ms");
        bench.say("~");
        bench.finish();
        assert!(drawn(&bench.board.trace().changes()).len() > 50);
        // A job that is given up ends them.
        let (bench, answer) = begin([(first, b"\x91\x96"), (first + 10, b"\x18")]);
        assert!(answer.contains("error:"), "{answer}");
        let machine = bench.plotter.machine();
        assert_eq!((machine.percent(), machine.rapid_percent()), (100, 100));
    }
}

/// The button is pressed and released before the picture is computed.
#[test]
fn the_stop_button_acts_while_a_picture_is_computed() {
    for early_ink in [true, false] {
        let mut bench = loaded(&lattice(), early_ink);
        bench.board.press_stop_during(100..110);
        let answer = bench.say("$plot\n");
        assert!(answer.contains("error:"), "{answer}");
        bench.work(100);
        assert!(matches!(bench.plotter.machine().state(), State::Alarm(_)));
        assert_eq!(drawn(&bench.board.trace().changes()), Run::new());
        // It can be unlocked, and draws then.
        assert!(bench.say("$X\n").ends_with("ok\n"));
        assert!(bench.say("$plot\n").ends_with("ok\n"));
    }
}

/// Draws the job without a cut. Returns its strokes and how many bytes of flash change.
fn undisturbed(lines: &[String], work_ticks: u64) -> (Run, usize) {
    let flash = CutFlash { budget: usize::MAX / 2, ..empty_flash() };
    let (flash, changes) = switch_on_early::<16384>(flash, Some(work_ticks), |plotter| {
        plotter.order(lines);
        plotter.finish();
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
        assert!(plotter.say("$resume").ends_with("error:163\n"));
    });
    (drawn(&changes), usize::MAX / 2 - flash.budget)
}

/// Goes on with the job that has stopped, to its end. Returns whether there was one.
fn go_on(plotter: &mut Powered<'_, '_>) -> bool {
    let greeting = plotter.heard();
    let answer = plotter.say("$resume=origin");
    if answer.ends_with("error:163\n") {
        assert!(!greeting.contains("stopped"), "{greeting}");
        return false;
    }
    assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
    assert!(plotter.is_cut() || answer.ends_with("ok\n"), "{answer}");
    true
}

/// Cuts the power before each of these bytes of flash, counted from the beginning of a job, and
/// once more while the job goes on.
fn cut_before_bytes(lines: &[String], work_ticks: u64, offsets: impl Iterator<Item = usize>) {
    let (whole, _) = undisturbed(lines, work_ticks);
    let early = Some(work_ticks);
    for budget in offsets {
        let flash = CutFlash { budget, ..empty_flash() };
        let (flash, changes) = switch_on_early::<16384>(flash, early, |plotter| {
            plotter.order(lines);
            if !plotter.is_cut() {
                plotter.finish();
            }
        });
        assert!(flash.is_cut, "{budget}");
        let mut runs = vec![drawn(&changes)];
        // The second cut comes while the order is kept again, if it was not.
        let again = CutFlash { budget: 1000, ..flash.powered() };
        let (flash, changes) = switch_on_early::<16384>(again, early, |plotter| {
            if go_on(plotter) && !plotter.is_cut() {
                plotter.finish();
            }
        });
        runs.push(drawn(&changes));
        let (_, changes) = switch_on_early::<16384>(flash.powered(), early, |plotter| {
            if !go_on(plotter) {
                if runs.concat() == whole {
                    return;
                }
                assert!(runs.iter().all(Vec::is_empty), "the job is lost: cut before {budget}");
                plotter.order(lines);
            }
            plotter.finish();
        });
        runs.push(drawn(&changes));
        assert_one_drawing(&whole, &runs);
    }
}

/// From the last pages of the drawing to the order and the first strokes behind it: each border of
/// a page, and a byte on each side.
#[test]
fn after_a_cut_before_and_while_the_order_is_kept_the_drawing_is_whole() {
    let lines = lattice();
    // The pen is behind the order, or waits for it.
    for (work_ticks, part) in [(MILLISECOND / 4, 0), (4 * MILLISECOND, 1)] {
        let (whole, bytes) = undisturbed(&lines, work_ticks);
        // One page for each stroke comes at the end or before the order.
        let strokes = 256 * whole.len();
        let borders = (bytes - strokes - 6 * 256..bytes - strokes + 16 * 256).step_by(256);
        let around = borders.flat_map(|at| [at, at + 1, at + 255]);
        cut_before_bytes(&lines, work_ticks, around.skip(part).step_by(7));
    }
}

/// The flash as it would be if a firmware with other sources had begun the job in it.
fn with_other_sources(mut flash: CutFlash) -> CutFlash {
    let (slot, sum) = LAYOUT.job.identify(&mut flash).expect("a job");
    let (log, mut notes) = (LAYOUT.logs[slot], [0; NOTE_BYTES]);
    let (length, noted) = log.read(&mut flash, sum, &mut notes).expect("a log");
    notes[24] ^= 1;
    log.begin(&mut flash, sum, &notes[..length]).expect("it is taken");
    log.note(&mut flash, 0, noted.parts).expect("it is taken");
    flash
}

/// Another firmware may compute another order, so a stroke with the same number may be another one.
#[test]
fn a_job_without_an_order_does_not_go_on_with_other_sources() {
    let lines = lattice();
    let (whole, bytes) = undisturbed(&lines, MILLISECOND);
    for (pages_left, is_refused) in [(whole.len() + 2, true), (20, false)] {
        let budget = bytes - 256 * pages_left;
        let flash = CutFlash { budget, ..empty_flash() };
        let (flash, _) = switch_on_early::<16384>(flash, Some(MILLISECOND), |plotter| {
            plotter.order(&lines);
            plotter.finish();
        });
        let flash = with_other_sources(flash.powered());
        switch_on_early::<16384>(flash, Some(MILLISECOND), |plotter| {
            let answer = plotter.say("$resume=origin");
            let expected = if is_refused { "error:165\n" } else { "ok\n" };
            assert!(answer.ends_with(expected), "{pages_left}: {answer}");
        });
    }
}

/// Draws a job whose power fails before its order is kept. Returns the strokes of the undisturbed
/// job, the flash as it is then, and the strokes that were drawn.
fn cut_before_its_order(lines: &[String]) -> (Run, CutFlash, Run) {
    let (whole, bytes) = undisturbed(lines, MILLISECOND);
    // One page for each stroke comes at the end, and before them those of the order.
    let budget = bytes - 256 * (whole.len() + 2);
    let flash = CutFlash { budget, ..empty_flash() };
    let (flash, changes) = switch_on_early::<16384>(flash, Some(MILLISECOND), |plotter| {
        plotter.order(lines);
        plotter.run(10_000);
    });
    (whole, flash, drawn(&changes))
}

/// The order that another firmware computes to check a copy must not be kept for the job that has
/// stopped, whose first strokes were drawn in their own order.
#[test]
fn an_order_by_other_sources_is_not_kept_for_the_stopped_job() {
    let (_, flash, _) = cut_before_its_order(&lattice());
    let flash = with_other_sources(flash.powered());
    let early = Some(MILLISECOND);
    let (flash, _) = switch_on_early::<16384>(flash, early, |plotter| {
        assert!(plotter.say("$C").ends_with("ok\n"));
        assert!(plotter.say("$again").ends_with("ok\n"));
    });
    switch_on_early::<16384>(flash.powered(), early, |plotter| {
        let answer = plotter.say("$resume=origin");
        assert!(answer.ends_with("error:165\n"), "{answer}");
    });
}

/// A copy is cut before each page that it writes, and goes on in the order in which it began.
#[test]
fn a_copy_of_a_job_without_an_order_goes_on_in_its_order() {
    let lines = lattice();
    let (whole, flash, _) = cut_before_its_order(&lines);
    let flash = with_other_sources(flash.powered());
    for budget in (0..60 * 256).step_by(3 * 256) {
        let early = Some(MILLISECOND);
        let copy = CutFlash { budget, ..flash.clone() };
        let (flash, before) = switch_on_early::<16384>(copy, early, |plotter| {
            plotter.say("$again");
            plotter.finish();
        });
        let (_, after) = switch_on_early::<16384>(flash.powered(), early, |plotter| {
            let answer = plotter.say("$resume=origin");
            if !answer.ends_with("ok\n") {
                assert_eq!(drawn(&before), Run::new(), "{budget}: {answer}");
                assert!(plotter.say("$again").ends_with("ok\n"));
            }
            plotter.finish();
        });
        assert_one_drawing(&whole, &[drawn(&before), drawn(&after)]);
    }
}

/// A job that was cut before its order was kept can be drawn anew without its model.
#[test]
fn a_job_without_an_order_is_drawn_again() {
    let lines = lattice();
    let (whole, flash, before) = cut_before_its_order(&lines);
    assert!(before.len() < whole.len());
    for _ in 0..2 {
        let (_, changes) =
            switch_on_early::<16384>(flash.clone().powered(), Some(MILLISECOND), |plotter| {
                assert!(plotter.say("$again").ends_with("ok\n"));
                plotter.finish();
            });
        assert_eq!(drawn(&changes), whole);
    }
}

/// The flash refuses a job, and takes writes again before the order of that job is known. The order
/// must not be kept behind the job that the flash still holds, which goes on with its own.
#[test]
fn an_order_is_not_kept_behind_another_job() {
    let lines = lattice();
    let (whole, flash, before) = cut_before_its_order(&lines);
    let (plot, model) = lines.split_last().expect("a job");
    let (flash, _) = switch_on_early::<16384>(flash.powered(), Some(MILLISECOND), |plotter| {
        plotter.order(model);
        assert_eq!(plotter.say("$page=59x59"), "ok\n");
        plotter.board.flash().expect("flash").budget = 0;
        let answer = plotter.say(plot);
        assert!(
            answer.contains("$again will not draw this") && answer.ends_with("ok\n"),
            "{answer}"
        );
        let flash = plotter.board.flash().expect("flash");
        (flash.budget, flash.is_cut) = (usize::MAX, false);
        plotter.finish();
        assert_eq!(strokes_stopped(&plotter.status()), None);
    });
    let (_, after) = switch_on_early::<16384>(flash.powered(), Some(MILLISECOND), |plotter| {
        assert!(go_on(plotter));
        plotter.finish();
    });
    assert_one_drawing(&whole, &[before, drawn(&after)]);
}

/// The number of strokes is an estimate as long as the order is not known.
#[test]
fn a_resumed_job_tells_its_strokes_once_its_order_is_known() {
    let lines = lattice();
    let (whole, flash, _) = cut_before_its_order(&lines);
    switch_on_early::<16384>(flash.powered(), Some(MILLISECOND), |plotter| {
        let estimate = plotter.status();
        assert_ne!(strokes_stopped(&estimate), Some(whole.len()), "{estimate}");
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.run(2000);
        plotter.send("\x18");
        plotter.run(1000);
        let status = plotter.status();
        assert_eq!(strokes_stopped(&status), Some(whole.len()), "{status}");
    });
}

/// The number of all strokes of the job that has stopped, according to a status.
fn strokes_stopped(status: &str) -> Option<usize> {
    let (_, stopped) = status.split_once("|Stopped:")?;
    let (_, all) = stopped.split(['|', '>']).next()?.split_once('/')?;
    all.parse().ok()
}
