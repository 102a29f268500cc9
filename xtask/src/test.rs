//! Runs all checks, those first that fail fastest.

use std::process::Command;
use std::thread;

use anyhow::{Result, anyhow};

use crate::command::{cargo, describe, run};
use crate::firmware;
use crate::page;
use crate::set_up::{self, Toolchain};
use crate::side_by_side::{self, Programs};
use crate::table::{BOARDS, BoardRow, LM3S6965, PICO};

/// Installs what is missing, then runs all checks. It stops at the first failure.
pub fn everything() -> Result<()> {
    set_up::checkers()?;
    for board in BOARDS {
        set_up::emulator(board)?;
    }
    set_up::browser()?;

    step(workspace("fmt").args(["--all", "--check"]))?;
    // The last pass of a compiler over an image or over the page keeps one core busy.
    let (built, tests) = thread::scope(|scope| {
        let built = scope.spawn(build_images_and_page);
        let tests = lint_and_build_tests();
        (built.join().unwrap_or_else(|_| Err(anyhow!("a panic"))), tests)
    });
    built?;
    let mut tests = tests?;
    let mut doctests = workspace("test");
    doctests.args(["--workspace", "--doc"]).args(EMULATOR);
    tests.computing.push(doctests);
    // They wait for machines that draw at their own speed.
    tests.waiting.push(page::tests()?);
    side_by_side::run(tests)
}

/// Lints, builds and checks the firmware of each board, then builds the page.
fn build_images_and_page() -> Result<()> {
    for board in BOARDS {
        lint_firmware(board)?;
        let image = firmware::build(board)?;
        say!("{}", firmware::check(board, &image)?)?;
    }
    say!("penup: building the page, which takes a minute or more the first time")?;
    page::build()
}

/// Lints all that runs on a computer, builds the documentation, then the client and the tests.
/// Returns a command for each test program, those in the emulators too, but not for the doctests.
fn lint_and_build_tests() -> Result<Programs> {
    step(
        workspace("clippy")
            .args(["--workspace", "--all-targets"])
            .args(EMULATOR)
            .args(["--", "-Dwarnings"]),
    )?;
    // The workspace as a whole enables all that one of its packages needs. So the library is linted
    // with nothing enabled, too, and as the smallest package that uses it enables it.
    for package in [
        &["--package", "penup", "--lib", "--no-default-features"][..],
        &["--package", "penup-readers"],
    ] {
        step(workspace("clippy").args(package).args(["--", "-Dwarnings"]))?;
    }
    step(
        workspace("doc")
            .args(["--workspace", "--no-deps", "--document-private-items"])
            .env("RUSTDOCFLAGS", "-Dwarnings"),
    )?;
    // The examples have been compiled for the lints, and contain no tests.
    side_by_side::built_by(workspace("test").args(["--workspace", "--tests"]).args(EMULATOR))
}

/// The options that enable the tests that need the emulators and the firmware.
const EMULATOR: [&str; 2] = ["--features", "penup-host-tests/emulator"];

/// Compares `count` random scenes with an exact model; `everything` does 2,000.
pub fn random_scenes(count: u32) -> Result<()> {
    step(
        workspace("test")
            .args(["--release", "--package", "penup-host-tests"])
            .args(["--test", "visibility_exact", "--test", "visibility_cameras"])
            .env("PENUP_SCENES", count.to_string()),
    )
}

/// Draws random jobs of the given seeds with random settings and orders, and prints how near they
/// come to the limits of speed, acceleration and jerk.
pub fn motion_soak(first: u64, seeds: u64) -> Result<()> {
    step(
        workspace("run")
            .args(["--quiet", "--release", "--package", "penup-host-tests"])
            .args(["--example", "motion_soak", "--"])
            .args([first.to_string(), seeds.to_string()]),
    )
}

/// Compares `count` random convex solids of each kind with an exact model; `everything` does 4,000.
pub fn random_solids(count: u32) -> Result<()> {
    step(
        workspace("test")
            .args(["--release", "--package", "penup-host-tests"])
            .args(["--test", "convex_from_vertices", "--test", "convex_from_edges"])
            .arg("random_solids_are")
            .env("PENUP_SOLIDS", count.to_string()),
    )
}

/// Lets the client send a drawing of `count` points, `stroke` in each polyline, to a simulated
/// board, and the same as lines of two points in each format, and checks its memory;
/// `everything` sends 20,000.
pub fn many_points(count: u32, stroke: u32) -> Result<()> {
    step(
        workspace("test")
            .args(["--release", "--package", "penup-client"])
            .args(["--test", "command", "many_points::"])
            .args(["--", "--nocapture", "--test-threads", "1"])
            .env("PENUP_POINTS", count.to_string())
            .env("PENUP_STROKE", stroke.to_string()),
    )
}

/// Simulates `count` power failures of each kind; `everything` does 200. From 4864 on, the power
/// fails before every byte of flash that a save changes.
pub fn power_cuts(count: u32) -> Result<()> {
    step(on_the_pico("pico_power")?.env("PENUP_CUTS", count.to_string()))
}

/// Cuts the power of the emulated Pico for some minutes: while jobs of every kind are drawn, while
/// a `long` one is, or while the client sends one (`streamed`).
pub fn power_soak(minutes: u32, seed: u64, long: bool, streamed: bool) -> Result<()> {
    let test = if streamed { "pico_streamed_resume" } else { "pico_cuts" };
    let name = if long { "a_job_of_half_an_hour_is_whole_after_ten_cuts" } else { "soak" };
    soak(&mut on_the_pico(test)?, &["--exact", name], minutes, seed)
}

/// Cuts the power of the emulated Pico before every byte that it writes to its flash, of each kind
/// of record or of the kind `only`.
pub fn byte_cuts(seed: u64, only: Option<String>) -> Result<()> {
    let mut command = on_the_pico("pico_byte_cuts")?;
    if let Some(only) = only {
        command.env("PENUP_PORTION", only);
    }
    soak(&mut command, &[], 0, seed)
}

/// Damages the lines of both emulated boards for some minutes.
pub fn line_soak(minutes: u32, seed: u64) -> Result<()> {
    set_up::emulator(&LM3S6965)?;
    firmware::check(&LM3S6965, &firmware::build(&LM3S6965)?)?;
    soak(&mut on_the_pico("line_soak")?, &[], minutes, seed)
}

/// Runs the ignored tests of a command, with these further arguments.
fn soak(command: &mut Command, arguments: &[&str], minutes: u32, seed: u64) -> Result<()> {
    step(
        command
            .args(["--", "--ignored", "--nocapture"])
            .args(arguments)
            .env("PENUP_MINUTES", minutes.to_string())
            .env("PENUP_SEED", seed.to_string()),
    )
}

/// Runs the largest scene of the Pico on its emulator, from the upload to the last step.
pub fn lattice7() -> Result<()> {
    step(on_the_pico("pico_lattice7")?.args(["--", "--ignored"]))
}

/// Builds the Pico's image, and returns the command of a test that runs it.
fn on_the_pico(test: &str) -> Result<Command> {
    set_up::emulator(&PICO)?;
    firmware::check(&PICO, &firmware::build(&PICO)?)?;
    let mut cargo = workspace("test");
    cargo.args(["--package", "penup-host-tests", "--test", test]).args(EMULATOR);
    Ok(cargo)
}

/// A cargo command that runs in the root of the workspace.
fn workspace(command: &str) -> Command {
    let mut cargo = cargo();
    cargo.current_dir(crate::root()).arg(command);
    cargo
}

/// Lints a board's firmware: with clippy if the board's compiler has it, else by the compiler's own
/// warnings.
fn lint_firmware(board: &BoardRow) -> Result<()> {
    let toolchain = set_up::toolchain(board.target)?;
    match toolchain {
        Toolchain::Rustup => step(
            toolchain
                .cargo("clippy", board.target)
                .args(firmware::cargo_options(board))
                .args(["--", "-Dwarnings"]),
        ),
        Toolchain::Debian => {
            say!("penup: no clippy for {}: Debian's compiler has none", board.target)?;
            step(
                toolchain
                    .cargo("rustc", board.target)
                    .args(firmware::cargo_options(board))
                    .args(["--", "-Dwarnings"]),
            )
        }
    }
}

/// Prints a command, then runs it.
fn step(command: &mut Command) -> Result<()> {
    say!("penup: {}", describe(command))?;
    run(command)
}
