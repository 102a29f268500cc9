//! Delivers lines over a line that may damage bytes: each with its number and checksum, as many at
//! a time as the plotter's queue takes, and again where one did not arrive.
//!
//! The same protocol as that of `penup plot`, but nothing here waits: replies and times come in,
//! bytes go out.

use penup_job::protocol::{LAST_NUMBER, RECEIVE_WINDOW, Reply, numbered};
use penup_readers::lines::{JobLine, Lines};
use std::collections::VecDeque;
use std::rc::Rc;

/// The most times that one line is sent again.
const MOST_RESENDS: u32 = 200;
/// The time in ms after which a line without a reply is asked for.
const REPLY_TIMEOUT: f64 = 300.0;
/// The longest time in ms without a line being accepted.
const LOST_TIMEOUT: f64 = 15_000.0;

/// What became of a delivery.
#[derive(Debug)]
pub enum Outcome {
    /// It goes on.
    More,
    /// Every line was accepted.
    Done,
    /// The plotter refused this line with this error.
    Refused(Option<JobLine>, u16),
    /// The plotter counts the lines anew: it was started again, or told to abort.
    Restarted,
    /// The line never arrived.
    Lost(Option<JobLine>),
}

/// Lines on their way to the plotter.
#[derive(Debug)]
pub struct Delivery {
    lines: Rc<dyn Lines>,
    /// The number of the line before the first one.
    base: i32,
    /// The number of the last line that is known to be accepted, and of the last one sent.
    done: i32,
    sent: i32,
    /// Number and size in bytes of each line that is not answered yet, the oldest first.
    in_queue: VecDeque<(i32, usize)>,
    /// When the number of the last accepted line was asked for; until it comes, nothing is sent.
    asked_at: Option<f64>,
    last_event: f64,
    last_progress: f64,
    resends: u32,
}

impl Delivery {
    /// Begins to deliver `lines` behind the line with number `base`, at the time `now` in ms.
    pub fn new(lines: Rc<dyn Lines>, base: i32, now: f64) -> Self {
        Self {
            lines,
            base,
            done: base,
            sent: base,
            in_queue: VecDeque::new(),
            asked_at: None,
            last_event: now,
            last_progress: now,
            resends: 0,
        }
    }

    /// The number of the last line that was accepted.
    pub fn number(&self) -> i32 {
        self.done
    }

    /// How many lines are accepted, and how many there are.
    pub fn progress(&self) -> (usize, usize) {
        ((self.done - self.base).unsigned_abs() as usize, self.lines.count())
    }

    /// Leaves `slept` ms until `now` out of the time without a line being accepted.
    pub fn leave_out(&mut self, slept: f64, now: f64) {
        self.last_progress = (self.last_progress + slept).min(now);
    }

    /// Lets the time pass until `now`, in ms. While the plotter `reads_no_lines`, because it
    /// computes or finds its switches, none is missed. What is to be sent is appended to `out`.
    pub fn tick(&mut self, now: f64, reads_no_lines: bool, out: &mut Vec<u8>) -> Outcome {
        if reads_no_lines {
            (self.last_event, self.last_progress) = (now, now);
            self.asked_at = self.asked_at.map(|_| now);
        }
        while self.asked_at.is_none()
            && let Some(line) = self.line(self.sent + 1)
        {
            let text = numbered(Some(self.sent + 1), &line.sent);
            let cost = text.len() + 1;
            let waiting: usize = self.in_queue.iter().map(|(_, cost)| cost).sum();
            // A line that is longer than the queue is sent alone.
            if waiting > 0 && waiting + cost > RECEIVE_WINDOW {
                break;
            }
            out.extend(text.bytes());
            out.push(b'\n');
            self.last_event = now;
            self.sent += 1;
            self.in_queue.push_back((self.sent, cost));
        }
        if now - self.asked_at.unwrap_or(self.last_event) > REPLY_TIMEOUT {
            self.ask(now, out);
        }
        if self.resends > MOST_RESENDS || now - self.last_progress > LOST_TIMEOUT {
            return Outcome::Lost(self.line(self.done + 1));
        }
        Outcome::More
    }

    /// Takes a reply. The end is believed only when the plotter has named the last line itself, so
    /// that no refusal whose reply was lost goes unseen.
    pub fn reply(&mut self, reply: &Reply, now: f64, out: &mut Vec<u8>) -> Outcome {
        match *reply {
            Reply::Done(number) if number > self.done && number <= self.sent => {
                self.accept(number, now);
                if self.is_over() && self.asked_at.is_none() {
                    self.ask(now, out);
                    self.resends = 0;
                }
            }
            Reply::Last(number) => {
                if number < self.done || number > self.sent {
                    return Outcome::Restarted;
                }
                if self.asked_at.take().is_some() {
                    // The plotter has read everything that was sent.
                    self.in_queue.clear();
                    self.sent = number;
                    self.last_event = now;
                }
                self.accept(number, now);
                if self.is_over() {
                    return Outcome::Done;
                }
            }
            Reply::Resend(number) => {
                if number <= self.done || number > self.sent + 1 {
                    return Outcome::Restarted;
                }
                if self.asked_at.is_none() {
                    self.ask(now, out);
                }
            }
            Reply::Refused(number, error) if number > self.base => {
                let line = self.line(number);
                // Its number is used up.
                self.done = self.done.max(number);
                return Outcome::Refused(line, error);
            }
            _ => {}
        }
        Outcome::More
    }

    fn is_over(&self) -> bool {
        self.progress().0 >= self.lines.count()
    }

    fn accept(&mut self, number: i32, now: f64) {
        self.in_queue.retain(|(line, _)| *line > number);
        if number > self.done {
            self.done = number;
            (self.last_event, self.last_progress) = (now, now);
            self.resends = 0;
        }
    }

    /// Asks for the number of the last accepted line. The first line end ends a line that has lost
    /// its own.
    fn ask(&mut self, now: f64, out: &mut Vec<u8>) {
        self.resends += 1;
        self.asked_at = Some(now);
        out.extend(format!("\n{}\n", numbered(None, LAST_NUMBER)).bytes());
    }

    fn line(&self, number: i32) -> Option<JobLine> {
        self.lines.line(usize::try_from(number - self.base - 1).ok()?)
    }
}
