//! Defines the command line and turns its options into settings of a job.

mod view;

pub use view::ViewArgs;

use crate::board;
use crate::fit::{FitError, TOLERANCES};
use crate::formats;
use crate::motion_plot::GivenSetting;
use crate::page::Page;
use crate::table::BoardRow;
use clap::{Args, Parser, Subcommand};
use penup::machine::Setting;
use std::path::PathBuf;
use view::page;

/// Draws solids and line drawings with a penup plotter.
#[derive(Debug, Parser)]
#[command(name = "penup", version, propagate_version = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Send a file to a plotter, real or emulated, and draw it
    Plot(PlotArgs),
    /// Show what would be drawn, without a plotter
    Preview(PreviewArgs),
    /// Turn the traced polylines of a plan into few B-spline control points
    Fit(FitArgs),
    /// Record a job as Harrison's tape of single motor steps, and read such tapes
    #[command(subcommand)]
    Tape(TapeCommand),
}

/// What to do with a tape.
#[derive(Debug, Subcommand)]
pub enum TapeCommand {
    /// Record the job of a file as a tape
    Encode(Box<TapeEncodeArgs>),
    /// Print the instructions of a tape
    Decode {
        /// The tape
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
    /// Show what a tape draws
    Show(TapeShowArgs),
}

/// Options of `penup tape encode`.
#[derive(Debug, Args)]
pub struct TapeEncodeArgs {
    /// The file to record.
    #[arg(value_name = "FILE", help = file_help("The file to record"))]
    pub file: PathBuf,
    /// The tape to write [default: beside the file, with the ending .tape]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
}

/// Options of `penup tape show`.
#[derive(Debug, Args)]
pub struct TapeShowArgs {
    /// The tape
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// The page: A4, A3, Letter, or width x height in mm
    #[arg(long, value_name = "PAGE", value_parser = page, default_value = "A4")]
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
    format!("{what}: {}", formats::list())
}

/// Options of `penup plot`.
#[derive(Debug, Args)]
pub struct PlotArgs {
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
    /// The serial port of a real plotter, such as /dev/ttyUSB0 or COM3
    #[arg(
        long,
        value_name = "DEVICE",
        conflicts_with_all = ["board", "svg", "png"],
        help_heading = "Plotter"
    )]
    pub port: Option<String>,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
    /// The pictures to write.
    #[command(flatten)]
    pub pictures: PictureArgs,
}

/// Options of `penup preview`.
#[derive(Debug, Args)]
pub struct PreviewArgs {
    /// The file to show.
    #[arg(value_name = "FILE", help = file_help("The file to show"))]
    pub file: PathBuf,
    /// The camera, the page and the order of the strokes.
    #[command(flatten)]
    pub view: ViewArgs,
    /// The pictures to write.
    #[command(flatten)]
    pub pictures: PictureArgs,
    /// Write the segments, strokes, lengths and computing times to this file as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub json: Option<PathBuf>,
    /// Plot speed, acceleration and jerk over time to this SVG file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub motion: Option<PathBuf>,
    /// Plot the motion of a machine with this setting, for example 204=20; can be repeated
    #[arg(
        long,
        value_name = "NUMBER=VALUE",
        value_parser = GivenSetting::parse,
        requires = "motion",
        help_heading = "Output"
    )]
    pub set: Vec<GivenSetting>,
    /// Compute the drawing this many times and report the shortest time of each stage
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        value_parser = clap::value_parser!(u32).range(1..),
        allow_hyphen_values = true,
        help_heading = "Output"
    )]
    pub repeat: u32,
}

/// Options of `penup fit`.
#[derive(Debug, Args)]
pub struct FitArgs {
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
    /// The OBJ file to write [default: FILE with -fitted in its name]
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// The pictures to write; `plot.svg` and `plot.png` if no output is named.
#[derive(Debug, Args)]
pub struct PictureArgs {
    /// Write the picture as SVG [default: plot.svg and plot.png if no output is named]
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
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_options_do_not_contradict_each_other() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_tape_has_steps_that_a_plotter_makes() {
        let steps = |steps: &str| {
            Cli::try_parse_from(["penup", "tape", "show", "f.tape", "--steps", steps])
                .map(drop)
                .map_err(|error| error.to_string())
        };
        for good in ["2", "80", "4000", "88.9"] {
            assert_eq!(steps(good), Ok(()));
        }
        for (bad, reason) in [
            ("0", "2 to 4000 steps"),
            ("-80", "2 to 4000 steps"),
            ("1e300", "2 to 4000 steps"),
            ("nan", "\"nan\" is not a number"),
        ] {
            let error = steps(bad).expect_err("refused");
            assert!(error.contains(reason) && error.contains("--steps <N>"), "{error}");
        }
    }

    #[test]
    fn a_preview_runs_at_least_once() {
        for times in ["0", "-1"] {
            let line = ["penup", "preview", "f.obj", "--repeat", times];
            let error = Cli::try_parse_from(line).expect_err("refused").to_string();
            assert!(error.contains(&format!("{times} is not in 1..")), "{error}");
            assert!(error.contains("'--repeat "), "{error}");
        }
    }
}
