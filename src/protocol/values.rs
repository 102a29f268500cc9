//! Parsers for the numbers and words of a line.

use super::CommandError;
use crate::fixed::{Decimal, Millimetres};
use crate::model::PEN_LIMIT;
use crate::text::parts;

/// The number of pens, as a number of the kind that is parsed.
pub(crate) const PENS: i32 = PEN_LIMIT as i32;

/// Whether `letter` is white space of ASCII.
fn is_space(letter: char) -> bool {
    matches!(letter, '\t'..='\r' | ' ')
}

/// `text` without white space at its ends. Only that of ASCII counts: the table of all Unicode
/// takes some 250 bytes of flash.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn trim(text: &str) -> &str {
    let after = text.bytes().rev().take_while(|byte| is_space(char::from(*byte))).count();
    trim_start(text.split_at_checked(text.len() - after).map_or("", |(kept, _)| kept))
}

/// `text` without white space at its beginning. Only that of ASCII counts.
#[inline(never)] // Its callers share one copy of the code.
pub(super) fn trim_start(text: &str) -> &str {
    text.trim_start_matches(is_space)
}

/// Returns the index of `text` among `words`, or the error that lists them.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn choice(text: &str, words: &'static [&'static str]) -> Result<usize, CommandError> {
    let index = words.iter().position(|word| *word == text);
    index.ok_or(CommandError::NotAChoice { choices: words })
}

/// Parses a decimal number without rounding it.
pub(crate) fn number(text: &str) -> Result<Decimal, CommandError> {
    Decimal::parse(trim(text)).map_err(|_| CommandError::NotANumber)
}

/// Parses a length in mm, which may be negative.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn length(text: &str) -> Result<Millimetres, CommandError> {
    number(text)?.to_millimetres().map_err(|_| CommandError::NumberOutOfRange)
}

/// Parses a length in mm, which must be above 0.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn positive(text: &str) -> Result<Millimetres, CommandError> {
    let length = length(text)?;
    if length > 0 { Ok(length) } else { Err(CommandError::NumberOutOfRange) }
}

/// Parses exactly N numbers with commas between them. They lose precision, so this is for angles
/// and positions of the camera only.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], CommandError> {
    let mut values = [0.0; N];
    read_values(text, &mut values)?;
    Ok(values)
}

/// Parses numbers with commas between them, as many as there are `values`,
/// each within ±1e15.
#[inline(never)] // All counts share one copy of the code.
fn read_values(text: &str, values: &mut [f64]) -> Result<(), CommandError> {
    let wrong_count = CommandError::WrongNumberCount { needed: values.len() };
    let mut parts = parts(text, b',').map(number);
    for value in &mut *values {
        *value = parts.next().unwrap_or(Err(wrong_count))?.to_f64();
    }
    if parts.next().is_some() {
        return Err(wrong_count);
    }
    // Beyond this range, squares and quotients of lengths would overflow.
    if values.iter().any(|value| libm::fabs(*value) > 1e15) {
        return Err(CommandError::NumberOutOfRange);
    }
    Ok(())
}

/// Parses `x y z`, and then the weight or colour that some modellers write. These must be numbers,
/// too, and are ignored.
pub(super) fn coordinates(text: &str) -> Result<[Decimal; 3], CommandError> {
    let mut words = text.split_ascii_whitespace().map(number);
    let mut next = || words.next().unwrap_or(Err(CommandError::WrongNumberCount { needed: 3 }));
    let coordinates = [next()?, next()?, next()?];
    for rest in words {
        rest?;
    }
    Ok(coordinates)
}

/// Splits off the first word. Returns it and the rest.
pub(super) fn split_word(text: &str) -> (&str, &str) {
    let text = trim_start(text);
    text.split_once([' ', '\t']).unwrap_or((text, ""))
}

/// Parses a whole number.
pub(crate) fn whole(text: &str) -> Result<i32, CommandError> {
    number(text)?.to_whole().map_err(|_| CommandError::NumberOutOfRange)
}

/// A list of decimal numbers, checked and still as text, with spaces between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimals<'a> {
    /// The words as they were sent. Each of them is a number.
    text: &'a str,
}

impl<'a> Decimals<'a> {
    /// Checks every word, so that [`Decimals::iter`] cannot fail.
    pub(super) fn new(text: &'a str) -> Result<Self, CommandError> {
        for word in text.split_ascii_whitespace() {
            number(word)?;
        }
        Ok(Self { text })
    }

    /// Returns the numbers in the order in which they were sent.
    pub fn iter(&self) -> impl Iterator<Item = Decimal> + Clone + use<'a> {
        self.text.split_ascii_whitespace().filter_map(|word| number(word).ok())
    }
}

/// The vertex numbers of a face, polyline or curve: `7`, `-1`, `7/2`, `7//3` or `7/2/3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Numbers<'a> {
    /// The words as they were sent. Each of them is a vertex number.
    text: &'a str,
}

impl<'a> Numbers<'a> {
    /// Checks every word, so that [`Numbers::iter`] cannot fail.
    pub(super) fn new(text: &'a str) -> Result<Self, CommandError> {
        for word in text.split_ascii_whitespace() {
            vertex_number(word).ok_or(CommandError::NotAVertexNumber)?;
        }
        Ok(Self { text })
    }

    /// Returns the numbers in the order in which they were sent.
    pub fn iter(&self) -> impl Iterator<Item = i32> + Clone + use<'a> {
        self.text.split_ascii_whitespace().filter_map(vertex_number)
    }
}

/// The first part of `v`, `v/vt`, `v//vn`, `v/vt/vn`, if every part is a whole number.
fn vertex_number(word: &str) -> Option<i32> {
    let mut parts = parts(word, b'/');
    let vertex = parts.next()?.parse().ok()?;
    let texture = parts.next();
    let normal = parts.next();
    let whole = |text: &str| text.parse::<i32>().is_ok();
    let texture_is_right = match texture {
        None => true,
        Some("") => normal.is_some(),
        Some(text) => whole(text),
    };
    if texture_is_right && normal.is_none_or(whole) && parts.next().is_none() {
        Some(vertex)
    } else {
        None
    }
}
