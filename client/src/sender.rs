//! Sends lines to a plotter and follows what it does with them.
//!
//! Framing as in Grbl 1.1: one reply to each line, in order. [`Sender::open`] makes sure that a
//! penup answers and is idle, [`Sender::stream`] keeps the plotter's receive queue filled but never
//! over-filled (counting the bytes that are not yet answered), [`Sender::plot`] draws, changes pens and waits for
//! the end. If anything goes wrong the sender stops at once and says which line it was at.

use crate::error::Error;
use crate::job::JobReport;
use crate::link::Link;
use crate::progress::{Progress, Quiet};
use crate::protocol::{
    ABORT, MODEL, PLOT, RECEIVE_WINDOW, RESUME, Reply, ReplyReader, STATUS_QUERY, Status, is_penup,
};
use crate::source::{JobLine, Lines};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long to wait for what.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// For any byte at all while it should answer.
    pub silence: Duration,
    /// For the answer to a line while the plotter is alive.
    pub lost: Duration,
    /// For the greeting after an abort.
    pub greeting: Duration,
    /// Between two status queries.
    pub query: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            silence: Duration::from_secs(5),
            lost: Duration::from_secs(15),
            greeting: Duration::from_secs(3),
            query: Duration::from_millis(100),
        }
    }
}

/// How often in a row the plotter said that it stands at a place and waits for a pen.
#[derive(Debug, Default)]
struct Standing {
    at: Option<(u8, String)>,
    times: u32,
}

impl Standing {
    /// The first reports may come before the last moves are done; later ones do not.
    const SURE: u32 = 3;

    fn pen_wanted(&mut self, status: &Status) -> Option<u8> {
        let at = status.pen_wanted.map(|pen| (pen, status.position.clone()));
        self.times = if at == self.at { self.times + 1 } else { 1 };
        self.at = at;
        status.pen_wanted.filter(|_| self.times >= Self::SURE)
    }
}

/// A plotter that answered and was idle.
pub struct Sender<'a> {
    link: &'a mut dyn Link,
    patience: Patience,
    interrupt: &'a AtomicBool,
    reader: ReplyReader,
    replies: VecDeque<Reply>,
    last_heard: Instant,
    last_query: Instant,
    /// What it said for people since its last answer.
    messages: Vec<String>,
    /// What it told of itself when it was asked last.
    told: Vec<String>,
    /// The strokes of the job that it draws.
    strokes: u64,
}

impl<'a> Sender<'a> {
    /// Waits until a penup answers, idle, with nothing of an older conversation left.
    ///
    /// `interrupt` set at any time later ends the job with the pen up and [`Error::Interrupted`].
    ///
    /// # Errors
    /// Nobody answers, something else answers, or it is busy.
    pub fn open(
        link: &'a mut dyn Link,
        patience: Patience,
        interrupt: &'a AtomicBool,
    ) -> Result<Self, Error> {
        let now = Instant::now();
        let mut sender = Self {
            link,
            patience,
            interrupt,
            reader: ReplyReader::default(),
            replies: VecDeque::new(),
            last_heard: now,
            last_query: now,
            messages: Vec::new(),
            told: Vec::new(),
            strokes: 0,
        };
        let state = sender.find_state()?;
        if !state.is_idle() {
            return Err(Error::NotReady { state: state.state });
        }
        // It is idle, so an abort loses nothing; it clears what an older sender left half sent.
        sender.link.send(&[ABORT])?;
        match sender.await_greeting()? {
            Some(greeting) if is_penup(&greeting) => Ok(sender),
            greeting => Err(Error::NotPenup { heard: greeting.unwrap_or_default() }),
        }
    }

    fn find_state(&mut self) -> Result<Status, Error> {
        let start = Instant::now();
        let mut heard = None;
        self.query()?;
        while start.elapsed() < self.patience.silence {
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
            // Bytes without a line end come from a wrong speed or another device, too.
            None if self.last_heard <= start => Err(self.silent(None)),
            heard => Err(Error::NotPenup { heard: heard.unwrap_or_default() }),
        }
    }

    /// Sends `lines`, keeping the plotter's receive queue full, until each is answered with `ok`.
    ///
    /// # Errors
    /// The first line that is refused or not answered; later lines may have been taken.
    pub fn stream(&mut self, lines: &dyn Lines, progress: &mut dyn Progress) -> Result<(), Error> {
        let cost = |line: &JobLine| line.sent.len() + 1;
        let (mut sent, mut answered, mut in_queue) = (0, 0, 0);
        let mut last_answer = Instant::now();
        self.last_heard = last_answer;
        while let Some(oldest) = lines.line(answered) {
            while let Some(line) = lines.line(sent)
                // A line longer than the queue goes alone; the plotter judges its length.
                && (in_queue == 0 || in_queue + cost(&line) <= RECEIVE_WINDOW)
            {
                self.send_line(&line.sent)?;
                in_queue += cost(&line);
                sent += 1;
            }
            self.stop_if_interrupted()?;
            match self.listen()? {
                Some(Reply::Ok) => {
                    in_queue -= cost(&oldest);
                    answered += 1;
                    last_answer = Instant::now();
                    self.messages.clear();
                    progress.lines_sent(answered, lines.count());
                }
                Some(reply) => self.fail_on(reply, Some(&oldest))?,
                None => {
                    self.query_if_due()?;
                    self.fail_if_silent(Some(&oldest))?;
                }
            }
            if last_answer.elapsed() > self.patience.lost {
                return Err(Error::LostLine { line: Some(Box::new(oldest)) });
            }
        }
        Ok(())
    }

    /// Draws what was sent, and waits until the machine is idle again.
    ///
    /// # Errors
    /// The drawing is refused, the machine stops, or it falls silent.
    pub fn plot(&mut self, progress: &mut dyn Progress) -> Result<(), Error> {
        let command = JobLine::command(PLOT);
        self.send_line(PLOT)?;
        self.last_heard = Instant::now();
        let mut acknowledged = false;
        let mut idle_since = None;
        let mut standing = Standing::default();
        loop {
            self.stop_if_interrupted()?;
            match self.listen()? {
                Some(Reply::Ok) if !acknowledged => {
                    acknowledged = true;
                    self.messages.drain(..).for_each(|note| progress.note(&note));
                    self.query()?;
                }
                Some(Reply::Status(status)) => {
                    progress.state(&status.state);
                    if let Some((done, all)) = status.strokes {
                        progress.strokes_drawn(done, all);
                        self.strokes = all;
                    }
                    if let Some(pen) = standing.pen_wanted(&status)
                        && self.link.change_pen(pen)?
                    {
                        self.link.send(&[RESUME])?;
                        standing = Standing::default();
                    }
                    if status.state == "Alarm" {
                        return Err(Error::NotReady { state: status.state });
                    }
                    match (status.is_idle(), acknowledged) {
                        (true, true) => return Ok(()),
                        (true, false) => {
                            idle_since.get_or_insert_with(Instant::now);
                        }
                        (false, _) => idle_since = None,
                    }
                }
                Some(reply) => self.fail_on(reply, Some(&command))?,
                None => self.fail_if_silent(Some(&command))?,
            }
            self.query_if_due()?;
            if idle_since.is_some_and(|since: Instant| since.elapsed() > self.patience.lost) {
                return Err(Error::LostLine { line: Some(Box::new(command)) });
            }
        }
    }

    /// What came of the job that was drawn; `None` if the plotter's firmware does not tell.
    ///
    /// # Errors
    /// As [`Sender::stream`].
    pub fn report(&mut self) -> Result<Option<JobReport>, Error> {
        self.told.clear();
        self.stream(&[JobLine::command(MODEL)], &mut Quiet)?;
        let strokes = self.strokes;
        Ok(self.told.iter().find_map(|line| JobReport::parse(strokes, line)))
    }

    fn fail_on(&mut self, reply: Reply, line: Option<&JobLine>) -> Result<(), Error> {
        match reply {
            Reply::Error(number) => Err(Error::Refused {
                line: Box::new(line.cloned().unwrap_or_else(|| JobLine::command(""))),
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
            Reply::Other(text) => {
                self.told.push(text);
                Ok(())
            }
            Reply::Ok | Reply::Status(_) => Ok(()),
        }
    }

    fn silent(&self, line: Option<&JobLine>) -> Error {
        Error::Silent { patience: self.patience.silence, line: line.cloned().map(Box::new) }
    }

    fn fail_if_silent(&self, line: Option<&JobLine>) -> Result<(), Error> {
        if self.last_heard.elapsed() > self.patience.silence {
            return Err(self.silent(line));
        }
        Ok(())
    }

    /// Stops the machine, pen up, if the user gave the job up.
    fn stop_if_interrupted(&mut self) -> Result<(), Error> {
        if !self.interrupt.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.link.send(&[ABORT])?;
        Err(match self.await_greeting()? {
            Some(_) => Error::Interrupted,
            None => Error::InterruptedUnconfirmed,
        })
    }

    fn await_greeting(&mut self) -> Result<Option<String>, Error> {
        let start = Instant::now();
        while start.elapsed() < self.patience.greeting {
            if let Some(Reply::Greeting(text)) = self.listen()? {
                return Ok(Some(text));
            }
        }
        Ok(None)
    }

    fn send_line(&mut self, line: &str) -> Result<(), Error> {
        // One write: a port may send each write as a packet of its own.
        let mut bytes = Vec::with_capacity(line.len() + 1);
        bytes.extend_from_slice(line.as_bytes());
        bytes.push(b'\n');
        Ok(self.link.send(&bytes)?)
    }

    fn query(&mut self) -> Result<(), Error> {
        self.last_query = Instant::now();
        Ok(self.link.send(&[STATUS_QUERY])?)
    }

    fn query_if_due(&mut self) -> Result<(), Error> {
        if self.last_query.elapsed() >= self.patience.query {
            self.query()?;
        }
        Ok(())
    }

    /// The next reply, or `None` if none came within half the time between two queries.
    fn listen(&mut self) -> Result<Option<Reply>, Error> {
        if self.replies.is_empty() {
            let mut buffer = [0; 256];
            let count = self.link.receive(&mut buffer, self.patience.query / 2)?;
            if count > 0 {
                self.last_heard = Instant::now();
            }
            let reader = &mut self.reader;
            let bytes = buffer.get(..count).unwrap_or_default();
            self.replies.extend(bytes.iter().filter_map(|&byte| reader.push(byte)));
        }
        Ok(self.replies.pop_front())
    }
}
