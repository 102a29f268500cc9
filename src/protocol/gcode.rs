//! Parses a line of G-code into words: letters, each with a number.

use super::CommandError;
use super::values::trim_start;
use crate::fixed::Decimal;

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
    text: &'a str,
}

impl<'a> GCode<'a> {
    /// Checks all of `text`.
    ///
    /// # Errors
    /// [`CommandError::NotANumber`] if a letter has no number, [`CommandError::UnknownCommand`] if
    /// there is anything else but words and comments.
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
        let text = text.split(';').next().unwrap_or("");
        let mut rest = text;
        while let Some(word) = next_word(&mut rest) {
            word?;
        }
        Ok(Self { text })
    }

    /// Whether a line that is not OBJ may be G-code: it begins with a capital letter, a comment or
    /// `%`.
    pub fn begins(line: &str) -> bool {
        line.starts_with(|first: char| matches!(first, 'A'..='Z' | '(' | ';' | '%'))
    }

    /// The words in order.
    pub fn words(self) -> impl Iterator<Item = Word> + use<'a> {
        let mut rest = self.text;
        core::iter::from_fn(move || next_word(&mut rest)?.ok())
    }
}

/// Removes the next word from `rest` and returns it. `None` at the end.
fn next_word(rest: &mut &str) -> Option<Result<Word, CommandError>> {
    loop {
        *rest = rest.trim_start_matches([' ', '\t', '%']);
        let Some(comment) = rest.strip_prefix('(') else { break };
        *rest = comment.split_once(')').map_or("", |(_, after)| after);
    }
    let letter = *rest.as_bytes().first()?;
    if !letter.is_ascii_alphabetic() {
        *rest = "";
        return Some(Err(CommandError::UnknownCommand));
    }
    let after = trim_start(rest.split_at_checked(1).map_or("", |(_, after)| after));
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    let end = after.find(|c| !is_part(c)).unwrap_or(after.len());
    let (number, after) = after.split_at_checked(end).unwrap_or((after, ""));
    *rest = after;
    let number = Decimal::parse(number).map_err(|_| CommandError::NotANumber);
    Some(number.map(|number| Word { letter: letter.to_ascii_uppercase(), number }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_word_is_refused() {
        for line in ["G1 X", "G1 5", "G1 X1Y", "G1 X--1", "G1 X1.2.3", "G", "G1 =", "GX"] {
            assert!(GCode::new(line).is_err(), "{line}");
        }
        for line in ["", "%", "(only this)", "; that", "N10 (unclosed", "G 1 X 2"] {
            assert!(GCode::new(line).is_ok(), "{line}");
        }
    }
}
