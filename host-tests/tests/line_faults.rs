//! Tests of the client and the plotter over a line that loses, doubles, changes and delays bytes in
//! both directions. Either the drawing is the one that was sent, or the client reports what is
//! wrong.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::drawing::PagePoint;
use penup_client::error::Error;
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_host_tests::noisy_line::{Damage, Fault, NoisyLine};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use penup_readers::lines::JobLine;
use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

/// The moves with the pen down.
type Ink = BTreeSet<(PagePoint, PagePoint)>;

/// Sends a scene on a small page over a line with these faults in each direction, and draws it.
fn draw(scene: &str, towards: Damage, back: Damage) -> (NoisyLine, Result<(), Error>) {
    let mut bench = Bench::new();
    // The speed is the maximum, because the drawing itself is not tested.
    bench.say("$201=20000\n$202=20000\n$120=30000\n$121=30000\n$212=1\n$213=1\n");
    let mut line = NoisyLine::new(bench, towards, back);
    let settings = ["$page=14x14", "$margin=2", "$seams=off", "$title=a b", "$title-size=1"];
    let file = job_lines(scene, &[]).into_iter().filter(|line| line != "$plot");
    let settings = settings.map(str::to_owned);
    let job = ["$clear".to_owned()].into_iter().chain(file).chain(settings);
    let job: Vec<JobLine> = job.map(JobLine::command).collect();
    let interrupt = AtomicBool::new(false);
    let drawn = Sender::open(&mut line, Timeouts::default(), &interrupt).and_then(|mut sender| {
        let drawn = sender.stream(&job, &mut Quiet).and_then(|()| sender.plot(&mut Quiet));
        sender.end();
        drawn
    });
    (line, drawn)
}

/// Does the same over a line without faults. Returns what it draws, and the bytes in each
/// direction.
fn draw_undisturbed(scene: &str) -> (Ink, [Vec<u8>; 2]) {
    let (line, drawn) = draw(scene, Damage::default(), Damage::default());
    drawn.expect("a line without damage");
    let ink = line.inked();
    assert!(ink.len() > 500, "{} moves are no drawing", ink.len());
    (ink, line.sent().map(<[u8]>::to_vec))
}

/// One fault of any kind at one of the bytes.
fn some_fault(random: &mut Random, bytes: &[u8]) -> (usize, Fault) {
    let at = random.below(bytes.len() as u64) as usize;
    let newlines = bytes.iter().enumerate().skip(at).filter(|(_, byte)| **byte == b'\n');
    let newline = newlines.map(|(at, _)| at).next().unwrap_or(at);
    match random.below(8) {
        0 => (at, Fault::Lost(1)),
        1 => (at, Fault::Doubled),
        2 | 3 => (at, Fault::Flipped(random.below(8) as u8)),
        4 => (newline, Fault::Lost(1)),
        5 => (newline, Fault::Doubled),
        6 => (at, Fault::Lost(20)),
        _ => (at, Fault::Late(10 + random.below(2000))),
    }
}

#[test]
fn a_thousand_single_faults_never_make_another_drawing() {
    let (ink, bytes) = draw_undisturbed("lattice1.obj");
    let mut random = Random::new(1);
    let mut refused = Vec::new();
    for case in 0..1000 {
        let there = random.below(2) == 0;
        let (at, fault) = some_fault(&mut random, &bytes[usize::from(!there)]);
        let damage = Damage { faults: vec![(at, fault)], one_in: None };
        let (towards, back) =
            if there { (damage, Damage::default()) } else { (Damage::default(), damage) };
        let (line, drawn) = draw("lattice1.obj", towards, back);
        match drawn {
            Ok(()) => assert!(line.inked() == ink, "case {case}: {fault:?} at {at} ({there})"),
            Err(Error::Link(error)) => panic!("case {case}: {fault:?} at {at} ({there}): {error}"),
            Err(error) => refused.push(format!("{case}: {fault:?} at {at} ({there}): {error}")),
        }
    }
    println!("{} ended with an error: {refused:#?}", refused.len());
    assert!(refused.len() < 30, "{refused:#?}");
}

#[test]
fn a_large_model_arrives_although_one_byte_in_a_hundred_is_damaged() {
    let (ink, bytes) = draw_undisturbed("lattice5.obj");
    for seed in [5, 6] {
        let damage = |seed| Damage { faults: vec![], one_in: Some((100, Random::new(seed))) };
        let (line, drawn) = draw("lattice5.obj", damage(seed), damage(seed + 100));
        drawn.expect("a line that can be mended");
        assert!(line.inked() == ink, "another drawing");
        let [there, back] = line.sent().map(<[u8]>::len);
        println!("{there} bytes instead of {}, {back} back, {} s", bytes[0].len(), line.seconds());
    }
}
