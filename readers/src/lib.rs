//! Reads the files that a job can draw: bytes in, lines to send out.
//!
//! Each file format is one module here and one row of `FORMATS`. It turns the contents of a file
//! into the lines that are sent to a plotter; everything else works on these [`Lines`], whatever
//! file they come from. [`words`] says in the terms of the command line why one is refused.
//!
//! Nothing here opens a file, starts a thread, or prints. So the readers serve the client and, in
//! WebAssembly, the page. A format that the page only loads when it is needed is a feature: `dxf`,
//! `gcode`, `hpgl`, `ply`, `svg`, `tape`; `svgz` is that of compressed SVG files, and `text` that
//! of fonts for their texts.
//!
//! The extension of a file's name decides its format. Where no format has that extension, or more
//! than one has, the content decides. A file of no known format is refused with a list of those
//! that are read, or with what it is, if that is known; and so is one that is empty, that is no
//! text where its format is, or of 4 GiB or more.

mod arrange;
#[cfg(feature = "dxf")]
mod dxf;
mod error;
mod flat;
pub mod files;
pub mod fonts;
mod foreign;
mod format;
#[cfg(feature = "gcode")]
mod gcode;
#[cfg(feature = "hpgl")]
mod hpgl;
pub mod lines;
mod mesh;
mod obj;
pub mod page;
mod plan;
#[cfg(feature = "ply")]
mod ply;
mod region;
mod stl;
#[cfg(feature = "svg")]
mod svg;
#[cfg(feature = "tape")]
mod tape;
pub mod words;

pub use arrange::{Arrangement, PLAN_OPTIONS, PlanOption, Turn, sine_cosine};
pub use error::ReadError;
pub use format::SIZE_LIMIT;
#[cfg(feature = "tape")]
pub use tape::end_note;

use crate::lines::{JobLine, Lines, Origin, extent};
use crate::page::{A4, Page};
use crate::plan::Plan;
use format::{Body, Contents, Format};
use penup::board_table::BOARDS;
use std::path::Path;

/// Every format that is read.
static FORMATS: &[&dyn Format] = &[
    &obj::Obj,
    #[cfg(feature = "svg")]
    &svg::Svg,
    &stl::Stl,
    #[cfg(feature = "ply")]
    &ply::Ply,
    #[cfg(feature = "gcode")]
    &gcode::GCode,
    #[cfg(feature = "hpgl")]
    &hpgl::HpGl,
    #[cfg(feature = "dxf")]
    &dxf::Dxf,
    #[cfg(feature = "tape")]
    &tape::Tape,
];

/// The number of bytes by which a format is recognised.
pub const BEGINNING: usize = 1 << 16;

/// A file whose every line has been checked.
#[derive(Debug)]
pub struct SourceFile {
    size: usize,
    lines: Box<dyn Lines + Send>,
    own_page: Option<Page>,
    sheet: Page,
    bounds: Option<[[f64; 2]; 2]>,
    notes: Vec<String>,
}

impl SourceFile {
    /// Checks `bytes`, the contents of a file called `name`, which is drawn as it is.
    ///
    /// A nested file may take much stack: see [`takes_deep_stack`].
    ///
    /// # Errors
    /// The format is unknown, or the file contains something that no plotter accepts.
    pub fn new(name: String, bytes: Vec<u8>) -> Result<Self, ReadError> {
        // A program that only calls this function does not contain the code that arranges plans.
        let (size, contents) = read(name, bytes, &Arrangement::default())?;
        let Contents { body, page, bounds, notes } = contents;
        Ok(match body {
            Body::Plan(plan) => Self::of_plan(size, plan, page, page.unwrap_or(A4), notes),
            Body::Lines(lines) => {
                let sheet = page.unwrap_or(A4);
                Self { size, lines, own_page: page, sheet, bounds, notes }
            }
        })
    }

    /// Checks `bytes`, the contents of a file called `name`, and arranges its plan.
    ///
    /// A nested file may take much stack: see [`takes_deep_stack`].
    ///
    /// # Errors
    /// The format is unknown, the file contains something that no plotter accepts, or it cannot be
    /// arranged so.
    pub fn arranged(
        name: String,
        bytes: Vec<u8>,
        arrangement: &Arrangement,
    ) -> Result<Self, ReadError> {
        let refused = |reason| ReadError::Content { file: name.clone(), reason };
        let (size, contents) = read(name.clone(), bytes, arrangement)?;
        let Contents { body, page, bounds, mut notes } = contents;
        let mut plan = match (body, arrangement.first_given()) {
            (Body::Plan(plan), _) => plan,
            (Body::Lines(lines), None) => {
                let sheet = arrangement.sheet(page, bounds);
                return Ok(Self { size, lines, own_page: page, sheet, bounds, notes });
            }
            (Body::Lines(lines), Some(option)) => {
                plan::of_lines(&name, lines.as_ref()).map_err(|reason| {
                    refused(format!(
                        "{option} is for drawings of straight lines at one height, and this file \
                         {reason}"
                    ))
                })?
            }
        };
        let sheet = arrangement.arrange(&mut plan, page, &mut notes).map_err(refused)?;
        // Areas are for the arrangement only. A plan that was made small may lie far off.
        plan.areas = None;
        notes.extend(plan.brought_near());
        Ok(Self::of_plan(size, plan, page, sheet, notes))
    }

    fn of_plan(
        size: usize,
        plan: Plan,
        own_page: Option<Page>,
        sheet: Page,
        mut notes: Vec<String>,
    ) -> Self {
        let bounds = plan.bounds();
        let (lines, more) = plan.into_lines();
        notes.extend(more);
        Self { size, lines: Box::new(lines), own_page, sheet, bounds, notes }
    }

    /// The size of the file in bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The page on which the file lays its plan; `None` if the file has no page.
    pub fn page(&self) -> Option<Page> {
        self.own_page
    }

    /// The page on which the drawing is laid: that of the arrangement, or else the file's own, or
    /// else A4, turned as the arrangement says.
    pub fn sheet(&self) -> Page {
        self.sheet
    }

    /// The least and the greatest x and y of the plan, in mm; `None` if that is not known.
    pub fn bounds(&self) -> Option<[[f64; 2]; 2]> {
        self.bounds
    }

    /// The least and the greatest x, y and z of the vertices; `None` if there are none.
    pub fn extent(&self) -> Option<[[f64; 3]; 2]> {
        extent(self)
    }

    /// What the user should know about the file: sentences without a full stop, each about
    /// something that is not drawn as the file says.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl Lines for SourceFile {
    fn count(&self) -> usize {
        self.lines.count()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        self.lines.line(index)
    }

    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        self.lines.in_order()
    }
}

/// Checks that a file called `name` which begins with these bytes, its first [`BEGINNING`] or all,
/// is of a format that is read. So a large file of another kind is refused before the rest is read.
///
/// # Errors
/// The format is unknown.
pub fn check_beginning(name: &str, beginning: &[u8]) -> Result<(), ReadError> {
    find(name, beginning).map(drop)
}

/// Reads `bytes`, the contents of a file called `name`. Returns their number, too.
fn read(
    name: String,
    bytes: Vec<u8>,
    arrangement: &Arrangement,
) -> Result<(usize, Contents), ReadError> {
    let format = find(&name, &bytes)?;
    let size = bytes.len();
    if size as u64 >= SIZE_LIMIT {
        return Err(ReadError::TooLarge { file: name });
    }
    if size == 0 {
        return Err(ReadError::Content { file: name, reason: "the file is empty".to_owned() });
    }
    if !format.may_be_binary(&bytes) && foreign::is_binary(&bytes) {
        let origin = Origin { file: name, line: 1, text: String::new() };
        let error = ReadError::NotText { origin, kind: format.name() };
        return Err(error.of_other_format(other_format(format, &bytes)));
    }
    let other = other_format(format, &bytes);
    let contents = format.read(name, bytes, arrangement);
    Ok((size, contents.map_err(|error| error.of_other_format(other))?))
}

/// The format that the content of a file is of, if it is not `format`, which its name says.
fn other_format(format: &dyn Format, bytes: &[u8]) -> Option<&'static dyn Format> {
    let beginning = bytes.get(..BEGINNING).unwrap_or(bytes);
    if format.recognises(beginning) {
        return None;
    }
    FORMATS.iter().copied().find(|it| it.recognises(beginning))
}

/// Whether reading a file called `name` with these `bytes` may take up to 256 MiB of stack, because
/// what it holds is nested.
pub fn takes_deep_stack(name: &str, bytes: &[u8]) -> bool {
    find(name, bytes).is_ok_and(|format| format.nests())
}

/// Finds the format of the file called `name`, which begins with these `bytes`.
///
/// # Errors
/// The format is unknown.
fn find(name: &str, bytes: &[u8]) -> Result<&'static dyn Format, ReadError> {
    let beginning = bytes.get(..BEGINNING).unwrap_or(bytes);
    if let Some(reason) = foreign::refusal(beginning) {
        return Err(ReadError::Content { file: name.to_owned(), reason });
    }
    let extension = Path::new(name).extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    let has_extension = |format: &&dyn Format| format.extensions().contains(&extension.as_str());
    let mut named: Vec<&dyn Format> = FORMATS.iter().copied().filter(has_extension).collect();
    let recognises = |format: &&dyn Format| format.recognises(beginning);
    let found = match named.len() {
        1 => named.pop(),
        0 => FORMATS.iter().copied().find(recognises),
        _ => named.into_iter().find(recognises),
    };
    found.ok_or_else(|| unknown(name))
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
/// assert!(penup_readers::list().contains("Wavefront OBJ (.obj)"));
/// ```
pub fn list() -> String {
    described(", ", |format, extensions| format!("{} ({extensions})", format.name()))
}

/// The extensions of the files that are read, without the dot.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    extensions_of_formats().flatten().copied()
}

/// The extensions of the files of each format, without the dot: at least one for each.
pub fn extensions_of_formats() -> impl Iterator<Item = &'static [&'static str]> {
    FORMATS.iter().map(|format| format.extensions())
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
fn counted(number: usize, [one, many]: [&str; 2]) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Says how many points the drawing has if the memory of a plotter takes fewer, and what happens
/// then.
fn capacity(points: usize) -> Option<String> {
    let boards = BOARDS.iter().map(|board| (board.name, board.memory.vertices));
    let short: Vec<String> = boards
        .filter(|(_, limit)| *limit < points)
        .map(|(name, limit)| format!("{name} takes {limit}"))
        .collect();
    (!short.is_empty()).then(|| {
        let short = short.join(", ");
        format!(
            "the drawing has {points} points, and {short}: beyond that `penup plot` computes the \
             drawing itself and sends the strokes, and `penup fit` makes fewer points"
        )
    })
}

#[cfg(test)]
mod tests;
