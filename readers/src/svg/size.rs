//! Reads the size that an SVG says it has, in all units that have a length of their own.

use super::css::Edit;
use usvg::roxmltree::Node;

/// A length of CSS as `usvg` reads it: with a unit in small letters; `None` if it is no length, or
/// depends on the window.
fn plain_length(length: &str) -> Option<String> {
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

/// Whether the root of an SVG has a width or a height that is a length.
pub(super) fn is_said(root: Node<'_, '_>) -> bool {
    let mut sides = ["width", "height"].into_iter().filter_map(|name| root.attribute(name));
    sides.any(|side| plain_length(side).is_some())
}

/// The corrections of the size of an SVG, whose root this is. Where one side has a length and the
/// other is a part of the window, that other is left out, so that it follows from the viewBox.
pub(super) fn edits_of(root: Node<'_, '_>) -> Vec<Edit> {
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
