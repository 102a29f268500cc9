//! Tests of clip paths, and of the page.

use super::*;
use crate::Turn;
use crate::region::length;

/// A dent of the shape that clips, a hole, two shapes, and a text are no different.
#[test]
fn any_clip_path_cuts_lines_off() {
    let cut = |shapes: &str, drawn: &str| {
        let svg = in_mm(&format!(
            "<clipPath id='c'>{shapes}</clipPath><g clip-path='url(#c)'>{drawn}</g>"
        ));
        let contents = read(&svg).expect("an SVG");
        assert_eq!(contents.notes(), [""; 0]);
        polylines(&contents).into_iter().map(|(_, points)| points).collect::<Vec<_>>()
    };
    let line = "<path d='M0 25H100' fill='none' stroke='red'/>";
    let dented = "<path d='M0 0H60V40H50V20H10V40H0Z'/>";
    let ends = [[[0.0, 75.0], [10.0, 75.0]], [[50.0, 75.0], [60.0, 75.0]]];
    assert_eq!(cut(dented, line), ends);
    let two = "<rect x='50' y='20' width='10' height='10'/><rect y='20' width='10' height='10'/>";
    let mut both = cut(two, line);
    both.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
    assert_eq!(both, ends);
    let ring = "<path clip-rule='evenodd' d='M0 0H60V50H0ZM10 10H50V40H10Z'/>";
    assert_eq!(cut(ring, line), ends);
    let nested = format!("<g transform='scale(2)'>{line}</g>");
    assert_eq!(cut("<path d='M5 40H15V60H5Z'/>", &nested), [[[5.0, 50.0], [15.0, 50.0]]]);
    assert_eq!(cut(dented, &line.replace("H100", "H5")), [[[0.0, 75.0], [5.0, 75.0]]]);
}

/// What is only filled is drawn as its outline: where a clip path cuts it, that is the clip path.
#[test]
fn the_clip_path_is_a_part_of_the_outline_of_what_is_only_filled() {
    let clip = "<clipPath id='c'><path d='M20 20H40V40H20Z'/></clipPath>";
    let drawn = |shape: &str| {
        let shape = shape.replace("<rect", "<rect clip-path='url(#c)'");
        positions(&in_mm(&format!("{clip}{shape}")))
    };
    let whole = drawn("<rect x='10' y='10' width='50' height='50'/>");
    assert_eq!(whole, [[[20.0, 80.0], [40.0, 80.0], [40.0, 60.0], [20.0, 60.0], [20.0, 80.0]]]);
    let corner = drawn("<rect x='30' y='30' width='50' height='50'/>");
    let ink: f64 = corner.iter().map(|line| length(line)).sum();
    assert!((ink - 40.0).abs() < 0.01, "{corner:?}");
    let at = |x: f64, y: f64| corner.iter().any(|line| distance_to(line, [x, 100.0 - y]) < 0.01);
    assert!(at(35.0, 30.0) && at(30.0, 35.0) && at(35.0, 40.0) && at(40.0, 35.0), "{corner:?}");
    // A stroke has ends there.
    let stroke = drawn("<rect x='30' y='30' width='50' height='50' fill='none' stroke='red'/>");
    assert_eq!(stroke, [[[30.0, 60.0], [30.0, 70.0], [40.0, 70.0]]]);
    // What fills it is cut off, too.
    let shape = "<rect clip-path='url(#c)' width='100' height='100'/>";
    let file = arranged(&in_mm(&format!("{clip}{shape}")), &[("hatch", "2,0")]).expect("a plan");
    let hatches: Vec<Sent> = polylines(&file).split_off(1);
    assert!(hatches.len() >= 9, "{hatches:?}");
    for (_, line) in hatches {
        assert!((length(&line) - 20.0).abs() < 0.01, "{line:?}");
    }
}

/// A shape that is cut to a square is hatched as that square is, wherever the square comes to lie.
#[test]
fn what_fills_a_clipped_shape_goes_with_it_when_the_plan_is_scaled_and_turned() {
    let mark = "<path d='M2 2H90' stroke='red' fill='none'/>";
    let square = "<rect x='20' y='20' width='20' height='20'";
    let clipped = format!(
        "<clipPath id='outer'><rect x='20' width='90' height='40'/></clipPath>\
         <clipPath id='c' clip-path='url(#outer)'><path d='M-9 20H40V200H-9Z'/></clipPath>\
         <mask id='m' maskUnits='userSpaceOnUse' width='100' height='100'>{square} fill='#fff'/>\
         </mask>"
    );
    let hatches = |shapes: &str, arrangement: &Arrangement| {
        let text = in_mm(&format!("{mark}{clipped}{shapes}"));
        let file = SourceFile::arranged("a.svg".to_owned(), text.into(), arrangement);
        let lines = polylines(&file.expect("a plan")).into_iter().map(|(_, points)| points);
        lines.filter(|points| points.len() == 2).skip(1).collect::<Vec<_>>()
    };
    for options in [
        &[("scale", "2,-0.5"), ("rotate", "30"), ("hatch", "0.7,0")][..],
        &[("rotate", "-90"), ("hatch", "0.7,0"), ("center", "")],
        &[("hatch", "0.7,0")],
    ] {
        let mut arrangement = Arrangement::default();
        if options.len() == 1 {
            arrangement = Arrangement::on(None, Turn::AsItIs, None).fitted("", 5.0);
        }
        for (name, value) in options {
            arrangement.set(name, value).expect("a value");
        }
        let expected = hatches(&format!("{square}/>"), &arrangement);
        assert!(expected.len() > 9, "{options:?}: {expected:?}");
        for cut in ["clip-path='url(#c)'", "mask='url(#m)'"] {
            let own = hatches(&format!("<rect {cut} width='95' height='95'/>"), &arrangement);
            assert_eq!(own.len(), expected.len(), "{options:?} {cut}: {own:?}");
            for (line, expected) in own.iter().flatten().zip(expected.iter().flatten()) {
                let off = (line[0] - expected[0]).hypot(line[1] - expected[1]);
                assert!(off < 0.01, "{options:?} {cut}: {line:?} is not {expected:?}");
            }
        }
    }
}

#[test]
fn a_background_is_not_drawn_as_a_frame() {
    let line = "<path d='M10 10H20' stroke='red'/>";
    let drawn = |background: &str| read(&in_mm(&format!("{background}{line}"))).expect("an SVG");
    for background in [
        "<rect width='100%' height='100%' fill='#fff'/>",
        "<path d='M0 0H100V100H0Z'/>",
        "<rect x='-10' y='-10' width='150' height='150' fill='#eee'/>",
        "<clipPath id='c'><path d='M0 0H100V100H0Z'/></clipPath>\
         <rect clip-path='url(#c)' x='-1' y='-1' width='150' height='150'/>",
    ] {
        let contents = drawn(background);
        assert_eq!(polylines(&contents).len(), 1, "{background}");
        let note = "1 filled shape covers the whole page, as a background does: its outline is not \
                    drawn";
        assert_eq!(contents.notes(), [note], "{background}");
    }
    for other in [
        "<rect width='100' height='100' fill='none' stroke='red'/>",
        "<rect width='99' height='100' fill='#eee'/>",
        "<path d='M0 0H100V100Z'/>",
    ] {
        assert_eq!(polylines(&drawn(other)).len(), 2, "{other}");
    }
}

#[test]
fn dots_with_round_or_square_ends_are_drawn_as_very_short_lines() {
    let dot = |x: f64| vec![[x, 50.0], [x + 0.08, 50.0]];
    for cap in ["round", "square"] {
        let stroke = format!("stroke='red' stroke-linecap='{cap}'");
        let contents = read(&in_mm(&format!(
            "<path d='M10 50h0M20 50zM200 50h0' {stroke}/><path d='M30 50h5' {stroke} \
             stroke-dasharray='0 3'/><clipPath id='c'><path d='M0 0H50V100H0Z'/></clipPath>\
             <path clip-path='url(#c)' d='M40 50h0M60 50h0' {stroke}/>\
             <path d='M100 50h0' {stroke}/>"
        )));
        let contents = contents.expect("an SVG");
        let drawn: Vec<_> = polylines(&contents).into_iter().map(|(_, points)| points).collect();
        let end = vec![[100.0, 50.0], [99.92, 50.0]];
        assert_eq!(drawn, [dot(10.0), dot(20.0), dot(30.0), dot(33.0), dot(40.0), end], "{cap}");
        let note = "1 path reaches beyond the page of the SVG: the rest is cut off";
        assert_eq!(contents.notes(), [note], "{cap}");
    }
}
