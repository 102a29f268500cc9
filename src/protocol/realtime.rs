//! The bytes that are commands by themselves, and how they are told from the bytes of lines.

#[cfg(feature = "hpgl")]
use crate::hpgl::Dialect;

/// A set of real-time requests: commands of a single byte, which never wait in a queue.
///
/// A board's receive interrupt collects these requests. The main loop and every long computation
/// check them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RealTime(u16);

impl RealTime {
    /// A command of Grbl that has no effect on a plotter.
    pub const NOTHING: Self = Self(0);
    /// `?`: reports the status.
    pub const STATUS: Self = Self(1);
    /// `!`: stops on the path and raises the pen.
    pub const HOLD: Self = Self(1 << 1);
    /// `~`: resumes.
    pub const RESUME: Self = Self(1 << 2);
    /// ctrl-X: cancels the job. Bytes received before it are dropped.
    pub const ABORT: Self = Self(1 << 3);
    /// 0x95: resets the override of moves with the pen up to 100 %.
    pub const RAPID_RESET: Self = Self(1 << 4);
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

    /// 0x96: halves the speed of moves with the pen up.
    pub const RAPID_HALF: Self = Self(1 << 13);
    /// 0x97: moves with the pen up at a quarter of the speed.
    pub const RAPID_QUARTER: Self = Self(1 << 14);

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
/// The bytes that Grbl defines, from 0x84 to 0x97, are also continuation bytes of letters in UTF-8.
/// Within a letter, they are text. After 0xC2, though, the bytes from 0x80 to 0x9F are no letters
/// that anybody writes (they would be control characters): programs that send the command as a
/// character of UTF-8 mean the command. All other commands act anywhere, whatever came before them:
/// 0xFB and 0xFD, which are penup's own, never occur in UTF-8.
///
/// In the texts of HP-GL all bytes are text but ctrl-X, 0xFB and 0xFD: labels may be in Latin-1, or
/// in the set of letters of an old computer. In its encoded data these two are data, too.
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
    /// Tells the texts of HP-GL.
    #[cfg(feature = "hpgl")]
    dialect: Dialect,
}

impl Sorter {
    /// A sorter before the first byte.
    pub const fn new() -> Self {
        Self {
            inner: 0,
            last: 0,
            #[cfg(feature = "hpgl")]
            dialect: Dialect::new(),
        }
    }

    /// The request that the byte makes. `None` for a byte of a line or of HP-GL.
    #[cfg(feature = "hpgl")]
    pub fn sort(&mut self, byte: u8) -> Option<RealTime> {
        let is_text = match byte {
            0x18 => false,
            0xFB | 0xFD => self.dialect.is_in_data(),
            _ => self.dialect.is_in_text(),
        };
        if is_text {
            (self.inner, self.last) = (0, byte);
            self.dialect.take(byte);
            return None;
        }
        let request = self.sort_byte(byte);
        match request {
            None => drop(self.dialect.take(byte)),
            Some(RealTime::ABORT) => self.dialect = Dialect::new(),
            Some(_) => {}
        }
        request
    }

    /// The request that the byte makes. `None` for a byte of a line.
    #[cfg(not(feature = "hpgl"))]
    pub const fn sort(&mut self, byte: u8) -> Option<RealTime> {
        self.sort_byte(byte)
    }

    /// Forgets all that has come, because ctrl-X came by some port.
    #[cfg(feature = "hpgl")]
    pub const fn clear(&mut self) {
        *self = Self::new();
    }

    /// Forgets a letter that has begun, because bytes were lost.
    #[cfg(feature = "hpgl")]
    pub const fn break_letter(&mut self) {
        (self.inner, self.last) = (0, 0xFF);
    }

    /// The request that the byte makes, if it is no text of HP-GL.
    #[cfg_attr(not(feature = "hpgl"), inline(always))]
    const fn sort_byte(&mut self, byte: u8) -> Option<RealTime> {
        // The second byte of a well-formed letter (Unicode, table 3-7).
        let is_inner = match self.last {
            0xC2 | 0xE0 => matches!(byte, 0xA0..=0xBF),
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
            // Grbl's safety door: a plotter has none, and stops as for a hold.
            0x84 => RealTime::HOLD,
            // Other bytes for these commands, which grblHAL has. Programs try them at any plotter.
            0x80 | 0x87 => RealTime::STATUS,
            0x81 => RealTime::RESUME,
            0x82 => RealTime::HOLD,
            // The speed of a spindle, flood and mist, which a plotter has not.
            0x99..=0x9E | 0xA0 | 0xA1 => RealTime::NOTHING,
            0x85 => RealTime::CANCEL_JOG,
            0x90 => RealTime::FEED_RESET,
            0x91 => RealTime::FEED_PLUS_10,
            0x92 => RealTime::FEED_MINUS_10,
            0x93 => RealTime::FEED_PLUS_1,
            0x94 => RealTime::FEED_MINUS_1,
            0x95 => RealTime::RAPID_RESET,
            0x96 => RealTime::RAPID_HALF,
            0x97 => RealTime::RAPID_QUARTER,
            0xFB => RealTime::PAUSE,
            0xFD => RealTime::EMERGENCY,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(feature = "hpgl")]
    use std::format;
    use std::vec::Vec;

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
        let is_control = |letter: char| ('\u{80}'..='\u{9F}').contains(&letter);
        let is_text = |letter: &char| !commands.contains(*letter) && !is_control(*letter);
        let letters = (' '..=char::MAX).filter(is_text);
        let mut sorter = Sorter::new();
        for letter in letters {
            let mut bytes = [0; 4];
            for byte in letter.encode_utf8(&mut bytes).bytes() {
                assert_eq!(sorter.sort(byte), None, "{letter}");
            }
        }
    }

    #[cfg(feature = "hpgl")]
    #[test]
    fn in_the_texts_of_hp_gl_they_are_text() {
        let both = [RealTime::STATUS, RealTime::HOLD];
        assert_eq!(requests(b"LB?!"), both, "no HP-GL");
        assert_eq!(requests(b"IN;PU;?!"), both);
        assert_eq!(requests(b"IN;LB?!~\x03?!"), both);
        assert_eq!(requests(b"IN;DT?;LB!~?!?"), [RealTime::HOLD, RealTime::STATUS]);
        assert_eq!(requests(b"IN;LB\xFD\x18?"), [RealTime::EMERGENCY, RealTime::ABORT, both[0]]);
        assert_eq!(requests(b"IN;PE?!~\xFD\xFB\x91;?!"), both);
        assert_eq!(requests(b"IN;LB\n$?\x03\n$\n?!"), both);
        assert_eq!(requests(b"IN;BP1,\"?!\",2,\"~\";?!"), both);
        assert_eq!(requests(b"\x1B%-12345X@PJL?!\r\n?!"), both);
        // All letters of Latin-1 and of older sets of letters but two.
        let stops = [RealTime::PAUSE, RealTime::EMERGENCY];
        for text in ["LB", "BL", "CO\"", "BP\""] {
            let bytes = |low, high| (low..=high).collect::<Vec<u8>>();
            let begin = format!("IN;{text}");
            assert_eq!(requests(&[begin.as_bytes(), &bytes(0x80, 0xFA)].concat()), []);
            assert_eq!(requests(&[begin.as_bytes(), &bytes(0xFB, 0xFF)].concat()), stops);
        }
        assert_eq!(requests(b"IN;DT\x85;LBa\x84\x85\x84"), [RealTime::HOLD]);
        assert_eq!(requests("IN;LBÅ€😀\u{91}\u{3}".as_bytes()), []);
        // The letter that has begun in a label is over behind it.
        assert_eq!(requests(b"IN;LB\xE2\x82\x03\x84"), [RealTime::HOLD]);
    }

    #[test]
    fn grbls_bytes_act_after_what_begins_no_letter() {
        assert_eq!(requests(b"\xC3\x85"), [], "a letter");
        // Programs that write the byte as a character of UTF-8 send 0xC2 before it.
        assert_eq!(requests(b"\xC2\x91\xC2\x85"), [RealTime::FEED_PLUS_10, RealTime::CANCEL_JOG]);
        assert_eq!(requests("°".as_bytes()), []);
        for bytes in [b"\xE0\x90".as_slice(), b"\xF0\x85", b"\xF4\x90", b"\xC3 \x85"] {
            assert_eq!(requests(bytes).len(), 1, "{bytes:?}");
        }
    }

    #[test]
    fn each_byte_asks_for_something_else_and_a_set_holds_all_that_was_put_in() {
        let (mut all, mut each) = (RealTime::default(), Vec::new());
        for byte in *b"?!~\x18\x85\x90\x91\x92\x93\x94\x95\x96\x97\xFB\xFD" {
            let found = requests(&[b' ', byte]);
            let [request] = found[..] else { panic!("{byte:#x}: {found:?}") };
            assert!(!all.has(request), "{byte:#x}");
            all = all.and(request);
            each.push(request);
            assert!(each.iter().all(|request| all.has(*request)), "{byte:#x}");
            assert!(each.len() == 1 || !request.has(all), "{byte:#x}");
        }
        assert_eq!(requests(b"\x84"), [RealTime::HOLD]);
        assert_eq!(requests(b"\xC3\x85\x85"), [RealTime::CANCEL_JOG], "a letter, and a byte");
    }
}
