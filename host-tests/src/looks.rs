//! The bounds of the time between two looks of the main loop at what is asked in real time.

use penup_client::emulator::CallGaps;
use std::time::Duration;

const DOCUMENT: &str = include_str!("../../docs/reliability.md");

/// The time that the document allows for a row.
fn allowed(row: &str) -> Duration {
    let line = DOCUMENT.lines().find(|line| line.starts_with(&format!("| {row} |")));
    let bound = line.and_then(|line| line.trim_end_matches(" |").rsplit("| ").next());
    let milliseconds = bound.and_then(|bound| bound.replace(',', "").parse().ok());
    Duration::from_millis(milliseconds.expect("the document has the row"))
}

/// The row of the document for all input but that of [`ALL_AT_ONCE`].
pub const ANY: &str = "between two looks";
/// The row for commands that read a whole model or job at once.
pub const ALL_AT_ONCE: &str = "between two looks, `$model`, `$again` and `$resume`";

/// The row for the heaviest jobs, while they are computed.
pub const COMPUTED: &str = "between two looks, while a job is computed";
/// The row for changes of all vertices of a model.
pub const EDITS: &str = "between two looks, changes of a whole model";
/// The row for arcs that become points of a polygon of HP-GL.
pub const POLYGONS: &str = "between two looks, arcs in polygons of HP-GL";

/// Checks that the main loop has looked as often in a job as the document says in this row.
///
/// # Panics
/// It has not.
pub fn assert_bounded(row: &str, job: &str, CallGaps { longest, longest_for_flash }: CallGaps) {
    println!("{job}: {longest:?}, {longest_for_flash:?} while flash was changed");
    assert!(longest <= allowed(row), "{job}: {longest:?}");
    let for_flash = allowed("between two looks, flash being changed");
    assert!(longest_for_flash <= for_flash, "{job}: {longest_for_flash:?}");
}
