//! Reads Wavefront OBJ files, whose lines a plotter understands as they are.
//!
//! Every line is checked with the plotter's own parser before anything is sent. A line that no
//! plotter accepts is refused with its number and its text. The bytes of the file are kept as they
//! are, and each line is generated when [`Lines::line`] asks for it, so a job needs little more
//! memory than its file.
//!
//! Blank lines, comments and keywords that have no effect on a plotter are not sent. A line that
//! ends in a backslash continues in the next one. A polyline that is longer than the maximum line
//! length is sent as several polylines, each of which starts at the last vertex of the one before.
//!
//! Files with lines that a plotter refuses although they are OBJ are read by [`irregular`].
//!
//! The reader refuses files that are not text, other lines that are too long, and machine commands
//! inside a file.

mod irregular;

use super::arrange::Arrangement;
use super::error::ReadError;
use super::flat::Flat;
use super::format::{Contents, Format};
use super::mesh::Mesh;
use crate::lines::acts_at_once;
use crate::lines::{JobLine, Lines, Origin};
use crate::words::{PROBABLY_Y_UP, explained};
use irregular::MOST_PENS;
use penup::protocol::{Command, CommandError, LINE_LIMIT};
use std::borrow::Cow;
use std::cell::Cell;
use std::collections::HashSet;

/// The format itself.
#[derive(Debug)]
pub(super) struct Obj;

impl Format for Obj {
    fn name(&self) -> &'static str {
        "Wavefront OBJ"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["obj"]
    }

    /// Whether the file begins with lines of OBJ, at least one of which is a vertex.
    fn recognises(&self, beginning: &[u8]) -> bool {
        // The last line may be cut.
        let last_end = beginning.iter().rposition(|byte| is_line_end(*byte)).unwrap_or(0);
        [beginning, &beginning[..last_end]].into_iter().any(|lines| {
            match ObjLines::checked(String::new(), lines.to_vec(), true) {
                Ok(Checked::Regular(lines)) => {
                    lines.in_order().any(|line| line.sent.starts_with("v "))
                }
                Ok(Checked::Irregular(_, bytes)) => bytes.windows(3).any(|it| it == b"\nv "),
                Err(_) => false,
            }
        })
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let has_y_up = has_y_up(&bytes);
        let mut contents = match ObjLines::checked(file, bytes, true)? {
            Checked::Regular(lines) => {
                let bounds = lines.flat.bounds(&lines);
                let notes = crease_note(&lines).into_iter().collect();
                Contents { bounds, notes, ..Contents::of(lines) }
            }
            Checked::Irregular(file, bytes) => irregular::read(file, &bytes)?,
        };
        if has_y_up && contents.bounds.is_none() {
            contents.notes.push(PROBABLY_Y_UP.to_owned());
        }
        Ok(contents)
    }
}

/// What the first lines of files hold that come from programs which usually write y up: Blender,
/// and Maya, which does not give its name.
const Y_UP_HEADS: [&[u8]; 2] =
    [b"# Blender ", b"# This file uses centimeters as units for non-parametric coordinates."];

/// Whether a file comes from a program that usually writes y up.
fn has_y_up(bytes: &[u8]) -> bool {
    bytes
        .split(|byte| is_line_end(*byte))
        .take(4)
        .any(|line| Y_UP_HEADS.iter().any(|head| line.starts_with(head)))
}

/// The most lines of a file that is searched for nearly flat edges. More of them would take time
/// and memory out of proportion to a hint.
const MOST_SEARCHED: usize = 300_000;

/// Says that most edges are nearly flat, if they are.
fn crease_note(lines: &dyn Lines) -> Option<String> {
    if lines.count() > MOST_SEARCHED {
        return None;
    }
    Mesh::of_lines(lines)?.crease_note()
}

/// The distance, in lines, between stored positions from which lines can be generated. A smaller
/// value makes [`Lines::line`] faster and takes more memory: 12 bytes for each position.
const CURSOR_EVERY: usize = 16;

/// An OBJ file whose every line has been checked.
#[derive(Debug)]
pub(super) struct ObjLines {
    /// The file, as the user named it.
    name: String,
    bytes: Vec<u8>,
    /// The position of every line whose number is a multiple of [`CURSOR_EVERY`].
    cursors: Vec<Cursor>,
    /// The number and the position of the line behind the one that was generated last. Most lines
    /// are asked for in order.
    next: Cell<Option<(usize, Cursor)>>,
    count: usize,
    /// Whether the file may be a plan.
    flat: Flat,
}

/// A position of the reader in the bytes of a file.
#[derive(Debug, Clone, Copy, Default)]
struct Cursor {
    /// The number of bytes before the position, less than 2^32.
    at: u32,
    /// The number of line ends before the position.
    line: u32,
    /// Whether it is inside a polyline of which an earlier part was already generated. The position
    /// is then before the vertex that both parts share.
    in_polyline: bool,
}

/// The result of checking a file.
#[derive(Debug)]
enum Checked {
    /// A plotter understands every line as it is.
    Regular(ObjLines),
    /// The name and the bytes of a file with other lines ([`irregular`]).
    Irregular(String, Vec<u8>),
}

impl ObjLines {
    /// Checks the lines of `bytes`, the contents of a file called `name`, and takes the corners of
    /// elements as they are.
    ///
    /// # Errors
    /// The file contains something that no plotter accepts.
    #[cfg(test)]
    pub(super) fn new(name: String, bytes: Vec<u8>) -> Result<Self, ReadError> {
        match Self::checked(name, bytes, false)? {
            Checked::Regular(lines) => Ok(lines),
            Checked::Irregular(file, _) => Err(ReadError::Utf16 { file }),
        }
    }

    /// Checks the lines of `bytes`. If `reads_irregular`, the check ends at the first line that
    /// [`irregular`] must read.
    fn checked(name: String, bytes: Vec<u8>, reads_irregular: bool) -> Result<Checked, ReadError> {
        if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
            return Err(ReadError::Utf16 { file: name });
        }
        let flat = Flat::default();
        let mut file =
            Self { name, bytes, cursors: Vec::new(), next: Cell::new(None), count: 0, flat };
        let mut cursor = Cursor::default();
        if file.bytes.starts_with(b"\xEF\xBB\xBF") {
            cursor.at = 3;
        }
        let mut content = String::new();
        let (mut vertices, mut pens) = (0, HashSet::new());
        loop {
            let mut next = cursor;
            match next.read(&file.bytes, &mut content) {
                Ok(None) => return Ok(Checked::Regular(file)),
                Ok(Some(from)) => {
                    vertices += usize::from(content.starts_with("v "));
                    file.flat.follow(&content);
                    if content.starts_with("usemtl") || content.starts_with("g ") {
                        pens.insert(content.clone());
                    }
                    let is_regular = irregular::is_regular(&content, vertices);
                    if reads_irregular && (!is_regular || pens.len() > MOST_PENS) {
                        return Ok(Checked::Irregular(file.name, file.bytes));
                    }
                    if file.count.is_multiple_of(CURSOR_EVERY) {
                        file.cursors.push(from);
                    }
                    file.count += 1;
                }
                Err((from, fault)) => {
                    let keyword = content.split(' ').next().unwrap_or_default();
                    let is_refused =
                        !matches!(fault, LineFault::NotText | LineFault::TooLong { .. });
                    if reads_irregular && is_refused && irregular::reads(keyword) {
                        return Ok(Checked::Irregular(file.name, file.bytes));
                    }
                    return Err(file.refused(from, fault));
                }
            }
            cursor = next;
        }
    }

    fn refused(&self, cursor: Cursor, fault: LineFault) -> ReadError {
        let origin = self.origin(cursor);
        let reason = match fault {
            LineFault::NotText => return ReadError::NotText { origin, kind: "an OBJ file" },
            LineFault::TooLong { length } => {
                format!("the line has {length} bytes, and a line may have at most {LINE_LIMIT}")
            }
            LineFault::Command => "a file cannot hold commands for the plotter".to_owned(),
            LineFault::Refused(refusal) => explained(refusal.number(), &[refusal.to_string()]),
        };
        ReadError::Line { origin, reason }
    }

    /// The line of the file that contains `cursor`.
    fn origin(&self, cursor: Cursor) -> Origin {
        let at = cursor.at as usize;
        let before = self.bytes.get(..at).unwrap_or_default();
        let begin = before.iter().rposition(|byte| is_line_end(*byte)).map_or(0, |end| end + 1);
        let line = self.bytes.get(begin..).unwrap_or_default();
        let line = line.split(|byte| is_line_end(*byte)).next().unwrap_or_default();
        // No character is longer than four bytes. A character that the limit would split is left
        // out.
        let shown = line.get(..4 * (Origin::MOST_SHOWN + 1)).map_or(line, |head| {
            let whole = std::str::from_utf8(head).map_err(|error| error.valid_up_to());
            whole.map_or_else(
                |end| &head[..if end + 4 > head.len() { end } else { head.len() }],
                str::as_bytes,
            )
        });
        let text = decoded(shown.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(shown));
        let text = text.trim().to_owned();
        Origin { file: self.name.clone(), line: cursor.line as usize + 1, text }
    }
}

impl Lines for ObjLines {
    fn count(&self) -> usize {
        self.count
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let stored = (index - index % CURSOR_EVERY, *self.cursors.get(index / CURSOR_EVERY)?);
        let is_nearer = |next: &(usize, Cursor)| (stored.0..=index).contains(&next.0);
        let (number, mut cursor) = self.next.get().filter(is_nearer).unwrap_or(stored);
        let mut content = String::new();
        let mut from = cursor;
        for _ in number..=index {
            // This cannot fail: every line was already read once without an error.
            from = cursor.read(&self.bytes, &mut content).ok()??;
        }
        self.next.set(Some((index + 1, cursor)));
        Some(JobLine { sent: content, origin: Some(self.origin(from)) })
    }

    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        let mut cursor = self.cursors.first().copied().unwrap_or_default();
        Box::new((0..self.count).map_while(move |_| {
            let mut sent = String::new();
            // This cannot fail: every line was already read once without an error.
            let from = cursor.read(&self.bytes, &mut sent).ok()??;
            Some(JobLine { sent, origin: Some(self.origin(from)) })
        }))
    }
}

/// The reason why a line is refused.
enum LineFault {
    TooLong { length: usize },
    Command,
    NotText,
    Refused(CommandError),
}

fn is_line_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0B | 0x0C)
}

/// Decodes bytes as UTF-8 or, if they are not UTF-8, as Latin-1, so that different names stay
/// different.
fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}

/// Replaces letters that are real-time commands: a `!` in a name would cause a feed hold. A name
/// only distinguishes pens, so another letter serves as well.
fn sendable(letter: char) -> char {
    if acts_at_once(letter) { '_' } else { letter }
}

impl Cursor {
    /// Writes the next line to send into `content` and moves behind it. Returns the position where
    /// that line begins, or `None` at the end of the file.
    ///
    /// # Errors
    /// The reason why the line is refused, and where it begins.
    fn read(
        &mut self,
        bytes: &[u8],
        content: &mut String,
    ) -> Result<Option<Self>, (Self, LineFault)> {
        while (self.at as usize) < bytes.len() {
            let from = *self;
            match self.read_line(bytes, content) {
                Ok(true) => return Ok(Some(from)),
                Ok(false) => {}
                Err(fault) => return Err((from, fault)),
            }
        }
        Ok(None)
    }

    /// Reads one line and joins its words with single spaces. Returns `true` if the line must be
    /// sent.
    fn read_line(&mut self, bytes: &[u8], content: &mut String) -> Result<bool, LineFault> {
        content.clear();
        if self.in_polyline {
            content.push('l');
        }
        let mut words = Words { bytes, at: self.at as usize, line: self.line };
        let mut vertices = 0;
        // The position before the last word of `content`, which may turn out to be the last one
        // that fits.
        let mut last = *self;
        while let Some(word) = words.next() {
            // Only the start of a word that is too long is decoded, because the word may be as long
            // as the file.
            let head = &word[..word.len().min(LINE_LIMIT + 1)];
            if head.contains(&0) {
                return Err(LineFault::NotText);
            }
            let before = content.len();
            if before > 0 {
                content.push(' ');
                vertices += 1;
            }
            let head = decoded(head);
            if head.bytes().any(|byte| acts_at_once(char::from(byte))) {
                content.extend(head.chars().map(sendable));
            } else {
                content.push_str(&head);
            }
            if content.len() > LINE_LIMIT {
                content.truncate(before);
                if before > 0 && Command::parse(content) == Ok(Command::Nothing) {
                    break;
                }
                if !content.starts_with("l ") || vertices < 3 {
                    // Bytes that are not UTF-8 become longer when they are decoded as Latin-1.
                    let length = self.line_length(bytes).max(LINE_LIMIT + 1);
                    return Err(LineFault::TooLong { length });
                }
                *self = Self { in_polyline: true, ..last };
                return is_sent(content);
            }
            // The casts are safe: both numbers are less than 2^32, the limit of every file.
            last.at = (words.at - word.len()) as u32;
            last.line = words.line;
        }
        words.end_line();
        *self = Self { at: words.at as u32, line: words.line, in_polyline: false };
        is_sent(content)
    }

    /// The number of bytes from here to the end of the line.
    fn line_length(&self, bytes: &[u8]) -> usize {
        let rest = bytes.get(self.at as usize..).unwrap_or_default();
        rest.iter().position(|byte| is_line_end(*byte)).unwrap_or(rest.len())
    }
}

/// Checks a line with the plotter's own parser. Returns `true` if the line must be sent.
fn is_sent(content: &str) -> Result<bool, LineFault> {
    match Command::parse(content) {
        Ok(Command::Nothing) => Ok(false),
        Ok(
            Command::Vertex(_)
            | Command::Face(_)
            | Command::Polyline(_)
            | Command::Degree(_)
            | Command::Curve { .. }
            | Command::Knots(_)
            | Command::EndCurve
            | Command::Pen { .. },
        ) => Ok(true),
        Err(_) if content.starts_with('$') => Err(LineFault::Command),
        // Any other command would act on the machine, as G-code does.
        Ok(_) | Err(CommandError::UnsupportedWord(_)) => Err(LineFault::Command),
        Err(refusal) => Err(LineFault::Refused(refusal)),
    }
}

/// An iterator over the words of a line, up to a comment or the end of the line.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The number of line ends before the current position.
    line: u32,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let rest = self.bytes.get(self.at..)?;
        let mut length = 0;
        while let Some(&byte) = rest.get(length)
            && !is_space(byte)
            && !is_line_end(byte)
            && byte != b'#'
            && !(length > 0 && rest[length - 1].is_ascii_digit() && is_continued(&rest[length..]))
        {
            length += 1;
        }
        self.at += length;
        rest.get(..length).filter(|word| !word.is_empty())
    }

    fn skip_space(&mut self) {
        while let Some(rest) = self.bytes.get(self.at..)
            && let Some(&byte) = rest.first()
        {
            if is_space(byte) {
                self.at += 1;
            } else if is_continued(rest) {
                self.at += 1;
                self.pass_line_end();
            } else {
                return;
            }
        }
    }

    /// Moves behind the end of this line.
    fn end_line(&mut self) {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        self.at += rest.iter().position(|byte| is_line_end(*byte)).unwrap_or(rest.len());
        self.pass_line_end();
    }

    fn pass_line_end(&mut self) {
        match self.bytes.get(self.at..).unwrap_or_default() {
            [b'\r', b'\n', ..] => self.at += 2,
            [_, ..] => self.at += 1,
            [] => return,
        }
        self.line += 1;
    }
}

/// Whether `rest` begins with a backslash at the end of a line, which continues the line in the
/// next one.
///
/// The callers accept a continuation only after a space or a number, because a Windows path may end
/// in a backslash.
fn is_continued(rest: &[u8]) -> bool {
    matches!(rest, [b'\\'] | [b'\\', b'\n' | b'\r', ..])
}

#[cfg(test)]
mod tests;
