//! Tells where HP-GL begins and ends among the bytes of a serial port, and which bytes are text.
//!
//! The receive interrupt and the main loop both follow the bytes in this way, each with a
//! [`Dialect`] of its own, and come to the same conclusions, because both see the same bytes.

use super::{DAMAGED, ESCAPE, LABEL_END};
use crate::array::MapEach;

/// The line that begins HP-GL by command.
const COMMAND: &[u8] = b"$hpgl";

/// The language or the instruction that a byte belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Token {
    /// A line that is not HP-GL.
    Line,
    /// HP-GL begins with this byte. The bytes of the line before it belong to HP-GL, too.
    Begins(Beginning),
    /// An instruction of HP-GL, and not a text.
    Code,
    /// The text of a label, or other data in which any byte may stand.
    Text,
    /// An instruction to the interface, which begins with ESC.
    Control,
    /// HP-GL has ended before this byte, the `$` at the beginning of a line.
    Leaves,
}

/// The ways in which HP-GL can begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beginning {
    /// By the instruction `IN`; the byte is the one after it.
    Initialize,
    /// By ESC and this byte.
    Escape,
    /// By the line `$hpgl`, which the byte ends.
    Command,
}

/// Follows the bytes of one serial port.
///
/// ```
/// use penup::hpgl::{Dialect, Token};
/// let mut dialect = Dialect::new();
/// for byte in *b"G0 X1\nIN;PU;LBWhy" {
///     dialect.take(byte);
/// }
/// assert!(dialect.is_in_text());
/// assert_eq!(dialect.take(b'?'), Token::Text);
/// dialect.take(3);
/// assert!(!dialect.is_in_text());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialect {
    /// The state of the recognizer, without instructions to the interface.
    state: State,
    /// The progress of an instruction to the interface.
    control: Control,
    /// The byte that ends a label.
    terminator: u8,
    /// The first letter of an instruction, 0 if none has come.
    letter: u8,
    /// Whether a quotation mark would begin a name.
    takes_name: bool,
    /// Whether the last byte ended a line.
    begins_line: bool,
}

/// The states of the recognizer: what the next byte belongs to, apart from instructions to the
/// interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// At the beginning of a line of another language.
    LineBegin,
    /// So many bytes of `IN` have come of a line.
    In(u8),
    /// So many bytes of `IN;` have come of a line behind semicolons and ends of labels.
    InBehindEnd(u8),
    /// So many bytes of the command have come of a line.
    Command(u8),
    /// ESC has come at the beginning of a line.
    Escape,
    /// The rest of a line of another language.
    Rest,
    /// An instruction.
    Code,
    /// A text, up to the terminator.
    Text,
    /// The new terminator, after `DT`.
    Terminator,
    /// The new symbol, after `SM`.
    Symbol,
    /// Data up to a semicolon, after `PE`.
    Data,
    /// A comment after `CO`, a name in quotation marks, or a line of PJL after `@`.
    Comment(Comment),
}

/// The progress of a comment, or of another text that has no effect. A comment ends with the second
/// of two quotation marks if it begins with one, and otherwise with a semicolon. Where bytes were
/// lost, each text ends with a semicolon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Comment {
    /// The bytes that end it, of which a line feed also stands for a carriage return; 0 as long as
    /// they are not known. The first mode of an interpreter must consist of zero bits, which it
    /// would not beside an `Option`, a `bool` or an enum.
    ends: [u8; 2],
}

impl Comment {
    /// A comment before its first byte.
    pub(super) const BEGUN: Self = Self { ends: [0; 2] };
    /// A name behind its first quotation mark. A line end ends it, too.
    pub(super) const NAME: Self = Self { ends: [b'"', b'\n'] };
    /// The rest of a line.
    pub(super) const LINE: Self = Self { ends: [b'\n'; 2] };

    /// Takes the next byte. Returns whether it ends the text.
    pub(super) fn ends_with(&mut self, byte: u8) -> bool {
        let byte = if byte == b'\r' { b'\n' } else { byte };
        match self.ends {
            _ if byte == DAMAGED => self.ends = [b';'; 2],
            [0, _] if byte.is_ascii_whitespace() => return false,
            [0, _] if byte == b'"' => {
                self.ends = [byte; 2];
                return false;
            }
            [0, _] => self.ends = [b';'; 2],
            _ => {}
        }
        self.ends.contains(&byte)
    }
}

/// The progress of an instruction to the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Control {
    /// No such instruction is in progress.
    None,
    /// ESC has come.
    Escape,
    /// ESC and a dot have come.
    Dot,
    /// The parameters of the instruction are coming, up to a colon.
    Parameters,
    /// An escape sequence of another language is coming, up to a capital letter.
    Other,
}

impl Dialect {
    /// Before the first byte.
    pub const fn new() -> Self {
        let (state, control) = (State::LineBegin, Control::None);
        let (terminator, letter) = (LABEL_END, 0);
        Self { state, control, terminator, letter, takes_name: false, begins_line: false }
    }

    /// Whether HP-GL is in force.
    pub fn is_in_force(&self) -> bool {
        matches!(
            self.state,
            State::Code
                | State::Text
                | State::Terminator
                | State::Symbol
                | State::Data
                | State::Comment(_)
        )
    }

    /// Whether the next byte is text or data, so that `?`, `!` and `~` are no commands.
    pub fn is_in_text(&self) -> bool {
        self.control != Control::None || (self.is_in_force() && self.state != State::Code)
    }

    /// Whether the next byte is data in which any byte from 0x80 up may stand, too: that of `PE`.
    pub fn is_in_data(&self) -> bool {
        self.control == Control::None && self.state == State::Data
    }

    /// Whether the next byte belongs to a comment, a name in quotation marks or a line of PJL.
    pub fn is_in_comment(&self) -> bool {
        matches!(self.state, State::Comment(_))
    }

    /// Takes the next byte and says what it belongs to.
    pub fn take(&mut self, byte: u8) -> Token {
        if let Some(token) = self.take_control(byte) {
            return token;
        }
        match self.state {
            State::LineBegin
            | State::In(_)
            | State::InBehindEnd(_)
            | State::Command(_)
            | State::Escape
            | State::Rest => self.take_line(byte),
            State::Code => self.take_code(byte),
            State::Text => {
                if byte == self.terminator {
                    self.state = State::Code;
                }
                Token::Text
            }
            State::Terminator => {
                self.terminator = terminator(byte);
                self.state = State::Code;
                Token::Text
            }
            State::Symbol => {
                self.state = State::Code;
                Token::Text
            }
            State::Comment(mut comment) => {
                let is_over = comment.ends_with(byte);
                self.state = if is_over { State::Code } else { State::Comment(comment) };
                if is_over && byte != b'"' {
                    self.take_code(byte);
                }
                Token::Text
            }
            State::Data => {
                if byte == b';' {
                    self.state = State::Code;
                }
                Token::Text
            }
        }
    }

    /// Takes a byte of an instruction to the interface. `None` if the byte does not belong to one.
    fn take_control(&mut self, byte: u8) -> Option<Token> {
        self.control = match self.control {
            Control::None if byte == ESCAPE && self.is_in_force() => Control::Escape,
            Control::None => return None,
            Control::Escape if byte == b'.' => Control::Dot,
            Control::Escape | Control::Other if byte.is_ascii_uppercase() => Control::None,
            Control::Escape | Control::Other => Control::Other,
            Control::Dot if has_parameters(byte) => Control::Parameters,
            Control::Dot => {
                if byte == b'K' {
                    (self.state, self.letter, self.takes_name) = (State::Code, 0, false);
                }
                Control::None
            }
            Control::Parameters if byte.is_ascii_digit() || byte == b';' => Control::Parameters,
            Control::Parameters if byte == b':' => Control::None,
            Control::Parameters => {
                // The instruction ends without its colon, and the byte belongs to what follows.
                self.control = Control::None;
                return (byte == ESCAPE).then(|| {
                    self.control = Control::Escape;
                    Token::Control
                });
            }
        };
        Some(Token::Control)
    }

    /// Takes a byte of a line that may still turn out to be HP-GL.
    fn take_line(&mut self, byte: u8) -> Token {
        let ends_line = byte == b'\n' || byte == b'\r';
        self.state = match (self.state, byte) {
            (State::In(2), b';' | b'\n' | b'\r') | (State::InBehindEnd(2), b';') => {
                return self.begin(Beginning::Initialize, byte);
            }
            (State::Escape, b'.' | b'%') => {
                self.control = if byte == b'.' { Control::Dot } else { Control::Other };
                return self.begin(Beginning::Escape, 0);
            }
            (State::Command(count), _) if ends_line && usize::from(count) == COMMAND.len() => {
                return self.begin(Beginning::Command, byte);
            }
            _ if ends_line => State::LineBegin,
            (State::LineBegin, b' ' | b'\t' | 0) => State::LineBegin,
            (State::LineBegin, ESCAPE) => State::Escape,
            (State::LineBegin, b'I') => State::In(1),
            (State::In(1), b'N') => State::In(2),
            // Some programs first end what the plotter may still be at. With more or less behind it
            // than `IN;`, the semicolon begins a comment of G-code.
            (State::LineBegin | State::InBehindEnd(0), b';' | LABEL_END) => State::InBehindEnd(0),
            (State::InBehindEnd(0), b'I') => State::InBehindEnd(1),
            (State::InBehindEnd(1), b'N') => State::InBehindEnd(2),
            (State::LineBegin, b'$') => State::Command(1),
            (State::Command(count), _) if COMMAND.get(usize::from(count)) == Some(&byte) => {
                State::Command(count + 1)
            }
            _ => State::Rest,
        };
        Token::Line
    }

    /// Begins HP-GL with this byte.
    fn begin(&mut self, beginning: Beginning, byte: u8) -> Token {
        let control = self.control;
        *self = Self { state: State::Code, control, ..Self::new() };
        if beginning != Beginning::Escape {
            self.take_code(byte);
        }
        Token::Begins(beginning)
    }

    /// Takes a byte of an instruction.
    fn take_code(&mut self, byte: u8) -> Token {
        if byte == b'$' && self.begins_line {
            *self = Self { state: State::Command(1), ..Self::new() };
            return Token::Leaves;
        }
        self.begins_line = byte == b'\n' || byte == b'\r';
        if !byte.is_ascii_alphabetic() {
            self.letter = 0;
            match byte {
                b'@' => self.state = State::Comment(Comment::LINE),
                b'"' if self.takes_name => self.state = State::Comment(Comment::NAME),
                b';' | b'\n' | b'\r' | DAMAGED => {}
                _ => return Token::Code,
            }
            self.takes_name &= byte == b'"';
            return Token::Code;
        }
        let first = core::mem::replace(&mut self.letter, byte);
        self.takes_name = false;
        if first != 0 {
            self.letter = 0;
            let name = [first, byte].map_each(|letter| letter.to_ascii_uppercase());
            self.takes_name = takes_name(name);
            if resets_terminator(name) {
                self.terminator = LABEL_END;
            }
            match &name {
                b"LB" | b"BL" | b"WD" => self.state = State::Text,
                b"DT" => self.state = State::Terminator,
                b"SM" => self.state = State::Symbol,
                b"PE" => self.state = State::Data,
                b"CO" => self.state = State::Comment(Comment::BEGUN),
                _ => {}
            }
        }
        Token::Code
    }
}

impl Default for Dialect {
    fn default() -> Self {
        Self::new()
    }
}

/// The terminator that `DT` and this byte choose. Line ends, zero and ESC cannot end a label.
pub(super) fn terminator(byte: u8) -> u8 {
    match byte {
        b';' | b'\n' | b'\r' | 0 | ESCAPE | DAMAGED => LABEL_END,
        byte => byte,
    }
}

/// Whether an instruction with this name takes names in quotation marks.
pub(super) fn takes_name(name: [u8; 2]) -> bool {
    matches!(&name, b"BP" | b"MG")
}

/// Whether labels end with ETX again from an instruction with this name on, whatever follows it.
pub(super) fn resets_terminator(name: [u8; 2]) -> bool {
    matches!(&name, b"IN" | b"DF")
}

/// Whether the instruction to the interface with this letter has parameters and ends with a colon.
pub(super) fn has_parameters(letter: u8) -> bool {
    matches!(letter, b'@' | b'H' | b'I' | b'M' | b'N' | b'P' | b'Q' | b'T')
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    /// The kinds of the bytes, one letter for each.
    fn kinds(bytes: &[u8]) -> String {
        let mut dialect = Dialect::new();
        let letter = |token| match token {
            Token::Line => 'l',
            Token::Begins(_) => 'B',
            Token::Code => 'c',
            Token::Text => 't',
            Token::Control => 'e',
            Token::Leaves => 'L',
        };
        bytes.iter().map(|byte| letter(dialect.take(*byte))).collect()
    }

    #[test]
    fn it_begins_with_in_escape_or_the_command_at_the_beginning_of_a_line_only() {
        for (bytes, expected) in [
            (b"IN;PU;".as_slice(), "llBccc"),
            (b"G0\nIN\nPU", "lllllBcc"),
            (b" IN;SP1", "lllBccc"),
            (b"INSIDE;\nIN\rPU", "llllllllllBcc"),
            (b"\x1B.(IN;", "lBeccc"),
            (b"\x1B.I81;;17:PU", "lBeeeeeeeecc"),
            (b"\x1B%0BPU", "lBeecc"),
            (b"$hpgl\r\nPU", "lllllBccc"),
            (b"(IN;)\n", "llllll"),
            (b"xIN;\n", "lllll"),
            (b"INK\n", "llll"),
            (b"in;\n", "llll"),
            (b"IN3\n", "llll"),
            (b"$hpg\n", "lllll"),
            (b"\xFFIN;\nIN;", "lllllllB"),
            // Before `IN;` there may be what ends an instruction or a label.
            (b";IN;SP1", "lllBccc"),
            (b"\x03IN;PU", "lllBcc"),
            (b" ;;\x03IN;PU", "llllllBcc"),
            // These are comments of G-code.
            (b";IN\n;PU", "lllllll"),
            (b";INTRO;\n", "llllllll"),
            (b";in;\n", "lllll"),
            (b"; IN;\n", "llllll"),
            (b";IIN;\n", "llllll"),
            (b";$hpgl\nPU", "lllllllll"),
        ] {
            assert_eq!(kinds(bytes), expected, "{}", bytes.escape_ascii());
        }
    }

    #[test]
    fn it_ends_with_a_dollar_at_the_beginning_of_a_line_outside_of_text_only() {
        for (bytes, expected) in [
            (b"IN;\n$$\n".as_slice(), "llBcLll"),
            (b"IN;$$\n", "llBccc"),
            (b"IN;LB\n$X\x03\n$", "llBccttttcL"),
            (b"IN;DT$;LBa\n$\n$", "llBcctccctttcL"),
            (b"IN;SM\n$", "llBcctc"),
            (b"IN;PE\n$;\n$", "llBcctttcL"),
        ] {
            assert_eq!(kinds(bytes), expected, "{}", bytes.escape_ascii());
        }
    }

    #[test]
    fn text_ends_where_the_interpreter_ends_it() {
        assert_eq!(kinds(b"IN;LBa?\x03PU"), "llBcctttcc");
        assert_eq!(kinds(b"IN;DT#LBa\x03#PU"), "llBcctcctttcc");
        assert_eq!(kinds(b"IN;DT#IN;LBa#\x03PU"), "llBcctccccctttcc");
        assert_eq!(kinds(b"IN;LBa\x1B.Bb\x03PU"), "llBccteeettcc");
        assert_eq!(kinds(b"IN;LBa\x1B.KPU"), "llBccteeecc");
        assert_eq!(kinds(b"IN;BP1,\"LB\"PU"), "llBccccctttcc");
        assert_eq!(kinds(b"IN;MG\"LB\x1B.KPU"), "llBccctteeecc");
        assert_eq!(kinds(b"IN;BP\x1B.K\"PU"), "llBcceeeccc");
        assert_eq!(kinds(b"IN;MG\"\n$"), "llBccctL");
        assert_eq!(kinds(b"\x1B%-12345X@PJL?\r\n$"), "lBeeeeeeectttttcL");
        assert_eq!(kinds(b"IN;@LB\x1B.KPU"), "llBctteeecc");
    }
}
