//! Tests a plotter that receives random bytes, among them real-time bytes: it always comes to rest,
//! answers, and knows where it is.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::machine::State;
use penup_host_tests::ink::Ink;
use penup_host_tests::noise::{FEW, PIECE, some};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::Bench;
use penup_host_tests::wish::wish;
use penup_job::pins::PinChange;

/// The number of bytes: `PENUP_NOISE`, or else ten megabytes.
fn count() -> u64 {
    wish("PENUP_NOISE", 10_000_000)
}

#[test]
fn noise_leaves_a_plotter_that_answers_and_knows_its_position() {
    let mut random = Random::new(2117);
    let mut moved = 0;
    for _ in 0..count() / PIECE {
        let mut bench = Bench::small();
        for _ in 0..PIECE / FEW {
            bench.board.receive(&some(&mut random));
            bench.work(2);
        }
        bench.board.receive(b"\n\x18");
        bench.finish();
        bench.say("\n\x18");
        bench.finish();
        if matches!(bench.plotter.machine().state(), State::Alarm(_)) {
            bench.say("$X\n");
        }
        bench.heard();
        let status = bench.say("?");
        assert!(status.contains("<Idle|") || status.contains("<Sleep"), "{status}");
        let mut ink = Ink::default();
        for change in &bench.board.trace().changes() {
            ink.change(PinChange::from(change));
        }
        ink.points();
        let pins = ink.position();
        let planned = bench.plotter.machine().planned_position();
        assert_eq!([planned.x, planned.y], pins, "{status}");
        moved += usize::from(pins != [0, 0]);
    }
    assert!(moved > 0, "some of it moves the machine");
}
