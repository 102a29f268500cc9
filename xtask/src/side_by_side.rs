//! Runs test programs in parallel. Cargo runs them one after the other, so that the other cores are
//! idle while the longest test of each program ends.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;
use std::vec;

use anyhow::{Context, Result, anyhow, ensure};
use serde_json::Value;

use crate::command::describe;

/// The prefixes of the names of the longest test programs, which run first.
const LONGEST: [&str; 3] = ["pico_", "qemu_", "stack"];

/// The name of the test program that waits most of the time, for machines that draw at their own
/// speed.
const WAITING: &str = "command";

/// The commands that run test programs.
pub struct Programs {
    /// Those that compute, in the order in which they start.
    pub computing: Vec<Command>,
    /// Those that mostly wait, so that they run beside the others.
    pub waiting: Vec<Command>,
}

/// Builds what the command `cargo test …` would run, except the doctests. Returns a command for
/// each test program, with its package's directory as the current one.
pub fn built_by(cargo_test: &mut Command) -> Result<Programs> {
    cargo_test.args(["--no-run", "--message-format=json-render-diagnostics"]);
    let name = describe(cargo_test);
    let built = cargo_test.stderr(Stdio::inherit()).output();
    let built = built.with_context(|| format!("cannot run {name}"))?;
    ensure!(built.status.success(), "{name}: {}", built.status);
    let mut programs = Programs { computing: Vec::new(), waiting: Vec::new() };
    let mut short = Vec::new();
    for line in String::from_utf8(built.stdout)?.lines() {
        let message: Value = serde_json::from_str(line)?;
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let is_test = message["profile"]["test"] == true;
        let (Some(program), true) = (text(&message["executable"]), is_test) else { continue };
        let manifest = text(&message["manifest_path"]).context("a program without a package")?;
        let package = Path::new(&manifest).parent().context("a package without a directory")?;
        let name = text(&message["target"]["name"]).unwrap_or_default();
        let mut command = Command::new(program);
        command.current_dir(package).env("CARGO_MANIFEST_DIR", package);
        if name == WAITING {
            programs.waiting.push(command);
        } else if LONGEST.iter().any(|longest| name.starts_with(longest)) {
            programs.computing.push(command);
        } else {
            short.push(command);
        }
    }
    programs.computing.append(&mut short);
    ensure!(!programs.computing.is_empty(), "{name}: no tests");
    Ok(programs)
}

/// Runs the programs that compute in their order, as many at a time as there are cores, and those
/// that wait beside them. The output of each is shown when it ends. After a failure, no further
/// program is started.
pub fn run(programs: Programs) -> Result<()> {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let next_of = |programs: &Mutex<vec::IntoIter<Command>>| {
        programs.lock().unwrap_or_else(PoisonError::into_inner).next()
    };
    let Programs { computing, waiting } = programs;
    let [computing, waiting] = [computing, waiting].map(|list| Mutex::new(list.into_iter()));
    let work = |programs: &Mutex<vec::IntoIter<Command>>| -> Result<()> {
        while let Some(mut program) = next_of(programs) {
            if let Err(error) = run_one(&mut program) {
                while next_of(&computing).is_some() || next_of(&waiting).is_some() {}
                return Err(error);
            }
        }
        Ok(())
    };
    let (work, computing, waiting) = (&work, &computing, &waiting);
    thread::scope(|scope| {
        let mut workers = vec![scope.spawn(move || work(waiting))];
        workers.extend((0..cores).map(|_| scope.spawn(move || work(computing))));
        let mut ended = workers.into_iter().map(|worker| worker.join());
        ended.try_for_each(|result| result.unwrap_or_else(|_| Err(anyhow!("a panic"))))
    })
}

/// Runs a program, then shows its output and how long it took.
fn run_one(program: &mut Command) -> Result<()> {
    let name = describe(program);
    let began = Instant::now();
    let output = program.output().with_context(|| format!("cannot run {name}"))?;
    let said = [&output.stdout, &output.stderr].map(|said| String::from_utf8_lossy(said));
    say!("penup: {name}: {} s\n{}{}", began.elapsed().as_secs(), said[0], said[1])?;
    ensure!(output.status.success(), "{name}: {}", output.status);
    Ok(())
}
