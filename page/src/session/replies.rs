//! What a session does with what the plotter answers: each reply, and each step of a delivery, may
//! end its phase.

use super::{ABSOLUTE, Session};
use crate::delivery::Outcome;
use crate::event::Event;
use crate::phase::Phase;
use crate::words::{alarm, message, refusal, sentence};
use penup::protocol::CommandError;
use penup_job::protocol::{ABORT, MODEL, PLOT, Reply, SETTINGS, Status, is_penup};
use penup_job::results::JobReport;
use penup_readers::lines::JobLine;
use std::rc::Rc;

/// The most times that the checksums and the report are asked for again.
const MOST_QUESTIONS: u32 = 10;
/// The least number of reports in succession by which a job has stopped before its end.
const LEAST_STOPS: u32 = 5;
/// The number of the error by which `$stream` says that there is no job that a computer sends. The
/// library of the page has no such jobs, so it does not know it.
const NO_STREAM: u16 = 181;

impl Session {
    pub(super) fn take(&mut self, reply: &Reply, raw: &str) {
        match reply {
            Reply::Status(status) => self.follow(status, raw),
            Reply::Greeting(text) => return self.greeted(text),
            Reply::Message(text) => {
                self.messages.push(text.clone());
                let is_note = matches!(self.phase, Phase::Drawing | Phase::Starting | Phase::Ready);
                // The refusal of a question before what comes next is none, and a wanted pen has an
                // event of its own.
                if is_note && self.next.is_none() && !text.starts_with("put in pen") {
                    let text = format!("{}.", sentence(&message(text)));
                    self.events.push(Event::Note { text });
                }
            }
            Reply::Alarm(number) => return self.alarmed(*number),
            Reply::Contents(contents) => self.contents = Some(*contents),
            Reply::Done(0) if self.phase == Phase::Numbering => {
                self.number = 0;
                self.enter(Phase::Ready);
                if std::mem::take(&mut self.is_relative) {
                    // The end of the square was refused, too.
                    self.deliver(Rc::new(vec![JobLine::command(ABSOLUTE)]));
                    self.enter(Phase::Commanding);
                }
                self.begin_job();
            }
            Reply::Done(0) if self.delivery.is_none() => self.begin_next(),
            Reply::Other(line) => {
                self.report = JobReport::parse(self.strokes, line).or(self.report.take());
                if self.phase == Phase::Asking {
                    self.settings.push(line.clone());
                }
                if self.phase == Phase::Commanding {
                    self.events.push(Event::Reply { text: line.clone() });
                }
            }
            _ => {}
        }
        if let Some(mut delivery) = self.delivery.take() {
            let before = delivery.progress().0;
            let outcome = delivery.reply(reply, self.now, &mut self.out);
            let (done, all) = delivery.progress();
            if self.phase == Phase::Sending && done != before {
                self.events.push(Event::Sent { done, all });
            }
            self.delivery = Some(delivery);
            self.settle(outcome);
        }
    }

    /// Goes on after a step of the delivery.
    pub(super) fn settle(&mut self, outcome: Outcome) {
        if let Some(delivery) = &self.delivery {
            self.number = delivery.number();
        }
        match outcome {
            Outcome::More => return,
            Outcome::Done if self.next.is_some() => {
                self.fail(
                    "A computer sent this drawing while it was drawn, and the plotter keeps no \
                     strokes of it. Disconnect this page, and type `penup plot FILE --port DEVICE \
                     --resume` on a computer, with the same file and options: it draws the rest."
                        .to_owned(),
                );
                return self.enter(Phase::Ready);
            }
            Outcome::Done => {}
            Outcome::Refused(_, error) if self.next.is_some() && has_no_stream(error) => {
                self.delivery = None;
                self.enter(self.phase);
                return self.begin_numbers();
            }
            Outcome::Refused(line, error) => {
                // The user knows nothing of the question before what comes next.
                let line = line.filter(|_| self.next.is_none());
                let text = refusal(line.as_ref(), error, &self.messages);
                self.fail(text);
                if self.phase == Phase::Alarm {
                    // It stays locked; what ends that numbers lines anew.
                    return;
                }
                // Until lines are numbered anew, the plotter repeats the refusal.
                self.enter(Phase::Numbering);
                return self.begin_numbers();
            }
            Outcome::Restarted => return self.restarted(),
            Outcome::Lost(line) => {
                let origin = line.and_then(|line| line.origin);
                let at = origin.map(|it| format!(" (line {} of {})", it.line, it.file));
                self.fail(format!(
                    "Bytes were lost on the way to the plotter again and again{}. Check the cable, \
                     keep it away from the motors, and see that nothing else uses the port.",
                    at.unwrap_or_default()
                ));
                return self.enter(Phase::Finding);
            }
        }
        self.delivery = None;
        match self.phase {
            Phase::Sending => {
                (self.contents, self.questions) = (None, 0);
                self.deliver(Rc::new(vec![JobLine::command(MODEL)]));
                self.enter(Phase::Comparing);
            }
            Phase::Comparing if self.contents.is_some() && self.contents == self.expected => {
                self.deliver(Rc::new(vec![JobLine::command(PLOT)]));
                self.enter(Phase::Starting);
            }
            // The answer may have been damaged: it has no checksum of its own.
            Phase::Comparing if self.questions < MOST_QUESTIONS => {
                self.questions += 1;
                self.contents = None;
                self.deliver(Rc::new(vec![JobLine::command(MODEL)]));
            }
            Phase::Comparing => {
                self.fail(
                    "The plotter holds something else than was sent to it, so nothing is drawn. \
                     Does another program send to it at the same time, or is its firmware of \
                     another version than this page?"
                        .to_owned(),
                );
                self.enter(Phase::Ready);
            }
            Phase::Starting => {
                self.job = None;
                self.enter(Phase::Drawing);
            }
            // A line of settings has no checksum: two answers must agree.
            Phase::Asking if self.settings != self.settings_before => {
                self.questions += 1;
                if self.questions > MOST_QUESTIONS {
                    self.fail("The line damages what the plotter answers: check it.".to_owned());
                    return self.enter(Phase::Ready);
                }
                self.settings_before = std::mem::take(&mut self.settings);
                self.deliver(Rc::new(vec![JobLine::command(SETTINGS)]));
            }
            Phase::Asking => self.move_pen(),
            Phase::Reporting if self.report.is_none() && self.questions < MOST_QUESTIONS => {
                self.questions += 1;
                self.deliver(Rc::new(vec![JobLine::command(MODEL)]));
            }
            Phase::Reporting => {
                let report = self.report.take().map(|report| report.to_string());
                self.events.push(Event::Drawn { report });
                self.enter(Phase::Ready);
            }
            _ => {
                self.is_relative = false;
                self.enter(Phase::Ready);
                self.begin_job();
            }
        }
    }

    fn greeted(&mut self, text: &str) {
        if !is_penup(text) {
            self.fail(format!("What answers is not penup: it said \u{201c}{text}\u{201d}."));
            return self.close();
        }
        self.is_relative = false;
        match self.phase {
            Phase::Closed | Phase::Finding => {}
            Phase::Greeting | Phase::Numbering => {
                if std::mem::take(&mut self.is_given_up) {
                    self.events.push(Event::Stopped);
                }
                self.enter(Phase::Numbering);
                self.begin_numbers();
            }
            _ => self.restarted(),
        }
    }

    fn restarted(&mut self) {
        self.fail(
            "The plotter gave up in the middle and started again. Either somebody stopped it at \
             another port, a byte was damaged on the line, or it lost its power: check the cable \
             and the supply."
                .to_owned(),
        );
        self.enter(Phase::Finding);
    }

    /// Tells that the job has ended before its last stroke. The plotter notes that stroke a moment
    /// after the machine is at rest, so several reports must say so.
    fn has_stopped(&mut self) {
        if self.stops < LEAST_STOPS {
            return;
        }
        self.fail(
            "The drawing has stopped before its end: it was given up at another port, or the \
             plotter was reset or lost its power."
                .to_owned(),
        );
        self.enter(Phase::Ready);
    }

    fn alarmed(&mut self, number: u16) {
        let text = alarm(number, &self.messages);
        self.fail(text);
        self.enter(Phase::Alarm);
    }

    fn follow(&mut self, status: &Status, raw: &str) {
        self.reads_no_lines = status.is_computing || status.state == "Home";
        let pair = |name: &str| -> Option<(f64, f64)> {
            let (done, all) = field(raw, name)?.split_once('/')?;
            Some((done.parse().ok()?, all.parse().ok()?))
        };
        if let Some((_, all)) = status.strokes {
            self.strokes = all;
        }
        self.percent = status.percent.unwrap_or(self.percent);
        self.events.push(Event::Status {
            state: status.state.clone(),
            position: status.position.split(',').filter_map(|c| c.parse().ok()).collect(),
            percent: self.percent,
            is_held: status.is_standing && status.pen_wanted.is_none(),
            stopped: status.stopped,
            strokes: status.strokes,
            ink: pair("Ink:"),
            left: field(raw, "Left:").and_then(|left| left.parse().ok()),
        });
        if status.state == "Alarm" && self.phase != Phase::Alarm {
            return self.alarmed(status.alarm.unwrap_or(0));
        }
        let is_stopped = status.is_idle() && status.stopped.is_some();
        self.stops = if is_stopped { self.stops + 1 } else { 0 };
        match self.phase {
            Phase::Finding if status.is_idle() => {
                // An abort loses nothing now, and clears what an earlier sender left half sent.
                self.out.push(ABORT);
                self.enter(Phase::Greeting);
            }
            Phase::Finding => self.enter(Phase::Watching),
            Phase::Watching if status.is_idle() => {
                self.out.push(ABORT);
                self.enter(Phase::Greeting);
            }
            // It homes. The user knows this as something that the machine does when it is ready.
            Phase::Alarm if status.state == "Home" && self.delivery.is_some() => {
                self.enter(Phase::Ready);
                self.enter(Phase::Commanding);
            }
            Phase::Alarm if status.state != "Alarm" && self.delivery.is_none() => {
                self.next = None;
                self.enter(Phase::Finding);
            }
            Phase::Drawing if is_stopped => self.has_stopped(),
            Phase::Drawing if status.is_idle() => {
                (self.report, self.questions) = (None, 0);
                self.deliver(Rc::new(vec![JobLine::command(MODEL)]));
                self.enter(Phase::Reporting);
            }
            _ => {}
        }
        self.ask_for_pen(status);
    }

    /// Tells the user once that the machine is at rest and waits for a pen. The first reports may
    /// come before the last moves are done; later ones do not.
    fn ask_for_pen(&mut self, status: &Status) {
        let (pen, position, times) = &mut self.holds;
        if (*pen, &*position) == (status.pen_wanted, &status.position) {
            *times = times.saturating_add(1);
        } else {
            (*pen, *position, *times) = (status.pen_wanted, status.position.clone(), 1);
        }
        if let (Some(pen), 3) = (status.pen_wanted, *times) {
            self.events.push(Event::Pen { pen });
        }
    }
}

/// Whether a plotter that refuses `$stream` with this error has no job that a computer sends.
fn has_no_stream(error: u16) -> bool {
    let unknown = [CommandError::UnknownSystemCommand, CommandError::UnknownCommand];
    error == NO_STREAM || unknown.iter().any(|unknown| unknown.number() == error)
}

/// The text of a field of a status report.
fn field<'a>(raw: &'a str, name: &str) -> Option<&'a str> {
    raw.strip_prefix('<')?.strip_suffix('>')?.split('|').find_map(|field| field.strip_prefix(name))
}
