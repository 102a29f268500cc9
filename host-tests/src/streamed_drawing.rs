//! Drawings that a computer has computed and sends stroke by stroke.

use crate::whole_jobs::Bench;
use penup::plotter::Unobserved;
use penup::stage::{Aborted, Cancel};
use penup_job::streamed::{Form, StreamedJob};

struct Never;

impl Cancel for Never {
    fn check(&mut self) -> Result<(), Aborted> {
        Ok(())
    }
}

/// A drawing that a computer has computed.
pub struct StreamedDrawing {
    /// The settings of the machine.
    pub settings: Vec<String>,
    /// The plotter in memory that has computed it.
    bench: Bench,
}

impl StreamedDrawing {
    /// Computes what these lines describe, whose last is `$plot`.
    ///
    /// # Panics
    /// Panics if a line is refused or nothing can be drawn.
    pub fn of(lines: &[String]) -> Self {
        let (_, before) = lines.split_last().expect("lines");
        let mut bench = Bench::new();
        for line in before {
            assert!(bench.say(&format!("{line}\n")).ends_with("ok\n"), "{line}");
        }
        bench.plotter.compute(&mut Never, &mut Unobserved).expect("a job");
        let is_of_machine =
            |line: &&String| line.starts_with('$') && line.as_bytes()[1].is_ascii_digit();
        Self { settings: before.iter().filter(is_of_machine).cloned().collect(), bench }
    }

    /// Its lines without the first strokes.
    ///
    /// # Panics
    /// Panics if it has not so many strokes.
    pub fn from(&mut self, strokes: u32) -> StreamedJob {
        self.from_as(strokes, Form::Strokes)
    }

    /// The same in this form.
    ///
    /// # Panics
    /// As [`StreamedDrawing::from`].
    pub fn from_as(&mut self, strokes: u32, form: Form) -> StreamedJob {
        let settings = *self.bench.plotter.machine().settings();
        let mut path = self.bench.plotter.strokes();
        assert!(strokes == 0 || path.begin_at(strokes), "so many strokes");
        StreamedJob::new(&settings, &mut path, form).expect("lines of strokes")
    }

    /// The lines with which it goes on where so many strokes are drawn, and so many points within
    /// strokes are passed.
    ///
    /// # Panics
    /// Panics if nothing is left.
    pub fn rest(&mut self, drawn: u32, points: u32) -> StreamedJob {
        let whole = self.from(0);
        let settings = *self.bench.plotter.machine().settings();
        let (mut path, passed) = self.bench.plotter.strokes_left(drawn, points).expect("a rest");
        let rest = StreamedJob::new(&settings, &mut path, Form::Strokes);
        let mut rest = rest.expect("lines of strokes");
        rest.set_rest_of(&whole, passed);
        rest
    }
}
