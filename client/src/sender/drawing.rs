//! Draws what was sent, or follows a job that runs: waits for its end, and asks for the report on
//! it.

use super::ending::{is_ink_left, is_left};
use super::streaming::Streaming;
use super::{MOST_RESTARTS, Sender};
use crate::error::Error;
use crate::link::{Answer, UserRequest};
use crate::progress::{Progress, Quiet};
use penup::machine::Setting;
use penup_job::protocol::{
    AGAIN, FASTER, GO_ON, GO_ON_AT_ORIGIN, HOLD, MODEL, PLOT, RESUME, Reply, SETTINGS, SLOWER,
    Status,
};
use penup_job::results::JobReport;
use penup_readers::lines::{JobLine, Lines};
use std::time::Instant;

/// The maximum number of queries for the report of a job while it does not arrive.
const SURE_OF_NO_REPORT: u32 = 3;

/// Counts how often in a row the plotter reported the same state of waiting, to decide whether the
/// machine has come to rest.
#[derive(Debug, Default)]
pub(super) struct Standstill {
    at: Option<(Option<u8>, String)>,
    times: u32,
}

impl Standstill {
    /// The number of equal reports that prove a standstill. The first reports may come before the
    /// last moves are done; later ones do not.
    const SURE: u32 = 3;

    /// Processes a status report. Returns `Some` if the machine has certainly stopped and waits;
    /// the inner value is the pen that it waits for, if any.
    pub(super) fn holds(&mut self, status: &Status) -> Option<Option<u8>> {
        let at = status.is_holding().then(|| (status.pen_wanted, status.position.clone()));
        self.times = if at == self.at { self.times + 1 } else { 1 };
        self.at = at;
        (self.at.is_some() && self.times >= Self::SURE).then_some(status.pen_wanted)
    }
}

/// The number of status reports without an effect after which a byte is sent again. The first ones
/// may have been written before it came.
pub(super) const REPORTS_BEFORE_REPEAT: u32 = 4;

/// The state of a drawing that the sender follows.
#[derive(Debug, Default)]
pub(super) struct FollowedDrawing {
    standstill: Standstill,
    held_since: Option<Instant>,
    is_holding: bool,
    /// Whether the machine is in a hold, at rest with the pen up.
    is_standing: bool,
    /// Whether the user of this program asked for the hold.
    paused_here: bool,
    /// The byte that the user of this program asked for last, until a report shows its effect, and
    /// the number of reports since it was sent.
    asked: Option<(u8, u32)>,
    /// The number of strokes in the last report while something was drawn, at least 1 if the
    /// plotter computed; `None` if nothing was drawn.
    strokes: Option<u64>,
}

impl FollowedDrawing {
    /// Notes what is drawn according to a status report.
    fn note(&mut self, status: &Status) {
        if matches!(status.state.as_str(), "Run" | "Hold") {
            let known = status.strokes.map_or(0, |(_, all)| all);
            self.strokes = Some(known.max(u64::from(status.is_computing)));
        }
    }

    /// Whether what was drawn has stopped before its end, if a job has, according to the `last`
    /// report. A job that stopped earlier is reported all the time, also after a program of G-code,
    /// whose moves are not kept.
    fn has_stopped(&self, last: &Status) -> bool {
        self.strokes.is_some() && (self.has_restarted(last) || is_left(last))
    }

    /// Whether the plotter has forgotten what it drew, according to the `last` report.
    fn has_restarted(&self, last: &Status) -> bool {
        self.strokes.is_some_and(|strokes| strokes > 0)
            && last.strokes.is_none_or(|(_, all)| all == 0)
    }

    /// Whether what was drawn has ended before its end according to the `last` report, though no
    /// job has stopped that the plotter keeps. It `is_job` unless it may be a program of G-code,
    /// whose strokes are counted less exactly than its ink.
    fn is_unfinished(&self, last: &Status, is_job: bool) -> bool {
        let has_ended_early = if is_job { is_left(last) } else { is_ink_left(last) };
        self.strokes.is_some() && (self.has_restarted(last) || has_ended_early)
    }
}

/// Whether a line may be sent beside the drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Numbers {
    /// Yes, with the next number.
    Free,
    /// Yes, after the numbers have begun anew: another program may have sent the drawing.
    Unknown,
    /// No, because the drawing is still being sent.
    InUse,
}

/// By how much a key moves the lowered pen, of 127.
const PEN_CHANGE: f64 = 2.0;

/// The setting that holds the height of the lowered pen.
const PEN_DOWN: Setting = Setting::PenDownHeight;

impl Sender<'_> {
    /// Starts the drawing of what was sent, and waits until the machine is idle again.
    ///
    /// # Errors
    /// The plotter refuses the drawing, stops with an alarm, stays in feed hold, or falls silent.
    pub fn plot(&mut self, progress: &mut dyn Progress) -> Result<(), Error> {
        let lines = [JobLine::command(PLOT)];
        self.begin_plot(&lines, progress)?;
        let base = self.done - 1;
        self.follow_drawing(Some(&lines), None, &mut FollowedDrawing::default(), progress)?;
        self.confirm(&lines, base)?;
        self.fail_if_stopped().map(drop)
    }

    /// Draws the last job again, which the plotter has kept, and waits until the machine is idle.
    ///
    /// # Errors
    /// As [`Sender::plot`].
    pub fn again(&mut self, progress: &mut dyn Progress) -> Result<(), Error> {
        self.draw_kept(AGAIN, progress)
    }

    /// Goes on with the job that a loss of power or a reset has stopped, and waits until the
    /// machine is idle. With `at_origin` the user has put the pen at the origin by hand.
    ///
    /// # Errors
    /// As [`Sender::plot`].
    pub fn go_on(&mut self, at_origin: bool, progress: &mut dyn Progress) -> Result<(), Error> {
        self.draw_kept(if at_origin { GO_ON_AT_ORIGIN } else { GO_ON }, progress)
    }

    /// Begins to draw a job that the plotter keeps by `command`, and waits until the machine is
    /// idle.
    fn draw_kept(&mut self, command: &str, progress: &mut dyn Progress) -> Result<(), Error> {
        let lines = [JobLine::command(command)];
        let begun = self.deliver(&lines, &mut Quiet);
        if let Err(Error::Refused { .. }) = begun {
            // The plotter tells this refusal until the numbers begin anew.
            self.begin_numbers(None)?;
        }
        begun?;
        let base = self.done - 1;
        self.follow_drawing(Some(&lines), None, &mut FollowedDrawing::default(), progress)?;
        self.confirm(&lines, base)?;
        self.fail_if_stopped().map(drop)
    }

    /// Follows the job that the plotter draws until the machine is idle, whoever has sent it.
    /// Returns the last status.
    ///
    /// # Errors
    /// The machine stops with an alarm or before the end of the job, stays in feed hold, or falls
    /// silent.
    pub fn watch(&mut self, progress: &mut dyn Progress) -> Result<Status, Error> {
        let mut followed = FollowedDrawing::default();
        followed.note(&self.last_status);
        let status = self.follow_drawing(None, None, &mut followed, progress)?;
        if status.stopped.is_some() && followed.has_stopped(&status) {
            return self.fail_if_stopped();
        }
        self.fail_if(status, |status| followed.is_unfinished(status, false))
    }

    /// As [`Sender::watch`], where this program has sent the drawing as strokes. The plotter keeps
    /// how far it comes, in place of any job that has stopped before.
    pub(super) fn watch_strokes(&mut self, progress: &mut dyn Progress) -> Result<Status, Error> {
        let mut followed = FollowedDrawing::default();
        self.follow_drawing(None, None, &mut followed, progress)?;
        let status = self.fail_if_stopped()?;
        // It was seen, or may have been.
        followed.strokes = Some(followed.strokes.unwrap_or(0).max(1));
        self.fail_if(status, |status| followed.is_unfinished(status, true))
    }

    /// As [`Sender::watch`], where this program has `sent` the drawing as G-code. The plotter does
    /// not keep how far it comes, so a job that has stopped is another one.
    pub(super) fn watch_gcode(
        &mut self,
        sent: &mut Streaming<'_>,
        progress: &mut dyn Progress,
    ) -> Result<Status, Error> {
        self.follow_drawing(None, Some(sent), &mut FollowedDrawing::default(), progress)
    }

    /// Asks for the status until the machine is idle, and lets it go on after pauses. `began` are
    /// the lines that began the drawing, if this program has sent them. The plotter knows less than
    /// this program of a drawing that was `sent` as G-code. What is seen is noted in `followed`.
    fn follow_drawing(
        &mut self,
        began: Option<&[JobLine; 1]>,
        mut sent: Option<&mut Streaming<'_>>,
        followed: &mut FollowedDrawing,
        progress: &mut dyn Progress,
    ) -> Result<Status, Error> {
        let command = &|| began.map(|[line]| line.clone());
        self.last_heard = self.link.now();
        self.query()?;
        loop {
            self.stop_if_interrupted()?;
            let numbers = if began.is_some() { Numbers::Free } else { Numbers::Unknown };
            self.obey(followed, numbers, progress)?;
            match self.listen()? {
                Some(Reply::Status(status)) => {
                    let status = match &mut sent {
                        Some(streaming) => streaming.told(status, streaming.job.count()),
                        None => status,
                    };
                    progress.state(&status.state);
                    if let Some((_, all)) = status.strokes {
                        progress.drawn(&status);
                        self.strokes = all;
                    }
                    self.fail_if_alarm(&status)?;
                    self.wait_or_resume(&status, followed)?;
                    followed.note(&status);
                    if status.is_idle() {
                        self.position.clone_from(&status.position);
                        return Ok(status);
                    }
                }
                Some(Reply::Done(_) | Reply::Last(_) | Reply::Resend(_) | Reply::Error(_)) => {}
                // This is the refusal of a line that another sender has sent.
                Some(Reply::Refused(number, _)) if began.is_none() || number != self.done => {}
                Some(Reply::Refused(_, error)) => {
                    self.fail_on(Reply::Error(error), command)?;
                }
                Some(reply) => self.fail_on(reply, command)?,
                None => self.fail_if_silent(command)?,
            }
            self.query_if_due()?;
        }
    }

    /// Does what the user of this program asked for by keys.
    pub(super) fn obey(
        &mut self,
        followed: &mut FollowedDrawing,
        numbers: Numbers,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        while let Some(request) = self.requests.pop_front() {
            let byte = match request {
                UserRequest::Pause if followed.is_holding => {
                    followed.paused_here = false;
                    followed.held_since = None;
                    RESUME
                }
                UserRequest::Pause => {
                    followed.paused_here = true;
                    HOLD
                }
                UserRequest::Faster => FASTER,
                UserRequest::Slower => SLOWER,
                UserRequest::PenHigher | UserRequest::PenLower => {
                    let by =
                        if request == UserRequest::PenLower { PEN_CHANGE } else { -PEN_CHANGE };
                    progress.note(&self.move_pen(by, followed, numbers)?);
                    continue;
                }
                // This request is carried out where interrupts are handled.
                UserRequest::GiveUp => continue,
            };
            if matches!(byte, HOLD | RESUME) {
                followed.asked = Some((byte, 0));
            }
            self.link.send(&[byte])?;
        }
        Ok(())
    }

    /// Sends the byte that the user asked for last again if it shows no effect: it may be lost.
    fn repeat_if_lost(
        &mut self,
        status: &Status,
        followed: &mut FollowedDrawing,
    ) -> Result<(), Error> {
        let Some((byte, reports)) = &mut followed.asked else { return Ok(()) };
        // A picture is computed to its end before the machine holds.
        if (*byte == HOLD) == status.is_holding() || status.is_idle() {
            followed.asked = None;
        } else if !status.is_computing {
            *reports += 1;
            if *reports % REPORTS_BEFORE_REPEAT == 0 {
                self.link.send(&[*byte])?;
            }
        }
        Ok(())
    }

    /// Changes the height of the lowered pen by this much. Returns the outcome, for the user.
    fn move_pen(
        &mut self,
        by: f64,
        followed: &FollowedDrawing,
        numbers: Numbers,
    ) -> Result<String, Error> {
        if !followed.is_standing {
            let reason =
                "the pen's height can be changed in a pause alone: press space, then u or d";
            return Ok(reason.to_owned());
        }
        match numbers {
            Numbers::Free => {}
            Numbers::Unknown => self.begin_numbers(None)?,
            Numbers::InUse => {
                let reason = "the pen's height cannot be changed while strokes are being sent";
                return Ok(reason.to_owned());
            }
        }
        let number = PEN_DOWN.info().number();
        let value_of = |setting: Setting, reply: &Reply| match reply {
            Reply::Other(line) => {
                let value = line.strip_prefix(&format!("${}=", setting.info().number()))?;
                value.split(' ').next()?.parse::<f64>().ok()
            }
            _ => None,
        };
        let changed = self.ask(SETTINGS).and_then(|replies| {
            let [up, down] = [Setting::PenUpHeight, PEN_DOWN]
                .map(|setting| replies.iter().find_map(|reply| value_of(setting, reply)));
            let Some(height) = down else { return Ok(None) };
            // A servo that is mounted the other way round lowers the pen by lesser numbers.
            let by = if up > down { -by } else { by };
            let height = (height + by).clamp(0.0, 127.0);
            self.ask(&format!("${number}={height}"))?;
            Ok(Some(height))
        });
        Ok(match changed {
            Ok(Some(height)) => format!("the lowered pen is at height {height} of 127 now"),
            Ok(None) | Err(Error::Refused { .. }) => {
                format!("this firmware does not change the pen's height (${number}) in a pause")
            }
            Err(error) => return Err(error),
        })
    }

    /// Lets a stopped machine continue if it waits for a pen that is in, or if the user allows it.
    pub(super) fn wait_or_resume(
        &mut self,
        status: &Status,
        followed: &mut FollowedDrawing,
    ) -> Result<(), Error> {
        followed.is_holding = status.is_holding() && status.pen_wanted.is_none();
        followed.is_standing = status.is_standing;
        self.repeat_if_lost(status, followed)?;
        let holds = followed.standstill.holds(status);
        if !status.is_holding() {
            followed.held_since = None;
            return Ok(());
        }
        let Some(pen) = holds else { return Ok(()) };
        if pen.is_none() && (followed.paused_here || followed.asked.is_some()) {
            return Ok(());
        }
        if self.may_resume(pen, &mut followed.held_since)? {
            self.link.send(&[RESUME])?;
            followed.standstill = Standstill::default();
        }
        Ok(())
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
                    let (status, contents) = self.look_again()?;
                    let has_moved = !status.is_idle() || status.position != self.position;
                    if has_moved || Some(contents) != self.contents {
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
            return match self.link.change_pen(pen)? {
                Answer::Yes => Ok(true),
                Answer::NotYet => Ok(false),
                Answer::Nobody => Err(Error::WaitsForPen { pen }),
            };
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
            Answer::Nobody if self.since(since) > self.timeouts.hold => Err(Error::Held),
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
