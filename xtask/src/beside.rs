//! Measures penup beside other programs that do the same.

use anyhow::Result;

use crate::command::{cargo, run};
use crate::python;

/// The programs by the names that the example `beside` gives them, and their packages.
const PROGRAMS: [(&str, &str); 2] =
    [("open-cascade", "cadquery-ocp==8.0.1"), ("vpype", "vpype==1.15.0")];

/// Installs the programs into `target/beside`, and prints tables of times beside theirs. One that
/// cannot be installed is skipped by name.
///
/// # Errors
/// The example cannot be built, or it fails.
pub fn compare() -> Result<()> {
    let mut example = cargo();
    let program = ["--package", "penup-host-tests", "--example", "beside", "--"];
    example.current_dir(crate::root()).args(["run", "--quiet", "--release"]).args(program);
    for (name, package) in PROGRAMS {
        let folder = crate::root().join("target/beside").join(name);
        match python::install(name, &folder, &[package], None, || Ok(())) {
            Ok(interpreter) => {
                example.arg(format!("{name}={}", interpreter.display()));
            }
            Err(reason) => say!("penup: {name} is skipped: {reason:#}")?,
        }
    }
    // The other programs use one core, too.
    run(example.env("RAYON_NUM_THREADS", "1"))
}
