//! Runs other programs and prints messages.

use std::env;
use std::fmt;
use std::io::{self, Write};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

/// The cargo that runs this program.
pub fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Runs a command to its end and shows its output.
///
/// # Errors
/// The command cannot be run, or it fails.
pub fn run(command: &mut Command) -> Result<()> {
    let name = describe(command);
    let status = command.status().with_context(|| format!("cannot run {name}"))?;
    if !status.success() {
        bail!("{name}: {status}");
    }
    Ok(())
}

/// Like [`run`], but kills the command after `limit`, which is an error.
pub fn run_within(limit: Duration, command: &mut Command) -> Result<()> {
    let name = describe(command);
    let mut child = command.spawn().with_context(|| format!("cannot run {name}"))?;
    let deadline = Instant::now() + limit;
    while Instant::now() < deadline {
        if let Some(status) = child.try_wait()? {
            if !status.success() {
                bail!("{name}: {status}");
            }
            return Ok(());
        }
        thread::sleep(Duration::from_millis(20));
    }
    end(&mut child);
    bail!("{name}: gave up after {} s", limit.as_secs())
}

/// The standard output of a program, trimmed. `None` if the program does not exist or fails.
pub fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let Output { status, stdout, .. } = Command::new(program)
        .args(arguments)
        .stderr(Stdio::null())
        .stdin(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&stdout).trim().to_owned();
    status.success().then_some(text)
}

/// The command as a user would type it.
pub fn describe(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    words.join(" ")
}

/// Prints a line to the standard output. If the reader of the output has gone, as `head` may have,
/// it does nothing and work continues.
///
/// # Errors
/// The output cannot be written, for example because the disk is full.
pub fn say(text: fmt::Arguments<'_>) -> Result<()> {
    say_to(&mut io::stdout().lock(), text)
}

fn say_to(output: &mut dyn Write, text: fmt::Arguments<'_>) -> Result<()> {
    match writeln!(output, "{text}").and_then(|()| output.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write the standard output"),
    }
}

/// Kills a child process and waits for its end.
fn end(child: &mut Child) {
    // Both calls fail only if the child has just ended by itself.
    let _ = child.kill();
    let _ = child.wait();
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Failing(io::ErrorKind);

    impl Write for Failing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_that_has_gone_is_no_error_and_a_full_disk_is() {
        let said = |kind| say_to(&mut Failing(kind), format_args!("a line"));
        assert!(said(io::ErrorKind::BrokenPipe).is_ok());
        let error = said(io::ErrorKind::StorageFull).expect_err("told");
        assert!(format!("{error:#}").starts_with("cannot write the standard output: "));
        let mut output = Vec::new();
        assert!(say_to(&mut output, format_args!("a {}", "line")).is_ok());
        assert_eq!(output, b"a line\n");
    }
}
