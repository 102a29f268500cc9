//! Reads lengths with all units that have a length of their own, also in capitals, and first of all
//! the size that an SVG says it has.

use super::css::Edit;
use super::markup::is_one_of;
use usvg::roxmltree::Node;

/// A length of CSS as `usvg` reads it: with a unit in small letters; `None` if it is no length, or
/// depends on the window.
pub(super) fn plain_length(length: &str) -> Option<String> {
    let length = length.trim();
    let number = length.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let unit = length.strip_prefix(number)?.to_ascii_lowercase();
    let value: f64 = number.parse().ok().filter(|value: &f64| value.is_finite())?;
    match unit.as_str() {
        // A quarter of a millimetre.
        "q" => Some(format!("{}mm", value / 4.0)),
        "" | "px" | "in" | "cm" | "mm" | "pt" | "pc" | "em" | "ex" => {
            Some(number.to_owned() + &unit)
        }
        _ => None,
    }
}

/// Whether an element is an `svg` with a side of the length 0, which is not drawn.
pub(super) fn is_empty(node: Node<'_, '_>) -> bool {
    let is_zero = |length: &str| {
        let number = length.trim().trim_end_matches(|it: char| it.is_ascii_alphabetic());
        number.parse() == Ok(0.0)
    };
    let is_separator = |letter: char| letter == ',' || letter.is_whitespace();
    let sides = node.attribute("viewBox").unwrap_or_default().split(is_separator);
    let mut sides = sides.filter(|number| !number.is_empty()).skip(2);
    let mut own = ["width", "height"].into_iter().filter_map(|side| node.attribute(side));
    is_one_of(node, &["svg"]) && (own.any(is_zero) || sides.any(is_zero))
}

/// The attributes and properties whose values are lengths, or lists of them.
pub(super) const LENGTHS: [&str; 23] = [
    "cx",
    "cy",
    "dx",
    "dy",
    "font-size",
    "height",
    "letter-spacing",
    "r",
    "rx",
    "ry",
    "startOffset",
    "stroke-dasharray",
    "stroke-dashoffset",
    "stroke-width",
    "textLength",
    "width",
    "word-spacing",
    "x",
    "x1",
    "x2",
    "y",
    "y1",
    "y2",
];

/// The lengths in a list, with what separates them.
fn listed(value: &str) -> impl Iterator<Item = &str> {
    value.split_inclusive([' ', ',', '\t', '\n', '\r'])
}

/// The value of this attribute or property as `usvg` reads it; `None` if it does so already, or if
/// it is no length.
pub(super) fn plain_value(name: &str, value: &str) -> Option<String> {
    let is_special = |letter: char| letter.is_ascii_uppercase() || letter == 'q';
    if !LENGTHS.contains(&name) || !value.contains(is_special) {
        return None;
    }
    let lengths = listed(value).map(|part| {
        let length = part.trim_end_matches([' ', ',', '\t', '\n', '\r']);
        let plain = if length.is_empty() || length.ends_with('%') {
            length.to_owned()
        } else {
            plain_length(length)?
        };
        Some(plain + part.get(length.len()..).unwrap_or_default())
    });
    lengths.collect::<Option<String>>().filter(|plain| plain != value)
}

/// Whether the value of this attribute or property is a list of lengths, which text has as `x`.
fn is_list(name: &str, is_shape: bool) -> bool {
    name == "stroke-dasharray" || matches!(name, "x" | "y" | "dx" | "dy") && !is_shape
}

/// Whether this is a number, or the beginning of a number with an end that is no unit.
fn begins_as_number(length: &str) -> bool {
    let digits = length.trim_start_matches(['+', '-', '.']);
    digits.starts_with(|letter: char| letter.is_ascii_digit())
}

/// What `usvg` does not read of the value of this attribute or property of a shape or of another
/// element. A value that it does not read is taken for 0, or for the value without it.
pub(super) fn unread(name: &str, value: &str, is_shape: bool) -> Option<String> {
    if !LENGTHS.contains(&name) {
        return None;
    }
    if value.contains('(') {
        return Some(format!("a calculation as {name}"));
    }
    let unread = |length: &str| {
        let number = length.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
        let percent = length.strip_suffix('%').map(str::parse::<f64>);
        if plain_length(length).is_some() || percent.is_some_and(|part| part.is_ok()) {
            None
        } else if number.parse::<f64>().is_ok_and(f64::is_finite) {
            Some(format!("a length in {} as {name}", length.get(number.len()..)?))
        } else {
            begins_as_number(length).then(|| format!("the value \"{length}\" as {name}"))
        }
    };
    if is_list(name, is_shape) {
        let is_separator = |letter: char| [' ', ',', '\t', '\n', '\r'].contains(&letter);
        value.split(is_separator).find_map(unread)
    } else {
        unread(value.trim())
    }
}

/// The corrections of the lengths of an element.
pub(super) fn edits_of_attributes(node: Node<'_, '_>) -> impl Iterator<Item = Edit> {
    node.attributes()
        .filter(|it| it.namespace().is_none())
        .filter_map(|it| plain_value(it.name(), it.value()).map(|plain| (it.range_value(), plain)))
}

/// Whether the root of an SVG has a width or a height that is a length.
pub(super) fn is_said(root: Node<'_, '_>) -> bool {
    let mut sides = ["width", "height"].into_iter().filter_map(|name| root.attribute(name));
    sides.any(|side| plain_length(side).is_some())
}

/// Whether no side of the root of an SVG has a unit of its own other than a pixel.
pub(super) fn is_in_pixels(root: Node<'_, '_>) -> bool {
    let mut sides = ["width", "height"].into_iter().filter_map(|name| root.attribute(name));
    sides.all(|side| {
        let number = side.trim().trim_end_matches(['p', 'x', 'P', 'X', '%']);
        number.parse::<f64>().is_ok()
    })
}

/// The corrections of the size of an SVG, whose root this is. Where one side has a length and the
/// other is a part of the window, that other is left out, so that it follows from the viewBox.
pub(super) fn edits_of_size(root: Node<'_, '_>) -> Vec<Edit> {
    let sides = ["width", "height"].map(|name| root.attribute_node(name));
    if !is_said(root) {
        return Vec::new();
    }
    let edits = sides.into_iter().flatten().map(|side| {
        let length = plain_length(side.value()).unwrap_or_default();
        (side.value() != length).then(|| (side.range_value(), length))
    });
    edits.flatten().collect()
}
