//! Reads the file to draw from the disk, or from the standard input.

use crate::error::Error;
use fontdb::Database;
use penup_readers::files::Files;
use penup_readers::fonts::Fonts;
use penup_readers::{
    Arrangement, BEGINNING, ReadError, SIZE_LIMIT, SourceFile, check_beginning, takes_deep_stack,
};
use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::Path;
use std::thread;

/// The name that stands for the standard input.
pub const STANDARD_INPUT: &str = "-";

/// What the standard input is called in messages.
const STANDARD_NAME: &str = "the standard input";

/// Whether `path` stands for the standard input.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT
}

/// What the file at `path` is called in messages.
pub fn name(path: &Path) -> String {
    if is_standard(path) { STANDARD_NAME.to_owned() } else { path.display().to_string() }
}

/// Reads all bytes of the file at `path`, or of the standard input if that is `-`.
///
/// # Errors
/// The file cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>, Error> {
    bytes_up_to(path, SIZE_LIMIT)
}

/// Reads the first bytes, `most` of them, of the file at `path`, or of the standard input if that
/// is `-`.
///
/// # Errors
/// The file cannot be read.
pub fn bytes_up_to(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let read = match is_standard(path) {
        true => io::stdin().lock().take(most).read_to_end(&mut bytes),
        false => File::open(path).and_then(|file| file.take(most).read_to_end(&mut bytes)),
    };
    read.map_err(|source| Error::File { file: name(path), source })?;
    Ok(bytes)
}

/// The size in bytes of the stack on which a file that may be nested is read.
const STACK: usize = 256 << 20;

/// Reads the file at `path`, or the standard input if that is `-`, checks its lines, and arranges
/// its plan.
///
/// # Errors
/// The file cannot be read, its format is unknown, or it contains something that no plotter
/// accepts.
pub fn read(path: &Path, arrangement: &Arrangement) -> Result<SourceFile, Error> {
    if is_standard(path) {
        return Ok(parse(name(path), bytes(path)?, arrangement)?);
    }
    let name = name(path);
    let unreadable = |source| Error::File { file: name.clone(), source };
    let (mut file, about) = open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.by_ref().take(BEGINNING as u64).read_to_end(&mut bytes).map_err(unreadable)?;
    // A file of no known format is refused before the rest of it is read.
    check_beginning(&name, &bytes)?;
    if about.len() < SIZE_LIMIT {
        // One more byte is reserved, so that the buffer does not grow only to detect the end of
        // the file.
        bytes.reserve_exact((about.len() as usize + 1).saturating_sub(bytes.len()));
    }
    let rest = SIZE_LIMIT - bytes.len() as u64;
    file.take(rest).read_to_end(&mut bytes).map_err(unreadable)?;
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let files = Files::read_by(move |path| referred(&folder, path));
    Ok(parse(name, bytes, &arrangement.clone().with_files(files))?)
}

/// The contents of the SVG to which a file in `folder` refers; `None` if there is none at this
/// path.
fn referred(folder: &Path, path: &str) -> Option<Vec<u8>> {
    let path = path.strip_prefix("file://").unwrap_or(path);
    let path = folder.join(without_percents(path)?);
    let is_svg = path.extension()?.eq_ignore_ascii_case("svg");
    if !is_svg {
        return None;
    }
    // A device or a pipe may have no end.
    let about = std::fs::metadata(&path).ok()?;
    if about.is_file() { std::fs::read(&path).ok() } else { None }
}

/// A path in which letters may stand as `%` and two hexadecimal digits; `None` if they are no
/// UTF-8.
fn without_percents(path: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = path.as_bytes();
    while let Some((byte, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|digits| std::str::from_utf8(digits).ok());
        let code = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        let code = code.filter(|_| *byte == b'%');
        bytes.push(code.unwrap_or(*byte));
        rest = if code.is_some() { after.get(2..)? } else { after };
    }
    String::from_utf8(bytes).ok()
}

/// Checks `bytes`, the contents of a file called `name`, and arranges its plan. A file that may be
/// nested is read on a stack of its own. A damaged one may make `usvg` panic, which ends that
/// thread only.
///
/// # Errors
/// The format is unknown, or the file contains something that no plotter accepts.
pub fn parse(
    name: String,
    bytes: Vec<u8>,
    arrangement: &Arrangement,
) -> Result<SourceFile, ReadError> {
    parse_or_panic(name.clone(), bytes, arrangement).unwrap_or_else(|_| {
        let reason = "this file cannot be read: simplify it, for example with Inkscape".to_owned();
        Err(ReadError::Content { file: name, reason })
    })
}

/// Does the same as [`parse`], but tells a panic on that stack of its own from a refusal: it is the
/// outer error.
///
/// # Errors
/// The inner error is that of [`parse`].
pub fn parse_or_panic(
    name: String,
    bytes: Vec<u8>,
    arrangement: &Arrangement,
) -> thread::Result<Result<SourceFile, ReadError>> {
    let arrangement = arrangement.clone().with_fonts(Fonts::found_by(fonts_of_this_computer));
    if !takes_deep_stack(&name, &bytes) {
        return Ok(SourceFile::arranged(name, bytes, &arrangement));
    }
    let reader = thread::Builder::new().stack_size(STACK).spawn({
        let name = name.clone();
        move || SourceFile::arranged(name, bytes, &arrangement)
    });
    match reader {
        Ok(reader) => reader.join(),
        Err(error) => Ok(Err(ReadError::Content { file: name, reason: error.to_string() })),
    }
}

fn fonts_of_this_computer() -> Database {
    let mut fonts = Database::new();
    fonts.load_system_fonts();
    let installed = |names: &[&str]| {
        let is_there = |name: &&str| {
            let mut families = fonts.faces().flat_map(|face| &face.families);
            families.any(|(family, _)| family == name)
        };
        names.iter().copied().find(is_there).map(str::to_owned)
    };
    let [plain, serif, fixed] = [&SANS_SERIF[..], &SERIF, &MONOSPACE].map(installed);
    if let Some(family) = plain {
        fonts.set_sans_serif_family(family);
    }
    if let Some(family) = serif {
        fonts.set_serif_family(family);
    }
    if let Some(family) = fixed {
        fonts.set_monospace_family(family);
    }
    fonts
}

/// The families that serve as fonts without serifs, the first that is installed before the others.
const SANS_SERIF: [&str; 7] = [
    "Arial",
    "Helvetica",
    "Liberation Sans",
    "Nimbus Sans",
    "DejaVu Sans",
    "Noto Sans",
    "FreeSans",
];

/// The families that serve as fonts with serifs.
const SERIF: [&str; 7] = [
    "Times New Roman",
    "Times",
    "Liberation Serif",
    "Nimbus Roman",
    "DejaVu Serif",
    "Noto Serif",
    "FreeSerif",
];

/// The families that serve as fonts whose letters are equally wide.
const MONOSPACE: [&str; 7] = [
    "Courier New",
    "Courier",
    "Liberation Mono",
    "Nimbus Mono PS",
    "DejaVu Sans Mono",
    "Noto Sans Mono",
    "FreeMono",
];

fn open(path: &Path) -> io::Result<(File, Metadata)> {
    let file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    Ok((file, about))
}
