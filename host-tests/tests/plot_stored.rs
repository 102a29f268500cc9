//! A model that does not fit in memory goes to flash by itself, is drawn part by part as it would
//! be drawn as a whole, and stays through a loss of power.
#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use penup::boards::host::{CutArea, lend_memory_of};
use penup::machine::State;
use penup_host_tests::ink::places;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use std::collections::BTreeSet;

/// A pen and a machine that take little time, so that the tests do not either.
const QUICK: [&str; 6] =
    ["$212=20", "$213=20", "$110=6000", "$111=6000", "$page=80x80", "$margin=5"];

/// A bench with the memory for so many vertices and corners, and for so many words to work in, and
/// flash for models.
fn small(vertices: usize, corners: usize, words: usize) -> Bench {
    let mut bench = Bench::with_memory(lend_memory_of(vertices, corners, words, 64));
    bench.board.set_model_flash(Some(CutArea::new(96 << 10)));
    bench.heard();
    bench
}

/// Runs until nothing moves any more, and puts in each pen that the machine asks for. Returns
/// these.
fn finish(bench: &mut Bench) -> Vec<u8> {
    let mut pens = Vec::new();
    bench.finish();
    while let Some(pen) = bench.plotter.machine().pen_wanted() {
        pens.push(pen);
        bench.say("~");
        bench.finish();
    }
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    pens
}

fn scene(name: &str, options: &[&str]) -> Vec<String> {
    job_lines(name, &[&QUICK[..], options].concat())
}

/// The positions that a board with enough memory inks, and one that has little.
fn both(lines: &[String], words: usize) -> [Vec<[f64; 2]>; 2] {
    let mut whole = Bench::new();
    whole.order(lines);
    finish(&mut whole);
    let mut parts = small(20, 60, words);
    let heard = parts.order(lines);
    assert!(heard.contains("the model goes to flash"), "{heard}");
    assert!(heard.contains("part by part"), "{heard}");
    let pens = finish(&mut parts);
    let heard = parts.heard();
    assert!(!heard.contains("given up"), "{heard}");
    assert!(pens.is_sorted_by(|one, next| one < next), "a pen is put in twice: {pens:?}");
    [places(&whole), places(&parts)]
}

/// How many positions only one of both has inked, of the positions that the first has.
fn only_one(whole: &[[f64; 2]], parts: &[[f64; 2]]) -> (usize, usize) {
    let key = |point: &[f64; 2]| point.map(|part| part as i64);
    let sets = [whole, parts].map(|points| points.iter().map(key).collect::<BTreeSet<_>>());
    (sets[0].symmetric_difference(&sets[1]).count(), sets[0].len())
}

#[test]
fn the_ink_is_that_of_the_whole_drawing() {
    let all: &[usize] = &[1500, 4000, 16_384];
    let cases: [(&str, &[&str], &[usize]); 5] = [
        ("lattice3.obj", &[], all),
        ("lattice3.obj", &["$hidden=pen,3"], all),
        ("lattice3.obj", &["$eye=1.2,1.1,1.4", "$at=3,3,3"], all),
        ("lattice3.obj", &["$crease=20", "$seams=on"], all),
        ("lattice4.obj", &[], &[2000]),
    ];
    for (name, options, memories) in cases {
        let lines = scene(name, options);
        for &words in memories {
            let [whole, parts] = both(&lines, words);
            assert!(whole.len() > 1000);
            let (differ, all) = only_one(&whole, &parts);
            assert_eq!(differ, 0, "{name} {options:?} {words}: of {all}");
        }
    }
}

#[test]
fn dots_and_the_title_may_lie_elsewhere() {
    // The dots of a line begin where the pen comes from, and lines on top of each other that belong
    // to different parts are both drawn.
    let lines = scene("lattice3.obj", &["$hidden=dotted", "$projection=orthographic"]);
    let [whole, parts] = both(&lines, 1500);
    let (differ, all) = only_one(&whole, &parts);
    assert!(10 * differ < all, "{differ} of {all}");
    let lines = scene("gears.obj", &["$page=60x60"]);
    let [whole, parts] = both(&lines, 16_384);
    let (differ, all) = only_one(&whole, &parts);
    assert!(200 * differ < all, "{differ} of {all}");
    // The title stands below the box around the model.
    let lines = scene("lattice3.obj", &["$title=Part by part", "$seams=on"]);
    let [whole, parts] = both(&lines, 1500);
    assert!(whole.len().abs_diff(parts.len()) < 10, "{} and {}", whole.len(), parts.len());
}

/// A small board that has been sent a lattice, which lies in its flash, and not `$plot`.
fn uploaded(words: usize, options: &[&str]) -> Bench {
    let mut bench = small(20, 60, words);
    let lines = scene("lattice3.obj", options);
    bench.order(&lines[..lines.len() - 1]);
    bench
}

/// Says a line that is refused, and returns the number of the error.
fn refused(bench: &mut Bench, line: &str) -> u16 {
    let answer = bench.say(&format!("{line}\n"));
    let number = answer.trim_end().rsplit_once("error:").map(|(_, number)| number);
    number.unwrap_or_else(|| panic!("{line}: {answer}")).parse().unwrap()
}

#[test]
fn the_checksum_is_that_of_the_model_in_memory() {
    let checksum = |answer: &str| {
        let (_, rest) = answer.split_once("[MODEL:checksum ").unwrap();
        rest[..8].to_owned()
    };
    let mut whole = Bench::new();
    let lines = scene("lattice3.obj", &[]);
    whole.order(&lines[..lines.len() - 1]);
    let mut stored = uploaded(4000, &[]);
    let answer = stored.say("$model\n");
    assert_eq!(checksum(&answer), checksum(&whole.say("$model\n")));
    assert!(answer.contains("[FLASH:vertices 216, faces 162, bars 0, corners 648 in"), "{answer}");
    stored.say("$clear\n");
    assert!(stored.say("$model\n").contains("[FLASH:98304 bytes for a larger model]"));
}

#[test]
fn what_a_model_in_flash_cannot_do_is_refused_by_name() {
    let mut bench = uploaded(4000, &[]);
    for line in ["$undo", "$move=1,2,3,4", "$list=v", "$delete=f,1"] {
        assert_eq!(refused(&mut bench, line), 191, "{line}");
    }
    assert_eq!(refused(&mut bench, "deg 3"), 192);
    assert_eq!(refused(&mut bench, "f 1 2 999"), 110);
    assert_eq!(refused(&mut bench, "f 1 1 2"), 112);
    // It is still coming.
    assert!(bench.say("v 1 2 3\n").ends_with("ok\n"));
    bench.order(&["$see=wire".to_owned()]);
    assert_eq!(refused(&mut bench, "$plot"), 193);
    bench.order(&["$see=faces".to_owned(), "$model".to_owned()]);
    // Now it is whole.
    for line in ["v 1 2 3", "f 1 2 3", "l 1 2", "usemtl 2", "deg 3", "$undo"] {
        assert_eq!(refused(&mut bench, line), 191, "{line}");
    }
    assert!(bench.say("$clear\n").contains("the model in flash is removed"));
    assert!(bench.say("v 1 2 3\n").ends_with("ok\n"));
    assert_eq!(refused(&mut bench, "f 1 2 3"), 110);
    // A model with curves stays in memory, and so has its limits.
    let mut bench = small(5, 60, 4000);
    let mut lines: Vec<_> = (0..5).map(|x| format!("v {x} {} 0", x * x)).collect();
    lines.extend(
        ["cstype bspline", "deg 2", "curv 0 1 1 2 3", "parm u 0 0 0 1 1 1", "end"]
            .map(str::to_owned),
    );
    bench.order(&lines);
    assert_eq!(refused(&mut bench, "v 9 9 9"), 192);
    assert!(bench.say("$model\n").contains("curves 1"));
}

#[test]
fn a_flash_that_is_full_refuses_the_next_part_and_keeps_the_rest() {
    let mut bench = Bench::with_memory(lend_memory_of(20, 60, 4000, 64));
    bench.board.set_model_flash(Some(CutArea::new(8 << 10)));
    let mut count = 0;
    let answer = loop {
        let answer = bench.say(&format!("v {count} 0 {}\n", count % 7));
        if !answer.ends_with("ok\n") {
            break answer;
        }
        count += 1;
    };
    assert!(answer.contains(&format!("the flash holds these {count} vertices")), "{answer}");
    assert!(answer.contains("error:190"), "{answer}");
    assert!(count > 600, "{count}");
    assert!(bench.say("$model\n").contains(&format!("[FLASH:vertices {count}, ")));
}

#[test]
fn a_model_stays_through_a_loss_of_power() {
    let mut bench = uploaded(4000, &[]);
    // Without its record it is lost.
    let flash = bench.board.set_model_flash(None);
    let mut again = small(20, 60, 4000);
    again.board.set_model_flash(flash);
    again.plotter.power_up(&mut again.board);
    assert!(!again.heard().contains("flash keeps a model"));

    let mut bench = uploaded(4000, &[]);
    bench.order(&["$plot".to_owned()]);
    finish(&mut bench);
    let drawn = places(&bench);
    let flash = bench.board.set_model_flash(None);
    let mut again = small(20, 60, 4000);
    again.board.set_model_flash(flash);
    again.plotter.power_up(&mut again.board);
    let heard = again.heard();
    assert!(heard.contains("[MSG:the flash keeps a model of 216 vertices"), "{heard}");
    let mut lines: Vec<_> = QUICK.map(str::to_owned).to_vec();
    lines.push("$plot".to_owned());
    again.order(&lines);
    finish(&mut again);
    assert_eq!(only_one(&drawn, &places(&again)).0, 0);
    // What the flash no longer holds is found before anything moves.
    let flash = again.board.set_model_flash(None).unwrap();
    let before = flash.bytes()[300];
    flash.set_byte(300, before ^ 4);
    again.board.set_model_flash(Some(flash));
    assert_eq!(refused(&mut again, "$plot"), 196);
    assert!(again.plotter.machine().is_stopped());
}

#[test]
fn a_drawing_in_parts_is_held_given_up_and_left_alone() {
    let mut bench = uploaded(4000, &["$hidden=dotted"]);
    bench.order(&["$plot".to_owned()]);
    bench.work(400);
    for line in ["v 1 2 3", "usemtl 2", "$move=1,2,3,4"] {
        assert_eq!(refused(&mut bench, line), 191, "{line}");
    }
    for line in ["$clear", "$hidden=erased", "$title=no"] {
        assert_eq!(refused(&mut bench, line), 194, "{line}");
    }
    assert_eq!(refused(&mut bench, "$plot"), 8);
    assert_eq!(refused(&mut bench, "G0 X1"), 8);
    let status = bench.say("?");
    assert!(status.contains("<Run|") && !status.contains("|Stream:"), "{status}");
    bench.say("!");
    bench.work(2000);
    assert!(bench.say("?").contains("<Hold:0|"));
    bench.say("~");
    bench.work(500);
    assert!(bench.say("?").contains("<Run|"));
    bench.say("\x18");
    bench.finish();
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    // The next drawing is a whole one.
    let lines = scene("lattice3.obj", &[]);
    let mut fresh = uploaded(4000, &[]);
    fresh.order(&["$plot".to_owned()]);
    finish(&mut fresh);
    let before = places(&bench);
    bench.order(&["$hidden=erased".to_owned(), "$plot".to_owned()]);
    finish(&mut bench);
    let (all, once) = (places(&bench), places(&fresh));
    let key = |points: &[[f64; 2]]| {
        points.iter().map(|point| point.map(|part| part as i64)).collect::<BTreeSet<_>>()
    };
    let (all, once, before) = (key(&all), key(&once), key(&before));
    assert!(once.is_subset(&all));
    assert!(all.iter().all(|point| once.contains(point) || before.contains(point)));
    // A small model is in memory again.
    bench.order(&["$clear".to_owned()]);
    bench.order(&lines[..8]);
    assert!(!bench.say("$model\n").contains("in flash"));
}

#[test]
fn a_drawing_beyond_the_travel_is_refused_before_anything_moves() {
    let mut bench = uploaded(4000, &["$130=60", "$131=60"]);
    assert_eq!(refused(&mut bench, "$plot"), 15);
    assert!(bench.plotter.machine().is_stopped());
    bench.order(&["$page=60x60".to_owned(), "$plot".to_owned()]);
    finish(&mut bench);
}

#[test]
fn what_is_too_dense_for_the_memory_is_said() {
    let mut bench = uploaded(300, &[]);
    let answer = bench.say("$plot\n");
    assert!(answer.ends_with("error:197\n"), "{answer}");
    let numbers: Vec<usize> = answer
        .split([' ', ':'])
        .filter_map(|word| word.parse().ok())
        .filter(|number| *number != 197)
        .collect();
    assert!(answer.contains(" bytes are needed in one place where there is room for "), "{answer}");
    assert!(numbers.len() == 2 && numbers[0] > numbers[1] && numbers[1] > 0, "{answer}");
    assert!(bench.plotter.machine().is_stopped());
    let mut bench = small(20, 60, 1500);
    bench.order(&scene("gears.obj", &["$page=60x60"]));
    bench.finish();
    let heard = bench.heard();
    assert!(heard.contains("[MSG:the job is given up: "), "{heard}");
    assert!(heard.contains(" are needed in one place where there is room for "), "{heard}");
    assert_eq!(bench.plotter.machine().state(), State::Idle);
}

/// The button ends the move of a model to flash, which takes many sectors. The model stays in
/// memory, and goes to flash once more when the line that did not fit comes again.
#[test]
fn a_move_to_flash_that_is_given_up_leaves_the_model_in_memory() {
    let lines = scene("lattice3.obj", &[]);
    let mut whole = small(20, 60, 1500);
    whole.order(&lines);
    finish(&mut whole);
    let (mut given_up, mut moved) = (0, 0);
    for from in 0..40 {
        let mut bench = small(20, 60, 1500);
        let fitting = lines.iter().take_while(|line| line.starts_with('v')).take(20);
        let count = bench.order(&fitting.cloned().collect::<Vec<_>>()).lines().count();
        // The contacts are read once in each turn, and before each change of flash.
        bench.board.press_stop_during(from..from + 1);
        let answer = bench.say(&format!("{}\n", lines[count]));
        bench.board.press_stop_during(0..0);
        bench.finish();
        bench.say("$X\n");
        bench.finish();
        if answer.contains("the model goes to flash") {
            moved += 1;
            continue;
        }
        given_up += 1;
        assert!(bench.say("$model\n").contains("vertices 20 of 20"), "{from}: {answer}");
        let heard = bench.order(&lines[count..]);
        assert!(heard.contains("the model goes to flash"), "{heard}");
        finish(&mut bench);
        assert_eq!(only_one(&places(&whole), &places(&bench)).0, 0, "{from}");
    }
    assert!(given_up > 0 && moved > 0, "{given_up} {moved}");
}
