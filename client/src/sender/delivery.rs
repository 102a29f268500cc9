//! Delivers lines: sends them with numbers and checksums until the plotter has accepted each.

use super::Sender;
use super::drawing::Numbers;
use super::streaming::{Arrival, Streaming};
use crate::error::Error;
use crate::progress::Progress;
use penup_job::protocol::{LAST_NUMBER, RECEIVE_WINDOW, RESUME, Reply, Status, numbered};
use penup_readers::lines::{JobLine, Lines};
use std::collections::VecDeque;
use std::time::Instant;

/// The maximum number of resends of the same line. If one byte in a hundred is corrupted, a line of
/// 256 bytes arrives intact once in 13 attempts.
const MOST_RESENDS: u32 = 200;

/// The state of sending a sequence of lines.
struct Delivery<'l, 'j> {
    lines: &'l dyn Lines,
    /// The number of the line before the first one.
    base: i32,
    /// The number of the last line that was sent.
    sent: i32,
    /// The number and the size in bytes of each line that is not yet answered, the oldest first.
    in_queue: VecDeque<(i32, usize)>,
    /// When the number of the last accepted line was asked for. While this is `Some`, no line is
    /// sent.
    requested_at: Option<Instant>,
    /// When a line was last sent or answered, or the number of the last accepted line arrived.
    last_event: Instant,
    last_progress: Instant,
    resends: u32,
    /// Whether the plotter computes a picture or homes, according to its last status report. It
    /// then reads no lines, so it is asked for none. Nor is it while the pen must move on before
    /// there is room for another line.
    reads_no_lines: bool,
    /// Whether the lines are drawn while they are sent, and how.
    streaming: Option<&'l mut Streaming<'j>>,
}

impl Delivery<'_, '_> {
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

impl Sender<'_> {
    pub(super) fn deliver(
        &mut self,
        lines: &dyn Lines,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        self.deliver_watching(lines, progress, &mut |_| {})
    }

    /// Sends `lines` with the next line numbers until each is accepted, and passes every reply to
    /// `watch`.
    ///
    /// # Errors
    /// Fails at the first line that is refused, and with [`Error::Restarted`] if the plotter has
    /// lost its line counter.
    pub(super) fn deliver_watching(
        &mut self,
        lines: &dyn Lines,
        progress: &mut dyn Progress,
        watch: &mut dyn FnMut(&Reply),
    ) -> Result<(), Error> {
        self.deliver_as(lines, None, progress, watch)
    }

    /// Sends `lines` as [`Sender::deliver_watching`] does; if they are drawn meanwhile, lets the
    /// machine go on after pauses.
    pub(super) fn deliver_as(
        &mut self,
        lines: &dyn Lines,
        streaming: Option<&mut Streaming<'_>>,
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
            requested_at: None,
            last_event: now,
            last_progress: now,
            resends: 0,
            reads_no_lines: false,
            streaming,
        };
        // The number of lines cannot overflow in practice: no plotter can hold the model of so many
        // lines.
        let end = delivery.base.saturating_add(i32::try_from(lines.count()).unwrap_or(i32::MAX));
        while self.done < end {
            self.fill_queue(&mut delivery)?;
            self.note_arrival(&mut delivery, end);
            self.stop_if_interrupted()?;
            if let Some(streaming) = &mut delivery.streaming {
                self.obey(&mut streaming.followed, Numbers::InUse, progress)?;
            }
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
                    if delivery.requested_at.take().is_some() {
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
                    if delivery.requested_at.is_none() {
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
            let since = delivery.requested_at.unwrap_or(delivery.last_event);
            if self.since(since) > self.timeouts.reply && !delivery.reads_no_lines {
                self.ask_for_last_number(&mut delivery)?;
            }
            if self.since(delivery.last_progress) > self.timeouts.lost {
                return Err(Error::LostLine { line: delivery.line(oldest).map(Box::new) });
            }
        }
        self.note_arrival(&mut delivery, end);
        self.confirm(lines, delivery.base)
    }

    /// Notes how much of a drawing has arrived whose last line has the number `end`.
    fn note_arrival(&self, delivery: &mut Delivery<'_, '_>, end: i32) {
        let sent = delivery.sent;
        if let Some(streaming) = &mut delivery.streaming {
            streaming.arrival = match self.done == end {
                true => Arrival::All,
                false if sent == end => Arrival::PerhapsAll,
                false => Arrival::Part,
            };
        }
    }

    /// Sends as many lines as fit into the plotter's receive queue.
    fn fill_queue(&mut self, delivery: &mut Delivery<'_, '_>) -> Result<(), Error> {
        while delivery.requested_at.is_none()
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

    fn advance(
        &mut self,
        number: i32,
        delivery: &mut Delivery<'_, '_>,
        progress: &mut dyn Progress,
    ) {
        delivery.forget_up_to(number);
        if number > self.done {
            self.done = number;
            delivery.last_progress = self.link.now();
            delivery.last_event = delivery.last_progress;
            delivery.resends = 0;
            self.messages.clear();
            if delivery.streaming.is_none() {
                progress.lines_sent((number - delivery.base) as usize, delivery.lines.count());
            }
        }
    }

    /// Asks for the number of the last accepted line. Nothing else is sent until it arrives.
    fn ask_for_last_number(&mut self, delivery: &mut Delivery<'_, '_>) -> Result<(), Error> {
        delivery.resends += 1;
        if delivery.resends > MOST_RESENDS {
            let line = delivery.line(self.done + 1).map(Box::new);
            return Err(Error::Damaged { line, times: MOST_RESENDS });
        }
        delivery.requested_at = Some(self.link.now());
        // The first line end terminates a line that has lost its own.
        self.send(&format!("\n{}\n", numbered(None, LAST_NUMBER)))
    }

    /// Processes a status report that arrives while lines are sent.
    fn follow(
        &mut self,
        status: &Status,
        delivery: &mut Delivery<'_, '_>,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        progress.state(&status.state);
        delivery.reads_no_lines = status.is_computing
            || status.state == "Home"
            || delivery.streaming.as_ref().is_some_and(|streaming| streaming.waits(status));
        if delivery.reads_no_lines {
            // The plotter reads no line until it has computed the picture or is homed.
            delivery.last_progress = self.link.now();
            delivery.last_event = delivery.last_progress;
            delivery.requested_at = delivery.requested_at.map(|_| delivery.last_progress);
        }
        if let Some(streaming) = &mut delivery.streaming {
            let done = usize::try_from(self.done - delivery.base).unwrap_or(0);
            let status = streaming.told(status.clone(), done);
            progress.drawn(&status);
            self.fail_if_alarm(&status)?;
            return self.wait_or_resume(&status, &mut streaming.followed);
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

    /// Checks that the last line sent is the last one that the plotter accepted, and that none was
    /// refused. This detects a refusal whose reply was lost, and an abort that somebody else sent.
    pub(super) fn confirm(&mut self, lines: &dyn Lines, base: i32) -> Result<(), Error> {
        let number = self.done;
        let last = &|| line_of(lines, base, number);
        let mut start = self.link.now();
        self.last_heard = start;
        let mut requested_at = None;
        let mut is_computing = false;
        while self.since(start) < self.timeouts.lost {
            self.stop_if_interrupted()?;
            if !is_computing
                && requested_at
                    .is_none_or(|requested_at| self.since(requested_at) > self.timeouts.reply)
            {
                requested_at = Some(self.link.now());
                self.send(&format!("\n{}\n", numbered(None, LAST_NUMBER)))?;
            }
            match self.listen()? {
                Some(Reply::Last(number)) if number == self.done => return Ok(()),
                Some(Reply::Last(_)) => return Err(Error::Restarted),
                Some(Reply::Refused(number, error)) => {
                    self.fail_on(Reply::Error(error), &|| line_of(lines, base, number))?;
                }
                Some(Reply::Status(status)) => {
                    self.fail_if_alarm(&status)?;
                    // While a part of a drawing is drawn, the next one is computed, and meanwhile
                    // the plotter reads no line.
                    is_computing = status.is_computing;
                    if is_computing {
                        start = self.link.now();
                    }
                }
                Some(Reply::Done(_) | Reply::Resend(_) | Reply::Error(_)) => {}
                Some(reply) => self.fail_on(reply, last)?,
                None => self.fail_if_silent(last)?,
            }
            self.query_if_due()?;
        }
        Err(Error::LostLine { line: last().map(Box::new) })
    }
}
