//! Results into files, whole or not at all.

use crate::error::Error;
use crate::interrupt::while_unfinished;
use std::fs;
use std::io;
use std::path::Path;

/// Writes `bytes` to `path`. An older file stays as it was until the new one is complete.
///
/// What is no ordinary file, such as `/dev/stdout`, is written directly.
///
/// # Errors
/// What the system says, with the file's name.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let result = match fs::metadata(path) {
        Ok(there) if !there.is_file() => fs::write(path, bytes),
        _ => write_beside(path, bytes),
    };
    result.map_err(|source| Error::Write { file: path.display().to_string(), source })
}

fn write_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut unfinished = name.to_owned();
    unfinished.push(format!(".{}.part", std::process::id()));
    let unfinished = path.with_file_name(unfinished);
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
