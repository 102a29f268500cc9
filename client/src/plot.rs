//! The command `plot`: who computes the drawing, and how it is sent.

use crate::cli::PlotArgs;
use crate::compute::{self, Capacity, Compute, Known};
use crate::error::Error;
use crate::interrupt::MovingPlotter;
use crate::keyboard::KEYS;
use crate::link::Link;
use crate::machine_settings::simulated;
use crate::machines;
use crate::operate;
use crate::outcome::Outcome;
use crate::output;
use crate::ports;
use crate::preview::InMemory;
use crate::progress::{Bar, Progress};
use crate::run::{FileJob, Outputs, note, read, summary, write_pictures};
use crate::sender::{Sender, Stopped, Timeouts};
use crate::workspace;
use penup::index::Index;
use penup::machine::{self, MachineError, Setting};
use penup::protocol::CommandError;
use penup_job::picture::Picture;
use penup_job::protocol::{GO_ON_AT_ORIGIN, Status};
use penup_job::results::{JobReport, counted_strokes};
use penup_job::room::Room;
use penup_job::streamed::{Form, StreamedJob};
use penup_readers::lines::Lines;
use penup_readers::page::Page;
use serde_json::json;
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Draws a file by a plotter at a port, or by an emulated board.
///
/// # Errors
/// See [`Error`].
pub fn plot(args: &PlotArgs, quiet: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    // Without a file, a small example is drawn.
    let example = || workspace::root().join("scenes/interpen.obj");
    let file = args.file.clone().unwrap_or_else(example);
    plot_file(args, &file, quiet, interrupt).map_err(|error| error.of_file(&file))
}

fn plot_file(
    args: &PlotArgs,
    file: &Path,
    quiet: bool,
    interrupt: &AtomicBool,
) -> Result<Outcome, Error> {
    let outputs = Outputs::of(&args.pictures, None);
    if args.port.is_none() {
        output::check(file, &outputs.files())?;
    }
    let (job, source) = read(file, &args.view, quiet)?;
    let settings = &source.settings;
    let mut bar = Bar::new(quiet);
    if let Some(device) = &args.port {
        let mut link = ports::open(device)?;
        link.rejoin(&args.rejoin, quiet);
        let _moving = MovingPlotter::new();
        if link.obey_keys() && !quiet {
            note_keys();
        }
        let plot = Plot { args, file, page: settings.page, quiet };
        let rejoined = plot.rejoin(&job, &mut link, interrupt, &mut bar)?;
        let (report, passes) = match rejoined {
            // Nobody knows which pass it was.
            Some(report) => (report, 1),
            None => {
                let mut sender = Sender::open(&mut link, Timeouts::default(), interrupt)?;
                let drawn = operate::limits(&mut sender)
                    .and_then(|known| plot.draw(job, &mut sender, &known, &mut bar));
                sender.end();
                (drawn?, args.passes.multipass)
            }
        };
        drop(bar);
        if passes < args.passes.multipass {
            plot.note(&["this pass is drawn to its end; begin the others anew".to_owned()]);
        }
        let text = report.as_ref().map(|report| format!(": {report}")).unwrap_or_default();
        let json = json!({ "file": file.display().to_string(), "drawn": report, "passes": passes });
        let times = if passes > 1 { format!(" {passes} times") } else { String::new() };
        let drawn = Outcome::done(format!("{} is drawn{times}{text}", file.display()), json);
        return Ok(source.measured(drawn));
    }
    // On Linux the kernel ends the emulator together with this program. On other systems this
    // program must end it, so Ctrl-C must not exit at once.
    let booting = (!cfg!(target_os = "linux")).then(MovingPlotter::new);
    let mut board = machines::emulate(args.board)?;
    let moving = MovingPlotter::new();
    drop(booting);
    let known = Known {
        capacity: Capacity::of(args.board),
        board: Some(args.board),
        settings: Some(machine::Settings::default()),
        kept: 0,
    };
    let plot = Plot { args, file, page: settings.page, quiet };
    let drawn =
        Sender::open(board.as_mut(), Timeouts::default(), interrupt).and_then(|mut sender| {
            let drawn = plot.draw(job, &mut sender, &known, &mut bar);
            sender.end();
            drawn
        });
    let report = drawn.map_err(|error| board.explain(error))?;
    let runs = board.pen_runs()?;
    drop(board);
    drop(moving);
    let picture = Picture { page: settings.page, runs };
    drop(bar);
    let files = write_pictures(&picture, &outputs)?;
    Ok(source.measured(summary(&files, report)))
}

/// A drawing that is to be plotted.
struct Plot<'p> {
    args: &'p PlotArgs,
    file: &'p Path,
    page: Page,
    quiet: bool,
}

impl Plot<'_> {
    fn note(&self, notes: &[String]) {
        if !self.quiet {
            note(self.file, notes);
        }
    }

    /// Draws the file with a plotter that is idle, according to what is `known` of it. The user is
    /// told if the page is larger than its travel and the drawing reaches beyond that: the refusal
    /// tells how far of one point only.
    fn draw(
        &self,
        job: FileJob,
        sender: &mut Sender<'_>,
        known: &Known,
        progress: &mut dyn Progress,
    ) -> Result<Option<JobReport>, Error> {
        let drawn = self.draw_known(job, sender, known, progress);
        if let Err(Error::NotDrawn { refusal: CommandError::Machine(error) }) = &drawn
            && matches!(error, MachineError::BeyondTravel { .. })
            && let Some(settings) = &known.settings
        {
            self.note(beyond(self.page, settings).as_slice());
        }
        drawn
    }

    /// As [`Plot::draw`]. The memory of the job is free again once this computer has taken it.
    fn draw_known(
        &self,
        job: FileJob,
        sender: &mut Sender<'_>,
        known: &Known,
        progress: &mut dyn Progress,
    ) -> Result<Option<JobReport>, Error> {
        if self.args.resume {
            return self.go_on(job, sender, known, progress);
        }
        let compute = match self.args.from > 0 || self.args.reloop {
            true if self.args.compute == Compute::Board => {
                let reason = "--from and --reloop need this computer: leave out --compute board";
                return Err(Error::NotStreamed { reason: reason.to_owned() });
            }
            true => Compute::Host,
            false => self.args.compute,
        };
        let choice = compute::choose(known, &job, compute)?;
        if known.kept > 0 && choice.host.is_none() {
            self.note(&[format!(
                "the plotter's flash keeps a model of {} vertices, which this drawing replaces",
                known.kept
            )]);
        }
        let notes = [choice.totals].into_iter().filter(|totals| !totals.is_empty());
        self.note(&notes.chain(choice.reason).collect::<Vec<_>>());
        let passes = self.args.passes.multipass;
        let Some(mut host) = choice.host else { return draw_by(sender, &job, passes, progress) };
        drop(job);
        host.set_reloops(self.args.reloop);
        let form = sender.form(&known.settings.unwrap_or_default())?;
        let (streamed, report) = host.streamed(form, self.args.from)?;
        self.note(&host.left_out());
        let (strokes, points) = (streamed.size().strokes, streamed.targets());
        self.note(&[format!(
            "it sends {} with {points} points, {:.1} bytes a point",
            counted_strokes(strokes.into()),
            streamed.bytes() as f64 / f64::from(points.max(1))
        )]);
        self.send(sender, &streamed, self.args.from, passes, progress)?;
        // Strokes that were left out once are drawn from then on.
        let mut whole = if passes > 1 { host.streamed(form, 0)?.0 } else { streamed };
        whole.ask_for_first_pen();
        for left in (1..passes).rev() {
            self.send(sender, &whole, 0, left, progress)?;
        }
        Ok(report)
    }

    /// Sends the rest of this drawing, which a loss of power or a reset has stopped.
    fn go_on(
        &self,
        job: FileJob,
        sender: &mut Sender<'_>,
        known: &Known,
        progress: &mut dyn Progress,
    ) -> Result<Option<JobReport>, Error> {
        let refused = |reason: &str| Error::NotResumed { reason: reason.to_owned() };
        let stopped = sender.stopped_drawing()?.ok_or_else(|| {
            refused(
                "no drawing has stopped that was sent while it was drawn; `penup resume` goes on \
                 with one that the plotter has computed",
            )
        })?;
        let Some(mut host) = compute::choose(known, &job, Compute::Host)?.host else {
            return Err(refused("this computer cannot compute it"));
        };
        drop(job);
        host.set_reloops(self.args.reloop);
        // The drawing may have begun behind its first strokes, by --from.
        let (mut whole, report) = host.streamed(Form::Strokes, 0)?;
        self.note(&host.left_out());
        let begin = whole.size().strokes.checked_sub(stopped.all);
        if let Some(begin) = begin.filter(|begin| *begin > 0) {
            whole = host.streamed(Form::Strokes, begin)?.0;
        }
        let Some(begin) = begin.filter(|_| whole.id() == stopped.id) else {
            return Err(refused(
                "another drawing has stopped: name the same file with the same options, and set \
                 the machine as it was",
            ));
        };
        if stopped.is_lost && !self.args.at_origin {
            return Err(refused(
                "nobody has said where the pen is: home the machine by `penup home`, or put the \
                 pen at the origin by hand and add --at-origin",
            ));
        }
        if stopped.is_lost {
            sender.ask(GO_ON_AT_ORIGIN)?;
        } else if self.args.at_origin {
            self.note(&[KNOWS_PLACE.to_owned()]);
        }
        let mut rest = host.streamed(Form::Strokes, begin + stopped.drawn)?.0;
        rest.set_id(stopped.id);
        let Stopped { drawn, all, .. } = stopped;
        self.note(&[format!("{drawn} of {all} strokes are drawn: the rest is sent")]);
        self.send(sender, &rest, begin, 1, progress)?;
        Ok(report)
    }

    /// Sends strokes while they are drawn, from this stroke of the drawing, in the first of these
    /// passes that are left.
    fn send(
        &self,
        sender: &mut Sender<'_>,
        streamed: &StreamedJob,
        from: u32,
        passes: u32,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        let mut followed = StrokeCounter { progress, begun: 0 };
        let sent = sender.draw_streamed(streamed, &mut followed);
        if let Err(error) = &sent {
            let is_repeated = self.args.passes.multipass > 1;
            let passes = is_repeated.then_some(passes);
            let go_on = match (is_lost(error, streamed.form()), self.args.resume) {
                (true, _) => Some(TAKE_UP.to_owned()),
                (false, _) if followed.begun == 0 => None,
                (false, true) => Some(GO_ON_AGAIN.to_owned()),
                // The last stroke that was begun may not be whole.
                (false, false) => Some(go_on_from(u64::from(from) + followed.begun - 1, passes)),
            };
            self.note(go_on.as_slice());
        }
        sent
    }

    /// If the plotter waits for more strokes of this drawing, sends them. `None` if it does
    /// something else.
    fn rejoin(
        &self,
        job: &FileJob,
        link: &mut dyn Link,
        interrupt: &AtomicBool,
        progress: &mut dyn Progress,
    ) -> Result<Option<Option<JobReport>>, Error> {
        let Some((mut sender, taken)) = Sender::rejoin(link, Timeouts::default(), interrupt)?
        else {
            return Ok(None);
        };
        let busy = || Error::NotReady { state: "Run".to_owned() };
        let settings = simulated(&operate::read_settings(&mut sender)?).map_err(|_| busy())?;
        let mut host = InMemory::<u32>::new(Room::for_job(job), settings);
        host.set_reloops(self.args.reloop);
        if !host.take(job) {
            return Err(busy());
        }
        let (mut streamed, report) = host.streamed(Form::Strokes, self.args.from)?;
        let size = streamed.size().strokes;
        let drawn = taken.strokes.and_then(|all| size.checked_sub(all));
        if let Some(drawn) = drawn.filter(|drawn| *drawn > 0) {
            // The rest of a drawing that had stopped has the number of the whole.
            let id = streamed.id();
            streamed = host.streamed(Form::Strokes, self.args.from + drawn)?.0;
            streamed.set_id(id);
        }
        // The number of strokes is that of a report without a checksum: the targets prove it.
        let is_same = streamed.id() == taken.id && streamed.targets() == taken.all;
        if !is_same || !streamed.skip(taken.targets) {
            return Err(busy());
        }
        let left = streamed.targets() - taken.targets;
        self.note(&[format!("the plotter draws this already: the last {left} points are sent")]);
        let sent = self.send(&mut sender, &streamed, self.args.from, 1, progress);
        sender.end();
        sent.map(|()| Some(report))
    }
}

/// Says that the page is larger than the travel of the machine, if it is.
fn beyond(page: Page, settings: &machine::Settings) -> Option<String> {
    let travel = [Setting::TravelX, Setting::TravelY].map(|it| settings.get(it).to_num::<f64>());
    let [width, height] = travel;
    (page.width > width || page.height > height).then(|| {
        format!(
            "the page of {} x {} mm is larger than the travel of the machine, which is {width} x \
             {height} mm",
            page.width, page.height
        )
    })
}

/// What the user is told who says that the pen is at the origin although its place is known.
pub const KNOWS_PLACE: &str =
    "the plotter knows where the pen is, so the drawing goes on from there, without --at-origin";

/// What the user is told who goes on with a drawing once more.
const GO_ON_AGAIN: &str = "to go on at the stroke that was begun last, do the same again";

/// What the user is told when the plotter is gone and waits for more strokes.
const TAKE_UP: &str = "the plotter draws what it has, and then waits for the rest with the pen up: \
                       once it answers, do the same again, or with --resume if its power was gone";

/// Whether the error leaves a plotter behind that waits for the rest of a drawing in this form.
fn is_lost(error: &Error, form: Form) -> bool {
    form == Form::Strokes && matches!(error, Error::Link(_) | Error::Silent { .. })
}

/// What the user is told who leaves out strokes that are drawn, in the first of these passes that
/// are left.
fn go_on_from(left_out: u64, passes: Option<u32>) -> String {
    let options = match passes {
        None => {
            format!(
                "add --from {left_out}, or --resume if the plotter has flash for how far it comes"
            )
        }
        Some(passes) => {
            format!("say --from {left_out} --multipass {passes} in place of those options")
        }
    };
    format!("to go on at the stroke that was begun last, {options}")
}

/// Passes reports of progress on, and notes how many strokes were begun.
struct StrokeCounter<'p> {
    progress: &'p mut dyn Progress,
    begun: u64,
}

impl Progress for StrokeCounter<'_> {
    fn lines_sent(&mut self, done: usize, all: usize) {
        self.progress.lines_sent(done, all);
    }

    fn drawn(&mut self, status: &Status) {
        self.begun = status.strokes.map_or(self.begun, |(done, _)| done);
        self.progress.drawn(status);
    }

    fn state(&mut self, state: &str) {
        self.progress.state(state);
    }

    fn note(&mut self, note: &str) {
        self.progress.note(note);
    }
}

/// Says which keys act from now on.
fn note_keys() {
    // A closed standard error is no reason to fail.
    let _ = writeln!(io::stderr(), "penup: while it draws, {KEYS}");
}

/// Sends a whole job over `link`, draws it and returns the plotter's report on it, if
/// it gives one.
///
/// # Errors
/// See [`Sender`].
pub fn draw(
    link: &mut dyn Link,
    job: &dyn Lines,
    timeouts: Timeouts,
    interrupt: &AtomicBool,
    progress: &mut dyn Progress,
) -> Result<Option<JobReport>, Error> {
    let mut sender = Sender::open(link, timeouts, interrupt)?;
    let drawn = draw_by(&mut sender, job, 1, progress);
    sender.end();
    drawn
}

/// Sends a whole job to `plotter`, which computes it. Returns its strokes, of which closed ones
/// begin at random points, and the report on them.
///
/// # Errors
/// See [`Sender`].
pub fn relooped<I: Index>(
    plotter: &mut InMemory<I>,
    job: &dyn Lines,
    interrupt: &AtomicBool,
    progress: &mut dyn Progress,
) -> Result<(StreamedJob, Option<JobReport>), Error> {
    let mut sender = Sender::open(plotter, Timeouts::simulated(), interrupt)?;
    let sent = sender.stream(job, progress);
    sender.end();
    sent?;
    plotter.set_reloops(true);
    plotter.streamed(Form::Strokes, 0)
}

/// Sends a whole job, and draws all of it this many times.
fn draw_by(
    sender: &mut Sender<'_>,
    job: &dyn Lines,
    passes: u32,
    progress: &mut dyn Progress,
) -> Result<Option<JobReport>, Error> {
    sender.stream(job, progress)?;
    for _ in 0..passes {
        sender.plot(progress)?;
    }
    sender.report()
}

#[cfg(test)]
mod tests {
    use super::go_on_from;

    #[test]
    fn the_passes_that_are_left_are_named() {
        assert!(
            go_on_from(4, None).ends_with(
                "add --from 4, or --resume if the plotter has flash for how far it comes"
            )
        );
        assert!(go_on_from(4, Some(2)).contains("say --from 4 --multipass 2 in place"));
    }
}
