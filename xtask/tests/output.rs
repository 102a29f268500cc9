//! `cargo xtask` as a user runs it.

#![allow(clippy::expect_used, reason = "a test fails with the words of what it expected")]

use std::process::{Command, Stdio};

/// As `cargo xtask | head -1` leaves it: the pipe's reading end is closed before anything is
/// written.
#[test]
fn a_pipe_that_nobody_reads_is_no_error() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_xtask"));
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = program.stdout(writer).stderr(Stdio::piped()).output().expect("the program runs");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}
