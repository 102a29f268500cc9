//! Joins runs of straight lines before an SVG is parsed.
//!
//! Each element takes more than a kilobyte while a file is read: a node in the document, its
//! attributes, and a node in the tree of `usvg`. Programs that draw by chance or by rules write
//! hundreds of thousands of short lines, each as an element. So `line`, `polyline` and `path`
//! elements that follow each other and differ in nothing but where they lie become one `path`. It
//! says by an attribute how many they were. The lines of the text keep their numbers.
//!
//! A file in which an element may count for more than its lines is left as it is, and so is an
//! element that has an `id`, or that may be filled and is more than one straight line.

use std::fmt::Write as _;
use svgtypes::{PathParser, PathSegment};
use usvg::roxmltree::Node;

/// The attribute that says how many elements were joined.
const COUNT: &str = "data-penup-count";

/// The most elements of a run, so that a message names a line near the one that it is about.
const MOST: usize = 1000;

/// What makes an element count for more than its lines: rules that choose elements, what is drawn
/// at the ends of lines, what depends on the size of an element, and declarations of entities. Of
/// dashes it would not be known how many lines they were.
const OTHER_MEANINGS: [&str; 15] = [
    "<!ENTITY",
    "<![CDATA[",
    "<style",
    "xml-stylesheet",
    "dasharray",
    "marker",
    "url(",
    "<clipPath",
    "<mask",
    "<switch",
    "<script",
    "<animate",
    "<set",
    "foreignObject",
    "pathLength",
];

/// How many elements of the file this one stands for.
pub(super) fn count(node: Node<'_, '_>) -> usize {
    node.attribute(COUNT).and_then(|count| count.parse().ok()).unwrap_or(1)
}

/// An element that may be joined with others.
struct Straight<'t> {
    /// Its attributes but those that say where it lies.
    others: Vec<(&'t str, &'t str)>,
    /// Its lines as the data of a path.
    data: String,
}

/// A copy of `text` in which runs of lines are joined; `None` if there are none.
pub(super) fn joined(text: &str) -> Option<String> {
    if OTHER_MEANINGS.iter().any(|meaning| text.contains(meaning)) {
        return None;
    }
    let mut copy = String::new();
    // The text before `copied` is in the copy.
    let (mut copied, mut at) = (0, 0);
    while let Some(begin) = find(text, at, "<") {
        let Some(tag) = tag(text, begin) else { break };
        let Some(first) = straight(tag) else {
            at = begin + tag.len();
            continue;
        };
        let (mut end, mut number) = (begin + tag.len(), 1);
        let mut data = first.data;
        while number < MOST
            && let Some((tag, next_end)) = next_tag(text, end)
            && let Some(next) = straight(tag).filter(|next| next.others == first.others)
        {
            data.push_str(&next.data);
            (end, number) = (next_end, number + 1);
        }
        if number > 1 {
            copy.push_str(text.get(copied..begin)?);
            // Writing to a string cannot fail.
            let _ = write!(copy, "<path {COUNT}=\"{number}\" d=\"{data}\"");
            for (name, value) in &first.others {
                // Neither has a quotation mark.
                let _ = write!(copy, " {name}=\"{value}\"");
            }
            copy.push_str("/>");
            let lines = text.get(begin..end)?.matches('\n').count();
            copy.extend(std::iter::repeat_n('\n', lines));
            copied = end;
        }
        at = end;
    }
    if copied == 0 {
        return None;
    }
    copy.push_str(text.get(copied..)?);
    copy.shrink_to_fit();
    Some(copy)
}

/// Where `what` is found in the text from `from` on.
fn find(text: &str, from: usize, what: &str) -> Option<usize> {
    Some(from + text.get(from..)?.find(what)?)
}

/// The tag or comment that begins at this place; `None` if it does not end.
fn tag(text: &str, begin: usize) -> Option<&str> {
    let rest = text.get(begin..)?;
    if rest.starts_with("<!--") {
        return rest.get(..find(rest, 4, "-->")? + 3);
    }
    let mut quote = None;
    for (at, letter) in rest.bytes().enumerate() {
        match (quote, letter) {
            (None, b'>') => return rest.get(..=at),
            (None, b'"' | b'\'') => quote = Some(letter),
            (Some(open), _) if open == letter => quote = None,
            _ => {}
        }
    }
    None
}

/// The tag behind this place, with nothing but spaces between, and where it ends.
fn next_tag(text: &str, from: usize) -> Option<(&str, usize)> {
    let rest = text.get(from..)?;
    let begin = from + (rest.len() - rest.trim_start().len());
    let tag = text.get(begin..)?.starts_with('<').then(|| tag(text, begin))??;
    Some((tag, begin + tag.len()))
}

/// The lines of an element that may be joined with others; `None` if it is none.
fn straight(tag: &str) -> Option<Straight<'_>> {
    let inner = tag.strip_prefix('<')?.strip_suffix("/>")?;
    let (name, attributes) = inner.split_once(char::is_whitespace)?;
    if !matches!(name, "line" | "polyline" | "path") || attributes.contains('&') {
        return None;
    }
    let mut others = Vec::new();
    let (mut ends, mut data) = ([None; 4], None);
    let mut rest = attributes.trim_start();
    while !rest.is_empty() {
        let (key, after) = rest.split_once('=')?;
        let key = key.trim_end();
        let after = after.trim_start();
        let quote = after.chars().next().filter(|letter| matches!(letter, '"' | '\''))?;
        let (value, after) = after.strip_prefix(quote)?.split_once(quote)?;
        rest = after.trim_start();
        // What is not well-formed is left to the parser.
        if rest.len() == after.len() && !rest.is_empty() {
            return None;
        }
        let end = ["x1", "y1", "x2", "y2"].iter().position(|end| *end == key);
        match (name, key, end) {
            ("line", _, Some(end)) if ends[end].is_none() => ends[end] = Some(value.trim()),
            ("line", _, Some(_)) => return None,
            ("polyline", "points", _) | ("path", "d", _) if data.is_none() => {
                data = Some(value.trim());
            }
            (_, "id" | "d" | "points" | "transform-origin" | COUNT, _) => return None,
            _ if value.contains('"') => return None,
            _ => others.push((key, value)),
        }
    }
    let (data, is_straight) = match name {
        "line" => {
            let ends = ends.map(|end| end.unwrap_or("0"));
            let [x1, y1, x2, y2] = ends;
            if !ends.iter().all(|end| is_number(end)) || (x1, y1) == (x2, y2) {
                return None;
            }
            (format!("M{x1} {y1}L{x2} {y2}"), true)
        }
        "polyline" => {
            let is_separator = |letter: char| letter == ',' || letter.is_ascii_whitespace();
            let numbers: Vec<&str> =
                data?.split(is_separator).filter(|word| !word.is_empty()).collect();
            let is_whole = numbers.len() >= 4 && numbers.len().is_multiple_of(2);
            if !is_whole || !numbers.iter().all(|number| is_number(number)) {
                return None;
            }
            (format!("M{}", data?), numbers.len() == 4)
        }
        _ => {
            let data = data.filter(|data| data.starts_with('M') && !data.contains(['a', 'A']))?;
            let (mut moves, mut lines) = (0, 0);
            for segment in PathParser::from(data) {
                match segment.ok()? {
                    PathSegment::MoveTo { .. } => moves += 1,
                    PathSegment::LineTo { .. }
                    | PathSegment::HorizontalLineTo { .. }
                    | PathSegment::VerticalLineTo { .. } => lines += 1,
                    // Anything else bends or closes.
                    _ => lines += 2,
                }
            }
            (data.to_owned(), (moves, lines) == (1, 1))
        }
    };
    // What is filled is more than its lines, unless it is one straight line.
    let is_unfilled = others.contains(&("fill", "none"));
    if !is_straight && !is_unfilled {
        return None;
    }
    Some(Straight { others, data })
}

/// Whether a text is a number as SVG writes it, without a unit.
fn is_number(text: &str) -> bool {
    let is_of_number = |letter: u8| letter.is_ascii_digit() || b"+-.eE".contains(&letter);
    text.bytes().all(is_of_number) && text.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::joined;
    use crate::SourceFile;
    use crate::lines::Lines as _;

    /// The word in the comment of the second file keeps its lines apart.
    #[test]
    fn joined_lines_are_drawn_and_counted_as_they_were() {
        let line = |n: u32, more: &str| {
            let (x, y) = (n * 7 % 50, n * 13 % 40);
            format!("<line x1='{x}' y1='{y}' x2='{}' y2='{}.5' {more}/>\n", y + 3, x + 1)
        };
        let mut body = String::new();
        for group in [
            "<g stroke='red'>",
            "<g stroke='blue' transform='rotate(20)'>",
            "<g id='layer3' stroke='black' stroke-width='0'>",
            "<g stroke='green' fill='none' stroke-linecap='round'>",
            "<g>",
        ] {
            body += group;
            (0..9).for_each(|n| body += &line(n, "opacity='0.5'"));
            (0..9).for_each(|n| body += &line(n, "stroke='#123' fill=\"none\""));
            for n in 0..9 {
                body += &format!("<path d='M{n},3C{n} 9 20 {n} 9 9' fill='none'/>");
                body += &format!("<polyline points='{n} 1 8,{n} 70 {n}' fill='none'/>\n");
            }
            body += "<polyline points='1 2 3 4'/><polyline points='3,4 5,6'/></g>\n";
        }
        body += "<g id='%notes'><line x2='9' stroke='red'/><line x2='8' stroke='red'/></g>";
        let drawn = |comment: &str| {
            let text = format!(
                "<svg xmlns='http://www.w3.org/2000/svg' width='60mm' height='50mm' \
                 viewBox='0 0 60 50'><!-- {comment} -->\n{body}</svg>"
            );
            let is_joined = joined(&text).is_some();
            let file = SourceFile::new("a.svg".into(), text.into_bytes()).expect("an SVG");
            let lines: Vec<String> = file.in_order().map(|line| line.sent).collect();
            (is_joined, lines, file.notes().to_vec())
        };
        let (whole, apart) = (drawn(""), drawn("marker"));
        assert_eq!((whole.0, apart.0), (true, false));
        assert!(whole.1.len() > 300 && !whole.2.is_empty(), "{whole:?}");
        assert_eq!(whole.1, apart.1);
        assert_eq!(whole.2, apart.2);
    }

    #[test]
    fn lines_that_differ_in_their_place_alone_are_joined() {
        let text = "<svg>\n<line x1='1' y1='2' x2='3' y2='4' stroke='red'/>\n\
                    <line stroke='red' x2='5'\ny2='6' />\n<line stroke='blue' x2='5'/>\n</svg>";
        let expected = "<svg>\n<path data-penup-count=\"2\" d=\"M1 2L3 4M0 0L5 6\" \
                        stroke=\"red\"/>\n\n\n<line stroke='blue' x2='5'/>\n</svg>";
        assert_eq!(joined(text).as_deref(), Some(expected));
        let text = "<g><path d='M1 2L3 4'/><path d='M1,2h9'/><polyline points='1,2 3 4'/></g>";
        let expected = "<g><path data-penup-count=\"3\" d=\"M1 2L3 4M1,2h9M1,2 3 4\"/></g>";
        assert_eq!(joined(text).as_deref(), Some(expected));
        let text = "<g><path d='M1 2L3 4L5 6' fill='none'/><path d='M1,2C3 4 5 6 7 8z' \
                    fill='none'/></g>";
        assert!(joined(text).is_some());
    }

    #[test]
    fn what_counts_for_more_than_its_lines_is_left_alone() {
        for pair in [
            // Filled, or perhaps so.
            ["<path d='M1 2L3 4L5 6'/>"; 2],
            ["<polyline points='1 2 3 4 5 6'/>"; 2],
            // Others.
            ["<line x2='3'/>", "<line x2='4' stroke='red'/>"],
            ["<line x2='3'/>", "<line x2='4' id='b'/>"],
            ["<line x2='3'/>", "text <line x2='4'/>"],
            ["<line x2='3'/>", "<line x2='4'></line>"],
            ["<line x2='3'/>", "<!-- <line x2='4'/> -->"],
            ["<line x2='3'/>", "</g><g><line x2='4'/>"],
            ["<line x2='3'/>", "<svg:line x2='4'/>"],
            // Not understood here.
            ["<line x2='3mm'/>"; 2],
            ["<line x2='inf'/>"; 2],
            ["<line x2='3' class='a&amp;b'/>"; 2],
            ["<path d='m1 2L3 4'/>"; 2],
            ["<path d='M1 2L3 4 oops'/>"; 2],
            ["<path d='M1 2A1 1 0 0 0 3 4' fill='none'/>"; 2],
            ["<polyline points='1 2 3'/>"; 2],
            // Not well-formed.
            ["<line x2='3' x2='4'/>"; 2],
            ["<line x2='3'y2='4'/>"; 2],
            ["<path d='M1 2L3 4' d='M1 2L3 4'/>"; 2],
            // A dot.
            ["<line x1='3' x2='3'/>"; 2],
            ["<line x2='3' marker-end='none'/>"; 2],
        ] {
            let text = format!("<svg><g>{}{}</g></svg>", pair[0], pair[1]);
            assert_eq!(joined(&text), None, "{text}");
        }
        let pair = "<line x2='3'/><line x2='4'/>";
        for other in ["<style/>", "<switch>", "<clipPath>", "<a clip-path='url(#a)'/>"] {
            assert_eq!(joined(&format!("<svg>{other}{pair}</svg>")), None, "{other}");
        }
        assert!(joined(&format!("<svg>{pair}</svg>")).is_some());
        assert_eq!(joined(&format!("<svg>{pair}<line")).map(|_| ()), Some(()));
    }
}
