//! Bytes to lines to typed commands, and replies.
//!
//! The framing is that of Grbl 1.1, for which senders exist: a greeting, one `ok` or `error:N` for
//! each line, `?` `!` `~` ctrl-X and others acted on at once. A [`LineReader`] makes lines of bytes,
//! [`Command::parse`] makes a typed command of a line, a [`CommandError`] says why a line was not carried
//! out. Anything that is no command is refused with a number and the reason; nothing here changes
//! any state.

mod command;
mod edit;
mod escape;
mod gcode;
mod line;
mod numbering;
mod option;
mod receiver;
mod command_error;
mod values;

pub use command::{Command, HELP};
pub use command_error::{CommandError, MEANINGS};
pub use escape::{Escape, EscapedText};
pub use gcode::{GCode, Word};
pub use line::{LINE_LIMIT, LineReader, RealTime, Sorter};
pub use numbering::{Checksum, Label, Named, Numbering, Received};
pub use option::{HiddenLines, PlotOption, ProjectionChoice, VisibilityMode};
pub use receiver::{DAMAGED, Receiver};
pub use values::{Decimals, Numbers};
