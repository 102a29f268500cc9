//! Reads the numbers of instructions, digit by digit.

/// A number that is being read. Its magnitude is at most [`Number::MOST`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Number {
    /// Whether a sign, a digit or a decimal point has come.
    has_begun: bool,
    /// Whether a digit has come.
    has_digit: bool,
    /// Whether the decimal point has come.
    has_point: bool,
    is_negative: bool,
    /// The digits before the point, clamped to a value beyond the range.
    whole: u32,
    /// The first digits behind the point, and ten to the power of their number.
    fraction: u32,
    power: u32,
}

/// The result of parsing a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parsed {
    /// There is no number.
    None,
    /// The value in units of 2^-16.
    Value(i64),
    /// The text is no number, or the number is beyond the range.
    Bad,
}

impl Number {
    /// The state before the first byte.
    pub(super) const ZERO: Self = Self {
        has_begun: false,
        has_digit: false,
        has_point: false,
        is_negative: false,
        whole: 0,
        fraction: 0,
        power: 0,
    };
    /// The greatest magnitude: 2^23, which are 209 m in plotter units.
    const MOST: u32 = 1 << 23;
    /// Digits behind the point beyond this power of ten do not count.
    const LEAST: u32 = 100_000_000;

    /// Takes a digit, a sign or a point. If it begins another number, it ends the one before, which
    /// is returned.
    pub(super) fn push(&mut self, byte: u8) -> Parsed {
        let begins =
            matches!(byte, b'+' | b'-') && self.has_begun || byte == b'.' && self.has_point;
        let before = if begins { self.end() } else { Parsed::None };
        self.has_begun = true;
        match byte {
            b'-' => self.is_negative = true,
            b'.' => (self.has_point, self.power) = (true, 1),
            b'0'..=b'9' => {
                let digit = u32::from(byte - b'0');
                self.has_digit = true;
                if !self.has_point {
                    self.whole = (self.whole * 10 + digit).min(2 * Self::MOST);
                } else if self.power < Self::LEAST {
                    self.fraction = self.fraction * 10 + digit;
                    self.power *= 10;
                }
            }
            _ => {}
        }
        before
    }

    /// Ends the number.
    pub(super) fn end(&mut self) -> Parsed {
        let Self { has_begun, has_digit, is_negative, whole, fraction, power, .. } =
            core::mem::take(self);
        if !has_begun {
            return Parsed::None;
        }
        if !has_digit || whole > Self::MOST {
            return Parsed::Bad;
        }
        let power = u64::from(power.max(1));
        let part = ((u64::from(fraction) << 16) + power / 2) / power;
        let magnitude = ((u64::from(whole) << 16) + part).cast_signed();
        Parsed::Value(if is_negative { -magnitude } else { magnitude })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Parsed {
        let mut number = Number::default();
        for byte in text.bytes() {
            assert_eq!(number.push(byte), Parsed::None, "{text}");
        }
        number.end()
    }

    #[test]
    fn numbers() {
        for (text, value) in [
            ("0", 0.0),
            ("-12", -12.0),
            ("+3.5", 3.5),
            (".25", 0.25),
            ("-.5", -0.5),
            ("7.", 7.0),
            ("8388607.99", 8_388_607.99),
            ("0.1234567890123", 0.123_456_789),
            ("000012", 12.0),
        ] {
            assert_eq!(read(text), Parsed::Value((value * 65536.0_f64).round() as i64), "{text}");
        }
        for text in ["-", ".", "+.", "8388609", "99999999999999999999"] {
            assert_eq!(read(text), Parsed::Bad, "{text}");
        }
        assert_eq!(read(""), Parsed::None);
    }

    #[test]
    fn a_sign_or_a_second_point_begins_the_next_number() {
        let mut number = Number::default();
        let found: std::vec::Vec<_> = b"10-5.5.25".iter().map(|byte| number.push(*byte)).collect();
        assert_eq!(found[2], Parsed::Value(10 << 16));
        assert_eq!(found[6], Parsed::Value(-11 << 15));
        assert_eq!(number.end(), Parsed::Value(1 << 14));
    }
}
