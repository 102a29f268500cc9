//! A file that was read, in a form that one program hands to another.

use penup_readers::SourceFile;
use penup_readers::lines::{JobLine, Lines, Origin};
use penup_readers::page::Page;
use serde::{Deserialize, Serialize};

/// A file that was read.
#[derive(Debug, Serialize, Deserialize)]
pub struct Reading {
    /// The lines to send, each with its end.
    text: String,
    /// The lines that come from one line of the file: how many, and its number and text. The number
    /// is 0 if they come from none.
    origins: Vec<(usize, usize, String)>,
    /// Width and height of the page that the file has, in mm, and of that on which it is laid.
    own: Option<[f64; 2]>,
    sheet: [f64; 2],
    /// The least and the greatest x and y of a plan, in mm.
    bounds: Option<[[f64; 2]; 2]>,
    /// What the user should know about the file.
    notes: Vec<String>,
}

impl Reading {
    /// Takes what was read.
    pub fn of(file: &SourceFile) -> Self {
        let mut reading = Self {
            text: String::new(),
            origins: Vec::new(),
            own: file.page().map(|page| [page.width, page.height]),
            sheet: [file.sheet().width, file.sheet().height],
            bounds: file.bounds(),
            notes: file.notes().to_vec(),
        };
        for JobLine { sent, origin } in file.in_order() {
            reading.text += &sent;
            reading.text.push('\n');
            let (line, text) = origin.map_or((0, String::new()), |it| (it.line, it.text));
            match reading.origins.last_mut() {
                Some((count, own, shown)) if *own == line && *shown == text => *count += 1,
                _ => reading.origins.push((1, line, text)),
            }
        }
        reading
    }

    /// The page that the file has, and that on which the drawing is laid.
    pub fn pages(&self) -> (Option<Page>, Page) {
        let page = |[width, height]: [f64; 2]| Page { width, height };
        (self.own.map(page), page(self.sheet))
    }

    /// The least and the greatest x and y of the plan, in mm; `None` if it is no plan.
    pub fn bounds(&self) -> Option<[[f64; 2]; 2]> {
        self.bounds
    }

    /// What the user should know about the file.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The lines to send, which come from the file called `name`.
    pub fn into_lines(self, name: &str) -> ReadLines {
        let ends = self.text.match_indices('\n').map(|(at, _)| at).collect();
        let mut first = 0;
        let origins = self.origins.into_iter().map(|(count, line, text)| {
            first += count;
            (first, line, text)
        });
        let origins = origins.collect();
        ReadLines { file: name.to_owned(), text: self.text, ends, origins }
    }
}

/// The lines of a [`Reading`].
#[derive(Debug)]
pub struct ReadLines {
    file: String,
    text: String,
    /// Where each line ends in the text.
    ends: Vec<usize>,
    /// The number of the first line that does not come from this line of the file any more.
    origins: Vec<(usize, usize, String)>,
}

impl Lines for ReadLines {
    fn count(&self) -> usize {
        self.ends.len()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let end = *self.ends.get(index)?;
        let begin = match index.checked_sub(1) {
            Some(before) => self.ends.get(before)? + 1,
            None => 0,
        };
        let sent = self.text.get(begin..end)?.to_owned();
        let at = self.origins.partition_point(|(behind, _, _)| *behind <= index);
        let origin = self.origins.get(at).filter(|(_, line, _)| *line > 0);
        let origin = origin.map(|(_, line, text)| Origin {
            file: self.file.clone(),
            line: *line,
            text: text.clone(),
        });
        Some(JobLine { sent, origin })
    }
}
