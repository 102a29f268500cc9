//! Tests of what DXF files draw.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

use super::Dxf;
use crate::SourceFile;
use crate::arrange::Arrangement;
use crate::format::{Body, Contents, Format as _};
use crate::lines::Lines as _;
use crate::tests::{notes, sent};

/// A file with these tables and blocks, and entities, whose pairs stand with spaces between them.
fn dxf(units: &str, before: &str, entities: &str) -> String {
    let text = format!(
        "0 SECTION 2 HEADER 9 $INSUNITS 70 {units} 0 ENDSEC {before} 0 SECTION 2 ENTITIES \
         {entities} 0 ENDSEC 0 EOF"
    );
    text.split_whitespace().map(|word| format!("{}\r\n", word.replace('_', " "))).collect()
}

/// The pen and the points of each stroke.
fn strokes(text: &str) -> Vec<(String, Vec<[f64; 2]>)> {
    let file = SourceFile::new("a.dxf".to_owned(), text.into()).expect("a DXF");
    let (mut vertices, mut pen, mut strokes) = (Vec::new(), String::new(), Vec::new());
    for line in file.in_order() {
        let mut words = line.sent.split(' ');
        let number = |word: &str| word.parse::<f64>().expect("a number");
        match words.next() {
            Some("v") => {
                let numbers: Vec<f64> = words.map(number).collect();
                vertices.push([numbers[0], numbers[1]]);
            }
            Some("usemtl") => pen = words.collect(),
            _ => {
                let points = words.map(|word| vertices[number(word) as usize - 1]).collect();
                strokes.push((pen.clone(), points));
            }
        }
    }
    strokes
}

#[test]
fn lines_and_polylines_have_true_size_in_any_unit() {
    let line = "0 LINE 8 walls 10 1 20 2 30 0 11 3 21 4 31 0";
    for (units, factor) in [("4", 1.0), ("5", 10.0), ("1", 25.4), ("0", 1.0), ("21", 304.800_609_6)]
    {
        let at = |value: f64| (value * factor * 1000.0).round() / 1000.0;
        let expected = [[at(1.0), at(2.0)], [at(3.0), at(4.0)]];
        let [(pen, points)] = &strokes(&dxf(units, "", line))[..] else { panic!("{units}") };
        assert_eq!((pen.as_str(), points.as_slice()), ("pen1", expected.as_slice()));
    }
    let unit = "the file does not say its unit: it is taken as mm";
    assert_eq!(notes("a.dxf", dxf("0", "", line).as_bytes()), [unit]);
    let light = "0 LWPOLYLINE 8 7_red 90 3 70 1 10 0 20 0 10 5 20 0 10 5 20 5";
    let old = "0 POLYLINE 8 a 66 1 70 0 0 VERTEX 8 a 10 1 20 1 0 VERTEX 8 a 10 2 20 1 0 SEQEND";
    assert_eq!(
        strokes(&dxf("4", "", &[light, old].join(" "))),
        [
            ("pen7".to_owned(), vec![[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 0.0]]),
            ("pen1".to_owned(), vec![[1.0, 1.0], [2.0, 1.0]]),
        ]
    );
}

/// What AutoCAD 2018 writes behind a paragraph.
const EMBEDDED: &str = "101 Embedded_Object 70 1 10 1.0 20 0.0 30 0.0 11 100 21 100 31 0.0 40 0.0 \
                        41 7 71 9";

/// Codes of two bytes are those of release 13 on, and of one byte those before.
#[test]
fn the_binary_form_is_that_of_the_text() {
    let line = "0 LINE 8 walls 62 3 10 1.5 20 2 11 -3 21 4.25 210 0 230 1";
    let paragraph = format!("0 MTEXT 10 9 20 9 40 5 71 1 1 HI {EMBEDDED}");
    let text = dxf("4", "", &format!("{line} {paragraph}"));
    for is_wide in [true, false] {
        let mut binary = b"AutoCAD Binary DXF\r\n\x1A\0".to_vec();
        let lines: Vec<&str> = text.lines().collect();
        for pair in lines.chunks(2) {
            let code: i16 = pair[0].parse().expect("a code");
            let bytes = code.to_le_bytes();
            binary.extend(&bytes[..if is_wide { 2 } else { 1 }]);
            match code {
                10..60 | 210..240 => {
                    binary.extend(pair[1].parse::<f64>().expect("a number").to_le_bytes());
                }
                60..80 => binary.extend(pair[1].parse::<i16>().expect("whole").to_le_bytes()),
                _ => binary.extend(format!("{}\0", pair[1]).bytes()),
            }
        }
        assert_eq!(sent("a.dxf", &binary), sent("a.dxf", text.as_bytes()), "{is_wide}");
        assert!(sent("a.dxf", &binary).is_ok(), "{is_wide}");
        for end in 0..binary.len() {
            let _ = sent("a.dxf", &binary[..end]);
        }
    }
}

#[test]
fn paper_space_is_drawn_where_model_space_is_empty() {
    let paper = "0 LINE 67 1 8 a 10 1 20 2 11 3 21 4 0 LINE 60 1 11 5";
    let text = dxf("4", "", paper);
    assert_eq!(strokes(&text)[0].1, [[1.0, 2.0], [3.0, 4.0]]);
    let said = notes("a.dxf", text.as_bytes());
    assert!(said[0].starts_with("1 entity in model space is not drawn"), "{said:?}");
    assert_eq!(said[1], "paper space is drawn, because there is nothing in model space");
}

/// A map in metres has coordinates that no plotter takes, and is small itself.
#[test]
fn a_map_is_moved_to_the_origin() {
    let line = "0 LINE 8 a 10 500000 20 4600000 11 500000.1 21 4600000.05";
    let map = dxf("6", "", line);
    assert_eq!(strokes(&map)[0].1, [[0.0, 0.0], [100.0, 50.0]]);
    let note = "the coordinates are too large for a plotter to keep them exactly: the drawing is \
                moved by -500000000 and -4600000000 mm";
    assert_eq!(notes("a.dxf", map.as_bytes()), [note]);
}

/// Checks that the only stroke stays within half a motor step of `radius` around a centre, has so
/// long a way, and these ends.
fn is_arc(entity: &str, centre: [f64; 2], radius: f64, length: f64, ends: [[f64; 2]; 2]) {
    let all = strokes(&dxf("4", "", entity));
    // A long stroke is sent as several lines, each of which begins where the one before ends.
    let mut points: Vec<[f64; 2]> = Vec::new();
    for (_, part) in &all {
        assert!(points.last().is_none_or(|last| part.first() == Some(last)), "{entity}");
        points.extend(part.iter().skip(usize::from(!points.is_empty())));
    }
    for pair in points.windows(2) {
        for part in [0.0, 0.5] {
            let point = [0, 1].map(|it: usize| pair[0][it] + part * (pair[1][it] - pair[0][it]));
            let off = (point[0] - centre[0]).hypot(point[1] - centre[1]) - radius;
            assert!(off.abs() < 0.005, "{off} {entity}");
        }
    }
    let way: f64 =
        points.windows(2).map(|it| (it[0][0] - it[1][0]).hypot(it[0][1] - it[1][1])).sum();
    assert!((way - length).abs() < 0.01, "{way} {entity}");
    let own = [points[0], points[points.len() - 1]];
    for (own, end) in own.iter().zip(ends) {
        assert!((own[0] - end[0]).hypot(own[1] - end[1]) < 0.002, "{own:?} {entity}");
    }
}

#[test]
fn arcs_circles_ellipses_bulges_and_splines_are_followed() {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let east = [15.0, 5.0];
    is_arc("0 CIRCLE 10 5 20 5 40 10", [5.0; 2], 10.0, 10.0 * TAU, [east; 2]);
    is_arc(
        "0 ARC 10 5 20 5 40 10 50 270 51 0",
        [5.0; 2],
        10.0,
        10.0 * FRAC_PI_2,
        [[5.0, -5.0], east],
    );
    // An arc that was drawn from below is mirrored.
    is_arc(
        "0 ARC 10 -5 20 5 40 10 50 90 51 180 210 0 220 0 230 -1",
        [5.0; 2],
        10.0,
        10.0 * FRAC_PI_2,
        [[5.0, 15.0], east],
    );
    let whole = "0 ELLIPSE 10 5 20 5 11 10 21 0 40 1 41 0 42";
    for end in ["6.28319", "6.283185307179586", "6.28318"] {
        let drawn = strokes(&dxf("4", "", &format!("{whole} {end}")));
        assert!(drawn.iter().flat_map(|it| &it.1).any(|[x, _]| *x < -4.9), "{end}");
    }
    let round = "0 ELLIPSE 10 5 20 5 11 0 21 10 40 1 41 0 42 3.141592653589793";
    is_arc(round, [5.0; 2], 10.0, 10.0 * PI, [[5.0, 15.0], [5.0, -5.0]]);
    let bulge = |bulge: &str| format!("0 LWPOLYLINE 70 0 10 -5 20 5 42 {bulge} 10 15 20 5");
    is_arc(&bulge("1"), [5.0; 2], 10.0, 10.0 * PI, [[-5.0, 5.0], east]);
    is_arc(&bulge("-1"), [5.0; 2], 10.0, 10.0 * PI, [[-5.0, 5.0], east]);
    let quarter = "0 LWPOLYLINE 70 0 10 15 20 5 42 0.41421356237309503 10 5 20 15";
    is_arc(quarter, [5.0; 2], 10.0, 10.0 * FRAC_PI_2, [east, [5.0, 15.0]]);
    // A quarter of a circle as a rational spline.
    let spline = "0 SPLINE 71 2 40 0 40 0 40 0 40 1 40 1 40 1 41 1 41 0.7071067811865476 41 1 \
                  10 15 20 5 10 15 20 15 10 5 20 15";
    is_arc(spline, [5.0; 2], 10.0, 10.0 * FRAC_PI_2, [east, [5.0, 15.0]]);
}

#[test]
fn blocks_are_inserted_turned_and_scaled_on_the_layer_of_the_insert() {
    let blocks = "0 SECTION 2 BLOCKS 0 BLOCK 2 tick 10 1 20 0 \
                  0 LINE 8 0 10 1 20 0 11 2 21 0 0 ENDBLK 0 ENDSEC";
    let insert = "0 LINE 8 3 10 0 20 0 11 9 21 0 0 INSERT 8 2_b 2 tick 10 5 20 5 41 3 42 3 50 90";
    assert_eq!(
        strokes(&dxf("4", blocks, insert)),
        [
            ("pen3".to_owned(), vec![[0.0, 0.0], [9.0, 0.0]]),
            ("pen2".to_owned(), vec![[5.0, 5.0], [5.0, 8.0]]),
        ]
    );
    let rows = "0 INSERT 2 tick 10 0 20 0 70 3 71 2 44 10 45 20";
    let all = strokes(&dxf("4", blocks, rows));
    let begins: Vec<[f64; 2]> = all.iter().map(|(_, points)| points[0]).collect();
    let expected = [[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [0.0, 20.0], [10.0, 20.0], [20.0, 20.0]];
    assert_eq!(begins, expected);
    let endless = "0 SECTION 2 BLOCKS 0 BLOCK 2 a 0 INSERT 2 a 0 ENDBLK 0 ENDSEC";
    let error = sent("a.dxf", dxf("4", endless, "0 INSERT 2 a").as_bytes()).expect_err("endless");
    assert!(error.contains("nested too deeply"), "{error}");
}

#[test]
fn what_is_not_drawn_is_counted() {
    let tables = "0 SECTION 2 TABLES 0 TABLE 2 LAYER 0 LAYER 2 off 62 -7 70 0 \
                  0 LAYER 2 cold 62 7 70 1 0 ENDTAB 0 ENDSEC";
    let text = dxf(
        "4",
        tables,
        "0 LINE 8 a 10 0 20 0 11 9 21 0 0 TEXT 8 a 1 hello 0 TEXT 8 a 1 you 0 LINE 8 off 10 0 \
         0 LINE 8 cold 10 0 0 LINE 67 1 10 0 0 LINE 60 1 11 5 0 INSERT 2 none",
    );
    let said = notes("a.dxf", text.as_bytes());
    let kinds: Vec<&str> = said.iter().filter_map(|it| it.split(" (").next()).collect();
    assert_eq!(
        kinds,
        [
            "1 INSERT of an unknown block is not drawn",
            "2 TEXT are not drawn",
            "1 entity in paper space is not drawn",
            "2 entities on layers that are off or frozen are not drawn",
            "1 invisible entity is not drawn",
        ]
    );
    let line = text.lines().position(|line| line == "TEXT").expect("a text") + 1;
    assert!(said[1].ends_with(&format!("(the first in line {line})")), "{said:?}");
}

/// Programs show them on the screen: the points of dimensions, and what the user wants so.
#[test]
fn layers_that_are_not_plotted_are_drawn_only_if_they_are_named() {
    let tables = "0 SECTION 2 TABLES 0 TABLE 2 LAYER 0 LAYER 2 Aid 62 7 70 0 290 0 \
                  0 LAYER 2 own 62 7 70 0 290 1 0 ENDTAB 0 ENDSEC";
    let line = |layer: &str, to: u32| format!("0 LINE 8 {layer} 10 0 20 0 11 {to} 21 0 ");
    let entities: String =
        [line("own", 1), line("AID", 2), line("DefPoints", 3), line("0", 4)].concat();
    let text = dxf("4", tables, &entities);
    let ends = |names: &[&str]| -> Vec<f64> {
        let mut arrangement = Arrangement::default();
        arrangement.layers.extend(names.iter().map(|name| (*name).to_owned()));
        let contents = Dxf.read("a.dxf".to_owned(), text.clone().into(), &arrangement);
        let Ok(Contents { body: Body::Plan(plan), .. }) = contents else { panic!("no plan") };
        plan.strokes.iter().map(|stroke| stroke.points[1][0]).collect()
    };
    assert_eq!(ends(&[]), [1.0, 4.0]);
    assert_eq!(ends(&["own"]), [1.0, 4.0]);
    assert_eq!(ends(&["defpoints"]), [1.0, 3.0, 4.0]);
    assert_eq!(ends(&["Aid", "Defpoints"]), [1.0, 2.0, 3.0, 4.0]);
    let [said] = &notes("a.dxf", text.as_bytes())[..] else { panic!("one note") };
    let expected = "2 entities on layers that are not to be plotted (--layer NAME draws one) are";
    assert!(said.starts_with(expected), "{said}");
}

/// The rest of a file that was cut off is missing without a trace.
#[test]
fn a_file_without_its_end_is_told() {
    let line = "0 LINE 8 0 10 1 20 2 11 3 21 4";
    let whole = dxf("4", "", &format!("{line} {line} {line}"));
    let is_told = |text: &str| {
        notes("a.dxf", text.as_bytes()).iter().any(|note| note.contains("no mark of its end"))
    };
    assert!(!is_told(&whole));
    let third = whole.match_indices("LINE\r\n").nth(2).expect("three lines").0;
    let cut = whole.get(..third - "0\r\n".len()).expect("the file before the third line");
    assert!(is_told(cut));
}

#[test]
fn damaged_files_are_refused_with_their_line() {
    let spline = "0 SPLINE 71 3 40 0 40 1 10 0 20 0 10 1 20 1";
    for (text, reason) in [
        ("0\nSECTION\nbanana\n".to_owned(), "a.dxf:3: there should be a code of DXF"),
        ("0\nSECTION\n2\n".to_owned(), "a.dxf:3: the file ends after a code"),
        (dxf("4", "", "0 LINE 10 one"), "this is no number"),
        (dxf("4", "", "0 LINE 10 1e300"), "this is no number"),
        (dxf("4", "", "0 LINE 10 nan"), "this is no number"),
        (dxf("15", "", "0 LINE 11 5"), "its unit ($INSUNITS) is none"),
        (dxf("4", "", spline), "1 SPLINE whose knots do not fit it is not drawn"),
        (dxf("4", "", "0 CIRCLE 40 1e11"), "too many points"),
        (dxf("4", "", "0 TEXT 1 a"), "nothing to draw in this DXF with 1 entity; 1 TEXT is not"),
        ("0\nEOF\n".to_owned(), "nothing to draw in this DXF"),
        ("AutoCAD Binary DXF\r\n\x1A\0\0\0SEC".to_owned(), "this binary DXF is damaged"),
    ] {
        let error = sent("a.dxf", text.as_bytes()).expect_err(&text);
        assert!(error.contains(reason), "{error}");
    }
    let whole = dxf("4", "", "0 LINE 8 a 10 0 20 0 11 9 21 0");
    assert!(sent("a", whole.as_bytes()).is_ok(), "known by its beginning");
    // However a file is cut, it is read or refused.
    for end in 0..whole.len() {
        let _ = sent("a.dxf", &whole.as_bytes()[..end]);
    }
}

#[test]
fn points_faces_and_dimensions_are_drawn() {
    let one = |entities: &str| {
        let [(_, points)] = &strokes(&dxf("4", "", entities))[..] else { panic!("{entities}") };
        points.clone()
    };
    assert_eq!(one("0 POINT 8 0 10 3 20 4 30 0"), [[3.0, 4.0], [3.08, 4.0]]);
    let corners = "10 0 20 0 30 1 11 4 21 0 31 1 12 4 22 2 32 1 13 0 23 2 33 1";
    let face = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
    assert_eq!(one(&format!("0 3DFACE 8 0 {corners}")), face);
    let crosswise = "10 0 20 0 11 4 21 0 12 0 22 2 13 4 23 2";
    assert_eq!(one(&format!("0 SOLID 8 0 {crosswise}")), face);
    let three = "0 SOLID 8 0 10 0 20 0 11 4 21 0 12 4 22 2";
    assert_eq!(one(three), [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 0.0]]);
    let tilted =
        dxf("4", "", &format!("0 LINE 11 5 0 3DFACE 8 0 {corners} 32 0").replace("32 1", "32 2"));
    assert_eq!(notes("a.dxf", tilted.as_bytes()), ["1 3DFACE, not level is not drawn (line 20)"]);
    // A dimension is drawn by the block that it names, where that block is.
    let block = "0 SECTION 2 BLOCKS 0 BLOCK 2 *D1 10 0 20 0 0 LINE 8 0 10 1 20 1 11 9 21 1 \
                 0 MTEXT 8 0 1 8 0 ENDBLK 0 ENDSEC";
    let dimension = dxf("4", block, "0 DIMENSION 8 5 2 *D1 10 7 20 7");
    assert_eq!(strokes(&dimension), [("pen5".to_owned(), vec![[1.0, 1.0], [9.0, 1.0]])]);
    // A table has a place and a direction of its own.
    let table = dxf("4", block, "0 TABLE 8 5 2 *D1 10 7 20 7 11 0 21 2 41 9");
    let table = table.replace("TABLE", "ACAD_TABLE");
    assert_eq!(strokes(&table), [("pen5".to_owned(), vec![[6.0, 8.0], [6.0, 16.0]])]);
    // What stands behind the end of the file is not read.
    assert_eq!(strokes(&(table.clone() + "ignore\nthis")), strokes(&table));
    let said = notes("a.dxf", dimension.as_bytes());
    assert!(
        matches!(said.as_slice(), [note] if note.starts_with("1 MTEXT is not drawn")),
        "{said:?}"
    );
    let unknown = dxf("4", "", "0 LINE 11 5 0 DIMENSION 8 5 2 *D9");
    let said = notes("a.dxf", unknown.as_bytes());
    assert!(
        matches!(said.as_slice(), [note] if note.starts_with("1 DIMENSION is not")),
        "{said:?}"
    );
}

#[test]
fn tilted_entities_are_seen_from_above() {
    // A circle about the x axis of the world is a line along its y.
    let points: Vec<[f64; 2]> =
        strokes(&dxf("4", "", "0 CIRCLE 10 7 20 0 30 3 40 5 210 1 220 0 230 0"))
            .into_iter()
            .flat_map(|(_, points)| points)
            .collect();
    let ends = points
        .iter()
        .fold([f64::MAX, f64::MIN], |[low, high], point| [low.min(point[1]), high.max(point[1])]);
    assert!(points.iter().all(|point| point[0] == 3.0), "{points:?}");
    assert!((ends[0] - 2.0).abs() < 0.005 && (ends[1] - 12.0).abs() < 0.005, "{ends:?}");
    // The short half axis of an ellipse whose plane is upright points up.
    let upright =
        "0 ELLIPSE 10 0 20 0 11 4 21 0 40 0.5 41 0 42 3.141592653589793 210 0 220 1 230 0";
    let points = strokes(&dxf("4", "", upright)).remove(0).1;
    assert!(points.iter().all(|point| point[1] == 0.0), "{points:?}");
}

#[test]
fn names_have_no_capitals_and_line_types_have_dashes() {
    let tables = "0 SECTION 2 TABLES 0 LTYPE 2 Dashed 49 2 49 -1 \
                  0 LAYER 2 Off 62 -7 0 LAYER 2 hid 62 7 6 DASHED 0 ENDTAB 0 ENDSEC \
                  0 SECTION 2 BLOCKS 0 BLOCK 2 Tick 0 LINE 8 hid 11 4 0 ENDBLK \
                  0 BLOCK 2 open 0 LINE 8 a 6 BYBLOCK 11 4 0 ENDBLK \
                  0 BLOCK 2 outer 0 INSERT 2 open 6 ByBlock 0 ENDBLK 0 ENDSEC";
    let drawn = |entities: &str| -> Vec<Vec<[f64; 2]>> {
        let strokes = strokes(&dxf("4", tables, entities));
        strokes.into_iter().map(|(_, points)| points).collect()
    };
    let dashes = vec![vec![[0.0, 0.0], [2.0, 0.0]], vec![[3.0, 0.0], [4.0, 0.0]]];
    assert_eq!(drawn("0 INSERT 2 TICK 0 LINE 8 OFF 11 9"), dashes);
    assert_eq!(drawn("0 LINE 8 a 6 dashed 11 4"), dashes);
    assert_eq!(drawn("0 LINE 8 hid 6 dashed 48 2 11 6"), [[[0.0, 0.0], [4.0, 0.0]]]);
    assert_eq!(drawn("0 LINE 8 hid 6 CONTINUOUS 11 4"), [[[0.0, 0.0], [4.0, 0.0]]]);
    // A line type that the block leaves open is that of the insertion, or of the block around it.
    assert_eq!(drawn("0 INSERT 2 OPEN 6 dashed"), dashes);
    assert_eq!(drawn("0 INSERT 2 OPEN 8 hid"), dashes);
    assert_eq!(drawn("0 INSERT 2 OUTER 6 dashed"), dashes);
    assert_eq!(drawn("0 INSERT 2 OPEN 8 a"), [[[0.0, 0.0], [4.0, 0.0]]]);
    assert_eq!(drawn("0 LINE 8 hid 6 ByBlock 11 4"), [[[0.0, 0.0], [4.0, 0.0]]]);
}

/// A block with a line, and objects that clip its insertion.
fn clipped(objects: &str, insertion: &str) -> String {
    let blocks = "0 SECTION 2 BLOCKS 0 BLOCK 2 bar 10 1 20 0 \
                  0 LINE 8 0 10 -8 20 0 11 12 21 0 0 POINT 10 20 20 0 0 ENDBLK 0 ENDSEC";
    let dictionaries = "0 DICTIONARY 5 D1 330 I1 3 ACAD_FILTER 360 D2 \
                        0 DICTIONARY 5 D2 330 D1 3 SPATIAL 360 F1";
    let objects = format!("0 SECTION 2 OBJECTS {dictionaries} {objects} 0 ENDSEC");
    dxf("4", &format!("{blocks} {objects}"), insertion)
        .replace("CLIP", "SPATIAL_FILTER")
        .replace("ROUNDTRIP", "ACAD_INVERTEDCLIP_ROUNDTRIP")
}

#[test]
fn inserted_blocks_are_clipped() {
    let insertion = "0 INSERT 5 I1 2 bar 10 5 20 5 41 2 42 2";
    // From the page to the block: x = (X - 5) / 2 + 1. The other matrix is not needed.
    let matrices = "40 0.5 40 0 40 0 40 -1.5 40 0 40 0.5 40 0 40 -2.5 40 0 40 0 40 1 40 0 \
                    40 1 40 0 40 0 40 0 40 0 40 1 40 0 40 0 40 0 40 0 40 1 40 0";
    let clip = |corners: &str, more: &str| {
        let filter = format!("0 CLIP 5 F1 330 D2 {corners} 71 1 {more} {matrices}");
        let text = clipped(&filter, insertion);
        let strokes = strokes(&text).into_iter().map(|(_, points)| points).collect::<Vec<_>>();
        (strokes, notes("a.dxf", text.as_bytes()))
    };
    let whole = vec![vec![[-13.0, 5.0], [27.0, 5.0]], vec![[43.0, 5.0], [43.08, 5.0]]];
    let rectangle = "10 1 20 0 10 9 20 8";
    assert_eq!(clip(rectangle, ""), (vec![vec![[1.0, 5.0], [9.0, 5.0]]], vec![]));
    let triangle = "10 0 20 0 10 10 20 0 10 0 20 10";
    assert_eq!(clip(triangle, ""), (vec![vec![[0.0, 5.0], [5.0, 5.0]]], vec![]));
    // What cuts in depth or from below is told, and so is a filter of no insertion.
    let told = "1 inserted block is clipped in the file (XCLIP) in a way that is not obeyed: the \
                whole is drawn";
    for (corners, more) in [(rectangle, "72 1 40 3"), (rectangle, "230 -1"), ("10 1 20 2", "")] {
        assert_eq!(clip(corners, more), (whole.clone(), vec![told.to_owned()]), "{more}");
    }
    let filter = format!("0 CLIP 5 F1 330 D2 {rectangle} 71 1 {matrices}");
    let mark = "0 XRECORD 330 X1 102 ROUNDTRIP 0 DICTIONARY 5 X1 330 F1";
    for (objects, handle) in [(filter.clone(), "I2"), (format!("{filter} {mark}"), "I1")] {
        let text = clipped(&objects, &insertion.replace("I1", handle));
        assert_eq!(notes("a.dxf", text.as_bytes()), [told], "{handle}");
    }
    let off = clipped(&filter.replace("71 1", "71 0"), insertion);
    assert_eq!((strokes(&off).len(), notes("a.dxf", off.as_bytes())), (2, vec![]));
}

/// The least and the greatest coordinates of all strokes, rounded to hundredths.
fn extent(entities: &str) -> [[f64; 2]; 2] {
    let text = dxf("4", "", entities);
    let points: Vec<[f64; 2]> = strokes(&text).into_iter().flat_map(|(_, points)| points).collect();
    let most = |pick: fn(f64, f64) -> f64| {
        [0, 1].map(|axis: usize| {
            let all = points.iter().map(|point| point[axis]);
            (all.reduce(pick).expect("points") * 100.0).round() / 100.0
        })
    };
    [most(f64::min), most(f64::max)]
}

#[test]
fn texts_stand_where_the_file_says() {
    // The letter H is 14 units wide and 21 high, in a width of 22: at a height of 21 mm it begins
    // 4 mm behind the beginning of its line.
    let text = |more: &str| extent(&format!("0 TEXT 8 a 10 100 20 50 40 21 1 H {more}"));
    assert_eq!(text(""), [[104.0, 50.0], [118.0, 71.0]]);
    assert_eq!(text("50 90"), [[79.0, 54.0], [100.0, 68.0]]);
    assert_eq!(text("41 0.5"), [[102.0, 50.0], [109.0, 71.0]]);
    assert_eq!(text("71 2"), [[82.0, 50.0], [96.0, 71.0]]);
    assert_eq!(text("71 4"), [[104.0, 29.0], [118.0, 50.0]]);
    // With an alignment the second point counts.
    let aligned = |codes: &str| text(&format!("11 10 21 20 {codes}"));
    assert_eq!(aligned("72 1"), [[3.0, 20.0], [17.0, 41.0]]);
    assert_eq!(aligned("72 2"), [[-8.0, 20.0], [6.0, 41.0]]);
    assert_eq!(aligned("72 2 73 3"), [[-8.0, -1.0], [6.0, 20.0]]);
    assert_eq!(aligned("72 1 73 2"), [[3.0, 9.5], [17.0, 30.5]]);
    assert_eq!(aligned("73 1"), [[14.0, 27.0], [28.0, 48.0]]);
    assert_eq!(aligned("72 0 73 0"), [[104.0, 50.0], [118.0, 71.0]]);
    // The text fills the way from 100 to 144, twice its width; 3 makes it higher, too.
    assert_eq!(text("72 5 11 144 21 50"), [[108.0, 50.0], [136.0, 71.0]]);
    assert_eq!(text("72 3 11 144 21 50"), [[108.0, 50.0], [136.0, 92.0]]);
    let attribute = extent("0 ATTRIB 10 0 20 0 11 10 21 20 40 21 1 H 70 0 72 2 74 3");
    assert_eq!(attribute, [[-8.0, -1.0], [6.0, 20.0]]);

    let paragraph = |more: &str| extent(&format!("0 MTEXT 10 100 20 50 40 21 1 H\\PH {more}"));
    assert_eq!(paragraph("71 1"), [[104.0, -6.0], [118.0, 50.0]]);
    assert_eq!(paragraph("71 3"), [[82.0, -6.0], [96.0, 50.0]]);
    assert_eq!(paragraph("71 5"), [[93.0, 22.0], [107.0, 78.0]]);
    assert_eq!(paragraph("71 7"), [[104.0, 57.0], [118.0, 113.0]]);
    assert_eq!(paragraph("71 1 44 2"), [[104.0, -41.0], [118.0, 50.0]]);
    assert_eq!(paragraph("71 1 50 90"), [[100.0, 54.0], [156.0, 68.0]]);
    assert_eq!(paragraph("71 1 50 90 11 1 21 0"), [[104.0, -6.0], [118.0, 50.0]]);
    assert_eq!(paragraph("71 1 11 0 21 1"), [[100.0, 54.0], [156.0, 68.0]]);

    let said =
        notes("a.dxf", dxf("4", "", "0 TEXT 40 5 1 H€\u{4E00} 0 ATTRIB 70 1 40 5 1 H").as_bytes());
    assert_eq!(
        said,
        [
            "1 invisible entity is not drawn (line 22)",
            "1 text is drawn in the plotter's own letters, not in the font of the file",
            "1 letter is not in the plotter's font: drawn as a box",
        ]
    );
}

/// The codes of the embedded object are those of the paragraph, with other meanings.
#[test]
fn an_embedded_object_does_not_belong_to_its_entity() {
    let paragraph = "0 MTEXT 8 0 100 AcDbMText 10 100 20 100 40 5 71 1 1 HI";
    let attribute = "0 ATTRIB 8 0 10 100 20 100 40 5 1 HI 72 1";
    for entity in [paragraph, attribute] {
        let whole = format!("{entity} {EMBEDDED} 0 LINE 11 5");
        let plain = format!("{entity} 0 LINE 11 5");
        assert_eq!(strokes(&dxf("4", "", &whole)), strokes(&dxf("4", "", &plain)));
    }
}

#[test]
fn drawings_elsewhere_are_told() {
    let blocks = |flags: &str| {
        format!(
            "0 SECTION 2 BLOCKS 0 BLOCK 2 Site 70 {flags} 10 0 20 0 1 ..\\entities.dwg 0 ENDBLK \
             0 BLOCK 2 bound 70 4 1 b.dwg 0 LINE 11 5 0 ENDBLK 0 BLOCK 2 lost 70 8 1 0 ENDBLK \
             0 ENDSEC"
        )
        .replace("1 0 ENDBLK", "0 ENDBLK")
    };
    let said = |flags: &str, entities: &str| {
        let entities = format!("0 LINE 11 5 {entities}");
        let said = notes("a.dxf", dxf("4", &blocks(flags), &entities).as_bytes());
        said.iter().filter_map(|it| it.rsplit_once(" (")).map(|it| it.0.to_owned()).collect()
    };
    let told = |what: &str| {
        let how = "(bind it in the program that wrote the file)";
        what.replace("DWG", &format!("INSERT of the external drawing ..\\entities.dwg {how}"))
    };
    for flags in ["4", "8", "36", "12"] {
        let one: Vec<String> = said(flags, "0 INSERT 2 SITE");
        assert_eq!(one, [told("1 DWG is not drawn")], "{flags}");
    }
    let two: Vec<String> = said("4", "0 INSERT 2 site 0 INSERT 2 site");
    assert_eq!(two, [told("2 DWG are not drawn")]);
    let lost: Vec<String> = said("4", "0 INSERT 2 lost");
    assert!(lost[0].starts_with("1 INSERT of the external drawing lost (bind"), "{lost:?}");
    // What is in the file is drawn, and a block of nothing is nothing.
    for (flags, entities) in [("4", "0 INSERT 2 bound"), ("0", "0 INSERT 2 site")] {
        let said: Vec<String> = said(flags, entities);
        assert!(said.is_empty(), "{said:?}");
    }
}

/// A file with a text in these bytes, and the header of a version with a code page.
fn written(version: &str, code_page: &str, text: &[u8]) -> Vec<u8> {
    let variable = |name: &str, code: u32, value: &str| match value {
        "" => String::new(),
        value => format!("9\r\n{name}\r\n  {code}\r\n{value}\r\n"),
    };
    let header = variable("$ACADVER", 1, version) + &variable("$DWGCODEPAGE", 3, code_page);
    let file = dxf("4", "", "0 TEXT 40 21 1 HERE").replacen("9\r\n", &format!("{header}9\r\n"), 1);
    let (before, after) = file.split_once("HERE").expect("a place for the text");
    [before.as_bytes(), text, after.as_bytes()].concat()
}

#[test]
fn letters_are_those_of_the_code_page() {
    for (version, code_page, bytes, letters) in [
        ("AC1015", "ANSI_1250", &b"\xE8\xF8"[..], "čř"),
        ("AC1015", "ansi_1251", b"\xC0\xC1\xDF", "АБЯ"),
        ("AC1015", "ANSI_1252", b"\xE9\x80", "é€"),
        ("AC1009", "ANSI_1253", b"\xC1\xD9", "ΑΩ"),
        ("AC1009", "ISO8859-9", b"\xFE\xDD", "şİ"),
        ("AC1009", "dos850", b"\x84\x9B", "äø"),
        ("AC1009", "dos866", b"\x80\x81", "АБ"),
        // The second byte of a letter may be that of a backslash.
        ("AC1015", "ANSI_932", b"\x95\x5C\x8E\xA6", "表示"),
        ("AC1015", "ANSI_936", b"\xB1\xED", "表"),
        ("AC1015", "ANSI_949", b"\xB0\xA1", "가"),
        ("AC1015", "ANSI_950", b"\xAA\xED", "表"),
        ("", "ANSI_1251", b"\xC0\xC1", "АБ"),
        // What is UTF-8 stays so, from 2007 on and where the file says nothing else.
        ("AC1021", "ANSI_1251", "é".as_bytes(), "é"),
        ("AC1032", "ANSI_1252", "čЯ".as_bytes(), "čЯ"),
        ("AC1015", "", "é".as_bytes(), "é"),
        ("", "ANSI_1252", "é".as_bytes(), "é"),
        ("AC1015", "", b"\xE9", "é"),
        ("AC1015", "DOS737", "é".as_bytes(), "é"),
        ("AC1021", "ANSI_1251", b"\xC0\xC1", "АБ"),
    ] {
        let own = written(version, code_page, bytes);
        let (text, note) = super::code_page::decoded(own.clone());
        assert!(text.contains(&format!("\r\n{letters}\r\n")), "{code_page} {text}");
        assert_eq!(note, None, "{code_page}");
        assert_eq!(sent("a.dxf", &own), sent("a.dxf", &written("", "", letters.as_bytes())));
    }
}

/// Another table has the same letters.
#[test]
fn code_pages_are_those_of_windows() {
    use encoding_rs as other;
    for (name, encoding) in [
        ("ANSI_874", other::WINDOWS_874),
        ("ANSI_1250", other::WINDOWS_1250),
        ("ANSI_1251", other::WINDOWS_1251),
        ("ANSI_1252", other::WINDOWS_1252),
        ("ANSI_1253", other::WINDOWS_1253),
        ("ANSI_1254", other::WINDOWS_1254),
        ("ANSI_1255", other::WINDOWS_1255),
        ("ANSI_1256", other::WINDOWS_1256),
        ("ANSI_1257", other::WINDOWS_1257),
        ("ANSI_1258", other::WINDOWS_1258),
        ("DOS866", other::IBM866),
    ] {
        let upper = super::one_byte::upper(name).expect("a known code page");
        for (byte, letter) in (0x80_u8..=0xFF).zip(upper.iter().map(|number| u32::from(*number))) {
            let bytes = [byte];
            let (theirs, _) = encoding.decode_without_bom_handling(&bytes);
            let ours = char::from_u32(letter).expect("a letter");
            assert!(theirs.chars().eq([ours]), "{name} {byte:x} {theirs} {ours}");
        }
    }
}

#[test]
fn doubtful_letters_are_told() {
    let unknown = "the code page of the file (DOS737) is not known: its letters are read as \
                   Latin-1, so some may be wrong";
    assert!(notes("a.dxf", &written("AC1009", "DOS737", b"\xE9")).contains(&unknown.to_owned()));
    assert_eq!(notes("a.dxf", &written("AC1009", "DOS737", b"e")).len(), 1);
    let doubtful = "the letters of the file are read in its code page (ANSI_1252), but may be \
                    UTF-8: if they are drawn wrongly, save it as a DXF of AutoCAD 2007 or newer";
    let file = written("AC1015", "ANSI_1252", "é".as_bytes());
    assert!(notes("a.dxf", &file).contains(&doubtful.to_owned()));
    let latin = written("AC1015", "", "Ã©".as_bytes());
    assert_eq!(sent("a.dxf", &file), sent("a.dxf", &latin));
    // The mark of UTF-8 decides.
    let marked = [b"\xEF\xBB\xBF", file.as_slice()].concat();
    assert_eq!(sent("a.dxf", &marked), sent("a.dxf", &written("", "", "é".as_bytes())));
    assert_eq!(notes("a.dxf", &marked).len(), 1);
}

#[test]
fn sides_of_a_face_may_be_invisible() {
    let face = |flags: &str| {
        let corners = "10 0 20 0 11 4 21 0 12 4 22 2 13 0 23 2";
        let text = dxf("4", "", &format!("0 LINE 10 9 11 9 21 9 0 3DFACE 70 {flags} {corners}"));
        let strokes = strokes(&text).split_off(1);
        strokes.into_iter().map(|(_, points)| points).collect::<Vec<_>>()
    };
    assert_eq!(face("1"), [[[4.0, 0.0], [4.0, 2.0], [0.0, 2.0], [0.0, 0.0]]]);
    assert_eq!(face("10"), [[[0.0, 0.0], [4.0, 0.0]], [[4.0, 2.0], [0.0, 2.0]]]);
    assert!(face("15").is_empty());
}

/// Files of which one was appended to another, or whose program writes several sections.
#[test]
fn every_section_of_entities_is_drawn_and_what_stands_behind_the_end_is_told() {
    let line = |y: u32| format!("0 LINE 8 a 10 0 20 {y} 11 9 21 {y}");
    let sections = format!("{} 0 ENDSEC 0 SECTION 2 ENTITIES {}", line(1), line(2));
    let sections = dxf("4", "", &sections);
    let drawn: Vec<f64> = strokes(&sections).iter().map(|(_, points)| points[0][1]).collect();
    assert_eq!(drawn, [1.0, 2.0]);
    assert_eq!(notes("a.dxf", sections.as_bytes()), [""; 0]);
    let first = dxf("4", "", &line(1));
    let joined = format!("{first}{}", dxf("4", "", &line(2)));
    assert_eq!(strokes(&joined).len(), 1);
    let note = "what stands behind the end of the file (EOF in line 30) is not drawn: if files \
                were joined, draw each by itself";
    assert_eq!(notes("a.dxf", joined.as_bytes()), [note]);
    assert_eq!(notes("a.dxf", format!("{first}\r\n \x1A\r\n").as_bytes()), [""; 0]);
}

/// A map in national coordinates, which a plotter keeps with half a millimetre or less.
#[test]
fn a_drawing_is_moved_where_its_coordinates_would_be_coarse() {
    let line = "0 LINE 8 a 10 530000000 20 180000000.25 11 530000100.125 21 180000050";
    let map = dxf("4", "", line);
    assert_eq!(strokes(&map)[0].1, [[0.0, 0.0], [100.125, 49.75]]);
    let note = "the coordinates are too large for a plotter to keep them exactly: the drawing is \
                moved by -530000000 and -180000000.25 mm";
    assert_eq!(notes("a.dxf", map.as_bytes()), [note]);
    // One that is as large as its coordinates would gain nothing.
    let large = dxf("4", "", "0 LINE 8 a 10 0 20 1000 11 530000000 21 180000000");
    assert_eq!(strokes(&large)[0].1, [[0.0, 1000.0], [530_000_000.0, 180_000_000.0]]);
    assert_eq!(notes("a.dxf", large.as_bytes()), [""; 0]);
    // It is when it is made small about its middle.
    let mut arrangement = Arrangement::default();
    arrangement.set("scale", "0.001").expect("a factor");
    let file = SourceFile::arranged("a.dxf".to_owned(), large.into_bytes(), &arrangement);
    let file = file.expect("a DXF");
    assert_eq!(file.bounds(), Some([[0.0; 2], [530_000.0, 179_999.0]]));
    let [said] = file.notes() else { panic!("{:?}", file.notes()) };
    assert!(said.ends_with("is moved by -264735000 and -89910500.5 mm"), "{said}");
}

/// AutoCAD shares the block of dimensions that were copied.
#[test]
fn a_dimension_lies_where_it_was_copied_to() {
    let block = "0 SECTION 2 BLOCKS 0 BLOCK 2 *D1 10 0 20 0 0 LINE 8 0 10 0 20 0 11 10 21 0 0 \
                 ENDBLK 0 ENDSEC";
    for (codes, expected) in [
        ("12 40 22 30", [[40.0, 30.0], [50.0, 30.0]]),
        ("12 -40 22 30 210 0 220 0 230 -1", [[40.0, 30.0], [50.0, 30.0]]),
        ("210 0 220 0 230 -1", [[0.0, 0.0], [10.0, 0.0]]),
        ("10 7 20 7", [[0.0, 0.0], [10.0, 0.0]]),
    ] {
        let text = dxf("4", block, &format!("0 DIMENSION 8 0 2 *D1 {codes}"));
        assert_eq!(strokes(&text), [("pen1".to_owned(), expected.to_vec())], "{codes}");
    }
}

#[test]
fn points_have_the_figure_and_the_size_that_the_file_says() {
    let of = |mode: i32, size: f64| {
        let text = dxf("4", "", "0 POINT 8 0 10 30 20 40 0 LINE 8 0 11 5");
        let header = format!("9\r\n$PDMODE\r\n70\r\n{mode}\r\n9\r\n$PDSIZE\r\n40\r\n{size}\r\n");
        text.replacen("9\r\n$INSUNITS", &format!("{header}9\r\n$INSUNITS"), 1)
    };
    let drawn = |mode, size| {
        let mut all: Vec<Vec<[f64; 2]>> =
            strokes(&of(mode, size)).into_iter().map(|(_, points)| points).collect();
        assert_eq!(all.pop(), Some(vec![[0.0, 0.0], [5.0, 0.0]]));
        assert_eq!(notes("a.dxf", of(mode, size).as_bytes()), [""; 0], "{mode}");
        all
    };
    let dot = vec![[30.0, 40.0], [30.08, 40.0]];
    let plus = [vec![[28.0, 40.0], [32.0, 40.0]], vec![[30.0, 38.0], [30.0, 42.0]]];
    let cross = [vec![[28.0, 38.0], [32.0, 42.0]], vec![[28.0, 42.0], [32.0, 38.0]]];
    let square = vec![[29.0, 39.0], [31.0, 39.0], [31.0, 41.0], [29.0, 41.0], [29.0, 39.0]];
    for size in [0.0, 2.0] {
        assert_eq!(drawn(0, size)[0], dot);
        assert_eq!(drawn(0, size).len(), 1);
    }
    assert_eq!(drawn(2, 2.0), plus);
    assert_eq!(drawn(3, 2.0), cross);
    assert_eq!(drawn(4, 2.0), [[[30.0, 40.0], [30.0, 41.0]]]);
    assert_eq!((drawn(65, 2.0).len(), &drawn(65, 2.0)[0]), (1, &square));
    assert_eq!(drawn(64, 2.0), [dot, square.clone()]);
    let all = drawn(98, 2.0);
    assert_eq!((&all[..2], &all[2]), (&plus[..], &square));
    let is_on_circle = |[x, y]: &[f64; 2]| ((x - 30.0).hypot(y - 40.0) - 1.0).abs() < 0.006;
    assert!(all.len() == 4 && all[3].len() > 10 && all[3].iter().all(is_on_circle), "{all:?}");
    assert_eq!(
        notes("a.dxf", of(1, 2.0).as_bytes()),
        ["1 POINT, which the file shows as nothing ($PDMODE) is not drawn (line 24)"]
    );
    for size in [0.0, -5.0] {
        assert_eq!(
            notes("a.dxf", of(35, size).as_bytes()),
            ["1 point is drawn as a dot: the size of its figure depends on the screen ($PDSIZE)"]
        );
    }
}

#[test]
fn letters_and_figures_of_line_types_are_told() {
    let tables = "0 SECTION 2 TABLES 0 LTYPE 2 GAS 49 5 74 0 49 -3 74 2 75 0 46 1 9 GAS 49 -3 74 0 \
                  0 LTYPE 2 DASHED 49 2 74 0 49 -1 74 0 0 ENDSEC";
    let lines = "0 LINE 6 Gas 8 0 11 50 0 LINE 6 DASHED 8 0 11 50 21 9";
    assert_eq!(
        notes("a.dxf", dxf("4", tables, lines).as_bytes()),
        ["1 line has letters or figures in the line type, which are not drawn: there are gaps"]
    );
}
