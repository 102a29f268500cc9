//! Counts the instructions of each stage on a Cortex-M3, and prints them beside the times of the
//! papers.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::command::{cargo, describe, run};
use crate::firmware;
use crate::set_up;
use crate::table::{BOARDS, BoardRow};

/// Seconds for a lattice of 1, 8, 27 … cubes: Griffith's on an ICL 1904S, and Brown's on a
/// PDP-11/34.
const PAPERS: [[&str; 2]; 7] = [
    ["0.257", "2.73"],
    ["2.28", "13.88"],
    ["8.84", "53.5"],
    ["23.6", "147.9"],
    ["51.5", "298"],
    ["92.6", "573"],
    ["161", "did not fit"],
];

/// Builds the image of a board, runs it in its emulator, and prints the cycles of each stage. This
/// takes some 10 minutes.
pub fn count_cycles(board: &'static BoardRow) -> Result<()> {
    run_in_emulators(&[board], &format!("{}_cycles", board.name))
}

/// Builds the images of all boards, and prints the greatest stack depth of each.
pub fn deepest_stack() -> Result<()> {
    run_in_emulators(&BOARDS, "deepest_stack")
}

/// Builds the images that `example` runs in emulators, and runs it.
fn run_in_emulators(boards: &[&'static BoardRow], example: &str) -> Result<()> {
    for &board in boards {
        set_up::emulator(board)?;
        firmware::check(board, &firmware::build(board)?)?;
    }
    let program = ["--package", "penup-host-tests", "--example", example];
    run(cargo().current_dir(crate::root()).args(["run", "--quiet", "--release"]).args(program))
}

/// Prints the table of scenes for `docs/performance.md`.
pub fn count() -> Result<()> {
    print(&run_image("bench")?)
}

/// Prints the table of motion planning for the same document.
pub fn count_motion() -> Result<()> {
    let counts = run_image("bench-motion")?;
    say!("| job | without a jerk | 100 m/s³ | 10 m/s³ | 1 m/s³ |")?;
    say!("|---|---|---|---|---|")?;
    for line in counts.lines() {
        say!("| {} |", line.replace('|', " | "))?;
    }
    say!("")?;
    say!("| job | step interrupts |")?;
    say!("|---|---|")?;
    run_in_emulators(&BOARDS[..1], "interrupt_counts")
}

/// Builds a benchmark image, runs it in QEMU, and returns its output.
fn run_image(name: &str) -> Result<String> {
    let target = BOARDS[0].target;
    set_up::emulator(BOARDS[0])?;
    let mut cargo = set_up::toolchain(target)?.cargo("build", target);
    let options = ["--package=penup", "--bin", name, "--profile=firmware", "--no-default-features"];
    // A target directory of its own keeps the benchmark and the firmware from causing rebuilds of
    // each other.
    let folder = crate::root().join("target/bench");
    run(cargo.arg("--quiet").args(options).args(["--features=mps2", "--target-dir"]).arg(&folder))?;
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args([
        "-machine",
        "mps2-an385",
        "-display",
        "none",
        "-monitor",
        "none",
        "-serial",
        "none",
    ])
    .args(["-semihosting-config", "enable=on,target=native", "-icount", "shift=0,sleep=off"])
    .arg("-kernel")
    .arg(folder.join(target).join("firmware").join(name))
    .stderr(Stdio::inherit());
    let answer = qemu.output().with_context(|| format!("cannot run {}", describe(&qemu)))?;
    ensure!(answer.status.success(), "{}: {}", describe(&qemu), answer.status);
    Ok(String::from_utf8_lossy(&answer.stdout).into_owned())
}

/// Prints the counts of the benchmark image as a table.
fn print(counts: &str) -> Result<()> {
    say!(
        "| scene | vertices | edges | view | visibility | an edge | view and visibility at 50 \
         MHz, s | Griffith, s | Brown, s | order |"
    )?;
    say!("|---|---|---|---|---|---|---|---|---|---|")?;
    let papers = PAPERS.iter().copied().chain(std::iter::repeat(["", ""]));
    for (line, [griffith, brown]) in counts.lines().zip(papers) {
        let words: Vec<&str> = line.split(' ').collect();
        let numbers: Vec<u64> = words.iter().skip(1).filter_map(|word| word.parse().ok()).collect();
        let (Some(name), [vertices, corners, view, visibility, order]) =
            (words.first(), &numbers[..])
        else {
            say!("{line}")?;
            continue;
        };
        // Each edge accounts for two corners, of its two faces or of a bar.
        let edges = corners / 2;
        // QEMU counts instructions; the core takes some five cycles for four of them.
        let seconds = (view + visibility) as f64 * 1.25 / 50e6;
        say!(
            "| {name} | {vertices} | {edges} | {} | {} | {} | {seconds:.3} | {griffith} | {brown} \
             | {} |",
            thousands(*view),
            thousands(*visibility),
            thousands(visibility / edges.max(1)),
            thousands(*order),
        )?;
    }
    Ok(())
}

/// The number in groups of three digits with spaces between them.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .filter_map(|group| std::str::from_utf8(group).ok())
        .collect();
    groups.join(" ")
}
