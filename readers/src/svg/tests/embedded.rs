//! Tests of SVG files that are images in another one.

use super::*;
use crate::files::Files;

/// An SVG as an address of data, in which `#` and `"` stand as their codes.
fn as_data(svg: &str) -> String {
    let coded = svg.replace('%', "%25").replace('#', "%23").replace('"', "%22");
    format!("data:image/svg+xml;utf8,{}", coded.replace('<', "%3C").replace('\'', "%27"))
}

const INNER: &str = "<svg xmlns='http://www.w3.org/2000/svg' width='20' height='10' \
                     viewBox='0 0 40 20'><path id='a' d='M0 10H60' stroke='#00f'/></svg>";

fn image(href: &str, attributes: &str) -> String {
    in_mm(&format!(
        "<path id='a' d='M0 0H9' stroke='red'/><g transform='translate(10 20)'>\
         <image href='{href}' {attributes}/></g>"
    ))
}

#[test]
fn an_svg_within_an_svg_is_drawn_in_its_place_and_cut_at_its_page() {
    for (attributes, line) in [
        // Twice as large, in the middle of the height.
        ("width='40' height='60'", [[10.0, 50.0], [50.0, 50.0]]),
        ("width='40' height='60' preserveAspectRatio='xMidYMin'", [[10.0, 70.0], [50.0, 70.0]]),
        ("width='40' height='60' preserveAspectRatio='none'", [[10.0, 50.0], [50.0, 50.0]]),
        ("x='5' y='5'", [[15.0, 70.0], [35.0, 70.0]]),
        // Six times as large, and cut at the sides.
        (
            "width='40' height='60' preserveAspectRatio='xMidYMid slice'",
            [[10.0, 50.0], [50.0, 50.0]],
        ),
    ] {
        let contents = read(&image(&as_data(INNER), attributes)).expect("an SVG");
        assert!(contents.notes().is_empty(), "{:?}", contents.notes());
        let drawn: Vec<Vec<[f64; 2]>> =
            polylines(&contents).into_iter().map(|(_, points)| points).collect();
        assert_eq!(drawn, [vec![[0.0, 100.0], [9.0, 100.0]], line.to_vec()], "{attributes}");
    }
}

#[test]
fn a_file_beside_an_svg_is_drawn_if_the_caller_reads_files() {
    let svg = image("in%20here.svg", "width='40' height='20'");
    let files = Files::read_by(|path| (path == "in%20here.svg").then(|| INNER.into()));
    let arrangement = Arrangement::default().with_files(files);
    let read_so = |arrangement: &Arrangement| {
        SourceFile::arranged("a.svg".to_owned(), svg.clone().into_bytes(), arrangement)
            .expect("an SVG")
    };
    let contents = read_so(&arrangement);
    assert_eq!(polylines(&contents).len(), 2);
    assert!(contents.notes().is_empty(), "{:?}", contents.notes());
    let contents = read_so(&Arrangement::default());
    assert_eq!(polylines(&contents).len(), 1);
    assert!(contents.notes()[0].starts_with("1 image is not drawn"), "{:?}", contents.notes());
}

#[test]
fn what_an_svg_within_an_svg_does_not_draw_is_named() {
    let inner = INNER.replace(
        "</svg>",
        "<image href='data:image/png;base64,iVBORw0KGgo=' width='9' height='9'/>\
         <image href='b.svg' width='9' height='9'/><script/></svg>",
    );
    let files = Files::read_by(|_| Some(INNER.into()));
    let arrangement = Arrangement::default().with_files(files);
    let svg = image(&as_data(&inner), "width='40' height='20'");
    let contents =
        SourceFile::arranged("a.svg".to_owned(), svg.into_bytes(), &arrangement).expect("an SVG");
    assert_eq!(polylines(&contents).len(), 2, "an image reads no other file");
    let notes = contents.notes();
    assert!(notes.iter().any(|note| note.contains("1 script is not run")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("image") && note.contains("not drawn")));
}

#[test]
fn the_css_of_an_svg_within_an_svg_is_corrected_as_well() {
    let inner = INNER.replace(
        "<path",
        "<style>:root{--a:b;fill:none}.a{transform:translate(0px,-5px)}</style><path class='a'",
    );
    let contents = read(&image(&as_data(&inner), "width='40' height='20'")).expect("an SVG");
    assert!(contents.notes().is_empty(), "{:?}", contents.notes());
    assert_eq!(polylines(&contents)[1].1, [[10.0, 75.0], [50.0, 75.0]]);
}
