//! What a command has to say when it has succeeded.

use serde_json::{Value, json};

/// The answer of a command, for a person and for a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The text for a person; may have several lines or none.
    pub text: String,
    /// The answer for `--json`.
    pub json: Value,
    /// Whether the user asked for the text itself. Otherwise it only tells what was done, and
    /// `--quiet` leaves it out.
    pub is_answer: bool,
}

impl Outcome {
    /// Tells what was done.
    pub fn done(text: impl Into<String>, json: Value) -> Self {
        Self { text: text.into(), json, is_answer: false }
    }

    /// Answers what was asked.
    pub fn answer(text: impl Into<String>, json: Value) -> Self {
        Self { text: text.into(), json, is_answer: true }
    }

    /// Tells in a sentence what was done, and has no other result.
    pub fn sentence(text: impl Into<String>) -> Self {
        let text = text.into();
        let json = json!({ "done": text });
        Self::done(text, json)
    }
}
