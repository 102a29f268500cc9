//! The text of a line of G-code: its words, and what a line may be instead of words.

use super::RefusalText;

/// A line of a program.
#[derive(Debug, PartialEq)]
pub(super) enum Line {
    /// Letters in capitals and their numbers.
    Words(Vec<(char, f64)>),
    /// A line that orders nothing.
    Skipped,
    /// What follows a `/`: the machine may have a switch by which it leaves such lines out.
    Optional(String),
    /// A pause, which may have a message (`M0`, `M1`).
    Pause,
    /// A command of this name that takes no words, but text or named values.
    Command(String),
    /// A command of Klipper, or a macro of its usual name, that sets the servo of the pen to this
    /// level.
    Servo(f64),
}

/// The commands `M` of Marlin behind which a text follows, such as a message or the name of a file.
const WITH_TEXT: [u16; 10] = [0, 1, 16, 23, 28, 32, 70, 117, 118, 486];

/// The words that begin or end a part of a program that is not carried out in its order.
const CONTROL: [&str; 23] = [
    "SUB",
    "ENDSUB",
    "CALL",
    "RETURN",
    "DO",
    "WHILE",
    "ENDWHILE",
    "BREAK",
    "CONTINUE",
    "IF",
    "ELSEIF",
    "ELSE",
    "ENDIF",
    "REPEAT",
    "ENDREPEAT",
    "GOTO",
    "END",
    "FOR",
    "NEXT",
    "LABEL",
    "GOSUB",
    "THEN",
    "LOOP",
];

/// Parses a line.
///
/// # Errors
/// The reason why it is refused.
pub(super) fn parse(text: &str) -> Result<Line, RefusalText> {
    let text = without_comments(text);
    let text = text.trim();
    if text.starts_with('/') {
        let rest = text.trim_start_matches(|letter: char| letter == '/' || letter.is_whitespace());
        return Ok(Line::Optional(rest.to_owned()));
    }
    // Of the machine's own commands these move.
    let command = text.get(..2).unwrap_or_default().to_ascii_uppercase();
    if matches!(command.as_str(), "$J" | "$H") {
        return Ok(Line::Command(command));
    }
    // A mark of the beginning or end, or a setting of the machine.
    if text.starts_with(['%', '$']) || text.is_empty() {
        return Ok(Line::Skipped);
    }
    let rest = after_number(text);
    let rest = match rest.strip_prefix(['O', 'o']) {
        Some(labelled) => after_label(labelled)?,
        None => rest,
    };
    let name: String = rest
        .chars()
        .take_while(|letter| letter.is_ascii_alphanumeric() || *letter == '_')
        .collect();
    let name = name.to_ascii_uppercase();
    let letters: String = name.chars().take_while(char::is_ascii_alphabetic).collect();
    if CONTROL.contains(&letters.as_str()) {
        return Err(not_followed(&letters));
    }
    let code = name.strip_prefix('M').and_then(|code| code.parse().ok());
    if code.is_some_and(|code| WITH_TEXT.contains(&code)) {
        return Ok(if code > Some(1) { Line::Command(name) } else { Line::Pause });
    }
    let takes_values = rest.split_whitespace().skip(1).all(|word| word.contains('='));
    let level = match name.as_str() {
        "PEN_UP" => Some(1.0),
        "PEN_DOWN" => Some(0.0),
        "SET_SERVO" => rest.split_whitespace().find_map(|word| {
            let (key, level) = word.split_once('=')?;
            let is_level = ["ANGLE", "WIDTH"].iter().any(|it| it.eq_ignore_ascii_case(key));
            level.parse().ok().filter(|level: &f64| is_level && level.is_finite())
        }),
        _ => None,
    };
    if let Some(level) = level.filter(|_| takes_values) {
        return Ok(Line::Servo(level));
    }
    if letters.len() > 1 && name.len() > 2 && takes_values {
        return Ok(Line::Command(name));
    }
    let words = words(rest)?;
    Ok(if words.is_empty() { Line::Skipped } else { Line::Words(words) })
}

fn not_followed(words: &str) -> RefusalText {
    format!(
        "{words} is a subprogram, a loop or a condition, which are not followed: let the program \
         that wrote this file write it without them"
    )
}

/// The text after the number of the line, if it has one.
fn after_number(text: &str) -> &str {
    let Some(rest) = text.strip_prefix(['N', 'n']) else { return text };
    let digits = rest.trim_start();
    match digits.trim_start_matches(|letter: char| letter.is_ascii_digit()) {
        rest if rest.len() < digits.len() && !rest.starts_with('.') => rest.trim_start(),
        _ => text,
    }
}

/// The text after the number of a program.
///
/// # Errors
/// The label is that of a subprogram, a loop or a condition.
fn after_label(text: &str) -> Result<&str, RefusalText> {
    let text = text.trim_start();
    let end = match text.strip_prefix('<') {
        Some(_) => text.find('>').map_or(text.len(), |at| at + 1),
        None => text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len()),
    };
    let (label, rest) = text.split_at(end);
    let rest = rest.trim_start();
    let word: String = rest.chars().take_while(char::is_ascii_alphabetic).collect();
    if CONTROL.contains(&word.to_ascii_uppercase().as_str()) {
        return Err(not_followed(&format!("O{label} {word}").to_ascii_uppercase()));
    }
    Ok(rest)
}

/// The line without comments in parentheses or after a semicolon, without texts in quotation marks,
/// and without a checksum.
fn without_comments(text: &str) -> String {
    let mut kept = String::new();
    let mut is_within = false;
    let mut letters = text.chars();
    while let Some(letter) = letters.next() {
        match letter {
            ';' | '*' if !is_within => break,
            '(' => is_within = true,
            ')' => is_within = false,
            '"' if !is_within => match letters.as_str().split_once('"') {
                Some((_, rest)) => letters = rest.chars(),
                None => kept.push(letter),
            },
            letter if !is_within => kept.push(letter),
            _ => {}
        }
    }
    kept
}

/// A letter of a line, and whether whitespace stands before it.
type Letter = (char, bool);

/// The length of the exponent at the beginning of what follows a number: `e-05`, as programs write
/// it that do not think of the word E. That of a 3D printer has whitespace before it, no sign, or a
/// point.
fn exponent(after: &[Letter]) -> usize {
    let [('e' | 'E', false), ('+' | '-', false), digits @ ..] = after else { return 0 };
    let count = digits.iter().take_while(|(it, spaced)| it.is_ascii_digit() && !spaced).count();
    let goes_on = digits.get(count).is_some_and(|(it, _)| it.is_ascii_digit() || *it == '.');
    if (1..=3).contains(&count) && !goes_on { 2 + count } else { 0 }
}

/// The words of a line: letters in capitals and their numbers.
fn words(text: &str) -> Result<Vec<(char, f64)>, RefusalText> {
    let mut letters: Vec<Letter> = Vec::new();
    let mut is_spaced = false;
    for letter in text.chars() {
        if !letter.is_whitespace() {
            letters.push((letter, is_spaced));
        }
        is_spaced = letter.is_whitespace();
    }
    let mut words = Vec::new();
    let mut without_number = Vec::new();
    let mut rest = letters.as_slice();
    while let [(letter, _), after @ ..] = rest {
        let is_number = |(letter, _): &Letter| letter.is_ascii_digit() || "+-.".contains(*letter);
        let mut end = after.iter().position(|it| !is_number(it)).unwrap_or(after.len());
        // `G1E-5` turns the extruder back.
        if end > 0 && !matches!(letter, 'G' | 'g' | 'M' | 'm') {
            end += after.get(end..).map_or(0, exponent);
        }
        let (number, next) = after.split_at(end);
        let number: String = number.iter().map(|(letter, _)| letter).collect();
        if !letter.is_ascii_alphabetic() {
            return Err(format!("\"{letter}\" is no word of G-code"));
        }
        if number.is_empty() {
            without_number.push(letter.to_ascii_uppercase());
        }
        let value = if number.is_empty() { Some(0.0) } else { number.parse().ok() };
        let value = value.filter(|value: &f64| value.is_finite());
        let value = value.ok_or_else(|| format!("\"{letter}{number}\" is no number"))?;
        words.push((letter.to_ascii_uppercase(), value));
        rest = next;
    }
    // Marlin's commands may have letters without a number, such as `G28 X`. A move may not.
    let is_move = words.iter().any(|&(letter, code)| letter == 'G' && (0.0..4.0).contains(&code))
        || !words.iter().any(|(letter, _)| matches!(letter, 'G' | 'M'));
    let lacks = |letter: &&char| is_move || matches!(letter, 'G' | 'M');
    match without_number.iter().find(lacks) {
        Some(letter) => Err(format!("\"{letter}\" has no number")),
        None => Ok(words),
    }
}
