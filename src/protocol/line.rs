//! Bytes to lines, and the bytes that are commands by themselves.

use super::Refusal;

/// The longest line, in bytes without its end.
pub const LINE_LIMIT: usize = 256;

/// What was asked for by single bytes, which never wait in a queue.
///
/// A board's receive interrupt collects these; the main loop and every long computation look at them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RealTime {
    /// `?`: report the status.
    pub status: bool,
    /// `!`: stop on the path, pen up.
    pub hold: bool,
    /// `~`: go on.
    pub resume: bool,
    /// ctrl-X: give up the job. Bytes received before it are dropped.
    pub abort: bool,
    /// No byte: bytes were lost because the sender did not wait for replies.
    pub bytes_lost: bool,
}

impl RealTime {
    /// What the byte asks for; `None` for a byte of a line.
    pub const fn of_byte(byte: u8) -> Option<Self> {
        let nothing =
            Self { status: false, hold: false, resume: false, abort: false, bytes_lost: false };
        match byte {
            b'?' => Some(Self { status: true, ..nothing }),
            b'!' => Some(Self { hold: true, ..nothing }),
            b'~' => Some(Self { resume: true, ..nothing }),
            0x18 => Some(Self { abort: true, ..nothing }),
            _ => None,
        }
    }

    /// Both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self {
            status: self.status || other.status,
            hold: self.hold || other.hold,
            resume: self.resume || other.resume,
            abort: self.abort || other.abort,
            bytes_lost: self.bytes_lost || other.bytes_lost,
        }
    }
}

/// Gathers bytes to lines of at most [`LINE_LIMIT`] bytes.
#[derive(Debug, Default)]
pub struct LineReader {
    bytes: heapless::Vec<u8, LINE_LIMIT>,
    too_long: bool,
    /// What ended the line before, until the next byte comes.
    ended_by: Option<u8>,
}

impl LineReader {
    /// Adds a byte. At the end of a line (LF, CR or CR LF) the line is handed out, an empty one too,
    /// so that every line that a sender counts is answered.
    ///
    /// # Errors
    /// [`Refusal::LineTooLong`] at the end of a line that was; [`Refusal::NotText`] if it is not UTF-8.
    pub fn push(&mut self, byte: u8) -> Option<Result<&str, Refusal>> {
        if let Some(end) = self.ended_by.take() {
            self.bytes.clear();
            self.too_long = false;
            if end == b'\r' && byte == b'\n' {
                return None;
            }
        }
        if byte != b'\r' && byte != b'\n' {
            self.too_long |= self.bytes.push(byte).is_err();
            return None;
        }
        self.ended_by = Some(byte);
        Some(if self.too_long {
            Err(Refusal::LineTooLong { limit: LINE_LIMIT })
        } else {
            core::str::from_utf8(&self.bytes).map_err(|_| Refusal::NotText)
        })
    }

    /// Forgets what has come of the line.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::{String, ToString};
    use std::vec::Vec;

    fn lines(bytes: &[u8]) -> Vec<Result<String, Refusal>> {
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
        let mut bytes = std::vec![b'x'; LINE_LIMIT + 1];
        bytes.extend(b"\r\nok\n");
        assert_eq!(
            lines(&bytes),
            [Err(Refusal::LineTooLong { limit: LINE_LIMIT }), Ok("ok".to_string())]
        );
        let mut bytes = std::vec![b'x'; LINE_LIMIT];
        bytes.push(b'\n');
        assert_eq!(lines(&bytes), [Ok("x".repeat(LINE_LIMIT))]);
    }

    #[test]
    fn bytes_that_are_no_text_are_refused() {
        assert_eq!(lines(b"\xff\xfe\nok\n"), [Err(Refusal::NotText), Ok("ok".to_string())]);
    }
}
