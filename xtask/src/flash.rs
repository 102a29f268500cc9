//! The image onto the board: by a debug probe, or onto the drive that a Pico shows.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::command::{output, run};
use crate::firmware::{self, Board};

const CHIP: &str = "RP2040";
/// What a Pico in BOOTSEL mode has on its drive.
const DRIVE_MARK: &str = "INFO_UF2.TXT";

/// Builds the firmware and writes it: by probe-rs if it finds a probe, else onto the Pico's drive.
pub fn flash(board: Board) -> Result<()> {
    if board != Board::Pico {
        bail!("{} is emulated only: `cargo plot --board {}` runs it", board.name(), board.name());
    }
    let image = firmware::build(board)?;
    println!("{}", firmware::check(board, &image)?);
    let probes = output("probe-rs", &["list"]);
    if probes.as_ref().is_some_and(|list| list.lines().any(|line| line.trim().starts_with('['))) {
        return run(Command::new("probe-rs").args(["download", "--chip", CHIP]).arg(&image))
            .and_then(|()| run(Command::new("probe-rs").args(["reset", "--chip", CHIP])));
    }
    if let Some(drive) = drive() {
        println!("penup: copying the image to {}", drive.display());
        fs::copy(image.with_extension("uf2"), drive.join("penup.uf2"))
            .with_context(|| format!("cannot write to {}", drive.display()))?;
        return Ok(());
    }
    let probe = match probes {
        Some(_) => "probe-rs finds no probe",
        None => "probe-rs is not installed (it is needed for a debug probe only: https://probe.rs)",
    };
    bail!("no board is connected: {probe}, and no Pico shows its drive.\n{}", by_hand(&image))
}

/// What the user does without this program.
pub fn by_hand(image: &Path) -> String {
    format!(
        "To flash by hand: hold BOOTSEL on the Pico while you plug it in, then copy {} onto the drive \
         RPI-RP2 that appears.",
        image.with_extension("uf2").display()
    )
}

/// The drive of a Pico in BOOTSEL mode, where systems mount drives.
fn drive() -> Option<PathBuf> {
    let user = std::env::var("USER").unwrap_or_default();
    let places = [format!("/media/{user}"), format!("/run/media/{user}"), "/Volumes".to_owned()];
    places
        .iter()
        .filter_map(|place| fs::read_dir(place).ok())
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .find(|drive| drive.join(DRIVE_MARK).exists() && drive.ends_with("RPI-RP2"))
}
