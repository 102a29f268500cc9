//! The commands that move the machine, stop it, or follow what it draws.

use super::lowering::{dip, pen_lines};
use super::settings::read;
use super::status::{as_json, described};
use super::{converse, open};
use crate::cli::{
    AgainArgs, JogArgs, PauseArgs, PenArgs, PenPosition, PlotterArgs, ResumeArgs, WatchArgs,
};
use crate::error::Error;
use crate::interrupt::MovingPlotter;
use crate::outcome::Outcome;
use crate::plot::{KNOWS_PLACE, is_at_origin};
use crate::progress::{Bar, Progress};
use crate::sender::{Sender, Timeouts};
use penup::protocol::CommandError;
use penup_job::protocol::{HOME, PEN_UP, Status, UNLOCK};
use std::io::{self, Write as _};
use std::sync::atomic::AtomicBool;

/// Says what was done, with the status that the machine has then.
fn done(text: &str, status: &Status) -> Outcome {
    Outcome::done(text, as_json(status))
}

/// Does `work` with a plotter that may be drawing.
fn join<T>(
    args: &PlotterArgs,
    interrupt: &AtomicBool,
    work: impl FnOnce(&mut Sender<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    let mut link = open(&args.port)?;
    let (mut sender, _) = Sender::join(&mut link, Timeouts::default(), interrupt)?;
    work(&mut sender)
}

/// Pauses the job that the machine draws.
///
/// # Errors
/// See [`Sender::pause`].
pub fn pause(args: &PauseArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let status = join(&args.plotter, interrupt, |sender| sender.pause(args.after_stroke))?;
    Ok(match status.is_holding() {
        true => done("it holds with the pen up", &status),
        false => done("the job ended before it could be paused", &status),
    })
}

/// Lets a machine that holds, or that waits for a pen, go on. If a loss of power or a reset has
/// stopped a job, goes on with it and follows it.
///
/// # Errors
/// See [`Sender::resume`] and [`Sender::go_on`].
pub fn resume(args: &ResumeArgs, is_quiet: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let mut link = open(&args.plotter.port)?;
    let (mut sender, status) = Sender::join(&mut link, Timeouts::default(), interrupt)?;
    if status.is_holding() && args.at_origin {
        let reason = "the machine holds and knows where the pen is: leave out --at-origin";
        return Err(Error::NotResumed { reason: reason.to_owned() });
    }
    if status.is_holding() || status.stopped.is_none() {
        return Ok(done("it goes on", &sender.resume()?));
    }
    let _moving = MovingPlotter::new();
    link.rejoin(&args.rejoin, is_quiet);
    link.obey_keys();
    let mut progress = progress(args.plotter.format.json, is_quiet);
    let mut sender = Sender::open(&mut link, Timeouts::default(), interrupt)?;
    if sender.stopped_drawing()?.is_some() {
        let option = if args.at_origin { " --at-origin" } else { "" };
        let reason = format!(
            "a computer sent this drawing while it was drawn: name its file, with the same \
             options, in `penup plot FILE --port DEVICE --resume{option}`"
        );
        return Err(Error::NotResumed { reason });
    }
    let mut drawn = sender.go_on(args.at_origin, progress.as_mut());
    let knows = CommandError::PositionKnown.number();
    let is_known = matches!(drawn, Err(Error::Refused { number, .. }) if number == knows);
    if is_known && args.at_origin && is_at_origin(&sender.status()?) {
        // The same command has gone on before, and was interrupted before the pen moved.
        let _ = writeln!(io::stderr(), "penup: note: {KNOWS_PLACE}");
        drawn = sender.go_on(false, progress.as_mut());
    }
    let drawn = drawn.and_then(|()| sender.status());
    sender.end();
    Ok(done("the rest of the job is drawn", &drawn?))
}

/// Aborts whatever the machine does.
///
/// # Errors
/// The machine is locked after an alarm then, or see [`Sender::give_up`].
pub fn abort(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let status = join(args, interrupt, |sender| sender.give_up())?;
    if status.is_alarm() {
        return Err(Error::Locked { alarm: status.alarm });
    }
    Ok(done("given up: the machine stands with the pen up", &status))
}

/// Finds the limit switches.
///
/// # Errors
/// Homing is off, or fails, or as [`Sender::ask`].
pub fn home(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    let status = converse(args, interrupt, |sender| {
        sender.ask(HOME)?;
        sender.wait_until_ready()
    })?;
    Ok(done("the machine is homed", &status))
}

/// Unlocks the machine after an alarm, and wakes it.
///
/// # Errors
/// As [`Sender::ask`].
pub fn unlock(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    converse(args, interrupt, |sender| {
        let status = sender.status()?;
        if !status.is_alarm() && status.state != "Sleep" {
            return Ok(done("the machine is not locked", &status));
        }
        sender.ask(UNLOCK)?;
        Ok(done("the machine is unlocked", &sender.wait_until_ready()?))
    })
}

/// Moves with the pen up, from where the pen is.
///
/// # Errors
/// The way leads beyond the travel, or as [`Sender::ask`].
pub fn jog(args: &JogArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    let status =
        converse(&args.plotter, interrupt, |sender| jog_by(sender, [args.x, args.y], args.speed))?;
    Ok(done(&format!("the pen is at {} mm", status.position), &status))
}

/// Moves the raised pen by so many mm, at this speed in mm/min, and waits until it is there.
pub(super) fn jog_by(
    sender: &mut Sender<'_>,
    [x, y]: [f64; 2],
    speed: f64,
) -> Result<Status, Error> {
    // A startup line may have chosen inches.
    sender.ask(&format!("$J=G21G91 X{x} Y{y} F{speed}"))?;
    sender.wait_until_ready()
}

/// Raises or lowers the pen.
///
/// # Errors
/// The machine has a laser, or as [`Sender::ask`].
pub fn pen(args: &PenArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    converse(&args.plotter, interrupt, |sender| match args.to {
        PenPosition::Up => {
            sender.ask(PEN_UP)?;
            Ok(done("the pen is up", &sender.wait_until_ready()?))
        }
        PenPosition::Down => {
            let pen = pen_lines(&read(sender)?)?;
            Ok(done("the pen was down, and is up again", &dip(&pen, sender)?))
        }
    })
}

/// Prints each new status as a line of JSON.
#[derive(Debug, Default)]
struct JsonLines {
    last: Option<Status>,
}

impl Progress for JsonLines {
    fn lines_sent(&mut self, _: usize, _: usize) {}

    fn drawn(&mut self, status: &Status) {
        if self.last.as_ref() != Some(status) {
            // Who does not read any more is not told.
            let _ = writeln!(io::stdout(), "{}", as_json(status));
            self.last = Some(status.clone());
        }
    }

    fn state(&mut self, _: &str) {}
}

fn progress(json: bool, is_quiet: bool) -> Box<dyn Progress> {
    if json { Box::<JsonLines>::default() } else { Box::new(Bar::new(is_quiet)) }
}

/// Follows what the machine draws until it is idle, whoever has sent it.
///
/// # Errors
/// See [`Sender::watch`] and [`Sender::fail_if_unfinished`].
pub fn watch(args: &WatchArgs, is_quiet: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let mut link = open(&args.plotter.port)?;
    link.rejoin(&args.rejoin, is_quiet);
    link.obey_keys();
    let mut progress = progress(args.plotter.format.json, is_quiet);
    let (mut sender, first) = Sender::join(&mut link, Timeouts::default(), interrupt)?;
    if first.is_idle() {
        let status = sender.fail_if_unfinished(first)?;
        return Ok(Outcome::done("nothing is being drawn", as_json(&status)));
    }
    let status = sender.watch(progress.as_mut())?;
    Ok(Outcome::done(described(&status), as_json(&status)))
}

/// Draws the last job again.
///
/// # Errors
/// The plotter keeps no job, or as [`Sender::again`].
pub fn again(args: &AgainArgs, is_quiet: bool, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let mut link = open(&args.plotter.port)?;
    link.rejoin(&args.rejoin, is_quiet);
    let _moving = MovingPlotter::new();
    link.obey_keys();
    let mut progress = progress(args.plotter.format.json, is_quiet);
    let mut sender = Sender::open(&mut link, Timeouts::default(), interrupt)?;
    let drawn = sender.again(progress.as_mut()).and_then(|()| sender.status());
    sender.end();
    let status = drawn?;
    Ok(done("the last job is drawn again", &status))
}
