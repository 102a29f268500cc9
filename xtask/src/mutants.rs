//! Changes the library in small ways, and looks for changes that its unit tests do not find.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::command::{cargo, describe, output, run};

/// The modules whose changes are tried: what decides which lines are drawn, in which order, by
/// which steps and when.
const FILES: [&str; 9] = [
    "src/fixed.rs",
    "src/geometry.rs",
    "src/view/**",
    "src/visibility/**",
    "src/order/**",
    "src/step/**",
    "src/motion/**",
    "src/protocol/**",
    "src/storage/**",
];

/// The longest time for the tests of one change, in seconds. One that makes them hang is found.
const PATIENCE: u32 = 120;

/// Tries about `count` changes, spread evenly over all that there are, and prints those that no
/// test finds. The same count gives the same changes. The list stays in target/mutants.out.
///
/// # Errors
/// `cargo-mutants` is missing, the tests fail without a change, or a change is not found.
pub fn run_sample(count: u32) -> Result<()> {
    ensure!(
        mutants().arg("--version").output().is_ok_and(|out| out.status.success()),
        "this needs cargo-mutants; install it with\ncargo install cargo-mutants --locked"
    );
    let list: Vec<&str> = ["mutants", "--list", "--package", "penup"].to_vec();
    let files = FILES.iter().flat_map(|file| ["--file", file]);
    let list: Vec<&str> = list.into_iter().chain(files.clone()).collect();
    let all = output("cargo", &list).map_or(0, |text| text.lines().count());
    let shards = all.div_ceil(count.max(1) as usize).max(1);
    say!("penup: one change in {shards} of {all}")?;
    let mut command = mutants();
    command
        .args(["--package", "penup"])
        .args(files)
        .args(["--sharding", "round-robin", "--shard", &format!("0/{shards}")])
        .args(["--timeout", &PATIENCE.to_string(), "--output", "target", "--no-shuffle"])
        .args(["--", "--lib"]);
    say!("penup: {}", describe(&command))?;
    run(&mut command)
}

/// The command in the root of the workspace.
fn mutants() -> Command {
    let mut command = cargo();
    command.current_dir(crate::root()).arg("mutants");
    command
}
