//! Reads the files that a job can draw.
//!
//! Each file format is one module here and one row of `FORMATS`. It turns the contents of a file
//! into the lines that are sent to a plotter; everything else in the client works on these
//! [`Lines`], whatever file they come from.
//!
//! The extension of a file's name decides its format. Where no format has that extension, or more
//! than one has, the content decides. A file of no known format is refused with a list of those
//! that are read, and so is a file of 4 GiB or more.

mod error;
mod format;
#[cfg(feature = "native")]
mod gcode;
#[cfg(feature = "native")]
mod hpgl;
#[cfg(feature = "native")]
mod mesh;
mod obj;
#[cfg(feature = "native")]
mod plan;
#[cfg(feature = "native")]
mod ply;
#[cfg(feature = "native")]
mod stl;
#[cfg(feature = "native")]
mod svg;
#[cfg(feature = "native")]
mod tape;

pub use error::ReadError;

use crate::lines::{JobLine, Lines};
use crate::page::Page;
use format::{Contents, Format, SIZE_LIMIT};
#[cfg(feature = "native")]
use penup::board_table::BOARDS;
use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::Path;

/// Every format that is read.
static FORMATS: &[&dyn Format] = &[
    &obj::Obj,
    #[cfg(feature = "native")]
    &svg::Svg,
    #[cfg(feature = "native")]
    &stl::Stl,
    #[cfg(feature = "native")]
    &ply::Ply,
    #[cfg(feature = "native")]
    &gcode::GCode,
    #[cfg(feature = "native")]
    &hpgl::HpGl,
    #[cfg(feature = "native")]
    &tape::Tape,
];

/// The name that stands for the standard input.
pub const STANDARD_INPUT: &str = "-";

/// The number of bytes by which a format is recognised.
const BEGINNING: u64 = 1 << 16;

/// A file whose every line has been checked.
#[derive(Debug)]
pub struct SourceFile {
    size: usize,
    contents: Contents,
}

impl SourceFile {
    /// Reads the file at `path`, or the standard input if that is `-`, and checks its lines.
    ///
    /// # Errors
    /// The file cannot be read, its format is unknown, or it contains something that no plotter
    /// accepts.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        if path.as_os_str() == STANDARD_INPUT {
            let name = "the standard input".to_owned();
            let mut bytes = Vec::new();
            let read = io::stdin().lock().take(SIZE_LIMIT).read_to_end(&mut bytes);
            read.map_err(|source| ReadError::File { file: name.clone(), source })?;
            return Self::new(name, bytes);
        }
        let name = path.display().to_string();
        let unreadable = |source| ReadError::File { file: name.clone(), source };
        let (mut file, about) = open(path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.by_ref().take(BEGINNING).read_to_end(&mut bytes).map_err(unreadable)?;
        // A file of no known format is refused before the rest of it is read.
        let format = find(path, &bytes).ok_or_else(|| unknown(&name))?;
        if about.len() < SIZE_LIMIT {
            // One more byte is reserved, so that the buffer does not grow only to detect the end of
            // the file.
            bytes.reserve_exact((about.len() as usize + 1).saturating_sub(bytes.len()));
        }
        let rest = SIZE_LIMIT - bytes.len() as u64;
        file.take(rest).read_to_end(&mut bytes).map_err(unreadable)?;
        Self::of(format, name, bytes)
    }

    /// Checks `bytes`, the contents of a file called `name`.
    ///
    /// # Errors
    /// The format is unknown, or the file contains something that no plotter accepts.
    pub fn new(name: String, bytes: Vec<u8>) -> Result<Self, ReadError> {
        let beginning = bytes.get(..BEGINNING as usize).unwrap_or(&bytes);
        let format = find(Path::new(&name), beginning).ok_or_else(|| unknown(&name))?;
        Self::of(format, name, bytes)
    }

    fn of(format: &dyn Format, name: String, bytes: Vec<u8>) -> Result<Self, ReadError> {
        let size = bytes.len();
        if size as u64 >= SIZE_LIMIT {
            return Err(ReadError::TooLarge { file: name });
        }
        Ok(Self { size, contents: format.read(name, bytes)? })
    }

    /// The size of the file in bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The page on which the file lays its plan; `None` if the file has no page.
    pub fn page(&self) -> Option<Page> {
        self.contents.page
    }

    /// The least and the greatest x and y of the plan, in mm; `None` if that is not known.
    pub fn bounds(&self) -> Option<[[f64; 2]; 2]> {
        self.contents.bounds
    }

    /// What the user should know about the file: sentences without a full stop, each about
    /// something that is not drawn as the file says.
    pub fn notes(&self) -> &[String] {
        &self.contents.notes
    }
}

impl Lines for SourceFile {
    fn count(&self) -> usize {
        self.contents.lines.count()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        self.contents.lines.line(index)
    }

    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        self.contents.lines.in_order()
    }
}

fn open(path: &Path) -> io::Result<(File, Metadata)> {
    let file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    Ok((file, about))
}

/// Finds the format of the file at `path`, which has this `beginning`.
fn find(path: &Path, beginning: &[u8]) -> Option<&'static dyn Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let has_extension = |format: &&dyn Format| format.extensions().contains(&extension.as_str());
    let mut named: Vec<&dyn Format> = FORMATS.iter().copied().filter(has_extension).collect();
    match named.len() {
        1 => named.pop(),
        0 => FORMATS.iter().copied().find(|format| format.recognises(beginning)),
        _ => named.into_iter().find(|format| format.recognises(beginning)),
    }
}

fn unknown(name: &str) -> ReadError {
    let formats = described("; ", |format, extensions| {
        format!("{} files, whose names end in {extensions}", format.name())
    });
    ReadError::Unknown { file: name.to_owned(), formats }
}

/// Lists the formats that are read, with their extensions, for the help of the command line.
///
/// ```
/// assert!(penup_client::formats::list().contains("Wavefront OBJ (.obj)"));
/// ```
pub fn list() -> String {
    described(", ", |format, extensions| format!("{} ({extensions})", format.name()))
}

/// The extensions of the files that are read, without the dot.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().flat_map(|format| format.extensions()).copied()
}

/// Describes each format by `describe`, which is given the format and the list of its extensions.
fn described(separator: &str, describe: impl Fn(&dyn Format, &str) -> String) -> String {
    let described = |format: &&dyn Format| {
        let extensions: Vec<String> =
            format.extensions().iter().map(|extension| format!(".{extension}")).collect();
        describe(*format, &extensions.join(" or "))
    };
    FORMATS.iter().map(described).collect::<Vec<_>>().join(separator)
}

/// A number with a noun and a verb.
#[cfg(feature = "native")]
fn counted(number: usize, [one, many]: [&str; 2]) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Says how many points the drawing has if a plotter takes fewer.
#[cfg(feature = "native")]
fn capacity(points: usize) -> Option<String> {
    let boards = BOARDS.iter().map(|board| (board.name, board.memory.vertices));
    let short: Vec<String> = boards
        .filter(|(_, limit)| *limit < points)
        .map(|(name, limit)| format!("{name} takes {limit}"))
        .collect();
    (!short.is_empty()).then(|| {
        let short = short.join(", ");
        format!("the drawing has {points} points, and {short}: `penup fit` makes fewer of them")
    })
}

#[cfg(test)]
mod tests;
