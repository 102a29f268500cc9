//! Orders to a machine: pause, resume, give up, and single lines with their answers.

use super::drawing::REPORTS_BEFORE_REPEAT;
use super::{MOST_QUESTIONS, Sender, Timeouts};
use crate::error::Error;
use crate::link::Link;
use crate::progress::Quiet;
use penup_job::protocol::{HOLD, PAUSE_AFTER_STROKE, RESUME, Reply, Status};
use penup_readers::lines::JobLine;
use std::sync::atomic::AtomicBool;

/// How often a byte is sent that the plotter does not obey.
const MOST_ORDERS: u32 = 5;

/// How often something is asked until two answers in a row are the same.
const MOST_READINGS: u32 = 10;

impl<'a> Sender<'a> {
    /// Joins a plotter, whatever it does, and returns its status. Nothing changes on the plotter.
    ///
    /// # Errors
    /// Nothing answers, or something other than penup does.
    pub fn join(
        link: &'a mut dyn Link,
        timeouts: Timeouts,
        interrupt: &'a AtomicBool,
    ) -> Result<(Self, Status), Error> {
        let mut sender = Self::new(link, timeouts, interrupt);
        let status = sender.find_state()?;
        Ok((sender, status))
    }

    /// Opens a conversation with a plotter that does nothing, also with one that is locked after an
    /// alarm or asleep.
    ///
    /// # Errors
    /// As [`Sender::open`].
    pub fn open_for_orders(
        link: &'a mut dyn Link,
        timeouts: Timeouts,
        interrupt: &'a AtomicBool,
    ) -> Result<(Self, Status), Error> {
        let mut sender = Self::new(link, timeouts, interrupt);
        sender.allows_alarm = true;
        let status = sender.take_over(|status| status.is_idle() || status.is_alarm())?;
        Ok((sender, status))
    }

    /// Asks for the status, until a report tells all of it: most do not tell the speeds, or by the
    /// settings where the machine is.
    ///
    /// # Errors
    /// As [`Sender::join`].
    pub fn status(&mut self) -> Result<Status, Error> {
        let mut status = self.find_state()?;
        for _ in 0..MOST_QUESTIONS {
            // A plotter that computes may take its time to answer.
            if status.is_complete() || status.is_computing {
                break;
            }
            status = self.find_state()?;
        }
        Ok(status)
    }

    /// Pauses the machine, and returns its status when it is at rest with the pen up. With
    /// `after_stroke` it first draws to the end of the stroke.
    ///
    /// # Errors
    /// There is no job to pause, or the plotter does not obey.
    pub fn pause(&mut self, after_stroke: bool) -> Result<Status, Error> {
        let status = self.find_state()?;
        if !matches!(status.state.as_str(), "Run" | "Hold") {
            return Err(Error::NothingToDo { order: "pause", state: status.state });
        }
        if status.state == "Run" {
            let byte = if after_stroke { PAUSE_AFTER_STROKE } else { HOLD };
            // A job may end before the pause takes effect.
            let is_obeyed = |status: &Status| status.state != "Run";
            // A picture is computed to its end, and a stroke may be long.
            let first = status.strokes.map_or(0, |(done, _)| done);
            self.insist("pause", byte, is_obeyed, |status| {
                let is_same_stroke = status.strokes.is_none_or(|(done, _)| done <= first + 1);
                status.is_computing || after_stroke && is_same_stroke
            })?;
        }
        self.wait_until(|status| status.is_standing || !status.is_holding())
    }

    /// Lets a machine that holds go on, and returns its status then.
    ///
    /// # Errors
    /// The machine does not hold, or does not obey.
    pub fn resume(&mut self) -> Result<Status, Error> {
        let status = self.find_state()?;
        if !status.is_holding() {
            return Err(Error::NothingToDo { order: "resume", state: status.state });
        }
        let pen = status.pen_wanted;
        // If the machine waits for another pen, this is already the next pause.
        let is_obeyed = |status: &Status| !status.is_holding() || status.pen_wanted != pen;
        self.insist("resume", RESUME, is_obeyed, |status| !status.is_standing)
    }

    /// Sends a byte that acts at once, and sends it again after some status reports, until one says
    /// that it `is_obeyed`: a byte may be lost. Returns that status. Reports while it `may_last` do
    /// not count as disobedience.
    ///
    /// # Errors
    /// The plotter does not obey.
    fn insist(
        &mut self,
        order: &'static str,
        byte: u8,
        is_obeyed: impl Fn(&Status) -> bool,
        may_last: impl Fn(&Status) -> bool,
    ) -> Result<Status, Error> {
        let (mut reports, mut in_vain) = (0, 0);
        self.wait_watching(&mut |sender, status| {
            if is_obeyed(status) {
                return Ok(true);
            }
            if reports % REPORTS_BEFORE_REPEAT == 0 {
                if in_vain == MOST_ORDERS {
                    return Err(Error::Unconfirmed { order });
                }
                sender.link.send(&[byte])?;
                in_vain += u32::from(!may_last(status));
            }
            reports += 1;
            Ok(false)
        })
    }

    /// Aborts whatever the machine does. Returns its status when it is at rest with the pen up,
    /// which may be that of an alarm.
    ///
    /// # Errors
    /// The plotter does not confirm it.
    pub fn give_up(&mut self) -> Result<Status, Error> {
        self.allows_alarm = true;
        let is_confirmed = self.abort()?.is_some();
        let is_at_rest = |status: &Status| status.is_idle() || status.is_alarm();
        if !is_confirmed && !is_at_rest(&self.find_state()?) {
            return Err(Error::Unconfirmed { order: "abort" });
        }
        self.wait_until(is_at_rest)
    }

    /// Sends one line and returns what the plotter said until it had carried it out.
    ///
    /// # Errors
    /// The plotter refuses the line, or as [`Sender::stream`]. After a refusal the conversation can
    /// go on.
    pub fn ask(&mut self, line: &str) -> Result<Vec<Reply>, Error> {
        let mut replies = Vec::new();
        let line = JobLine::command(line);
        let asked = self.deliver_watching(&[line], &mut Quiet, &mut |reply| {
            // What came before a repetition was about a line that did not arrive.
            match reply {
                Reply::Resend(_) => replies.clear(),
                reply => replies.push(reply.clone()),
            }
        });
        if let Err(Error::Refused { .. }) = asked {
            // The plotter tells this refusal until the numbers begin anew.
            self.begin_numbers(None)?;
        }
        asked.map(|()| replies)
    }

    /// Asks until two answers in a row are the same: they have no checksum.
    ///
    /// # Errors
    /// The answers do not arrive, or differ again and again, or `ask` fails.
    pub fn agreed<T: PartialEq>(
        &mut self,
        mut ask: impl FnMut(&mut Self) -> Result<Option<T>, Error>,
    ) -> Result<T, Error> {
        let mut last = None;
        for _ in 0..MOST_READINGS {
            match ask(self)? {
                Some(answer) if last.as_ref() == Some(&answer) => return Ok(answer),
                answer => last = answer,
            }
        }
        Err(Error::Damaged { line: None, times: MOST_READINGS })
    }

    /// Waits until the machine has done all moves, after which it must be ready for others.
    ///
    /// # Errors
    /// The machine stops with an alarm, or the plotter falls silent.
    pub fn wait_until_ready(&mut self) -> Result<Status, Error> {
        self.allows_alarm = false;
        self.wait_until(Status::is_idle)?;
        self.status()
    }

    /// Waits for a status report that `is_enough`.
    fn wait_until(&mut self, is_enough: impl Fn(&Status) -> bool) -> Result<Status, Error> {
        self.wait_watching(&mut |_, status| Ok(is_enough(status)))
    }

    /// Asks for the status until `watch` returns true for one.
    pub(super) fn wait_watching(
        &mut self,
        watch: &mut dyn FnMut(&mut Self, &Status) -> Result<bool, Error>,
    ) -> Result<Status, Error> {
        self.last_heard = self.link.now();
        self.query()?;
        loop {
            self.stop_if_interrupted()?;
            match self.listen()? {
                Some(Reply::Status(status)) => {
                    self.fail_if_alarm(&status)?;
                    if watch(self, &status)? {
                        return Ok(status);
                    }
                }
                Some(reply @ Reply::Alarm(_)) => self.fail_on(reply, &|| None)?,
                Some(_) => {}
                None => self.fail_if_silent(&|| None)?,
            }
            self.query_if_due()?;
        }
    }
}
