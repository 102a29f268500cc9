//! Draws solids that are larger than the memory of the emulated Raspberry Pi Pico.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::command::{cargo, run};
use crate::firmware;
use crate::set_up;
use crate::table::PICO;

/// Where the Stanford bunny is, of 35,947 vertices and 69,451 triangles. It is not stored here.
const BUNNY: &str = "https://raw.githubusercontent.com/alecjacobson/common-3d-test-models/master/\
                     data/stanford-bunny.obj";

/// Draws the Stanford bunny, which it fetches if there is no file.
pub fn bunny(file: Option<PathBuf>) -> Result<()> {
    let file = match file {
        Some(file) => fs::canonicalize(&file).with_context(|| file.display().to_string())?,
        None => fetched()?,
    };
    draw(&file)
}

/// Draws a mesh of 10,000 faces that is made there.
pub fn mesh() -> Result<()> {
    draw(Path::new("mesh"))
}

/// The bunny's file, which is fetched once.
fn fetched() -> Result<PathBuf> {
    let file = crate::root().join("target/models/stanford-bunny.obj");
    if !file.exists() {
        fs::create_dir_all(crate::root().join("target/models"))?;
        let part = file.with_extension("part");
        say!("penup: fetching {BUNNY}")?;
        let fetch = ["--fail", "--silent", "--show-error", "--location", "--max-time", "300"];
        run(Command::new("curl").args(fetch).arg("--output").arg(&part).arg(BUNNY)).with_context(
            || format!("fetch {BUNNY} in another way, and name the file: cargo xtask bunny FILE"),
        )?;
        fs::rename(part, &file)?;
    }
    Ok(file)
}

/// Builds the image and runs the example, which compares what the pins do with the host.
fn draw(model: &Path) -> Result<()> {
    set_up::emulator(&PICO)?;
    firmware::check(&PICO, &firmware::build(&PICO)?)?;
    let program = ["--package", "penup-host-tests", "--example", "large_model", "--"];
    run(cargo()
        .current_dir(crate::root())
        .args(["run", "--quiet", "--release"])
        .args(program)
        .arg(model))
}
