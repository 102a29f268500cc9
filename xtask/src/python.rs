//! Programs from PyPI, each in a virtual environment of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, ensure};

use crate::command::{output, run_within};

/// How long an installation may take.
const INSTALL_LIMIT: Duration = Duration::from_secs(600);

/// Makes a virtual environment with these packages in the directory `python` of `folder`, unless
/// this was done before. `more` installs what else belongs to the program into `folder`; `wanted`
/// names that. Returns the interpreter.
///
/// # Errors
/// There is no Python, or something cannot be installed.
pub fn install(
    name: &str,
    folder: &Path,
    packages: &[&str],
    wanted: Option<&str>,
    more: impl FnOnce() -> Result<()>,
) -> Result<PathBuf> {
    let environment = folder.join("python");
    let interpreter = environment.join("bin/python");
    let wanted = packages.iter().copied().chain(wanted).collect::<Vec<_>>().join("\n");
    // This file is written last, so if it is right, the installation is complete.
    let done = folder.join("installed");
    if fs::read_to_string(&done).is_ok_and(|found| found == wanted) {
        return Ok(interpreter);
    }
    ensure!(output("python3", &["--version"]).is_some(), "there is no python3");
    say!("penup: installing {name} into {}", folder.display())?;
    fs::create_dir_all(folder)?;
    let mut python = Command::new("python3");
    run_within(INSTALL_LIMIT, python.args(["-m", "venv", "--clear"]).arg(&environment))?;
    let mut pip = Command::new(environment.join("bin/pip"));
    pip.args(["install", "--quiet", "--disable-pip-version-check"]).args(packages);
    run_within(INSTALL_LIMIT, &mut pip)?;
    more()?;
    fs::write(done, wanted)?;
    Ok(interpreter)
}
