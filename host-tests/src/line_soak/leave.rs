//! Senders that are gone in the middle of things: their computer has crashed, or the cable was
//! pulled.

use super::{DamagedLine, Job, OFTEN};
use penup_client::error::Error as ClientError;
use penup_client::link::{Answer, Link};
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_readers::lines::Lines as _;
use std::error::Error;
use std::io;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What a sender leaves in the middle of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Middle {
    /// A line of the upload.
    Line,
    /// The upload, between two lines.
    Upload,
    /// A job that the board draws.
    Job,
    /// A drawing that is sent while it is drawn, within a line.
    Stream,
}

/// When a sender leaves.
enum Departure {
    /// When the line with this number is sent, in its middle or behind it.
    Sending { number: usize, within_line: bool },
    /// When the machine draws.
    Drawing,
}

/// The line of a sender that leaves.
struct Leaving<'l> {
    line: &'l mut DamagedLine,
    departure: Departure,
    is_gone: bool,
}

impl Leaving<'_> {
    fn fail_if_gone(&self) -> io::Result<()> {
        if self.is_gone { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
    }
}

/// The number of a line that is sent with one.
fn line_number(bytes: &[u8]) -> Option<usize> {
    let digits = bytes.strip_prefix(b"N")?.split(|byte| !byte.is_ascii_digit()).next()?;
    std::str::from_utf8(digits).ok()?.parse().ok()
}

impl Link for Leaving<'_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.fail_if_gone()?;
        let Departure::Sending { number, within_line } = self.departure else {
            return self.line.send(bytes);
        };
        if line_number(bytes) != Some(number) {
            return self.line.send(bytes);
        }
        self.is_gone = true;
        let arrives = if within_line { bytes.len() / 2 } else { bytes.len() };
        self.line.send(&bytes[..arrives])
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let draws = matches!(self.departure, Departure::Drawing) && self.line.watched.is_drawing();
        self.is_gone |= draws;
        self.fail_if_gone()?;
        self.line.receive(buffer, timeout)
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.line.change_pen(pen)
    }
}

impl DamagedLine {
    /// Has a sender `act` that leaves then. Waits until nothing more is said.
    fn leave_then(
        &mut self,
        departure: Departure,
        act: impl FnOnce(&mut Sender<'_>) -> Result<(), ClientError>,
    ) -> Result<(), Box<dyn Error>> {
        let interrupt = AtomicBool::new(false);
        let timeouts = Timeouts { query: OFTEN, ..Timeouts::default() };
        let mut leaving = Leaving { line: self, departure, is_gone: false };
        let outcome = Sender::open(&mut leaving, timeouts, &interrupt)
            .and_then(|mut sender| act(&mut sender));
        let is_gone = leaving.is_gone;
        if !is_gone || !matches!(outcome, Err(ClientError::Link(_))) {
            return Err(format!("a sender that should leave: {is_gone}, {outcome:?}").into());
        }
        self.hear_out()
    }

    /// Leaves in the middle of something.
    pub(super) fn leave(&mut self, job: &mut Job, middle: Middle) -> Result<(), Box<dyn Error>> {
        match middle {
            // This board takes no strokes.
            Middle::Stream if job.streamed.is_none() => return Ok(()),
            Middle::Line | Middle::Upload => {
                let number = 1 + self.random.below(job.sent.len() as u64) as usize;
                let within_line = middle == Middle::Line;
                let departure = Departure::Sending { number, within_line };
                self.leave_then(departure, |sender| sender.stream(&job.sent, &mut Quiet))?;
            }
            Middle::Job => {
                self.watched.take_ink()?;
                self.leave_then(Departure::Drawing, |sender| {
                    sender.stream(&job.sent, &mut Quiet)?;
                    sender.plot(&mut Quiet)
                })?;
                // The board draws on by itself.
                while !self.status()?.starts_with("<Idle") {}
                if self.watched.take_ink()? != job.ink {
                    return Err("a job whose sender has left is another drawing".into());
                }
            }
            Middle::Stream => self.leave_stream(job)?,
        }
        self.counts.left[middle as usize] += 1;
        self.assert_at_rest()
    }

    /// Leaves in the middle of a drawing that is sent while it is drawn, asks for the status for a
    /// while, and sends the rest as another sender.
    fn leave_stream(&mut self, job: &mut Job) -> Result<(), Box<dyn Error>> {
        let Some((drawing, ink)) = &mut job.streamed else { return Ok(()) };
        let mut streamed = drawing.from(0);
        self.watched.take_ink()?;
        // The plotter's queue holds two lines, so it has taken some by then.
        let number = streamed.count() - self.random.below(2) as usize;
        let departure = Departure::Sending { number, within_line: true };
        self.leave_then(departure, |sender| sender.draw_streamed(&streamed, &mut Quiet))?;
        for _ in 0..self.random.below(300) {
            let status = self.status()?;
            if !self.watched.is_drawing() {
                return Err(format!("a drawing whose rest may come has ended: {status}").into());
            }
        }
        let interrupt = AtomicBool::new(false);
        let timeouts = Timeouts { query: OFTEN, ..Timeouts::default() };
        let rejoined = Sender::rejoin(self, timeouts, &interrupt)?;
        let (mut sender, taken) = rejoined.ok_or("nobody waits for strokes")?;
        let is_same = taken.id == streamed.id() && taken.all == streamed.targets();
        if !is_same || !(1..taken.all).contains(&taken.targets) || !streamed.skip(taken.targets) {
            return Err(format!("what has come of the drawing is {taken:?}").into());
        }
        sender.draw_streamed(&streamed, &mut Quiet)?;
        sender.end();
        if self.watched.take_ink()? != *ink {
            return Err("a drawing of two senders is another one".into());
        }
        Ok(())
    }
}
