//! The lines that are sent to a plotter, and where each comes from.

use std::fmt;

/// A line to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobLine {
    /// The text to send, without the line end.
    pub sent: String,
    /// The line of the user's file that it comes from; `None` for the client's own commands.
    pub origin: Option<Origin>,
}

/// A line of the user's file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The file, as the user named it.
    pub file: String,
    /// The line number, counted from 1.
    pub line: usize,
    /// The text of the line; of a long line, at least its first [`Origin::MOST_SHOWN`] characters.
    pub text: String,
}

impl Origin {
    /// The maximum number of characters of a line that an error message shows.
    pub const MOST_SHOWN: usize = 100;

    /// The beginning of the line with control characters replaced, so that it is safe to print on a
    /// terminal.
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
    /// A command of the client itself, which comes from no file.
    pub fn command(text: impl Into<String>) -> Self {
        Self { sent: text.into(), origin: None }
    }
}

/// Whether `letter` is a real-time command, which acts wherever it occurs, or ends a line. No line
/// may contain such a letter.
pub fn acts_at_once(letter: char) -> bool {
    matches!(letter, '?' | '!' | '~') || letter.is_ascii_control() && letter != '\t'
}

/// A sequence of lines to send, numbered from 0 and generated on demand.
pub trait Lines {
    /// The number of lines.
    fn count(&self) -> usize;

    /// Line number `index`; `None` past the last one.
    fn line(&self, index: usize) -> Option<JobLine>;

    /// Iterates over all lines in order, which may be faster than calling [`Lines::line`] for each.
    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        Box::new((0..self.count()).map_while(|index| self.line(index)))
    }
}

impl fmt::Debug for dyn Lines {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // There may be millions of them.
        write!(formatter, "{} lines", self.count())
    }
}

impl fmt::Debug for dyn Lines + Send {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self as &dyn Lines).fmt(formatter)
    }
}

/// The least and the greatest x, y and z of the vertices in `lines`; `None` if there are none.
pub fn extent(lines: &dyn Lines) -> Option<[[f64; 3]; 2]> {
    let points = lines.in_order().filter_map(|line| {
        let mut words = line.sent.strip_prefix("v ")?.split(' ');
        let mut number = || words.next()?.parse::<f64>().ok();
        Some([number()?, number()?, number()?])
    });
    points.fold(None, |extent, point| {
        let [low, high] = extent.unwrap_or([point; 2]);
        let axes = [0, 1, 2];
        Some([
            axes.map(|axis: usize| low[axis].min(point[axis])),
            axes.map(|axis: usize| high[axis].max(point[axis])),
        ])
    })
}

impl<const COUNT: usize> Lines for [JobLine; COUNT] {
    fn count(&self) -> usize {
        COUNT
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        self.get(index).cloned()
    }
}

impl Lines for Vec<JobLine> {
    fn count(&self) -> usize {
        self.len()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        self.get(index).cloned()
    }
}
