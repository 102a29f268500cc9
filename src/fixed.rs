//! The number formats of the firmware, with their rules for rounding and overflow, in one place.
//!
//! Lengths on the page are [`Millimetres`]; positions of the motors are steps (`i32`). Numbers
//! arrive as [`Decimal`] text and are rounded once, half away from zero, into the format that needs
//! them. A number that does not fit is refused, never wrapped.

use crate::array::MapEach;
use core::fmt;

/// A length on the page, within ±32768 mm, in units of 2^-16 mm.
pub type Millimetres = ::fixed::types::I16F16;

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
        let (negative, unsigned) = match text.strip_prefix('-') {
            Some(unsigned) => (true, unsigned),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
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

/// Divides by 2^`bits`, rounding half away from zero. It is used to move a block of coordinates to
/// a coarser unit.
pub fn shift_right_rounding(value: i32, bits: u32) -> i32 {
    match bits {
        0 => value,
        1..=31 => {
            let rounded = (i64::from(value).abs() + (1 << (bits - 1))) >> bits;
            // The absolute value is at most 2^31 / 2.
            (if value < 0 { -rounded } else { rounded }) as i32
        }
        _ => 0,
    }
}

/// Divides, rounding half away from zero. The divisor must be positive.
pub fn divide_rounding(dividend: i128, divisor: i128) -> i128 {
    let half = divisor >> 1;
    // Neither operand of the unsigned division is negative.
    let quotient = |dividend: i128| divide(dividend as u128, divisor as u128) as i128;
    if dividend < 0 { -quotient(half - dividend) } else { quotient(dividend + half) }
}

/// Divides, rounding towards minus infinity. The divisor must be positive.
///
/// ```
/// use penup::fixed::divide_down;
/// let quotients = [-7, -6, -1, 0, 5, 6].map(|dividend| divide_down(dividend, 3));
/// assert_eq!(quotients, [-3, -2, -1, 0, 1, 2]);
/// ```
pub fn divide_down(dividend: i128, divisor: i128) -> i128 {
    // Neither operand of the unsigned division is negative.
    let quotient = |dividend: i128| divide(dividend as u128, divisor as u128) as i128;
    if dividend < 0 { -quotient(divisor - 1 - dividend) } else { quotient(dividend) }
}

/// Divides, rounding down. The divisor must be positive.
///
/// The quotient is computed bit by bit. The compiler's own 128-bit division takes five times the
/// flash, and more time if the quotient is short.
#[inline(never)] // The code of a 128-bit division is long.
pub fn divide(dividend: u128, divisor: u128) -> u128 {
    debug_assert_ne!(divisor, 0);
    if let (Ok(dividend), Ok(divisor)) = (u64::try_from(dividend), u64::try_from(divisor)) {
        return u128::from(dividend.checked_div(divisor).unwrap_or(u64::MAX));
    }
    let shift = divisor.leading_zeros().saturating_sub(dividend.leading_zeros());
    let (mut rest, mut part, mut quotient) = (dividend, divisor << shift, 0);
    for _ in 0..=shift {
        quotient <<= 1;
        if rest >= part {
            rest -= part;
            quotient |= 1;
        }
        part >>= 1;
    }
    quotient
}

/// Returns the exact product of two 64-bit numbers. Kept out of line, it takes a tenth of the flash
/// that inlined products would.
#[inline(never)]
pub fn product(a: i64, b: i64) -> i128 {
    i128::from(a) * i128::from(b)
}

/// Returns value × 2^`bits`. The code of a 128-bit shift is long, so it is stored once.
#[inline(never)]
pub fn shift_left(value: i128, bits: u32) -> i128 {
    value << bits
}

/// Returns value / 2^`bits`, rounded towards minus infinity. See [`shift_left`].
#[inline(never)]
pub fn shift_right(value: i128, bits: u32) -> i128 {
    value >> bits
}

/// Halves a number, rounding towards zero.
pub fn half(value: i128) -> i128 {
    (value - (value >> 127)) >> 1
}

/// Returns the remainder of a number after subtracting as many whole `period`s as fit into it. The
/// result is exact and has the sign of the number. It equals `libm::fmod` for numbers of less than
/// 2^60 periods, and takes a twentieth of the flash.
///
/// ```
/// use penup::fixed::rest_of_periods;
/// assert_eq!(rest_of_periods(-450.5, 360.0), -90.5);
/// ```
pub fn rest_of_periods(number: f64, period: f64) -> f64 {
    let mut rest = libm::fabs(number);
    for power in (0..60).rev() {
        let part = libm::ldexp(period, power);
        // The subtraction is exact, because the remainder is less than twice the part.
        if rest >= part {
            rest -= part;
        }
    }
    rest.copysign(number)
}

/// Returns the square root, exactly rounded. It equals `libm::sqrt` for numbers that are not
/// negative, and takes a fifth of the flash.
///
/// ```
/// use penup::fixed::square_root;
/// assert_eq!([0.0, 2.25, 1e300].map(square_root), [0.0, 1.5, 1e150]);
/// ```
pub fn square_root(number: f64) -> f64 {
    if number == 0.0 || !number.is_finite() {
        return number;
    }
    // The number is fraction × 2^exponent, where the exponent is even and the fraction lies between
    // 1/4 and 1.
    let (fraction, exponent) = libm::frexp(number);
    let odd = exponent & 1;
    // The fraction in units of 2^-64.
    let mut digits = (libm::ldexp(fraction, 53) as i64).cast_unsigned() << (11 - odd);
    let (mut rest, mut root) = (0u64, 0u64);
    // One bit of the root more than a double holds; the last bit is rounded off. It cannot be a
    // tie, because then the number would have twice as many bits.
    for _ in 0..54 {
        rest = rest << 2 | digits >> 62;
        digits <<= 2;
        let part = root << 2 | 1;
        root <<= 1;
        if rest >= part {
            rest -= part;
            root |= 1;
        }
    }
    libm::ldexp(((root + 1) >> 1).cast_signed() as f64, (exponent + odd) / 2 - 53)
}

/// Returns the sine and cosine of an angle in degrees. The angle must be within ±10^15. The result
/// is exact for multiples of 90.
///
/// ```
/// use penup::fixed::sin_cos_degrees;
/// assert_eq!(sin_cos_degrees(-450.0), (-1.0, 0.0));
/// assert_eq!(sin_cos_degrees(1e15), sin_cos_degrees(280.0));
/// ```
pub fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    // The remainder is exact, so the angle to the nearest quarter turn is within 45 degrees.
    let degrees = rest_of_periods(degrees, 360.0);
    let quarters = libm::round(degrees / 90.0);
    let radians = (degrees - 90.0 * quarters).to_radians();
    // The angle is at most π/4. Limiting it in terms of the bits that libm tests lets the compiler
    // leave out the reduction of larger angles, which saves 3 KB on the device.
    let [high, low] = [radians.to_bits() >> 32, radians.to_bits()].map_each(|word| word as u32);
    let high = (high & 0x7FFF_FFFF).min(0x3FE9_21FB) | high & 0x8000_0000;
    let (sin, cos) = libm::sincos(f64::from_bits(u64::from(high) << 32 | u64::from(low)));
    match quarters as i64 & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Formats a number of the camera with up to six decimals and without trailing zeros. The code is
/// far smaller than that of the standard library, which finds the shortest form.
///
/// ```
/// use penup::fixed::SixDecimals;
/// let shown = [-2.5, 1e15, 1e-7].map(|number| SixDecimals(number).to_string());
/// assert_eq!(shown, ["-2.5", "1000000000000000", "0"]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SixDecimals(pub f64);

impl fmt::Display for SixDecimals {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = libm::fabs(self.0);
        let (mut whole, mut millionths) = (magnitude as u64, 0);
        // Beyond this limit a double does not have six decimals.
        if magnitude < 1e9 {
            let all = libm::round(magnitude * 1e6) as u64;
            (whole, millionths) = (all / 1_000_000, all % 1_000_000);
        }
        if self.0 < 0.0 && (whole, millionths) != (0, 0) {
            formatter.write_str("-")?;
        }
        write!(formatter, "{whole}")?;
        let mut width = 6;
        while millionths > 0 && millionths % 10 == 0 {
            millionths /= 10;
            width -= 1;
        }
        // The mask tells the compiler that there are few.
        let width = width & 7;
        if millionths > 0 { write!(formatter, ".{millionths:0width$}") } else { Ok(()) }
    }
}

/// Formats a length with as few decimals as distinguish it from all other lengths. The code is far
/// smaller than the formatting of its own type.
///
/// ```
/// use penup::fixed::{Length, Millimetres};
/// let text = |length: f64| Length(Millimetres::from_num(length)).to_string();
/// assert_eq!([210.0, 7.3, -0.25, 0.0].map(text), ["210", "7.3", "-0.25", "0"]);
/// assert_eq!(Length(Millimetres::from_bits(1)).to_string(), "0.00002");
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Length(pub Millimetres);

impl fmt::Display for Length {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = i64::from(self.0.to_bits());
        let magnitude = units.abs();
        let tells_it = |decimals: &u32| {
            let power = units_in_one(*decimals).cast_signed();
            let digits = (magnitude * power + (1 << 15)) >> 16;
            ((digits << 16) + power / 2).checked_div(power) == Some(magnitude)
        };
        let decimals = (0..5).find(tells_it).unwrap_or(5);
        BinaryFraction { units, fraction_bits: 16, decimals }.fmt(formatter)
    }
}

/// How many units with this many decimals, at most 9, there are in 1.
fn units_in_one(decimals: u32) -> u64 {
    (0..decimals).fold(1, |units, _| units * 10)
}

/// Formats `units` × 2^-`fraction_bits` with `decimals` decimals, rounded half away from zero.
///
/// ```
/// use penup::fixed::BinaryFraction;
/// assert_eq!(format!("{}", BinaryFraction { units: -3, fraction_bits: 1, decimals: 3 }),
/// "-1.500");
/// ```
#[derive(Debug, Clone, Copy)]
pub struct BinaryFraction {
    /// The number to format, in units of 2^-`fraction_bits`.
    pub units: i64,
    /// The unit is 2^-`fraction_bits`. The value is at most 60.
    pub fraction_bits: u32,
    /// The number of digits after the point, at most 9.
    pub decimals: u32,
}

impl fmt::Display for BinaryFraction {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = self.decimals.min(9);
        let scale = units_in_one(decimals);
        let bits = self.fraction_bits.min(60);
        let magnitude = self.units.unsigned_abs();
        let below_one = product((magnitude & ((1 << bits) - 1)) as i64, scale as i64); // below 2^90
        let half: u64 = if bits == 0 { 0 } else { 1 << (bits - 1) };
        let fraction = shift_right(below_one + i128::from(half), bits) as u64; // at most `scale`
        let carries = fraction >= scale;
        let whole = (magnitude >> bits) + u64::from(carries);
        let fraction = if carries { 0 } else { fraction };
        if self.units < 0 && (whole, fraction) != (0, 0) {
            formatter.write_str("-")?;
        }
        write!(formatter, "{whole}")?;
        if decimals > 0 {
            write!(formatter, ".{fraction:0width$}", width = decimals as usize)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
