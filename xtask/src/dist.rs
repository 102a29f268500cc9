//! Puts everything that a user needs who has no compiler into one folder.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::command::{cargo, describe, run};
use crate::table::BOARDS;
use crate::{firmware, page};

/// The shells for which the client writes completions, and the names of these files.
const COMPLETIONS: [(&str, &str); 5] = [
    ("bash", "penup.bash"),
    ("elvish", "penup.elv"),
    ("fish", "penup.fish"),
    ("powershell", "_penup.ps1"),
    ("zsh", "_penup"),
];

/// Builds the client for this computer, the page that it serves, and the images of all boards that
/// can be flashed. Puts them into a folder of `target/dist` that can be copied to a computer
/// of the same kind, with the manual pages, the completions and the licences.
///
/// # Errors
/// Something cannot be built or written.
pub fn dist() -> Result<()> {
    let name = concat!("target/dist/penup-", env!("CARGO_PKG_VERSION"));
    let folder = crate::root().join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).with_context(|| format!("cannot empty {name}"))?;
    }
    fs::create_dir_all(folder.join("completions"))?;
    for board in BOARDS.into_iter().filter(|board| board.flashing.is_some()) {
        say!("penup: building the firmware of the {} board", board.name)?;
        let image = firmware::build(board)?;
        say!("{}", firmware::check(board, &image)?)?;
        for extension in ["elf", "uf2"] {
            let to = folder.join(format!("penup-{}.{extension}", board.name));
            fs::copy(image.with_extension(extension), to)?;
        }
    }
    say!("penup: building the page and the client, which takes some minutes the first time")?;
    page::build()?;
    copy_all(&page::folder(), &folder.join("page"))?;
    let mut client = cargo();
    run(client.current_dir(crate::root()).args(["build", "--release", "-p", "penup-client"]))?;
    let program = format!("penup{}", std::env::consts::EXE_SUFFIX);
    let built = crate::root().join("target/release").join(&program);
    fs::copy(built, folder.join(&program)).with_context(|| format!("cannot copy {program}"))?;
    let program = folder.join(program);
    run(Command::new(&program).args(["--quiet", "man"]).arg(folder.join("man")))?;
    for (shell, file) in COMPLETIONS {
        write_output(&program, &["completions", shell], &folder.join("completions").join(file))?;
    }
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        fs::copy(crate::root().join(licence), folder.join(licence))?;
    }
    say!("penup: {name} has all that a computer of this kind needs without a compiler")
}

/// Writes what a program prints to a file.
fn write_output(program: &Path, arguments: &[&str], file: &Path) -> Result<()> {
    let output = fs::File::create(file)?;
    let mut command = Command::new(program);
    let status = command.args(arguments).stdout(Stdio::from(output)).status()?;
    ensure!(status.success(), "{}: {status}", describe(&command));
    Ok(())
}

/// Copies a folder with all that is in it.
fn copy_all(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_all(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}
