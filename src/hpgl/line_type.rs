//! `LT`: lines of dashes and dots.

use super::coordinates::{Point, UNIT};
use crate::fixed::{divide_rounding, product};

/// The parts of each pattern in percent of its length: what is drawn and what is not, in turn. A
/// part of no length is a dot.
const PATTERNS: [&[u8]; 6] = [
    &[0, 100],
    &[50, 50],
    &[70, 30],
    &[80, 10, 0, 10],
    &[70, 10, 10, 10],
    &[50, 10, 10, 10, 10, 10],
];

/// The least length of a pattern: a fifth of a millimetre.
const LEAST: i64 = 8 * UNIT;

/// The style in which lines are drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineStyle {
    /// The number after `LT`; `None` for solid lines.
    pub(super) number: Option<u8>,
    pub(super) length: PatternLength,
    /// The distance into the pattern at which the last line ended.
    phase: i64,
}

/// The length of a pattern, in units of 2^-16.
#[derive(Debug, Clone, Copy)]
pub(super) enum PatternLength {
    /// In percent of the distance from P1 to P2.
    Percent(i64),
    /// In plotter units.
    Units(i64),
}

/// A line that is drawn in parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) from: Point,
    pub(super) to: Point,
    pub(super) length: i64,
    /// The length that has been drawn already.
    done: i64,
}

/// A part of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DashPart {
    /// A dash.
    Dash([Point; 2]),
    /// A dot.
    Dot(Point),
    /// Nothing is drawn.
    Gap,
}

impl LineStyle {
    /// The length of the pattern when none was chosen: 4 percent.
    const DEFAULT_LENGTH: PatternLength = PatternLength::Percent(4 * UNIT);

    /// A value that consists of zero bits. It is not valid before initialization.
    pub(super) const ZERO: Self =
        Self { number: None, length: PatternLength::Percent(0), phase: 0 };

    /// Solid lines.
    pub(super) const SOLID: Self = Self { number: None, length: Self::DEFAULT_LENGTH, phase: 0 };

    /// Begins the pattern from its start, as every `LT` does.
    pub(super) fn chosen(number: u8, length: PatternLength) -> Self {
        Self { number: Some(number), length, phase: 0 }
    }

    /// The next part of a line, with patterns of this length. `None` at its end.
    pub(super) fn next_part(&mut self, stroke: &mut Stroke, pattern: i64) -> Option<DashPart> {
        let index = self.number.and_then(|number| usize::from(number).checked_sub(1));
        let Some(parts) = index.and_then(|index| PATTERNS.get(index)) else {
            // This line type has dots only, at the ends of lines.
            let is_over = core::mem::replace(&mut stroke.done, i64::MAX) == i64::MAX;
            return (!is_over).then_some(DashPart::Dot(stroke.to));
        };
        if stroke.done >= stroke.length {
            return None;
        }
        let pattern = pattern.max(LEAST);
        let mut begin = 0;
        for (index, part) in parts.iter().enumerate() {
            let end = begin + divide_rounding(product(pattern, (*part).into()), 100) as i64;
            let is_last = index + 1 == parts.len();
            let is_drawn = index % 2 == 0;
            if is_drawn && *part == 0 && self.phase == begin {
                // After the dot, the gap begins.
                self.phase += 1;
                return Some(DashPart::Dot(stroke.point(stroke.done)));
            }
            if self.phase >= end && !is_last {
                begin = end;
                continue;
            }
            let end = if is_last { pattern } else { end };
            let from = stroke.done;
            let length = (end - self.phase).max(1).min(stroke.length - from);
            stroke.done += length;
            self.phase += length;
            if self.phase >= pattern {
                self.phase = 0;
            }
            let dash = DashPart::Dash([stroke.point(from), stroke.point(stroke.done)]);
            return Some(if is_drawn { dash } else { DashPart::Gap });
        }
        None
    }
}

impl Stroke {
    /// The line from one position to another.
    pub(super) fn new(from: Point, to: Point) -> Self {
        Self { from, to, length: to.minus(from).length(), done: 0 }
    }

    /// The point at this distance from the beginning.
    fn point(&self, distance: i64) -> Point {
        let offset = self.to.minus(self.from);
        let part = |length: i64| {
            divide_rounding(product(length, distance), self.length.max(1).into()) as i64
        };
        Point { x: self.from.x + part(offset.x), y: self.from.y + part(offset.y) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    /// A line of this length in patterns of 100 units, as one letter for each 10 units; `.` is a
    /// dot.
    fn picture(style: &mut LineStyle, length: i64) -> String {
        let end = Point { x: length * UNIT, y: 0 };
        let mut stroke = Stroke::new(Point::default(), end);
        let mut text = String::new();
        let mut at = 0;
        while let Some(part) = style.next_part(&mut stroke, 100 * UNIT) {
            let done = (stroke.done.min(stroke.length) + UNIT / 2) / (10 * UNIT);
            let letter = match part {
                DashPart::Dash(_) => '-',
                DashPart::Dot(_) => {
                    text.push('.');
                    continue;
                }
                DashPart::Gap => ' ',
            };
            (at..done).for_each(|_| text.push(letter));
            at = done;
        }
        text
    }

    #[test]
    fn patterns() {
        for (number, expected) in [
            (0, "."),
            (1, ".          .          ."),
            (2, "-----     -----     -----"),
            (3, "-------   -------   -----"),
            (4, "-------- . -------- . -----"),
            (5, "------- - ------- - -----"),
            (6, "----- - - ----- - - -----"),
        ] {
            let mut style = LineStyle::chosen(number, PatternLength::Percent(0));
            assert_eq!(picture(&mut style, 250).trim_end(), expected, "LT{number}");
        }
    }

    #[test]
    fn a_pattern_goes_on_in_the_next_line() {
        let mut style = LineStyle::chosen(2, PatternLength::Percent(0));
        let parts = [30, 30, 70].map(|length| picture(&mut style, length));
        assert_eq!(parts.concat(), "-----     ---");
    }
}
