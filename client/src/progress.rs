//! Reports the progress of a job to the user: lines sent, then strokes drawn.

use crate::words::for_client;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, Write as _};

/// A receiver of progress reports.
pub trait Progress {
    /// The plotter has accepted `done` of `all` lines.
    fn lines_sent(&mut self, done: usize, all: usize);
    /// The plotter has drawn `done` of `all` strokes.
    fn strokes_drawn(&mut self, done: u64, all: u64);
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
    fn strokes_drawn(&mut self, _: u64, _: u64) {}
    fn state(&mut self, _: &str) {}
}

/// A progress bar on the standard error; invisible if that is not a terminal.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    phase: &'static str,
}

impl Default for Bar {
    fn default() -> Self {
        let bar = ProgressBar::new(0);
        // The template is a constant. If it were invalid, the default style would be used.
        if let Ok(style) = ProgressStyle::with_template(
            "{msg:>9} {bar:40.cyan/black.bright} {human_pos}/{human_len} {prefix} {elapsed:.dim}",
        ) {
            bar.set_style(style.progress_chars("━╸━"));
        }
        Self { bar, phase: "" }
    }
}

impl Bar {
    /// Curves have been fitted to `done` of `all` vertices.
    pub fn fitted(&mut self, done: usize, all: usize) {
        self.show("Fitting", "vertices", done as u64, all as u64);
    }

    fn show(&mut self, phase: &'static str, unit: &'static str, done: u64, all: u64) {
        if self.phase != phase {
            self.phase = phase;
            self.bar.reset();
            self.bar.set_message(phase);
            self.bar.set_prefix(unit);
        }
        self.bar.set_length(all);
        self.bar.set_position(done);
    }
}

impl Progress for Bar {
    fn lines_sent(&mut self, done: usize, all: usize) {
        self.show("Sending", "lines", done as u64, all as u64);
    }

    fn strokes_drawn(&mut self, done: u64, all: u64) {
        self.show("Drawing", "strokes", done, all);
    }

    fn note(&mut self, note: &str) {
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
