//! Lines with a number and a checksum, so that lost, damaged, repeated or reordered lines are
//! detected.
//!
//! A line `N17 v 0 1 0*…` has the number 17. The text after the last `*` is the checksum of all
//! bytes before it. There are two checksums, which cannot be confused: RepRap's XOR of the bytes,
//! in one to three decimal digits, and [`CRC_16`], in exactly four hexadecimal digits (0-9, A-F). A
//! [`Numbering`] removes number and checksum and decides whether the line is to be carried out.
//! Lines are carried out in the order of their numbers. A line that came before is only
//! acknowledged again. After the first line with a CRC, a line without number and checksum is
//! refused, because it may be the remainder of a damaged line. So is a line with an XOR, which lets
//! one wrong line in 256 pass.
//!
//! `M110 N…` sets the number of the last line. `M110` alone, with a checksum, asks for it. A
//! numbered `M2` or `M30` ends the obligation to send numbers, as does ctrl-X.

use super::gcode::ends_in_comment;
use super::{CommandError, GCode, LINE_LIMIT};
use crate::checksum::CRC_16;
use crate::text::strip_first;

/// The largest number of bytes that number and checksum add to a line: `N-999999999 ` and `*FFFF`.
pub const NUMBER_LIMIT: usize = 12 + 5;

/// The kind of checksum at the end of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checksum {
    /// The exclusive or of all bytes, in decimal, as RepRap defines it.
    Xor,
    /// [`CRC_16`] in four hexadecimal digits.
    Crc,
}

/// What the reply to a line contains besides its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Label {
    /// The kind of checksum of the line. If it is a CRC, the reply has one, too.
    pub checksum: Option<Checksum>,
    /// The number that the reply names.
    pub named: Named,
}

/// Which line number a reply names, and what it means there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Named {
    /// No number, because the line had none.
    #[default]
    Nothing,
    /// The number of the line, which has been accepted.
    Line(i32),
    /// The number of the last accepted line, in reply to `M110`.
    Last(i32),
    /// The number of the expected line, because this line was not accepted.
    Expected(i32),
}

/// What to do with a received line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received<'a> {
    /// Carry the line out, and reply with this label.
    Line(&'a str, Label),
    /// Do not carry it out, but reply with this outcome and this label.
    Answer(Result<(), CommandError>, Label),
}

/// Keeps track of which numbered lines have come.
///
/// ```
/// use penup::protocol::{Named, Numbering, Received};
/// let mut numbering = Numbering::default();
/// let mut receive = |line| match numbering.receive(Ok(line)) {
///     Received::Line(text, label) => Some((text, label.named)),
///     Received::Answer(..) => None,
/// };
/// assert_eq!(receive("v 0 1 0"), Some(("v 0 1 0", Named::Nothing)));
/// assert_eq!(receive("N1 v 0 1 0*56"), Some(("v 0 1 0", Named::Line(1))));
/// assert_eq!(receive("N2 v 0 3 0*56"), None);
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Numbering {
    /// The number of the last line that was accepted.
    last: i32,
    /// Whether any line has had a number so far, or one was set by `M110`.
    has_begun: bool,
    /// The checksum that every line must have from now on, if any.
    required: Option<Checksum>,
    /// The number of the first line that was accepted and then refused since the number was last
    /// set, with its error.
    refused: Option<(i32, u16)>,
    /// Which of the last 32 lines that were accepted were then refused; the lowest bit is that of
    /// the last line.
    refusals: u32,
}

impl Numbering {
    /// Checks a line as the reader has returned it.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn receive<'a>(&mut self, line: Result<&'a str, CommandError>) -> Received<'a> {
        let line = match line {
            Ok(line) => line,
            Err(command_error) => return self.refuse(command_error, None),
        };
        match Checked::split(line) {
            Some(checked) => self.receive_checked(checked),
            None => self.receive_unchecked(line),
        }
    }

    /// Notes the outcome of a line that was carried out, so that it can be repeated.
    pub fn note(&mut self, label: Label, outcome: Result<(), CommandError>) {
        if let (Named::Line(number), Err(command_error)) = (label.named, outcome)
            && number == self.last
        {
            self.refusals |= 1;
            self.refused.get_or_insert((number, command_error.number()));
        }
    }

    /// Returns what was answered to a line that came before. Of lines that were refused, only the
    /// first one's error is kept, and stands for that of later ones. Of more than 32 lines behind
    /// it, it is not known which were refused, so all count as refused.
    fn answer_again(&self, number: i32) -> Result<(), CommandError> {
        let Some((first, error)) = self.refused else { return Ok(()) };
        let later = self.refusals.checked_shr(self.last.abs_diff(number));
        let is_refused = number > first && later.is_none_or(|bits| bits & 1 != 0);
        if number == first || is_refused { Err(CommandError::RefusedBefore(error)) } else { Ok(()) }
    }

    /// Decides what to do with a line that has a checksum.
    fn receive_checked<'a>(&mut self, line: Checked<'a>) -> Received<'a> {
        let Checked { checksum, text, .. } = line;
        let sets_number = number_to_set(text);
        let by = Some(checksum);
        if !line.is_whole {
            return self.refuse(CommandError::Damaged, by);
        }
        let label = |number| Label { checksum: by, named: Named::Line(number) };
        if let Some(number) = sets_number {
            return match number.or(line.number) {
                Some(number) => {
                    let required = Some(checksum);
                    *self = Self { last: number, has_begun: true, required, ..Self::default() };
                    Received::Answer(Ok(()), label(line.number.unwrap_or(number)))
                }
                None => match self.refused {
                    Some((number, error)) => {
                        Received::Answer(Err(CommandError::RefusedBefore(error)), label(number))
                    }
                    None => {
                        let named = Named::Last(self.last);
                        Received::Answer(Ok(()), Label { checksum: by, named })
                    }
                },
            };
        }
        let Some(number) = line.number else { return self.refuse(CommandError::Unnumbered, by) };
        if self.required == Some(Checksum::Crc) && checksum == Checksum::Xor {
            return self.refuse(CommandError::Damaged, by);
        }
        // Without M110, a sender begins at 1 or at 0.
        if number == self.last + 1 || (number == 0 && !self.has_begun) {
            (self.last, self.has_begun, self.required) = (number, true, Some(checksum));
            self.refusals <<= 1;
            if matches!(text.trim_ascii(), "M2" | "M30") {
                self.required = None;
            }
            if text.len() > LINE_LIMIT {
                let outcome = Err(CommandError::LineTooLong { limit: LINE_LIMIT });
                self.note(label(number), outcome);
                return Received::Answer(outcome, label(number));
            }
            return Received::Line(text, label(number));
        }
        if number > self.last || !self.has_begun {
            return self.refuse(CommandError::OutOfOrder { expected: self.last + 1 }, by);
        }
        Received::Answer(self.answer_again(number), label(number))
    }

    /// Decides what to do with a line that has no checksum.
    fn receive_unchecked<'a>(&mut self, line: &'a str) -> Received<'a> {
        let may_be_damaged = match self.required {
            None => false,
            Some(Checksum::Xor) => split_number(line).is_some() || split_checksum(line).is_some(),
            // Empty lines, as doubled line ends produce them, are harmless.
            Some(Checksum::Crc) => !line.trim_ascii().is_empty(),
        };
        if may_be_damaged {
            return self.refuse(CommandError::Unnumbered, None);
        }
        if line.len() > LINE_LIMIT {
            return self.refuse(CommandError::LineTooLong { limit: LINE_LIMIT }, None);
        }
        // A line of G-code may have a checksum alone.
        if let Some((head, Checksum::Xor, value)) = split_checksum(line)
            && GCode::begins(head)
            && !ends_in_comment(head)
        {
            let is_whole = head.bytes().fold(0, |xor, byte| xor ^ byte) == (value & 0xFF) as u8;
            return if is_whole && value <= 0xFF {
                Received::Line(head, Label::default())
            } else {
                Received::Answer(Err(CommandError::Damaged), Label::default())
            };
        }
        let (number, text) = split_number(line).map_or((None, line), |(n, text)| (Some(n), text));
        match number_to_set(text) {
            Some(to_set) => {
                if let Some(number) = to_set.or(number) {
                    *self = Self { last: number, has_begun: true, ..Self::default() };
                }
                Received::Answer(Ok(()), Label::default())
            }
            None => Received::Line(line, Label::default()),
        }
    }

    /// Refuses the line. If lines are numbered, the reply names the number after that of the last
    /// line.
    fn refuse<'a>(&self, command_error: CommandError, by: Option<Checksum>) -> Received<'a> {
        let is_of_numbers = matches!(
            command_error,
            CommandError::Damaged | CommandError::OutOfOrder { .. } | CommandError::Unnumbered
        );
        let named = is_of_numbers || self.required.is_some();
        let named = if named { Named::Expected(self.last + 1) } else { Named::Nothing };
        let checksum = self.required.filter(|required| *required == Checksum::Crc).or(by);
        Received::Answer(Err(command_error), Label { checksum, named })
    }
}

/// A line with a checksum: a numbered line, or `M110`.
struct Checked<'a> {
    /// The kind of checksum that the line has.
    checksum: Checksum,
    /// Whether the checksum matches.
    is_whole: bool,
    /// The number of the line; `None` for `M110` without a number before it.
    number: Option<i32>,
    /// The line without its number and its checksum.
    text: &'a str,
}

impl<'a> Checked<'a> {
    /// Splits a line with a checksum that has a number or is `M110`. `None` for other lines.
    fn split(line: &'a str) -> Option<Self> {
        let (head, checksum, value) = split_checksum(line)?;
        let (number, text) = match split_number(head) {
            Some((number, text)) => (Some(number), text),
            None => (None, number_to_set(head).map(|_| head)?),
        };
        let right = match checksum {
            Checksum::Xor => head.bytes().fold(0, |xor, byte| xor ^ byte).into(),
            Checksum::Crc => CRC_16.checksum(head.as_bytes()),
        };
        Some(Self { checksum, is_whole: value == right, number, text })
    }
}

/// The text before the last `*`, and the checksum after it.
fn split_checksum(line: &str) -> Option<(&str, Checksum, u16)> {
    let (head, tail) = line.split_at_checked(line.bytes().rposition(|byte| byte == b'*')?)?;
    let tail = tail.get(1..)?;
    let is_hexadecimal = |byte: u8| matches!(byte, b'0'..=b'9' | b'A'..=b'F');
    if tail.len() == 4 && tail.bytes().all(is_hexadecimal) {
        return Some((head, Checksum::Crc, u16::from_str_radix(tail, 16).ok()?));
    }
    let tail = tail.trim_ascii();
    let is_decimal = tail.bytes().all(|byte| byte.is_ascii_digit());
    let value = tail.parse().ok().filter(|_| is_decimal && tail.len() <= 3)?;
    Some((head, Checksum::Xor, value))
}

/// The number after `N`, of at most nine digits, and the text after it.
fn split_number(line: &str) -> Option<(i32, &str)> {
    let rest = strip_first(line.trim_ascii_start(), b'N')?;
    let digits = strip_first(rest, b'-').unwrap_or(rest);
    let sign = rest.len() - digits.len();
    let count = digits.bytes().take_while(u8::is_ascii_digit).count();
    let (number, text) = rest.split_at_checked(sign + count)?;
    let number = number.parse().ok().filter(|_| count <= 9)?;
    Some((number, text.trim_ascii_start()))
}

/// `Some` if the text is `M110`, with the number that it sets, if it has one.
fn number_to_set(text: &str) -> Option<Option<i32>> {
    let rest = text.trim_ascii().strip_prefix("M110")?.trim_ascii_start();
    if rest.is_empty() {
        return Some(None);
    }
    split_number(rest).filter(|(_, rest)| rest.is_empty()).map(|(number, _)| Some(number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;
    use std::string::String;

    /// The line with its number and its checksum.
    fn numbered(number: i32, text: &str) -> String {
        let line = format!("N{number} {text}");
        let xor = line.bytes().fold(0, |xor, byte| xor ^ byte);
        format!("{line}*{xor}")
    }

    fn receive(numbering: &mut Numbering, line: &str) -> Result<Named, (CommandError, Named)> {
        match numbering.receive(Ok(line)) {
            Received::Line(_, label) | Received::Answer(Ok(()), label) => Ok(label.named),
            Received::Answer(Err(error), label) => Err((error, label.named)),
        }
    }

    #[test]
    fn a_number_is_split_from_its_line() {
        assert_eq!(split_number("N12 G0"), Some((12, "G0")));
        assert_eq!(split_number(" N-3x"), Some((-3, "x")));
        assert_eq!(split_number("N123456789"), Some((123_456_789, "")));
        assert_eq!(["G0 N1", "N", "N-", "N1234567890", ""].map(split_number), [None; 5]);
    }

    #[test]
    fn lines_come_in_order_and_are_answered_again() {
        let mut numbering = Numbering::default();
        assert_eq!(receive(&mut numbering, &numbered(1, "v 0 1 0")), Ok(Named::Line(1)));
        let late = receive(&mut numbering, &numbered(4, "v 0 1 0"));
        assert_eq!(late, Err((CommandError::OutOfOrder { expected: 2 }, Named::Expected(2))));
        assert_eq!(receive(&mut numbering, &numbered(2, "v 0 1 0")), Ok(Named::Line(2)));
        // What was refused is refused again; what was not is not.
        let label = Label { checksum: None, named: Named::Line(2) };
        numbering.note(Label { named: Named::Line(1), ..label }, Err(CommandError::Unnumbered));
        assert_eq!(receive(&mut numbering, &numbered(2, "v 0 1 0")), Ok(Named::Line(2)));
        numbering.note(label, Err(CommandError::Unnumbered));
        let number = CommandError::Unnumbered.number();
        let again = receive(&mut numbering, &numbered(2, "v 0 1 0"));
        assert_eq!(again.map_err(|(error, _)| error), Err(CommandError::RefusedBefore(number)));
        assert_eq!(receive(&mut numbering, &numbered(1, "v 0 1 0")), Ok(Named::Line(1)));
        // So is each later one, as long as it is known, and longer.
        for later in 3..40 {
            assert_eq!(receive(&mut numbering, &numbered(later, "v")), Ok(Named::Line(later)));
            if later % 2 == 0 {
                numbering.note(
                    Label { named: Named::Line(later), ..label },
                    Err(CommandError::Unnumbered),
                );
            }
            for before in 1..=later {
                let is_refused = before % 2 == 0 || before > 2 && later - before >= 32;
                let again = receive(&mut numbering, &numbered(before, "v"));
                assert_eq!(again.is_err(), is_refused, "{before} behind {later}");
            }
        }
        // A line without a checksum that has a number may be damaged.
        let mut numbering = Numbering::default();
        assert_eq!(receive(&mut numbering, &numbered(1, "v 0 1 0")), Ok(Named::Line(1)));
        assert_eq!(receive(&mut numbering, &numbered(2, "v 0 1 0")), Ok(Named::Line(2)));
        assert_eq!(receive(&mut numbering, "v 1 2 3"), Ok(Named::Nothing));
        let without = receive(&mut numbering, "N3 v 0 1 0");
        assert_eq!(without, Err((CommandError::Unnumbered, Named::Expected(3))));
    }
}
