//! The lines that are sent of a plan, each with the element of the file that it comes from.
//!
//! A drawing may have millions of lines and elements, so both lie in texts of their own, and little
//! more is kept of each: a line of two points takes some 50 bytes, and what the file says of it.

use super::{PER_MM, Stroke};
use crate::lines::{JobLine, Lines, Origin};
use penup::protocol::LINE_LIMIT;
use std::cell::Cell;
use std::collections::HashMap;
use std::fmt::Write as _;

/// The elements of a file, in the order in which they begin.
#[derive(Debug, Default)]
pub(super) struct Elements {
    /// The texts of all elements, one behind the other.
    text: String,
    /// The line of the file in which each begins, and where its text ends. A file has fewer than
    /// 4 GiB, and so fewer lines. Beyond 4 GiB of texts, an element is named by its line alone.
    each: Vec<(u32, u32)>,
}

impl Elements {
    /// Adds an element that begins in this line of the file. Of its text, what messages show is
    /// kept, and enough to see that there is more.
    pub(super) fn push(&mut self, line: usize, text: &str) {
        let before = self.text.len();
        let end = text.char_indices().nth(Origin::MOST_SHOWN + 1);
        self.text.push_str(end.and_then(|(end, _)| text.get(..end)).unwrap_or(text));
        if u32::try_from(self.text.len()).is_err() {
            self.text.truncate(before);
        }
        self.each.push((shortened(line), shortened(self.text.len())));
    }

    /// The number of elements.
    pub(super) fn count(&self) -> usize {
        self.each.len()
    }

    /// The place of an element in the file called `file`.
    fn origin(&self, file: &str, element: u32) -> Option<Origin> {
        let element = element as usize;
        let (line, end) = *self.each.get(element)?;
        let before = element.checked_sub(1).and_then(|before| self.each.get(before));
        let begin = before.map_or(0, |(_, end)| *end);
        let text = self.text.get(begin as usize..end as usize)?.to_owned();
        Some(Origin { file: file.to_owned(), line: line as usize, text })
    }
}

/// A number of 32 bits, or the greatest.
fn shortened(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// The letter that begins a text line which is not sent, but names the element of those behind it.
const ELEMENT: char = '#';

/// The number of lines from one that is found at once to the next.
const STRIDE: usize = 64;

/// The lines of a plan, each with the element of the file that it comes from.
#[derive(Debug)]
pub(crate) struct PlanLines {
    file: String,
    elements: Elements,
    /// All lines with their ends, and a line that begins with [`ELEMENT`] before the first one of
    /// each element.
    text: String,
    /// The number of lines that are sent.
    count: usize,
    /// Where every line begins whose number is a multiple of [`STRIDE`], and its element.
    marks: Vec<(usize, u32)>,
    /// The number of the line behind the last one that was asked for, where the text goes on
    /// there, and the element. Most lines are asked for in order.
    next: Cell<Option<(usize, usize, u32)>>,
}

impl PlanLines {
    /// Begins to write the lines of a plan with these elements.
    pub(super) fn writer(file: String, elements: Elements) -> PlanWriter {
        let (text, marks) = (String::new(), Vec::new());
        let lines = Self { file, elements, text, count: 0, marks, next: Cell::new(None) };
        PlanWriter { lines, element: None, pen: None, vertices: Vertices::default() }
    }

    /// The lines that are sent and their elements, from a line on that begins here in the text and
    /// comes from this element.
    fn from(&self, (begin, mut element): (usize, u32)) -> impl Iterator<Item = (&str, u32)> {
        let text = self.text.get(begin..).unwrap_or_default();
        text.split_terminator('\n').filter_map(move |line| match line.strip_prefix(ELEMENT) {
            Some(number) => {
                element = number.parse().unwrap_or(u32::MAX);
                None
            }
            None => Some((line, element)),
        })
    }

    fn job_line(&self, (line, element): (&str, u32)) -> JobLine {
        let origin = self.elements.origin(&self.file, element);
        JobLine { sent: line.to_owned(), origin }
    }
}

impl Lines for PlanLines {
    fn count(&self) -> usize {
        self.count
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let (mark, skipped) = match self.next.get() {
            Some((next, at, element)) if next == index => ((at, element), 0),
            _ => (*self.marks.get(index / STRIDE)?, index % STRIDE),
        };
        let (line, element) = self.from(mark).nth(skipped)?;
        // The line lies in the text, so the difference of their addresses is where it begins.
        let begin = line.as_ptr().addr() - self.text.as_ptr().addr();
        self.next.set(Some((index + 1, begin + line.len() + 1, element)));
        Some(self.job_line((line, element)))
    }

    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        let first = self.marks.first();
        let lines = first.into_iter().flat_map(|mark| self.from(*mark));
        Box::new(lines.map(|line| self.job_line(line)))
    }
}

/// Writes the lines of a plan, stroke by stroke.
pub(super) struct PlanWriter {
    lines: PlanLines,
    /// The element of the last line.
    element: Option<u32>,
    /// The pen of the last stroke.
    pen: Option<u32>,
    vertices: Vertices,
}

impl PlanWriter {
    fn push(&mut self, line: std::fmt::Arguments<'_>, element: u32) {
        let lines = &mut self.lines;
        // Writing to a string cannot fail.
        if self.element.replace(element) != Some(element) {
            let _ = writeln!(lines.text, "{ELEMENT}{element}");
        }
        if lines.count.is_multiple_of(STRIDE) {
            lines.marks.push((lines.text.len(), element));
        }
        lines.count += 1;
        let _ = writeln!(lines.text, "{line}");
    }

    /// Adds the lines of a stroke. Returns `false` if it has no length when it is rounded to
    /// thousandths of a millimetre.
    pub(super) fn draw(&mut self, stroke: &Stroke) -> bool {
        let position = |value: f64| (value * PER_MM).round() as i64;
        let mut positions: Vec<[i64; 2]> =
            stroke.points.iter().map(|point| point.map(position)).collect();
        positions.dedup();
        if positions.len() < 2 {
            return false;
        }
        let element = stroke.element;
        if self.pen.replace(stroke.pen) != Some(stroke.pen) {
            self.push(format_args!("usemtl pen{}", stroke.pen), element);
        }
        let mut vertex = |position: [i64; 2]| {
            let (number, is_new) = self.vertices.number(position);
            if is_new {
                let [x, y] = position.map(|value| value as f64 / PER_MM);
                self.push(format_args!("v {x} {y} 0"), element);
            }
            number
        };
        let numbers: Vec<usize> = positions.into_iter().map(&mut vertex).collect();
        let mut line = String::from("l");
        let mut last = None;
        for number in numbers {
            let before = line.len();
            // Writing to a string cannot fail.
            let _ = write!(line, " {number}");
            if line.len() > LINE_LIMIT {
                line.truncate(before);
                self.push(format_args!("{line}"), element);
                line = format!("l {} {number}", last.unwrap_or(number));
            }
            last = Some(number);
        }
        self.push(format_args!("{line}"), element);
        true
    }

    /// Returns all lines, and the number of vertices among them.
    pub(super) fn end(self) -> (PlanLines, usize) {
        let mut lines = self.lines;
        lines.text.shrink_to_fit();
        lines.marks.shrink_to_fit();
        (lines, self.vertices.count)
    }
}

/// The vertices so far.
#[derive(Debug, Default)]
struct Vertices {
    count: usize,
    /// Their numbers, counted from 1, by their coordinates in thousandths of a millimetre. What is
    /// farther than two kilometres away is not found again, which takes but a vertex more.
    numbers: HashMap<[i32; 2], u32>,
}

impl Vertices {
    /// The number of the vertex at this position, and whether it is a new one.
    fn number(&mut self, [x, y]: [i64; 2]) -> (usize, bool) {
        let next = self.count + 1;
        let number = match (x.try_into(), y.try_into(), next.try_into()) {
            (Ok(x), Ok(y), Ok(next)) => *self.numbers.entry([x, y]).or_insert(next) as usize,
            _ => next,
        };
        self.count += usize::from(number == next);
        (number, number == next)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Plan;
    use super::*;

    /// A plan of so many elements, of which every third draws two lines and every fourth none, and
    /// what is expected of its lines that draw: the element's line in the file and its text.
    fn plan(elements: u32) -> (Plan, Vec<(usize, String)>) {
        let (mut plan, mut drawn) = (Plan::new("a.svg".to_owned()), Vec::new());
        for number in 0..elements {
            let (line, text) = (7 * number as usize + 1, format!("<line x1=\"{number}\"/>"));
            plan.begin(line, &text);
            let x = f64::from(number);
            for row in 0..usize::from(number % 4 != 3) + usize::from(number % 3 == 0) {
                plan.draw([[x, row as f64], [x + 0.5, row as f64]], None, number / 100 + 1);
                drawn.push((line, text.clone()));
            }
        }
        (plan, drawn)
    }

    #[test]
    fn each_line_is_found_by_its_number_with_its_element() {
        for elements in [0, 1, 5, 63, 64, 65, 1000] {
            let (plan, drawn) = plan(elements);
            let (lines, notes) = plan.into_lines();
            assert_eq!(notes.len(), usize::from(elements == 1000), "{notes:?}");
            let in_order: Vec<JobLine> = lines.in_order().collect();
            assert_eq!(in_order.len(), lines.count());
            for (index, line) in in_order.iter().enumerate() {
                assert_eq!(lines.line(index).as_ref(), Some(line), "{index} of {elements}");
            }
            assert_eq!(lines.line(lines.count()), None);
            assert_eq!(lines.line(usize::MAX), None);
            let polylines = in_order.iter().filter(|line| line.sent.starts_with("l "));
            let origins: Vec<_> = polylines.map(|line| line.origin.clone()).collect();
            let expected: Vec<_> = (drawn.into_iter())
                .map(|(line, text)| Some(Origin { file: "a.svg".to_owned(), line, text }))
                .collect();
            assert_eq!(origins, expected);
        }
    }

    #[test]
    fn a_line_that_is_cut_goes_on_where_it_ended() {
        let (mut plan, count) = (Plan::new("a.svg".to_owned()), 400);
        plan.begin(1, "<polyline/>");
        plan.draw((0..count).map(|number| [f64::from(number), 0.0]), None, 1);
        let (lines, _) = plan.into_lines();
        let polylines: Vec<Vec<u32>> = (lines.in_order())
            .filter_map(|line| {
                assert!(line.sent.len() <= LINE_LIMIT, "{}", line.sent);
                let numbers = line.sent.strip_prefix("l ")?.split(' ');
                Some(numbers.map(|number| number.parse().expect("a number")).collect())
            })
            .collect();
        assert!(polylines.len() > 1);
        let mut next = 1;
        for numbers in polylines {
            for pair in numbers.windows(2) {
                assert_eq!(pair, [next, next + 1]);
                next += 1;
            }
        }
        assert_eq!(next, count as u32);
    }
}
