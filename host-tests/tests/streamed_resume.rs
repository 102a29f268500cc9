//! Drawings that a computer sends while they are drawn, and whose plotter loses its power: judged
//! by the ink that the pins leave. The cases share one sender, so this is longer than 500 lines.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::boards::host::CutFlash;
use penup::plotter::Board as _;
use penup_host_tests::cut_jobs::{
    Point, Powered, assert_one_drawing, drawn_length, empty_flash, ink, strokes_of, switch_on_early,
};
use penup_host_tests::random::Random;
use penup_host_tests::streamed_drawing::StreamedDrawing as Drawing;
use penup_host_tests::whole_jobs::job_lines;
use penup_job::pins::PinChange;
use penup_job::streamed::StreamedJob;
use penup_readers::lines::Lines as _;

/// A pen that takes little time, so that the tests do not either.
const QUICK_PEN: [&str; 2] = ["$212=20", "$213=20"];

/// The working memory of the plotter in words: a target that has come takes one.
const WORDS: usize = 1000;

/// The numbers of a `[STOPPED:id,drawn,all,lost,points]`, if that is answered to `$stream`.
fn stopped(plotter: &mut Powered<'_, '_>) -> Option<[u32; 5]> {
    plotter.heard();
    let answer = plotter.say("$stream");
    if answer.ends_with("error:181\n") {
        return None;
    }
    let numbers = answer.trim_start_matches("[STOPPED:").trim_end_matches("]\nok\n");
    let numbers: Vec<u32> =
        numbers.split(',').map(|it| it.parse().unwrap_or_else(|_| panic!("{answer}"))).collect();
    Some(numbers.try_into().expect("five numbers"))
}

/// Sends lines while they are drawn, with a line late now and then, for this many milliseconds at
/// most. Returns whether the drawing has ended.
fn send(
    plotter: &mut Powered<'_, '_>,
    job: &StreamedJob,
    late_once_in: i32,
    mut milliseconds: u64,
    random: &mut Random,
) -> bool {
    let lines: Vec<String> = job.in_order().map(|line| line.sent).collect();
    for line in lines {
        if late_once_in > 0 && random.once_in(late_once_in) {
            let passed = plotter.run(milliseconds.min(20_000));
            milliseconds -= passed;
        }
        plotter.board.receive(format!("{line}\n").as_bytes());
        while plotter.plotter.poll(plotter.board) {}
        while !plotter.board.has_read_all() {
            if milliseconds == 0 || plotter.is_cut() {
                return false;
            }
            milliseconds -= 1;
            plotter.board.wait();
            while plotter.plotter.poll(plotter.board) {}
        }
        if milliseconds == 0 || plotter.is_cut() {
            return false;
        }
        assert!(plotter.heard().ends_with("ok\n"), "{line}");
    }
    plotter.run(milliseconds) < milliseconds && !plotter.is_cut()
}

/// Sends a drawing to a plotter whose power fails at random instants, or while a random byte of its
/// flash is written, and sends the rest as a client does. Returns the strokes of each run.
fn draw_with_cuts(
    drawing: &mut Drawing,
    cuts: u32,
    late_once_in: i32,
    milliseconds: u64,
    random: &mut Random,
) -> Vec<Vec<Vec<Point>>> {
    let mut flash = empty_flash();
    let mut runs: Vec<Vec<Vec<Point>>> = Vec::new();
    let whole = drawing.from(0);
    let all = whole.size().strokes;
    let mut is_over = false;
    for number in 0..=cuts {
        let is_last = number == cuts;
        let after = if is_last { u64::MAX / 2 } else { random.below(milliseconds) };
        let in_flash = !is_last && random.once_in(3);
        let (left, changes) = switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
            let found = stopped(plotter);
            if found.is_none() && runs.iter().any(|run| !run.is_empty()) {
                is_over = true;
                return;
            }
            let (from, points) = found.map_or((0, 0), |[id, drawn, found_all, lost, points]| {
                assert_eq!((whole.id(), all), (id, found_all), "it is known again");
                assert_eq!(lost, 1, "nobody has said where the pen is");
                (drawn, points)
            });
            if found.is_some() {
                assert!(plotter.say("$resume").contains("error:163\n"), "it has no strokes");
                assert!(plotter.say("$resume=origin").ends_with("ok\n"));
                let [.., lost, _] = stopped(plotter).expect("still stopped");
                assert_eq!(lost, 0);
            } else {
                plotter.order(&drawing.settings);
            }
            if plotter.is_cut() {
                return;
            }
            let job = drawing.rest(from, points);
            if in_flash {
                let budget = random.below(256 * u64::from(all - from + 2)) as usize;
                plotter.board.flash().expect("flash").budget = budget;
            }
            is_over = send(plotter, &job, late_once_in, after, random);
            if is_over {
                assert_eq!(stopped(plotter), None, "nothing is left");
                assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
                assert!(plotter.say("$again").ends_with("error:161\n"), "it is not kept");
            }
        });
        flash = left;
        runs.push(strokes_of(changes.iter().map(PinChange::from)));
        if is_over {
            break;
        }
    }
    assert!(is_over, "the last run has no cut");
    runs
}

/// What a drawing is without a cut: its strokes, and the milliseconds that it takes.
fn undisturbed(drawing: &mut Drawing) -> (Vec<Vec<Point>>, u64) {
    let job = drawing.from(0);
    let (_, changes) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&drawing.settings);
        assert!(send(plotter, &job, 0, u64::MAX / 2, &mut Random::new(1)));
    });
    let milliseconds = job.size().milliseconds;
    (strokes_of(changes.iter().map(PinChange::from)), milliseconds)
}

#[test]
fn a_drawing_that_is_sent_arrives_whole_although_the_power_fails() {
    let options = ["$page=60x60", "$margin=5", "$hidden=erased"];
    let lines = job_lines("lattice2.obj", &[&QUICK_PEN[..], &options].concat());
    let mut drawing = Drawing::of(&lines);
    let (whole, milliseconds) = undisturbed(&mut drawing);
    let mut twice = 0;
    for seed in 0..8 {
        let random = &mut Random::new(1971 + seed);
        let runs = draw_with_cuts(&mut drawing, 8, 0, milliseconds / 4, random);
        twice += assert_one_drawing(&whole, &runs);
    }
    assert!(twice > 5, "{twice}: a cut comes in the middle of a stroke more often than not");
}

/// A spiral in one stroke and a few short ones, whose lines come late: the pen rises within the
/// stroke, which is not drawn by then.
#[test]
fn a_stroke_whose_rest_was_late_is_not_taken_for_drawn() {
    let mut lines: Vec<String> = Vec::new();
    let points = 4000;
    for index in 0..points {
        let (angle, radius) = (f64::from(index) * 0.2, 1.0 + f64::from(index) * 0.004);
        lines.push(format!(
            "v {:.3} {:.3} 0",
            30.0 + radius * angle.cos(),
            30.0 + radius * angle.sin()
        ));
    }
    for first in (1..points).step_by(20) {
        let last = points.min(first + 20);
        let numbers: Vec<String> = (first..=last).map(|number| number.to_string()).collect();
        lines.push(format!("l {}", numbers.join(" ")));
    }
    lines.extend(["v 0 0 0", "v 4 0 0", "v 0 60 0", "v 5 60 0"].map(str::to_owned));
    lines.extend([
        format!("l {} {}", points + 1, points + 2),
        format!("l {} {}", points + 3, points + 4),
    ]);
    let options = ["$view=auto", "$page=70x70", "$margin=5", "$110=6000", "$111=6000", "$plot"];
    lines.extend(QUICK_PEN.iter().chain(&options).map(|line| (*line).to_owned()));
    let mut drawing = Drawing::of(&lines);
    let (whole, milliseconds) = undisturbed(&mut drawing);
    let mut cuts = 0;
    for seed in 0..6 {
        let random = &mut Random::new(1979 + seed);
        let runs = draw_with_cuts(&mut drawing, 5, 6, milliseconds, random);
        assert!(ink(runs.iter().flatten()) == ink(&whole), "seed {seed}: the ink differs");
        cuts += runs.len() - 1;
    }
    assert!(cuts > 6, "{cuts}");
}

#[test]
fn what_a_drawing_depends_on_must_be_as_it_was() {
    let options = ["$page=20x20", "$margin=4"];
    let lines = job_lines("cube.obj", &[&QUICK_PEN[..], &options].concat());
    let mut drawing = Drawing::of(&lines);
    let job = drawing.from(0);
    let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&drawing.settings);
        assert!(!send(plotter, &job, 0, 1000, &mut Random::new(3)));
    });
    switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        let greeting = plotter.heard();
        assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
        assert!(plotter.status().contains("|Stopped:"));
        plotter.order(&["$3=1".to_owned()]);
        let answer = plotter.say("$stream");
        assert!(answer.contains("error:1") && !answer.contains("STOPPED"), "{answer}");
        plotter.order(&["$3=0".to_owned()]);
        assert!(stopped(plotter).is_some());
    });
}

/// A small drawing with these settings, and all of its strokes.
fn small(settings: &[&str]) -> (Drawing, StreamedJob) {
    let options = [&QUICK_PEN[..], &["$page=20x20", "$margin=4"], settings].concat();
    let mut drawing = Drawing::of(&job_lines("cube.obj", &options));
    let job = drawing.from(0);
    (drawing, job)
}

/// A drawing that is cut: its strokes, the flash, and what was drawn.
fn cut_in_the_middle() -> (Drawing, Vec<Vec<Point>>, CutFlash, Vec<Vec<Point>>) {
    let options = ["$page=60x60", "$margin=5", "$hidden=erased"];
    let lines = job_lines("lattice2.obj", &[&QUICK_PEN[..], &options].concat());
    let mut drawing = Drawing::of(&lines);
    let job = drawing.from(0);
    let (whole, milliseconds) = undisturbed(&mut drawing);
    let (flash, changes) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&drawing.settings);
        assert!(!send(plotter, &job, 0, milliseconds / 2, &mut Random::new(3)));
    });
    (drawing, whole, flash.powered(), strokes_of(changes.iter().map(PinChange::from)))
}

/// More reads than there ever are.
const MANY: usize = 1 << 40;

#[test]
fn garbage_from_the_flash_at_a_start_loses_nothing() {
    let (_, whole, flash, before) = cut_in_the_middle();
    let start = |garbage_after: usize| {
        let mut found = (String::new(), None);
        let garbled = CutFlash { garbage_after: Some(garbage_after), ..flash.clone() };
        let (flash, _) = switch_on_early::<WORDS>(garbled, None, |plotter| {
            found = (plotter.heard(), stopped(plotter));
        });
        (found, flash.garbage_after)
    };
    let (found, left) = start(MANY);
    let (greeting, numbers) = &found;
    assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
    let [_, drawn, all, ..] = numbers.expect("it has stopped");
    assert!(drawn > 0 && all as usize == whole.len() && before.len() < whole.len(), "{drawn}");
    let count = MANY - left.expect("there are fewer reads");
    assert!(count > 100, "{count}");
    for number in 0..count {
        assert_eq!(start(number), (found.clone(), None), "garbage at read {number} of {count}");
    }
}

#[test]
fn garbage_from_the_flash_while_the_rest_is_sent_loses_nothing() {
    let (mut drawing, whole, flash, before) = cut_in_the_middle();
    let mut go_on = |garbage_after: usize| {
        let (flash, changes) = switch_on_early::<WORDS>(flash.clone(), None, |plotter| {
            let [_, drawn, _, _, points] = stopped(plotter).expect("it has stopped");
            let rest = drawing.rest(drawn, points);
            plotter.board.flash().expect("flash").garbage_after = Some(garbage_after);
            assert!(plotter.say("$resume=origin").ends_with("ok\n"));
            assert!(send(plotter, &rest, 0, u64::MAX / 2, &mut Random::new(5)));
            assert_eq!(stopped(plotter), None);
        });
        let after = strokes_of(changes.iter().map(PinChange::from));
        assert_one_drawing(&whole, &[before.clone(), after]);
        flash.garbage_after
    };
    let count = MANY - go_on(MANY).expect("there are fewer reads");
    assert!(count > 20, "{count}");
    let mut random = Random::new(7);
    for _ in 0..30 {
        let number = random.below(count as u64) as usize;
        assert_eq!(go_on(number), None, "garbage at read {number} of {count}");
    }
}

/// A drawing of which no stroke is drawn may begin anew at another origin. Then that counts.
#[test]
fn a_drawing_that_begins_anew_goes_on_at_the_origin_where_it_began() {
    let (drawing, job) = small(&["$22=1"]);
    let mut random = Random::new(3);
    let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&drawing.settings);
        plotter.home((700, 300));
        assert!(!send(plotter, &job, 0, 200, &mut random));
    });
    let (flash, _) = switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        plotter.heard();
        assert!(plotter.say("$X").ends_with("ok\n"));
        let [_, drawn, _, lost, _] = stopped(plotter).expect("it has stopped");
        assert_eq!([drawn, lost], [0, 1]);
        assert!(!send(plotter, &job, 0, 1800, &mut random));
    });
    switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        plotter.home((700, 300));
        assert!(plotter.say("$stream").ends_with("error:169\n"));
        // The user says that the pen is there.
        assert!(plotter.say("$SLP").ends_with("ok\n"));
        plotter.send("\x18");
        plotter.run(100);
        assert!(plotter.say("$X").ends_with("ok\n"));
        let [_, drawn, _, lost, _] = stopped(plotter).expect("it goes on there");
        assert!(drawn > 0 && lost == 1, "{drawn} {lost}");
    });
}

/// The notes of an attempt that was given up before its first stroke are not those of a later one
/// with another setting.
#[test]
fn a_drawing_that_begins_anew_goes_on_with_the_settings_that_it_began_with() {
    let (drawing, job) = small(&[]);
    let mut random = Random::new(3);
    let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&drawing.settings);
        assert!(!send(plotter, &job, 0, 200, &mut random));
        plotter.board.receive(b"\x18");
        plotter.run(3000);
        let [_, drawn, ..] = stopped(plotter).expect("it has stopped");
        assert_eq!(drawn, 0);
        plotter.order(&["$3=1".to_owned()]);
        assert!(!send(plotter, &job, 0, 1500, &mut random));
    });
    switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        let [_, drawn, ..] = stopped(plotter).expect("it goes on with the setting that it had");
        assert!(drawn > 0, "{drawn}");
    });
}

/// A whole number as targets are written in `$s=…`.
fn digits(number: i32) -> String {
    const DIGITS: &[u8] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz+-";
    let mut left = if number < 0 { -2 * number - 1 } else { 2 * number }.cast_unsigned();
    let mut text = String::new();
    loop {
        let (digit, rest) = (left % 32, left / 32);
        let digit = DIGITS[digit as usize + if rest > 0 { 32 } else { 0 }];
        text.push(char::from(digit));
        if rest == 0 {
            return text;
        }
        left = rest;
    }
}

/// The header of a job of separate strokes of 400 steps, each below the one before, and its first
/// lines: one stroke each, drawn by the pen with this number, from 0.
fn apart(strokes: u32, pens: &[u8]) -> Vec<String> {
    let head =
        format!("$stream=5242880,5242880,7,{},400,400,800,16000,{strokes},1,1,1000", 2 * strokes);
    let stroke = |(number, pen): (usize, &u8)| {
        let (x, y) = (digits(400), digits(400 * (number as i32 + 1)));
        format!("$s=/{pen},{x}{y}{x}{}", digits(0))
    };
    [head].into_iter().chain(pens.iter().enumerate().map(stroke)).collect()
}

/// The flash notes strokes by twos here, so the rest begins with one by the pen before the one that
/// was put in last. Nobody knows which is in the holder.
#[test]
fn the_rest_of_a_drawing_whose_strokes_are_noted_by_twos_asks_for_its_pen() {
    let settings = QUICK_PEN.map(str::to_owned);
    let strokes = 23_041;
    let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&[&settings[..], &apart(strokes, &[0, 0, 0, 1, 1])].concat());
        plotter.run(10_000);
        assert!(plotter.heard().contains("put in pen 2"));
        plotter.send("~");
        plotter.run(20);
    });
    let (_, changes) = switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        let [id, drawn, all, ..] = stopped(plotter).expect("it has stopped");
        assert_eq!((id, drawn, all), (7, 2, strokes));
        assert!(plotter.say("$resume=origin").ends_with("ok\n"));
        plotter.order(&apart(strokes - drawn, &[0, 1, 1]));
        plotter.run(10_000);
        assert!(plotter.status().contains("|Pen:1|"), "{}", plotter.status());
        plotter.send("~");
        plotter.run(10_000);
        assert!(plotter.status().contains("|Pen:2|"), "{}", plotter.status());
    });
    assert_eq!(strokes_of(changes.iter().map(PinChange::from)).len(), 1);
}

/// Has the user put in pen 2.
fn put_in_pen_2(plotter: &mut Powered<'_, '_>) {
    plotter.send("T2M6\n");
    plotter.run(100);
    assert!(plotter.heard().contains("put in the next pen"));
    plotter.send("~");
    plotter.run(100);
}

/// The power goes while the plotter asks for pen 1, because pen 2 was in. A plotter that starts
/// knows nothing of that, and asks again, if the drawing has several pens.
#[test]
fn the_rest_of_a_drawing_asks_for_its_first_pen_after_a_start() {
    let settings = QUICK_PEN.map(str::to_owned);
    for (numbers, asks) in [("", true), (",1", false), (",1,0", false), (",2,0", true)] {
        let job = |strokes: u32| {
            let mut lines = apart(strokes, &[0, 0, 0, 0]);
            lines[0] += numbers;
            lines
        };
        let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
            plotter.order(&settings);
            put_in_pen_2(plotter);
            plotter.order(&job(4));
            plotter.run(1000);
            assert!(plotter.status().contains("|Pen:1|"), "{}", plotter.status());
        });
        switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
            assert_eq!(stopped(plotter).map(|[_, drawn, ..]| drawn), Some(0));
            assert!(plotter.say("$resume=origin").ends_with("ok\n"));
            plotter.order(&job(4));
            plotter.run(1000);
            assert_eq!(plotter.status().contains("|Pen:1|"), asks, "{numbers}");
        });
    }
}

/// With points within strokes a stroke goes on at the last one, also behind a second cut, and also
/// where its lines come late.
#[test]
fn a_stroke_that_is_sent_goes_on_within() {
    let mut lines: Vec<String> = Vec::new();
    let points = 600;
    for index in 0..points {
        let (angle, radius) = (f64::from(index) * 0.2, 1.0 + f64::from(index) * 0.04);
        let (x, y) = (30.0 + radius * angle.cos(), 30.0 + radius * angle.sin());
        lines.push(format!("v {x:.3} {y:.3} 0"));
    }
    for first in (1..points).step_by(20) {
        let last = points.min(first + 20);
        let numbers: Vec<String> = (first..=last).map(|number| number.to_string()).collect();
        lines.push(format!("l {}", numbers.join(" ")));
    }
    lines.extend(["v 0 0 0", "v 4 0 0"].map(str::to_owned));
    lines.push(format!("l {} {}", points + 1, points + 2));
    let options = ["$219=0.04", "$view=auto", "$page=70x70", "$margin=5", "$plot"];
    lines.extend(QUICK_PEN.iter().chain(&options).map(|line| (*line).to_owned()));
    let mut drawing = Drawing::of(&lines);
    let (whole, milliseconds) = undisturbed(&mut drawing);
    let mut cuts = 0;
    for (seed, late_once_in) in [(0, 0), (1, 0), (2, 0), (3, 6), (4, 6)] {
        let random = &mut Random::new(1980 + seed);
        let runs = draw_with_cuts(&mut drawing, 6, late_once_in, milliseconds / 3, random);
        assert!(ink(runs.iter().flatten()) == ink(&whole), "seed {seed}: the ink differs");
        // At most what lies between two points is drawn twice for each cut, and a chord.
        let twice = runs.iter().map(|run| drawn_length(run)).sum::<f64>() - drawn_length(&whole);
        let most = (runs.len() - 1) as f64 * (40.0 + 5.0) * 80.0;
        assert!(twice <= most, "seed {seed}: {twice} steps are drawn twice, {most} at most");
        cuts += runs.len() - 1;
    }
    assert!(cuts > 10, "{cuts}");
}

/// Whoever asks the plotter for the rest of a drawing that it does not have is told who has it.
#[test]
fn users_are_told_that_the_sender_has_the_rest() {
    let settings = QUICK_PEN.map(str::to_owned);
    let (flash, _) = switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
        plotter.order(&[&settings[..], &apart(9, &[0, 0, 0])].concat());
        plotter.run(3000);
    });
    switch_on_early::<WORDS>(flash.powered(), None, |plotter| {
        let greeting = plotter.heard();
        assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
        assert!(greeting.contains("of 9: its sender sends the rest]"), "{greeting}");
        for line in ["$resume", "$again"] {
            let answer = plotter.say(line);
            assert!(answer.contains("sender"), "{line}: {answer}");
            // What is advised must not be refused in turn.
            assert!(!answer.contains("$again") && !answer.contains("$plot"), "{line}: {answer}");
        }
        let answer = plotter.say("$resume=origin");
        assert!(answer.contains("the sender") && answer.ends_with("]\nok\n"), "{answer}");
    });
}

/// A stroke that begins where the one before ends is not lifted for, so the machine counts one
/// stroke less than the drawing has. The drawing is still known to be complete.
#[test]
fn a_drawing_whose_strokes_touch_is_complete_at_its_end() {
    for (dwell, strokes) in [(20, 2), (150, 2), (150, 3), (400, 3)] {
        let (mut line, mut at) = ("$s=,".to_owned(), [0, 0]);
        for target in 0..strokes {
            let from = [400 * (target + 1), 400];
            for (to, draws) in [(from, false), ([from[0] + 400, 400], true)] {
                if !draws && target > 0 {
                    line.push(',');
                }
                for axis in 0..2 {
                    line += &digits(to[axis] - std::mem::replace(&mut at[axis], to[axis]));
                }
            }
        }
        let head = format!(
            "$stream=5242880,5242880,7,{},400,400,{},400,{strokes},1,1,1000",
            2 * strokes,
            400 * (strokes + 1)
        );
        switch_on_early::<WORDS>(empty_flash(), None, |plotter| {
            let settings = [format!("$212={dwell}"), "$213=20".to_owned()];
            plotter.order(&[&settings[..], &[head, line]].concat());
            plotter.finish();
            let status = plotter.status();
            assert!(!status.contains("Stopped"), "{dwell} {strokes}: {status}");
            assert!(status.contains(&format!("|Drawn:{strokes}/{strokes}|")), "{status}");
            assert_eq!(stopped(plotter), None, "{dwell} {strokes}");
        });
    }
}
