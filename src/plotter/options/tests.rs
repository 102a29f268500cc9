use super::*;
use crate::geometry::{Projection, Vertex};
use crate::model::{Corner, Model, Position, no_undo};
use crate::view::Lens;
use std::format;
use std::string::{String, ToString};

/// The options after one has been set.
fn with(name: &str, value: &str) -> Result<PlotOptions, CommandError> {
    let mut options = PlotOptions::default();
    let outcome = options.set(name, value);
    if outcome.is_err() {
        assert_eq!(options, PlotOptions::default(), "{name}={value} was refused");
    }
    assert_ne!(outcome, Ok(false), "there is no option {name}");
    outcome.map(|_| options)
}

/// The line that `$options` lists for an option.
fn listed(options: &PlotOptions, name: &str) -> Option<String> {
    let begin = format!("${name}=");
    options.lines().map(|line| line.to_string()).find(|line| line.starts_with(&begin))
}

#[test]
fn options_are_read_with_their_values() {
    let eye = |value| with("eye", value).map(|options| options.eye);
    assert_eq!(eye("-1, 2.5 ,3e1"), Ok(Some([-1.0, 2.5, 30.0])));
    assert_eq!(eye("1,2"), Err(CommandError::WrongNumberCount { needed: 3 }));
    assert_eq!(eye("1,2,3,4"), Err(CommandError::WrongNumberCount { needed: 3 }));
    assert_eq!(eye("1,2,"), Err(CommandError::NotANumber));
    assert_eq!(eye("1,2,1e300"), Err(CommandError::NumberOutOfRange));
    let projection = |value| with("projection", value).map(|options| options.projection);
    assert_eq!(projection("orthographic"), Ok(ProjectionChoice::Lens(Lens::Orthographic)));
    assert_eq!(projection("cabinet"), projection("oblique, 45,0.5"));
    assert_eq!(projection("oblique,45,3"), Err(CommandError::NumberOutOfRange));
    assert_eq!(projection("oblique,45"), Err(CommandError::WrongNumberCount { needed: 2 }));
    assert_eq!(projection("trimetric,10,20"), projection("axonometric,10,20"));
    assert!(matches!(projection("isometric,1,2"), Err(CommandError::NotAChoice { .. })));
    let page = |value| with("page", value).map(|options| [options.page.width, options.page.height]);
    assert_eq!(page("210x297"), Ok([210, 297].map(Millimetres::from_num)));
    assert_eq!(page("210"), Err(CommandError::NotAPage));
    assert_eq!(page("0x297"), Err(CommandError::NumberOutOfRange));
    let refusal = |name, value| with(name, value).expect_err("refused");
    assert_eq!(refusal("margin", "-1"), CommandError::NumberOutOfRange);
    assert_eq!(refusal("see", "gone").to_string(), "choose faces, wire, vertices or edges");
    assert_eq!(PlotOptions::default().set("110", "5"), Ok(false));
}

#[test]
fn the_ends_of_each_range_are_taken_and_no_more() {
    for (name, good, bad) in [
        ("margin", &["0", "32767.5"][..], &["-0.1", "32768"][..]),
        ("title-size", &["1", "100"], &["0.9", "100.1"]),
        ("lift", &["0", "1000"], &["-0.1", "1000.1"]),
        ("effort", &["auto", "0", "2147483647"], &["-1", "2147483648", "1.5"]),
        ("crease", &["0", "180"], &["-0.1", "180.1"]),
        ("precision", &["auto", "0", "1e6"], &["-0.1", "1000001"]),
        ("hidden", &["pen,1", "pen,32"], &["pen,0", "pen,33"]),
    ] {
        good.iter().for_each(|value| assert!(with(name, value).is_ok(), "{name}={value}"));
        bad.iter().for_each(|value| {
            assert_eq!(with(name, value), Err(CommandError::NumberOutOfRange), "{name}={value}");
        });
    }
}

#[test]
fn what_is_listed_can_be_set_and_is_then_listed_again() {
    for option in OPTIONS {
        for value in option.values.iter().filter(|value| value.bytes().all(|b| b != b',')) {
            let is_placeholder = value.bytes().any(|byte| byte.is_ascii_uppercase());
            let value = if is_placeholder { option.default() } else { value.to_string() };
            let Ok(options) = with(option.name, &value) else {
                // Only a position cannot be set to what it is by default.
                assert_eq!(value, "auto", "{}", option.name);
                continue;
            };
            let line = listed(&options, option.name);
            let Some(shown) = line.as_ref().and_then(|line| line.split_once('=')) else { continue };
            let again = with(option.name, shown.1).expect("what is listed can be set");
            assert_eq!(listed(&again, option.name), line);
            // Short forms are listed with their numbers.
            let has_numbers = matches!(option.name, "projection" | "hidden");
            assert!(shown.1 == value || has_numbers, "{line:?} is not {value}");
        }
    }
}

#[test]
fn every_option_is_listed_once_but_for_the_automatic_view() {
    let options = PlotOptions::default();
    let listed: std::vec::Vec<String> = options.lines().map(|line| line.to_string()).collect();
    for option in OPTIONS {
        let begin = format!("${}=", option.name);
        let count = listed.iter().filter(|line| line.starts_with(&begin)).count();
        assert_eq!(count, usize::from(option.name != "view"), "{}", option.name);
    }
}

#[test]
fn a_flag_explains_each_choice() {
    for option in OPTIONS {
        let Some(flag) = option.flag.get() else { continue };
        let explained = flag.choices.len();
        assert!(explained == 0 || explained == option.values.len(), "{}", option.name);
    }
}

/// The inner edges of a cube bend by 90 degrees, in oblique views, too.
#[test]
fn an_oblique_view_keeps_the_creases_of_a_cube() {
    let mut memory = ([Position::ORIGIN; 8], [<Corner>::ZERO; 2]);
    let mut cube = Model::new(&mut memory.0, &mut memory.1);
    for at in ["0 0 0", "1 0 0", "0 0 1", "0 1 1", "1 1 1", "1 0 1"] {
        let mut at = at.split(' ').map(|part| Decimal::parse(part).unwrap());
        cube.add_vertex([(); 3].map(|()| at.next().unwrap()), &mut no_undo).unwrap();
    }
    for projection in ["orthographic", "cavalier", "cabinet", "oblique,30,2"] {
        for (crease, is_drawn) in [("60", true), ("90", true), ("91", false)] {
            let mut options = with("projection", projection).unwrap();
            options.set("crease", crease).unwrap();
            let view = View::new(&options.camera(&cube).unwrap(), &cube).unwrap();
            let corners = [0, 1, 2, 3, 4, 5].map(|n| view.vertex(cube.vertices()[n]));
            let [a, b, c, d, e, f] = corners;
            // The front and the top have the edge from c to f in common.
            let faces: [&mut dyn Iterator<Item = Vertex>; 2] =
                [&mut [a, b, f, c].into_iter(), &mut [c, f, e, d].into_iter()];
            let crease = options.visibility(&view).crease.unwrap();
            let found = crease.draws(Projection::Parallel, f, faces, false, &|| false);
            assert_eq!(found, is_drawn, "{projection} {crease:?}");
        }
    }
}
