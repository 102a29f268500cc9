//! The properties of elements as `usvg` finds them: in an attribute, in the style sheets of the
//! file, and in `style`. Of two of the same name the later counts, unless the other is important.

use super::css::Edit;
use super::markup::is_one_of;
use simplecss::{AttributeOperator, DeclarationTokenizer, Element, PseudoClass, StyleSheet};
use usvg::roxmltree::{Document, Node};

/// The properties that are asked for.
const PROPERTIES: [&str; 6] =
    ["stroke", "vector-effect", "color-interpolation", "display", "visibility", "font-size"];

/// The rules of the style sheets of a file that may set one of the [`PROPERTIES`].
#[derive(Debug)]
pub(super) struct Styles<'a>(StyleSheet<'a>);

impl<'a> Styles<'a> {
    /// Reads the style sheets of `document`.
    pub(super) fn of(document: &'a Document<'_>) -> Self {
        let mut sheet = StyleSheet::new();
        let sheets = document.descendants().filter(|node| node.has_tag_name("style"));
        let is_css =
            |node: &Node<'_, '_>| node.attribute("type").is_none_or(|kind| kind == "text/css");
        for text in sheets.filter(is_css).filter_map(|node| node.text()) {
            sheet.parse_more(text);
        }
        sheet.rules.retain(|rule| rule.declarations.iter().any(|it| PROPERTIES.contains(&it.name)));
        Self(sheet)
    }

    /// The value of one of the [`PROPERTIES`] of an element, which may stand in a style sheet; that
    /// of an element that contains it does not count.
    pub(super) fn property(&self, node: Node<'a, '_>, name: &str) -> Option<&'a str> {
        debug_assert!(PROPERTIES.contains(&name));
        let rules = self.0.rules.iter().filter(|rule| {
            rule.declarations.iter().any(|it| it.name == name)
                && rule.selector.matches(&Styled(node))
        });
        let of_sheets = rules.flat_map(|rule| rule.declarations.iter().copied());
        let own = DeclarationTokenizer::from(node.attribute("style").unwrap_or_default());
        let (mut value, mut is_important) = (node.attribute(name), false);
        for declaration in of_sheets.chain(own).filter(|it| it.name == name) {
            if !is_important {
                (value, is_important) = (Some(declaration.value), declaration.important);
            }
        }
        value.map(str::trim)
    }

    /// The correction that takes the letters out of a part of a text which is not shown. `usvg`
    /// gives them the places in `x` and `y`, which are for the letters that are shown.
    pub(super) fn without_hidden_letters(&self, node: Node<'a, '_>, text: &str) -> Option<Edit> {
        if !is_one_of(node, &["tspan"]) {
            return None;
        }
        let is_empty = |size: &str| {
            let number = size.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
            number.parse() == Ok(0.0) && !node.children().any(|child| child.is_element())
        };
        let is_english = |language: &str| language == "en" || language.starts_with("en-");
        let languages = node.attribute("systemLanguage");
        let is_hidden = self.property(node, "display") == Some("none")
            || self.property(node, "font-size").is_some_and(is_empty)
            || languages.is_some_and(|all| !all.split(',').any(|it| is_english(it.trim())));
        let own = node.range();
        let start = node.first_child().filter(|_| is_hidden)?.range().start.checked_sub(1)?;
        let letters =
            text.get(start..own.end).filter(|it| it.starts_with('>') && start > own.start)?;
        let end = start + letters.rfind("</")?;
        // The lines of the text keep their numbers.
        let lines = "\n".repeat(text.get(start..end)?.matches('\n').count());
        Some((start..end, lines + ">"))
    }
}

/// An element as selectors see it.
struct Styled<'a, 'input>(Node<'a, 'input>);

impl Element for Styled<'_, '_> {
    fn parent_element(&self) -> Option<Self> {
        self.0.parent_element().map(Self)
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.0.prev_sibling_element().map(Self)
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        self.0.attribute(name).is_some_and(|value| operator.matches(value))
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.prev_sibling_element().is_none()
    }
}
