//! Tests of what CSS and other programs add to SVG.

use super::*;

#[test]
fn what_css_and_other_programs_add_is_obeyed_or_named() {
    let line = "<path d='M10 10H20' stroke='red'/>";
    let notes =
        |more: &str| read(&in_mm(&format!("{line}{more}"))).expect("an SVG").notes().to_vec();
    for (more, said) in [
        ("<rect width='9' height='9' style='clip-path:circle(2px)'/>", "property clip-path of CSS"),
        ("<path d='M1 1H9' stroke='red' style='rotate:20deg'/>", "property rotate of CSS"),
        ("<path d='M1 1H9' transform='rotate(1turn)'/>", "property transform of CSS"),
        ("<circle r='5' cx='9' cy='9' style='r:9px'/>", "property r of CSS"),
        (
            "<style>@media print{path{d:none}}</style>",
            "1 element or style sheet has the rule @media",
        ),
        ("<style>path:not(.b){fill:red}</style>", "a selector :not of CSS"),
        ("<path d='M1 1H9' style='stroke:var(--a)'/>", "a variable of CSS"),
        ("<script>a()</script>", "1 script is not run (line 1)"),
        ("<set attributeName='x'/>", "1 animation is not obeyed"),
        (
            "<flowRoot><flowRegion><rect width='9' height='9'/></flowRegion>\
          <flowPara>a</flowPara></flowRoot>",
            "1 flowed text of Inkscape is not read",
        ),
        (
            "<path d='M1 1H9' fill='none' stroke='red' stroke-width='0'/>",
            "1 path is not drawn: the stroke has no width",
        ),
        (
            "<g stroke='red'><path d='M1 1H9' fill='none' stroke-width='0'/></g>",
            "1 path is not drawn: the stroke has no width",
        ),
        (
            "<pattern id='p' width='2' height='2' patternUnits='userSpaceOnUse'>\
          <path d='M0 0H1V1'/></pattern><rect width='9' height='9' fill='url(#p)'/>",
            "1 path has a pattern",
        ),
        (
            "<symbol id='s' transform='scale(2)'><path d='M1 1H9V9'/></symbol><use href='#s'/>",
            "the transform of a symbol",
        ),
    ] {
        let notes = notes(more);
        assert!(matches!(notes.as_slice(), [note] if note.contains(said)), "{more}: {notes:?}");
    }
    for more in [
        "<path d='M1 1H9' fill='none'/>",
        "<g visibility='hidden'><path d='M1 1H9' fill='none' stroke='red' stroke-width='0'/></g>",
        "<style>.a:hover{fill:red} svg{width:50px}</style>",
    ] {
        assert!(notes(more).is_empty(), "{more}: {:?}", notes(more));
    }
    let turned =
        "<path d='M10 0H20' stroke='red' style='fill:none;transform:rotate(90deg) scale(2)'/>";
    assert_eq!(positions(&in_mm(turned)), [[[0.0, 80.0], [0.0, 60.0]]]);
}

#[test]
fn the_dashes_of_a_stroke_of_fixed_width_are_measured_on_the_page() {
    // 20 pixels are 5.292 mm.
    let dashed = "<g transform='scale(10)'><path d='M1 1H2' stroke='red' stroke-dasharray='20' \
                  vector-effect='non-scaling-stroke'/></g>";
    let sent = positions(&in_mm(dashed));
    assert_eq!(sent, [[[10.0, 90.0], [15.292, 90.0]]]);
}
