//! Assembles lines from bytes, and recognises the bytes that are commands by themselves.

use super::numbering::NUMBER_LIMIT;
use super::{CommandError, DAMAGED};

/// The length of the longest line in bytes, without its end, its number and its checksum.
pub const LINE_LIMIT: usize = 256;

/// A set of real-time requests: commands of a single byte, which never wait in a queue.
///
/// A board's receive interrupt collects these requests. The main loop and every long computation
/// check them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RealTime(u16);

impl RealTime {
    /// `?`: reports the status.
    pub const STATUS: Self = Self(1);
    /// `!`: stops on the path and raises the pen.
    pub const HOLD: Self = Self(1 << 1);
    /// `~`: resumes.
    pub const RESUME: Self = Self(1 << 2);
    /// ctrl-X: cancels the job. Bytes received before it are dropped.
    pub const ABORT: Self = Self(1 << 3);
    /// 0x85: cancels jogs.
    pub const CANCEL_JOG: Self = Self(1 << 5);
    /// 0x90: resets the feed override to 100 %.
    pub const FEED_RESET: Self = Self(1 << 6);
    /// 0x91: raises the feed override by 10 %.
    pub const FEED_PLUS_10: Self = Self(1 << 7);
    /// 0x92: lowers the feed override by 10 %.
    pub const FEED_MINUS_10: Self = Self(1 << 8);
    /// 0x93: raises the feed override by 1 %.
    pub const FEED_PLUS_1: Self = Self(1 << 9);
    /// 0x94: lowers the feed override by 1 %.
    pub const FEED_MINUS_1: Self = Self(1 << 10);
    /// 0xFB: pauses at the end of the stroke.
    pub const PAUSE: Self = Self(1 << 11);
    /// 0xFD: emergency stop, which halts the pins at once.
    pub const EMERGENCY: Self = Self(1 << 12);

    /// Whether this set contains all of `requests`.
    pub const fn has(self, requests: Self) -> bool {
        self.0 & requests.0 == requests.0
    }

    /// The union of both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The intersection with `mask`.
    #[must_use]
    pub const fn only(self, mask: Self) -> Self {
        Self(self.0 & mask.0)
    }

    /// The set as bits, for a board that collects them in an atomic.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// The set with the bits of [`RealTime::to_bits`].
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }
}

/// Separates the bytes that act at once from the bytes of lines, one by one as they come.
///
/// The bytes 0x85 and 0x90 to 0x94, which Grbl defines, are also continuation bytes of letters in
/// UTF-8. Within a letter, they are text. All other commands act anywhere, whatever came before
/// them: 0xFB and 0xFD, which are penup's own, never occur in UTF-8.
///
/// ```
/// use penup::protocol::{RealTime, Sorter};
/// let mut sorter = Sorter::default();
/// assert_eq!(sorter.sort(0x85), Some(RealTime::CANCEL_JOG));
/// assert!("Å ñ".bytes().all(|byte| sorter.sort(byte).is_none()));
/// // The first byte of a letter that never comes does not keep a stop from acting.
/// assert_eq!(sorter.sort(0xF0), None);
/// assert_eq!(sorter.sort(0xFD), Some(RealTime::EMERGENCY));
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Sorter {
    /// Number of continuation bytes of the current letter that are still to come.
    inner: u8,
    /// The previous byte.
    last: u8,
}

impl Sorter {
    /// A sorter before the first byte.
    pub const fn new() -> Self {
        Self { inner: 0, last: 0 }
    }

    /// The request that the byte makes. `None` for a byte of a line.
    pub const fn sort(&mut self, byte: u8) -> Option<RealTime> {
        // The second byte of a well-formed letter (Unicode, table 3-7).
        let is_inner = match self.last {
            0xE0 => matches!(byte, 0xA0..=0xBF),
            0xED => matches!(byte, 0x80..=0x9F),
            0xF0 => matches!(byte, 0x90..=0xBF),
            0xF4 => matches!(byte, 0x80..=0x8F),
            _ => matches!(byte, 0x80..=0xBF),
        };
        self.last = byte;
        if is_inner && self.inner > 0 {
            self.inner -= 1;
            return None;
        }
        self.inner = match byte {
            0xC2..=0xDF => 1,
            0xE0..=0xEF => 2,
            0xF0..=0xF4 => 3,
            _ => 0,
        };
        Some(match byte {
            b'?' => RealTime::STATUS,
            b'!' => RealTime::HOLD,
            b'~' => RealTime::RESUME,
            0x18 => RealTime::ABORT,
            0x85 => RealTime::CANCEL_JOG,
            0x90 => RealTime::FEED_RESET,
            0x91 => RealTime::FEED_PLUS_10,
            0x92 => RealTime::FEED_MINUS_10,
            0x93 => RealTime::FEED_PLUS_1,
            0x94 => RealTime::FEED_MINUS_1,
            0xFB => RealTime::PAUSE,
            0xFD => RealTime::EMERGENCY,
            _ => return None,
        })
    }
}

/// Assembles bytes into lines of at most [`LINE_LIMIT`] bytes besides a number and a checksum.
#[derive(Debug, Default)]
pub struct LineReader {
    bytes: heapless::Vec<u8, { LINE_LIMIT + NUMBER_LIMIT }>,
    /// Whether the line does not fit.
    too_long: bool,
    /// Whether bytes of the line were lost or damaged.
    damaged: bool,
    /// The byte that ended the previous line, until the next byte comes.
    ended_by: Option<u8>,
}

impl LineReader {
    /// A reader before the first byte.
    pub const fn new() -> Self {
        Self { bytes: heapless::Vec::new(), too_long: false, damaged: false, ended_by: None }
    }

    /// Adds a byte. At the end of a line (LF, CR or CR LF), returns the line, even if it is empty,
    /// so that every line that a sender counts is answered.
    ///
    /// # Errors
    /// All at the end of the line: [`CommandError::BytesLost`] if it contains [`DAMAGED`],
    /// [`CommandError::LineTooLong`] if it is too long, [`CommandError::NotText`] if it is not
    /// UTF-8.
    pub fn push(&mut self, byte: u8) -> Option<Result<&str, CommandError>> {
        if let Some(end) = self.ended_by.take() {
            self.bytes.clear();
            (self.too_long, self.damaged) = (false, false);
            if end == b'\r' && byte == b'\n' {
                return None;
            }
        }
        if byte == DAMAGED {
            self.damaged = true;
            return None;
        }
        if byte != b'\r' && byte != b'\n' {
            self.too_long |= self.bytes.push(byte).is_err();
            return None;
        }
        self.ended_by = Some(byte);
        Some(if self.damaged {
            Err(CommandError::BytesLost)
        } else if self.too_long {
            Err(CommandError::LineTooLong { limit: LINE_LIMIT })
        } else {
            core::str::from_utf8(&self.bytes).map_err(|_| CommandError::NotText)
        })
    }

    /// Discards what has been received of the line.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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

    /// The requests that the bytes make, in order.
    fn requests(bytes: &[u8]) -> Vec<RealTime> {
        let mut sorter = Sorter::new();
        bytes.iter().filter_map(|byte| sorter.sort(*byte)).collect()
    }

    #[test]
    fn a_stop_acts_after_any_three_bytes() {
        for first in 0..=u8::MAX {
            for second in [b'a', 0x80, 0xA5, 0xC3, 0xE2, 0xF0, 0xFF] {
                for third in [b'a', 0x80, 0xBF, 0xDF, 0xED, 0xF4] {
                    for (byte, expected) in [
                        (0xFD, RealTime::EMERGENCY),
                        (0xFB, RealTime::PAUSE),
                        (b'!', RealTime::HOLD),
                        (0x18, RealTime::ABORT),
                    ] {
                        let found = requests(&[first, second, third, byte]);
                        assert_eq!(found.last(), Some(&expected), "{first} {second} {third}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_letter_asks_for_anything() {
        let commands = "?!~\u{18}";
        let letters = (' '..=char::MAX).filter(|letter| !commands.contains(*letter));
        let mut sorter = Sorter::new();
        for letter in letters {
            let mut bytes = [0; 4];
            for byte in letter.encode_utf8(&mut bytes).bytes() {
                assert_eq!(sorter.sort(byte), None, "{letter}");
            }
        }
    }

    #[test]
    fn grbls_bytes_act_after_what_begins_no_letter() {
        assert_eq!(requests(b"\xC3\x85"), [], "a letter");
        for bytes in [b"\xE0\x90".as_slice(), b"\xF0\x85", b"\xF4\x90", b"\xC3 \x85"] {
            assert_eq!(requests(bytes).len(), 1, "{bytes:?}");
        }
    }

    #[test]
    fn bytes_that_are_no_text_are_refused() {
        assert_eq!(lines(b"\xfe\xfe\nok\n"), [Err(CommandError::NotText), Ok("ok".to_string())]);
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
