//! What lies on a face is not hidden by it: bars, curves and other faces, from any eye, also one
//! inside the scene, where the near plane cuts the face. A wire frame shows the same ink there.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::machine::{Path, Target};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::Bench;

/// Sends the lines and orders the drawing. Returns the length of its ink in steps, and the number
/// of its strokes.
fn ink(lines: &[String]) -> (f64, u32) {
    let mut bench = Bench::new();
    bench.heard();
    for line in lines {
        let answer = bench.say(&format!("{line}\n"));
        assert!(answer.ends_with("ok\n"), "{line}: {answer}");
    }
    let (mut length, mut strokes, mut at, mut was_inked) = (0.0, 0, [0; 2], false);
    let mut path = bench.plotter.strokes();
    while let Some(Target { point, ink }) = path.next_target() {
        if ink.is_some() {
            length += f64::from(point.x - at[0]).hypot(f64::from(point.y - at[1]));
            strokes += u32::from(!was_inked);
        }
        (at, was_inked) = ([point.x, point.y], ink.is_some());
    }
    (length, strokes)
}

/// A point of the plane z = x / 2 - y / 4, in which every point of the tests lies.
fn on_plane(x: f64, y: f64) -> String {
    format!("v {x} {y} {}", x / 2.0 - y / 4.0)
}

/// The lines of a model with this camera and way to see.
fn sent(model: &[String], eye: [f64; 3], at: [f64; 3], options: &[&str]) -> Vec<String> {
    let numbers = |[x, y, z]: [f64; 3]| format!("{x},{y},{z}");
    let camera = [format!("$eye={}", numbers(eye)), format!("$at={}", numbers(at))];
    let options = options.iter().chain(&["$plot"]).map(|option| (*option).to_owned());
    model.iter().cloned().chain(camera).chain(options).collect()
}

/// The ink of the faces must be that of the wire frame.
fn assert_nothing_is_hidden(model: &[String], eye: [f64; 3], at: [f64; 3]) {
    let (wire, wire_strokes) = ink(&sent(model, eye, at, &["$see=wire"]));
    let (faces, strokes) = ink(&sent(model, eye, at, &["$see=faces"]));
    assert!((wire - faces).abs() < 20.0, "{eye:?} {at:?}: {faces} of {wire} steps");
    assert_eq!(strokes, wire_strokes, "{eye:?} {at:?}");
}

/// A random number from -1 to 1, with some decimals.
fn unit(random: &mut Random) -> f64 {
    f64::from(random.below(20_001) as u32) / 10_000.0 - 1.0
}

#[test]
fn a_curve_on_a_face_is_whole() {
    let mut random = Random::new(1978);
    for _ in 0..30 {
        let mut model: Vec<_> =
            [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]].map(|[x, y]| on_plane(x, y)).into();
        model.push("f 1 2 3 4".to_owned());
        let count = 4 + random.below(5) as usize;
        model.extend((0..count).map(|_| {
            let [x, y] = [0; 2].map(|_| 1.5 + unit(&mut random));
            on_plane(x, y)
        }));
        let points: String = (5..5 + count).map(|number| format!(" {number}")).collect();
        let lines = ["cstype bspline".to_owned(), "deg 3".to_owned()];
        model.extend(lines);
        model.push(format!("curv 3 {count}{points}"));
        model.push("end".to_owned());
        let [x, y] = [0; 2].map(|_| 1.5 + 3.0 * unit(&mut random));
        assert_nothing_is_hidden(&model, [x, y, 9.0], [1.5, 1.5, 0.4]);
    }
}

#[test]
fn what_lies_on_a_face_that_the_near_plane_cuts_is_whole() {
    let mut random = Random::new(1971);
    for _ in 0..40 {
        let mut model: Vec<_> = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
            .map(|[x, y]| on_plane(x, y))
            .into();
        model.push("f 1 2 3 4".to_owned());
        // Some bars lie in front of the eye, and others are cut, too.
        for bar in 0..6 {
            for _ in 0..2 {
                let [x, y] = [0; 2].map(|_| 4.8 * unit(&mut random));
                model.push(on_plane(x, y));
            }
            model.push(format!("l {} {}", 5 + 2 * bar, 6 + 2 * bar));
        }
        // A face on the face, which is cut or not.
        for [x, y] in [[1.0, 2.0], [2.5, 2.0], [2.5, 4.0], [1.0, 4.0]] {
            model.push(on_plane(x, y));
        }
        model.push("f 17 18 19 20".to_owned());
        let [x, y] = [0; 2].map(|_| 3.0 * unit(&mut random));
        let height = x / 2.0 - y / 4.0;
        let ahead = [x + 4.0 * unit(&mut random), y + 3.0];
        let eye = [x, y, height + 1.5 + unit(&mut random)];
        assert_nothing_is_hidden(&model, eye, [ahead[0], ahead[1], height]);
    }
}

/// The lines of an OBJ file.
fn lines_of(text: &str) -> Vec<String> {
    text.lines().map(str::to_owned).collect()
}

/// The foot of a block that stands on a floor which the near plane cuts is drawn without seams.
#[test]
fn blocks_on_a_cut_floor_touch_it() {
    let model = lines_of(
        "v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nf 1 2 3 4\nv -1 1 0\nv 1 1 0\nv 1 2 0\nv -1 2 0\n\
         v -1 1 1\nv 1 1 1\nv 1 2 1\nv -1 2 1\nf 5 8 7 6\nf 9 10 11 12\nf 5 6 10 9\nf 6 7 11 10\n\
         f 7 8 12 11\nf 8 5 9 12",
    );
    let mut random = Random::new(1980);
    for _ in 0..20 {
        let eye = [0.5 * unit(&mut random), -1.3 + 0.5 * unit(&mut random), 1.7];
        let [with, without] = [&[][..], &["$seams=off"]]
            .map(|options| ink(&sent(&model, eye, [0.5, 3.0, 0.5], options)).0);
        assert!((with - without).abs() < 20.0, "{eye:?}: {with} {without}");
    }
}

/// Two panels of one plane that the near plane cuts are one shape where blocks are merged.
#[test]
fn cut_panels_are_merged() {
    let panels = |one: &str| {
        lines_of(&format!(
            "v -5 -5 0\nv 0 -5 0\nv 0 5 0\nv -5 5 0\nv 0 -5 0\nv 5 -5 0\nv 5 5 0\nv 0 5 0\n{one}"
        ))
    };
    let [two, one] = [panels("f 1 2 3 4\nf 5 6 7 8"), panels("f 1 6 7 4")];
    let (eye, at) = ([0.3, -1.3, 1.7], [0.5, 3.0, 0.5]);
    let (merged, _) = ink(&sent(&two, eye, at, &["$blocks=merged"]));
    let (whole, _) = ink(&sent(&one, eye, at, &[]));
    assert!((merged - whole).abs() < 20.0, "{merged} {whole}");
}
