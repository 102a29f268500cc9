//! The lines of OBJ that draw polylines as a plan.

use super::format::Contents;
use crate::lines::{JobLine, Lines, Origin};
use crate::page::Page;
use penup::protocol::LINE_LIMIT;
use std::collections::HashMap;
use std::fmt::Write as _;

/// The number of thousandths of a millimetre in one, in which coordinates are written.
const PER_MM: f64 = 1000.0;

/// The lines of a plan, each with the element of the file that it comes from.
#[derive(Debug, Default)]
pub(super) struct Plan {
    file: String,
    /// The lines, and for each the number of its element.
    lines: Vec<(String, u32)>,
    /// The line of the file in which each element begins, and its text.
    elements: Vec<(usize, String)>,
    /// The numbers of the vertices, counted from 1, by their coordinates in thousandths of a
    /// millimetre.
    vertices: HashMap<[i64; 2], usize>,
    pen: Option<u32>,
    /// The number of polylines without a length, which are not drawn.
    pub(super) dots: usize,
}

impl Plan {
    pub(super) fn new(file: String) -> Self {
        Self { file, ..Self::default() }
    }

    /// The number of vertices, which are all different.
    pub(super) fn vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Begins an element of the file, to which the lines that follow belong.
    pub(super) fn begin(&mut self, line: usize, text: String) {
        self.elements.push((line, text));
    }

    fn push(&mut self, line: String) {
        let element = self.elements.len().saturating_sub(1);
        self.lines.push((line, u32::try_from(element).unwrap_or(u32::MAX)));
    }

    /// Draws a polyline with a pen, counted from 1. The points are millimetres with y upward. If
    /// there is a page, they are within it; what rounding brings outside is moved to its border.
    pub(super) fn draw(
        &mut self,
        points: impl IntoIterator<Item = [f64; 2]>,
        page: Option<[f64; 2]>,
        pen: u32,
    ) {
        let rounded = |value: f64, axis: usize| {
            let value = (value * PER_MM).round();
            let most = page.map(|page| (page[axis] * PER_MM).floor());
            most.map_or(value, |most| value.clamp(0.0, most)) as i64
        };
        let position = |[x, y]: [f64; 2]| [rounded(x, 0), rounded(y, 1)];
        let mut positions: Vec<[i64; 2]> = points.into_iter().map(position).collect();
        positions.dedup();
        if positions.len() < 2 {
            self.dots += 1;
            return;
        }
        if self.pen != Some(pen) {
            self.pen = Some(pen);
            self.push(format!("usemtl pen{pen}"));
        }
        let numbers: Vec<usize> =
            positions.into_iter().map(|position| self.vertex(position)).collect();
        let mut line = String::from("l");
        let mut last = None;
        for number in numbers {
            let before = line.len();
            // Writing to a string cannot fail.
            let _ = write!(line, " {number}");
            if line.len() > LINE_LIMIT {
                line.truncate(before);
                self.push(std::mem::replace(&mut line, String::from("l")));
                let _ = write!(line, " {} {number}", last.unwrap_or(number));
            }
            last = Some(number);
        }
        self.push(line);
    }

    /// The number of the vertex at this position, which is made if there is none.
    fn vertex(&mut self, position: [i64; 2]) -> usize {
        let next = self.vertices.len() + 1;
        let number = *self.vertices.entry(position).or_insert(next);
        if number == next {
            let [x, y] = position.map(|value| value as f64 / PER_MM);
            self.push(format!("v {x} {y} 0"));
        }
        number
    }

    /// What the user should know about any plan.
    pub(super) fn notes(&self) -> Vec<String> {
        let dots = match self.dots {
            0 => None,
            1 => Some("1 line is not drawn, because a dot has no length".to_owned()),
            dots => Some(format!("{dots} lines are not drawn, because a dot has no length")),
        };
        dots.into_iter().chain(super::capacity(self.vertices())).collect()
    }

    /// Ends the plan.
    pub(super) fn contents(self, page: Option<Page>, notes: Vec<String>) -> Contents {
        Contents { bounds: self.bounds(), page, notes, ..Contents::of(self) }
    }

    /// The least and the greatest coordinates in mm; `None` if nothing is drawn.
    pub(super) fn bounds(&self) -> Option<[[f64; 2]; 2]> {
        let mut positions = self.vertices.keys().copied();
        let first = positions.next()?;
        let bounds = positions.fold([first, first], |[low, high], [x, y]| {
            [[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]]
        });
        Some(bounds.map(|corner| corner.map(|value| value as f64 / PER_MM)))
    }
}

impl Lines for Plan {
    fn count(&self) -> usize {
        self.lines.len()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let (sent, element) = self.lines.get(index)?;
        let origin = self.elements.get(*element as usize).map(|(line, text)| Origin {
            file: self.file.clone(),
            line: *line,
            text: text.clone(),
        });
        Some(JobLine { sent: sent.clone(), origin })
    }
}
