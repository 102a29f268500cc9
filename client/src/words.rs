//! Translates the plotter's messages into the terms of this program.
//!
//! The messages of the plotter and its library refer to the serial protocol, such as `$page` or
//! `send $pens=one`. A user who typed `--page` must read `--page`. `OPTIONS` is the single table of
//! the options that exist in both forms. [`told`] translates a message of the plotter with it,
//! [`asked`] a line that was sent, and [`explained`] a refusal. For refusals whose text would not
//! help here, the number of the error selects another text.

use crate::protocol::meaning;

/// The form of a plotter setting on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// `$name=value` is `--name value`.
    Value,
    /// `$name=on` is `--name`.
    Switch,
    /// There is no such option; messages use these words instead.
    Words(&'static str),
}

/// Each `$` word that occurs in the plotter's messages or that this program sends, without its `$`.
const OPTIONS: &[(&str, Form)] = &[
    ("eye", Form::Value),
    ("at", Form::Value),
    ("up", Form::Value),
    ("angles", Form::Value),
    ("projection", Form::Value),
    ("behind", Form::Value),
    ("see", Form::Value),
    ("hidden", Form::Value),
    ("seams", Form::Value),
    ("blocks", Form::Value),
    ("crease", Form::Value),
    ("pens", Form::Value),
    ("page", Form::Value),
    ("margin", Form::Value),
    ("title", Form::Value),
    ("title-size", Form::Value),
    ("fit", Form::Switch),
    ("order", Form::Value),
    ("cycle", Form::Switch),
    ("effort", Form::Value),
    ("lift", Form::Value),
    ("view", Form::Words("the automatic view")),
    ("clear", Form::Words("an empty model")),
    ("model", Form::Words("the size of the model")),
    ("plot", Form::Words("the drawing")),
    ("again", Form::Words("drawing it once more")),
    ("100", Form::Words("the steps per mm along x (setting 100 of the machine)")),
    ("101", Form::Words("the steps per mm along y (setting 101)")),
    ("130", Form::Words("the travel along x (setting 130 of the machine)")),
    ("131", Form::Words("along y (setting 131)")),
];

/// Texts for refusals whose own text refers to the serial line only, with the numbers of the
/// errors.
const SENTENCES: &[(u16, &str)] = &[
    (
        1,
        "penup reads the OBJ keywords v, f, l, o, g, s, usemtl, mtllib, vn, vt, cstype, deg, curv, \
         parm and end",
    ),
    (3, "the plotter does not know this: its firmware and this program are of different versions"),
    (5, "the plotter has no limit switches, or its homing is off (setting 22 of the machine)"),
    (8, "the plotter is busy: wait until its plot ends, or reset it"),
    (9, "the plotter is locked after an alarm: release its stop if it is pressed, then unlock it"),
    (101, "bytes were lost on the line: check the cable, and that nothing else uses the port"),
    (120, "there is nothing to draw: the file has no faces, lines or curves"),
    (161, "the plotter keeps no job"),
    (162, "the kept job is counted in other steps"),
    (170, "a line was damaged on its way: check the cable, and keep it away from the motors"),
    (171, "a line was lost on its way: check the cable, and that nothing else uses the port"),
    (
        172,
        "a line lost its number on its way: check the cable, and that nothing else uses the port",
    ),
];

/// The reason for a refusal, from the number of the error and the messages that the plotter sent
/// before it.
///
/// The messages are more precise than the meaning of the number, so they are included.
pub fn explained(number: u16, messages: &[String]) -> String {
    if let Some((_, sentence)) = SENTENCES.iter().find(|(own, _)| *own == number) {
        return format!("{sentence} (error {number})");
    }
    let mut reason = meaning(number).to_owned();
    for message in messages {
        reason.push_str(": ");
        reason.push_str(&told(message));
    }
    format!("{reason} (error {number})")
}

/// Describes a line that was sent by the option that it came from.
///
/// ```
/// use penup_client::words::asked;
/// assert_eq!(asked("$page=210x297"), "--page 210x297");
/// assert_eq!(asked("$title=costs $5=x"), "--title costs $5=x");
/// assert_eq!(asked("$plot"), "the drawing");
/// ```
pub fn asked(line: &str) -> String {
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
/// use penup_client::words::told;
/// assert_eq!(told("choose a larger $page, or $fit=on"), "choose a larger --page, or --fit");
/// assert_eq!(told("send $pens=one to draw all with one"), "use --pens one to draw all with one");
/// ```
pub fn told(text: &str) -> String {
    let mut parts = text.split('$');
    let mut told = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = split_after(part, |letter| letter == '-');
        let (value, rest) = match rest.strip_prefix('=') {
            Some(rest) => {
                let (value, rest) = split_after(rest, |letter| letter == '-');
                (Some(value), rest)
            }
            None => (None, rest),
        };
        // On the command line an option is used, not sent.
        if told.ends_with("send ") {
            told.truncate(told.len() - "send ".len());
            told.push_str("use ");
        }
        told.push_str(&named(name, value));
        told.push_str(rest);
    }
    told
}

/// Splits `text` after its leading letters, digits and the characters that `or` accepts.
fn split_after(text: &str, or: impl Fn(char) -> bool) -> (&str, &str) {
    let is_in = |letter: char| letter.is_ascii_alphanumeric() || or(letter);
    text.split_at(text.find(|letter| !is_in(letter)).unwrap_or(text.len()))
}

fn named(name: &str, value: Option<&str>) -> String {
    match (form(name), value) {
        (Some(Form::Words(words)), _) => words.to_owned(),
        (Some(Form::Switch), Some("off")) => format!("no --{name}"),
        (Some(Form::Switch), _) | (Some(Form::Value), None) => format!("--{name}"),
        (Some(Form::Value), Some(value)) => format!("--{name} {value}"),
        // The firmware is of another version; its own word is better than nothing.
        (None, None) => name.to_owned(),
        (None, Some(value)) => format!("{name} {value}"),
    }
}

fn form(name: &str) -> Option<Form> {
    OPTIONS.iter().find(|(option, _)| *option == name).map(|(_, form)| *form)
}

#[cfg(test)]
mod tests;
