//! Sends a drawing that this computer has computed, while it is drawn.

use super::drawing::{FollowedDrawing, Numbers};
use super::refusals::for_sent_drawing;
use super::{Sender, Timeouts};
use crate::error::Error;
use crate::link::Link;
use crate::progress::{Progress, Quiet};
use penup::machine::{Setting, Settings};
use penup::protocol::{CommandError, MOST_TARGETS};
use penup_job::protocol::{Reply, STREAM, Status};
use penup_job::streamed::{Form, StreamedJob};
use std::sync::atomic::AtomicBool;

/// A drawing whose strokes a plotter has taken in part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Taken {
    /// The number by which the plotter knows it: [`StreamedJob::id`].
    pub id: u32,
    /// The number of targets of the drawing that have come.
    pub targets: u32,
    /// The number of all targets of the drawing.
    pub all: u32,
    /// The number of points within strokes that were passed before the drawing went on.
    pub points: u32,
    /// The number of strokes that are drawn in all, if the plotter has said so.
    pub strokes: Option<u32>,
}

/// A drawing that was sent while it was drawn, and that the plotter has stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped {
    /// The number by which the plotter knows it: [`StreamedJob::id`].
    pub id: u32,
    /// The number of strokes that are drawn.
    pub drawn: u32,
    /// The number of strokes of the drawing.
    pub all: u32,
    /// Whether nobody has said where the pen is since then.
    pub is_lost: bool,
    /// The number of points within strokes that are passed, at which the machine has rested.
    pub points: u32,
}

/// How much of a drawing has arrived that is sent while it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Arrival {
    /// Lines are left that were not sent.
    #[default]
    Part,
    /// All lines were sent, and the last ones were not answered.
    PerhapsAll,
    /// The plotter has taken all lines.
    All,
}

/// The greatest number of lines of G-code that a plotter has taken and not carried out: it plans 15
/// moves ahead, and reads some lines beyond them.
const MOST_PLANNED: usize = 20;

/// The state of a drawing while its lines are sent.
pub(super) struct Streaming<'j> {
    /// The lines of the drawing.
    pub job: &'j StreamedJob,
    /// The progress of the drawing.
    pub followed: FollowedDrawing,
    /// The number of changes of pens that are done, if the plotter does not tell which pen it waits
    /// for.
    pub pens_in: usize,
    /// Whether the machine has been seen to wait for the next one.
    pub waited: bool,
    /// How much of the drawing has arrived.
    pub arrival: Arrival,
}

impl<'j> Streaming<'j> {
    /// The state before the first line.
    pub fn of(job: &'j StreamedJob) -> Self {
        let followed = FollowedDrawing::default();
        Self { job, followed, pens_in: 0, waited: false, arrival: Arrival::Part }
    }
}

impl Streaming<'_> {
    /// Whether the plotter, according to its status, cannot take another line before the pen has
    /// moved on.
    pub fn waits(&self, status: &Status) -> bool {
        match self.job.form() {
            Form::Strokes => is_full(status),
            // A move waits for room among those that are planned.
            Form::GCode => matches!(status.state.as_str(), "Run" | "Hold"),
        }
    }

    /// The status with what a plotter that draws G-code cannot know: how much there is in all once
    /// it has taken the first `done` lines, and which pen comes next.
    pub fn told(&mut self, mut status: Status, done: usize) -> Status {
        if self.job.form() == Form::Strokes {
            return status;
        }
        let size = self.job.size();
        let share = self.job.share(done);
        let part = |all: u64| ((all as f64 * share) as u64, all);
        let seconds = size.milliseconds as f64 * (1.0 - share) / 1000.0;
        // The last moves that the plotter has taken may still wait.
        let begun = self.job.strokes_begun(done.saturating_sub(MOST_PLANNED));
        status.strokes = Some((begun.into(), size.strokes.into()));
        status.ink = Some(part(size.drawn >> 18));
        status.seconds_left = Some(seconds as u64);
        // Lines behind the change are taken before the pen is in.
        let pens = self.job.pens_in_lines(done);
        if status.is_standing && pens.len() > self.pens_in {
            status.pen_wanted = pens.last().copied();
            self.waited = true;
        } else if self.waited && !status.is_holding() {
            (self.pens_in, self.waited) = (self.pens_in + 1, false);
        }
        status
    }
}

/// Whether the plotter has no room for another line of strokes, and so reads none.
fn is_full(status: &Status) -> bool {
    status.stream.is_some_and(|[_, _, room]| (room as usize) < MOST_TARGETS)
}

impl<'a> Sender<'a> {
    /// Joins a plotter that draws strokes while they are sent, to send it the rest. `None` if it
    /// does something else. Nothing changes on the plotter but the numbers of lines.
    ///
    /// # Errors
    /// The drawing ends, or is given up, before the answer is known, or as [`Sender::open`].
    pub fn rejoin(
        link: &'a mut dyn Link,
        timeouts: Timeouts,
        interrupt: &'a AtomicBool,
    ) -> Result<Option<(Self, Taken)>, Error> {
        let mut sender = Self::new(link, timeouts, interrupt);
        let status = sender.find_state()?;
        if status.stream.is_none() {
            return Ok(None);
        }
        sender.begin_numbers_beside_strokes()?;
        let asked = sender.agreed(|sender| Ok(sender.ask(STREAM)?.iter().find_map(taken_in)));
        let taken = asked.map_err(|error| match error {
            Error::Refused { .. } => Error::EndedMeanwhile,
            error => error,
        })?;
        let strokes = status.strokes.and_then(|(_, all)| u32::try_from(all).ok());
        Ok(Some((sender, Taken { strokes, ..taken })))
    }

    /// Begins the numbers of lines anew while strokes are drawn.
    ///
    /// # Errors
    /// Their drawing ends meanwhile, or as [`Sender::open`].
    fn begin_numbers_beside_strokes(&mut self) -> Result<(), Error> {
        loop {
            if self.wait_for_room()?.stream.is_none() {
                return Err(Error::EndedMeanwhile);
            }
            match self.begin_numbers(None) {
                // The plotter still had lines, which have filled its memory again.
                Err(Error::LostLine { .. }) if is_full(&self.find_state()?) => {}
                begun => return begun,
            }
        }
    }

    /// Waits until the plotter has room for more strokes, because it reads no line before that.
    /// Lets the machine go on after pauses meanwhile. Returns the last status.
    fn wait_for_room(&mut self) -> Result<Status, Error> {
        let mut followed = FollowedDrawing::default();
        self.wait_watching(&mut |sender, status| {
            if !is_full(status) {
                return Ok(true);
            }
            sender.obey(&mut followed, Numbers::InUse, &mut Quiet)?;
            sender.wait_or_resume(status, &mut followed)?;
            Ok(false)
        })
    }

    /// Whether the plotter, which has these settings, takes strokes, or only G-code.
    ///
    /// # Errors
    /// It takes only G-code in which a program cannot say when the pen is down, or as
    /// [`Sender::stream`].
    pub fn form(&mut self, settings: &Settings) -> Result<Form, Error> {
        let unknown = [CommandError::UnknownSystemCommand, CommandError::UnknownCommand];
        let form = match self.ask(STREAM) {
            Err(Error::Refused { number, .. })
                if unknown.iter().any(|error| error.number() == number) =>
            {
                Form::GCode
            }
            // No strokes are expected now, or another drawing has stopped that cannot go on.
            Err(Error::Refused { .. }) => Form::Strokes,
            other => other.map(|_| Form::Strokes)?,
        };
        let shows_pen = settings.get(Setting::PenMode) == 0 && !settings.is_on(Setting::Laser);
        if form == Form::GCode && !shows_pen {
            let reason = "this plotter takes G-code: set $206=0 and $32=0, so that G1 draws";
            return Err(Error::NotStreamed { reason: reason.to_owned() });
        }
        Ok(form)
    }

    /// How far a drawing has come that was sent while it was drawn and has stopped; `None` if there
    /// is none.
    ///
    /// # Errors
    /// What it depends on has changed, or as [`Sender::ask`].
    pub fn stopped_drawing(&mut self) -> Result<Option<Stopped>, Error> {
        match self.agreed(|sender| Ok(sender.ask(STREAM)?.iter().find_map(stopped_in))) {
            Err(Error::Refused { number, messages, line }) => {
                match for_sent_drawing(number, &messages) {
                    _ if number == CommandError::NoStream.number() => Ok(None),
                    Some(reason) => Err(Error::NotResumed { reason }),
                    None => Err(Error::Refused { number, messages, line }),
                }
            }
            asked => asked.map(Some),
        }
    }

    /// How much has arrived of the drawing that was sent last.
    pub fn arrival(&self) -> Arrival {
        self.arrival
    }

    /// Sends a drawing while it is drawn, and waits until the machine is idle again.
    ///
    /// # Errors
    /// The plotter refuses the drawing, stops with an alarm, stays in feed hold, or falls silent.
    pub fn draw_streamed(
        &mut self,
        job: &StreamedJob,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        self.strokes = job.size().strokes.into();
        let mut streaming = Streaming::of(job);
        let base = self.done;
        let delivered = self.deliver_as(job, Some(&mut streaming), progress, &mut |_| {});
        self.arrival = streaming.arrival;
        delivered?;
        match job.form() {
            Form::Strokes => self.watch_strokes(progress)?,
            // The plotter knows only of what it has not drawn yet, and not of the pens.
            Form::GCode => {
                self.watch_gcode(&mut streaming, &mut Quiet)?;
                // A plotter that has started again unheard is idle, too, and has not drawn the last
                // moves.
                return self.confirm(job, base);
            }
        };
        Ok(())
    }
}

/// The answer to `$stream` after a stop: `[STOPPED:id,drawn,all,lost,points]`. Older firmware does
/// not say the last number.
fn stopped_in(reply: &Reply) -> Option<Stopped> {
    let Reply::Other(line) = reply else { return None };
    let mut numbers = line.strip_prefix("[STOPPED:")?.strip_suffix(']')?.split(',');
    let mut next = || numbers.next()?.parse::<u32>().ok();
    let (id, drawn, all, lost) = (next()?, next()?, next()?, next()?);
    let points = next().unwrap_or(0);
    Some(Stopped { id, drawn, all, is_lost: lost != 0, points }).filter(|_| drawn < all)
}

/// The answer to `$stream`: `[STREAM:id,taken,all,points]`. Older firmware does not say the last
/// number.
fn taken_in(reply: &Reply) -> Option<Taken> {
    let Reply::Other(line) = reply else { return None };
    let mut numbers = line.strip_prefix("[STREAM:")?.strip_suffix(']')?.split(',');
    let mut next = || numbers.next()?.parse::<u32>().ok();
    let (id, targets, all) = (next()?, next()?, next()?);
    let points = next().unwrap_or(0);
    Some(Taken { id, targets, all, points, strokes: None })
}

#[cfg(test)]
mod tests;
