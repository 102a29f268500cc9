//! The errors of reading a file to draw. Each message also tells the user what to do about it.

use crate::format::Format;
use crate::lines::Origin;

/// The reason why a file is not drawn.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// Neither the name nor the content of the file tells a format that penup reads.
    #[error("{file}: penup reads {formats}")]
    Unknown {
        /// The path as the user wrote it.
        file: String,
        /// The formats that are read, as the end of a sentence.
        formats: String,
    },
    /// A line of the file cannot be drawn.
    #[error("{}:{}: {reason}\n    {}", origin.file, origin.line, origin.shown())]
    Line {
        /// The offending line.
        origin: Origin,
        /// What is wrong with it, and what the user can do about it, as a sentence.
        reason: String,
    },
    /// The file as a whole cannot be drawn.
    #[error("{file}: {reason}")]
    Content {
        /// The path as the user wrote it.
        file: String,
        /// What is wrong with it, and what the user can do about it, as a sentence.
        reason: String,
    },
    /// A line of the file contains a NUL byte, so the file is not text.
    #[error(
        "{}:{}: this is no text, and {kind} is: is it another file under this name?",
        origin.file, origin.line
    )]
    NotText {
        /// The offending line.
        origin: Origin,
        /// What the file should be, with its article, for example `an OBJ file`.
        kind: &'static str,
    },
    /// The file is UTF-16 text, which penup does not read.
    #[error("{file}: this is UTF-16 text: save it as UTF-8")]
    Utf16 {
        /// The path as the user wrote it.
        file: String,
    },
    /// The file is 4 GiB or larger.
    #[error("{file}: the file is larger than 4 GB, which is more than any plotter takes")]
    TooLarge {
        /// The path as the user wrote it.
        file: String,
    },
}

impl ReadError {
    /// Says that the file is of `other`, another format than its name says, if it is.
    pub(crate) fn of_other_format(mut self, other: Option<&dyn Format>) -> Self {
        let Some(format) = other else { return self };
        let extension = format.extensions().first().copied().unwrap_or_default();
        let (article, name) = (article(format.name()), format.name());
        let advice = format!(
            "the content is that of {article} {name} file: give it a name that ends in .{extension}"
        );
        match &mut self {
            Self::Line { reason, .. } | Self::Content { reason, .. } => {
                *reason = format!("{advice} ({reason})");
                self
            }
            Self::NotText { origin, .. } => {
                Self::Content { file: origin.file.clone(), reason: advice }
            }
            _ => self,
        }
    }
}

/// The article before the name of a format.
fn article(name: &str) -> &'static str {
    // These are spoken letter by letter, or begin with a vowel.
    if name.starts_with("HP") || name.starts_with('S') { "an" } else { "a" }
}
