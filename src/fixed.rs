//! The number formats of the firmware, with their rules for rounding and overflow, in one place.
//!
//! Lengths on the page are [`Millimetres`]; positions of the motors are steps (`i32`). Numbers
//! arrive as [`Decimal`] text and are rounded once, half away from zero, into the format that needs
//! them. A number that does not fit is refused, never wrapped.

mod decimal;

pub use decimal::{Decimal, NotANumber, OutOfRange};

use crate::array::MapEach;
use core::fmt;

/// A length on the page, within ±32768 mm, in units of 2^-16 mm.
pub type Millimetres = ::fixed::types::I16F16;

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
/// Without 64-bit registers the quotient is computed bit by bit. The compiler's own 128-bit
/// division takes five times the flash there, and more time if the quotient is short.
#[inline(never)] // The code of a 128-bit division is long.
pub fn divide(dividend: u128, divisor: u128) -> u128 {
    debug_assert_ne!(divisor, 0);
    if cfg!(target_pointer_width = "64") {
        return dividend.checked_div(divisor).unwrap_or(u128::MAX);
    }
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

/// The number of decimals, 3 or 5, with which a value is shown so that it is read back unchanged.
///
/// Whatever was set with up to three decimals is shown with three, as other programs expect it.
///
/// ```
/// use penup::fixed::{Decimal, Millimetres, decimals_of};
/// let value = |text: &str| Decimal::parse(text).unwrap().to_millimetres().unwrap();
/// let decimals = ["80", "88.9", "-0.001", "80.0003"].map(|text| decimals_of(value(text)));
/// assert_eq!(decimals, [3, 3, 3, 5]);
/// assert_eq!(decimals_of(Millimetres::DELTA), 5);
/// ```
pub fn decimals_of(value: Millimetres) -> u32 {
    // How far 1000 times the value is from a whole number, in units of 2^-16. If this is less than
    // half a thousand, the value is the nearest one to a multiple of 0.001.
    let beyond = (value.to_bits() as u16).wrapping_mul(1000);
    if beyond.min(beyond.wrapping_neg()) < 500 { 3 } else { 5 }
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
