//! Words the plotter's messages for a user of the page.

use penup::plotter::OPTIONS;
use penup::protocol::{AlarmEntry, alarm_entries};
use penup_job::view::{AZIMUTH, ELEVATION, VIEW, Y_UP};
use penup_readers::lines::JobLine;
use penup_readers::{PLAN_OPTIONS, words};

/// Names the controls of the page where the client's messages name its flags.
pub fn for_page(text: &str) -> String {
    let mut text = text.to_owned();
    let views = [VIEW, AZIMUTH, ELEVATION, Y_UP].map(|option| option.name);
    let plans = PLAN_OPTIONS.iter().map(|option| option.name);
    let mut names: Vec<&str> = OPTIONS.iter().map(|option| option.name).collect();
    names.extend(views.into_iter().chain(plans).chain(["landscape"]));
    // `--title-size` must not become `"title"-size`.
    names.sort_by_key(|name| std::cmp::Reverse(name.len()));
    for name in names {
        text = text.replace(&format!("--{name}"), &format!("\u{201c}{name}\u{201d}"));
    }
    text
}

/// Says why a line was refused, from the number of the error and the messages before it.
pub fn refusal(line: Option<&JobLine>, number: u16, messages: &[String]) -> String {
    let reason = words::explained(number, messages);
    let text = match line.map(|line| (&line.origin, &line.sent)) {
        Some((Some(origin), _)) => {
            format!("{}, line {}: {reason}: {}", origin.file, origin.line, origin.shown())
        }
        Some((None, sent)) => sentence(&format!("{}: {reason}", words::as_option(sent))),
        None => sentence(&reason),
    };
    for_page(&text)
}

/// The buttons of the page for the lines that a cure of an alarm tells to send.
const BUTTONS: [(&str, &str); 4] = [
    ("send $X", "press Unlock"),
    ("send $H", "press Unlock, then Home"),
    ("with $H", "with Home"),
    ("or $X if", "or Unlock alone if"),
];

/// Says what an alarm means and what to do about it.
pub fn alarm(number: u16, messages: &[String]) -> String {
    let said = if messages.is_empty() {
        String::new()
    } else {
        format!(" It said: {}.", for_page(&words::for_client(&messages.join("; "))))
    };
    let entries = alarm_entries();
    match entries.iter().find(|entry| u16::from(entry.number) == number) {
        Some(AlarmEntry { cause, cure, .. }) => {
            let cure = BUTTONS
                .iter()
                .fold(cure.get().to_owned(), |cure, (line, button)| cure.replace(line, button));
            let cause = cause.get();
            format!("The plotter stopped with alarm {number}: {cause}.{said} What to do: {cure}.")
        }
        None => format!(
            "The plotter stopped with alarm {number}, which this page does not know.{said} Its \
             firmware is of another version than the page."
        ),
    }
}

/// The text with a capital letter at its beginning.
pub fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}
