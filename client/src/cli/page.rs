//! The arguments of `penup page`, and what it does.

use super::{FormatArgs, machine};
use crate::board;
use crate::bridge::{Bridge, FarEnd};
use crate::error::Error;
use crate::machines;
use crate::outcome::Outcome;
use crate::ports;
use crate::serve::PageServer;
use crate::table::BoardRow;
use crate::workspace;
use clap::Args;
use std::env;
use std::io::{self, Write as _};
use std::path::PathBuf;

/// Options of `penup page`.
#[derive(Debug, Args)]
pub struct PageArgs {
    /// The file to show; - is the standard input [default: an example]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// The folder of the page [default: page beside this program, or what `cargo xtask page` has
    /// built in this checkout]
    #[arg(long, value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
    /// The port to listen at, on this computer alone; 0 takes one that is free
    #[arg(long, value_name = "PORT", default_value = "0")]
    pub listen: u16,
    /// The serial port of a plotter, for browsers that cannot use one.
    #[arg(
        long,
        value_name = "DEVICE",
        help = format!("Join the page to a plotter, in any browser. {}", machine::port_help()),
        conflicts_with = "board",
        help_heading = "Plotter"
    )]
    pub port: Option<String>,
    /// Join the page to this emulated board; what is drawn comes from its pins
    #[arg(long, value_parser = board::parser(), help_heading = "Plotter")]
    pub board: Option<&'static BoardRow>,
    /// How an answer is printed.
    #[command(flatten)]
    pub format: FormatArgs,
    /// Print the address, and open no browser
    #[arg(long)]
    pub no_browser: bool,
}

/// The folder of the page: beside this program if it came with one, else in the checkout.
fn built_page() -> PathBuf {
    let beside = env::current_exe().ok().and_then(|program| Some(program.parent()?.join("page")));
    let built = beside.filter(|folder| folder.join("index.html").is_file());
    built.unwrap_or_else(|| workspace::root().join("target/page"))
}

/// Serves the page until the process ends.
///
/// # Errors
/// The page is not built, the file cannot be read, the port is in use, or the plotter cannot be
/// joined.
pub fn serve(args: &PageArgs) -> Result<Outcome, Error> {
    let folder = args.folder.clone().unwrap_or_else(built_page);
    let bridge = bridge(args)?;
    let server = PageServer::new(&folder, args.file.as_deref(), args.listen, bridge)?;
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

/// The bridge to the plotter that the arguments name, and what the page calls that plotter.
fn bridge(args: &PageArgs) -> Result<Option<(String, Bridge)>, Error> {
    if let Some(board) = args.board {
        let open = move || machines::emulate(board).map(FarEnd::Board);
        let name = format!("Emulated board {}", board.name);
        return Ok(Some((name, Bridge::new(Box::new(open))?)));
    }
    let Some(device) = args.port.clone() else { return Ok(None) };
    let name = match device.as_str() {
        ports::AUTOMATIC => "The plotter of the program penup".to_owned(),
        device => format!("The plotter at {device}"),
    };
    let open =
        move || -> Result<FarEnd, Error> { Ok(FarEnd::Port(Box::new(ports::open(&device)?))) };
    Ok(Some((name, Bridge::new(Box::new(open))?)))
}
