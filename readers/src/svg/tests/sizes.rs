//! Tests of the size that an SVG says it has.

use super::*;

/// The page of an SVG of 100 x 50 units, its first vertex, and whether its size is not said.
fn sized(size: &str) -> ([f64; 2], [f64; 2], bool) {
    let svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' {size} viewBox='0 0 100 50'>\
         <path d='M10 25H90' stroke='red'/></svg>"
    );
    let contents = read(&svg).expect("an SVG");
    let Page { width, height } = contents.page().expect("a page");
    let is_told = contents.notes().iter().any(|it| it.contains("does not say its size"));
    ([width, height], polylines(&contents)[0].1[0], is_told)
}

#[test]
fn each_unit_of_css_gives_true_size_and_a_percentage_follows_from_the_view_box() {
    for size in [
        "width='100mm' height='50mm'",
        "width='100MM' height='50MM'",
        "width='400Q' height='200q'",
        "width=' 10Cm ' height='50mm\n'",
        "width='1E2mm' height='50mm'",
        "width='100%' height='50mm'",
        "width='100mm' height='100%'",
        "width='50%' height='5CM'",
        "width='100mm' height='50vh'",
        "width='100 mm' height='50mm'",
        "width='auto' height='200Q'",
        "height='50MM'",
    ] {
        assert_eq!(sized(size), ([100.0, 50.0], [10.0, 25.0], false), "{size}");
    }
}

#[test]
fn a_size_that_depends_on_the_window_or_is_no_length_is_not_said() {
    for size in [
        "",
        "width='100%' height='100%'",
        "width='50vw' height='25vw'",
        "width='100 mm' height='50 mm'",
        "width='100%' height='50vh'",
        "width='calc(1mm)' height=''",
        "width='1e400mm' height='-'",
        "width='infmm' height='é'",
    ] {
        assert_eq!(sized(size), ([26.458, 13.229], [2.646, 6.614], true), "{size}");
    }
}

#[test]
fn units_in_capitals_are_units_and_other_lengths_are_named() {
    let drawn = |shape: &str| {
        let contents = read(&in_mm(shape)).expect("an SVG");
        (polylines(&contents), contents.notes().to_vec())
    };
    let small = drawn("<rect x='5mm' y='1cm' width='20mm' height='10mm' stroke='red'/>");
    for shape in [
        "<rect x='5MM' y='1Cm' width='80Q' height='40q' stroke='red'/>",
        "<rect x='5MM' y='1CM' width='20mm' height='10MM' stroke='red' stroke-width='1MM'/>",
    ] {
        assert_eq!(drawn(shape), small, "{shape}");
    }
    let diagonal = "<line x1='5mm' y1='1cm' x2='25mm' y2='20mm' stroke='red'/>";
    assert_eq!(drawn(&diagonal.replace("mm", "MM").replace("cm", "CM")), drawn(diagonal));
    let dashes = |dashes: &str| drawn(&format!("<path d='M5 5H30' stroke='red' {dashes}/>"));
    let small = dashes("stroke-dasharray='1mm,2mm'");
    for capitals in [
        "stroke-dasharray='1MM,  8Q'",
        "style='stroke-dasharray:1MM /* a */ 8q'",
        "class='a'/><style>.a{stroke-dasharray:1MM,8q}</style><g",
    ] {
        assert_eq!(dashes(capitals), small, "{capitals}");
    }
    let line = "<path d='M5 5H30' stroke='red'/>";
    for (shape, what) in [
        ("<circle cx='9' cy='9' r='2rem' stroke='red'/>", "a length in rem as r"),
        ("<rect width='10vw' height='5' stroke='red'/>", "a length in vw as width"),
        ("<circle r='calc(1px + 2px)' stroke='red'/>", "a calculation as r"),
        ("<path d='M5 5H30' stroke='red' style='stroke-dasharray:1,2vh'/>", "a length in vh as st"),
        ("<rect x='12,5' width='5' height='5' stroke='red'/>", "the value \"12,5\" as x"),
        ("<rect width='5 mm' height='5' stroke='red'/>", "the value \"5 mm\" as width"),
        ("<text x='1 2;' y='-.5'>a</text>", "the value \"2;\" as x"),
        ("<use href='#a' style='width:5mm'/>", "the property width of CSS"),
        ("<style>use{height:5mm}</style><use href='#a'/>", "the property height of CSS"),
    ] {
        let (_, notes) = drawn(&format!("{line}{shape}"));
        let said = format!("1 element or style sheet has {what}");
        assert!(notes.iter().any(|note| note.starts_with(&said)), "{shape}: {notes:?}");
    }
    for harmless in ["font-size='medium'", "letter-spacing='normal'", "r='50%' x='1e1 -2E-1,3'"] {
        assert!(drawn(&format!("<g {harmless}>{line}</g>")).1.is_empty(), "{harmless}");
    }
}

#[test]
fn programs_whose_pixels_have_another_size_are_told() {
    let note = |attributes: &str| {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' \
             xmlns:inkscape='http://www.inkscape.org/namespaces/inkscape' {attributes} \
             viewBox='0 0 720 360'><path d='M10 25H90' stroke='red'/></svg>"
        );
        read(&svg).expect("an SVG").notes().join("; ")
    };
    let illustrator = "width='720px' height='360px' data-by='Adobe Illustrator 24'";
    assert_eq!(
        note(illustrator),
        "the SVG gives its size in px: 96 units are taken as an inch, and its page is 190.5 x \
         95.25 mm; Adobe Illustrator takes 72: its size by --scale 1.3333 --page 254x127"
    );
    let inkscape =
        |version: &str, size: &str| note(&format!("inkscape:version='{version}' {size}"));
    let size = "width='744.09448' height='1052.3622'";
    for version in ["0.91 r13725", "0.48.4 r9939"] {
        let note = inkscape(version, size);
        let hint = "Inkscape before 0.92 takes 90: its size by --scale 1.0667 --page 210x297";
        assert!(note.ends_with(hint), "{note}");
        assert_eq!(inkscape(version, "width='210mm' height='297mm'"), "");
    }
    for version in ["0.92.4", "1.3.2 (091e20e)", "0.x", ""] {
        assert_eq!(inkscape(version, size), "");
    }
}

#[test]
fn a_picture_without_a_size_is_not_drawn() {
    let path = "<path d='M1 1H9' stroke='red'/>";
    for size in ["width='0' height='0'", "height='0mm'", "viewBox='0 0 0 9'"] {
        let svg = in_mm(&format!("{path}<svg {size}>{path}</svg>"));
        assert_eq!(positions(&svg).len(), 1, "{size}");
    }
    assert_eq!(positions(&in_mm(&format!("{path}<svg width='9'>{path}</svg>"))).len(), 2);
}

#[test]
fn a_symbol_with_a_size_has_it_where_it_is_used() {
    let used = |size: &str, own: &str| {
        let path = "<path d='M1 1H9' stroke='red'/>";
        positions(&in_mm(&format!(
            "<symbol id='s' viewBox='0 0 10 10' {size}>{path}</symbol><use href='#s' {own}/>"
        )))
    };
    let size = "width='20' height='20'";
    assert_eq!(used(size, ""), [[[2.0, 98.0], [18.0, 98.0]]]);
    assert_eq!(used(size, ""), used("", size));
    assert_eq!(used(size, "width='10' height='10'"), [[[1.0, 99.0], [9.0, 99.0]]]);
    assert_eq!(used("width='20'", "height='20'"), used("", size));
}

#[test]
fn a_percentage_of_a_use_of_a_symbol_is_that_of_the_picture() {
    let path = "<path d='M1 1H9V9' stroke='red'/>";
    let used = |own: &str| {
        format!("<symbol id='s' viewBox='0 0 10 10'>{path}</symbol><use href='#s' {own}/>")
    };
    for (parts, lengths) in [
        ("width='50%' height='50%'", "width='50' height='50'"),
        ("width='50%' height='20'", "width='50' height='20'"),
        ("height=' 3e1% '", "height='30'"),
        ("x='40%' y='20%' width='50' height='50'", "x='40' y='20' width='50' height='50'"),
        ("x='10%' y='10%' width='20%' height='20%'", "x='10' y='10' width='20' height='20'"),
    ] {
        let expected = positions(&in_mm(&used(lengths)));
        assert_eq!(expected.len(), 1, "{lengths}");
        assert_eq!(positions(&in_mm(&used(parts))), expected, "{parts}");
        // Of a picture without a viewBox, and of one within another.
        let sized = |own: &str| {
            let svg = "<svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='1e2MM'>";
            positions(&format!("{svg}{}</svg>", used(&own.replace("0'", "0mm'"))))
        };
        assert_eq!(sized(parts), sized(lengths), "{parts}");
        let nested = |own: &str| {
            let inner = used(own);
            in_mm(&format!("<svg width='40' height='40' viewBox='0 0 100 100'>{inner}</svg>"))
        };
        assert_eq!(positions(&nested(parts)), positions(&nested(lengths)), "{parts}");
    }
    // The picture within another has a part of that one as its size.
    let nested =
        |size: &str, own: &str| positions(&in_mm(&format!("<svg {size}>{}</svg>", used(own))));
    let expected = nested("width='50' height='50'", "width='25' height='25'");
    let half = "width='50%' height='50%'";
    assert_eq!(nested(half, half), expected);
    assert_eq!(nested("", half), positions(&in_mm(&used("width='50' height='50'"))));
    // The symbol has a part of the picture as its size.
    let part = format!(
        "<symbol id='s' viewBox='0 0 10 10' width='50%' height='50%'>{path}</symbol>\
         <use href='#s'/>"
    );
    let expected = positions(&in_mm(&used("width='50' height='50'")));
    assert_eq!(positions(&in_mm(&part)), expected);
}
