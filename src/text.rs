//! Takes texts apart at characters of ASCII. The functions of the core library for that take any
//! character, and call functions that check bounds, which stay in an image as code that may panic.

/// The parts of `text` before and behind the first `separator`, which is of ASCII; `None` if it has
/// none.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn split_once(text: &str, separator: u8) -> Option<(&str, &str)> {
    let at = text.bytes().position(|byte| byte == separator)?;
    text.get(..at).zip(text.get(at + 1..))
}

/// `text` without the `first` character, which is of ASCII; `None` if it begins otherwise.
#[inline(never)] // Its callers share one copy of the code.
pub(crate) fn strip_first(text: &str, first: u8) -> Option<&str> {
    text.get(1..).filter(|_| text.bytes().next() == Some(first))
}

/// The parts of a text between separators.
#[derive(Debug, Clone)]
pub(crate) struct Parts<'a> {
    /// The text that is left; `None` behind the last part.
    rest: Option<&'a str>,
    /// What stands between two parts, of ASCII.
    separator: u8,
}

/// The parts of `text` between each two of these separators of ASCII: one more than there are
/// separators.
pub(crate) const fn parts(text: &str, separator: u8) -> Parts<'_> {
    Parts { rest: Some(text), separator }
}

impl<'a> Iterator for Parts<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let text = self.rest?;
        let (part, rest) = match split_once(text, self.separator) {
            Some((part, rest)) => (part, Some(rest)),
            None => (text, None),
        };
        self.rest = rest;
        Some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn texts_are_taken_apart_as_by_the_core_library() {
        for text in ["", ",", "a", "a,", ",a", "a,b", "ä,ö,,ü", "€", ",,", "$x", "é$"] {
            assert_eq!(split_once(text, b','), text.split_once(','), "{text}");
            assert_eq!(strip_first(text, b'$'), text.strip_prefix('$'), "{text}");
            let expected: Vec<&str> = text.split(',').collect();
            assert_eq!(parts(text, b',').collect::<Vec<_>>(), expected, "{text}");
        }
    }
}
