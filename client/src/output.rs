//! Writes output files atomically: completely or not at all. `-` is the standard output; after that
//! the program says everything else on the standard error.

use crate::error::Error;
use crate::interrupt::while_unfinished;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf, is_separator};
use std::sync::atomic::{AtomicBool, Ordering};

/// Checks that all outputs can be written, before the work that produces them.
///
/// No two of the `outputs` may be the same file, and none may be the `input`, even under different
/// names. An ordinary output is tested by writing an empty file beside it, which is removed again.
///
/// # Errors
/// The first problem that is found, with the name of the file.
pub fn check(input: &Path, outputs: &[&Path]) -> Result<(), Error> {
    let input = identity(input);
    let is_input = |output: &&&Path| !is_standard(output) && identity(output) == input;
    if let Some(output) = outputs.iter().find(is_input) {
        return Err(Error::OutputIsInput { output: output.display().to_string() });
    }
    check_outputs(outputs)
}

/// Like [`check`], where no file is read.
///
/// # Errors
/// As [`check`].
pub fn check_outputs(outputs: &[&Path]) -> Result<(), Error> {
    let name = |path: &Path| path.display().to_string();
    for (index, output) in outputs.iter().enumerate() {
        let file = identity(output);
        if let Some(first) = outputs[..index].iter().find(|first| identity(first) == file) {
            return Err(Error::OutputTwice { first: name(first), second: name(output) });
        }
        try_to_write(output).map_err(|source| Error::Write { file: name(output), source })?;
    }
    Ok(())
}

/// The name that stands for the standard output.
pub const STANDARD_OUTPUT: &str = "-";

/// Whether a file was written to the standard output.
static STANDARD_HOLDS_A_FILE: AtomicBool = AtomicBool::new(false);

/// Whether a file was written to the standard output, where nothing else belongs then.
pub fn standard_holds_a_file() -> bool {
    STANDARD_HOLDS_A_FILE.load(Ordering::Relaxed)
}

/// Whether `path` stands for the standard output.
fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD_OUTPUT
}

/// The canonical path of a file, which need not exist yet.
fn identity(path: &Path) -> PathBuf {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}

/// Finds out, before any work, whether the file can be written.
fn try_to_write(path: &Path) -> io::Result<()> {
    if path.is_dir() || path.to_string_lossy().ends_with(is_separator) {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if is_standard(path) {
        return Ok(());
    }
    match fs::metadata(path) {
        // Pipes are not tested, because opening one would wait for its reader.
        Ok(there) if !there.is_file() => Ok(()),
        _ => {
            let unfinished = unfinished(path)?;
            while_unfinished(&unfinished, || {
                fs::write(&unfinished, []).and_then(|()| fs::remove_file(&unfinished))
            })
        }
    }
}

/// The temporary name of an output that is not complete yet.
fn unfinished(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut unfinished = name.to_owned();
    unfinished.push(format!(".{}.part", std::process::id()));
    Ok(path.with_file_name(unfinished))
}

/// Writes `bytes` to `path`. An existing file stays unchanged until the new one is complete.
///
/// A file that is not an ordinary one, such as `/dev/stdout`, is written directly.
///
/// # Errors
/// The operating system's error, with the name of the file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let result = match fs::metadata(path) {
        _ if is_standard(path) => {
            STANDARD_HOLDS_A_FILE.store(true, Ordering::Relaxed);
            let mut stdout = io::stdout().lock();
            match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
                // The reader of the pipe closed it early, as `head` does. This is no error.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                written => written,
            }
        }
        Ok(there) if !there.is_file() => fs::write(path, bytes),
        _ => write_beside(path, bytes),
    };
    result.map_err(|source| Error::Write { file: path.display().to_string(), source })
}

/// Writes a file under another name beside `path`, and renames it when it is complete.
fn write_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let unfinished = unfinished(path)?;
    let result = while_unfinished(&unfinished, || {
        fs::write(&unfinished, bytes).and_then(|()| fs::rename(&unfinished, path))
    });
    if result.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&unfinished);
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plot.svg");
        write(&path, b"old").expect("written");
        write(&path, b"new").expect("written");
        assert_eq!(fs::read(&path).expect("readable"), b"new");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("no/plot.svg");
        let error = write(&path, b"x").expect_err("no such folder");
        assert!(error.to_string().contains("no/plot.svg"), "{error}");
    }
}
