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

/// Sends lines, each of which must be accepted.
fn order(bench: &mut Bench, lines: &[String]) {
    for line in lines {
        let answer = bench.say(&format!("{line}\n"));
        assert!(answer.ends_with("ok\n"), "{line}: {answer}");
    }
}

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
    order(&mut bench, lines);
    finish(&mut bench);
    events(&mut bench)
}

/// The lines that only set up the machine, and the job that a computer makes of all.
fn computed(lines: &[String], form: Form) -> (Vec<String>, Result<StreamedJob, StreamError>) {
    let mut bench = Bench::new();
    let (plot, before) = lines.split_last().expect("lines");
    assert_eq!(plot, "$plot");
    order(&mut bench, before);
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
    order(&mut bench, &machine);
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
    let machines: [&[&str]; 5] = [
        &[],
        // Dotted lines with another pen, strokes that overlap and begin early.
        &["$hidden=dotted"],
        &["$hidden=pen", "$250=1", "$251=0.5", "$252=0.5"],
        // A limit on jerk, one speed for each line, backlash.
        &["$122=500", "$205=1", "$180=0.1", "$181=0.2"],
        // A polargraph.
        &["$150=2", "$170=500", "$171=100", "$172=300"],
    ];
    for machine in machines {
        for name in ["cube.obj", "lattice2.obj", "interpen.obj"] {
            let mut lines = scene(name, &[]);
            let plot = lines.pop().expect("a job");
            let mut bench = Bench::new();
            // Settings that this version does not have are left out.
            let known = machine.iter().filter(|line| bench.say(&format!("{line}\n")) == "ok\n");
            lines.extend(known.map(|line| (*line).to_owned()));
            lines.push(plot);
            let (sent, status) = streamed(&lines);
            assert!(sent == uploaded(&lines), "{name} {machine:?}");
            let done = status.split_once("Strokes:").expect("strokes").1;
            let (done, all) = done.split('|').next().expect("counts").split_once('/').expect("all");
            assert_eq!(done, all, "{name} {machine:?} {status}");
            assert!(status.contains("|Left:0>"), "{status}");
        }
    }
}
