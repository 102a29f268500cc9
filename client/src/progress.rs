//! Reports the progress of a job to the user: lines sent, then ink drawn and time left.

use indicatif::{ProgressBar, ProgressStyle};
use penup_job::protocol::Status;
use penup_readers::words::for_client;
use std::io::{self, Write as _};

/// A receiver of progress reports.
pub trait Progress {
    /// The plotter has accepted `done` of `all` lines.
    fn lines_sent(&mut self, done: usize, all: usize);
    /// The plotter draws, and reports with this status how far it is.
    fn drawn(&mut self, status: &Status);
    /// Called with the plotter's state whenever it reports one.
    fn state(&mut self, state: &str);
    /// A remark of the plotter on a job that it draws nevertheless, for instance that it leaves
    /// something out.
    fn note(&mut self, _note: &str) {}
}

/// Ignores all reports.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn lines_sent(&mut self, _: usize, _: usize) {}
    fn drawn(&mut self, _: &Status) {}
    fn state(&mut self, _: &str) {}
}

/// A progress bar on the standard error; invisible if that is not a terminal, or if the user wants
/// quiet.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    phase: &'static str,
    is_quiet: bool,
}

impl Default for Bar {
    fn default() -> Self {
        Self::new(false)
    }
}

impl Bar {
    /// A bar, which says nothing at all if the user wants quiet.
    pub fn new(is_quiet: bool) -> Self {
        let bar = if is_quiet { ProgressBar::hidden() } else { ProgressBar::new(0) };
        // The template is a constant. If it were invalid, the default style would be used.
        if let Ok(style) = ProgressStyle::with_template(
            "{msg:>9} {bar:30.cyan/black.bright} {percent:>3} % {prefix} {elapsed:.dim}",
        ) {
            bar.set_style(style.progress_chars("━╸━"));
        }
        Self { bar, phase: "", is_quiet }
    }

    /// Curves have been fitted to `done` of `all` vertices.
    pub fn fitted(&mut self, done: usize, all: usize) {
        self.show("Fitting", format!("{done}/{all} vertices"), done as u64, all as u64);
    }

    fn show(&mut self, phase: &'static str, text: String, done: u64, all: u64) {
        if self.phase != phase {
            self.phase = phase;
            self.bar.reset();
            self.bar.set_message(phase);
        }
        self.bar.set_prefix(text);
        self.bar.set_length(all);
        self.bar.set_position(done);
    }
}

/// Says how far a drawing is: strokes, ink, and the time that is left.
///
/// ```
/// use penup_client::progress::how_far;
/// use penup_job::protocol::Status;
/// let status = Status {
///     strokes: Some((12, 60)),
///     ink: Some((1234, 3400)),
///     seconds_left: Some(201),
///     ..Status::default()
/// };
/// assert_eq!(how_far(&status), "12/60 strokes, 1.2 of 3.4 m, 3:21 left");
/// ```
pub fn how_far(status: &Status) -> String {
    let metres = |mm: u64| mm as f64 / 1000.0;
    let strokes = status.strokes.map(|(done, all)| format!("{done}/{all} strokes"));
    let ink = status.ink.map(|(done, all)| format!("{:.1} of {:.1} m", metres(done), metres(all)));
    let left = status.seconds_left.map(|seconds| format!("{} left", duration(seconds)));
    [strokes, ink, left].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Writes a number of seconds as `m:ss` or `h:mm:ss`.
///
/// ```
/// use penup_client::progress::duration;
/// assert_eq!(duration(9), "0:09");
/// assert_eq!(duration(3661), "1:01:01");
/// ```
pub fn duration(seconds: u64) -> String {
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    match hours {
        0 => format!("{minutes}:{seconds:02}"),
        _ => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

impl Progress for Bar {
    fn lines_sent(&mut self, done: usize, all: usize) {
        self.show("Sending", format!("{done}/{all} lines"), done as u64, all as u64);
    }

    fn drawn(&mut self, status: &Status) {
        // Progress is measured by ink, because this determines the duration of a stroke. Older
        // firmware does not report ink.
        let ink = status.ink.filter(|(_, all)| *all > 0);
        let (done, all) = ink.or(status.strokes).unwrap_or_default();
        self.show("Drawing", how_far(status), done, all);
    }

    fn note(&mut self, note: &str) {
        if self.is_quiet {
            return;
        }
        self.bar.suspend(|| {
            // A closed standard error is no reason to fail.
            let _ = writeln!(io::stderr(), "penup: note: {}", for_client(note));
        });
    }

    fn state(&mut self, state: &str) {
        if self.phase == "Drawing" {
            let message = if state == "Hold" { "Held" } else { "Drawing" };
            self.bar.set_message(message);
        } else if state == "Run" {
            self.bar.set_message("Thinking");
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
