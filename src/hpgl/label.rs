//! Labels: the size, direction and slant of letters, and where each stroke of a letter lies.

use super::LABEL_END;
use super::coordinates::{Frame, Point, UNIT};
use crate::array::MapEach;
use crate::drawing::LetterStrokes;
use crate::fixed::{divide_rounding, product};

/// The number of the font's units that are as wide as a letter. The widest letters of the font take
/// 22, so that they stay within the letter and the space behind it.
const WIDTH_UNITS: i64 = 16;

/// The default width and height of letters: 0.187 and 0.269 cm, for a sheet of A4.
const DEFAULT_SIZE: [i64; 2] = [(UNIT * 748 + 5) / 10, (UNIT * 1076 + 5) / 10];

/// The style in which letters are drawn.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TextStyle {
    /// The width and the height of letters, in coordinates, or in percent of the distances between
    /// P1 and P2 if `is_relative_size`.
    pub(super) size: [i64; 2],
    pub(super) is_relative_size: bool,
    /// The direction in which letters follow each other, or in percent of the distances between P1
    /// and P2 if `is_relative_direction`.
    pub(super) direction: [i64; 2],
    pub(super) is_relative_direction: bool,
    /// The tangent of the slant, in units of 2^-16.
    pub(super) slant: i64,
    /// The byte that ends a label.
    pub(super) terminator: u8,
    /// The letter that is drawn at each point, 0 for none.
    pub(super) symbol: u8,
    /// The distance that the pen has covered along the line of letters since its beginning.
    pub(super) advanced: Point,
}

impl TextStyle {
    /// A value that consists of zero bits. It is not valid before initialization.
    pub(super) const ZERO: Self =
        Self { size: [0; 2], direction: [0; 2], terminator: 0, ..Self::DEFAULT };

    /// The style after `DF`.
    pub(super) const DEFAULT: Self = Self {
        size: DEFAULT_SIZE,
        is_relative_size: false,
        direction: [UNIT, 0],
        is_relative_direction: false,
        slant: 0,
        terminator: LABEL_END,
        symbol: 0,
        advanced: Point { x: 0, y: 0 },
    };

    /// `SI` without numbers.
    pub(super) fn set_default_size(&mut self) {
        (self.size, self.is_relative_size) = (DEFAULT_SIZE, false);
    }

    /// The width and the height of letters.
    fn letter(&self, frame: &Frame) -> [i64; 2] {
        if !self.is_relative_size {
            return self.size;
        }
        let Point { x, y } = frame.percents(self.size);
        [x, y]
    }

    /// The sine and the cosine of the direction, in units of 2^-30.
    fn sine_and_cosine(&self, frame: &Frame) -> [i64; 2] {
        let [x, y] = self.direction;
        let direction =
            if self.is_relative_direction { frame.percents([x, y]) } else { Point { x, y } };
        let length = direction.length();
        if length == 0 {
            return [0, 1 << 30];
        }
        [direction.y, direction.x]
            .map_each(|part| divide_rounding(product(part, 1 << 30), length.into()) as i64)
    }

    /// A distance on the page, given along the line of letters and across it.
    fn on_page(&self, frame: &Frame, distance: Point) -> Point {
        frame.turned(distance.rotated(self.sine_and_cosine(frame)))
    }

    /// The distance on the page of this many letters and this many lines up, in units of 2^-16.
    /// `None` beyond the range.
    pub(super) fn spaces(&self, frame: &Frame, [columns, lines]: [i64; 2]) -> Option<Point> {
        let [width, height] = self.letter(frame);
        let times = |count: i64, length: i64, halves: i64| {
            let distance = divide_rounding(product(count, length) * i128::from(halves), 2 << 16);
            i64::try_from(distance).ok().filter(|distance| distance.abs() <= 1 << 39)
        };
        let distance = Point { x: times(columns, width, 3)?, y: times(lines, height, 4)? };
        Some(self.on_page(frame, distance))
    }

    /// The distance on the page from where a letter begins to a point of it, in the font's units
    /// from the middle of its baseline. The middle of a symbol is where it begins.
    pub(super) fn letter_point(&self, frame: &Frame, [x, y]: [i32; 2], is_symbol: bool) -> Point {
        let [width, height] = self.letter(frame);
        let scaled = |units: i64, length: i64, of: i64| {
            divide_rounding(product(units, length), (2 * of).into()) as i64
        };
        let capital = i64::from(LetterStrokes::CAPITAL_HEIGHT);
        let [right, down] = if is_symbol { [0, capital] } else { [WIDTH_UNITS, 0] };
        let across = scaled(2 * i64::from(y) - down, height, capital);
        let slanted = divide_rounding(product(across, self.slant), UNIT.into());
        // The slant is limited, so the sum is far below 2^63.
        let along = scaled(2 * i64::from(x) + right, width, WIDTH_UNITS) + slanted as i64;
        self.on_page(frame, Point { x: along, y: across })
    }
}
