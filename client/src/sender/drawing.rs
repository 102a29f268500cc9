//! Draws what was sent: starts the drawing, waits for its end, and asks for the report on it.

use super::{MOST_RESTARTS, Sender};
use crate::error::Error;
use crate::lines::{JobLine, Lines};
use crate::link::Answer;
use crate::progress::{Progress, Quiet};
use crate::protocol::{MODEL, PLOT, RESUME, Reply, Status};
use crate::results::JobReport;
use std::time::Instant;

/// The maximum number of queries for the report of a job while it does not arrive.
const SURE_OF_NO_REPORT: u32 = 3;

/// Counts how often in a row the plotter reported the same state of waiting, to decide whether the
/// machine has come to rest.
#[derive(Debug, Default)]
struct Standstill {
    at: Option<(Option<u8>, String)>,
    times: u32,
}

impl Standstill {
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

impl Sender<'_> {
    /// Starts the drawing of what was sent, and waits until the machine is idle again.
    ///
    /// # Errors
    /// The plotter refuses the drawing, stops with an alarm, stays in feed hold, or falls silent.
    pub fn plot(&mut self, progress: &mut dyn Progress) -> Result<(), Error> {
        let command = JobLine::command(PLOT);
        let lines = [command.clone()];
        let command = &|| Some(command.clone());
        self.begin_plot(&lines, progress)?;
        let mut standstill = Standstill::default();
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
                    match standstill.holds(&status) {
                        Some(pen) if self.may_resume(pen, &mut held_since)? => {
                            self.link.send(&[RESUME])?;
                            standstill = Standstill::default();
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
}
