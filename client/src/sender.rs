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

use crate::error::Error;
use crate::lines::{JobLine, Lines};
use crate::link::{Answer, Link};
use crate::progress::{Progress, Quiet};
use crate::protocol::{
    ABORT, END, LAST_NUMBER, MODEL, PLOT, RECEIVE_WINDOW, RESUME, Reply, ReplyReader, STATUS_QUERY,
    Status, is_penup, numbered,
};
use crate::results::JobReport;
use crate::twin;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The timeouts of a sender.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// The longest time without any byte from the plotter while it should answer.
    pub silence: Duration,
    /// The longest time without progress while the plotter still answers status queries.
    pub lost: Duration,
    /// The total time to wait for the greeting after an abort, retries included.
    pub greeting: Duration,
    /// The time to wait for the reply to a line before the sender asks for the number of the last
    /// accepted line.
    pub reply: Duration,
    /// The time between two status queries.
    pub query: Duration,
    /// The time for which a machine may stay in feed hold if the user cannot be asked.
    pub hold: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            silence: Duration::from_secs(5),
            lost: Duration::from_secs(15),
            greeting: Duration::from_secs(3),
            reply: Duration::from_millis(300),
            query: Duration::from_millis(100),
            hold: Duration::from_secs(60),
        }
    }
}

/// The maximum number of resends of the same line. If one byte in a hundred is corrupted, a line of
/// 256 bytes arrives intact once in 13 attempts.
const MOST_RESENDS: u32 = 200;

/// The maximum number of times that a job is started again because the plotter was told to abort
/// it.
const MOST_RESTARTS: u32 = 5;

/// The maximum number of queries for the checksums while no answer to them arrives.
const MOST_QUESTIONS: u32 = 30;

/// The number of differing answers after which the sender reports that the plotter holds something
/// else than was sent.
const SURE_OF_OTHER_CONTENTS: u32 = 3;

/// The maximum number of queries for the report of a job while it does not arrive.
const SURE_OF_NO_REPORT: u32 = 3;

/// Counts how often in a row the plotter reported the same state of waiting, to decide whether the
/// machine has come to rest.
#[derive(Debug, Default)]
struct Standing {
    at: Option<(Option<u8>, String)>,
    times: u32,
}

impl Standing {
    /// The number of equal reports that prove a standstill. The first reports may come before the
    /// last moves are done; later ones do not.
    const SURE: u32 = 3;

    /// Processes a status report. Returns `Some` if the machine has certainly stopped and waits;
    /// the inner value is the pen that it waits for, if any.
    fn holds(&mut self, status: &Status) -> Option<Option<u8>> {
        let at = status.is_holding().then(|| (status.pen_wanted, status.position.clone()));
        self.times = if at == self.at { self.times + 1 } else { 1 };
        self.at = at;
        (self.at.is_some() && self.times >= Self::SURE).then_some(status.pen_wanted)
    }
}

/// A conversation with a plotter that answered and was idle when it began.
pub struct Sender<'a> {
    link: &'a mut dyn Link,
    patience: Patience,
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
}

/// Computes the line to cite in an error; it is called only if there is an error.
type AtLine<'l> = &'l dyn Fn() -> Option<JobLine>;

/// The state of sending a sequence of lines.
struct Delivery<'l> {
    lines: &'l dyn Lines,
    /// The number of the line before the first one.
    base: i32,
    /// The number of the last line that was sent.
    sent: i32,
    /// The number and the size in bytes of each line that is not yet answered, the oldest first.
    in_queue: VecDeque<(i32, usize)>,
    /// When the number of the last accepted line was asked for. While this is `Some`, no line is
    /// sent.
    asked: Option<Instant>,
    /// When a line was last sent or answered, or the number of the last accepted line arrived.
    last_event: Instant,
    last_progress: Instant,
    resends: u32,
}

impl Delivery<'_> {
    fn line(&self, number: i32) -> Option<JobLine> {
        line_of(self.lines, self.base, number)
    }

    fn forget_up_to(&mut self, number: i32) {
        self.in_queue.retain(|(line, _)| *line > number);
    }
}

/// The line with number `number`, where the first of `lines` has number `base + 1`.
fn line_of(lines: &dyn Lines, base: i32, number: i32) -> Option<JobLine> {
    lines.line(usize::try_from(number - base - 1).ok()?)
}

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
        patience: Patience,
        interrupt: &'a AtomicBool,
    ) -> Result<Self, Error> {
        let now = link.now();
        let mut sender = Self {
            link,
            patience,
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
        };
        let state = sender.find_state()?;
        if !state.is_idle() {
            return Err(Error::NotReady { state: state.state });
        }
        sender.position = state.position;
        // The plotter is idle, so an abort loses nothing. It clears what an earlier sender left
        // half sent.
        let greeting = sender.abort()?;
        sender.begin_numbers(greeting)?;
        Ok(sender)
    }

    fn find_state(&mut self) -> Result<Status, Error> {
        let start = self.link.now();
        let mut heard = None;
        self.query()?;
        while self.since(start) < self.patience.silence {
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
        while self.since(start) < self.patience.lost {
            // The first line end terminates what is left of a corrupted line.
            self.send(&format!("\n{}\n", numbered(Some(0), LAST_NUMBER)))?;
            let asked = self.link.now();
            while self.since(asked) < self.patience.reply {
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
        self.begin_numbers(None)?;
        let status = self.find_state()?;
        if !status.is_idle() || status.position != self.position {
            return Err(Error::Restarted);
        }
        // A plotter that lost its power has also lost its position and its settings.
        let was_there = twin::contents(lines, taken);
        let empty = twin::contents(lines, 0);
        let is_empty = |contents: Option<[u32; 2]>| {
            contents.zip(empty).is_some_and(|(contents, empty)| contents[0] == empty[0])
        };
        if !is_empty(was_there) && is_empty(Some(self.contents()?)) {
            return Err(Error::Restarted);
        }
        Ok(())
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

    fn deliver(&mut self, lines: &dyn Lines, progress: &mut dyn Progress) -> Result<(), Error> {
        self.deliver_watching(lines, progress, &mut |_| {})
    }

    /// Sends `lines` with the next line numbers until each is accepted, and passes every reply to
    /// `watch`.
    ///
    /// # Errors
    /// Fails at the first line that is refused, and with [`Error::Restarted`] if the plotter has
    /// lost its line counter.
    fn deliver_watching(
        &mut self,
        lines: &dyn Lines,
        progress: &mut dyn Progress,
        watch: &mut dyn FnMut(&Reply),
    ) -> Result<(), Error> {
        let now = self.link.now();
        self.last_heard = now;
        let mut delivery = Delivery {
            lines,
            base: self.done,
            sent: self.done,
            in_queue: VecDeque::new(),
            asked: None,
            last_event: now,
            last_progress: now,
            resends: 0,
        };
        // The number of lines cannot overflow in practice: no plotter can hold the model of so many
        // lines.
        let end = delivery.base.saturating_add(i32::try_from(lines.count()).unwrap_or(i32::MAX));
        while self.done < end {
            self.fill_queue(&mut delivery)?;
            self.stop_if_interrupted()?;
            let reply = self.listen()?;
            if let Some(reply) = &reply {
                watch(reply);
            }
            let oldest = self.done + 1;
            match reply {
                Some(Reply::Done(number)) => {
                    if number > self.done && number <= delivery.sent {
                        self.advance(number, &mut delivery, progress);
                    }
                }
                Some(Reply::Last(number)) => {
                    if number < self.done || number > delivery.sent {
                        return Err(Error::Restarted);
                    }
                    if delivery.asked.take().is_some() {
                        // The plotter has read everything that was sent.
                        delivery.in_queue.clear();
                        delivery.sent = number;
                        delivery.last_event = self.link.now();
                    }
                    self.advance(number, &mut delivery, progress);
                }
                Some(Reply::Resend(number)) => {
                    if number <= self.done || number > delivery.sent + 1 {
                        return Err(Error::Restarted);
                    }
                    if delivery.asked.is_none() {
                        self.ask_for_last_number(&mut delivery)?;
                    }
                }
                Some(Reply::Refused(number, error)) => {
                    self.fail_on(Reply::Error(error), &|| delivery.line(number))?;
                }
                Some(Reply::Status(status)) => self.follow(&status, &mut delivery, progress)?,
                Some(Reply::Ok | Reply::Error(_) | Reply::Contents(_) | Reply::Other(_)) => {}
                Some(reply) => self.fail_on(reply, &|| delivery.line(oldest))?,
                None => self.fail_if_silent(&|| delivery.line(oldest))?,
            }
            self.query_if_due()?;
            let since = delivery.asked.unwrap_or(delivery.last_event);
            if self.since(since) > self.patience.reply {
                self.ask_for_last_number(&mut delivery)?;
            }
            if self.since(delivery.last_progress) > self.patience.lost {
                return Err(Error::LostLine { line: delivery.line(oldest).map(Box::new) });
            }
        }
        self.confirm(lines, delivery.base)
    }

    /// Sends as many lines as fit into the plotter's receive queue.
    fn fill_queue(&mut self, delivery: &mut Delivery<'_>) -> Result<(), Error> {
        while delivery.asked.is_none()
            && let Some(line) = delivery.line(delivery.sent + 1)
        {
            let text = numbered(Some(delivery.sent + 1), &line.sent);
            let cost = text.len() + 1;
            let waiting: usize = delivery.in_queue.iter().map(|(_, cost)| cost).sum();
            // A line that is longer than the queue is sent alone; the plotter reads it while it
            // arrives.
            if waiting > 0 && waiting + cost > RECEIVE_WINDOW {
                break;
            }
            let before = self.link.now();
            self.send(&format!("{text}\n"))?;
            // Sending to a plotter in memory may take minutes, because it processes the bytes at
            // once.
            delivery.last_progress += self.since(before);
            delivery.last_event = self.link.now();
            delivery.sent += 1;
            delivery.in_queue.push_back((delivery.sent, cost));
        }
        Ok(())
    }

    fn advance(&mut self, number: i32, delivery: &mut Delivery<'_>, progress: &mut dyn Progress) {
        delivery.forget_up_to(number);
        if number > self.done {
            self.done = number;
            delivery.last_progress = self.link.now();
            delivery.last_event = delivery.last_progress;
            delivery.resends = 0;
            self.messages.clear();
            progress.lines_sent((number - delivery.base) as usize, delivery.lines.count());
        }
    }

    /// Asks for the number of the last accepted line. Nothing else is sent until it arrives.
    fn ask_for_last_number(&mut self, delivery: &mut Delivery<'_>) -> Result<(), Error> {
        delivery.resends += 1;
        if delivery.resends > MOST_RESENDS {
            let line = delivery.line(self.done + 1).map(Box::new);
            return Err(Error::Damaged { line, times: MOST_RESENDS });
        }
        delivery.asked = Some(self.link.now());
        // The first line end terminates a line that has lost its own.
        self.send(&format!("\n{}\n", numbered(None, LAST_NUMBER)))
    }

    /// Processes a status report that arrives while lines are sent.
    fn follow(
        &mut self,
        status: &Status,
        delivery: &mut Delivery<'_>,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        progress.state(&status.state);
        if status.is_computing {
            // The plotter reads no line until it has computed the picture.
            delivery.last_progress = self.link.now();
            delivery.last_event = delivery.last_progress;
            delivery.asked = delivery.asked.map(|_| delivery.last_progress);
        }
        // No user asks for a feed hold before anything is drawn, so the machine is resumed.
        let nothing_drawn = status.strokes.is_none_or(|(done, _)| done == 0);
        if status.is_holding()
            && status.pen_wanted.is_none()
            && nothing_drawn
            && status.position == self.position
        {
            self.link.send(&[RESUME])?;
        }
        self.fail_if_alarm(status)
    }

    /// Starts the drawing of what was sent, and waits until the machine is idle again.
    ///
    /// # Errors
    /// The plotter refuses the drawing, stops with an alarm, stays in feed hold, or falls silent.
    pub fn plot(&mut self, progress: &mut dyn Progress) -> Result<(), Error> {
        let command = JobLine::command(PLOT);
        let lines = [command.clone()];
        let command = &|| Some(command.clone());
        self.begin_plot(&lines, progress)?;
        let mut standing = Standing::default();
        let mut held_since = None;
        self.last_heard = self.link.now();
        self.query()?;
        loop {
            self.stop_if_interrupted()?;
            match self.listen()? {
                Some(Reply::Status(status)) => {
                    progress.state(&status.state);
                    if let Some((done, all)) = status.strokes {
                        progress.strokes_drawn(done, all);
                        self.strokes = all;
                    }
                    self.fail_if_alarm(&status)?;
                    match standing.holds(&status) {
                        Some(pen) if self.may_resume(pen, &mut held_since)? => {
                            self.link.send(&[RESUME])?;
                            standing = Standing::default();
                        }
                        _ if !status.is_holding() => held_since = None,
                        _ => {}
                    }
                    if status.is_idle() {
                        self.position = status.position;
                        return self.confirm(&lines, self.done - 1);
                    }
                }
                Some(Reply::Done(_) | Reply::Last(_) | Reply::Resend(_) | Reply::Error(_)) => {}
                Some(Reply::Refused(number, _)) if number != self.done => {}
                Some(Reply::Refused(_, error)) => {
                    self.fail_on(Reply::Error(error), command)?;
                }
                Some(reply) => self.fail_on(reply, command)?,
                None => self.fail_if_silent(command)?,
            }
            self.query_if_due()?;
        }
    }

    /// Sends the plot command until it is accepted. It is sent again if the plotter was told to
    /// abort before it moved.
    fn begin_plot(&mut self, lines: &dyn Lines, progress: &mut dyn Progress) -> Result<(), Error> {
        let mut restarts = 0;
        loop {
            let mut notes = Vec::new();
            let begun = self.deliver_watching(lines, &mut Quiet, &mut |reply| match reply {
                Reply::Message(note) => notes.push(note.clone()),
                // The messages so far were about a line that was not accepted.
                Reply::Resend(_) | Reply::Error(_) => notes.clear(),
                _ => {}
            });
            if begun.is_ok() {
                notes.iter().for_each(|note| progress.note(note));
            }
            match begun {
                Err(Error::Restarted) if restarts < MOST_RESTARTS => {
                    restarts += 1;
                    self.begin_numbers(None)?;
                    let status = self.find_state()?;
                    let has_moved = !status.is_idle() || status.position != self.position;
                    if has_moved || Some(self.contents()?) != self.contents {
                        return Err(Error::Restarted);
                    }
                }
                result => return result,
            }
        }
    }

    /// Checks that the last line sent is the last one that the plotter accepted, and that none was
    /// refused. This detects a refusal whose reply was lost, and an abort that somebody else sent.
    fn confirm(&mut self, lines: &dyn Lines, base: i32) -> Result<(), Error> {
        let number = self.done;
        let last = &|| line_of(lines, base, number);
        let start = self.link.now();
        self.last_heard = start;
        let mut asked = None;
        while self.since(start) < self.patience.lost {
            self.stop_if_interrupted()?;
            if asked.is_none_or(|asked| self.since(asked) > self.patience.reply) {
                asked = Some(self.link.now());
                self.send(&format!("\n{}\n", numbered(None, LAST_NUMBER)))?;
            }
            match self.listen()? {
                Some(Reply::Last(number)) if number == self.done => return Ok(()),
                Some(Reply::Last(_)) => return Err(Error::Restarted),
                Some(Reply::Refused(number, error)) => {
                    self.fail_on(Reply::Error(error), &|| line_of(lines, base, number))?;
                }
                Some(Reply::Status(status)) => self.fail_if_alarm(&status)?,
                Some(Reply::Done(_) | Reply::Resend(_) | Reply::Error(_)) => {}
                Some(reply) => self.fail_on(reply, last)?,
                None => self.fail_if_silent(last)?,
            }
            self.query_if_due()?;
        }
        Err(Error::LostLine { line: last().map(Box::new) })
    }

    /// Decides whether a stopped machine may resume: if it waits for `pen`, whether that pen is in;
    /// otherwise, in a feed hold that somebody else caused, whether the user allows it.
    fn may_resume(
        &mut self,
        pen: Option<u8>,
        held_since: &mut Option<Instant>,
    ) -> Result<bool, Error> {
        if let Some(pen) = pen {
            return Ok(self.link.change_pen(pen)?);
        }
        let now = self.link.now();
        let is_new = held_since.is_none();
        let since = *held_since.get_or_insert(now);
        match self.link.ask_to_resume(is_new)? {
            Answer::Yes => {
                *held_since = None;
                Ok(true)
            }
            Answer::NotYet => Ok(false),
            Answer::Nobody if self.since(since) > self.patience.hold => Err(Error::Held),
            Answer::Nobody => Ok(false),
        }
    }

    /// The plotter's report on the last drawing; `None` if its firmware does not send one.
    ///
    /// # Errors
    /// As [`Sender::stream`].
    pub fn report(&mut self) -> Result<Option<JobReport>, Error> {
        let (strokes, mut report) = (self.strokes, None);
        for _ in 0..SURE_OF_NO_REPORT {
            let ask = [JobLine::command(MODEL)];
            self.deliver_watching(&ask, &mut Quiet, &mut |reply| {
                if let Reply::Other(line) = reply {
                    report = JobReport::parse(strokes, line).or(report.take());
                }
            })?;
            if report.is_some() {
                break;
            }
        }
        Ok(report)
    }

    /// Ends the conversation, after which the plotter accepts lines without numbers again.
    pub fn end(mut self) {
        // A failure is ignored: the abort of the next sender has the same effect.
        let _ = self.send(&format!("{}\n", numbered(Some(self.done + 1), END)));
        let start = self.link.now();
        while self.since(start) < self.patience.reply {
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
            ("Alarm", Some(number)) => self.fail_on(Reply::Alarm(number), &|| None),
            ("Alarm", None) => Err(Error::NotReady { state: status.state.clone() }),
            _ => Ok(()),
        }
    }

    fn silent(&self, line: AtLine<'_>) -> Error {
        Error::Silent { patience: self.patience.silence, line: line().map(Box::new) }
    }

    fn fail_if_silent(&self, line: AtLine<'_>) -> Result<(), Error> {
        if self.since(self.last_heard) > self.patience.silence {
            return Err(self.silent(line));
        }
        Ok(())
    }

    /// Stops the machine with the pen up if the user cancelled the job.
    fn stop_if_interrupted(&mut self) -> Result<(), Error> {
        if !self.interrupt.load(Ordering::Relaxed) {
            return Ok(());
        }
        Err(match self.abort()? {
            Some(_) => Error::Interrupted,
            None => Error::InterruptedUnconfirmed,
        })
    }

    /// Sends ctrl-X, and repeats it up to twice if no greeting arrives. Returns the greeting, if
    /// there is one.
    fn abort(&mut self) -> Result<Option<String>, Error> {
        for _ in 0..3 {
            self.link.send(&[ABORT])?;
            let start = self.link.now();
            while self.since(start) < self.patience.greeting / 3 {
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

    fn query_if_due(&mut self) -> Result<(), Error> {
        if self.since(self.last_query) >= self.patience.query {
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
            let count = self.link.receive(&mut buffer, self.patience.query / 2)?;
            if count > 0 {
                self.last_heard = self.link.now();
            }
            let reader = &mut self.reader;
            let bytes = buffer.get(..count).unwrap_or_default();
            self.replies.extend(bytes.iter().filter_map(|&byte| reader.push(byte)));
        }
        Ok(self.replies.pop_front())
    }
}
