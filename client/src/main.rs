//! `penup`: sends files to a plotter, or to an emulated one, and shows the picture.

use clap::Parser;
use penup_client::cli::Cli;
use penup_client::error::Error;
use penup_client::interrupt;
use penup_client::outcome::Outcome;
use penup_client::output::standard_holds_a_file;
use penup_client::run::run;
use serde_json::json;
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

static INTERRUPT: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let cli = Cli::parse();
    let is_quiet = cli.quiet;
    // A failure is ignored: without a handler, Ctrl-C still ends the process.
    let _ = ctrlc::set_handler(move || interrupt::ctrl_c(&INTERRUPT, is_quiet));
    match run(&cli, &INTERRUPT).and_then(|outcome| say(&cli, &outcome)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if cli.is_json() {
                // The exit code and the standard error tell the same.
                let _ = print(
                    &json!({ "error": error.to_string(), "exit_code": error.exit_code() })
                        .to_string(),
                );
            }
            // If the standard error cannot be written to, the exit code still reports the failure.
            let _ = writeln!(io::stderr(), "penup: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Prints what a command has to say, as far as the user wants to know it.
fn say(cli: &Cli, outcome: &Outcome) -> Result<(), Error> {
    if cli.is_json() {
        print(&outcome.json.to_string())
    } else if outcome.text.is_empty() || cli.quiet && !outcome.is_answer {
        Ok(())
    } else {
        print(&outcome.text)
    }
}

fn print(text: &str) -> Result<(), Error> {
    if standard_holds_a_file() {
        // If the standard error cannot be written to, the exit code still tells the outcome.
        let _ = writeln!(io::stderr(), "{text}");
        return Ok(());
    }
    let mut stdout = io::stdout();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        // The reader of the pipe closed it early, as `head` does. This is no error.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => {
            result.map_err(|source| Error::Write { file: "the standard output".to_owned(), source })
        }
    }
}
