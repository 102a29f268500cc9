//! Tries programs that send to Grbl, unmodified, with the emulated boards.
//!
//! Each program is installed from its registry into `target/senders`. A script of
//! `host-tests/senders` then uses it as a person would: it connects, asks, moves, streams a file,
//! holds, resumes and gives up. The example `board_on_pty` serves the board at a pseudo-terminal
//! and judges the ink by the pins.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use crate::command::{cargo, describe, run, run_within};
use crate::table::BOARDS;
use crate::{firmware, python, set_up};

/// A program, what installs it, and the script that tries it.
struct Program {
    name: &'static str,
    /// The packages from PyPI, with those that the script needs.
    python: &'static [&'static str],
    /// The package from npm.
    node: Option<&'static str>,
    script: &'static str,
}

/// The programs.
const PROGRAMS: [Program; 5] = [
    Program {
        name: "cncjs",
        python: &["python-socketio[client]==4.6.1", "python-engineio==3.14.2"],
        node: Some("cncjs@1.11.5"),
        script: "cncjs.py",
    },
    Program { name: "bCNC", python: &["bCNC==0.9.16"], node: None, script: "bcnc.py" },
    Program {
        name: "grbl-streamer",
        python: &["grbl-streamer==2.0.2"],
        node: None,
        script: "streamer.py",
    },
    Program { name: "gscrib", python: &["gscrib==1.2.0"], node: None, script: "gscrib_direct.py" },
    Program {
        name: "vpype",
        python: &["vpype==1.15.0", "vpype-gcode==0.13.0", "pyserial==3.5"],
        node: None,
        script: "vpype_gcode.py",
    },
];

/// The serial ports that are tried, as the example names them.
const PORTS: [&str; 3] = ["lm3s6965", "pico", "pico-usb"];

/// How long an installation from npm may take.
const INSTALL_LIMIT: Duration = Duration::from_secs(600);
/// How long a script may take.
const SCRIPT_LIMIT: Duration = Duration::from_secs(900);

/// What is tried.
#[derive(clap::Args)]
pub struct Arguments {
    /// The only program to try.
    #[arg(long, value_parser = PROGRAMS.map(|program| program.name))]
    program: Option<String>,
    /// The only port to try.
    #[arg(long, value_parser = PORTS)]
    port: Option<String>,
}

/// What a script has found.
struct Found {
    version: String,
    passed: u32,
    /// The checks that failed, with the reasons.
    failed: Vec<String>,
    /// Why the script ended early.
    broke: Option<String>,
}

impl Found {
    /// How many checks passed, of how many.
    fn counts(&self) -> String {
        format!("{} of {}", self.passed, self.passed as usize + self.failed.len())
    }

    /// All that went wrong.
    fn told(self) -> impl Iterator<Item = String> {
        self.failed.into_iter().chain(self.broke)
    }
}

/// Installs the programs, tries each with each board, and prints a table.
///
/// # Errors
/// A check failed, or no program can be tried.
pub fn try_all(arguments: &Arguments) -> Result<()> {
    for board in BOARDS {
        set_up::emulator(board)?;
        firmware::check(board, &firmware::build(board)?)?;
    }
    let server = build_server()?;
    let is_chosen =
        |chosen: &Option<String>, name| chosen.as_deref().is_none_or(|only| only == name);
    let (mut rows, mut failures, mut tried) = (Vec::new(), Vec::new(), 0);
    for board in BOARDS {
        if arguments.program.is_none() && is_chosen(&arguments.port, board.name) {
            let mut lines = Command::new(server.with_file_name("grbl_lines"));
            let found =
                follow(lines.arg(board.name).stderr(Stdio::inherit()), "Grbl's lines", board.name)?;
            rows.push(format!(
                "| Grbl's lines | {} | {} | {} |",
                found.version,
                board.name,
                found.counts()
            ));
            failures
                .extend(found.told().map(|what| format!("Grbl's lines at {}: {what}", board.name)));
        }
    }
    for program in PROGRAMS.iter().filter(|program| is_chosen(&arguments.program, program.name)) {
        let folder = match install(program) {
            Ok(folder) => folder,
            Err(reason) => {
                say!("penup: {} is skipped: {reason:#}", program.name)?;
                rows.push(format!("| {} | skipped | | {reason:#} |", program.name));
                continue;
            }
        };
        for port in PORTS.into_iter().filter(|port| is_chosen(&arguments.port, port)) {
            say!("penup: trying {} at {port}", program.name)?;
            let found = try_program(program, &folder, &server, port)?;
            let all = found.passed as usize + found.failed.len();
            let version = &found.version;
            rows.push(format!(
                "| {} | {version} | {port} | {} of {all} |",
                program.name, found.passed
            ));
            let told = found.failed.into_iter().chain(found.broke);
            failures.extend(told.map(|what| format!("{} at {port}: {what}", program.name)));
            tried += 1;
        }
    }
    say!("| program | version | port | checks passed |")?;
    say!("|---|---|---|---|")?;
    for row in rows {
        say!("{row}")?;
    }
    ensure!(tried > 0, "no program could be tried");
    if !failures.is_empty() {
        bail!("these checks failed:\n{}", failures.join("\n"));
    }
    Ok(())
}

/// Builds what serves a board at a pseudo-terminal, and returns its path.
fn build_server() -> Result<PathBuf> {
    let mut build = cargo();
    build.current_dir(crate::root()).args(["build", "--quiet", "--package", "penup-host-tests"]);
    run(build.args(["--example", "board_on_pty", "--example", "grbl_lines"]))?;
    Ok(crate::root().join("target/debug/examples/board_on_pty"))
}

/// The folder of what this command installs.
fn folder_of(program: &Program) -> PathBuf {
    crate::root().join("target/senders").join(program.name)
}

/// Finds or installs a program, and returns its folder.
fn install(program: &Program) -> Result<PathBuf> {
    let folder = folder_of(program);
    python::install(program.name, &folder, program.python, program.node, || {
        let Some(package) = program.node else { return Ok(()) };
        let mut npm = Command::new("npm");
        npm.args(["install", "--no-audit", "--no-fund", "--loglevel=error", "--prefix"]);
        run_within(INSTALL_LIMIT, npm.arg(&folder).arg(package))
    })?;
    Ok(folder)
}

/// Runs the script of a program at one port.
fn try_program(program: &Program, folder: &Path, server: &Path, port: &str) -> Result<Found> {
    let files = folder.join("files").join(port);
    fs::create_dir_all(&files)?;
    let mut script = Command::new(folder.join("python/bin/python"));
    script
        .arg(crate::root().join("host-tests/senders").join(program.script))
        .arg(server)
        .arg(port)
        .arg(&files)
        // Programs keep their settings there, and bytecode elsewhere than beside the scripts.
        .env("HOME", &files)
        .env("PENUP_SENDER", folder)
        .env("PYTHONPYCACHEPREFIX", folder.join("bytecode"))
        .env_remove("DISPLAY")
        .stderr(fs::File::create(files.join("errors.txt"))?);
    let mut found = follow(&mut script, program.name, port)?;
    if let Some(reason) = &mut found.broke {
        *reason += &format!(": see {}", files.join("errors.txt").display());
    }
    Ok(found)
}

/// Runs what prints a line for each check.
fn follow(script: &mut Command, name: &str, port: &str) -> Result<Found> {
    script.stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = script.spawn().with_context(|| format!("cannot run {}", describe(script)))?;
    let lines = child.stdout.take().map(BufReader::new);
    let mut found =
        Found { version: "unknown".to_owned(), passed: 0, failed: Vec::new(), broke: None };
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| -> Result<()> {
        scope.spawn(|| {
            let deadline = Instant::now() + SCRIPT_LIMIT;
            while !is_over.load(Ordering::Relaxed) {
                if Instant::now() > deadline || child.try_wait().is_ok_and(|ended| ended.is_some())
                {
                    // An error says that it has ended.
                    let _ = child.kill();
                    return;
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        });
        for line in lines.into_iter().flat_map(|lines| lines.lines().map_while(Result::ok)) {
            match line.split_once(' ') {
                Some(("version", version)) => version.clone_into(&mut found.version),
                Some(("pass", _)) => found.passed += 1,
                Some(("fail", what)) => {
                    say!("penup: {name} at {port}: {what}")?;
                    found.failed.push(what.to_owned());
                }
                _ => {}
            }
        }
        is_over.store(true, Ordering::Relaxed);
        Ok(())
    })?;
    let status = child.wait()?;
    if !status.success() || found.passed == 0 {
        found.broke = Some(format!("its script broke ({status})"));
    }
    Ok(found)
}
