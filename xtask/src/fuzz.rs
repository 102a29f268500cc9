//! Runs the fuzzers, which need nightly Rust and `cargo-fuzz`.

use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::command::run;

/// The longest input, in bytes.
const LONGEST: u32 = 4096;
/// The longest time for one input, in seconds; a longer one counts as a hang.
const TIMEOUT: u32 = 60;

/// Fuzzes each target for this many seconds, or only the target with the name `only`. New inputs
/// that reach new code stay in `fuzz/corpus`; an input that breaks a promise is written to
/// `fuzz/artifacts`, and ends the run. `fuzz/dictionaries` has the words that a target understands.
///
/// # Errors
/// Nightly Rust or `cargo-fuzz` is missing, there is no such target, or a promise is broken.
pub fn fuzz(seconds: u32, only: Option<&str>) -> Result<()> {
    let has_fuzzer = cargo_fuzz().arg("--version").output().is_ok_and(|out| out.status.success());
    ensure!(
        has_fuzzer,
        "fuzzing needs nightly Rust and cargo-fuzz; install them with\n\
         rustup toolchain install nightly\ncargo install cargo-fuzz"
    );
    let corpus = crate::root().join("fuzz/corpus");
    let folders = std::fs::read_dir(&corpus).context("cannot read fuzz/corpus")?;
    let mut targets = Vec::new();
    for folder in folders {
        targets.push(folder?.file_name().to_string_lossy().into_owned());
    }
    targets.sort();
    if let Some(only) = only {
        targets.retain(|target| target == only);
        ensure!(!targets.is_empty(), "there is no target {only} in fuzz/corpus");
    }
    for target in &targets {
        say!("penup: fuzzing {target} for {seconds} s")?;
        let mut command = cargo_fuzz();
        command.args(["run", target, "--"]).args([
            format!("-max_total_time={seconds}"),
            format!("-max_len={LONGEST}"),
            format!("-timeout={TIMEOUT}"),
            "-print_final_stats=1".to_owned(),
        ]);
        let words = crate::root().join("fuzz/dictionaries").join(format!("{target}.dict"));
        if words.exists() {
            command.arg(format!("-dict={}", words.display()));
        }
        run(&mut command)?;
    }
    Ok(())
}

/// The command of `cargo-fuzz` in the root of the workspace.
fn cargo_fuzz() -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo", "fuzz"]).current_dir(crate::root());
    command
}
