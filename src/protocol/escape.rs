//! Escapes that represent any text in ASCII, for letters that a line cannot contain directly.
//!
//! `\xE9` is the letter with this Unicode number in two hexadecimal digits. `\u{2013}` has up to
//! six digits. `\\` is a backslash. Other letters represent themselves, so UTF-8 may also be sent
//! directly.

use super::CommandError;
use crate::drawing::is_in_font;
use crate::text::{split_once, strip_first};
use core::fmt::{self, Write};
use core::str::Chars;

/// The escaped text of a title. Every escape in it is valid, and the font has every letter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EscapedText<'a> {
    /// The text as it was sent, with its escapes.
    text: &'a str,
}

impl<'a> EscapedText<'a> {
    /// Checks every letter, so that [`EscapedText::letters`] cannot fail.
    ///
    /// # Errors
    /// [`CommandError::NotAnEscape`] if a backslash does not begin an escape,
    /// [`CommandError::NotInTheFont`] if the font lacks a letter.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn new(text: &'a str) -> Result<Self, CommandError> {
        let mut rest = text.chars();
        while let Some(letter) = next(&mut rest) {
            let letter = letter.ok_or(CommandError::NotAnEscape)?;
            if !is_in_font(letter) {
                return Err(CommandError::NotInTheFont(letter));
            }
        }
        Ok(Self { text })
    }

    /// Returns the letters that the text stands for, its escapes replaced.
    pub fn letters(&self) -> impl Iterator<Item = char> + use<'a> {
        let mut rest = self.text.chars();
        core::iter::from_fn(move || next(&mut rest)?)
    }
}

/// The next letter; `Some(None)` if its escape is not valid; `None` at the end.
fn next(rest: &mut Chars<'_>) -> Option<Option<char>> {
    let first = rest.next()?;
    if first != '\\' {
        return Some(Some(first));
    }
    Some(escaped(rest).and_then(char::from_u32))
}

/// Returns the Unicode number that the escape after a backslash gives.
fn escaped(rest: &mut Chars<'_>) -> Option<u32> {
    let (digits, after) = match rest.next()? {
        '\\' => return Some('\\'.into()),
        'x' => rest.as_str().split_at_checked(2)?,
        'u' => split_once(strip_first(rest.as_str(), b'{')?, b'}')?,
        _ => return None,
    };
    *rest = after.chars();
    let is_number = (1..=6).contains(&digits.len()) && strip_first(digits, b'+').is_none();
    u32::from_str_radix(digits, 16).ok().filter(|_| is_number)
}

/// Shows any text in the escaped form, in ASCII and without bytes that act at once.
///
/// ```
/// use penup::protocol::{Escape, EscapedText};
/// assert_eq!(Escape("Café – 3 % \\ ok?").to_string(), r"Caf\xE9 \u{2013} 3 % \\ ok\x3F");
/// let escaped = Escape("Café – 3 %").to_string();
/// assert!(EscapedText::new(&escaped)?.letters().eq("Café – 3 %".chars()));
/// # Ok::<(), penup::protocol::CommandError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Escape<'a>(pub &'a str);

impl fmt::Display for Escape<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|letter| match letter {
            '\\' => formatter.write_str("\\\\"),
            '?' | '!' | '~' => write!(formatter, "\\x{:02X}", u32::from(letter)),
            ' '..='~' => formatter.write_char(letter),
            ..='\u{FF}' => write!(formatter, "\\x{:02X}", u32::from(letter)),
            _ => write!(formatter, "\\u{{{:X}}}", u32::from(letter)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::{String, ToString};

    fn read(text: &str) -> Result<String, CommandError> {
        EscapedText::new(text).map(|text| text.letters().collect())
    }

    #[test]
    fn every_letter_comes_back_and_no_byte_acts_at_once() {
        let latin_1 = (' '..='~').chain('\u{A0}'..='ÿ').chain("–—‘’“”…€Œœ".chars());
        let text: String = latin_1.collect();
        let sent = Escape(&text).to_string();
        assert!(
            sent.bytes().all(|byte| matches!(byte, b' '..=b'}') && byte != b'?' && byte != b'!')
        );
        assert_eq!(read(&sent), Ok(text.clone()));
        let quiet = |letter: &char| !matches!(letter, '\\');
        let plain: String = text.chars().filter(quiet).collect();
        assert_eq!(read(&plain), Ok(plain.clone()));
    }

    #[test]
    fn what_is_no_escape_or_no_letter_of_the_font_is_refused() {
        for text in [
            r"\",
            r"\n",
            r"\x4",
            r"\xg0",
            r"\u2013",
            r"\u{}",
            r"\u{0002013}",
            r"\u{d800}",
            r"\u{20",
        ] {
            assert_eq!(read(text), Err(CommandError::NotAnEscape), "{text}");
        }
        assert_eq!(read("a→b"), Err(CommandError::NotInTheFont('→')));
        assert_eq!(read(r"\x0A"), Err(CommandError::NotInTheFont('\n')));
        assert_eq!(read(r"\u{1f600}"), Err(CommandError::NotInTheFont('\u{1F600}')));
        assert_eq!(read(""), Ok(String::new()));
    }
}
