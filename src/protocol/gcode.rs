//! Parses a line of G-code into words: letters, each with a number.
//!
//! As in Grbl, lower case counts as upper case, and white space, comments, `/` and letters outside
//! ASCII are skipped wherever they stand, also within a number.

use super::CommandError;
use crate::fixed::Decimal;
use crate::text::strip_first;

/// One letter and its number: `G1`, `X-2.5`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// The letter, in upper case.
    pub letter: u8,
    /// The number after the letter.
    pub number: Decimal,
}

/// The words of a line, which has been checked to be well-formed. Comments in parentheses and after
/// a semicolon are skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GCode<'a> {
    /// The line as it was sent, without what follows a semicolon.
    text: &'a str,
}

/// The greatest number of characters of a number.
const NUMBER_CHARACTERS: usize = 40;

impl<'a> GCode<'a> {
    /// Checks all of `text`.
    ///
    /// # Errors
    /// [`CommandError::NotANumber`] if a letter has no number, [`CommandError::NotAWord`] if there
    /// is anything else but words and comments.
    ///
    /// ```
    /// use penup::protocol::GCode;
    /// let line = GCode::new("G1 X-2.5y3 (a corner) F600 ; slowly")?;
    /// let letters: Vec<_> = line.words().map(|word| char::from(word.letter)).collect();
    /// assert_eq!(letters, ['G', 'X', 'Y', 'F']);
    /// assert!(GCode::new("G1 X").is_err());
    /// # Ok::<(), penup::protocol::CommandError>(())
    /// ```
    pub fn new(text: &'a str) -> Result<Self, CommandError> {
        let mut rest = Significant(text.bytes());
        while let Some(word) = next_word(&mut rest) {
            word?;
        }
        Ok(Self { text })
    }

    /// Whether a line that is not empty is G-code rather than OBJ. G-code begins with a capital
    /// letter, a comment, `%` or `/`, or with a small letter that a number follows at once; after a
    /// letter that is no keyword of OBJ there may be spaces before the number.
    ///
    /// ```
    /// use penup::protocol::GCode;
    /// for line in ["G1 X2", "g1 x2", "(a comment)", "x 3", "/G0", "%"] {
    ///     assert!(GCode::begins(line), "{line}");
    /// }
    /// for line in ["g 1", "f 1 2 3", "v 1 2 3", "usemtl 3", "hello"] {
    ///     assert!(!GCode::begins(line), "{line}");
    /// }
    /// ```
    pub fn begins(line: &str) -> bool {
        let mut bytes = line.bytes().skip_while(|byte| *byte == b' ' || *byte == b'\t');
        match bytes.next() {
            Some(b'A'..=b'Z' | b'(' | b';' | b'%' | b'/') => true,
            Some(letter @ b'a'..=b'z') => {
                let may_be_obj = matches!(letter, b'f' | b'g' | b'l' | b'o' | b's' | b'v');
                let after = bytes.find(|byte| may_be_obj || !byte.is_ascii_whitespace());
                matches!(after, Some(b'0'..=b'9' | b'+' | b'-' | b'.' | b'('))
            }
            _ => false,
        }
    }

    /// Whether the line is `%`, which stands before and after a program.
    pub fn is_mark(self) -> bool {
        strip_first(self.text.trim_ascii(), b'%').is_some()
    }

    /// The text of the line, as it came.
    pub fn text(self) -> &'a str {
        self.text
    }

    /// Returns the words in the order in which they were sent.
    pub fn words(self) -> impl Iterator<Item = Word> + use<'a> {
        let mut rest = Significant(self.text.bytes());
        core::iter::from_fn(move || next_word(&mut rest)?.ok())
    }
}

/// The part of a line of G-code to which a byte belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum LinePart {
    /// Outside comments.
    #[default]
    Code,
    /// A comment in parentheses.
    Parentheses,
    /// A comment up to the end of the line.
    Rest,
}

impl LinePart {
    /// Takes the next byte. Returns whether the byte belongs to a comment or delimits one.
    pub(super) fn takes(&mut self, byte: u8) -> bool {
        let was = *self;
        *self = match (was, byte) {
            (Self::Code, b'(') => Self::Parentheses,
            (Self::Code, b';') => Self::Rest,
            (Self::Parentheses, b')') => Self::Code,
            _ => was,
        };
        was != Self::Code || *self != Self::Code
    }
}

/// The part of a line before a `#` that begins a comment, which it does not within one.
pub(super) fn before_hash(line: &str) -> &str {
    let mut part = LinePart::Code;
    let hash = line.bytes().position(|byte| !part.takes(byte) && byte == b'#');
    hash.and_then(|at| line.get(..at)).unwrap_or(line)
}

/// Whether a comment goes on at the end of this beginning of a line.
pub(super) fn ends_in_comment(head: &str) -> bool {
    let mut part = LinePart::Code;
    for byte in head.bytes() {
        part.takes(byte);
    }
    part != LinePart::Code
}

/// The bytes of a line that matter, in upper case.
#[derive(Clone)]
pub(crate) struct Significant<'a>(pub core::str::Bytes<'a>);

impl Iterator for Significant<'_> {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let mut part = LinePart::Code;
        loop {
            let byte = self.0.next()?;
            if !part.takes(byte) && matches!(byte, b'!'..=b'~') && !matches!(byte, b'/' | b'%') {
                return Some(byte.to_ascii_uppercase());
            }
        }
    }
}

/// Takes the next word from `rest`. `None` at the end.
fn next_word(rest: &mut Significant<'_>) -> Option<Result<Word, CommandError>> {
    let letter = rest.next()?;
    if !letter.is_ascii_uppercase() {
        *rest = Significant("".bytes());
        return Some(Err(CommandError::NotAWord));
    }
    let number = next_number(rest).ok_or(CommandError::NotANumber);
    if number.is_err() {
        *rest = Significant("".bytes());
    }
    Some(number.map(|number| Word { letter, number }))
}

/// Takes a number from `rest`. `None` if there is none.
pub(crate) fn next_number(rest: &mut Significant<'_>) -> Option<Decimal> {
    let mut text = heapless::String::<NUMBER_CHARACTERS>::new();
    let mut has_point = false;
    loop {
        let before = rest.clone();
        let Some(byte) = rest.next() else { break };
        let is_part = match byte {
            b'+' | b'-' => text.is_empty(),
            b'.' => !core::mem::replace(&mut has_point, true),
            _ => byte.is_ascii_digit(),
        };
        if !is_part {
            *rest = before;
            break;
        }
        // Digits behind the point that do not fit are too small to matter, if the number is not one
        // of leading zeros, which leave them no room.
        let is_full = byte == b'.' && text.len() > NUMBER_CHARACTERS / 2;
        if is_full || (text.push(char::from(byte)).is_err() && !has_point) {
            return None;
        }
    }
    Decimal::parse(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_word_is_refused() {
        for line in ["G1 X", "G1 X1Y", "G1 X--1", "G", "GX", "G1 X-", "G1 X."] {
            assert_eq!(GCode::new(line), Err(CommandError::NotANumber), "{line}");
        }
        for line in ["G1 X1.2.3", "G1 =", "5", "G0 X1*", "G1 X1-2"] {
            assert_eq!(GCode::new(line), Err(CommandError::NotAWord), "{line}");
        }
        for line in ["", "%", "(only this)", "; that", "N10 (unclosed", "G 1 X 2", "G1 X(1)2 . 5é"]
        {
            assert!(GCode::new(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn a_number_may_have_any_digits_behind_its_point() {
        let line = GCode::new("X0.333333333333333333333333333333333333333333333333Y1").expect("ok");
        let numbers: std::vec::Vec<_> = line.words().map(|word| word.number.to_f64()).collect();
        assert_eq!(numbers.len(), 2);
        assert!((numbers[0] - 1.0 / 3.0).abs() < 1e-15 && numbers[1] == 1.0);
        assert!(GCode::new(&"X1".repeat(50)).is_ok());
        assert!(GCode::new(&std::format!("X{}", "1".repeat(50))).is_err());
        for zeros in 1..60 {
            let text = std::format!("X{}1.5", "0".repeat(zeros));
            let read =
                GCode::new(&text).map(|line| line.words().next().expect("X").number.to_f64());
            assert!(read.is_err() || read == Ok(1.5), "{zeros}: {read:?}");
        }
    }
}
