//! Numbers as the user writes them, and their conversion to the formats of the firmware.

use super::{Millimetres, divide, shift_left};
use crate::array::MapEach;
use crate::text::strip_first;
use core::fmt;

/// A number exactly as the user wrote it: `mantissa` × 10^`exponent`.
///
/// The absolute value of the mantissa is below 10^18. Further digits of a longer text are cut off
/// (they are below 10^-17 of the value).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Decimal {
    /// The digits of the number as a whole number, with its sign.
    mantissa: i64,
    /// The power of ten by which the mantissa is multiplied.
    exponent: i16,
}

impl fmt::Display for Decimal {
    /// Writes the number so that parsing the text gives the same number, for example `5e-4`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The types of numbers that others are formatted in, because a board stores code for each.
        let sign = if self.mantissa < 0 { "-" } else { "" };
        write!(formatter, "{sign}{}", self.mantissa.unsigned_abs())?;
        match self.exponent {
            0 => Ok(()),
            exponent => write!(formatter, "e{}", i32::from(exponent)),
        }
    }
}

/// The error that a text is not a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotANumber;

/// The error that a number does not fit the format for which it is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfRange;

/// The mantissa of a [`Decimal`] stays below this limit.
const MANTISSA_LIMIT: i64 = 1_000_000_000_000_000_000;

impl Decimal {
    /// Parses a number such as `-12`, `+3.5`, `.5` or `6.02e-3`.
    ///
    /// # Errors
    /// [`NotANumber`] for anything else: no digit, a second point, `inf`, `nan`, trailing text, or
    /// an exponent beyond ±9999.
    ///
    /// ```
    /// use penup::fixed::Decimal;
    /// assert_eq!(Decimal::parse("-0.5")?.to_binary(16), Ok(-32768));
    /// assert_eq!(Decimal::parse("25e-2")?.to_binary(2), Ok(1));
    /// assert!(Decimal::parse("1.2.3").is_err());
    /// # Ok::<(), penup::fixed::NotANumber>(())
    /// ```
    pub fn parse(text: &str) -> Result<Self, NotANumber> {
        let (negative, unsigned) = match strip_first(text, b'-') {
            Some(unsigned) => (true, unsigned),
            None => (false, strip_first(text, b'+').unwrap_or(text)),
        };
        let (digits, power) = match unsigned.split_once(['e', 'E']) {
            Some((digits, power)) => (digits, parse_power(power)?),
            None => (unsigned, 0),
        };
        let mut mantissa: i64 = 0;
        let mut exponent: i32 = i32::from(power);
        let mut any_digit = false;
        let mut after_point = false;
        for byte in digits.bytes() {
            match byte {
                b'.' if !after_point => after_point = true,
                b'0'..=b'9' => {
                    any_digit = true;
                    if mantissa < MANTISSA_LIMIT / 10 {
                        mantissa = mantissa * 10 + i64::from(byte - b'0');
                        exponent -= i32::from(after_point);
                    } else {
                        exponent += i32::from(!after_point);
                    }
                }
                _ => return Err(NotANumber),
            }
        }
        if !any_digit {
            return Err(NotANumber);
        }
        let mantissa = if negative { -mantissa } else { mantissa };
        // A line is far shorter than 20000 digits, so this never fails in practice.
        let exponent = i16::try_from(exponent).map_err(|_| NotANumber)?;
        Ok(Self { mantissa, exponent })
    }

    /// Converts to the nearest multiple of 2^-`fraction_bits`, rounded half away from zero. Returns
    /// the number of these units.
    ///
    /// # Errors
    /// [`OutOfRange`] if the result does not fit in 62 bits.
    pub fn to_binary(self, fraction_bits: u32) -> Result<i64, OutOfRange> {
        self.binary(fraction_bits, |power| power / 2)
    }

    /// Converts to a multiple of 2^-`fraction_bits`, rounded towards zero. Returns the number of
    /// these units. Truncating the result again to a coarser unit gives the same as converting to
    /// that unit at once.
    ///
    /// # Errors
    /// [`OutOfRange`] if the result does not fit in 62 bits.
    pub fn to_binary_truncated(self, fraction_bits: u32) -> Result<i64, OutOfRange> {
        self.binary(fraction_bits, |_| 0)
    }

    /// Converts to binary units. `more` gives, for the power of ten that divides, the number that
    /// is added before the division.
    #[inline(never)] // Inlined in all its callers, it would take 36 KB on the Pico.
    fn binary(self, fraction_bits: u32, more: fn(u128) -> u128) -> Result<i64, OutOfRange> {
        if self.mantissa == 0 {
            return Ok(0);
        }
        let magnitude = i128::from(self.mantissa.abs()); // below 2^60
        let shifted = if fraction_bits <= 60 {
            shift_left(magnitude, fraction_bits) as u128
        } else {
            return Err(OutOfRange);
        };
        let rounded = if self.exponent >= 0 {
            let power = power_of_ten(self.exponent.unsigned_abs()).ok_or(OutOfRange)?;
            // If a factor has more than 64 bits, the product has more than 62.
            let [shifted, power] =
                [u64::try_from(shifted), u64::try_from(power)].map_each(|factor| factor.ok());
            u128::from(shifted.ok_or(OutOfRange)?) * u128::from(power.ok_or(OutOfRange)?)
        } else {
            // Beyond 10^38 the quotient is zero whatever the mantissa is.
            power_of_ten(self.exponent.unsigned_abs())
                .map_or(0, |power| divide(shifted + more(power), power))
        };
        let value =
            i64::try_from(rounded).ok().filter(|value| *value < 1 << 62).ok_or(OutOfRange)?;
        Ok(if self.mantissa < 0 { -value } else { value })
    }

    /// Returns the number of decimals, not counting the zeros at the end.
    ///
    /// ```
    /// use penup::fixed::Decimal;
    /// for (text, decimals) in [("0.250", 2), ("-3", 0), ("1e-3", 3), ("2.5e1", 0), ("0.000", 0)] {
    ///     assert_eq!(Decimal::parse(text)?.decimals(), decimals);
    /// }
    /// # Ok::<(), penup::fixed::NotANumber>(())
    /// ```
    pub fn decimals(self) -> u32 {
        let (mut mantissa, mut exponent) = (self.mantissa, self.exponent);
        while exponent < 0 && mantissa % 10 == 0 {
            if mantissa == 0 {
                return 0;
            }
            mantissa /= 10;
            exponent += 1;
        }
        if exponent < 0 { u32::from(exponent.unsigned_abs()) } else { 0 }
    }

    /// Converts to the nearest length, taking the number as millimetres.
    ///
    /// # Errors
    /// [`OutOfRange`] beyond ±32768 mm.
    pub fn to_millimetres(self) -> Result<Millimetres, OutOfRange> {
        let bits = self.to_binary(16)?;
        i32::try_from(bits).map(Millimetres::from_bits).map_err(|_| OutOfRange)
    }

    /// Converts to a binary floating-point number. It is for the camera, whose angles are the only
    /// place for such numbers.
    ///
    /// The result is exactly rounded for up to 15 digits and |exponent| <= 22, so it is the same on
    /// every machine.
    pub fn to_f64(self) -> f64 {
        let mut value = self.mantissa as f64;
        for _ in 0..self.exponent.unsigned_abs().min(400) / 22 {
            value = if self.exponent < 0 { value / 1e22 } else { value * 1e22 };
        }
        // 10^22 is the largest power of ten that a double holds exactly.
        let rest = power_of_ten(self.exponent.unsigned_abs().min(400) % 22).unwrap_or(1) as f64;
        if self.exponent < 0 { value / rest } else { value * rest }
    }

    /// The mantissa and the exponent, of which [`Decimal::from_parts`] makes the number again.
    pub const fn parts(self) -> (i64, i16) {
        (self.mantissa, self.exponent)
    }

    /// The number with this mantissa and this exponent; `None` if no text has it.
    pub fn from_parts(mantissa: i64, exponent: i32) -> Option<Self> {
        let exponent = i16::try_from(exponent).ok()?;
        (mantissa.unsigned_abs() < MANTISSA_LIMIT.unsigned_abs())
            .then_some(Self { mantissa, exponent })
    }

    /// Whether the number is below 0.
    pub const fn is_negative(self) -> bool {
        self.mantissa < 0
    }

    /// Converts to the nearest hundredth, in units of 0.01.
    ///
    /// # Errors
    /// [`OutOfRange`] for a negative number, or beyond 32 bits.
    ///
    /// ```
    /// use penup::fixed::Decimal;
    /// assert_eq!(Decimal::parse("28.1").map(Decimal::to_hundredths), Ok(Ok(2810)));
    /// ```
    pub fn to_hundredths(self) -> Result<i32, OutOfRange> {
        let Self { mantissa, exponent } = self;
        let hundredths = Self { mantissa, exponent: exponent.saturating_add(2) }.to_binary(0)?;
        let hundredths = i32::try_from(hundredths).map_err(|_| OutOfRange)?;
        if mantissa < 0 { Err(OutOfRange) } else { Ok(hundredths) }
    }

    /// Converts to an `i32`, if the number is whole.
    ///
    /// # Errors
    /// [`OutOfRange`] for a fraction or a number beyond 32 bits.
    pub fn to_whole(self) -> Result<i32, OutOfRange> {
        let value = self.to_binary(0)?;
        if self.exponent < 0 {
            let power = power_of_ten(self.exponent.unsigned_abs()).ok_or(OutOfRange)?;
            let mantissa = u128::from(self.mantissa.unsigned_abs());
            if divide(mantissa, power) * power != mantissa {
                return Err(OutOfRange);
            }
        }
        i32::try_from(value).map_err(|_| OutOfRange)
    }
}

/// Parses the exponent of ten of a decimal.
fn parse_power(text: &str) -> Result<i16, NotANumber> {
    let power: i16 = text.parse().map_err(|_| NotANumber)?;
    if (-9999..=9999).contains(&power) { Ok(power) } else { Err(NotANumber) }
}

/// Returns a power of ten, or `None` if it does not fit.
fn power_of_ten(exponent: u16) -> Option<u128> {
    // 10^38 is the greatest power of ten below 2^128.
    (exponent <= 38).then(|| (0..exponent).fold(1, |power, _| 10 * power))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_are_exact_as_far_as_they_fit() {
        for exponent in 0..50 {
            assert_eq!(power_of_ten(exponent), 10u128.checked_pow(exponent.into()), "{exponent}");
        }
    }
}
