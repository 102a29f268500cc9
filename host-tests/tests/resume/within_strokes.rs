//! Long strokes, within which the machine rests so that a job goes on there.

use crate::{draw_with_cuts, undisturbed};
use penup_host_tests::cut_jobs::{
    Point, assert_one_drawing, empty_flash, ink, strokes_of, switch_on,
};
use penup_host_tests::random::Random;
use penup_job::pins::PinChange;

/// The lines of a spiral, a closed zigzag around it, and a short line, with these settings.
fn long_strokes(settings: &[&str]) -> Vec<String> {
    let spiral = (0..300).map(|index| {
        let (turn, radius) = (f64::from(index) / 40.0, 3.0 + f64::from(index) / 20.0);
        [
            radius * (turn * std::f64::consts::TAU).cos(),
            radius * (turn * std::f64::consts::TAU).sin(),
        ]
    });
    let zigzag = (0..60).map(|index| {
        let (turn, radius) = (f64::from(index) / 60.0, 20.0 + 4.0 * f64::from(index % 2));
        [
            radius * (turn * std::f64::consts::TAU).cos(),
            radius * (turn * std::f64::consts::TAU).sin(),
        ]
    });
    let vertices = spiral.chain(zigzag).chain([[-24.0, -24.0], [-20.0, -24.0]]);
    let vertices = vertices.map(|[x, y]| format!("v {x:.3} {y:.3} 0"));
    let lines = (1..300).chain(301..360).chain([361]).map(|from| format!("l {from} {}", from + 1));
    let settings = ["$212=20", "$213=20", "$page=60x60", "$margin=4"].iter().chain(settings);
    let settings = settings.map(|line| (*line).to_owned());
    let ends = ["l 360 301".to_owned(), "$plot".to_owned()];
    vertices.chain(lines).chain(settings).chain(ends).collect()
}

/// The number of steps of the strokes.
fn steps(strokes: &[Vec<Point>]) -> usize {
    strokes.iter().map(|stroke| stroke.len() - 1).sum()
}

/// Draws long strokes with these settings and this many cuts at random instants, and checks that
/// the ink is that of the undisturbed job, and that at most so many steps are drawn twice after
/// each cut.
fn go_on_within_strokes(settings: &[&str], cuts: usize, most: usize, random: &mut Random) {
    let lines = long_strokes(settings);
    let (whole, runs) = draw_with_cuts(&lines, cuts, random);
    assert_eq!(ink(runs.iter().flatten()), ink(&whole), "{settings:?}");
    let drawn: usize = runs.iter().map(|run| steps(run)).sum();
    let twice = drawn - steps(&whole);
    assert!(twice <= cuts * most, "{settings:?}: {twice} steps are drawn twice");
}

/// The pen stays on the paper where the machine rests, and the ink is the same.
#[test]
fn rests_within_strokes_change_no_ink() {
    let [(without, time, _), (with, longer, _)] =
        ["$219=0", "$219=0.05"].map(|setting| undisturbed(&long_strokes(&[setting])));
    // The pen is lowered as often, too.
    assert_eq!(with, without);
    // It is some 800 mm of ink, so the machine has come to rest some fifteen times.
    assert!(steps(&with) > 50_000, "{}", steps(&with));
    assert!(longer > time, "{longer} {time}");
}

/// The page has 80 steps to a millimetre, so 50 mm are 4,000 steps, and slanting chords have fewer.
#[test]
fn a_job_goes_on_within_a_long_stroke() {
    let mut random = Random::new(1980);
    for _ in 0..4 {
        // 50 mm, a chord of at most 8 mm, and a corner.
        go_on_within_strokes(&["$219=0.05"], 10, 80 * 60 * 2, &mut random);
    }
    // Without the setting, a stroke begins anew.
    let lines = long_strokes(&[]);
    let (whole, runs) = draw_with_cuts(&lines, 10, &mut random);
    assert_one_drawing(&whole, &runs);
}

/// Strokes that begin early, end late and go on beyond their end do so where they would have.
#[test]
fn a_job_goes_on_within_a_stroke_that_is_made_longer() {
    let mut random = Random::new(1801);
    for settings in [
        &["$219=0.02", "$222=3", "$223=2"][..],
        &["$219=0.011", "$221=4"],
        &["$219=0.03", "$221=9", "$222=1", "$223=5", "$204=2"],
    ] {
        for _ in 0..3 {
            go_on_within_strokes(settings, 8, 80 * 60 * 2, &mut random);
        }
    }
}

/// Broken lines have no points, so their strokes begin anew.
#[test]
fn a_polargraph_goes_on_within_a_long_stroke() {
    let mut random = Random::new(7);
    let settings = ["$230=2", "$219=0.05"];
    let lines = long_strokes(&settings);
    let (whole, runs) = draw_with_cuts(&lines, 6, &mut random);
    assert_eq!(ink(runs.iter().flatten()), ink(&whole));
}

/// A hold and giving up while the machine comes to rest, and while it stands there.
#[test]
fn holds_and_aborts_at_a_rest_within_a_stroke_lose_nothing() {
    let lines = long_strokes(&["$219=0.05"]);
    let (whole, time, _) = undisturbed(&lines);
    let mut random = Random::new(42);
    for _ in 0..6 {
        let (_, changes) = switch_on(empty_flash(), |plotter| {
            plotter.order(&lines);
            for _ in 0..20 {
                plotter.run(random.below(time / 12));
                if random.once_in(2) {
                    plotter.send("!");
                    plotter.run(random.below(900));
                    plotter.send("~");
                } else {
                    plotter.board.receive(&[0x18]);
                    plotter.finish();
                    plotter.heard();
                    if plotter.status().contains("|Stopped:") {
                        assert_eq!(plotter.say("$resume"), "ok\n");
                    }
                }
            }
            plotter.finish();
            assert!(!plotter.status().contains("Stopped"), "{}", plotter.status());
        });
        let drawn = strokes_of(changes.iter().map(PinChange::from));
        assert_eq!(ink(&drawn), ink(&whole));
    }
}
