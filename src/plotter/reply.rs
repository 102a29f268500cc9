//! Lines that go back to the user.

use super::Board;
use crate::fixed::BinaryFraction;
use crate::machine::Value;
use crate::protocol::Refusal;
use core::fmt::{self, Write};

/// Writes whole lines to the board's serial line.
pub(super) struct Reply<'b, B: Board + ?Sized>(pub &'b mut B);

impl<B: Board + ?Sized> Reply<'_, B> {
    /// One line.
    pub fn line(&mut self, arguments: fmt::Arguments<'_>) {
        self.part(arguments);
        self.0.write(b"\r\n");
    }

    /// A part of a line.
    pub fn part(&mut self, arguments: fmt::Arguments<'_>) {
        // The serial line blocks and does not fail.
        let _ = self.write_fmt(arguments);
    }

    /// The position as Grbl's status report gives it, in mm.
    pub fn position(&mut self, position: [Value; 2]) {
        let [x, y] = position.map(|mm| BinaryFraction {
            units: mm.to_bits().into(),
            fraction_bits: 16,
            places: 3,
        });
        self.part(format_args!("|MPos:{x},{y},0.000"));
    }

    /// The reply that every line gets: `ok`, or why not and `error:N`.
    pub fn outcome(&mut self, outcome: Result<(), Refusal>) {
        match outcome {
            Ok(()) => self.line(format_args!("ok")),
            Err(refusal) => {
                self.line(format_args!("[MSG:{refusal}]"));
                self.line(format_args!("error:{}", refusal.number()));
            }
        }
    }
}

impl<B: Board + ?Sized> Write for Reply<'_, B> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}
