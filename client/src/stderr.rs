//! What the program says at standard error, where a terminal may show a progress bar.

use std::io::{self, IsTerminal as _, Write as _};

/// Writes a line to standard error. In a terminal it takes the place of the progress bar. A closed
/// standard error is no reason to fail.
pub fn say(text: &str) {
    let mut stderr = io::stderr();
    let clear = if stderr.is_terminal() { "\r\x1b[2K" } else { "" };
    let _ = writeln!(stderr, "{clear}{text}");
}
