//! Repeats Harrison's experiments with the pen-up problem.

use anyhow::Result;

use crate::command::{cargo, run};

/// Prints each table of Harrison's chapter 7, with new measurements beside his seconds. They are
/// counted in instructions if valgrind is installed. This takes a minute or two.
pub fn repeat() -> Result<()> {
    let program = ["--package", "penup-host-tests", "--example", "experiments"];
    run(cargo().args(["run", "--quiet", "--release"]).args(program))
}
