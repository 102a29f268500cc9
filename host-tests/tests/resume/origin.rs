//! From where a job that goes on counts its coordinates: from switches, or from where the user has
//! put the pen.

use super::{cut_after_five_strokes, draw_five_strokes, lattice, undisturbed};
use penup_host_tests::cut_jobs::{Powered, assert_one_drawing, empty_flash, strokes_of, switch_on};
use penup_job::pins::PinChange;

#[test]
fn a_machine_with_limit_switches_is_homed_first() {
    let lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    let mut runs = vec![];
    let mut flash = empty_flash();
    for at in [(900, 400), (700, 300)] {
        let mut homed = (0, 0);
        let (kept, changes) = switch_on(flash, |plotter| {
            plotter.heard();
            if runs.is_empty() {
                assert_eq!(plotter.say("$22=1"), "ok\n");
                homed = plotter.home(at);
                plotter.order(&lines);
                draw_five_strokes(plotter);
                return;
            }
            assert!(plotter.status().starts_with("<Alarm"));
            assert!(plotter.say("$resume").ends_with("error:9\n"));
            homed = plotter.home(at);
            assert_eq!(plotter.say("$resume"), "ok\n");
            plotter.finish();
        });
        flash = kept;
        let mut strokes = strokes_of(changes.iter().map(PinChange::from));
        for (x, y) in strokes.iter_mut().flatten() {
            (*x, *y) = (*x - homed.0, *y - homed.1);
        }
        runs.push(strokes);
    }
    assert_one_drawing(&whole, &runs);
}

/// The origin that the user has set by hand is another one than that which homing finds, so the
/// rest of the drawing would lie elsewhere on the sheet.
#[test]
fn a_job_that_began_at_an_origin_set_by_hand_does_not_go_on_from_a_homed_one() {
    let mut lines = lattice("$hidden=erased");
    let (whole, ..) = undisturbed(&lines);
    lines.insert(0, "$22=1".to_owned());
    let (flash, before) = cut_after_five_strokes(&lines);
    let mut origin = (0, 0);
    let (_, changes) = switch_on(flash, |plotter| {
        plotter.home((700, 300));
        let said = plotter.say("$resume");
        assert!(said.contains("$SLP") && said.ends_with("error:169\n"), "{said}");
        assert!(plotter.say("$resume=origin").ends_with("error:169\n"));
        assert!(plotter.status().contains("|Stopped:5/"), "{}", plotter.status());
        // The user moves the pen to that origin, and does what the message says.
        assert_eq!(plotter.say("$J=G91 X3 Y2 F2000"), "ok\n");
        plotter.finish();
        origin = plotter.position();
        assert!(plotter.say("$SLP").ends_with("ok\n"));
        plotter.send("\x18");
        plotter.run(100);
        assert!(plotter.say("$X").ends_with("ok\n"));
        assert_eq!(plotter.say("$resume=origin"), "ok\n");
        plotter.finish();
        assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
    });
    let mut after = strokes_of(changes.iter().map(PinChange::from));
    for (x, y) in after.iter_mut().flatten() {
        (*x, *y) = (*x - origin.0, *y - origin.1);
    }
    assert_one_drawing(&whole, &[before, after]);
}

/// Draws five strokes of a drawing from an origin that the user has set by hand, or after homing.
fn draw_from(plotter: &mut Powered<'_, '_>, is_homed: bool, between: &str) {
    assert_eq!(plotter.say("$22=1"), "ok\n");
    if is_homed {
        plotter.home((700, 300));
    }
    if !between.is_empty() {
        assert_eq!(plotter.say(between), "ok\n");
    }
    plotter.order(&lattice("$hidden=erased"));
    draw_five_strokes(plotter);
}

/// With another setting, homing finds another origin.
#[test]
fn a_setting_that_moves_the_origin_counts_from_when_the_machine_was_homed() {
    // It was another one while the machine was homed, and is as before now.
    switch_on(empty_flash(), |plotter| {
        plotter.heard();
        draw_from(plotter, true, "");
        plotter.send("\x18");
        plotter.finish();
        assert!(plotter.say("$27=5").ends_with("ok\n"));
        plotter.home((700, 300));
        assert!(plotter.say("$resume").ends_with("error:166\n"));
        assert_eq!(plotter.say("$27=2"), "ok\n");
        assert!(plotter.say("$resume").ends_with("error:164\n"));
        plotter.home((700, 300));
        assert_eq!(plotter.say("$resume"), "ok\n");
    });
    // The pull-off was another one when the machine was homed, so this origin is nobody's.
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.heard();
        draw_from(plotter, true, "$27=5");
    });
    switch_on(flash, |plotter| {
        plotter.home((700, 300));
        assert!(plotter.say("$resume").ends_with("error:169\n"));
    });
    // What does not move the origin may change.
    switch_on(empty_flash(), |plotter| {
        plotter.heard();
        draw_from(plotter, true, "$220=2");
        plotter.send("\x18");
        plotter.finish();
        plotter.home((700, 300));
        assert_eq!(plotter.say("$resume"), "ok\n");
    });
}
