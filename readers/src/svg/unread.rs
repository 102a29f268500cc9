//! What an SVG asks for by means that are not read: properties and rules of CSS, scripts,
//! animations, and paints of other programs. All of it is counted, for the user.

use super::count::Count;
use super::css::{UNREAD, VARIABLE, plain_paint, without_comments};
use super::lengths;
use super::markup::{SHAPES, is_one_of};
use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr as _;
use svgtypes::FontShorthand;
use usvg::roxmltree::{Document, Node};

/// The properties of CSS that move or form a shape, and are read as attributes only or not at all.
const NOT_READ: [&str; 10] = [
    "-webkit-mask",
    "-webkit-mask-image",
    "d",
    "mask-image",
    "offset-path",
    "rotate",
    "scale",
    "shape-inside",
    "transform-box",
    "translate",
];

/// The attributes of shapes that CSS may set, which are read as attributes only.
const SIZES: [&str; 9] = ["cx", "cy", "height", "r", "rx", "ry", "width", "x", "y"];

/// The rules of a style sheet that change nothing which is drawn.
const HARMLESS_RULES: [&str; 5] = ["charset", "font-face", "keyframes", "namespace", "page"];

/// The classes of a selector that are read.
const CLASSES: [&str; 6] = ["active", "first-child", "focus", "hover", "link", "visited"];

/// What is said of a style sheet by which a stroke is not seen.
const WITHOUT_WIDTH: &str = "a stroke of the width 0";

/// What is said of letters that few fonts have.
const SMALL_CAPITALS: &str = "small capitals";

/// Counts what is not read, in sentences.
pub(super) fn sentences(document: &Document<'_>) -> Vec<String> {
    let mut unread: BTreeMap<String, Count> = BTreeMap::new();
    let (mut scripts, mut animations, mut flowed, mut paints) =
        (Count::default(), Count::default(), Count::default(), Count::default());
    for node in document.descendants().filter(Node::is_element) {
        if is_one_of(node, &["script"]) {
            scripts.add(document, node);
        } else if is_one_of(node, &["animate", "animateMotion", "animateTransform", "set"]) {
            animations.add(document, node);
        } else if is_one_of(node, &["flowRoot"]) && super::markup::has_letters(node) {
            flowed.add(document, node);
        } else if is_one_of(node, &["meshgradient", "meshGradient", "mesh", "hatch"]) {
            paints.add(document, node);
        } else if is_one_of(node, &["style"]) {
            let is_for = |medium: &str| matches!(medium.trim(), "" | "all" | "screen");
            if node.attribute("media").is_some_and(|media| !media.split(',').any(is_for)) {
                let what = "a medium as a condition".to_owned();
                unread.entry(what).or_default().add(document, node);
            }
            let sheet: String = node.children().filter_map(|it| it.text()).collect();
            for what in of_sheet(&sheet, &sized(document)) {
                unread.entry(what).or_default().add(document, node);
            }
        }
        if is_one_of(node, &["symbol"]) && node.attribute("transform").is_some() {
            unread.entry("the transform of a symbol".to_owned()).or_default().add(document, node);
        }
        let is_shape = has_size(node);
        let own = declarations(node.attribute("style").unwrap_or_default());
        let attributes =
            node.attributes().filter(|it| it.namespace().is_none() && it.name() != "style");
        let as_attribute = attributes.map(|it| (it.name(), it.value(), false));
        for (name, value, is_style) in
            own.map(|(name, value)| (name, value, true)).chain(as_attribute)
        {
            let is_obeyed = name == "white-space" && !loses_spaces(node);
            let what = unread_property(name, value, is_style, is_shape);
            if let Some(what) = what.filter(|_| !is_obeyed) {
                unread.entry(what).or_default().add(document, node);
            }
        }
    }
    let mut said = Vec::new();
    let mut sheets = Count::default();
    let is_sheet = |it: &Node<'_, '_>| it.pi().is_some_and(|it| it.target == "xml-stylesheet");
    document.root().children().filter(is_sheet).for_each(|node| sheets.add(document, node));
    let what = "not read: put it into a style element of the file";
    sheets.say(&mut said, ["style sheet elsewhere is", "style sheets elsewhere are"], what);
    scripts.say(&mut said, ["script is", "scripts are"], "not run");
    let what = "not obeyed: what is drawn is the state without them";
    animations.say(&mut said, ["animation is", "animations are"], what);
    let what = "not read: convert text to paths";
    flowed.say(&mut said, ["flowed text of Inkscape is", "flowed texts of Inkscape are"], what);
    let what = "not read: what is only filled with it is not drawn";
    paints.say(&mut said, ["mesh or hatch is", "meshes or hatches are"], what);
    for (what, count) in &unread {
        let nouns = ["element or style sheet has", "elements or style sheets have"];
        let end = match what.as_str() {
            WITHOUT_WIDTH => "drawn: give it a width",
            SMALL_CAPITALS => "obeyed by fonts that have none",
            _ => "obeyed",
        };
        count.say(&mut said, nouns, &format!("{what}, which is not {end}"));
    }
    said
}

/// Whether a text has spaces in a row, or at a line end, of which one is drawn.
fn loses_spaces(node: Node<'_, '_>) -> bool {
    const XML: &str = "http://www.w3.org/XML/1998/namespace";
    let keeps = |node: Node<'_, '_>| node.attribute((XML, "space")) == Some("preserve");
    let mut texts = node.descendants().filter_map(|node| node.text());
    !node.ancestors().any(keeps) && texts.any(|text| text.contains("  ") || text.contains('\n'))
}

/// Whether a property of texts has a value that is not obeyed.
fn is_unread_of_text(name: &str, value: &str) -> bool {
    match name {
        "direction" => value == "rtl",
        "inline-size" => value != "0",
        "white-space" => value.starts_with("pre") || value == "break-spaces",
        _ => matches!(name, "text-decoration-line" | "text-transform"),
    }
}

/// The properties and values of a list of declarations.
pub(super) fn declarations(list: &str) -> impl Iterator<Item = (&str, &str)> {
    let pairs = list.split(';').filter_map(|declaration| declaration.split_once(':'));
    pairs.map(|(name, value)| (name.trim(), without_important(value)))
}

/// A value without the word that it goes before others.
pub(super) fn without_important(value: &str) -> &str {
    let word = value.rsplit_once('!').filter(|(_, word)| word.trim() == "important");
    word.map_or(value, |(value, _)| value).trim()
}

/// Whether an element has a size that CSS may set, which is read as attributes only. That of the
/// whole picture is told as its page.
fn has_size(node: Node<'_, '_>) -> bool {
    is_one_of(node, &SHAPES)
        || is_one_of(node, &["image", "use", "svg"]) && node.parent_element().is_some()
}

/// The names, the classes and the identifiers of all elements that have a size, as selectors write
/// them.
fn sized(document: &Document<'_>) -> BTreeSet<String> {
    let nodes = document.descendants().filter(|node| has_size(*node));
    let selectors = nodes.flat_map(|node| {
        let classes = node.attribute("class").unwrap_or_default().split_whitespace();
        let id = node.attribute("id").map(|id| format!("#{id}"));
        let name = node.tag_name().name().to_owned();
        classes.map(|class| format!(".{class}")).chain(id).chain([name]).collect::<Vec<_>>()
    });
    selectors.collect()
}

/// Whether selectors may select one of the elements that are `sized`.
fn selects_sized(selectors: &str, sized: &BTreeSet<String>) -> bool {
    selectors.split(',').filter_map(|it| it.split([' ', '>', '+']).next_back()).any(|last| {
        let is_sign = |letter: char| matches!(letter, '.' | '#' | '[' | ':');
        let starts = last.char_indices().filter(|(_, it)| is_sign(*it)).map(|(at, _)| at);
        let starts: Vec<usize> = [0].into_iter().chain(starts).chain([last.len()]).collect();
        let mut parts = starts.windows(2).filter_map(|ends| last.get(ends[0]..ends[1]));
        parts.any(|part| sized.contains(part))
    })
}

/// Whether it is told that a value of this property is not read.
pub(super) fn is_told(name: &str) -> bool {
    matches!(name, "fill" | "stroke" | "clip-path" | "font" | "transform")
        || NOT_READ.contains(&name)
        || lengths::LENGTHS.contains(&name)
}

/// What is not read of a property.
fn unread_property(name: &str, value: &str, is_style: bool, is_shape: bool) -> Option<String> {
    let is_usual = matches!(value, "" | "none" | "auto" | "inherit" | "initial" | "unset");
    if is_usual {
        return None;
    }
    if name == UNREAD {
        return Some(match value {
            VARIABLE => "a variable of CSS".to_owned(),
            "fill" | "stroke" => no_colour(value),
            name => format!("the property {name} of CSS"),
        });
    }
    let is_unread = match name {
        "clip-path" | "mask" => {
            let is_plain = value.starts_with("url(") && value.trim_end().ends_with(')');
            !is_plain && !value.contains("var(")
        }
        "font-variant" | "font-variant-caps" if value.contains("small-caps") => {
            return Some(SMALL_CAPITALS.to_owned());
        }
        name if is_unread_of_text(name, value) => true,
        "font" => is_style && !value.contains("var(") && FontShorthand::from_str(value).is_err(),
        "transform" | "patternTransform" | "gradientTransform" => plain_transform(value).is_none(),
        _ => is_style && (NOT_READ.contains(&name) || is_shape && SIZES.contains(&name)),
    };
    if is_unread {
        return Some(format!("the property {name} of CSS"));
    }
    if value.contains("var(") {
        return Some("a variable of CSS".to_owned());
    }
    if !is_style && is_unread_paint(name, value.trim()) {
        return Some(no_colour(name));
    }
    lengths::unread(name, value, is_shape)
}

/// What is said of a `fill` or a `stroke` whose value is not read.
fn no_colour(name: &str) -> String {
    format!("a {name} that is no name of a colour, #rrggbb, rgb() or hsl()")
}

/// Whether an attribute is a paint that is not read. The `fill` of an animation is no paint.
fn is_unread_paint(name: &str, value: &str) -> bool {
    matches!(name, "fill" | "stroke")
        && !matches!(value, "freeze" | "remove")
        && !value.starts_with("url(")
        && plain_paint(value).is_none()
}

/// What is not read of a style sheet of a picture in which elements with these selectors are
/// `sized`.
fn of_sheet(sheet: &str, sized: &BTreeSet<String>) -> Vec<String> {
    let mut unread = Vec::new();
    let plain = without_comments(sheet);
    let mut rest = plain.as_ref();
    while let Some(end) = rest.find(['{', ';', '}']) {
        let (prelude, body) = (rest[..end].trim(), &rest[end..]);
        if let Some(rule) = prelude.strip_prefix('@') {
            let name = rule.split(|it: char| !it.is_alphanumeric() && it != '-').next();
            let name = name.unwrap_or_default();
            if !HARMLESS_RULES.iter().any(|rule| name.ends_with(rule)) {
                unread.push(format!("the rule @{name} of CSS"));
            }
            rest = after_block(body);
            continue;
        }
        let Some(block) = body.strip_prefix('{') else {
            rest = &body[1..];
            continue;
        };
        let list = block.split('}').next().unwrap_or_default();
        unread.extend(of_selectors(prelude, list));
        unread.extend(list.contains('{').then(|| "a rule within a rule of CSS".to_owned()));
        unread.extend(has_stroke_without_width(list).then(|| WITHOUT_WIDTH.to_owned()));
        // Other sizes are those of the whole picture, or of none.
        let reads_sizes = selects_sized(prelude, sized);
        let properties = declarations(list)
            .filter(|(name, _)| reads_sizes || !matches!(*name, "width" | "height"));
        unread.extend(properties.filter_map(|(name, value)| {
            if name.starts_with("--") { None } else { unread_property(name, value, true, true) }
        }));
        rest = after_block(body);
    }
    unread
}

/// Whether declarations ask for a stroke and give it the width 0. Illustrator gives that to what
/// has no stroke.
fn has_stroke_without_width(list: &str) -> bool {
    let last = |name| declarations(list).filter(|it| it.0 == name).map(|it| it.1).last();
    let width = last("stroke-width").unwrap_or_default();
    let width = width.trim_end_matches(|letter: char| letter.is_ascii_alphabetic()).parse::<f64>();
    width == Ok(0.0) && last("stroke").is_some_and(|paint| paint != "none")
}

/// What is not read of the selectors of a rule with these declarations.
fn of_selectors(selectors: &str, list: &str) -> Vec<String> {
    let mut unread = Vec::new();
    // Variables are counted where they are used.
    let has_variables_only = declarations(list).all(|(name, _)| name.starts_with("--"));
    for class in selectors.split(':').skip(1).filter(|class| !class.is_empty()) {
        let end = class.find(|it: char| !it.is_alphanumeric() && it != '-');
        let class = class.get(..end.unwrap_or(class.len())).unwrap_or_default();
        let is_silent = class == "root" && has_variables_only;
        if !CLASSES.contains(&class) && !is_silent {
            unread.push(format!("a selector :{class} of CSS"));
        }
    }
    unread.extend(unread_sign(selectors).map(|sign| format!("a selector with {sign} of CSS")));
    unread
}

/// The first sign of selectors at which `usvg` stops reading them.
fn unread_sign(selectors: &str) -> Option<String> {
    let mut quote = None;
    let mut is_in_brackets = false;
    let mut letters = selectors.chars().peekable();
    while let Some(letter) = letters.next() {
        let is_operator = letters.peek() == Some(&'=');
        match letter {
            _ if quote.is_some() => quote = quote.filter(|quote| *quote != letter),
            '"' | '\'' => quote = Some(letter),
            '[' => is_in_brackets = true,
            ']' => is_in_brackets = false,
            '^' | '$' | '*' if is_operator => return Some(format!("{letter}=")),
            '~' | '|' if is_in_brackets && is_operator => {}
            ' ' | '\n' | '\t' | '\r' if is_in_brackets => return Some("spaces in [ ]".to_owned()),
            // Of the letters beyond ASCII these are not taken for letters.
            '~' | '|' | '\\' | '\u{80}'..='\u{ED}' => return Some(letter.to_string()),
            _ => {}
        }
    }
    None
}

/// What follows a block, or a semicolon.
fn after_block(text: &str) -> &str {
    let mut depth = 0_u32;
    for (at, letter) in text.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            ';' => {}
            _ => continue,
        }
        if depth == 0 {
            return &text[at + 1..];
        }
    }
    ""
}

/// A transform of CSS in the form of SVG, whose angles are degrees and whose lengths are pixels;
/// `None` if there is no such form.
pub(super) fn plain_transform(value: &str) -> Option<String> {
    let mut plain = String::with_capacity(value.len());
    let mut rest = value;
    while let Some(letter) = rest.chars().next() {
        let unit = ["deg", "px"].into_iter().find(|unit| rest.starts_with(unit));
        let taken = match unit {
            Some(unit) if plain.ends_with(|it: char| it.is_ascii_digit() || it == '.') => {
                unit.len()
            }
            _ => {
                plain.push(letter);
                letter.len_utf8()
            }
        };
        rest = &rest[taken..];
    }
    svgtypes::Transform::from_str(&plain).is_ok().then_some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_of_css_becomes_one_of_svg() {
        for (css, svg) in [
            ("rotate(20deg) translate(3px, 4.px)", Some("rotate(20) translate(3, 4.)")),
            ("matrix(1,0,0,1,5,6)", Some("matrix(1,0,0,1,5,6)")),
            ("rotate(0.5turn)", None),
            ("translate(50%, 0)", None),
            ("rotate3d(1, 1, 1, 45deg)", None),
        ] {
            assert_eq!(plain_transform(css).as_deref(), svg, "{css}");
        }
    }

    #[test]
    fn a_style_sheet_says_what_is_not_read_of_it() {
        let sized = BTreeSet::from(["rect", ".big", "#photo"].map(str::to_owned));
        for (sheet, unread) in [
            (".a{stroke:red;fill:none} /* @import x; */ #b:hover, path:first-child {d:none}", ""),
            ("@font-face{src:url(a;b)} @charset 'x'; .a{width:5px}", ""),
            ("@import url(a.css); .a{stroke:red}", "the rule @import of CSS"),
            ("@media print{.a{d:path('M0 0')} .b{x:1}} .c{r:5px}", "the rule @media of CSS"),
            ("a:not(.b), c{}", "a selector :not of CSS"),
            (".a{stroke:var(--b)} :root{--b:red}", "a variable of CSS"),
            (":root{--b:red;--c:d}", ""),
            (":root{--b:red;stroke:red}", "a selector :root of CSS"),
            ("svg{width:100%} rect .a, a{height:5px}", ""),
            ("g > rect.b{width:5px}", "the property width of CSS"),
            ("a, .a.big:hover{height:5px}", "the property height of CSS"),
            ("#photo{height:5px}", "the property height of CSS"),
            (".a, .b ~ .c{}", "a selector with ~ of CSS"),
            ("#\\31 a{}", "a selector with \\ of CSS"),
            ("svg|path{}", "a selector with | of CSS"),
            ("a[b$='c']{}", "a selector with $= of CSS"),
            ("a[b~='~|'] > *, a[b|=c] + .d-1_é{}", "a selector with é of CSS"),
            ("a[b~='~|\\^=é'] > *, a[b|=c] + .d-1_ö{}", ""),
            (".a{font:4px/1.5 Arial} .b{font:inherit} .c{font:bold 4px Arial !important}", ""),
            (".a{font:caption}", "the property font of CSS"),
            (".a{clip-path:circle(5px)}", "the property clip-path of CSS"),
            (".a{stroke:red;stroke-width:0px}", "a stroke of the width 0"),
            (".a{stroke-width:0}.b{stroke:none;stroke-width:0}.c{stroke:red;stroke-width:.1}", ""),
            (".a{", ""),
            ("@media {", "the rule @media of CSS"),
            ("}}{;@", ""),
        ] {
            let said = of_sheet(sheet, &sized);
            assert_eq!(said.first().map_or("", String::as_str), unread, "{sheet}");
        }
        assert_eq!(of_sheet("@media print{.a{x:1}} .c{r:5px}", &sized).len(), 2);
    }
}
