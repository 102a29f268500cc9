//! Tests a job of half an hour whose power is cut ten times at random instants: it arrives as one
//! undamaged drawing, judged by the ink that the pins leave.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup_host_tests::cut_jobs::{assert_one_drawing, empty_flash, strokes_of, switch_on};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_job::pins::PinChange;

#[test]
fn a_job_of_half_an_hour_that_is_cut_ten_times_is_one_drawing() {
    let options = ["$page=120x120", "$margin=5", "$201=75", "$202=150"];
    let lines = job_lines("lattice3.obj", &options);
    let mut passed = 0;
    let (_, changes) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        passed = plotter.finish();
    });
    assert!(passed > 30 * 60 * 1000, "{passed} ms");
    let whole = strokes_of(changes.iter().map(PinChange::from));
    let mut random = Random::new(2119);
    let (mut flash, mut runs) = (empty_flash(), Vec::new());
    for number in 0..=10 {
        // About a tenth of the job each, and in the mean a little less.
        let after = if number == 10 { u64::MAX } else { passed / 20 + random.below(passed / 11) };
        let (left, changes) = switch_on(flash.powered(), |plotter| {
            if number == 0 {
                plotter.order(&lines);
            } else {
                let answer = plotter.say("$resume=origin");
                assert!(answer.ends_with("ok\n"), "run {number}: {answer}");
            }
            plotter.run(after);
        });
        flash = left;
        runs.push(strokes_of(changes.iter().map(PinChange::from)));
    }
    let twice = assert_one_drawing(&whole, &runs);
    assert!(twice <= 10, "{twice}");
}
