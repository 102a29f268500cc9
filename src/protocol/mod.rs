//! The serial protocol: from bytes to lines, from lines to typed commands, and the errors that
//! replies name.
//!
//! The framing is that of Grbl 1.1, for which senders exist: a greeting, one `ok` or `error:N` for
//! each line, and single bytes (`?`, `!`, `~`, ctrl-X and others) that act at once. A
//! [`LineReader`] makes lines from bytes, and [`Command::parse`] makes a typed command from a line.
//! A [`CommandError`] says why a line was not carried out. Anything that is not a command is
//! refused with a number and the reason. Nothing here changes the state of the plotter.

mod alarm;
mod block_error;
mod command;
mod edit;
mod escape;
mod gcode;
mod line;
mod numbering;
mod realtime;
mod receiver;
#[cfg(feature = "stream")]
mod streamed;
mod command_error;
mod values;

pub use alarm::AlarmEntry;
#[cfg(any(test, feature = "host"))]
pub use alarm::alarm_entries;
pub use block_error::BlockError;
pub(crate) use command::meaning;
pub use command::{Command, HELP};
pub use command_error::{CommandError, ErrorEntry};
#[cfg(feature = "tiles")]
pub use command_error::{Crowd, StoredModelError};
#[cfg(any(test, feature = "host"))]
pub use command_error::{error_entries, error_samples};
pub use escape::{Escape, EscapedText};
pub use gcode::{GCode, Word};
pub(crate) use gcode::{Significant, next_number};
pub use line::{LINE_LIMIT, LineReader};
pub use numbering::{Checksum, Label, Named, Numbering, Received};
pub use realtime::{RealTime, Sorter};
pub use receiver::{DAMAGED, Receiver};
#[cfg(all(feature = "stream", any(test, feature = "host")))]
pub use streamed::StrokeWriter;
#[cfg(feature = "stream")]
pub use streamed::{MOST_TARGETS, STROKES_KEYWORD, StreamHeader, StreamedTarget, StreamedTargets};
pub use values::{Decimals, Numbers};
pub(crate) use values::{PENS, choice, length, number, numbers, positive, trim, whole};
