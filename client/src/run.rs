//! Runs the commands of the command line.
//!
//! The file is longer than 500 lines, because it has a function for each command that is no order
//! to the machine.

use crate::cli::page;
use crate::cli::{
    Cli, Command, FitArgs, PictureArgs, PreviewArgs, SettingsCommand, TapeCommand, TapeEncodeArgs,
    TapeShowArgs, ViewArgs,
};
use crate::error::Error;
use crate::files;
use crate::fit::fit_obj;
use crate::machine_settings::{AssignedSetting, simulated};
use crate::manual;
use crate::operate::{self, SavedSettings};
use crate::outcome::Outcome;
use crate::output::{self, STANDARD_OUTPUT};
use crate::plot::{draw, plot, relooped};
use crate::png::png;
use crate::preview::{Drawn, InMemory};
use crate::progress::{Bar, Progress as _, duration};
use crate::sender::{Sender, Timeouts};
use crate::tape;
use penup::index::Index;
use penup::machine::Setting;
use penup::step::tape::BadCode;
use penup_job::export::{self, Retracing};
use penup_job::notes;
use penup_job::picture::Picture;
use penup_job::results::{JobReport, JobResult};
use penup_job::room::Room;
use penup_job::streamed::StreamedJob;
use penup_job::{Job, Settings};
use penup_readers::page::Page;
use penup_readers::{Arrangement, ReadError, SourceFile};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Runs the command and returns what it has to say.
///
/// When a signal handler sets `interrupt`, the machine stops with the pen up.
///
/// # Errors
/// See [`Error`]. No output file is written if the command fails before the writing.
pub fn run(cli: &Cli, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let quiet = cli.quiet;
    match &cli.command {
        Command::Plot(args) => plot(args, quiet, interrupt),
        Command::Preview(args) => {
            preview(args, quiet, interrupt).map_err(|error| error.of_file(&args.file))
        }
        Command::Page(args) => page::serve(args),
        Command::Fit(args) => fit(args, quiet),
        Command::Tape(TapeCommand::Encode(args)) => {
            encode_tape(args, quiet, interrupt).map_err(|error| error.of_file(&args.file))
        }
        Command::Tape(TapeCommand::Decode { file, .. }) => {
            let tape = files::bytes(file)?;
            let text = tape::decode(&tape).map_err(damaged(file))?;
            note_end(file, &tape, quiet);
            let instructions: Vec<&str> = text.lines().collect();
            Ok(Outcome::answer(text.trim_end(), json!({ "instructions": instructions })))
        }
        Command::Tape(TapeCommand::Show(args)) => show_tape(args, quiet),
        Command::Ports(args) => operate::ports(args),
        Command::Status(args) => operate::status(args, interrupt),
        Command::Watch(args) => operate::watch(args, quiet, interrupt),
        Command::Pause(args) => operate::pause(args, interrupt),
        Command::Resume(args) => operate::resume(args, quiet, interrupt),
        Command::Abort(args) => operate::abort(args, interrupt),
        Command::Home(args) => operate::home(args, interrupt),
        Command::Unlock(args) => operate::unlock(args, interrupt),
        Command::Jog(args) => operate::jog(args, interrupt),
        Command::Pen(args) => operate::pen(args, interrupt),
        Command::Set(args) => operate::set(args, interrupt),
        Command::Settings(SettingsCommand::Show(args)) => operate::show(args, interrupt),
        Command::Settings(SettingsCommand::Save { file, plotter }) => {
            operate::save(file.as_deref(), plotter, interrupt)
        }
        Command::Settings(SettingsCommand::Restore { file, plotter }) => {
            operate::restore(file, plotter, interrupt)
        }
        Command::Again(args) => operate::again(args, quiet, interrupt),
        Command::Setup(args) => operate::setup(args, interrupt),
        Command::Shake(args) => operate::shake(args, interrupt),
        Command::Console(args) => operate::console(&args.port, args.format.json, interrupt),
        Command::Completions { shell, .. } => Ok(manual::completions(*shell)),
        Command::Man { folder, .. } => manual::pages(folder.as_deref()),
    }
}

fn preview(args: &PreviewArgs, quiet: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    operate::fail_if_given_twice(&args.set)?;
    let outputs = Outputs::of(&args.pictures, Some(args));
    output::check(&args.file, &outputs.files())?;
    let (job, source) = read(&args.file, &args.view, quiet)?;
    let mut machine = match &args.machine {
        Some(file) => SavedSettings::read(file)?.settings,
        None => Vec::new(),
    };
    machine.extend(args.set.iter().cloned());
    if args.machine.is_none()
        && let Some((travel, said)) = large_enough(&machine, source.settings.page)
    {
        machine.extend(travel);
        if !quiet {
            note(&args.file, &[said]);
        }
    }
    let machine = simulated(&machine)?;
    if args.motion.is_some() && machine.get(Setting::Kinematics) != 0 {
        return Err(Error::MotionOfOtherMachine);
    }
    let bar = Bar::new(quiet);
    match args.board {
        None => {
            let plotter = InMemory::<u32>::new(Room::for_job(&job), machine);
            show(plotter, &job, &source, args, &outputs, bar, interrupt)
        }
        Some(board) => {
            let plotter = InMemory::<u16>::new(Room::of_board(board), machine);
            let shown = show(plotter, &job, &source, args, &outputs, bar, interrupt);
            shown.map_err(|error| match error {
                Error::Refused { number, .. } if FULL.contains(&number) => Error::BeyondMemory {
                    source: Box::new(error),
                    board: board.name.to_owned(),
                    keeps: board.model_flash > 0 && !source.is_plan,
                },
                error => error,
            })
        }
    }
}

/// The travel of a machine that holds `page`, and what to tell the user about it, if that of the
/// default machine does not and nobody has said what theirs is.
fn large_enough(
    assigned: &[AssignedSetting],
    page: Page,
) -> Option<([AssignedSetting; 2], String)> {
    const TRAVEL: [Setting; 2] = [Setting::TravelX, Setting::TravelY];
    let is_said = assigned.iter().any(|it| {
        Setting::numbered(it.number)
            .is_some_and(|setting| setting == Setting::Kinematics || TRAVEL.contains(&setting))
    });
    let settings = penup::machine::Settings::default();
    let usual = TRAVEL.map(|setting| settings.get(setting).to_num::<f64>());
    let needed = [page.width, page.height];
    let fits = (0..2).all(|axis| needed[axis] <= usual[axis]);
    if is_said || fits {
        return None;
    }
    let travel = [0, 1].map(|axis| AssignedSetting {
        number: TRAVEL[axis].info().number(),
        value: needed[axis].max(usual[axis]).ceil().to_string(),
    });
    let [x, y] = &travel;
    let said = format!(
        "the page of {} x {} mm is larger than the travel of the default machine, which is {} x {} \
         mm, so the preview is of a machine with {} x {} mm: say what yours has by --machine FILE, \
         or by --set {}={} --set {}={}",
        page.width,
        page.height,
        usual[0],
        usual[1],
        x.value,
        y.value,
        x.number,
        x.value,
        y.number,
        y.value
    );
    // A page that no machine holds is refused in the plotter's words.
    simulated(&travel).is_ok().then_some((travel, said))
}

/// The errors of a plotter whose memory does not hold all vertices, or all corners, of a model.
const FULL: [u16; 2] = [113, 114];

/// Draws the job by `plotter` and writes the pictures and reports that the arguments name.
fn show<I: Index>(
    mut plotter: InMemory<I>,
    job: &FileJob,
    source: &Source,
    args: &PreviewArgs,
    outputs: &Outputs,
    mut bar: Bar,
    interrupt: &AtomicBool,
) -> Result<Outcome, Error> {
    let passes = args.passes.multipass;
    let (streamed, report) = if args.reloop {
        let (streamed, report) = relooped(&mut plotter, job, interrupt, &mut bar)?;
        draw_strokes(&mut plotter, Some(&streamed), interrupt, &mut bar)?;
        (Some(streamed), report)
    } else {
        (None, draw(&mut plotter, job, Timeouts::simulated(), interrupt, &mut bar)?)
    };
    let mut drawn = plotter.drawn();
    if passes > 1 {
        // The pictures show the first pass. Each other one begins where one has ended.
        draw_strokes(&mut plotter, streamed.as_ref(), interrupt, &mut bar)?;
        let other = plotter.drawn();
        drawn.steps += u64::from(passes - 1) * other.steps;
        drawn.duration_s += f64::from(passes - 1) * other.duration_s;
    }
    if let Some(said) = plotter.open_path() {
        bar.note(&said);
    }
    drop(bar);
    let Drawn { runs, steps, duration_s } = drawn;
    let picture = Picture { page: source.settings.page, runs };
    let mut files = write_pictures(&picture, outputs)?;
    files.extend(write_exports(&picture, args, plotter.draw_speed())?);
    if let Some(path) = &outputs.json {
        let mut result = JobResult { steps, duration_s, ..plotter.result()? };
        for _ in 1..args.repeat {
            result.timings_ms = result.timings_ms.best(plotter.result()?.timings_ms);
        }
        let whole = PreviewResult {
            result: &result,
            passes,
            page_mm: page_mm(source.settings.page),
            bounds: source.extent,
            drawn: &report,
        };
        let text = serde_json::to_string(&whole).map_err(|error| Error::Write {
            file: path.display().to_string(),
            source: error.into(),
        })?;
        output::write(path, format!("{text}\n").as_bytes())?;
        files.push(path);
    }
    if let Some(path) = &outputs.motion {
        output::write(path, plotter.motion()?.svg().as_bytes())?;
        files.push(path);
    }
    let mut outcome = source.measured(summary(&files, report));
    if passes > 1 {
        outcome.text += &format!(", {passes} passes");
    }
    let time = duration(duration_s.round() as u64);
    outcome.text += &format!(", {time} to draw");
    Ok(outcome)
}

/// Draws these strokes, or else the job that `plotter` has computed, from where the pen is.
fn draw_strokes<I: Index>(
    plotter: &mut InMemory<I>,
    streamed: Option<&StreamedJob>,
    interrupt: &AtomicBool,
    bar: &mut Bar,
) -> Result<(), Error> {
    let mut sender = Sender::open(plotter, Timeouts::simulated(), interrupt)?;
    let drawn = match streamed {
        Some(streamed) => sender.draw_streamed(streamed, bar),
        None => sender.plot(bar),
    };
    sender.end();
    drawn
}

/// The size of the page for `--json`, in mm.
fn page_mm(Page { width, height }: Page) -> Value {
    json!({ "width": width, "height": height })
}

/// What is written by `penup preview --json`.
#[derive(Serialize)]
struct PreviewResult<'a> {
    #[serde(flatten)]
    result: &'a JobResult,
    /// How often everything is drawn; the lengths are those of one pass, and the steps and the
    /// duration those of all.
    passes: u32,
    /// The size of the page.
    page_mm: Value,
    /// The least and the greatest coordinates of the model, or of the plan in mm.
    bounds: Option<[[f64; 3]; 2]>,
    /// The plotter's own report on one pass.
    drawn: &'a Option<JobReport>,
}

/// Writes the drawing for other machines. Returns the names of the files written.
fn write_exports<'a>(
    picture: &Picture,
    args: &'a PreviewArgs,
    speed: f64,
) -> Result<Vec<&'a Path>, Error> {
    let mut files = Vec::new();
    let retracing = Retracing { passes: args.passes.multipass, reloops: false };
    let lines = export::lines(&picture.runs, retracing);
    if let Some(path) = &args.gcode {
        output::write(path, export::gcode(&lines, speed).as_bytes())?;
        files.push(path.as_path());
    }
    if let Some(path) = &args.hpgl {
        output::write(path, export::hpgl(&lines).as_bytes())?;
        files.push(path.as_path());
    }
    Ok(files)
}

/// The file to write: the one that is named, or else the one `beside` the file that is read. Beside
/// the standard input is the standard output.
fn output_for(named: Option<&PathBuf>, read: &Path, beside: PathBuf) -> PathBuf {
    let beside = if files::is_standard(read) { STANDARD_OUTPUT.into() } else { beside };
    named.cloned().unwrap_or(beside)
}

fn fit(args: &FitArgs, quiet: bool) -> Result<Outcome, Error> {
    let file = args.file.display().to_string();
    let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let beside = args.file.with_file_name(format!("{stem}-fitted.obj"));
    let output = output_for(args.output.as_ref(), &args.file, beside);
    output::check(&args.file, &[&output])?;
    let source = files::read(&args.file, &Arrangement::default())?;
    if !quiet {
        note(&args.file, source.notes());
    }
    let mut bar = Bar::new(quiet);
    let fitted =
        fit_obj(&source, source.size(), args.tolerance, &mut |done, all| bar.fitted(done, all))
            .map_err(|source| Error::Fit { file: file.clone(), source })?;
    drop(bar);
    output::write(&output, fitted.obj.as_bytes())?;
    let text = format!("{}: {}", output.display(), fitted.saving);
    Ok(Outcome::done(&text, json!({ "files": [output], "saving": fitted.saving.to_string() })))
}

fn encode_tape(
    args: &TapeEncodeArgs,
    quiet: bool,
    interrupt: &AtomicBool,
) -> Result<Outcome, Error> {
    let beside = args.file.with_extension("tape");
    let output = output_for(args.output.as_ref(), &args.file, beside);
    output::check(&args.file, &[&output])?;
    let (job, _) = read(&args.file, &args.view, quiet)?;
    let mut plotter =
        InMemory::<u32>::new(Room::for_job(&job), penup::machine::Settings::default());
    {
        let mut bar = Bar::new(quiet);
        let mut sender = Sender::open(&mut plotter, Timeouts::simulated(), interrupt)?;
        sender.stream(&job, &mut bar)?;
        sender.end();
    }
    let tape = plotter.tape()?;
    if !quiet {
        let has_several_pens = plotter.has_several_pens();
        let merged = has_several_pens.then(|| {
            "several pens draw it, and a tape has no pens: one pen draws all of them".to_owned()
        });
        note(&args.file, &merged.into_iter().chain(plotter.left_out()).collect::<Vec<_>>());
    }
    output::write(&output, &tape)?;
    let text = format!("{}: {} bytes", output.display(), tape.len());
    Ok(Outcome::done(text, json!({ "files": [output], "bytes": tape.len() })))
}

fn show_tape(args: &TapeShowArgs, quiet: bool) -> Result<Outcome, Error> {
    let outputs = Outputs::of(&args.pictures, None);
    output::check(&args.file, &outputs.files())?;
    let tape = files::bytes(&args.file)?;
    let shown = tape::show(&tape, args.page, args.steps);
    let (picture, moves) = shown.map_err(damaged(&args.file))?;
    note_end(&args.file, &tape, quiet);
    let files = write_pictures(&picture, &outputs)?;
    let names = names(&files);
    let text = format!("{}: {moves} moves from {} bytes", names.join(", "), tape.len());
    let json = json!({ "files": names, "moves": moves, "bytes": tape.len() });
    Ok(Outcome::done(text, json))
}

/// Tells the user what of a tape is missing or not shown.
fn note_end(file: &Path, tape: &[u8], quiet: bool) {
    if !quiet {
        note(file, penup_readers::end_note(tape).as_slice());
    }
}

fn damaged(file: &Path) -> impl Fn(BadCode) -> Error {
    move |BadCode { row, code }| Error::Tape { file: file.display().to_string(), row, code }
}

/// A file as the job that is sent.
pub type FileJob = Job<SourceFile>;

/// Reads `file`, tells the user what is not drawn as the file says, and chooses the settings.
pub fn read(file: &Path, view: &ViewArgs, quiet: bool) -> Result<(FileJob, Source), Error> {
    let source = files::read(file, view.arrangement())?;
    let settings = view
        .settings_for(&source)
        .map_err(|reason| ReadError::Content { file: file.display().to_string(), reason })?;
    if !quiet {
        let known = notes::followed(&settings);
        let of_file = source.notes().iter().filter(|note| !known.contains(&note.as_str()));
        note(file, &of_file.cloned().collect::<Vec<_>>());
        if let Some(bounds) = source.bounds() {
            note(file, &notes::of_plan(&settings, bounds));
            let own = notes::fits_own_page(&settings, source.page(), source.sheet());
            note(file, own.as_slice());
        }
        note(file, &notes::idle_options(&settings, source.bounds().is_some()));
    }
    let (mut extent, is_plan) = (source.extent(), source.bounds().is_some());
    let is_flat = is_plan && settings.shows_plans_flat();
    if let Some(by) = source.bounds().and_then(|bounds| settings.moves_plan_by(bounds)) {
        for corner in extent.iter_mut().flatten() {
            corner.iter_mut().zip(by).for_each(|(part, by)| *part += by);
        }
    }
    let is_scaled_by_plotter =
        is_flat && settings.value("fit") == Some("on") && !view.arrangement().scales_to_page();
    let job = Job::new(source, &settings);
    Ok((job, Source { settings, extent, is_plan, is_flat, is_scaled_by_plotter }))
}

/// What is known of a file that was read beside its lines.
pub struct Source {
    /// The settings of the drawing.
    pub settings: Settings,
    /// The least and the greatest coordinates; of a plan at true size, those on the page.
    extent: Option<[[f64; 3]; 2]>,
    is_plan: bool,
    /// Whether it is a plan that is laid on the page as it is, and not seen in space as a model.
    is_flat: bool,
    /// Whether the coordinates are those of a plan before the plotter scales it to the page.
    is_scaled_by_plotter: bool,
}

impl Source {
    /// Adds the size of the page and the bounding box to what is said about the job.
    pub fn measured(&self, mut outcome: Outcome) -> Outcome {
        if let Value::Object(fields) = &mut outcome.json {
            fields.insert("page_mm".to_owned(), page_mm(self.settings.page));
        }
        let Some(corners) = self.extent else { return outcome };
        let axes = if self.is_flat { 2 } else { 3 };
        let [low, high] = corners.map(|corner| {
            let part = |part: &f64| ((part * 1e6).round() / 1e6 + 0.0).to_string();
            corner.iter().take(axes).map(part).collect::<Vec<_>>().join(", ")
        });
        let (what, unit) = if self.is_flat { ("drawing", " mm") } else { ("model", "") };
        // What is drawn of a solid lies elsewhere, of course.
        let before =
            if self.is_scaled_by_plotter { "before it is fitted to the page, " } else { "" };
        outcome.text += &format!("; {before}the {what} reaches from {low} to {high}{unit}");
        if let Value::Object(fields) = &mut outcome.json {
            fields.insert("bounds".to_owned(), json!(corners));
        }
        outcome
    }
}

/// Prints notes on `file` to the standard error.
pub fn note(file: &Path, notes: &[String]) {
    for note in notes {
        // A closed standard error is no reason to fail.
        let _ = writeln!(io::stderr(), "penup: note: {}: {note}", file.display());
    }
}

/// The files that a command writes; those that are not named are not written.
pub struct Outputs {
    svg: Option<PathBuf>,
    png: Option<PathBuf>,
    json: Option<PathBuf>,
    motion: Option<PathBuf>,
    gcode: Option<PathBuf>,
    hpgl: Option<PathBuf>,
}

impl Outputs {
    /// The files that the arguments name. If there are none, two pictures in the working directory.
    pub fn of(pictures: &PictureArgs, preview: Option<&PreviewArgs>) -> Self {
        let mut named = Self {
            svg: pictures.svg.clone(),
            png: pictures.png.clone(),
            json: preview.and_then(|args| args.json.clone()),
            motion: preview.and_then(|args| args.motion.clone()),
            gcode: preview.and_then(|args| args.gcode.clone()),
            hpgl: preview.and_then(|args| args.hpgl.clone()),
        };
        if named.files().is_empty() {
            named.svg = Some("plot.svg".into());
            named.png = Some("plot.png".into());
        }
        named
    }

    /// The names of all files that will be written.
    pub fn files(&self) -> Vec<&Path> {
        let all = [&self.svg, &self.png, &self.json, &self.motion, &self.gcode, &self.hpgl];
        all.into_iter().flatten().map(PathBuf::as_path).collect()
    }
}

/// Renders all pictures before it writes the first file. Returns the names of the files written.
pub fn write_pictures<'a>(picture: &Picture, outputs: &'a Outputs) -> Result<Vec<&'a Path>, Error> {
    let svg = picture.svg();
    let png = match outputs.png.as_deref() {
        Some(path) => Some((path, png(&svg)?)),
        None => None,
    };
    let mut files = Vec::new();
    if let Some(path) = &outputs.svg {
        output::write(path, svg.as_bytes())?;
        files.push(path.as_path());
    }
    if let Some((path, bytes)) = png {
        output::write(path, &bytes)?;
        files.push(path);
    }
    Ok(files)
}

fn names(files: &[&Path]) -> Vec<String> {
    files.iter().map(|path| path.display().to_string()).collect()
}

/// Says which files were written, and what the plotter reports.
pub fn summary(files: &[&Path], report: Option<JobReport>) -> Outcome {
    let names = names(files);
    let text = report.as_ref().map_or("drawn".to_owned(), |report| report.to_string());
    let json = json!({ "files": names, "drawn": report });
    Outcome::done(format!("{}: {text}", names.join(", ")), json)
}
