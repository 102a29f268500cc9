//! The development tool of penup: it sets up, builds, tests, emulates and flashes. `cargo xtask`
//! lists its commands.
//!
//! Every command installs what it lacks and says so. If it cannot install something, it names it,
//! with the command that does. A second run finds everything and installs nothing.
//!
//! Messages go through `say!`, because the standard library's macros panic if the output has been
//! closed.
#![warn(clippy::print_stdout, clippy::print_stderr)]

/// Prints a line to the standard output; see [`command::say`].
macro_rules! say {
    ($($text:tt)*) => { crate::command::say(format_args!($($text)*)) };
}

mod bench;
mod beside;
mod command;
mod corpus;
mod dependencies;
mod dist;
mod experiments;
mod flash;
mod firmware;
mod fuzz;
mod gallery;
mod growth;
mod large;
mod mutants;
mod page;
mod panics;
mod python;
mod senders;
mod set_up;
mod side_by_side;
mod test;
mod uf2;
// This file belongs to the client. xtask builds the client as a command, so it does not depend on
// it as a crate.
#[path = "../../client/src/workspace.rs"]
mod workspace;
// So do the names of the boards on command lines.
#[path = "../../client/src/board.rs"]
mod board;
// The table belongs to the library, which is large; the table depends on nothing.
#[path = "../../src/board_table.rs"]
mod table;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result};
use clap::{CommandFactory, Parser, Subcommand};

use command::{cargo, describe};
use table::{BOARDS, BoardRow, Emulator};

/// Builds, tests and runs penup.
#[derive(Parser)]
#[command(bin_name = "cargo xtask", about, disable_help_subcommand = true)]
struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
}

#[derive(Subcommand)]
enum Task {
    /// Builds a board's firmware and checks the image.
    Build {
        /// The board to build for.
        #[arg(long, value_parser = board::parser(), default_value = board::DEFAULT)]
        board: &'static BoardRow,
    },
    /// Builds a board's firmware and writes it to the board that is connected.
    Flash {
        /// The board to flash.
        #[arg(long, value_parser = board::parser(), default_value = flash::default_board())]
        board: &'static BoardRow,
    },
    /// Builds the client, the page and the images of the boards, and puts them into target/dist
    /// with manual pages and completions, for a computer of the same kind that has no compiler.
    Dist,
    /// Plots FILE on the emulated board; the same as `cargo plot`. Its own --help says how.
    #[command(disable_help_flag = true)]
    Plot {
        /// The file, and the options of `penup plot`.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Builds the page as static files for any web server, into target/page.
    Page,
    /// Tests the page in Chromium, which it installs if need be.
    PageTest(page::TestArguments),
    /// Counts the instructions of each stage on a Cortex-M3, or the cycles on a board, for every
    /// lattice.
    Bench {
        /// A board that QEMU emulates stands for its core; of another one, cycles are counted.
        #[arg(long, value_parser = board::parser(), default_value = board::DEFAULT)]
        board: &'static BoardRow,
        /// Those of planning for each step event alone, on the Cortex-M3.
        #[arg(long, conflicts_with = "board")]
        motion: bool,
        /// Times on this computer beside Open CASCADE and vpype, which it installs into
        /// target/beside (some 10 minutes).
        #[arg(long, conflicts_with_all = ["board", "motion"])]
        beside: bool,
        /// How the instructions for a face or a stroke grow with a drawing on this computer, and
        /// the pictures of it in docs; needs valgrind (most of an hour).
        #[arg(long, conflicts_with_all = ["board", "motion", "beside"])]
        growth: bool,
    },
    /// Prints how deep the stacks of the emulated boards become over the heaviest jobs (some 2
    /// minutes).
    Stack,
    /// Draws the figures of the papers into docs/gallery, and README's picture.
    Gallery,
    /// Repeats Harrison's experiments (his chapter 7), counted in instructions.
    Experiments,
    /// Compares hidden lines on many random scenes with an exact model.
    Scenes {
        /// How many scenes.
        #[arg(default_value_t = 20_000)]
        count: u32,
    },
    /// Compares many random convex solids, from vertices and from edges, with an exact model.
    Solids {
        /// How many solids of each kind (some minutes for 100,000).
        #[arg(default_value_t = 100_000)]
        count: u32,
    },
    /// Draws random jobs with random settings, orders and lateness, and prints how near speed,
    /// acceleration and jerk come to their limits.
    MotionSoak {
        /// The first seed.
        #[arg(default_value_t = 1)]
        first: u64,
        /// How many seeds, of 90 jobs each (a minute for 100).
        #[arg(default_value_t = 100)]
        seeds: u64,
    },
    /// Lets the emulated Pico draw 343 cubes, and compares every step with the host's (some
    /// minutes).
    Lattice7,
    /// Lets the emulated Pico draw the Stanford bunny, which is larger than its memory, and
    /// compares every step with the host's (some 20 minutes).
    Bunny {
        /// The file; without it, it is fetched.
        file: Option<PathBuf>,
    },
    /// Does the same with a mesh of 10,000 faces (some 6 minutes).
    Mesh,
    /// Sends a drawing of many points to a simulated board with the Pico's memory, as long
    /// polylines and as lines of two points in each format, and checks how much memory the client
    /// takes for each point (an hour).
    Points {
        /// How many points.
        #[arg(default_value_t = 1_000_000)]
        count: u32,
        /// How many of them each polyline has.
        #[arg(long, default_value_t = 1000)]
        stroke: u32,
    },
    /// Cuts the emulated Pico's power at many instants, and in as many writes of its flash.
    Cuts {
        /// How many of each; from 4864 on, before every byte that a save changes (some 10 minutes).
        #[arg(default_value_t = 4864)]
        count: u32,
    },
    /// Draws jobs of every kind on the emulated Pico, whose power is cut at random instants and in
    /// writes of its flash, which then returns garbage once; judged by the ink.
    PowerSoak {
        /// For how many minutes.
        #[arg(default_value_t = 30)]
        minutes: u32,
        /// The seed of the random numbers.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Draws one job of half an hour instead, which is cut ten times.
        #[arg(long, conflicts_with_all = ["minutes", "streamed"])]
        long: bool,
        /// Lets the client's `plot --resume` send a large drawing instead.
        #[arg(long)]
        streamed: bool,
        /// Cuts the power before every byte of each kind of record that is written instead, and at
        /// 1,000 random instants of jobs and of a large model (three quarters of an hour or
        /// more).
        #[arg(long, conflicts_with_all = ["minutes", "streamed", "long"])]
        bytes: bool,
        /// Does so for one kind only: settings, parameters, job, points, streamed, model, early or
        /// parts.
        #[arg(long, requires = "bytes")]
        only: Option<String>,
    },
    /// Damages lines, makes noise and leaves in the middle of things on both emulated boards, and
    /// measures how long the status is waited for.
    LineSoak {
        /// For how many minutes on each board, both at once.
        #[arg(default_value_t = 60)]
        minutes: u32,
        /// The seed of the random numbers.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Changes the library in small ways, and lists the changes that no unit test finds; needs
    /// cargo-mutants.
    Mutants {
        /// How many changes of those modules that decide what is drawn, always the same ones.
        #[arg(default_value_t = 500)]
        count: u32,
        /// A portion of them only, such as 2/5, the second of five; or `further`: some more
        /// changes, which are not among them.
        #[arg(long)]
        part: Option<mutants::Part>,
    },
    /// Tries cncjs, bCNC, grbl-streamer, gscrib and vpype with the emulated boards; it installs
    /// them into target/senders (some 30 minutes).
    Senders(senders::Arguments),
    /// Draws every file of public collections by `penup preview`; it fetches them into
    /// target/corpus (some 30 minutes).
    Corpus(corpus::Arguments),
    /// Lists, by file, the calls of panic functions that are left in the boards' images.
    Panics,
    /// Checks the licences, sources and known holes of all crates; needs cargo-deny.
    Deny,
    /// Looks for inputs that break a promise; needs nightly Rust and cargo-fuzz.
    Fuzz {
        /// For how many seconds each target is fuzzed.
        #[arg(default_value_t = 20)]
        seconds: u32,
        /// The only target to fuzz, a folder of fuzz/corpus.
        #[arg(long)]
        target: Option<String>,
    },
    /// Fuzzes each target for an hour.
    Soak,
    /// Installs what building and testing need.
    SetUp,
    /// Runs every check: format, lints, documentation, tests on the host and in the emulator.
    Test,
}

fn main() -> ExitCode {
    match carry_out() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // `Display` adds no backtrace: the message is for the user. If it cannot be written,
            // the exit code must suffice.
            let _ = writeln!(std::io::stderr(), "penup: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn carry_out() -> Result<()> {
    match Arguments::parse().task {
        None => say!("{}", Arguments::command().render_help().to_string().trim_end())?,
        Some(Task::Build { board }) => {
            let image = firmware::build(board)?;
            say!("{}", firmware::check(board, &image)?)?;
            if let Some(flashing) = board.flashing {
                say!("{}", flash::by_hand(flashing, &image))?;
            }
        }
        Some(Task::Flash { board }) => flash::flash(board)?,
        Some(Task::Plot { arguments }) => plot(&arguments)?,
        Some(Task::Page) => page::build()?,
        Some(Task::PageTest(arguments)) => page::test(&arguments)?,
        Some(Task::Bench { motion: true, .. }) => bench::count_motion()?,
        Some(Task::Bench { beside: true, .. }) => beside::compare()?,
        Some(Task::Bench { growth: true, .. }) => growth::measure()?,
        Some(Task::Bench { board, .. }) => match board.emulator {
            Emulator::Qemu { .. } => bench::count()?,
            Emulator::Rp2040js => bench::count_cycles(board)?,
        },
        Some(Task::Stack) => bench::deepest_stack()?,
        Some(Task::Gallery) => gallery::make()?,
        Some(Task::Experiments) => experiments::repeat()?,
        Some(Task::Scenes { count }) => test::random_scenes(count)?,
        Some(Task::Solids { count }) => test::random_solids(count)?,
        Some(Task::MotionSoak { first, seeds }) => test::motion_soak(first, seeds)?,
        Some(Task::Points { count, stroke }) => test::many_points(count, stroke)?,
        Some(Task::Cuts { count }) => test::power_cuts(count)?,
        Some(Task::PowerSoak { seed, bytes: true, only, .. }) => test::byte_cuts(seed, only)?,
        Some(Task::PowerSoak { minutes, seed, long, streamed, .. }) => {
            test::power_soak(minutes, seed, long, streamed)?;
        }
        Some(Task::LineSoak { minutes, seed }) => test::line_soak(minutes, seed)?,
        Some(Task::Mutants { count, part }) => {
            mutants::run_sample(count, part.unwrap_or(mutants::Part::WHOLE))?;
        }
        Some(Task::Lattice7) => test::lattice7()?,
        Some(Task::Bunny { file }) => large::bunny(file)?,
        Some(Task::Mesh) => large::mesh()?,
        Some(Task::Senders(arguments)) => senders::try_all(&arguments)?,
        Some(Task::Corpus(arguments)) => corpus::draw_all(&arguments)?,
        Some(Task::Dist) => dist::dist()?,
        Some(Task::Panics) => panics::list()?,
        Some(Task::Deny) => dependencies::deny()?,
        Some(Task::Fuzz { seconds, target }) => fuzz::fuzz(seconds, target.as_deref())?,
        Some(Task::Soak) => fuzz::fuzz(3600, None)?,
        Some(Task::SetUp) => {
            for board in BOARDS {
                set_up::toolchain(board.target)?;
                set_up::emulator(board)?;
            }
            set_up::checkers()?;
            say!("everything is there")?;
        }
        Some(Task::Test) => test::everything()?,
    }
    Ok(())
}

/// Runs the client. For an emulated board, it first builds the board's firmware.
fn plot(arguments: &[String]) -> Result<()> {
    let mut client = client("plot", arguments);
    let at_a_port = arguments.iter().any(|argument| argument.starts_with("--port"));
    let asks_only = arguments.iter().any(|argument| ["-h", "--help"].contains(&&**argument));
    if !at_a_port && !asks_only {
        let board = firmware::board_of(arguments)?;
        set_up::emulator(board)?;
        let image = firmware::build(board)?;
        firmware::check(board, &image)?;
    }
    let status = client.status().with_context(|| format!("cannot run {}", describe(&client)))?;
    if !status.success() {
        // The client has reported the reason itself.
        std::process::exit(status.code().unwrap_or(1));
    }
    Ok(())
}

/// The command that runs the client, in the user's current directory.
fn client(command: &str, arguments: &[String]) -> Command {
    let mut client = cargo();
    client
        .args(["run", "--quiet", "--package", "penup-client", "--bin", "penup"])
        .arg("--manifest-path")
        .arg(root().join("Cargo.toml"))
        .args(["--", command])
        .args(arguments);
    client
}

/// The root directory of the workspace.
fn root() -> PathBuf {
    workspace::root()
}
