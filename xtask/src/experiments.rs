//! Harrison's experiments with the pen-up problem, repeated.

use anyhow::Result;

use crate::command::{cargo, run};

/// Measures (a minute or two) and prints each table of his chapter 7 beside his seconds, in instructions
/// if valgrind is installed.
pub fn repeat() -> Result<()> {
    let program = ["--package", "penup-host-tests", "--example", "experiments"];
    run(cargo().args(["run", "--quiet", "--release"]).args(program))
}
