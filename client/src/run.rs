//! Runs the commands of the command line.

use crate::cli::{
    Cli, Command, FitArgs, PictureArgs, PlotArgs, PreviewArgs, TapeCommand, TapeEncodeArgs,
    TapeShowArgs, ViewArgs,
};
use crate::error::Error;
use crate::fit::fit_obj;
use crate::formats::{ReadError, SourceFile};
use crate::interrupt::MovingPlotter;
use crate::job::{Job, Settings};
use crate::lines::Lines;
use crate::link::{Link, SerialLink};
use crate::machines;
use crate::output;
use crate::picture::{self, Picture};
use crate::preview::InMemory;
use crate::progress::{Bar, Progress};
use crate::results::JobReport;
use crate::sender::{Patience, Sender};
use crate::tape;
use crate::workspace;
use penup::step::tape::BadCode;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Runs the command and returns the sentence to print for the user.
///
/// When a signal handler sets `interrupt`, the machine stops with the pen up.
///
/// # Errors
/// See [`Error`]. No output file is written if the command fails before the writing.
pub fn run(cli: &Cli, interrupt: &AtomicBool) -> Result<String, Error> {
    match &cli.command {
        Command::Plot(args) => plot(args, interrupt),
        Command::Preview(args) => preview(args, interrupt),
        Command::Fit(args) => fit(args),
        Command::Tape(TapeCommand::Encode(args)) => encode_tape(args, interrupt),
        Command::Tape(TapeCommand::Decode { file }) => {
            Ok(tape::decode(&read_tape(file)?).map_err(damaged(file))?.trim_end().to_owned())
        }
        Command::Tape(TapeCommand::Show(args)) => show_tape(args),
    }
}

fn plot(args: &PlotArgs, interrupt: &AtomicBool) -> Result<String, Error> {
    // Without a file, a small example is drawn.
    let example = || workspace::root().join("scenes/interpen.obj");
    let file = args.file.clone().unwrap_or_else(example);
    let outputs = Outputs::of(&args.pictures, None, None);
    if args.port.is_none() {
        output::check(&file, &outputs.files())?;
    }
    let (source, settings) = read(&file, &args.view)?;
    let job = Job::new(source, &settings);
    let mut bar = Bar::default();
    if let Some(device) = &args.port {
        let mut link = SerialLink::open(device)
            .map_err(|source| Error::Port { device: device.clone(), source })?;
        let _moving = MovingPlotter::new();
        let report = draw(&mut link, &job, interrupt, &mut bar)?;
        let report = report.map(|report| format!(": {report}")).unwrap_or_default();
        return Ok(format!("{} is drawn{report}", file.display()));
    }
    // On Linux the kernel ends the emulator together with this program. On other systems this
    // program must end it, so Ctrl-C must not exit at once.
    let booting = (!cfg!(target_os = "linux")).then(MovingPlotter::new);
    let mut board = machines::emulate(args.board)?;
    let moving = MovingPlotter::new();
    drop(booting);
    let drawn = draw(board.as_mut(), &job, interrupt, &mut bar);
    let report = drawn.map_err(|error| board.explain(error))?;
    let pen = board.pen_runs()?;
    drop(board);
    drop(moving);
    let picture = Picture { page: settings.page, runs: pen.runs, step: pen.step };
    drop(bar);
    let files = write_pictures(&picture, &outputs)?;
    Ok(summary(&files, report))
}

fn preview(args: &PreviewArgs, interrupt: &AtomicBool) -> Result<String, Error> {
    let outputs = Outputs::of(&args.pictures, args.json.as_deref(), args.motion.as_deref());
    output::check(&args.file, &outputs.files())?;
    let (source, settings) = read(&args.file, &args.view)?;
    let job = Job::new(source, &settings);
    let mut bar = Bar::default();
    let mut plotter = InMemory::new();
    let report = draw(&mut plotter, &job, interrupt, &mut bar)?;
    let mut result = plotter.result()?;
    for _ in 1..args.repeat {
        result.timings_ms = result.timings_ms.best(plotter.result()?.timings_ms);
    }
    drop(bar);
    let picture =
        Picture { page: settings.page, runs: result.pen.runs.clone(), step: result.pen.step };
    let mut files = write_pictures(&picture, &outputs)?;
    if let Some(path) = &outputs.json {
        let text = serde_json::to_string(&result).map_err(|error| Error::Write {
            file: path.display().to_string(),
            source: error.into(),
        })?;
        output::write(path, format!("{text}\n").as_bytes())?;
        files.push(path);
    }
    if let Some(path) = &outputs.motion {
        output::write(path, plotter.motion(&args.set)?.svg().as_bytes())?;
        files.push(path);
    }
    Ok(summary(&files, report))
}

fn fit(args: &FitArgs) -> Result<String, Error> {
    let file = args.file.display().to_string();
    let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let beside = || args.file.with_file_name(format!("{stem}-fitted.obj"));
    let output = args.output.clone().unwrap_or_else(beside);
    output::check(&args.file, &[&output])?;
    let source = SourceFile::read(&args.file)?;
    note(&args.file, source.notes());
    let mut bar = Bar::default();
    let fitted =
        fit_obj(&source, source.size(), args.tolerance, &mut |done, all| bar.fitted(done, all))
            .map_err(|source| Error::Fit { file: file.clone(), source })?;
    drop(bar);
    output::write(&output, fitted.obj.as_bytes())?;
    Ok(format!("{}: {}", output.display(), fitted.saving))
}

fn encode_tape(args: &TapeEncodeArgs, interrupt: &AtomicBool) -> Result<String, Error> {
    let output = args.output.clone().unwrap_or_else(|| args.file.with_extension("tape"));
    output::check(&args.file, &[&output])?;
    let (source, settings) = read(&args.file, &args.view)?;
    let job = Job::new(source, &settings);
    let mut plotter = InMemory::new();
    {
        let mut bar = Bar::default();
        let mut sender = Sender::open(&mut plotter, Patience::default(), interrupt)?;
        sender.stream(&job, &mut bar)?;
        sender.end();
    }
    let tape = plotter.tape()?;
    output::write(&output, &tape)?;
    Ok(format!("{}: {} bytes", output.display(), tape.len()))
}

fn show_tape(args: &TapeShowArgs) -> Result<String, Error> {
    let outputs = Outputs::of(&args.pictures, None, None);
    output::check(&args.file, &outputs.files())?;
    let tape = read_tape(&args.file)?;
    let shown = tape::show(&tape, args.page, args.steps);
    let (picture, moves) = shown.map_err(damaged(&args.file))?;
    let files = write_pictures(&picture, &outputs)?;
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    Ok(format!("{}: {moves} moves from {} bytes", names.join(", "), tape.len()))
}

fn read_tape(file: &Path) -> Result<Vec<u8>, Error> {
    let unreadable = |source| ReadError::File { file: file.display().to_string(), source };
    Ok(std::fs::read(file).map_err(unreadable)?)
}

fn damaged(file: &Path) -> impl Fn(BadCode) -> Error {
    move |BadCode { row, code }| Error::Tape { file: file.display().to_string(), row, code }
}

/// Sends a whole job over `link`, draws it and returns the plotter's report on it, if
/// it gives one.
///
/// # Errors
/// See [`Sender`].
pub fn draw(
    link: &mut dyn Link,
    job: &dyn Lines,
    interrupt: &AtomicBool,
    progress: &mut dyn Progress,
) -> Result<Option<JobReport>, Error> {
    let mut sender = Sender::open(link, Patience::default(), interrupt)?;
    let drawn = (sender.stream(job, progress))
        .and_then(|()| sender.plot(progress))
        .and_then(|()| sender.report());
    sender.end();
    drawn
}

/// Reads `file`, tells the user what is not drawn as the file says, and chooses the settings.
fn read(file: &Path, view: &ViewArgs) -> Result<(SourceFile, Settings), Error> {
    let source = SourceFile::read(file)?;
    let settings = view.settings_on(source.page());
    note(file, source.notes());
    let moved = source.bounds().and_then(|bounds| settings.moves_plan(bounds));
    note(file, moved.as_slice());
    Ok((source, settings))
}

/// Prints notes on `file` to the standard error.
fn note(file: &Path, notes: &[String]) {
    for note in notes {
        // A closed standard error is no reason to fail.
        let _ = writeln!(io::stderr(), "penup: note: {}: {note}", file.display());
    }
}

struct Outputs {
    svg: Option<PathBuf>,
    png: Option<PathBuf>,
    json: Option<PathBuf>,
    motion: Option<PathBuf>,
}

impl Outputs {
    fn of(pictures: &PictureArgs, json: Option<&Path>, motion: Option<&Path>) -> Self {
        let mut named = Self {
            svg: pictures.svg.clone(),
            png: pictures.png.clone(),
            json: json.map(Path::to_owned),
            motion: motion.map(Path::to_owned),
        };
        if named.files().is_empty() {
            named.svg = Some("plot.svg".into());
            named.png = Some("plot.png".into());
        }
        named
    }

    fn files(&self) -> Vec<&Path> {
        let all = [&self.svg, &self.png, &self.json, &self.motion];
        all.into_iter().flatten().map(PathBuf::as_path).collect()
    }
}

/// Renders all pictures before it writes the first file. Returns the names of the files written.
fn write_pictures<'a>(picture: &Picture, outputs: &'a Outputs) -> Result<Vec<&'a Path>, Error> {
    let svg = picture.svg();
    let png = match outputs.png.as_deref() {
        Some(path) => Some((path, picture::png(&svg)?)),
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

fn summary(files: &[&Path], report: Option<JobReport>) -> String {
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let report = report.map_or("drawn".to_owned(), |report| report.to_string());
    format!("{}: {report}", names.join(", "))
}
