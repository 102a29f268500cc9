//! The size and the place of a symbol where a `use` draws it, in the form that `usvg` reads.
//!
//! `usvg` takes no size from the symbol. It takes a percentage twice: of the viewport that the
//! `use` lies in, as it should, and then of the size that has come out. So the `use` is given the
//! size of its symbol, and a percentage becomes a length.

use super::css::Edit;
use super::lengths::plain_length;
use super::markup::is_one_of;
use std::collections::HashMap;
use usvg::roxmltree::{Document, Node};

/// The symbols of a document by their `id`.
pub(super) struct Symbols<'a, 'input>(HashMap<&'a str, Node<'a, 'input>>);

impl<'a, 'input> Symbols<'a, 'input> {
    pub(super) fn of(document: &'a Document<'input>) -> Self {
        let symbols = document.descendants().filter(|node| is_one_of(*node, &["symbol"]));
        Self(symbols.filter_map(|it| Some((it.attribute("id")?, it))).collect())
    }

    /// The symbol that `node` draws, if it is a `use` of one.
    fn used_by(&self, node: Node<'_, '_>) -> Option<Node<'a, 'input>> {
        let address = node.attributes().find(|it| it.name() == "href")?.value();
        let id = address.strip_prefix('#').filter(|_| is_one_of(node, &["use"]))?;
        self.0.get(id).copied()
    }

    /// The attributes that `node` lacks because the symbol that it draws has the size.
    pub(super) fn sizes_for(&self, node: Node<'_, '_>) -> String {
        let Some(symbol) = self.used_by(node) else { return String::new() };
        let lacking = ["width", "height"].into_iter().filter(|name| !node.has_attribute(*name));
        let size = |name| {
            let size = symbol.attribute(name)?;
            let size = plain_length(size).or_else(|| length_of_part(node, name, size))?;
            Some(format!(" {name}=\"{size}\""))
        };
        lacking.filter_map(size).collect()
    }

    /// The percentages of `node` as lengths, if it draws a symbol.
    pub(super) fn edits_of(&self, node: Node<'_, '_>) -> Vec<Edit> {
        if self.used_by(node).is_none() {
            return Vec::new();
        }
        let own = ["x", "y", "width", "height"].into_iter();
        let edit = |name| {
            let attribute = node.attribute_node(name)?;
            Some((attribute.range_value(), length_of_part(node, name, attribute.value())?))
        };
        own.filter_map(edit).collect()
    }
}

/// The length of a percentage of the viewport that `node` lies in, along the direction of the
/// attribute `name`; `None` if it is no percentage, or the viewport has no size of its own.
fn length_of_part(node: Node<'_, '_>, name: &str, part: &str) -> Option<String> {
    let part: f64 = part.trim().strip_suffix('%')?.parse().ok()?;
    let (axis, side) = if matches!(name, "x" | "width") { (2, "width") } else { (3, "height") };
    let mut outer = node.ancestors().skip(1);
    let viewport = outer.find(|it| is_one_of(*it, &["svg", "symbol"]))?;
    let whole = match viewport.attribute("viewBox") {
        Some(sides) => {
            let is_separator = |letter: char| letter == ',' || letter.is_whitespace();
            let mut numbers = sides.split(is_separator).filter(|number| !number.is_empty());
            numbers.nth(axis)?.to_owned()
        }
        None => {
            let whole = viewport.attribute(side).unwrap_or("100%");
            plain_length(whole).or_else(|| length_of_part(viewport, side, whole))?
        }
    };
    let number = whole.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let unit = whole.strip_prefix(number)?;
    let length = number.parse::<f64>().ok()? * part / 100.0;
    length.is_finite().then(|| format!("{length}{unit}"))
}
