use super::*;
use crate::cli::Cli;
use clap::Parser as _;

/// The settings for a model of one vertex.
fn settings(options: &[&str]) -> Result<Settings, String> {
    settings_of("v 0 0 0\n", options)
}

/// The settings for an OBJ file with this text.
fn settings_of(text: &str, options: &[&str]) -> Result<Settings, String> {
    let line = ["penup", "preview", "f.obj"].iter().chain(options);
    let cli = Cli::try_parse_from(line).map_err(|error| error.to_string())?;
    match cli.command {
        crate::cli::Command::Preview(args) => {
            let file = SourceFile::arranged("a.obj".into(), text.into(), args.view.arrangement());
            args.view.settings_for(&file.map_err(|error| error.to_string())?)
        }
        _ => Err("the wrong command".to_owned()),
    }
}

#[test]
fn negative_numbers_work_with_a_space_and_with_an_equals_sign() {
    let spaced = settings(&["--eye", "-3,-4,2.5", "--at", "-.5,0,-1e-1", "--up", "-1,-2,-3"]);
    let joined = settings(&["--eye=-3,-4,2.5", "--at=-.5,0,-1e-1", "--up=-1,-2,-3"]);
    assert_eq!(spaced, joined);
    let settings = spaced.expect("good options");
    assert_eq!(settings.value("eye"), Some("-3,-4,2.5"));
    assert_eq!(settings.value("at"), Some("-.5,0,-1e-1"));
    assert_eq!(settings.value("up"), Some("-1,-2,-3"));
}

#[test]
fn pages_have_names_or_sizes_and_lie_either_way() {
    let size = |options: &[&str]| {
        let page = settings(options).expect("good options").page;
        (page.width, page.height)
    };
    assert_eq!(size(&[]), (210.0, 297.0));
    assert_eq!(size(&["--landscape"]), (297.0, 210.0));
    assert_eq!(size(&["--page", "a3"]), (297.0, 420.0));
    assert_eq!(size(&["--page=Letter", "--landscape"]), (279.4, 215.9));
    assert_eq!(size(&["--page", "80.5x60"]), (80.5, 60.0));
    assert_eq!(size(&["--page", "60X80", "--landscape"]), (80.0, 60.0));
    assert_eq!(size(&["--page", "a6"]), (105.0, 148.0));
    assert_eq!(size(&["--page", "Tabloid"]), (279.4, 431.8));
    assert_eq!(size(&["--page", "11x17in"]), (279.4, 431.8));
    assert_eq!(size(&["--page", "30cmx20cm"]), (300.0, 200.0));
    assert_eq!(size(&["--page", "1inx300mm"]), (25.4, 300.0));
}

/// A title with one letter more than allowed.
const LONG: &str =
    "0123456789 123456789 123456789 123456789 123456789 123456789 123456789 1234567890";

#[test]
fn a_title_may_have_any_letter_of_the_font() {
    let title = "Café – 3 % \\ #1: ¿sí? ~ «ÿ»!";
    let settings = settings(&["--title", title, "--title-size=12.5"]).expect("good options");
    let escaped = Escape(title).to_string();
    assert_eq!(settings.value("title"), Some(escaped.as_str()));
    assert_eq!(settings.value("title-size"), Some("12.5"));
}

#[test]
fn numbers_may_have_exponents_of_any_size() {
    let options = ["--eye", "1e-300,2,3", "--effort", "1e3", "--lift=25e-1", "--page=2e2x3e2"];
    let settings = settings(&options).expect("good options");
    assert_eq!(settings.value("eye"), Some("1e-300,2,3"));
    assert_eq!(settings.value("effort"), Some("1e3"));
    assert_eq!(settings.value("lift"), Some("25e-1"));
    assert_eq!(settings.value("page"), Some("200x300"));
    assert_eq!((settings.page.width, settings.page.height), (200.0, 300.0));
}

const NUMBER: &str = "a number is written like -12.5";
const RANGE: &str = "the number is too large, too small or has the wrong sign";

#[test]
fn nonsense_is_refused_with_the_reason() {
    for (options, reason) in [
        (["--eye", "1,2"], "it takes 3 numbers"),
        (["--eye", "1,2,3,4"], "it takes 3 numbers"),
        (["--eye", "1,,3"], NUMBER),
        (["--eye", "1e308,0,0"], RANGE),
        (["--eye", "1,2,3#4"], "no value has such a letter"),
        (["--eye", "1,2,3\n"], "no value has such a letter"),
        (["--eye", &format!("1,2,{}", "0".repeat(300))], "a line has at most 256 bytes"),
        (["--at", "1,2,nan"], NUMBER),
        (["--up", "--fit"], NUMBER),
        (["--angles", "1e300,0,0"], RANGE),
        (["--crease", "nan"], NUMBER),
        (["--crease", "-5"], RANGE),
        (["--crease", "500"], RANGE),
        (["--page", "B5"], "none of A4"),
        (["--page", "-10x20"], RANGE),
        (["--page", "10xinf"], NUMBER),
        (["--page", "1e9x1e9"], RANGE),
        (["--page", "1e-9x100"], RANGE),
        (["--margin", "-1"], RANGE),
        (["--margin", "1e308"], RANGE),
        (["--effort", "-1"], RANGE),
        (["--effort", "1e12"], RANGE),
        (["--effort", "1.5"], "(expected: auto, or a whole number, 0 to 2147483647)"),
        (["--effort", "much"], NUMBER),
        (["--title-size", "101"], "(expected: 1 to 100 mm)"),
        (["--title", "a→b"], "the font lacks → (U+2192)"),
        (["--title", "line\nline"], "the font lacks"),
        (["--title", LONG], "at most 80 bytes"),
        (["--title-size", "0.5"], RANGE),
        (["--lift", "-1"], RANGE),
        (["--lift", "1001"], RANGE),
        (["--hidden", "gone"], "erased, dotted, dashed"),
    ] {
        let error = settings(&options).expect_err("refused");
        assert!(error.contains(reason), "{options:?}: {error}");
        assert!(error.contains(&format!("'{} ", options[0])), "{options:?}: {error}");
    }
}

/// A tetrahedron, 2 wide, 4 deep and 4 high.
const SOLID: &str = "v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 0 4\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";

#[test]
fn a_direction_places_the_eye_around_the_middle_and_says_what_is_up() {
    let placed = |options: &[&str]| {
        let settings = settings_of(SOLID, options).expect("settings");
        let value = |name| -> Vec<f64> {
            let value = settings.value(name).expect("a value");
            value.split(',').map(|part| part.parse::<f64>().expect("a number")).collect()
        };
        let eye: Vec<f64> = value("eye").iter().zip([1.0, 2.0, 2.0]).map(|(a, b)| a - b).collect();
        (eye.iter().map(|part| part / 10.5).collect::<Vec<_>>(), value("up"))
    };
    let near = |options: &[&str], eye: [f64; 3], up: [f64; 3]| {
        let (own_eye, own_up) = placed(options);
        for axis in 0..3 {
            assert!((own_eye[axis] - eye[axis]).abs() < 1e-6, "{options:?} {own_eye:?}");
            assert!((own_up[axis] - up[axis]).abs() < 1e-6, "{options:?} {own_up:?}");
        }
    };
    let (z, y) = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
    near(&["--view", "front"], [0.0, -1.0, 0.0], z);
    near(&["--view", "left"], [-1.0, 0.0, 0.0], z);
    near(&["--view", "top"], z, y);
    near(&["--view", "front", "--y-up"], z, y);
    near(&["--view", "top", "--y-up"], y, [0.0, 0.0, -1.0]);
    near(&["--azimuth=0", "--elevation", "90"], z, [-1.0, 0.0, 0.0]);
    near(&["--azimuth=0", "--elevation", "30"], [0.75_f64.sqrt(), 0.0, 0.5], z);
    near(
        &["--azimuth=45", "--elevation=0", "--projection", "orthographic"],
        [0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0],
        z,
    );
    // The usual view follows what is up, whatever the projection.
    near(&["--y-up"], [0.45, 0.5, 0.75], y);
    near(&["--up", "0,1,0"], [0.45, 0.5, 0.75], y);
    near(&["--y-up", "--projection", "cabinet"], z, y);
    let third = (1.0_f64 / 3.0).sqrt();
    near(&["--y-up", "--projection", "isometric"], [third, third, third], y);
    let settings = settings_of(SOLID, &["--y-up", "--projection", "isometric"]).expect("settings");
    assert_eq!(settings.value("projection"), Some("orthographic"));
    // Nothing is sent that the user did not ask for.
    assert_eq!(settings_of(SOLID, &[]).expect("settings").value("eye"), None);
    let own = settings_of(SOLID, &["--eye=9,9,9", "--up=0,1,0"]).expect("settings");
    assert_eq!(own.value("eye"), Some("9,9,9"));
}

#[test]
fn a_direction_that_contradicts_another_choice_is_refused() {
    for (options, reason) in [
        (&["--view", "front", "--eye", "1,2,3"][..], "cannot be used with"),
        (&["--view", "front", "--azimuth", "3"], "cannot be used with"),
        (&["--y-up", "--up", "0,0,1"], "cannot be used with"),
        (&["--elevation", "91"], "-90 to 90 degrees"),
        (&["--view", "inside"], "possible values: front, back, left, right, top, bottom"),
        (&["--view", "front", "--projection", "isometric"], "has a direction of its own"),
    ] {
        let error = settings_of(SOLID, options).expect_err("refused");
        assert!(error.contains(reason), "{error}");
    }
    let plan = "v 0 0 0\nv 9 5 0\nl 1 2\n";
    let error = settings_of(plan, &["--y-up"]).expect_err("refused");
    assert!(error.contains("this drawing lies flat"), "{error}");
}

#[test]
fn options_of_plans_reach_the_file_and_contradict_others() {
    let plan = "v 0 0 0\nv 9 5 0\nl 1 2\n";
    let page = |options: &[&str]| settings_of(plan, options).map(|settings| settings.page.width);
    assert_eq!(page(&["--landscape=auto"]), Ok(297.0));
    assert_eq!(page(&["--landscape=auto", "--rotate", "90"]), Ok(210.0));
    assert_eq!(page(&["--landscape"]), Ok(297.0));
    assert_eq!(page(&["--pens", "auto", "--layer-order", "1"]), Ok(210.0));
    for (options, reason) in [
        (&["--scale", "2", "--fit"][..], "cannot be used with"),
        (&["--center", "--fit"], "cannot be used with"),
        (&["--pens", "one", "--layer-order", "1"], "leave out --layer-order, or --pens one"),
        (&["--scale", "0"], "a factor is 0.001 to 1000"),
        (&["--crop", "500,500,5,5"], "nothing left to draw after --crop"),
        (&["--landscape=sometimes"], "possible values: always, auto"),
    ] {
        let error = page(options).expect_err("refused");
        assert!(error.contains(reason), "{error}");
    }
}
