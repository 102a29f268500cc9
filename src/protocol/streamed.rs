//! Strokes that a computer has computed and sends while they are drawn: `$stream=…` begins them,
//! and each line `$s=…` brings some more.
//!
//! A line of strokes names the targets of the pen, in order and in whole steps of the page. A
//! target is two numbers, x and y, each less that of the target before; the first target of a line
//! counts from the origin, so that each line can be read by itself. A number n is written as 2n, or
//! as -2n - 1 if it is negative, in digits to the base 32, the lowest first; each digit but the
//! last has 32 added. The digits 0 to 63 are `0` to `9`, `A` to `Z`, `a` to `z`, `+` and `-`. The
//! pen draws to a target unless a `,` stands before it. `/` and a digit choose the pen, `:` and a
//! digit the line type of what follows; a line begins with the first pen and full lines.
//!
//! Nothing here knows the state of the plotter. A line that is damaged is refused as a whole.

use super::CommandError;
use crate::drawing::{LineType, PAGE_LIMIT, PagePoint};
use crate::machine::{JobSize, Target};
use crate::model::PEN_LIMIT;
use crate::text::parts;

/// The keyword of a line of strokes.
pub const STROKES_KEYWORD: &str = "$s=";

/// The most targets that a line can name: each takes two digits at least.
pub const MOST_TARGETS: usize = super::LINE_LIMIT / 2;

/// The number of bits that a digit carries.
const DIGIT_BITS: u32 = 5;

/// What is added to a digit that is not the last of its number.
const MORE: u8 = 1 << DIGIT_BITS;

/// What is known of a job before its strokes come: the values of `$stream=`, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamHeader {
    /// The steps per millimetre of the page, x and y, in units of 2^-16, by which the job was
    /// computed.
    pub steps: [i32; 2],
    /// A number by which the sender knows the job again.
    pub id: u32,
    /// The number of all targets.
    pub targets: u32,
    /// The least coordinates of all targets, in steps of the page.
    pub least: PagePoint,
    /// The greatest coordinates of all targets, in steps of the page.
    pub greatest: PagePoint,
    /// The strokes, lengths and time of the whole job.
    pub size: JobSize,
    /// The number of pens of the whole job, of which this may be the rest. 0 if that is not said.
    pub pens: u32,
    /// The number of points within strokes at which the machine has rested before this rest of a
    /// job begins ([`Setting::PointDistance`](crate::machine::Setting::PointDistance)).
    pub points: u32,
}

impl StreamHeader {
    /// The number of values.
    const COUNT: usize = 14;

    /// Parses the text after `$stream=`: whole numbers with commas between them. The last two may
    /// be left out, and are 0 then.
    ///
    /// # Errors
    /// There are too few or too many numbers, or one of them is not a number or is too
    /// large.
    pub fn parse(text: &str) -> Result<Self, CommandError> {
        let wrong_count = CommandError::WrongNumberCount { needed: Self::COUNT };
        let mut parts = parts(text, b',');
        let mut read = 0;
        let mut next = |limit: u64| {
            read += 1;
            let part = match parts.next() {
                None if read > Self::COUNT - 2 => return Ok(0),
                part => part.ok_or(wrong_count)?.trim_ascii(),
            };
            if part.is_empty() || !part.bytes().all(|byte| byte.is_ascii_digit()) {
                return Err(CommandError::NotANumber);
            }
            let value = part.parse::<u64>().ok().filter(|value| *value <= limit);
            value.ok_or(CommandError::NumberOutOfRange)
        };
        let (most, page) = (u32::MAX.into(), PAGE_LIMIT as u64);
        // Lengths below 2^56 are some 270 km.
        let length = 1 << 56;
        let header = Self {
            steps: [next(i32::MAX as u64)? as i32, next(i32::MAX as u64)? as i32],
            id: next(most)? as u32,
            targets: next(most)? as u32,
            least: PagePoint { x: next(page)? as i32, y: next(page)? as i32 },
            greatest: PagePoint { x: next(page)? as i32, y: next(page)? as i32 },
            size: JobSize {
                strokes: next(most)? as u32,
                drawn: next(length)?,
                travelled: next(length)?,
                milliseconds: next(length)?,
            },
            pens: next(most)? as u32,
            points: next(most)? as u32,
        };
        if parts.next().is_some() {
            return Err(wrong_count);
        }
        // A job without targets would count as drawn at once, and take the place of the kept one.
        if header.targets == 0 {
            return Err(CommandError::NumberOutOfRange);
        }
        Ok(header)
    }

    /// The line that begins a job with these values.
    ///
    /// ```
    /// use penup::protocol::StreamHeader;
    /// let header = StreamHeader { id: 7, targets: 2, ..StreamHeader::default() };
    /// let line = header.line();
    /// assert_eq!(line, "$stream=0,0,7,2,0,0,0,0,0,0,0,0,0,0");
    /// assert_eq!(StreamHeader::parse(line.trim_start_matches("$stream=")), Ok(header));
    /// ```
    #[cfg(any(test, feature = "host"))]
    pub fn line(&self) -> std::string::String {
        let Self { steps: [x, y], id, targets, least, greatest, size, pens, points } = self;
        std::format!(
            "$stream={x},{y},{id},{targets},{},{},{},{},{},{},{},{},{pens},{points}",
            least.x,
            least.y,
            greatest.x,
            greatest.y,
            size.strokes,
            size.drawn,
            size.travelled,
            size.milliseconds
        )
    }

    /// Whether a target lies where the header says that all do.
    pub fn holds(&self, point: PagePoint) -> bool {
        (self.least.x..=self.greatest.x).contains(&point.x)
            && (self.least.y..=self.greatest.y).contains(&point.y)
    }
}

/// A target of a stroke that was sent, and its pen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StreamedTarget {
    /// Where the pen moves, and whether it draws.
    pub target: Target,
    /// The pen, counted from 0.
    pub pen: u8,
}

/// The targets of a line of strokes, read from the text after `$s=`.
///
/// ```
/// use penup::protocol::StreamedTargets;
/// let targets: Result<Vec<_>, _> = StreamedTargets::new(",K0E0").collect();
/// let targets = targets.expect("a move and a line");
/// let seen = targets.iter().map(|t| (t.target.point.x, t.target.point.y, t.target.ink.is_some()));
/// assert_eq!(seen.collect::<Vec<_>>(), [(10, 0, false), (17, 0, true)]);
/// assert!(StreamedTargets::new("K").any(|target| target.is_err()));
/// ```
#[derive(Debug, Clone)]
pub struct StreamedTargets<'a> {
    /// What has not been read yet.
    bytes: core::slice::Iter<'a, u8>,
    /// The last target.
    at: PagePoint,
    /// The pen of what follows.
    pen: u8,
    /// The line type of what follows.
    line_type: LineType,
}

impl<'a> StreamedTargets<'a> {
    /// Reads the text after `$s=`.
    pub fn new(text: &'a str) -> Self {
        Self {
            bytes: text.as_bytes().iter(),
            at: PagePoint::default(),
            pen: 0,
            line_type: LineType::Full,
        }
    }

    /// The next digit; `None` at the end, or where there is none.
    fn digit(&mut self) -> Option<u8> {
        Some(match self.bytes.next()? {
            digit @ b'0'..=b'9' => digit - b'0',
            digit @ b'A'..=b'Z' => digit - b'A' + 10,
            digit @ b'a'..=b'z' => digit - b'a' + 36,
            b'+' => 62,
            b'-' => 63,
            _ => return None,
        })
    }

    /// The coordinate that follows `before`; `None` if there is none, or if it lies beyond every
    /// page.
    fn coordinate(&mut self, before: i32) -> Option<i32> {
        let (mut folded, mut shift) = (0u32, 0);
        loop {
            let digit = self.digit()?;
            folded |= u32::from(digit % MORE) << shift;
            shift += DIGIT_BITS;
            if digit < MORE {
                break;
            }
            // Differences on a page are below 2^21, so folded ones take five digits at most.
            if shift > 4 * DIGIT_BITS {
                return None;
            }
        }
        let difference = (folded >> 1) as i32 ^ -((folded & 1) as i32);
        Some(before + difference).filter(|coordinate| (0..=PAGE_LIMIT).contains(coordinate))
    }

    /// The next target; `None` where there is none.
    fn target(&mut self) -> Option<StreamedTarget> {
        let mut draws = true;
        loop {
            match self.bytes.as_slice().first()? {
                b',' if draws => draws = false,
                b'/' => {
                    self.bytes.next();
                    self.pen = self.digit().filter(|pen| *pen < PEN_LIMIT)?;
                    continue;
                }
                b':' => {
                    self.bytes.next();
                    let code = self.digit()?;
                    self.line_type = *LineType::ALL.get(usize::from(code))?;
                    continue;
                }
                _ => break,
            }
            self.bytes.next();
        }
        let PagePoint { x, y } = self.at;
        let (x, y) = (self.coordinate(x)?, self.coordinate(y)?);
        self.at = PagePoint { x, y };
        let target = Target { point: self.at, ink: draws.then_some(self.line_type) };
        Some(StreamedTarget { target, pen: self.pen })
    }
}

impl Iterator for StreamedTargets<'_> {
    type Item = Result<StreamedTarget, CommandError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.bytes.as_slice().is_empty() {
            return None;
        }
        let target = self.target();
        if target.is_none() {
            // Nothing behind an error is read.
            self.bytes = [].iter();
        }
        Some(target.ok_or(CommandError::NotStrokes))
    }
}

/// Writes targets as lines of strokes.
#[cfg(any(test, feature = "host"))]
#[derive(Debug, Default)]
pub struct StrokeWriter {
    /// The line that is being written, without its keyword.
    line: std::string::String,
    /// The last target of the line.
    at: PagePoint,
    /// The pen in force.
    pen: u8,
    /// The line type in force.
    line_type: LineType,
}

#[cfg(any(test, feature = "host"))]
impl StrokeWriter {
    /// The digits in order.
    const DIGITS: &'static [u8; 64] =
        b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz+-";

    /// The length of the line so far, with its keyword.
    pub fn bytes(&self) -> usize {
        STROKES_KEYWORD.len() + self.line.len()
    }

    fn push_digit(&mut self, digit: u32) {
        self.line.push(char::from(Self::DIGITS[digit as usize % 64]));
    }

    fn push_number(&mut self, number: i32) {
        let mut folded = ((number << 1) ^ (number >> 31)).cast_unsigned();
        while folded >= u32::from(MORE) {
            self.push_digit(folded % u32::from(MORE) + u32::from(MORE));
            folded >>= DIGIT_BITS;
        }
        self.push_digit(folded);
    }

    /// Adds a target on the page to the line.
    pub fn push(&mut self, StreamedTarget { target, pen }: StreamedTarget) {
        if pen != self.pen {
            self.line.push('/');
            self.push_digit(pen.into());
            self.pen = pen;
        }
        match target.ink {
            None => self.line.push(','),
            Some(line_type) if line_type != self.line_type => {
                self.line.push(':');
                self.push_digit(line_type.code().into());
                self.line_type = line_type;
            }
            Some(_) => {}
        }
        let PagePoint { x, y } = target.point;
        self.push_number(x - self.at.x);
        self.push_number(y - self.at.y);
        self.at = target.point;
    }

    /// The line, with its keyword; the next target begins another one.
    pub fn end_line(&mut self) -> std::string::String {
        let Self { line, .. } = core::mem::take(self);
        std::format!("{STROKES_KEYWORD}{line}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn target(x: i32, y: i32, ink: Option<LineType>, pen: u8) -> StreamedTarget {
        StreamedTarget { target: Target { point: PagePoint { x, y }, ink }, pen }
    }

    #[test]
    fn every_target_is_read_as_it_was_written() {
        let full = Some(LineType::Full);
        let targets = [
            target(0, PAGE_LIMIT, None, 0),
            target(PAGE_LIMIT, 0, full, 0),
            target(15, 16, full, 0),
            target(31, 0, Some(LineType::Dashed), 3),
            target(31, 0, None, 31),
            target(31, 1, Some(LineType::Dotted), 31),
        ];
        let mut writer = StrokeWriter::default();
        targets.iter().for_each(|&target| writer.push(target));
        assert_eq!(writer.bytes(), 3 + 40);
        let line = writer.end_line();
        let read: Result<Vec<_>, _> =
            StreamedTargets::new(line.trim_start_matches("$s=")).collect();
        assert_eq!(read, Ok(targets.to_vec()));
        assert!(line.bytes().all(|byte| byte.is_ascii_graphic() && !b"?!~*;(#".contains(&byte)));
    }

    #[test]
    fn what_is_no_target_is_refused() {
        // An odd number of coordinates, an unknown digit, pen or line type, two commas, a number
        // that is too long, a point below the page and one beyond it, and a mark at the end.
        for text in
            ["0", "0=", "/W00", ":300", ",,00", "zzzzz000", "10", "zzzz1zzzz1zzzz1", "00,", "00/1"]
        {
            let read: Result<Vec<_>, _> = StreamedTargets::new(text).collect();
            assert_eq!(read, Err(CommandError::NotStrokes), "{text}");
        }
        assert_eq!(StreamedTargets::new("").next(), None);
    }

    #[test]
    fn a_header_is_read_as_a_whole_or_not() {
        let header = StreamHeader {
            steps: [80 << 16, 100 << 16],
            id: u32::MAX,
            targets: 5,
            least: PagePoint { x: 1, y: 2 },
            greatest: PagePoint { x: PAGE_LIMIT, y: 4 },
            size: JobSize { strokes: 6, drawn: 7 << 40, travelled: 8, milliseconds: 9 },
            pens: 10,
            points: 11,
        };
        let line = header.line();
        let text = line.trim_start_matches("$stream=");
        assert_eq!(StreamHeader::parse(text), Ok(header));
        assert!(matches!(
            StreamHeader::parse(&std::format!("{text},1")),
            Err(CommandError::WrongNumberCount { needed: 14 })
        ));
        let short = text.strip_suffix(",10,11").unwrap();
        let without = StreamHeader { pens: 0, points: 0, ..header };
        assert_eq!(StreamHeader::parse(short), Ok(without));
        assert_eq!(StreamHeader::parse(&std::format!("{short},10")).map(|it| it.pens), Ok(10));
        assert!(StreamHeader::parse(&std::format!("{short},10,")).is_err());
        assert!(StreamHeader::parse("1,2,3").is_err());
        assert_eq!(StreamHeader::parse("-1"), Err(CommandError::NotANumber));
        let long = text.replace(",2,", ",1048577,");
        assert_eq!(StreamHeader::parse(&long), Err(CommandError::NumberOutOfRange));
    }

    #[test]
    fn a_header_says_where_all_targets_lie() {
        let header = StreamHeader::parse("0,0,7,2,5,10,20,30,0,0,0,0").unwrap();
        let holds = |x, y| header.holds(PagePoint { x, y });
        assert!(holds(5, 10) && holds(20, 30) && holds(6, 20));
        assert!(!holds(4, 20) && !holds(21, 20) && !holds(6, 9) && !holds(6, 31));
    }
}
