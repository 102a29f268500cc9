//! Tests of reading G-code.

use crate::tests::{notes, sent};

/// The strokes of a program: for each the points.
fn strokes(program: &str) -> Vec<Vec<[f64; 2]>> {
    let lines = sent("a.gcode", program.as_bytes()).expect("G-code");
    let mut vertices = Vec::new();
    let mut strokes = Vec::new();
    for line in &lines {
        let mut words = line.split(' ');
        let word = words.next();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        match word {
            Some("v") => vertices.push([numbers[0], numbers[1]]),
            Some("l") => {
                strokes.push(numbers.iter().map(|it| vertices[*it as usize - 1]).collect())
            }
            _ => {}
        }
    }
    strokes
}

/// The same two strokes in the dialects of many programs.
#[test]
fn the_pen_is_found_in_every_dialect() {
    let expected =
        vec![vec![[10.0, 10.0], [20.0, 10.0], [20.0, 20.0]], vec![[30.0, 5.0], [40.0, 5.0]]];
    let program = |up: &str, down: &str, travel: &str| {
        format!(
            "G21 G90\n{up}\n{travel} X10 Y10\n{down}\nG1 X20 F900\nG1 Y20\n{up}\n\
             {travel} X30 Y5\n{down}\nG1 X40\n{up}\n{travel} X0 Y0\n"
        )
    };
    for (name, up, down, travel) in [
        ("spindle", "M5", "M3 S1000", "G0"),
        ("spindle and feeds only", "M5", "M3", "G1"),
        ("servo by S", "M3 S30", "M3 S90", "G0"),
        ("servo by S, the other way", "M3 S90", "M3 S30", "G1"),
        ("servo of Marlin", "M280 P0 S10", "M280 P0 S60", "G0"),
        ("MakerBot's servo", "M300 S50", "M300 S30", "G1"),
        ("height", "G0 Z5", "G1 Z0", "G0"),
        ("height by feeds", "G1 Z3", "G1 Z-1", "G1"),
        ("height, the other way", "G0 Z0", "G0 Z2", "G0"),
        ("laser", "M4 S0", "M4 S255", "G1"),
        ("none", "", "", "G0"),
    ] {
        assert_eq!(strokes(&program(up, down, travel)), expected, "{name}");
    }
    // A spindle that runs all the time lifts nothing; the height does.
    let routed = format!("M3 S12000\n{}M5\n", program("G0 Z5", "G1 Z-1", "G0"));
    assert_eq!(strokes(&routed), expected);
}

/// LightBurn switches the laser on once, by M4 or M3, without a power, and travels by G0.
#[test]
fn a_laser_that_stays_on_does_not_draw_its_travels() {
    let expected =
        vec![vec![[10.0, 10.0], [20.0, 10.0], [20.0, 20.0]], vec![[30.0, 5.0], [40.0, 5.0]]];
    for mode in ["M4", "M3"] {
        for end in ["M9\nG1 S0\nM5\nG90\nG0 X0 Y0\nM2\n", "M5\n"] {
            let program = format!(
                "G00 G17 G40 G21 G54\nG90\n{mode}\nM8\nG0 X10Y10\nG1 X20S200F6000\nG1 Y20\n\
                 G0 X30Y5\nG1 X40\n{end}"
            );
            assert_eq!(strokes(&program), expected, "{program}");
        }
    }
    // A program that draws by G0, and so does not feed while the pen is down.
    let rapids = "M5\nG0 X10 Y10\nM3\nG0 X20\nG0 Y20\nM5\nG0 X30 Y5\nM3\nG0 X40\nM5\n";
    assert_eq!(strokes(rapids), expected);
}

/// What programs write draws their figure and nothing else, whatever lifts the pen.
#[test]
fn files_of_many_programs_draw_their_figure() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../host-tests/tests/dialects");
    let read = |name: &str| std::fs::read_to_string(format!("{folder}/{name}")).expect("a file");
    let figure = |downward: bool| -> Vec<Vec<[f64; 2]>> {
        let svg = read("figure.svg");
        let points = |list: &str| {
            let of_point = |point: &str| {
                let (x, y) = point.split_once(',').expect("x,y");
                let [x, y]: [f64; 2] = [x, y].map(|it| it.parse().expect("a number"));
                [x, if downward { y } else { 80.0 - y }]
            };
            list.split(' ').map(of_point).collect()
        };
        svg.split("points=\"").skip(1).filter_map(|it| it.split('"').next()).map(points).collect()
    };
    let mut tried = 0;
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let name = entry.expect("an entry").file_name().into_string().expect("a name");
        if name.ends_with(".rs") || name.ends_with(".svg") {
            continue;
        }
        let downward = ["ninja", "step_motor"].iter().any(|it| name.contains(it));
        let (drawn, expected) = (strokes(&read(&name)), figure(downward));
        assert_eq!(drawn.len(), expected.len(), "{name}: {drawn:?}");
        for (stroke, line) in drawn.iter().zip(&expected) {
            assert_eq!(stroke.len(), line.len(), "{name}: {stroke:?}");
            for (own, other) in stroke.iter().zip(line) {
                let off = (own[0] - other[0]).hypot(own[1] - other[1]);
                assert!(off < 1.0 / 80.0, "{name}: {own:?} is not {other:?}");
            }
        }
        tried += 1;
    }
    assert_eq!(tried, 14);
}

#[test]
fn a_program_may_travel_at_several_heights_and_draw_at_several() {
    let line = vec![vec![[10.0, 10.0], [20.0, 10.0], [20.0, 20.0]], vec![[30.0, 5.0], [40.0, 5.0]]];
    let milled = "G0 Z15\nG0 X10 Y10\nG0 Z5\nG1 Z-1\nG1 X20\nG1 Z-2\nG1 Y20\nG0 Z5\n\
                  G0 X30 Y5\nG1 Z-1\nG1 X40\nG0 Z15\nG0 X0 Y0\n";
    assert_eq!(strokes(milled), line);
    // A laser of two powers, which G0 does not light.
    let laser = "M5\nG0 X10 Y10\nM3 S200\nG1 X20\nG1 Y20 S100\nM5\nG0 X30 Y5\nM3\nG1 X40\nM5\n";
    assert_eq!(strokes(laser), line);
}

#[test]
fn units_modes_offsets_and_comments_are_obeyed() {
    let inches =
        "; by hand\n%\nN10 g20 (inches ; here) g91*71\nG0X1Y1\nG1 X 1 . 5\nG21\nG1Y2\nM2\nG1X9";
    assert_eq!(strokes(inches), [[[25.4, 25.4], [63.5, 25.4], [63.5, 27.4]]]);
    let offset = "G0 X10 Y10\nG92 X0 Y0\nG1 X5\nG92.1\nG1 X0 Y0\n";
    assert_eq!(strokes(offset), [[[10.0, 10.0], [15.0, 10.0], [0.0, 0.0]]]);
}

#[test]
fn arcs_stay_within_their_circle() {
    for (arc, centre) in [
        ("G2 X20 Y10 I5 J0", [15.0, 10.0]),
        ("G3 X20 Y10 R5", [15.0, 10.0]),
        ("G3 X10 Y10 I0 J5", [10.0, 15.0]),
        ("G90.1\nG2 X20 Y10 I15 J10", [15.0, 10.0]),
    ] {
        let strokes = strokes(&format!("G0 X10 Y10\n{arc}\n"));
        let [stroke] = strokes.as_slice() else { panic!("{strokes:?}") };
        assert!(stroke.len() > 10, "{arc}");
        for point in stroke {
            let radius = (point[0] - centre[0]).hypot(point[1] - centre[1]);
            assert!((radius - 5.0).abs() < 0.002, "{arc}: {point:?}");
        }
        let up = stroke.iter().any(|point| point[1] > 10.1);
        assert_eq!(up, arc != "G3 X20 Y10 R5", "{arc} turns the right way");
    }
}

#[test]
fn what_is_not_obeyed_is_counted_and_what_cannot_be_drawn_refused() {
    let said = notes("a.nc", b"G0 X1\nG1 X5\nG64 P0.1\nM117\nG33\nG33\n");
    assert_eq!(
        said,
        [
            "2 words G33 have no meaning for a drawing (the first in line 5)",
            "M117 has no meaning for a drawing (line 4)",
        ]
    );
    for (program, reason) in [
        ("G0 X5\n", "a.nc: there is nothing to draw in this G-code"),
        ("G1 X5\nG2 X9 R1\n", "a.nc:2: there is no such arc"),
        ("G1 X5\nG2 X9 I9\n", "a.nc:2: there is no such arc"),
        ("G1 X1.2.3\n", "a.nc:1: \"X1.2.3\" is no number"),
        ("G1 X1\n#1=5\n", "a.nc:2: \"#\" is no word of G-code"),
        ("G1 X1\n\0\n", "a.nc:2: this is no text"),
        ("G18\nG2 X5 Z5 I1 K1\n", "a.nc:1: arcs in other planes"),
    ] {
        let error = sent("a.nc", program.as_bytes()).expect_err("refused");
        assert!(error.starts_with(reason), "{error}");
    }
    assert!(sent("known by its beginning", b"G21\nG0 X5\nG1 X9\n").is_ok());
}
