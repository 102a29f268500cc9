//! What the user is told about how to go on with a plot that has broken off.

use crate::cli::PlotArgs;
use crate::error::Error;
use crate::progress::Progress;
use crate::sender::Arrival;
use penup_job::protocol::Status;
use penup_job::streamed::Form;

/// What the user is told who says that the pen is at the origin although its place is known.
pub const KNOWS_PLACE: &str =
    "the plotter knows where the pen is, so the drawing goes on from there, without --at-origin";

/// Whether the machine stands at the origin of its page, as far as it knows.
pub fn is_at_origin(status: &Status) -> bool {
    let mut numbers = status.position.split(',').map(str::parse::<f64>);
    !status.position.is_empty() && numbers.all(|number| number.is_ok_and(|number| number == 0.0))
}

/// A drawing, or the rest of one, that was being sent while it was drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sending {
    /// The format in which the strokes are written.
    pub form: Form,
    /// The number of strokes of the whole drawing that come before those that are sent.
    pub left_out: u32,
    /// The number of strokes of the whole drawing that come before those by which the plotter
    /// knows it. The rest of a drawing that had stopped has the number of all of that.
    pub begin: u32,
    /// The number of passes that are left, this one among them; `None` if it is not known.
    pub passes: Option<u32>,
}

/// How far a drawing has come when sending it breaks off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Progressed {
    /// The number of strokes that were begun, of those that were sent.
    pub begun: u64,
    /// How much of the drawing has arrived.
    pub arrival: Arrival,
}

/// How to go on with a drawing that broke off by this error; `None` if the same command begins it
/// anew.
pub(super) fn advice(
    args: &PlotArgs,
    sending: &Sending,
    so_far: Progressed,
    error: &Error,
) -> Option<String> {
    let goes_on = matches!(
        error,
        Error::Link(_)
            | Error::Silent { .. }
            | Error::Held
            | Error::WaitsForPen { .. }
            | Error::LostLine { .. }
            | Error::Damaged { .. }
    );
    let all = args.passes.multipass;
    if goes_on && sending.form == Form::Strokes {
        return Some(take_up(args, sending, so_far.arrival));
    }
    let is_later = sending.passes.is_some_and(|left| left < all);
    if so_far.begun == 0 && sending.left_out == args.left_out() && !is_later {
        return None;
    }
    // The last stroke that was begun may not be whole.
    let left_out = u64::from(sending.left_out) + so_far.begun.saturating_sub(1);
    let how = match sending.passes {
        _ if args.resume && args.at_origin => {
            "do the same again, without --at-origin if the plotter kept its power".to_owned()
        }
        _ if args.resume => "do the same again".to_owned(),
        Some(left) if all > 1 => {
            format!("say --from {left_out} --multipass {left} in place of those options")
        }
        None if all > 1 => format!(
            "say --from {left_out} in place of {}, which ends this pass",
            replaced(args).unwrap_or_default()
        ),
        _ => match args.from {
            None => format!(
                "add --from {left_out}, or --resume if the plotter has flash for how far it comes"
            ),
            Some(from) => format!(
                "say --from {left_out} in place of --from {from}, or --resume in place of it if \
                 the plotter has flash for how far it comes"
            ),
        },
    };
    Some(format!("to go on at the stroke that was begun last, {how}"))
}

/// How to go on with a drawing that the plotter goes on with, as far as it has it. Strokes that are
/// left out would be drawn by both.
fn take_up(args: &PlotArgs, sending: &Sending, arrival: Arrival) -> String {
    let again = match (args.resume, sending.begin) {
        (true, 1..) => format!(
            "do the same again with --from {} in place of {}",
            sending.begin,
            if args.at_origin { "--resume and --at-origin" } else { "--resume" }
        ),
        _ => "do the same again".to_owned(),
    };
    let how = match arrival {
        Arrival::Part => format!(
            "the plotter draws what it has, and then waits for the rest with the pen up: once it \
             answers, {again}"
        ),
        Arrival::PerhapsAll => format!(
            "the plotter draws what it has, which may be all: once it answers, ask by `penup \
             status` whether it still draws; if it does, {again}"
        ),
        Arrival::All => "the plotter has all of this drawing: once it answers, `penup watch` \
                         follows it to its end"
            .to_owned(),
    };
    let without_power = match replaced(args) {
        _ if args.resume => "or do the same again if its power was gone".to_owned(),
        Some(options) => {
            format!("or do the same with --resume in place of {options} if its power was gone")
        }
        None if arrival == Arrival::Part => "or with --resume if its power was gone".to_owned(),
        None => "or do the same with --resume if its power was gone".to_owned(),
    };
    let how = match args.resume && arrival == Arrival::Part && sending.begin == 0 {
        true => how,
        false => format!("{how}, {without_power}"),
    };
    match sending.passes {
        Some(left) if left > 1 => format!("{how}; {}", passes_left(left - 1)),
        _ => how,
    }
}

/// How to draw the passes that have not begun.
pub(super) fn passes_left(left: u32) -> String {
    let (noun, verb) =
        if left == 1 { ("pass has", "draws it") } else { ("passes have", "draws them") };
    format!(
        "{left} more {noun} not begun: once this one has ended, the same with --multipass {left} \
         and without --from {verb}"
    )
}

/// The options with which --resume is refused, if they are given.
fn replaced(args: &PlotArgs) -> Option<&'static str> {
    match (args.from, args.passes.multipass) {
        (None, 1) => None,
        (Some(_), 1) => Some("--from"),
        (None, _) => Some("--multipass"),
        (Some(_), _) => Some("--from and --multipass"),
    }
}

/// Passes reports of progress on, and notes how many strokes were begun.
pub(super) struct StrokeCounter<'p> {
    progress: &'p mut dyn Progress,
    form: Form,
    /// The number of strokes that were begun.
    pub begun: u64,
}

impl<'p> StrokeCounter<'p> {
    /// A counter of strokes that are sent in this form.
    pub fn new(progress: &'p mut dyn Progress, form: Form) -> Self {
        Self { progress, form, begun: 0 }
    }
}

impl Progress for StrokeCounter<'_> {
    fn lines_sent(&mut self, done: usize, all: usize) {
        self.progress.lines_sent(done, all);
    }

    fn drawn(&mut self, status: &Status) {
        // Until the plotter has carried out the header, it reports the strokes of the job before.
        if self.form == Form::GCode || status.stream.is_some() {
            self.begun = status.strokes.map_or(self.begun, |(done, _)| done);
        }
        self.progress.drawn(status);
    }

    fn state(&mut self, state: &str) {
        self.progress.state(state);
    }

    fn note(&mut self, note: &str) {
        self.progress.note(note);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use crate::progress::Quiet;
    use clap::Parser as _;
    use penup_job::protocol::Reply;
    use std::io;

    const SENDING: Sending =
        Sending { form: Form::Strokes, left_out: 0, begin: 0, passes: Some(1) };

    /// The advice after `penup plot a.obj --port auto` with these options.
    fn advised(options: &str, sending: &Sending, so_far: Progressed, error: &Error) -> String {
        let line = format!("penup plot a.obj --port auto {options}");
        match Cli::try_parse_from(line.split_whitespace()).map(|cli| cli.command) {
            Ok(Command::Plot(args)) => advice(&args, sending, so_far, error).unwrap_or_default(),
            other => format!("{other:?}"),
        }
    }

    fn lost() -> Error {
        Error::Link(io::ErrorKind::BrokenPipe.into())
    }

    #[test]
    fn a_plotter_that_has_all_is_not_told_to_draw_it_once_more() {
        let so_far = |arrival| Progressed { begun: 5, arrival };
        let told = |arrival| advised("", &SENDING, so_far(arrival), &lost());
        assert!(told(Arrival::Part).contains("once it answers, do the same again, or with"));
        assert!(told(Arrival::PerhapsAll).contains("whether it still draws; if it does, do the"));
        let all = told(Arrival::All);
        assert!(
            all.contains("`penup watch` follows it") && !all.contains("the same again"),
            "{all}"
        );
    }

    /// Strokes that are left out would be drawn by the plotter, which has them, and once more.
    #[test]
    fn a_plotter_that_goes_on_is_never_told_to_leave_out_strokes() {
        let so_far = Progressed { begun: 5, arrival: Arrival::Part };
        let errors = [
            lost(),
            Error::Held,
            Error::LostLine { line: None },
            Error::Damaged { line: None, times: 9 },
        ];
        for error in &errors {
            let told = advised("", &SENDING, so_far, error);
            assert!(told.contains("do the same again") && !told.contains("--from"), "{told}");
        }
        // Lines of G-code do not come again.
        let sending = Sending { form: Form::GCode, ..SENDING };
        assert!(advised("", &sending, so_far, &Error::Held).contains("add --from 4, or --resume"));
    }

    #[test]
    fn options_that_exclude_each_other_are_not_advised_together() {
        let so_far = Progressed { begun: 5, arrival: Arrival::Part };
        for (options, passes, replaced) in [
            ("--from 3", 1, "with --resume in place of --from if"),
            ("--multipass 3", 3, "with --resume in place of --multipass if"),
            ("--from 3 --multipass 3", 2, "with --resume in place of --from and --multipass if"),
        ] {
            let sending = Sending { passes: Some(passes), ..SENDING };
            let told = advised(options, &sending, so_far, &lost());
            assert!(told.contains(replaced), "{told}");
            let left = format!("the same with --multipass {} and without --from", passes - 1);
            assert_eq!(told.contains(&left), passes > 1, "{told}");
        }
        // The plotter knows the rest of a drawing by the number of what began behind stroke 10.
        let sending = Sending { left_out: 14, begin: 10, ..SENDING };
        let told = advised("--resume", &sending, so_far, &lost());
        assert!(told.contains("do the same again with --from 10 in place of --resume"), "{told}");
    }

    #[test]
    fn the_strokes_and_the_passes_that_are_left_are_named() {
        let so_far = Progressed { begun: 5, arrival: Arrival::Part };
        let told = |options: &str, sending: &Sending, begun| {
            advised(options, sending, Progressed { begun, ..so_far }, &Error::Restarted)
        };
        assert!(
            told("", &SENDING, 5).ends_with(
                "add --from 4, or --resume if the plotter has flash for how far it comes"
            )
        );
        assert!(
            told("--from 3", &Sending { left_out: 3, ..SENDING }, 5)
                .contains("say --from 7 in place of --from 3")
        );
        let second = Sending { passes: Some(2), ..SENDING };
        assert!(told("--multipass 3", &second, 5).contains("say --from 4 --multipass 2 in place"));
        assert!(told("--multipass 3", &second, 0).contains("say --from 0 --multipass 2 in place"));
        assert_eq!(told("--multipass 2", &second, 0), "", "nothing is drawn");
        // The rest of a drawing whose first 20 strokes were drawn before.
        assert!(told("", &Sending { left_out: 20, ..SENDING }, 5).contains("add --from 24,"));
        assert!(told("--resume", &SENDING, 5).ends_with("do the same again"));
    }

    /// Until then the plotter reports what it has drawn of the job before.
    #[test]
    fn strokes_count_from_when_the_plotter_takes_them() {
        let mut quiet = Quiet;
        let mut counter = StrokeCounter::new(&mut quiet, Form::Strokes);
        for (report, begun) in [
            ("<Idle|MPos:0.000,0.000|Drawn:499/499|Ink:9/9|Left:0>", 0),
            ("<Run|MPos:0.000,0.000|Stream:9/99,900|Drawn:2/499|Ink:0/9|Left:9>", 2),
            ("<Idle|MPos:0.000,0.000|Drawn:0/0|Ink:0/0|Left:0>", 2),
        ] {
            if let Reply::Status(status) = Reply::parse(report) {
                counter.drawn(&status);
            }
            assert_eq!(counter.begun, begun, "{report}");
        }
    }

    #[test]
    fn the_origin_is_known_by_its_coordinates() {
        let at = |position: &str| Status { position: position.to_owned(), ..Status::default() };
        assert!(is_at_origin(&at("0.000,0.000")) && is_at_origin(&at("-0.000,0.000,0.000")));
        for other in ["", "0.000,1.000", "0.000,nan", "0.000,"] {
            assert!(!is_at_origin(&at(other)), "{other}");
        }
    }
}
