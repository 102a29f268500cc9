//! Plans, which are drawn where they lie.

use super::*;

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
    let more = ["p 1\n", "deg 1\ncurv 0 1 1 2\nparm u 0 0 1 1\nend\n"];
    for plan in more.map(|more| format!("{plan}{more}")) {
        assert_eq!(told(&plan, &idle).as_deref(), Some("--hidden, --crease"), "{plan}");
    }
    assert_eq!(told(solid, &idle), None);
    assert_eq!(told(solid, &["--fit"]).as_deref(), Some("--fit"));
    assert_eq!(told(solid, &["--title-size", "9"]).as_deref(), Some("--title-size"));
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

/// Below the drawing is the title, whose height the plotter keeps free, too.
#[test]
fn a_plan_that_the_title_moves_is_told_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 20 12 0\nv 60 42 0\nl 1 2\n").expect("written");
    let preview = |options: &[&str]| {
        let usual = ["preview", "a.obj", "--svg", "a.svg", "--json", "a.json"];
        let (code, said, noted) = penup(folder.path(), &[&usual[..], options].concat());
        assert_eq!(code, Some(0), "{noted}");
        let result = fs::read_to_string(folder.path().join("a.json")).expect("readable");
        let result: serde_json::Value = serde_json::from_str(&result).expect("JSON");
        let y = |value: &serde_json::Value| value.as_f64().expect("a number");
        // The line of the plan is the longest stroke.
        let strokes = result["strokes"].as_array().expect("strokes");
        let ends = |stroke: &serde_json::Value| [y(&stroke[0][1]), y(&stroke[1][1])];
        let height = |stroke: &&serde_json::Value| {
            let [from, to] = ends(stroke);
            ((from - to).abs() * 1000.0) as i64
        };
        let [from, to] = ends(strokes.iter().max_by_key(height).expect("a stroke"));
        let told = [0, 1].map(|end| y(&result["bounds"][end][1]));
        (from.min(to), told, said, noted)
    };
    let (drawn, told, said, noted) = preview(&[]);
    assert!((drawn - 12.0).abs() < 0.02 && told == [12.0, 42.0], "{drawn} {told:?}");
    assert!(!noted.contains("is moved") && said.contains("from 20, 12 to 60, 42 mm"), "{said}");
    let (drawn, told, said, noted) = preview(&["--title", "Ada"]);
    assert!(drawn > 12.5 && (drawn - told[0]).abs() < 0.02, "{drawn} {told:?}");
    assert!(
        noted.contains(" mm of its title: the file has it from 20, 12 to 60, 42 mm"),
        "{noted}"
    );
    assert!(!said.contains("from 20, 12 to"), "{said}");
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

/// Dots at any place of the grid of the motors are drawn, also where a millimetre has few steps.
#[test]
fn no_dot_is_lost_between_two_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let dots: String = (0..1000)
        .map(|number| {
            let [column, row] = [number % 40, number / 40].map(f64::from);
            format!("<path d='M{:.2},{:.2}h0'/>", column * 4.37 + 10.0, row * 6.13 + 10.0)
        })
        .collect();
    let svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='200mm' height='200mm' \
         viewBox='0 0 200 200'><g stroke='black' stroke-linecap='round'>{dots}</g></svg>"
    );
    fs::write(folder.path().join("dots.svg"), svg).expect("written");
    for settings in [&[][..], &["--set", "100=40", "--set", "101=40"]] {
        let preview = ["preview", "dots.svg", "--json", "dots.json"];
        let (code, _, noted) = penup(folder.path(), &[&preview[..], settings].concat());
        assert_eq!(code, Some(0), "{noted}");
        let json = fs::read_to_string(folder.path().join("dots.json")).expect("a file");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        let strokes = json["stroke_pens"].as_array().map(Vec::len);
        assert_eq!(strokes, Some(1000), "{settings:?}");
    }
}
