//! Answers at the standard input where the keys of a terminal are not taken ([`crate::keyboard`]).
//!
//! Only what comes behind a question answers it. At a terminal any line does, and what was typed
//! before is discarded. Elsewhere an empty line does, as by `ssh` or by a program that waits for
//! the question. What stands there before the first question was not written for it, such as the
//! list of files in `while read file; do penup plot "$file"; done < list`. It is left where it is,
//! and nobody is there who can answer.

use crate::link::Answer;
use std::io::{self, IsTerminal as _};
use std::sync::mpsc::{self, Receiver, TryRecvError};

/// Who answers at the standard input; see the [module](self).
#[derive(Debug, Default)]
pub struct TypedLines {
    user: User,
}

#[derive(Debug, Default)]
enum User {
    /// Nothing has been asked yet.
    #[default]
    Unasked,
    /// There is nobody.
    Nobody,
    /// Somebody may type these lines.
    Typing { lines: Receiver<String>, is_terminal: bool },
}

impl TypedLines {
    /// Prepares for a question. Returns whether somebody may answer it.
    pub fn begin_question(&mut self) -> bool {
        let is_terminal = io::stdin().is_terminal();
        if is_terminal {
            input::discard();
        }
        match &self.user {
            User::Nobody => return false,
            User::Typing { lines, .. } => while lines.try_recv().is_ok() {},
            User::Unasked if !is_terminal && input::waits() => {
                self.user = User::Nobody;
                return false;
            }
            User::Unasked => self.user = User::Typing { lines: lines(), is_terminal },
        }
        true
    }

    /// The answer to the question that was begun last.
    pub fn answer(&mut self) -> Answer {
        let User::Typing { lines, is_terminal } = &self.user else { return Answer::Nobody };
        match lines.try_recv() {
            Ok(line) if *is_terminal || line.trim().is_empty() => Answer::Yes,
            Err(TryRecvError::Empty) => Answer::NotYet,
            // A line with words is for another program.
            Ok(_) | Err(TryRecvError::Disconnected) => {
                self.user = User::Nobody;
                Answer::Nobody
            }
        }
    }
}

/// Starts a thread that passes on each line of the standard input. It runs until the process or the
/// input ends.
fn lines() -> Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        io::stdin().lines().map_while(Result::ok).all(|line| sender.send(line).is_ok())
    });
    receiver
}

#[cfg(unix)]
mod input {
    use rustix::io::ioctl_fionread;
    use rustix::process::getpgrp;
    use rustix::termios::{QueueSelector, tcflush, tcgetpgrp};
    use std::io::stdin;

    /// Whether bytes wait at the standard input, which is no terminal. An input that does not say
    /// so is at its end, or its end shows when it is read.
    pub fn waits() -> bool {
        ioctl_fionread(stdin()).is_ok_and(|bytes| bytes > 0)
    }

    /// Discards what was typed at the terminal.
    pub fn discard() {
        // The system stops a program in the background that does so.
        if tcgetpgrp(stdin()).is_ok_and(|foreground| foreground != getpgrp()) {
            return;
        }
        // Nothing can be done about a terminal that is gone.
        let _ = tcflush(stdin(), QueueSelector::IFlush);
    }
}

#[cfg(not(unix))]
mod input {
    /// Whether bytes wait at the standard input, which is no terminal. This system does not say so,
    /// and a wrong answer draws with the wrong pen.
    pub const fn waits() -> bool {
        true
    }

    /// The lines that were typed before are those that were read before.
    pub const fn discard() {}
}
