//! The questions to the user, and the answers.

use super::End;
use std::io::{self, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

/// The lines that the user types.
pub(super) struct Answers<'a> {
    typed: Receiver<String>,
    interrupt: &'a AtomicBool,
}

impl<'a> Answers<'a> {
    pub(super) fn new(interrupt: &'a AtomicBool) -> Self {
        let (sender, typed) = mpsc::channel();
        // The thread reads until the input or the process ends.
        std::thread::spawn(move || {
            io::stdin().lines().map_while(Result::ok).all(|line| sender.send(line).is_ok())
        });
        Self { typed, interrupt }
    }

    /// Asks a question and returns what the user types, in lower case.
    pub(super) fn ask(&self, question: &str) -> Result<String, End> {
        say(question);
        loop {
            match self.typed.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => return Ok(line.trim().to_lowercase()),
                Err(RecvTimeoutError::Disconnected) => return Err(End::BrokenOff),
                Err(RecvTimeoutError::Timeout) if self.interrupt.load(Ordering::Relaxed) => {
                    return Err(End::BrokenOff);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Asks until the answer is one of these words, or begins one of them.
    pub(super) fn choose<T: Copy>(&self, question: &str, words: &[(&str, T)]) -> Result<T, End> {
        loop {
            let answer = self.ask(question)?;
            let is_it = |(word, _): &&(&str, T)| !answer.is_empty() && word.starts_with(&answer);
            if let Some((_, choice)) = words.iter().find(is_it) {
                return Ok(*choice);
            }
            let words: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            say(&format!("Please type {}.", words.join(", ")));
        }
    }

    /// Asks until the answer is a number within these bounds; `None` if it is empty.
    pub(super) fn number(
        &self,
        question: &str,
        [least, most]: [f64; 2],
    ) -> Result<Option<f64>, End> {
        loop {
            let answer = self.ask(question)?;
            match answer.replace(',', ".").parse::<f64>() {
                _ if answer.is_empty() => return Ok(None),
                Ok(number) if (least..=most).contains(&number) => return Ok(Some(number)),
                _ => say(&format!("Please type a number from {least} to {most}.")),
            }
        }
    }

    pub(super) fn is_yes(&self, question: &str) -> Result<bool, End> {
        self.choose(&format!("{question} (yes, no)"), &[("yes", true), ("no", false)])
    }
}

/// Says something to the user, who is to answer; so `--quiet` does not silence it.
pub(super) fn say(text: &str) {
    // A closed standard error is no reason to fail.
    let _ = writeln!(io::stderr(), "{text}");
}
