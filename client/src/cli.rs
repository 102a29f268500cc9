//! Defines the command line and turns its options into settings of a job.

use crate::board;
use crate::fit::{FitError, TOLERANCES};
use crate::formats;
use crate::job::Settings;
use crate::page::Page;
use crate::protocol::{TITLE, acts_at_once};
use crate::table::BoardRow;
use crate::words::told;
use clap::{Args, Parser, Subcommand, ValueEnum};
use penup::drawing::TitleText;
use penup::machine::Setting;
use penup::protocol::{Command as PlotterCommand, CommandError, Escape, LINE_LIMIT};
use std::path::PathBuf;

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
    #[arg(long, value_parser = board::parser(), default_value = board::DEFAULT, help_heading = "Plotter")]
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

/// Camera and page.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Where the eye is [default: a three-quarter view]
    #[arg(long, value_name = "X,Y,Z", value_parser = eye, allow_hyphen_values = true, help_heading = "Camera")]
    pub eye: Option<String>,
    /// The point that the eye looks at [default: the middle of the model]
    #[arg(long, value_name = "X,Y,Z", value_parser = at, allow_hyphen_values = true, help_heading = "Camera")]
    pub at: Option<String>,
    /// The direction that is up in the picture [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = up, allow_hyphen_values = true, help_heading = "Camera")]
    pub up: Option<String>,
    /// Harrison's rotation in degrees: look along z after turning by C about z, B about y, A about x
    #[arg(long, value_name = "A,B,C", value_parser = angles, allow_hyphen_values = true, help_heading = "Camera")]
    pub angles: Option<String>,
    /// perspective, orthographic, cavalier, cabinet, oblique,ANGLE,RATIO, isometric, dimetric, trimetric
    /// or axonometric,AZIMUTH,ELEVATION
    #[arg(long, value_parser = projection, default_value = "perspective", allow_hyphen_values = true,
          help_heading = "Camera")]
    pub projection: String,
    /// What becomes of what is behind the eye
    #[arg(long, value_enum, default_value = "clip", help_heading = "Camera")]
    pub behind: Behind,
    /// What hides: any faces, or nothing; or one convex solid seen from its vertices or edges alone
    #[arg(long, value_enum, default_value = "faces", help_heading = "Camera")]
    pub see: See,
    /// What to do with hidden lines: erased, dotted, dashed, shown, pen or pen,NUMBER
    #[arg(long, value_parser = hidden, default_value = "erased", help_heading = "Camera")]
    pub hidden: String,
    /// Whether the lines are drawn where faces pass through each other
    #[arg(long, value_enum, default_value = "on", help_heading = "Camera")]
    pub seams: Switch,
    /// Whether blocks that touch are drawn as one shape
    #[arg(long, value_enum, default_value = "separate", help_heading = "Camera")]
    pub blocks: Blocks,
    /// Leave out edges between faces that bend less than so many degrees
    #[arg(
        long,
        value_name = "DEGREES",
        value_parser = crease,
        default_value = "0",
        allow_hyphen_values = true,
        help_heading = "Camera"
    )]
    pub crease: String,
    /// How far coordinates may be off, in units of the model: half of the last of three or more
    /// decimals (auto), or a number; 0 takes them as they stand
    #[arg(long, value_name = "LENGTH", value_parser = precision, default_value = "auto",
          allow_hyphen_values = true, help_heading = "Camera")]
    pub precision: String,
    /// Whether the file's usemtl, or else its groups, choose pens: pen1 to pen32, or by name
    #[arg(long, value_enum, default_value = "auto", help_heading = "Page")]
    pub pens: Pens,
    /// A4, A3, Letter, or width x height in mm, such as 300x200
    #[arg(long, value_name = "PAGE", value_parser = page, default_value = "A4", allow_hyphen_values = true,
          help_heading = "Page")]
    pub page: Page,
    /// Lay the page on its long side
    #[arg(long, help_heading = "Page")]
    pub landscape: bool,
    /// What stays free on each side, in mm
    #[arg(long, value_name = "MM", value_parser = margin, default_value = "10", allow_hyphen_values = true,
          help_heading = "Page")]
    pub margin: String,
    /// Write this below the drawing
    #[arg(long, value_name = "TEXT", value_parser = title, default_value = "", hide_default_value = true,
          allow_hyphen_values = true, help_heading = "Page")]
    pub title: String,
    /// Height of the title's capitals, 1 to 100 mm
    #[arg(long, value_name = "MM", value_parser = title_size, default_value = "5", allow_hyphen_values = true,
          help_heading = "Page")]
    pub title_size: String,
    /// Scale a plan to the page, too (solids always are; plans are drawn at true size)
    #[arg(long, help_heading = "Page")]
    pub fit: bool,
    /// How the moves between strokes are chosen
    #[arg(long, value_enum, default_value = "auto", help_heading = "Order")]
    pub order: Order,
    /// Let the pen return to where it began
    #[arg(long, help_heading = "Order")]
    pub cycle: bool,
    /// Work to improve the order of many parts, for each move with the pen up; with 0 the nearest part comes next
    #[arg(
        long,
        value_name = "NUMBER",
        default_value = "4000",
        value_parser = effort,
        allow_hyphen_values = true,
        help_heading = "Order"
    )]
    pub effort: String,
    /// Extra pen-up travel that is accepted to save one pen lift, 0 to 1000 mm
    #[arg(long, value_name = "MM", value_parser = lift, default_value = "2", allow_hyphen_values = true,
          help_heading = "Order")]
    pub lift: String,
}

impl ViewArgs {
    /// The settings that these options select.
    pub fn settings(&self) -> Settings {
        let Page { width, height } = self.page;
        let page = if self.landscape {
            Page { width: width.max(height), height: width.min(height) }
        } else {
            self.page
        };
        Settings {
            eye: self.eye.clone(),
            at: self.at.clone(),
            up: self.up.clone(),
            angles: self.angles.clone(),
            projection: self.projection.clone(),
            behind: match self.behind {
                Behind::Clip => "clip",
                Behind::Refuse => "refuse",
            },
            seams: match self.seams {
                Switch::On => "on",
                Switch::Off => "off",
            },
            blocks: match self.blocks {
                Blocks::Separate => "separate",
                Blocks::Merged => "merged",
            },
            crease: self.crease.clone(),
            precision: self.precision.clone(),
            see: match self.see {
                See::Faces => "faces",
                See::Wire => "wire",
                See::Vertices => "vertices",
                See::Edges => "edges",
            },
            hidden: self.hidden.clone(),
            pens: match self.pens {
                Pens::Auto => "auto",
                Pens::One => "one",
            },
            page,
            margin: self.margin.clone(),
            title: self.title.clone(),
            title_size: self.title_size.clone(),
            fit: self.fit,
            order: match self.order {
                Order::Auto => "auto",
                Order::Greedy => "greedy",
                Order::Exact => "exact",
            },
            cycle: self.cycle,
            effort: self.effort.clone(),
            lift: self.lift.clone(),
        }
    }
}

/// Defines a parser for each option whose value the plotter's own parser checks. The text is the
/// valid range, for the error message.
macro_rules! read_by_the_plotter {
    ($($option:ident: $range:literal),* $(,)?) => {
        $(fn $option(text: &str) -> Result<String, String> {
            within($range, understood(stringify!($option), text))
        })*
    };
}

read_by_the_plotter!(
    eye: "three numbers, -1e15 to 1e15",
    at: "three numbers, -1e15 to 1e15",
    up: "three numbers, -1e15 to 1e15",
    angles: "three numbers, -1e15 to 1e15",
    projection: "angles up to 360 degrees, elevations up to 90, a ratio of 0 to 2",
    hidden: "pens 1 to 32",
    crease: "0 to 180 degrees",
    precision: "auto, or 0 to 1e6",
    margin: "0 to 32767 mm",
    effort: "a whole number, 0 to 2147483647",
    lift: "0 to 1000 mm",
);

/// Adds the valid range to the error message.
fn within(range: &str, value: Result<String, String>) -> Result<String, String> {
    value.map_err(|reason| format!("{reason} (expected: {range})"))
}

fn title(text: &str) -> Result<String, String> {
    let line = format!("{TITLE}={}", Escape(text));
    if line.len() > LINE_LIMIT {
        return Err(
            "it is too long: letters beyond ASCII take four to eight bytes of a line".to_owned()
        );
    }
    match PlotterCommand::parse(&line).map_err(|refusal| told(&refusal.to_string()))? {
        // The title is short enough.
        PlotterCommand::Title(letters) if TitleText::new(letters.letters()).is_some() => {
            Ok(text.to_owned())
        }
        _ => Err(CommandError::TitleTooLong { limit: TitleText::LIMIT }.to_string()),
    }
}

fn title_size(text: &str) -> Result<String, String> {
    within("1 to 100 mm", understood("title-size", text))
}

/// Checks the value of an option with the plotter's own parser and returns it unchanged.
fn understood(option: &str, text: &str) -> Result<String, String> {
    // These letters are refused even in a comment.
    if text.contains(|letter| letter == '#' || acts_at_once(letter)) {
        return Err("no value has such a letter".to_owned());
    }
    let line = format!("${option}={text}");
    if line.len() > LINE_LIMIT {
        return Err(CommandError::LineTooLong { limit: LINE_LIMIT }.to_string());
    }
    match PlotterCommand::parse(&line) {
        Ok(_) => Ok(text.to_owned()),
        Err(refusal) => Err(told(&refusal.to_string())),
    }
}

/// How the moves between strokes are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Order {
    /// Exact where it fits in memory, else greedy
    Auto,
    /// Greedy with regret, then pair exchange
    Greedy,
    /// At the least length
    Exact,
}

/// Whether blocks that touch are one shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Blocks {
    /// Each has all its edges
    Separate,
    /// No line is drawn between two faces in one plane
    Merged,
}

/// Who chooses pens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Pens {
    /// The file
    Auto,
    /// Nobody: one pen draws all
    One,
}

/// On or off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Yes
    On,
    /// No
    Off,
}

/// What becomes of what is behind the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Behind {
    /// It is cut off
    Clip,
    /// Nothing is drawn
    Refuse,
}

/// How it is found out what is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum See {
    /// Faces hide what is behind them
    Faces,
    /// Nothing hides anything: a wire frame
    Wire,
    /// One convex solid, from its vertices alone
    Vertices,
    /// One convex solid, from its vertices and edges
    Edges,
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("\"{text}\" is not a number")),
    }
}

fn page(text: &str) -> Result<Page, String> {
    let (width, height) = match text.to_ascii_lowercase().as_str() {
        "a4" => (210.0, 297.0),
        "a3" => (297.0, 420.0),
        "letter" => (215.9, 279.4),
        other => {
            let (width, height) = other
                .split_once('x')
                .ok_or("it is none of A4, A3, Letter, or width x height in mm such as 300x200")?;
            within("each side up to 32767 mm", understood("page", other))?;
            (number(width)?, number(height)?)
        }
    };
    Ok(Page { width, height })
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

    fn settings(options: &[&str]) -> Result<Settings, String> {
        let line = ["penup", "preview", "f.obj"].iter().chain(options);
        let cli = Cli::try_parse_from(line).map_err(|error| error.to_string())?;
        match cli.command {
            Command::Preview(args) => Ok(args.view.settings()),
            _ => Err("the wrong command".to_owned()),
        }
    }

    #[test]
    fn the_options_do_not_contradict_each_other() {
        Cli::command().debug_assert();
    }

    #[test]
    fn negative_numbers_work_with_a_space_and_with_an_equals_sign() {
        let spaced = settings(&["--eye", "-3,-4,2.5", "--at", "-.5,0,-1e-1", "--up", "-1,-2,-3"]);
        let joined = settings(&["--eye=-3,-4,2.5", "--at=-.5,0,-1e-1", "--up=-1,-2,-3"]);
        assert_eq!(spaced, joined);
        let settings = spaced.expect("good options");
        assert_eq!(settings.eye.as_deref(), Some("-3,-4,2.5"));
        assert_eq!(settings.at.as_deref(), Some("-.5,0,-1e-1"));
        assert_eq!(settings.up.as_deref(), Some("-1,-2,-3"));
    }

    #[test]
    fn pages_have_names_or_sizes_and_lie_either_way() {
        let size = |options: &[&str]| {
            let page = settings(options).expect("good options").page;
            (page.width, page.height)
        };
        assert_eq!(size(&[]), (210.0, 297.0));
        assert_eq!(size(&["--landscape"]), (297.0, 210.0));
        assert_eq!(size(&["--page", "a3"]), (297.0, 420.0));
        assert_eq!(size(&["--page=Letter", "--landscape"]), (279.4, 215.9));
        assert_eq!(size(&["--page", "80.5x60"]), (80.5, 60.0));
        assert_eq!(size(&["--page", "60X80", "--landscape"]), (80.0, 60.0));
    }

    /// A title with one letter more than allowed.
    const LONG: &str =
        "0123456789 123456789 123456789 123456789 123456789 123456789 123456789 1234567890";

    #[test]
    fn a_title_may_have_any_letter_of_the_font() {
        let title = "Café – 3 % \\ #1: ¿sí? ~ «ÿ»!";
        let settings = settings(&["--title", title, "--title-size=12.5"]).expect("good options");
        assert_eq!((settings.title.as_str(), settings.title_size.as_str()), (title, "12.5"));
    }

    #[test]
    fn numbers_may_have_exponents_of_any_size() {
        let options = ["--eye", "1e-300,2,3", "--effort", "1e3", "--lift=25e-1", "--page=2e2x3e2"];
        let settings = settings(&options).expect("good options");
        assert_eq!(settings.eye.as_deref(), Some("1e-300,2,3"));
        assert_eq!((settings.effort.as_str(), settings.lift.as_str()), ("1e3", "25e-1"));
        assert_eq!((settings.page.width, settings.page.height), (200.0, 300.0));
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

    const NUMBER: &str = "a number is written like -12.5 or 3e-2";
    const RANGE: &str = "the number is too large, too small or has the wrong sign";

    #[test]
    fn nonsense_is_refused_with_the_reason() {
        for (options, reason) in [
            (["--eye", "1,2"], "it takes 3 numbers"),
            (["--eye", "1,2,3,4"], "it takes 3 numbers"),
            (["--eye", "1,,3"], NUMBER),
            (["--eye", "1e308,0,0"], RANGE),
            (["--eye", "1,2,3#4"], "no value has such a letter"),
            (["--eye", "1,2,3\n"], "no value has such a letter"),
            (["--eye", &format!("1,2,{}", "0".repeat(300))], "a line has at most 256 bytes"),
            (["--at", "1,2,nan"], NUMBER),
            (["--up", "--fit"], NUMBER),
            (["--angles", "1e300,0,0"], RANGE),
            (["--crease", "nan"], NUMBER),
            (["--crease", "-5"], RANGE),
            (["--crease", "500"], RANGE),
            (["--page", "B5"], "none of A4"),
            (["--page", "-10x20"], RANGE),
            (["--page", "10xinf"], NUMBER),
            (["--page", "1e9x1e9"], RANGE),
            (["--page", "1e-9x100"], RANGE),
            (["--margin", "-1"], RANGE),
            (["--margin", "1e308"], RANGE),
            (["--effort", "-1"], RANGE),
            (["--effort", "1e12"], RANGE),
            (["--effort", "1.5"], "(expected: a whole number, 0 to 2147483647)"),
            (["--effort", "much"], NUMBER),
            (["--title-size", "101"], "(expected: 1 to 100 mm)"),
            (["--title", "a→b"], "the font lacks → (U+2192)"),
            (["--title", "line\nline"], "the font lacks"),
            (["--title", LONG], "at most 80 bytes"),
            (["--title-size", "0.5"], RANGE),
            (["--lift", "-1"], RANGE),
            (["--lift", "1001"], RANGE),
            (["--repeat", "0"], "0 is not in 1.."),
            (["--repeat", "-1"], "-1 is not in 1.."),
            (["--hidden", "gone"], "erased, dotted, dashed, shown"),
        ] {
            let error = settings(&options).expect_err("refused");
            assert!(error.contains(reason), "{options:?}: {error}");
            assert!(error.contains(&format!("'{} ", options[0])), "{options:?}: {error}");
        }
    }
}
