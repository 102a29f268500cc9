//! `penup console`: lines from the standard input to the plotter, and its answers.

use super::open;
use crate::cli::PortArgs;
use crate::error::Error;
use crate::link::Link;
use crate::outcome::Outcome;
use crate::sender::{Sender, Timeouts};
use crate::stderr;
use penup_job::protocol::{ABORT, Reply, ReplyReader};
use penup_readers::lines::acts_at_once;
use serde_json::json;
use std::collections::VecDeque;
use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::Duration;

/// What a user types for the byte that gives a job up.
const ABORT_WORD: &str = "^X";

/// The longest pause in which the plotter is asked for nothing.
const PAUSE: Duration = Duration::from_millis(20);

/// After the end of the input, this many pauses in which nothing comes are the end.
const LAST_SILENCES: u32 = 25;
/// So many times [`PAUSE`] in a row without a byte, 3 s, until a greeting counts as lost.
const GREETING_SILENCES: u32 = 150;

/// What the user of a terminal is told first.
const GREETING: &str = "Type lines for the plotter; ? asks for the status, ! holds, ~ goes on, ^X \
                        gives up. Ctrl-D ends.";

/// Sends each line of the standard input when the one before is answered, and prints all that the
/// plotter says, with `is_json` each of its lines as an object. Lines of bytes that act at once are
/// not held back. Ends at the end of the input.
///
/// # Errors
/// The port cannot be opened, or the line to the plotter breaks.
pub fn console(args: &PortArgs, is_json: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let mut link = open(args)?;
    // A client that broke off may have left the plotter in a conversation with checksums.
    let (_, status) = Sender::join(&mut link, Timeouts::default(), interrupt)?;
    let is_reset = status.is_idle();
    if is_reset {
        link.send(&[ABORT])?;
    }
    if io::stdin().is_terminal() {
        stderr::say(GREETING);
    }
    let refused = talk(&mut link, &typed(), is_reset, is_json)?;
    Ok(Outcome { text: String::new(), json: json!({ "refused": refused }), is_answer: false })
}

/// Starts a thread that reads the standard input line by line. The last message may be an error.
fn typed() -> Receiver<io::Result<String>> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let lines = io::stdin().lock().split(b'\n');
        // Letters that are not UTF-8, such as those of a comment in Latin-1, do not end the input.
        let text = |line: Vec<u8>| String::from_utf8_lossy(&line).trim_end_matches('\r').to_owned();
        lines.map(|line| line.map(text)).all(|line| sender.send(line).is_ok())
    });
    receiver
}

/// The lines that end within `bytes`, each as an object of JSON. What follows them stays in `line`.
fn objects(bytes: &[u8], line: &mut Vec<u8>) -> Vec<u8> {
    let mut objects = Vec::new();
    for byte in bytes {
        if *byte != b'\n' {
            line.push(*byte);
            continue;
        }
        let said = String::from_utf8_lossy(line).trim().to_owned();
        line.clear();
        if !said.is_empty() {
            objects.extend(format!("{}\n", json!({ "said": said })).bytes());
        }
    }
    objects
}

/// Sends what is typed, and prints what the plotter says. With `is_reset` its greeting is still to
/// come, which answers no line. Returns how many lines were refused.
fn talk(
    link: &mut dyn Link,
    typed: &Receiver<io::Result<String>>,
    is_reset: bool,
    is_json: bool,
) -> Result<usize, Error> {
    let mut reader = ReplyReader::default();
    let mut waiting: VecDeque<String> = VecDeque::new();
    let (mut is_open, mut is_answered, mut refused) = (true, true, 0);
    let mut awaits_greeting = is_reset;
    let mut buffer = [0; 256];
    let mut line_said = Vec::new();
    let mut silences = 0;
    // A last question, such as that for the status, may still be answered.
    while is_open
        || !is_answered
        || awaits_greeting
        || !waiting.is_empty()
        || silences < LAST_SILENCES
    {
        match typed.try_recv() {
            Ok(Err(error)) => return Err(error.into()),
            Ok(Ok(line)) if line.trim() == ABORT_WORD => {
                link.send(&[ABORT])?;
                // The plotter forgets what it has not carried out, and answers by its greeting.
                waiting.clear();
                (is_answered, awaits_greeting) = (true, true);
            }
            Ok(Ok(line)) if !line.is_empty() && line.chars().all(acts_at_once) => {
                link.send(line.as_bytes())?;
            }
            Ok(Ok(line)) => waiting.push_back(line),
            Err(TryRecvError::Disconnected) => is_open = false,
            Err(TryRecvError::Empty) => {}
        }
        // A greeting that is lost is not waited for any longer.
        awaits_greeting &= silences < GREETING_SILENCES;
        if is_answered
            && !awaits_greeting
            && let Some(line) = waiting.pop_front()
        {
            link.send(format!("{line}\n").as_bytes())?;
            is_answered = false;
        }
        let count = link.receive(&mut buffer, PAUSE)?;
        silences = if count == 0 { silences + 1 } else { 0 };
        let bytes = buffer.get(..count).unwrap_or_default();
        let mut stdout = io::stdout().lock();
        let said = if is_json { objects(bytes, &mut line_said) } else { bytes.to_vec() };
        stdout
            .write_all(&said)
            .and_then(|()| stdout.flush())
            .map_err(|source| Error::Write { file: "the standard output".to_owned(), source })?;
        for reply in bytes.iter().filter_map(|byte| reader.push(*byte)) {
            match reply {
                Reply::Error(_) => {
                    is_answered = true;
                    refused += 1;
                }
                Reply::Ok => is_answered = true,
                Reply::Greeting(_) => (is_answered, awaits_greeting) = (true, false),
                _ => {}
            }
        }
    }
    Ok(refused)
}

#[cfg(test)]
mod tests {
    use super::{GREETING_SILENCES, LAST_SILENCES, objects, talk};
    use crate::link::{Answer, Link};
    use std::io;
    use std::sync::mpsc;
    use std::time::Duration;

    /// A plotter that greets and answers when it was listened to so many times since.
    struct Slow {
        greets_in: Option<u32>,
        answers_in: Option<u32>,
        lines: usize,
    }

    /// What a slow plotter takes for a line.
    const LONG: u32 = 2 * GREETING_SILENCES;

    impl Link for Slow {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.lines += bytes.iter().filter(|byte| **byte == b'\n').count();
            self.answers_in = Some(LONG);
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
            for (left, said) in [
                (&mut self.greets_in, &b"Grbl 1.1h [penup 0.1.0 '$' for help]\r\n"[..]),
                (&mut self.answers_in, b"error:9\r\n"),
            ] {
                *left = left.and_then(|left| left.checked_sub(1));
                if *left == Some(0) {
                    buffer[..said.len()].copy_from_slice(said);
                    return Ok(said.len());
                }
            }
            Ok(0)
        }

        fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
            Ok(Answer::Yes)
        }
    }

    #[test]
    fn a_greeting_answers_no_line() {
        for greets_in in [Some(3), Some(2 * LAST_SILENCES), None] {
            let mut plotter = Slow { greets_in, answers_in: None, lines: 0 };
            let (sender, typed) = mpsc::channel();
            for line in ["$H", "G0 X1"] {
                sender.send(Ok(line.to_owned())).expect("it is read");
            }
            drop(sender);
            let refused = talk(&mut plotter, &typed, true, true).expect("a conversation");
            assert_eq!((refused, plotter.lines), (2, 2), "{greets_in:?}");
        }
    }

    #[test]
    fn each_whole_line_is_an_object() {
        let mut line = Vec::new();
        assert_eq!(objects(b"ok\r\n<Id", &mut line), b"{\"said\":\"ok\"}\n");
        assert_eq!(objects(b"le>\n\n", &mut line), b"{\"said\":\"<Idle>\"}\n");
        assert!(line.is_empty());
    }
}
