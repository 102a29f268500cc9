//! A file, line by line, as it is sent.
//!
//! Every line keeps its number and its text, so that a refusal names both. Blank lines and comments
//! stay at home. Refused: files that are not OBJ by their name, `$` commands inside a file.

use crate::error::Error;
use crate::protocol::acts_at_once;
use std::fs;
use std::path::Path;

/// One line to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobLine {
    /// What is sent, without the line end.
    pub sent: String,
    /// Where in the user's file it stands; `None` for the client's own commands.
    pub origin: Option<Origin>,
}

/// A line of the user's file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The file, as the user named it.
    pub file: String,
    /// The line's number, from 1.
    pub line: usize,
    /// The line as it stands there.
    pub text: String,
}

impl Origin {
    /// How much of a line is shown, in characters.
    const MOST_SHOWN: usize = 100;

    /// The beginning of the line, in characters that a terminal only shows.
    pub fn shown(&self) -> String {
        let is_shown = |character: &char| !character.is_control() && *character != '\u{FFFD}';
        let mut shown: String = (self.text.chars())
            .map(|character| if is_shown(&character) { character } else { '·' })
            .take(Self::MOST_SHOWN)
            .collect();
        if self.text.chars().nth(Self::MOST_SHOWN).is_some() {
            shown.push('…');
        }
        shown
    }
}

impl JobLine {
    /// A command of the client itself.
    pub fn command(text: impl Into<String>) -> Self {
        Self { sent: text.into(), origin: None }
    }
}

/// Reads the lines of `path`.
///
/// # Errors
/// The file cannot be read, its name does not end in `.obj`, or it holds a `$` command.
pub fn read_file(path: &Path) -> Result<Vec<JobLine>, Error> {
    let name = path.display().to_string();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let bytes = fs::read(path).map_err(|source| Error::File { file: name.clone(), source })?;
    if !extension.eq_ignore_ascii_case("obj") {
        return Err(Error::Extension { file: name });
    }
    lines(&name, &bytes)
}

fn lines(file: &str, bytes: &[u8]) -> Result<Vec<JobLine>, Error> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut lines = Vec::new();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let content = text.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        let origin =
            Origin { file: file.to_owned(), line: index + 1, text: text.trim().to_owned() };
        if content.starts_with('$') {
            return Err(Error::CommandInFile { origin });
        }
        lines.push(JobLine { sent: sendable(content), origin: Some(origin) });
    }
    Ok(lines)
}

/// A `!` in a name would hold the machine; a name only tells pens apart, so another letter serves.
fn sendable(content: &str) -> String {
    let letter = |letter| if acts_at_once(letter) { '_' } else { letter };
    content.chars().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(bytes: &[u8]) -> Vec<(usize, String)> {
        let lines = lines("f.obj", bytes).expect("a file that can be sent");
        lines
            .into_iter()
            .map(|line| (line.origin.expect("from the file").line, line.sent))
            .collect()
    }

    #[test]
    fn blank_lines_and_comments_stay_at_home_and_numbers_count_them() {
        assert_eq!(
            sent(b"\xEF\xBB\xBF# cube\r\n\r\nv 0 0 0\r\n  # again\n\tf 1 2 3  # mine\n"),
            [(3, "v 0 0 0".into()), (5, "f 1 2 3".into())]
        );
        assert_eq!(sent("o Würfel".as_bytes()), [(1, "o Würfel".into())]);
        assert_eq!(sent(b""), []);
        assert_eq!(sent(b"v 1 2 3"), [(1, "v 1 2 3".into())]);
    }

    #[test]
    fn no_byte_of_a_file_acts_at_once() {
        let other = |byte: &u8| !matches!(byte, b'\n' | b'#');
        let all: Vec<u8> = (0..=255).filter(other).collect();
        let lines = sent(&[b"o ".as_slice(), &all, b" end"].concat());
        let [(1, sent)] = lines.as_slice() else {
            panic!("one line expected: {lines:?}");
        };
        assert!(!sent.chars().any(acts_at_once), "{sent}");
        assert!(sent.starts_with("o _") && sent.ends_with(" end"), "{sent}");
    }

    #[test]
    fn a_command_in_a_file_is_refused() {
        let error = lines("f.obj", b"v 0 0 0\n  $plot\n").expect_err("refused");
        assert!(error.to_string().starts_with("f.obj:2: "), "{error}");
    }

    #[test]
    fn a_line_is_shown_without_what_acts_on_a_terminal() {
        let shown = |bytes: &[u8]| {
            let lines = lines("f.obj", bytes).expect("a file that can be sent");
            lines[0].origin.as_ref().expect("from the file").shown()
        };
        assert_eq!(shown(b"f \x1b[2J\x07 Z\xff\n"), "f ·[2J· Z·");
        let long = shown("ü".repeat(101).as_bytes());
        assert_eq!((long.chars().count(), long.chars().last()), (101, Some('…')));
    }
}
