//! Translates the plotter's messages into the terms of this program.
//!
//! The messages of the plotter and its library refer to the serial protocol, such as `$page` or
//! `send $pens=one`. A user who typed `--page` must read `--page`. The library's table of options
//! says which exist in both forms. [`for_client`] translates a message of the plotter with it,
//! [`as_option`] a line that was sent, and [`explained`] a refusal. For refusals whose text would
//! not help here, the library's table of errors has another text.

use penup::plotter::OPTIONS;
use penup::protocol::{ErrorEntry, error_entries};

/// The form of a plotter setting on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// `$name=value` is `--name value`.
    Value,
    /// `$name=on` is `--name`.
    Switch,
    /// `$number=value` is a setting of the machine.
    Setting,
    /// There is no such option; messages use these words instead.
    Words(&'static str),
}

/// The `$` words that occur in the plotter's messages, or that this program sends, and for which it
/// has no flag, without their `$`. Each has the words that stand for it.
const WORDS: &[(&str, &str)] = &[
    ("view", "the automatic view"),
    ("clear", "an empty model"),
    ("model", "the size of the model"),
    ("plot", "the drawing"),
    ("again", "drawing it once more"),
    ("100", "the steps per mm along x (setting 100 of the machine)"),
    ("101", "the steps per mm along y (setting 101)"),
    ("130", "the travel along x (setting 130 of the machine)"),
    ("131", "along y (setting 131)"),
];

/// The note on a solid most of whose edges are nearly flat. It says nothing new to a user who has
/// given `--crease`.
pub const MOSTLY_FLAT: &str =
    "most edges are nearly flat: --crease 30 leaves them out, and outlines stay";

/// The note on a model by a program that usually writes y up. It says nothing new to a user who has
/// said what is up.
pub const PROBABLY_Y_UP: &str =
    "the program that wrote it usually has y up: if the model lies on its side, add --y-up";

/// The refusals whose messages tell what the text for this program cannot: the setting that has
/// changed, and its value.
const TOLD_BY_MESSAGES: [u16; 1] = [OTHER_SETTING];

/// A setting has changed since the job began.
const OTHER_SETTING: u16 = 166;

/// What the library says of `error:number`. `None` if it has no such error.
///
/// ```
/// use penup_readers::words::error_entry;
/// assert_eq!(error_entry(2).map(|entry| entry.meaning.get()), Some("not a number"));
/// assert_eq!(error_entry(9999), None);
/// ```
pub fn error_entry(number: u16) -> Option<ErrorEntry> {
    error_entries().into_iter().find(|entry| entry.number == number)
}

/// The reason for a refusal, from the number of the error and the messages that the plotter sent
/// before it.
///
/// The messages are more precise than the meaning of the number, so they are included.
pub fn explained(number: u16, messages: &[String]) -> String {
    let entry = error_entry(number);
    if let Some(sentence) = entry.and_then(|entry| entry.for_client.get()) {
        let told = if TOLD_BY_MESSAGES.contains(&number) { messages } else { &[] };
        return format!("{} (error {number})", with_messages(sentence, told));
    }
    let unknown = "a reason that this client does not know";
    let meaning = entry.map_or(unknown, |entry| entry.meaning.get());
    format!("{} (error {number})", with_messages(meaning, messages))
}

/// The reason with the messages that the plotter sent before it refused.
fn with_messages(reason: &str, messages: &[String]) -> String {
    let messages = messages.iter().map(|message| for_client(message));
    std::iter::once(reason.to_owned()).chain(messages).collect::<Vec<_>>().join(": ")
}

/// Describes a line that was sent by the option that it came from.
///
/// ```
/// use penup_readers::words::as_option;
/// assert_eq!(as_option("$page=210x297"), "--page 210x297");
/// assert_eq!(as_option("$title=costs $5=x"), "--title costs $5=x");
/// assert_eq!(as_option("$plot"), "the drawing");
/// ```
pub fn as_option(line: &str) -> String {
    let Some(command) = line.strip_prefix('$') else { return line.to_owned() };
    let (name, value) = match command.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (command, None),
    };
    named(name, value)
}

/// Translates a message of the plotter into the terms of the command line.
///
/// ```
/// use penup_readers::words::for_client;
/// assert_eq!(for_client("choose a larger $page, or $fit=on"), "choose a larger --page, or --fit");
/// let for_all = for_client("send $pens=one to draw all with one");
/// assert_eq!(for_all, "use --pens one to draw all with one");
/// ```
pub fn for_client(text: &str) -> String {
    let mut parts = text.split('$');
    let mut translated = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = split_after(part, |letter| letter == '-');
        let (value, rest) = match rest.strip_prefix('=') {
            Some(rest) => {
                let (value, rest) = split_after(rest, |letter| letter == '-');
                (Some(value), rest)
            }
            None => (None, rest),
        };
        // On the command line an option is "used", and not "sent".
        if translated.ends_with("send ") {
            translated.truncate(translated.len() - "send ".len());
            translated.push_str("use ");
        }
        translated.push_str(&named(name, value));
        translated.push_str(rest);
    }
    translated
}

/// Splits `text` after its leading letters, digits and the characters that `or` accepts.
fn split_after(text: &str, or: impl Fn(char) -> bool) -> (&str, &str) {
    let is_in = |letter: char| letter.is_ascii_alphanumeric() || or(letter);
    text.split_at(text.find(|letter| !is_in(letter)).unwrap_or(text.len()))
}

/// Writes an option of the client with its value.
fn named(name: &str, value: Option<&str>) -> String {
    match (form(name), value) {
        // Of the words that have a value, only those for settings do not say it.
        (Some(Form::Words(words)), Some(value)) if name.parse::<u16>().is_ok() => {
            format!("{words} to {value}")
        }
        (Some(Form::Words(words)), _) => words.to_owned(),
        (Some(Form::Switch), Some("off")) => format!("no --{name}"),
        (Some(Form::Switch), _) | (Some(Form::Value), None) => format!("--{name}"),
        (Some(Form::Value), Some(value)) => format!("--{name} {value}"),
        (Some(Form::Setting), None) => format!("setting {name} of the machine"),
        (Some(Form::Setting), Some(value)) => format!("setting {name} of the machine to {value}"),
        // The firmware is of another version; its own word is better than nothing.
        (None, None) => name.to_owned(),
        (None, Some(value)) => format!("{name} {value}"),
    }
}

/// Returns how an option with this name is written for the client.
fn form(name: &str) -> Option<Form> {
    let words = WORDS.iter().find(|(word, _)| *word == name);
    words.map(|(_, words)| Form::Words(words)).or_else(|| {
        // One that the library does not know may be a typing error, or of newer firmware.
        if name.parse::<u16>().is_ok() {
            return Some(Form::Setting);
        }
        let option = OPTIONS.iter().find(|option| option.name == name)?;
        Some(if option.flag.get()?.is_switch { Form::Switch } else { Form::Value })
    })
}

#[cfg(test)]
mod tests;
