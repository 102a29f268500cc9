//! The encoded polylines of HP-GL/2, `PE`: numbers in base 64 or 32, with flags between them.

use super::DAMAGED;
use super::coordinates::Point;
use super::interpreter::{ErrorNumber, Interpreter};
use super::polygon::PolygonBuffer;

/// The progress of an encoded polyline.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Polyline {
    /// Whether the next move is made with the pen up.
    is_up: bool,
    /// Whether the next move is absolute.
    is_absolute: bool,
    /// Whether numbers are in base 32.
    in_base_32: bool,
    /// The number of binary places of coordinates.
    fraction: u32,
    /// The x that waits for its y.
    x: Option<i64>,
    /// The meaning of the number that is being read.
    meaning: Meaning,
    /// The number so far, and how many bits of it there are.
    value: i64,
    bits: u32,
}

/// The meaning of a number of an encoded polyline.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Meaning {
    #[default]
    Coordinate,
    Pen,
    Fraction,
}

impl Polyline {
    /// Before the first byte.
    pub(super) const ZERO: Self = Self {
        is_up: false,
        is_absolute: false,
        in_base_32: false,
        fraction: 0,
        x: None,
        meaning: Meaning::Coordinate,
        value: 0,
        bits: 0,
    };
}

impl<B: PolygonBuffer> Interpreter<B> {
    /// Begins an encoded polyline.
    pub(super) fn begin_polyline(&mut self) {
        self.polyline = Polyline::default();
    }

    /// Takes a byte of an encoded polyline. Returns whether it is over.
    pub(super) fn push_encoded(&mut self, byte: u8) -> bool {
        let line = &mut self.polyline;
        if byte == DAMAGED {
            return false;
        }
        if byte == b';' {
            if line.x.is_some() || line.bits > 0 || line.meaning != Meaning::Coordinate {
                self.fail(ErrorNumber::WrongCount);
            }
            return true;
        }
        if byte.is_ascii_whitespace() {
            return false;
        }
        if line.bits == 0 && line.meaning == Meaning::Coordinate {
            // Flags may have their eighth bit set. No digit is one of them then.
            match if byte & 0x7F < 63 { byte & 0x7F } else { byte } {
                b'<' => line.is_up = true,
                b'=' => line.is_absolute = true,
                b'7' => line.in_base_32 = true,
                b':' => line.meaning = Meaning::Pen,
                b'>' => line.meaning = Meaning::Fraction,
                _ => self.push_digit(byte),
            }
            return false;
        }
        self.push_digit(byte);
        false
    }

    /// Takes a digit of a number.
    fn push_digit(&mut self, byte: u8) {
        let line = &mut self.polyline;
        let (byte, last) = if line.in_base_32 { (byte & 0x7F, 95) } else { (byte, 191) };
        let most = if line.in_base_32 { 31 } else { 63 };
        let digit = byte.checked_sub(if byte >= last { last } else { 63 });
        let Some(digit) = digit.filter(|digit| *digit <= most && line.bits < 48) else {
            (line.value, line.bits) = (0, 0);
            return self.fail(ErrorNumber::BadParameter);
        };
        line.value += i64::from(digit) << line.bits;
        line.bits += if line.in_base_32 { 5 } else { 6 };
        if byte < last {
            return;
        }
        let magnitude = line.value >> 1;
        let value = if line.value & 1 == 1 { -magnitude } else { magnitude };
        (line.value, line.bits) = (0, 0);
        match core::mem::take(&mut line.meaning) {
            Meaning::Pen => {
                if let Err(error) = self.choose_pen(value) {
                    self.fail(error);
                }
            }
            Meaning::Fraction => match u32::try_from(value) {
                Ok(bits) if bits <= 26 => line.fraction = bits,
                _ => self.fail(ErrorNumber::BadParameter),
            },
            Meaning::Coordinate => self.push_coordinate(value),
        }
    }

    /// Takes a coordinate, and draws when it is the second one of a pair.
    fn push_coordinate(&mut self, value: i64) {
        let line = &mut self.polyline;
        // Beyond the range it would be refused anyhow.
        let value = value.clamp(-1 << 46, 1 << 46);
        let value = if line.fraction <= 16 {
            value << (16 - line.fraction)
        } else {
            value >> (line.fraction - 16)
        };
        let Some(x) = line.x.take() else {
            line.x = Some(value);
            return;
        };
        let is_up = core::mem::take(&mut line.is_up);
        let is_absolute = core::mem::take(&mut line.is_absolute);
        self.is_down = !is_up;
        if x.abs().max(value.abs()) > 1 << 39 {
            return self.overflow();
        }
        self.go(Point { x, y: value }, !is_absolute);
    }
}
