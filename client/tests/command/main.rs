//! The program as a user runs it.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, reason = "a test fails with the words of what it expected")]

#[cfg(unix)]
mod at_a_port;
#[cfg(unix)]
mod machine;
#[cfg(target_os = "linux")]
mod many_points;
mod plans;
mod results;

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
    let strokes = "The memory of pico does not hold this model, but `penup plot` draws it: it \
                   sends the strokes. A preview without --board shows them.\n";
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
fn an_upright_model_is_proposed_to_those_who_do_not_say_what_is_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let solid = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    let plan = "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n";
    let blender = "# Blender v2.80 (sub 74) OBJ File: 'a.blend'\n# www.blender.org\n";
    let maya = "# This file uses centimeters as units for non-parametric coordinates.\n";
    for (head, body, options, proposed) in [
        (blender, solid, &[][..], true),
        (maya, solid, &[], true),
        // Slashes and a group without a meaning for a plotter.
        (blender, "v 0 0 0\nv 1 0 0\nv 0 1 1\ns off\nf 1/1 2/2 3/3\n", &[], true),
        (blender, solid, &["--y-up"], false),
        (blender, solid, &["--angles", "0,0,0"], false),
        (blender, plan, &[], false),
        ("# OBJ File Generated by Meshlab\n", solid, &[], false),
        ("", solid, &[], false),
    ] {
        fs::write(folder.path().join("a.obj"), head.to_owned() + body).expect("written");
        let arguments = [&["preview", "a.obj", "--svg", "a.svg"], options].concat();
        let (code, _, noted) = penup(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{noted}");
        assert_eq!(noted.contains("add --y-up"), proposed, "{head} {options:?}: {noted}");
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
    assert!(said.contains("1 stroke, 157."), "{said}");
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

/// The shell has opened the file to which `/dev/stdout` leads.
#[cfg(unix)]
#[test]
fn the_name_of_the_standard_output_is_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nl 1 2\n").expect("written");
    let out = folder.path().join("out.svg");
    let status = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["preview", "a.obj", "--svg", "/dev/stdout"])
        .current_dir(folder.path())
        .stdout(fs::File::create(&out).expect("created"))
        .status();
    assert!(status.expect("the program runs").success());
    let picture = fs::read_to_string(&out).expect("readable");
    assert!(picture.starts_with("<") && picture.trim_end().ends_with("</svg>"), "{picture}");
    assert!(std::path::Path::new("/dev/stdout").is_symlink());
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
        assert_eq!(String::from_utf8_lossy(&output.stderr), "penup: ended by Ctrl-C\n");
        drop(writer);
    }
    assert_eq!(files(folder.path()), ["endless.obj"]);
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
