//! The lines of Grbl 1.1 with the answers that Grbl gives, from `tests/grbl/lines.txt`.

/// A row of the list.
pub struct Row<'a> {
    /// The state in which the line is sent.
    pub state: &'a str,
    /// What is sent: `⏎` ends a line, `\xHH` is a byte, `\p` is a pause of some milliseconds and
    /// `\w` one of a second and a half.
    pub sent: &'a str,
    /// What Grbl answers.
    pub grbl: &'a str,
    /// What penup answers where it differs on purpose.
    pub penup: Option<&'a str>,
}

/// All rows.
///
/// # Panics
/// Panics if a row has not the form of the list.
pub fn rows() -> impl Iterator<Item = Row<'static>> {
    let text = include_str!("../tests/grbl/lines.txt");
    text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(|line| {
        let mut fields = line.split(" | ");
        let mut field = || fields.next();
        let (state, sent) = (field().expect("a state"), field().expect("a line"));
        let (grbl, penup) = (field().unwrap_or(""), field());
        let has_reason = field().is_some_and(|reason| !reason.is_empty());
        assert!(penup.is_none() || has_reason, "no reason: {line}");
        Row { state, sent, grbl, penup }
    })
}

/// Whether the text is of this form, in which `*` stands for any text.
fn is_like(text: &str, form: &str) -> bool {
    let Some((first, mut form)) = form.split_once('*') else { return text == form };
    let Some(mut text) = text.strip_prefix(first) else { return false };
    while let Some((part, rest)) = form.split_once('*') {
        let Some(at) = text.find(part) else { return false };
        (text, form) = (&text[at + part.len()..], rest);
    }
    text.ends_with(form)
}

/// Whether the answer is the expected one. Messages count where the expected answer names them.
pub fn agrees(heard: &str, expected: &str) -> bool {
    let named = expected.contains("[MSG:");
    let lines: Vec<&str> = heard
        .lines()
        .filter(|line| named || !line.starts_with("[MSG:"))
        .skip_while(|line| line.is_empty())
        .collect();
    is_like(&lines.join("⏎"), expected.trim_start_matches('⏎'))
}
