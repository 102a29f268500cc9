//! Lists the calls of panic functions in the boards' images.

use anyhow::Result;

use crate::command::{cargo, run};
use crate::firmware;
use crate::table::BOARDS;

/// Builds the images, and prints for each file of the project which panics its code can still
/// call. The test `panics` holds their number down.
pub fn list() -> Result<()> {
    for board in BOARDS {
        firmware::build(board)?;
    }
    let program = ["--package", "penup-host-tests", "--example", "panics"];
    run(cargo().args(["run", "--quiet"]).args(program))
}
