//! `penup`: sends files to a plotter, or to an emulated one, and shows the picture.

use clap::Parser;
use penup_client::cli::Cli;
use penup_client::run::run;
use std::io::Write;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPT: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let cli = Cli::parse();
    // The second Ctrl-C leaves at once. Without a handler Ctrl-C still ends the process.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPT.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    match run(&cli, &INTERRUPT) {
        Ok(sentence) => {
            // Whoever listened may have heard enough.
            let _ = writeln!(std::io::stdout(), "{sentence}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("penup: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
