//! Writes the image to a board: by a debug probe, or by copying it to the drive that its boot ROM
//! shows. A board on which penup runs is first asked to show this drive.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::command::{output, run};
use crate::firmware;
use crate::table::{BOARDS, BoardRow, Flashing};

/// The file that identifies the drive of a boot ROM.
const DRIVE_MARK: &str = "INFO_UF2.TXT";

/// The name of the first board that can be flashed.
pub fn default_board() -> &'static str {
    BOARDS.iter().find(|board| board.flashing.is_some()).map_or("", |board| board.name)
}

/// Builds the firmware and writes it to the board. If probe-rs finds a probe, that is used.
/// Otherwise the image is copied to the board's drive. If there is no drive yet, a running penup is
/// asked for it.
///
/// # Errors
/// The board is emulated only, no board is connected, or writing fails.
pub fn flash(board: &'static BoardRow) -> Result<()> {
    let Some(flashing) = board.flashing else {
        bail!("{0} is emulated only: `cargo plot --board {0}` runs it", board.name);
    };
    let Flashing { chip, drive: name, .. } = flashing;
    let image = firmware::build(board)?;
    say!("{}", firmware::check(board, &image)?)?;
    let probes = output("probe-rs", &["list"]);
    if probes.as_ref().is_some_and(|list| list.lines().any(|line| line.trim().starts_with('['))) {
        return run(Command::new("probe-rs").args(["download", "--chip", chip]).arg(&image))
            .and_then(|()| run(Command::new("probe-rs").args(["reset", "--chip", chip])));
    }
    if let Some(drive) = drive(name).or_else(|| touched_drive(flashing)) {
        say!("penup: copying the image to {}", drive.display())?;
        fs::copy(image.with_extension("uf2"), drive.join("penup.uf2"))
            .with_context(|| format!("cannot write to {}", drive.display()))?;
        return Ok(());
    }
    let probe = match probes {
        Some(_) => "probe-rs finds no probe",
        None => "probe-rs is not installed (it is needed for a debug probe only: https://probe.rs)",
    };
    bail!(
        "no board is connected: {probe}, and none shows its drive {name}.\n{}",
        by_hand(flashing, &image)
    )
}

/// Asks a board on which penup runs to show its drive. This opens its USB port at 1200 baud, closes
/// it, and waits some seconds for the drive.
fn touched_drive(flashing: Flashing) -> Option<PathBuf> {
    /// The pause between two looks for the drive; `LOOKS` is their number.
    const PAUSE: Duration = Duration::from_millis(250);
    /// How often the drive is looked for.
    const LOOKS: u32 = 40;
    let port = penup_port(flashing.port)?;
    say!("penup: asking the board at {} for its drive", port.display()).ok()?;
    // `stty` opens the port, sets the rate and closes it.
    let option = if cfg!(target_os = "macos") { "-f" } else { "-F" };
    output("stty", &[option, port.to_str()?, "1200", "hupcl"])?;
    (0..LOOKS).find_map(|_| {
        std::thread::sleep(PAUSE);
        drive(flashing.drive)
    })
}

/// The USB port of a board on which penup runs: on Linux the one with this in its name.
fn penup_port(name: &str) -> Option<PathBuf> {
    let by_id = entries("/dev/serial/by-id");
    let named = by_id.into_iter().find(|path| path.to_string_lossy().contains(name));
    // macOS does not show the device's name, so a port is accepted only if it is the only one.
    named.or_else(|| {
        let mut ports = entries("/dev");
        ports.retain(|path| path.to_string_lossy().starts_with("/dev/cu.usbmodem"));
        <[PathBuf; 1]>::try_from(ports).ok().map(|[port]| port)
    })
}

/// The paths of all entries of a directory.
fn entries(directory: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).collect()
}

/// Instructions for flashing `image` without this program.
pub fn by_hand(flashing: Flashing, image: &Path) -> String {
    format!(
        "To flash by hand: hold BOOTSEL on the board while you plug it in, then copy {} onto the \
         drive {} that appears.",
        image.with_extension("uf2").display(),
        flashing.drive
    )
}

/// The drive of this name, in the directories where operating systems mount drives.
fn drive(name: &str) -> Option<PathBuf> {
    let user = std::env::var("USER").unwrap_or_default();
    let directories =
        [format!("/media/{user}"), format!("/run/media/{user}"), "/Volumes".to_owned()];
    directories
        .iter()
        .filter_map(|directory| fs::read_dir(directory).ok())
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .find(|drive| drive.join(DRIVE_MARK).exists() && drive.ends_with(name))
}
