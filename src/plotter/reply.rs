//! The replies to the user, written to the board as lines.
//!
//! Numbers of 16 bits are formatted as `u32`, because each type whose formatting a board stores
//! takes some 160 bytes of its flash.

use super::Board;
use super::grbl::coordinate;
use crate::array::MapEach;
use crate::checksum::CRC_16;
use crate::machine::Value;
use crate::protocol::{Checksum, CommandError, Label, Named};
use core::fmt::{self, Write};

/// Writes replies to the serial line of a board, line by line.
pub(super) struct Reply<'b, B: Board + ?Sized>(pub &'b mut B);

impl<B: Board + ?Sized> Reply<'_, B> {
    /// Writes a line and its end.
    pub fn line(&mut self, arguments: fmt::Arguments<'_>) {
        self.part(arguments);
        self.0.write(b"\r\n");
    }

    /// Writes a part of a line. [`Reply::line`] writes the last part and the line's end.
    pub fn part(&mut self, arguments: fmt::Arguments<'_>) {
        // Writing to the serial line may block, but it does not fail.
        let _ = self.write_fmt(arguments);
    }

    /// Writes coordinates with commas between them.
    pub fn coordinates(&mut self, position: [Value; 3], inches: bool) {
        let [x, y, z] = position.map_each(|mm| coordinate(mm, inches));
        self.part(format_args!("{x},{y},{z}"));
    }

    /// Writes the reply that every line gets: `ok`, or the reason of a refusal and `error:N`. The
    /// reply names the number of a numbered line. If the label asks for it, a line with the
    /// expected number or the last number comes first.
    pub fn outcome(&mut self, outcome: Result<(), CommandError>, label: Label) {
        let Label { checksum, named } = label;
        let with_crc = checksum == Some(Checksum::Crc);
        if let Err(command_error) = outcome {
            // After a line with a CRC that must be resent, the reason is left out, so that the
            // sender gets the expected number sooner.
            let is_expected = matches!(named, Named::Expected(_));
            if !with_crc || !is_expected || matches!(command_error, CommandError::Unnumbered) {
                self.line(format_args!("[MSG:{command_error}]"));
            }
        }
        let number = match named {
            Named::Line(number) => Some(number),
            Named::Nothing => None,
            Named::Last(last) => {
                self.checked_line(format_args!("Line: {last}"), with_crc);
                None
            }
            Named::Expected(expected) => {
                self.checked_line(format_args!("Resend: {expected}"), with_crc);
                None
            }
        };
        let with_crc = with_crc && number.is_some();
        let number = Number(number);
        match outcome {
            Ok(()) => self.checked_line(format_args!("ok{number}"), with_crc),
            Err(command_error) => self.checked_line(
                format_args!("error:{}{number}", u32::from(command_error.number())),
                with_crc,
            ),
        }
    }

    /// Writes a line, followed by its CRC if `with_crc`.
    fn checked_line(&mut self, arguments: fmt::Arguments<'_>, with_crc: bool) {
        let mut digest = CRC_16.digest();
        let mut write = |text: &str| {
            digest.update(text.as_bytes());
            self.0.write(text.as_bytes());
        };
        // Writing to the serial line may block, but it does not fail.
        let _ = fmt::write(&mut PieceWriter(&mut write), arguments);
        let sum = digest.finalize();
        if with_crc { self.line(format_args!("*{sum:04X}")) } else { self.line(format_args!("")) }
    }
}

/// Hands formatted text on to a callback, piece by piece as it is formatted.
struct PieceWriter<'w>(&'w mut dyn FnMut(&str));

impl Write for PieceWriter<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        (self.0)(text);
        Ok(())
    }
}

/// The number of a line as a reply names it: ` N17` for the number 17, nothing for `None`.
struct Number(Option<i32>);

impl fmt::Display for Number {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |number| write!(formatter, " N{number}"))
    }
}

impl<B: Board + ?Sized> Write for Reply<'_, B> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}
