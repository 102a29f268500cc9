//! Compares the tables of the documents, parsed as Markdown, with the tables of the source.
//!
//! For a row that is missing, out of date or superfluous, the failure shows the row to write
//! instead.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use clap::CommandFactory;
use penup::fixed::Length;
use penup::machine::SETTINGS;
use penup::plotter::help;
use penup::protocol::{ErrorEntry, alarm_entries, error_entries, error_samples};
use penup_client::cli::Cli;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A table of a document: its heading, and its rows as lists of cells in plain text.
type Table = Vec<Vec<String>>;

/// All tables of a document, with the position of each row in its text.
fn tables_of(text: &str) -> Vec<(Table, Vec<Range<usize>>)> {
    let mut tables: Vec<(Table, Vec<Range<usize>>)> = Vec::new();
    for (event, position) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
        let Event::Start(Tag::Table(_)) = event else {
            let Some((rows, positions)) = tables.last_mut() else { continue };
            match event {
                Event::Start(Tag::TableHead | Tag::TableRow) => {
                    rows.push(Vec::new());
                    positions.push(position);
                }
                Event::Start(Tag::TableCell) => {
                    rows.last_mut().expect("a row before its cells").push(String::new());
                }
                Event::Text(part) => push_text(rows, &part),
                // Code keeps its marks: a reader tells `$` from a dollar.
                Event::Code(part) => push_text(rows, &format!("`{part}`")),
                // Text behind the table is none of its last cell.
                Event::End(TagEnd::Table) => rows.push(Vec::new()),
                _ => {}
            }
            continue;
        };
        tables.push((Table::new(), Vec::new()));
    }
    for (rows, _) in &mut tables {
        rows.pop();
    }
    tables
}

fn push_text(rows: &mut Table, text: &str) {
    if let Some(cell) = rows.last_mut().and_then(|row| row.last_mut()) {
        cell.push_str(text);
    }
}

/// Formats a row as it must be written.
fn written(cells: &[String]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    format!("| {} |", cells.join(" | "))
}

fn protocol() -> String {
    std::fs::read_to_string(root().join("docs/protocol.md")).expect("docs/protocol.md")
}

fn root() -> PathBuf {
    penup_client::workspace::root()
}

/// Whether `PENUP_WRITE_DOCUMENTS=1` asks to write the documents instead of comparing them.
fn writes_documents() -> bool {
    std::env::var_os("PENUP_WRITE_DOCUMENTS").is_some()
}

/// Compares a table of `docs/protocol.md`, found by its heading, with the expected rows.
fn assert_table(heading: &[&str], rows: &[Vec<String>]) {
    // Each test writes its own table into the same file.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock();
    let text = protocol();
    let tables = tables_of(&text);
    let found = tables.iter().find(|(table, _)| table.first().is_some_and(|row| row == heading));
    let (found, positions) = found.unwrap_or_else(|| {
        panic!("docs/protocol.md has no table with the heading | {} |", heading.join(" | "))
    });
    if writes_documents() {
        let [_, first, .., last] = &positions[..] else { panic!("a table has rows") };
        let end = last.start + text[last.clone()].trim_end().len();
        let rows: Vec<String> = rows.iter().map(|row| written(row)).collect();
        let text = format!("{}{}{}", &text[..first.start], rows.join("\n"), &text[end..]);
        return std::fs::write(root().join("docs/protocol.md"), text).expect("it can be written");
    }
    let found = &found[1..];
    let mut faults = String::new();
    for row in rows.iter().filter(|row| !found.contains(row)) {
        faults += &format!("write this row: {}\n", written(row));
    }
    for row in found.iter().filter(|row| !rows.contains(row)) {
        faults += &format!("take this row out: {}\n", written(row));
    }
    assert!(faults.is_empty(), "the table of docs/protocol.md is not the source's:\n{faults}");
    assert_eq!(found, rows, "the rows of docs/protocol.md stand in another order");
}

#[test]
fn the_settings_are_those_of_the_source() {
    let rows: Vec<Vec<String>> = SETTINGS
        .iter()
        .map(|info| {
            let [least, greatest, default] =
                [info.least, info.greatest, info.default].map(|value| Length(value).to_string());
            let number = info.number().to_string();
            vec![number, info.name.into(), info.unit().into(), least, greatest, default]
        })
        .collect();
    assert_table(&["number", "name", "unit", "least", "greatest", "default"], &rows);
}

#[test]
fn the_errors_are_those_of_the_source() {
    let row = |entry: &ErrorEntry| vec![entry.number.to_string(), entry.meaning.get().into()];
    let rows: Vec<Vec<String>> = error_entries().iter().map(row).collect();
    assert_table(&["number", "meaning"], &rows);
}

#[test]
fn the_commands_and_options_are_those_of_the_source() {
    let mut rows: Vec<Vec<String>> = Vec::new();
    help(&mut |usage, meaning| rows.push(vec![format!("`{usage}`"), meaning.into()]));
    assert_table(&["command", "what it does"], &rows);
}

/// The number of cells in the text of a row. A Markdown parser drops superfluous cells.
fn cells_written(row: &str) -> usize {
    let row = row.trim().trim_start_matches('|');
    let bars = row.match_indices('|').filter(|(at, _)| !row[..*at].ends_with('\\')).count();
    if row.ends_with('|') && !row.ends_with("\\|") { bars } else { bars + 1 }
}

#[test]
fn every_row_of_every_document_has_as_many_cells_as_its_heading() {
    let mut documents = vec![root().join("README.md"), root().join("CHANGELOG.md")];
    for folder in ["docs", "docs/gallery"] {
        let files = std::fs::read_dir(root().join(folder)).expect("a folder of documents");
        let files = files.map(|file| file.expect("a file").path());
        documents.extend(files.filter(|file| file.extension().is_some_and(|end| end == "md")));
    }
    for document in documents {
        let text = std::fs::read_to_string(&document).expect("a document");
        for (table, positions) in tables_of(&text) {
            let columns = table.first().map_or(0, Vec::len);
            for position in positions {
                let row = &text[position];
                assert_eq!(cells_written(row), columns, "{}: {row}", document.display());
            }
        }
    }
}

/// The files below `folder` that are source or documents, but for what is built or installed.
fn sources_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of source") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() {
            if !["target", "node_modules", ".git", "corpus", "artifacts"].contains(&name) {
                sources_below(&path, found);
            }
        } else if ["rs", "mjs", "js", "toml", "css", "html", "py", "sh", "x", "md"]
            .iter()
            .any(|end| path.extension().is_some_and(|extension| extension == *end))
        {
            found.push(path);
        }
    }
}

/// `cargo fmt` breaks no comment and no string. Only the row of a table must be one line.
#[test]
fn no_line_has_more_than_100_columns() {
    let mut sources = Vec::new();
    sources_below(&root(), &mut sources);
    assert!(sources.len() > 300, "{} files", sources.len());
    let mut long = String::new();
    for source in sources {
        let text = std::fs::read_to_string(&source).expect("a source in UTF-8");
        for (number, line) in (1..).zip(text.lines()) {
            if line.chars().count() > 100 && !line.starts_with('|') {
                long += &format!("{}:{number}\n", source.display());
            }
        }
    }
    assert!(long.is_empty(), "more than 100 columns:\n{long}");
}

/// A long file of Rust has more than one purpose, unless its head gives a reason.
#[test]
fn a_file_of_more_than_500_lines_says_why() {
    let mut sources = Vec::new();
    sources_below(&root(), &mut sources);
    sources.retain(|source| source.extension().is_some_and(|extension| extension == "rs"));
    let mut long = String::new();
    for source in sources {
        let text = std::fs::read_to_string(&source).expect("a source in UTF-8");
        let head: String = text.lines().take_while(|line| line.starts_with("//!")).collect();
        let gives_reason = ["longer than", "some 500 lines"].iter().any(|it| head.contains(it));
        if text.lines().count() > 500 && !gives_reason {
            long += &format!("{}\n", source.display());
        }
    }
    assert!(long.is_empty(), "more than 500 lines, and the head gives no reason:\n{long}");
}

#[test]
fn a_bar_that_is_not_escaped_shifts_the_cells_and_is_found() {
    let heading = "| unit | least | default |\n|---|---|---|\n";
    let cells = |row: &str| {
        let text = format!("{heading}{row}\n\nText.");
        let (table, positions) = tables_of(&text).remove(0);
        (table[1].clone(), cells_written(&text[positions[1].clone()]))
    };
    let own = |cells: [&str; 3]| cells.map(String::from).to_vec();
    assert_eq!(cells("| 0|1 | 0 | 1 |"), (own(["0", "1", "0"]), 4));
    assert_eq!(cells("| 0\\|1 | 0 | `a\\|b` |"), (own(["0|1", "0", "`a|b`"]), 3));
    assert_eq!(cells("| 0 | 1 |"), (own(["0", "1", ""]), 2));
}

#[test]
fn the_licences_that_are_declared_have_their_texts() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).expect(name);
    let readme = read("README.md");
    assert!(read("Cargo.toml").contains("license = \"MIT OR Apache-2.0\""));
    for (name, words) in
        [("LICENSE-MIT", "the penup contributors"), ("LICENSE-APACHE", "Version 2.0, January 2004")]
    {
        assert!(read(name).contains(words), "{name}");
        assert!(readme.contains(&format!("]({name})")), "README.md does not lead to {name}");
    }
}

/// Behind this line of `docs/client.md` stands what the client's own help says.
const END_OF_INTRODUCTION: &str = "<!-- What follows is printed by the client. -->\n";

/// The help of `command` and of its subcommands, each as a section.
fn push_help(command: &mut clap::Command, path: &str, text: &mut String) {
    let help = command.clone().bin_name(path).term_width(96).render_long_help().to_string();
    let lines: Vec<&str> = help.trim().lines().map(str::trim_end).collect();
    *text += &format!("\n## {path}\n\n```text\n{}\n```\n", lines.join("\n"));
    for subcommand in command.get_subcommands_mut().filter(|command| command.get_name() != "help") {
        let path = format!("{path} {}", subcommand.get_name());
        push_help(subcommand, &path, text);
    }
}

#[test]
fn the_help_of_the_client_is_its_document() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs/client.md");
    let text = std::fs::read_to_string(&path).expect("docs/client.md");
    let (introduction, body) = text.split_once(END_OF_INTRODUCTION).expect("the line before it");
    let mut help = String::new();
    push_help(&mut Cli::command(), "penup", &mut help);
    if writes_documents() {
        let text = format!("{introduction}{END_OF_INTRODUCTION}{help}");
        return std::fs::write(&path, text).expect("docs/client.md can be written");
    }
    assert!(
        body == help,
        "docs/client.md is out of date; write it anew with \
         PENUP_WRITE_DOCUMENTS=1 cargo test -p penup-host-tests --test documents"
    );
}

/// Behind this line of `docs/errors.md` stands what the tables of the source say.
const END_OF_ERRORS_INTRODUCTION: &str = "<!-- What follows is made from the source. -->\n";

#[test]
fn every_alarm_and_error_is_in_its_document_with_cause_and_cure() {
    let mut body = String::from("\n## Alarms\n");
    for entry in alarm_entries() {
        let (cause, cure) = (entry.cause.get(), entry.cure.get());
        body += &filled(&format!("- **ALARM:{}**: {cause}. To do: {cure}.", entry.number));
    }
    body += "\n## Errors\n";
    for entry in error_entries() {
        body += &format!("\n### error:{}, {}\n\n", entry.number, entry.meaning.get());
        let samples = error_samples();
        let of_this = samples.iter().filter(|error| error.entry() == entry);
        let mut sentences: Vec<String> = of_this.map(ToString::to_string).collect();
        sentences.dedup();
        assert!(sentences.iter().all(|sentence| !sentence.is_empty()), "{entry:?}");
        for sentence in sentences {
            body += filled(&format!("- {sentence}.")).trim_start_matches('\n');
        }
        if let Some(words) = entry.for_client.get() {
            body +=
                filled(&format!("- The program `penup` says: {words}.")).trim_start_matches('\n');
        }
    }
    let path = root().join("docs/errors.md");
    let text = std::fs::read_to_string(&path).expect("docs/errors.md");
    let (introduction, written) =
        text.split_once(END_OF_ERRORS_INTRODUCTION).expect("the line before the tables");
    if writes_documents() {
        let text = format!("{introduction}{END_OF_ERRORS_INTRODUCTION}{body}");
        return std::fs::write(&path, text).expect("docs/errors.md can be written");
    }
    assert!(
        written == body,
        "docs/errors.md is out of date; write it anew with \
         PENUP_WRITE_DOCUMENTS=1 cargo test -p penup-host-tests --test documents"
    );
}

/// An item of a list, filled to lines of 100 columns, with an empty line before it. Signs that
/// Markdown would read as its own are escaped.
fn filled(item: &str) -> String {
    let escaped = item.replace('<', "\\<").replace('$', "\\$").replace('|', "\\|");
    let mut text = String::from("\n");
    let mut column = 0;
    for word in escaped.split(' ') {
        if column > 0 && column + 1 + word.chars().count() > 100 {
            text += "\n  ";
            column = 2;
        } else if column > 0 {
            text += " ";
            column += 1;
        }
        text += word;
        column += word.chars().count();
    }
    text + "\n"
}
