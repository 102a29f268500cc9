//! Assembles lines from bytes.
//!
//! A line of G-code may hold comments of any length and any bytes, as Grbl allows: what does not
//! fit of its comments is dropped, and so are bytes that are no text.

use super::gcode::LinePart;
use super::numbering::NUMBER_LIMIT;
use super::values::trim;
use super::{CommandError, DAMAGED, GCode};
use crate::text::strip_first;

/// The length of the longest line in bytes, without its end, its number and its checksum.
pub const LINE_LIMIT: usize = 256;

/// Assembles bytes into lines of at most [`LINE_LIMIT`] bytes besides a number and a checksum.
#[derive(Debug, Default)]
pub struct LineReader {
    /// The bytes of the line so far, with its number and its checksum.
    bytes: heapless::Vec<u8, { LINE_LIMIT + NUMBER_LIMIT }>,
    /// Whether the line does not fit.
    too_long: bool,
    /// Whether bytes of the line were lost or damaged.
    damaged: bool,
    /// Whether comments have given way.
    is_cut: bool,
    /// The part of the line that the last byte belongs to, once comments have given way.
    part: LinePart,
    /// The byte that ended the previous line, until the next byte comes.
    ended_by: Option<u8>,
}

impl LineReader {
    /// Makes a reader that has not seen any byte yet.
    pub const fn new() -> Self {
        let bytes = heapless::Vec::new();
        let (too_long, damaged, is_cut) = (false, false, false);
        Self { bytes, too_long, damaged, is_cut, part: LinePart::Code, ended_by: None }
    }

    /// Adds a byte. At the end of a line (LF, CR or CR LF), returns the line, even if it is empty,
    /// so that every line that a sender counts is answered.
    ///
    /// # Errors
    /// All at the end of the line: [`CommandError::BytesLost`] if it contains [`DAMAGED`],
    /// [`CommandError::LineTooLong`] if it is too long without the comments of G-code,
    /// [`CommandError::NotText`] if it is neither UTF-8 nor G-code.
    pub fn push(&mut self, byte: u8) -> Option<Result<&str, CommandError>> {
        if let Some(end) = self.ended_by.take() {
            self.bytes.clear();
            (self.too_long, self.damaged, self.is_cut) = (false, false, false);
            if end == b'\r' && byte == b'\n' {
                return None;
            }
        }
        if byte == DAMAGED {
            self.damaged = true;
            return None;
        }
        // 0xC2 belongs to a command that was sent as a character of UTF-8, unless a letter follows.
        if self.bytes.last() == Some(&0xC2) && !matches!(byte, 0xA0..=0xBF) {
            self.bytes.pop();
            if matches!(byte, 0x80..=0x9F) {
                return None;
            }
        }
        if byte != b'\r' && byte != b'\n' {
            self.append(byte);
            return None;
        }
        self.ended_by = Some(byte);
        Some(if self.damaged {
            Err(CommandError::BytesLost)
        } else if self.too_long || (self.is_cut && self.bytes.contains(&b'*')) {
            // The checksum of a line cannot be checked without its comments.
            Err(CommandError::LineTooLong { limit: LINE_LIMIT })
        } else {
            self.text()
        })
    }

    /// Appends a byte. Where there is no room, the comments of G-code give way.
    fn append(&mut self, byte: u8) {
        if self.is_cut && self.part.takes(byte) {
            return;
        }
        let Err(byte) = self.bytes.push(byte) else { return };
        if self.too_long || self.is_cut || !is_code(&self.bytes) {
            self.too_long = true;
            return;
        }
        let mut part = LinePart::Code;
        self.bytes.retain(|byte| !part.takes(*byte));
        (self.is_cut, self.part) = (true, part);
        if !self.bytes.is_full() {
            self.append(byte);
        } else {
            self.too_long = true;
        }
    }

    /// The line as text.
    fn text(&mut self) -> Result<&str, CommandError> {
        let is_text = core::str::from_utf8(&self.bytes).is_ok();
        if !is_text || self.bytes.first().is_some_and(|byte| !byte.is_ascii()) {
            let letters = self.bytes.iter().take_while(|byte| !byte.is_ascii()).count();
            let rest = self.bytes.get(letters..).unwrap_or_default();
            if is_code(rest) {
                // What came before a command is noise. A damaged byte within it may have been a
                // digit of a setting.
                let is_command = rest.trim_ascii_start().first() == Some(&b'$');
                let mut left = letters;
                self.bytes.retain(|byte| {
                    let is_noise = left > 0;
                    left = left.saturating_sub(1);
                    !is_noise && (is_command || byte.is_ascii())
                });
            }
        }
        core::str::from_utf8(&self.bytes).map_err(|_| CommandError::NotText)
    }

    /// Discards what has been received of the line.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Whether the bytes are those of a line of G-code, or of a `$` command without a text.
fn is_code(bytes: &[u8]) -> bool {
    let bytes = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
    match strip_first(trim(bytes), b'$') {
        Some(command) => !["title", "I", "i"].iter().any(|name| trim(command).starts_with(name)),
        None => GCode::begins(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;
    use std::string::{String, ToString};
    use std::vec::Vec;

    fn lines(bytes: &[u8]) -> Vec<Result<String, CommandError>> {
        let mut reader = LineReader::default();
        bytes
            .iter()
            .filter_map(|byte| reader.push(*byte).map(|line| line.map(ToString::to_string)))
            .collect()
    }

    #[test]
    fn every_kind_of_line_end_ends_one_line() {
        let found = lines(b"a\nb\r\nc\rd\n\n\r\n");
        let expected = ["a", "b", "c", "d", "", ""].map(|line| Ok(line.to_string()));
        assert_eq!(found, expected);
    }

    #[test]
    fn a_line_too_long_is_refused_whole_and_the_next_is_read() {
        // The reader leaves room for a number and a checksum, which do not count as the line's.
        const ROOM: usize = LINE_LIMIT + NUMBER_LIMIT;
        let mut bytes = std::vec![b'x'; ROOM + 1];
        bytes.extend(b"\r\nok\n");
        assert_eq!(
            lines(&bytes),
            [Err(CommandError::LineTooLong { limit: LINE_LIMIT }), Ok("ok".to_string())]
        );
        let mut bytes = std::vec![b'x'; ROOM];
        bytes.push(b'\n');
        assert_eq!(lines(&bytes), [Ok("x".repeat(ROOM))]);
    }

    #[test]
    fn bytes_that_are_no_text_are_refused_but_in_g_code() {
        let refused = Err(CommandError::NotText);
        for line in [b"\xfe\xfe\n".as_slice(), b"v 1 2 3\xb7\n", b"$title=\xe9t\xe9\n"] {
            assert_eq!(lines(&[line, b"ok\n"].concat()), [refused.clone(), Ok("ok".to_string())]);
        }
        for line in [b"\xC2G0 X1\n".as_slice(), b"G0\xfe X1\n", b"G0 X1\xb7\n"] {
            assert_eq!(lines(line), [Ok("G0 X1".to_string())]);
        }
        for line in [b"\xC2\x9AG0 X1\n".as_slice(), b"\xC3\x84G0 X1\n", b"G0\xC2\x9D X1\xC2\n"] {
            assert_eq!(lines(line), [Ok("G0 X1".to_string())]);
        }
        // What is sent as a character of UTF-8 belongs to no text either.
        let line = "\u{9A}$title=\u{9A}\u{A9} Gr\u{F6}\u{DF}e\u{80}\n";
        assert_eq!(lines(line.as_bytes()), [Ok("$title=© Größe".to_string())]);
        assert_eq!(lines("G0 X1 (Größe)\n".as_bytes()), [Ok("G0 X1 (Größe)".to_string())]);
    }

    #[test]
    fn comments_of_g_code_have_any_length() {
        let (long, longer) = ("y".repeat(250), "y".repeat(1000));
        for (line, kept) in [
            (format!("({longer}) G0 X1"), " G0 X1"),
            (format!("G0 X1 ({longer}) Y2 ({longer}) Z3"), "G0 X1  Y2  Z3"),
            (format!("G0 X1 ({long}) ({long}) ;{longer}"), "G0 X1   "),
            (format!("G0 X1 ;{longer}("), "G0 X1 "),
        ] {
            assert_eq!(lines((line + "\n").as_bytes()), [Ok(kept.to_string())]);
        }
        let too_long = Err(CommandError::LineTooLong { limit: LINE_LIMIT });
        for line in [format!("N1 G0 X1 ({longer})*12"), format!("# ({longer})"), "X".repeat(300)] {
            let found = lines((line + "\nok\n").as_bytes());
            assert_eq!(found, [too_long.clone(), Ok("ok".to_string())]);
        }
    }

    #[test]
    fn a_line_that_lost_bytes_is_refused_once_at_its_end() {
        let lost = Err(CommandError::BytesLost);
        assert_eq!(lines(b"v 1\xff\xff 3\nok\n"), [lost.clone(), Ok("ok".to_string())]);
        // This holds whatever the length of the line, and even if it contains nothing else.
        let mut bytes = std::vec![b'x'; LINE_LIMIT + 1];
        bytes.extend(b"\xff\r\n\xff\n");
        assert_eq!(lines(&bytes), [lost.clone(), lost]);
    }

    #[test]
    fn what_is_forgotten_is_not_refused() {
        let mut reader = LineReader::default();
        assert_eq!(reader.push(DAMAGED), None);
        reader.clear();
        assert_eq!(reader.push(b'\n'), Some(Ok("")));
    }
}
