//! The arguments of `penup page`, and what it does.

use super::FormatArgs;
use crate::error::Error;
use crate::outcome::Outcome;
use crate::serve::PageServer;
use crate::workspace;
use clap::Args;
use std::io::{self, Write as _};
use std::path::PathBuf;

/// Options of `penup page`.
#[derive(Debug, Args)]
pub struct PageArgs {
    /// The file to show [default: an example]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// The folder that `cargo xtask page` has built [default: that of this checkout]
    #[arg(long, value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
    /// The port to listen at, on this computer alone; 0 takes one that is free
    #[arg(long, value_name = "PORT", default_value = "0")]
    pub listen: u16,
    /// How an answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// Print the address, and open no browser
    #[arg(long)]
    pub no_browser: bool,
}

/// Serves the page until the process ends.
///
/// # Errors
/// The page is not built, the file cannot be read, or the port is in use.
pub fn serve(args: &PageArgs) -> Result<Outcome, Error> {
    let folder = args.folder.clone().unwrap_or_else(|| workspace::root().join("target/page"));
    let server = PageServer::new(&folder, args.file.as_deref(), args.listen)?;
    let address = server.address();
    let said = match args.format.json {
        true => serde_json::json!({ "address": address }).to_string(),
        false => address.clone(),
    };
    let printed = writeln!(io::stdout(), "{said}").and_then(|()| io::stdout().flush());
    printed.map_err(|source| Error::Write { file: "the standard output".to_owned(), source })?;
    // A closed standard error is no reason to fail, nor is a computer without a browser.
    let say = |text: &str| drop(writeln!(io::stderr(), "penup: {text}"));
    if !args.no_browser && open::that_detached(&address).is_err() {
        say("no browser could be opened: open the address above in one");
    }
    say("Ctrl-C ends the page");
    server.run();
    Ok(Outcome::sentence("the page is closed"))
}
