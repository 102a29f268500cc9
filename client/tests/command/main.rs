//! The program as a user runs it.

#![allow(clippy::expect_used, reason = "a test fails with the words of what it expected")]

#[cfg(unix)]
mod at_a_port;
#[cfg(unix)]
mod machine;
#[cfg(target_os = "linux")]
mod many_points;

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn penup(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (status.code(), text(stdout), text(stderr))
}

fn files(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let name = |entry: std::io::Result<fs::DirEntry>| entry.expect("an entry").file_name();
    let mut names: Vec<String> =
        entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn help_names_every_option() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, plot, _) = penup(folder.path(), &["plot", "--help"]);
    assert_eq!(code, Some(0));
    let (code, preview, _) = penup(folder.path(), &["preview", "--help"]);
    assert_eq!(code, Some(0));
    for option in [
        "--eye",
        "--at",
        "--up",
        "--projection",
        "--hidden",
        "--page",
        "--landscape",
        "--margin",
        "--fit",
        "--svg",
        "--png",
    ] {
        assert!(plot.contains(option) && preview.contains(option), "{option}");
    }
    assert!(plot.contains("--board") && plot.contains("--port"));
    assert!(preview.contains("--json") && preview.contains("--repeat"));
    assert!(preview.contains("--board"));
}

#[test]
fn a_missing_file_a_stranger_and_a_bad_option_are_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("scene.zip"), "PK").expect("written");
    fs::write(folder.path().join("bad.obj"), "v 0 0 0\n$plot\n").expect("written");
    let before = files(folder.path());
    for command in ["plot", "preview"] {
        for (file, code, reason) in [
            ("none.obj", 1, "cannot read none.obj: "),
            ("scene.zip", 1, "scene.zip: penup reads Wavefront OBJ files"),
            ("bad.obj", 1, "bad.obj:2: a file cannot hold commands"),
            ("--page=B5", 2, "none of A4, A0, A1, A2, A3, A5, A6, Letter, Legal, Tabloid"),
        ] {
            let (status, stdout, stderr) = penup(folder.path(), &[command, file]);
            assert_eq!(status, Some(code), "{stderr}");
            assert!(stderr.contains(reason), "{stderr}");
            assert_eq!(stdout, "");
        }
    }
    assert_eq!(files(folder.path()), before);
}

#[test]
fn a_hopeless_line_is_named_before_anything_is_sent() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = format!("v 0 0 0\nf {}\n", "1 ".repeat(50_000_000));
    fs::write(folder.path().join("long.obj"), long).expect("written");
    fs::write(folder.path().join("machine.obj"), "v 0 0 0\nG1 X10\n").expect("written");
    fs::write(folder.path().join("binary.obj"), b"v 0 0 0\nv \0\x01\0\n").expect("written");
    for (file, reason) in [
        ("long.obj:2", "the line has 100000002 bytes, and a line may have at most 256"),
        ("machine.obj:2", "a file cannot hold commands for the plotter"),
        ("binary.obj:2", "this is no text"),
    ] {
        let name = file.split(':').next().unwrap_or_default();
        // There is no such port: the file comes first.
        let (code, _, stderr) = penup(folder.path(), &["plot", name, "--port", "no-such-port"]);
        assert_eq!(code, Some(1));
        assert!(stderr.starts_with(&format!("penup: {file}: {reason}")), "{stderr}");
    }
}

/// The limit, 200 MB, is that of the whole program with its threads and libraries.
#[cfg(target_os = "linux")]
#[test]
fn memory_grows_with_the_file_and_little_faster() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!("{}v 0 0\n", "v 0 0 0\n".repeat(2_000_000));
    fs::write(folder.path().join("many.obj"), text).expect("written");
    let program = env!("CARGO_BIN_EXE_penup");
    let line = format!("ulimit -v 200000; exec {program} preview many.obj");
    let run = Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output();
    let said = String::from_utf8(run.expect("a shell").stderr).expect("text");
    assert!(
        said.starts_with("penup: many.obj:2000001: wrong number of values: it takes 3 numbers"),
        "{said}"
    );
}

#[test]
fn only_a_board_limits_a_preview() {
    // More points than a number of 16 bits can tell apart, in one line to and fro.
    let folder = tempfile::tempdir().expect("a folder");
    let at = |number: usize| {
        let (row, column) = (number / 250, number % 250);
        let x = if row.is_multiple_of(2) { column } else { 249 - column };
        format!("v {}.{} {}.{} 0\n", 20 + x / 2, 5 * (x % 2), 20 + row / 2, 5 * (row % 2))
    };
    let points: String = (0..66_000).map(at).collect();
    let bars: String = (1..66_000).map(|number| format!("l {number} {}\n", number + 1)).collect();
    fs::write(folder.path().join("large.obj"), points + &bars).expect("written");
    let preview = ["preview", "large.obj", "--json", "large.json", "--effort", "0"];
    let (code, said, noted) = penup(folder.path(), &preview);
    assert_eq!((code, noted.as_str()), (Some(0), ""), "{said}");
    let json = fs::read_to_string(folder.path().join("large.json")).expect("written");
    let result: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let strokes = result["strokes"].as_array().expect("strokes");
    assert_eq!(strokes.len(), 1);
    assert_eq!(strokes[0].as_array().expect("points").len(), 66_000);
    // A board holds fewer.
    let (code, _, refused) = penup(folder.path(), &[&preview[..], &["--board", "pico"]].concat());
    assert_eq!(code, Some(4));
    assert!(refused.contains("4096"), "{refused}");
    let strokes = "The memory of pico does not hold this model, but `penup plot` draws it: it sends \
                   the strokes. A preview without --board shows them.\n";
    assert!(refused.ends_with(strokes), "{refused}");
    // A solid may go to the flash of a board that has room for it.
    let solid =
        (0..4097).map(|number| format!("v {} {} {}\n", number % 64, number / 64, number % 7));
    let faces = (1..4000).map(|number| format!("f {number} {} {}\n", number + 1, number + 65));
    let solid: String = solid.chain(faces).collect();
    fs::write(folder.path().join("solid.obj"), solid).expect("written");
    let preview = ["preview", "solid.obj", "--svg", "solid.svg", "--board"];
    let kept = ", or with --compute board the model, which the board keeps in its flash.";
    for (board, is_kept) in [("pico", true), ("lm3s6965", false)] {
        let (code, _, refused) = penup(folder.path(), &[&preview[..], &[board]].concat());
        assert_eq!((code, refused.contains(kept)), (Some(4), is_kept), "{refused}");
        assert!(refused.contains("A preview without --board shows them."), "{refused}");
    }
}

/// An icon or a poster has a page that is none of a plotter.
#[test]
fn a_drawing_that_is_fitted_to_its_own_page_is_told_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let icon = "<svg xmlns='http://www.w3.org/2000/svg' width='24' height='24'>\
                <path d='M2 2H22V9' fill='none' stroke='black'/></svg>";
    fs::write(folder.path().join("icon.svg"), icon).expect("written");
    let said = |options: &[&str]| {
        let all = [&["preview", "icon.svg", "--fit", "--svg", "out.svg"], options].concat();
        let (code, _, noted) = penup(folder.path(), &all);
        (code, noted)
    };
    let note =
        "--fit scales to the page of the file, which is 6.35 x 6.35 mm: --page A4 is another";
    let (code, noted) = said(&[]);
    assert_eq!((code, noted.contains(note)), (Some(4), true), "{noted}");
    let (code, noted) = said(&["--page", "A4"]);
    assert_eq!((code, noted.as_str()), (Some(0), ""));
}

/// What the options of plans do is drawn: the plotter itself measures the ink.
#[test]
fn a_plan_is_arranged_before_it_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let square = "G21 G90\nM5\nG0 X20 Y20\nM3\nG1 X60\nG1 Y60\nG1 X20\nG1 Y20\nM5\nG0 X0 Y0\n";
    fs::write(folder.path().join("square.gcode"), square).expect("written");
    let drawn = |options: &[&str]| {
        let fixed = ["preview", "square.gcode", "--json", "square.json"];
        let (code, said, noted) = penup(folder.path(), &[&fixed[..], options].concat());
        assert_eq!(code, Some(0), "{said}{noted}");
        let json = fs::read_to_string(folder.path().join("square.json")).expect("written");
        let result: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        (result["pen_down_mm"].as_f64().expect("a length"), said)
    };
    let near = |options: &[&str], expected: f64| {
        let (length, said) = drawn(options);
        assert!((length - expected).abs() < 0.05, "{options:?}: {length} {said}");
    };
    near(&[], 160.0);
    near(&["--scale", "2"], 320.0);
    near(&["--crop", "10,10,30,100"], 80.0);
    // 13 lines of 40 mm, from 21 mm to 57 mm.
    near(&["--hatch", "3,0"], 160.0 + 520.0);
    let (_, said) = drawn(&["--center"]);
    assert!(said.contains("reaches from 85, 128.5 to 125, 168.5 mm"), "{said}");
    let (_, said) = drawn(&["--fit"]);
    assert!(said.contains("before it is fitted to the page, the drawing reaches"), "{said}");
    let (code, _, noted) = penup(folder.path(), &["preview", "square.gcode", "--layer", "7"]);
    assert_eq!((code, noted.contains("there is no layer \"7\"")), (Some(1), true), "{noted}");
}

#[test]
fn an_svg_is_drawn_at_its_place_with_two_pens() {
    let folder = tempfile::tempdir().expect("a folder");
    let svg = "<svg xmlns='http://www.w3.org/2000/svg' width='90mm' height='60mm' \
               viewBox='0 0 90 60'><path d='M0 0H20' stroke='red'/>\
               <circle cx='70' cy='40' r='20' fill='none' stroke='blue'/>\
               <image href='a.png' width='9' height='9'/></svg>";
    fs::write(folder.path().join("a.svg"), svg).expect("written");
    let (code, said, noted) = penup(folder.path(), &["preview", "a.svg", "--json", "a.json"]);
    assert_eq!(code, Some(0), "{noted}");
    assert!(said.starts_with("a.json: "), "{said}");
    assert!(noted.contains("note: a.svg: 1 image is not drawn"), "{noted}");
    let json = fs::read_to_string(folder.path().join("a.json")).expect("readable");
    let result: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(result["stroke_pens"], serde_json::json!([1, 2]));
    let strokes: Vec<Vec<[f64; 2]>> =
        serde_json::from_value(result["strokes"].clone()).expect("strokes");
    let mut line = strokes[0].clone();
    line.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_eq!(line, [[0.0, 60.0], [20.0, 60.0]]);
    for [x, y] in &strokes[1] {
        let radius = (x - 70.0).hypot(y - 20.0);
        assert!((radius - 20.0).abs() < 1.0 / 80.0, "{x} {y}");
    }
    // A margin moves what lies in it, and that is said.
    let arguments = ["preview", "a.svg", "--json", "b.json", "--page", "A4", "--margin", "5"];
    let (code, _, noted) = penup(folder.path(), &arguments);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("the drawing is moved onto the page of 210 x 297 mm"), "{noted}");
}

#[test]
fn options_that_change_nothing_on_a_plan_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |text: &str, options: &[&str]| {
        fs::write(folder.path().join("a.obj"), text).expect("written");
        let (code, _, noted) =
            penup(folder.path(), &[&["preview", "a.obj", "--svg", "a.svg"], options].concat());
        assert_eq!(code, Some(0), "{noted}");
        let (_, names) = noted.split_once("nothing is changed by ")?;
        names.lines().next().map(str::to_owned)
    };
    let (plan, solid) = ("v 0 0 0\nv 20 30 0\nl 1 2\n", "v 0 0 0\nv 20 30 0\nv 0 9 9\nf 1 2 3\n");
    let idle = ["--hidden", "dotted", "--crease", "30"];
    assert_eq!(told(plan, &idle).as_deref(), Some("--hidden, --crease"));
    let lens = ["--projection", "orthographic"];
    assert_eq!(told(plan, &lens).as_deref(), Some("--projection"));
    assert_eq!(told(plan, &[]), None);
    assert_eq!(told(plan, &["--lift", "3", "--page", "A4"]), None);
    assert_eq!(told(plan, &[&idle[..], &["--eye=9,-9,9"]].concat()), None);
    assert_eq!(told(solid, &idle), None);
    assert_eq!(told(solid, &["--fit"]).as_deref(), Some("--fit"));
    assert_eq!(told(solid, &["--title-size", "9"]).as_deref(), Some("--title-size"));
}

#[test]
fn the_standard_input_and_output_are_those_of_tape_and_fit_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let piped = |arguments: &[&str], given: &[u8]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
            .args(arguments)
            .current_dir(folder.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program runs");
        program.stdin.take().expect("a pipe").write_all(given).expect("written");
        let output = program.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        output.stdout
    };
    let plan: &[u8] = b"v 20 20 0\nv 40 20 0\nv 40 30 0\nl 1 2 3\n";
    let tape = piped(&["tape", "encode", "-", "--quiet"], plan);
    let decoded = piped(&["tape", "decode", "-"], &tape);
    fs::write(folder.path().join("plan.obj"), plan).expect("written");
    piped(&["tape", "encode", "plan.obj"], b"");
    assert_eq!(fs::read(folder.path().join("plan.tape")).expect("readable"), tape);
    assert_eq!(piped(&["tape", "decode", "plan.tape"], b""), decoded);
    let shown = piped(&["tape", "show", "-", "--svg", "-"], &tape);
    assert_eq!(piped(&["tape", "show", "plan.tape", "--svg", "-"], b""), shown);
    let fitted = piped(&["fit", "-", "--quiet"], plan);
    piped(&["fit", "plan.obj"], b"");
    assert_eq!(fs::read(folder.path().join("plan-fitted.obj")).expect("readable"), fitted);
    assert_eq!(files(folder.path()), ["plan-fitted.obj", "plan.obj", "plan.tape"]);
}

#[test]
fn a_plan_that_the_margin_moves_is_told_and_a_solid_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |text: &str, options: &[&str]| {
        fs::write(folder.path().join("a.obj"), text).expect("written");
        let (code, _, noted) =
            penup(folder.path(), &[&["preview", "a.obj", "--svg", "a.svg"], options].concat());
        assert_eq!(code, Some(0), "{noted}");
        noted.contains("the drawing is moved onto the page of 210 x 297 mm with its margin of")
    };
    assert!(told("v 0 0 0\nv 20 30 0\nl 1 2\n", &[]));
    assert!(!told("v 0 0 0\nv 20 30 0\nl 1 2\n", &["--margin", "0"]));
    assert!(!told("v 0 0 0\nv 20 30 0\nl 1 2\n", &["--fit"]));
    assert!(!told("v 30 30 2\nv 50 50 2\nl 1 2\n", &[]));
    assert!(!told("v 0 0 0\nv 20 30 0\nv 0 9 0\nf 1 2 3\n", &[]));
    assert!(!told("v 0 0 0\nv 20 30 1\nl 1 2\n", &[]));
}

#[test]
fn a_plan_that_is_too_small_to_be_drawn_is_told_its_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = "v 0 0 42\nv 0.00001 0 42\nv 0 0.00001 42\nl 1 2 3\n";
    fs::write(folder.path().join("a.obj"), plan).expect("written");
    let preview = ["preview", "a.obj", "--svg", "a.svg"];
    let (code, _, noted) = penup(folder.path(), &preview);
    assert_eq!(code, Some(4));
    assert!(noted.contains("the drawing is 0.00001 x 0.00001 mm at true size"), "{noted}");
    assert!(noted.contains("nothing to draw") && noted.contains("a motor step"), "{noted}");
    let (code, said, noted) = penup(folder.path(), &[&preview[..], &["--fit"]].concat());
    assert_eq!((code, noted.as_str()), (Some(0), ""), "{said}");
}

#[test]
fn a_plan_that_fits_the_turned_page_is_told_how_to_turn_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |size: &str, options: &[&str]| {
        fs::write(folder.path().join("a.obj"), format!("v 0 0 0\nv {size} 0\nl 1 2\n"))
            .expect("written");
        let (code, _, noted) =
            penup(folder.path(), &[&["preview", "a.obj", "--svg", "a.svg"], options].concat());
        (code, noted.contains("the drawing fits the page if that is turned: --landscape=auto"))
    };
    assert_eq!(told("250 100", &[]), (Some(4), true));
    assert_eq!(told("250 100", &["--landscape=auto"]), (Some(0), false));
    assert_eq!(told("100 250", &["--landscape"]), (Some(4), true));
    assert_eq!(told("100 250", &["--landscape=auto"]), (Some(0), false));
    assert_eq!(told("300 100", &[]), (Some(4), false));
    assert_eq!(told("250 195", &[]), (Some(4), false));
    assert_eq!(told("250 100", &["--fit"]), (Some(0), false));
    assert_eq!(told("150 100", &[]), (Some(0), false));
}

#[test]
fn creases_are_proposed_to_those_who_do_not_choose_them() {
    let folder = tempfile::tempdir().expect("a folder");
    // A square of 9 x 9 smaller ones, each bent a little.
    let corners = (0..100).map(|index| {
        let (x, y) = (index % 10, index / 10);
        format!("v {x} {y} {}\n", f64::from((x + y) % 2) / 10.0)
    });
    let faces = (0..90)
        .filter(|index| index % 10 != 9)
        .map(|index| format!("f {} {} {} {}\n", index + 1, index + 2, index + 12, index + 11));
    fs::write(folder.path().join("a.obj"), corners.chain(faces).collect::<String>())
        .expect("written");
    for (options, proposed) in [(&[][..], true), (&["--crease", "20"], false), (&["--fit"], true)] {
        let arguments = [&["preview", "a.obj", "--svg", "a.svg"], options].concat();
        let (code, _, noted) = penup(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{noted}");
        assert_eq!(noted.contains("--crease 30 leaves them out"), proposed, "{options:?}: {noted}");
    }
}

#[test]
fn a_port_that_is_not_there_is_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 0 0 0\n").expect("written");
    let (code, _, stderr) = penup(folder.path(), &["plot", "a.obj", "--port", "no-such-port"]);
    assert_eq!(code, Some(3));
    assert!(stderr.contains("cannot open no-such-port"), "{stderr}");
    assert!(stderr.contains("is the plotter plugged in"), "{stderr}");
    let both = ["plot", "a.obj", "--port", "p", "--board", "lm3s6965"];
    assert_eq!(penup(folder.path(), &both).0, Some(2));
}

#[test]
fn a_trace_is_fitted_and_the_curves_are_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let circle = |degree: u32| {
        let (sine, cosine) = f64::from(degree).to_radians().sin_cos();
        format!("v {:.3} {:.3} 0\n", 100.0 + 50.0 * cosine, 100.0 + 50.0 * sine)
    };
    let numbers: Vec<String> = (1..=181).map(|number| number.to_string()).collect();
    let trace: String = (0..=180).map(circle).collect();
    fs::write(folder.path().join("arc.obj"), format!("{trace}l {}\n", numbers.join(" ")))
        .expect("written");
    let (code, said, _) = penup(folder.path(), &["fit", "arc.obj", "--tolerance", "0.05"]);
    assert_eq!(code, Some(0));
    assert!(said.contains("arc-fitted.obj: 1 polylines: 181 vertices became"), "{said}");
    let (code, said, error) = penup(folder.path(), &["preview", "arc-fitted.obj"]);
    assert_eq!(code, Some(0), "{error}");
    // Half the circumference.
    assert!(said.contains("1 strokes, 157."), "{said}");
    let (code, _, error) = penup(folder.path(), &["fit", "arc-fitted.obj"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("no polyline"), "{error}");
    fs::write(folder.path().join("far.obj"), "v 0 0 0\nv 1e308 0 0\nl 1 2\n").expect("written");
    let (code, _, error) = penup(folder.path(), &["fit", "far.obj"]);
    assert_eq!(code, Some(1));
    assert_eq!(error, "penup: far.obj:2: coordinates go up to 1073741824\n");
}

/// The plotter reads the number that the option has, in the form that it was given.
#[test]
fn a_far_eye_and_a_near_one_are_drawn_or_refused_with_their_option() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), include_str!("../../../scenes/cube.obj"))
        .expect("written");
    let preview = |options: &[&str]| {
        penup(folder.path(), &[&["preview", "cube.obj", "--svg", "x.svg"], options].concat())
    };
    let (code, said, error) = preview(&["--eye", "1e-300,-5,4"]);
    assert_eq!(code, Some(0), "{error}");
    assert_eq!(said, preview(&["--eye", "0,-5,4"]).1);
    for (option, value) in [
        ("--eye", "1e308,0,0"),
        ("--angles", "1e300,0,0"),
        ("--margin", "1e308"),
        ("--page", "1e9x1e9"),
        ("--crease", "nan"),
        ("--crease", "-5"),
        ("--crease", "500"),
    ] {
        let (code, _, error) = preview(&[option, value]);
        assert_eq!(code, Some(2), "{error}");
        let first = format!("error: invalid value '{value}' for '{option} <");
        assert!(error.starts_with(&first) && error.len() < 300, "{error}");
    }
}

const PLAN: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nl 1 2 3\n";

#[test]
fn no_result_replaces_its_file_or_another_result() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("sub")).expect("a folder");
    fs::write(folder.path().join("b.obj"), PLAN).expect("written");
    fs::write(folder.path().join("plot.svg"), [0x33; 9]).expect("written");
    let mut before = files(folder.path());
    let refused = |arguments: &[&str], reason: &str| {
        let (code, stdout, stderr) = penup(folder.path(), arguments);
        assert_eq!((code, stdout.as_str()), (Some(1), ""), "{arguments:?}: {stderr}");
        assert_eq!(stderr, format!("penup: {reason}\n"), "{arguments:?}");
    };
    let read = "is the file to read: give the result another name, so that it is not overwritten";
    for (arguments, output) in [
        (&["fit", "b.obj", "--output", "b.obj"][..], "b.obj"),
        (&["fit", "b.obj", "--output", "./sub/../b.obj"], "./sub/../b.obj"),
        (&["tape", "encode", "b.obj", "--output", "b.obj"], "b.obj"),
        (&["tape", "show", "plot.svg"], "plot.svg"),
        (&["preview", "b.obj", "--svg", "b.obj"], "b.obj"),
        (&["preview", "b.obj", "--json", "b.obj"], "b.obj"),
        (&["plot", "b.obj", "--png", "b.obj"], "b.obj"),
    ] {
        refused(arguments, &format!("{output} {read}"));
    }
    let one = "are one file: give each result a file of its own";
    refused(&["preview", "b.obj", "--svg", "x", "--png", "x"], &format!("x and x {one}"));
    refused(&["preview", "b.obj", "--svg", "x", "--json", "./x"], &format!("x and ./x {one}"));
    refused(&["preview", "b.obj", "--png", "x", "--json", "x"], &format!("x and x {one}"));
    refused(
        &["plot", "b.obj", "--svg", "x", "--png", "sub/../x"],
        &format!("x and sub/../x {one}"),
    );
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("b.obj", folder.path().join("link.obj")).expect("a link");
        refused(&["fit", "link.obj", "--output", "b.obj"], &format!("b.obj {read}"));
        before = [before, vec!["link.obj".to_owned()]].concat();
        before.sort();
    }
    assert_eq!(files(folder.path()), before);
    assert_eq!(fs::read_to_string(folder.path().join("b.obj")).expect("readable"), PLAN);
}

/// The file to read is not there either: where the results go is looked at first.
#[test]
fn an_output_that_cannot_be_written_is_an_error_before_any_work() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("file"), "").expect("written");
    fs::create_dir(folder.path().join("folder")).expect("a folder");
    let before = files(folder.path());
    let mut outputs = vec!["no/x", "file/x", "folder", "folder/", "new/"];
    // Even the system's administrator cannot make a file there.
    if cfg!(target_os = "linux") {
        outputs.push("/proc/x");
    }
    for output in outputs {
        for arguments in [
            &["plot", "none.obj", "--svg", output][..],
            &["plot", "none.obj", "--png", output],
            &["preview", "none.obj", "--svg", output],
            &["preview", "none.obj", "--png", output],
            &["preview", "none.obj", "--json", output],
            &["fit", "none.obj", "--output", output],
            &["tape", "encode", "none.obj", "--output", output],
            &["tape", "show", "none.tape", "--svg", output],
        ] {
            let (code, _, stderr) = penup(folder.path(), arguments);
            assert_eq!(code, Some(1));
            let reason = format!("penup: cannot write {output}: ");
            assert!(stderr.starts_with(&reason), "{arguments:?}: {stderr}");
        }
    }
    assert_eq!(files(folder.path()), before);
}

/// Every command reads its file from a pipe that never ends, and is given up there.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_every_command_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("endless.obj");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("a pipe").success());
    for arguments in [
        &["fit"][..],
        &["preview"],
        &["plot"],
        &["tape", "encode"],
        &["tape", "decode"],
        &["tape", "show"],
    ] {
        let program = Command::new(env!("CARGO_BIN_EXE_penup"))
            .args(arguments)
            .arg("endless.obj")
            .current_dir(folder.path())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("the program runs");
        // Opening it to write waits until the program reads it.
        let writer = fs::OpenOptions::new().write(true).open(&pipe).expect("a pipe");
        let number = program.id().to_string();
        let sent = Command::new("kill").args(["-INT", &number]).status().expect("a signal");
        assert!(sent.success());
        let output = program.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{arguments:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "penup: given up\n");
        drop(writer);
    }
    assert_eq!(files(folder.path()), ["endless.obj"]);
}

#[cfg(target_os = "linux")]
#[test]
fn an_output_that_is_closed_is_no_error_and_a_full_one_is() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("long.tape"), [0x33; 100_000]).expect("written");
    let shell = |line: &str| {
        let program = env!("CARGO_BIN_EXE_penup");
        let output = Command::new("bash")
            .args(["-c", &line.replace("penup", program)])
            .current_dir(folder.path())
            .output()
            .expect("a shell");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for line in [
        "penup --help | head -1; exit ${PIPESTATUS[0]}",
        "penup tape decode long.tape | true; exit ${PIPESTATUS[0]}",
        "penup tape decode long.tape >&-",
    ] {
        assert_eq!(shell(line), (Some(0), String::new()), "{line}");
    }
    let (code, said) = shell("penup tape decode long.tape > /dev/full");
    assert_eq!(code, Some(1));
    assert!(said.starts_with("penup: cannot write the standard output: "), "{said}");
    assert_eq!(shell("penup preview none.obj 2> /dev/full").0, Some(1));
}

/// A copy of a checkout: what tells one from other folders, and the program in its target
/// directory.
#[test]
fn a_moved_checkout_is_used_where_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let target = folder.path().join("target/debug");
    fs::create_dir_all(&target).expect("a folder");
    let root = penup_client::workspace::root();
    for file in ["Cargo.toml", "scenes/interpen.obj", "client/Cargo.toml"] {
        let copy = folder.path().join(file);
        fs::create_dir_all(copy.parent().expect("a folder")).expect("a folder");
        fs::copy(root.join(file), copy).expect("copied");
    }
    let program = target.join("penup");
    fs::copy(env!("CARGO_BIN_EXE_penup"), &program).expect("copied");
    let output = Command::new(program)
        .arg("plot")
        .env_remove("CARGO_MANIFEST_DIR")
        .current_dir(folder.path())
        .output()
        .expect("the program runs");
    let said = String::from_utf8(output.stderr).expect("text");
    let image = folder.path().join("target/firmware/lm3s6965.elf").display().to_string();
    assert!(said.contains(&image), "{said}");
    assert!(said.contains("run `cargo xtask build --board lm3s6965`"), "{said}");
}

/// A checkout whose emulators are broken programs.
#[cfg(target_os = "linux")]
#[test]
fn a_broken_emulator_is_reported_in_a_sentence() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let root = penup_client::workspace::root();
    for file in ["Cargo.toml", "scenes/interpen.obj", "client/Cargo.toml"] {
        let copy = folder.path().join(file);
        fs::create_dir_all(copy.parent().expect("a folder")).expect("a folder");
        fs::copy(root.join(file), copy).expect("copied");
    }
    // Any ELF file serves as an image.
    let firmware = folder.path().join("target/firmware");
    fs::create_dir_all(&firmware).expect("a folder");
    fs::copy("/bin/true", firmware.join("lm3s6965.elf")).expect("copied");
    let programs = folder.path().join("bin");
    fs::create_dir(&programs).expect("a folder");
    let plot = || {
        let output = Command::new(env!("CARGO_BIN_EXE_penup"))
            .arg("plot")
            .env("CARGO_MANIFEST_DIR", folder.path())
            .env("PATH", &programs)
            .env("TMPDIR", folder.path())
            .current_dir(folder.path())
            .output()
            .expect("the program runs");
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).expect("text")
    };
    let said = plot();
    assert!(said.contains("cannot run qemu-system-arm"), "{said}");
    assert!(said.contains("cargo xtask set-up"), "{said}");
    let qemu = programs.join("qemu-system-arm");
    let script = "#!/bin/sh\necho 'Error: at Object.<anonymous> (file:1)' >&2\nexit 3\n";
    fs::write(&qemu, script).expect("written");
    fs::set_permissions(&qemu, fs::Permissions::from_mode(0o755)).expect("set");
    let said = plot();
    assert!(said.starts_with("penup: the emulator of the lm3s6965 board broke: "), "{said}");
    assert!(said.contains("cargo xtask set-up") && said.lines().count() == 2, "{said}");
    assert!(!said.contains("Object.<anonymous>"), "{said}");
    let details = said.trim().rsplit(' ').next().expect("a file");
    let details = fs::read_to_string(details).expect("kept");
    assert!(details.contains("Object.<anonymous>"), "{details}");
}

#[test]
fn a_drawing_is_written_for_other_machines() {
    let folder = tempfile::tempdir().expect("a folder");
    let square = "v 10 10 0\nv 60 10 0\nv 60 60 0\nv 10 60 0\nv 80 20 0\nv 80 70 0\n\
                  usemtl pen1\nl 1 2 3 4 1\nusemtl pen2\nl 5 6\n";
    fs::write(folder.path().join("a.obj"), square).expect("written");
    let export = |options: &[&str]| {
        let all =
            [&["preview", "a.obj", "--gcode", "a.gcode", "--hpgl", "a.plt"], options].concat();
        let (code, said, error) = penup(folder.path(), &all);
        assert_eq!(code, Some(0), "{error}");
        assert!(said.starts_with("a.gcode, a.plt: 2 strokes, 250.0 mm drawn"), "{said}");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("readable");
        (read("a.gcode"), read("a.plt"))
    };
    let ink = |file: &str| {
        let (code, _, error) = penup(folder.path(), &["preview", file, "--json", "ink.json"]);
        assert_eq!(code, Some(0), "{error}");
        let json = fs::read_to_string(folder.path().join("ink.json")).expect("readable");
        let result: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        result["pen_down_mm"].as_f64().expect("a number")
    };
    let (gcode, hpgl) = export(&[]);
    assert!(gcode.contains("(pen 2)\nM0\n") && hpgl.contains("SP2;"), "{gcode}{hpgl}");
    for file in ["a.gcode", "a.plt"] {
        // The files draw the same when they are read again.
        assert!((ink(file) - 250.0).abs() < 0.1, "{file}");
    }
    let (thrice, _) = export(&["--multipass", "3"]);
    let draws = |text: &str| text.matches("G1 ").count();
    assert_eq!((draws(&gcode), draws(&thrice)), (5, 15));
    assert_eq!(thrice.matches("M3").count(), 2, "{thrice}");
    let (looped, _) = export(&["--reloop"]);
    assert_eq!(draws(&looped), 5);
}

/// Of a machine whose steps are no grid on the page, the lines are computed, and not read from the
/// pins.
#[test]
fn broken_lines_are_broken_on_every_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let cube = include_str!("../../../scenes/cube.obj");
    fs::write(folder.path().join("cube.obj"), cube).expect("written");
    for line_type in ["dashed", "dotted"] {
        let lifts = |options: &[&str]| {
            let all = ["preview", "cube.obj", "--hidden", line_type, "--gcode", "a.gcode"];
            let (code, _, error) = penup(folder.path(), &[&all, options].concat());
            assert_eq!(code, Some(0), "{error}");
            let gcode = fs::read_to_string(folder.path().join("a.gcode")).expect("readable");
            gcode.matches("M3").count()
        };
        let of_grid = lifts(&[]);
        assert!(of_grid > 40, "{of_grid}");
        for setting in ["230=1", "101=88"] {
            let lifts = lifts(&["--set", setting]);
            assert!(lifts.abs_diff(of_grid) <= 2, "{line_type} {setting}: {lifts}, not {of_grid}");
        }
    }
}

#[test]
fn the_standard_output_takes_one_file_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nl 1 2\n").expect("written");
    for (option, begin, end) in [
        ("--svg", "<svg ", "</svg>\n"),
        ("--gcode", "(penup ", "M2\n"),
        ("--hpgl", "IN;", "SP0;\n"),
        ("--json", "{", "}\n"),
    ] {
        let (code, said, error) = penup(folder.path(), &["preview", "a.obj", option, "-"]);
        assert_eq!(code, Some(0), "{error}");
        assert!(said.starts_with(begin) && said.ends_with(end), "{said}");
        assert!(error.starts_with("-: 1 strokes, 50.0 mm drawn"), "{error}");
    }
    let (code, _, error) = penup(folder.path(), &["preview", "a.obj", "--svg=-", "--hpgl=-"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("give each result a file of its own"), "{error}");
    assert_eq!(files(folder.path()), ["a.obj"]);
}

#[test]
fn the_page_is_given_the_standard_input() {
    use std::io::{BufRead as _, BufReader, Read as _};
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("index.html"), "the page").expect("written");
    let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["page", "-", "--no-browser", "--folder", "."])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program runs");
    program.stdin.take().expect("a pipe").write_all(b"v 1 2 3\n").expect("written");
    let mut address = String::new();
    let mut said = BufReader::new(program.stdout.take().expect("a pipe"));
    said.read_line(&mut address).expect("a line");
    let (host, path) = address
        .trim()
        .strip_prefix("http://")
        .and_then(|address| address.split_once('/'))
        .unwrap_or_default();
    let (path, name) = path.split_once('#').unwrap_or_default();
    assert_eq!(name, "given=the%20standard%20input");
    let mut connection = std::net::TcpStream::connect(host).expect("a server");
    write!(connection, "GET /{path}given HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("asked");
    let mut answer = String::new();
    connection.read_to_string(&mut answer).expect("an answer");
    program.kill().expect("killed");
    program.wait().expect("it ends");
    assert!(answer.ends_with("\r\n\r\nv 1 2 3\n"), "{answer}");
}

#[test]
fn what_a_preview_says_stands_in_its_json() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nv 60 35 0\nl 1 2\nl 2 3\n")
        .expect("written");
    let json = |options: &[&str]| {
        let (code, said, error) =
            penup(folder.path(), &[&["preview", "a.obj", "--json", "a.json"], options].concat());
        assert_eq!(code, Some(0), "{error}");
        let json = fs::read_to_string(folder.path().join("a.json")).expect("readable");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        (said, json)
    };
    let (said, once) = json(&[]);
    assert_eq!(once["bounds"], serde_json::json!([[10.0, 10.0, 0.0], [60.0, 35.0, 0.0]]));
    assert_eq!(once["passes"], 1);
    assert_eq!(once["page_mm"], serde_json::json!({ "width": 210.0, "height": 297.0 }));
    let drawn = &once["drawn"];
    let figures = format!(
        "a.json: {} strokes, {:.1} mm drawn, {:.1} mm between them, efficiency {:.1} %; the \
         drawing reaches from 10, 10 to 60, 35 mm, 0:{:02.0} to draw\n",
        drawn["strokes"],
        drawn["pen_down_mm"].as_f64().expect("a number"),
        drawn["pen_up_mm"].as_f64().expect("a number"),
        drawn["efficiency_percent"].as_f64().expect("a number"),
        once["duration_s"].as_f64().expect("a number").round(),
    );
    assert_eq!(said, figures);
    let (said, twice) = json(&["--multipass", "2"]);
    assert!(said.contains(", 2 passes, "), "{said}");
    let of = |json: &serde_json::Value, name: &str| json[name].as_f64().expect("a number");
    assert_eq!(of(&twice, "pen_down_mm"), of(&once, "pen_down_mm"));
    assert!(of(&twice, "duration_s") > 1.8 * of(&once, "duration_s"));
    assert!(of(&twice, "steps") > 1.8 * of(&once, "steps"));

    let (_, turned) = json(&["--page", "A5", "--landscape"]);
    assert_eq!(turned["page_mm"], serde_json::json!({ "width": 210.0, "height": 148.0 }));
}
