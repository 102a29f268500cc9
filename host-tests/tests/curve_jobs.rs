//! Tests of curves that are sent over the serial line: they are read, flattened, hidden and drawn
//! like any edge.

use penup::machine::{Path, Target};
use penup_host_tests::curve_reference::{distance, spline_at};
use penup_host_tests::whole_jobs::{Bench, job_lines};

/// The strokes that the pen draws for these lines, in steps.
fn drawn(lines: &[String]) -> Vec<[[f64; 2]; 2]> {
    let mut bench = Bench::new();
    bench.heard();
    for line in lines {
        assert_eq!(bench.say(&format!("{line}\n")), "ok\n", "{line}");
    }
    let (mut ink, mut at) = (Vec::new(), [0.0; 2]);
    let mut strokes = bench.plotter.strokes();
    while let Some(Target { point, ink: inked }) = strokes.next_target() {
        let to = [f64::from(point.x), f64::from(point.y)];
        if inked.is_some() {
            ink.push([at, to]);
        }
        at = to;
    }
    ink
}

fn sent(text: &str, settings: &[&str]) -> Vec<String> {
    text.lines().chain(settings.iter().copied()).chain(["$plot"]).map(str::to_owned).collect()
}

fn nearest(position: [f64; 2], ink: &[[[f64; 2]; 2]]) -> f64 {
    ink.iter().map(|[a, b]| distance(position, *a, *b)).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_isobars_of_figure_11_are_drawn_where_they_are() {
    let lines = job_lines("isobars.obj", &["$margin=0"]);
    let ink = drawn(&lines);
    let (mut vertices, mut control, mut ends) = (Vec::new(), Vec::new(), [0.0; 2]);
    let (mut curves, mut bars) = (0, 0);
    for line in &lines {
        let numbers: Vec<f64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
        match line.split(' ').next() {
            Some("v") => vertices.push([numbers[0], numbers[1], numbers[2]]),
            Some("l") => bars += numbers.len() - 1,
            Some("curv") => {
                curves += 1;
                ends = [numbers[0], numbers[1]];
                control = numbers[2..].iter().map(|at| vertices[*at as usize - 1]).collect();
            }
            Some("parm") => {
                for sample in 0..=1000 {
                    let u = ends[0] + (ends[1] - ends[0]) * f64::from(sample) / 1000.0;
                    let [x, y, _] = spline_at(&control, &numbers, 3, u);
                    // The tolerance is half a step plus the rounding of the chord's ends to steps.
                    let stray = nearest([80.0 * x, 80.0 * y], &ink);
                    assert!(stray <= 0.5 + 0.5f64.sqrt() + 0.01, "{line}: {stray} steps");
                }
            }
            _ => {}
        }
    }
    // 55 vertices for the isobars and 28 for the map, as in the paper.
    assert_eq!((curves, vertices.len()), (9, 55 + 28));
    // A polyline would need twelve times as many vertices.
    assert!((600..=690).contains(&(ink.len() - bars)), "{} chords", ink.len() - bars);
}

/// A face 100 wide across, seen from above, and a parabola through it.
const THROUGH_A_FACE: &str = "v 0 0 0\nv 100 0 0\nv 100 100 0\nv 0 100 0\nf 1 2 3 4\n\
    cstype bspline\ndeg 2\nv 20 50 40\nv 50 50 -40\nv 80 50 40\n\
    curv 0 1 5 6 7\nparm u 0 0 0 1 1 1\nend";

#[test]
fn a_curve_is_hidden_like_any_edge() {
    let settings = ["$page=120x120", "$margin=10", "$eye=50,50,500", "$at=50,50,0", "$up=0,1,0"];
    let with = |option| [&settings[..], &["$projection=orthographic", option]].concat();
    let visible = drawn(&sent(THROUGH_A_FACE, &with("$hidden=erased")));
    let all = drawn(&sent(THROUGH_A_FACE, &with("$hidden=shown")));
    // It lies below the face where 40 (1 - 2 t)² < 40 × 2 t (1 - t): 40 (1 - 4 t + 4 t²) - ...
    let height = |t: f64| 40.0 * ((1.0 - t).powi(2) - 2.0 * t * (1.0 - t) + t * t);
    for step in 0..=100 {
        let t = f64::from(step) / 100.0;
        let position = [80.0 * (10.0 + 20.0 + 60.0 * t), 80.0 * 60.0];
        assert!(nearest(position, &all) < 2.0, "{t}");
        if height(t).abs() > 1.0 {
            assert_eq!(nearest(position, &visible) < 2.0, height(t) > 0.0, "{t}");
        }
    }
}

#[test]
fn control_points_do_not_make_the_page_larger() {
    // A cubic whose inner control points lie far off: it rises to three quarters of their height.
    let bow = "v 10 20 0\nv 10 353.3333333 0\nv 200 353.3333333 0\nv 200 20 0\ncstype \
     bspline\ndeg 3\n\
               curv 0 1 1 2 3 4\nparm u 0 0 0 0 1 1 1 1\nend";
    let top = |ink: &[[[f64; 2]; 2]]| ink.iter().flatten().map(|p| p[1]).fold(0.0, f64::max);
    let ink = drawn(&sent(bow, &[]));
    assert!((top(&ink) - 80.0 * 270.0).abs() <= 1.0, "{}", top(&ink));
    let fitted = drawn(&sent(bow, &["$fit=on", "$page=400x270", "$margin=10"]));
    assert!((top(&fitted) - 80.0 * 260.0).abs() <= 1.0, "{}", top(&fitted));
    // Through the camera, too, the curve goes from the bottom to the top of the free page.
    let seen = drawn(&sent(
        bow,
        &[
            "$projection=orthographic",
            "$eye=100,100,900",
            "$at=100,100,0",
            "$up=0,1,0",
            "$page=400x270",
            "$margin=10",
        ],
    ));
    assert!((top(&seen) - 80.0 * 260.0).abs() <= 1.5, "{}", top(&seen));
}

#[test]
fn a_curve_past_the_eye_is_cut_off() {
    let ring = "v 10 0 1\nv 10 10 1\nv -10 10 1\nv -10 -10 1\nv 10 -10 1\ncstype bspline\ndeg 2\n\
                curv 2 7 1 2 3 4 5 1 2\nend";
    let ink = drawn(&sent(ring, &["$eye=0,0,0", "$at=1,0,0.1", "$up=0,0,1"]));
    assert!(!ink.is_empty());
    let on_page = |p: &[f64; 2]| (0.0..=16800.0).contains(&p[0]) && (0.0..=23760.0).contains(&p[1]);
    assert!(ink.iter().flatten().all(on_page));
}

#[test]
fn curves_that_are_none_are_refused_and_change_nothing() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2\n");
    let before = bench.say("$model\n");
    for (lines, message) in [
        ("cstype bezier", "[MSG:choose bspline]\nerror:105\n"),
        ("curv 0 1 1 2 3", "[MSG:send deg first, 1 to 5]\nerror:117\n"),
        ("deg 6", "[MSG:a curve has degree 1 to 5]\nerror:116\n"),
        ("parm u 0 1", "[MSG:begin a curve first: send curv]\nerror:117\n"),
        ("end", "[MSG:begin a curve first: send curv]\nerror:117\n"),
        (
            "deg 2\ncurv 0 1 1 2",
            "ok\n[MSG:a curve of this degree takes 3 control points]\nerror:116\n",
        ),
        ("curv 2 3 1 2 9", "[MSG:there is no vertex 9: the model has 3]\nerror:110\n"),
        ("curv 2 3 1 2 3\nparm v 0", "ok\n[MSG:choose u]\nerror:105\n"),
        ("parm u 0 0 1\nend", "ok\n[MSG:the curve takes 6 knots and has 3]\nerror:116\n"),
    ] {
        assert_eq!(bench.say(&format!("{lines}\n")), message, "{lines}");
    }
    assert_eq!(bench.say("$model\n"), before);
}
