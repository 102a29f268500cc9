//! Tests of reading G-code.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

use crate::arrange::Arrangement;
use crate::format::{Body, Contents, Format};
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

/// The pens of the strokes of a program.
fn pens(program: &str) -> Vec<u32> {
    let format = super::GCode;
    let contents = format.read("a.nc".to_owned(), program.into(), &Arrangement::default());
    let Ok(Contents { body: Body::Plan(plan), .. }) = contents else { panic!("no plan") };
    plan.strokes.iter().map(|stroke| stroke.pen).collect()
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
        ("servo of Repetier", "M340 P3 S2350", "M340 P3 S1500", "G0"),
        ("Klipper", "SET_SERVO SERVO=pen ANGLE=30", "set_servo servo=pen angle=90", "G0"),
        ("Klipper by width", "SET_SERVO SERVO=a WIDTH=.001", "SET_SERVO SERVO=a WIDTH=.002", "G1"),
        ("macros of Klipper", "PEN_UP", "PEN_DOWN", "G1"),
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

/// Some pen plotters are told their size by words beside M, among them E.
#[test]
fn a_size_beside_m_is_no_extrusion() {
    let program = "M4 X840 E0.5 S6400 P80\nG21\nG90\nG0 X10 Y10\nM340 P3 S1500\nG1 X20\nG1 Y20\n\
                   M340 P3 S2350\nG0 X30 Y5\nM340 P3 S1500\nG1 X40\nM340 P3 S2350\n";
    let expected =
        vec![vec![[10.0, 10.0], [20.0, 10.0], [20.0, 20.0]], vec![[30.0, 5.0], [40.0, 5.0]]];
    assert_eq!(strokes(program), expected);
    assert!(notes("a.gcode", program.as_bytes()).iter().all(|note| !note.contains("3D printer")));
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

/// What the longer way by G0 would show is wrong of a program that draws by G0.
#[test]
fn a_program_that_draws_by_g0_is_not_inverted() {
    let square = "G0 X50 Y10\nX50 Y50\nX10 Y50\nX10 Y10\n";
    let points = [[10.0, 10.0], [50.0, 10.0], [50.0, 50.0], [10.0, 50.0], [10.0, 10.0]];
    for (up, down) in [("G0 Z5", "G0 Z-1"), ("M280 P0 S30", "M280 P0 S90")] {
        let program = format!("{up}\nG0 X10 Y10\n{down}\n{square}{up}\nG0 X0 Y0\n");
        assert_eq!(strokes(&program), vec![points.to_vec()], "{program}");
    }
    // Of one that draws by both, both count.
    let mixed = "G0 Z5\nG0 X10 Y0\nG1 Z-1\nG1 X50\nG1 Y40\nG0 X90 Y80\nG0 Z5\nG0 X85\n";
    assert_eq!(strokes(mixed), [[[10.0, 0.0], [50.0, 0.0], [50.0, 40.0], [90.0, 80.0]]]);
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
    // The offset is suspended and restored, along each axis and for heights.
    let again = "G0 Z5\nG0 X10 Y10\nG92 X0 Z0\nG1 Z-6\nG1 X5\nG92.2\nG1 X0 Y0\nG92.3\nG1 X1 Y1\n\
                 G0 Z0\nG0 X9\nG92.2\nG1 Z-1\nG1 X1\nG92.1\nG92.3\nG1 X2 Y2\nG0 Z5\n";
    assert_eq!(
        strokes(again),
        [
            vec![[10.0, 10.0], [15.0, 10.0], [0.0, 0.0], [11.0, 1.0]],
            vec![[19.0, 1.0], [1.0, 1.0], [2.0, 2.0]]
        ]
    );
    assert_eq!(notes("a.nc", again.as_bytes()), [""; 0]);
}

#[test]
fn each_tool_draws_with_a_pen() {
    let line = "G0 X0 Y0\nM3\nG1 X9 F900\nM5\n";
    let program = |changes: [&str; 4]| changes.map(|it| format!("{it}\n{line}")).concat();
    for (changes, expected) in [
        // penup itself writes the number of a pen before the pause for it.
        (["(penup 0.1.0)", "(pen 2)\nM0", "(pen 5)\nM0", "(pen 2)\nM0"], [1, 2, 5, 2]),
        (["(pen 3)\nM0", "(pen 0)", "(pen 33)", "T7 M6"], [3, 3, 3, 3]),
        // Of other programs the first tool that draws has the first pen.
        (["T9\nT0", "T4", "", "T0"], [1, 2, 2, 1]),
        (["", "N5 T2", "t0", "T1"], [1, 2, 3, 4]),
        // A tool that is called is put in by M6.
        (["T3\nM6\nT8", "", "M6 T8", "T3 M06 (BLUE)"], [1, 1, 2, 1]),
        (["T5 M0", "T6 M0", "T6 M1", "T5 M0"], [1, 2, 2, 1]),
        // These mean the temperature or the fan of an extruder.
        (["T1", "M104 T0", "M106 T2", "T0 M109"], [1, 1, 1, 1]),
        (["", "", "", "M2\nT5"], [1, 1, 1, 0]),
    ] {
        let expected: Vec<u32> = expected.into_iter().filter(|pen| *pen > 0).collect();
        let program = program(changes);
        assert_eq!(pens(&program), expected, "{program}");
        let said = notes("a.nc", program.as_bytes());
        let is_expected = |it: &String| it.starts_with("M10") || it.contains("behind the end");
        assert!(said.iter().all(is_expected), "{program}{said:?}");
    }
    // A stroke ends where another pen goes on.
    let program = "T1\nG0 X1\nG1 X5\nT2\nG1 X9\n";
    assert_eq!(pens(program), [1, 2]);
    assert_eq!(strokes(program), [[[1.0, 0.0], [5.0, 0.0]], [[5.0, 0.0], [9.0, 0.0]]]);
    let many: String = (1..40).map(|tool| format!("T{tool}\n{line}")).collect();
    assert_eq!(pens(&many)[30..], [31, 32, 32, 32, 32, 32, 32, 32, 32]);
    assert_eq!(
        notes("a.nc", many.as_bytes()),
        ["the program draws with 39 tools, and a plotter has 32 pens: pen 32 draws what the last \
          of them do"]
    );
}

/// So the plotter pauses for them alike, and `--pens` chooses them alike.
#[cfg(feature = "hpgl")]
#[test]
fn pens_are_those_of_the_same_drawing_in_hp_gl() {
    let program = "(pen 2)\nM0\nG0 X10 Y10\nG1 X20\n(pen 4)\nM0\nG0 X0 Y5\nG1 X7\n";
    let plot = b"IN;SP2;PU400,400;PD800,400;SP4;PU0,200;PD280,200;PU;SP0;";
    assert_eq!(sent("a.nc", program.as_bytes()), sent("a.plt", plot));
    assert!(sent("a.nc", program.as_bytes()).is_ok());
}

#[test]
fn a_pause_between_strokes_is_told() {
    let line = "G0 X0 Y0\nG1 X9\n";
    let told = |count: &str| {
        format!(
            "{count} not followed (from line 4 on): if the pen is changed there, draw the parts of \
             the program as files of their own"
        )
    };
    for pause in ["M0", "M00 (blue)", "M1 Blue, please", "G4 P1 M0", "M6"] {
        let program = format!("{pause}\n{line}{pause}\n{line}{pause}\n{line}{pause}\nM2\n");
        assert_eq!(notes("a.nc", program.as_bytes()), [told("2 pauses are")], "{pause}");
        let program = format!("T3 M6\n{line}{pause}\n{line}{pause}\n");
        let expected = if pause == "M6" { vec![] } else { vec![told("1 pause is")] };
        assert_eq!(notes("a.nc", program.as_bytes()), expected, "{pause}");
    }
}

/// An L, drawn as a part of a program is.
const PART: &str = "G0 X0 Y0\nG1 Y20\nG0 X0 Y0\nG1 X10\n";

/// The strokes of an L at so much further right and up.
fn part(x: f64, y: f64) -> [Vec<[f64; 2]>; 2] {
    [vec![[x, y], [x, y + 20.0]], vec![[x, y], [x + 10.0, y]]]
}

#[test]
fn systems_of_coordinates_lie_where_the_program_sets_them() {
    let (own, other) = (part(0.0, 0.0), part(50.0, -5.0));
    let both = [own.clone(), other].concat();
    let set = "G10 L2 P1 X-300 Y-200\nG10 L2 P2 X-250 Y-205\n";
    for program in [
        format!("{set}{PART}G55\n{PART}G54\nG0 X0 Y0\n"),
        // The system at the beginning is that of the drawing, whichever it is.
        format!("G55\nG10 L2 P0 X-300 Y-200\nG10 L2 P9 X-250 Y-205\n{PART}G59.3\n{PART}"),
        format!("G54\n{set}G10 L2 P1 X-200 Y-210\nG55\n{PART}G10 L2 P2 X-200 Y-210\n{PART}"),
        format!("{PART}G0 X0 Y0\nG10 L20 P2 X-50 Y5\nG55\n{PART}"),
        format!("G20\nG10 L2 P1 X0 Y0\nG21\nG10 L2 P2 X50 Y-5\nG92 X0 Y0\n{PART}G55\n{PART}"),
        // What the pen is told of where it is makes its place known again.
        format!("{PART}G55\nG10 L20 P2 X-40 Y5\n{PART}"),
        format!("{PART}G55\nG92 X-40 Y5\n{PART}"),
    ] {
        assert_eq!(strokes(&program), both, "{program}");
        assert_eq!(notes("a.nc", program.as_bytes()), [""; 0], "{program}");
    }
    // A system before the first move, and one that is chosen again, change nothing.
    for program in [
        format!("G52 X0 Y0\nG54\nG55\n{PART}G55\nG54\nG55\n{PART}G54\nM30\n"),
        format!("G10 L20 P2 X7 Y7\n{PART}G54\n{PART}G59.1\nG91\nG54\nG90\n"),
        format!("{PART}G55\nG92 X3\nG54\nG92.1\n{PART}"),
    ] {
        assert_eq!(strokes(&program), [own.clone(), own.clone()].concat(), "{program}");
    }
    let arc = "G90.1\nG10 L2 P1 X0 Y0\nG10 L2 P2 X10 Y0\nG0 X20 Y10\nG55\nG2 X20 Y10 I15 J10\n";
    let drawn = strokes(arc).concat();
    assert!(drawn.iter().all(|[x, y]| ((x - 25.0).hypot(y - 10.0) - 5.0).abs() < 0.002));
}

#[test]
fn a_move_in_coordinates_without_a_known_place_is_refused() {
    for (before, line, by) in [
        ("G55\n", 6, "G55 in line 5 chose coordinates"),
        ("G59.1\n", 6, "G59.1 in line 5"),
        ("G10 L2 P2 X9 Y9\nG55\n", 7, "G55 in line 6"),
        ("G10 L2 P1 X9\n", 6, "G10 L2 in line 5"),
        ("G55\nG92 X0 Y0\nG54\n", 8, "G54 in line 7"),
        ("G53 G0 X0 Y0\nG92 X0 Y0\n", 7, "G92 in line 6"),
    ] {
        let error = sent("a.nc", format!("{PART}{before}{PART}").as_bytes()).expect_err("refused");
        assert!(error.starts_with(&format!("a.nc:{line}: {by}")), "{error}");
    }
    for (line, expected) in [
        ("G10 L2 P1 R30", "R turns the coordinates"),
        ("G54.1 P3", "G54.1 changes where the pen goes"),
        ("G52 X0 Y5", "G52 changes where the pen goes"),
    ] {
        let error = sent("a.nc", format!("{line}\n{PART}").as_bytes()).expect_err("refused");
        assert!(error.starts_with(&format!("a.nc:1: {expected}")), "{error}");
    }
    // Tools are no systems, nor are there more than nine; a printer draws its thread back.
    let tools = format!("G10 L1 P1 R3\nG10 L20 P11 X5\nG10\nG11\n{PART}");
    assert_eq!(
        notes("a.nc", tools.as_bytes()),
        [
            "G10 L1 has no meaning for a drawing (line 1)",
            "G10 L20 has no meaning for a drawing (line 2)",
        ]
    );
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
        ("G1 X5\nG1 Xabc\n", "a.nc:2: \"X\" has no number"),
        ("G1 X5\nX Y3\n", "a.nc:2: \"X\" has no number"),
        ("G1 X5\nG X3\n", "a.nc:2: \"G\" has no number"),
        ("G28 X\nG1 X5\nG2 X3 I\n", "a.nc:3: \"I\" has no number"),
        ("G1 X1\n#1=5\n", "a.nc:2: \"#\" is no word of G-code"),
        ("G1 X1\n\0\n", "a.nc:2: this is no text"),
        ("G18\nG2 X5 Z5 I1 K1\n", "a.nc:1: arcs in other planes"),
    ] {
        let error = sent("a.nc", program.as_bytes()).expect_err("refused");
        assert!(error.starts_with(reason), "{error}");
    }
    assert!(sent("known by its beginning", b"G21\nG0 X5\nG1 X9\n").is_ok());
}

/// C, Python and Java write small numbers as `1.2e-05`. Slicers put a space before E.
#[test]
fn an_exponent_belongs_to_its_number() {
    let line = [[[0.0, 0.0], [0.0, 10.0], [25.0, 10.0]]];
    for last in ["X2.5e+01 Y1.0E+1", "X250E-1Y10", "X 2 . 5e+1 Y10", "x2.5e+001 y10"] {
        assert_eq!(strokes(&format!("G0 X1.2e-05 Y-1e-7\nG1 X1.2e-05 Y10\n{last}\n")), line);
    }
    // The words E of a printer: of these moves the first alone extrudes.
    for other in ["X30 E-4", "X30 e -4", "X30E-0.4", "X30E0", "X30E -4", "X30E-1234"] {
        let program = format!("M83\nG92E-1\nG0 X10\nG1 X20 E1\nG1 {other}\nG1E-2\n");
        assert_eq!(strokes(&program), [[[10.0, 0.0], [20.0, 0.0]]], "{other}");
    }
    let error = sent("a.nc", b"G1 X5\nX1e+999\n").expect_err("refused");
    assert!(error.starts_with("a.nc:2: \"X1e+999\" is no number"), "{error}");
}

/// A square of two layers and a move without ink, as PrusaSlicer (M83) and Cura (M82) write it.
#[test]
fn of_a_program_for_a_3d_printer_only_what_it_extrudes_is_drawn() {
    let square = vec![[10.0, 10.0], [20.0, 10.0], [20.0, 20.0]];
    let line = vec![[30.0, 5.0], [40.0, 5.0]];
    let relative = "M104 S210\nM862.3 P \"MK3S\" ; check\nM117 Layer 1 of 2: 50%\n\
                    PRINT_START BED=60 NAME=a_b\nG28 W\nG21\nG90\nM83\nG92 E0.0\nG1 E5 F1000\n\
                    G1 Z0.2\nG1 X10 Y10 F9000\nG1 X20 E.5\nG1 Y20 E0.5\nG1 X15 E-.4\nG1 E-2\n\
                    G1 Z.4\nG1 X30 Y5\nG1 E2\nG1 X40 E.5\nG1 X0 Y0\nM84\n";
    assert_eq!(strokes(relative), [square.clone(), line.clone()]);
    let absolute = "M82\nG92 E0\nG0 Z0.2\nG0 X10 Y10\nG1 X20 E1\nG1 Y20 E2\nG1 X15 E1.5\n\
                    G1 E-4\nG92 E0\nG0 Z.4\nG1 X30 Y5 E0\nG1 X40 E.5\nG1 X0 Y0 E0.5\n";
    assert_eq!(strokes(absolute), [square, line]);
    // G91 makes the extruder relative, too, until G90.
    let both = "M82\nG0 X10 Y10\nG91\nG1 X5 E1\nG1 X5 E1\nG1 X5 E-1\nG90\nG1 X50 Y50 E1\n";
    assert_eq!(strokes(both), [[[10.0, 10.0], [15.0, 10.0], [20.0, 10.0]]]);
    // An extruder that only ever turns on the spot lifts nothing.
    assert_eq!(strokes("G1 E5\nG0 X5\nG1 X9\n"), [[[5.0, 0.0], [9.0, 0.0]]]);
    assert_eq!(
        notes("a.gcode", absolute.as_bytes()),
        ["the program is for a 3D printer: only what it extrudes is drawn, 4 moves are not, \
             and its layers at 2 heights lie one upon the other",]
    );
}

#[test]
fn a_move_in_the_coordinates_of_the_machine_is_not_drawn() {
    let line = [[[10.0, 10.0], [20.0, 10.0]]];
    // To the stop of the z axis and to a corner of the machine, as milling programs end.
    let milled = "G53 G0 Z0\nG0 X10 Y10\nG1 Z-1\nG1 X20\nG53 G0 Z0\nG53 G0 X0 Y0\nM30\n";
    assert_eq!(strokes(milled), line);
    let lifted = "G0 Z5\nG0 X10 Y10\nG1 Z-1\nG1 X20\nG53 G1 Z0\nG1 X30\nG53 G1 X-1 Y-1\nM30\n";
    assert_eq!(strokes(lifted), line);
    assert_eq!(
        notes("a.nc", milled.as_bytes()),
        ["1 move goes to a place of the machine (G53 in line 6), which is not known here, and is \
             not drawn",]
    );
    for (program, expected) in [
        // A place of the machine is where the ink would begin.
        ("G0 X1\nG1 X5\nG53 G0 X0 Y0\nG1 X9 Y9\n", "a.nc:4: the pen would draw from a place of"),
        ("G0 X1\nG1 X5\nG53 G0 X0 Y0\nG0 X9\nG1 Y9\n", "a.nc:5: the pen would draw from a"),
        ("G1 X5\nG53 G2 X9 Y9 R9\n", "a.nc:2: G53 is for G0 and G1"),
    ] {
        let error = sent("a.nc", program.as_bytes()).expect_err("refused");
        assert!(error.starts_with(expected), "{error}");
    }
    let known_again = "G0 X1\nG1 X5\nG53 G0 X0 Y0\nG0 X9 Y0\nG1 Y9\n";
    assert_eq!(strokes(known_again), [[[1.0, 0.0], [5.0, 0.0]], [[9.0, 0.0], [9.0, 9.0]]]);
}

/// Printers home before they begin, and mills in the middle, to have room for a new tool.
#[test]
fn home_is_a_place_of_the_machine_after_the_first_move() {
    let first = vec![[10.0, 10.0], [20.0, 10.0]];
    for (home, after, second) in [
        ("G28", "G0 X30 Y5\nG1 X40", [[30.0, 5.0], [40.0, 5.0]]),
        ("G91 G28 Z0\nG90", "G0 X30 Y5\nG1 X40", [[30.0, 5.0], [40.0, 5.0]]),
        ("G28 X", "G0 X30\nG1 Y9", [[30.0, 10.0], [30.0, 9.0]]),
        ("G30 Y0", "G0 Y5\nG1 X40", [[20.0, 5.0], [40.0, 5.0]]),
    ] {
        let program = format!("G28\nG0 X10 Y10\nG1 X20\n{home}\n{after}\nG28\n");
        assert_eq!(strokes(&program), [first.clone(), second.to_vec()], "{program}");
        assert_eq!(notes("a.nc", program.as_bytes()), [""; 0], "{program}");
    }
    for (home, after) in [("G28", "G91\nG1 X5"), ("G30 X0", "G0 Y9\nG1 X9"), ("G28 Y", "G1 X9")] {
        let program = format!("G0 X10 Y10\nG1 X20\n{home}\n{after}\n");
        let error = sent("a.nc", program.as_bytes()).expect_err("refused");
        assert!(
            error.contains("would draw from a place of the machine (line 3), which"),
            "{error}"
        );
    }
    // It lifts the pen as well.
    let lifted = "G0 Z5\nG0 X10 Y10\nG1 Z-1\nG1 X20\nG91 G28 Z0\nG90\nG1 X30\nG1 Z-1\nG1 X40\n";
    assert_eq!(strokes(lifted), [first, vec![[30.0, 10.0], [40.0, 10.0]]]);
}

/// The lines are engraved with little power, and the outline is cut with more.
#[test]
fn a_laser_with_two_powers_draws_with_both() {
    for on in ["M4", "M3", "M3 S0"] {
        let program =
            format!("G21 G90\n{on}\nG0 X10 Y10\nG1 X30 S200 F1000\nG0 X40 Y10\nG1 X60 S500\nM5\n");
        let [first, second] = [[[10.0, 10.0], [30.0, 10.0]], [[40.0, 10.0], [60.0, 10.0]]];
        assert_eq!(strokes(&program), [first, second], "{program}");
    }
}

/// Z sets the focus of a laser, or a height for the way, and the laser or the servo draws.
#[test]
fn a_height_does_not_draw_while_the_laser_is_off() {
    for (on, off) in [("M3 S500", "M5"), ("M3", "M5"), ("S500", "S0")] {
        let program = format!(
            "G21 G90\nM3 {off}\nG0 Z10\nG0 X0 Y0\nG0 Z0\nG0 X10 Y10\n{on}\nG1 X20 F600\n{off}\n\
             G0 X40\n{on}\nG1 X50\n{off}\nG0 Z10\nG0 X0 Y0\nM30\n"
        );
        let program = program.replace("M3 M5", "M5");
        let [first, second] = [[[10.0, 10.0], [20.0, 10.0]], [[40.0, 10.0], [50.0, 10.0]]];
        assert_eq!(strokes(&program), [first, second], "{program}");
    }
    // A mill whose spindle stands still while the tool is changed, and that travels by G1.
    let mill = "G0 Z5\nM3 S9000\nG1 X10 Y10\nG1 Z-1\nG1 X20\nG1 Z5\nM5\nM6 T2\nM3\nG1 X40\n\
                G1 Z-1\nG1 X50\nG0 Z5\nM5\nG0 X0 Y0\n";
    assert_eq!(strokes(mill).len(), 2);
}

/// Two drawings that were joined, each of which begins at home.
#[test]
fn home_is_known_again_where_coordinates_were_set_there() {
    let drawing = [[10.0, 10.0], [20.0, 10.0]];
    let part = "G28\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n";
    let shifted = "G28\nG92 X-30 Y5\nG0 X-20 Y15\nG1 X-10\n";
    let along_x = "G28 X\nG92 X0\nG0 X10\nG1 X20\n";
    let by_g10 = "G28\nG10 L20 P0 X0 Y0\nG0 X10 Y10\nG1 X20\n";
    for again in [part, shifted, along_x, by_g10] {
        assert_eq!(strokes(&format!("{part}{again}")), [drawing, drawing], "{again}");
        assert_eq!(strokes(&format!("{by_g10}{again}")), [drawing, drawing], "{again}");
    }
    // The pen draws from nowhere but a place that a move has reached.
    let error = sent("a.nc", format!("{part}G28\nG92 X0 Y0\nG1 X5\n").as_bytes());
    let error = error.expect_err("refused").to_string();
    assert!(error.contains("would draw from a place of the machine"), "{error}");
    // It is not known where coordinates were set elsewhere, or the second time.
    for (begin, again) in [
        ("G28\nG0 X10 Y10\nG1 X20\n", part),
        ("G92 X0 Y0\nG0 X10 Y10\nG1 X20\n", part),
        ("G30\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n", part),
        ("G28\nG53 G0 X5 Y5\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n", part),
        (part, "G30\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n"),
        (part, "G28\nG53 G0 X5 Y5\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n"),
        (part, "G28\nG91\nG0 X5 Y5\nG90\nG92 X0 Y0\nG0 X10 Y10\nG1 X20\n"),
    ] {
        let error = sent("a.nc", format!("{begin}{again}").as_bytes()).expect_err("refused");
        assert!(error.to_string().contains("G92 in line "), "{begin}{again}{error}");
    }
}

#[test]
fn a_distance_from_a_height_of_the_machine_is_no_height() {
    let begin = "G0 Z5\nG0 X10 Y10\nG1 Z-1\nG1 X20\n";
    let line = [[[10.0, 10.0], [20.0, 10.0]]];
    for (end, expected) in [
        ("G53 G0 Z0\nG91\nG0 X5\nG1 Z-6\nG1 X5\n", "a.nc:9: the Z of line 8 is a distance"),
        ("G91 G28 Z0\nG1 Z-6\nG1 Z-1\nG2 X5 I2.5\n", "a.nc:8: the Z of line 6 is a distance"),
    ] {
        let program = format!("{begin}{end}");
        let error = sent("a.nc", program.as_bytes()).expect_err("no height").to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    // Neither travels nor a height of the drawing, whatever comes before it.
    let travels = format!("{begin}G53 G0 Z0\nG91\nG1 Z-1\nG0 X5\nG90\n");
    assert_eq!(strokes(&travels), line);
    assert_eq!(strokes(&format!("{travels}G1 Z5\nG1 X0\n")), line);
    assert_eq!(strokes(&format!("{travels}G0 X40\nG1 Z-1\nG1 X50\n")).len(), 2);
}

#[test]
fn a_temperature_or_a_time_is_no_power() {
    // The servo of a spindle's pin goes up and down by the power.
    let program = |between: &str| {
        format!(
            "M3 S90\n{between}G1 X10 Y10\nS30\nG1 X20\nS90\nG1 X30\nS30\n{between}G1 X40\nS90\n\
             G1 X0 Y0\n"
        )
    };
    let drawn = strokes(&program(""));
    assert_eq!(drawn.len(), 2);
    for between in ["M104 S200\n", "M106 S255\n", "G4 S2\n", "S200 M104\n"] {
        assert_eq!(strokes(&program(between)), drawn, "{between}");
    }
}

#[test]
fn what_changes_where_the_pen_goes_is_refused_and_never_left_out() {
    for (line, expected) in [
        ("M98 P1000", "M98 calls a subprogram, which is not followed"),
        ("M98 P\"prime.g\"", "M98 calls a subprogram"),
        ("M97 P30", "M97 calls a subprogram"),
        ("G65 P9810 X5", "G65 calls a subprogram"),
        ("o100 call [5]", "O100 CALL is a subprogram, a loop or a condition"),
        ("O<square> sub", "O<SQUARE> SUB is a subprogram"),
        ("o101 repeat [5]", "O101 REPEAT"),
        ("G5 X5 Y5 I1 J1 P1 Q1", "G5 changes where the pen goes"),
        ("G68 X0 Y0 R45", "G68 changes where the pen goes"),
        ("G51 X0 Y0 P2", "G51 changes where the pen goes"),
        ("G16", "G16 changes where the pen goes"),
    ] {
        let error = sent("a.nc", format!("G1 X5\n{line}\nG1 X9\n").as_bytes());
        let error = error.expect_err("refused");
        assert!(error.starts_with(&format!("a.nc:2: {expected}")), "{error}");
    }
    // The number of a program is no call.
    assert_eq!(strokes("%\nO1000 (PART)\nG0 X1\nG1 X5\nM30\n"), [[[1.0, 0.0], [5.0, 0.0]]]);
    assert_eq!(notes("a.nc", b"O1000\nG0 X1\nG1 X5\nM30\n"), [""; 0]);
}

/// The X and Y of a setting are no coordinates, and a hole is no line.
#[test]
fn what_only_looks_like_a_move_is_none() {
    let line = [[[1.0, 0.0], [5.0, 0.0]]];
    assert_eq!(strokes("G0 X1\nG1 X5\nM201 X1000 Y1000 E5000\nM92 X80 Y80\nG29 X9 Y9\n"), line);
    assert_eq!(strokes("G0 X1\nG1 X5\nM0 Put the pen in X and Y\nM117 X is Y\n"), line);
    // The coordinates of a move in force may stand beside words without a meaning for a plan.
    let beside = "G0 X1\nG1 X2\nX3 M64 P1\nG95 X4\nG97 X5\n";
    assert_eq!(strokes(beside), [[[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0], [5.0, 0.0]]]);
    let drilled = "G43 H1 Z5\nG0 X1\nG1 Z-1\nG1 X5\nG0 Z5\nG81 X7 Y7 Z-3 R1\nX9\nG80\n\
                   G0 X0 Y0\n";
    assert_eq!(strokes(drilled), line);
    assert_eq!(notes("a.nc", drilled.as_bytes()), ["G81 has no meaning for a drawing (line 6)"]);
}

#[test]
fn what_is_left_out_or_drawn_by_choice_is_told() {
    let line = "G0 X0 Y0\nM3\nG1 X9\nM5\n";
    let said = |program: &str| notes("a.nc", program.as_bytes()).join("; ");
    for end in ["", "M2\n", "M30\n%\n\n(end)\n; of all\n"] {
        assert_eq!(said(&format!("{line}{end}")), "", "{end}");
    }
    let behind = "5 lines are not drawn, behind the end of the program (M2 or M30 in line 5)";
    assert_eq!(said(&format!("{line}M2\n%\n{line}M30\n")), behind);
    let behind = "4 lines are not drawn, behind the end of the program (the second % in line 6)";
    assert_eq!(said(&format!("%\n{line}%\n{line}%\n")), behind);
    assert_eq!(strokes(&format!("%\n{line}%\nG1 X50\n")), [[[0.0, 0.0], [9.0, 0.0]]]);
    // As the plotter itself reads them.
    let choice = "G0 X10 Y10\nM3\nG1 X20\n/G1 Y20\n/ / G1 X10\nG1 Y10\nM5\n";
    assert_eq!(strokes(choice), [[[10., 10.], [20., 10.], [20., 20.], [10., 20.], [10., 10.]]]);
    assert_eq!(
        said(choice),
        "2 lines begin with / and are drawn, as Grbl draws them (the first is line 4)"
    );
    assert_eq!(
        said(&format!("$100=80\n{line}/M5\n")),
        "line 6 begins with / and is drawn, as \
        Grbl draws it"
    );
    for command in ["$J", "$H"] {
        let told = said(&format!("{}=G91 X5\n{line}", command.to_lowercase()));
        assert_eq!(told, format!("{command} has no meaning for a drawing (line 1)"));
    }
    strokes(&format!("{}G0 X0\n{line}", "/".repeat(1_000_000)));
}

/// The program of a laser or plotter that moves by G1 alone, of one stroke or two.
fn by_feeds(up: &str, down: &str, strokes: usize, end: &str) -> String {
    let stroke = ["X10 Y10", "X20", "X30 Y5", "X40"].map(|to| format!("G1 {to} F3000\n"));
    let strokes = stroke.chunks(2).take(strokes);
    let drawn: String = strokes.map(|it| format!("{}{down}\n{}{up}\n", it[0], it[1])).collect();
    format!("{drawn}{end}")
}

/// On the iDraw 2.0, Z5 is down, and there is no G0.
#[test]
fn the_pen_is_up_where_the_program_begins_and_ends() {
    let line = [[[10.0, 10.0], [20.0, 10.0]], [[30.0, 5.0], [40.0, 5.0]]];
    for (up, down) in [
        ("G1G90 Z0.5F5000", "G1G90 Z5.0F5000"),
        ("G1 Z3", "G1 Z-1"),
        ("G91 G1 Z-4 F900\nG90", "G91 G1 Z4.5 F900\nG90"),
        ("M280 P0 S10", "M280 P0 S60"),
        ("M280 P0 S60", "M280 P0 S10"),
        ("M3 S0", "M3 S255"),
        ("M4 S30", "M4 S90"),
        ("M3 S90", "M3 S30"),
    ] {
        for count in [1, 2] {
            let begun = format!("G21\n{up}\n");
            for (begin, end) in [
                (&*begun, "G1 X0 Y0\n"),
                (&*begun, ""),
                (&*begun, "G1 X90 Y99\nM5\n"),
                ("G21\n", "G1 X0 Y0\n"),
            ] {
                let program = format!("{begin}{}", by_feeds(up, down, count, end));
                assert_eq!(strokes(&program), line[..count], "{program}");
                assert_eq!(notes("a.nc", program.as_bytes()), [""; 0], "{program}");
            }
        }
    }
}

/// Neither the beginning nor the end shows which level is up, or they do not agree.
#[test]
fn where_the_pen_is_taken_to_be_up_is_told() {
    let said = |name: &str, side: &str, other: &str| {
        format!(
            "the program does not show at which {name} the pen is up, which is taken to be the \
             {side}: if it is the {other}, let the program begin and end with the pen up"
        )
    };
    for (up, down, note) in [
        ("G1 Z5", "G1 Z0", said("Z", "higher", "lower")),
        ("M280 P0 S10", "M280 P0 S60", said("level of the servo", "lower", "higher")),
        ("M3 S90", "M3 S30", said("S", "higher", "lower")),
    ] {
        let program = format!("{up}\nG1 X10 Y10\n{down}\nG1 X20\n");
        assert_eq!(strokes(&program), [[[10.0, 10.0], [20.0, 10.0]]], "{program}");
        assert_eq!(notes("a.nc", program.as_bytes()), [note], "{program}");
    }
    let inverted = "G1 Z0\nG1 X10 Y10\nG1 Z5\nG1 X20\n";
    assert_eq!(strokes(inverted), [[[0.0, 0.0], [10.0, 10.0]]]);
    assert_eq!(notes("a.nc", inverted.as_bytes()), [said("Z", "higher", "lower")]);
    assert_eq!(strokes(&format!("{inverted}G1 Z0\n")), [[[10.0, 10.0], [20.0, 10.0]]]);
}

/// The profile `ninja` of vpype-gcode draws at Z6, and goes home at Z0, by G1.
#[test]
fn the_way_home_is_not_drawn_however_small_the_drawing() {
    for strokes_of in [1, 2] {
        let line = [[[150.0, 150.0], [151.0, 150.0]], [[152.0, 150.0], [152.0, 151.0]]];
        let mut program = "G21\nG17\nG90\nG28\n".to_owned();
        for [[x, y], [to_x, to_y]] in &line[..strokes_of] {
            program += &format!(
                "G1 Z3 F10000\nG0 X{x} Y{y} F15000\nG1 Z6 F6000\nG1 X{to_x} Y{to_y} F10000\n"
            );
        }
        program += "\nG1 Z0 F1000\nG1 X0 Y0 F1000\nM2\n";
        assert_eq!(strokes(&program), line[..strokes_of], "{program}");
    }
}

/// Z is the focus, and the power 0 is the way, by G1.
#[test]
fn a_laser_that_travels_by_g1_draws_with_power_alone() {
    let line = [[[10.0, 10.0], [20.0, 10.0]], [[30.0, 5.0], [40.0, 5.0]]];
    for (up, down) in [("M3 S0", "M3 S255"), ("S0", "S255"), ("M5", "M4 S9")] {
        for begin in ["M3 S0", "M3 S0\nG0 Z10\nG0 X1 Y1\nG0 Z0", "M5\nG1 Z10\nG1 X1 Y1\nG1 Z0"] {
            for count in [1, 2] {
                for end in ["M5\n", "G1 X0 Y0\nM5\n", "G1 Z10\nG1 X0 Y0\nM5\n"] {
                    let program = by_feeds(up, down, count, end);
                    let program = format!("{begin}\nM3 S0\n{program}");
                    assert_eq!(strokes(&program), line[..count], "{program}");
                }
            }
        }
    }
    // The first stroke begins where the laser stands.
    let here = "M3 S255\nG1 X10\nM3 S0\nG1 X0\nM5\n";
    assert_eq!(strokes(here), [[[0.0, 0.0], [10.0, 0.0]]]);
}

/// Lasers and pens on the pin of the fan, as of Marlin, or on that of the coolant, as of Grbl.
#[test]
fn a_fan_or_coolant_lifts_the_pen_where_nothing_else_does() {
    let line = [[[10.0, 10.0], [20.0, 10.0]], [[30.0, 5.0], [40.0, 5.0]]];
    for (up, down, name) in [
        ("M107", "M106 S255", "M106 and M107"),
        ("M106 S0", "M106", "M106 and M107"),
        ("M9", "M8", "M7 to M9"),
        ("M09", "M7", "M7 to M9"),
    ] {
        let program = format!("G21\n{up}\n{}", by_feeds(up, down, 2, "G1 X0 Y0\n"));
        assert_eq!(strokes(&program), line, "{program}");
        let note = format!("{name} are taken to lift the pen, because nothing else does");
        assert_eq!(notes("a.nc", program.as_bytes()), [note]);
        // With G0 for the ways there is nothing to say.
        let rapid = program.replace("G1 X10 Y10", "G0 X10 Y10").replace("G1 X30", "G0 X30");
        let rapid = rapid.replace("G1 X0", "G0 X0");
        assert_eq!(strokes(&rapid), line, "{rapid}");
        assert_eq!(notes("a.nc", rapid.as_bytes()), [""; 0], "{rapid}");
    }
    // A program without G1.
    let rapids = "M9\nG0 X10 Y10\nM8\nG0 X20\nM9\nG0 X30 Y5\nM8\nG0 X40\nM9\nG0 X0 Y0\n";
    assert_eq!(strokes(rapids), line);
}

/// On mills, printers and most lasers they are what their names say.
#[test]
fn a_fan_or_coolant_lifts_no_pen_where_something_else_does() {
    let line = [[[10.0, 10.0], [20.0, 10.0]], [[30.0, 5.0], [40.0, 5.0]]];
    for (on, off) in [("M8", "M9"), ("M106 S99", "M107")] {
        for (up, down) in [("G1 Z5", "G1 Z-1"), ("M5", "M3 S9"), ("M280 P0 S1", "M280 P0 S9")] {
            let end = "G1 X0 Y0\n";
            let program = format!("{up}\n{}", by_feeds(up, down, 2, end));
            let cooled = program.replace("G1 X20", &format!("{off}\nG1 X20"));
            let cooled = format!("{on}\n{}{on}\nG1 X1\n{off}\n", cooled);
            assert_eq!(strokes(&cooled), line, "{cooled}");
            assert_eq!(notes("a.nc", cooled.as_bytes()), [""; 0], "{cooled}");
        }
        // It is on all the time, or during G0.
        let begin = format!("{on}\nG0 X10 Y10\nG1 X20\nG0 X30 Y5\n");
        assert_eq!(strokes(&format!("{begin}G1 X40\n{off}\n")), line);
        let program = format!("{begin}{off}\nG1 X40\n{on}\n");
        assert_eq!(strokes(&program), line);
        let [said] = &notes("a.nc", program.as_bytes())[..] else { panic!("{program}") };
        assert!(said.contains("are not obeyed: the program moves by G0 while"), "{said}");
    }
}

/// Grbl refuses such a line, too: in which order its words would act is not said.
#[test]
fn a_word_that_is_twice_in_a_line_is_refused() {
    for (line, reason) in [
        ("G1 X10 Y0 G1 X10 Y10", "two motions (G0 to G3) are"),
        ("G1 X10 Y0 X10 Y10", "X is more than once"),
        ("X5 X6", "X is more than once"),
        ("G1 X5 F100 F200", "F is more than once"),
        ("M3 S10 G1 X5 S20", "S is more than once"),
        ("G1 X10 G1 Y10", "two motions (G0 to G3) are"),
        ("G0 X10 G1 Y10", "two motions (G0 to G3) are"),
    ] {
        let error = sent("a.nc", format!("G1 X1\n{line}\n").as_bytes()).expect_err(line);
        assert!(
            error.starts_with(&format!("a.nc:2: {reason} in the line, which Grbl refuses")),
            "{error}"
        );
    }
    // Codes of several groups may stand in a line, and settings may repeat a letter.
    assert_eq!(strokes("G90 G21 G17\nM92 X80 X80\nG0 X1 M5 M9\nG1 X5\n").len(), 1);
}

#[test]
fn a_line_may_end_with_a_carriage_return_alone() {
    let unix = "(a; b)\nG21\nG90 ; c\nM3\nG1 X10\nG1 Y20\nM5\nG1 X9\n";
    for end in ["\r", "\r\n"] {
        assert_eq!(strokes(&unix.replace('\n', end)), strokes(unix), "{end:?}");
    }
    assert_eq!(strokes(unix).len(), 1);
    assert!(sent("known by its beginning", b"G21\rG0 X5\rG1 X9\r").is_ok());
    let error = sent("a.nc", b"G21\rG1 X5\r\nG1 Xabc\r").expect_err("refused");
    assert!(error.starts_with("a.nc:3: \"X\" has no number"), "{error}");
}

/// Some plotters lift their pen while the spindle is on. The module's own note says so.
#[test]
fn a_spindle_may_lift_the_pen_and_that_is_told() {
    let line = [[[10.0, 10.0], [20.0, 10.0]], [[30.0, 10.0], [40.0, 10.0]]];
    let note = "the pen is taken to be down while the spindle is off (M5 or S0), because the \
                program travels while it is on: if it is down while it is on, let the program \
                draw by G1 and travel by G0, or begin and end with M5";
    let program = |up: &str, down: &str, travel: &str, end: &str| {
        format!(
            "{up}\nG21\nG90\n{travel} X10 Y10\n{down}\nG1 X20 Y10 F1000\n{up}\n{travel} X30 \
             Y10\n{down}\nG1 X40\n{up}\n{travel} X0 Y0\n{end}"
        )
    };
    for (up, down) in
        [("M03 S80", "M05 S0"), ("M3", "M5"), ("M3 S1000", "M3 S0"), ("M3 S90", "S0"), ("M4", "M5")]
    {
        for (travel, end) in [("G0", ""), ("G0", "M5\n"), ("G0", "M5\nG0 X9 Y9\n"), ("G1", "")] {
            let program = program(up, down, travel, end);
            assert_eq!(strokes(&program), line, "{program}");
            assert_eq!(notes("a.nc", program.as_bytes()), [note], "{program}");
        }
        // By G1, the way home is no sign.
        let home = program(up, down, "G0", "").replace("G0 X0", "G1 X0");
        assert_eq!(strokes(&home), line, "{home}");
        // The other way round, as a laser.
        for (travel, end) in [("G0", ""), ("G1", ""), ("G1", "M5\n"), ("G0", "M5\nG0 X9 Y9\n")] {
            let laser = program(down, up, travel, end);
            assert_eq!(strokes(&laser), line, "{laser}");
            assert_eq!(notes("a.nc", laser.as_bytes()), [""; 0], "{laser}");
        }
    }
    // A laser that is not switched off at the end, or that burns with several powers.
    let raster = "M4\nG1 X10 S100 F900\nX20 S0\nX30 S200\n";
    assert_eq!(strokes(raster).len(), 2);
    assert_eq!(strokes(raster)[0][0], [0.0, 0.0]);
    // A program that draws by G0, and travels by both.
    let rapids = "M5\nG0 X10 Y10\nM3\nG0 X20\nM5\nG1 X0 Y0\n";
    assert_eq!(strokes(rapids), [[[10.0, 10.0], [20.0, 10.0]]]);
    assert_eq!(
        notes("a.nc", rapids.as_bytes()),
        ["the pen is taken to be down while the spindle is on, although the program moves by G0 \
          then, and by G1 to G3 while it is off"]
    );
}

/// As `PD;PU;` of HP-GL does.
#[test]
fn where_the_pen_is_put_down_without_a_move_is_a_dot() {
    let dot = |x: f64, y: f64| vec![[x, y], [x + 0.08, y]];
    let line = vec![[10.0, 10.0], [20.0, 10.0]];
    for (up, down) in [
        ("G0 Z5", "G1 Z-1"),
        ("G0 Z5", "G0 Z1\nG1 Z-1\nG4 P1\nG0 Z1"),
        ("M5", "M3 S1000"),
        ("M5", "M3"),
        ("M5", "M4\nG4 P0.1\nM8"),
        ("M280 P0 S10", "M280 P0 S60\nG4 P100"),
        ("M280 P0 S60", "M280 P0 S10"),
        ("M3 S30", "M3 S90"),
        ("M3 S0", "M3 S90"),
        ("PEN_UP", "PEN_DOWN"),
    ] {
        for travel in ["G0", "G1"] {
            // Dots alone, with the pen up at first or not.
            let dots = format!(
                "{travel} X30 Y30\n{down}\n{up}\n{travel} X9 Y5\n{down}\n{up}\n{travel} X0 Y0\n"
            );
            let expected = [dot(30.0, 30.0), dot(9.0, 5.0)];
            for program in [format!("{up}\n{dots}"), dots] {
                assert_eq!(strokes(&program), expected, "{program}");
                assert_eq!(notes("a.nc", program.as_bytes()), [""; 0], "{program}");
            }
        }
        // Between lines, of which the first does not begin with a dot, nor ends with one.
        let lines = format!(
            "{up}\nG0 X30 Y30\n{down}\n{up}\nG0 X10 Y10\n{down}\nG1 X20\n{up}\nG0 X9 Y5\n\
             {down}\n{up}\nG0 X0 Y0\n"
        );
        assert_eq!(strokes(&lines), [dot(30.0, 30.0), line.clone(), dot(9.0, 5.0)], "{lines}");
    }
    assert_eq!(strokes("G0 Z5\nG0 X30 Y30\nG1 Z-1\nG0 Z5\n"), [dot(30.0, 30.0)]);
    // Pens.
    let program = "M5\nT1\nG0 X1\nM3\nM5\nT2\nG0 X5\nM3\nM5\nG0 X0\n";
    assert_eq!(pens(program), [1, 2]);
}

#[test]
fn a_level_that_a_program_only_begins_or_ends_with_is_no_dot() {
    let line = [vec![[10.0, 10.0], [20.0, 10.0]]];
    let drawn = "G0 X10 Y10\nDOWN\nG1 X20\nUP\nG0 X0 Y0\n";
    for (up, down) in [("G0 Z5", "G1 Z-1"), ("M5", "M3"), ("M280 P0 S9", "M280 P0 S60")] {
        for program in [
            format!("DOWN\nUP\n{drawn}"),
            format!("UP\n{drawn}DOWN\n"),
            format!("UP\n{drawn}DOWN\nG28\nM30\n"),
        ] {
            let program = program.replace("UP", up).replace("DOWN", down);
            assert_eq!(strokes(&program), line, "{program}");
        }
        // Another change at the end of a line is no dot of another pen.
        let program = format!("UP\n{}", drawn.replace("X20\n", "X20\nT2\nM8\n"));
        let program = program.replace("UP", up).replace("DOWN", down);
        assert_eq!(strokes(&program), line, "{program}");
    }
    // A lens that is focused, a laser that is lit over its travels, and an extruder.
    for program in [
        "G0 Z2\nG0 Z5\nM4 S0\nG0 X10 Y10\nM3\nG1 X20 S200\nS0\nM5\nG0 Z2\nG0 Z5\nM30\n",
        "M4\nM8\nM9\nG0 X10 Y10\nG1 X20\nM5\n",
        "M83\nG0 Z5\nG1 Z1\nG1 Z5\nG0 X10 Y10\nG1 Z1\nG1 X20 E1\nG1 Z5\nG1 Z1\nG1 E1\nG1 Z5\n",
    ] {
        assert_eq!(strokes(program), line, "{program}");
    }
}

/// The P of LinuxCNC.
#[test]
fn an_arc_may_turn_several_times() {
    for (p, turns) in [("", 0.5), ("P0", 0.5), ("P1", 0.5), ("P2", 1.5), ("P4", 3.5)] {
        let drawn = strokes(&format!("G0 X10\nG3 X-10 Y0 I-10 J0 {p}\n"));
        let sides = drawn.concat();
        let sides = sides.windows(2).map(|it| (it[1][0] - it[0][0]).hypot(it[1][1] - it[0][1]));
        let length: f64 = sides.sum();
        assert!((length / (20.0 * std::f64::consts::PI) - turns).abs() < 0.01, "{p}: {length}");
    }
    for p in ["P1.5", "P-1", "P1000000000"] {
        assert!(sent("a.nc", format!("G0 X10\nG3 X-10 Y0 I-10 {p}\n").as_bytes()).is_err(), "{p}");
    }
}

#[test]
fn a_mark_of_the_encoding_is_passed_over() {
    let program = "\u{FEFF}G21\nG0 X1\nG1 X5\n";
    assert_eq!(strokes(program), [[[1.0, 0.0], [5.0, 0.0]]]);
    assert!(sent("known by its beginning", program.as_bytes()).is_ok());
}
