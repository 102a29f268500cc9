//! Tests of masks: what they hide is not drawn.

use super::*;

/// A square of 20 mm from (10, 10) that is only filled, and a line through it at y 50, both masked.
fn masked(mask: &str) -> String {
    in_mm(&format!("{mask}<g mask='url(#m)'><path d='M0 50H100' stroke='red'/></g>"))
}

/// The parts of the line that are left, from left to right, as their ends.
fn parts(mask: &str) -> Vec<[f64; 2]> {
    let contents = read(&masked(mask)).expect("an SVG");
    assert!(contents.notes().is_empty(), "{mask}: {:?}", contents.notes());
    let mut parts: Vec<[f64; 2]> = polylines(&contents)
        .iter()
        .map(|(_, points)| [points[0][0], points[points.len() - 1][0]])
        .collect();
    parts.sort_by(|one, other| one[0].total_cmp(&other[0]));
    parts
}

#[test]
fn shapes_of_a_mask_hide_each_other() {
    const WHOLE: &str = "maskUnits='userSpaceOnUse' x='0' y='0' width='100' height='100'";
    let white = "<rect width='100' height='100' fill='white'/>";
    let hole = "<rect x='40' y='40' width='20' height='20'/>";
    let spot = "<rect x='45' y='45' width='10' height='10' fill='#fff'/>";
    for (contents, left) in [
        (white.to_owned(), vec![[0.0, 100.0]]),
        ([white, hole].concat(), vec![[0.0, 40.0], [60.0, 100.0]]),
        ([white, hole, spot].concat(), vec![[0.0, 40.0], [45.0, 55.0], [60.0, 100.0]]),
        ([hole, white].concat(), vec![[0.0, 100.0]]),
        ([hole, spot].concat(), vec![[45.0, 55.0]]),
        // At least half of the light: grey, or see-through white.
        (white.replace("white", "#808080"), vec![[0.0, 100.0]]),
        (white.replace("/>", " opacity='.5'/>"), vec![[0.0, 100.0]]),
        ([white, &hole.replace("/>", " opacity='.4'/>")].concat(), vec![[0.0, 100.0]]),
        (
            [white, &hole.replace("/>", " fill-opacity='.6'/>")].concat(),
            vec![[0.0, 40.0], [60.0, 100.0]],
        ),
        // A stroke counts with its width, and a gradient that is light all over as what it is.
        ("<path d='M50 0V100' stroke='white' stroke-width='6'/>".to_owned(), vec![[47.0, 53.0]]),
        (
            "<path d='M50 0V100' stroke='white' stroke-width='6' stroke-dasharray='40 100'/>\
             <linearGradient id='l'><stop stop-color='#eee'/><stop offset='1' stop-color='#fff'/>\
             </linearGradient><rect x='70' y='40' width='9' height='20' fill='url(#l)'/>"
                .to_owned(),
            vec![[70.0, 79.0]],
        ),
        // What is used elsewhere, moved, and clipped.
        (
            "<g transform='translate(5)'><rect id='r' y='40' width='20' height='20' \
             fill='#fff'/></g><use href='#r' x='60'/>"
                .to_owned(),
            vec![[5.0, 25.0], [60.0, 80.0]],
        ),
    ] {
        let mask = format!("<mask id='m' {WHOLE}>{contents}</mask>");
        assert_eq!(parts(&mask), left, "{contents}");
    }
}

#[test]
fn a_mask_has_a_border_a_type_and_masks_of_its_own() {
    let mask = |attributes: &str| {
        format!(
            "<mask id='m' {attributes}><rect width='100' height='100' fill='{{}}'/></mask>\
             <mask id='n' maskUnits='userSpaceOnUse' x='0' y='0' width='100' height='100'>\
             <rect x='50' y='0' width='50' height='90' fill='white'/></mask>"
        )
    };
    let bounds = "maskUnits='userSpaceOnUse' x='20' y='0' width='40' height='100'";
    let white = |attributes: &str| mask(attributes).replace("{}", "white");
    assert_eq!(parts(&white(bounds)), [[20.0, 60.0]]);
    assert_eq!(parts(&white(&format!("{bounds} mask='url(#n)'"))), [[50.0, 60.0]]);
    let black = mask(&format!("{bounds} style='mask-type:alpha'")).replace("{}", "black");
    assert_eq!(parts(&black), [[20.0, 60.0]]);
    // Grey lets less than half of the light through where colours are mixed as light is.
    let grey = |more: &str| mask(&format!("{bounds} {more}")).replace("{}", "#999");
    assert_eq!(parts(&grey("")), [[20.0, 60.0]]);
    let nothing = read(&masked(&grey("color-interpolation='linearRGB'"))).expect_err("no line");
    assert!(nothing.contains("there is nothing to draw"), "{nothing}");
    // Sizes that are parts of what is masked.
    let units = "<mask id='m' maskContentUnits='objectBoundingBox' x='0' width='1'>\
                 <rect x='.25' width='.5' height='1' fill='white'/></mask>\
                 <path d='M0 0H80V80H0z' stroke='red' mask='url(#m)'/>";
    let drawn = positions(&in_mm(units));
    assert!(drawn.contains(&vec![[20.0, 100.0], [60.0, 100.0]]), "{drawn:?}");
}

#[test]
fn the_border_of_a_mask_is_an_outline_of_what_is_only_filled_once() {
    // The hole has two borders on one line, and is drawn once.
    let svg = in_mm(
        "<mask id='m' maskUnits='userSpaceOnUse' x='0' y='0' width='100' height='100'>\
         <rect width='100' height='100' fill='white'/><rect x='40' y='40' width='20' height='20'/>\
         <rect x='40' y='40' width='20' height='20'/></mask>\
         <rect x='10' y='30' width='80' height='40' mask='url(#m)'/>",
    );
    let length: f64 = positions(&svg).iter().map(|points| crate::region::length(points)).sum();
    assert!((length - 2.0 * (80.0 + 40.0) - 80.0).abs() < 1e-6, "{length}");
}

#[test]
fn what_a_soft_mask_may_hide_is_drawn_and_named() {
    let defined = "<linearGradient id='l'><stop stop-color='white'/><stop offset='1'/>\
                   </linearGradient><filter id='b'><feGaussianBlur stdDeviation='3'/></filter>";
    for (contents, left) in [
        ("<rect x='20' width='60' height='100' fill='url(#l)'/>", [20.0, 80.0]),
        (
            "<image href='data:image/png;base64,iVBORw0KGgo=' x='20' width='60' height='100' \
          preserveAspectRatio='none'/>",
            [20.0, 80.0],
        ),
        ("<rect x='20' width='60' height='100' fill='white' filter='url(#b)'/>", [0.0, 100.0]),
        (
            "<g opacity='.7'><rect width='9' height='9' fill='#fff'/><circle r='9'/></g>",
            [0.0, 100.0],
        ),
    ] {
        let attributes = "maskUnits='userSpaceOnUse' width='100' height='100'";
        let mask = format!("{defined}<mask id='m' {attributes}>{contents}</mask>");
        let read = read(&masked(&mask)).expect("an SVG");
        assert_eq!(polylines(&read)[0].1, [[left[0], 50.0], [left[1], 50.0]], "{contents}");
        let notes = read.notes();
        assert!(notes[0].starts_with("1 mask is not applied as a whole"), "{notes:?}");
    }
}
