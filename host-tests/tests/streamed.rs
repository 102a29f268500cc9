//! Drawings that a computer computes and sends stroke by stroke, judged by what the pins do.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::boards::host::lend_memory_of;
use penup::machine::State;
use penup::plotter::Board as _;
use penup_client::emulator::MachineEventKind;
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::{Bench, job_lines, machine_events};
use penup_job::protocol::numbered;
use penup_job::streamed::{Form, StreamError, StreamedJob};
use penup_readers::lines::Lines;

/// A pen that takes little time, so that the tests do not either.
const QUICK_PEN: [&str; 2] = ["$212=20", "$213=20"];

/// Runs until nothing moves any more, and puts in each pen that the machine asks for.
fn finish(bench: &mut Bench) {
    bench.finish();
    while bench.plotter.machine().pen_wanted().is_some() {
        bench.say("~");
        bench.finish();
    }
}

/// What the pins have done.
fn events(bench: &mut Bench) -> Vec<MachineEventKind> {
    machine_events(&bench.board.trace().changes())
}

/// Draws a job that a board computes. Returns what the pins do.
fn uploaded(lines: &[String]) -> Vec<MachineEventKind> {
    let mut bench = Bench::new();
    bench.order(lines);
    finish(&mut bench);
    events(&mut bench)
}

/// The lines that only set up the machine, and the job that a computer makes of all.
fn computed(lines: &[String], form: Form) -> (Vec<String>, Result<StreamedJob, StreamError>) {
    let mut bench = Bench::new();
    let (plot, before) = lines.split_last().expect("lines");
    assert_eq!(plot, "$plot");
    bench.order(before);
    struct Never;
    impl penup::stage::Cancel for Never {
        fn check(&mut self) -> Result<(), penup::stage::Aborted> {
            Ok(())
        }
    }
    let unobserved = &mut penup::plotter::Unobserved;
    bench.plotter.compute(&mut Never, unobserved).expect("a job");
    let settings = *bench.plotter.machine().settings();
    let job = StreamedJob::new(&settings, &mut bench.plotter.strokes(), form);
    let is_of_machine = |line: &&String| line[1..].starts_with(|c: char| c.is_ascii_digit());
    let machine = before.iter().filter(|line| line.starts_with('$')).filter(is_of_machine);
    (machine.cloned().collect(), job)
}

/// The lines of a streamed job.
fn lines_of(job: &StreamedJob) -> Vec<String> {
    job.in_order().map(|line| line.sent).collect()
}

/// Sends lines while they are drawn, as many at a time as the plotter takes.
fn stream(bench: &mut Bench, lines: &[String]) {
    for line in lines {
        bench.board.receive(format!("{line}\n").as_bytes());
        for _ in 0..600_000 {
            bench.plotter.poll(&mut bench.board);
            if bench.board.has_read_all() {
                break;
            }
            if bench.plotter.machine().pen_wanted().is_some() {
                bench.board.receive(b"~");
            }
            bench.board.wait();
        }
        while bench.plotter.poll(&mut bench.board) {}
        let answer = bench.heard();
        assert!(answer.ends_with("ok\n"), "{line}: {answer:?}");
    }
}

/// Draws a job that a computer computes. Returns what the pins do.
fn streamed(lines: &[String]) -> (Vec<MachineEventKind>, String) {
    let (machine, job) = computed(lines, Form::Strokes);
    let job = job.expect("a job");
    let mut bench = Bench::new();
    bench.order(&machine);
    stream(&mut bench, &lines_of(&job));
    finish(&mut bench);
    bench.board.receive(b"?");
    while bench.plotter.poll(&mut bench.board) {}
    let status = bench.heard();
    (events(&mut bench), status)
}

fn scene(name: &str, options: &[&str]) -> Vec<String> {
    let page = ["$page=60x60", "$margin=5", "$110=6000", "$111=6000"];
    job_lines(name, &[&QUICK_PEN[..], &page, options].concat())
}

#[test]
fn strokes_that_are_sent_move_the_pins_as_an_uploaded_job_does() {
    let machines: [&[&str]; 6] = [
        &[],
        // Dotted lines with another pen.
        &["$hidden=dotted"],
        // Another pen for hidden lines, and strokes that overlap, begin early and end late.
        &["$hidden=pen,2", "$221=1", "$222=0.5", "$223=0.5"],
        // A limit on jerk, one speed for each line, backlash.
        &["$204=20", "$205=1", "$235=0.1", "$236=0.2"],
        // Both motors move both axes.
        &["$230=1", "$236=0.1"],
        // A polargraph.
        &["$230=2"],
    ];
    for machine in machines {
        for name in ["cube.obj", "lattice2.obj", "interpen.obj"] {
            let lines = scene(name, machine);
            let (sent, status) = streamed(&lines);
            assert!(sent == uploaded(&lines), "{name} {machine:?}");
            assert_all_done(&status);
        }
    }
}

/// Checks that all strokes are done, according to a status report.
fn assert_all_done(status: &str) {
    let done = status.split_once("Drawn:").expect("strokes").1;
    let (done, all) = done.split('|').next().expect("counts").split_once('/').expect("all");
    assert_eq!(done, all, "{status}");
    assert!(all != "0", "{status}");
    assert!(status.contains("|Left:0>"), "{status}");
}

/// A plan of random polylines, and the options with which it is drawn.
fn random_plan(random: &mut Random) -> Vec<String> {
    let mut lines = vec!["$view=auto".to_owned()];
    let mut count = 0;
    for _ in 0..1 + random.below(12) {
        lines.push(format!("usemtl pen{}", 1 + random.below(3)));
        let points = 2 + random.below(6);
        for _ in 0..points {
            let coordinate = |random: &mut Random| 10.0 + random.below(40_000) as f64 / 1000.0;
            lines.push(format!("v {} {} 0", coordinate(random), coordinate(random)));
        }
        let numbers: Vec<String> = (1..=points).map(|at| (count + at).to_string()).collect();
        lines.push(format!("l {}", numbers.join(" ")));
        count += points;
    }
    let options = ["$page=70x70", "$margin=5", "$order=greedy"];
    lines.extend(options.iter().chain(&QUICK_PEN).map(|line| (*line).to_owned()));
    lines.push("$plot".to_owned());
    lines
}

#[test]
fn random_drawings_are_the_same_whoever_computes_them() {
    let mut random = Random::new(1984);
    for number in 0..40 {
        let lines = random_plan(&mut random);
        let (sent, status) = streamed(&lines);
        assert!(sent == uploaded(&lines), "{number}: {lines:#?}");
        assert_all_done(&status);
    }
}

/// The positions of the pen while it is down, in order.
fn ink(events: &[MachineEventKind]) -> Vec<(i32, i32)> {
    let (mut at, mut is_down, mut ink) = ((0, 0), false, Vec::new());
    for event in events {
        match event {
            MachineEventKind::Pen { down } => is_down = *down,
            MachineEventKind::Step { x, y } => {
                at = (at.0 + i32::from(*x), at.1 + i32::from(*y));
                if is_down {
                    ink.push(at);
                }
            }
            _ => {}
        }
    }
    ink
}

/// A spiral in one stroke, of so many points.
fn spiral(points: u32) -> Vec<String> {
    let mut lines: Vec<String> = (0..points)
        .map(|index| {
            let (angle, radius) = (f64::from(index) * 0.2, 1.0 + f64::from(index) * 0.004);
            format!("v {:.3} {:.3} 0", 30.0 + radius * angle.cos(), 30.0 + radius * angle.sin())
        })
        .collect();
    for first in (1..points).step_by(20) {
        let last = points.min(first + 20);
        let numbers: Vec<String> = (first..=last).map(|number| number.to_string()).collect();
        lines.push(format!("l {}", numbers.join(" ")));
    }
    let options = ["$view=auto", "$page=70x70", "$margin=5"];
    lines.extend(options.iter().chain(&QUICK_PEN).map(|line| (*line).to_owned()));
    lines.push("$plot".to_owned());
    lines
}

/// The pen is up whenever the machine stands and waits for lines, and the ink is what it would be
/// if they had come in time.
#[test]
fn a_machine_whose_lines_are_late_waits_with_the_pen_up() {
    for lines in [scene("lattice2.obj", &[]), spiral(3000)] {
        let whole = uploaded(&lines);
        let (machine, job) = computed(&lines, Form::Strokes);
        let job = lines_of(&job.expect("a job"));
        // The ring is shorter than the spiral.
        let mut bench = Bench::with_memory(lend_memory_of(100, 300, 1000, 16));
        bench.order(&machine);
        let mut waits = 0;
        for some in job.chunks(job.len() / 5) {
            stream(&mut bench, some);
            bench.finish();
            let is_late = bench.plotter.machine().state() == State::Run;
            waits += u32::from(is_late);
            let so_far = events(&mut bench);
            let is_pen_down = so_far.iter().rev().find_map(|event| match event {
                MachineEventKind::Pen { down } => Some(*down),
                _ => None,
            });
            assert_ne!(is_pen_down, Some(true), "it stands with the pen down");
            assert!(ink(&whole).starts_with(&ink(&so_far)));
        }
        assert!(waits >= 4, "{waits}");
        assert_eq!(ink(&events(&mut bench)), ink(&whole));
        let status = bench.say("?");
        assert!(status.starts_with("<Idle"), "{status}");
        assert_all_done(&status);
    }
}

/// Lines that are damaged, lost or doubled, as a sender with numbers and checksums repairs them.
#[test]
fn a_line_that_is_damaged_lost_or_doubled_draws_no_wrong_stroke() {
    let lines = scene("lattice2.obj", &[]);
    let whole = uploaded(&lines);
    let (machine, job) = computed(&lines, Form::Strokes);
    let job = lines_of(&job.expect("a job"));
    let mut random = Random::new(1971);
    let mut faults = 0;
    for _ in 0..12 {
        let mut bench = Bench::new();
        bench.order(&machine);
        assert!(bench.say(&format!("{}\n", numbered(Some(0), "M110"))).starts_with("ok N0"));
        let mut next = 0;
        while next < job.len() {
            let mut text = numbered(Some(next as i32 + 1), &job[next]).into_bytes();
            match random.below(4) {
                0 => {
                    let at = random.below(text.len() as u64) as usize;
                    text[at] = b' ' + random.below(95) as u8;
                    // Bytes that act at once are no part of a line.
                    if b"?!~".contains(&text[at]) {
                        text[at] = b'_';
                    }
                }
                1 => drop(text.remove(random.below(text.len() as u64) as usize)),
                2 => text.extend_from_within(..),
                _ => text = [text.clone(), text].join(&b'\n'),
            }
            text.push(b'\n');
            bench.board.receive(&text);
            for _ in 0..600_000 {
                bench.plotter.poll(&mut bench.board);
                if bench.board.has_read_all() {
                    break;
                }
                bench.board.wait();
            }
            while bench.plotter.poll(&mut bench.board) {}
            let answers = bench.heard();
            faults += u32::from(answers.contains("error:17"));
            // As the sender does, it goes on behind the last line that was taken.
            let last = bench.say(&format!("{}\n", numbered(None, "M110")));
            let last = last.split_once("Line: ").expect("a number").1;
            next = last.split_once('*').expect("a checksum").0.parse().expect("a number");
        }
        bench.finish();
        assert!(events(&mut bench) == whole);
    }
    assert!(faults > 40, "{faults}");
}

#[test]
fn what_cannot_be_drawn_is_refused_before_anything_moves() {
    let mut bench = Bench::new();
    let mut refused = |line: &str| {
        let answer = bench.say(&format!("{line}\n"));
        let number = answer.trim_end().rsplit_once("error:").expect("an error").1.to_owned();
        assert_eq!(bench.plotter.machine().state(), State::Idle);
        number
    };
    let steps = 80 << 16;
    let header = |right: u32| format!("$stream={steps},{steps},1,2,0,0,{right},100,1,1,1,1");
    // No strokes are expected; nobody draws any.
    assert_eq!(refused("$s=,0000"), "181");
    assert_eq!(refused("$stream"), "181");
    // Beyond the travel of 420 mm.
    assert_eq!(refused(&header(40_000)), "15");
    assert_eq!(refused("$stream=1,2"), "103");
    assert_eq!(refused(&format!("$stream=65536,{steps},1,2,0,0,1,100,1,1,1,1")), "162");
    let mut bench = Bench::new();
    bench.heard();
    assert_eq!(bench.say(&format!("{}\n", header(100))), "ok\n");
    assert!(bench.say("$stream\n").starts_with("[STREAM:1,0,2,0]\nok"));
    // Beyond the bounds that were said, no strokes, and too many.
    for (line, number) in [("$s=,0000mC0", "182"), ("$s=0", "180"), ("$s=,0000000000", "181")] {
        let answer = bench.say(&format!("{line}\n"));
        assert!(answer.ends_with(&format!("error:{number}\n")), "{line}: {answer}");
    }
    assert!(bench.say("$stream\n").starts_with("[STREAM:1,0,2,0]\nok"), "nothing was taken");
    assert!(bench.say("$plot\n").ends_with("error:8\n"));
    assert_eq!(bench.say("$s=,0022\n"), "ok\n");
    // What was given up takes no more strokes, nor does a job of another kind.
    bench.say("\x18");
    bench.finish();
    assert!(bench.say("$s=22\n").ends_with("error:181\n"));
    assert_eq!(ink(&events(&mut bench)), []);
    assert_eq!(ink(&uploaded(&scene("cube.obj", &[]))).len(), {
        bench.order(&scene("cube.obj", &[]));
        assert!(bench.say("$s=22\n").ends_with("error:181\n"));
        bench.finish();
        ink(&events(&mut bench)).len()
    });
}

#[test]
fn gcode_draws_the_same_ink_where_there_are_no_lines_of_strokes() {
    for machine in [&[][..], &["$100=88.889", "$101=53.333"], &["$hidden=pen,2"]] {
        for name in ["cube.obj", "lattice2.obj"] {
            let lines = scene(name, machine);
            let (machine, job) = computed(&lines, Form::GCode);
            let mut bench = Bench::new();
            bench.order(&machine);
            for line in lines_of(&job.expect("a job")) {
                bench.board.receive(format!("{line}\n").as_bytes());
                for _ in 0..600_000 {
                    bench.plotter.poll(&mut bench.board);
                    let sent = bench.heard();
                    if sent.contains("send ~") {
                        bench.board.receive(b"~");
                    }
                    assert!(!sent.contains("error"), "{line}: {sent}");
                    if sent.contains("ok\n") {
                        break;
                    }
                    bench.board.wait();
                }
            }
            finish(&mut bench);
            assert_eq!(ink(&events(&mut bench)), ink(&uploaded(&lines)), "{name}");
        }
    }
    let dotted = scene("cube.obj", &["$hidden=dotted"]);
    assert!(matches!(computed(&dotted, Form::GCode).1, Err(StreamError::LineType)));
}
