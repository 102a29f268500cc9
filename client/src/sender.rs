//! Sends the lines of a job to a plotter and processes the replies.
//!
//! Every line carries a number and a checksum (see `docs/protocol.md`), and replies are matched by
//! number. Bytes that are lost or corrupted in either direction therefore never lead to a different
//! drawing. [`Sender::open`] makes sure that penup firmware answers and is idle. [`Sender::stream`]
//! keeps the plotter's receive queue filled without overflowing it, resends lines that did not
//! arrive, and compares the checksums of the model and of the options with what was sent.
//! [`Sender::plot`] starts the drawing, handles changes of pens and waits for the end. A failure
//! that cannot be repaired ends with an error that says what happened.
//!
//! When a line is refused as corrupted or out of order, or when replies stop, the sender asks for
//! the number of the last accepted line. The answer also proves that the plotter has read
//! everything that was sent before the question, so its queue is empty. Sending resumes after that
//! number.

mod delivery;
mod drawing;
mod ending;
mod orders;
mod refusals;
mod timeouts;
mod streaming;

pub use streaming::{Arrival, Stopped, Taken};
pub use timeouts::Timeouts;

use crate::error::Error;
use crate::link::{Link, UserRequest};
use crate::progress::{Progress, Quiet};
use penup_job::protocol::{
    ABORT, END, LAST_NUMBER, MODEL, Reply, ReplyReader, STATUS_QUERY, Status, is_penup, numbered,
};
use penup_job::twin;
use penup_readers::lines::{JobLine, Lines};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The maximum number of times that a job is started again because the plotter was told to abort
/// it.
const MOST_RESTARTS: u32 = 5;

/// The maximum number of queries for what no answer has told yet.
const MOST_QUESTIONS: u32 = 30;

/// The number of differing answers after which the sender reports that the plotter holds something
/// else than was sent.
const SURE_OF_OTHER_CONTENTS: u32 = 3;

/// The longest time that the end of a conversation takes.
const LONGEST_END: Duration = Duration::from_secs(3);

/// A conversation with a plotter that answered and was idle when it began.
pub struct Sender<'a> {
    link: &'a mut dyn Link,
    timeouts: Timeouts,
    interrupt: &'a AtomicBool,
    reader: ReplyReader,
    replies: VecDeque<Reply>,
    last_heard: Instant,
    last_query: Instant,
    /// The number of the last line that is known to have been accepted.
    done: i32,
    /// The messages for the user that the plotter sent since its last accepted line.
    messages: Vec<String>,
    /// The total number of strokes of the current drawing.
    strokes: u64,
    /// The position that the machine reported when it was last idle, as text.
    position: String,
    /// The checksums of the model and of the options, once the plotter has confirmed them.
    contents: Option<[u32; 2]>,
    /// The last status report, with what it does not tell from those before.
    last_status: Status,
    /// Whether a machine that is locked after an alarm is no failure.
    allows_alarm: bool,
    /// What the user beside the plotter has asked for and has not been done yet.
    requests: VecDeque<UserRequest>,
    /// How much has arrived of the drawing that was sent last while it was drawn.
    arrival: Arrival,
}

/// Computes the line to cite in an error; it is called only if there is an error.
type AtLine<'l> = &'l dyn Fn() -> Option<JobLine>;

impl<'a> Sender<'a> {
    /// Waits until an idle plotter with penup firmware answers, and discards what is left of an
    /// earlier conversation.
    ///
    /// If `interrupt` is set at any later time, the job stops with the pen up and
    /// [`Error::Interrupted`].
    ///
    /// # Errors
    /// Nothing answers, something other than penup answers, or the plotter is busy.
    pub fn open(
        link: &'a mut dyn Link,
        timeouts: Timeouts,
        interrupt: &'a AtomicBool,
    ) -> Result<Self, Error> {
        let mut sender = Self::new(link, timeouts, interrupt);
        sender.take_over(Status::is_idle)?;
        Ok(sender)
    }

    /// A conversation that has not begun.
    fn new(link: &'a mut dyn Link, timeouts: Timeouts, interrupt: &'a AtomicBool) -> Self {
        let now = link.now();
        Self {
            link,
            timeouts,
            interrupt,
            reader: ReplyReader::default(),
            replies: VecDeque::new(),
            last_heard: now,
            last_query: now,
            done: 0,
            messages: Vec::new(),
            strokes: 0,
            position: String::new(),
            contents: None,
            last_status: Status::default(),
            allows_alarm: false,
            requests: VecDeque::new(),
            arrival: Arrival::Part,
        }
    }

    /// Begins the conversation with a plotter that `is_ready`, and returns its status.
    fn take_over(&mut self, is_ready: impl Fn(&Status) -> bool) -> Result<Status, Error> {
        let status = self.find_state()?;
        if !is_ready(&status) {
            return Err(Error::NotReady { state: status.state });
        }
        self.position.clone_from(&status.position);
        // Nothing moves, so an abort loses nothing. It clears what an earlier sender left half
        // sent.
        let greeting = self.abort()?;
        self.begin_numbers(greeting)?;
        Ok(status)
    }

    /// Asks for the status until the plotter answers.
    fn find_state(&mut self) -> Result<Status, Error> {
        let start = self.link.now();
        let mut heard = None;
        self.query()?;
        while self.since(start) < self.timeouts.silence {
            self.stop_if_interrupted()?;
            match self.listen()? {
                Some(Reply::Status(status)) => return Ok(status),
                Some(Reply::Greeting(text)) if !is_penup(&text) => {
                    return Err(Error::NotPenup { heard: text });
                }
                Some(Reply::Other(text)) => heard = Some(text),
                _ => self.query_if_due()?,
            }
        }
        match heard {
            // A wrong baud rate or another device also produces bytes without a line end.
            None if self.last_heard <= start => Err(self.silent(&|| None)),
            heard => Err(Error::NotPenup { heard: heard.unwrap_or_default() }),
        }
    }

    /// Sets the plotter's line counter so that the next line is number 1. Any other reply until
    /// then belongs to an earlier conversation.
    fn begin_numbers(&mut self, mut greeting: Option<String>) -> Result<(), Error> {
        let start = self.link.now();
        self.last_heard = start;
        let (mut refused, mut knows_numbers) = (0, false);
        while self.since(start) < self.timeouts.lost {
            // The first line end terminates what is left of a corrupted line.
            self.send(&format!("\n{}\n", numbered(Some(0), LAST_NUMBER)))?;
            let requested_at = self.link.now();
            while self.since(requested_at) < self.timeouts.reply {
                self.stop_if_interrupted()?;
                match self.listen()? {
                    Some(Reply::Done(0)) => {
                        self.done = 0;
                        self.messages.clear();
                        return Ok(());
                    }
                    Some(Reply::Done(_) | Reply::Refused(..) | Reply::Resend(_)) => {
                        knows_numbers = true;
                    }
                    Some(Reply::Error(_)) => {
                        refused += 1;
                        break;
                    }
                    Some(Reply::Greeting(text)) => greeting = Some(text),
                    _ => self.query_if_due()?,
                }
            }
            self.fail_if_silent(&|| None)?;
            let is_other = greeting.as_deref().is_some_and(|greeting| !is_penup(greeting));
            if refused >= 5 && !knows_numbers {
                let heard = greeting.unwrap_or_default();
                return Err(if is_other {
                    Error::NotPenup { heard }
                } else {
                    Error::WithoutNumbers
                });
            }
        }
        match greeting {
            Some(heard) if !is_penup(&heard) => Err(Error::NotPenup { heard }),
            _ => Err(Error::LostLine { line: None }),
        }
    }

    /// Sends `lines` and checks that the plotter then holds what they describe. The lines must
    /// begin by clearing the model and must set every option.
    ///
    /// # Errors
    /// Fails at the first line that is refused or not answered, or with [`Error::OtherContents`] if
    /// the plotter holds something else. Later lines may have been accepted.
    pub fn stream(&mut self, lines: &dyn Lines, progress: &mut dyn Progress) -> Result<(), Error> {
        let expected = twin::contents(lines, lines.count());
        let mut restarts = 0;
        loop {
            let sent = self.deliver(lines, progress).and_then(|()| self.compare(expected));
            match sent {
                Err(Error::Restarted) if restarts < MOST_RESTARTS => {
                    restarts += 1;
                    self.begin_again(lines)?;
                }
                result => return result,
            }
        }
    }

    /// Prepares to send the job again after a greeting in the middle of it. This is possible if the
    /// plotter was only told to abort: it still holds what it was sent and has not moved. Otherwise
    /// it fails with [`Error::Restarted`].
    fn begin_again(&mut self, lines: &dyn Lines) -> Result<(), Error> {
        let taken = usize::try_from(self.done).unwrap_or(0);
        let (status, contents) = self.look_again()?;
        if !status.is_idle() || status.position != self.position {
            return Err(Error::Restarted);
        }
        // A plotter that lost its power has also lost its position and its settings.
        let was_there = twin::contents(lines, taken);
        let empty = twin::contents(lines, 0);
        let is_empty = |contents: Option<[u32; 2]>| {
            contents.zip(empty).is_some_and(|(contents, empty)| contents[0] == empty[0])
        };
        if !is_empty(was_there) && is_empty(Some(contents)) {
            return Err(Error::Restarted);
        }
        Ok(())
    }

    /// Begins the numbers of lines anew behind a greeting. Returns the status, and the checksums of
    /// the model and of the options. Further greetings may come meanwhile: each opening of a port
    /// makes one.
    fn look_again(&mut self) -> Result<(Status, [u32; 2]), Error> {
        let mut restarts = 0;
        loop {
            self.begin_numbers(None)?;
            let status = self.find_state()?;
            match self.contents() {
                Err(Error::Restarted) if restarts < MOST_RESTARTS => restarts += 1,
                contents => return Ok((status, contents?)),
            }
        }
    }

    /// Checks that the plotter's checksums are `expected`.
    fn compare(&mut self, expected: Option<[u32; 2]>) -> Result<(), Error> {
        for _ in 0..SURE_OF_OTHER_CONTENTS {
            if Some(self.contents()?) == expected {
                self.contents = expected;
                return Ok(());
            }
        }
        Err(Error::OtherContents)
    }

    /// Queries the checksums of the model and of the options that the plotter holds.
    fn contents(&mut self) -> Result<[u32; 2], Error> {
        for _ in 0..MOST_QUESTIONS {
            let mut contents = None;
            self.deliver_watching(&[JobLine::command(MODEL)], &mut Quiet, &mut |reply| {
                if let Reply::Contents(found) = reply {
                    contents = Some(*found);
                }
            })?;
            if let Some(contents) = contents {
                return Ok(contents);
            }
        }
        Err(Error::LostLine { line: Some(Box::new(JobLine::command(MODEL))) })
    }

    /// Ends the conversation, after which the plotter accepts lines without numbers again.
    pub fn end(mut self) {
        // A failure is ignored: the abort of the next sender has the same effect.
        let _ = self.send(&format!("{}\n", numbered(Some(self.done + 1), END)));
        // The time of the conversation may stand still: the plotter may be gone.
        let (start, begin) = (self.link.now(), Instant::now());
        while self.since(start) < self.timeouts.reply && begin.elapsed() < LONGEST_END {
            match self.listen() {
                Ok(Some(Reply::Done(number) | Reply::Refused(number, _)))
                    if number == self.done + 1 =>
                {
                    return;
                }
                Ok(_) => {}
                Err(_) => return,
            }
        }
    }

    fn fail_on(&mut self, reply: Reply, line: AtLine<'_>) -> Result<(), Error> {
        match reply {
            Reply::Error(number) => Err(Error::Refused {
                line: Box::new(line().unwrap_or_else(|| JobLine::command(""))),
                number,
                messages: std::mem::take(&mut self.messages),
            }),
            // It is told anew to a program that opens the port.
            Reply::Alarm(_) if self.allows_alarm => Ok(()),
            Reply::Alarm(number) => {
                Err(Error::Alarm { number, messages: std::mem::take(&mut self.messages) })
            }
            Reply::Greeting(_) => Err(Error::Restarted),
            Reply::Message(text) => {
                self.messages.push(text);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn fail_if_alarm(&mut self, status: &Status) -> Result<(), Error> {
        match (status.state.as_str(), status.alarm) {
            _ if self.allows_alarm => Ok(()),
            ("Alarm", Some(number)) => self.fail_on(Reply::Alarm(number), &|| None),
            ("Alarm", None) => Err(Error::NotReady { state: status.state.clone() }),
            _ => Ok(()),
        }
    }

    /// Returns the error for a plotter that answers no more.
    fn silent(&self, line: AtLine<'_>) -> Error {
        Error::Silent { timeout: self.timeouts.silence, line: line().map(Box::new) }
    }

    fn fail_if_silent(&self, line: AtLine<'_>) -> Result<(), Error> {
        if self.since(self.last_heard) > self.timeouts.silence {
            return Err(self.silent(line));
        }
        Ok(())
    }

    /// Stops the machine with the pen up if the user cancelled the job.
    fn stop_if_interrupted(&mut self) -> Result<(), Error> {
        let request = self.link.request();
        if !self.interrupt.load(Ordering::Relaxed) && request != Some(UserRequest::GiveUp) {
            self.requests.extend(request);
            return Ok(());
        }
        Err(match self.abort() {
            Ok(Some(_)) => Error::Interrupted,
            // Where the line is broken, the plotter may still be drawing.
            Ok(None) | Err(Error::Link(_)) => Error::InterruptedUnconfirmed,
            Err(error) => error,
        })
    }

    /// Sends ctrl-X, and repeats it up to twice if no greeting arrives. Returns the greeting, if
    /// there is one.
    fn abort(&mut self) -> Result<Option<String>, Error> {
        for _ in 0..3 {
            self.link.send(&[ABORT])?;
            let start = self.link.now();
            while self.since(start) < self.timeouts.greeting / 3 {
                if let Some(Reply::Greeting(text)) = self.listen()? {
                    return Ok(Some(text));
                }
            }
        }
        Ok(None)
    }

    fn send(&mut self, text: &str) -> Result<(), Error> {
        // There is one write for each call, because a port may send each write as a separate
        // packet.
        Ok(self.link.send(text.as_bytes())?)
    }

    fn query(&mut self) -> Result<(), Error> {
        self.last_query = self.link.now();
        Ok(self.link.send(&[STATUS_QUERY])?)
    }

    /// Asks for the status if the last time was long enough ago.
    fn query_if_due(&mut self) -> Result<(), Error> {
        if self.since(self.last_query) >= self.timeouts.query {
            self.query()?;
        }
        Ok(())
    }

    fn since(&self, time: Instant) -> Duration {
        self.link.now().saturating_duration_since(time)
    }

    /// Returns the next reply, or `None` if none arrives within half the interval of status
    /// queries.
    fn listen(&mut self) -> Result<Option<Reply>, Error> {
        if self.replies.is_empty() {
            let mut buffer = [0; 256];
            let count = self.link.receive(&mut buffer, self.timeouts.query / 2)?;
            if count > 0 {
                self.last_heard = self.link.now();
            }
            let reader = &mut self.reader;
            let bytes = buffer.get(..count).unwrap_or_default();
            self.replies.extend(bytes.iter().filter_map(|&byte| reader.push(byte)));
        }
        let mut reply = self.replies.pop_front();
        if let Some(Reply::Status(status)) = &mut reply {
            status.complete(&self.last_status);
            self.last_status.clone_from(status);
        }
        Ok(reply)
    }
}
