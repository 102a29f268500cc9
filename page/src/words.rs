//! Words the plotter's messages for a user of the page.

use penup::plotter::OPTIONS;
use penup::protocol::{AlarmEntry, alarm_entries};
use penup_job::view::{AZIMUTH, ELEVATION, VIEW, Y_UP};
use penup_readers::lines::JobLine;
use penup_readers::{PLAN_OPTIONS, words};

/// The buttons of the page for the commands of the client that its messages name.
const COMMANDS: [(&str, &str); 9] = [
    ("`penup home` finds it", "press Home to find it"),
    ("`penup resume --at-origin`", "press \u{201c}The pen is at the origin: go on\u{201d}"),
    ("leave out --at-origin", "press \u{201c}Go on with it\u{201d}"),
    ("`penup again` draws it", "open its drawing and press Plot to draw it"),
    ("begin anew by `penup again`", "open its drawing and press Plot to begin anew"),
    ("`penup plot` begins", "Plot begins"),
    ("`penup jog` moves it", "the arrows under \u{201c}By hand\u{201d} move it"),
    ("`penup unlock`", "press Unlock"),
    ("give the job up by `penup abort`", "press Give up"),
];

/// Puts the second of each pair in place of the first.
fn with_buttons(text: &str, buttons: &[(&str, &str)]) -> String {
    buttons.iter().fold(text.to_owned(), |text, (said, button)| text.replace(said, button))
}

/// Names the controls of the page where the client's messages name its flags and commands.
pub fn for_page(text: &str) -> String {
    let mut text = with_buttons(text, &COMMANDS);
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
    let messages: Vec<_> = messages.iter().map(|it| with_buttons(it, &BUTTONS)).collect();
    let reason = words::explained(number, &messages);
    let text = match line.map(|line| (&line.origin, &line.sent)) {
        Some((Some(origin), _)) => {
            format!("{}, line {}: {reason}: {}", origin.file, origin.line, origin.shown())
        }
        Some((None, sent)) => sentence(&format!("{}: {reason}", words::as_option(sent))),
        None => sentence(&reason),
    };
    for_page(&text)
}

/// The buttons of the page for the lines that a plotter tells to send.
const BUTTONS: [(&str, &str); 6] = [
    ("'$H'|'$X' to unlock", "press Home or Unlock"),
    ("send $X to unlock", "press Unlock"),
    ("send $X", "press Unlock"),
    ("send $H", "press Home"),
    ("with $H", "with Home"),
    ("or $X if", "or Unlock if"),
];

/// A message of the plotter in the words of the page.
pub fn message(text: &str) -> String {
    for_page(&words::for_client(&with_buttons(text, &BUTTONS)))
}

/// Says what an alarm means and what to do about it.
pub fn alarm(number: u16, messages: &[String]) -> String {
    let said = if messages.is_empty() {
        String::new()
    } else {
        format!(" It said: {}.", message(&messages.join("; ")))
    };
    let entries = alarm_entries();
    match entries.iter().find(|entry| u16::from(entry.number) == number) {
        Some(AlarmEntry { cause, cure, .. }) => {
            let (cause, cure) = (cause.get(), with_buttons(cure.get(), &BUTTONS));
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

#[cfg(test)]
mod tests {
    use super::*;
    use penup::protocol::error_entries;

    /// The commands of the client for which the page has buttons. It has one for `penup plot`, too,
    /// but that draws more than the page can.
    const WITH_BUTTONS: [&str; 6] = ["home", "jog", "unlock", "resume", "again", "abort"];

    #[test]
    fn refusals_name_the_buttons_of_the_page() {
        for entry in error_entries() {
            let text = refusal(None, entry.number, &[]);
            for command in WITH_BUTTONS {
                assert!(!text.contains(&format!("penup {command}")), "{text}");
            }
            assert!(!text.contains("--at-origin"), "{text}");
        }
        let expected = [
            (
                164,
                "The plotter does not know where the pen is: press Home to find it; without limit \
                 switches put the pen at the origin by hand, then press \u{201c}The pen is at the \
                 origin: go on\u{201d}",
            ),
            (
                165,
                "The firmware has changed since the job began: open its drawing and press Plot to \
                 draw it from its beginning",
            ),
            (
                166,
                "A setting has changed since the job began that decides where ink falls: set it \
                 back, or open its drawing and press Plot to begin anew",
            ),
            (
                167,
                "The plotter holds another model than that of the job: Plot begins anew with a \
                 model of yours",
            ),
            (
                168,
                "The plotter knows where the pen is: press \u{201c}Go on with it\u{201d}; if the \
                 pen was moved by hand, switch the plotter off and on first",
            ),
            (
                169,
                "The job began at an origin set by hand, and the machine was homed since: put the \
                 pen at that origin (the arrows under \u{201c}By hand\u{201d} move it), switch \
                 the plotter off and on, then press Unlock and press \u{201c}The pen is at the \
                 origin: go on\u{201d}",
            ),
        ];
        for (number, text) in expected {
            assert_eq!(refusal(None, number, &[]), format!("{text} (error {number})"));
        }
    }

    #[test]
    fn alarms_name_the_buttons_of_the_page() {
        for entry in alarm_entries() {
            let text = alarm(entry.number.into(), &[]);
            let lines = ["$X", "$H", "penup "];
            assert!(lines.iter().all(|line| !text.contains(line)), "{text}");
        }
        let text = alarm(11, &[]);
        let cure = "press Home to find the limit switches, or Unlock if the pen stands at";
        assert!(text.contains(cure), "{text}");
    }
}
