//! The files and the streams to which results go.

use super::*;

const PLAN: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nl 1 2 3\n";

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

/// A tape has no pens, and the plot of the motion shows what all of them draw.
#[test]
fn all_pens_and_every_refill_are_on_a_tape_and_in_the_plot_of_the_motion() {
    let folder = tempfile::tempdir().expect("a folder");
    let vertices = "v 20 20 0\nv 40 20 0\nv 40 30 0\n";
    let pens = "usemtl a\nl 1 2\nusemtl b\nl 2 3\n";
    fs::write(folder.path().join("pens.obj"), format!("{vertices}{pens}")).expect("written");
    fs::write(folder.path().join("one.obj"), format!("{vertices}l 1 2 3\n")).expect("written");
    let lengths = |name: &str| {
        let (code, _, error) = penup(folder.path(), &["tape", "encode", name, "--quiet"]);
        assert_eq!(code, Some(0), "{error}");
        let (_, said, _) = penup(folder.path(), &["tape", "decode", &name.replace("obj", "tape")]);
        let words = said.split_ascii_whitespace();
        words.filter_map(|word| word.parse::<u32>().ok()).sum::<u32>()
    };
    assert_eq!(lengths("pens.obj"), lengths("one.obj"));
    for (name, options, is_told) in [
        ("pens.obj", &[][..], true),
        ("pens.obj", &["--pens", "one"], false),
        ("one.obj", &[], false),
    ] {
        let encode = [&["tape", "encode", name][..], options].concat();
        let (code, _, noted) = penup(folder.path(), &encode);
        let told = "several pens draw it, and a tape has no pens: one pen draws all of them";
        assert_eq!((code, noted.contains(told)), (Some(0), is_told), "{name}: {noted}");
    }
    let lines = format!("{vertices}v 20 30 0\nl 1 2\nl 3 4\n");
    fs::write(folder.path().join("lines.obj"), &lines).expect("written");
    let by_pens = lines.replace("l 3", "usemtl b\nl 3");
    fs::write(folder.path().join("lines-by-pens.obj"), by_pens).expect("written");
    let seconds = |name: &str, more: &[&str]| {
        let plot = [&["preview", name, "--motion", "motion.svg"][..], more].concat();
        let (code, _, error) = penup(folder.path(), &plot);
        assert_eq!(code, Some(0), "{error}");
        let plot = fs::read_to_string(folder.path().join("motion.svg")).expect("readable");
        let (before, _) = plot.split_once(" s; greatest").expect("the duration");
        before.rsplit(' ').next().and_then(|it| it.parse::<f64>().ok()).expect("seconds")
    };
    let whole = seconds("lines.obj", &[]);
    assert!(whole > 1.5, "{whole}");
    assert_eq!(seconds("lines-by-pens.obj", &[]), whole);
    assert_eq!(seconds("lines.obj", &["--set", "215=0.01"]), whole);
}

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
        "penup --quiet tape decode long.tape | true; exit ${PIPESTATUS[0]}",
        "penup --quiet tape decode long.tape >&-",
    ] {
        assert_eq!(shell(line), (Some(0), String::new()), "{line}");
    }
    let (code, said) = shell("penup --quiet tape decode long.tape > /dev/full");
    assert_eq!(code, Some(1));
    assert!(said.starts_with("penup: cannot write the standard output: "), "{said}");
    assert_eq!(shell("penup preview none.obj 2> /dev/full").0, Some(1));
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
        assert!(error.starts_with("-: 1 stroke, 50.0 mm drawn"), "{error}");
    }
    let (code, _, error) = penup(folder.path(), &["preview", "a.obj", "--svg=-", "--hpgl=-"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("give each result a file of its own"), "{error}");
    assert_eq!(files(folder.path()), ["a.obj"]);
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
        "a.json: {} stroke, {:.1} mm drawn, {:.1} mm between them, efficiency {:.1} %; the \
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
