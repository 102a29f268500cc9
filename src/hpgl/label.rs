//! Labels: their bytes, the size, direction and slant of letters, and where each stroke of a
//! letter lies.

use super::coordinates::{Frame, Point, UNIT};
use super::interpreter::{ErrorNumber, Interpreter, Step};
use super::parser::Mode;
use super::polygon::PolygonBuffer;
use super::{DAMAGED, LABEL_END};
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
    size: [i64; 2],
    is_relative_size: bool,
    /// The direction in which letters follow each other, or in percent of the distances between P1
    /// and P2 if `is_relative_direction`.
    direction: [i64; 2],
    is_relative_direction: bool,
    /// The tangent of the slant, in units of 2^-16.
    slant: i64,
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
    fn set_default_size(&mut self) {
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
    fn spaces(&self, frame: &Frame, [columns, lines]: [i64; 2]) -> Option<Point> {
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

impl<B: PolygonBuffer> Interpreter<B> {
    /// `SI`, `SR`, `DI`, `DR` and `SL`: the size, direction and slant of letters.
    pub(super) fn choose_text_style(
        &mut self,
        name: &[u8; 2],
        numbers: &[i64],
    ) -> Result<(), ErrorNumber> {
        let text = &mut self.text;
        // Letters of more than a metre do not fit on any page.
        let is_size = |size: i64| size != 0 && size.abs() <= 110 * UNIT;
        match (name, numbers) {
            (b"SI", []) => text.set_default_size(),
            (b"SI", &[width, height]) if is_size(width) && is_size(height) => {
                // A centimetre has 400 plotter units.
                (text.size, text.is_relative_size) = ([400 * width, 400 * height], false);
            }
            (b"SR", []) => {
                (text.size, text.is_relative_size) = ([UNIT * 3 / 4, UNIT * 3 / 2], true);
            }
            (b"SR", &[width, height]) if is_size(width) && is_size(height) => {
                (text.size, text.is_relative_size) = ([width, height], true);
            }
            (b"DI" | b"DR", []) => {
                (text.direction, text.is_relative_direction) = ([UNIT, 0], false);
                text.advanced = Point::default();
            }
            (b"DI" | b"DR", &[run, rise]) if run != 0 || rise != 0 => {
                (text.direction, text.is_relative_direction) = ([run, rise], name == b"DR");
                text.advanced = Point::default();
            }
            (b"SL", []) => text.slant = 0,
            (b"SL", &[tangent]) => text.slant = tangent.clamp(-30 * UNIT, 30 * UNIT),
            (b"SI" | b"SR" | b"DI" | b"DR", [_, _]) => return Err(ErrorNumber::BadParameter),
            _ => return Err(ErrorNumber::WrongCount),
        }
        Ok(())
    }

    /// Takes a byte of a label. Letters are those of UTF-8. A byte that is none of it is one of
    /// Latin-1, as older programs write them.
    pub(super) fn push_text(&mut self, byte: u8) {
        let (partial, left) = core::mem::take(&mut self.partial);
        let is_over = byte == self.text.terminator;
        if byte == DAMAGED {
            return;
        }
        if left > 0 && matches!(byte, 0x80..=0xBF) && !is_over {
            let bits = partial << 6 | u32::from(byte & 0x3F);
            if left > 1 {
                self.partial = (bits, left - 1);
                return;
            }
            // The bits that the first byte has of the letter depend on the number of bytes.
            let letter = match bits {
                0..=0x3FFF => bits & 0x7FF,
                0x4000..=0xF_FFFF => bits & 0xFFFF,
                _ => bits & 0x1F_FFFF,
            };
            return self.write(char::from_u32(letter).unwrap_or('\u{FFFD}'));
        }
        if left > 0 {
            // The byte is taken again behind what came of the letter: a byte of Latin-1, or more,
            // which are drawn as a box.
            self.again = Some(byte);
            return self.write(u8::try_from(partial).map_or('\u{FFFD}', char::from));
        }
        match byte {
            _ if is_over => self.mode = Mode::Code,
            0x00..=0x1F | 0x7F => self.control_letter(byte, false),
            0xC2..=0xDF => self.partial = (byte.into(), 1),
            0xE0..=0xEF => self.partial = (byte.into(), 2),
            0xF0..=0xF4 => self.partial = (byte.into(), 3),
            _ => self.write(byte.into()),
        }
    }

    /// Draws a letter, and goes to where the next one begins.
    fn write(&mut self, letter: char) {
        if self.is_lost {
            return;
        }
        // A polygon has no letters.
        if self.polygon.is_open {
            return self.fail(ErrorNumber::Unknown);
        }
        self.add_letter(letter, false);
        self.space([UNIT, 0]);
    }

    /// A control character of a label: CR, LF and the step back. With `feeds`, CR also goes one
    /// line down. Others have no effect.
    pub(super) fn control_letter(&mut self, byte: u8, feeds: bool) {
        match byte {
            b'\r' => {
                self.at = self.at.minus(core::mem::take(&mut self.text.advanced));
                if feeds {
                    self.space([0, -UNIT]);
                }
            }
            b'\n' => self.space([0, -UNIT]),
            0x08 => self.space([-UNIT, 0]),
            _ => {}
        }
    }

    /// Moves the pen by this many letters and lines without drawing.
    pub(super) fn space(&mut self, columns_and_lines: [i64; 2]) {
        let [columns, lines] = columns_and_lines;
        let along = self.text.spaces(&self.frame, [columns, 0]);
        let across = self.text.spaces(&self.frame, [0, lines]);
        let (Some(along), Some(across)) = (along, across) else { return self.overflow() };
        let at = self.at.plus(along).and_then(|at| at.plus(across));
        let (Some(at), Some(advanced)) = (at, self.text.advanced.plus(along)) else {
            return self.overflow();
        };
        self.text.advanced = advanced;
        self.add(Step::Place(at));
    }
}
