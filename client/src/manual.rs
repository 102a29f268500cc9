//! Shell completions and manual pages, made from the definition of the command line.

use crate::cli::Cli;
use crate::error::Error;
use crate::outcome::Outcome;
use crate::output;
use clap::{Command, CommandFactory as _};
use clap_complete::Shell;
use clap_mangen::Man;
use serde_json::json;
use std::path::Path;

/// The completions for `shell`.
pub fn completions(shell: Shell) -> Outcome {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "penup", &mut text);
    let text = String::from_utf8_lossy(&text);
    Outcome::answer(text.trim_end(), json!({ "completions": text }))
}

/// The manual page of the program, or all pages written to `folder`.
///
/// # Errors
/// A page cannot be written.
pub fn pages(folder: Option<&Path>) -> Result<Outcome, Error> {
    let mut command = Cli::command();
    command.build();
    let mut pages = Vec::new();
    collect(&command, "penup", &mut pages);
    let Some(folder) = folder else {
        let (_, page) = pages.into_iter().next().unwrap_or_default();
        return Ok(Outcome::answer(page.trim_end(), json!({ "page": page })));
    };
    std::fs::create_dir_all(folder)
        .map_err(|source| Error::Write { file: folder.display().to_string(), source })?;
    for (name, page) in &pages {
        output::write(&folder.join(name), page.as_bytes())?;
    }
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    let text = format!("{}: {} pages", folder.display(), pages.len());
    Ok(Outcome::done(text, json!({ "folder": folder, "files": names })))
}

/// Adds the pages of `command`, which is called `name`, and of its subcommands.
fn collect(command: &Command, name: &str, pages: &mut Vec<(String, String)>) {
    let mut page = Vec::new();
    let man = Man::new(command.clone().display_name(name.to_owned()));
    // Writing to memory cannot fail.
    let _ = man.render(&mut page);
    pages.push((format!("{name}.1"), String::from_utf8_lossy(&page).into_owned()));
    for subcommand in command.get_subcommands().filter(|it| it.get_name() != "help") {
        collect(subcommand, &format!("{name}-{}", subcommand.get_name()), pages);
    }
}
