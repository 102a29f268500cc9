//! Writes output files atomically: completely or not at all. `-` and `/dev/stdout` are the standard
//! output; after that the program says everything else on the standard error. What a link leads to
//! is replaced, and the link stays.

use crate::error::Error;
use crate::interrupt::while_unfinished;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf, is_separator};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Checks that all outputs can be written, before the work that produces them.
///
/// No two of the `outputs` may be the same file, and none may be the `input`, even under different
/// names. An ordinary output is tested by an empty file, which is removed again: under the name of
/// the output, which the folder may refuse, or beside a file that is there.
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

/// The name that the system gives it. It may lead to an ordinary file, which the shell has opened.
const STANDARD_DEVICE: &str = "/dev/stdout";

/// The folder of what the system has opened, or opens in a way of its own.
const DEVICES: &str = "/dev";

/// Whether a file was written to the standard output.
static STANDARD_HOLDS_A_FILE: AtomicBool = AtomicBool::new(false);

/// Whether a file was written to the standard output, where nothing else belongs then.
pub fn standard_holds_a_file() -> bool {
    STANDARD_HOLDS_A_FILE.load(Ordering::Relaxed)
}

/// Whether `path` stands for the standard output.
fn is_standard(path: &Path) -> bool {
    [STANDARD_OUTPUT, STANDARD_DEVICE].into_iter().any(|name| path.as_os_str() == name)
}

/// The ways to write a file.
#[derive(Debug, PartialEq, Eq)]
enum Way {
    /// To the standard output.
    Standard,
    /// Directly: pipes and the like, and what a link leads to that is not there yet.
    Direct,
    /// Under another name beside this path first.
    Beside(PathBuf),
}

impl Way {
    fn to(path: &Path) -> Self {
        if is_standard(path) {
            return Self::Standard;
        }
        let is_ordinary = fs::metadata(path).map_or(!path.is_symlink(), |there| there.is_file());
        match is_ordinary && !path.starts_with(DEVICES) {
            true => Self::Beside(path.canonicalize().unwrap_or_else(|_| path.to_owned())),
            false => Self::Direct,
        }
    }
}

/// The canonical path of a file, which need not exist yet.
fn identity(path: &Path) -> PathBuf {
    if is_standard(path) {
        return PathBuf::from(STANDARD_OUTPUT);
    }
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
    match Way::to(path) {
        // Pipes are not tested, because opening one would wait for its reader.
        Way::Standard | Way::Direct => Ok(()),
        Way::Beside(path) => {
            let tried = if path.exists() { unfinished(&path) } else { path };
            while_unfinished(&tried, || {
                File::create_new(&tried).map(drop).and_then(|()| fs::remove_file(&tried))
            })
        }
    }
}

/// The temporary name of an output that is not complete yet. It is short, whatever the name of the
/// output, because a folder takes no longer name than that may be.
fn unfinished(path: &Path) -> PathBuf {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!("penup-{}-{number}.part", std::process::id()))
}

/// Writes `bytes` to `path`. An existing file stays unchanged until the new one is complete.
///
/// A file that is not an ordinary one, such as a pipe, is written directly.
///
/// # Errors
/// The operating system's error, with the name of the file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let result = match Way::to(path) {
        Way::Standard => {
            STANDARD_HOLDS_A_FILE.store(true, Ordering::Relaxed);
            let mut stdout = io::stdout().lock();
            match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
                // The reader of the pipe closed it early, as `head` does. This is no error.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                written => written,
            }
        }
        Way::Direct => fs::write(path, bytes),
        Way::Beside(path) => write_beside(&path, bytes),
    };
    result.map_err(|source| Error::Write { file: path.display().to_string(), source })
}

/// Writes a file under another name beside `path`, and renames it when it is complete.
fn write_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let unfinished = unfinished(path);
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
    fn each_name_that_a_folder_takes_is_written_and_a_longer_one_is_refused_before_the_work() {
        let folder = tempfile::tempdir().expect("a folder");
        for length in [1, 245, 246, 255] {
            let path = folder.path().join("n".repeat(length));
            for bytes in [b"old", b"new"] {
                check_outputs(&[&path]).expect("it can be written");
                write(&path, bytes).expect("written");
            }
            assert_eq!(fs::read(&path).expect("readable"), b"new", "{length}");
        }
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 4);
        let error = check_outputs(&[&folder.path().join("n".repeat(256))]).expect_err("too long");
        assert!(matches!(error, Error::Write { .. }), "{error}");
    }

    #[test]
    fn a_file_that_is_there_is_left_as_it_is_by_the_check() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plot.svg");
        fs::write(&path, b"old").expect("written");
        check_outputs(&[&path]).expect("it can be written");
        assert_eq!(fs::read(&path).expect("readable"), b"old");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_leads_to_the_new_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("out")).expect("created");
        fs::write(path("out/there.svg"), b"old").expect("written");
        for name in ["there.svg", "new.svg"] {
            std::os::unix::fs::symlink(Path::new("out").join(name), path(name)).expect("linked");
            check_outputs(&[&path(name)]).expect("it can be written");
            write(&path(name), b"drawing").expect("written");
            assert!(path(name).is_symlink(), "{name}");
            assert_eq!(fs::read(path("out").join(name)).expect("readable"), b"drawing", "{name}");
        }
        assert_eq!(fs::read_dir(path("out")).expect("listed").count(), 2);
    }

    #[test]
    fn the_standard_output_has_two_names() {
        assert_eq!(Way::to(Path::new("/dev/stdout")), Way::Standard);
        assert_eq!(Way::to(Path::new("/dev/stderr")), Way::Direct);
        let both = check_outputs(&[Path::new("-"), Path::new("/dev/stdout")]);
        let error = both.expect_err("one file").to_string();
        assert!(error.contains("are one file"), "{error}");
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("no/plot.svg");
        let error = write(&path, b"x").expect_err("no such folder");
        assert!(error.to_string().contains("no/plot.svg"), "{error}");
    }
}
