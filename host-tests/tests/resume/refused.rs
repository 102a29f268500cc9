//! A drawing that is refused or only checked leaves a job that has stopped as it is.

use super::{lattice, undisturbed};
use penup_host_tests::cut_jobs::{Powered, empty_flash, ink, strokes_of, switch_on};
use penup_job::pins::PinChange;

/// Lets a job stop, does something else, completes the job, and compares the ink.
fn completes_behind(disturb: impl Fn(&mut Powered<'_, '_>)) {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let (_, changes) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        plotter.run(4000);
        plotter.board.receive(&[0x18]);
        plotter.finish();
        plotter.heard();
        let stopped = plotter.status();
        assert!(stopped.contains("|Stopped:"), "{stopped}");
        disturb(plotter);
        plotter.finish();
        plotter.heard();
        assert_eq!(plotter.say("$resume"), "ok\n");
        plotter.finish();
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
        // The job that is kept is still that one.
        assert_eq!(plotter.say("$again"), "ok\n");
        plotter.board.receive(&[0x18]);
        plotter.finish();
    });
    assert_eq!(ink(&strokes_of(changes.iter().map(PinChange::from))), ink(&whole));
}

#[test]
fn a_drawing_that_is_refused_leaves_the_stopped_job() {
    completes_behind(|plotter| {
        // The drawing would leave the travel.
        assert_eq!(plotter.say("$130=40\n$131=40"), "ok\nok\n");
        let answer = plotter.say("$plot");
        assert!(answer.ends_with("error:15\n"), "{answer}");
        assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
        assert_eq!(plotter.say("$130=400\n$131=400"), "ok\nok\n");
    });
}

#[test]
fn a_drawing_that_is_only_checked_leaves_the_stopped_job() {
    for checked in ["$plot", "$again"] {
        completes_behind(|plotter| {
            plotter.say("$page=30x30\n$C");
            assert_eq!(plotter.say(checked), "ok\n", "{checked}");
            assert!(plotter.status().contains("|Stopped:"), "{}", plotter.status());
            plotter.say("$C\n$page=60x60");
        });
    }
}

/// Checking a job does not tell the plotter where the pen is.
#[test]
fn after_an_emergency_stop_a_check_does_not_find_the_position() {
    switch_on(empty_flash(), |plotter| {
        plotter.order(&lattice("$hidden=erased"));
        plotter.run(4000);
        plotter.board.receive(&[0xFD]);
        plotter.run(500);
        assert!(plotter.say("$X").ends_with("ok\n"));
        plotter.say("$C");
        assert_eq!(plotter.say("$again"), "ok\n");
        plotter.say("$C");
        assert!(plotter.say("$resume").ends_with("error:164\n"));
    });
    // Nor does it after a loss of power.
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lattice("$hidden=erased"));
        plotter.run(4000);
    });
    switch_on(flash.powered(), |plotter| {
        let before = plotter.heard();
        assert!(before.contains("[MSG:a job stopped at stroke "), "{before}");
        plotter.say("$C\n$again\n$C");
        assert!(plotter.say("$resume").ends_with("error:164\n"));
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
    });
}
