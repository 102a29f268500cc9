//! Drawings of a model in flash, which are computed and drawn part by part, go on after a loss of
//! power: judged by the ink that the pins leave.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

mod garbage;

use penup::boards::host::{CutArea, CutFlash, LAYOUT};
use penup::machine::State;
use penup::plotter::Board as _;
use penup::storage::NOTE_BYTES;
use penup_host_tests::cut_jobs::{
    Point, Powered, assert_one_drawing, drawn_length, empty_flash, ink, strokes_of, switch_on_small,
};
use penup_host_tests::random::Random;
use penup_host_tests::streamed_drawing::StreamedDrawing;
use penup_host_tests::whole_jobs::job_lines;
use penup_job::pins::PinChange;
use penup_readers::lines::Lines;

/// What the pins have drawn: each time that the pen was down is a list of points.
type Run = Vec<Vec<Point>>;

/// A pen and a machine that take little time, so that the tests do not either. The numbers of the
/// camera have more digits than `$options` shows.
const OPTIONS: [&str; 7] = [
    "$212=20",
    "$213=20",
    "$110=6000",
    "$111=6000",
    "$page=60x60",
    "$margin=5",
    "$eye=9.12345678901,-14.00000001,8.3",
];

/// So many ticks pass in a millisecond of computing, so that the pen waits for some parts.
const WORK_TICKS: u64 = 250_000;

/// The lines of a job whose model does not fit in the memory.
fn lattice(options: &[&str]) -> Vec<String> {
    job_lines("lattice3.obj", &[&OPTIONS[..], options].concat())
}

/// A board that is off: its flash, and its flash for a model.
struct Off {
    flash: CutFlash,
    model: CutArea,
}

impl Off {
    fn new() -> Self {
        Self { flash: empty_flash(), model: CutArea::new(96 << 10) }
    }

    /// Switches the board on, lets `work` use it, and cuts the power. Returns what was drawn.
    fn on(&mut self, work: impl FnOnce(&mut Powered<'_, '_>)) -> Run {
        let model = core::mem::replace(&mut self.model, CutArea::new(0));
        let (flash, model, changes) =
            switch_on_small(self.flash.clone().powered(), model, WORK_TICKS, work);
        (self.flash, self.model) = (flash, model);
        strokes_of(changes.iter().map(PinChange::from))
    }
}

/// Runs to the end of the job, or until the power fails, and puts in each pen that the machine asks
/// for. Returns the number of milliseconds.
fn finish(plotter: &mut Powered<'_, '_>) -> u64 {
    let passed = run(plotter, 3_600_000);
    assert!(passed < 3_600_000, "the job does not end");
    passed
}

/// Does the same for this many milliseconds at most.
fn run(plotter: &mut Powered<'_, '_>, milliseconds: u64) -> u64 {
    let mut passed = 0;
    loop {
        passed += plotter.run(milliseconds - passed);
        let is_over = plotter.is_cut() || plotter.plotter.machine().state() == State::Idle;
        if is_over || passed >= milliseconds {
            return passed;
        }
        // Between two pens or parts the machine stands.
        let asks = plotter.plotter.machine().pen_wanted().is_some();
        plotter.send(if asks { "~" } else { "" });
        plotter.board.wait();
        passed += 1;
    }
}

/// Draws a job without a cut. Returns its strokes, and how long it takes in milliseconds.
fn undisturbed(lines: &[String]) -> (Run, u64) {
    let mut milliseconds = 0;
    let mut board = Off::new();
    let strokes = board.on(|plotter| {
        plotter.order(lines);
        milliseconds = finish(plotter);
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
        let answer = plotter.say("$resume");
        assert!(answer.ends_with("error:163\n"), "{answer}");
    });
    let after = board.on(|plotter| {
        let greeting = plotter.heard();
        assert!(!greeting.contains("stopped"), "{lines:?}: {greeting}");
        assert!(plotter.say("$resume").ends_with("error:163\n"));
    });
    assert_eq!(after, Run::new());
    (strokes, milliseconds)
}

/// Goes on with the drawing that has stopped. Returns whether there was one.
fn go_on(plotter: &mut Powered<'_, '_>) -> bool {
    let greeting = plotter.heard();
    let answer = plotter.say("$resume");
    if answer.ends_with("error:163\n") {
        assert!(!greeting.contains("stopped"), "{greeting}");
        return false;
    }
    assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
    // How many strokes there are is not known.
    let status = plotter.status();
    let stopped = status.split('|').find_map(|field| field.strip_prefix("Stopped:"));
    assert!(stopped.is_some_and(|numbers| numbers.ends_with("/0")), "{status}");
    // Nobody has said yet where the pen is.
    assert!(answer.ends_with("error:164\n"), "{answer}");
    let answer = plotter.say("$resume=origin");
    assert!(plotter.is_cut() || answer.lines().any(|line| line == "ok"), "{answer}");
    true
}

/// Draws a job and cuts the power `cuts` times, at random instants of the time that it takes, or
/// while a random byte of the flash is written. Returns the strokes of each run.
fn draw_with_cuts(lines: &[String], milliseconds: u64, cuts: u64, random: &mut Random) -> Vec<Run> {
    let mut board = Off::new();
    let mut runs: Vec<Run> = Vec::new();
    for number in 0..=cuts {
        let is_last = number == cuts;
        let after = random.below(2 * milliseconds / (cuts + 1) + 1);
        let in_flash = !is_last && random.once_in(3);
        let run = board.on(|plotter| {
            let goes_on = go_on(plotter);
            if in_flash {
                let budget = random.below(256 * 40) as usize;
                plotter.board.flash().expect("flash").budget = budget;
            }
            if !goes_on {
                // A cut before the job has begun, or behind its end.
                if runs.iter().any(|run| !run.is_empty()) {
                    return;
                }
                plotter.say("$clear");
                plotter.order(lines);
            }
            if is_last || in_flash {
                finish(plotter);
            } else {
                run(plotter, after);
            }
        });
        runs.push(run);
    }
    runs
}

#[test]
fn a_drawing_that_is_cut_ten_times_arrives_as_one() {
    for options in [&["$hidden=erased"][..], &["$hidden=pen,2", "$title=Cut"], &["$crease=20"]] {
        let lines = lattice(options);
        let (whole, milliseconds) = undisturbed(&lines);
        assert!(whole.len() > 60, "{}", whole.len());
        let mut twice = 0;
        for seed in 0..4 {
            let mut random = Random::new(1977 + seed);
            let runs = draw_with_cuts(&lines, milliseconds, 10, &mut random);
            assert!(runs.iter().filter(|run| !run.is_empty()).count() > 5, "{options:?}");
            twice += assert_one_drawing(&whole, &runs);
        }
        assert!(twice > 5, "{options:?}: {twice}");
    }
}

/// With points within strokes a stroke goes on at the last one, in whatever part it lies.
#[test]
fn a_stroke_of_a_part_goes_on_within() {
    let lines = lattice(&["$hidden=erased", "$219=0.005"]);
    let (whole, milliseconds) = undisturbed(&lines);
    let without = undisturbed(&lattice(&["$hidden=erased"])).0;
    assert_eq!(ink(&whole), ink(&without));
    let all = drawn_length(&whole);
    let (mut twice, mut cuts) = (0.0, 0.0);
    for seed in 0..4 {
        let mut random = Random::new(1990 + seed);
        let runs = draw_with_cuts(&lines, milliseconds, 10, &mut random);
        assert_eq!(ink(runs.iter().flatten()), ink(&whole), "seed {seed}");
        twice += runs.iter().map(|run| drawn_length(run)).sum::<f64>() - all;
        cuts += runs.len() as f64 - 1.0;
    }
    // Between two points lie 400 steps and a chord. On average half of it is drawn twice.
    assert!(twice > 0.0 && twice < 400.0 * cuts, "{twice} {cuts}");
}

#[test]
fn a_drawing_that_is_given_up_goes_on_and_is_drawn_again() {
    let lines = lattice(&[]);
    let (whole, milliseconds) = undisturbed(&lines);
    let mut board = Off::new();
    let mut first = 0;
    let drawn = board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds / 3);
        plotter.send("\x18");
        plotter.finish();
        first = strokes_of(plotter.board.trace().changes().iter().map(PinChange::from)).len();
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
        // Neither options nor speeds count that are set meanwhile.
        for line in ["$hidden=dotted", "$page=50x50", "$effort=0", "$111=3000", "$120=400"] {
            assert!(plotter.say(line).ends_with("ok\n"), "{line}");
        }
        let answer = plotter.say("$resume");
        assert!(answer.contains("which may take minutes") && answer.ends_with("ok\n"), "{answer}");
        finish(plotter);
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
    });
    assert!(first > 10 && first < whole.len() - 10, "{first}");
    let runs = [drawn[..first].to_vec(), drawn[first..].to_vec()];
    assert_one_drawing(&whole, &runs);
    // Another copy, after a loss of power, which is cut, and goes on.
    let begun = board.on(|plotter| {
        assert!(plotter.say("$again").ends_with("ok\n"));
        plotter.run(milliseconds / 3);
    });
    assert!(begun.len() > 10 && begun.len() < whole.len() - 10);
    let rest = board.on(|plotter| {
        assert!(go_on(plotter));
        finish(plotter);
    });
    assert_one_drawing(&whole, &[begun, rest]);
}

#[test]
fn the_rest_can_be_given_up_while_it_is_computed() {
    let lines = lattice(&[]);
    let (whole, milliseconds) = undisturbed(&lines);
    let mut board = Off::new();
    let mut runs = Vec::new();
    runs.push(board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds * 2 / 3);
    }));
    let nothing = board.on(|plotter| {
        // The button is pressed while what is drawn is computed again.
        plotter.board.press_stop_during(40..60);
        let answer = plotter.say("$resume=origin");
        assert!(answer.contains("error:"), "{answer}");
        plotter.run(100);
        assert!(matches!(plotter.plotter.machine().state(), State::Alarm(_)));
        plotter.board.press_stop_during(0..0);
        assert!(plotter.say("$X").ends_with("ok\n"));
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
    });
    assert_eq!(nothing, Run::new());
    runs.push(board.on(|plotter| {
        assert!(go_on(plotter));
        finish(plotter);
    }));
    assert_one_drawing(&whole, &runs);
}

/// The power goes behind the last stroke, before its end is noted, at any byte of the note.
#[test]
fn a_cut_behind_the_last_stroke_leaves_nothing_to_draw() {
    let lines = lattice(&["$eye=99,0.5,0.5", "$at=0.5,0.5,0.5", "$projection=orthographic"]);
    let (whole, _) = undisturbed(&lines);
    let mut board = Off::new();
    let mut all = 0;
    board.on(|plotter| {
        plotter.board.flash().expect("flash").budget = usize::MAX / 2;
        plotter.order(&lines);
        finish(plotter);
        all = usize::MAX / 2 - plotter.board.flash().expect("flash").budget;
    });
    // One page says that the drawing is complete, and each page before it that a stroke is drawn.
    for before_end in [0, 1, 40, 150, 191, 192, 193, 200, 255, 256, 257, 300, 512] {
        let mut board = Off::new();
        let mut runs = vec![board.on(|plotter| {
            plotter.board.flash().expect("flash").budget = all - before_end;
            plotter.order(&lines);
            finish(plotter);
        })];
        runs.push(board.on(|plotter| {
            let greeting = plotter.heard();
            let answer = plotter.say("$resume=origin");
            assert_eq!(greeting.contains("stopped"), answer.ends_with("ok\n"), "{answer}");
            finish(plotter);
            assert!(plotter.say("$resume=origin").ends_with("error:163\n"));
        }));
        assert_eq!(ink(runs.iter().flatten()), ink(&whole), "{before_end}");
    }
    // All strokes are noted, and not that these are all.
    let (slot, sum) = LAYOUT.job.identify(&mut board.flash).expect("a job");
    let (log, mut notes) = (LAYOUT.logs[slot], [0; NOTE_BYTES]);
    let (length, noted) = log.read(&mut board.flash, sum, &mut notes).expect("a log");
    assert!(noted.is_closed);
    let mut flash = board.flash.clone().powered();
    log.begin(&mut flash, sum, &notes[..length]).expect("it is taken");
    log.note(&mut flash, 0, whole.len() as u32).expect("it is taken");
    board.flash = flash;
    let nothing = board.on(|plotter| {
        assert!(plotter.heard().contains("stopped"));
        let answer = plotter.say("$resume=origin");
        assert!(answer.contains("nothing is left to draw"), "{answer}");
        assert!(plotter.say("$resume=origin").ends_with("error:163\n"));
    });
    assert_eq!(nothing, Run::new());
}

#[test]
fn what_has_changed_is_refused_and_the_drawing_stays_kept() {
    let lines = lattice(&[]);
    let (whole, milliseconds) = undisturbed(&lines);
    let mut board = Off::new();
    let begun = board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds / 2);
    });
    let nothing = board.on(|plotter| {
        assert!(plotter.say("$100=81").ends_with("ok\n"));
        assert!(plotter.say("$resume=origin").contains("$100"));
        assert!(plotter.say("$100=80").ends_with("ok\n"));
        // Checking moves nothing and replaces nothing.
        assert!(plotter.say("$C").ends_with("ok\n"));
        assert!(plotter.say("$plot").ends_with("ok\n"));
        plotter.send("\x18");
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
    });
    assert_eq!(nothing, Run::new());
    let rest = board.on(|plotter| {
        assert!(go_on(plotter));
        finish(plotter);
    });
    assert_one_drawing(&whole, &[begun, rest]);

    let mut board = Off::new();
    let begun = board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds / 2);
    });
    let nothing = board.on(|plotter| {
        assert!(plotter.say("$clear").ends_with("ok\n"));
        assert!(plotter.say("$resume=origin").ends_with("error:167\n"));
        assert!(plotter.say("$again").ends_with("error:167\n"));
        let other = job_lines("notched.obj", &[]);
        plotter.order(&other[..other.len() - 1]);
        assert!(plotter.say("$resume=origin").ends_with("error:167\n"));
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
        assert!(plotter.say("$clear").ends_with("ok\n"));
    });
    assert_eq!(nothing, Run::new());
    // The same model, sent again, is that of the drawing.
    let rest = board.on(|plotter| {
        plotter.order(&lines[..lines.len() - 1]);
        let answer = plotter.say("$resume=origin");
        assert!(answer.ends_with("ok\n"), "{answer}");
        finish(plotter);
    });
    assert_one_drawing(&whole, &[begun, rest]);
}

#[test]
fn a_refusal_leaves_the_options_as_they_are() {
    let lines = lattice(&[]);
    let (_, milliseconds) = undisturbed(&lines);
    let mut board = Off::new();
    board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds / 2);
    });
    board.on(|plotter| {
        assert!(plotter.heard().contains("stopped"));
        let mut refuses = |refused: &str, because: &str| {
            let before = plotter.say("$options");
            let answer = plotter.say(refused);
            assert!(answer.contains(because), "{refused}: {answer}");
            assert_eq!(plotter.say("$options"), before, "{refused}");
        };
        // The machine is too small for the drawing.
        refuses("$130=30", "ok\n");
        refuses("$resume=origin", "error:");
        refuses("$again", "error:");
        refuses("$130=420", "ok\n");
        // It only checks, so that the pen is nowhere.
        refuses("$C", "ok\n");
        refuses("$resume=origin", "error:");
        refuses("$again", "ok\n");
    });
}

/// The power goes while a drawing in parts begins to be drawn once more: what it is computed from
/// stays kept.
#[test]
fn a_drawing_is_drawn_again_wherever_its_beginning_was_cut() {
    let lines = lattice(&[]);
    let mut board = Off::new();
    let whole = board.on(|plotter| {
        plotter.order(&lines);
        finish(plotter);
    });
    for budget in [0, 1, 100, 300, 1000, 3000, 4095, 4096, 4097, 4200, 4351, 4352, 4353, 4400] {
        let begun = board.on(|plotter| {
            plotter.board.flash().expect("flash").budget = budget;
            plotter.send("$again\n");
            finish(plotter);
            assert!(plotter.is_cut(), "{budget}");
        });
        assert!(begun.len() < whole.len(), "{budget}");
    }
    let again = board.on(|plotter| {
        let answer = plotter.say("$again");
        assert!(answer.ends_with("ok\n"), "{answer}");
        finish(plotter);
    });
    assert_eq!(ink(&again), ink(&whole));
}

/// A board on which the power fails while a drawing is in progress, the strokes of the whole
/// drawing, and those that were drawn.
fn cut_in_the_middle() -> (Off, Run, Run) {
    let lines = lattice(&[]);
    let (whole, milliseconds) = undisturbed(&lines);
    let mut board = Off::new();
    let begun = board.on(|plotter| {
        plotter.order(&lines);
        plotter.run(milliseconds / 2);
    });
    (board, whole, begun)
}

/// The first line of a drawing that is sent comes in the very turn of the main loop in which a
/// drawing in parts ends, or in one of those around it.
#[test]
fn a_drawing_that_is_sent_right_behind_the_last_part_is_drawn() {
    let lines = lattice(&["$eye=99,0.5,0.5", "$at=0.5,0.5,0.5", "$projection=orthographic"]);
    let (whole, _) = undisturbed(&lines);
    let plan = ["v 5 5 0", "v 40 5 0", "v 40 30 0", "l 1 2 3", "$plot"];
    let mut settings = lattice(&[]);
    settings.retain(|line| line.starts_with("$1") || line.starts_with("$2"));
    let drawing = [&settings[..], &plan.map(str::to_owned)].concat();
    let job = StreamedDrawing::of(&drawing).from(0);
    let sent: Vec<String> = job.in_order().map(|line| line.sent).collect();
    let (head, rest) = sent.split_first().expect("lines");

    // The machine's number of turns until the drawing in parts has ended.
    let mut turns = 0;
    let turn = |plotter: &mut Powered<'_, '_>| {
        plotter.plotter.poll(plotter.board);
        plotter.board.wait();
    };
    Off::new().on(|plotter| {
        plotter.order(&lines);
        plotter.board.receive(head.as_bytes());
        while plotter.plotter.machine().state() != State::Idle {
            turn(plotter);
            turns += 1;
        }
    });
    let mut accepted = 0;
    for early in 0..8 {
        let mut is_accepted = false;
        let run = Off::new().on(|plotter| {
            plotter.order(&lines);
            plotter.board.receive(head.as_bytes());
            for _ in 0..turns + 3 - early {
                turn(plotter);
            }
            plotter.heard();
            plotter.board.receive(b"\n");
            // Nothing is read while the end of the drawing is noted.
            let answer = loop {
                turn(plotter);
                match plotter.heard() {
                    heard if heard.is_empty() => {}
                    heard => break heard,
                }
            };
            is_accepted = answer.ends_with("ok\n");
            if is_accepted {
                accepted += 1;
                plotter.order(rest);
            } else {
                assert!(answer.ends_with("error:8\n"), "{early}: {answer}");
            }
            plotter.finish();
            assert_eq!(plotter.plotter.machine().state(), State::Idle, "{early}");
        });
        let first = &run[..run.len().min(whole.len())];
        assert_eq!(ink(first), ink(&whole), "{early}");
        assert_eq!(run.len() - first.len(), usize::from(is_accepted), "{early}");
    }
    assert!((2..8).contains(&accepted), "{accepted}");
}
