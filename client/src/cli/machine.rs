//! The arguments of the commands that ask or move a plotter.

use super::number;
use crate::keyboard::KEYS;
use crate::machine_settings::AssignedSetting;
use crate::ports::{AUTOMATIC, PORTS_VARIABLE};
use clap::{Args, Subcommand, ValueEnum};
use penup::machine::Setting;
use std::path::PathBuf;

/// How the plotter is found.
#[derive(Debug, Args)]
pub struct PortArgs {
    /// The serial port of the plotter, such as /dev/ttyUSB0 or COM3.
    #[arg(long, value_name = "DEVICE", help = port_help(), default_value = AUTOMATIC)]
    pub port: String,
}

/// How the plotter is found, and how its answer is printed.
#[derive(Debug, Args)]
pub struct PlotterArgs {
    /// How the plotter is found.
    #[command(flatten)]
    pub port: PortArgs,
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
}

/// Options of `penup console`.
#[derive(Debug, Args)]
pub struct ConsoleArgs {
    /// How the plotter is found.
    #[command(flatten)]
    pub port: PortArgs,
    /// How the answers are printed.
    #[command(flatten)]
    pub format: FormatArgs,
}

/// How long a plotter that is gone is waited for.
#[derive(Debug, Args)]
pub struct RejoinArgs {
    /// How long to wait for the plotter if its port vanishes or it falls silent in the middle of a
    /// job; 0 gives up at once
    #[arg(
        long,
        value_name = "SECONDS",
        default_value = "300",
        value_parser = clap::value_parser!(u64).range(..=604_800),
        allow_hyphen_values = true,
        help_heading = "Plotter"
    )]
    pub rejoin: u64,
}

/// How an answer is printed.
#[derive(Debug, Args)]
pub struct FormatArgs {
    /// Print the result, or the error, as JSON
    #[arg(long)]
    pub json: bool,
}

pub(super) fn port_help() -> String {
    format!(
        "The serial port of the plotter, such as /dev/ttyUSB0 or COM3; {AUTOMATIC} is the only \
         plotter that answers at the ports on USB, or at those in {PORTS_VARIABLE}"
    )
}

/// Options of `penup ports`.
#[derive(Debug, Args)]
pub struct PortsArgs {
    /// How the answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
}

/// Options of `penup watch`.
#[derive(Debug, Args)]
#[command(after_help = format!("Keys: {KEYS}, and Ctrl-C leaves the plotter drawing."))]
pub struct WatchArgs {
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
    /// How long a plotter that is gone is waited for.
    #[command(flatten)]
    pub rejoin: RejoinArgs,
}

/// Options of `penup again`.
#[derive(Debug, Args)]
#[command(after_help = format!("Keys: {KEYS}, and Ctrl-C stops with the pen up."))]
pub struct AgainArgs {
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
    /// How long a plotter that is gone is waited for.
    #[command(flatten)]
    pub rejoin: RejoinArgs,
}

/// Options of `penup pause`.
#[derive(Debug, Args)]
pub struct PauseArgs {
    /// Draw to the end of the stroke first
    #[arg(long)]
    pub after_stroke: bool,
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
}

/// Options of `penup resume`.
#[derive(Debug, Args)]
#[command(after_help = format!(
    "A job that a loss of power or a reset has stopped goes on at the stroke that was being drawn. \
     The machine is homed first, by `penup home`; without limit switches put the pen at the origin \
     by hand and say so by --at-origin.\n\nKeys: {KEYS}. Ctrl-C stops such a job, with the pen up; \
     do the same again to go on with it."
))]
pub struct ResumeArgs {
    /// The pen has been put at the origin of the page by hand
    #[arg(long)]
    pub at_origin: bool,
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
    /// How long a plotter that is gone is waited for.
    #[command(flatten)]
    pub rejoin: RejoinArgs,
}

/// Options of `penup jog`.
#[derive(Debug, Args)]
pub struct JogArgs {
    /// The way to the right in mm; negative to the left
    #[arg(value_name = "X", value_parser = number, allow_hyphen_values = true)]
    pub x: f64,
    /// The way up in mm; negative down
    #[arg(value_name = "Y", value_parser = number, allow_hyphen_values = true)]
    pub y: f64,
    /// The speed
    #[arg(long, value_name = "MM/MIN", default_value = "1500", value_parser = speed)]
    pub speed: f64,
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
}

/// Options of `penup pen`.
#[derive(Debug, Args)]
pub struct PenArgs {
    /// What the pen does
    #[arg(value_enum)]
    pub to: PenPosition,
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
}

/// What the pen does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PenPosition {
    /// Raises the pen
    Up,
    /// Lowers the pen for a moment; the plotter raises it again while it has nothing to draw
    Down,
}

/// Options of `penup set`.
#[derive(Debug, Args)]
pub struct SetArgs {
    /// The settings, for example 100=88.9; `penup settings show` lists them
    #[arg(value_name = "NUMBER=VALUE", required = true, value_parser = AssignedSetting::parse)]
    pub settings: Vec<AssignedSetting>,
    /// The plotter.
    #[command(flatten)]
    pub plotter: PlotterArgs,
}

/// What to do with the settings of the machine.
#[derive(Debug, Subcommand)]
pub enum SettingsCommand {
    /// List the settings with their values
    Show(PlotterArgs),
    /// Save the settings as TOML
    Save {
        /// The file to write [default: the standard output]
        #[arg(value_name = "FILE")]
        file: Option<PathBuf>,
        /// The plotter.
        #[command(flatten)]
        plotter: PlotterArgs,
    },
    /// Set what a file saved before says; other settings stay
    Restore {
        /// The file to read
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// The plotter.
        #[command(flatten)]
        plotter: PlotterArgs,
    },
}

fn speed(text: &str) -> Result<f64, String> {
    let most = Setting::MaxRateX.info().greatest.to_num::<f64>();
    match number(text)? {
        speed if (1.0..=most).contains(&speed) => Ok(speed),
        _ => Err(format!("a speed is 1 to {most} mm/min")),
    }
}
