//! What the XML of an SVG says and `usvg` does not tell: layers, and what is not drawn.
//!
//! `usvg` keeps nothing of an element but its `id`. So every group, shape and text without one is
//! given an `id` in a copy of the text, by which the drawn paths are traced back to their elements.

use super::axidraw::Control;
use super::count::Count;
use super::flatten::Arcs;
use super::pens::Layer;
use super::styles::Styles;
use super::uses::Symbols;
use super::{css, lengths, pens, runs, unread};
use crate::page::Page;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use usvg::roxmltree::{Document, Error, Node, NodeId, ParsingOptions};

/// The elements that are drawn as paths.
pub(super) const SHAPES: [&str; 7] =
    ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon"];

/// The elements whose contents are drawn only where something refers to them, or never.
const NOT_DRAWN: [&str; 13] = [
    "defs",
    "symbol",
    "clipPath",
    "mask",
    "pattern",
    "marker",
    "linearGradient",
    "radialGradient",
    "filter",
    "flowRoot",
    "hatch",
    "switch",
    "metadata",
];

/// The elements whose contents are not looked for in the drawing, wherever they stand.
const NOT_SHOWN: [&str; 3] = ["clipPath", "mask", "pattern"];

/// A feature of SVG 1.1 that is there. SVG 2 asks for none.
const FEATURE: &str = "http://www.w3.org/TR/SVG11/feature#Shape";

/// The most prefixes that are declared for a file.
const MOST_PREFIXES: usize = 20;

pub(super) const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

/// Parses the text of an SVG.
///
/// # Errors
/// The text is not well-formed XML.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, Error> {
    Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..Default::default() })
}

/// A copy of `text` in which the prefixes are declared that the file uses without a declaration, as
/// what is cut out of a web page does.
pub(super) fn with_prefixes(text: &str) -> Cow<'_, str> {
    let mut text = Cow::Borrowed(text);
    for _ in 0..MOST_PREFIXES {
        let prefix = match parsed(&text) {
            Err(Error::UnknownNamespace(prefix, _)) => prefix,
            _ => break,
        };
        let space = match prefix.as_str() {
            "xlink" => "http://www.w3.org/1999/xlink",
            "inkscape" => INKSCAPE,
            other => other,
        };
        let Some(begin) = text.find("<svg") else { break };
        let declaration = format!(" xmlns:{prefix}=\"{space}\"");
        text.to_mut().insert_str(begin + "<svg".len(), &declaration);
    }
    text
}

/// Whether `node` is an element of SVG with one of these names.
pub(super) fn is_one_of(node: Node<'_, '_>, names: &[&str]) -> bool {
    let namespace = node.tag_name().namespace();
    node.is_element()
        && matches!(namespace, None | Some("http://www.w3.org/2000/svg"))
        && names.contains(&node.tag_name().name())
}

/// A copy of `text` in which every group, reference, shape and text has an `id`, and CSS and the
/// size of the picture have a form that `usvg` reads. In a `switch` no `foreignObject` is chosen,
/// and features of SVG that are asked for are there, as in a browser.
pub(super) fn with_ids(text: &str, document: &Document<'_>) -> String {
    let own: HashSet<&str> =
        document.descendants().filter_map(|node| node.attribute("id")).collect();
    let names_root = css::names_root(document);
    let symbols = Symbols::of(document);
    let styles = Styles::of(document);
    let mut copy = String::with_capacity(text.len() + text.len() / 4);
    let (mut copied, mut number) = (0, 0_u32);
    for node in document.descendants() {
        let is_traced =
            is_one_of(node, &SHAPES) || is_one_of(node, &["g", "a", "use", "svg", "text", "image"]);
        let is_root = node == document.root_element();
        let is_traced = is_traced && node.attribute("id").is_none() && !is_root;
        let is_named = is_root && names_root && node.attribute(css::ROOT).is_none();
        let mut edits = edits_of(node, text);
        edits.extend(symbols.edits_of(node));
        edits.extend(styles.without_hidden_letters(node, text));
        let sizes = symbols.sizes_for(node);
        let is_foreign = is_one_of(node, &["foreignObject"]);
        let is_left_out = is_foreign && node.attribute("requiredExtensions").is_none();
        let is_empty = !is_root && lengths::is_empty(node) && !node.has_attribute("display");
        if !is_traced
            && !is_left_out
            && !is_empty
            && !is_named
            && sizes.is_empty()
            && edits.is_empty()
        {
            continue;
        }
        // The name of an element ends at a space, a slash or an angle bracket. The contents of an
        // entity lie elsewhere in the text, and perhaps not in order.
        let start = node.range().start;
        let Some(rest) = text.get(start + 1..).filter(|_| start >= copied) else { continue };
        let is_end = |letter: char| letter.is_whitespace() || matches!(letter, '/' | '>');
        let Some(name) = rest.find(is_end) else { continue };
        let end = start + 1 + name;
        copy.push_str(text.get(copied..end).unwrap_or_default());
        copied = end;
        if is_left_out {
            copy.push_str(" requiredExtensions=\"penup\"");
        }
        if is_empty {
            copy.push_str(" display=\"none\"");
        }
        if is_named {
            copy.push_str(&format!(" {}=\"\"", css::ROOT));
        }
        copy.push_str(&sizes);
        if is_traced {
            let id = loop {
                number += 1;
                let id = format!("penup-{number}");
                if !own.contains(id.as_str()) {
                    break id;
                }
            };
            copy.push_str(&format!(" id=\"{id}\""));
        }
        edits.sort_by_key(|(range, _)| range.start);
        for (range, value) in edits {
            if range.start >= copied {
                copy.push_str(text.get(copied..range.start).unwrap_or_default());
                copy.push_str(&value);
                copied = range.end;
            }
        }
    }
    copy.push_str(text.get(copied..).unwrap_or_default());
    copy
}

/// The corrections of an element that is not only given an `id`.
fn edits_of(node: Node<'_, '_>, text: &str) -> Vec<css::Edit> {
    let mut edits = css::edits_of(node, text);
    let own_condition = node.attribute_node("requiredFeatures");
    let own_condition = own_condition.filter(|_| !is_one_of(node, &["foreignObject"]));
    edits.extend(own_condition.map(|it| (it.range_value(), FEATURE.to_owned())));
    if node == node.document().root_element() {
        edits.extend(lengths::edits_of_size(node));
    } else {
        edits.extend(lengths::edits_of_attributes(node));
    }
    edits
}

/// The elements of an SVG in which every group and shape has an `id`.
#[derive(Debug)]
pub(super) struct Markup<'a, 'input> {
    document: &'a Document<'input>,
    /// The elements by their `id`; `None` for an `id` that several have.
    by_id: HashMap<&'a str, Option<NodeId>>,
    /// The positions of the line ends in the text.
    line_ends: Vec<usize>,
    styles: Styles<'a>,
}

impl<'a, 'input> Markup<'a, 'input> {
    pub(super) fn new(document: &'a Document<'input>) -> Self {
        let mut by_id = HashMap::new();
        for node in document.descendants() {
            if let Some(id) = node.attribute("id") {
                by_id.entry(id).and_modify(|known| *known = None).or_insert(Some(node.id()));
            }
        }
        let text = document.input_text();
        let line_ends = text.match_indices('\n').map(|(at, _)| at).collect();
        Self { document, by_id, line_ends, styles: Styles::of(document) }
    }

    /// The element with this `id`; `None` if it is empty, unknown, or several have it.
    pub(super) fn element(&self, id: &str) -> Option<NodeId> {
        self.by_id.get(id).copied().flatten()
    }

    fn node(&self, element: NodeId) -> Option<Node<'a, 'input>> {
        self.document.get_node(element)
    }

    /// The number of the line in which an element begins, and the text of that element up to its
    /// end or the end of the line.
    pub(super) fn position(&self, element: NodeId) -> (usize, String) {
        let Some(node) = self.node(element) else { return (1, String::new()) };
        let start = node.range().start;
        let text = self.document.input_text().get(start..).unwrap_or_default();
        let end = text.find(['>', '\n']).map_or(text.len(), |end| end + 1);
        let shown: String = text.get(..end).unwrap_or_default().chars().take(200).collect();
        // The attributes that this program adds are not the user's.
        let shown = without(&without(&shown, " id=\"penup-"), " data-penup-");
        (self.line_ends.partition_point(|end| *end < start) + 1, shown.trim().to_owned())
    }

    /// How many elements of the file this one stands for; 1 if it is not known.
    pub(super) fn count(&self, element: Option<NodeId>) -> usize {
        element.and_then(|element| self.node(element)).map_or(1, runs::count)
    }

    /// Which Béziers of this element's path are arcs.
    pub(super) fn arcs(&self, element: Option<NodeId>) -> Arcs {
        let Some(node) = element.and_then(|element| self.node(element)) else {
            return Arcs::Quarters;
        };
        let has_arcs = match node.tag_name().name() {
            "circle" | "ellipse" | "rect" => true,
            "path" => node.attribute("d").is_some_and(|data| data.contains(['a', 'A'])),
            _ => false,
        };
        if has_arcs { Arcs::Any } else { Arcs::None }
    }

    /// The outermost layer that contains this element: a layer of Inkscape, or else a group right
    /// below the root that has a label or a number in its `id`.
    pub(super) fn layer(&self, element: NodeId) -> Option<Layer> {
        let groups = self.node(element)?.ancestors().filter(|node| is_one_of(*node, &["g"]));
        let layer = groups.filter(|node| is_layer(*node)).last()?;
        let name = pens::name(layer);
        Some(Layer { element: layer.id(), number: pens::pen_of(layer), name })
    }

    /// Whether a layer that contains this element is not plotted, because its name begins with `%`.
    pub(super) fn is_documentation(&self, element: NodeId) -> bool {
        self.node(element).is_some_and(is_in_documentation)
    }

    /// Counts what the file has that is never drawn, in sentences for the user. `drawn` are the
    /// elements that were found in the drawing, and `reads_text` says whether there are fonts.
    pub(super) fn left_out(&self, drawn: &HashSet<NodeId>, reads_text: bool) -> Vec<String> {
        let mut texts = Count::default();
        let mut images = Count::default();
        for node in self.document.descendants().filter(|node| is_one_of(*node, &["text", "image"]))
        {
            if is_within(node, &NOT_SHOWN) || drawn.contains(&node.id()) {
                continue;
            }
            let is_text = is_one_of(node, &["text"]);
            if is_text && (!has_letters(node) || is_within(node, &NOT_DRAWN)) {
                continue;
            }
            if !is_hidden(node) && !is_in_documentation(node) {
                let counted = if is_text { &mut texts } else { &mut images };
                counted.add(self.document, node);
            }
        }
        let mut said = Vec::new();
        let what = match reads_text {
            true => "not drawn: no font for it is found, or it has no size: convert text to paths",
            false => "not drawn, because a page has no fonts: open the file with penup page",
        };
        texts.say(&mut said, ["text is", "texts are"], what);
        images.say(&mut said, ["image is", "images are"], "not drawn: only those that are SVG are");
        said.extend(self.shapes_left_out(drawn));
        said
    }

    /// Counts what the file has that is never drawn and is neither a text nor an image, in
    /// sentences for the user. `drawn` are the elements that were found in the drawing.
    pub(super) fn shapes_left_out(&self, drawn: &HashSet<NodeId>) -> Vec<String> {
        let mut foreign = Count::default();
        let mut broken = Count::default();
        let mut missing = Count::default();
        let mut shortened = Count::default();
        for node in self.document.descendants() {
            if !node.is_element() || is_within(node, &NOT_SHOWN) {
                continue;
            }
            let counted = if is_one_of(node, &["foreignObject"]) {
                match has_other_letters(node) {
                    None => &mut foreign,
                    Some(true) => &mut shortened,
                    Some(false) => continue,
                }
            } else if has_error(node) {
                &mut broken
            } else if (is_one_of(node, &SHAPES) || is_one_of(node, &["use"]))
                && !is_within(node, &NOT_DRAWN)
                && node.attribute("id").is_some_and(|id| self.element(id).is_some())
                && !drawn.contains(&node.id())
            {
                &mut missing
            } else {
                continue;
            };
            if !is_hidden(node) && !is_in_documentation(node) {
                counted.add(self.document, node);
            }
        }
        let mut said = Vec::new();
        let what = "not drawn: it is not SVG";
        foreign.say(&mut said, ["foreignObject is", "foreignObjects are"], what);
        let what = "drawn as another text, which the file has for programs that read no HTML: \
                    draw.io shortens it so, unless text is exported without formatting and word \
                    wrap";
        shortened.say(&mut said, ["text in HTML is", "texts in HTML are"], what);
        let what = "not drawn as a whole: there is an error in the data, and the rest is left out";
        broken.say(&mut said, ["shape is", "shapes are"], what);
        let what = "not drawn: hidden, or without a size or points, or with one in a unit that is \
                    not read, or a reference to nothing";
        missing.say(&mut said, ["element is", "elements are"], what);
        said.extend(unread::sentences(self.document));
        said
    }

    /// Says how large a unit is taken to be, if the file does not say the size of its `page`, or
    /// says it in pixels of a program whose pixels have another size.
    pub(super) fn size_note(&self, page: Page) -> Option<String> {
        let root = self.document.root_element();
        let version = root.attribute((INKSCAPE, "version")).unwrap_or_default();
        let minor = version.strip_prefix("0.").and_then(|it| it.split(['.', ' ']).next());
        let is_old = minor.and_then(|it| it.parse().ok()).is_some_and(|minor: u32| minor < 92);
        let program = if self.document.input_text().contains("Adobe Illustrator") {
            Some(("Adobe Illustrator", 72.0, "1.3333"))
        } else {
            is_old.then_some(("Inkscape before 0.92", 90.0, "1.0667"))
        };
        let is_said = lengths::is_said(root);
        if is_said && (program.is_none() || !lengths::is_in_pixels(root)) {
            return None;
        }
        let what = if is_said { "gives its size in px" } else { "does not say its size" };
        let Page { width, height } = page;
        let mut note = format!(
            "the SVG {what}: 96 units are taken as an inch, and its page is {width} x {height} mm"
        );
        if let Some((program, units, scale)) = program {
            let [width, height] =
                [width, height].map(|size| (size * 9600.0 / units).round() / 100.0);
            note += &format!(
                "; {program} takes {units}: its size by --scale {scale} --page {width}x{height}"
            );
        }
        Some(note)
    }

    /// Whether a stroke is asked for by the element, or by those that contain it.
    pub(super) fn asks_for_stroke(&self, element: NodeId) -> bool {
        let mut nodes = self.node(element).into_iter().flat_map(|node| node.ancestors());
        nodes
            .find_map(|node| self.styles.property(node, "stroke"))
            .is_some_and(|paint| !matches!(paint, "none" | "transparent"))
    }

    /// Whether the element or one that contains it says that it is not shown.
    pub(super) fn is_hidden(&self, element: NodeId) -> bool {
        let mut nodes = self.node(element).into_iter().flat_map(|node| node.ancestors());
        nodes.any(|node| {
            self.styles.property(node, "display") == Some("none")
                || self.styles.property(node, "visibility") == Some("hidden")
        })
    }

    /// Whether the element is an image.
    pub(super) fn is_image(&self, element: NodeId) -> bool {
        self.node(element).is_some_and(|node| is_one_of(node, &["image"]))
    }

    /// Whether the colours of an element are mixed as light is.
    pub(super) fn is_linear(&self, element: NodeId) -> bool {
        self.own(element, "color-interpolation") == Some("linearRGB")
    }

    /// The length that an element says its path has, 0 or more.
    pub(super) fn path_length(&self, element: NodeId) -> Option<f64> {
        let said = self.node(element)?.attribute("pathLength")?;
        said.trim().parse().ok().filter(|length: &f64| length.is_finite() && *length >= 0.0)
    }

    /// Whether the width of an element's stroke, and with it the length of its dashes, is the same
    /// whatever transforms there are.
    pub(super) fn has_fixed_stroke(&self, element: NodeId) -> bool {
        self.own(element, "vector-effect") == Some("non-scaling-stroke")
    }

    /// The value of a property that an element has, and not by inheritance.
    fn own(&self, element: NodeId, property: &str) -> Option<&'a str> {
        self.styles.property(self.node(element)?, property)
    }
}

/// The text of a tag without the attribute that begins so.
fn without(tag: &str, attribute: &str) -> String {
    let Some((before, rest)) = tag.split_once(attribute) else { return tag.to_owned() };
    let behind = rest.split('"').skip(2 - attribute.matches('"').count()).collect::<Vec<_>>();
    format!("{before}{}", behind.join("\""))
}

/// Whether the file has a text, or perhaps an SVG as an image, which may have one.
pub(super) fn has_text(document: &Document<'_>) -> bool {
    document.descendants().any(|node| is_one_of(node, &["text"]))
        || references_of_images(document).any(|address| address.contains("svg"))
}

/// The number of images that are files of their own.
pub(super) fn references_to_files(document: &Document<'_>) -> usize {
    references_of_images(document).filter(|address| !address.starts_with("data:")).count()
}

/// Where the images of a file are.
fn references_of_images<'a>(document: &'a Document<'_>) -> impl Iterator<Item = &'a str> {
    let images = document.descendants().filter(|node| is_one_of(*node, &["image"]));
    images.filter_map(|image| Some(image.attributes().find(|it| it.name() == "href")?.value()))
}

/// Whether the letters of a `foreignObject` are others than those of what is drawn instead, if it
/// has any; `None` if nothing is.
fn has_other_letters(foreign: Node<'_, '_>) -> Option<bool> {
    let switch = foreign.parent_element().filter(|parent| is_one_of(*parent, &["switch"]))?;
    let letters = |node: Node<'_, '_>| -> String {
        let all = node.descendants().filter(Node::is_text).filter_map(|node| node.text());
        all.flat_map(str::chars).filter(|letter| !letter.is_whitespace()).collect()
    };
    let own = letters(foreign);
    let others = switch.children().filter(|node| node.is_element() && *node != foreign);
    Some(!own.is_empty() && !others.map(letters).any(|other| other == own))
}

/// Whether a text has letters.
pub(super) fn has_letters(text: Node<'_, '_>) -> bool {
    let mut letters = text.descendants().filter_map(|node| node.text());
    letters.any(|letters| !letters.trim().is_empty())
}

fn is_within(node: Node<'_, '_>, names: &[&str]) -> bool {
    node.ancestors().skip(1).any(|node| is_one_of(node, names))
}

/// Whether a layer that contains `node` is not plotted, because its name begins with `%`.
fn is_in_documentation(node: Node<'_, '_>) -> bool {
    let mut groups = node.ancestors().filter(|node| is_one_of(*node, &["g"]));
    groups.any(|group| is_layer(group) && Control::of(&pens::name(group)).is_documentation)
}

/// Whether the data of a path, or the points of a polyline or polygon, have an error, at which what
/// is drawn ends.
fn has_error(node: Node<'_, '_>) -> bool {
    if is_one_of(node, &["polyline", "polygon"]) {
        let points = node.attribute("points").unwrap_or_default();
        let mut numbers = svgtypes::NumberListParser::from(points);
        let is_odd = numbers.count() % 2 == 1;
        return is_odd || numbers.any(|number| number.is_err());
    }
    let data = node.attribute("d").filter(|_| is_one_of(node, &["path"])).unwrap_or_default();
    data.trim() != "none" && svgtypes::PathParser::from(data).any(|segment| segment.is_err())
}

/// Whether the element or one that contains it says by itself that it is not shown.
fn is_hidden(node: Node<'_, '_>) -> bool {
    node.ancestors().any(|node| {
        let says = |name: &str, value: &str| {
            let mut style = unread::declarations(node.attribute("style").unwrap_or_default());
            node.attribute(name).is_some_and(|own| own.trim() == value)
                || style.any(|declaration| declaration == (name, value))
        };
        says("display", "none") || says("visibility", "hidden")
    })
}

fn is_layer(group: Node<'_, '_>) -> bool {
    let is_on_top = group.parent_element().is_some_and(|parent| parent.parent_element().is_none());
    let has_label = group.attribute((INKSCAPE, "label")).is_some();
    group.attribute((INKSCAPE, "groupmode")) == Some("layer")
        || is_on_top && (has_label || pens::pen_of(group).is_some())
}
