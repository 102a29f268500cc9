//! The errors of reading a file to draw. Each message also tells the user what to do about it.

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
