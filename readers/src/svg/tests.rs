//! Tests of what an SVG draws: the lines that are sent are compared with the SVG's own geometry.
//!
//! The file is longer than 500 lines, because it is a list of short cases.

use super::*;
use crate::SourceFile;
use crate::lines::Lines as _;
use kurbo::Point;
use penup::protocol::LINE_LIMIT;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// A polyline that is sent, in mm, and the name of its pen.
type Sent = (String, Vec<[f64; 2]>);

fn read(svg: &str) -> Result<SourceFile, String> {
    let read = SourceFile::new("a.svg".to_owned(), svg.as_bytes().to_vec());
    read.map_err(|error| error.to_string())
}

/// The polylines that `contents` sends.
fn polylines(contents: &SourceFile) -> Vec<Sent> {
    let (mut vertices, mut pen) = (Vec::new(), String::new());
    let mut sent: Vec<Sent> = Vec::new();
    let mut is_continued = false;
    for line in contents.in_order() {
        let mut words = line.sent.split(' ');
        let keyword = words.next();
        let number = |word: &str| word.parse::<f64>().expect("a number");
        match keyword {
            Some("v") => {
                let [x, y, z] = words.map(number).collect::<Vec<_>>().try_into().expect("three");
                assert_eq!(z, 0.0);
                vertices.push([x, y]);
            }
            Some("usemtl") => pen = words.next().expect("a name").to_owned(),
            Some("l") => {
                let vertex = |word| vertices[number(word) as usize - 1];
                let positions: Vec<[f64; 2]> = words.map(vertex).collect();
                match sent.last_mut() {
                    // A long polyline is sent as several lines.
                    Some((_, last)) if is_continued => {
                        assert_eq!(last.last(), positions.first());
                        last.extend(&positions[1..]);
                    }
                    _ => sent.push((pen.clone(), positions)),
                }
            }
            other => panic!("{other:?}"),
        }
        is_continued = keyword == Some("l") && line.sent.len() > LINE_LIMIT - 6;
    }
    sent
}

/// An SVG whose pixel is a millimetre, on a page of 100 mm x 100 mm.
fn in_mm(contents: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' \
         xmlns:inkscape='http://www.inkscape.org/namespaces/inkscape' \
         width='100mm' height='100mm' viewBox='0 0 100 100'>{contents}</svg>"
    )
}

fn drawn(svg: &str) -> Vec<Sent> {
    polylines(&read(svg).expect("an SVG"))
}

/// The polylines without their pens.
fn positions(svg: &str) -> Vec<Vec<[f64; 2]>> {
    drawn(svg).into_iter().map(|(_, positions)| positions).collect()
}

fn distance_to(positions: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let to_segment = |pair: &[[f64; 2]]| {
        let line = kurbo::Line::new((pair[0][0], pair[0][1]), (pair[1][0], pair[1][1]));
        kurbo::ParamCurveNearest::nearest(&line, Point::new(x, y), 1e-9).distance_sq.sqrt()
    };
    positions.windows(2).map(to_segment).fold(f64::INFINITY, f64::min)
}

/// Half a motor step in mm.
const HALF_A_STEP: f64 = 1.0 / 160.0;

/// Checks that `svg` draws one polyline within half a motor step of `curve`, which is asked for
/// parameters from 0 to 1.
fn follows(svg: &str, curve: impl Fn(f64) -> [f64; 2]) -> usize {
    let all = positions(svg);
    let [polyline] = all.as_slice() else { panic!("{all:?}") };
    let samples: Vec<[f64; 2]> = (0..=20_000).map(|at| curve(f64::from(at) / 20_000.0)).collect();
    for sample in samples.iter().step_by(7) {
        assert!(distance_to(polyline, *sample) <= HALF_A_STEP, "{sample:?}");
    }
    for position in polyline {
        assert!(distance_to(&samples, *position) <= 0.001, "{position:?}");
    }
    polyline.len()
}

#[test]
fn lines_have_their_place_with_y_upward() {
    let svg = in_mm(
        "<path d='M10 20 H30 V50' stroke='red' fill='none'/><line x2='5' y2='5' stroke='blue'/>",
    );
    assert_eq!(
        drawn(&svg),
        [
            ("pen1".to_owned(), vec![[10.0, 80.0], [30.0, 80.0], [30.0, 50.0]]),
            ("pen2".to_owned(), vec![[0.0, 100.0], [5.0, 95.0]]),
        ]
    );
}

#[test]
fn units_and_the_view_box_give_true_size() {
    for (size, page, scale) in [
        ("width='96' height='192'", [25.4, 50.8], 25.4 / 96.0),
        ("width='2in' height='1in'", [50.8, 25.4], 25.4 / 96.0),
        ("width='72pt' height='6pc'", [25.4, 25.4], 25.4 / 96.0),
        ("width='10cm' height='5cm' viewBox='0 0 1000 500'", [100.0, 50.0], 0.1),
        ("viewBox='0 0 96 96'", [25.4, 25.4], 25.4 / 96.0),
        ("width='50mm' viewBox='0 0 100 200'", [50.0, 100.0], 0.5),
    ] {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' {size} stroke='red'>\
             <path d='M0 0L20 10'/></svg>"
        );
        let contents = read(&svg).expect("an SVG");
        let Page { width, height } = contents.page().expect("a page");
        assert_eq!([width, height], page, "{size}");
        let is_told = contents.notes().iter().any(|it| it.contains("does not say its size"));
        assert_eq!(is_told, size == "viewBox='0 0 96 96'", "{size}: {:?}", contents.notes());
        let sent = polylines(&contents);
        let expected = [[0.0, height], [20.0 * scale, height - 10.0 * scale]];
        for (position, expected) in sent[0].1.iter().zip(expected) {
            assert!((position[0] - expected[0]).abs() < 6e-4, "{size}: {position:?}");
            assert!((position[1] - expected[1]).abs() < 6e-4, "{size}: {position:?}");
        }
    }
    // Adobe Illustrator writes points, and leaves the size out.
    let svg = "<!-- Generator: Adobe Illustrator 24.0.1 --><svg \
               xmlns='http://www.w3.org/2000/svg' viewBox='0 0 720 360'><circle r='9'/></svg>";
    let contents = read(svg).expect("an SVG");
    let note = "the SVG does not say its size: 96 units are taken as an inch, and its page is \
                190.5 x 95.25 mm; Adobe Illustrator takes 72: its size by --scale 1.3333 --page \
                254x127";
    assert!(contents.notes().contains(&note.to_owned()), "{:?}", contents.notes());
    // The picture keeps its proportions in the middle of the page.
    let svg = "<svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='50mm' \
               viewBox='-10 -10 20 20'><path d='M-10 -10L10 10' stroke='black'/></svg>";
    assert_eq!(positions(svg), [[[25.0, 50.0], [75.0, 0.0]]]);
}

#[test]
fn circles_and_arcs_are_followed_to_half_a_step() {
    let circle = |radius: f64| {
        move |at: f64| {
            let (sine, cosine) = (at * std::f64::consts::TAU).sin_cos();
            [50.0 + radius * cosine, 50.0 + radius * sine]
        }
    };
    let points = follows(&in_mm("<circle cx='50' cy='50' r='50'/>"), circle(50.0));
    // 199 chords would be off by half a step; rounding takes a part of that.
    assert!((199..240).contains(&points), "{points}");
    let arcs = "<path d='M90 50A40 40 0 0 1 10 50A40 40 0 0 1 90 50Z'/>";
    follows(&in_mm(arcs), circle(40.0));
    follows(&in_mm("<circle cx='.5' cy='.5' r='.4' transform='scale(100)'/>"), circle(40.0));
    let used = "<defs><circle id='c' r='40'/></defs><use href='#c' x='50' y='50'/>";
    follows(&in_mm(used), circle(40.0));
    follows(&in_mm("<ellipse cx='50' cy='50' rx='45' ry='10'/>"), |at| {
        let (sine, cosine) = (at * std::f64::consts::TAU).sin_cos();
        [50.0 + 45.0 * cosine, 50.0 + 10.0 * sine]
    });
}

#[test]
fn beziers_are_followed_to_half_a_step() {
    let points =
        follows(&in_mm("<path d='M10 10C100 20 0 80 90 90' fill='none' stroke='red'/>"), |t| {
            let u = 1.0 - t;
            let at = |a: [f64; 4]| {
                a[0] * u * u * u + 3.0 * (a[1] * u * u * t + a[2] * u * t * t) + a[3] * t * t * t
            };
            [at([10.0, 100.0, 0.0, 90.0]), 100.0 - at([10.0, 20.0, 80.0, 90.0])]
        });
    assert!(points < 110, "{points}");
    follows(&in_mm("<path d='M10 10Q90 10 90 90'/>"), |t| {
        let u = 1.0 - t;
        let at = |a: [f64; 3]| a[0] * u * u + 2.0 * a[1] * u * t + a[2] * t * t;
        [at([10.0, 90.0, 90.0]), 100.0 - at([10.0, 10.0, 90.0])]
    });
}

#[test]
fn many_short_lines_become_few() {
    let mut data = String::from("M10 50");
    for step in 1..=4000 {
        let _ = write!(data, "L{} {}", 10.0 + f64::from(step) / 50.0, 50.0 + 1e-3);
    }
    let sent = positions(&in_mm(&format!("<path d='{data}' fill='none' stroke='red'/>")));
    assert_eq!(sent.len(), 1);
    assert!(sent[0].len() < 4, "{sent:?}");
    // A line that turns back keeps its end.
    let back = positions(&in_mm("<path d='M10 50H60H20' fill='none' stroke='red'/>"));
    assert_eq!(back, [[[10.0, 50.0], [60.0, 50.0], [20.0, 50.0]]]);
}

#[test]
fn transforms_are_nested_and_references_are_followed() {
    let svg = in_mm(
        "<g transform='translate(50 50)'><g transform='rotate(90)'><g transform='scale(2 3)'>\
         <path d='M0 0H10V10' fill='none' stroke='red'/></g></g></g>\
         <defs><path id='a' d='M0 0H10' stroke='black'/></defs><use xlink:href='#a' x='5' y='6'/>\
         <symbol id='s' viewBox='0 0 10 10'><path d='M0 0L10 10' stroke='black'/></symbol>\
         <use href='#s' x='10' y='10' width='20' height='20'/>",
    );
    assert_eq!(
        positions(&svg),
        [
            vec![[50.0, 50.0], [50.0, 30.0], [20.0, 30.0]],
            vec![[5.0, 94.0], [15.0, 94.0]],
            vec![[10.0, 90.0], [30.0, 70.0]],
        ]
    );
}

#[test]
fn what_is_outside_of_the_page_or_of_a_clip_path_is_cut_off() {
    let contents =
        read(&in_mm("<path d='M-10 50H110' stroke='black'/><path d='M200 0h9' stroke='black'/>"))
            .expect("an SVG");
    assert_eq!(polylines(&contents)[0].1, [[0.0, 50.0], [100.0, 50.0]]);
    assert_eq!(contents.notes(), ["2 paths reach beyond the page of the SVG: the rest is cut off"]);
    let clipped = in_mm(
        "<clipPath id='c'><rect x='20' y='20' width='10' height='10'/></clipPath>\
         <g clip-path='url(#c)'><path d='M0 25H100' stroke='black'/></g>",
    );
    let contents = read(&clipped).expect("an SVG");
    assert_eq!(polylines(&contents)[0].1, [[20.0, 75.0], [30.0, 75.0]]);
    assert!(contents.notes().is_empty(), "{:?}", contents.notes());
}

#[test]
fn strokes_are_dashed_and_shapes_without_a_stroke_have_outlines() {
    let dashed = "<path d='M10 50H30' stroke='red' stroke-dasharray='5 3'/>";
    assert_eq!(
        positions(&in_mm(dashed)),
        [[[10.0, 50.0], [15.0, 50.0]], [[18.0, 50.0], [23.0, 50.0]], [[26.0, 50.0], [30.0, 50.0]]]
    );
    let shapes = "<rect x='10' y='10' width='5' height='5'/>\
                  <path d='M0 0H9' fill='none'/><path d='M0 0H9' style='display:none'/>\
                  <g visibility='hidden'><path d='M0 0H9' stroke='black'/></g>\
                  <g opacity='0'><path d='M0 0H9' stroke='black'/></g>";
    let contents = read(&in_mm(shapes)).expect("an SVG");
    assert_eq!(
        polylines(&contents)[0].1,
        [[10.0, 90.0], [15.0, 90.0], [15.0, 85.0], [10.0, 85.0], [10.0, 90.0]]
    );
    assert_eq!(polylines(&contents).len(), 1);
    assert!(contents.notes().is_empty(), "{:?}", contents.notes());
}

/// A program may write lines as shapes that are filled, of which nothing is seen, and white shapes
/// as the ground of a diagram.
#[test]
fn what_would_not_be_seen_is_not_drawn_and_is_told() {
    let rest = "<rect x='1' y='2' width='3' height='4' stroke='red'/>";
    let told = |more: &str| {
        let contents = read(&in_mm(&format!("{more}{rest}"))).expect("an SVG");
        (polylines(&contents).len() - 1, contents.notes().join("; "))
    };
    let flat = "filled, but without an area and without a stroke";
    for (more, number) in [
        ("<line x1='5' y1='5' x2='50' y2='9'/><polyline points='9,9 50,9 20,9'/>", 2),
        ("<path fill='blue' d='M10 20H30Z M5 5L9 9'/>", 1),
        ("<rect x='5' y='5' width='20' height='0.0001'/>", 1),
    ] {
        let (drawn, notes) = told(more);
        assert_eq!(drawn, 0, "{more}");
        assert!(notes.starts_with(&format!("{number} path")) && notes.contains(flat), "{notes}");
    }
    // A thin shape is seen, and so is each part of a path that has an area.
    assert_eq!(told("<rect x='5' y='5' width='20' height='0.01'/>"), (1, String::new()));
    assert_eq!(told("<path d='M5 5H9 M10 10H15V15'/>"), (1, String::new()));
    let white = "<rect x='20' y='20' width='30' height='20' fill='#fff'/>";
    let (drawn, notes) = told(white);
    assert_eq!(drawn, 0);
    assert!(notes.starts_with("1 shape is not drawn: filled with white alone"), "{notes}");
    // It is seen on another colour, and with a stroke; what only lies above it changes nothing.
    let black = "<circle cx='40' cy='40' r='15'/>";
    assert_eq!(told(&format!("{black}{white}")), (2, String::new()));
    assert_eq!(told(&white.replace("/>", " stroke='red'/>")), (1, String::new()));
    assert_eq!(told(&format!("{white}{black}")).0, 1);
    // A drawing for a dark ground is all white.
    let dark = format!("{white}<path d='M1 1H9' stroke='white'/>");
    assert_eq!(positions(&in_mm(&dark)).len(), 2);
}

/// Text as programs of other systems save it, and compressed.
/// A class says what an attribute may say, too.
#[test]
fn strokes_that_a_style_sheet_sets_are_judged_as_others_are() {
    let of_class = |style: &str, paths: &str| {
        in_mm(&format!(
            "<style>.a{{{style}}} .b{{fill:none;stroke:black}}</style><linearGradient id='g'>\
             <stop offset='0' stop-color='red'/><stop offset='1'/></linearGradient>{paths}\
             <path class='b' d='M10 60L90 70'/>"
        ))
    };
    // A gradient has no size along a level line, and `#nope` is nothing.
    for paint in ["url(#g)", "url(#nope)"] {
        let path = "<g class='a'><path d='M10 10H90'/></g><path class='a' d='M10 20H90'/>";
        let svg = of_class(&format!("fill:none;stroke:{paint}"), path);
        let expected =
            "2 paths are not drawn: the stroke has no width, or a paint that is not read";
        assert_eq!(read(&svg).expect("an SVG").notes(), [expected], "{paint}");
    }
    // The dashes have their length on the page, whoever says so.
    let style = "fill:none;stroke:black;stroke-dasharray:10 10;";
    let effect = "vector-effect:non-scaling-stroke";
    let dashed = |style: &str, more: &str| {
        let path = format!("<g transform='scale(10)'><path class='a' {more} d='M1 1H9'/></g>");
        drawn(&of_class(style, &path)).len() - 1
    };
    assert_eq!(dashed(style, ""), 1);
    for (style, more) in [
        (format!("{style}{effect}"), String::new()),
        (format!("{style}{effect} !important"), "style='vector-effect:none'".to_owned()),
        (style.to_owned(), "vector-effect='non-scaling-stroke'".to_owned()),
        (format!("{style}vector-effect:none"), format!("style='{effect}'")),
    ] {
        assert_eq!(dashed(&style, &more), 16, "{style} {more}");
    }
}

#[test]
fn what_an_image_that_is_an_svg_leaves_out_is_told() {
    let image = |contents: &str| {
        let inner = in_mm(contents).replace('<', "%3C").replace('#', "%23");
        in_mm(&format!(
            "<image width='100' height='100' xlink:href=\"data:image/svg+xml,{inner}\"/>"
        ))
    };
    let line = "<path stroke='black' fill='none' d='M0 10L40 10";
    let whole = image(&format!(
        "{line}L80 70'/><g><use xlink:href='%23a'/></g><rect id='a' \
         width='9' height='9' fill='none' stroke='red'/>"
    ));
    assert_eq!(read(&whole).expect("an SVG").notes(), [""; 0]);
    let broken = image(&format!(
        "{line}L40 oops L80 70'/><rect width='0' height='9'/><circle/><use xlink:href='%23b'/>"
    ));
    let file = read(&broken).expect("an SVG");
    let expected = [
        "in an SVG that is an image, 1 shape is not drawn as a whole: there is an error in the \
         data, and the rest is left out (line 1)",
        "in an SVG that is an image, 3 elements are not drawn: hidden, or without a size or \
         points, or with one in a unit that is not read, or a reference to nothing (the first in \
         line 1)",
    ];
    assert_eq!(file.notes(), expected);
}

/// A map in national coordinates, by its viewBox or by a transform.
#[test]
fn what_lies_too_far_from_the_origin_to_be_exact_is_told() {
    let path = |x: f64, y: f64| {
        let [right, top] = [x + 50.0, y + 70.0];
        format!("<path stroke='black' fill='none' d='M{x} {y}L{right} {top}'/>")
    };
    let told = |svg: &str| read(svg).expect("an SVG").notes().join("; ");
    let note = "1 path lies so far from the origin of its coordinates that it is drawn less \
                exactly than a motor step: move the drawing to the origin in the program that \
                wrote it";
    let map = in_mm(&path(500_010.0, 5_500_010.0));
    let boxed = map.replace("viewBox='0 0", "viewBox='500000 5500000");
    assert_eq!(told(&boxed), note);
    let moved =
        format!("<g transform='translate(-500000,-5500000)'>{}</g>", path(500_010.0, 5.5e6));
    assert_eq!(told(&in_mm(&moved)), note);
    assert_eq!(told(&in_mm(&path(20.0, 10.0))), "");
    // A line that only reaches far, and coordinates that are fine on a small scale.
    let long = "<path stroke='black' d='M-9e6 10L9e6 10'/>";
    assert!(!told(&in_mm(long)).contains("less exactly"));
    let fine = in_mm(&path(500_010.0, 500_010.0))
        .replace("viewBox='0 0 100 100'", "viewBox='0 0 900000 900000'");
    assert_eq!(told(&fine), "");
}

#[test]
fn text_of_other_encodings_is_read() {
    let svg = in_mm("<g id='Räume'><path d='M10 20H30' stroke='red'/></g>");
    let of = |bytes: Vec<u8>| {
        let file = SourceFile::new("a.svg".to_owned(), bytes).map_err(|error| error.to_string());
        file.map(|file| polylines(&file))
    };
    let expected = of(svg.clone().into_bytes());
    assert!(expected.is_ok());
    let utf16 = |to_bytes: fn(u16) -> [u8; 2]| {
        let text =
            format!("\u{FEFF}<?xml version='1.0' encoding='UTF-16'?><!-- Привет, мир -->{svg}");
        text.encode_utf16().flat_map(to_bytes).collect::<Vec<u8>>()
    };
    assert_eq!(of(utf16(u16::to_le_bytes)), expected);
    assert_eq!(of(utf16(u16::to_be_bytes)), expected);
    let latin1 = format!("<?xml version='1.0' encoding='ISO-8859-1'?>{svg}");
    let latin1: Vec<u8> = latin1.chars().map(|letter| letter as u8).collect();
    assert_eq!(of(latin1), expected);
    if !cfg!(feature = "svgz") {
        return;
    }
    // Blocks of gzip may be stored as they are.
    let length = u16::try_from(svg.len()).expect("short");
    let [low, high] = length.to_le_bytes();
    let mut gzip = b"\x1F\x8B\x08\0\0\0\0\0\0\xFF".to_vec();
    gzip.extend([1, low, high, !low, !high]);
    gzip.extend(svg.as_bytes());
    let checksum = svg.bytes().fold(!0_u32, |sum, byte| {
        let step = |sum: u32, _| (sum >> 1) ^ if sum & 1 == 1 { 0xEDB8_8320 } else { 0 };
        (0..8).fold(sum ^ u32::from(byte), step)
    });
    gzip.extend((!checksum).to_le_bytes());
    gzip.extend(u32::from(length).to_le_bytes());
    assert_eq!(of(gzip.clone()), expected);
    gzip.truncate(200);
    assert!(of(gzip).expect_err("damaged").contains("this compressed SVG is damaged"));
}

/// What is cut out of a web page lacks the declarations of its prefixes.
#[test]
fn prefixes_need_no_declaration() {
    let svg = "<svg width='10mm' height='10mm' viewBox='0 0 10 10'><defs><path id='a' d='M1 1H9' \
               stroke='red'/></defs><use xlink:href='#a'/><g inkscape:groupmode='layer' \
               inkscape:label='3' other:b='c'><path d='M2 5H9' stroke='red'/></g></svg>";
    assert_eq!(used_pens(svg), ["pen1", "pen3"]);
}

#[test]
fn what_is_only_filled_has_a_side_between_its_ends_and_a_stroke_has_none() {
    let corner = [[10.0, 90.0], [15.0, 90.0], [15.0, 85.0]];
    let closed = [[10.0, 90.0], [15.0, 90.0], [15.0, 85.0], [10.0, 90.0]];
    let drawn = |svg: &str| positions(&in_mm(svg));
    assert_eq!(drawn("<path d='M10 10H15V15'/>"), [closed.to_vec()]);
    assert_eq!(drawn("<path d='M10 10H15V15Z'/>"), [closed.to_vec()]);
    assert_eq!(drawn("<polyline points='10,10 15,10 15,15'/>"), [closed.to_vec()]);
    assert_eq!(drawn("<path d='M10 10H15V15' fill='none' stroke='red'/>"), [corner.to_vec()]);
    assert_eq!(drawn("<path d='M10 10H15V15' stroke='red'/>"), [corner.to_vec()]);
    // Each part of a path has its own.
    let two = "<path d='M10 10H15V15M30 30H35V35'/>";
    assert!(drawn(two).iter().all(|line| line.len() == 4) && drawn(two).len() == 2);
}

fn used_pens(svg: &str) -> Vec<String> {
    drawn(svg).into_iter().map(|(pen, _)| pen).collect()
}

#[test]
fn layers_choose_pens_or_else_colours_do() {
    let layer = |label: &str, contents: &str| {
        format!("<g inkscape:groupmode='layer' inkscape:label='{label}'>{contents}</g>")
    };
    let red = "<path d='M0 0H9' stroke='red'/>";
    let blue = "<path d='M0 5H9' stroke='blue'/>";
    let two = [layer("2 red", red), layer("outline", blue), layer("pen5", red)].concat();
    assert_eq!(used_pens(&in_mm(&two)), ["pen2", "pen1", "pen5"]);
    // A layer within a layer belongs to the outer one, and a reference to where it stands.
    let shared = "<defs><path id='p' d='M0 9H9' stroke='black'/></defs>";
    let nested = layer("1", &layer("4", red)) + &layer("3", "<g><use href='#p'/></g>") + shared;
    assert_eq!(used_pens(&in_mm(&nested)), ["pen1", "pen3"]);
    // One layer says nothing where there are colours.
    let one = layer("Layer 1", &format!("{blue}{red}{blue}"));
    assert_eq!(used_pens(&in_mm(&one)), ["pen1", "pen2", "pen1"]);
    assert_eq!(used_pens(&in_mm(&layer("pen7", red))), ["pen7"]);
    let styled = "<style>.a{stroke:#00f}</style><path class='a' d='M0 5H9'/>".to_owned() + red;
    assert_eq!(used_pens(&in_mm(&styled)), ["pen1", "pen2"]);
    let groups = format!("<g id='layer3'>{red}</g><g id='pen_4'>{red}</g>");
    assert_eq!(used_pens(&in_mm(&groups)), ["pen3", "pen4"]);
    // What a program calls a group that has no name is none, and Illustrator writes digits so.
    let group = |id: &str, contents: &str| format!("<g id='{id}'>{contents}</g>");
    let invented = group("g10", red) + &group("g12-3", red) + &group("g14", blue);
    assert_eq!(used_pens(&in_mm(&invented)), ["pen1", "pen1", "pen2"]);
    for id in ["g12", "path7-5", "rect12", "svg3"] {
        assert_eq!(used_pens(&in_mm(&group(id, red))), ["pen1"], "{id}");
    }
    let coded = group("_x32_", red) + &group("_x31__red", red) + &group("_x25_ 4", red);
    assert_eq!(used_pens(&in_mm(&coded)), ["pen2", "pen1"]);
    assert_eq!(used_pens(&in_mm(&group("line-2", red))), ["pen2"]);
    let unnamed = "<g inkscape:groupmode='layer' id='g7'>".to_owned() + red + "</g>";
    assert_eq!(used_pens(&in_mm(&(unnamed + &layer("g7", red)))), ["pen1", "pen7"]);
}

#[test]
fn the_codes_of_axidraw_are_obeyed_or_named() {
    let layer = |label: &str, y: u32| {
        format!(
            "<g inkscape:groupmode='layer' inkscape:label='{label}'>\
             <path d='M0 {y}H9' stroke='black'/></g>"
        )
    };
    let notes = "<g inkscape:groupmode='layer' inkscape:label='% notes'><text>a</text></g>";
    let svg = in_mm(&[layer("2", 1), layer("! 2 +S50+D100 red", 2), layer("%3", 3)].concat());
    let svg = svg.replace("</svg>", &format!("{notes}</svg>"));
    assert_eq!(used_pens(&svg), ["pen2", "pen1"]);
    let contents = read(&svg).expect("an SVG");
    assert_eq!(
        contents.notes(),
        [
            "the layer \"! 2 +S50+D100 red\" is drawn with the speed and the pen of the others: \
             +S50 +D100 cannot be obeyed",
            "1 path is not drawn: the name of the layer begins with %",
        ]
    );
    let error = read(&in_mm(&layer("%", 3))).map(drop).expect_err("nothing to draw");
    assert!(error.contains("1 path is in layers that are not plotted"), "{error}");
    let alone = read(&in_mm(&layer("!1", 3))).expect("an SVG");
    assert!(alone.notes()[0].starts_with("there is no pause before the layer \"!1\""));
}

/// Reads an SVG and arranges it by these options.
fn arranged(svg: &str, options: &[(&str, &str)]) -> Result<SourceFile, String> {
    let mut arrangement = Arrangement::default();
    for (option, value) in options {
        arrangement.set(option, value)?;
    }
    let file = SourceFile::arranged("a.svg".to_owned(), svg.into(), &arrangement);
    file.map_err(|error| error.to_string())
}

/// The dots of icons are such lines: a plotter leaves out what is shorter than two of its steps.
#[test]
fn what_is_too_short_for_a_plotter_becomes_a_dot() {
    let svg = in_mm(
        "<g stroke='black' fill='none'><path d='M10 10h.01M10 20v.02M10 30h50M99.99 40v.01'/>\
         <circle cx='50' cy='50' r='.01'/><path d='M70 70h.04'/><path d='M70.04 70h.04'/></g>",
    );
    let lengths = |options: &[(&str, &str)]| -> Vec<f64> {
        let lines = polylines(&arranged(&svg, options).expect("a plan"));
        let ends = lines.iter().map(|(_, points)| points[points.len() - 1][0] - points[0][0]);
        ends.map(|length| (length * 1e3).round() / 1e3).collect()
    };
    let notes =
        |options: &[(&str, &str)]| arranged(&svg, options).expect("a plan").notes().join("; ");
    // What goes on as another line is a part of a longer one.
    assert_eq!(lengths(&[]), [0.08, 0.08, 50.0, -0.08, 0.08, 0.04, 0.04]);
    assert_eq!(notes(&[]), "4 lines are drawn as dots: they are shorter than 0.05 mm");
    assert_eq!(lengths(&[("scale", "0.02")])[..3], [0.08, 0.08, 1.0]);
    assert_eq!(lengths(&[("scale", "10")])[..3], [0.1, 0.0, 500.0]);
    let page = Some(Page { width: 1000.0, height: 1000.0 });
    let fitted = Arrangement::on(page, Default::default(), None).fitted(" ", 5.0);
    let file = SourceFile::arranged("a.svg".to_owned(), svg.clone().into(), &fitted);
    assert_eq!(polylines(&file.expect("a plan"))[0].1[1][0], 10.01, "the plotter scales it up");
}

#[test]
fn layers_are_chosen_by_label_number_or_colour() {
    let layer = |label: &str, y: u32| {
        format!(
            "<g inkscape:groupmode='layer' inkscape:label='{label}'>\
             <path d='M0 {y}H9' stroke='black'/></g>"
        )
    };
    let svg = in_mm(&[layer("Sky", 1), layer("4 house", 2), layer("Tree", 3)].concat());
    let heights = |svg: &str, options: &[(&str, &str)]| -> Vec<f64> {
        let file = arranged(svg, options).expect("a plan");
        polylines(&file).iter().map(|(_, points)| 100.0 - points[0][1]).collect()
    };
    assert_eq!(heights(&svg, &[("layer", "sky,4")]), [1.0, 2.0]);
    assert_eq!(heights(&svg, &[("layer", "Tree")]), [3.0]);
    let file = arranged(&svg, &[("layer-order", "Tree,4 house")]).expect("a plan");
    let pens: Vec<String> = polylines(&file).into_iter().map(|(pen, _)| pen).collect();
    assert_eq!(pens, ["pen3", "pen2", "pen1"]);
    let coloured = in_mm("<path d='M0 1H9' stroke='red'/><path d='M0 2H9' stroke='#00f'/>");
    assert_eq!(heights(&coloured, &[("layer", "#0000FF")]), [2.0]);
    let error = arranged(&svg, &[("layer", "sea")]).map(drop).expect_err("refused");
    assert!(error.contains("no layer \"sea\"; there are \"Sky\" (pen 1)"), "{error}");
}

#[test]
fn filled_shapes_are_hatched_within_the_page_and_holes_stay_free() {
    let svg = in_mm(
        "<path d='M10 10H30V30H10ZM15 15V25H25V15Z'/>\
         <rect x='50' y='50' width='10' height='10' fill='none' stroke='red'/>\
         <rect x='70' y='70' width='10' height='10' fill='#fff' stroke='red'/>\
         <rect x='90' y='10' width='50' height='10'/>",
    );
    let outlines = polylines(&read(&svg).expect("an SVG")).len();
    let file = arranged(&svg, &[("hatch", "2,0")]).expect("a plan");
    let lines = polylines(&file).split_off(outlines);
    let length = |line: &Sent| line.1[1][0] - line.1[0][0];
    let ink: f64 = lines.iter().map(|line| length(line).abs()).sum();
    // 300 and 100 square millimetres by lines that are 2 mm apart.
    assert!((ink - 200.0).abs() < 20.0, "{ink}");
    for (_, points) in &lines {
        let middle = [f64::midpoint(points[0][0], points[1][0]), 100.0 - points[0][1]];
        let is_between = |from: [f64; 2], to: [f64; 2]| {
            (0..2).all(|axis| (from[axis]..=to[axis]).contains(&middle[axis]))
        };
        let is_ring = is_between([10.0; 2], [30.0; 2]) && !is_between([15.1; 2], [24.9; 2]);
        assert!(is_ring || is_between([90.0, 10.0], [100.0, 20.0]), "{points:?}");
        assert!(points.iter().all(|point| point[0] <= 100.0), "{points:?}");
    }
    // Outlines of one direction leave a hole by the rule that says so.
    let ink = |rule: &str| -> f64 {
        let svg = in_mm(&format!("<path d='M10 10H30V30H10ZM15 15H25V25H15Z' {rule}/>"));
        let file = arranged(&svg, &[("hatch", "2,0")]).expect("a plan");
        polylines(&file).split_off(2).iter().map(|line| length(line).abs()).sum()
    };
    assert_eq!([ink(""), ink("fill-rule='evenodd'")], [200.0, 150.0]);
    // A white shape does not hide the lines of what lies below it.
    let white = "<path d='M10 10H30V30H10Z'/><circle cx='20' cy='20' r='5' fill='white'/>";
    let told = |options: &[(&str, &str)]| {
        arranged(&in_mm(white), options).expect("a plan").notes().join("; ")
    };
    assert_eq!(told(&[]), "");
    assert_eq!(
        told(&[("hatch", "2")]),
        "1 white shape lies on a filled one, and the lines of --hatch go through it"
    );
    let outline = in_mm("<rect width='10' height='10' fill='none' stroke='red'/>");
    let error = arranged(&outline, &[("hatch", "2")]).map(drop).expect_err("nothing filled");
    assert!(error.contains("no closed, filled shape"), "{error}");
}

#[test]
fn what_is_not_drawn_is_counted() {
    let svg = in_mm(
        "<path d='M0 0H9' stroke='black'/>\n<text>a</text>\n<text>b</text>\
         <image href='a.png' width='9' height='9'/>\
         \n<path d='M0 0H5 L x' stroke='red'/>\n<rect width='-1' height='5'/><use href='#none'/>\
         <mask id='m' maskUnits='userSpaceOnUse' width='9' height='9'>\
         <image href='b.png' y='5' width='9' height='9'/></mask>\
         <path mask='url(#m)' d='M0 9H9' stroke='red'/><path d='M5 5h0' stroke='red'/>",
    );
    assert_eq!(
        read(&svg).expect("an SVG").notes(),
        [
            "2 texts are not drawn, because a page has no fonts: open the file with penup page \
             (the first in line 2)",
            "1 image is not drawn: only those that are SVG are (line 3)",
            "1 shape is not drawn as a whole: there is an error in the data, and the rest is left \
             out (line 4)",
            "2 elements are not drawn: hidden, or without a size or points, or with one in a \
             unit that is not read, or a reference to nothing (the first in line 5)",
            "1 mask is not applied as a whole: what a gradient, an image, a pattern or a filter \
             hides is drawn",
            "1 line is not drawn: dots have no length",
        ]
    );
}

#[test]
fn each_line_cites_its_element() {
    let svg = in_mm("\n<g>\n<path\n d='M0 0H9' stroke='red'/></g>");
    let contents = read(&svg).expect("an SVG");
    let origins: BTreeSet<(usize, String)> = (contents.in_order().filter_map(|line| line.origin))
        .map(|origin| (origin.line, origin.text))
        .collect();
    assert_eq!(origins, BTreeSet::from([(3, "<path".to_owned())]));
    let svg = in_mm("<circle id='a' cx='9' cy='9' r='9'/>\n<circle cx='9' cy='9' r='5'/>");
    let contents = read(&svg).expect("an SVG");
    let last = contents.line(contents.count() - 1).and_then(|line| line.origin);
    let last = last.expect("an origin");
    assert_eq!((last.line, last.text.as_str()), (2, "<circle cx='9' cy='9' r='5'/>"));
}

#[test]
fn every_line_is_one_that_a_plotter_takes() {
    let mut data = String::from("M0 0");
    for step in 0..2000 {
        let _ = write!(data, "L{} {}", step * 37 % 91, step * 53 % 97);
    }
    let contents = read(&in_mm(&format!("<path d='{data}'/>"))).expect("an SVG");
    for line in contents.in_order() {
        assert!(line.sent.len() <= LINE_LIMIT, "{}", line.sent);
        assert!(penup::protocol::Command::parse(&line.sent).is_ok(), "{}", line.sent);
    }
    let sent = polylines(&contents);
    assert_eq!(sent.len(), 1);
    assert!(sent[0].1.len() > 1900);
}

#[test]
fn a_large_drawing_says_how_many_points_it_has() {
    let line = |number: i32| format!("M{} {}h.01", number % 90, number / 90);
    let data: String = (0..2500).map(line).collect();
    let contents = read(&in_mm(&format!("<path d='{data}' stroke='red'/>"))).expect("an SVG");
    let notes = contents.notes();
    let [note] = notes else { panic!("{notes:?}") };
    assert!(note.starts_with("the drawing has 5000 points, and lm3s6965 takes 1000"), "{note}");
}

#[test]
fn a_file_that_cannot_be_drawn_is_refused_with_a_sentence() {
    let deep = |depth: usize| {
        in_mm(&format!(
            "{}<path d='M0 0H9' stroke='black'/>{}",
            "<g>".repeat(depth),
            "</g>".repeat(depth)
        ))
    };
    // As deep as `usvg` goes, a file needs more stack than a test has.
    let deepest = deep(900);
    let reader = std::thread::Builder::new().stack_size(256 << 20);
    let reader = reader.spawn(move || positions(&deepest).len()).expect("a thread");
    assert_eq!(reader.join().expect("no panic"), 1);
    let numbers = "<path d='M0 0L1e38 1e38'/><circle r='NaN'/><path d='M-1e39 0L1e300 5'/>";
    let huge = "<svg xmlns='http://www.w3.org/2000/svg' width='1e38' height='1e38'>\
                <path d='M0 0H1e30V9'/></svg>";
    for (svg, reason) in [
        (String::new(), "the file is empty"),
        ("<svg".to_owned(), "this is not a well-formed SVG"),
        ("<html/>".to_owned(), "this is a web page"),
        ("<htm/>".to_owned(), "this is not a well-formed SVG"),
        (in_mm("<path d='M0 0H9'/>"), "1 path is not drawn: filled, but without an area"),
        (in_mm(""), "there is nothing to draw in this SVG"),
        (in_mm("<text>a</text>"), "nothing to draw in this SVG; 1 text is not drawn"),
        (in_mm("<path fill='none' d='M0 0H9'/>"), "1 path has neither a stroke nor a fill"),
        (in_mm("").replace("100mm", "0"), "the SVG has no size"),
        (in_mm("<path d='M0 0H9' stroke='red'/>").replace("100 100'", "0 0'"), "has no size"),
        (in_mm("").replace("100mm", "NaN"), "nothing to draw"),
        (deep(5000), "nested too deeply"),
        (in_mm("<circle r='1e30'/>"), "a curve of kilometres"),
        (in_mm("<path d='M0 0C1e30 0 0 1e30 9 9'/>"), "a curve of kilometres"),
        (in_mm("<g id='a'><use href='#a'/></g>"), "nothing to draw"),
    ] {
        let error = read(&svg).map(|contents| polylines(&contents)).expect_err(&svg);
        assert!(error.starts_with("a.svg: ") && error.contains(reason), "{error}");
    }
    // Whatever these draw, they neither panic nor take long.
    for svg in [in_mm(numbers), huge.to_owned()] {
        let _ = read(&svg);
    }
    let error = SourceFile::new("a.svg".to_owned(), vec![0x1F, 0x8B, 8]).expect_err("compressed");
    assert!(error.to_string().contains("damaged or not whole"), "{error}");
    let error = SourceFile::new("a.svg".to_owned(), b"<svg>\xFF".to_vec()).expect_err("no text");
    assert!(error.to_string().contains("UTF-8"), "{error}");
}

mod clips;
mod css;
mod embedded;
mod masks;
mod sizes;
#[cfg(feature = "text")]
mod texts;
