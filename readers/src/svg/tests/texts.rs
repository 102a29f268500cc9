//! Tests of texts, in a font that is made here: its only letter, `a`, is a square.

use super::*;
use crate::Arrangement;
use crate::fonts::Fonts;
use usvg::fontdb::Database;

/// A TrueType font of this family. Its letter `a` is a square from 0 to 500 of 1000 units, and
/// 1000 units wide.
fn font(family: &str) -> Vec<u8> {
    let words =
        |words: &[u16]| -> Vec<u8> { words.iter().flat_map(|it| it.to_be_bytes()).collect() };
    let head = [
        &words(&[1, 0, 1, 0, 0, 0, 0x5F0F, 0x3CF5, 0, 1000, 0, 0, 0, 0, 0, 0, 0, 0])[..],
        &words(&[0, 0, 500, 500, 0, 8, 2, 0, 0]),
    ];
    let square = [
        &words(&[1, 0, 0, 500, 500, 3, 0])[..],
        // Four points on the outline; first their flags, then the ways between them.
        &[1; 4],
        &words(&[0, 0, 500, 0, 0, 500, 0, (-500_i16).cast_unsigned()]),
    ]
    .concat();
    let half = u16::try_from(square.len() / 2).expect("small");
    let name: Vec<u8> = family.encode_utf16().flat_map(u16::to_be_bytes).collect();
    let length = u16::try_from(name.len()).expect("short");
    let names =
        [&words(&[0, 2, 30, 3, 1, 0x409, 1, length, 0, 3, 1, 0x409, 6, length, 0])[..], &name];
    let maxp = words(&[1, 0, 2, 4, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    let letters = [
        &words(&[0, 1, 3, 1, 0, 12])[..],
        &words(&[4, 32, 0, 4, 4, 1, 0, 97, 0xFFFF, 0, 97, 0xFFFF, 1_u16.wrapping_sub(97), 1, 0, 0]),
    ];
    let mut tables: Vec<([u8; 4], Vec<u8>)> = vec![
        (*b"cmap", letters.concat()),
        (*b"glyf", square),
        (*b"head", head.concat()),
        (
            *b"hhea",
            words(&[
                1,
                0,
                800,
                (-200_i16).cast_unsigned(),
                0,
                1000,
                0,
                0,
                0,
                1,
                0,
                0,
                0,
                0,
                0,
                0,
                0,
                2,
            ]),
        ),
        (*b"hmtx", words(&[1000, 0, 1000, 0])),
        (*b"loca", words(&[0, 0, half])),
        (*b"maxp", maxp),
        (*b"name", names.concat()),
        (*b"post", words(&[3, 0, 0, 0, 0, 50, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0])),
    ];
    tables.sort();
    let count = u16::try_from(tables.len()).expect("few");
    let mut file = words(&[1, 0, count, 128, 3, count * 16 - 128]);
    let mut at = file.len() + tables.len() * 16;
    for (tag, table) in &tables {
        let numbers =
            [0, u32::try_from(at).expect("small"), u32::try_from(table.len()).expect("small")];
        file.extend(tag);
        file.extend(numbers.iter().flat_map(|it| it.to_be_bytes()));
        at += table.len().next_multiple_of(4);
    }
    for (_, mut table) in tables {
        table.resize(table.len().next_multiple_of(4), 0);
        file.extend(table);
    }
    file
}

fn squares() -> Database {
    let mut database = Database::new();
    database.load_font_data(font("Squares"));
    assert_eq!(database.len(), 1, "the font is whole");
    database
}

fn read_in(find: fn() -> Database, svg: &str) -> Result<SourceFile, String> {
    let arrangement = Arrangement::default().with_fonts(Fonts::found_by(find));
    let bytes = svg.as_bytes().to_vec();
    let read = SourceFile::arranged("a.svg".to_owned(), bytes, &arrangement);
    read.map_err(|error| error.to_string())
}

#[test]
fn a_text_is_drawn_as_the_outlines_of_its_letters() {
    let svg = in_mm("<text x='20' y='30' font-family='Squares' font-size='10'>aa</text>");
    let contents = read_in(squares, &svg).expect("an SVG");
    assert_eq!(contents.notes(), [""; 0]);
    let square = |x: f64| [[x, 70.0], [x + 5.0, 75.0]];
    let corners: Vec<[[f64; 2]; 2]> = polylines(&contents)
        .into_iter()
        .map(|(_, points)| {
            assert_eq!(points.len(), 5);
            let of = |pick: fn(f64, f64) -> f64, axis: usize| {
                points.iter().map(|point| point[axis]).fold(points[0][axis], pick)
            };
            [[of(f64::min, 0), of(f64::min, 1)], [of(f64::max, 0), of(f64::max, 1)]]
        })
        .collect();
    assert_eq!(corners, [square(20.0), square(30.0)]);
    let origin = contents.line(contents.count() - 1).and_then(|line| line.origin);
    assert!(origin.expect("an origin").text.starts_with("<text x='20'"));
}

#[test]
fn a_font_that_is_missing_is_named_and_so_is_the_one_that_serves() {
    let text = |font: &str| format!("<text x='9' y='9' {font}>a</text>\n");
    let svg = in_mm(
        &[
            text("font-family='Helvetica, Arial'"),
            text("font-family='Nice Script'"),
            text("style='font-family:&quot;Nice Script&quot;'"),
            text("font-family='Nowhere, Squares'"),
            text("font-family='serif'"),
            text(""),
        ]
        .concat(),
    );
    assert_eq!(
        read_in(squares, &svg).expect("an SVG").notes(),
        [
            "1 text is drawn in Squares, because none of the fonts Helvetica, Arial is there",
            "2 texts are drawn in Squares, because the font Nice Script is missing",
        ]
    );
}

#[test]
fn letters_that_no_font_has_are_named() {
    let svg = in_mm("<text x='9' y='9' font-family='Squares'>abba c</text>");
    assert_eq!(
        read_in(squares, &svg).expect("an SVG").notes(),
        ["letters are not drawn as such, because no font has them, among them: b"]
    );
}

#[test]
fn a_computer_without_fonts_draws_no_text_and_says_so() {
    let svg = in_mm(
        "<path d='M0 0H9' stroke='black'/><text>a</text><text> </text><defs><text>b</text></defs>",
    );
    let said = "1 text is not drawn: no font for it is found, or it has no size: convert text to \
                paths (line 1)";
    assert_eq!(read_in(Database::new, &svg).expect("an SVG").notes(), [said]);
    let without_size = in_mm("<path d='M0 0H9' stroke='black'/><text font-size='0'>a</text>");
    assert_eq!(read_in(squares, &without_size).expect("an SVG").notes(), [said]);
}

#[test]
fn layers_and_colours_choose_the_pens_of_texts() {
    let svg = in_mm(
        "<g id='2'><text x='9' y='9' font-family='Squares'>a</text></g>\
         <g id='1'><path d='M0 0H9' stroke='black'/></g><g id='%3'><text x='9' y='50'>a</text></g>",
    );
    let contents = read_in(squares, &svg).expect("an SVG");
    let pens: Vec<String> = polylines(&contents).into_iter().map(|(pen, _)| pen).collect();
    assert_eq!(pens, ["pen2", "pen1"]);
}

#[test]
fn the_size_of_letters_is_read_beside_the_height_of_lines() {
    let size = |svg: &str| {
        let contents = read_in(squares, &in_mm(svg)).expect("an SVG");
        assert!(contents.notes().is_empty(), "{svg}: {:?}", contents.notes());
        let (_, points) = polylines(&contents).remove(0);
        let right = points.iter().map(|point| point[0]).fold(0.0, f64::max);
        // The letter is half as wide as it is large.
        2.0 * (right - 20.0)
    };
    let text = |font: &str| {
        [
            format!("<text x='20' y='30' style=\"fill:red;{font};stroke:none\">a</text>"),
            format!("<style>text{{{font};fill:red}}</style><text x='20' y='30'>a</text>"),
        ]
    };
    for font in [
        "font:4px/1.5 Squares",
        "font: italic bold 4px / normal Squares, sans-serif",
        "font:4px/calc(1px + 2px)&quot;Squares&quot;",
        "font:4px/120% 'Squares' !important",
        "--a:b/c;font:4px Squares",
    ] {
        for svg in text(font) {
            assert_eq!(size(&svg), 4.0, "{svg}");
        }
    }
    let svg = in_mm("<text x='20' y='30' style='font:caption'>a</text>");
    let notes = read_in(squares, &svg).expect("an SVG").notes().join("; ");
    assert!(notes.contains("the property font of CSS, which is not obeyed"), "{notes}");
}

/// Browsers give the places in `x` to the letters that are shown, and so does this reader.
#[test]
fn letters_that_are_not_shown_take_no_place() {
    let first = |x: &str, hidden: &str| {
        let svg = in_mm(&format!(
            "<style>.h{{display:none}}</style><g transform='translate(30 30)'><text x='{x}' y='40' \
             font-family='Squares' font-size='5'>{hidden}<tspan>a</tspan></text></g>"
        ));
        let read = read_in(squares, &svg).expect("an SVG");
        let lines = polylines(&read);
        (lines.len(), lines[0].1[0], read.notes().to_vec())
    };
    let shown = (1, [70.0, 30.0], Vec::new());
    for hidden in [
        "",
        "<tspan display='none'>a</tspan>",
        "<tspan style='display: none'>a\n<tspan fill='red'>a</tspan></tspan>",
        "<tspan class='h'>a</tspan>",
        "<tspan systemLanguage='de, fr-CH'>a</tspan>",
        "<tspan font-size='0'>a</tspan>",
    ] {
        assert_eq!(first("40", hidden), shown, "{hidden}");
        assert_eq!(first("40 45", hidden), shown, "{hidden}");
    }
    for seen in ["<tspan systemLanguage='de, en-GB'>a</tspan>", "<tspan display='inline'>a</tspan>"]
    {
        assert_eq!(first("40", seen).0, 2, "{seen}");
    }
}
