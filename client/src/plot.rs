//! The command `plot`: who computes the drawing, and how it is sent.

mod advice;

pub use advice::{KNOWS_PLACE, is_at_origin};

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
use advice::{Progressed, Sending, StrokeCounter, advice, passes_left};
use penup::index::Index;
use penup::machine::{self, MachineError, Setting};
use penup::protocol::CommandError;
use penup_job::picture::Picture;
use penup_job::protocol::GO_ON_AT_ORIGIN;
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
        let passes = args.passes.multipass;
        let report = match rejoined {
            // Nobody knows which pass it was.
            Some(_) if passes > 1 => return Err(Error::PassesLeft { passes }),
            Some(report) => report,
            None => {
                let mut sender = Sender::open(&mut link, Timeouts::default(), interrupt)?;
                let drawn = operate::limits(&mut sender)
                    .and_then(|known| plot.draw(job, &mut sender, &known, &mut bar));
                sender.end();
                drawn?
            }
        };
        drop(bar);
        let text = report.as_ref().map(|report| format!(": {report}")).unwrap_or_default();
        let json = json!({ "file": file.display().to_string(), "drawn": report, "passes": passes });
        let times = if passes > 1 { format!(" {passes} times") } else { String::new() };
        let drawn = Outcome::done(format!("{} is drawn{times}{text}", file.display()), json);
        return Ok(source.measured(drawn));
    }
    // On Linux the kernel ends the emulator together with this program. On other systems this
    // program must end it, so Ctrl-C must not exit at once.
    let booting = (!cfg!(target_os = "linux")).then(MovingPlotter::emulated);
    let mut board = machines::emulate(args.board)?;
    let moving = MovingPlotter::emulated();
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
        let left_out = self.args.left_out();
        let compute = match left_out > 0 || self.args.reloop {
            true if self.args.compute == Compute::Board => {
                let reason = "--from and --reloop need this computer: leave out --compute board";
                return Err(Error::NotStreamed { reason: reason.to_owned() });
            }
            true => Compute::Host,
            false => self.args.compute,
        };
        if left_out > 0 {
            // Whoever names this computer has counted the strokes in its order.
            if self.args.compute != Compute::Host {
                fail_if_stopped_by_plotter(sender, left_out)?;
            }
            self.note(&[format!(
                "--from {left_out} counts in the order of --compute host; the plotter draws in \
                 another order what it computes itself"
            )]);
        }
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
        let (streamed, report) = host.streamed(form, left_out)?;
        if self.args.from.is_none() && form == Form::Strokes {
            let reason = fail_if_stopped_before(sender, &mut host, &streamed, passes)?;
            self.note(&reason.into_iter().collect::<Vec<_>>());
        }
        self.note(&host.left_out());
        let (strokes, points) = (streamed.size().strokes, streamed.targets());
        self.note(&[format!(
            "it sends {} with {points} points, {:.1} bytes a point",
            counted_strokes(strokes.into()),
            streamed.bytes() as f64 / f64::from(points.max(1))
        )]);
        let sending = Sending { form, left_out, begin: left_out, passes: Some(passes) };
        self.send(sender, &streamed, sending, progress)?;
        // Strokes that were left out once are drawn from then on.
        let mut whole = if passes > 1 { host.streamed(form, 0)?.0 } else { streamed };
        whole.ask_for_first_pen();
        for left in (1..passes).rev() {
            let sending = Sending { left_out: 0, begin: 0, passes: Some(left), ..sending };
            self.send(sender, &whole, sending, progress)?;
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
        let (whole, report) = host.streamed(Form::Strokes, 0)?;
        self.note(&host.left_out());
        let Some(begin) = begin_of(&stopped, &mut host, &whole)? else {
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
        // The same command may have gone on before, and was interrupted before the pen moved. Else
        // the plotter refuses to believe that the pen is at the origin, and says why.
        if stopped.is_lost || self.args.at_origin && !is_at_origin(&sender.status()?) {
            sender.ask(GO_ON_AT_ORIGIN)?;
        } else if self.args.at_origin {
            self.note(&[KNOWS_PLACE.to_owned()]);
        }
        let left_out = begin + stopped.drawn;
        let Stopped { drawn, all, points, .. } = stopped;
        let rest = host.rest(begin, drawn, points)?;
        self.note(&[format!("{drawn} of {all} strokes are drawn: the rest is sent")]);
        let sending = Sending { form: Form::Strokes, left_out, begin, passes: Some(1) };
        self.send(sender, &rest, sending, progress)?;
        Ok(report)
    }

    /// Sends strokes while they are drawn. If that breaks off, the user is told how to go on.
    fn send(
        &self,
        sender: &mut Sender<'_>,
        streamed: &StreamedJob,
        sending: Sending,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        let mut followed = StrokeCounter::new(progress, sending.form);
        let sent = sender.draw_streamed(streamed, &mut followed);
        if let Err(error) = &sent {
            let so_far = Progressed { begun: followed.begun, arrival: sender.arrival() };
            self.note(advice(self.args, &sending, so_far, error).as_slice());
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
        // A later pass begins at the first stroke.
        let first = self.args.left_out();
        let begins = [Some(first), Some(0).filter(|_| first > 0)];
        for begin in begins.into_iter().flatten() {
            let (mut streamed, report) = host.streamed(Form::Strokes, begin)?;
            let size = streamed.size().strokes;
            let drawn = taken.strokes.and_then(|all| size.checked_sub(all)).unwrap_or(0);
            if drawn < size && (drawn > 0 || taken.points > 0) {
                // It draws the rest of a drawing that had stopped.
                streamed = host.rest(begin, drawn, taken.points)?;
            }
            // The number of strokes is that of a report without a checksum: the targets prove it.
            let is_same = streamed.id() == taken.id && streamed.targets() == taken.all;
            if !is_same || !streamed.skip(taken.targets) {
                continue;
            }
            let left = streamed.targets() - taken.targets;
            self.note(&[format!(
                "the plotter draws this already: the last {left} points are sent"
            )]);
            let passes = Some(1).filter(|_| self.args.passes.multipass == 1);
            let left_out = begin + drawn;
            let sending = Sending { form: Form::Strokes, left_out, begin, passes };
            let sent = self.send(&mut sender, &streamed, sending, progress);
            sender.end();
            return sent.map(|()| Some(report));
        }
        Err(busy())
    }
}

/// The number of strokes of the whole drawing that come before those by which the plotter knows the
/// drawing that has stopped: it may have begun behind its first strokes, by --from. `None` if that
/// is another drawing.
fn begin_of(
    stopped: &Stopped,
    host: &mut InMemory<u32>,
    whole: &StreamedJob,
) -> Result<Option<u32>, Error> {
    let id = match whole.size().strokes.checked_sub(stopped.all) {
        None => return Ok(None),
        Some(0) => whole.id(),
        Some(begin) => host.streamed(Form::Strokes, begin)?.0.id(),
    };
    Ok(whole.size().strokes.checked_sub(stopped.all).filter(|_| id == stopped.id))
}

/// Fails if the plotter has stopped this drawing and would draw it over what is drawn of it. If it
/// has stopped a drawing that cannot go on, returns what to tell about it: the plotter does not say
/// which drawing that is.
fn fail_if_stopped_before(
    sender: &mut Sender<'_>,
    host: &mut InMemory<u32>,
    whole: &StreamedJob,
    passes: u32,
) -> Result<Option<String>, Error> {
    let stopped = match sender.stopped_drawing() {
        Err(Error::NotResumed { reason }) => {
            return Ok(Some(format!(
                "this plot begins anew; the plotter has stopped a drawing before, which cannot go \
                 on now: {reason}"
            )));
        }
        stopped => stopped?.filter(|stopped| stopped.drawn > 0),
    };
    let Some(stopped) = stopped else { return Ok(None) };
    match begin_of(&stopped, host, whole)? {
        None => Ok(None),
        Some(_) => Err(Error::StoppedBefore {
            done: stopped.drawn.into(),
            all: stopped.all.into(),
            is_repeated: passes > 1,
        }),
    }
}

/// Fails if the plotter has stopped a drawing that it has computed itself. It draws in another
/// order than this computer, whose first strokes are therefore not those that it has drawn.
fn fail_if_stopped_by_plotter(sender: &mut Sender<'_>, left_out: u32) -> Result<(), Error> {
    let Some((done, all)) = sender.stopped_job()? else { return Ok(()) };
    match sender.stopped_drawing() {
        Ok(None) => Err(Error::StoppedByPlotter { done, all, left_out }),
        // A drawing that this computer has sent, whether it can go on or not.
        Ok(Some(_)) | Err(Error::NotResumed { .. }) => Ok(()),
        Err(error) => Err(error),
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
    for left in (0..passes).rev() {
        let drawn = sender.plot(progress);
        if drawn.is_err() && left > 0 {
            progress.note(&passes_left(left));
        }
        drawn?;
    }
    sender.report()
}
