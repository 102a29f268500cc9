//! Another program that does the same work when it is asked to.

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::spawn;
use std::time::{Duration, Instant};

/// How long a program may take for a scene, everything included.
pub const LIMIT: Duration = Duration::from_secs(60);

/// A script in Python that has loaded a scene.
pub struct Program {
    child: Child,
    input: ChildStdin,
    lines: Receiver<String>,
    deadline: Instant,
}

/// Why there is no answer.
pub enum Silence {
    /// It took longer than [`LIMIT`].
    TooLong,
    /// It ended.
    Broke,
}

impl Silence {
    /// What stands in the table instead of a time.
    pub fn word(&self) -> &'static str {
        match self {
            Self::TooLong => "over 60 s",
            Self::Broke => "failed",
        }
    }
}

/// What a program has done once.
pub struct Answer {
    /// How long that took.
    pub milliseconds: f64,
    /// The length that it found.
    pub length: f64,
}

impl Program {
    /// Starts a script of `host-tests/beside` by this interpreter, and waits until it has loaded
    /// the scene.
    ///
    /// # Errors
    /// See [`Silence`].
    pub fn start(python: &Path, script: &str, arguments: &[&str]) -> Result<Self, Silence> {
        let script = penup_client::workspace::root().join("host-tests/beside").join(script);
        let mut command = Command::new(python);
        command.arg(script).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(|_| Silence::Broke)?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Silence::Broke);
        };
        let (sender, lines) = channel();
        spawn(move || {
            // The other end is gone if nobody waits any more.
            BufReader::new(output).lines().map_while(Result::ok).all(|l| sender.send(l).is_ok())
        });
        let mut program = Self { child, input, lines, deadline: Instant::now() + LIMIT };
        program.hear()?;
        Ok(program)
    }

    fn hear(&mut self) -> Result<String, Silence> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        self.lines.recv_timeout(left).map_err(|_| match self.child.try_wait() {
            Ok(None) if Instant::now() >= self.deadline => Silence::TooLong,
            _ => Silence::Broke,
        })
    }

    /// Lets it do the work once.
    ///
    /// # Errors
    /// See [`Silence`].
    pub fn run(&mut self) -> Result<Answer, Silence> {
        self.input.write_all(b"run\n").map_err(|_| Silence::Broke)?;
        let line = self.hear()?;
        let mut numbers = line.split(' ').map_while(|word| word.parse().ok());
        match (numbers.next(), numbers.next()) {
            (Some(milliseconds), Some(length)) => Ok(Answer { milliseconds, length }),
            _ => Err(Silence::Broke),
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // Both calls fail only if it has just ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A file with this text that both programs read.
///
/// # Errors
/// It cannot be written.
pub fn file(name: &str, text: &str) -> std::io::Result<PathBuf> {
    let folder = penup_client::workspace::root().join("target/beside/scenes");
    fs::create_dir_all(&folder)?;
    let path = folder.join(name);
    fs::write(&path, text)?;
    Ok(path)
}
