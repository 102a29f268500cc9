//! Defines the command line and turns its options into settings of a job.

mod machine;
pub mod page;
mod view;

pub use machine::{
    AgainArgs, ConsoleArgs, FormatArgs, JogArgs, PauseArgs, PenArgs, PenPosition, PlotterArgs,
    PortArgs, PortsArgs, RejoinArgs, ResumeArgs, SetArgs, SettingsCommand, WatchArgs,
};
pub use page::PageArgs;
pub use view::ViewArgs;

use crate::board;
use crate::compute::Compute;
use crate::error::{EXIT_CODES, ExitCode};
use crate::files::STANDARD_INPUT;
use crate::fit::{FitError, TOLERANCES};
use crate::machine_settings::AssignedSetting;
use crate::table::BoardRow;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use penup::machine::Setting;
use penup_readers::page::Page;
use std::path::PathBuf;
use view::page as page_size;

/// Draws solids and line drawings with a penup plotter.
#[derive(Debug, Parser)]
#[command(name = "penup", version, propagate_version = true, after_long_help = exit_codes())]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Say nothing but errors and what was asked for: no progress, notes or closing sentence
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// The exit codes, for the help.
fn exit_codes() -> String {
    let line = |code: &ExitCode| format!("{:>5}  {}", code.number, code.meaning);
    format!("Exit codes:\n{}", EXIT_CODES.iter().map(line).collect::<Vec<_>>().join("\n"))
}

impl Cli {
    /// Whether the result, or the error, is printed as JSON.
    pub fn is_json(&self) -> bool {
        self.command.format().is_some_and(|format| format.json)
    }
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Send a file to a plotter, real or emulated, and draw it
    Plot(PlotArgs),
    /// Show what would be drawn, without a plotter
    Preview(PreviewArgs),
    /// Show a page in the browser: turn the model, look at the drawing, and plot it
    Page(PageArgs),
    /// Turn the traced polylines of a plan into few B-spline control points
    Fit(FitArgs),
    /// Record a job as Harrison's tape of single motor steps, and read such tapes
    #[command(subcommand)]
    Tape(TapeCommand),
    /// List the serial ports and what answers there
    Ports(PortsArgs),
    /// Ask a plotter what it does
    Status(PlotterArgs),
    /// Follow a job that a plotter draws, whoever has sent it
    Watch(WatchArgs),
    /// Pause a job: the machine slows down and raises the pen
    Pause(PauseArgs),
    /// Go on with a job that holds, waits for a pen, or was stopped by a loss of power
    Resume(ResumeArgs),
    /// Give a job up: the machine slows down and raises the pen
    Abort(PlotterArgs),
    /// Find the limit switches
    Home(PlotterArgs),
    /// Unlock a machine after an alarm, or wake it
    Unlock(PlotterArgs),
    /// Move the raised pen by hand
    Jog(JogArgs),
    /// Raise the pen, or lower it for a moment
    Pen(PenArgs),
    /// Change settings of the machine
    Set(SetArgs),
    /// List, save and restore the settings of the machine
    #[command(subcommand)]
    Settings(SettingsCommand),
    /// Draw the last job again, which the plotter has kept
    Again(AgainArgs),
    /// Set up a new machine step by step: directions, steps in a mm, pen, origin, test square
    Setup(PlotterArgs),
    /// Draw squares that show at what frequency the machine shakes, for input shaping
    Shake(PlotterArgs),
    /// Talk to a plotter line by line
    Console(ConsoleArgs),
    /// Print the completions for a shell
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: Shell,
        /// How the answer is printed.
        #[command(flatten)]
        format: FormatArgs,
    },
    /// Print the manual page, or write those of all commands
    Man {
        /// The folder to write penup.1, penup-plot.1 and the others to
        #[arg(value_name = "FOLDER")]
        folder: Option<PathBuf>,
        /// How the answer is printed.
        #[command(flatten)]
        format: FormatArgs,
    },
}

impl Command {
    /// How the answer is printed; `None` if there is no choice.
    fn format(&self) -> Option<&FormatArgs> {
        Some(match self {
            Self::Plot(args) => &args.format,
            Self::Fit(args) => &args.format,
            Self::Tape(TapeCommand::Encode(args)) => &args.format,
            Self::Tape(TapeCommand::Show(args)) => &args.format,
            Self::Ports(args) => &args.format,
            Self::Watch(WatchArgs { plotter, .. })
            | Self::Again(AgainArgs { plotter, .. })
            | Self::Pause(PauseArgs { plotter, .. })
            | Self::Resume(ResumeArgs { plotter, .. })
            | Self::Jog(JogArgs { plotter, .. })
            | Self::Pen(PenArgs { plotter, .. })
            | Self::Set(SetArgs { plotter, .. })
            | Self::Settings(
                SettingsCommand::Show(plotter)
                | SettingsCommand::Save { plotter, .. }
                | SettingsCommand::Restore { plotter, .. },
            )
            | Self::Status(plotter)
            | Self::Abort(plotter)
            | Self::Home(plotter)
            | Self::Unlock(plotter)
            | Self::Setup(plotter)
            | Self::Shake(plotter) => &plotter.format,
            Self::Tape(TapeCommand::Decode { format, .. })
            | Self::Completions { format, .. }
            | Self::Man { format, .. } => format,
            Self::Console(args) => &args.format,
            Self::Page(args) => &args.format,
            // Its --json names a file for all that is known of the drawing.
            Self::Preview(_) => return None,
        })
    }
}

/// What to do with a tape.
#[derive(Debug, Subcommand)]
pub enum TapeCommand {
    /// Record the job of a file as a tape
    Encode(Box<TapeEncodeArgs>),
    /// Print the instructions of a tape
    Decode {
        /// The tape; - is the standard input
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// How the answer is printed.
        #[command(flatten)]
        format: FormatArgs,
    },
    /// Show what a tape draws
    Show(TapeShowArgs),
}

/// Options of `penup tape encode`.
#[derive(Debug, Args)]
pub struct TapeEncodeArgs {
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// The file to record.
    #[arg(value_name = "FILE", help = file_help("The file to record"))]
    pub file: PathBuf,
    /// The tape to write; - is the standard output [default: beside the file, with the ending
    /// .tape]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
}

/// Options of `penup tape show`.
#[derive(Debug, Args)]
pub struct TapeShowArgs {
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// The tape; - is the standard input
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// The page: A0 to A6, Letter, Legal, Tabloid, or its size such as 300x200, 11x17in
    #[arg(long, value_name = "PAGE", value_parser = page_size, default_value = "A4")]
    pub page: Page,
    /// The number of motor steps in a millimetre, 2 to 4000
    #[arg(
        long,
        value_name = "N",
        value_parser = steps,
        default_value = "80",
        allow_hyphen_values = true
    )]
    pub steps: f64,
    /// The pictures to write.
    #[command(flatten)]
    pub pictures: PictureArgs,
}

/// The help for a file that is read, with the formats that it may have.
fn file_help(what: &str) -> String {
    format!("{what}: {}; {STANDARD_INPUT} is the standard input", penup_readers::list())
}

/// The options for an emulated board, with which none for a real plotter can be used.
///
/// What needs a port must name them itself: of two options that exclude each other, clap asks for
/// neither.
const EMULATED: [&str; 3] = ["board", "svg", "png"];

/// Options of `penup plot`.
#[derive(Debug, Args)]
#[command(mut_arg("rejoin", |rejoin| rejoin.requires("port").conflicts_with_all(EMULATED)))]
pub struct PlotArgs {
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// The file to draw; the default is an example.
    #[arg(
        value_name = "FILE",
        help = file_help("The file to draw") + " [default: two boxes that pass through each other]"
    )]
    pub file: Option<PathBuf>,
    /// The board to emulate; the picture is drawn from its pins
    #[arg(
        long,
        value_parser = board::parser(),
        default_value = board::DEFAULT,
        help_heading = "Plotter"
    )]
    pub board: &'static BoardRow,
    /// The serial port of a real plotter.
    #[arg(
        long,
        value_name = "DEVICE",
        help = machine::port_help(),
        conflicts_with_all = EMULATED,
        help_heading = "Plotter"
    )]
    pub port: Option<String>,
    /// Where the drawing is computed
    #[arg(
        long,
        value_enum,
        value_name = "WHERE",
        default_value = "auto",
        help_heading = "Plotter"
    )]
    pub compute: Compute,
    /// Leave out so many strokes at the beginning, in the order of --compute host, by which this
    /// computer then draws. The plotter draws in another order what it computes itself: `penup
    /// resume` goes on with that. 0 draws all of a drawing that the plotter has stopped
    #[arg(long, value_name = "STROKES", allow_hyphen_values = true, help_heading = "Plotter")]
    pub from: Option<u32>,
    /// Begin closed lines at random points, so that the marks of the pen do not stand in a row;
    /// this computer then computes the drawing. Else they begin where the moves between lines
    /// become short
    #[arg(long, help_heading = "Plotter")]
    pub reloop: bool,
    /// Go on with this drawing where a loss of power or a reset has stopped it while this computer
    /// sent it, with the same options; the machine is homed before, by `penup home`
    #[arg(
        long,
        requires = "port",
        conflicts_with_all = ["from", "multipass"],
        conflicts_with_all = EMULATED,
        help_heading = "Plotter"
    )]
    pub resume: bool,
    /// The pen has been put at the origin of the page by hand, for machines that cannot be homed
    #[arg(
        long,
        requires = "resume",
        conflicts_with_all = ["from", "multipass"],
        conflicts_with_all = EMULATED,
        help_heading = "Plotter"
    )]
    pub at_origin: bool,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
    /// The pictures to write.
    #[command(flatten)]
    pub pictures: PictureArgs,
    /// How often everything is drawn.
    #[command(flatten)]
    pub passes: PassesArgs,
    /// How long a plotter that is gone is waited for.
    #[command(flatten)]
    pub rejoin: RejoinArgs,
}

impl PlotArgs {
    /// How many strokes are left out at the beginning.
    pub fn left_out(&self) -> u32 {
        self.from.unwrap_or(0)
    }
}

/// How often everything is drawn.
#[derive(Debug, Args)]
pub struct PassesArgs {
    /// Draw everything this many times; a plotter draws the whole again, and --gcode and --hpgl
    /// draw each line again without lifting the pen
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        value_parser = clap::value_parser!(u32).range(1..=100),
        allow_hyphen_values = true,
        help_heading = "Drawing"
    )]
    pub multipass: u32,
}

/// What the help of `penup preview` says besides the options.
const PREVIEW_ENDS: &str = "\
The machine is the default one, or that of --machine and --set. A page larger than the travel of \
the default machine is previewed with a note, on a machine that holds it; say the travel of yours \
by --machine FILE, or by --set 130=MM --set 131=MM. `penup plot` draws on the machine that is \
there, and refuses what its travel does not hold.";

/// Options of `penup preview`.
#[derive(Debug, Args)]
#[command(after_long_help = PREVIEW_ENDS)]
pub struct PreviewArgs {
    /// The file to show.
    #[arg(value_name = "FILE", help = file_help("The file to show"))]
    pub file: PathBuf,
    /// Compute with the memory and the limits of this board [default: those of this computer]
    #[arg(long, value_parser = board::parser(), help_heading = "Plotter")]
    pub board: Option<&'static BoardRow>,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
    /// The pictures to write.
    #[command(flatten)]
    pub pictures: PictureArgs,
    /// How often everything is drawn.
    #[command(flatten)]
    pub passes: PassesArgs,
    /// Write the page, segments, strokes, lengths, bounds and times to this file as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub json: Option<PathBuf>,
    /// Write the drawing for a Grbl machine whose M3 lowers the pen
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub gcode: Option<PathBuf>,
    /// Write the drawing as HP-GL, in units of 0.025 mm
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub hpgl: Option<PathBuf>,
    /// Begin closed lines at random points, so that the marks of the pen do not stand in a row, as
    /// `penup plot --reloop` does; else they begin where the moves between lines become short
    #[arg(long, help_heading = "Drawing")]
    pub reloop: bool,
    /// Plot speed, acceleration and jerk over time to this SVG file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub motion: Option<PathBuf>,
    /// Preview a machine with the settings of this file of `penup settings save`
    #[arg(long, value_name = "FILE", help_heading = "Machine")]
    pub machine: Option<PathBuf>,
    /// Preview a machine with this setting, for example 204=20; can be repeated
    #[arg(
        long,
        value_name = "NUMBER=VALUE",
        value_parser = AssignedSetting::parse,
        help_heading = "Machine"
    )]
    pub set: Vec<AssignedSetting>,
    /// Compute the drawing this many times and report the shortest time of each stage in --json
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        value_parser = clap::value_parser!(u32).range(1..),
        allow_hyphen_values = true,
        requires = "json",
        help_heading = "Output"
    )]
    pub repeat: u32,
}

/// Options of `penup fit`.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// The file with the polylines, a plan in mm.
    #[arg(value_name = "FILE", help = file_help("The file with the polylines, a plan in mm"))]
    pub file: PathBuf,
    /// The largest distance allowed between a curve and its polyline
    #[arg(
        long,
        value_name = "MM",
        default_value = "0.1",
        value_parser = tolerance,
        allow_hyphen_values = true
    )]
    pub tolerance: f64,
    /// The OBJ file to write; - is the standard output [default: FILE with -fitted in its name]
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// The pictures to write; `plot.svg` and `plot.png` if no output is named. `-` is the standard
/// output.
#[derive(Debug, Args)]
pub struct PictureArgs {
    /// Write the picture as SVG; - is the standard output, here and for every other file [default:
    /// plot.svg and plot.png if no output is named]
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub svg: Option<PathBuf>,
    /// Write the picture as PNG
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub png: Option<PathBuf>,
}

/// Parses a finite number.
fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("\"{text}\" is not a number")),
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    match number(text)? {
        tolerance if TOLERANCES.contains(&tolerance) => Ok(tolerance),
        _ => Err(FitError::Tolerance.to_string()),
    }
}

fn steps(text: &str) -> Result<f64, String> {
    let limits = Setting::StepsPerMmX.info();
    let (least, most) = (limits.least.to_num::<f64>(), limits.greatest.to_num::<f64>());
    match number(text)? {
        steps if (least..=most).contains(&steps) => Ok(steps),
        _ => Err(format!("a plotter makes {least} to {most} steps in a millimetre")),
    }
}

#[cfg(test)]
mod tests;
