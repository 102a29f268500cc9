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
        ("<path d='M1 1H9' stroke='red' transform='rotate(1turn)'/>", "property transform of CSS"),
        ("<circle r='5' cx='9' cy='9' style='r:9px'/>", "property r of CSS"),
        ("<rect width='5' height='9' style='y:9px'/>", "property y of CSS"),
        ("<polyline points='5,5 20,5 NaN,9 20,20' stroke='red'/>", "1 shape is not drawn as a"),
        ("<polygon points='5,5 20,5 9,9,9' stroke='red'/>", "1 shape is not drawn as a whole"),
        (
            "<style>@media print{path{d:none}}</style>",
            "1 element or style sheet has the rule @media",
        ),
        ("<style>path:not(.b){fill:red}</style>", "a selector :not of CSS"),
        ("<path d='M1 1H9V5' style='stroke:var(--a)'/>", "a variable of CSS"),
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
        ("<style>g{fill:none; .a{stroke:black}}</style>", "a rule within a rule of CSS"),
        ("<style media='print'>.a{fill:none}</style>", "a medium as a condition"),
        ("<g direction='rtl'/>", "the property direction of CSS"),
        ("<g style='direction:rtl'/>", "the property direction of CSS"),
        ("<g style='text-transform:uppercase'/>", "the property text-transform of CSS"),
        ("<style>.a{text-decoration-line:underline}</style>", "the property text-decoration-line"),
        ("<g style='inline-size:20px'/>", "the property inline-size of CSS"),
        ("<g style='white-space:pre'>a  b</g>", "the property white-space of CSS"),
        ("<g font-variant='small-caps'/>", "small capitals, which is not obeyed by fonts"),
        ("<g style='mask:url(#c) alpha'/>", "the property mask of CSS"),
        ("<g style='mask:url(#c) no-repeat'/>", "the property mask of CSS"),
        ("<g style='mask-image:url(#c)'/>", "the property mask-image of CSS"),
        ("<style>.a{clip-path:url(#c) view-box}</style>", "the property clip-path of CSS"),
        (
            "<symbol id='s' transform='scale(2)'><path d='M1 1H9V9'/></symbol><use href='#s'/>",
            "the transform of a symbol",
        ),
    ] {
        let notes = notes(more);
        assert!(matches!(notes.as_slice(), [note] if note.contains(said)), "{more}: {notes:?}");
    }
    let svg = format!("<?xml version='1.0'?>\n<?xml-stylesheet href='a.css'?>{}", in_mm(line));
    let notes_of_sheet = read(&svg).expect("an SVG").notes().to_vec();
    let what =
        "1 style sheet elsewhere is not read: put it into a style element of the file (line 2)";
    assert_eq!(notes_of_sheet, [what]);
    for more in [
        "<path d='M1 1H9' fill='none'/>",
        "<g visibility='hidden'><path d='M1 1H9' fill='none' stroke='red' stroke-width='0'/></g>",
        "<style>.a:hover{fill:red} svg{width:50px}</style>",
        "<style media='screen, print'>.a{fill:red}</style><g direction='ltr'/>",
        "<g style='text-transform:none;white-space:normal;font-variant:normal;mask:none'/>",
        "<g style='white-space:pre' xml:space='preserve'>a  b</g>",
        "<g style='white-space:pre'>a b</g>",
        "<g style='text-decoration-line:none;inline-size:0;mask-image:none;clip-path:url(#a )'/>",
        // What is hidden is so in capitals and between spaces, too.
        "<g style='DISPLAY:NONE'><path d='M1 1H9'/></g>",
        "<g visibility='HIDDEN'><path d='M1 1H9'/></g><path d='M1 1H9' display=' none '/>",
        "<linearGradient id='g'><stop stop-opacity='0'/><stop offset='1' stop-opacity='0'/>\
         </linearGradient><path d='M1 1H9V9' fill='none' stroke='url(#g)'/>",
    ] {
        assert!(notes(more).is_empty(), "{more}: {:?}", notes(more));
        assert_eq!(positions(&in_mm(&format!("{line}{more}"))).len(), 1, "{more}");
    }
    let hidden = "<style>.a{Display : None}</style><path class='a' d='M1 1H9' stroke='red'/>";
    assert_eq!(positions(&in_mm(&format!("{line}{hidden}"))).len(), 1);
    let turned =
        "<path d='M10 0H20' stroke='red' style='fill:none;transform:rotate(90deg) scale(2)'/>";
    assert_eq!(positions(&in_mm(turned)), [[[0.0, 80.0], [0.0, 60.0]]]);
}

#[test]
fn a_paint_that_is_not_read_leaves_the_one_before_it() {
    let read = |path: &str| {
        let contents = read(&in_mm(&format!("{path} d='M10 10H20'/>"))).expect("an SVG");
        (polylines(&contents).len(), contents.notes().join("; "))
    };
    let path = "<path fill='none' stroke='#000'";
    for style in [
        "stroke:color(display-p3 0.74 0.95 0.39)",
        "stroke: light-dark(rgb(0, 0, 0), rgb(255, 255, 255));",
        "fill: light-dark(#ffffff, var(--dark, #121212)); stroke: light-dark(#000, rgb(1,1,1))",
        "background: light-dark(rgb(1,1,1), a(2)); stroke: oklch(0.6 0.2 30)",
        "; stroke: red",
    ] {
        assert_eq!(read(&format!("{path} style='{style}'")), (1, String::new()), "{style}");
    }
    for (shape, count) in [
        ("<path fill='NONE' stroke='currentcolor'", 1),
        ("<path fill='none' stroke='light-dark(rgb(1, 2, 3), #fff)'", 1),
        (
            "<path d='M1 1H9V9' style='stroke:NONE;stroke-dasharray: ;fill:red'/><path fill='none'",
            1,
        ),
    ] {
        assert_eq!(read(shape), (count, String::new()), "{shape}");
    }
    let sheet = "<style>.a{fill:none;stroke:oklch(0.6 0.2 30)}</style><path class='a' stroke='red'";
    let (count, notes) = read(sheet);
    assert_eq!(count, 1);
    assert!(notes.contains("has a stroke that is no name of a colour, #rrggbb"), "{notes}");
    // So it is with an attribute, which has none before it.
    for paint in ["fill='oklch(0.6 0.2 30)'", "stroke='lab(50% 40 59)'", "fill='rouge'"] {
        let shape = format!("<path d='M1 1H9V9' {paint}/>");
        let (count, notes) = read(&format!("{shape}<path fill='none' stroke='red'"));
        let name = paint.split('=').next().unwrap_or_default();
        let said = format!("has a {name} that is no name of a colour, #rrggbb");
        assert!(count <= 2 && notes.contains(&said), "{paint}: {notes}");
    }
    for paint in ["context-fill", "transparent", " red ", "hwb(9 9% 9%)"] {
        let shape = format!("<g fill='{paint}'/><path fill='none' stroke='red'");
        assert_eq!(read(&shape), (1, String::new()), "{paint}");
    }
    // What is not set is that of the element around it.
    for keyword in ["unset", "REVERT"] {
        for own in [format!("stroke='{keyword}'"), format!("style='stroke:{keyword}'")] {
            let group = format!("<g stroke='red'><path d='M1 1H9' fill='none' {own}/></g>");
            assert_eq!(read(&format!("{group}{path}")), (2, String::new()), "{own}");
        }
    }
    let animated = "<animate fill='freeze'/><path fill='none' stroke='red'";
    assert!(!read(animated).1.contains("colour"));
}

#[test]
fn the_dashes_of_a_stroke_of_fixed_width_are_measured_on_the_page() {
    // 20 pixels are 5.292 mm.
    let dashed = "<g transform='scale(10)'><path d='M1 1H2' stroke='red' stroke-dasharray='20' \
                  vector-effect='non-scaling-stroke'/></g>";
    let sent = positions(&in_mm(dashed));
    assert_eq!(sent, [[[10.0, 90.0], [15.292, 90.0]]]);
}

#[test]
fn dashes_are_measured_in_the_length_that_a_path_says_it_has() {
    let dashes = |shape: &str| {
        let svg = in_mm(&format!("<g transform='scale(2)' stroke='red' fill='none'>{shape}</g>"));
        positions(&svg)
    };
    let half = "stroke-dasharray='50'";
    let line = dashes(&format!("<path d='M5 5H25' pathLength='100' {half}/>"));
    assert_eq!(line, [[[10.0, 90.0], [30.0, 90.0]]]);
    let later = format!("<line x1='5' y1='5' x2='25' y2='5' pathLength=' 200 ' {half}/>");
    let ends = [[[10.0, 90.0], [20.0, 90.0]], [[30.0, 90.0], [40.0, 90.0]]];
    assert_eq!(dashes(&later), ends);
    let shifted = later.replace("/>", " stroke-dashoffset='50'/>");
    assert_eq!(dashes(&shifted), [[[20.0, 90.0], [30.0, 90.0]], [[40.0, 90.0], [50.0, 90.0]]]);
    let circle = dashes(&format!("<circle cx='25' cy='25' r='10' pathLength='100' {half}/>"));
    let ink: f64 = circle.iter().map(|line| crate::region::length(line)).sum();
    assert!((ink - 20.0 * std::f64::consts::PI).abs() < 0.05, "{ink}");
    // A stroke of fixed width has the same dashes then.
    let fixed = line_of("pathLength='100' vector-effect='non-scaling-stroke'");
    assert_eq!(dashes(&fixed), line);
    // Of a path of no length, each dash is endless; a negative length is none.
    assert_eq!(dashes(&line_of("pathLength='0'")), [[[10.0, 90.0], [50.0, 90.0]]]);
    assert_eq!(dashes(&line_of("pathLength='-1'")), dashes(&line_of("")));
}

/// A line of 20 units with dashes of 50 units.
fn line_of(attributes: &str) -> String {
    format!("<path d='M5 5H25' stroke-dasharray='50' {attributes}/>")
}

#[test]
fn a_browser_text_in_html_is_replaced_by_what_the_file_has_for_others() {
    const FEATURES: &str = "requiredFeatures='http://www.w3.org/TR/SVG11/feature#Extensibility'";
    let html = |text: &str, features: &str| {
        format!(
            "<switch><foreignObject {features} width='9' height='9'><p \
             xmlns='http://www.w3.org/1999/xhtml'>{text}</p></foreignObject>\
             <g><desc>Lamp</desc><path d='M0 9H9' stroke='black'/></g></switch>"
        )
    };
    // What is drawn where there is no HTML is drawn, but not that there is none.
    let warning = format!("<switch><g {FEATURES}/><path d='M0 50H9' stroke='black'/></switch>");
    for features in ["", FEATURES] {
        let read = |text| read(&in_mm(&[html(text, features), warning.clone()].concat()));
        let same = read("La mp").expect("an SVG");
        assert_eq!(polylines(&same).len(), 1, "{features}");
        assert!(same.notes().is_empty(), "{:?}", same.notes());
        let longer = read("Lamp plugged in?").expect("an SVG");
        assert!(longer.notes()[0].starts_with("1 text in HTML is drawn as another text"));
    }
    let alone = "<foreignObject><p>a</p></foreignObject><path d='M0 9H9' stroke='black'/>";
    let notes = read(&in_mm(alone)).expect("an SVG");
    assert_eq!(notes.notes(), ["1 foreignObject is not drawn: it is not SVG (line 1)"]);
}

#[test]
fn a_style_sheet_moves_shapes_as_an_attribute_does() {
    let sheet = |sheet: &str| {
        let path = "<path class='a' d='M10 10H20' stroke='red'/>";
        let svg = in_mm(&format!("<style>{sheet}</style>{path}"));
        let contents = read(&svg).expect("an SVG");
        assert!(contents.notes().is_empty(), "{sheet}: {:?}", contents.notes());
        polylines(&contents).into_iter().map(|(_, points)| points).collect::<Vec<_>>()
    };
    for moved in [
        ".a{transform:translate(10px,5px)}",
        "<![CDATA[.b{fill:red}\n.a { fill:none; transform : translate( 10px , 5px ) ; }]]>",
        ".a{transform:translate(10px,/* ; */5px)!important;transform:none}",
        ".a{--b:c;transform:translate(10px,5px)}",
        "/* .a{ */.a{transform:translate(10px,5px)",
        "/*<![CDATA[*/.a{transform:translate(10px,5px)}/*]]>*/.b{--c:d",
        "<![CDATA[.a{transform:translate(10px,5px)}.b{--c:d]]>",
        "<![CDATA[<!--\n.a{transform:translate(10px,5px)}\n-->]]>",
        "<![CDATA[<!-- .b{fill:red} --> .a{transform:translate(10px,5px)}]]>",
    ] {
        assert_eq!(sheet(moved), [[[20.0, 85.0], [30.0, 85.0]]], "{moved}");
    }
    let svg = in_mm("<style>.a{transform:rotate(1turn)}</style><path d='M1 1H9' stroke='red'/>");
    let notes = read(&svg).expect("an SVG").notes().join("; ");
    assert!(notes.contains("the property transform of CSS, which is not obeyed"), "{notes}");
    // The lines of the file keep their numbers.
    let svg = in_mm(
        "<style>:root{--a:b\n;}.a{transform:rotate(/*\n*/0deg)}</style>\n\
         <path d='M1 1H9' stroke='red'/>",
    );
    let contents = read(&svg).expect("an SVG");
    assert!(contents.in_order().filter_map(|line| line.origin).all(|origin| origin.line == 4));
}

#[test]
fn selectors_are_obeyed_or_named() {
    let two = "<path class='a' d='M10 10H20' stroke='red'/><path class='a' d='M10 20H20'/>";
    let read = |sheet: &str, shapes: &str| {
        let contents = read(&in_mm(&format!("<style>{sheet}</style>{shapes}"))).expect("an SVG");
        (polylines(&contents).len(), contents.notes().join("; "))
    };
    for (selector, what) in [
        (".a ~ .a", "with ~"),
        (".a~.a", "with ~"),
        ("#\\31 a", "with \\"),
        ("svg|path", "with |"),
        ("path, *|a", "with |"),
        ("[class^=\"a\"]", "with ^="),
        ("[class = a]", "with spaces in [ ]"),
        (".é", "with é"),
        (".b:root &gt; .a", ":root"),
    ] {
        let (_, notes) = read(&format!("{selector}{{stroke:red}}"), two);
        let said = format!("a selector {what} of CSS, which is not obeyed");
        assert!(notes.contains(&said), "{selector}: {notes}");
    }
    for selector in [
        ".a + .a",
        "svg&gt;.a",
        ":root .a",
        "svg:root > *",
        "[class~=\"a\"]",
        "[class|=a]",
        "[class='a']",
        "path",
        ":root",
        "q,:root",
    ] {
        let (lines, notes) = read(&format!("{selector}{{stroke:red;fill:none}}"), two);
        assert_eq!((lines, notes.as_str()), (2, ""), "{selector}");
    }
    // The root is no other element, and a rule for it goes before one for all elements `svg`.
    let nested = "<svg><path d='M10 20H20'/></svg><path d='M10 10H20' stroke='red'/>";
    assert_eq!(read(":root{--b:c;stroke:red}svg{stroke:none}", nested).0, 1);
    assert_eq!(read(":root{--b:c}", nested).0, 1);
}

#[test]
fn long_css_takes_no_long_time() {
    for part in ["--a:b;", "/*", "'", "\"\\", ":root", "a{", "font:1/", "transform:(", "--:(", "}"]
    {
        let sheet = part.repeat(300_000);
        let sheet = format!("<style>{sheet}</style><path d='M1 1H9' stroke='red'/>");
        assert_eq!(drawn(&in_mm(&sheet)).len(), 1);
    }
}
