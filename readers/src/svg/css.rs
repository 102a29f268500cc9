//! Corrects CSS in the text of an SVG, so that `usvg` obeys more of it: in style sheets and in
//! `style` attributes alike.
//!
//! Transforms get the form that they have in SVG. The line height in `font` is left out, and so are
//! custom properties, because `usvg` reads nothing that follows them. The pseudo-class `:root`
//! becomes an attribute selector, which counts as much, for an attribute that the root is given.
//! Units in capitals become small letters, and the marks of a comment of HTML around a style sheet
//! are left out, as CSS wants it. A declaration that `usvg` cannot read is left out, so that the
//! one before it or the attribute holds and those that follow are read. If there is nothing else
//! and the declaration matters, a declaration of [`UNREAD`] takes its place, and the user is told.

use super::{lengths, unread};
use simplecss::DeclarationTokenizer;
use std::borrow::Cow;
use std::ops::Range;
use svgtypes::Paint;
use usvg::roxmltree::{Document, Node};

/// A range of a text, and what stands there instead.
pub(super) type Edit = (Range<usize>, String);

/// The attribute that the root of an SVG has for style sheets that name it.
pub(super) const ROOT: &str = "data-penup-root";

/// The property that stands for one whose value is not read. Its value is the name of that
/// property, or [`VARIABLE`] if the value is a variable.
pub(super) const UNREAD: &str = "penup-unread";
pub(super) const VARIABLE: &str = "var";

/// The properties whose values are paints or colours.
const PAINTS: [&str; 4] = ["fill", "stroke", "color", "stop-color"];

/// The properties that may hide an element.
const HIDING: [&str; 2] = ["display", "visibility"];

const ROOT_CLASS: &str = ":root";

/// Whether a style sheet of the file may have a selector for the root.
pub(super) fn names_root(document: &Document<'_>) -> bool {
    let sheets = document.descendants().filter(|node| is_sheet(*node));
    let mut texts = sheets.flat_map(|sheet| sheet.children()).filter_map(|child| child.text());
    texts.any(|text| text.contains(ROOT_CLASS))
}

/// The corrections of the CSS that an element has, in the text of the document.
pub(super) fn edits_of(node: Node<'_, '_>, text: &str) -> Vec<Edit> {
    let mut ranges = Vec::new();
    let mut found = Vec::new();
    for attribute in node.attributes().filter(|it| it.namespace().is_none()) {
        if attribute.name() == "style" {
            ranges.push(attribute.range_value());
        } else if PAINTS.contains(&attribute.name()) {
            let paint = plain_paint(attribute.value()).filter(|it| *it != attribute.value());
            let paint = paint.filter(|paint| !paint.contains(['"', '\'', '&', '<']));
            found.extend(paint.map(|paint| (attribute.range_value(), paint.to_owned())));
        } else if HIDING.contains(&attribute.name()) {
            let plain = attribute.value().trim().to_ascii_lowercase();
            let is_edited = plain != attribute.value() && !plain.contains(['"', '\'', '&', '<']);
            found.extend(is_edited.then(|| (attribute.range_value(), plain)));
        }
    }
    if is_sheet(node) {
        let sheets = contents(node, text);
        let marks = sheets.iter().flat_map(|sheet| html_marks(text, sheet.clone()));
        found.extend(marks.map(|mark| (mark, String::new())));
        ranges.extend(sheets);
    }
    for range in ranges {
        let start = range.start;
        let has_attribute = |name: &str| !is_sheet(node) && node.has_attribute(name);
        let edits = edits(text.get(range).unwrap_or_default(), has_attribute).into_iter();
        found.extend(edits.map(|(it, instead)| (start + it.start..start + it.end, instead)));
    }
    found
}

/// Where the contents of a style sheet lie in the text.
fn contents(sheet: Node<'_, '_>, text: &str) -> Vec<Range<usize>> {
    let own = sheet.range();
    let texts = sheet.children().filter(Node::is_text).map(|text| text.range());
    // The contents of an entity lie elsewhere.
    let mut ranges: Vec<_> =
        texts.filter(|it| own.start <= it.start && it.end <= own.end).collect();
    let mut children = sheet.children();
    if let [only] = ranges.as_mut_slice()
        && children.nth(1).is_none()
        && let Some(length) = text.get(only.start..own.end).and_then(|rest| rest.rfind("</"))
    {
        // Of text that is partly in CDATA this is the first piece.
        only.end = only.start + length;
    }
    ranges
}

/// The marks of comments of HTML in a range of the text that holds a style sheet. CSS passes over
/// them, though not over what lies between them (CSS Syntax 3, section 5.4.1).
fn html_marks(text: &str, sheet: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let css = text.get(sheet.clone()).unwrap_or_default();
    let marks = ["<!--", "-->"].into_iter().flat_map(|mark| css.match_indices(mark));
    marks.map(move |(at, mark)| sheet.start + at..sheet.start + at + mark.len())
}

fn is_sheet(node: Node<'_, '_>) -> bool {
    node.is_element() && node.tag_name().name() == "style"
}

/// The corrections of a style sheet, or of a list of declarations of an element that
/// `has_attribute`s.
fn edits(css: &str, has_attribute: impl Fn(&str) -> bool) -> Vec<Edit> {
    let mut edits = Vec::new();
    // The paints that the present list has, and whether anything of the list is left.
    let (mut paints, mut is_begun) = (Vec::new(), false);
    for part in parts(css) {
        if part.end == Some(b'{') {
            edits.extend(edits_of_selectors(&part));
            paints.clear();
            is_begun = false;
            continue;
        }
        let has_paint = |name: &str| has_attribute(name) || paints.contains(&name);
        let edit = match without_leading_comments(part.text) {
            // `usvg` reads nothing behind a semicolon with which a list begins.
            "" => (!is_begun && part.end == Some(b';')).then(|| {
                let end = part.start + part.text.len();
                (end..end + 1, String::new())
            }),
            own => edit_of_declaration(&part, own, has_paint),
        };
        is_begun |= match &edit {
            Some((_, instead)) => !instead.is_empty(),
            None => !part.text.trim().is_empty(),
        };
        if edit.as_ref().is_none_or(|(_, it)| !it.is_empty() && !it.starts_with(UNREAD)) {
            paints.extend(part.text.split(':').next().map(str::trim));
        }
        edits.extend(edit);
    }
    for (range, instead) in &mut edits {
        // The lines of the text keep their numbers.
        let lines = |text: &str| text.matches('\n').count();
        let before = lines(css.get(range.clone()).unwrap_or_default());
        instead.push_str(&"\n".repeat(before.saturating_sub(lines(instead))));
    }
    edits
}

/// The text up to a brace or a semicolon.
struct Part<'a> {
    text: &'a str,
    /// Where it begins.
    start: usize,
    /// The letter at which it ends; `None` at the end of the text.
    end: Option<u8>,
}

/// The parts of a text. Braces and semicolons in comments and in strings end none.
fn parts(css: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let bytes = css.as_bytes();
    let (mut start, mut at) = (0, 0);
    while let Some(letter) = bytes.get(at).copied() {
        let next = match letter {
            b'/' if bytes.get(at + 1) == Some(&b'*') => comment_end(css, at),
            b'"' | b'\'' => string_end(bytes, at, letter),
            _ => at + 1,
        };
        if matches!(letter, b'{' | b'}' | b';') {
            let text = css.get(start..at).unwrap_or_default();
            parts.push(Part { text, start, end: Some(letter) });
            start = next;
        }
        at = next;
    }
    parts.push(Part { text: css.get(start..).unwrap_or_default(), start, end: None });
    parts
}

/// The end of the comment that begins at `at`.
fn comment_end(css: &str, at: usize) -> usize {
    let contents = at + "/*".len();
    let length = css.get(contents..).and_then(|rest| rest.find("*/"));
    length.map_or(css.len(), |length| contents + length + "*/".len())
}

/// The end of the string that begins with `quote` at `at`.
fn string_end(bytes: &[u8], at: usize, quote: u8) -> usize {
    let mut is_escaped = false;
    let is_end = |letter: &u8| {
        let ends = *letter == quote && !is_escaped;
        is_escaped = *letter == b'\\' && !is_escaped;
        ends
    };
    let contents = at + 1;
    let length = bytes.get(contents..).and_then(|rest| rest.iter().position(is_end));
    length.map_or(bytes.len(), |length| contents + length + 1)
}

/// A copy of a text without its comments.
pub(super) fn without_comments(css: &str) -> Cow<'_, str> {
    if !css.contains("/*") {
        return Cow::Borrowed(css);
    }
    let mut plain = String::with_capacity(css.len());
    let mut rest = css;
    while let Some((before, after)) = rest.split_once("/*") {
        plain.push_str(before);
        rest = after.split_once("*/").map_or("", |(_, after)| after);
    }
    plain.push_str(rest);
    Cow::Owned(plain)
}

/// The corrections of the selectors of a rule.
fn edits_of_selectors(part: &Part<'_>) -> Vec<Edit> {
    if part.text.contains(['"', '\'']) {
        return Vec::new();
    }
    let classes = part.text.match_indices(ROOT_CLASS).filter(|(at, class)| {
        let before = part.text.get(..*at).unwrap_or_default();
        let behind = part.text.get(at + class.len()..).unwrap_or_default();
        let is_more = |it: char| it.is_alphanumeric() || matches!(it, '-' | '_' | '\\' | '(');
        !before.ends_with([':', '\\']) && !behind.starts_with(is_more)
    });
    let ranges = classes.map(|(at, class)| part.start + at..part.start + at + class.len());
    ranges.map(|range| (range, format!("[{ROOT}]"))).collect()
}

/// The correction of a declaration, which is `own` and perhaps comments before it. `has_paint`
/// tells whether a paint is known without it.
fn edit_of_declaration(
    part: &Part<'_>,
    own: &str,
    has_paint: impl Fn(&str) -> bool,
) -> Option<Edit> {
    let end = part.start + part.text.len();
    // The marks of CDATA stay.
    if own.contains('<') || own.contains("]]>") {
        return None;
    }
    let (name, value) = own.split_once(':')?;
    let start = end - value.trim_start().len();
    let value = unread::without_important(value);
    let plain = without_comments(value);
    let name = name.trim_end();
    let hiding = name.to_ascii_lowercase();
    if HIDING.contains(&hiding.as_str()) {
        let plain = plain.trim().to_ascii_lowercase();
        let is_edited = hiding != name || plain != value;
        return is_edited
            .then(|| (end - own.len()..start + value.len(), format!("{hiding}:{plain}")));
    }
    let instead = match name {
        "transform" => unread::plain_transform(&plain),
        "font" => without_line_height(&plain),
        name if PAINTS.contains(&name) => plain_paint(&plain).map(str::to_owned),
        name => lengths::plain_value(name, &plain),
    };
    if let Some(instead) = instead {
        return (instead != value).then(|| (start..start + value.len(), instead));
    }
    let is_name = |letter: char| letter.is_alphanumeric() || matches!(letter, '-' | '_');
    let is_read = || {
        let read = DeclarationTokenizer::from(own).next();
        !PAINTS.contains(&name)
            && read.is_some_and(|read| without_comments(read.value).trim() == plain.trim())
    };
    if name.is_empty() || !name.chars().all(is_name) || !is_whole(own) || is_read() {
        return None;
    }
    let start = end - own.len();
    let what = if plain.contains("var(") { VARIABLE } else { name };
    let is_silent = plain.is_empty()
        || !unread::is_told(name)
        || what != VARIABLE && PAINTS.contains(&name) && has_paint(name);
    Some(match is_silent {
        // A semicolon alone is an error to `usvg`.
        true => (start..end + usize::from(part.end == Some(b';')), String::new()),
        false => (start..end, format!("{UNREAD}:{what}")),
    })
}

/// A paint as `usvg` reads it, which is the light one of two; `None` if it reads none.
pub(super) fn plain_paint(paint: &str) -> Option<&str> {
    let pair = paint.strip_prefix("light-dark(");
    let light = pair.and_then(|pair| pair.get(..find_outside_brackets(pair, |it| it == ',')?));
    let paint = light.unwrap_or(paint).trim();
    if ["unset", "revert"].iter().any(|it| it.eq_ignore_ascii_case(paint)) {
        return Some("inherit");
    }
    let keywords = ["none", "currentColor", "initial"];
    let keyword = keywords.into_iter().find(|it| it.eq_ignore_ascii_case(paint));
    keyword.or_else(|| Paint::from_str(paint).is_ok().then_some(paint))
}

/// Where the first such letter outside brackets stands.
fn find_outside_brackets(text: &str, is_end: impl Fn(char) -> bool) -> Option<usize> {
    let mut depth = 0_u32;
    text.find(|letter| {
        match letter {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth == 0 && is_end(letter)
    })
}

fn without_leading_comments(text: &str) -> &str {
    let mut rest = text.trim_start();
    while rest.starts_with("/*") {
        rest = rest.get(comment_end(rest, 0)..).unwrap_or_default().trim_start();
    }
    rest
}

/// Whether the semicolon after a text ends a declaration, rather than lying in brackets or in the
/// name of a letter.
fn is_whole(declaration: &str) -> bool {
    let number = |letter| declaration.matches(letter).count();
    !declaration.contains('&') && number('(') == number(')')
}

/// The value of `font` without the height of lines, which stands behind the size of the letters
/// and before the font; `None` if there is none.
fn without_line_height(font: &str) -> Option<String> {
    let slash = font.find(['/', '"', '\'']).filter(|at| font.as_bytes().get(*at) == Some(&b'/'))?;
    let (size, rest) = font.split_at(slash);
    let rest = rest.trim_start_matches('/').trim_start();
    let is_end = |it: char| it.is_whitespace() || matches!(it, '"' | '\'' | '&');
    let family =
        find_outside_brackets(rest, is_end).and_then(|end| rest.get(end..)).unwrap_or_default();
    Some(format!("{} {}", size.trim_end(), family.trim_start()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edited(css: &str) -> String {
        let mut edited = css.to_owned();
        for (range, instead) in edits(css, |_| false).into_iter().rev() {
            edited.replace_range(range, &instead);
        }
        edited
    }

    #[test]
    fn css_is_corrected_and_keeps_its_lines() {
        for (css, corrected) in [
            (".a{transform:translate(10px,5px)}", ".a{transform:translate(10,5)}"),
            (
                "/*{*/ /* ; */ transform /* */: none;transform: /* a\n */rotate(9deg) !important",
                "/*{*/ /* ; */ transform /* */: none;transform: rotate(9)\n !important",
            ),
            (
                "a:hover{fill:red;transform:rotate(1turn)}",
                "a:hover{fill:red;transform:rotate(1turn)}",
            ),
            ("font:italic 4px / 1.5 &quot;A&quot;;x:y", "font:italic 4px &quot;A&quot;;x:y"),
            (".a{font:4px/calc(1 + 2)'a/b'}", ".a{font:4px 'a/b'}"),
            ("font:4px 'a/b'", "font:4px 'a/b'"),
            ("font:4px/1.5", "font:4px "),
            (
                "svg:root, :root>a, :rooted, b::root{--x:'}';\n--y:\n(a);fill:red;--z:b}",
                "svg[data-penup-root], [data-penup-root]>a, :rooted, b::root{\n\nfill:red;}",
            ),
            ("--x:&quot;a;fill:red&quot;", "--x:&quot;a;fill:red&quot;"),
            ("a[b=':root']{}", "a[b=':root']{}"),
            ("transform:rotate(1deg", "transform:rotate(1deg"),
            ("/* transform:rotate(1deg)", "/* transform:rotate(1deg)"),
            (".a{--b:c]]>", ".a{--b:c]]>"),
            ("--b:<![CDATA[;]]>c", "--b:<![CDATA[;]]>c"),
            ("'\\';transform:rotate(1deg)", "'\\';transform:rotate(1deg)"),
            ("ä:{;}:;--:;é'", "ä:{}:;é'"),
            ("a{; /**/;fill:red;;stroke-dasharray: ;}", "a{ /**/fill:red;;}"),
            ("a:b(c(d));b:a/b;c:a=b;e:a:b;fill:red", "fill:red"),
            ("fill:url(&quot;#a&quot;);stroke:red", "fill:url(&quot;#a&quot;);stroke:red"),
            ("marker:url(data:a;base64,b);fill:RED", "marker:url(data:a;base64,b);fill:RED"),
            ("fill:red;fill:color(a 1 1 1);stroke:oklch(1)", "fill:red;penup-unread:stroke"),
            ("fill:a(1)}.b{fill:red}.c{fill:b(", "penup-unread:fill}.b{fill:red}.c{fill:b("),
            ("stroke:light-dark(rgb(1, 2, 3), #FFF);fill:NONE", "stroke:rgb(1, 2, 3);fill:none"),
            ("fill:CurrentColor;stroke:var(--a, b)", "fill:currentColor;penup-unread:var"),
            ("r:calc((1px));--a:b;@import url(a:b);", "penup-unread:r;@import url(a:b);"),
        ] {
            assert_eq!(edited(css), corrected, "{css}");
        }
    }
}
