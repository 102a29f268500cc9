//! Reads OBJ files that hold more than a plotter understands, or hold it in another order.
//!
//! Faces and polylines may come before their vertices, and may repeat a corner: all vertices are
//! sent first, numbers become absolute, and a corner that repeats the one before is left out. A
//! face with two corners is a line; one corner is nothing. Points, surfaces, curves that are no
//! B-splines and what else has no meaning for a plotter is left out, and told in one note. More
//! materials than pens are all drawn with one.

use super::super::error::ReadError;
use super::super::flat::Flat;
use super::super::format::Contents;
use super::{LineFault, Words, decoded, is_sent, sendable};
use crate::lines::{JobLine, Lines, Origin};
use penup::protocol::LINE_LIMIT;
use std::collections::{BTreeMap, HashSet};
use std::fmt::Write as _;

/// The most pens that a plotter has.
pub(super) const MOST_PENS: usize = 32;

/// The statements of OBJ that have no meaning for a plotter.
const WITHOUT_MEANING: &[&str] = &[
    "p",
    "vp",
    "vw",
    "t",
    "lod",
    "bevel",
    "c_interp",
    "d_interp",
    "mg",
    "maplib",
    "usemap",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "bmat",
    "step",
    "curv2",
    "surf",
    "trim",
    "hole",
    "scrv",
    "sp",
    "con",
    "call",
    "csh",
    "bzp",
    "bsp",
    "cdc",
    "cdp",
    "res",
    "curvature",
    // Statements of a library of materials, which some programs write into the model itself.
    "newmtl",
    "Ka",
    "Kd",
    "Ks",
    "Ke",
    "Ns",
    "Ni",
    "Tf",
    "Tr",
    "d",
    "illum",
    "map_Ka",
    "map_Kd",
    "map_Ks",
];

/// Whether a statement with this keyword is read here although a plotter refuses it.
pub(super) fn reads(keyword: &str) -> bool {
    WITHOUT_MEANING.contains(&keyword)
        || matches!(keyword, "f" | "fo" | "l" | "cstype" | "deg" | "curv" | "parm" | "end")
}

/// Whether a plotter that holds this many vertices takes the corners of a face or polyline as they
/// are.
pub(super) fn is_regular(line: &str, vertices: usize) -> bool {
    let mut words = line.split(' ');
    if !matches!(words.next(), Some("f" | "l")) {
        return true;
    }
    let (mut first, mut last) = (None, None);
    let mut count = 0;
    for word in words {
        let Some(number) = corner(word, vertices) else { return true };
        if number == 0 || number > vertices || last == Some(number) {
            return false;
        }
        last = Some(number);
        first.get_or_insert(number);
        count += 1;
    }
    count > 1 && (line.starts_with('l') || first != last)
}

/// The number of the vertex of a corner such as `3/1/2` or `-1`, where this many came before.
/// `None` if it is no number. It may be 0 or too large.
fn corner(word: &str, vertices: usize) -> Option<usize> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let number = if number < 0 { number.checked_add(vertices as i64 + 1)? } else { number };
    Some(usize::try_from(number).unwrap_or(0))
}

/// The statements of a file, those with vertices first.
#[derive(Debug, Default)]
struct Irregular {
    name: String,
    /// The text of all lines, one after the other.
    text: String,
    /// Where each line ends in `text`, and its number in the file.
    vertices: Vec<(usize, usize)>,
    /// The text of all other lines, and where each ends.
    others_text: String,
    others: Vec<(usize, usize)>,
}

/// Whether a freeform element is read.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Freeform {
    /// B-splines are.
    BSplines,
    /// Freeform elements of this kind are not read.
    Other,
}

/// Reads `bytes`, the contents of a file called `name`.
///
/// # Errors
/// The file contains something that is no OBJ, or a corner that is no vertex.
pub(super) fn read(name: String, bytes: &[u8]) -> Result<Contents, ReadError> {
    let mut file = Irregular { name: name.clone(), ..Irregular::default() };
    let mut skipped: BTreeMap<String, usize> = BTreeMap::new();
    let (mut first_skipped, mut repeated, mut too_few) = (0, 0usize, 0usize);
    let mut materials: HashSet<String> = HashSet::new();
    // Corners that are vertices only if more of them follow: the greatest number, and its line.
    let mut farthest = (0, 0);
    let mut freeform = Freeform::BSplines;
    // Whether a surface is being left out, which lasts until its end.
    let mut is_in_surface = false;
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let mut words = Words { bytes, at: start, line: 0 };
    while words.at < bytes.len() {
        let number = words.line as usize + 1;
        let mut parts: Vec<String> = Vec::new();
        let mut is_text = true;
        while let Some(word) = words.next() {
            is_text &= !word.contains(&0);
            parts.push(decoded(word).chars().map(sendable).collect());
        }
        words.end_line();
        let shown = || parts.join(" ").chars().take(Origin::MOST_SHOWN + 1).collect();
        let origin = || Origin { file: name.clone(), line: number, text: shown() };
        if !is_text {
            return Err(ReadError::NotText { origin: origin(), kind: "an OBJ file" });
        }
        let refused = |reason: String| Err(ReadError::Line { origin: origin(), reason });
        let Some((keyword, rest)) = parts.split_first() else { continue };
        let mut skip = |what: &str| {
            *skipped.entry(what.to_owned()).or_default() += 1;
            first_skipped = if first_skipped == 0 { number } else { first_skipped };
        };
        let known = file.vertices.len();
        let mut line = parts.join(" ");
        match keyword.as_str() {
            "cstype" => {
                let is_read = rest == ["bspline"];
                freeform = if is_read { Freeform::BSplines } else { Freeform::Other };
                if !is_read {
                    skip(&line);
                }
                continue;
            }
            "surf" => {
                is_in_surface = true;
                skip(keyword);
                continue;
            }
            "end" if is_in_surface => {
                is_in_surface = false;
                continue;
            }
            "parm" if is_in_surface => continue,
            "curv" if freeform == Freeform::Other => {
                skip(keyword);
                continue;
            }
            "deg" | "parm" | "end" if freeform == Freeform::Other => continue,
            word if WITHOUT_MEANING.contains(&word) => {
                skip(keyword);
                continue;
            }
            "usemtl" | "g" => {
                materials.insert(line.clone());
            }
            "f" | "fo" | "l" | "curv" => {
                let is_curve = keyword == "curv";
                let (ends, corners) = rest.split_at(if is_curve { rest.len().min(2) } else { 0 });
                let mut numbers: Vec<usize> = Vec::new();
                for word in corners {
                    match corner(word, known) {
                        None => return refused(format!("\"{word}\" is no vertex number")),
                        Some(0) => return refused(format!("there is no vertex {word}")),
                        Some(vertex) => {
                            if vertex > farthest.0 {
                                farthest = (vertex, number);
                            }
                            if !is_curve && numbers.last() == Some(&vertex) {
                                repeated += 1;
                            } else {
                                numbers.push(vertex);
                            }
                        }
                    }
                }
                let is_face = matches!(keyword.as_str(), "f" | "fo");
                while is_face && numbers.len() > 1 && numbers.first() == numbers.last() {
                    numbers.pop();
                    repeated += 1;
                }
                if !is_curve && numbers.len() < 2 {
                    too_few += 1;
                    continue;
                }
                let keyword = match (is_curve, is_face && numbers.len() > 2) {
                    (true, _) => "curv",
                    (_, true) => "f",
                    (_, false) => "l",
                };
                file.push_element(keyword, ends, &numbers, number);
                if file.longest_since(number) <= LINE_LIMIT {
                    continue;
                }
                return refused(format!(
                    "the line is too long: one has at most {LINE_LIMIT} bytes"
                ));
            }
            _ => {}
        }
        if line.len() > LINE_LIMIT {
            let end = (0..=LINE_LIMIT).rev().find(|end| line.is_char_boundary(*end));
            line.truncate(end.unwrap_or(0));
        }
        match is_sent(&line) {
            Ok(false) => {}
            Ok(true) if keyword == "v" => file.push_vertex(&line, number),
            Ok(true) => file.push(&line, number),
            Err(LineFault::Refused(refusal)) => {
                let reason = crate::words::explained(refusal.number(), &[refusal.to_string()]);
                return refused(reason);
            }
            Err(_) => return refused("a file cannot hold commands for the plotter".to_owned()),
        }
    }
    if farthest.0 > file.vertices.len() {
        let (vertex, line) = farthest;
        let reason = format!("there is no vertex {vertex}: the file has {}", file.vertices.len());
        let origin = Origin { file: file.name, line, text: String::new() };
        return Err(ReadError::Line { origin, reason });
    }
    let mut notes = Vec::new();
    if !skipped.is_empty() {
        let kinds: Vec<String> =
            skipped.iter().map(|(word, count)| format!("{word} ({count})")).collect();
        let kinds = kinds.join(", ");
        notes.push(format!(
            "left out, without a meaning for a plotter: {kinds}; the first in line {first_skipped}"
        ));
    }
    if repeated > 0 || too_few > 0 {
        notes.push(format!(
            "{repeated} corners repeat the one before and are left out; {too_few} elements have \
             too few corners to be drawn"
        ));
    }
    if materials.len() > MOST_PENS {
        file.drop_materials();
        notes.push(format!(
            "there are {} materials or groups and {MOST_PENS} pens: all is drawn with pen 1",
            materials.len()
        ));
    }
    notes.extend(super::crease_note(&file));
    let bounds = Flat::of(&file).bounds(&file);
    Ok(Contents { bounds, notes, ..Contents::of(file) })
}

impl Irregular {
    fn push_vertex(&mut self, line: &str, number: usize) {
        self.text.push_str(line);
        self.vertices.push((self.text.len(), number));
    }

    fn push(&mut self, line: &str, number: usize) {
        self.others_text.push_str(line);
        self.others.push((self.others_text.len(), number));
    }

    /// Adds an element, a polyline in parts that share a vertex.
    fn push_element(&mut self, keyword: &str, ends: &[String], numbers: &[usize], number: usize) {
        let mut line = keyword.to_owned();
        ends.iter().for_each(|end| line += &format!(" {end}"));
        let mut last = None;
        for vertex in numbers {
            let before = line.len();
            // Writing to a string cannot fail.
            let _ = write!(line, " {vertex}");
            if line.len() > LINE_LIMIT && keyword == "l" {
                line.truncate(before);
                self.push(&line, number);
                line = format!("l {} {vertex}", last.unwrap_or(vertex));
            }
            last = Some(vertex);
        }
        self.push(&line, number);
    }

    /// Returns the length of the last line, if it comes from this line of the file.
    fn longest_since(&self, number: usize) -> usize {
        let mut ends = self.others.iter().rev();
        match (ends.next(), ends.next()) {
            (Some((end, own)), before) if *own == number => end - before.map_or(0, |(end, _)| *end),
            _ => 0,
        }
    }

    /// Leaves out all choices of a pen.
    fn drop_materials(&mut self) {
        let kept: Vec<(String, usize)> = (0..self.others.len())
            .filter_map(|index| part(&self.others_text, &self.others, index))
            .filter(|(line, _)| !line.starts_with("usemtl") && !line.starts_with("g "))
            .map(|(line, number)| (line.to_owned(), number))
            .collect();
        self.others_text.clear();
        self.others.clear();
        kept.iter().for_each(|(line, number)| self.push(line, *number));
    }
}

/// Line number `index` of those that end at `ends` in `text`, with its number in the file.
fn part<'t>(text: &'t str, ends: &[(usize, usize)], index: usize) -> Option<(&'t str, usize)> {
    let (end, number) = *ends.get(index)?;
    let begin = index.checked_sub(1).and_then(|before| ends.get(before)).map_or(0, |(end, _)| *end);
    Some((text.get(begin..end)?, number))
}

impl Lines for Irregular {
    fn count(&self) -> usize {
        self.vertices.len() + self.others.len()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let (line, number) = match index.checked_sub(self.vertices.len()) {
            None => part(&self.text, &self.vertices, index)?,
            Some(index) => part(&self.others_text, &self.others, index)?,
        };
        let origin = Origin { file: self.name.clone(), line: number, text: line.to_owned() };
        Some(JobLine { sent: line.to_owned(), origin: Some(origin) })
    }
}

#[cfg(test)]
mod tests {
    use crate::tests::{notes, sent};

    fn lines(text: &str) -> Vec<String> {
        sent("a.obj", text.as_bytes()).expect("OBJ")
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn faces_may_come_before_their_vertices_and_repeat_corners() {
        let expected = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "f 1 2 3", "l 3 4"];
        assert_eq!(lines(&format!("f 1 2 3\nl 3 4\n{SQUARE}")), expected);
        assert_eq!(lines(&format!("{SQUARE}f 1/1 2/2/2 2 3//3 1\nl 3 4 4\n")), expected);
        assert_eq!(
            lines(&format!("{SQUARE}f -4 -3 \\\n -2\nf 3 4\nf 2\nl 1\nf 1 1 1\n")),
            expected
        );
        let said = notes("a.obj", format!("{SQUARE}f 1 2 2 3 1\nf 2 2\n").as_bytes());
        let told = "3 corners repeat the one before and are left out; 1 elements have too few";
        assert!(said.len() == 1 && said[0].starts_with(told), "{said:?}");
    }

    #[test]
    fn what_has_no_meaning_is_told_in_one_note() {
        let text = format!(
            "{SQUARE}p 1 2\nlod 3\nvp 0 1\np 3\ncstype bezier\ndeg 3\ncurv 0 1 1 2 3 4\n\
             parm u 0 1\nend\ncstype bspline\ndeg 1\ncurv 0 1 1 2\nend\nsurf 0 1 0 1 1 2 3 4\n\
             parm u 0 1\nend\nf 1 2 3 4\n"
        );
        let all = lines(&text);
        assert_eq!(all[4..], ["deg 1", "curv 0 1 1 2", "end", "f 1 2 3 4"]);
        assert_eq!(
            notes("a.obj", text.as_bytes()),
            ["left out, without a meaning for a plotter: cstype bezier (1), curv (1), lod (1), \
              p (2), surf (1), vp (1); the first in line 5"]
        );
    }

    #[test]
    fn more_materials_than_pens_are_drawn_with_one() {
        let materials: String = (0..40).map(|n| format!("usemtl m{n}\nf 1 2 3\n")).collect();
        let text = format!("{SQUARE}{materials}");
        assert!(lines(&text).iter().all(|line| !line.starts_with("usemtl")));
        let said = notes("a.obj", text.as_bytes());
        let expected = "there are 40 materials or groups and 32 pens: all is drawn with pen 1";
        assert_eq!(said.first().map(String::as_str), Some(expected));
    }

    #[test]
    fn a_corner_that_is_no_vertex_is_refused_with_its_line() {
        for (text, reason) in [
            ("v 0 0 0\nf 1 2 3\n", "a.obj:2: there is no vertex 3: the file has 1"),
            ("v 0 0 0\nf 1 -2 1\n", "a.obj:2: there is no vertex -2"),
            ("v 0 0 0\np 1\nf 1 x 2\n", "a.obj:3: \"x\" is no vertex number"),
            ("v 0 0 0\np 1\n$plot\n", "a.obj:3: a file cannot hold commands"),
            ("v 0 0 0\np 1\nv 0 0\n", "a.obj:3: wrong number of values"),
        ] {
            let error = sent("a.obj", text.as_bytes()).expect_err("refused");
            assert!(error.starts_with(reason), "{error}");
        }
    }
}
